//! The watchdog, and the state of a machine after its reset.
//!
//! ```text
//! every 0.5 ms                axes' ticks -> bridges off without them        (`operation::Watch`)
//! every eighth of these       ticks of axes and servo, housekeeping's rounds -> fed
//! 512 oscillator cycles later reset if not fed                               (32 kHz nominal: 16 ms)
//! ```
//!
//! A reset turns both bridges off in hardware. The new start has neither calibration nor reference and is
//! refused for [`InhibitReason::Watchdog`]. Its servo does not begin before calibration and reference, so the
//! leg's part of the firmware does not run here.

use hal_sim::faults::Injector;
use scarab::hal::AxisCommand;
use scarab::safety::{FaultCode, InhibitReason};

use crate::faulty_board::{PERIODS_PER_S, Rig};

/// Oscillator cycles from feeding to reset: a divider of 4, 128 steps.
const CYCLES: f64 = 512.0;
/// Nominal frequency of the oscillator, Hz.
const NOMINAL_HZ: f64 = 32_000.0;

/// Simulated watchdog.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Watchdog {
    /// Period of the last feed, and the periods from there to the reset.
    fed: u64,
    patience: u64,
    /// Factor of a stretched time.
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
    /// Sets the frequency of the watchdog's oscillator, Hz: 17 to 47 kHz.
    pub(crate) fn set_oscillator(&mut self, hz: f64) {
        self.watchdog.patience = patience(hz) * self.watchdog.stretched;
    }

    /// Applies the firmware's writes to the watchdog's registers.
    pub(crate) fn write_watchdog(&mut self) {
        if let Some(times) = self.board.registers.stretched.take() {
            let dog = &mut self.watchdog;
            dog.patience = dog.patience / dog.stretched * times;
            (dog.stretched, dog.fed) = (times, self.period);
        }
    }

    /// Stalls the processor for some periods, as a flash write does. The plant continues with every switch
    /// open, and the watchdog counts.
    pub(crate) fn stand_still(&mut self, periods: u64) {
        for _ in 0..periods {
            self.world.period(&[AxisCommand::OFF; N], 0.0);
        }
        self.period += periods;
        if self.period - self.watchdog.fed >= self.watchdog.patience {
            self.restart();
        }
    }

    /// Runs the watchdog at the end of a period.
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

    /// Resets the board; the injected hang ends.
    fn restart(&mut self) {
        self.restarted = true;
        self.boot(InhibitReason::Watchdog.bit());
    }

    /// Restores the power. The operator's contacts and the plant continue.
    pub(crate) fn power_on(&mut self) {
        self.boot(0);
    }

    /// Starts the image again, with these inhibit reasons.
    fn boot(&mut self, causes: u32) {
        self.leg = self.cold.clone();
        self.board.boot(&self.leg);
        self.board.signals.inhibit.raise_bits(causes);
        (self.output, self.axis_fault, self.edges) = (None, None, crate::faulty_board::Edges::default());
        self.injector = Injector::new(0);
        self.watchdog.fed = self.period;
    }

    /// Returns whether the watchdog has reset the board.
    pub(crate) fn is_restarted(&self) -> bool {
        self.restarted
    }
}
