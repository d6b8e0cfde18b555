//! Reduces long curves to the points that can be seen, with gaps where a value is unknown.

use std::ops::Range;

use plotters::element::{PathElement, Rectangle};
use plotters::series::DashedLineSeries;
use plotters::style::{Color, RGBColor, ShapeStyle};

use crate::view::figures::canvas::{Chart, DrawingError, px};

/// Points of one curve: about three per pixel of the widest frame.
const MOST_POINTS: usize = 1200;

/// Draws a curve, reduced to its extremes where it has too many points; `None` is a gap.
pub fn draw(
    chart: &mut Chart<'_, '_>,
    time_s: &[f64],
    values: impl Iterator<Item = Option<f64>>,
    style: ShapeStyle,
) -> Result<(), DrawingError> {
    let mut pieces: Vec<Vec<(f64, f64)>> = vec![Vec::new()];
    for (time, value) in time_s.iter().zip(values) {
        match (value.filter(|value| value.is_finite()), pieces.last_mut()) {
            (Some(value), Some(piece)) => piece.push((*time, value)),
            (None, Some(piece)) if !piece.is_empty() => pieces.push(Vec::new()),
            _ => {}
        }
    }
    let per_pair = (2 * time_s.len()).div_ceil(MOST_POINTS);
    for piece in pieces.into_iter().filter(|piece| piece.len() > 1) {
        chart.draw_series([PathElement::new(extremes(&piece, per_pair), style)])?;
    }
    Ok(())
}

/// Draws a short dashed curve; lengths of dash and gap in pixels.
pub(crate) fn dashed(
    chart: &mut Chart<'_, '_>,
    points: impl Iterator<Item = (f64, f64)>,
    style: ShapeStyle,
    (length, gap): (i32, i32),
) -> Result<(), DrawingError> {
    let points: Vec<_> = points.filter(|(_, value)| value.is_finite()).collect();
    chart.draw_series(DashedLineSeries::new(points, px(length), px(gap), style)).map(|_| ())
}

/// Minimum and maximum of each group of points, in their order.
fn extremes(points: &[(f64, f64)], per_pair: usize) -> Vec<(f64, f64)> {
    if per_pair <= 2 {
        return points.to_vec();
    }
    let mut kept = Vec::with_capacity(2 * points.len() / per_pair + 2);
    for group in points.chunks(per_pair) {
        let by_value = |one: &&(f64, f64), other: &&(f64, f64)| one.1.total_cmp(&other.1);
        let (Some(low), Some(high)) = (group.iter().min_by(by_value), group.iter().max_by(by_value)) else {
            continue;
        };
        let (first, second) = if low.0 <= high.0 { (low, high) } else { (high, low) };
        kept.push(*first);
        if first != second {
            kept.push(*second);
        }
    }
    kept
}

/// Fills the background where the condition holds.
pub fn shade(
    chart: &mut Chart<'_, '_>,
    height: &Range<f64>,
    time_s: &[f64],
    holds: &[bool],
    colour: RGBColor,
) -> Result<(), DrawingError> {
    let mut from: Option<f64> = None;
    let mut stretches = Vec::new();
    for (time, holds) in time_s.iter().zip(holds) {
        match (from, holds) {
            (None, true) => from = Some(*time),
            (Some(begun), false) => {
                stretches.push((begun, *time));
                from = None;
            }
            _ => {}
        }
    }
    stretches.extend(from.zip(time_s.last().copied()));
    let bars = stretches
        .into_iter()
        .map(|(begun, ended)| Rectangle::new([(begun, height.start), (ended, height.end)], colour.filled()));
    chart.draw_series(bars)?;
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::extremes;

    #[test]
    fn a_thinned_curve_keeps_every_peak_in_its_order() {
        let mut points: Vec<(f64, f64)> = (0..1000).map(|index| (f64::from(index), 0.0)).collect();
        points[501].1 = 7.0;
        points[505].1 = -3.0;
        let kept = extremes(&points, 20);
        assert!(kept.len() <= 100, "{} points", kept.len());
        assert!(kept.contains(&(501.0, 7.0)) && kept.contains(&(505.0, -3.0)));
        assert!(kept.windows(2).all(|pair| pair[0].0 < pair[1].0), "time goes back");
    }

    #[test]
    fn a_short_curve_is_drawn_point_by_point() {
        let points = [(0.0, 1.0), (1.0, 2.0), (2.0, 0.0)];
        assert_eq!(extremes(&points, 1), points);
    }
}
