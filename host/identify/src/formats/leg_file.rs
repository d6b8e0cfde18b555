//! Leg files: a leg in TOML, as users write it.
//!
//! Why a file: simulation and identification state their leg in one place that can be read, compared and
//! shared. Keys are an interface; unknown ones are errors. Every error names file, line and reason.
//!
//! | key | unit, meaning | default |
//! | --- | --- | --- |
//! | `name` | | required |
//! | `gravity` | m/s^2, base frame | required |
//! | `torque_noise_percent` | white noise in percent of mean absolute torque, see below | 0 |
//! | `accept_error_percent` | error of a held-out torque accepted beside noise, percent of its rms | 5 |
//! | `bandwidth_hz` | -3 dB frequency of the identification's low-pass | 8 |
//! | `pushes` | `{ per_minute, torque_nm, duration_s }`: random pushes by the wearer | none |
//! | `temperature_c` | temperature of the drives, degrees Celsius, if known | none |
//! | `side` | `"right"` or `"left"`: on the left the drives are mounted mirrored | right |
//! | `segments` | `{ shank_m, foot_m, wearer_kg, prior_wearer_kg }`, see below | none |
//! | `joint.name`, `joint.dh` | `dh = { alpha, a, d }`, modified D-H, rad and m | required |
//! | `direction`, `zero_offset_deg` | joint angle = direction * anatomical angle + zero offset | 1, 0 |
//! | `range_deg` | anatomical, lower and upper | -90, 90 |
//! | `speed_limit_deg_s`, `acceleration_limit_deg_s2`, `torque_limit_nm` | | 180, 2000, 100 |
//! | `torque_per_ampere` | N m/A at the joint | 1.5 |
//! | `current_limit_a` | limit of the drive | torque limit / torque per ampere |
//! | `drive_lag_s` | time constant of the current | 0.0005 |
//! | `encoder` | `{ side = "motor" or "joint", counts, ratio }` | motor, 8192, 50 |
//! | `current_noise_a` | standard deviation per logged 500 Hz sample | 0 |
//! | `current_offset_a`, `current_step_a` | error and conversion step of the current sensor | 0, 0 (none) |
//! | `outliers` | `{ percent, torque_nm }`: share of samples with an outlier, its largest error | none |
//! | `offset`, `rotor` | `"auto"`, `"on"`, `"off"`: estimate torque offset, rotor inertia | on, on |
//! | `offset` | or `{ within_nm = 0.2 }`: estimate it, known to be zero within this sigma | |
//! | `stribeck_model` | `"auto"`, `"on"`, `"off"`: estimate Stribeck friction | auto |
//! | `asymmetric_coulomb` | `"auto"`, `"on"`, `"off"`: one Coulomb level per direction | off |
//! | `spring`, `load_friction` | the same: spring beside the drive, friction by load; `replay` only | auto |
//! | `stribeck` | `{ static_nm, speed_rad_s }`: simulated static friction, speed of its decay | none |
//! | `truth`, `prior` | see below | none |
//! | `brake` | `{ release_ms, engage_ms }`: times of a holding brake on the board's output | none |
//! | `assist` | `{ friction, inertia, weight, periodic }`: assistance of the start button | none |
//! | `[joint.motor]`, `supply` | complete drive ([`MotorFile`], [`SupplyFile`]) | none, 48 V |
//!
//! `torque_noise_percent` refers to each joint's mean absolute torque, per logged 500 Hz sample. The noise
//! is added to the logged current only; `current_noise_a` comes on top. `outliers` refers to logged 500 Hz
//! samples of the current. `segments` describes the last two links as the thigh and shank of a wearer.
//!
//! Keys of `truth` and `prior` are
//! `{ mass, com, inertia_com, rotor_inertia, coulomb, viscous, offset, asymmetry }`; the last five
//! default to 0. `inertia_com` holds the tensor elements XX XY XZ YY YZ ZZ about the centre of
//! mass. All are in the joint's D-H frame with the D-H sign. Only a simulation needs `truth`.

