//! Level 1: what stands around the leg's tick, 4 kHz.

use crate::checksum::Checksum;
use crate::safety::{Derating, DeratingRamps, FaultCode, SupplyWatch};
use crate::units::Volt;

/// Whether the joints' samples mean anything.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Gate {
    /// Not: nothing is asked of the axes, and what is asked of the leg is forgotten.
    Closed,
    /// Since now: whatever state the drive was left in, it begins off.
    Anew,
    /// As before.
    Open,
}

/// What was found around a tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Found {
    /// Gains or limits are not what they were; looked at every 64 ms.
    pub parameters: Option<FaultCode>,
    /// The supply dies.
    pub supply: Option<FaultCode>,
    /// What is left of the torques.
    pub derating: Derating,
}

/// What is kept from tick to tick.
#[derive(Clone, Debug, PartialEq)]
pub struct ServoRound {
    ticking: bool,
    tick: u32,
    /// Of gains and limits as they were made.
    checksum: Checksum,
    supply: SupplyWatch,
    ramps: DeratingRamps,
}

impl ServoRound {
    /// Nothing begun; `checksum` is of the servo's gains and limits as they were made.
    #[must_use]
    pub fn new(checksum: Checksum, ramps: DeratingRamps) -> Self {
        Self { ticking: false, tick: 0, checksum, supply: SupplyWatch::default(), ramps }
    }

    /// Before anything else of a tick; `begun` while both joints have a calibration and a zero.
    pub fn gate(&mut self, begun: bool) -> Gate {
        let before = core::mem::replace(&mut self.ticking, begun);
        match (begun, before) {
            (false, _) => Gate::Closed,
            (true, false) => Gate::Anew,
            (true, true) => Gate::Open,
        }
    }

    /// Before the leg's tick. The sum is asked for only where it is looked at.
    pub fn look(&mut self, sum: impl FnOnce() -> Checksum, bus: Volt, hottest_c: f32) -> Found {
        self.tick = self.tick.wrapping_add(1);
        let changed = self.tick & 0xFF == 0 && sum() != self.checksum;
        Found {
            parameters: changed.then_some(FaultCode::Parameters),
            supply: self.supply.look(bus).then_some(FaultCode::SupplyLost),
            derating: self.ramps.at(hottest_c, bus),
        }
    }

    /// Ticks since the beginning in which the gate was open.
    #[must_use]
    pub const fn tick(&self) -> u32 {
        self.tick
    }
}
