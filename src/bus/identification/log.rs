//! The 500 Hz log as a host takes it away: a queue, of which a host holds a part, reads it as one block and lets it go.
//!
//! Why a queue and not a memory of the last minute: a board has no room for that, and a host that reads while the leg moves gets
//! every sample once. What does not fit is counted, not overwritten, so that a hole is seen.
//!
//! ```text
//! hold   from now on the block is what waits, whatever comes meanwhile
//! block  of each sample: tick (u32), segment (u32), angles (N f32, rad), torques (N f32, N m); little-endian, model's signs
//! let go what was held is gone
//! ```
//!
//! Memory: 8 + 8 N bytes a sample.

use crate::leg::{LoggedSample, Segment};

/// One sample as it is kept.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Kept<const N: usize> {
    tick: u32,
    segment: u32,
    position_rad: [f32; N],
    torque_nm: [f32; N],
}

/// Samples that wait for a host, at most `L`.
#[derive(Clone, Debug, PartialEq)]
pub struct Log<const N: usize, const L: usize> {
    samples: [Kept<N>; L],
    first: usize,
    length: usize,
    held: usize,
    lost: u32,
}

/// 0 none, 1 identified from, 2 tracked, 3 and on the motions that are predicted.
const fn number(segment: Option<Segment>) -> u32 {
    match segment {
        None => 0,
        Some(Segment::Training) => 1,
        Some(Segment::Tracking) => 2,
        Some(Segment::Validation(motion)) => 3 + motion as u32,
    }
}

impl<const N: usize, const L: usize> Log<N, L> {
    /// Nothing waits.
    pub const EMPTY: Self = Self {
        samples: [Kept { tick: 0, segment: 0, position_rad: [0.0; N], torque_nm: [0.0; N] }; L],
        first: 0,
        length: 0,
        held: 0,
        lost: 0,
    };

    /// Bytes of a sample.
    pub const BYTES: usize = 8 + 8 * N;

    /// A sample of the log; one that does not fit is lost.
    pub fn push(&mut self, logged: &LoggedSample<N>) {
        let place = (self.first + self.length) % L.max(1);
        match self.samples.get_mut(place) {
            Some(slot) if self.length < L => {
                *slot = Kept {
                    tick: logged.sample.tick,
                    segment: number(logged.segment),
                    position_rad: logged.sample.position_rad,
                    torque_nm: logged.sample.torque_nm,
                };
                self.length += 1;
            }
            _ => self.lost = self.lost.saturating_add(1),
        }
    }

    /// What waits is held, or (`false`) what was held is let go.
    pub fn hold(&mut self, hold: bool) {
        if hold {
            self.held = self.length;
        } else {
            self.first = (self.first + self.held) % L.max(1);
            self.length -= self.held.min(self.length);
            self.held = 0;
        }
    }

    /// Samples that are held.
    #[must_use]
    pub const fn held(&self) -> u32 {
        self.held as u32
    }

    /// Samples that wait.
    #[must_use]
    pub const fn waiting(&self) -> u32 {
        self.length as u32
    }

    /// Samples that found no room.
    #[must_use]
    pub const fn lost(&self) -> u32 {
        self.lost
    }

    /// The block's bytes from `offset` on, as many as fit; how many it has.
    pub fn bytes(&self, offset: u32, into: &mut [u8]) -> u32 {
        for (place, byte) in (offset as usize..).zip(into) {
            let sample = place / Self::BYTES;
            if sample >= self.held {
                break;
            }
            let place = place % Self::BYTES;
            let kept = self.samples.get((self.first + sample) % L.max(1));
            *byte = kept.and_then(|kept| kept.byte(place)).unwrap_or(0);
        }
        (self.held * Self::BYTES) as u32
    }
}

impl<const N: usize> Kept<N> {
    fn byte(&self, place: usize) -> Option<u8> {
        let word = match place / 4 {
            0 => self.tick,
            1 => self.segment,
            word => {
                let (angles, torques) = (self.position_rad.iter(), self.torque_nm.iter());
                angles.chain(torques).nth(word - 2)?.to_bits()
            }
        };
        word.to_le_bytes().get(place % 4).copied()
    }
}
