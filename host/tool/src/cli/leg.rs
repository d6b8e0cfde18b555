//! `leg`: a new leg file from a robot description or from answers, and what a leg file lacks.

mod check;
mod questions;

use clap::{ArgGroup, Args};
use nalgebra::Vector3;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_base::shell::{program, quoted};
use scarab_base::{files, output};
use scarab_identify::formats::leg_file::check::GRAVITY;
use scarab_identify::formats::robot::Robot;
use scarab_identify::leg::from_robot::{LARGEST_PARALLEL_RAD, RobotOptions, leg};

use crate::cli::arguments::{Input, LegName, Output};

/// Largest position of a held joint, rad or m.
const LARGEST_POSITION: f64 = 1000.0;

/// Source of a leg file, or the file to check.
#[derive(Args, Debug)]
#[command(group(ArgGroup::new("job").required(true).args(["urdf", "new", "check"])))]
pub(crate) struct LegArguments {
    /// Convert a robot description (URDF): D-H numbers, directions, zeros, limits and prior.
    #[arg(long, requires = "out")]
    urdf: Option<Input>,
    /// Ask for the numbers on the terminal; answers may also come from a pipe, one a line.
    #[arg(long)]
    new: bool,
    /// List what replay, simulation and image need from this leg file and do not find.
    #[arg(long, value_name = "LEG", conflicts_with = "out")]
    check: Option<LegName>,
    /// Write the leg file here; a file that exists is refused. Default of --new: my-leg.toml.
    #[arg(long, default_value_if("new", "true", "my-leg.toml"))]
    out: Option<Output>,
    /// Joints of the leg, proximal first. Default: all that turn.
    #[arg(
        long,
        value_name = "NAME,..",
        value_delimiter = ',',
        requires = "urdf",
        help_heading = "Robot description"
    )]
    joints: Vec<String>,
    /// Hold a joint at a position, rad or m; may be repeated.
    #[arg(long, value_name = "NAME=POSITION", value_parser = lock, requires = "urdf", help_heading = "Robot description")]
    lock: Vec<(String, f64)>,
    /// Gravity's acceleration in the frame of the root, m/s2.
    #[arg(long, value_name = "X,Y,Z", value_parser = gravity, default_value = "0,0,-9.81", allow_hyphen_values = true, help_heading = "Robot description")]
    gravity: Vector3<f64>,
    /// Take axes within this angle of parallel as parallel, rad (0 to 0.01).
    #[arg(long, value_name = "RAD", value_parser = parallel, default_value = "0", help_heading = "Robot description")]
    parallel: f64,
    /// Leave out the bodies: geometry and limits only.
    #[arg(long, requires = "urdf", help_heading = "Robot description")]
    no_prior: bool,
}

/// Writes a leg file or checks one; returns the exit code.
pub(crate) fn run(arguments: &LegArguments) -> Result<u8, ToolError> {
    if let Some(name) = &arguments.check {
        output::print(&check::text(name)?)?;
        return Ok(EXIT_ACCEPTED);
    }
    let Some(out) = &arguments.out else {
        return Err(ToolError::input("--out is missing: which leg file shall be written?"));
    };
    files::check_new(out)?;
    let (text, remarks) = match &arguments.urdf {
        Some(urdf) => {
            let robot = Robot::parse(&files::read_text(urdf)?, &urdf.display().to_string())?;
            let options = RobotOptions {
                joints: arguments.joints.clone(),
                locked: arguments.lock.clone(),
                gravity: arguments.gravity,
                parallel_rad: arguments.parallel,
                with_prior: !arguments.no_prior,
            };
            let found = leg(&robot, &options)?;
            (found.text, found.remarks)
        }
        None => (questions::ask_on_terminal()?, Vec::new()),
    };
    files::write_new(out, &text)?;
    for remark in &remarks {
        output::print(&format!("{remark}\n"))?;
    }
    let path = out.display().to_string();
    output::print(&format!("leg file: {path}\nnext: {} leg --check {}\n", program(), quoted(&path)))?;
    Ok(EXIT_ACCEPTED)
}

fn lock(text: &str) -> Result<(String, f64), String> {
    // Names of joints may contain `=`.
    let Some((name, position)) = text.rsplit_once('=') else {
        return Err("is not NAME=POSITION, for example ankle=0.1".to_owned());
    };
    match position.trim().parse::<f64>() {
        Ok(position) if position.abs() <= LARGEST_POSITION => Ok((name.to_owned(), position)),
        _ => Err(format!(
            "`{position}` is not a position from -{LARGEST_POSITION} to {LARGEST_POSITION} rad or m"
        )),
    }
}

fn gravity(text: &str) -> Result<Vector3<f64>, String> {
    let [low, high] = GRAVITY;
    let numbers: Vec<f64> = text.split(',').filter_map(|word| word.trim().parse().ok()).collect();
    match numbers[..] {
        [x, y, z]
            if text.split(',').count() == 3 && [x, y, z].iter().all(|part| (low..=high).contains(part)) =>
        {
            Ok(Vector3::new(x, y, z))
        }
        _ => Err(format!("is not three numbers X,Y,Z from {low} to {high} m/s2")),
    }
}

fn parallel(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(angle) if (0.0..=LARGEST_PARALLEL_RAD).contains(&angle) => Ok(angle),
        _ => Err(format!("is not an angle from 0 to {LARGEST_PARALLEL_RAD} rad")),
    }
}
