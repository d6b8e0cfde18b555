//! Paths of swarms on a function of the plane: over contours, over iterations, and convergence.

use std::ops::Range;

use contour::ContourBuilder;
use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::combinators::{IntoLogRange, LogCoord};
use plotters::coord::types::RangedCoordf64;
use plotters::element::{Circle, Cross, PathElement, Polygon};
use plotters::prelude::{Cartesian2d, SVGBackend};
use plotters::series::DashedLineSeries;
use plotters::style::text_anchor::HPos;
use plotters::style::{Color, RGBColor, ShapeStyle};
use scarab::swarm::{Objective, TestProblem};
use scarab_base::error::ToolError;
use scarab_tool::view::figures::canvas::{
    Area, Axes, BLUE, Chart, DARK, DrawingError, GREEN, GRID, Key, LEFT, VERMILION, axes, font, legend, line,
    px, render, text,
};
use scarab_tool::view::figures::{Figure, Group, WIDTH};

/// Heights of the contour maps, the curves, and title with legend; pixels.
const MAPS: u32 = 420;
const CURVES: u32 = 310;
const HEAD: u32 = 54;
/// Points of the contour grid along each axis.
const GRID_POINTS: usize = 101;
/// Share of the window's values that lie below each contour.
const LEVELS: [f64; 6] = [0.02, 0.08, 0.2, 0.4, 0.65, 0.9];
/// Smallest drawn value; the searches are not used beyond it.
const FLOOR: f64 = 1e-10;
/// Colour of the contours.
const LEVEL: RGBColor = RGBColor(165, 165, 165);

/// Path of the best beetle.
pub struct Walk {
    /// Name of the search.
    pub name: &'static str,
    /// Position after each iteration.
    pub positions: Vec<[f64; 2]>,
}

/// Evaluations between two points of a curve.
const STRIDE: usize = 5;

/// Quartiles of many curves.
pub struct Band {
    /// Iterations or evaluations from one value to the next.
    spacing: usize,
    low: Vec<f64>,
    middle: Vec<f64>,
    high: Vec<f64>,
}

impl Band {
    /// Quartiles over iterations, up to the length of the shortest curve.
    pub fn over_iterations(curves: &[&[f64]]) -> Self {
        Self::new(curves, 1)
    }

    /// Quartiles over evaluations, one value per `STRIDE`.
    pub fn over_evaluations(curves: &[&[f64]]) -> Self {
        Self::new(curves, STRIDE)
    }

    fn new(curves: &[&[f64]], spacing: usize) -> Self {
        let length = curves.iter().map(|curve| curve.len()).min().unwrap_or(0);
        let mut band = Self { spacing, low: Vec::new(), middle: Vec::new(), high: Vec::new() };
        for index in (0..length).step_by(spacing) {
            let mut values: Vec<f64> = curves.iter().filter_map(|curve| curve.get(index)).copied().collect();
            values.sort_unstable_by(f64::total_cmp);
            let at = |share: f64| values.get((share * (values.len() - 1) as f64).round() as usize).copied();
            for (list, share) in [(&mut band.low, 0.25), (&mut band.middle, 0.5), (&mut band.high, 0.75)] {
                list.extend(at(share).map(|value| value.max(FLOOR)));
            }
        }
        band
    }
}

/// Convergence of one search.
pub struct Convergence {
    /// Name of the search.
    pub name: &'static str,
    /// f - f* after every iteration.
    pub by_iteration: Band,
    /// f - f* after every evaluation.
    pub by_evaluation: Band,
}

/// Colour, width and dashes of a search; dash and gap in pixels, `None` for a solid line.
fn line_style(name: &str) -> (ShapeStyle, Option<(i32, i32)>) {
    match name {
        "pso" => (line(GREEN, 6), Some((9, 4))),
        "bas" => (line(DARK, 5), Some((2, 4))),
        "bso-paper" => (line(VERMILION, 7), Some((5, 2))),
        _ => (line(BLUE, 10), None),
    }
}

/// Draws the whole figure of one function.
pub fn figure(
    file: String,
    title: &str,
    problem: &TestProblem,
    minimisers: &[[f64; 2]],
    walks: &[Walk],
    convergence: &[Convergence],
) -> Result<Figure, ToolError> {
    let svg = render(WIDTH, HEAD + MAPS + CURVES, &|area| {
        text(area, (12, 14), 13, HPos::Left, title)?;
        let keys: Vec<_> = convergence.iter().map(|curve| (curve.name, key(curve.name))).collect();
        legend(area, (LEFT, 36), &keys)?;
        let (_, area) = area.split_vertically(px(HEAD as i32));
        let (maps, curves) = area.split_vertically(px(MAPS as i32));
        let window = window(problem.half_width(), minimisers, walks);
        for (cell, walk) in maps.split_evenly((1, walks.len())).iter().zip(walks) {
            map(cell, problem, &window, minimisers, walk)?;
        }
        if let [first, second, third] = &curves.split_evenly((1, 3))[..] {
            trace(first, walks)?;
            descent(second, "iterations", convergence, |curve| &curve.by_iteration)?;
            descent(third, "evaluations", convergence, |curve| &curve.by_evaluation)?;
        }
        Ok(())
    })
    .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
    Ok(Figure { file, group: Group::Search, title: title.to_owned(), svg })
}

