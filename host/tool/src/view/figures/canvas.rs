//! Size, palette, fonts, axes and legend of all figures.

use std::ops::Range;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::ranged1d::{BoldPoints, Ranged};
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{Circle, PathElement, Rectangle, Text};
use plotters::prelude::{Cartesian2d, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, Color, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

/// Factor between the drawn and the shown size.
const OVERSAMPLING: u32 = 4;

/// Grid lines.
pub const GRID: RGBColor = RGBColor(228, 228, 228);
/// Axis lines.
const AXIS: RGBColor = RGBColor(90, 90, 90);
/// Wide, pale curves: a tint of Okabe and Ito's blue.
pub const PALE: RGBColor = RGBColor(158, 198, 230);
/// Okabe and Ito's blue.
pub const BLUE: RGBColor = RGBColor(0, 114, 178);
/// Okabe and Ito's vermilion.
pub const VERMILION: RGBColor = RGBColor(213, 94, 0);
/// Okabe and Ito's bluish green, darkened for thin lines.
pub const GREEN: RGBColor = RGBColor(0, 128, 95);
/// Thin curves.
pub const DARK: RGBColor = BLACK;
/// Background of excluded ranges.
pub const SHADE: RGBColor = RGBColor(222, 222, 222);
/// Background of expected ranges.
pub(crate) const BAND: RGBColor = RGBColor(224, 237, 248);

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// Error of drawing into a string.
pub type DrawingError = DrawingAreaErrorKind<std::io::Error>;

/// Converts shown pixels to drawn units.
pub const fn px(pixels: i32) -> i32 {
    pixels * OVERSAMPLING as i32
}

/// Line with a width in quarters of a pixel.
pub fn line(colour: RGBColor, quarters: u32) -> ShapeStyle {
    colour.stroke_width(quarters)
}

/// Draws a figure of the given shown size and returns its text.
pub fn render(
    width: u32,
    height: u32,
    draw: &dyn Fn(&Area<'_>) -> Result<(), DrawingError>,
) -> Result<String, DrawingError> {
    let drawn = (width * OVERSAMPLING, height * OVERSAMPLING);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, drawn).into_drawing_area();
        area.fill(&WHITE)?;
        draw(&area)?;
        area.present()?;
    }
    let size = |(width, height): (u32, u32)| format!("width=\"{width}\" height=\"{height}\"");
    Ok(svg.replacen(&size(drawn), &size((width, height)), 1))
}

/// Font of a size in pixels.
pub fn font(pixels: i32) -> TextStyle<'static> {
    ("sans-serif", px(pixels)).into_font().color(&BLACK)
}

/// Writes text at a point of the area, in shown pixels.
pub fn text(
    area: &Area<'_>,
    (x, y): (i32, i32),
    size: i32,
    anchor: HPos,
    words: impl Into<String>,
) -> Result<(), DrawingError> {
    let style = font(size).pos(Pos::new(anchor, VPos::Center));
    area.draw(&Text::new(words.into(), (px(x), px(y)), style))
}

/// Raises the exponents of a unit: `kg m2` becomes `kg m\u{b2}`.
pub(crate) fn unit(plain: &str) -> String {
    plain.replace("m2", "m\u{b2}")
}

/// Symbol of a legend entry.
pub enum Key {
    Curve(ShapeStyle),
    /// Dashed curve: lengths of dash and gap, pixels.
    Dashes(ShapeStyle, i32, i32),
    /// Background colour.
    Field(RGBColor),
    /// Dot with a radius in pixels.
    Dot(RGBColor, i32),
}

/// Draws legend entries from left to right; each takes the width of its text, and a new line begins
/// at the right edge.
pub fn legend(
    area: &Area<'_>,
    (left, mut y): (i32, i32),
    entries: &[(&str, Key)],
) -> Result<(), DrawingError> {
    let end = area.dim_in_pixel().0 as i32 / OVERSAMPLING as i32;
    let mut x = left;
    for (words, key) in entries {
        let width = 48 + 13 * words.chars().count() as i32 / 2;
        if x > left && x + width > end {
            (x, y) = (left, y + 16);
        }
        match key {
            Key::Curve(style) => {
                area.draw(&PathElement::new(vec![(px(x), px(y)), (px(x + 24), px(y))], *style))?;
            }
            Key::Dashes(style, length, gap) => {
                for begin in (0..24).step_by((length + gap).max(1) as usize) {
                    let end = (begin + length).min(24);
                    let dash = vec![(px(x + begin), px(y)), (px(x + end), px(y))];
                    area.draw(&PathElement::new(dash, *style))?;
                }
            }
            Key::Dot(colour, radius) => {
                area.draw(&Circle::new((px(x + 12), px(y)), px(*radius), colour.filled()))?;
            }
            Key::Field(colour) => {
                area.draw(&Rectangle::new([(px(x), px(y - 5)), (px(x + 24), px(y + 5))], colour.filled()))?;
            }
        }
        text(area, (x + 30, y), 12, HPos::Left, *words)?;
        x += width;
    }
    Ok(())
}

