//! Scale and load of a simulated run: a second run with a known mass, and a known load.
//!
//! The board identifies one leg in its present state. A second run with a known mass determines the torque
//! constants (`scarab::ident::solve::scale`). It compares the records of two identifications, each through
//! the whole firmware on the same simulated leg; between them the operator attaches the mass. The first run
//! is then solved again with corrected torques, by the same solver and verdict. A known load is subtracted
//! from the records in the same way.
//!
//! Without a mass, results stay relative to the assumed torque constants, and the report says so.

use hal_sim::world::TICK_S;
use scarab::ident::{
    Ends, HeldOut, Misalignments, Record, Recorder, Residual, Solver, Thresholds, Unused as HeldOutMotion,
    Verdict, torque_constant_ratio,
};
use scarab::leg::{LoggedSample, Segment, VALIDATION_MOTIONS};
use scarab::model::Payload;
use scarab_base::error::ToolError;
use scarab_base::names::VALIDATION_NAMES;
use scarab_identify::report::findings::FindingReport;
use scarab_identify::run::scale::{Scale, base_of, loaded};

use crate::pair::{Context, PENDING, Pair, TAPS};

/// Time for which the leg hangs with the mass before it moves again, s.
const ATTACHING_S: f64 = 2.0;
/// Limit of the second run, s.
const LONGEST_RUN_S: f64 = 120.0;

/// Records of the predicted motions.
pub(crate) type Unused<const N: usize, const B: usize> = [Option<Record<f32, N, B>>; VALIDATION_MOTIONS];

/// Run solved again with corrected torques.
#[derive(Clone, Debug)]
pub struct Corrected<const N: usize, const B: usize> {
    /// Finished solver.
    pub solver: Box<Solver<f32, N, B>>,
    /// Verdict on the corrected result with the corrected records.
    pub verdict: Verdict,
    /// Evidence of that verdict.
    pub(crate) findings: Vec<FindingReport>,
    /// Corrected records of the unused motions.
    pub(crate) unused: Unused<N, B>,
    /// First iteration with an excess of at most 0.5.
    pub(crate) iterations_to_half_chi2: Option<u32>,
}

/// Unused motions with corrected torques.
struct SeenAgain<const N: usize> {
    residuals: [Residual<f32, N>; VALIDATION_MOTIONS],
    asked: Misalignments<f32>,
}

/// Evaluates the load, and runs a second identification with the mass on the already identified `pair`.
pub fn find<const N: usize, const B: usize>(
    context: &Context<N, B>,
    pair: &Pair<N, B>,
    payload: Option<&Payload<f64>>,
    load: Option<&Payload<f64>>,
) -> Result<Scale<N, B>, ToolError> {
    let ratios = match payload {
        Some(payload) => find_with(context, pair, payload, payload)?.ratios,
        None => [None; N],
    };
    let load_base = load.map_or([0.0; B], |load| base_of(&context.background, load));
    Ok(Scale { payload: payload.copied(), ratios, load: load.copied(), load_base })
}

/// Runs without a load; the attached mass may differ from the stated one.
pub fn find_with<const N: usize, const B: usize>(
    context: &Context<N, B>,
    pair: &Pair<N, B>,
    carried: &Payload<f64>,
    stated: &Payload<f64>,
) -> Result<Scale<N, B>, ToolError> {
    let base = base_of(&context.background, stated);
    let mut ratios = [None; N];
    if let Some(solver) = pair.leg.identification().solver() {
        let with = second_run(pair, carried, context.gravity)?;
        ratios = core::array::from_fn(|joint| torque_constant_ratio(solver.record(), &with, joint, &base));
    }
    Ok(Scale { payload: Some(*stated), ratios, load: None, load_base: [0.0; B] })
}

