//! `regressor`: torques and regressor of given states.

use std::path::PathBuf;

use clap::Args;

use super::leg_options::LegOptions;
use crate::tool::error::{EXIT_ACCEPTED, ToolError};
use crate::tool::regressor::{self, RegressorOptions};
use crate::tool::tables;

/// Which states of which leg.
#[derive(Args, Debug)]
pub struct RegressorArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// States: columns q1.., qd1.., qdd1.. in rad and s, D-H angles.
    #[arg(long)]
    states: PathBuf,
    /// Compute in the device's single precision.
    #[arg(long)]
    f32: bool,
}

/// Prints the table; the exit code.
pub fn run(arguments: &RegressorArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.load()?;
    let options = RegressorOptions { states: arguments.states.clone(), single_precision: arguments.f32 };
    tables::print(&regressor::table(&leg, &options)?)?;
    Ok(EXIT_ACCEPTED)
}
