//! The swarm's way down, and the commanded motions.

use plotters::chart::ChartBuilder;
use plotters::coord::combinators::IntoLogRange;
use plotters::element::PathElement;
use plotters::series::LineSeries;
use plotters::style::text_anchor::HPos;
use plotters::style::{RGBColor, ShapeStyle};

use super::super::series::CommandedSeries;
use super::canvas::{
    Area, Axes, DARK, DrawingError, GRID, MIDDLE, axes, font, legend, line, px, range, text,
};

/// Excesses below are drawn here, chi-square units: single precision of the cost hides what is smaller.
const SMALLEST_EXCESS: f64 = 1e-7;
/// Excess that moves no parameter by more than a fraction of its standard deviation.
const GOAL: f64 = 0.5;

/// Cost above the optimum after each iteration.
pub fn whole(area: &Area<'_>, excess: &[(u32, f64)]) -> Result<(), DrawingError> {
    text(area, (12, 16), 14, HPos::Left, "Beetle swarm: cost of its best above the optimum in its box")?;
    legend(area, (66, 38), &[("swarm", line(DARK, 6)), ("half a chi-square unit", line(MIDDLE, 12))])?;
    let (_, area) = area.split_vertically(px(50));
    let points: Vec<(f64, f64)> = excess
        .iter()
        .map(|(iteration, excess)| (f64::from(*iteration), excess.max(SMALLEST_EXCESS)))
        .collect();
    let last = points.last().map_or(1.0, |(iteration, _)| iteration.max(1.0));
    let largest = points.iter().map(|(_, excess)| *excess).fold(10.0, f64::max);
    let mut chart = ChartBuilder::on(&area)
        .margin_left(px(6))
        .margin_right(px(12))
        .margin_top(px(6))
        .x_label_area_size(px(38))
        .y_label_area_size(px(66))
        .build_cartesian_2d(0.0..last, (SMALLEST_EXCESS..largest * 3.0).log_scale())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .set_all_tick_mark_size(px(3))
        .x_labels(10)
        .y_labels(8)
        .label_style(font(11))
        .axis_desc_style(font(12))
        .x_desc("iterations")
        .y_desc("excess, chi-square units")
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("1e{:.0}", value.log10()))
        .draw()?;
    chart.draw_series([PathElement::new(vec![(0.0, GOAL), (last, GOAL)], line(MIDDLE, 12))])?;
    chart.draw_series(LineSeries::new(points, line(DARK, 6)))?;
    Ok(())
}

/// Commanded angles of all motions.
pub fn motions(area: &Area<'_>, joints: &[&str], motions: &[CommandedSeries]) -> Result<(), DrawingError> {
    let styles: [ShapeStyle; 3] = [line(DARK, 5), line(MIDDLE, 10), line(RGBColor(130, 165, 210), 16)];
    text(area, (12, 16), 14, HPos::Left, "Commanded angles")?;
    let entries: Vec<_> = joints.iter().copied().zip(styles).collect();
    legend(area, (56, 38), &entries)?;
    let (_, charts) = area.split_vertically(px(50));
    let angles = range(motions.iter().flat_map(|motion| motion.position_deg.iter().flatten()));
    for (index, (part, motion)) in charts.split_evenly((2, 2)).iter().zip(motions).enumerate() {
        let x_label = format!("time, s ({})", motion.motion);
        let frame = Axes {
            x: 0.0..motion.time_s.last().copied().unwrap_or(1.0),
            y: angles.clone(),
            x_label: &x_label,
            y_label: if index % 2 == 0 { "angle, degrees" } else { "" },
            x_ticks: 8,
            y_ticks: 6,
        };
        let mut chart = axes(part, &frame)?;
        for (position, style) in motion.position_deg.iter().zip(styles).rev() {
            let points = motion.time_s.iter().copied().zip(position.iter().copied());
            chart.draw_series(LineSeries::new(points, style))?;
        }
    }
    Ok(())
}
