//! Torque over time: measured, predicted, noise-free, and residual.

use plotters::element::Rectangle;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, ShapeStyle};
use scarab_identify::report::series::{JointCurves, MotionSeries};

use crate::view::figures::canvas::{
    Area, Axes, BAND, BLUE, DARK, DrawingError, Key, LEFT, PALE, SHADE, VERMILION, axes, legend, line, px,
    range, symmetric, text,
};
use crate::view::figures::curve;

/// Heights of one motion's title, torque and residual; pixels.
const CELL: (i32, i32, i32) = (20, 150, 102);
/// Height of title and two lines of legend.
const HEAD: i32 = 64;
/// Height of one joint in the small figure, pixels.
const JOINT_HEIGHT: i32 = 181;
/// Height of title and legends in the small figure.
const REST_HEIGHT: i32 = 74;

pub(crate) fn small_height(joints: usize) -> u32 {
    (REST_HEIGHT + JOINT_HEIGHT * joints.max(1) as i32).unsigned_abs()
}

pub(crate) fn height(motions: &[MotionSeries]) -> u32 {
    let (title, upper, lower) = CELL;
    (HEAD + (title + upper + lower) * motions.len().div_ceil(2) as i32).unsigned_abs()
}

fn measured() -> ShapeStyle {
    line(PALE, 18)
}

fn noise_free() -> ShapeStyle {
    line(VERMILION, 7)
}

fn predicted() -> ShapeStyle {
    line(DARK, 4)
}

/// Entries of the curves in the residual's frame: the noise-free one is known of a simulated leg only.
fn residuals(is_simulated: bool) -> impl Iterator<Item = (&'static str, Key)> {
    let noise_free = is_simulated.then(|| ("noise-free \u{2212} predicted", Key::Curve(noise_free())));
    std::iter::once(("measured \u{2212} predicted", Key::Curve(measured_error()))).chain(noise_free)
}

/// Style of measured minus predicted torque.
fn measured_error() -> ShapeStyle {
    line(BLUE, 3)
}

/// Draws one joint on all motions, two side by side; `sigma` is the noise of its filtered torque.
pub(crate) fn whole(
    area: &Area<'_>,
    name: &str,
    joint: usize,
    sigma: Option<f64>,
    motions: &[MotionSeries],
) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, format!("{name}: torque through the filter, and residual below"))?;
    let curves: Vec<_> =
        motions.iter().filter_map(|motion| Some((motion, motion.joints.get(joint)?))).collect();
    let simulated = curves.iter().any(|(_, curves)| !curves.noise_free_nm.is_empty());
    let mut entries = vec![("measured", Key::Curve(measured())), ("predicted", Key::Curve(predicted()))];
    if simulated {
        entries.push(("noise-free", Key::Curve(noise_free())));
    }
    entries.extend(residuals(simulated));
    entries
        .extend([("\u{b1}2 sigma of the noise", Key::Field(BAND)), ("at rest, excluded", Key::Field(SHADE))]);
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    let torque = range(curves.iter().flat_map(|(_, curves)| torques(curves)));
    let error =
        symmetric(curves.iter().flat_map(|(_, curves)| errors_seen(curves)), 2.5 * sigma.unwrap_or(0.0));
    let columns = curves.len().clamp(1, 2);
    let parts = cells.split_evenly((curves.len().div_ceil(2).max(1), columns));
    for (index, (part, (motion, curves))) in parts.iter().zip(&curves).enumerate() {
        let label = |words| if index % 2 == 0 { words } else { "" };
        text(part, (LEFT, 10), 12, HPos::Left, format!("{} ({})", motion.name, motion.role.name()))?;
        let (_, part) = part.split_vertically(px(CELL.0));
        let (upper, lower) = part.split_vertically(px(CELL.1));
        let top = Axes {
            x: ends(motion),
            y: torque.clone(),
            x_label: "",
            y_label: label("torque, N m"),
            x_ticks: 8 / columns + 3,
            y_ticks: 6,
        };
        draw_torque(&upper, &top, motion, curves)?;
        let bottom =
            Axes { y: error.clone(), x_label: "time, s", y_label: label("residual, N m"), y_ticks: 4, ..top };
        draw_error(&lower, &bottom, motion, curves, sigma)?;
    }
    Ok(())
}

