//! Figures of a current loop: steps, voltage limit, braking.

use std::path::Path;

use plotters::style::text_anchor::HPos;
use plotters::style::{RGBColor, ShapeStyle};
use scarab_base::error::ToolError;
use scarab_base::files;
use scarab_rig::report::motor::MotorReport;

use crate::view::figures::canvas::{
    Area, Axes, BLUE, DARK, DrawingError, GREEN, GRID, Key, LEFT, PALE, VERMILION, axes, legend, line, px,
    range, render, short, text,
};
use crate::view::figures::{WIDTH, curve};

/// Heights of a row of frames, and of title with legend; pixels.
const ROW: i32 = 210;
const HEAD: i32 = 56;

/// Lengths of dash and gap, pixels.
const DASHES: (i32, i32) = (5, 4);

/// Style of a curve. No two curves of a frame share colour, width and dashes.
#[derive(Clone, Copy)]
struct Line {
    style: ShapeStyle,
    dashes: Option<(i32, i32)>,
}

impl Line {
    fn solid(style: ShapeStyle) -> Self {
        Self { style, dashes: None }
    }

    fn dashed(style: ShapeStyle) -> Self {
        Self { style, dashes: Some(DASHES) }
    }

    fn key(self) -> Key {
        match self.dashes {
            None => Key::Curve(self.style),
            Some((length, gap)) => Key::Dashes(self.style, length, gap),
        }
    }
}

struct Trace<'a> {
    time: &'a [f64],
    values: &'a [f64],
    line: Line,
}

fn thin(colour: RGBColor) -> ShapeStyle {
    line(colour, 6)
}

