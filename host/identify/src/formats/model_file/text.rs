//! Writes a model as readable TOML: one line for each parameter and each row of the covariance.

use core::fmt::Write as _;

use serde::Serialize;
use toml::ser::ValueSerializer;

use crate::formats::model_file::{ModelFile, checksum};

const HEAD: &str = "\
# A Scarab model: what an accepted identification found, on which leg and how surely. Written by the tool; keys and units
# are in docs/files.md. The checksum covers every value: an edited file is refused.
";

impl ModelFile {
    /// TOML text that [`ModelFile::parse`] reads back unchanged.
    pub fn to_toml(&self) -> String {
        let mut out = String::from(HEAD);
        line(&mut out, "schema", &self.schema);
        line(&mut out, checksum::KEY, &self.checksum);
        line(&mut out, "fingerprint", &self.fingerprint);
        line(&mut out, "created", &self.created);
        line(&mut out, "scarab", &self.scarab);
        out += "\n[leg]\n";
        line(&mut out, "name", &self.leg.name);
        line(&mut out, "side", &self.leg.side);
        line(&mut out, "gravity", &self.leg.gravity);
        lines(&mut out, "joints", &self.leg.joints);
        out += "\n[conditions]\n";
        let conditions = &self.conditions;
        line(&mut out, "source", &conditions.source);
        line(&mut out, "verdict", &conditions.verdict);
        line(&mut out, "scale", &conditions.scale);
        line(&mut out, "prior", &conditions.prior);
        line(&mut out, "plan", &conditions.plan);
        line(&mut out, "bandwidth_hz", &conditions.bandwidth_hz);
        line(&mut out, "motion_s", &conditions.motion_s);
        conditions.seed.iter().for_each(|seed| line(&mut out, "seed", seed));
        line(&mut out, "swarm_seed", &conditions.swarm_seed);
        conditions.condition.iter().for_each(|condition| line(&mut out, "condition", condition));
        conditions.temperature_c.iter().for_each(|celsius| line(&mut out, "temperature_c", celsius));
        line(&mut out, "not_estimated", &conditions.not_estimated);
        lines(&mut out, "fits", &conditions.fits);
        out += "\n[base_set]\n";
        lines(&mut out, "parameters", &self.base_set.parameters);
        lines(&mut out, "covariance", &self.base_set.covariance);
        if !self.base_set.stribeck.is_empty() {
            lines(&mut out, "stribeck", &self.base_set.stribeck);
        }
        if !self.base_set.additional_torque.is_empty() {
            lines(&mut out, "additional_torque", &self.base_set.additional_torque);
        }
        out += "\n[full_set]\n";
        lines(&mut out, "parameters", &self.full_set.parameters);
        out
    }

    /// Adds the checksum of the content.
    pub(crate) fn sealed(mut self) -> Self {
        let raw: toml::Table =
            toml::from_str(&self.to_toml()).unwrap_or_else(|fault| unreachable!("own text: {fault}"));
        self.checksum = checksum::of_table(&raw);
        self
    }
}

fn line(out: &mut String, key: &str, value: &impl Serialize) {
    writeln!(out, "{key} = {}", inline(value)).unwrap_or_else(|fault| unreachable!("memory: {fault}"));
}

fn lines(out: &mut String, key: &str, values: &[impl Serialize]) {
    *out += &format!("{key} = [\n");
    values.iter().for_each(|value| *out += &format!("  {},\n", inline(value)));
    *out += "]\n";
}

fn inline(value: &impl Serialize) -> String {
    let mut text = String::new();
    value
        .serialize(ValueSerializer::new(&mut text))
        .unwrap_or_else(|fault| unreachable!("plain tables, words and numbers: {fault}"));
    text
}