/// Solves the run again with corrected torques; `None` if no correction applies.
pub fn corrected<const N: usize, const B: usize>(
    scale: &Scale<N, B>,
    context: &Context<N, B>,
    solver: &Solver<f32, N, B>,
    unused: &Unused<N, B>,
    log: &[LoggedSample<N>],
) -> Option<Corrected<N, B>> {
    let found = scale.trusted();
    if found.is_none() && scale.load.is_none() {
        return None;
    }
    let ratios = found.map_or([1.0; N], |found| found.map(|ratio| ratio.ratio));
    let (model, thresholds) = (&context.background.device, Thresholds::default());
    let prior = context.configuration.prior.as_ref();
    let solve = |ratios: &[f32; N]| {
        let record = solver.record().corrected(ratios, &scale.load_base);
        Solver::new(model, record, solver.plan(), prior, solver.search().seed())
    };
    let mut again = Box::new(solve(&ratios));
    for joint in 0..N {
        let mut moved = ratios;
        moved[joint] += found.map_or(0.0, |found| found[joint].sigma);
        again.widen(solve(&moved).least_squares());
    }
    let iterations_to_half_chi2 = context.background.search(&mut again).to_half;
    let unused = unused
        .each_ref()
        .map(|record| record.as_ref().map(|record| record.corrected(&ratios, &scale.load_base)));
    let seen = revalidate(scale, context, &again, &ratios, log)?;
    let held_out = unused
        .iter()
        .zip(&seen.residuals)
        .filter_map(|(record, residual)| Some(HeldOutMotion { record: record.as_ref()?, residual }));
    let mut findings = Vec::new();
    let verdict = again.judge(model, &thresholds, held_out, &seen.asked, &mut |piece| {
        findings.push(FindingReport::new(piece, &VALIDATION_NAMES));
    });
    Some(Corrected { solver: again, verdict, findings, unused, iterations_to_half_chi2 })
}

/// Passes the unused motions through the firmware's own recorder again with corrected
/// torques. They are compared with the corrected leg including its load: residuals in their order, and
/// apparent misalignments.
fn revalidate<const N: usize, const B: usize>(
    scale: &Scale<N, B>,
    context: &Context<N, B>,
    solver: &Solver<f32, N, B>,
    ratios: &[f32; N],
    log: &[LoggedSample<N>],
) -> Option<SeenAgain<N>> {
    let mut recorder =
        Box::new(Recorder::<f32, N, B, TAPS, PENDING>::new(context.configuration.bandwidth_hz).ok()?);
    let mut model = context.background.device.clone();
    model.stribeck = solver.stribeck(&model);
    let values = loaded(Some(scale), &solver.values());
    let mut held_out = Box::new(HeldOut::<f32, N, B, PENDING>::new(recorder.reach()));
    let mut residuals = [Residual::new(); VALIDATION_MOTIONS];
    for (motion, residual) in residuals.iter_mut().enumerate() {
        let segment = Some(Segment::Validation(motion as u8));
        recorder.clear(Ends::Whole);
        held_out.begin(
            &values,
            &solver.unexpected(),
            &solver.row_noise(),
            &solver.record().selection.dropped,
        );
        for logged in log.iter().filter(|logged| logged.segment == segment) {
            let torque = core::array::from_fn(|joint| logged.sample.torque_nm[joint] / ratios[joint]);
            match recorder.push(&model, &logged.sample.position_rad, &torque) {
                Some(progress) => held_out.take(&model, &progress),
                None => held_out.break_off(),
            }
        }
        while let Some(progress) = recorder.flush(&model) {
            match progress {
                Some(progress) => held_out.take(&model, &progress),
                None => held_out.break_off(),
            }
        }
        held_out.break_off();
        *residual = *held_out.residual();
    }
    Some(SeenAgain { residuals, asked: held_out.alignment().misalignments() })
}

/// Repeats the excitation with a mass on the leg and returns its record.
fn second_run<const N: usize, const B: usize>(
    pair: &Pair<N, B>,
    payload: &Payload<f64>,
    gravity: [f32; 3],
) -> Result<Record<f32, N, B>, ToolError> {
    let mut pair = pair.clone();
    pair.evaluations = 0; // only the record is used
    pair.world.attach(payload.joint, payload.mass, payload.position.into());
    for _ in 0..(ATTACHING_S / TICK_S) as u32 {
        pair.tick(None, gravity);
    }
    pair.recorded(gravity, LONGEST_RUN_S).ok_or_else(|| {
        ToolError::input(format!(
            "--payload: the drive did not complete the second run with {} kg on joint {}: too heavy?",
            payload.mass,
            payload.joint + 1
        ))
    })
}
