//! `excite`: designs an exciting motion and predicts its result before anything moves.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::{files, output};
use scarab_identify::formats::excitation::Excitation;
use scarab_identify::formats::motion_samples::{MotionSamples, SampleRate};
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_rig::excite::assumption::Assumption;
use scarab_rig::excite::bench::{ExciteOptions, FEWEST_EVALUATIONS, MOST_EVALUATIONS};
use scarab_rig::excite::design::DesignOptions;
use scarab_rig::excite::run::{USUAL_DURATION_S, USUAL_MARGIN_PERCENT, excite};

use crate::cli::arguments::{Input, Output};
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;
use crate::cli::noise::NoiseOptions;
use crate::excitation_constant as constant;
use crate::view::excite as text;

/// Leg to be excited, and outputs of the design.
#[derive(Args, Debug)]
pub(crate) struct ExciteArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Write the motion here, as TOML for identify.
    #[arg(long)]
    out: Option<Output>,
    /// Write the motion here, as a Rust constant for an image.
    #[arg(long = "const")]
    constant: Option<Output>,
    /// Write samples of the motion here, as CSV: t_s, and q1_rad, qd1_radps, qdd1_radps2 of each joint.
    #[arg(long)]
    csv: Option<Output>,
    /// Write the motion here, as a ROS 2 trajectory (trajectory_msgs/JointTrajectory, YAML).
    #[arg(long)]
    trajectory: Option<Output>,
    /// Samples per second of --csv and --trajectory, Hz; a divisor of 4000.
    #[arg(long, value_name = "HZ", default_value = "500")]
    rate: SampleRate,
    /// Duration of the motion with its blends, s.
    #[arg(long, default_value_t = USUAL_DURATION_S, allow_negative_numbers = true)]
    duration: f64,
    #[command(flatten)]
    noise: NoiseOptions,
    /// Assumed error of each base parameter in the bound on torque, percent.
    #[arg(long, default_value_t = USUAL_MARGIN_PERCENT, allow_negative_numbers = true)]
    torque_margin: f64,
    /// Assume the truth of the leg file instead of its prior.
    #[arg(long)]
    assume_truth: bool,
    /// Check this motion instead of designing one.
    #[arg(long)]
    excitation: Option<Input>,
    /// Seed of the swarm's random numbers.
    #[arg(long, default_value_t = DEFAULT_SEED)]
    seed: u64,
    /// Largest number of curves that the swarm evaluates.
    #[arg(long, default_value_t = EVALUATIONS, value_parser = clap::value_parser!(u32).range(i64::from(FEWEST_EVALUATIONS)..=i64::from(MOST_EVALUATIONS)))]
    evaluations: u32,
    /// Write the report as JSON here.
    #[arg(long)]
    json: Option<Output>,
}

/// Evaluations by default: about five seconds of one core for two joints.
const EVALUATIONS: u32 = 48_000;

/// Designs, reports and writes; returns the exit code.
pub(crate) fn run(arguments: &ExciteArguments) -> Result<u8, ToolError> {
    let leg = &arguments.noise.on(arguments.leg.load()?)?;
    let torque_noise_percent = arguments.noise.percent()?;
    let given = match &arguments.excitation {
        Some(file) => Some((file.to_path_buf(), Excitation::load(file)?)),
        None => None,
    };
    let options = &ExciteOptions {
        design: DesignOptions {
            duration_s: arguments.duration,
            seed: arguments.seed,
            evaluations: arguments.evaluations,
        },
        given,
        carried: Vec::new(),
        torque_noise_percent,
        margin_percent: arguments.torque_margin,
        assumption: if arguments.assume_truth { Assumption::Truth } else { Assumption::Best },
    };
    options.check().map_err(ToolError::input)?;
    let excited = excite(leg, options)?;
    if let Some(path) = &arguments.out {
        files::write(path, excited.motion.to_toml())?;
    }
    if let Some(path) = &arguments.constant {
        files::write(path, constant::source(&excited.motion))?;
    }
    if arguments.csv.is_some() || arguments.trajectory.is_some() {
        let samples = MotionSamples::new(leg, &excited.motion, arguments.rate)?;
        if let Some(path) = &arguments.csv {
            files::write(path, samples.to_csv())?;
        }
        if let Some(path) = &arguments.trajectory {
            files::write(path, samples.to_trajectory())?;
        }
    }
    if let Some(path) = &arguments.json {
        write_json(path, &excited.report)?;
    }
    output::print(&text::report(&excited.report))?;
    Ok(EXIT_ACCEPTED)
}
