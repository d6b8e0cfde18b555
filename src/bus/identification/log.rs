//! Queue of the 500 Hz log. A host holds a part of it, reads that part as one block, and releases it.
//!
//! Why a queue and not the last minute: a board has not enough memory for a minute. From a queue, a host that
//! reads during a motion receives every sample once. A sample that does not fit is counted and discarded, so
//! gaps are visible.
//!
//! ```text
//! hold     freezes the block: the samples waiting now, whatever arrives later
//! block    per sample: tick (u32), segment (u32), angles (N f32, rad), torques (N f32, N m)
//!          little-endian, signs of the model
//! release  discards the held samples
//! ```
//!
//! Memory: 8 + 8 N bytes a sample.

use crate::leg::{LoggedSample, Segment};

/// One stored sample.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Entry<const N: usize> {
    tick: u32,
    segment: u32,
    position_rad: [f32; N],
    torque_nm: [f32; N],
}

/// Samples that wait for a host, at most `L`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Log<const N: usize, const L: usize> {
    samples: [Entry<N>; L],
    first: usize,
    length: usize,
    held: usize,
    lost: u32,
}

/// Number of a segment: 0 none, 1 training, 2 tracking, 3 and above the validation motions.
const fn number(segment: Option<Segment>) -> u32 {
    match segment {
        None => 0,
        Some(Segment::Training) => 1,
        Some(Segment::Tracking) => 2,
        Some(Segment::Validation(motion)) => 3 + motion as u32,
    }
}

impl<const N: usize, const L: usize> Log<N, L> {
    /// Empty queue.
    pub(crate) const EMPTY: Self = Self {
        samples: [Entry { tick: 0, segment: 0, position_rad: [0.0; N], torque_nm: [0.0; N] }; L],
        first: 0,
        length: 0,
        held: 0,
        lost: 0,
    };

    /// Bytes per sample.
    pub(crate) const BYTES: usize = 8 + 8 * N;

    /// Appends a sample; counts it as lost if the queue is full.
    pub fn push(&mut self, logged: &LoggedSample<N>) {
        let index = (self.first + self.length) % L.max(1);
        match self.samples.get_mut(index) {
            Some(slot) if self.length < L => {
                *slot = Entry {
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

    /// Holds the waiting samples, or (`false`) releases the held ones.
    pub(crate) fn hold(&mut self, hold: bool) {
        if hold {
            self.held = self.length;
        } else {
            self.first = (self.first + self.held) % L.max(1);
            self.length -= self.held.min(self.length);
            self.held = 0;
        }
    }

    /// Returns the number of held samples.
    pub(crate) const fn held(&self) -> u32 {
        self.held as u32
    }

    /// Returns the number of waiting samples, held ones included.
    pub(crate) const fn waiting(&self) -> u32 {
        self.length as u32
    }

    /// Returns the number of lost samples.
    pub(crate) const fn lost(&self) -> u32 {
        self.lost
    }

    /// Copies bytes of the held block from `offset` on into `into`; returns the block's size in bytes.
    pub(crate) fn bytes(&self, offset: u32, into: &mut [u8]) -> u32 {
        for (position, byte) in (offset as usize..).zip(into) {
            let sample = position / Self::BYTES;
            if sample >= self.held {
                break;
            }
            let position = position % Self::BYTES;
            let entry = self.samples.get((self.first + sample) % L.max(1));
            *byte = entry.and_then(|entry| entry.byte(position)).unwrap_or(0);
        }
        (self.held * Self::BYTES) as u32
    }
}

impl<const N: usize> Entry<N> {
    fn byte(&self, position: usize) -> Option<u8> {
        let word = match position / 4 {
            0 => self.tick,
            1 => self.segment,
            word => {
                let (angles, torques) = (self.position_rad.iter(), self.torque_nm.iter());
                angles.chain(torques).nth(word - 2)?.to_bits()
            }
        };
        word.to_le_bytes().get(position % 4).copied()
    }
}
