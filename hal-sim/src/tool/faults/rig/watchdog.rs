//! The watchdog, and what is left of a machine that it reset.
//!
//! ```text
//! every 0.5 ms axes' ticks -> released; every eighth time axes' ticks, servo's ticks, housekeeping's rounds -> fed (`operation::Watch`)
//! 512 cycles of its oscillator (32 kHz nominal: 16 ms) without that: reset
//! ```
//!
//! A reset releases both bridges by hardware. The image that boots then knows no calibration and where no joint stands, is refused for
//! [`Cause::Watchdog`], and its servo does not begin before it was calibrated and referenced, so nothing of the leg runs on here.

use scarab::hal::AxisCommand;
use scarab::safety::{Cause, FaultCode};

use super::{PERIODS_PER_S, Rig};
use crate::faults::Injector;

/// Of the oscillator, from being fed to the reset: a divider of 4, 128 steps.
const CYCLES: f64 = 512.0;
/// Of the oscillator, Hz.
const NOMINAL_HZ: f64 = 32_000.0;

/// The watchdog.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Watchdog {
    /// Period in which it was fed, and those that it then waits.
    fed: u64,
    patience: u64,
    /// How many times its usual time that is.
    stretched: u64,
}

impl Watchdog {
    pub(super) fn new() -> Self {
        Self { fed: 0, patience: patience(NOMINAL_HZ), stretched: 1 }
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

    /// Takes over what the firmware wrote into the watchdog's registers.
    pub fn write_watchdog(&mut self) {
        if let Some(times) = self.board.registers.stretched.take() {
            let dog = &mut self.watchdog;
            dog.patience = dog.patience / dog.stretched * times;
            (dog.stretched, dog.fed) = (times, self.period);
        }
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
        let commands = self.board.registers.commands;
        self.board.watch(self.period);
        if self.is_blind(Some(FaultCode::CurrentTicks)) {
            self.board.registers.commands = commands;
        }
        if core::mem::take(&mut self.board.registers.fed) || self.is_blind(Some(FaultCode::Watchdog)) {
            self.watchdog.fed = self.period;
        }
        if self.period - self.watchdog.fed >= self.watchdog.patience {
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

    /// The image starts again, with these causes that forbid to enable.
    fn boot(&mut self, causes: u32) {
        self.leg = self.cold.clone();
        self.board.boot(&self.leg);
        self.board.signals.inhibit.raise_bits(causes);
        (self.output, self.axis_fault, self.edges) = (None, None, super::Edges::default());
        self.injector = Injector::new(0);
        self.watchdog.fed = self.period;
    }

    /// It was reset by its watchdog.
    #[must_use]
    pub fn is_restarted(&self) -> bool {
        self.restarted
    }
}