/// Style of two axes; an empty label takes no space.
#[derive(Clone)]
pub struct Axes<'s> {
    pub x: Range<f64>,
    pub y: Range<f64>,
    pub x_label: &'s str,
    pub y_label: &'s str,
    pub x_ticks: usize,
    pub y_ticks: usize,
}

/// Space to the left of a frame, pixels.
pub const LEFT: i32 = 58;
/// Part of [`LEFT`] beyond the axis label.
const EDGE: i32 = 8;

/// Draws axes with a light grid; all frames begin at the same distance from the left.
pub fn axes<'a, 'b>(area: &'a Area<'b>, axes: &Axes<'_>) -> Result<Chart<'a, 'b>, DrawingError> {
    let below = if axes.x_label.is_empty() { 18 } else { 34 };
    let mut chart = ChartBuilder::on(area)
        .margin_left(px(EDGE))
        .margin_right(px(12))
        .margin_top(px(6))
        .x_label_area_size(px(below))
        .y_label_area_size(px(LEFT - EDGE))
        .build_cartesian_2d(axes.x.clone(), axes.y.clone())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .axis_style(line(AXIS, 3))
        .set_all_tick_mark_size(px(3))
        .x_labels(labels(&axes.x, axes.x_ticks))
        .y_labels(labels(&axes.y, axes.y_ticks))
        .label_style(font(12))
        .axis_desc_style(font(12))
        .x_desc(axes.x_label)
        .y_desc(axes.y_label)
        .x_label_formatter(&|value| short(*value))
        .y_label_formatter(&|value| short(*value))
        .draw()?;
    Ok(chart)
}

/// With fewer labels the scale of an axis cannot be read.
const LEAST_LABELS: usize = 3;

/// Labels to request for an axis: `most`, or more where plotters would draw fewer than [`LEAST_LABELS`].
fn labels(range: &Range<f64>, most: usize) -> usize {
    let axis = RangedCoordf64::from(range.clone());
    let drawn = |count: &usize| axis.key_points(BoldPoints(*count)).len();
    (most..=most + 2 * LEAST_LABELS).find(|count| drawn(count) >= LEAST_LABELS).unwrap_or(most)
}

/// Formats a number on an axis with a true minus sign and without rounding noise.
pub(crate) fn short(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    let words = format!("{}", if rounded == 0.0 { 0.0 } else { rounded });
    words.replace('-', "\u{2212}")
}

/// Range of all values, widened by a twentieth on both sides.
pub fn range<'a>(values: impl Iterator<Item = &'a f64>) -> Range<f64> {
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    if !(high > low) {
        return if low.is_finite() { low - 1.0..low + 1.0 } else { 0.0..1.0 };
    }
    let margin = (high - low) / 20.0;
    low - margin..high + margin
}

/// Symmetric range of all values, a tenth wider than the largest magnitude; at least `least`.
pub fn symmetric(values: impl Iterator<Item = f64>, least: f64) -> Range<f64> {
    let largest = values.map(f64::abs).filter(|size| size.is_finite()).fold(least, f64::max);
    let end = if largest > 0.0 { 1.1 * largest } else { 1.0 };
    -end..end
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_axis_has_three_labels_and_at_most_four_more_than_requested() {
        for requested in 3..=11 {
            for step in 0..400 {
                let end = 10_f64.powf(f64::from(step) / 50.0 - 4.0);
                for range in [-end..end, 0.0..end, 48.0..48.0 + end, -0.3 * end..end] {
                    let axis = RangedCoordf64::from(range.clone());
                    let drawn = axis.key_points(BoldPoints(labels(&range, requested))).len();
                    assert!(
                        (LEAST_LABELS..=requested + 4).contains(&drawn),
                        "{requested} {range:?}: {drawn}"
                    );
                }
            }
        }
    }
}
