//! Picture of one leg from what its nodes have shown.

use scarab::bus::Frame;
use scarab::ident::{Estimate, Estimator, Plan, Reason};
use scarab::leg::{LoggedSample, Segment};
use scarab::model::AnatomicalJoint;
use scarab::servo::{LOG_RATE_HZ, LogSample, TICKS_PER_LOG};

use crate::base::error::ToolError;
use crate::base::number::Number;
use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::anatomy;
use crate::formats::model_file::ModelFile;
use crate::leg::background::Background;
use crate::leg::setup::{PriorChoice, background};
use crate::report::live::{EstimateOrigin, LiveOutcome, LiveStatus, LiveUpdate, Severity};
use crate::rig::bus::alarms::{Alarms, reason};
use crate::run::live::bus::Wire;
use crate::run::live::bus::node::{Event, NmtState, Node};
use crate::run::live::bus::words::{JointState, doing};
use crate::run::live::picture::{HALF_SAMPLE_S, Picture};
use crate::run::live::progress::Progress;

/// Objects that are shown.
const STATUSWORD: u16 = 0x6041;
/// Inputs, and their copy for CORC.
const INPUTS: [u16; 2] = [0x60FD, 0x219A];
const POSITION: u16 = 0x6064;
const TARGET: u16 = 0x607A;
const TORQUE: u16 = 0x6077;
const RATED_TORQUE: u16 = 0x6076;
/// Mode of operation, requested and present.
const MODE: [u16; 2] = [0x6060, 0x6061];
const IDENTIFICATION: u16 = 0x2100;
const BASE: u16 = 0x2120;
const BASE_SIGMA: u16 = 0x2121;
/// Bits of the statusword and of the inputs.
const INTERNAL_LIMIT: u32 = 1 << 11;
const SWITCH_CLOSED: u32 = 1 << 16;
const INHIBITING: core::ops::RangeInclusive<u8> = 17..=20;
/// Longest distance of two positions between which the motion is drawn, s.
const LONGEST_GAP_S: f64 = 0.1;
/// Targets and states of an identification older than this are no present ones, s.
const STALE_S: f64 = 0.5;
/// A node that was silent for this time is not heard any more, s.
const SILENT_S: f64 = 1.0;
/// Time of a statusword without positions after which the lack is told, s.
const NO_POSITION_S: f64 = 2.0;
/// Time in which an equal line is not repeated, s.
const REPEATED_S: f64 = 1.0;
/// Bandwidth of torque and prediction, Hz: an adapter's times scatter by a millisecond, and the acceleration
/// is their second derivative.
const BANDWIDTH_HZ: f32 = 5.0;
const SAMPLE_S: f64 = 1.0 / LOG_RATE_HZ as f64;

/// Positions of all joints at one time, and torques if the bus carries them; the model's angles and signs.
#[derive(Clone, Copy)]
struct Measured<const N: usize> {
    time_s: f64,
    /// Time of the last frame that belongs to it.
    until_s: f64,
    position: [f64; N],
    /// Torques, N m; not a number if unknown.
    torque: [f64; N],
}

/// One leg of the bus.
pub struct Leg<'a, const N: usize, const B: usize> {
    picture: Picture<'a, N>,
    progress: Progress<N, B>,
    background: Background<N, B>,
    anatomy: [AnatomicalJoint<f64>; N],
    nodes: [Node; N],
    alarms: Alarms,
    /// Words of the last fault in an emergency message.
    fault: Option<&'static str>,
    /// Last line about an emergency message, and its time, s.
    line: (String, f64),
    last: Option<Measured<N>>,
    /// Times of positions that wait for their torques, s.
    waiting: Option<[f64; N]>,
    /// Whether the lack of positions was told.
    lacks_positions: bool,
    /// Number of the next point of the 500 Hz grid.
    next: u64,
    /// Drive states and activity of the last status, to notice changes.
    shown: String,
    base: Vec<[f32; 2]>,
    /// Verdict and reasons that were shown.
    verdict: Option<(u32, u32)>,
}