pub mod assist;
pub mod check;
mod convert;
pub mod draft;
pub mod geometry;
mod image;
pub mod keys;
mod motor;
mod segments;
mod switch;

pub use image::{MissingForImage, MissingOfJoint};
pub use motor::{BrakeFile, MotorFile, SupplyFile};
pub use segments::{BodySide, SegmentsFile};
pub use switch::Switch;

use scarab::units::Hertz;
use scarab_base::error::FileError;
use scarab_base::toml_file;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::json;

use crate::formats::leg_file::assist::AssistFile;

/// Default leg.
pub const DEFAULT_LEG: &str = "x2-wearer-75kg";

/// Shipped legs by name, with their text.
pub const SHIPPED_LEGS: [(&str, &str); 6] = [
    (DEFAULT_LEG, include_str!("../../../legs/x2-wearer-75kg.toml")),
    ("x2-rough", include_str!("../../../legs/x2-rough.toml")),
    ("mujoco-leg", include_str!("../../../legs/mujoco-leg.toml")),
    ("dp-a0", include_str!("../../../legs/dp-a0.toml")),
    ("sp", include_str!("../../../legs/sp.toml")),
    ("paper-chain", include_str!("../../../legs/paper-chain.toml")),
];

/// Checked leg: 1 to 3 joints, physically consistent, limits in order.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LegFile {
    /// Name of the leg.
    pub name: String,
    /// Gravity's acceleration in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// Noise of the logged torque in percent of each joint's mean absolute torque.
    #[serde(default)]
    pub torque_noise_percent: f64,
    /// Frequency at which the low-pass of the identification is 3 dB down, Hz.
    #[serde(default = "default_bandwidth")]
    pub bandwidth_hz: f64,
    /// Error of a held-out torque that a replay accepts beside noise, percent of its root mean square.
    #[serde(default = "default_accept_error")]
    pub accept_error_percent: f64,
    /// The wearer's pushes.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub pushes: Option<PushesFile>,
    /// Temperature of the drives, degrees Celsius, if known.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub temperature_c: Option<f64>,
    /// Side of the body.
    #[serde(default, skip_serializing_if = "is_default")]
    pub side: BodySide,
    /// Segments of thigh and shank.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub segments: Option<SegmentsFile>,
    /// Supply of complete drives.
    #[serde(default, skip_serializing_if = "is_default")]
    pub supply: SupplyFile,
    /// Greatest current from the supply, A; `None` for no limit.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub supply_current_a: Option<f64>,
    /// Greatest current into the supply, A; `None` for a supply whose diode lets none in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub charge_current_a: Option<f64>,
    /// Holding brake on the board's output.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub brake: Option<BrakeFile>,
    /// Assistance of the start button.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub assist: Option<AssistFile>,
    /// Joints, proximal first.
    #[serde(rename = "joint")]
    pub joints: Vec<JointFile>,
}

/// Random pushes by the wearer.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct PushesFile {
    /// Mean number per minute.
    pub per_minute: f64,
    /// Largest peak, N m.
    pub torque_nm: f64,
    /// Mean duration, s.
    pub duration_s: f64,
}

