//! E3: the counter of an encoder starts at any of its 16-bit values and wraps at any time, without any
//! effect.
//!
//! Each motor is calibrated on its test stand and driven back and forth. Its axis' inputs are then replayed
//! to axes whose counter starts elsewhere, one for each offset. The motion is the same if commands and joint
//! samples are equal bit for bit. Successive seeds start the counter one count farther from its wrap, odd
//! seeds below and even ones above. So 65,536 seeds cover all offsets, and among the first hundreds every
//! other counter wraps during the motion.

use core::f64::consts::TAU;

use hal_sim::world::periods::PERIODS_PER_TICK;
use rayon::prelude::*;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, JointSample};
use scarab::motor::{Axis, AxisConfiguration, AxisRequest, Calibration};
use scarab::units::Ampere;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::board::run_calibration;
use crate::faults::bench::calibration::{UNFIT, on_stand};
use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::run::Outcome;
use scarab::model::planar::JOINTS;

/// Number of start values of a counter.
pub(crate) const OFFSETS: u64 = 65_536;
/// Duration of the motion: 25 ms, about a hundred counts.
const PERIODS: usize = 600;
/// Amplitude (A) and frequency (Hz) of the requested current.
const ASKED_A: f64 = 4.0;
const ASKED_HZ: f64 = 40.0;

/// Inputs and outputs of one axis.
struct Driven {
    configuration: AxisConfiguration,
    calibration: Calibration,
    first: AxisSample,
    samples: Vec<AxisSample>,
    commands: Vec<AxisCommand>,
    joint: Vec<JointSample>,
}

fn requested(period: usize) -> AxisRequest {
    let turns = ASKED_HZ * period as f64 / f64::from(CURRENT_RATE_HZ);
    AxisRequest { enabled: true, current: Ampere((ASKED_A * (TAU * turns).sin()) as f32) }
}

/// Runs an axis on samples and returns its commands and joint samples.
fn run(
    axis: &mut Axis,
    mut sample: impl FnMut(usize, &AxisCommand) -> AxisSample,
) -> (Vec<AxisCommand>, Vec<JointSample>) {
    let (mut commands, mut joint) = (Vec::with_capacity(PERIODS), Vec::new());
    let mut command = AxisCommand::OFF;
    for period in 0..PERIODS {
        command = axis.tick(&sample(period, &command), requested(period));
        commands.push(command);
        if (period + 1) % PERIODS_PER_TICK as usize == PERIODS_PER_TICK as usize / 2 {
            axis.check();
        }
        if (period + 1).is_multiple_of(PERIODS_PER_TICK as usize) {
            joint.push(axis.joint_sample());
        }
    }
    (commands, joint)
}

impl Driven {
    fn new(leg: &LegFile, index: usize) -> Result<Self, ToolError> {
        let unfit = || leg.error(UNFIT);
        let (mut stand, mut calibrator, configuration) = on_stand(leg, index, 1)?;
        let ended = run_calibration(&mut calibrator, |_, command| stand.period(command, 0.0));
        let calibration = ended.and_then(|(_, result)| result.ok()).ok_or_else(unfit)?;
        let first = stand.period(&AxisCommand::OFF, 0.0);
        let mut axis = Axis::new(&configuration, &calibration, &first).map_err(|_| unfit())?;
        let mut samples = Vec::with_capacity(PERIODS);
        let (commands, joint) = run(&mut axis, |_, command| {
            let sample = stand.period(command, 0.0);
            samples.push(sample);
            sample
        });
        if axis.fault().is_some() {
            return Err(leg.error("its motor cannot be driven on the test stand").into());
        }
        Ok(Self { configuration, calibration, first, samples, commands, joint })
    }
}

pub(super) fn shift(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let driven = (0..JOINTS).map(|joint| Driven::new(leg, joint)).collect::<Result<Vec<_>, _>>()?;
    Ok(seeds.par_iter().map(|seed| one(fault, &driven, *seed, blind)).collect())
}

/// Blind: a count that stays at its end instead of wrapping.
fn one(fault: &Fault, driven: &[Driven], seed: u64, blind: bool) -> Outcome {
    let number = (seed - 1) % OFFSETS;
    let begin = if number.is_multiple_of(2) { !(number / 2) as u16 } else { (number / 2) as u16 };
    let same = driven.iter().all(|driven| {
        let first = driven.first.encoder_count;
        let moved = |count: u16| {
            let since = count.wrapping_sub(first).cast_signed();
            if blind { begin.saturating_add_signed(since) } else { begin.wrapping_add_signed(since) }
        };
        let shown = |sample: &AxisSample| AxisSample {
            encoder_count: moved(sample.encoder_count),
            index_count: sample.index_count.map(moved),
            ..*sample
        };
        let offset = begin.wrapping_sub(first);
        let calibration = driven.calibration.with_counter_moved(offset);
        let Ok(mut axis) = Axis::new(&driven.configuration, &calibration, &shown(&driven.first)) else {
            return false;
        };
        let (commands, joint) = run(&mut axis, |period, _| shown(&driven.samples[period]));
        axis.fault().is_none() && commands == driven.commands && joint == driven.joint
    });
    let mut found = outcome(fault, seed, same.then_some("-"));
    found.magnitude = Some(f64::from(begin));
    found
}
