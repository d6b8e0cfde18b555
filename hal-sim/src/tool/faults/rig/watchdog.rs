//! The watchdog, and what is left of a machine that it reset.
//!
//! ```text
//! every 0.5 ms axes' ticks -> `TickGuard` -> released
//! every 4 ms   axes' ticks, servo's ticks, housekeeping's rounds -> `CheckIns` -> fed
//! 512 cycles of its oscillator (32 kHz nominal: 16 ms) without that: reset
//! ```
//!
//! A reset releases both bridges by hardware. The image that boots then knows no calibration and where no joint stands, is refused for
//! [`Cause::Watchdog`], and its servo does not begin before it was calibrated and referenced, so nothing of the leg runs on here.

use scarab::hal::AxisCommand;
use scarab::safety::{Cause, CheckIns, FaultCode, GUARD_RATE_HZ, TickGuard};

use super::ports::Ports;
use super::{PERIODS_PER_S, Rig};
use crate::faults::Injector;

/// Between two looks at who has checked in.
const PERIODS_PER_LOOK: u64 = PERIODS_PER_S / 250;
/// Between two looks at the current ticks.
const PERIODS_PER_GUARD: u64 = PERIODS_PER_S / GUARD_RATE_HZ as u64;
/// Of the oscillator, from being fed to the reset: a divider of 4, 128 steps.
const CYCLES: f64 = 512.0;
/// Of the oscillator, Hz.
const NOMINAL_HZ: f64 = 32_000.0;

/// The watchdog and those that it waits for.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Watchdog<const N: usize> {
    /// Of the housekeeping.
    pub(super) rounds: u32,
    check_ins: CheckIns<4>,
    guard: TickGuard<N>,
    /// Period in which it was fed, and those that it then waits.
    fed: u64,
    patience: u64,
    /// How many times as long as usual that is.
    stretched: u64,
}

impl<const N: usize> Watchdog<N> {
    pub(super) fn new() -> Self {
        Self {
            rounds: 0,
            check_ins: CheckIns::new([0; 4]),
            guard: TickGuard::new(),
            fed: 0,
            patience: patience(NOMINAL_HZ),
            stretched: 1,
        }
    }
}

fn patience(hz: f64) -> u64 {
    (CYCLES / hz * PERIODS_PER_S as f64).ceil() as u64
}

impl<const N: usize, const B: usize> Rig<N, B> {
    /// What the watchdog's oscillator runs at, Hz: 17 to 47 kHz.
    pub fn set_oscillator(&mut self, hz: f64) {
        self.watchdog.patience = patience(hz) * self.watchdog.stretched;
    }

    /// So many times as long until it bites, counted from now; 1 is the usual.
    pub fn stretch(&mut self, times: u64) {
        let dog = &mut self.watchdog;
        dog.patience = dog.patience / dog.stretched * times;
        (dog.stretched, dog.fed) = (times, self.period);
    }

    /// The processor stands for so many periods, its flash being written: the plant goes on with every switch open, and the watchdog counts.
    pub fn stand_still(&mut self, periods: u64) {
        for _ in 0..periods {
            self.world.period(&[AxisCommand::RELEASED; N], 0.0);
        }
        self.period += periods;
        if self.period - self.watchdog.fed >= self.watchdog.patience {
            self.restart();
        }
    }

    /// At the end of a period.
    pub(super) fn watch(&mut self) {
        if self.period.is_multiple_of(PERIODS_PER_GUARD)
            && self.watchdog.guard.look(self.ports.ticks)
            && self.ports.causes & Cause::Storing.bit() == 0
            && !self.ports.is_blind(Some(FaultCode::CurrentTicks))
        {
            self.ports.causes |= Cause::CurrentTicks.bit();
            self.ports.commands = [AxisCommand::RELEASED; N];
        }
        let blind = self.ports.is_blind(Some(FaultCode::Watchdog));
        let dog = &mut self.watchdog;
        if self.period.is_multiple_of(PERIODS_PER_LOOK) {
            let [first, .., last] = self.ports.ticks.as_slice() else { return };
            if dog.check_ins.all([*first, *last, self.ports.servo_ticks, dog.rounds]) || blind {
                dog.fed = self.period;
            }
        }
        if self.period - dog.fed >= dog.patience {
            self.restart();
        }
    }

    /// What hung does so no more.
    fn restart(&mut self) {
        self.restarted = true;
        self.boot(Cause::Watchdog.bit());
    }

    /// The power was away and is back. What the operator's hands do goes on, and so does the leg.
    pub fn power_on(&mut self) {
        self.boot(0);
    }

    /// The image from its beginning, with what forbids to enable from the start.
    fn boot(&mut self, causes: u32) {
        let samples = self.sample.joints;
        self.ports = Ports { causes, period: self.period, ..Ports::new(samples) };
        let cold = &self.cold;
        (self.leg, self.loops) = (cold.leg.clone(), cold.loops);
        (self.keeper, self.round) = (cold.keeper.clone(), cold.round.clone());
        (self.output, self.told) = (None, None);
        self.injector = Injector::new(0);
        (self.watchdog.fed, self.watchdog.guard) = (self.period, TickGuard::new());
    }

    /// It was reset by its watchdog.
    #[must_use]
    pub fn is_restarted(&self) -> bool {
        self.restarted
    }
}
