//! Draws a run with a fault: joints, motors and supply, and the time at which the bridges were
//! switched off.

use plotters::style::text_anchor::HPos;
use scarab_base::error::ToolError;
use scarab_rig::faults::recording::FaultCurves;

use crate::view::figures::canvas::{
    Area, Axes, BLUE, DARK, DrawingError, Key, LEFT, PALE, VERMILION, axes, legend, line, px, range, render,
    text,
};
use crate::view::figures::{Figure, Group, WIDTH, curve};

/// Heights of a frame, and of title with legend; pixels.
const ROW: i32 = 170;
const HEAD: i32 = 44;

/// Draws one run; `what` is the title.
pub(crate) fn drawn(file: String, what: &str, recording: &FaultCurves) -> Result<Figure, ToolError> {
    let height = (HEAD + 3 * ROW) as u32;
    let svg = render(WIDTH, height, &|area| whole(area, what, recording))
        .map_err(|error| ToolError::input(format!("{file}: cannot be drawn: {error}")))?;
    Ok(Figure { file, group: Group::Torque, title: what.to_owned(), svg })
}

fn whole(area: &Area<'_>, what: &str, recording: &FaultCurves) -> Result<(), DrawingError> {
    text(area, (LEFT, 8), 13, HPos::Left, what)?;
    let (head, mut rest) = area.split_vertically(px(HEAD));
    legend(
        &head,
        (LEFT, 24),
        &[
            ("first joint", Key::Curve(line(BLUE, 6))),
            ("second joint", Key::Curve(line(VERMILION, 6))),
            ("bridges released", Key::Field(PALE)),
        ],
    )?;
    let frames = [
        ("Speed", "deg/s", vec![(&recording.speed[0], BLUE), (&recording.speed[1], VERMILION)]),
        (
            "Torque of the motors",
            "N m",
            vec![(&recording.torque[0], BLUE), (&recording.torque[1], VERMILION)],
        ),
        ("Bus", "V", vec![(&recording.bus, DARK)]),
    ];
    for (title, unit, curves) in frames {
        let (here, below) = rest.split_vertically(px(ROW));
        text(&here, (LEFT, 4), 11, HPos::Left, title)?;
        let (_, here) = here.split_vertically(px(16));
        let height = range(curves.iter().flat_map(|(values, _)| values.iter()));
        let end = recording.time_ms.last().copied().unwrap_or(1.0);
        let mut chart = axes(
            &here,
            &Axes {
                x: 0.0..end.max(1e-3),
                y: height.clone(),
                x_label: "ms since the injection",
                y_label: unit,
                x_ticks: 8,
                y_ticks: 5,
            },
        )?;
        curve::shade(&mut chart, &height, &recording.time_ms, &recording.released, PALE)?;
        for (values, colour) in curves {
            let shown = values.iter().map(|value| Some(*value));
            curve::draw(&mut chart, &recording.time_ms, shown, line(colour, 6))?;
        }
        rest = below;
    }
    Ok(())
}
