//! Keys `[joint.motor]` and `supply` of a complete drive.
//!
//! The magnets' flux is not a key. It follows from the torque constant:
//! `torque_per_ampere = 1.5 pole_pairs flux ratio`. Both drives of a leg thus make the same torque
//! from the same current. Bridge, shunts and converter are those of the board
//! ([`hal_sim::drive::description`]).

use hal_sim::drive::description::{
    AS5047P_ERROR, AxisDescription, BridgeDescription, CompleteDescription, CounterDescription,
    JointEncoderDescription, MotorDescription, ShuntDescription, SupplyDescription, ThermistorDescription,
    Wiring,
};
use scarab::board::odrive_v3_6::settings::drives;
use scarab::leg::{AbsoluteEncoders, CounterDirection};
use scarab::safety::thermistor::{OPEN, SHORTED};
use scarab::safety::{BrakeDelays, SupplyLimits, Thermistor, WindingRating};
use scarab::units::{Ampere, Ohm, Weber};
use scarab_base::error::FileError;
use scarab_base::toml_file::Fault;
use serde::{Deserialize, Serialize};

use crate::formats::leg_file::check::KeyLocation;
use crate::formats::leg_file::{JointFile, LegFile, Side, defaults, is_default};

/// Least time constant of a winding, s; below it the board cannot measure an inductance within its
/// PWM periods.
const LEAST_TIME_CONSTANT_S: f64 = 80e-6;
/// Range of the supply voltage without load, V. The board's bridges switch from 20 V on, and its
/// brake resistor begins to conduct at 50 V.
const SUPPLY_V: [f64; 2] = [22.0, 50.0];
/// Reading of a simulated joint encoder at the joint's zero, degrees.
const JOINT_READING_DEG: f64 = 77.0;
/// Most pole pairs of a motor with an AS5047P.
const AS5047P_PAIRS: u32 = 14;
/// Largest ratio at which an encoder at the joint tells the motor turns apart: its errors are below a quarter
/// of one.
const MOST_RATIO: f64 = 80.0;
/// Largest angle from the zero that an encoder at the joint measures, degrees, with a margin.
const MOST_RANGE_DEG: f64 = 170.0;
/// Counts per turn of an AS5047P.
const AS5047P_COUNTS: [u32; 2] = [4000, 4096];
/// Time constant of a simulated thermistor as a share of its winding's.
const THERMISTOR_LAG: f64 = 0.05;
/// Temperatures that a thermistor must read: down to this one, up to so much above the winding's limit.
const COLDEST_C: f64 = -20.0;
const THERMISTOR_RESERVE_K: f64 = 20.0;
/// Range of a 16-bit counter.
const MOST_COUNTS: u32 = 1 << 16;

/// Motor of a joint.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotorFile {
    /// Electrical turns per turn of the rotor.
    pub pole_pairs: u32,
    /// Resistance of one phase, ohm.
    pub resistance_ohm: f64,
    /// Inductance along the magnets' axis, microhenry.
    pub inductance_d_uh: f64,
    /// Inductance across the magnets' axis, microhenry.
    pub inductance_q_uh: f64,
    /// Peak of the cogging torque at the rotor, N m.
    #[serde(default)]
    pub(crate) cogging_nm: f64,
    /// Periods of the cogging torque per turn.
    #[serde(default = "default_cogging_periods")]
    pub(crate) cogging_periods: u32,
    /// Electrical angle at the joint's anatomical zero, degrees.
    #[serde(default)]
    pub(crate) electrical_zero_deg: f64,
    /// Rotor angle of the encoder's index pulse, degrees.
    #[serde(default)]
    pub(crate) index_deg: f64,
    /// Thermal resistance from winding to ambient, K/W.
    #[serde(default = "default_thermal_resistance")]
    pub thermal_resistance_k_w: f64,
    /// Thermal time constant of the winding, s.
    #[serde(default = "default_thermal_time")]
    pub thermal_time_s: f64,
    /// Highest ambient temperature of the motor, degrees Celsius.
    #[serde(default = "default_ambient")]
    pub ambient_c: f64,
    /// Temperature of the winding at which no torque is left, degrees Celsius.
    #[serde(default = "default_winding_limit")]
    pub winding_limit_c: f64,
    /// Thermistor in the winding, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub thermistor: Option<ThermistorFile>,
    /// Permitted travel of a calibration, motor turns; `None` for the usual one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub calibration_turns: Option<f64>,
    /// Whether the encoder is an AS5047P that is also read by SPI; it has no index then.
    #[serde(default, skip_serializing_if = "is_default")]
    pub absolute_encoder: bool,
    /// AS5047P at the joint, if there is one.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub joint_encoder: Option<JointEncoder>,
}

