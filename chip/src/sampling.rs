//! Sampling instants of both axes, measured in the image, and edges of the other bridge before them.

use serde::Serialize;

use scarab_host::base::error::ToolError;

use crate::chip::Sampling;
use crate::session::Session;
use crate::time::{TICK_HZ, Ticks};

/// Sampling of one axis in one situation.
#[derive(Clone, Debug, Serialize)]
pub struct SamplingReport {
    /// Situation.
    pub situation: &'static str,
    /// Axis.
    pub axis: usize,
    /// Conversions.
    pub conversions: usize,
    /// Time from the middle of the lower zero vector to the trigger, ns: least and greatest.
    pub trigger_ns: [f64; 2],
    /// Time from that middle to the hold, ns: least and greatest.
    pub hold_ns: [f64; 2],
    /// Conversions with an edge of the other bridge within 1.2 us before the hold.
    pub disturbed: usize,
}

/// Documented instant of the trigger after the middle (docs/motor.md), three clocks of the converter until it
/// holds, and a clock of the timer, ns.
const TRIGGER_NS: f64 = 119.0;
const SAMPLING_NS: f64 = 3e9 / 21e6;
const CLOCK_NS: f64 = 6.0;

impl SamplingReport {
    /// Whether every conversion began at the documented instant, without a preceding edge of the other
    /// bridge.
    #[must_use]
    pub fn is_sound(&self) -> bool {
        let are_right =
            |times: [f64; 2], expected: f64| times.iter().all(|at| (at - expected).abs() < CLOCK_NS);
        self.conversions > 0
            && self.disturbed == 0
            && are_right(self.trigger_ns, TRIGGER_NS)
            && are_right(self.hold_ns, TRIGGER_NS + SAMPLING_NS)
    }
}

fn nanoseconds(difference: Ticks) -> f64 {
    1e9 * difference.cast_signed() as f64 / TICK_HZ as f64
}

/// Measures for a time, s.
///
/// # Errors
/// The model does not support an action of the processor.
pub fn measure(
    session: &mut Session,
    situation: &'static str,
    duration: f64,
) -> Result<Vec<SamplingReport>, ToolError> {
    session.machine.chip_mut().samplings = Some(Vec::new());
    session.run(duration)?;
    let samplings = session.machine.chip_mut().samplings.take().unwrap_or_default();
    Ok((0..2).map(|axis| report(situation, axis, &samplings)).collect())
}

fn report(situation: &'static str, axis: usize, samplings: &[Sampling]) -> SamplingReport {
    let own: Vec<&Sampling> = samplings.iter().filter(|sampling| sampling.axis == axis).collect();
    let range = |of: fn(&Sampling) -> Ticks| {
        // Negative before the middle.
        let values = own.iter().map(|sampling| nanoseconds(of(sampling).wrapping_sub(sampling.middle)));
        values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], value: f64| {
            [low.min(value), high.max(value)]
        })
    };
    SamplingReport {
        situation,
        axis,
        conversions: own.len(),
        trigger_ns: range(|sampling| sampling.trigger),
        hold_ns: range(|sampling| sampling.hold),
        disturbed: own.iter().filter(|sampling| sampling.edges > 0).count(),
    }
}
