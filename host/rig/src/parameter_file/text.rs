//! Writes TOML text: one line for each object and each part of a joint.

use scarab::leg::{Constant, CounterDirection};
use scarab_base::toml_file::quoted;
use std::fmt::Display;

use crate::parameter_file::objects::{is_pattern, is_wide};
use crate::parameter_file::{
    AxisCalibration, FrictionBound, JointZeroPart, ModelJoint, ModelPart, NodeObjects, ObjectValue,
    ParameterFile,
};

const HEAD: &str = "\
# What a Scarab board remembers over the power, written by the tool; keys and units are in docs/files.md. A calibration is checked at
# the motor, a model against the leg's fingerprint, whatever stands here.
";

impl ParameterFile {
    /// TOML text that [`ParameterFile::parse`] reads back unchanged.
    pub fn to_toml(&self) -> String {
        let mut out = String::from(HEAD);
        line(&mut out, "schema", self.schema);
        self.node.iter().for_each(|part| node(&mut out, part));
        self.calibration.iter().for_each(|part| calibration(&mut out, part));
        self.model.iter().for_each(|part| model(&mut out, "model", part));
        self.worn_model.iter().for_each(|part| model(&mut out, "worn_model", part));
        out
    }
}

fn line(out: &mut String, key: &str, value: impl Display) {
    *out += &format!("{key} = {value}\n");
}

/// Shortest digits that restore the f32 of this number.
fn float(value: f64) -> String {
    let (single, text) = (value as f32, format!("{:?}", value as f32));
    // The f64's own digits are used if reading the short form as f64 and rounding again would give
    // another number.
    let same = f64::from(single) == value && text.parse::<f64>().is_ok_and(|read| read as f32 == single);
    if same { text } else { format!("{value:?}") }
}

fn object(value: &ObjectValue) -> String {
    let ObjectValue { index, subindex, name, value: number } = value;
    let name = quoted(name.as_deref().unwrap_or(""));
    let number =
        if is_pattern(value) && is_wide(value) { format!("0x{number:08X}") } else { number.to_string() };
    format!("{{ index = 0x{index:04X}, subindex = {subindex}, name = {name}, value = {number} }}")
}

fn node(out: &mut String, node: &NodeObjects) {
    *out += "\n[[node]]\n";
    line(out, "joint", quoted(node.joint.name()));
    if node.objects.is_empty() {
        line(out, "objects", "[]");
        return;
    }
    *out += "objects = [\n";
    node.objects.iter().for_each(|value| *out += &format!("  {},\n", object(value)));
    *out += "]\n";
}

fn calibration(out: &mut String, axis: &AxisCalibration) {
    *out += "\n[[calibration]]\n";
    line(out, "joint", quoted(axis.joint.name()));
    line(out, "resistance_ohm", float(axis.resistance_ohm));
    line(out, "direct_inductance_h", float(axis.direct_inductance_h));
    line(out, "quadrature_inductance_h", float(axis.quadrature_inductance_h));
    line(out, "offset_rad", format!("{:?}", axis.offset_rad));
    let counter = match axis.encoder.counter {
        CounterDirection::Up => "up",
        CounterDirection::Down => "down",
    };
    let (pairs, counts) = (axis.encoder.pole_pairs, axis.encoder.counts_per_turn);
    let absolute = if axis.encoder.absolute { ", absolute = true" } else { "" };
    let setting =
        format!("{{ counter = \"{counter}\", pole_pairs = {pairs}, counts_per_turn = {counts}{absolute} }}");
    line(out, "encoder", setting);
    if let Some(celsius) = axis.winding_c {
        line(out, "winding_c", format!("{celsius:.1}"));
    }
    if let Some(JointZeroPart { rotor_counts, joint_steps, setting }) = axis.joint_zero {
        let zero =
            format!("{{ rotor_counts = {rotor_counts}, joint_steps = {joint_steps}, setting = {setting} }}");
        line(out, "joint_zero", zero);
    }
}

fn model(out: &mut String, table: &str, model: &ModelPart) {
    *out += &format!("\n[{table}]\n");
    line(out, "fingerprint", quoted(&model.fingerprint));
    line(out, "firmware", quoted(&model.firmware));
    line(out, "generation", model.generation);
    line(out, "swarm_seed", quoted(&model.swarm_seed));
    model.bridge_temperature_c.iter().for_each(|celsius| line(out, "bridge_temperature_c", float(*celsius)));
    model.worn.iter().for_each(|worn| line(out, "worn", worn));
    line(out, "inertia_lower_bound", float(model.inertia_lower_bound));
    model.joint.iter().for_each(|joint| model_joint(out, table, joint));
}

fn model_joint(out: &mut String, table: &str, joint: &ModelJoint) {
    *out += &format!("\n[[{table}.joint]]\n");
    line(out, "joint", quoted(joint.joint.name()));
    let parameters = scarab::model::Parameter::ALL.into_iter().zip(joint.parameters.to_array());
    let parameters: Vec<String> =
        parameters.map(|(parameter, value)| format!("{} = {}", parameter.symbol(), float(value))).collect();
    line(out, "parameters", format!("{{ {} }}", parameters.join(", ")));
    let (excess, velocity) = (float(joint.stribeck.excess), float(joint.stribeck.velocity_rad_s));
    line(out, "stribeck", format!("{{ excess = {excess}, velocity_rad_s = {velocity} }}"));
    let constant = match joint.constant {
        Constant::Offset => "offset",
        Constant::Asymmetry => "asymmetry",
    };
    line(out, "constant", quoted(constant));
    let FrictionBound { coulomb_nm, viscous_nm_s_rad } = joint.friction_lower_bound;
    let (coulomb, viscous) = (float(coulomb_nm), float(viscous_nm_s_rad));
    let bound = format!("{{ coulomb_nm = {coulomb}, viscous_nm_s_rad = {viscous} }}");
    line(out, "friction_lower_bound", bound);
    line(out, "length_m", float(joint.length_m));
    line(out, "torque_per_ampere", float(joint.torque_per_ampere));
    joint.rms_nm.iter().for_each(|rms| line(out, "rms_nm", float(*rms)));
    joint.mean_absolute_nm.iter().for_each(|mean| line(out, "mean_absolute_nm", float(*mean)));
}