impl<'a, const N: usize, const B: usize> Leg<'a, N, B> {
    /// A leg with one node per joint, proximal first; `model` predicts its torque.
    ///
    /// # Errors
    /// The leg file is incomplete, or its filter does not fit.
    pub fn new(
        leg: &'a LegFile,
        ids: [u8; N],
        place: usize,
        model: Option<&ModelFile>,
        out: &'a dyn Fn(LiveUpdate),
    ) -> Result<Self, ToolError> {
        // The leg on the bus is not the one of the leg file: its true parameters are unknown.
        let background = Background { truth: None, ..background::<N, B>(leg, PriorChoice::Default, 0)? };
        let mut progress = Progress::new(&background.device, BANDWIDTH_HZ, Estimator::Robust)?;
        if let Some(model) = model {
            let set = &model.base_set;
            let value =
                |name: &str| set.parameters.iter().find(|base| base.name == name).map(|base| base.value);
            let curves =
                set.stribeck.iter().map(|curve| (curve.joint - 1, curve.surplus_nm, curve.speed_rad_s));
            progress.use_named(&background, value, curves);
        }
        Ok(Self {
            picture: Picture::new(leg, anatomy::<N>(leg)?, out).at(place),
            progress,
            background,
            anatomy: anatomy::<N>(leg)?,
            nodes: ids.map(Node::new),
            alarms: Alarms::default(),
            fault: None,
            line: (String::new(), f64::NEG_INFINITY),
            last: None,
            waiting: None,
            lacks_positions: false,
            next: 0,
            shown: String::new(),
            base: Vec::new(),
            verdict: None,
        })
    }

    /// Takes a frame of the bus; `called` names the leg in the timeline.
    pub fn take(&mut self, frame: &Frame, now_s: f64, called: &str) {
        self.picture.time_s = now_s;
        for joint in 0..N {
            let name = &self.picture.leg().joints[joint].name;
            match self.nodes[joint].take(frame, now_s) {
                Some(Event::Nmt(state)) => {
                    self.picture.note(Severity::Note, format!("{called}{name}'s node {}", state.words()));
                    if state == NmtState::BootUp {
                        self.alarms.restarted(self.nodes[joint].emergency());
                    }
                }
                Some(Event::Emergency) => {
                    if let Some(words) = self.alarms.emergency(frame) {
                        let fault = self.alarms.active_fault();
                        let severity = if fault.is_some() { Severity::Fault } else { Severity::Warning };
                        self.fault = fault.or(self.fault);
                        let (line, since_s) = &self.line;
                        if *line != words || now_s - since_s > REPEATED_S {
                            self.picture.note(severity, format!("{called}{words}"));
                        }
                        self.line = (words, now_s);
                    }
                }
                Some(Event::Unmapped { length, mapped }) => {
                    let words = format!(
                        "{called}{name}'s PDO {:03X} has {length} bytes, the known mapping {mapped}: it was mapped \
                         before this page listened, so that it is not shown; start the page before the host",
                        frame.id()
                    );
                    self.picture.note(Severity::Warning, words);
                }
                None => {}
            }
        }
        self.measure();
        self.picture.time_s = now_s;
    }

    /// Value that every joint's node has, each by this function.
    fn each<T>(&self, value: impl Fn(&Node) -> Option<T>) -> Option<[T; N]> {
        let values: Option<Vec<T>> = self.nodes.iter().map(value).collect();
        values?.try_into().ok()
    }

    /// Draws the motion up to the present positions once every joint has a new one, with its torque if the
    /// bus carries torques.
    fn measure(&mut self) {
        let since = self.last.map_or(f64::NEG_INFINITY, |last| last.until_s);
        let now_s = self.picture.time_s;
        let at = |object: u16| self.each(|node| node.time_s(object, 0));
        let Some(positions_at) = at(POSITION).filter(|at| at.iter().all(|at| *at > since)) else { return };
        let torques_at = at(TORQUE).filter(|at| at.iter().all(|at| now_s - *at < STALE_S));
        let has_torques = torques_at.is_some_and(|at| at.iter().all(|at| *at > since));
        if torques_at.is_some() && !has_torques {
            // Torques of the same cycle come later, if they come each cycle.
            let waiting = *self.waiting.get_or_insert(positions_at);
            if !positions_at.iter().zip(waiting).all(|(at, waiting)| *at > waiting) {
                return;
            }
        }
        self.waiting = None;
        let torques_at = torques_at.filter(|_| has_torques);
        let Some(position) = self.each(|node| node.signed(POSITION)) else { return };
        let torque = torques_at.and_then(|_| self.each(|node| node.signed(TORQUE)));
        let used = || positions_at.into_iter().chain(torques_at.into_iter().flatten());
        let measured = Measured {
            // All nodes measure at a SYNC and answer one after the other.
            time_s: positions_at.into_iter().fold(f64::INFINITY, f64::min),
            until_s: used().fold(0.0, f64::max),
            position: core::array::from_fn(|joint| {
                self.anatomy[joint].angle_to_chain(f64::from(position[joint]) * 1e-6)
            }),
            torque: core::array::from_fn(|joint| {
                let thousandths = torque.map_or(f64::NAN, |torque| f64::from(torque[joint]));
                self.anatomy[joint].to_chain(thousandths * 1e-3 * self.rated_torque(joint))
            }),
        };
        match self.last.filter(|last| measured.time_s - last.time_s <= LONGEST_GAP_S) {
            Some(last) => self.draw(&last, &measured),
            None => {
                self.progress.break_off();
                self.picture.restart();
                self.next = (measured.time_s / SAMPLE_S).ceil().max(0.0) as u64;
            }
        }
        self.last = Some(measured);
    }

