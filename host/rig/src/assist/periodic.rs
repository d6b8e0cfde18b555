//! Assistance of a periodic motion: how fast the oscillators lock, what the wearer's effort does, and what
//! happens when the wearer stops.
//!
//! ```text
//! e(t)     = p(t) / 2 pi - strides(t), wrapped      p: phase of the oscillators
//! error    = e - its mean in the last seconds before the cadence changes, or after it at the end
//! locked   = |error| stays below 5 % of a cycle
//! effort   = rms of both muscles in a cycle, over that of the same cycle without assistance
//! ```
//!
//! The wearer walks in the air, and after `CHANGE_S` changes the cadence by 20 %. In other runs the wearer
//! walks as long and then is limp or resists; energy that the leg gives counts from the second cycle on.

use core::f64::consts::TAU;

use crate::report::assist::PeriodicReport;
use hal_sim::wearer::description::WearerDescription;
use hal_sim::wearer::motion::{CadenceChange, Gait, IntendedMotion};
use hal_sim::wearer::muscles::Intention;
use hal_sim::world::TICK_S;
use scarab::leg::AssistShares;
use scarab_base::error::ToolError;
use scarab_base::stats::rms;
use scarab_identify::leg::exercise::{Exercise, hip_and_knee};

use super::subject::Subject;
use super::trial::{Drives, LimbAlone, Stage};

/// Time of the change of cadence, its size and duration.
const CHANGE_S: f64 = 14.0;
const CHANGE: f64 = 1.2;
const CHANGE_WITHIN_S: f64 = 1.0;
/// Duration of a run, and of the mean of the phase before the change, s.
const RUN_S: f64 = 28.0;
const REFERENCE_S: f64 = 5.0;
/// Largest phase error of locked oscillators, cycles.
const LOCKED: f64 = 0.05;
/// Cycles in which oscillators may lock.
const LOCKING_CYCLES: f64 = 3.0;
/// Ticks per sample of the law.
const TICKS_PER_SAMPLE: u64 = 8;
/// Time that a wearer is observed after stopping, s.
const STOPPED_S: f64 = 8.0;

/// One sample of a walk.
#[derive(Clone, Copy, Debug)]
struct Step {
    time: f64,
    /// Strides of the wearer since the start.
    strides: f64,
    /// Phase of the oscillators minus that of the wearer, cycles, -0.5 to 0.5.
    phase_error: f64,
    /// Sum of both joints' squared muscle torque, (N m)^2.
    effort: f64,
}

fn wrapped(cycles: f64) -> f64 {
    cycles - cycles.round()
}

fn gait<const B: usize>(subject: &Subject<B>, cadence_hz: f64) -> Result<Gait, ToolError> {
    let joints = hip_and_knee(&subject.exoskeleton)
        .ok_or_else(|| subject.exoskeleton.error("is not a hip and a knee"))?;
    // Angles that the faster cadence permits too.
    match Exercise::Gait(CHANGE * cadence_hz).intended(joints, subject.seed) {
        IntendedMotion::Gait(gait) => Ok(Gait { cadence_hz, ..gait }),
        _ => Err(subject.exoskeleton.error("has no gait").into()),
    }
}

/// Walks with a change of cadence.
fn walk<const B: usize>(
    subject: &Subject<B>,
    rig: &WearerDescription,
    shares: AssistShares,
    cadence_hz: f64,
) -> Result<Vec<Step>, ToolError> {
    let change = CadenceChange { at: CHANGE_S, cadence_hz: CHANGE * cadence_hz, within: CHANGE_WITHIN_S };
    let gait = Gait { change: Some(change), ..gait(subject, cadence_hz)? };
    let models = [&subject.empty.identified, &subject.worn()?.identified];
    let mut stage = Stage::begin(subject, rig, Drives::Assist(shares, models), None)?;
    stage.intend(Intention::Follow(IntendedMotion::Gait(gait)))?;
    let (mut steps, mut strides, mut effort) = (Vec::new(), 0.0, 0.0);
    for tick in 1..=(RUN_S / TICK_S) as u64 {
        stage.tick();
        let time = tick as f64 * TICK_S;
        let x = ((time - CHANGE_S) / CHANGE_WITHIN_S).clamp(0.0, 1.0);
        let changed = x * x * x * (10.0 - 15.0 * x + 6.0 * x * x);
        strides += TICK_S * cadence_hz * (1.0 + (CHANGE - 1.0) * changed);
        effort += stage.wearer().muscle_torque.iter().map(|torque| torque * torque).sum::<f64>();
        if tick.is_multiple_of(TICKS_PER_SAMPLE) {
            let periodic = stage.pair.leg.law().periodic();
            let phase = periodic.map_or(f64::NAN, |periodic| f64::from(periodic.oscillator().phase()) / TAU);
            let phase_error = wrapped(phase - strides);
            steps.push(Step { time, strides, phase_error, effort: effort / TICKS_PER_SAMPLE as f64 });
            effort = 0.0;
        }
    }
    Ok(steps)
}

/// Squared efforts of the cycles, mean over each.
fn efforts(steps: &[Step]) -> Vec<f64> {
    steps
        .chunk_by(|one, other| one.strides.floor() == other.strides.floor())
        .map(|cycle| cycle.iter().map(|step| step.effort).sum::<f64>() / cycle.len() as f64)
        .collect()
}