/// Thermistor in a winding, from the board's pin to ground, and the resistor from the pin to 3.3 V.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ThermistorFile {
    /// Resistor from the pin to 3.3 V, ohm.
    pub(crate) pull_up_ohm: f64,
    /// Resistance of the thermistor at 25 degrees Celsius, ohm.
    pub(crate) r25_ohm: f64,
    /// Constant beta of its data sheet, K.
    pub(crate) beta_k: f64,
}

/// Direction of an absolute encoder at a joint.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum JointEncoder {
    /// Its angle grows with the counts of the motor's encoder.
    WithCounter,
    /// Its angle falls while the counts grow.
    AgainstCounter,
}

defaults! {
    default_cogging_periods: u32 = 84;
    default_thermal_resistance: f64 = 1.0;
    default_thermal_time: f64 = 300.0;
    default_ambient: f64 = 40.0;
    default_winding_limit: f64 = 100.0;
}

/// Supply of the board.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SupplyFile {
    /// Voltage without load, V.
    pub voltage_v: f64,
    /// Resistance of source and cable, ohm.
    pub resistance_ohm: f64,
    /// Capacitance of the bus, microfarad.
    pub capacitance_uf: f64,
    /// Brake resistor, ohm.
    pub brake_ohm: f64,
}

/// Times of a holding brake on the board's output, ms.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BrakeFile {
    /// From the command until it is open.
    pub release_ms: f64,
    /// From the command until it is closed.
    pub engage_ms: f64,
}

impl Default for SupplyFile {
    fn default() -> Self {
        let board = SupplyDescription::default();
        Self {
            voltage_v: board.voltage,
            resistance_ohm: board.resistance,
            capacitance_uf: 1e6 * board.capacitance,
            brake_ohm: board.brake_resistance,
        }
    }
}

impl SupplyFile {
    /// Description of the simulated supply.
    pub fn description(&self) -> SupplyDescription {
        SupplyDescription {
            voltage: self.voltage_v,
            resistance: self.resistance_ohm,
            capacitance: 1e-6 * self.capacitance_uf,
            brake_resistance: self.brake_ohm,
            ..SupplyDescription::default()
        }
    }

    pub(super) fn check(&self) -> Result<(), Fault> {
        let location = KeyLocation { joint: None, table: Some("supply") };
        let [low, high] = SUPPLY_V;
        if !(low..=high).contains(&self.voltage_v) {
            let complaint = format!(
                "is {}, outside {low}..{high}: the board's bridges switch from 20 V on, and from 50 V on its brake resistor would dissipate the supply's power",
                self.voltage_v
            );
            return Err(location.fault("voltage_v", &complaint));
        }
        location.within("resistance_ohm", self.resistance_ohm, 0.001, 10.0)?;
        location.within("capacitance_uf", self.capacitance_uf, 50.0, 1e6)?;
        location.within("brake_ohm", self.brake_ohm, 0.1, 1000.0)
    }
}

impl MotorFile {
    /// Motor of the class of ODrive's D5065 with 270 rpm/V: 8.27/270 = 0.0306 N m/A, 7 pole pairs and 12
    /// slots, at most 65 A. Resistance and inductance are typical of such outrunners (15..40 mohm, 9..35
    /// uH). Cogging (1 % of the greatest torque), saliency and thermal values are our assumptions.
    pub(crate) const D5065_CLASS: Self = Self {
        pole_pairs: 7,
        resistance_ohm: 0.039,
        inductance_d_uh: 15.0,
        inductance_q_uh: 17.0,
        cogging_nm: 0.017,
        cogging_periods: 84,
        electrical_zero_deg: 40.0,
        index_deg: 0.0,
        thermal_resistance_k_w: 1.0,
        thermal_time_s: 300.0,
        ambient_c: 40.0,
        winding_limit_c: 100.0,
        thermistor: None,
        calibration_turns: None,
        absolute_encoder: false,
        joint_encoder: None,
    };

