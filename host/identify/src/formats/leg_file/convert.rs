//! Converts a leg file to the parameters of the plant.

use hal_sim::description::{
    BodyDescription, CurrentSensorDescription, DenavitHartenberg, DriveDescription, EncoderDescription,
    FrictionDescription, JointDescription, LegDescription, OutlierDescription, PushDescription, Stribeck,
};
use scarab_base::error::FileError;

use crate::formats::leg_file::{BodySide, EncoderFile, JointFile, LegFile, LinkParameters, PushesFile, Side};

/// Distance of the simulated mechanical end stops from the range, degrees: wide enough for the default leg,
/// which hangs at its anatomical zero.
pub(crate) const END_STOP_DEG: f64 = 7.0;

/// Mechanical end stops of a joint with this range, rad.
fn stops([low, high]: [f64; 2]) -> [f64; 2] {
    [low - END_STOP_DEG, high + END_STOP_DEG].map(f64::to_radians)
}

impl LegFile {
    /// Description of the simulated leg. Its sensors have `current_noise_a` only: `torque_noise_percent`
    /// refers to a motion, for which the caller adds it with `World::set_current_noise`. Fails if the leg
    /// does not have `N` joints or a joint has no `truth`.
    pub fn description<const N: usize>(&self) -> Result<LegDescription<N>, FileError> {
        let described = |joint: &JointFile| {
            let truth = joint.truth.as_ref().ok_or_else(|| {
                self.error(format!("joint `{}` has no `truth`: the leg cannot be simulated; `replay` identifies from a recording", joint.name))
            })?;
            Ok(joint.description(truth))
        };
        Ok(LegDescription {
            gravity: self.gravity,
            joints: self.each_joint(described)?,
            mirrored: self.side == BodySide::Left,
            pushes: self.pushes.as_ref().map(PushesFile::description),
        })
    }

    /// Replaces the noise by this standard deviation of each joint's logged torque, N m.
    pub fn with_torque_noise(mut self, noise_nm: &[f64]) -> Self {
        self.torque_noise_percent = 0.0;
        for (joint, noise) in self.joints.iter_mut().zip(noise_nm) {
            joint.current_noise_a = noise / joint.torque_per_ampere;
        }
        self
    }
}

impl EncoderFile {
    /// At the joint the ratio of a faster encoder is part of its counts.
    fn description(&self) -> EncoderDescription {
        let (counts, ratio) = (f64::from(self.counts), self.ratio);
        match self.side {
            Side::Motor => EncoderDescription { counts, ratio },
            Side::Joint => EncoderDescription { counts: counts * ratio, ratio: 1.0 },
        }
    }
}

impl JointFile {
    /// Limit of the drive's current, A.
    pub fn current_limit(&self) -> f64 {
        self.current_limit_a.unwrap_or(self.torque_limit_nm / self.torque_per_ampere)
    }

    /// Lower of torque limit and current limit, N m.
    pub fn torque_cap(&self) -> f64 {
        self.torque_limit_nm.min(self.current_limit() * self.torque_per_ampere)
    }

    fn description(&self, truth: &LinkParameters) -> JointDescription {
        JointDescription {
            frame: DenavitHartenberg { alpha: self.dh.twist(), a: self.dh.a, d: self.dh.d },
            direction: self.direction as f64,
            zero_offset: self.zero_offset_deg.to_radians(),
            body: BodyDescription { mass: truth.mass, com: truth.com, inertia_com: truth.inertia_com },
            rotor_inertia: truth.rotor_inertia,
            stops: Some(stops(self.range_deg)),
            friction: FrictionDescription {
                coulomb: truth.coulomb,
                viscous: truth.viscous,
                // Friction of coulomb + asymmetry one way and coulomb - asymmetry the other is equivalent
                // to symmetric friction of coulomb and a constant torque. This holds moving and at rest.
                offset: truth.offset + truth.asymmetry,
                stribeck: self.stribeck.map(|stribeck| Stribeck {
                    static_level: stribeck.static_nm,
                    speed: stribeck.speed_rad_s,
                }),
            },
            drive: DriveDescription {
                torque_per_ampere: self.torque_per_ampere,
                current_limit: self.current_limit(),
                lag: self.drive_lag_s,
            },
            encoder: self.encoder.description(),
            current_sensor: CurrentSensorDescription {
                noise: self.current_noise_a,
                offset: self.current_offset_a,
                step: self.current_step_a,
                outliers: self.outliers.map(|outliers| OutlierDescription {
                    share: outliers.percent / 100.0,
                    current: outliers.torque_nm / self.torque_per_ampere,
                }),
            },
        }
    }
}

impl PushesFile {
    /// Pushes as the plant takes them.
    pub fn description(&self) -> PushDescription {
        PushDescription { rate: self.per_minute / 60.0, torque: self.torque_nm, duration: self.duration_s }
    }
}
