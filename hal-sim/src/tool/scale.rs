//! Scale and load of a simulated run: the same leg once more with a known mass, and a load that is known anyway.
//!
//! Why here: the board identifies one leg as it hangs. What a second run with a known mass says about the torque constants
//! (`scarab::ident::scale`) is worked out from the records of two identifications, each through the whole firmware on the
//! same simulated leg; attaching the mass between them is the operator's part. Then the first run is solved again with
//! every torque put right, by the same solver, and judged again by the same verdict. A load that the leg is known to
//! carry is taken off the records in the same way.
//!
//! Without a mass everything stays relative to the torque constants that were used, and the report says so.

mod report;

pub use report::{MassReport, ScaleReport, TorqueConstantReport, lines, summary};

use scarab::ident::{
    ConstantRatio, Ends, HeldOut, Misalignments, Record, Recorder, Residual, SearchState, Solver, Thresholds,
    Unused as HeldOutMotion, Verdict, torque_constant_ratio,
};
use scarab::leg::{LoggedSample, Segment, VALIDATION_MOTIONS};
use scarab::model::Payload;

use super::error::ToolError;
use super::findings::FindingReport;
use super::motions::VALIDATION_NAMES;
use super::pair::{Context, PENDING, Pair, TAPS};
use crate::world::TICK_S;

/// The leg hangs so long with the mass before it is moved again, s.
const ATTACHING_S: f64 = 2.0;
/// The second run takes no longer, s.
const LONGEST_RUN_S: f64 = 120.0;
/// Evaluations between two looks at the search.
const SLICE: u32 = 20;

/// Records of the motions that were predicted.
pub type Unused<const N: usize, const B: usize> = [Option<Record<f32, N, B>>; VALIDATION_MOTIONS];

/// What a known mass and a known load say about a run.
#[derive(Clone, Debug)]
pub struct Scale<const N: usize, const B: usize> {
    /// The mass of the second run.
    pub payload: Option<Payload<f64>>,
    /// Believed over true torque constant, where the mass told.
    pub ratios: [Option<ConstantRatio<f32>>; N],
    /// What the leg was known to carry in both runs.
    pub load: Option<Payload<f64>>,
    /// Base parameters of that; zero without.
    pub load_base: [f32; B],
}

/// A run solved again with every torque put right.
#[derive(Clone, Debug)]
pub struct Corrected<const N: usize, const B: usize> {
    /// Done.
    pub solver: Box<Solver<f32, N, B>>,
    /// Of the corrected result on the corrected records.
    pub verdict: Verdict,
    /// What it saw.
    pub findings: Vec<FindingReport>,
    /// Corrected.
    pub unused: Unused<N, B>,
    /// First iteration with an excess of at most a half.
    pub iterations_to_half_chi2: Option<u32>,
}

/// What unused motions look like with every torque put right.
struct SeenAgain<const N: usize> {
    residuals: [Residual<f32, N>; VALIDATION_MOTIONS],
    asked: Misalignments<f32>,
}

impl<const N: usize, const B: usize> Scale<N, B> {
    /// What a load says, and a mass for which `pair`, which has identified, is carried through a second run.
    pub fn find(
        context: &Context<N, B>,
        pair: &Pair<N, B>,
        payload: Option<&Payload<f64>>,
        load: Option<&Payload<f64>>,
    ) -> Result<Self, ToolError> {
        let ratios = match payload {
            Some(payload) => Self::find_with(context, pair, payload, payload)?.ratios,
            None => [None; N],
        };
        let load_base = load.map_or([0.0; B], |load| base_of(context, load));
        Ok(Self { payload: payload.copied(), ratios, load: load.copied(), load_base })
    }

    /// The same without a load, with a mass on the leg that need not be the one that is stated.
    pub fn find_with(
        context: &Context<N, B>,
        pair: &Pair<N, B>,
        carried: &Payload<f64>,
        stated: &Payload<f64>,
    ) -> Result<Self, ToolError> {
        let base = base_of(context, stated);
        let mut ratios = [None; N];
        if let Some(solver) = pair.leg.identification().solver() {
            let with = second_run(pair, carried, context.gravity)?;
            ratios =
                core::array::from_fn(|joint| torque_constant_ratio(solver.record(), &with, joint, &base));
        }
        Ok(Self { payload: Some(*stated), ratios, load: None, load_base: [0.0; B] })
    }