fn key(name: &str) -> Key {
    let (style, dashes) = line_style(name);
    dashes.map_or(Key::Curve(style), |(length, gap)| Key::Dashes(style, length, gap))
}

/// Square window with all positions and the nearest minima, no larger than the box.
fn window(half: f64, minimisers: &[[f64; 2]], walks: &[Walk]) -> [Range<f64>; 2] {
    let positions = || walks.iter().flat_map(|walk| &walk.positions).chain(minimisers);
    let reach = |axis: usize| {
        let of = |position: &[f64; 2]| position[axis];
        let low = positions().map(of).fold(f64::INFINITY, f64::min);
        let high = positions().map(of).fold(f64::NEG_INFINITY, f64::max);
        ((low + high) / 2.0, high - low)
    };
    let (x, y) = (reach(0), reach(1));
    let width = (0.62 * x.1.max(y.1)).clamp(1e-3 * half, half);
    [x.0, y.0].map(|centre| {
        let centre = centre.clamp(width - half, half - width);
        centre - width..centre + width
    })
}

/// Draws contours and the paths of the best beetles.
fn map(
    area: &Area<'_>,
    problem: &TestProblem,
    window: &[Range<f64>; 2],
    minimisers: &[[f64; 2]],
    walk: &Walk,
) -> Result<(), DrawingError> {
    let steps = walk.positions.len().saturating_sub(1);
    text(
        area,
        (LEFT, 10),
        12,
        HPos::Left,
        format!("{}: the best, {steps} iterations; circle: first, cross: least value", walk.name),
    )?;
    let (_, area) = area.split_vertically(px(20));
    let [x, y] = window.clone();
    let mut chart = axes(&area, &Axes { x, y, x_label: "x", y_label: "y", x_ticks: 7, y_ticks: 7 })?;
    contours(&mut chart, problem, window)?;
    let positions = || walk.positions.iter().map(|[x, y]| (*x, *y));
    chart.draw_series([PathElement::new(positions().collect::<Vec<_>>(), line_style(walk.name).0)])?;
    chart.draw_series(positions().skip(1).map(|position| Circle::new(position, px(2), DARK.filled())))?;
    chart.draw_series(positions().take(1).map(|position| Circle::new(position, px(6), line(DARK, 6))))?;
    let inside = minimisers.iter().filter(|[x, y]| window[0].contains(x) && window[1].contains(y));
    chart.draw_series(inside.map(|[x, y]| Cross::new((*x, *y), px(7), line(DARK, 7))))?;
    Ok(())
}

fn contours(
    chart: &mut Chart<'_, '_>,
    problem: &TestProblem,
    window: &[Range<f64>; 2],
) -> Result<(), DrawingError> {
    let step = |axis: &Range<f64>| (axis.end - axis.start) / (GRID_POINTS - 1) as f64;
    let at = |axis: &Range<f64>, index: usize| axis.start + step(axis) * index as f64;
    let [x, y] = window;
    let point = |index: usize| [at(x, index % GRID_POINTS), at(y, index / GRID_POINTS)];
    let values: Vec<f64> =
        (0..GRID_POINTS * GRID_POINTS).map(|index| problem.evaluate(&point(index))).collect();
    let mut sorted = values.clone();
    sorted.sort_unstable_by(f64::total_cmp);
    let levels: Vec<f64> = LEVELS
        .iter()
        .filter_map(|share| sorted.get((share * sorted.len() as f64) as usize))
        .copied()
        .collect();
    // The first value of the grid lies half a cell inside the builder's origin.
    let builder = ContourBuilder::new(GRID_POINTS, GRID_POINTS, true)
        .x_origin(x.start - step(x) / 2.0)
        .y_origin(y.start - step(y) / 2.0)
        .x_step(step(x))
        .y_step(step(y));
    for level in builder.lines(&values, &levels).unwrap_or_default() {
        let lines = level.geometry().iter().map(|points| {
            PathElement::new(
                points.coords().map(|point| (point.x, point.y)).collect::<Vec<_>>(),
                line(LEVEL, 3),
            )
        });
        chart.draw_series(lines)?;
    }
    Ok(())
}