/// One joint and the link beyond it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct JointFile {
    /// Name of the joint.
    pub name: String,
    /// Position of its frame in the previous one.
    pub dh: DhFile,
    /// 1 or -1: joint angle = direction * anatomical angle + zero offset.
    #[serde(default = "default_direction")]
    pub direction: i64,
    /// Joint angle at the anatomical zero, degrees.
    #[serde(default)]
    pub zero_offset_deg: f64,
    /// Anatomical range, degrees.
    #[serde(default = "default_range")]
    pub range_deg: [f64; 2],
    /// Speed limit, degrees per second.
    #[serde(default = "default_speed_limit")]
    pub speed_limit_deg_s: f64,
    /// Acceleration limit, degrees per second squared.
    #[serde(default = "default_acceleration_limit")]
    pub acceleration_limit_deg_s2: f64,
    /// Torque limit at the joint, N m.
    #[serde(default = "default_torque_limit")]
    pub torque_limit_nm: f64,
    /// Torque constant at the joint, N m/A.
    #[serde(default = "default_torque_per_ampere")]
    pub torque_per_ampere: f64,
    /// Limit of the drive, A; torque limit / torque per ampere unless given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub current_limit_a: Option<f64>,
    /// Time constant of the current, s.
    #[serde(default = "default_lag")]
    pub drive_lag_s: f64,
    /// Angle sensor.
    #[serde(default = "default_encoder")]
    pub encoder: EncoderFile,
    /// Standard deviation of the current per logged 500 Hz sample, A.
    #[serde(default)]
    pub current_noise_a: f64,
    /// Constant error of the current sensor, A.
    #[serde(default)]
    pub current_offset_a: f64,
    /// Conversion step of the current sensor, A; 0 for none.
    #[serde(default)]
    pub current_step_a: f64,
    /// Outliers of the measured current, simulated only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub outliers: Option<OutliersFile>,
    /// Whether a torque offset is estimated.
    #[serde(default = "always")]
    pub offset: Switch,
    /// Whether a rotor inertia is estimated.
    #[serde(default = "always")]
    pub rotor: Switch,
    /// Whether Stribeck friction is estimated.
    #[serde(default = "automatic")]
    pub stribeck_model: Switch,
    /// Whether Coulomb friction has a level for each direction.
    #[serde(default = "never", skip_serializing_if = "Switch::is_off")]
    pub asymmetric_coulomb: Switch,
    /// Whether a spring beside the drive is estimated from recordings.
    #[serde(default = "automatic", skip_serializing_if = "Switch::is_auto")]
    pub spring: Switch,
    /// Whether friction that grows with the load is estimated from recordings.
    #[serde(default = "automatic", skip_serializing_if = "Switch::is_auto")]
    pub load_friction: Switch,
    /// Static friction above Coulomb friction, simulated only.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub stribeck: Option<StribeckFile>,
    /// Parameters of the simulated leg.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub truth: Option<LinkParameters>,
    /// Parameters assumed before identification.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub prior: Option<LinkParameters>,
    /// Motor of a complete drive.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub motor: Option<MotorFile>,
}

/// Modified Denavit-Hartenberg parameters, rad and m.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DhFile {
    /// Twist, rad.
    pub alpha: f64,
    /// Length, m.
    pub a: f64,
    /// Offset along the axis, m.
    pub d: f64,
}

/// Difference from a right angle, or half a turn, that is taken for rounding, rad: as in 1.57 or 3.1416.
const ROUNDED_RAD: f64 = 1e-3;

impl DhFile {
    /// Twist with which the leg is computed, rad: a right angle or half a turn where the file rounds one. A
    /// fraction of a milliradian would only distinguish parameters that no motion shows.
    pub fn twist(&self) -> f64 {
        let quarters = (self.alpha / std::f64::consts::FRAC_PI_2).round();
        let right = quarters * std::f64::consts::FRAC_PI_2;
        if quarters != 0.0 && (self.alpha - right).abs() <= ROUNDED_RAD { right } else { self.alpha }
    }
}

/// Encoder of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct EncoderFile {
    /// Motor or joint side of the gear.
    pub side: Side,
    /// Counts per encoder turn.
    pub counts: u32,
    /// Encoder turns per joint turn.
    pub ratio: f64,
}

impl EncoderFile {
    /// Joint angle of one count, rad.
    pub fn step_rad(&self) -> f64 {
        core::f64::consts::TAU / (f64::from(self.counts) * self.ratio)
    }
}

/// Side of the gear.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "lowercase")]
pub enum Side {
    /// Encoder on the motor.
    Motor,
    /// Encoder on the joint.
    Joint,
}

/// Stribeck friction.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct StribeckFile {
    /// Breakaway torque, N m.
    pub static_nm: f64,
    /// Speed at which the surplus has fallen to 1/e, rad/s.
    pub speed_rad_s: f64,
}

