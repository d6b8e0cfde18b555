//! Torque over time: measured, predicted, noise-free, and what is left.

use plotters::element::Rectangle;
use plotters::series::LineSeries;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, ShapeStyle};

use super::super::series::TorqueSeries;
use super::canvas::{
    Area, Axes, Chart, DARK, DrawingError, MIDDLE, PALE, SHADE, axes, legend, line, px, range, text,
};

/// Of one joint in the small figure, pixels.
const JOINT_HEIGHT: i32 = 181;
/// Of title and legends there.
const REST_HEIGHT: i32 = 68;

/// Of the small figure, pixels.
pub fn small_height(joints: usize) -> u32 {
    (REST_HEIGHT + JOINT_HEIGHT * joints as i32).unsigned_abs()
}

fn measured() -> ShapeStyle {
    line(PALE, 20)
}

fn noise_free() -> ShapeStyle {
    line(MIDDLE, 10)
}

fn predicted() -> ShapeStyle {
    line(DARK, 4)
}

/// Of measured minus predicted.
fn measured_error() -> ShapeStyle {
    line(PALE, 5)
}

/// One joint on all motions.
pub fn whole(area: &Area<'_>, joint: &str, motions: &[&TorqueSeries]) -> Result<(), DrawingError> {
    text(
        area,
        (12, 16),
        14,
        HPos::Left,
        format!("{joint}: torque on motions that were not identified from"),
    )?;
    curve_legend(area, 38)?;
    let (_, charts) = area.split_vertically(px(52));
    let (upper, lower) = charts.split_vertically(px(222));
    let (lower, foot) = lower.split_vertically(px(140));
    error_legend(&foot, 12)?;
    let torque = common_range(motions.iter().copied());
    let error = error_range(motions.iter().copied());
    let count = motions.len().max(1);
    for (index, ((upper, lower), motion)) in
        upper.split_evenly((1, count)).iter().zip(lower.split_evenly((1, count))).zip(motions).enumerate()
    {
        let label = |words| if index == 0 { words } else { "" };
        let top = Axes {
            x: 0.0..end(motion),
            y: torque.clone(),
            x_label: "",
            y_label: label("torque, N m"),
            x_ticks: 6,
            y_ticks: 7,
        };
        curves(upper, &top, motion)?;
        let x_label = format!("time, s ({})", motion.motion);
        let bottom =
            Axes { y: error.clone(), x_label: &x_label, y_label: label("error, N m"), y_ticks: 5, ..top };
        errors(&lower, &bottom, motion)?;
    }
    Ok(())
}

/// All joints on one motion.
pub fn small(area: &Area<'_>, joints: &[&str], motion: &[TorqueSeries]) -> Result<(), DrawingError> {
    let name = motion.first().map_or("", |curve| curve.motion);
    text(area, (12, 14), 13, HPos::Left, format!("Torque on an unused motion ({name})"))?;
    curve_legend(area, 34)?;
    let (_, charts) = area.split_vertically(px(46));
    let (charts, foot) = charts.split_vertically(px(JOINT_HEIGHT * joints.len() as i32));
    error_legend(&foot, 10)?;
    let parts = charts.split_evenly((joints.len().max(1), 1));
    for (index, ((part, joint), curve)) in parts.iter().zip(joints).zip(motion).enumerate() {
        let last = index + 1 == joints.len();
        let (upper, lower) = part.split_vertically(px(JOINT_HEIGHT * 3 / 5));
        let y_label = format!("{joint}, N m");
        let top = Axes {
            x: 0.0..end(curve),
            y: common_range([curve].into_iter()),
            x_label: "",
            y_label: &y_label,
            x_ticks: 8,
            y_ticks: 5,
        };
        curves(&upper, &top, curve)?;
        let x_label = if last { "time, s" } else { "" };
        errors(
            &lower,
            &Axes { y: error_range([curve].into_iter()), x_label, y_label: "error, N m", y_ticks: 3, ..top },
            curve,
        )?;
    }
    Ok(())
}