    pub(super) fn check(&self, number: usize, joint: &JointFile) -> Result<(), Fault> {
        let location = KeyLocation { joint: Some((number, &joint.name)), table: Some("motor") };
        location.within("pole_pairs", f64::from(self.pole_pairs), 1.0, 64.0)?;
        location.within("resistance_ohm", self.resistance_ohm, 0.001, 10.0)?;
        let millisecond = 1e3 * LEAST_TIME_CONSTANT_S;
        for (key, inductance) in
            [("inductance_d_uh", self.inductance_d_uh), ("inductance_q_uh", self.inductance_q_uh)]
        {
            location.within(key, inductance, 1.0, 1e5)?;
            if inductance * 1e-6 / self.resistance_ohm < LEAST_TIME_CONSTANT_S {
                let complaint = format!(
                    "is {inductance}: with {} ohm its time constant is below {millisecond} ms, too short for the board to measure",
                    self.resistance_ohm
                );
                return Err(location.fault(key, &complaint));
            }
        }
        location.within("cogging_nm", self.cogging_nm, 0.0, 10.0)?;
        location.within("cogging_periods", f64::from(self.cogging_periods), 1.0, 10_000.0)?;
        location.within("electrical_zero_deg", self.electrical_zero_deg, -360.0, 360.0)?;
        location.within("index_deg", self.index_deg, -360.0, 360.0)?;
        location.within("thermal_resistance_k_w", self.thermal_resistance_k_w, 0.01, 100.0)?;
        location.within("thermal_time_s", self.thermal_time_s, 1.0, 1e5)?;
        location.within("ambient_c", self.ambient_c, -40.0, 100.0)?;
        // The derating takes the last 20 degrees.
        location.within("winding_limit_c", self.winding_limit_c, self.ambient_c + 30.0, 250.0)?;
        if let Some(thermistor) = &self.thermistor {
            thermistor.check(&location, self.winding_limit_c)?;
        }
        if let Some(turns) = self.calibration_turns {
            // Rounded for the message.
            let least = (1e3 * f64::from(drives::least_travel_turns(self.pole_pairs as u8))).round() / 1e3;
            location.within("calibration_turns", turns, least, 2.0)?;
        }
        let whole = KeyLocation { joint: location.joint, table: None };
        if joint.encoder.side != Side::Motor || joint.encoder.counts > MOST_COUNTS {
            let complaint = format!("needs an encoder at the motor with at most {MOST_COUNTS} counts");
            return Err(whole.fault("motor", &complaint));
        }
        self.check_encoders(&location, joint)?;
        let flux = self.flux(joint);
        if !(1e-4..=1.0).contains(&flux) {
            let complaint = format!(
                "has a flux of {flux:.6} V s by torque_per_ampere, pole_pairs and encoder.ratio, outside 0.0001..1"
            );
            return Err(whole.fault("motor", &complaint));
        }
        Ok(())
    }

    fn check_encoders(&self, location: &KeyLocation<'_>, joint: &JointFile) -> Result<(), Fault> {
        let (counts, ratio, pairs) = (joint.encoder.counts, joint.encoder.ratio, self.pole_pairs);
        if self.absolute_encoder && !AS5047P_COUNTS.contains(&counts) {
            let complaint = format!(
                "is true, but `encoder.counts` is {counts}: an AS5047P has 4000 counts per turn, or 4096"
            );
            return Err(location.fault("absolute_encoder", &complaint));
        }
        if self.absolute_encoder && pairs > AS5047P_PAIRS {
            let complaint = format!(
                "is true, but `pole_pairs` is {pairs}: the encoder's error of 0.8 degrees permits at most {AS5047P_PAIRS}"
            );
            return Err(location.fault("absolute_encoder", &complaint));
        }
        if self.joint_encoder.is_some() && ratio > MOST_RATIO {
            let complaint =
                format!("cannot tell the motor turns apart at `encoder.ratio` {ratio}: at most {MOST_RATIO}");
            return Err(location.fault("joint_encoder", &complaint));
        }
        if self.joint_encoder.is_some() && joint.range_deg.iter().any(|end| end.abs() > MOST_RANGE_DEG) {
            let complaint =
                format!("measures within a turn: `range_deg` must lie within {MOST_RANGE_DEG} degrees");
            return Err(location.fault("joint_encoder", &complaint));
        }
        Ok(())
    }