/// Draws a frame with curves.
fn frame(
    area: &Area<'_>,
    title: &str,
    y_label: &str,
    end_ms: f64,
    traces: &[Trace<'_>],
) -> Result<(), DrawingError> {
    text(area, (LEFT, 10), 12, HPos::Left, title)?;
    let (_, area) = area.split_vertically(px(20));
    let begin = traces.iter().filter_map(|trace| trace.time.first()).copied().fold(0.0, f64::min);
    let mut chart = axes(
        &area,
        &Axes {
            x: begin..end_ms,
            y: range(traces.iter().flat_map(|trace| trace.values)),
            x_label: "time, ms",
            y_label,
            x_ticks: 7,
            y_ticks: 6,
        },
    )?;
    for trace in traces {
        let points = trace.time.iter().copied().zip(trace.values.iter().copied());
        let shown = points.filter(|(time, _)| *time <= end_ms);
        match trace.line.dashes {
            Some(dashes) => curve::dashed(&mut chart, shown, trace.line.style, dashes)?,
            None => {
                let (times, values): (Vec<_>, Vec<_>) = shown.unzip();
                curve::draw(&mut chart, &times, values.into_iter().map(Some), trace.line.style)?;
            }
        }
    }
    Ok(())
}

fn steps(area: &Area<'_>, report: &MotorReport) -> Result<(), DrawingError> {
    let title = "Steps of the quadrature current q against the designed loop, and the direct current d";
    text(area, (12, 14), 13, HPos::Left, title)?;
    let design = Line::solid(line(PALE, 18));
    let quadrature = [Line::solid(thin(BLUE)), Line::dashed(thin(VERMILION))];
    let direct = [Line::solid(line(GREEN, 5)), Line::dashed(line(DARK, 5))];
    let entries = [
        ("q designed", design.key()),
        ("q with feedforward", quadrature[0].key()),
        ("q without", quadrature[1].key()),
        ("d with feedforward", direct[0].key()),
        ("d without", direct[1].key()),
    ];
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    for (part, pair) in cells.split_evenly((2, 2)).iter().zip(report.steps.chunks(2)) {
        let Some(first) = pair.first() else { continue };
        let (from, to) = (first.from_a, first.to_a);
        let ideal: Vec<f64> =
            report.designed_response.iter().map(|share| from + share * (to - from)).collect();
        let mut traces = vec![Trace { time: &first.time_ms, values: &ideal, line: design }];
        for (step, line) in pair.iter().zip(quadrature) {
            traces.push(Trace { time: &step.time_ms, values: &step.quadrature_a, line });
        }
        for (step, line) in pair.iter().zip(direct) {
            traces.push(Trace { time: &step.time_ms, values: &step.direct_a, line });
        }
        frame(part, &format!("rotor at {:.0} rad/s", first.speed_rad_s), "current, A", 2.0, &traces)?;
    }
    Ok(())
}

fn limit(area: &Area<'_>, report: &MotorReport) -> Result<(), DrawingError> {
    let title = "From a current that a weak supply cannot hold, back within the limit";
    text(area, (12, 14), 13, HPos::Left, title)?;
    // First the weak supply, then the strong one.
    let quadrature = [Line::solid(thin(VERMILION)), Line::solid(line(PALE, 18))];
    let direct = [Line::dashed(line(DARK, 5)), Line::solid(line(GREEN, 5))];
    let label = |index: usize, words: &str| {
        let supply = report.limit.get(index).map_or(0.0, |limit| limit.supply_v);
        format!("{supply:.0} V: {words}")
    };
    let words = [label(1, "quadrature"), label(0, "quadrature"), label(1, "direct"), label(0, "direct")];
    let lines = [quadrature[1], quadrature[0], direct[1], direct[0]];
    let entries: Vec<_> = words.iter().zip(lines).map(|(words, line)| (words.as_str(), line.key())).collect();
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    for (part, pair) in cells.split_evenly((1, 2)).iter().zip(report.limit.chunks(2)) {
        let mut traces = Vec::new();
        // The thin curve is drawn over the wide one.
        for (limit, line) in pair.iter().zip(quadrature).rev() {
            traces.push(Trace { time: &limit.time_ms, values: &limit.quadrature_a, line });
        }
        for (limit, line) in pair.iter().zip(direct).rev() {
            traces.push(Trace { time: &limit.time_ms, values: &limit.direct_current_a, line });
        }
        let speed = pair.first().map_or(0.0, |limit| limit.speed_rad_s);
        frame(part, &format!("rotor at {speed:.0} rad/s"), "current, A", 2.5, &traces)?;
    }
    Ok(())
}

fn regeneration(area: &Area<'_>, report: &MotorReport) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, "A joint's inertia is braked: bus voltage and speed")?;
    let lines = [Line::solid(thin(BLUE)), Line::dashed(thin(VERMILION))];
    let limit = Line::solid(line(DARK, 3));
    let border = report.bus_limit_v;
    let words = format!("upper limit, {border:.0} V: outputs off");
    let entries = [
        ("with chopper", lines[0].key()),
        ("without, until the outputs are off", lines[1].key()),
        (words.as_str(), limit.key()),
    ];
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    let parts = cells.split_evenly((1, 2));
    let [left, right] = parts.as_slice() else { return Ok(()) };
    let end =
        report.regeneration.iter().filter_map(|braking| braking.time_ms.last()).copied().fold(1.0, f64::max);
    let both = || report.regeneration.iter().zip(lines);
    let (ends, borders) = ([0.0, end], [border; 2]);
    let mut bus = vec![Trace { time: &ends, values: &borders, line: limit }];
    bus.extend(both().map(|(braking, line)| Trace { time: &braking.time_ms, values: &braking.bus_v, line }));
    frame(left, "supply", "bus voltage, V", end, &bus)?;
    let speed: Vec<_> = both()
        .map(|(braking, line)| Trace { time: &braking.time_ms, values: &braking.speed_rad_s, line })
        .collect();
    frame(right, "rotor", "speed, rad/s", end, &speed)
}

fn ripple(area: &Area<'_>, report: &MotorReport) -> Result<(), DrawingError> {
    text(
        area,
        (12, 14),
        13,
        HPos::Left,
        "Torque ripple without sensor noise, rms and sixth harmonic, percent of the mean",
    )?;
    let (rms, sixth) = (thin(BLUE), thin(GREEN));
    legend(area, (LEFT, 35), &[("rms", Key::Curve(rms)), ("sixth harmonic", Key::Curve(sixth))])?;
    text(area, (790, 35), 12, HPos::Left, "rms")?;
    let (_, area) = area.split_vertically(px(HEAD));
    let quiet: Vec<_> = report.ripple.iter().filter(|ripple| !ripple.noise).collect();
    let largest =
        quiet.iter().map(|ripple| ripple.torque_percent.max(ripple.sixth_percent)).fold(0.01, f64::max);
    // Axis ticks every 0.1 %, or every tenth of the largest power of ten.
    let step = 0.1 * 10_f64.powf((largest.log10() + 0.5).floor());
    let bottom = 20 * quiet.len() as i32 + 4;
    for tick in 0..=(largest / step) as i32 {
        let x = 330 + (440.0 * step * f64::from(tick) / largest) as i32;
        let ends = vec![(px(x), px(4)), (px(x), px(bottom))];
        area.draw(&plotters::element::PathElement::new(ends, line(GRID, 4)))?;
        text(&area, (x, bottom + 8), 12, HPos::Center, format!("{} %", short(step * f64::from(tick))))?;
    }
    for (index, ripple) in quiet.iter().enumerate() {
        let y = 14 + 20 * index as i32;
        let compensated =
            if ripple.compensated { "dead time compensated" } else { "dead time not compensated" };
        let words = format!("{:.0} rad/s, {compensated}", ripple.speed_rad_s);
        text(&area, (12, y), 12, HPos::Left, words)?;
        for (value, style, offset) in [(ripple.torque_percent, rms, -3), (ripple.sixth_percent, sixth, 3)] {
            let end = 330 + (440.0 * value / largest) as i32;
            let ends = vec![(px(330), px(y + offset)), (px(end), px(y + offset))];
            area.draw(&plotters::element::PathElement::new(ends, style))?;
        }
        text(&area, (790, y), 12, HPos::Left, format!("{:.2} %", ripple.torque_percent))?;
    }
    Ok(())
}

/// Draws all figures into a directory, creating it if necessary.
pub fn write(directory: &Path, report: &MotorReport) -> Result<(), ToolError> {
    type Drawing = fn(&Area<'_>, &MotorReport) -> Result<(), DrawingError>;
    let quiet = report.ripple.iter().filter(|ripple| !ripple.noise).count() as i32;
    let figures: [(&str, i32, Drawing); 4] = [
        ("current-steps.svg", HEAD + 2 * ROW, steps),
        ("torque-ripple.svg", HEAD + 20 * quiet + 28, ripple),
        ("voltage-limit.svg", HEAD + ROW, limit),
        ("regeneration.svg", HEAD + ROW, regeneration),
    ];
    for (file, height, draw) in figures {
        let svg = render(WIDTH, height.unsigned_abs(), &|area| draw(area, report))
            .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
        files::write(&directory.join(file), svg)?;
    }
    Ok(())
}