    /// Rated torque of a joint (6076), N m.
    fn rated_torque(&self, joint: usize) -> f64 {
        let file = &self.picture.leg().joints[joint];
        let cap = file.torque_limit_nm.min(file.current_limit() * file.torque_per_ampere.abs());
        self.nodes[joint].raw(RATED_TORQUE, 0).map_or(cap, |thousandths| f64::from(thousandths) * 1e-3)
    }

    /// Adds the 500 Hz samples between two measurements, by linear interpolation.
    fn draw(&mut self, from: &Measured<N>, to: &Measured<N>) {
        let now_s = self.picture.time_s;
        let target_at = self.each(|node| node.time_s(TARGET, 0));
        let is_present = target_at.is_some_and(|at| at.iter().all(|at| now_s - *at < STALE_S));
        let target = self.each(|node| node.signed(TARGET)).filter(|_| is_present);
        let target = target.map(|target| -> [f32; N] {
            core::array::from_fn(|joint| {
                self.anatomy[joint].angle_to_chain(f64::from(target[joint]) * 1e-6) as f32
            })
        });
        while self.next as f64 * SAMPLE_S <= to.time_s {
            let time_s = self.next as f64 * SAMPLE_S;
            let share = ((time_s - from.time_s) / (to.time_s - from.time_s)).clamp(0.0, 1.0);
            let between = |from: f64, to: f64| (from + share * (to - from)) as f32;
            let sample = LogSample {
                position_rad: core::array::from_fn(|joint| between(from.position[joint], to.position[joint])),
                torque_nm: core::array::from_fn(|joint| between(from.torque[joint], to.torque[joint])),
                counts_sum: [0; N],
                tick: (self.next as u32).wrapping_mul(TICKS_PER_LOG),
            };
            self.picture.time_s = time_s + HALF_SAMPLE_S;
            if let Some(target) = &target {
                self.picture.command(target);
            }
            let logged = LoggedSample { sample, segment: Some(Segment::Tracking) };
            self.picture.learn(&logged, &mut self.progress, &self.background, Plan::OneTime);
            self.next += 1;
        }
    }

    /// Base parameters, verdict and status, as far as the bus has shown them.
    pub fn report(&mut self, now_s: f64, called: &str, bus: &Wire<'_>) {
        self.picture.time_s = now_s;
        self.report_parameters();
        self.report_verdict();
        let status = self.status(bus);
        let since_s = self.last.map_or(0.0, |last| last.until_s);
        let has_state = self.nodes.iter().any(|node| node.time_s(STATUSWORD, 0).is_some());
        let lacks_positions = has_state && now_s - since_s > NO_POSITION_S;
        if lacks_positions && !self.lacks_positions && !bus.has_ended {
            let words = format!(
                "{called}no positions (6064) of all joints: no PDO carries them, none is sent without SYNC, or they \
                 were mapped before this page listened"
            );
            self.picture.note(Severity::Warning, words);
        }
        self.lacks_positions = lacks_positions;
        let shown = format!("{called}the leg {}; drive: {}", status.doing, status.drive);
        if shown != self.shown {
            self.picture.note(Severity::Note, shown.clone());
            self.shown = shown;
        }
        self.picture.send(LiveUpdate::Status(status));
    }

    /// Reports the parameters once a host has read them.
    fn report_parameters(&mut self) {
        let node = &self.nodes[0];
        let rank = self.background.model.base.rank();
        let base = |place: usize| {
            let sub = u8::try_from(place + 1).ok()?;
            Some([node.real(BASE, sub)?, node.real(BASE_SIGMA, sub)?])
        };
        let Some(base) = (0..rank).map(base).collect::<Option<Vec<[f32; 2]>>>() else { return };
        if base != self.base {
            let mut estimate = Estimate::nothing();
            for (place, [value, sigma]) in base.iter().enumerate() {
                estimate.values[place] = *value;
                estimate.covariance[place][place] = sigma * sigma;
                estimate.determined[place] = true;
            }
            self.progress.use_result(&self.background.device, &estimate.values);
            let reports = self.background.base_parameters(&[false; B], &estimate, None);
            self.picture.estimate(
                EstimateOrigin::Result,
                node.raw(IDENTIFICATION, 10).unwrap_or(0),
                &reports,
            );
            self.base = base;
        }
    }

