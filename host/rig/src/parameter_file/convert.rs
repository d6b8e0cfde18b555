//! Converts calibration and model between the file and the store; checks shared by both directions.

use std::f64::consts::PI;

use scarab::leg::{
    AbsoluteAngle, Assured, Constant, ElectricalAngle, Fingerprint, JointZero, StoredCalibration,
    StoredModel, Stribeck,
};
use scarab::store::{CalibrationRecord, JointProvenance, Key, ModelRecord, Provenance};
use scarab::units::{Celsius, Henry, Metre, NewtonMetre, NewtonMetrePerAmpere, Ohm};
use scarab_identify::formats::temperature::RANGE_C;

use crate::parameter_file::{
    AxisCalibration, FrictionBound, Joint, JointZeroPart, ModelJoint, ModelPart, Parameters, StribeckPart,
};

/// Units of an electrical angle.
const UNITS_PER_RAD: f64 = 4_294_967_296.0 / (2.0 * PI);

/// Number in the board's precision, if finite.
fn finite(name: &str, value: f64) -> Result<f32, String> {
    let single = value as f32;
    if single.is_finite() {
        Ok(single)
    } else {
        Err(format!("`{name}` is {value}, which a board cannot store"))
    }
}

fn above_zero(name: &str, value: f64) -> Result<f32, String> {
    match finite(name, value)? {
        single if single > 0.0 => Ok(single),
        _ => Err(format!("`{name}` is {value}; it must be above 0")),
    }
}

fn not_below_zero(name: &str, value: f64) -> Result<f32, String> {
    match finite(name, value)? {
        single if single >= 0.0 => Ok(single),
        _ => Err(format!("`{name}` is {value}; it must not be below 0")),
    }
}

impl AxisCalibration {
    pub(super) fn from_record(joint: Joint, kept: &CalibrationRecord) -> Self {
        let StoredCalibration {
            resistance,
            direct_inductance,
            quadrature_inductance,
            offset,
            encoder,
            winding_c,
            joint_zero,
        } = kept.0;
        Self {
            joint,
            resistance_ohm: resistance.0.into(),
            direct_inductance_h: direct_inductance.0.into(),
            quadrature_inductance_h: quadrature_inductance.0.into(),
            offset_rad: f64::from(offset.units()) / UNITS_PER_RAD,
            encoder,
            winding_c: winding_c.map(f64::from),
            joint_zero: joint_zero.map(|zero| JointZeroPart {
                rotor_counts: zero.rotor,
                joint_steps: zero.joint.steps(),
                setting: zero.setting,
            }),
        }
    }

    pub(super) fn to_record(&self) -> Result<CalibrationRecord, String> {
        let units = (self.offset_rad * UNITS_PER_RAD).round();
        if !(f64::from(i32::MIN)..=f64::from(i32::MAX)).contains(&units) {
            return Err(format!("`offset_rad` is {}; it must be from -pi to pi", self.offset_rad));
        }
        if self.encoder.pole_pairs == 0 || self.encoder.counts_per_turn == 0 {
            return Err("`encoder`: pole pairs and counts per turn must be above 0".into());
        }
        let winding_c = self.winding_c.map(|celsius| finite("winding_c", celsius)).transpose()?;
        if let Some(celsius) = winding_c.filter(|celsius| !(-100.0..=1000.0).contains(celsius)) {
            return Err(format!("`winding_c` is {celsius}, outside -100..1000"));
        }
        let steps = u32::from(self.joint_zero.map_or(0, |zero| zero.joint_steps));
        if steps >= AbsoluteAngle::STEPS.unsigned_abs() {
            return Err(format!("`joint_zero.joint_steps` is {steps}; it must be below 16384"));
        }
        Ok(CalibrationRecord(StoredCalibration {
            resistance: Ohm(above_zero("resistance_ohm", self.resistance_ohm)?),
            direct_inductance: Henry(above_zero("direct_inductance_h", self.direct_inductance_h)?),
            quadrature_inductance: Henry(above_zero(
                "quadrature_inductance_h",
                self.quadrature_inductance_h,
            )?),
            offset: ElectricalAngle::from_units(units as i32),
            encoder: self.encoder,
            winding_c,
            joint_zero: self.joint_zero.map(|zero| JointZero {
                rotor: zero.rotor_counts,
                joint: AbsoluteAngle::from_steps(zero.joint_steps),
                setting: zero.setting,
            }),
        }))
    }
}

