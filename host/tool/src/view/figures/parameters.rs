//! Errors of the base parameters in reported standard deviations; without a known truth, standard
//! deviations in percent of the value.

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::combinators::IntoLogRange;
use plotters::coord::ranged1d::{Ranged, ValueFormatter};
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::prelude::{Cartesian2d, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{Color, RGBColor};
use scarab_base::precision::{sigma, value};
use scarab_identify::report::{BaseReport, RunReport};

use crate::view::figures::canvas::{Area, DARK, DrawingError, GRID, font, line, px, text, unit};

pub(crate) const ONE_SIGMA: RGBColor = RGBColor(190, 205, 225);
pub(crate) const THREE_SIGMA: RGBColor = RGBColor(228, 235, 244);

/// Draws values, standard deviations and truths.
pub(crate) fn whole(area: &Area<'_>, run: &RunReport) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, format!("{}: {}", run.leg, what(run)))?;
    let (_, area) = area.split_vertically(px(30));
    dots(&area, run, (90, 260), &|base| {
        if base.value.known().is_none() {
            return NOT_DETERMINED.into();
        }
        let (found, deviation) = (value(base.value, base.sigma), sigma(base.sigma));
        let truth = base.truth.known().map(|truth| value(truth.into(), base.sigma));
        let truth = truth.map_or(String::new(), |truth| format!(", truth {truth}"));
        format!("{found} \u{b1} {deviation} {}{truth}", unit(base.unit))
    })
}

/// Draws the values only.
pub(crate) fn small(area: &Area<'_>, run: &RunReport) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, format!("Base parameters: {}", what(run)))?;
    let (_, area) = area.split_vertically(px(30));
    dots(&area, run, (56, 136), &|base| match base.value.known() {
        Some(_) => format!("{} {}", value(base.value, base.sigma), unit(base.unit)),
        None => NOT_DETERMINED.into(),
    })
}

/// Text in place of a value.
const NOT_DETERMINED: &str = "not determined";

/// Title of the figure: it depends on whether the truth is known.
pub(crate) fn what(run: &RunReport) -> &'static str {
    if truth_is_known(run) { "errors, bands of one and three sigma" } else { "sigma in percent of the value" }
}

fn truth_is_known(run: &RunReport) -> bool {
    run.base_parameters.iter().any(|base| base.truth.known().is_some())
}

/// Standard deviation in percent of the value.
fn uncertainty(base: &BaseReport) -> Option<f64> {
    let (found, deviation) = (base.value.known()?, base.sigma.known().filter(|sigma| *sigma > 0.0)?);
    Some(100.0 * deviation / found.abs())
}

fn error(base: &BaseReport) -> Option<f64> {
    let sigma = base.sigma.known().filter(|sigma| *sigma > 0.0)?;
    Some((base.value.known()? - base.truth.known()?) / sigma)
}

/// Draws one row per parameter; `margins` in pixels to the left and right hold names and `values`.
fn dots(
    area: &Area<'_>,
    run: &RunReport,
    margins: (i32, i32),
    values: &dyn Fn(&BaseReport) -> String,
) -> Result<(), DrawingError> {
    let bases = &run.base_parameters;
    let rows = bases.len().max(1) as f64;
    if truth_is_known(run) {
        let largest = bases.iter().filter_map(error).map(f64::abs).fold(3.5, f64::max);
        let end = (largest + 0.3).min(20.0);
        let mut chart = frame(area, margins).build_cartesian_2d(-end..end, 0.0..rows)?;
        sigma_axis(&mut chart, rows)?;
        let position = |base: &BaseReport| error(base).map(|error| error.clamp(-end, end));
        rows_of(area, &mut chart, bases, margins, &position, values)
    } else {
        let mut chart =
            frame(area, margins).build_cartesian_2d((PERCENT.0..PERCENT.1).log_scale(), 0.0..rows)?;
        for (limit, colour) in [(100.0, THREE_SIGMA), (5.0, ONE_SIGMA)] {
            chart.draw_series([Rectangle::new([(PERCENT.0, 0.0), (limit, rows)], colour.filled())])?;
        }
        mesh(&mut chart, "sigma, % of the value (bands: below 5 % and below 100 %)", &|value| {
            format!("{value}")
        })?;
        let position =
            |base: &BaseReport| uncertainty(base).map(|percent| percent.clamp(PERCENT.0, PERCENT.1));
        rows_of(area, &mut chart, bases, margins, &position, values)
    }
}