    /// Believed over true constant of all joints; `None` unless the mass told every one of them well and nothing contradicts.
    #[must_use]
    pub fn trusted(&self) -> Option<[ConstantRatio<f32>; N]> {
        let all: Option<Vec<_>> = self
            .ratios
            .iter()
            .map(|ratio| ratio.filter(|found| found.is_told() && found.is_consistent()))
            .collect();
        all?.try_into().ok()
    }

    /// The run with every torque put right; `None` where there is nothing to correct.
    #[must_use]
    pub fn corrected(
        &self,
        context: &Context<N, B>,
        solver: &Solver<f32, N, B>,
        unused: &Unused<N, B>,
        log: &[LoggedSample<N>],
    ) -> Option<Corrected<N, B>> {
        let found = self.trusted();
        if found.is_none() && self.load.is_none() {
            return None;
        }
        let ratios = found.map_or([1.0; N], |found| found.map(|ratio| ratio.ratio));
        let (model, thresholds) = (&context.background.device, Thresholds::default());
        let prior = context.configuration.prior.as_ref();
        let solve = |ratios: &[f32; N]| {
            let record = solver.record().corrected(ratios, &self.load_base);
            Solver::new(model, record, solver.plan(), prior, solver.search().seed())
        };
        let mut again = Box::new(solve(&ratios));
        for joint in 0..N {
            let mut moved = ratios;
            moved[joint] += found.map_or(0.0, |found| found[joint].sigma);
            again.widen(solve(&moved).least_squares());
        }
        let iterations_to_half_chi2 = search(context, &mut again);
        let unused = unused
            .each_ref()
            .map(|record| record.as_ref().map(|record| record.corrected(&ratios, &self.load_base)));
        let seen = self.look_again(context, &again, &ratios, log)?;
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

    /// The unused motions once more through the firmware's own recorder, every torque put right, held against the corrected
    /// leg with what it carries: their order in time, and what they ask for.
    fn look_again(
        &self,
        context: &Context<N, B>,
        solver: &Solver<f32, N, B>,
        ratios: &[f32; N],
        log: &[LoggedSample<N>],
    ) -> Option<SeenAgain<N>> {
        let mut recorder =
            Box::new(Recorder::<f32, N, B, TAPS, PENDING>::new(context.configuration.bandwidth_hz).ok()?);
        let mut model = context.background.device.clone();
        model.stribeck = solver.stribeck(&model);
        let values = loaded(Some(self), &solver.values());
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
}

fn base_of<const N: usize, const B: usize>(context: &Context<N, B>, mass: &Payload<f64>) -> [f32; B] {
    context.background.model.base.project(&mass.parameters::<N>()).map(|value| value as f32)
}

/// Base values of the leg with what it carries, from those of the leg alone.
#[must_use]
pub fn loaded<const N: usize, const B: usize>(scale: Option<&Scale<N, B>>, values: &[f32; B]) -> [f32; B] {
    let load = scale.map_or([0.0; B], |scale| scale.load_base);
    core::array::from_fn(|base| values[base] + load[base])
}

/// Runs the search to its end; the first iteration with an excess of at most a half.
fn search<const N: usize, const B: usize>(
    context: &Context<N, B>,
    solver: &mut Solver<f32, N, B>,
) -> Option<u32> {
    let optimum = context.background.costs(solver);
    let mut to_half = None;
    loop {
        let state = solver.advance(&context.background.device, SLICE);
        let excess = optimum.factor.excess(&solver.search().values().map(f64::from)) - optimum.above;
        if excess <= 0.5 && !matches!(state, SearchState::Failed(_)) {
            to_half = to_half.or(Some(solver.search().iterations()));
        }
        if state != SearchState::Running {
            return to_half;
        }
    }
}

/// The excitation once more, with a mass on the leg: the record of it.
fn second_run<const N: usize, const B: usize>(
    pair: &Pair<N, B>,
    payload: &Payload<f64>,
    gravity: [f32; 3],
) -> Result<Record<f32, N, B>, ToolError> {
    let mut pair = pair.clone();
    pair.evaluations = 0; // the record is all that is wanted
    pair.world.attach(payload.joint, payload.mass, payload.place.into());
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
