//! Sampling instants of both axes, measured in the image, and edges of the other bridge before them.
//!
//! The sweep raises both bridges' voltages to their limit in all directions: with all wires of the motors
//! broken and a constant error of the measured current, the integrals of the current loops run away within
//! the 8 ms that the detectors take. The other bridge's voltage is that of its duties at the hold.

use core::f64::consts::TAU;

use serde::Serialize;

use scarab_base::error::ToolError;

use crate::chip::Sampling;
use crate::machine::Snapshot;
use crate::plant::ShuntFault;
use crate::session::Session;
use crate::time::{TICK_HZ, Ticks};

/// Sampling of one axis in one situation.
#[derive(Clone, Debug, Serialize)]
pub struct SamplingReport {
    pub situation: &'static str,
    pub axis: usize,
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
/// Voltage of a bridge up to which it does not disturb the other's samples at 48 V (docs/motor.md), V.
pub const CLEAN_V: f64 = 24.3;
/// Runs of the sweep, one for each direction of the voltage, and the duration of one, s.
const DIRECTIONS: u32 = 72;
const RUN_S: f64 = 12e-3;
/// Error of the measured current in the sweep, codes: some 20 A.
const ERROR_CODES: f64 = 500.0;
/// Fewest conversions in each volt of the sweep.
const FEWEST: usize = 20;

/// Conversions while the other bridge's voltage is within a volt.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize)]
pub struct SweepStep {
    /// Lower end, V.
    pub from_v: u32,
    pub conversions: usize,
    /// Conversions with an edge of the other bridge within 1.2 us before the hold.
    pub disturbed: usize,
}

/// Sweep over the other bridge's voltage.
#[derive(Clone, Debug, Serialize)]
pub struct SweepReport {
    pub bus_v: f64,
    /// Steps of a volt.
    pub steps: Vec<SweepStep>,
    /// Voltage up to which no conversion was disturbed, V.
    pub clean_v: f64,
    pub highest_v: f64,
    /// Share of disturbed conversions above the documented voltage.
    pub share_above: f64,
}

impl SweepReport {
    fn new(samplings: &[Sampling], bus_v: f64) -> Self {
        let volts =
            |samplings: &mut dyn Iterator<Item = &Sampling>, start: f64, pick: fn(f64, f64) -> f64| {
                samplings.map(|sampling| sampling.other_v).fold(start, pick)
            };
        let highest_v = volts(&mut samplings.iter(), 0.0, f64::max);
        let mut disturbed = samplings.iter().filter(|sampling| sampling.edges > 0);
        let clean_v = volts(&mut disturbed, highest_v, f64::min);
        let count = |low: f64, high: f64| {
            let within = samplings.iter().filter(|sampling| (low..high).contains(&sampling.other_v));
            within.fold((0, 0), |(all, disturbed), sampling| {
                (all + 1, disturbed + usize::from(sampling.edges > 0))
            })
        };
        let steps = (0..=highest_v as u32).map(|from_v| {
            let (conversions, disturbed) = count(f64::from(from_v), f64::from(from_v + 1));
            SweepStep { from_v, conversions, disturbed }
        });
        let (all, disturbed) = count(CLEAN_V, f64::INFINITY);
        let share_above = disturbed as f64 / all.max(1) as f64;
        Self { bus_v, steps: steps.collect(), clean_v, highest_v, share_above }
    }

    /// Whether all voltages up to the documented one were seen, and none of them disturbs a conversion.
    pub fn is_sound(&self) -> bool {
        let documented = &self.steps[..self.steps.len().min(1 + CLEAN_V as usize)];
        documented.iter().all(|step| step.conversions >= FEWEST)
            && self.clean_v >= CLEAN_V
            && self.highest_v > CLEAN_V
    }
}

/// Result of all measurements.
#[derive(Clone, Debug, Serialize)]
pub struct Report {
    /// At rest and in motion.
    pub situations: Vec<SamplingReport>,
    /// Over the other bridge's voltage.
    pub sweep: SweepReport,
}

impl Report {
    /// Whether all of it is as documented.
    pub fn is_sound(&self) -> bool {
        self.situations.iter().all(SamplingReport::is_sound) && self.sweep.is_sound()
    }
}

/// Measures at rest, in motion and over the voltage, from a session whose drive is enabled.
pub fn run(session: &mut Session) -> Result<Report, ToolError> {
    let resting = session.machine.save()?;
    let mut situations = measure(session, "rest", 0.5)?;
    session.press_start()?;
    session.run(4.0)?;
    situations.extend(measure(session, "motion", 4.0)?);
    Ok(Report { situations, sweep: sweep(session, &resting)? })
}

fn sweep(session: &mut Session, resting: &Snapshot) -> Result<SweepReport, ToolError> {
    let (mut samplings, mut bus_v) = (Vec::new(), 0.0);
    for direction in 0..DIRECTIONS {
        session.machine.restore(resting)?;
        let plant = &mut session.chip_mut().plant;
        bus_v = plant.supply.voltage();
        for (axis, number) in plant.axes.iter_mut().zip([0, DIRECTIONS / 5]) {
            let angle = TAU * f64::from(direction + number) / f64::from(DIRECTIONS);
            axis.open = [true; 3];
            axis.shunt_faults = [-1.0, 1.0]
                .map(|side| Some(ShuntFault::Offset(ERROR_CODES * (angle + side * TAU / 3.0).cos())));
        }
        session.chip_mut().samplings = Some(Vec::new());
        session.run(RUN_S)?;
        samplings.extend(session.chip_mut().samplings.take().unwrap_or_default());
    }
    Ok(SweepReport::new(&samplings, bus_v))
}

impl SamplingReport {
    /// Whether every conversion began at the documented instant, without a preceding edge of the other
    /// bridge.
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
fn measure(
    session: &mut Session,
    situation: &'static str,
    duration: f64,
) -> Result<Vec<SamplingReport>, ToolError> {
    session.chip_mut().samplings = Some(Vec::new());
    session.run(duration)?;
    let samplings = session.chip_mut().samplings.take().unwrap_or_default();
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

#[cfg(test)]
mod tests {
    use super::*;

    fn samplings(disturbed_from: f64) -> Vec<Sampling> {
        let sampling = |other_v: f64| Sampling {
            axis: 0,
            trigger: 0,
            hold: 0,
            middle: 0,
            edges: u32::from(other_v > disturbed_from),
            other_v,
        };
        (0..5000).map(|number| sampling(25.5 * f64::from(number) / 5000.0)).collect()
    }

    #[test]
    fn the_sweep_fails_with_an_edge_below_the_documented_voltage() {
        let report = SweepReport::new(&samplings(24.6), 48.0);
        assert!(report.is_sound() && (24.6..24.61).contains(&report.clean_v), "{report:?}");
        assert!((report.share_above - 0.75).abs() < 0.01);
        assert!(!SweepReport::new(&samplings(24.2), 48.0).is_sound());
    }

    #[test]
    fn the_sweep_fails_where_voltages_were_not_seen() {
        let mut some = samplings(24.6);
        some.retain(|sampling| !(10.0..11.0).contains(&sampling.other_v));
        assert!(!SweepReport::new(&some, 48.0).is_sound());
        let low: Vec<_> = samplings(24.6).into_iter().filter(|sampling| sampling.other_v < 20.0).collect();
        assert!(!SweepReport::new(&low, 48.0).is_sound());
    }
}