impl Parameters {
    fn from_array(of: [f64; 14]) -> Self {
        let [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off] = of;
        Self { xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off }
    }

    /// Values in a fixed order.
    pub(crate) fn to_array(self) -> [f64; 14] {
        let Self { xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off } = self;
        [xx, xy, xz, yy, yz, zz, hx, hy, hz, m, ia, fc, fv, off]
    }
}

/// Data of one joint of a model in the store.
struct JointRecord {
    parameters: [f32; 14],
    stribeck: Stribeck<f32>,
    constant: Constant,
    coulomb_bound_nm: f32,
    viscous_bound: f32,
    from: JointProvenance,
}

impl ModelJoint {
    fn to_record(&self) -> Result<JointRecord, String> {
        let mut parameters = [0.0; 14];
        let symbols = scarab::model::Parameter::ALL.map(scarab::model::Parameter::symbol);
        for ((to, from), symbol) in parameters.iter_mut().zip(self.parameters.to_array()).zip(symbols) {
            *to = finite(symbol, from)?;
        }
        let unknown =
            |name, value: Option<f64>| value.map_or(Ok(f32::NAN), |value| not_below_zero(name, value));
        Ok(JointRecord {
            parameters,
            stribeck: Stribeck {
                excess: not_below_zero("excess", self.stribeck.excess)?,
                velocity: above_zero("velocity_rad_s", self.stribeck.velocity_rad_s)?,
            },
            constant: self.constant,
            coulomb_bound_nm: not_below_zero("coulomb_nm", self.friction_lower_bound.coulomb_nm)?,
            viscous_bound: not_below_zero("viscous_nm_s_rad", self.friction_lower_bound.viscous_nm_s_rad)?,
            from: JointProvenance {
                length: Metre(finite("length_m", self.length_m)?),
                torque_per_ampere: NewtonMetrePerAmpere(above_zero(
                    "torque_per_ampere",
                    self.torque_per_ampere,
                )?),
                rms: NewtonMetre(unknown("rms_nm", self.rms_nm)?),
                mean_absolute: NewtonMetre(unknown("mean_absolute_nm", self.mean_absolute_nm)?),
            },
        })
    }
}

fn version(text: &str) -> Option<[u8; 3]> {
    let parts: Vec<u8> = text.split('.').map(|part| part.parse().ok()).collect::<Option<_>>()?;
    parts.try_into().ok()
}

fn fingerprint(text: &str) -> Option<Fingerprint> {
    let plain = text.len() == 16 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
    u64::from_str_radix(text, 16).ok().filter(|_| plain).map(Fingerprint)
}

impl ModelPart {
    pub(super) fn from_record<const N: usize>(kept: &ModelRecord<N>) -> Self {
        let ModelRecord { model, provenance } = kept;
        let [major, minor, patch] = provenance.firmware;
        let known = |value: f32| (!value.is_nan()).then_some(f64::from(value));
        let joint = |(index, joint): (usize, Joint)| {
            let (curve, from) = (model.stribeck.get(index)?, provenance.joints.get(index)?);
            Some(ModelJoint {
                joint,
                parameters: Parameters::from_array(model.parameters.get(index)?.map(f64::from)),
                stribeck: StribeckPart { excess: curve.excess.into(), velocity_rad_s: curve.velocity.into() },
                constant: *model.constant.get(index)?,
                friction_lower_bound: FrictionBound {
                    coulomb_nm: (*model.assured.coulomb_nm.get(index)?).into(),
                    viscous_nm_s_rad: (*model.assured.viscous.get(index)?).into(),
                },
                length_m: from.length.0.into(),
                torque_per_ampere: from.torque_per_ampere.0.into(),
                rms_nm: known(from.rms.0),
                mean_absolute_nm: known(from.mean_absolute.0),
            })
        };
        Self {
            fingerprint: format!("{:016x}", model.fingerprint.0),
            firmware: format!("{major}.{minor}.{patch}"),
            generation: provenance.generation,
            swarm_seed: provenance.swarm_seed.to_string(),
            bridge_temperature_c: provenance.bridge.map(|bridge| bridge.0.into()),
            worn: provenance.worn,
            inertia_lower_bound: model.assured.inertia_share.into(),
            joint: Joint::ALL.into_iter().enumerate().take(N).filter_map(joint).collect(),
        }
    }

