//! State of a simulated run after a tick, without the leg's size.

use scarab::ident::Estimate;
use scarab::leg::{Activity, ControlOutput, DriveState, IdentifyPhase, LimitCodes, Step, Stribeck};
use scarab_base::names::VALIDATION_NAMES;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::BaseReport;
use scarab_identify::report::findings::FindingReport;
use scarab_identify::run::progress::ChainSample;

use crate::pair::{Context, Pair};

/// Estimate of a search.
#[derive(Clone, Debug)]
pub struct SearchEstimate {
    /// Iterations of the search.
    pub iterations: u32,
    /// Reports of the base parameters.
    pub base: Vec<BaseReport>,
    /// Their values.
    pub values: Vec<f32>,
    /// Stribeck curve of each joint.
    pub stribeck: Vec<Stribeck<f32>>,
}

/// State of a run after a tick.
pub trait RunState {
    /// Servo ticks since the start.
    fn ticks(&self) -> u64;
    /// State of the drive.
    fn drive(&self) -> DriveState;
    /// Activity of the leg.
    fn activity(&self) -> Activity;
    /// Limits that acted on each joint in this tick.
    fn limit_codes(&self) -> Vec<LimitCodes>;
    /// Commanded chain angles, rad.
    fn commanded_rad(&self) -> &[f32];
    /// Newest logged sample in the output, with its tick.
    fn logged(&self) -> Option<(u32, ChainSample)>;
    /// Duration of the motion that an activity runs, in ticks.
    fn motion_ticks(&self, activity: Activity) -> Option<u64>;
    /// Why the drive stopped, in words.
    fn stop_words(&self, leg: &LegFile) -> String;
    /// Estimate of the running search; `None` if it still has this number of iterations.
    fn search(&self, iterations: u32) -> Option<SearchEstimate>;
    /// Result of the finished search.
    fn result(&self) -> Option<SearchEstimate>;
    /// Number of the motions predicted so far, with the tests of the verdict; `None` if it is this number.
    fn findings(&self, motions: usize) -> Option<(usize, Vec<FindingReport>)>;
}

/// A pair after a tick.
pub(crate) struct Tick<'a, const N: usize, const B: usize> {
    pub(crate) context: &'a Context<N, B>,
    pub(crate) pair: &'a Pair<N, B>,
    pub(crate) output: &'a ControlOutput<N>,
}

impl<const N: usize, const B: usize> Tick<'_, N, B> {
    fn found(&self, estimate: &Estimate<f32, B>, dropped: &[bool; B], iterations: u32) -> SearchEstimate {
        SearchEstimate {
            iterations,
            base: self.context.background.base_parameters(dropped, estimate, None),
            values: estimate.values.to_vec(),
            stribeck: self.pair.leg.identification().model().stribeck.to_vec(),
        }
    }
}

impl<const N: usize, const B: usize> RunState for Tick<'_, N, B> {
    fn ticks(&self) -> u64 {
        self.pair.ticks
    }

    fn drive(&self) -> DriveState {
        self.pair.leg.control().state()
    }

    fn activity(&self) -> Activity {
        self.pair.leg.control().activity()
    }

    fn limit_codes(&self) -> Vec<LimitCodes> {
        self.pair.leg.control().limit_codes(self.output).to_vec()
    }

    fn commanded_rad(&self) -> &[f32] {
        &self.output.motion.position_rad
    }

    fn logged(&self) -> Option<(u32, ChainSample)> {
        let logged = self.output.logged?;
        let motion = ChainSample {
            position_rad: logged.sample.position_rad.to_vec(),
            torque_nm: logged.sample.torque_nm.to_vec(),
            segment: logged.segment,
        };
        Some((logged.sample.tick, motion))
    }

    fn motion_ticks(&self, activity: Activity) -> Option<u64> {
        let motions = &self.context.motions;
        let motion = match activity {
            Activity::Identify(IdentifyPhase::Excite) => &motions.excitation,
            Activity::Identify(IdentifyPhase::Validate { motion, step: Step::Run }) => {
                motions.validation.get(usize::from(motion))?
            }
            _ => return None,
        };
        Some(u64::from(motion.duration_ticks()))
    }

    fn stop_words(&self, leg: &LegFile) -> String {
        self.pair.stop_words(leg)
    }

    fn search(&self, iterations: u32) -> Option<SearchEstimate> {
        let solver = self.pair.leg.identification().solver();
        let solver =
            solver.filter(|solver| solver.is_selected() && solver.search().iterations() != iterations)?;
        let estimate = Estimate { values: solver.search().values(), ..solver.least_squares().clone() };
        Some(self.found(&estimate, &solver.record().selection.dropped, solver.search().iterations()))
    }

    fn result(&self) -> Option<SearchEstimate> {
        let solver = self.pair.leg.identification().solver()?;
        Some(self.found(&solver.estimate(), &solver.record().selection.dropped, solver.search().iterations()))
    }

    fn findings(&self, motions: usize) -> Option<(usize, Vec<FindingReport>)> {
        let identification = self.pair.leg.identification();
        identification.solver()?;
        let predicted = identification.validation().iter().flatten().count();
        let mut findings = Vec::new();
        if predicted == motions {
            return None;
        }
        identification
            .judge_with(&mut |evidence| findings.push(FindingReport::new(evidence, &VALIDATION_NAMES)));
        Some((predicted, findings))
    }
}