    /// Reports the verdict, and its reasons once a host has read them.
    fn report_verdict(&mut self) {
        let node = &self.nodes[0];
        let read = node.raw(IDENTIFICATION, 8).filter(|verdict| (1..=2).contains(verdict));
        let verdict = read.map(|verdict| (verdict, node.raw(IDENTIFICATION, 9).unwrap_or(0)));
        if let Some((verdict, bits)) = verdict.filter(|_| verdict != self.verdict) {
            let reasons = Reason::ALL.into_iter().filter(|reason| bits >> *reason as u8 & 1 == 1);
            self.picture.send(LiveUpdate::Outcome(LiveOutcome {
                leg: self.picture.place(),
                verdict: if verdict == 1 { "accepted" } else { "refused" }.into(),
                validated: true,
                reasons: reasons.map(|reason| reason.name().into()).collect(),
                findings: Vec::new(),
            }));
        }
        self.verdict = verdict;
    }

    fn status(&self, bus: &Wire<'_>) -> LiveStatus {
        let joints = &self.picture.leg().joints;
        let named = |joint: usize, words: &str| format!("{}: {words}", joints[joint].name);
        let now_s = self.picture.time_s;
        let is_heard = |node: &Node| !bus.has_ended && node.heard_s().is_some_and(|at| now_s - at < SILENT_S);
        let states: [Option<JointState>; N] = core::array::from_fn(|joint| {
            let node = &self.nodes[joint];
            let word = node.raw(STATUSWORD, 0).filter(|_| is_heard(node))?;
            JointState::of(word as u16)
        });
        let is_same = states.iter().all(|state| *state == states[0]);
        let name = |state: Option<JointState>| state.map_or("unknown", JointState::name);
        let drive = if is_same {
            name(states[0]).to_owned()
        } else {
            (0..N).map(|joint| named(joint, name(states[joint]))).collect::<Vec<_>>().join("; ")
        };
        let lowest = states.iter().flatten().min().copied().filter(|_| states.iter().all(Option::is_some));
        let is_enabled = lowest.is_some_and(JointState::is_enabled);
        let silent: Vec<String> =
            self.nodes.iter().filter(|node| !is_heard(node)).map(|node| node.id().to_string()).collect();
        let number = |sub| {
            let node = &self.nodes[0];
            let is_present = node.time_s(IDENTIFICATION, sub).is_some_and(|at| now_s - at < STALE_S);
            node.raw(IDENTIFICATION, sub).filter(|_| is_present)
        };
        let modes: Vec<Option<i32>> =
            self.nodes.iter().map(|node| node.signed(node.newest(&MODE)?)).collect();
        let (doing, waits_for) = match lowest {
            _ if bus.has_ended => ("is unknown: the source has ended".into(), "nothing"),
            _ if !silent.is_empty() => {
                let others =
                    if bus.heard.is_empty() { String::new() } else { format!(" (heard: {})", bus.heard) };
                (format!("is unknown: no frame of node {}{others}", silent.join(", ")), "a frame")
            }
            None => (
                "is unknown: no statusword (6041) of every joint".into(),
                "a PDO with it, or a host that reads it",
            ),
            Some(_) if is_enabled => (doing(number(2), number(3), &modes), "commands of its host"),
            Some(state) => ("is off".into(), state.waits_for()),
        };
        let has_fault = states.iter().flatten().any(|state| state.has_fault());
        let fault =
            if has_fault { self.fault.unwrap_or("a fault from before this page listened") } else { "" };
        let not_enabled = match lowest {
            Some(_) if has_fault => format!("fault: {fault}"),
            Some(_) if !is_enabled => self.not_enabled(),
            _ => String::new(),
        };
        let limited = (0..N).filter(|joint| {
            self.nodes[*joint].raw(STATUSWORD, 0).is_some_and(|word| word & INTERNAL_LIMIT != 0)
        });
        LiveStatus {
            leg: self.picture.place(),
            time_s: self.picture.time_s,
            run: 1,
            drive,
            doing,
            waits_for: waits_for.into(),
            left_s: Number::UNKNOWN,
            not_enabled,
            fault: lowest.map(|_| fault.into()),
            limits: lowest.map(|_| limited.map(|joint| named(joint, "internal limit active")).collect()),
            speed: Number::UNKNOWN,
            processor: String::new(),
            bus: bus.load.to_owned(),
        }
    }

    /// Reasons in the inputs (60FD) why the leg cannot be enabled.
    fn not_enabled(&self) -> String {
        let mut reasons = Vec::new();
        for (node, joint) in self.nodes.iter().zip(&self.picture.leg().joints) {
            let inputs = node.newest(&INPUTS).and_then(|index| node.raw(index, 0));
            let Some(inputs) = inputs else { continue };
            let open = (inputs & SWITCH_CLOSED == 0).then_some(16);
            let set = INHIBITING.filter(|bit| inputs >> bit & 1 == 1);
            reasons.extend(open.into_iter().chain(set).map(|bit| format!("{}: {}", joint.name, reason(bit))));
        }
        if reasons.is_empty() { "no request of its host to enable it".into() } else { reasons.join("; ") }
    }
}