/// Draws all joints on one motion.
pub(crate) fn small(area: &Area<'_>, joints: &[&str], motion: &MotionSeries) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, format!("Torque on {} ({})", motion.name, motion.role.name()))?;
    let mut entries = vec![("measured", Key::Curve(measured())), ("predicted", Key::Curve(predicted()))];
    let simulated = motion.joints.iter().any(|curves| !curves.noise_free_nm.is_empty());
    if simulated {
        entries.push(("noise-free", Key::Curve(noise_free())));
    }
    entries.push(("at rest", Key::Field(SHADE)));
    legend(area, (LEFT, 34), &entries)?;
    let (_, charts) = area.split_vertically(px(44));
    let (charts, foot) = charts.split_vertically(px(JOINT_HEIGHT * joints.len().max(1) as i32));
    legend(&foot, (LEFT, 14), &residuals(simulated).collect::<Vec<_>>())?;
    let parts = charts.split_evenly((joints.len().max(1), 1));
    for (index, ((part, joint), curves)) in parts.iter().zip(joints).zip(&motion.joints).enumerate() {
        let last = index + 1 == joints.len();
        let (upper, lower) = part.split_vertically(px(JOINT_HEIGHT * 3 / 5));
        let y_label = format!("{joint}, N m");
        let top = Axes {
            x: ends(motion),
            y: range(torques(curves)),
            x_label: "",
            y_label: &y_label,
            x_ticks: 8,
            y_ticks: 5,
        };
        draw_torque(&upper, &top, motion, curves)?;
        let x_label = if last { "time, s" } else { "" };
        let error = symmetric(errors_seen(curves), 0.0);
        draw_error(
            &lower,
            &Axes { y: error, x_label, y_label: "residual, N m", y_ticks: 3, ..top },
            motion,
            curves,
            None,
        )?;
    }
    Ok(())
}

fn ends(motion: &MotionSeries) -> std::ops::Range<f64> {
    match (motion.time_s.first(), motion.time_s.last()) {
        (Some(first), Some(last)) if last > first => {
            first.min(if *first < 2.0 { 0.0 } else { *first })..*last
        }
        _ => 0.0..1.0,
    }
}

fn torques(curves: &JointCurves) -> impl Iterator<Item = &f64> {
    curves.measured_nm.iter().chain(&curves.predicted_nm).chain(&curves.noise_free_nm)
}

/// Residuals that the axis must show: measured ones while the joint moves.
fn errors_seen(curves: &JointCurves) -> impl Iterator<Item = f64> + '_ {
    curves.residual_nm().flatten()
}

fn draw_torque(
    area: &Area<'_>,
    frame: &Axes<'_>,
    motion: &MotionSeries,
    curves: &JointCurves,
) -> Result<(), DrawingError> {
    let mut chart = axes(area, frame)?;
    curve::shade(&mut chart, &frame.y, &motion.time_s, &curves.still, SHADE)?;
    for (values, style) in [
        (&curves.measured_nm, measured()),
        (&curves.noise_free_nm, noise_free()),
        (&curves.predicted_nm, predicted()),
    ] {
        curve::draw(&mut chart, &motion.time_s, values.iter().copied().map(Some), style)?;
    }
    Ok(())
}

fn draw_error(
    area: &Area<'_>,
    frame: &Axes<'_>,
    motion: &MotionSeries,
    curves: &JointCurves,
    sigma: Option<f64>,
) -> Result<(), DrawingError> {
    let mut chart = axes(area, frame)?;
    let ends = (frame.x.start, frame.x.end);
    if let Some(sigma) = sigma {
        let half = (2.0 * sigma).min(frame.y.end);
        chart.draw_series([Rectangle::new([(ends.0, -half), (ends.1, half)], BAND.filled())])?;
    }
    curve::shade(&mut chart, &frame.y, &motion.time_s, &curves.still, SHADE)?;
    let within = |error: f64| error.clamp(frame.y.start, frame.y.end);
    curve::draw(
        &mut chart,
        &motion.time_s,
        curves.residual_nm().map(|error| error.map(within)),
        measured_error(),
    )?;
    let noise_free_error = curves
        .noise_free_nm
        .iter()
        .zip(&curves.predicted_nm)
        .zip(&curves.still)
        .map(|((torque, predicted), still)| (!still).then(|| within(torque - predicted)));
    curve::draw(&mut chart, &motion.time_s, noise_free_error, noise_free())
}
