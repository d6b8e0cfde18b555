//! Converts motor current to joint torque and back.
//!
//! ```text
//! motor torque = 3/2 pole pairs flux * current
//! joint torque = ratio * motor torque * loss   power from motor to joint:  loss = efficiency
//!                                              power from joint to motor:  loss = 1 / backdriving efficiency
//! ```
//!
//! The loss of a gear acts against the driving side. A motor that lifts a leg delivers less than ratio times
//! its torque, a motor that brakes it holds more. Within `band` of zero joint speed the loss changes
//! linearly between both. Otherwise the torque would jump with the sign of a noisy speed. At rest it is the
//! mean of both.
//!
//! Signs: current, torque and speed grow with the joint's flexion, as [`super::Axis`] provides.
//! Source: the usual one-parameter loss of a gear, e.g. Giberti, Cinquemani, Legnani (2010).
//! Known limits: losses that do not grow with load belong to friction, which identification estimates.

use crate::real::clamp;
use crate::units::{Ampere, NewtonMetre, NewtonMetrePerAmpere, RadianPerSecond, Weber};

/// Transmission from a motor to its joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Transmission {
    torque_per_ampere: f32,
    driving: f32,
    backdriving: f32,
    per_band: f32,
}

/// Constants of a transmission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TransmissionConfiguration {
    /// Pole pairs of the motor, 1..=64.
    pub pole_pairs: u8,
    /// Flux linkage of the magnets.
    pub flux: Weber,
    /// Motor turns per joint turn, at least 1.
    pub ratio: f32,
    /// Share of the motor's power that reaches the joint, above 0.3, at most 1.
    pub efficiency: f32,
    /// Share of the joint's power that reaches the motor, above 0.3, at most 1.
    pub backdriving_efficiency: f32,
    /// Joint speed beyond which the loss has its full direction, positive.
    pub band: RadianPerSecond,
}

impl Transmission {
    /// Returns `None` for constants outside their ranges.
    #[must_use]
    pub fn new(configuration: &TransmissionConfiguration) -> Option<Self> {
        let TransmissionConfiguration { pole_pairs, flux, ratio, efficiency, backdriving_efficiency, band } =
            *configuration;
        let torque_per_ampere = 1.5 * f32::from(pole_pairs) * flux.0 * ratio;
        let sensible = (1..=64).contains(&pole_pairs)
            && (1e-4..=1.0).contains(&flux.0)
            && (1.0..=1000.0).contains(&ratio)
            && efficiency > 0.3
            && efficiency <= 1.0
            && backdriving_efficiency > 0.3
            && backdriving_efficiency <= 1.0
            && (1e-3..=1.0).contains(&band.0);
        sensible.then(|| Self {
            torque_per_ampere,
            driving: efficiency,
            backdriving: 1.0 / backdriving_efficiency,
            per_band: 1.0 / band.0,
        })
    }

    /// Joint torque per motor current of a lossless gear.
    #[must_use]
    pub fn torque_per_ampere(&self) -> NewtonMetrePerAmpere {
        NewtonMetrePerAmpere(self.torque_per_ampere)
    }

    /// Joint torque of a current at a joint speed.
    #[must_use]
    pub fn torque(&self, current: Ampere, speed: RadianPerSecond) -> NewtonMetre {
        NewtonMetre(self.torque_per_ampere * current.0 * self.loss(current.0, speed))
    }

    /// Current for a joint torque at a joint speed.
    #[must_use]
    pub fn current(&self, torque: NewtonMetre, speed: RadianPerSecond) -> Ampere {
        Ampere(torque.0 / (self.torque_per_ampere * self.loss(torque.0, speed)))
    }

    /// Factor between torque and lossless torque; `effort` only gives the sign of torque or current.
    fn loss(&self, effort: f32, speed: RadianPerSecond) -> f32 {
        let towards_joint = clamp(speed.0 * self.per_band, -1.0, 1.0);
        let driving = if effort < 0.0 { -towards_joint } else { towards_joint };
        0.5 * ((1.0 + driving) * self.driving + (1.0 - driving) * self.backdriving)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Motor of 270 rpm/V with 7 pole pairs, gear of 50.
    const KNEE: TransmissionConfiguration = TransmissionConfiguration {
        pole_pairs: 7,
        flux: Weber(2.917e-3),
        ratio: 50.0,
        efficiency: 0.8,
        backdriving_efficiency: 0.75,
        band: RadianPerSecond(0.05),
    };

    fn knee() -> Transmission {
        Transmission::new(&KNEE).expect("usual")
    }

    #[test]
    fn the_joint_gets_less_when_driven_and_resists_more_when_it_drives() {
        let plain = 1.5 * 7.0 * 2.917e-3 * 50.0;
        assert!((knee().torque_per_ampere().0 - plain).abs() < 1e-5);
        for sign in [1.0, -1.0] {
            let torque =
                |speed: f32| knee().torque(Ampere(10.0 * sign), RadianPerSecond(speed * sign)).0 * sign;
            assert!((torque(1.0) - 10.0 * plain * 0.8).abs() < 1e-4);
            assert!((torque(-1.0) - 10.0 * plain / 0.75).abs() < 1e-4);
            // The gear's loss, motor power less joint power, is never negative.
            for speed in [-2.0, -0.1, 0.1, 2.0] {
                assert!((10.0 * plain - torque(speed)) * speed >= 0.0);
            }
        }
    }

    #[test]
    fn torque_does_not_jump_with_the_sign_of_a_small_speed() {
        let torque = |speed: f32| knee().torque(Ampere(10.0), RadianPerSecond(speed)).0;
        assert!((torque(1e-4) - torque(-1e-4)).abs() < 0.02 && torque(0.0) > torque(0.05));
    }

    #[test]
    fn current_and_torque_undo_each_other_in_every_quadrant() {
        for speed in [-1.0, -0.02, 0.0, 0.03, 1.0] {
            for current in [-40.0, -1.0, 0.0, 1.0, 40.0] {
                let speed = RadianPerSecond(speed);
                let back = knee().current(knee().torque(Ampere(current), speed), speed);
                assert!((back.0 - current).abs() < 1e-4, "{current} at {speed:?}: {back:?}");
            }
        }
    }

    #[test]
    fn absurd_transmissions_are_refused() {
        let refused = |change: fn(&mut TransmissionConfiguration)| {
            let mut configuration = KNEE;
            change(&mut configuration);
            Transmission::new(&configuration).is_none()
        };
        assert!(
            refused(|c| c.ratio = 0.0)
                && refused(|c| c.efficiency = 1.1)
                && refused(|c| c.efficiency = f32::NAN)
        );
        assert!(refused(|c| c.flux.0 = -1.0) && refused(|c| c.band.0 = 0.0) && refused(|c| c.pole_pairs = 0));
    }
}
