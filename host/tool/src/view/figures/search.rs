//! Descent of the swarm to the optimum of its box.

use plotters::chart::ChartBuilder;
use plotters::coord::combinators::IntoLogRange;
use plotters::element::PathElement;
use plotters::series::LineSeries;
use plotters::style::text_anchor::HPos;
use scarab_base::precision::plain;
use scarab_identify::report::series::Series;

use crate::view::figures::canvas::{
    Area, DARK, DrawingError, GRID, Key, VERMILION, font, legend, line, px, text,
};

/// Smallest drawn excess, chi-square units; single precision of the cost hides smaller ones.
const FLOOR: f64 = 1e-7;
/// Limit below which J_C - J_LS is rounding, chi-square units.
const SMALLEST_FLOOR: f64 = 1e-6;
/// Excess that moves no parameter by more than a fraction of its standard deviation.
const GOAL: f64 = 0.5;

/// Draws the cost above the optimum after each iteration.
pub(crate) fn whole(area: &Area<'_>, series: &Series) -> Result<(), DrawingError> {
    let floor = match series.floor_chi2 {
        Some(above) if above > SMALLEST_FLOOR => {
            format!(", which lies {} chi-square units above least squares", plain(above.into()))
        }
        Some(_) => ", which is that of least squares here".into(),
        None => String::new(),
    };
    let title = format!("Beetle swarm: cost of its best above the optimum of its box{floor}");
    text(area, (12, 14), 13, HPos::Left, title)?;
    let entries = [
        ("swarm, cold start", Key::Curve(line(DARK, 6))),
        ("half a chi-square unit", Key::Curve(line(VERMILION, 10))),
    ];
    legend(area, (66, 36), &entries)?;
    let known = series.excess.iter().filter(|(_, excess)| excess.is_finite());
    let points: Vec<(f64, f64)> =
        known.map(|(iteration, excess)| (f64::from(*iteration), excess.max(FLOOR))).collect();
    if points.is_empty() {
        return text(area, (66, 90), 12, HPos::Left, "There was no search to draw.");
    }
    let (_, area) = area.split_vertically(px(48));
    let last = points.last().map_or(1.0, |(iteration, _)| iteration.max(1.0));
    let largest = points.iter().map(|(_, excess)| *excess).fold(10.0, f64::max);
    let mut chart = ChartBuilder::on(&area)
        .margin_left(px(8))
        .margin_right(px(12))
        .margin_top(px(6))
        .x_label_area_size(px(36))
        .y_label_area_size(px(58))
        .build_cartesian_2d(0.0..last, (FLOOR..largest * 3.0).log_scale())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .set_all_tick_mark_size(px(3))
        .x_labels(10)
        .y_labels(8)
        .label_style(font(12))
        .axis_desc_style(font(12))
        .x_desc("iterations")
        .y_desc("cost \u{2212} optimum, chi-square units")
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("1e{:.0}", value.log10()).replace('-', "\u{2212}"))
        .draw()?;
    chart.draw_series([PathElement::new(vec![(0.0, GOAL), (last, GOAL)], line(VERMILION, 10))])?;
    chart.draw_series(LineSeries::new(points, line(DARK, 6)))?;
    Ok(())
}
