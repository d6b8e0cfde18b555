//! Outputs of an advanced timer (RM0090 17.3.11 to 17.3.13): complementary outputs with dead time.
//!
//! ```text
//! reference  ____________|^^^^^^^^^^^^^^^^^|____________
//! output     _______________|^^^^^^^^^^^^^^|____________      on one dead time after the reference's rise
//! complement ^^^^^^^^^^^^|____________________|^^^^^^^^^      on one dead time after its fall
//! ```
//!
//! Without main output both are at their idle level, or not driven; then the gate drivers' pull-downs hold
//! them low.

use crate::peripherals::timer::{MOE, Timer};
use crate::time::{NEVER, Ticks};

/// Reference of one channel since its last edge.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Reference {
    level: bool,
    since: Ticks,
}

/// Pins of a half bridge: high side, low side.
pub type Pins = [bool; 2];

/// Outputs of channels 1 to 3.
#[derive(Clone, Debug, Default)]
pub struct Outputs {
    references: [Reference; 3],
    /// Whether each pin is connected to its channel.
    pub connected: [Pins; 3],
    main: bool,
}

/// Dead time of a register value, clocks of the dead-time generator (RM0090 17.4.18).
pub fn dead_time(code: u32) -> u64 {
    let code = u64::from(code & 0xFF);
    match code >> 5 {
        0..=3 => code,
        4 | 5 => (64 + (code & 0x3F)) * 2,
        6 => (32 + (code & 0x1F)) * 8,
        _ => (32 + (code & 0x1F)) * 16,
    }
}

impl Outputs {
    /// Follows the timer to an instant, after its registers changed or an edge was due. Returns the edges of
    /// references: rising ones less falling ones, and their number.
    pub fn follow(&mut self, timer: &Timer, now: Ticks) -> (i32, u32) {
        let main = timer.main_output() & MOE != 0;
        let (mut edges, mut count) = (0, 0);
        for (reference, level) in self.references.iter_mut().zip(timer.references(now)) {
            if level != reference.level {
                edges += if level { 1 } else { -1 };
                count += 1;
            }
            if level != reference.level || main && !self.main {
                *reference = Reference { level, since: now };
            }
        }
        self.main = main;
        if main { (edges, count) } else { (0, 0) }
    }

    /// Levels of the pins at an instant up to which the outputs followed.
    pub fn pins(&self, timer: &Timer, now: Ticks) -> [Pins; 3] {
        let dead = dead_time(timer.main_output()) * timer.dead_time_clock();
        core::array::from_fn(|channel| {
            let reference = self.references[channel];
            let levels = if self.main {
                driven(timer.outputs(channel), reference.level, now >= reference.since + dead)
            } else if timer.main_output() & 1 << 10 != 0 {
                timer.idle_levels(channel)
            } else {
                [false; 2]
            };
            core::array::from_fn(|side| levels[side] && self.connected[channel][side])
        })
    }

    /// Next instant at which a pin may change.
    pub fn next_change(&self, timer: &Timer, now: Ticks) -> Ticks {
        if !self.main {
            return NEVER;
        }
        let dead = dead_time(timer.main_output()) * timer.dead_time_clock();
        let mut next = NEVER;
        let counter = timer.runs().then(|| timer.counter_state(now));
        for (channel, reference) in self.references.iter().enumerate() {
            if reference.since + dead > now {
                next = next.min(reference.since + dead);
            }
            if let (Some(counter), Some([rise, fall])) = (&counter, timer.edges(channel)) {
                next = next.min(counter.next(if reference.level { fall } else { rise }));
            }
        }
        next
    }

    /// Whether the main output is on.
    pub const fn is_on(&self) -> bool {
        self.main
    }
}

/// Levels of both outputs from enable and polarity bits, the reference, and whether the dead time is over.
fn driven(bits: u32, reference: bool, settled: bool) -> Pins {
    let active = match (bits & 1 == 1, bits >> 2 & 1 == 1) {
        (true, true) => [reference && settled, !reference && settled],
        (true, false) => [reference, false],
        (false, true) => [false, reference],
        (false, false) => [false, false],
    };
    [active[0] ^ (bits >> 1 & 1 == 1), active[1] ^ (bits >> 3 & 1 == 1)]
}

#[cfg(test)]
pub(crate) mod tests {
    use super::*;
    use crate::findings::{Access, Findings};
    use crate::peripherals::timer::Kind;

    #[test]
    fn dead_time_codes_have_four_ranges() {
        assert_eq!([20, 127, 128, 191, 192, 224, 255].map(dead_time), [20, 127, 128, 254, 256, 512, 1008]);
    }

    /// A bridge that switches output A at `compare`, from the counter's zero at time 0 on.
    pub(crate) fn bridge(compare: u32) -> (Timer, Outputs) {
        let mut timer = Timer::new("TIM1", Kind::Advanced);
        timer.set_clock(2, 0);
        let mut findings = Findings::default();
        let setup = [
            (0x00, 0xE0),
            (0x2C, 3500),
            (0x18, 0x7878),
            (0x34, compare),
            (0x38, 3500),
            (0x3C, 3500),
            (0x14, 1),
            (0x20, 0x555),
            (0x44, MOE | 0xC00 | 20),
            (0x00, 0xE1),
        ];
        for (offset, value) in setup {
            timer.write(offset, value, 0, &mut Access { now: 0, findings: &mut findings });
        }
        (timer, Outputs { connected: [[true; 2]; 3], ..Outputs::default() })
    }
}