/// Draws both coordinates of the best beetle over the iterations.
fn trace(area: &Area<'_>, walks: &[Walk]) -> Result<(), DrawingError> {
    text(area, (LEFT, 10), 12, HPos::Left, "position of the best: x solid, y dotted")?;
    let (_, area) = area.split_vertically(px(20));
    let settled = walks.iter().map(|walk| settled(&walk.positions)).max().unwrap_or(1).max(4) as f64;
    let values: Vec<f64> = walks.iter().flat_map(|walk| walk.positions.iter().flatten()).copied().collect();
    let mut chart = axes(
        &area,
        &Axes {
            x: 0.0..settled,
            y: scarab_tool::view::figures::canvas::range(values.iter()),
            x_label: "iterations",
            y_label: "x, y",
            x_ticks: 5,
            y_ticks: 6,
        },
    )?;
    for walk in walks {
        let (style, _) = line_style(walk.name);
        for axis in 0..2 {
            let points: Vec<_> =
                (0..).map(f64::from).zip(walk.positions.iter().map(|position| position[axis])).collect();
            let shown: Vec<_> = points.into_iter().filter(|(iteration, _)| *iteration <= settled).collect();
            if axis == 0 {
                chart.draw_series([PathElement::new(shown, style)])?;
            } else {
                chart.draw_series(DashedLineSeries::new(shown, px(2), px(3), style))?;
            }
        }
    }
    Ok(())
}

/// Iteration after which no movement is visible.
fn settled(positions: &[[f64; 2]]) -> usize {
    let Some(end) = positions.last() else { return 0 };
    let distance = |position: &[f64; 2]| (position[0] - end[0]).hypot(position[1] - end[1]);
    let seen = 0.01 * positions.iter().map(distance).fold(0.0, f64::max);
    positions.iter().rposition(|position| distance(position) > seen).map_or(0, |last| last + 3)
}

type LogChart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, LogCoord<f64>>>;

/// Draws f - f* of all searches.
fn descent(
    area: &Area<'_>,
    x_label: &str,
    convergence: &[Convergence],
    band: fn(&Convergence) -> &Band,
) -> Result<(), DrawingError> {
    text(area, (LEFT, 10), 12, HPos::Left, format!("convergence over {x_label}"))?;
    let (_, area) = area.split_vertically(px(20));
    let end = |band: &Band| band.spacing * band.middle.len().saturating_sub(1);
    let last = convergence.iter().map(|curve| end(band(curve))).max().unwrap_or(1) as f64;
    let highest = convergence.iter().flat_map(|curve| &band(curve).high).copied().fold(1.0, f64::max);
    let mut chart: LogChart<'_, '_> = ChartBuilder::on(&area)
        .margin_left(px(8))
        .margin_right(px(12))
        .margin_top(px(6))
        .x_label_area_size(px(34))
        .y_label_area_size(px(LEFT - 8))
        .build_cartesian_2d(0.0..last, (FLOOR..2.0 * highest).log_scale())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .set_all_tick_mark_size(px(3))
        .x_labels(5)
        .y_labels(7)
        .label_style(font(12))
        .axis_desc_style(font(12))
        .x_desc(x_label)
        .y_desc("f \u{2212} f*")
        .x_label_formatter(&|value| format!("{value:.0}"))
        .y_label_formatter(&|value| format!("1e{:.0}", value.log10().round() + 0.0).replace('-', "\u{2212}"))
        .draw()?;
    for curve in convergence {
        let band = band(curve);
        let (style, dashes) = line_style(curve.name);
        let points = |values: &[f64]| {
            let positions = (0..).map(|index: usize| (index * band.spacing) as f64);
            positions.zip(values.iter().copied()).collect::<Vec<_>>()
        };
        let outline = points(&band.low).into_iter().chain(points(&band.high).into_iter().rev());
        chart.draw_series([Polygon::new(outline.collect::<Vec<_>>(), style.color.mix(0.13).filled())])?;
        let middle = points(&band.middle);
        match dashes {
            None => chart.draw_series([PathElement::new(middle, style)]).map(|_| ())?,
            Some((length, gap)) => {
                chart.draw_series(DashedLineSeries::new(middle, px(length), px(gap), style)).map(|_| ())?;
            }
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_band_holds_the_middle_half_as_far_as_all_curves_go() {
        let curves = [[1.0, 5.0, 0.0], [2.0, 4.0, 0.0], [3.0, 3.0, 0.0], [4.0, 2.0, 0.0], [5.0, 1.0, 0.0]];
        let mut slices: Vec<&[f64]> = curves.iter().map(|curve| &curve[..]).collect();
        slices[0] = &curves[0][..2];
        let band = Band::over_iterations(&slices);
        assert_eq!(Band::over_evaluations(&slices).middle, [3.0]);
        assert_eq!((band.low, band.middle, band.high), (vec![2.0; 2], vec![3.0; 2], vec![4.0; 2]));
    }
}