    /// Flux linkage of the magnets, V s.
    pub(crate) fn flux(&self, joint: &JointFile) -> f64 {
        joint.torque_per_ampere / (1.5 * f64::from(self.pole_pairs) * joint.encoder.ratio)
    }

    /// Permitted travel of a calibration, motor turns.
    pub fn calibration_turns(&self) -> f32 {
        let usual = drives::usual_travel_turns(self.pole_pairs as u8);
        self.calibration_turns.map_or(usual, |turns| turns as f32)
    }

    /// Motor, encoders and gear for the firmware.
    pub fn for_firmware(&self, joint: &JointFile) -> scarab::leg::MotorDescription {
        scarab::leg::MotorDescription {
            pole_pairs: self.pole_pairs as u8,
            flux: Weber(self.flux(joint) as f32),
            counts_per_turn: joint.encoder.counts,
            ratio: joint.encoder.ratio as f32,
            winding: self.winding(),
            thermistor: self.thermistor.as_ref().map(ThermistorFile::for_firmware),
            calibration_turns: self.calibration_turns(),
            absolute: AbsoluteEncoders {
                rotor: self.absolute_encoder,
                joint: self.joint_encoder.map(|direction| match direction {
                    JointEncoder::WithCounter => CounterDirection::Up,
                    JointEncoder::AgainstCounter => CounterDirection::Down,
                }),
            },
        }
    }

    /// Thermal constants for the firmware.
    pub fn winding(&self) -> WindingRating {
        WindingRating::new(
            Ohm(self.resistance_ohm as f32),
            self.thermal_resistance_k_w as f32,
            self.thermal_time_s as f32,
            self.ambient_c as f32,
            self.winding_limit_c as f32,
        )
    }

    /// Description of the simulated axis.
    pub fn axis(&self, joint: &JointFile) -> AxisDescription {
        AxisDescription {
            motor: MotorDescription {
                resistance: self.resistance_ohm,
                inductance_d: 1e-6 * self.inductance_d_uh,
                inductance_q: 1e-6 * self.inductance_q_uh,
                flux: self.flux(joint),
                pole_pairs: self.pole_pairs,
                electrical_zero: self.electrical_zero_deg.to_radians(),
                cogging: self.cogging_nm,
                cogging_periods: self.cogging_periods,
                thermal_resistance: self.thermal_resistance_k_w,
                thermal_time: self.thermal_time_s,
                thermistor: self.thermistor.map(|fitted| ThermistorDescription {
                    pull_up: fitted.pull_up_ohm,
                    at_25_c: fitted.r25_ohm,
                    beta: fitted.beta_k,
                    lag: THERMISTOR_LAG * self.thermal_time_s,
                }),
            },
            bridge: BridgeDescription::default(),
            shunts: ShuntDescription::default(),
            counter: CounterDescription {
                counts: f64::from(joint.encoder.counts),
                start: 0,
                index: self.index_deg.to_radians(),
                error: if self.absolute_encoder { AS5047P_ERROR } else { 0.0 },
                absolute: self.absolute_encoder,
            },
            joint_encoder: self.joint_encoder.map(|direction| JointEncoderDescription {
                direction: match direction {
                    JointEncoder::WithCounter => 1.0,
                    JointEncoder::AgainstCounter => -1.0,
                },
                zero: JOINT_READING_DEG.to_radians(),
                error: AS5047P_ERROR,
            }),
            wiring: Wiring::default(),
            ratio: joint.encoder.ratio,
        }
    }
}

