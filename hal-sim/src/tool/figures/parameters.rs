//! Errors of the base parameters in reported standard deviations.

use plotters::chart::ChartBuilder;
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};

use super::super::report::{BaseReport, RunReport};
use super::super::tables::number;
use super::canvas::{Area, DARK, DrawingError, GRID, font, line, px, text};

const ONE_SIGMA: RGBColor = RGBColor(190, 205, 225);
const THREE_SIGMA: RGBColor = RGBColor(228, 235, 244);

/// With values, standard deviations and truths.
pub fn whole(area: &Area<'_>, run: &RunReport) -> Result<(), DrawingError> {
    let title = format!("{}: errors of the base parameters, bands of one and three sigma", run.leg);
    text(area, (12, 16), 14, HPos::Left, title)?;
    let (_, area) = area.split_vertically(px(30));
    dots(&area, run, (90, 260), &|base| {
        let (value, sigma) = (number(base.value), number(base.sigma));
        format!("{value} \u{b1} {sigma} {}, truth {}", base.unit, number(base.truth))
    })
}

/// With values alone.
pub fn small(area: &Area<'_>, run: &RunReport) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, "Base parameters: errors, bands of one and three sigma")?;
    let (_, area) = area.split_vertically(px(30));
    dots(&area, run, (56, 136), &|base| format!("{} {}", number(base.value), base.unit))
}

fn error(base: &BaseReport) -> Option<f64> {
    let sigma = base.sigma.known().filter(|sigma| *sigma > 0.0)?;
    Some((base.value.known()? - base.truth.known()?) / sigma)
}

/// One row for each; `margins` to the left and right in pixels hold names and `values`.
fn dots(
    area: &Area<'_>,
    run: &RunReport,
    (left, right): (i32, i32),
    values: &dyn Fn(&BaseReport) -> String,
) -> Result<(), DrawingError> {
    let bases = &run.base_parameters;
    let largest = bases.iter().filter_map(error).map(f64::abs).fold(3.5, f64::max);
    let (end, rows) = ((largest + 0.3).min(20.0), bases.len().max(1) as f64);
    let mut chart = ChartBuilder::on(area)
        .margin_left(px(left))
        .margin_right(px(right))
        .x_label_area_size(px(38))
        .build_cartesian_2d(-end..end, 0.0..rows)?;
    for (half, colour) in [(3.0, THREE_SIGMA), (1.0, ONE_SIGMA)] {
        chart.draw_series([Rectangle::new([(-half, 0.0), (half, rows)], colour.filled())])?;
    }
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .x_labels(7)
        .set_all_tick_mark_size(px(3))
        .label_style(font(11))
        .axis_desc_style(font(12))
        .x_desc("(value - truth) / sigma")
        .x_label_formatter(&|value| format!("{value:.0}"))
        .draw()?;
    chart.draw_series([PathElement::new(vec![(0.0, 0.0), (0.0, rows)], line(DARK, 3))])?;
    for (row, base) in bases.iter().enumerate() {
        let middle = rows - row as f64 - 0.5;
        if let Some(error) = error(base) {
            let dot = Circle::new((error.clamp(-end, end), middle), px(4), DARK.filled());
            chart.draw_series([dot])?;
        }
        // From the figure's corner to the area's own.
        let (x, y) = chart.backend_coord(&(end, middle));
        let (x0, y0) = area.get_base_pixel();
        let words = |words: String, x: i32, anchor| {
            Text::new(words, (x, y - y0), font(12).pos(Pos::new(anchor, VPos::Center)))
        };
        area.draw(&words(base.name.clone(), px(left - 8), HPos::Right))?;
        area.draw(&words(values(base), x - x0 + px(8), HPos::Left))?;
    }
    Ok(())
}
