//! Figures of compensation and assistance: torque with and without over time, rms, stability limit.

use plotters::style::text_anchor::HPos;
use plotters::style::{RGBColor, ShapeStyle};
use scarab_base::error::ToolError;
use scarab_rig::report::assist::{AssistReport, AssistRow, InteractionCurve, StabilityReport};

use crate::view::figures::canvas::{
    Area, Axes, BLUE, DARK, DrawingError, GREEN, GRID, Key, LEFT, PALE, VERMILION, axes, legend, line, px,
    render, short, symmetric, text,
};
use crate::view::figures::{Draw, Figure, Group, WIDTH, curve};

/// Heights of a row of frames, and of title with legend; pixels.
const ROW: i32 = 190;
const HEAD: i32 = 56;
/// Heights of the bars of a row, and space between rows; pixels.
const BAR: i32 = 7;
const GAP: i32 = 12;
/// Left and right end of the bars, pixels.
const BARS: [i32; 2] = [240, 860];
/// Shown time of the torques, s.
const SHOWN_S: f64 = 6.0;
/// Lengths of dash and gap, pixels.
const DASHES: (i32, i32) = (5, 4);

/// Draws all figures.
pub(crate) fn all(report: &AssistReport) -> Result<Vec<Figure>, ToolError> {
    let mut figures = Vec::new();
    let mut add = |file: &str, group, title: &str, height: i32, draw: Draw<'_>| {
        let svg = render(WIDTH, height.unsigned_abs(), draw)
            .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
        figures.push(Figure { file: file.into(), group, title: title.into(), svg });
        Ok::<_, ToolError>(())
    };
    if !report.curves.is_empty() {
        let rows = report.curves.len().div_ceil(2) as i32;
        let title = "Interaction torque over time, with and without compensation";
        add("interaction.svg", Group::Torque, title, HEAD + ROW * rows, &|area| {
            interaction(area, &report.curves)
        })?;
    }
    let compared: Vec<_> = report.rows.iter().filter(|row| !bars_of(row).is_empty()).collect();
    if !compared.is_empty() {
        let bars: usize = compared.iter().map(|row| bars_of(row).len()).sum();
        let height = HEAD + BAR * bars as i32 + GAP * compared.len() as i32 + 28;
        let title = "Interaction torque at the same motion of the wearer's leg";
        add("interaction-rms.svg", Group::Summary, title, height, &|area| rms(area, &compared))?;
    }
    let title = "Largest stable share of inertia over the cuffs' stiffness";
    add("stability.svg", Group::Search, title, HEAD + 300, &|area| stability(area, &report.stability))?;
    Ok(figures)
}

fn thin(colour: RGBColor) -> ShapeStyle {
    line(colour, 6)
}

fn interaction(area: &Area<'_>, curves: &[InteractionCurve]) -> Result<(), DrawingError> {
    text(area, (12, 14), 13, HPos::Left, "Interaction torque at the same motion of the wearer's leg")?;
    let styles = [line(PALE, 16), thin(DARK), thin(VERMILION)];
    let entries = [
        ("drives off", Key::Curve(styles[0])),
        ("weight carried", Key::Dashes(styles[1], DASHES.0, DASHES.1)),
        ("transparent, identified model", Key::Curve(styles[2])),
    ];
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    let rows = curves.len().div_ceil(2);
    for (part, curve) in cells.split_evenly((rows, 2)).iter().zip(curves) {
        text(part, (LEFT, 10), 12, HPos::Left, format!("{}, {}", curve.motion, curve.joint))?;
        let (_, part) = part.split_vertically(px(20));
        let begin = curve.time_s.first().copied().unwrap_or(0.0);
        let shown = curve.time_s.iter().take_while(|time| **time <= begin + SHOWN_S).count();
        let times = curve.time_s.get(..shown).unwrap_or_default();
        let values = [&curve.drives_off_nm, &curve.gravity_only_nm, &curve.identified_nm];
        let mut chart = axes(
            &part,
            &Axes {
                x: begin..begin + SHOWN_S,
                y: symmetric(values.iter().flat_map(|values| values.iter().copied()), 1.0),
                x_label: "time, s",
                y_label: "torque, N m",
                x_ticks: 7,
                y_ticks: 5,
            },
        )?;
        for (number, (values, style)) in values.into_iter().zip(styles).enumerate() {
            let values = values.iter().copied();
            if number == 1 {
                curve::dashed(&mut chart, times.iter().copied().zip(values), style, DASHES)?;
            } else {
                curve::draw(&mut chart, times, values.map(Some), style)?;
            }
        }
    }
    Ok(())
}

/// Known torques of a row with their colours, in the order of the legend.
fn bars_of(row: &AssistRow) -> Vec<(f64, RGBColor)> {
    let torques = [
        row.drives_off_rms_nm,
        row.gravity_only_rms_nm,
        row.prior_rms_nm,
        row.identified_rms_nm,
        row.true_model_rms_nm,
    ];
    let known = torques.into_iter().zip(BAR_COLOURS);
    known.filter_map(|(torque, colour)| Some((torque.known()?, colour))).collect()
}