impl ThermistorFile {
    fn check(&self, location: &KeyLocation<'_>, limit_c: f64) -> Result<(), Fault> {
        let limits = [
            // Less heats the thermistor, more lets the pin's leakage current read as a temperature.
            ("pull_up_ohm", self.pull_up_ohm, 1e3, 5e4),
            ("r25_ohm", self.r25_ohm, 1e3, 5e4),
            ("beta_k", self.beta_k, 1000.0, 6000.0),
        ];
        for (key, value, low, high) in limits {
            if !(low..=high).contains(&value) {
                return Err(
                    location.fault("thermistor", &format!("has `{key}` {value}, outside {low}..{high}"))
                );
            }
        }
        // A cold motor must not look like an open wire, nor a hot one like a short.
        let celsius = |code: u16| self.for_firmware().celsius(code).map_or(f64::INFINITY, f64::from);
        let (hottest, coldest) = (celsius(SHORTED + 1), celsius(OPEN - 1));
        let needed = limit_c + THERMISTOR_RESERVE_K;
        let advice = match (hottest >= needed, coldest <= COLDEST_C) {
            (true, true) => return Ok(()),
            (false, true) => "choose a smaller pull-up",
            (true, false) => "choose a larger pull-up",
            (false, false) => "no pull-up fits this thermistor",
        };
        let range =
            format!("reads {coldest:.0} to {hottest:.0} degrees, needs {COLDEST_C} to {needed:.0}: {advice}");
        Err(location.fault("thermistor", &range))
    }

    /// Constants for the firmware.
    pub fn for_firmware(&self) -> Thermistor {
        Thermistor {
            pull_up: Ohm(self.pull_up_ohm as f32),
            at_25_c: Ohm(self.r25_ohm as f32),
            beta_k: self.beta_k as f32,
        }
    }
}

impl LegFile {
    /// The leg with a thermistor of 10 kOhm in each winding.
    pub fn with_thermistors(&self) -> Self {
        let mut leg = self.clone();
        for motor in leg.joints.iter_mut().filter_map(|joint| joint.motor.as_mut()) {
            motor.thermistor =
                Some(ThermistorFile { pull_up_ohm: 3300.0, r25_ohm: 10_000.0, beta_k: 3435.0 });
        }
        leg
    }

    /// The leg with an AS5047P at each rotor and each joint, at the distal joints against their counters.
    pub fn with_absolute_encoders(&self) -> Self {
        let mut leg = self.clone();
        for (index, joint) in leg.joints.iter_mut().enumerate() {
            joint.encoder.counts = AS5047P_COUNTS[1];
            if let Some(motor) = joint.motor.as_mut() {
                let first = index == 0;
                let direction = if first { JointEncoder::WithCounter } else { JointEncoder::AgainstCounter };
                (motor.absolute_encoder, motor.joint_encoder) = (true, Some(direction));
            }
        }
        leg
    }

    /// Complete drives of the simulated leg. Fails if the leg does not have `N` joints or a joint
    /// has no motor.
    pub fn complete_description<const N: usize>(&self) -> Result<CompleteDescription<N>, FileError> {
        let axes = self.each_joint(|joint| {
            let motor = joint.motor.as_ref().ok_or_else(|| {
                self.error(format!(
                    "joint `{}` has no `[joint.motor]`: its complete drive cannot be simulated",
                    joint.name
                ))
            })?;
            Ok(motor.axis(joint))
        })?;
        let mut supply = self.supply.description();
        supply.takes_charge = self.charge_current_a.is_some();
        Ok(CompleteDescription::new(axes, supply))
    }

    /// Delays of the holding brake for the firmware, rounded up.
    pub fn brake_delays(&self) -> Option<BrakeDelays> {
        let brake = self.brake?;
        let (release_ms, engage_ms) = (brake.release_ms.ceil() as u16, brake.engage_ms.ceil() as u16);
        Some(BrakeDelays { release_ms, engage_ms })
    }

    /// Limits of the supply for the firmware.
    pub fn supply_limits(&self) -> SupplyLimits {
        let limit = |ampere: Option<f64>| ampere.map(|ampere| Ampere(ampere as f32));
        SupplyLimits {
            draw: limit(self.supply_current_a),
            charge: limit(self.charge_current_a),
            brake: Ohm(self.supply.brake_ohm as f32),
        }
    }
}
