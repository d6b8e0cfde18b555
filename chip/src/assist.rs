//! A session of assistance of the unmodified image, and the same session of the host's complete drives.
//!
//! Both models are identified on the host and written into the image's flash, as a board has them after two
//! identifications. The motors are calibrated free of their gears, the leg is put on its wearer while the
//! drive holds it, and the start button begins and ends the session (table `assist` of the leg file).

use hal_sim::wearer::WearerTruth;
use hal_sim::wearer::motion::IntendedMotion;
use hal_sim::wearer::muscles::Intention;
use scarab::leg::{Activity, AssistPhase, ControlRequest, DriveState, IdentifiedModel, Wearing};
use scarab::model::planar::BASE;
use scarab::store::{JointProvenance, ModelRecord, Provenance};
use scarab::units::{Metre, NewtonMetre};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::assist::AssistFile;
use scarab_identify::leg::exercise::{Exercise, hip_and_knee};
use scarab_identify::leg::two_bodies::MuscleTone;
use scarab_rig::assist::study::Mode;
use scarab_rig::assist::subject::{Cuffs, Subject};
use scarab_rig::options::{DriveModel, SimulationOptions};
use scarab_rig::pair::{Context, Pair};
use scarab_rig::parameter_file::memory::Memory;
use serde::Serialize;

use crate::image::Image;
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;

/// Strides per second of the wearer.
const CADENCE_HZ: f64 = 0.8;
/// Time from the start of the motion to the measurement, and its duration, s: whole strides.
const SETTLING_S: f64 = 7.5;
const MEASURED_S: f64 = 5.0;
/// Interval of the measurement, s.
const SAMPLE_S: f64 = 1e-3;
/// Servo ticks in it.
const TICKS: u32 = 4;
/// Longest fade with what precedes it, s.
const FADE_S: f64 = 3.0;
/// Largest permitted difference of the interaction torque between image and host.
const LARGEST_DIFFERENCE: f64 = 0.05;

/// Result of one session on the image and on the host; pairs are hip and knee.
#[derive(Clone, Debug, Serialize)]
pub struct AssistComparison {
    pub mode: &'static str,
    /// Interaction torque of the image, N m rms.
    pub image_rms_nm: [f64; 2],
    /// Interaction torque of the host's complete drives, N m rms.
    pub host_rms_nm: [f64; 2],
    /// Phases of the image's session in order, and of the host's.
    pub image_phases: Vec<String>,
    pub host_phases: Vec<String>,
    /// Share of the processor that the law takes in the session, 0..1.
    pub law_share: f64,
    pub missed_current_ticks: u32,
}

impl AssistComparison {
    /// Whether torques agree and the phases are the same.
    pub fn is_good(&self) -> bool {
        let agrees = |joint: usize| {
            (self.image_rms_nm[joint] / self.host_rms_nm[joint] - 1.0).abs() <= LARGEST_DIFFERENCE
        };
        agrees(0) && agrees(1) && self.image_phases == self.host_phases && self.missed_current_ticks == 0
    }
}

/// Mean square of the interaction torque.
#[derive(Default)]
struct Mean {
    sums: [f64; 2],
    count: u32,
}

impl Mean {
    fn take(&mut self, truth: &WearerTruth) {
        for (sum, torque) in self.sums.iter_mut().zip(truth.interaction_torque) {
            *sum += torque * torque;
        }
        self.count += 1;
    }

    fn rms(&self) -> [f64; 2] {
        self.sums.map(|sum| (sum / f64::from(self.count)).sqrt())
    }
}

/// Wearer, motion and models of a session.
struct Subjected {
    subject: Subject<BASE>,
    exoskeleton: LegFile,
    shares: AssistFile,
    wearer: hal_sim::wearer::description::WearerDescription,
    motion: IntendedMotion,
}

/// Runs one session on the image, at `factor` cycles per instruction, and on the host.
///
/// # Errors
/// The leg has no wearer, the image cannot be built, or a session does not begin.
pub fn compare(
    leg: &LegFile,
    mode: Mode,
    cuffs: &Cuffs,
    seed: u64,
    factor: f64,
) -> Result<AssistComparison, ToolError> {
    let subject = Subject::<BASE>::identify(leg, cuffs, seed)?
        .map_err(|refused| leg.error(format!("model `{}` refused: {:?}", refused.model, refused.reasons)))?;
    let shares = mode.shares(&AssistFile::USUAL);
    let exoskeleton = LegFile { assist: Some(shares), ..subject.exoskeleton.clone() };
    let joints = hip_and_knee(&exoskeleton).ok_or_else(|| leg.error("is no hip with a knee"))?;
    let motion = Exercise::Gait(CADENCE_HZ).intended(joints, seed);
    let wearer = cuffs.on(&subject.bodies.wearer(MuscleTone::Firm));
    let subjected = Subjected { subject, exoskeleton, shares, wearer, motion };
    let host = subjected.on_host(seed)?;
    subjected.on_image(mode, host, seed, factor)
}

impl Subjected {
    fn error(&self, text: impl Into<String>) -> ToolError {
        self.exoskeleton.error(text.into()).into()
    }

    fn models(&self) -> Result<[IdentifiedModel<JOINTS>; 2], ToolError> {
        Ok([self.subject.empty.identified, self.subject.worn()?.identified])
    }