const BAR_COLOURS: [RGBColor; 5] = [PALE, DARK, GREEN, VERMILION, BLUE];

fn rms(area: &Area<'_>, rows: &[&AssistRow]) -> Result<(), DrawingError> {
    text(
        area,
        (12, 14),
        13,
        HPos::Left,
        "Interaction torque at the same motion of the wearer's leg, N m rms",
    )?;
    let words = ["drives off", "weight carried", "CAD prior", "identified model", "true model"];
    let entries: Vec<_> = words.into_iter().zip(BAR_COLOURS.map(Key::Field)).collect();
    legend(area, (LEFT, 35), &entries)?;
    let (_, area) = area.split_vertically(px(HEAD));
    let largest = rows.iter().flat_map(|row| bars_of(row)).map(|(torque, _)| torque).fold(0.1, f64::max);
    let bars: usize = rows.iter().map(|row| bars_of(row).len()).sum();
    let bottom = BAR * bars as i32 + GAP * rows.len() as i32;
    let x_of = |torque: f64| BARS[0] + (f64::from(BARS[1] - BARS[0]) * torque / largest) as i32;
    // Axis ticks: a tenth, a fifth or half of the next power of ten.
    let power = 10_f64.powf(largest.log10().floor());
    let step = [0.2, 0.5, 1.0, 2.0].map(|share| share * power).into_iter().find(|step| largest / step <= 6.0);
    let step = step.unwrap_or(power);
    for tick in 0..=(largest / step) as i32 {
        let torque = step * f64::from(tick);
        let ends = vec![(px(x_of(torque)), px(0)), (px(x_of(torque)), px(bottom))];
        area.draw(&plotters::element::PathElement::new(ends, line(GRID, 4)))?;
        text(&area, (x_of(torque), bottom + 10), 12, HPos::Center, short(torque))?;
    }
    let mut y = 0;
    for row in rows {
        let bars = bars_of(row);
        let middle = y + BAR * bars.len() as i32 / 2;
        text(&area, (12, middle), 12, HPos::Left, format!("{}: {}, {}", row.mode, row.motion, row.joint))?;
        for (torque, colour) in bars {
            let corners = [(px(BARS[0]), px(y)), (px(x_of(torque)), px(y + BAR - 1))];
            area.draw(&plotters::element::Rectangle::new(corners, ShapeStyle::from(colour).filled()))?;
            y += BAR;
        }
        y += GAP;
    }
    Ok(())
}

fn stability(area: &Area<'_>, report: &StabilityReport) -> Result<(), DrawingError> {
    let title = "Largest stable share of inertia; cuffs' damping across the segment in N s/m";
    text(area, (12, 14), 13, HPos::Left, title)?;
    let colours = [VERMILION, GREEN, BLUE, DARK, PALE];
    let mut dampings: Vec<f64> = report.curves.iter().map(|curve| curve.damping_n_s_per_m).collect();
    dampings.sort_by(f64::total_cmp);
    dampings.dedup();
    // Width and colour both differ: the curves can be distinguished in grey.
    let style = |damping: f64| {
        let number = dampings.iter().position(|other| *other == damping).unwrap_or(0);
        line(colours.get(number).copied().unwrap_or(DARK), 4 + 2 * number as u32)
    };
    let words: Vec<_> = dampings.iter().map(|damping| short(*damping)).collect();
    let entries: Vec<_> = words
        .iter()
        .zip(&dampings)
        .map(|(words, damping)| (words.as_str(), Key::Curve(style(*damping))))
        .collect();
    legend(area, (LEFT, 35), &entries)?;
    let (_, cells) = area.split_vertically(px(HEAD));
    let own = [report.largest_share_limp, report.largest_share_held];
    for ((part, limb), own) in cells.split_evenly((1, 2)).iter().zip(["limp", "held"]).zip(own) {
        let title =
            format!("{limb} limb (dot: this wearer's cuffs, {})", short((100.0 * own).round() / 100.0));
        text(part, (LEFT, 10), 12, HPos::Left, title)?;
        let (_, part) = part.split_vertically(px(20));
        let curves = || report.curves.iter().filter(|curve| curve.limb == limb);
        let end = curves().flat_map(|curve| &curve.stiffness_n_per_m).fold(0.0, |a: f64, b| a.max(*b));
        let mut chart = axes(
            &part,
            &Axes {
                x: 0.0..1e-3 * end,
                y: 0.0..1.05,
                x_label: "stiffness across the segment, kN/m",
                y_label: "share of inertia",
                x_ticks: 6,
                y_ticks: 6,
            },
        )?;
        for curve in curves() {
            let stiffness: Vec<f64> = curve.stiffness_n_per_m.iter().map(|value| 1e-3 * value).collect();
            let shares = curve.largest_share.iter().copied().map(Some);
            curve::draw(&mut chart, &stiffness, shares, style(curve.damping_n_s_per_m))?;
        }
        let dot = (1e-3 * report.stiffness_n_per_m, own);
        let filled = ShapeStyle::from(DARK).filled();
        chart.draw_series([plotters::element::Circle::new(dot, px(4), filled)])?;
    }
    Ok(())
}