fn curve_legend(area: &Area<'_>, y: i32) -> Result<(), DrawingError> {
    let entries = [("measured", measured()), ("noise-free", noise_free()), ("predicted", predicted())];
    legend(area, (56, y), &entries)
}

fn error_legend(area: &Area<'_>, y: i32) -> Result<(), DrawingError> {
    let entries = [
        ("measured - predicted", measured_error()),
        ("noise-free - predicted", noise_free()),
        ("joint sticks", line(SHADE, 40)),
    ];
    legend(area, (14, y), &entries)
}

fn end(motion: &TorqueSeries) -> f64 {
    motion.time_s.last().copied().unwrap_or(1.0)
}

fn common_range<'a>(motions: impl Iterator<Item = &'a TorqueSeries>) -> std::ops::Range<f64> {
    range(
        motions.flat_map(|motion| motion.measured.iter().chain(&motion.predicted).chain(&motion.noise_free)),
    )
}

/// Symmetric, of the instants at which the joint moves.
fn error_range<'a>(motions: impl Iterator<Item = &'a TorqueSeries>) -> std::ops::Range<f64> {
    let largest = motions
        .flat_map(|motion| {
            let errors = motion.measured.iter().zip(&motion.predicted).zip(&motion.sticks);
            errors
                .filter(|(_, sticks)| !**sticks)
                .map(|((measured, predicted), _)| (measured - predicted).abs())
        })
        .fold(0.0, f64::max);
    let end = if largest > 0.0 { 1.1 * largest } else { 1.0 };
    -end..end
}

fn curves(area: &Area<'_>, frame: &Axes<'_>, motion: &TorqueSeries) -> Result<(), DrawingError> {
    let mut chart = axes(area, frame)?;
    shade(&mut chart, frame, motion)?;
    let time = || motion.time_s.iter().copied();
    chart.draw_series(LineSeries::new(time().zip(motion.measured.iter().copied()), measured()))?;
    chart.draw_series(LineSeries::new(time().zip(motion.noise_free.iter().copied()), noise_free()))?;
    chart.draw_series(LineSeries::new(time().zip(motion.predicted.iter().copied()), predicted()))?;
    Ok(())
}

fn errors(area: &Area<'_>, frame: &Axes<'_>, motion: &TorqueSeries) -> Result<(), DrawingError> {
    let mut chart = axes(area, frame)?;
    shade(&mut chart, frame, motion)?;
    // What leaves the frame, where the joint sticks, stops at its edge.
    let error = |torque: &[f64]| -> Vec<(f64, f64)> {
        let errors = torque.iter().zip(&motion.predicted).map(|(torque, predicted)| torque - predicted);
        motion
            .time_s
            .iter()
            .copied()
            .zip(errors.map(|error| error.clamp(frame.y.start, frame.y.end)))
            .collect()
    };
    chart.draw_series(LineSeries::new(error(&motion.measured), measured_error()))?;
    chart.draw_series(LineSeries::new(error(&motion.noise_free), noise_free()))?;
    Ok(())
}

/// Marks the stretches in which the joint sticks.
fn shade(chart: &mut Chart<'_, '_>, frame: &Axes<'_>, motion: &TorqueSeries) -> Result<(), DrawingError> {
    let mut from: Option<f64> = None;
    let mut stretches = Vec::new();
    for (time, sticks) in motion.time_s.iter().zip(&motion.sticks) {
        match (from, sticks) {
            (None, true) => from = Some(*time),
            (Some(begun), false) => {
                stretches.push((begun, *time));
                from = None;
            }
            _ => {}
        }
    }
    stretches.extend(from.map(|begun| (begun, end(motion))));
    let bars = stretches
        .into_iter()
        .map(|(begun, ended)| Rectangle::new([(begun, frame.y.start), (ended, frame.y.end)], SHADE.filled()));
    chart.draw_series(bars)?;
    Ok(())
}