/// Isolated outliers of the current.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OutliersFile {
    /// Share of the logged 500 Hz samples, percent.
    pub(crate) percent: f64,
    /// Largest error, either sign, N m at the joint.
    pub(crate) torque_nm: f64,
}

/// A link with rotor and friction, in the joint's D-H frame.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LinkParameters {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub com: [f64; 3],
    /// Tensor elements XX XY XZ YY YZ ZZ about the centre of mass, kg m^2.
    pub inertia_com: [f64; 6],
    /// Rotor inertia at the joint, kg m^2.
    #[serde(default)]
    pub rotor_inertia: f64,
    /// Coulomb friction, N m.
    #[serde(default)]
    pub coulomb: f64,
    /// Viscous friction, N m s/rad.
    #[serde(default)]
    pub viscous: f64,
    /// Torque offset, N m.
    #[serde(default)]
    pub offset: f64,
    /// Half the difference of Coulomb friction between growing and falling D-H angle, N m.
    #[serde(default, skip_serializing_if = "is_default")]
    pub asymmetry: f64,
}

#[cfg(test)]
impl LinkParameters {
    /// Sums M, HX, HY, ZZ about the joint.
    pub(crate) fn sums(&self) -> [f64; 4] {
        let [x, y, _] = self.com;
        [self.mass, self.mass * x, self.mass * y, self.inertia_com[5] + self.mass * (x * x + y * y)]
    }
}

/// Range of a joint without `range_deg`, anatomical, degrees.
pub const DEFAULT_RANGE_DEG: [f64; 2] = [-90.0, 90.0];

/// Speed limit of a joint without `speed_limit_deg_s`, degrees per second.
pub(crate) const DEFAULT_SPEED_LIMIT: f64 = 180.0;
/// Torque limit of a joint without `torque_limit_nm`, N m.
pub(crate) const DEFAULT_TORQUE_LIMIT: f64 = 100.0;
/// Torque constant of a joint without `torque_per_ampere`, N m/A, unless its torque needs too much current.
const DEFAULT_TORQUE_PER_AMPERE: f64 = 1.5;
/// Bandwidth of the position loop, which no leg file changes.
pub const POSITION_BANDWIDTH: Hertz = Hertz(6.0);

/// Writes the functions that serde asks for defaults.
macro_rules! defaults {
    ($($name:ident: $kind:ty = $value:expr;)*) => { $(fn $name() -> $kind { $value })* };
}
pub(crate) use defaults;

defaults! {
    default_bandwidth: f64 = 8.0;
    default_accept_error: f64 = 5.0;
    default_direction: i64 = 1;
    default_range: [f64; 2] = DEFAULT_RANGE_DEG;
    default_speed_limit: f64 = DEFAULT_SPEED_LIMIT;
    default_acceleration_limit: f64 = 2000.0;
    default_torque_limit: f64 = DEFAULT_TORQUE_LIMIT;
    default_torque_per_ampere: f64 = DEFAULT_TORQUE_PER_AMPERE;
    default_lag: f64 = 5e-4;
    default_encoder: EncoderFile = EncoderFile { side: Side::Motor, counts: 8192, ratio: 50.0 };
    always: Switch = Switch::On;
    automatic: Switch = Switch::Auto;
    never: Switch = Switch::Off;
}

/// A part of a leg file that states these keys only. Numbers that are not finite, which JSON lacks, must be
/// replaced by the caller.
fn with_defaults<T: DeserializeOwned>(stated: serde_json::Value) -> T {
    serde_json::from_value(stated)
        .unwrap_or_else(|fault| unreachable!("every other key has a default: {fault}"))
}

/// Whether a key has its type's default, so that it is not written.
fn is_default<T: Default + PartialEq>(value: &T) -> bool {
    *value == T::default()
}

impl JointFile {
    /// Joint with defaults for every other key.
    pub fn new(name: &str, dh: DhFile) -> Self {
        let stated = json!({ "name": name, "dh": DhFile::default() });
        Self { dh, ..with_defaults(stated) }
    }
}

