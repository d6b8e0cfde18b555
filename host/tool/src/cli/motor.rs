//! `motor`: measures the board's current loop with one of a leg's motors.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::output;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_rig::motor::measure;

use crate::cli::arguments::{Output, OutputFolder};
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;
use crate::view::{figures, motor as text};

/// Motor and outputs.
#[derive(Args, Debug)]
pub(crate) struct MotorArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Joint of the measured motor, by name or number from 1.
    #[arg(long, default_value = "1")]
    joint: String,
    /// Seed of the sensors' noise.
    #[arg(long, default_value_t = DEFAULT_SEED)]
    seed: u64,
    /// Write the report with its curves as JSON here.
    #[arg(long)]
    json: Option<Output>,
    /// Draw into this directory, as SVG files.
    #[arg(long)]
    figures: Option<OutputFolder>,
}

/// Measures and prints; returns the exit code.
pub(crate) fn run(arguments: &MotorArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.load()?;
    let by_name = leg.joints.iter().position(|joint| joint.name == arguments.joint);
    let by_number = arguments.joint.parse::<usize>().ok().and_then(|number| number.checked_sub(1));
    let joint = by_name.or(by_number.filter(|index| *index < leg.joints.len())).ok_or_else(|| {
        let names: Vec<_> = leg.joints.iter().map(|joint| joint.name.as_str()).collect();
        let count = names.len();
        ToolError::input(format!(
            "--joint: `{}` is not a joint of {}: {} or 1 to {count}",
            arguments.joint,
            leg.name,
            names.join(", "),
        ))
    })?;
    let report = measure(&leg, joint, arguments.seed)?;
    if let Some(path) = &arguments.json {
        write_json(path, &report)?;
    }
    output::print(&text::tables(&report))?;
    if let Some(directory) = &arguments.figures {
        figures::motor::write(directory, &report)?;
        output::print(&format!("\nfigures: {}\n", directory.display()))?;
    }
    Ok(EXIT_ACCEPTED)
}
