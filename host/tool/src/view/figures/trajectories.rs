//! Angles over time: commanded, measured, and their deviation.

use plotters::style::text_anchor::HPos;
use plotters::style::{RGBColor, ShapeStyle};
use scarab_identify::report::series::MotionSeries;

use crate::view::figures::canvas::{
    Area, Axes, BLUE, DrawingError, GREEN, Key, LEFT, VERMILION, axes, legend, line, px, range, symmetric,
    text,
};
use crate::view::figures::curve;

/// Heights of one motion's title, angles and deviation; pixels.
const CELL: (i32, i32, i32) = (20, 140, 92);
/// Heights of one motion without commands.
const BARE_CELL: (i32, i32) = (20, 170);
/// Height of title and legend.
const HEAD: i32 = 56;

/// Colours of command and measurement of each joint.
const COLOURS: [(RGBColor, RGBColor); 3] =
    [(RGBColor(158, 198, 230), BLUE), (RGBColor(245, 195, 155), VERMILION), (RGBColor(160, 215, 198), GREEN)];

fn commanded(motions: &[MotionSeries]) -> bool {
    motions.iter().flat_map(|motion| &motion.joints).any(|curves| !curves.commanded_deg.is_empty())
}

pub(crate) fn height(motions: &[MotionSeries]) -> u32 {
    let cell = if commanded(motions) { CELL.0 + CELL.1 + CELL.2 } else { BARE_CELL.0 + BARE_CELL.1 };
    (HEAD + cell * motions.len().div_ceil(2) as i32).unsigned_abs()
}

fn style(joint: usize) -> (ShapeStyle, ShapeStyle) {
    let (pale, full) = COLOURS[joint % COLOURS.len()];
    (line(pale, 18), line(full, 5))
}

/// Draws title and legend.
fn head(area: &Area<'_>, joints: &[&str], with_commands: bool) -> Result<(), DrawingError> {
    let title =
        if with_commands { "Angles: commanded and measured, deviation below" } else { "Measured angles" };
    text(area, (12, 14), 13, HPos::Left, title)?;
    let words: Vec<(String, String)> =
        joints.iter().map(|name| (format!("{name}, commanded"), format!("{name}, measured"))).collect();
    let mut entries = Vec::new();
    for (joint, (command, measurement)) in words.iter().enumerate() {
        let (pale, full) = style(joint);
        if with_commands {
            entries.push((command.as_str(), Key::Curve(pale)));
        }
        entries.push((measurement.as_str(), Key::Curve(full)));
    }
    legend(area, (LEFT, 35), &entries)
}

/// Draws all motions, two side by side.
pub(crate) fn whole(area: &Area<'_>, joints: &[&str], motions: &[MotionSeries]) -> Result<(), DrawingError> {
    let with_commands = commanded(motions);
    head(area, joints, with_commands)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    let all = || motions.iter().flat_map(|motion| &motion.joints);
    let angles = range(all().flat_map(|curves| curves.measured_deg.iter().chain(&curves.commanded_deg)));
    let deviations =
        symmetric(all().flat_map(|curves| deviation(&curves.measured_deg, &curves.commanded_deg)), 0.0);
    let columns = motions.len().clamp(1, 2);
    let parts = cells.split_evenly((motions.len().div_ceil(2).max(1), columns));
    for (index, (part, motion)) in parts.iter().zip(motions).enumerate() {
        let label = |words| if index % 2 == 0 { words } else { "" };
        text(part, (LEFT, 10), 12, HPos::Left, format!("{} ({})", motion.name, motion.role.name()))?;
        let (_, part) = part.split_vertically(px(CELL.0));
        let (upper, lower) = part.split_vertically(px(if with_commands { CELL.1 } else { BARE_CELL.1 }));
        let first = motion.time_s.first().copied().unwrap_or(0.0);
        let begin = if first < 2.0 { first.min(0.0) } else { first };
        let end = motion.time_s.last().copied().unwrap_or(begin + 1.0);
        let top = Axes {
            x: begin..if end > begin { end } else { begin + 1.0 },
            y: angles.clone(),
            x_label: if with_commands { "" } else { "time, s" },
            y_label: label("angle, deg"),
            x_ticks: 8 / columns + 3,
            y_ticks: 6,
        };
        let mut chart = axes(&upper, &top)?;
        for (joint, curves) in motion.joints.iter().enumerate() {
            let (pale, full) = style(joint);
            let known = |values: &[f64]| values.iter().copied().map(Some).collect::<Vec<_>>();
            curve::draw(&mut chart, &motion.time_s, known(&curves.commanded_deg).into_iter(), pale)?;
            curve::draw(&mut chart, &motion.time_s, known(&curves.measured_deg).into_iter(), full)?;
        }
        if !with_commands {
            continue;
        }
        let bottom = Axes {
            y: deviations.clone(),
            x_label: "time, s",
            y_label: label("deviation, deg"),
            y_ticks: 4,
            ..top
        };
        let mut chart = axes(&lower, &bottom)?;
        for (joint, curves) in motion.joints.iter().enumerate() {
            let (_, full) = style(joint);
            let between = deviation(&curves.measured_deg, &curves.commanded_deg).map(Some);
            curve::draw(&mut chart, &motion.time_s, between, full)?;
        }
    }
    Ok(())
}

fn deviation<'a>(measured: &'a [f64], commanded: &'a [f64]) -> impl Iterator<Item = f64> + 'a {
    measured.iter().zip(commanded).map(|(measured, commanded)| measured - commanded)
}