    pub(super) fn to_record<const N: usize>(&self) -> Result<ModelRecord<N>, String> {
        let mut joints = Vec::new();
        for (part, expected) in self.joint.iter().zip(Joint::ALL) {
            let name = part.joint.name();
            if part.joint != expected {
                return Err(format!(
                    "`joint`: {name} instead of {}: list each joint once, from the base",
                    expected.name()
                ));
            }
            joints.push(part.to_record().map_err(|why| format!("{name}: {why}"))?);
        }
        let joints: [JointRecord; N] = joints.try_into().map_err(|_| "`joint`: 1 to 3 joints make a leg")?;
        let (low, high) = RANGE_C;
        if let Some(celsius) = self.bridge_temperature_c.filter(|celsius| !(low..=high).contains(celsius)) {
            return Err(format!("`bridge_temperature_c` is {celsius}; it must be from {low} to {high}"));
        }
        let inertia_share = not_below_zero("inertia_lower_bound", self.inertia_lower_bound)?;
        if inertia_share > 1.0 {
            return Err(format!("`inertia_lower_bound` is {inertia_share}; it must be from 0 to 1"));
        }
        let fault = |key: &str, value: &str, why: &str| format!("`{key}` is `{value}`; it must be {why}");
        Ok(ModelRecord {
            model: StoredModel {
                fingerprint: fingerprint(&self.fingerprint)
                    .ok_or_else(|| fault("fingerprint", &self.fingerprint, "16 hexadecimal digits"))?,
                parameters: joints.each_ref().map(|joint| joint.parameters),
                stribeck: joints.each_ref().map(|joint| joint.stribeck),
                constant: joints.each_ref().map(|joint| joint.constant),
                assured: Assured {
                    coulomb_nm: joints.each_ref().map(|joint| joint.coulomb_bound_nm),
                    viscous: joints.each_ref().map(|joint| joint.viscous_bound),
                    inertia_share,
                },
            },
            provenance: Provenance {
                firmware: version(&self.firmware)
                    .ok_or_else(|| fault("firmware", &self.firmware, "three numbers up to 255, as 0.1.0"))?,
                generation: self.generation,
                swarm_seed: self.swarm_seed.parse().map_err(|_| {
                    fault("swarm_seed", &self.swarm_seed, "the digits of a number of 64 bits")
                })?,
                bridge: self.bridge_temperature_c.map(|celsius| Celsius(celsius as f32)),
                worn: self.worn,
                joints: joints.each_ref().map(|joint| joint.from),
            },
        })
    }

    /// Checks the part as the model of this key.
    pub(super) fn check(&self, key: Key) -> Result<(), String> {
        match (key == Key::WornModel, self.worn == Some(true)) {
            (true, false) => return Err("`worn` must be true".into()),
            (false, true) => return Err("`worn` is true: the model of a worn leg is `worn_model`".into()),
            _ => {}
        }
        match self.joint.len() {
            1 => self.to_record::<1>().map(drop),
            3 => self.to_record::<3>().map(drop),
            _ => self.to_record::<2>().map(drop),
        }
    }
}
