//! File of an exciting motion: written by a design, read by people, used by `identify`.
//!
//! TOML, `schema = 1`. Angles are the model's (D-H) joint angles in rad, which the firmware proves.
//! The limits beside them are anatomical and in degrees, as in a leg file. `identify` uses period,
//! cycles, blend and coefficients; `proved` and `expected` are information. Nothing in a file is
//! trusted: geometry and joint names must be the leg's, and the firmware proves the motion again.

use std::path::Path;

use scarab::motion::{ExcitationTable, HARMONICS, MotionError, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab_base::error::{FileError, ToolError};
use scarab_base::{files, toml_file};
use serde::{Deserialize, Serialize};

use crate::formats::leg_file::LegFile;
use crate::report::excite::ExpectedBase;

/// Version of the file.
pub const SCHEMA: u32 = 1;
/// Longest accepted motion, s.
pub const LONGEST_S: f64 = 120.0;
/// Largest accepted coefficient, rad.
const LARGEST_COEFFICIENT: f64 = 100.0;

/// An exciting motion of 1 to 3 joints.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Excitation {
    /// [`SCHEMA`].
    pub(crate) schema: u32,
    /// Name of the leg in the leg file of the design.
    pub leg: String,
    /// Fingerprint of that leg: [`geometry`].
    pub geometry: String,
    /// Duration of one cycle, s.
    pub period_s: f32,
    /// Cycles at full speed.
    pub cycles: u32,
    /// Duration of a blend between rest and full speed, s.
    pub blend_s: f32,
    /// Joints, proximal first.
    #[serde(rename = "joint")]
    pub joints: Vec<ExcitedJoint>,
    /// Expected result of an identification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub expected: Option<Expected>,
}

/// Fourier series of one joint.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExcitedJoint {
    /// Name in the leg file.
    pub name: String,
    /// Centre of the model's angle, rad.
    pub centre_rad: f32,
    /// Sine coefficients, rad, lowest harmonic first.
    pub sine_rad: Vec<f32>,
    /// Cosine coefficients, rad, lowest harmonic first.
    pub cosine_rad: Vec<f32>,
    /// Proved bounds.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub proved: Option<Proved>,
}

/// Proved anatomical bounds of one joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Proved {
    /// Range of the angle from the coefficients, degrees.
    pub angle_deg: [f64; 2],
    /// Speed from the coefficients, degrees per second.
    pub speed_deg_s: f64,
    /// Acceleration from the coefficients, blends included, degrees per second squared.
    pub acceleration_deg_s2: f64,
    /// Torque of the assumed leg, N m, margin and approach included.
    pub torque_nm: f64,
}

/// Expected result, and the leg it refers to.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Expected {
    /// `prior` or `truth` of the leg file.
    pub assumed: String,
    /// Standard deviation of each joint's logged torque, N m.
    pub torque_noise_nm: Vec<f64>,
    /// Expected base parameters.
    pub base_parameter: Vec<ExpectedBase>,
}

/// Fingerprint of the meaning of a motion's angles (FNV-1a, 64 bits). It covers names, Denavit-Hartenberg
/// numbers and anatomical convention of every joint. Gravity, limits and masses are checked separately.
pub fn geometry(leg: &LegFile) -> String {
    let mut hash = 0xcbf2_9ce4_8422_2325_u64;
    let mut add = |bytes: &[u8]| {
        for byte in bytes {
            hash = (hash ^ u64::from(*byte)).wrapping_mul(0x0100_0000_01b3);
        }
    };
    for joint in &leg.joints {
        add(joint.name.as_bytes());
        add(&[0]);
        add(&joint.direction.to_le_bytes());
        for number in [joint.dh.twist(), joint.dh.a, joint.dh.d, joint.zero_offset_deg] {
            // Adding zero makes -0 and 0 the same geometry.
            add(&(number + 0.0).to_bits().to_le_bytes());
        }
    }
    format!("{hash:016x}")
}

impl Excitation {
    /// Motion of a leg, without proof or expectation.
    pub fn from_table<const N: usize>(leg: &LegFile, table: &ExcitationTable<N>) -> Self {
        let joints = leg.joints.iter().enumerate().take(N).map(|(index, joint)| ExcitedJoint {
            name: joint.name.clone(),
            centre_rad: table.centre_rad[index],
            sine_rad: table.sine_rad[index].to_vec(),
            cosine_rad: table.cosine_rad[index].to_vec(),
            proved: None,
        });
        Self {
            schema: SCHEMA,
            leg: leg.name.clone(),
            geometry: geometry(leg),
            period_s: table.period_s,
            cycles: table.cycles,
            blend_s: table.blend_s,
            joints: joints.collect(),
            expected: None,
        }
    }

    /// Reads a file.
    ///
    /// # Errors
    /// Names the file, and the line if the error has one.
    pub fn load(path: &Path) -> Result<Self, ToolError> {
        let file = path.display().to_string();
        let motion: Self = toml_file::parse(&files::read_text(path)?, &file)?;
        motion.check().map_err(|reason| FileError::new(file, reason))?;
        Ok(motion)
    }

