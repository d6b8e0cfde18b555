//! Figure 7 of the paper, reproduced: torque of the three-joint chain on the verification motion,
//! and its error over noise.

use plotters::element::{Circle, EmptyElement, PathElement, Rectangle};
use plotters::series::PointSeries;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, ShapeStyle};
use scarab_base::error::ToolError;
use scarab_tool::view::figures::canvas::{
    Area, Axes, DARK, DrawingError, Key, LEFT, PALE, SHADE, VERMILION, axes, legend, line, px, range, render,
    symmetric, text,
};
use scarab_tool::view::figures::{Figure, Group, WIDTH, curve};

/// Heights of title with legend, and of a joint; pixels.
const HEAD: i32 = 58;
const JOINT: i32 = 230;
/// Height of a joint's torque within [`JOINT`], pixels.
const TORQUE: i32 = 122;
/// Width of the curves over time, pixels; the rest is for the noise.
const TIME: i32 = 570;

/// Error of a method over time.
#[derive(Clone, Debug)]
pub struct Curve {
    /// Sequential method, else the one-time method.
    pub sequential: bool,
    /// Predicted minus noise-free torque, N m.
    pub nm: Vec<f64>,
}

/// Torque of one joint over time, all filtered.
#[derive(Clone, Debug)]
pub struct JointTorque<'n> {
    /// Name of the joint.
    pub name: &'n str,
    /// Time, s.
    pub time_s: Vec<f64>,
    /// Samples excluded because the joint is at rest.
    pub still: Vec<bool>,
    /// Measured torque, N m.
    pub measured: Vec<f64>,
    /// Noise-free torque, N m.
    pub real: Vec<f64>,
    /// Torque predicted by the one-time method, N m.
    pub predicted: Vec<f64>,
    /// Errors of both methods.
    pub errors: [Curve; 2],
}

/// Error of one joint by one method at one level of noise.
#[derive(Clone, Copy, Debug)]
pub struct Level {
    /// Noise, percent.
    pub noise_percent: f64,
    /// Joint, from 0.
    pub joint: usize,
    /// Sequential method, else the one-time method.
    pub sequential: bool,
    /// Error relative to the noise-free torque, percent.
    pub percent: f64,
}

fn style(sequential: bool) -> ShapeStyle {
    if sequential { line(VERMILION, 10) } else { line(DARK, 5) }
}