    /// Record of a model as the board stores it.
    fn record(&self, model: &IdentifiedModel<JOINTS>, worn: bool) -> ModelRecord<JOINTS> {
        let configuration = &self.subject.context.configuration;
        let joints = configuration.joints.map(|joint| JointProvenance {
            length: Metre(0.0),
            torque_per_ampere: joint.scale.torque_per_ampere,
            rms: NewtonMetre(f32::NAN),
            mean_absolute: NewtonMetre(f32::NAN),
        });
        ModelRecord {
            model: configuration.to_stored(model),
            provenance: Provenance {
                firmware: [0, 1, 0],
                generation: 1,
                swarm_seed: configuration.swarm_seed,
                bridge: None,
                worn: Some(worn),
                joints,
            },
        }
    }

    fn on_host(&self, seed: u64) -> Result<([f64; 2], Vec<String>), ToolError> {
        let simulation = SimulationOptions { drive: DriveModel::Full, ..SimulationOptions::with_seed(seed) };
        let context = Context::<JOINTS, BASE>::new(&self.exoskeleton, &simulation)?;
        let mut pair = Pair::new(&self.exoskeleton, &context, seed)?;
        let [empty, worn] = self.models()?;
        let is_ready = pair.leg.set_model(Wearing::Empty, empty)
            && pair.leg.set_model(Wearing::Worn, worn)
            && pair.enable(context.gravity);
        if !is_ready {
            return Err(self.error("the host's drive refused to be enabled"));
        }
        pair.world.wear(&self.wearer).map_err(|error| self.error(error.to_string()))?;
        let mut phases = Vec::new();
        let mut run = |pair: &mut Pair<JOINTS, BASE>, seconds: f64, mut see: Option<&mut Mean>| {
            for tick in 0..(seconds * 4000.0) as u32 {
                pair.tick(None, context.gravity);
                note(&mut phases, pair.leg.control().activity());
                if let Some(mean) = see.as_deref_mut().filter(|_| tick.is_multiple_of(TICKS))
                    && let Some(truth) = pair.world.wearer_truth()
                {
                    mean.take(&truth);
                }
            }
        };
        run(&mut pair, 0.5, None);
        pair.tick(Some(ControlRequest::Assist(self.shares.shares())), context.gravity);
        run(&mut pair, 1.5, None);
        let intention = Intention::Follow(self.motion);
        pair.world.intend(intention).map_err(|error| self.error(error.to_string()))?;
        run(&mut pair, SETTLING_S, None);
        let mut mean = Mean::default();
        run(&mut pair, MEASURED_S, Some(&mut mean));
        pair.tick(Some(ControlRequest::EndAssist), context.gravity);
        run(&mut pair, 1.5, None);
        Ok((mean.rms(), phases))
    }

    fn on_image(
        &self,
        mode: Mode,
        (host_rms_nm, host_phases): ([f64; 2], Vec<String>),
        seed: u64,
        factor: f64,
    ) -> Result<AssistComparison, ToolError> {
        let image = Image::build(&self.exoskeleton)?;
        let mut session = Session::new(&image, &self.exoskeleton, factor, seed)?;
        session.prints = true;
        let mut memory = Memory::new(Some(session.chip_mut().flash.parameters_mut()));
        let [empty, worn] = self.models()?;
        let off = DriveState::SwitchOnDisabled;
        let is_stored = memory.keep_any(off, &self.record(&empty, false))
            && memory.keep_any(off, &self.record(&worn, true));
        if !is_stored {
            return Err(self.error("the models do not fit the image's flash"));
        }
        session.chip_mut().flash.parameters_mut().copy_from_slice(memory.bytes());
        session.boot()?;
        session.enable_drive()?;
        let worn = session.chip_mut().plant.wear(&self.wearer);
        worn.map_err(|error| self.error(error.to_string()))?;
        session.run(0.5)?;
        session.begin_measurement();
        let from = session.probe.lines.len();
        session.press_start()?;
        session.wait("state", &["activity=assist", "phase=run"], FADE_S)?;
        session.run(0.4)?;
        let intended = session.chip_mut().plant.intend(Intention::Follow(self.motion));
        intended.map_err(|error| self.error(error.to_string()))?;
        session.run(SETTLING_S)?;
        let mut mean = Mean::default();
        for _ in 0..(MEASURED_S / SAMPLE_S) as u32 {
            session.run(SAMPLE_S)?;
            if let Some(truth) = session.chip().plant.wearer_truth() {
                mean.take(&truth);
            }
        }
        let report = crate::report::ChipReport::new(&mut session, false, factor, seed)?;
        session.press_start()?;
        session.wait("state", &["activity=idle"], FADE_S)?;
        let phases = session.probe.lines.iter().skip(from).filter_map(|(_, line)| {
            let is_assist = field(line, "activity") == Some("assist");
            is_assist.then(|| field(line, "phase").unwrap_or("-").to_owned())
        });
        Ok(AssistComparison {
            mode: mode.name(),
            image_rms_nm: mean.rms(),
            host_rms_nm,
            image_phases: phases.collect(),
            host_phases,
            law_share: report.load.assist,
            missed_current_ticks: report.missed_current_ticks,
        })
    }
}

/// Notes a new phase of a session.
fn note(phases: &mut Vec<String>, activity: Activity) {
    let Activity::Assist(phase) = activity else { return };
    let name = match phase {
        AssistPhase::Enter => "enter",
        AssistPhase::Run => "run",
        AssistPhase::Leave => "leave",
    };
    if phases.last().is_none_or(|last| last != name) {
        phases.push(name.to_owned());
    }
}
