//! Figures of a run as SVG, 900 pixels wide.
//!
//! | file | shows |
//! | --- | --- |
//! | `torque-1.svg`, ... | a joint's measured, predicted and noise-free torque on the unused motions, residuals below |
//! | `base-parameters.svg` | errors of the base parameters in reported standard deviations |
//! | `search.svg` | the swarm's cost above the optimum in its box over its iterations |
//! | `motions.svg` | commanded angles |
//! | `identify.svg` | one unused motion and the base parameters, small |
//!
//! `docs/figures/identify.svg` is this `identify.svg`: `cargo sim && cp target/sim/identify.svg docs/figures/`.
//!
//! Curves differ in lightness and width, so they can be told apart in grey. Drawn at four times the size with a
//! `viewBox` of that size, since the backend rounds to whole pixels.

mod canvas;
mod parameters;
mod search;
mod torque;

use std::path::Path;

use super::error::ToolError;
use super::report::RunReport;
use super::series::Series;
use canvas::{Area, DrawingError, render};

/// Width of every figure, pixels.
const WIDTH: u32 = 900;

/// Draws all figures of a run into a directory, which is made if need be; `joints` are their names.
pub fn write(directory: &Path, joints: &[&str], run: &RunReport, series: &Series) -> Result<(), ToolError> {
    std::fs::create_dir_all(directory).map_err(|error| ToolError::cannot_write(directory, &error))?;
    let save = |name: &str, height: u32, draw: &dyn Fn(&Area<'_>) -> Result<(), DrawingError>| {
        let path = directory.join(name);
        let svg = render(WIDTH, height, draw).map_err(|error| ToolError::cannot_write(&path, &error))?;
        std::fs::write(&path, svg).map_err(|error| ToolError::cannot_write(&path, &error))
    };
    for (joint, name) in joints.iter().enumerate() {
        save(&format!("torque-{}.svg", joint + 1), 440, &|area| {
            let motions: Vec<_> = series.torque.iter().filter_map(|motion| motion.get(joint)).collect();
            torque::whole(area, name, &motions)
        })?;
    }
    let rows = run.base_parameters.len() as u32;
    save("base-parameters.svg", 90 + 24 * rows, &|area| parameters::whole(area, run))?;
    save("search.svg", 340, &|area| search::whole(area, &series.excess))?;
    save("motions.svg", 460, &|area| search::motions(area, joints, &series.commanded))?;
    save("identify.svg", torque::small_height(joints.len()), &|area| {
        let motion = series.torque.get(SHOWN_MOTION).map_or(&[][..], Vec::as_slice);
        let (left, right) = area.split_horizontally(canvas::px(480));
        torque::small(&left, joints, motion)?;
        parameters::small(&right, run)
    })
}

/// The motion of `identify.svg`: gait at 3 s, where inertia, gravity and friction all matter.
const SHOWN_MOTION: usize = 1;