impl LegFile {
    /// Leg of these joints with defaults for every other key.
    pub(crate) fn plain(name: &str, gravity: [f64; 3], joints: Vec<JointFile>) -> Self {
        let stated = json!({ "name": name, "gravity": [0.0, 0.0, 0.0], "joint": [] });
        Self { gravity, joints, ..with_defaults(stated) }
    }

    /// Index of a joint from its name or its number from 1; the error names the joints.
    ///
    /// # Errors
    /// No joint has this name or number.
    pub fn joint_index(&self, joint: &str) -> Result<usize, String> {
        let names: Vec<_> = self.joints.iter().map(|joint| joint.name.as_str()).collect();
        let number = joint.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
        let found = names.iter().position(|name| *name == joint);
        found.or(number.filter(|&number| number < names.len())).ok_or_else(|| {
            let (leg, count) = (&self.name, names.len());
            format!("`{joint}` is not a joint of `{leg}`: {} or 1 to {count}", names.join(", "))
        })
    }

    /// Loads a shipped leg by name, or the file at a path.
    pub fn load(name_or_path: &str) -> Result<Self, FileError> {
        let (text, file) = Self::text(name_or_path)?;
        Self::parse(&text, &file)
    }

    /// Text of a shipped leg or of a file, and its name in error messages.
    ///
    /// # Errors
    /// The file cannot be read.
    pub fn text(name_or_path: &str) -> Result<(String, String), FileError> {
        if let Some((name, text)) = SHIPPED_LEGS.iter().find(|(name, _)| *name == name_or_path) {
            return Ok(((*text).to_owned(), format!("{name} (shipped)")));
        }
        let text = std::fs::read_to_string(name_or_path).map_err(|fault| {
            let names = SHIPPED_LEGS.map(|(name, _)| name).join(", ");
            let reason = format!("cannot be read ({fault}), and is not the name of a shipped leg ({names})");
            FileError::new(name_or_path, reason)
        })?;
        Ok((text, name_or_path.to_owned()))
    }

    /// Parses TOML text; `file` is its name in error messages.
    pub fn parse(text: &str, file: &str) -> Result<Self, FileError> {
        let mut leg: Self = toml_file::parse(text, file)?;
        // An unknown drive delivers the stated torque.
        for (joint, is_stated) in
            leg.joints.iter_mut().zip(Self::joints_that_state(text, "torque_per_ampere"))
        {
            if !is_stated {
                joint.torque_per_ampere =
                    DEFAULT_TORQUE_PER_AMPERE.max(joint.torque_limit_nm / check::LARGEST_CURRENT_A);
            }
        }
        check::leg(&leg).map_err(|fault| fault.in_file(file, text))?;
        Ok(leg)
    }

    /// Whether each joint of a checked leg's text states this key. A default must not convert a recording.
    pub(crate) fn joints_that_state(text: &str, key: &str) -> Vec<bool> {
        let table = text.parse::<toml::Table>().unwrap_or_default();
        let joints = table.get("joint").and_then(toml::Value::as_array);
        joints.into_iter().flatten().map(|joint| joint.get(key).is_some()).collect()
    }

    /// One value for each joint. Fails if the leg does not have `N` joints.
    pub(crate) fn each_joint<T, const N: usize>(
        &self,
        of: impl FnMut(&JointFile) -> Result<T, FileError>,
    ) -> Result<[T; N], FileError> {
        let count = self.joints.len();
        let all: Vec<T> = self.joints.iter().map(of).collect::<Result<_, _>>()?;
        all.try_into().map_err(|_| self.error(format!("has {count} joints, not {N}")))
    }

    /// Error about this leg.
    pub fn error(&self, reason: impl Into<String>) -> FileError {
        FileError::new(&self.name, reason.into())
    }

    /// TOML text that [`LegFile::parse`] reads back unchanged.
    pub fn to_toml(&self) -> String {
        toml::to_string(self)
            .unwrap_or_else(|fault| unreachable!("a leg is plain tables and numbers: {fault}"))
    }
}
