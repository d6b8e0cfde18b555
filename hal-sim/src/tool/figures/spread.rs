//! Base parameters over many runs: a dot for each run, a bar from one standard deviation below their mean to one above.

use plotters::element::{Circle, PathElement};
use plotters::style::Color;

use super::super::spread::Spread;
use super::canvas::{Area, BLUE, DARK, DrawingError, line, px};
use super::parameters::{frame, labels, sigma_axis};

/// More dots are a blot; what is said in numbers counts all.
pub const LARGEST_RUNS: usize = 500;

/// One row for each parameter, errors about truth in reported sigma.
pub fn whole(area: &Area<'_>, spreads: &[Spread]) -> Result<(), DrawingError> {
    let (rows, margins) = (spreads.len().max(1) as f64, (90, 200));
    let all = spreads.iter().flat_map(|spread| &spread.errors);
    let end = all.fold(3.5_f64, |largest, error| largest.max(error.abs())).min(20.0) + 0.3;
    let mut chart = frame(area, margins).build_cartesian_2d(-end..end, 0.0..rows)?;
    sigma_axis(&mut chart, rows)?;
    for (row, spread) in spreads.iter().enumerate() {
        let middle = rows - row as f64 - 0.5;
        // In three lanes, so that dots of like errors stay apart.
        let lane = |run: usize| middle + 0.2 * (run % 3) as f64 - 0.2;
        let dots = spread.errors.iter().take(LARGEST_RUNS).enumerate();
        chart.draw_series(dots.map(|(run, error)| {
            Circle::new((error.clamp(-end, end), lane(run)), px(1), BLUE.mix(0.5).filled())
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