/// Steps between two times, s.
fn between(steps: &[Step], [begin, end]: [f64; 2]) -> impl DoubleEndedIterator<Item = &Step> {
    steps.iter().filter(move |step| (begin..end).contains(&step.time))
}

/// Mean phase error in the last seconds before a time (s), cycles. Errors near half a cycle wrap.
fn reference(steps: &[Step], end: f64) -> f64 {
    let (sine, cosine) = between(steps, [end - REFERENCE_S, end]).fold((0.0, 0.0), |(sine, cosine), step| {
        let (s, c) = (TAU * step.phase_error).sin_cos();
        (sine + s, cosine + c)
    });
    sine.atan2(cosine) / TAU
}

/// Strides from a time until the phase stays locked before an end, s.
fn lock_cycles(steps: &[Step], window: [f64; 2]) -> f64 {
    let reference = reference(steps, window[1]);
    let first = between(steps, window).next().map_or(0.0, |step| step.strides);
    let is_unlocked = |step: &&Step| !(wrapped(step.phase_error - reference).abs() < LOCKED);
    between(steps, window).rfind(is_unlocked).map_or(0.0, |step| step.strides - first)
}

/// Energy given from the second cycle after a walking wearer stopped, J.
fn stopped<const B: usize>(
    subject: &Subject<B>,
    rig: &WearerDescription,
    shares: AssistShares,
    cadence_hz: f64,
    intention: Intention,
) -> Result<f64, ToolError> {
    let models = [&subject.empty.identified, &subject.worn()?.identified];
    let limb = LimbAlone::new(subject, rig)?;
    let mut stage = Stage::begin(subject, rig, Drives::Assist(shares, models), None)?;
    stage.intend(Intention::Follow(IntendedMotion::Gait(gait(subject, cadence_hz)?)))?;
    stage.run(CHANGE_S);
    stage.intend(intention)?;
    stage.run(1.0 / cadence_hz);
    Ok(stage.given(&limb, STOPPED_S))
}

/// Measures one cadence; `wearer` is a person, `rig` one who insists on the motion.
///
/// # Errors
/// A wearer does not fit, or the firmware refuses the session.
pub(crate) fn periodic<const B: usize>(
    subject: &Subject<B>,
    [rig, wearer]: [&WearerDescription; 2],
    shares: AssistShares,
    cadence_hz: f64,
) -> Result<PeriodicReport, ToolError> {
    let with = walk(subject, rig, shares, cadence_hz)?;
    let without = walk(subject, rig, AssistShares { periodic: 0.0, ..shares }, cadence_hz)?;
    let settled = reference(&with, CHANGE_S);
    let steady =
        between(&with, [CHANGE_S - REFERENCE_S, CHANGE_S]).map(|step| wrapped(step.phase_error - settled));
    let [with_effort, without_effort] = [&with, &without].map(|steps| efforts(steps));
    let changed_at = CHANGE_S * cadence_hz;
    let is_locked = |cycle: &(usize, f64)| {
        let number = cycle.0 as f64;
        number >= LOCKING_CYCLES && !(changed_at - 1.0..changed_at + LOCKING_CYCLES + 1.0).contains(&number)
    };
    let ratios: Vec<f64> = with_effort
        .iter()
        .zip(&without_effort)
        .map(|(with, without)| (with / without).sqrt())
        .enumerate()
        .filter(is_locked)
        .map(|(_, ratio)| ratio)
        .collect();
    Ok(PeriodicReport {
        seed: subject.seed,
        cadence_hz,
        lock_cycles: lock_cycles(&with, [0.0, CHANGE_S]),
        relock_cycles: lock_cycles(&with, [CHANGE_S, RUN_S]),
        phase_error_percent: 100.0 * rms(steady),
        mean_effort: ratios.iter().sum::<f64>() / ratios.len().max(1) as f64,
        largest_effort: ratios.iter().copied().fold(0.0, f64::max),
        given_limp_j: stopped(subject, wearer, shares, cadence_hz, Intention::Limp)?,
        given_resisting_j: stopped(subject, wearer, shares, cadence_hz, Intention::Resist)?,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Walk at 1 Hz whose phase error settles near half a cycle from three strides on, on both sides of the
    /// wrap, and falls again by a tenth for two strides after the change.
    fn steps() -> Vec<Step> {
        (0..2800)
            .map(|number| {
                let time = f64::from(number) * 0.01;
                let away = match time {
                    0.0..3.0 => 0.2,
                    14.0..16.0 => -0.1,
                    _ => 0.0,
                };
                let jitter = if number % 2 == 0 { 0.01 } else { -0.01 };
                let phase_error = wrapped(0.5 + jitter + away);
                Step { time, strides: time, phase_error, effort: time.floor() }
            })
            .collect()
    }

    #[test]
    fn locking_is_counted_in_cycles_across_the_wrap_of_the_phase() {
        let steps = steps();
        assert!((reference(&steps, CHANGE_S).abs() - 0.5).abs() < 1e-9);
        assert!((lock_cycles(&steps, [0.0, CHANGE_S]) - 3.0).abs() < 0.02);
        assert!((lock_cycles(&steps, [CHANGE_S, RUN_S]) - 2.0).abs() < 0.02);
    }

    #[test]
    fn efforts_are_means_of_whole_cycles() {
        let efforts = efforts(&steps());
        assert_eq!(efforts.len(), 28);
        assert!(efforts.iter().enumerate().all(|(cycle, effort)| (effort - cycle as f64).abs() < 1e-9));
    }
}