/// Draws `figure-7.svg`; `paper` are the paper's percentages.
pub fn drawn(joints: &[JointTorque<'_>], levels: &[Level], paper: &[f64]) -> Result<Figure, ToolError> {
    let file = "figure-7.svg".to_owned();
    let height = (HEAD + JOINT * joints.len().max(1) as i32).unsigned_abs();
    let svg = render(WIDTH, height, &|area| whole(area, joints, levels, paper))
        .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
    let title = "Torque of the three-joint chain on the verification motion, and its error over noise".into();
    Ok(Figure { file, group: Group::Torque, title, svg })
}

fn whole(
    area: &Area<'_>,
    joints: &[JointTorque<'_>],
    levels: &[Level],
    paper: &[f64],
) -> Result<(), DrawingError> {
    let title = "Verification motion: torque through the filter, error below; right: error over noise";
    text(area, (12, 14), 13, HPos::Left, title)?;
    let entries = [
        ("measured, 7 % noise", Key::Curve(line(PALE, 18))),
        ("noise-free", Key::Curve(line(VERMILION, 7))),
        ("predicted, one-time", Key::Curve(line(DARK, 4))),
        ("error: one-time", Key::Curve(style(false))),
        ("error: sequential", Key::Curve(style(true))),
        ("at rest", Key::Field(SHADE)),
    ];
    legend(area, (LEFT, 36), &entries)?;
    let (_, rows) = area.split_vertically(px(HEAD));
    for (index, (row, joint)) in rows.split_evenly((joints.len().max(1), 1)).iter().zip(joints).enumerate() {
        let (left, right) = row.split_horizontally(px(TIME));
        over_time(&left, joint)?;
        let own: Vec<_> = levels.iter().filter(|level| level.joint == index).copied().collect();
        over_noise(&right, joint.name, &own, paper.get(index).copied())?;
    }
    Ok(())
}

fn over_time(area: &Area<'_>, joint: &JointTorque<'_>) -> Result<(), DrawingError> {
    let (upper, lower) = area.split_vertically(px(TORQUE));
    let ends = joint.time_s.first().copied().unwrap_or(0.0)..joint.time_s.last().copied().unwrap_or(1.0);
    let y_label = format!("{}, N m", joint.name);
    let all =
        joint.measured.iter().filter(|torque| torque.is_finite()).chain(&joint.real).chain(&joint.predicted);
    let frame = Axes { x: ends, y: range(all), x_label: "", y_label: &y_label, x_ticks: 9, y_ticks: 5 };
    let mut chart = axes(&upper, &frame)?;
    curve::shade(&mut chart, &frame.y, &joint.time_s, &joint.still, SHADE)?;
    for (values, style) in [
        (&joint.measured, line(PALE, 18)),
        (&joint.real, line(VERMILION, 7)),
        (&joint.predicted, line(DARK, 4)),
    ] {
        curve::draw(&mut chart, &joint.time_s, values.iter().copied().map(Some), style)?;
    }
    let moving = |errors: &Curve| -> Vec<Option<f64>> {
        errors.nm.iter().zip(&joint.still).map(|(error, still)| (!still).then_some(*error)).collect()
    };
    let largest = symmetric(joint.errors.iter().flat_map(|errors| moving(errors).into_iter().flatten()), 0.0);
    let frame = Axes { y: largest, x_label: "time, s", y_label: "error, N m", y_ticks: 4, ..frame };
    let mut chart = axes(&lower, &frame)?;
    curve::shade(&mut chart, &frame.y, &joint.time_s, &joint.still, SHADE)?;
    for errors in joint.errors.iter().rev() {
        curve::draw(&mut chart, &joint.time_s, moving(errors).into_iter(), style(errors.sequential))?;
    }
    Ok(())
}

fn over_noise(area: &Area<'_>, name: &str, levels: &[Level], paper: Option<f64>) -> Result<(), DrawingError> {
    let most = levels.iter().map(|level| level.percent).chain(paper).fold(0.0, f64::max);
    let last = levels.iter().map(|level| level.noise_percent).fold(1.0, f64::max);
    let y_label = format!("{name}: error, %");
    let frame = Axes {
        x: 0.0..1.04 * last,
        y: 0.0..1.1 * most,
        x_label: "noise, % of mean abs torque",
        y_label: &y_label,
        x_ticks: 6,
        y_ticks: 6,
    };
    let mut chart = axes(area, &frame)?;
    if let Some(paper) = paper {
        chart.draw_series([PathElement::new(vec![(0.0, paper), (1.04 * last, paper)], line(PALE, 14))])?;
        let (x, y) = chart.backend_coord(&(0.03 * last, paper));
        let (left, top) = area.get_base_pixel();
        let words = format!("paper, its plant: {paper} %");
        let at = ((x - left) / px(1), (y - top) / px(1) + if paper > 0.85 * most { 10 } else { -10 });
        text(area, at, 11, HPos::Left, words)?;
    }
    for sequential in [true, false] {
        let points: Vec<_> = levels
            .iter()
            .filter(|level| level.sequential == sequential)
            .map(|level| (level.noise_percent, level.percent))
            .collect();
        let colour = if sequential { VERMILION } else { DARK };
        chart.draw_series([PathElement::new(points.clone(), style(sequential))])?;
        if sequential {
            chart.draw_series(PointSeries::of_element(
                points,
                px(3),
                colour.filled(),
                &|at, size, style| {
                    EmptyElement::at(at) + Rectangle::new([(-size, -size), (size, size)], style)
                },
            ))?;
        } else {
            chart.draw_series(points.into_iter().map(|at| Circle::new(at, px(3), colour.filled())))?;
        }
    }
    Ok(())
}