/// Ends of the logarithmic axis.
const PERCENT: (f64, f64) = (0.01, 1000.0);

/// Reserves space for names and values beside the axes.
pub fn frame<'a, 'b>(area: &'a Area<'b>, (left, right): (i32, i32)) -> ChartBuilder<'a, 'b, SVGBackend<'b>> {
    let mut builder = ChartBuilder::on(area);
    builder.margin_left(px(left)).margin_right(px(right)).x_label_area_size(px(36));
    builder
}

/// Axis of errors in sigma: bands of one and three, a line at zero.
pub(crate) fn sigma_axis(
    chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<RangedCoordf64, RangedCoordf64>>,
    rows: f64,
) -> Result<(), DrawingError> {
    for (half, colour) in [(3.0, THREE_SIGMA), (1.0, ONE_SIGMA)] {
        chart.draw_series([Rectangle::new([(-half, 0.0), (half, rows)], colour.filled())])?;
    }
    mesh(chart, "(value \u{2212} truth) / sigma", &|value| format!("{value:.0}").replace('-', "\u{2212}"))?;
    chart.draw_series([PathElement::new(vec![(0.0, 0.0), (0.0, rows)], line(DARK, 3))]).map(|_| ())
}

/// Draws vertical grid lines from one numeric axis.
pub(crate) fn mesh<'b, X: Ranged<ValueType = f64> + ValueFormatter<f64>>(
    chart: &mut ChartContext<'_, SVGBackend<'b>, Cartesian2d<X, RangedCoordf64>>,
    label: &str,
    numbers: &dyn Fn(&f64) -> String,
) -> Result<(), DrawingError> {
    chart
        .configure_mesh()
        .disable_y_mesh()
        .disable_y_axis()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .x_labels(7)
        .set_all_tick_mark_size(px(3))
        .label_style(font(12))
        .axis_desc_style(font(12))
        .x_desc(label)
        .x_label_formatter(numbers)
        .draw()
}

fn rows_of<X: Ranged<ValueType = f64>>(
    area: &Area<'_>,
    chart: &mut ChartContext<'_, SVGBackend<'_>, Cartesian2d<X, RangedCoordf64>>,
    bases: &[BaseReport],
    margins: (i32, i32),
    position: &dyn Fn(&BaseReport) -> Option<f64>,
    values: &dyn Fn(&BaseReport) -> String,
) -> Result<(), DrawingError> {
    let rows = bases.len().max(1) as f64;
    for (row, base) in bases.iter().enumerate() {
        let middle = rows - row as f64 - 0.5;
        let at = position(base);
        let (_, y) = chart.backend_coord(&(at.unwrap_or(1.0), middle));
        if let Some(at) = at {
            chart.draw_series([Circle::new((at, middle), px(4), DARK.filled())])?;
        }
        labels(area, y, margins, (base.name.clone(), values(base)))?;
    }
    Ok(())
}

/// Writes a name to the left and text to the right of a row at `y`, relative to the figure's corner.
pub(crate) fn labels(
    area: &Area<'_>,
    y: i32,
    (left, right): (i32, i32),
    (name, words): (String, String),
) -> Result<(), DrawingError> {
    let (width, _) = area.dim_in_pixel();
    // Offset between the figure's corner and the area's own.
    let (_, y0) = area.get_base_pixel();
    let text = |words: String, x: i32, anchor| {
        Text::new(words, (x, y - y0), font(12).pos(Pos::new(anchor, VPos::Center)))
    };
    area.draw(&text(name, px(left - 8), HPos::Right))?;
    area.draw(&text(words.replace('-', "\u{2212}"), width as i32 - px(right - 8), HPos::Left))
}
