//! What all figures share: size, fonts, axes, legend.

use std::ops::Range;

use plotters::chart::{ChartBuilder, ChartContext};
use plotters::coord::Shift;
use plotters::coord::types::RangedCoordf64;
use plotters::drawing::{DrawingArea, DrawingAreaErrorKind, IntoDrawingArea};
use plotters::element::{PathElement, Text};
use plotters::prelude::{Cartesian2d, SVGBackend};
use plotters::style::text_anchor::{HPos, Pos, VPos};
use plotters::style::{BLACK, Color, IntoFont, RGBColor, ShapeStyle, TextStyle, WHITE};

/// Drawn this many times larger than shown.
const OVERSAMPLING: u32 = 4;

/// Lines of the grid.
pub const GRID: RGBColor = RGBColor(225, 225, 225);
/// What is pale and wide.
pub const PALE: RGBColor = RGBColor(170, 195, 225);
/// What is darker and less wide.
pub const MIDDLE: RGBColor = RGBColor(205, 100, 10);
/// What is thin.
pub const DARK: RGBColor = BLACK;
/// Background of what is left out.
pub const SHADE: RGBColor = RGBColor(235, 235, 235);

/// Part of a figure.
pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;
/// A part with two axes.
pub type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;
/// What drawing into a text can fail with.
pub type DrawingError = DrawingAreaErrorKind<std::io::Error>;

/// Pixels as shown to units as drawn.
pub const fn px(pixels: i32) -> i32 {
    pixels * OVERSAMPLING as i32
}

/// A line so many quarters of a pixel wide.
pub fn line(colour: RGBColor, quarters: u32) -> ShapeStyle {
    colour.stroke_width(quarters)
}

/// Draws a figure of this size as shown, and returns its text.
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

/// Text of a size in pixels.
pub fn font(pixels: i32) -> TextStyle<'static> {
    ("sans-serif", px(pixels)).into_font().color(&BLACK)
}

/// Writes at a point of the area, in pixels as shown.
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

/// Lines with their meaning from left to right; one takes the width of its words.
pub fn legend(
    area: &Area<'_>,
    (mut x, y): (i32, i32),
    entries: &[(&str, ShapeStyle)],
) -> Result<(), DrawingError> {
    for (words, style) in entries {
        area.draw(&PathElement::new(vec![(px(x), px(y)), (px(x + 28), px(y))], *style))?;
        text(area, (x + 33, y), 12, HPos::Left, *words)?;
        x += 55 + 6 * words.chars().count() as i32;
    }
    Ok(())
}

/// How two axes are drawn.
pub struct Axes<'s> {
    pub x: Range<f64>,
    pub y: Range<f64>,
    pub x_label: &'s str,
    pub y_label: &'s str,
    pub x_ticks: usize,
    pub y_ticks: usize,
}

/// Axes with a light grid.
pub fn axes<'a, 'b>(area: &'a Area<'b>, axes: &Axes<'_>) -> Result<Chart<'a, 'b>, DrawingError> {
    let below = if axes.x_label.is_empty() { 18 } else { 36 };
    let left = if axes.y_label.is_empty() { 34 } else { 52 };
    let mut chart = ChartBuilder::on(area)
        .margin_left(px(6))
        .margin_right(px(10))
        .margin_top(px(6))
        .x_label_area_size(px(below))
        .y_label_area_size(px(left))
        .build_cartesian_2d(axes.x.clone(), axes.y.clone())?;
    chart
        .configure_mesh()
        .max_light_lines(0)
        .bold_line_style(line(GRID, 3))
        .axis_style(line(RGBColor(90, 90, 90), 4))
        .set_all_tick_mark_size(px(3))
        .x_labels(axes.x_ticks)
        .y_labels(axes.y_ticks)
        .label_style(font(11))
        .axis_desc_style(font(12))
        .x_desc(axes.x_label)
        .y_desc(axes.y_label)
        .x_label_formatter(&|value| short(*value))
        .y_label_formatter(&|value| short(*value))
        .draw()?;
    Ok(chart)
}

/// A number on an axis, without the last digits of a sum of tenths.
fn short(value: f64) -> String {
    let rounded = (value * 1e6).round() / 1e6;
    format!("{}", if rounded == 0.0 { 0.0 } else { rounded })
}

/// Smallest range of all values, a twentieth wider to both sides.
pub fn range<'a>(values: impl Iterator<Item = &'a f64>) -> Range<f64> {
    let (low, high) = values
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), value| (low.min(*value), high.max(*value)));
    if !(high > low) {
        return if low.is_finite() { low - 1.0..low + 1.0 } else { 0.0..1.0 };
    }
    let margin = (high - low) / 20.0;
    low - margin..high + margin
}
