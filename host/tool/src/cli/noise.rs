//! Noise of the logged torque: arguments of every command that needs it.

use clap::Args;

use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::check::LARGEST_NOISE_PERCENT;

/// Noise of the logged torque, instead of the leg file's.
#[derive(Args, Debug)]
pub(crate) struct NoiseOptions {
    /// Noise of the logged torque, percent of each joint's mean absolute torque on the default motion.
    /// Default: that of the leg file.
    #[arg(long, allow_negative_numbers = true, help_heading = "Simulation")]
    torque_noise: Option<f64>,
    /// Noise of the logged torque, standard deviation at rest, N m: one number or one for each joint.
    #[arg(
        long,
        value_name = "NM[,NM..]",
        value_delimiter = ',',
        allow_negative_numbers = true,
        conflicts_with = "torque_noise",
        help_heading = "Simulation"
    )]
    torque_noise_nm: Vec<f64>,
}

/// Largest plausible noise of a torque, N m.
const LARGEST_NM: f64 = 1000.0;

impl NoiseOptions {
    /// Percentage, if given.
    ///
    /// # Errors
    /// The value is not a valid percentage.
    pub(crate) fn percent(&self) -> Result<Option<f64>, ToolError> {
        if self.torque_noise.is_some_and(|percent| !(0.0..=LARGEST_NOISE_PERCENT).contains(&percent)) {
            return Err(ToolError::input(format!(
                "--torque-noise: must be a percentage from 0 to {LARGEST_NOISE_PERCENT}"
            )));
        }
        Ok(self.torque_noise)
    }

    /// Leg with the given noise in N m instead of its own.
    ///
    /// # Errors
    /// The number of values differs from the number of joints, or one is invalid.
    pub(crate) fn on(&self, leg: LegFile) -> Result<LegFile, ToolError> {
        let (given, joints) = (&self.torque_noise_nm, leg.joints.len());
        if let Some(noise) = given.iter().find(|noise| !(0.0..=LARGEST_NM).contains(*noise)) {
            return Err(ToolError::input(format!(
                "--torque-noise-nm: {noise} N m is outside 0..{LARGEST_NM}"
            )));
        }
        match given.len() {
            0 => Ok(leg),
            1 => Ok(leg.with_torque_noise(&vec![given[0]; joints])),
            count if count == joints => Ok(leg.with_torque_noise(given)),
            count => Err(ToolError::input(format!(
                "--torque-noise-nm: {count} numbers, but the leg `{}` has {joints} joints",
                leg.name
            ))),
        }
    }
}