    fn check(&self) -> Result<(), String> {
        if self.schema != SCHEMA {
            return Err(format!("`schema` is {}, this program reads {SCHEMA}", self.schema));
        }
        if !(1..=3).contains(&self.joints.len()) {
            return Err(format!("`joint` occurs {} times; a leg has 1 to 3", self.joints.len()));
        }
        for joint in &self.joints {
            let (sines, cosines) = (joint.sine_rad.len(), joint.cosine_rad.len());
            if sines != cosines || !(1..=HARMONICS).contains(&sines) {
                return Err(format!(
                    "joint `{}`: {sines} sines and {cosines} cosines; needed are as many of both, 1 to {HARMONICS}",
                    joint.name
                ));
            }
            let numbers = joint.sine_rad.iter().chain(&joint.cosine_rad).chain([&joint.centre_rad]);
            for number in numbers.map(|number| f64::from(*number)) {
                if !(number.abs() <= LARGEST_COEFFICIENT) {
                    return Err(format!("joint `{}`: a coefficient is {number} rad", joint.name));
                }
            }
        }
        for (key, value) in [("period_s", self.period_s), ("blend_s", self.blend_s)] {
            if !(value > 0.0 && f64::from(value) <= LONGEST_S) {
                return Err(format!("`{key}` is {value}; it must be above 0 and at most {LONGEST_S}"));
            }
        }
        if self.cycles == 0 || self.duration_s() > LONGEST_S {
            return Err(format!(
                "{} cycles of {} s and two blends of {} s last {:.1} s; allowed are at least one cycle and at most {LONGEST_S} s",
                self.cycles,
                self.period_s,
                self.blend_s,
                self.duration_s()
            ));
        }
        Ok(())
    }

    /// Duration with blends, s.
    pub fn duration_s(&self) -> f64 {
        f64::from(self.period_s) * f64::from(self.cycles) + 2.0 * f64::from(self.blend_s)
    }

    /// Coefficients, after a check that they belong to this leg.
    ///
    /// # Errors
    /// Describes the difference.
    pub fn table<const N: usize>(&self, leg: &LegFile) -> Result<ExcitationTable<N>, String> {
        if self.joints.len() != N {
            return Err(format!(
                "the motion has {} joints, the leg `{}` has {N}",
                self.joints.len(),
                leg.name
            ));
        }
        if let Some((joint, own)) =
            self.joints.iter().zip(&leg.joints).find(|(joint, own)| joint.name != own.name)
        {
            return Err(format!(
                "the motion's joint `{}` is `{}` in the leg `{}`: not the same leg",
                joint.name, own.name, leg.name
            ));
        }
        if self.geometry != geometry(leg) {
            return Err(format!(
                "designed for the leg `{}` (geometry {}), not for `{}` (geometry {}): lengths, axes or zero differ",
                self.leg,
                self.geometry,
                leg.name,
                geometry(leg)
            ));
        }
        self.numbers().ok_or_else(|| "the motion has another number of joints".into())
    }

    /// Coefficients for a leg of `N` joints, unchecked.
    pub fn numbers<const N: usize>(&self) -> Option<ExcitationTable<N>> {
        let joints: &[ExcitedJoint; N] = self.joints.as_slice().try_into().ok()?;
        let filled =
            |stated: &[f32]| core::array::from_fn(|order| stated.get(order).copied().unwrap_or_default());
        Some(ExcitationTable {
            period_s: self.period_s,
            blend_s: self.blend_s,
            cycles: self.cycles,
            centre_rad: joints.each_ref().map(|joint| joint.centre_rad),
            sine_rad: joints.each_ref().map(|joint| filled(&joint.sine_rad)),
            cosine_rad: joints.each_ref().map(|joint| filled(&joint.cosine_rad)),
        })
    }

    /// Motion for a leg of `N` joints; not yet proved, nor checked against the leg.
    ///
    /// # Errors
    /// Describes the error, without the file's name.
    pub fn motion<const N: usize>(&self) -> Result<Periodic<N>, ToolError> {
        let table =
            self.numbers::<N>().ok_or_else(|| ToolError::input("the motion has another number of joints"))?;
        table.motion(SERVO_RATE_HZ).map_err(|error| ToolError::input(motion_error(error)))
    }

    /// TOML text that [`Excitation::load`] reads back unchanged.
    pub fn to_toml(&self) -> String {
        let body = toml::to_string(self)
            .unwrap_or_else(|fault| unreachable!("a motion is plain tables and numbers: {fault}"));
        format!("{HEADER}{body}")
    }
}

const HEADER: &str = "\
# An exciting motion, designed by `scarab excite`; `scarab identify --excitation` takes it.
#
# q(t) = centre + sum over k of sine[k] sin(2 pi k t / period) + cosine[k] cos(2 pi k t / period), k from 1;
# whole cycles between two blends in which the phase gathers speed and loses it. Angles are the model's (D-H)
# joint angles in rad; `proved` is anatomical: angles, speeds and accelerations from the coefficients, torque of the
# assumed leg with its margin. `expected` is what an identification from this motion should report.

";

/// Describes why the numbers do not define a motion.
pub(crate) fn motion_error(error: MotionError) -> String {
    match error {
        MotionError::NotFinite { joint } => format!("joint {}: a coefficient is not finite", joint + 1),
        MotionError::Period => "`period_s` is invalid".into(),
        MotionError::Blend => "`blend_s` is invalid".into(),
        MotionError::Cycles => "`cycles` is invalid".into(),
        MotionError::Rate { joint } | MotionError::Range { joint } => {
            format!("joint {}: its limits", joint + 1)
        }
    }
}
