//! Figures of a run as SVG, 900 pixels wide: one set for the files and for the report.
//!
//! | file | contents |
//! | --- | --- |
//! | `identify.svg` | at a glance: torque on one motion and the base parameters |
//! | `motions.svg` | commanded and measured angles, and their deviation |
//! | `torque-1.svg`, ... | a joint's measured, predicted and noise-free torque on every motion, residuals |
//! | `residuals.svg` | distribution and correlation of the residuals, against noise through the filter |
//! | `search.svg` | the swarm's cost above the optimum in its box over its iterations |
//! | `base-parameters.svg` | errors of the base parameters in reported sigma, or sigma in percent |
//!
//! Many runs (`--seeds`) have `spread.svg`: every base parameter about its truth.
//!
//! More than four motions are continued in `motions-b.svg`, `torque-1-b.svg` and so on.
//! `scripts/figures` draws those in `docs/figures`.
//!
//! Colours are those of Okabe and Ito (2008) or tints of them, which the colour-blind can distinguish.
//! Curves also differ in lightness and width, so they can be distinguished in grey. Drawings have four
//! times the shown size with a `viewBox` of that size, since the backend rounds to whole pixels.

pub(crate) mod assist;
pub mod canvas;
pub mod curve;
pub(crate) mod faults;
pub(crate) mod motor;
mod parameters;
mod residuals;
mod search;
mod spread;
mod torque;
mod trajectories;

use std::path::Path;

use crate::view::spread::Spread;
use canvas::{Area, DrawingError, render};
use scarab_base::error::ToolError;
use scarab_base::files;
use scarab_identify::report::RunReport;
use scarab_identify::report::series::{Role, Series};

/// Width of every figure, pixels.
pub const WIDTH: u32 = 900;
/// Motions in one figure.
const MOTIONS_PER_FIGURE: usize = 4;

/// Section of a report for a figure.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Group {
    /// Summary at a glance.
    Summary,
    /// Angles.
    Trajectories,
    /// Torques.
    Torque,
    /// Statistics of the residuals.
    Residuals,
    /// Descent of the swarm.
    Search,
    /// Errors of the base parameters.
    BaseParameters,
}

/// One figure.
#[derive(Clone, Debug, PartialEq)]
pub struct Figure {
    /// Name of its file.
    pub file: String,
    /// Section of the report.
    pub group: Group,
    /// Title, read aloud by a screen reader.
    pub title: String,
    /// The drawing.
    pub svg: String,
}

/// Draws all figures of a run; `joints` are the names of the joints.
pub fn all(joints: &[&str], run: &RunReport, series: &Series) -> Result<Vec<Figure>, ToolError> {
    let mut figures = Vec::new();
    let mut add = |group, file: String, title: String, height, draw: Draw<'_>| {
        let svg = render(WIDTH, height, draw)
            .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
        figures.push(Figure { file, group, title, svg });
        Ok::<_, ToolError>(())
    };
    let shown = shown_motion(series);
    let glance = torque::small_height(joints.len());
    let title = format!("Filtered torque and residual (grey: at rest), base parameters of {}", run.leg);
    add(Group::Summary, "identify.svg".into(), title, glance, &|area| {
        let (left, right) = area.split_horizontally(canvas::px(480));
        if let Some(motion) = shown {
            torque::small(&left, joints, motion)?;
        }
        parameters::small(&right, run)
    })?;
    for (part, motions) in series.motions.chunks(MOTIONS_PER_FIGURE).enumerate() {
        let height = trajectories::height(motions);
        add(Group::Trajectories, name("motions", part), "Angles of every motion".into(), height, &|area| {
            trajectories::whole(area, joints, motions)
        })?;
    }
    for (joint, words) in joints.iter().enumerate() {
        for (part, motions) in series.motions.chunks(MOTIONS_PER_FIGURE).enumerate() {
            let sigma = series.noise_nm.get(joint).copied();
            let (file, title) =
                (name(&format!("torque-{}", joint + 1), part), format!("Torque of the {words}"));
            add(Group::Torque, file, title, torque::height(motions), &|area| {
                torque::whole(area, words, joint, sigma, motions)
            })?;
        }
    }
    // A board may have sent no log, and never sends its cost above the optimum of its box.
    let is_determined = run.trace.is_some();
    if !is_determined || !series.motions.is_empty() {
        let (file, title) =
            ("residuals.svg".into(), "Distribution and autocorrelation of the residuals".into());
        add(Group::Residuals, file, title, residuals::height(joints.len()), &|area| {
            residuals::whole(area, joints, series)
        })?;
    }
    if !is_determined {
        let title = "Cost of the beetle swarm above the optimum".into();
        add(Group::Search, "search.svg".into(), title, 330, &|area| search::whole(area, series))?;
    }
    let rows = run.base_parameters.len() as u32;
    let title = format!("Base parameters: {}", parameters::what(run));
    add(Group::BaseParameters, "base-parameters.svg".into(), title, 90 + 24 * rows, &|area| {
        parameters::whole(area, run)
    })?;
    Ok(figures)
}

/// Base parameters of many runs of one leg about their truth.
pub(crate) fn spread(leg: &str, spreads: &[Spread]) -> Result<Figure, ToolError> {
    let file = "spread.svg".to_owned();
    let svg = render(WIDTH, spread::HEAD + 60 + 26 * spreads.len() as u32, &|area| {
        spread::whole(area, leg, spreads)
    })
    .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
    let title =
        format!("Base parameters of {leg} about their truth: runs, their mean and spread, in reported sigma");
    Ok(Figure { file, group: Group::BaseParameters, title, svg })
}

type Draw<'d> = &'d dyn Fn(&Area<'_>) -> Result<(), DrawingError>;

/// Writes the figures into a directory, creating it if necessary.
pub fn write(directory: &Path, figures: &[Figure]) -> Result<(), ToolError> {
    for figure in figures {
        files::write(&directory.join(&figure.file), &figure.svg)?;
    }
    Ok(())
}

/// `motions.svg`, then `motions-b.svg` and so on.
fn name(stem: &str, part: usize) -> String {
    match part {
        0 => format!("{stem}.svg"),
        1..26 => format!("{stem}-{}.svg", char::from(b'a' + part as u8)),
        _ => format!("{stem}-{}.svg", part + 1),
    }
}

/// Motion of `identify.svg`: gait at 3 s, where inertia, gravity and friction all matter; else the
/// last unused one.
fn shown_motion(series: &Series) -> Option<&scarab_identify::report::series::MotionSeries> {
    let unused = || series.motions.iter().filter(|motion| motion.role == Role::Validation);
    unused()
        .find(|motion| motion.name == "gait-3")
        .or_else(|| unused().next_back())
        .or(series.motions.first())
}
