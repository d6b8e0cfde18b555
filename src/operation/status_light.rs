//! Status light: shows without bus and probe that the processor runs, and what the board waits for.
//!
//! ```text
//! every 2 s   one flash     ready, drive off
//!             two           zeros unknown: take the reference
//!             three         not calibrated
//!             four          an inhibit reason (2170:1), or a fault of the drive
//!             five          new image on trial: confirm it
//! flickers                  a calibration is under way
//! on, short gaps            the drive is on
//! steady for more than 2 s  on or off: the processor does not run, or writes its flash
//! ```

use super::contacts::RATE_HZ;

const CYCLE_MS: u32 = 2000;
/// Interval and length of flashes.
const INTERVAL_MS: u32 = 300;
const FLASH_MS: u32 = 150;
/// Half a period of the flicker, and length of the gaps.
const FLICKER_MS: u32 = 100;

/// What the light shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum StatusLight {
    /// This many flashes.
    Flashes(u32),
    /// Flickers.
    Busy,
    /// On, with gaps.
    On,
}

/// State of the board that the light shows.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct LightInputs {
    /// The drive is switched on or enabled, or it stops.
    pub(crate) is_on: bool,
    /// A calibration is under way.
    pub(crate) is_calibrating: bool,
    /// An inhibit reason is set, or the drive has a fault.
    pub(crate) is_inhibited: bool,
    /// The image is on trial.
    pub(crate) is_on_trial: bool,
    /// All axes are calibrated.
    pub(crate) is_calibrated: bool,
    /// The zeros of the joints are known.
    pub(crate) is_referenced: bool,
}

impl StatusLight {
    /// Chooses what to show.
    pub(crate) const fn from_inputs(inputs: &LightInputs) -> Self {
        let LightInputs { is_on, is_calibrating, is_inhibited, is_on_trial, is_calibrated, is_referenced } =
            *inputs;
        match () {
            () if is_on => Self::On,
            () if is_calibrating => Self::Busy,
            () if is_inhibited => Self::Flashes(4),
            () if is_on_trial => Self::Flashes(5),
            () if !is_calibrated => Self::Flashes(3),
            () if !is_referenced => Self::Flashes(2),
            () => Self::Flashes(1),
        }
    }

    /// Whether the light is lit in a round of level 6.
    pub(crate) const fn is_lit(self, round: u32) -> bool {
        let ms = round % (CYCLE_MS * RATE_HZ / 1000) * (1000 / RATE_HZ);
        match self {
            Self::Flashes(count) => ms < count * INTERVAL_MS && ms % INTERVAL_MS < FLASH_MS,
            Self::Busy => ms % (2 * FLICKER_MS) < FLICKER_MS,
            Self::On => ms >= FLICKER_MS,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const READY: LightInputs = LightInputs {
        is_on: false,
        is_calibrating: false,
        is_inhibited: false,
        is_on_trial: false,
        is_calibrated: true,
        is_referenced: true,
    };

    /// Number of times that the light goes on in a cycle, and its share of the time in percent.
    fn seen(inputs: LightInputs) -> (usize, usize) {
        let light = StatusLight::from_inputs(&inputs);
        let rounds = CYCLE_MS * RATE_HZ / 1000;
        // The cycle repeats, so the round before the first is the last one.
        let rises =
            (0..rounds).filter(|round| light.is_lit(round + rounds) && !light.is_lit(round + rounds - 1));
        let lit = (0..rounds).filter(|round| light.is_lit(*round)).count();
        (rises.count(), 100 * lit / rounds as usize)
    }

    #[test]
    fn every_state_has_its_own_signal() {
        for (inputs, expected) in [
            (READY, (1, 7)),
            (LightInputs { is_referenced: false, ..READY }, (2, 15)),
            (LightInputs { is_calibrated: false, is_referenced: false, ..READY }, (3, 22)),
            (LightInputs { is_inhibited: true, is_on_trial: true, ..READY }, (4, 30)),
            (LightInputs { is_on_trial: true, is_calibrated: false, ..READY }, (5, 37)),
            (LightInputs { is_calibrating: true, is_calibrated: false, ..READY }, (10, 50)),
            (LightInputs { is_on: true, is_inhibited: true, ..READY }, (1, 95)),
        ] {
            assert_eq!(seen(inputs), expected, "{inputs:?}");
        }
    }
}
