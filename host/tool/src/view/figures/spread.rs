//! Base parameters over many runs: a dot per run, and a bar of one standard deviation to both sides
//! of their mean.

use crate::view::spread::Spread;
use plotters::element::{Circle, PathElement};
use plotters::style::Color;
use plotters::style::text_anchor::HPos;

use crate::view::figures::canvas::{Area, BLUE, DARK, DrawingError, Key, legend, line, px, text};
use crate::view::figures::parameters::{ONE_SIGMA, THREE_SIGMA, frame, labels, sigma_axis};

/// Largest number of dots that remains readable; the printed numbers count all runs.
pub(crate) const LARGEST_RUNS: usize = 500;

/// Most runs that are drawn with larger dots.
const FEW_RUNS: usize = 100;

/// Height of title and legend, pixels.
pub(crate) const HEAD: u32 = 50;

/// Draws one row per parameter: errors in reported sigma.
pub(crate) fn whole(area: &Area<'_>, leg: &str, spreads: &[Spread]) -> Result<(), DrawingError> {
    let runs = spreads.iter().map(|spread| spread.errors.len()).max().unwrap_or(0);
    let radius = if runs > FEW_RUNS { 1 } else { 2 };
    let title = format!("{leg}: errors of the base parameters in {runs} runs, in units of each run's sigma");
    text(area, (12, 14), 13, HPos::Left, title)?;
    let entries = [
        ("a run", Key::Dot(BLUE, radius)),
        ("mean \u{b1} standard deviation", Key::Curve(line(DARK, 8))),
        ("one sigma", Key::Field(ONE_SIGMA)),
        ("three sigma", Key::Field(THREE_SIGMA)),
    ];
    legend(area, (90, 36), &entries)?;
    let (_, area) = area.split_vertically(px(HEAD as i32));
    let area = &area;
    let (rows, margins) = (spreads.len().max(1) as f64, (90, 200));
    let all = spreads.iter().flat_map(|spread| &spread.errors);
    let end = all.fold(3.5_f64, |largest, error| largest.max(error.abs())).min(20.0) + 0.3;
    let mut chart = frame(area, margins).build_cartesian_2d(-end..end, 0.0..rows)?;
    sigma_axis(&mut chart, rows)?;
    for (row, spread) in spreads.iter().enumerate() {
        let middle = rows - row as f64 - 0.5;
        // Three lanes keep dots with similar errors apart.
        let lane = |run: usize| middle + 0.2 * (run % 3) as f64 - 0.2;
        let dots = spread.errors.iter().take(LARGEST_RUNS).enumerate();
        chart.draw_series(dots.map(|(run, error)| {
            Circle::new((error.clamp(-end, end), lane(run)), px(radius), BLUE.mix(0.5).filled())
        }))?;
        let (mean, deviation) = (spread.mean(), spread.deviation());
        let ends = [mean - deviation, mean + deviation].map(|at| (at.clamp(-end, end), middle));
        chart.draw_series([PathElement::new(ends.to_vec(), line(DARK, 8))])?;
        let at = mean.clamp(-end, end);
        chart.draw_series([Circle::new((at, middle), px(3), DARK.filled())])?;
        let words = format!("mean {mean:+.2}, spread {deviation:.2}");
        let (_, y) = chart.backend_coord(&(0.0, middle));
        labels(area, y, margins, (spread.name.clone(), words))?;
    }
    Ok(())
}
