//! `regressor`: torques and regressor of given states.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::output;
use scarab_identify::run::regressor::{self, RegressorOptions};

use crate::cli::leg_options::LegOptions;
use crate::cli::states::StatesOptions;

/// Leg and states.
#[derive(Args, Debug)]
pub(crate) struct RegressorArguments {
    #[command(flatten)]
    leg: LegOptions,
    #[command(flatten)]
    states: StatesOptions,
    /// Compute in the device's single precision.
    #[arg(long)]
    f32: bool,
}

/// Prints the table and returns the exit code.
pub fn run(arguments: &RegressorArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.load()?;
    let options = RegressorOptions { angles: arguments.states.angles(), single_precision: arguments.f32 };
    output::print(&regressor::table(&leg, &arguments.states.states, &options)?)?;
    Ok(EXIT_ACCEPTED)
}
