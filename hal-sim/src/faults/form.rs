//! Forms of a signal fault, and its timing.
//!
//! ```text
//! off        0                                stuck     value when the fault began
//! garbage    uniform over the channel         rail      a given value
//! offset     value + o                        scale     middle + s (value - middle)
//! delayed    value of n readings ago          slow      y += share (value - y)
//! ```
//!
//! The channel afterwards rounds integer signals, and wraps or clamps them.

use crate::maths::nearest;
use rand_distr::{Distribution, StandardUniform};
use rand_xoshiro::Xoshiro256PlusPlus;

/// Readings stored for a delay.
const HISTORY: usize = 32;

/// Form of a signal fault.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Form {
    /// No signal: 0, an open contact, no pulse.
    Off,
    /// The last value for ever.
    Stuck,
    /// Random values over the channel's range.
    Garbage,
    /// Constant value; NaN where the channel can carry it.
    Rail(f64),
    /// Adds this value.
    Offset(f64),
    /// Scales the distance from the channel's middle.
    Scale(f64),
    /// Delays by this number of readings, at most 31.
    Delayed(u8),
    /// First-order lag: this share of the difference per reading.
    Slow(f64),
}

/// Timing: from a tick on, for some ticks; an intermittent fault acts in `on` of every `on + off` ticks.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Timing {
    /// First tick.
    pub begin: u64,
    /// Ticks from the first to the last.
    pub duration: u64,
    /// Ticks on.
    pub on: u64,
    /// Ticks off in between; 0 for a permanent fault.
    pub off: u64,
}

impl Timing {
    /// From a tick on, permanently.
    pub const fn from(begin: u64) -> Self {
        Self { begin, duration: u64::MAX, on: 1, off: 0 }
    }

    /// From a tick on, for a number of ticks.
    pub const fn lasting(begin: u64, duration: u64) -> Self {
        Self { begin, duration, on: 1, off: 0 }
    }

    /// Whether the fault acts at a tick.
    pub(crate) const fn holds(&self, tick: u64) -> bool {
        let Some(since) = tick.checked_sub(self.begin) else { return false };
        since < self.duration && (self.off == 0 || since % (self.on + self.off) < self.on)
    }
}

/// State of a faulted channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Memory {
    history: [f64; HISTORY],
    next: usize,
    lagged: f64,
    begun: bool,
}

impl Memory {
    pub(super) const EMPTY: Self = Self { history: [0.0; HISTORY], next: 0, lagged: 0.0, begun: false };

    /// Takes the true reading and returns the faulted one.
    pub(super) fn pass(
        &mut self,
        form: Form,
        acts: bool,
        value: f64,
        range: [f64; 2],
        generator: &mut Xoshiro256PlusPlus,
    ) -> f64 {
        if !self.begun {
            *self = Self { history: [value; HISTORY], next: 0, lagged: value, begun: true };
        }
        let newest = (self.next + HISTORY - 1) % HISTORY;
        if let Form::Slow(share) = form {
            self.lagged += if acts { share } else { 1.0 } * (value - self.lagged);
        }
        let stuck = form == Form::Stuck && acts;
        if !stuck {
            self.history[self.next] = value;
            self.next = (self.next + 1) % HISTORY;
        }
        if !acts {
            return value;
        }
        let [low, high] = range;
        let middle = 0.5 * (low + high);
        match form {
            Form::Off => 0.0,
            Form::Stuck => self.history[newest],
            Form::Garbage => {
                let share: f64 = StandardUniform.sample(generator);
                low + share * (high - low)
            }
            Form::Rail(rail) => rail,
            Form::Offset(offset) => value + offset,
            Form::Scale(scale) => middle + scale * (value - middle),
            Form::Delayed(readings) => {
                let back = usize::from(readings).min(HISTORY - 1);
                self.history[(self.next + 2 * HISTORY - 1 - back) % HISTORY]
            }
            Form::Slow(_) => self.lagged,
        }
    }
}

/// Nearest integer, wrapped to 16 bits.
pub(super) fn wrapped(value: f64) -> u16 {
    nearest(value) as u16
}

/// Nearest code of a 12-bit converter.
pub(super) fn code(value: f64) -> u16 {
    nearest(value).clamp(0, 4095) as u16
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand_core::SeedableRng;

    fn seen(form: Form, timing: Timing) -> [f64; 8] {
        let mut memory = Memory::EMPTY;
        let mut generator = Xoshiro256PlusPlus::seed_from_u64(1);
        core::array::from_fn(|tick| {
            let acts = timing.holds(tick as u64);
            memory.pass(form, acts, 10.0 + tick as f64, [0.0, 20.0], &mut generator)
        })
    }

    #[test]
    fn every_form_acts_from_its_tick_on_and_not_before() {
        let from = |form| seen(form, Timing::from(3));
        assert_eq!(from(Form::Off), [10.0, 11.0, 12.0, 0.0, 0.0, 0.0, 0.0, 0.0]);
        assert_eq!(from(Form::Stuck), [10.0, 11.0, 12.0, 12.0, 12.0, 12.0, 12.0, 12.0]);
        assert_eq!(from(Form::Rail(4.0))[2..5], [12.0, 4.0, 4.0]);
        assert_eq!(from(Form::Offset(-5.0))[2..5], [12.0, 8.0, 9.0]);
        assert_eq!(from(Form::Scale(2.0))[2..5], [12.0, 16.0, 18.0]);
        assert_eq!(from(Form::Delayed(2))[2..6], [12.0, 11.0, 12.0, 13.0]);
        assert_eq!(from(Form::Slow(0.5))[2..5], [12.0, 12.5, 13.25]);
        assert!(from(Form::Rail(f64::NAN))[3].is_nan());
        let garbage = from(Form::Garbage);
        assert!(garbage[3..].iter().all(|value| (0.0..20.0).contains(value)) && garbage[3] != garbage[4]);
    }

    #[test]
    fn a_fault_ends_and_an_intermittent_one_alternates() {
        let twice = seen(Form::Rail(0.0), Timing { begin: 1, duration: 5, on: 1, off: 2 });
        assert_eq!(twice, [10.0, 0.0, 12.0, 13.0, 0.0, 15.0, 16.0, 17.0]);
        assert_eq!(seen(Form::Off, Timing::lasting(6, 1))[5..], [15.0, 0.0, 17.0]);
    }
}
