//! Picture of one leg from what its nodes have shown.

use scarab::bus::Frame;
use scarab::ident::Reason;
use scarab::leg::Segment;
use scarab::servo::LOG_RATE_HZ;
use scarab_base::error::ToolError;
use scarab_base::number::Number;
use scarab_client::alarms::{Alarms, reason};
use scarab_client::words::{JointState, doing};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::ModelFile;
use scarab_identify::run::progress::{ChainSample, Progress, ProgressOptions, progress};

use crate::live::bus::BusStatus;
use crate::live::bus::node::{Event, NmtState, Node};
use crate::live::picture::{HALF_SAMPLE_S, Picture};
use crate::live::report::{EstimateOrigin, LiveOutcome, LiveStatus, LiveUpdate, Severity};

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
/// Time of a statusword without positions after which the lack is reported, s.
const NO_POSITION_S: f64 = 2.0;
/// Time in which an equal line is not repeated, s.
const REPEATED_S: f64 = 1.0;
/// Bandwidth of torque and prediction, Hz: an adapter's times scatter by a millisecond, and the acceleration
/// is their second derivative.
const BANDWIDTH_HZ: f64 = 5.0;
const SAMPLE_S: f64 = 1.0 / LOG_RATE_HZ as f64;

/// Positions of all joints at one time, and torques if the bus carries them; the model's angles and signs.
#[derive(Clone)]
struct Measured {
    time_s: f64,
    /// Time of the last frame that belongs to it.
    until_s: f64,
    position: Vec<f64>,
    /// Torques, N m; not a number if unknown.
    torque: Vec<f64>,
}

/// One leg of the bus.
pub(crate) struct Leg<'a> {
    picture: Picture<'a>,
    progress: Box<dyn Progress>,
    nodes: Vec<Node>,
    alarms: Alarms,
    /// Words of the last fault in an emergency message.
    fault: Option<&'static str>,
    /// Last line about an emergency message, and its time, s.
    line: (String, f64),
    last: Option<Measured>,
    /// Times of positions that wait for their torques, s.
    waiting: Option<Vec<f64>>,
    /// Whether the lack of positions was reported.
    lacks_positions: bool,
    /// Number of the next point of the 500 Hz grid.
    next: u64,
    /// Drive states and activity of the last status, to notice changes.
    shown: String,
    base: Vec<[f32; 2]>,
    /// Verdict and reasons that were shown.
    verdict: Option<(u32, u32)>,
}

impl<'a> Leg<'a> {
    /// A leg with one node per joint, proximal first; `model` predicts its torque.
    ///
    /// # Errors
    /// The leg file is incomplete, or its filter does not fit.
    pub fn new(
        leg: &'a LegFile,
        ids: &[u8],
        index: usize,
        model: Option<&ModelFile>,
        out: &'a dyn Fn(LiveUpdate),
    ) -> Result<Self, ToolError> {
        // The leg on the bus is not the one of the leg file: its true parameters are unknown.
        let options = ProgressOptions { reports_truth: false, ..ProgressOptions::new(BANDWIDTH_HZ) };
        let mut progress = progress(leg, &options)?;
        if let Some(model) = model {
            let set = &model.base_set;
            let value =
                |name: &str| set.parameters.iter().find(|base| base.name == name).map(|base| base.value);
            let curves =
                set.stribeck.iter().map(|curve| (curve.joint - 1, curve.surplus_nm, curve.speed_rad_s));
            progress.use_named(&value, &curves.collect::<Vec<_>>());
        }
        Ok(Self {
            picture: Picture::new(leg, out)?.at(index),
            progress,
            nodes: ids.iter().copied().map(Node::new).collect(),
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

    /// Takes a frame of the bus; `prefix` names the leg in the timeline.
    pub(crate) fn take(&mut self, frame: &Frame, now_s: f64, prefix: &str) {
        self.picture.time_s = now_s;
        for joint in 0..self.nodes.len() {
            let name = &self.picture.leg().joints[joint].name;
            match self.nodes[joint].take(frame, now_s) {
                Some(Event::Nmt(state)) => {
                    self.picture.note(Severity::Note, format!("{prefix}{name}'s node {}", state.words()));
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
                            self.picture.note(severity, format!("{prefix}{words}"));
                        }
                        self.line = (words, now_s);
                    }
                }
                Some(Event::Unmapped { length, mapped }) => {
                    let words = format!(
                        "{prefix}{name}'s PDO {:03X} has {length} bytes, the known mapping {mapped}: it was mapped \
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
    fn each<T>(&self, value: impl Fn(&Node) -> Option<T>) -> Option<Vec<T>> {
        self.nodes.iter().map(value).collect()
    }

    /// Value of each joint.
    fn of_joints<T>(&self, value: impl Fn(usize) -> T) -> Vec<T> {
        (0..self.nodes.len()).map(value).collect()
    }

    /// Draws the motion up to the present positions once every joint has a new one, with its torque if the
    /// bus carries torques.
    fn measure(&mut self) {
        let since = self.last.as_ref().map_or(f64::NEG_INFINITY, |last| last.until_s);
        let now_s = self.picture.time_s;
        let at = |object: u16| self.each(|node| node.time_s(object, 0));
        let Some(positions_at) = at(POSITION).filter(|at| at.iter().all(|at| *at > since)) else { return };
        let torques_at = at(TORQUE).filter(|at| at.iter().all(|at| now_s - *at < STALE_S));
        let has_torques = torques_at.as_ref().is_some_and(|at| at.iter().all(|at| *at > since));
        if torques_at.is_some() && !has_torques {
            // Torques of the same cycle come later, if they come each cycle.
            let waiting = self.waiting.get_or_insert_with(|| positions_at.clone());
            if !positions_at.iter().zip(waiting).all(|(at, waiting)| *at > *waiting) {
                return;
            }
        }
        self.waiting = None;
        let torques_at = torques_at.filter(|_| has_torques);
        let Some(position) = self.each(|node| node.signed(POSITION)) else { return };
        let torque = torques_at.as_ref().and_then(|_| self.each(|node| node.signed(TORQUE)));
        let anatomy = self.picture.anatomy();
        let measured = Measured {
            // All nodes measure at a SYNC and answer one after the other.
            time_s: positions_at.iter().copied().fold(f64::INFINITY, f64::min),
            until_s: positions_at.iter().chain(torques_at.iter().flatten()).copied().fold(0.0, f64::max),
            position: self
                .of_joints(|joint| anatomy[joint].angle_to_chain(f64::from(position[joint]) * 1e-6)),
            torque: self.of_joints(|joint| {
                let thousandths = torque.as_ref().map_or(f64::NAN, |torque| f64::from(torque[joint]));
                anatomy[joint].to_chain(thousandths * 1e-3 * self.rated_torque(joint))
            }),
        };
        match self.last.take().filter(|last| measured.time_s - last.time_s <= LONGEST_GAP_S) {
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
    fn draw(&mut self, from: &Measured, to: &Measured) {
        let now_s = self.picture.time_s;
        let target_at = self.each(|node| node.time_s(TARGET, 0));
        let is_present = target_at.is_some_and(|at| at.iter().all(|at| now_s - *at < STALE_S));
        let target = self.each(|node| node.signed(TARGET)).filter(|_| is_present);
        let anatomy = self.picture.anatomy();
        let target = target.map(|target| {
            self.of_joints(|joint| anatomy[joint].angle_to_chain(f64::from(target[joint]) * 1e-6) as f32)
        });
        while self.next as f64 * SAMPLE_S <= to.time_s {
            let time_s = self.next as f64 * SAMPLE_S;
            let share = ((time_s - from.time_s) / (to.time_s - from.time_s)).clamp(0.0, 1.0);
            let between = |from: f64, to: f64| (from + share * (to - from)) as f32;
            let logged = ChainSample {
                position_rad: self.of_joints(|joint| between(from.position[joint], to.position[joint])),
                torque_nm: self.of_joints(|joint| between(from.torque[joint], to.torque[joint])),
                segment: Some(Segment::Tracking),
            };
            self.picture.time_s = time_s + HALF_SAMPLE_S;
            if let Some(target) = &target {
                self.picture.command(target);
            }
            self.picture.learn(&logged, &mut *self.progress);
            self.next += 1;
        }
    }

    /// Base parameters, verdict and status, as far as the bus has shown them.
    pub fn report(&mut self, now_s: f64, prefix: &str, bus: &BusStatus<'_>) {
        self.picture.time_s = now_s;
        self.report_parameters();
        self.report_verdict();
        let status = self.status(bus);
        let since_s = self.last.as_ref().map_or(0.0, |last| last.until_s);
        let has_state = self.nodes.iter().any(|node| node.time_s(STATUSWORD, 0).is_some());
        let lacks_positions = has_state && now_s - since_s > NO_POSITION_S;
        if lacks_positions && !self.lacks_positions && !bus.has_ended {
            let words = format!(
                "{prefix}no positions (6064) of all joints: no PDO carries them, none is sent without SYNC, or they \
                 were mapped before this page listened"
            );
            self.picture.note(Severity::Warning, words);
        }
        self.lacks_positions = lacks_positions;
        let shown = format!("{prefix}the leg {}; drive: {}", status.doing, status.drive);
        if shown != self.shown {
            self.picture.note(Severity::Note, shown.clone());
            self.shown = shown;
        }
        self.picture.send(LiveUpdate::Status(status));
    }

    /// Reports the parameters once a host has read them.
    fn report_parameters(&mut self) {
        let node = &self.nodes[0];
        let base = |index: usize| {
            let sub = u8::try_from(index + 1).ok()?;
            Some([node.real(BASE, sub)?, node.real(BASE_SIGMA, sub)?])
        };
        let Some(base) = (0..self.progress.rank()).map(base).collect::<Option<Vec<[f32; 2]>>>() else {
            return;
        };
        if base != self.base {
            let values: Vec<f32> = base.iter().map(|[value, _]| *value).collect();
            self.progress.use_result(&values, &[]);
            let reports = self.progress.reports(&base);
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
                leg: self.picture.leg_index(),
                verdict: if verdict == 1 { "accepted" } else { "refused" }.into(),
                validated: true,
                reasons: reasons.map(|reason| reason.name().into()).collect(),
                findings: Vec::new(),
            }));
        }
        self.verdict = verdict;
    }

    fn status(&self, bus: &BusStatus<'_>) -> LiveStatus {
        let joints = &self.picture.leg().joints;
        let named = |joint: usize, words: &str| format!("{}: {words}", joints[joint].name);
        let now_s = self.picture.time_s;
        let is_heard = |node: &Node| !bus.has_ended && node.heard_s().is_some_and(|at| now_s - at < SILENT_S);
        let state = |node: &Node| {
            let word = node.raw(STATUSWORD, 0).filter(|_| is_heard(node))?;
            JointState::from_statusword(word as u16)
        };
        let states: Vec<Option<JointState>> = self.nodes.iter().map(state).collect();
        let is_same = states.iter().all(|state| *state == states[0]);
        let name = |state: Option<JointState>| state.map_or("unknown", JointState::name);
        let drive = if is_same {
            name(states[0]).to_owned()
        } else {
            self.of_joints(|joint| named(joint, name(states[joint]))).join("; ")
        };
        let lowest = states.iter().flatten().min().copied().filter(|_| states.iter().all(Option::is_some));
        let is_enabled = lowest.is_some_and(JointState::is_enabled);
        let silent: Vec<String> =
            self.nodes.iter().filter(|node| !is_heard(node)).map(|node| node.id().to_string()).collect();
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
            Some(_) if is_enabled => (self.activity(), "commands of its host"),
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
        let limited = (0..self.nodes.len()).filter(|joint| {
            self.nodes[*joint].raw(STATUSWORD, 0).is_some_and(|word| word & INTERNAL_LIMIT != 0)
        });
        LiveStatus {
            leg: self.picture.leg_index(),
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

    /// What the enabled leg does, in words.
    fn activity(&self) -> String {
        let present = |sub| {
            let at_s = self.nodes[0].time_s(IDENTIFICATION, sub)?;
            self.nodes[0].raw(IDENTIFICATION, sub).filter(|_| self.picture.time_s - at_s < STALE_S)
        };
        let modes = self.of_joints(|joint| self.nodes[joint].signed(self.nodes[joint].newest(&MODE)?));
        doing(present(2), present(3), &modes)
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

#[cfg(test)]
mod tests {
    use core::cell::RefCell;

    use super::*;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    const BUS: BusStatus<'_> = BusStatus { load: "", heard: "1, 2", has_ended: false };

    /// Reports about a leg of nodes 1 and 2.
    struct Bench<'a> {
        leg: Leg<'a>,
        reports: &'a RefCell<Vec<LiveUpdate>>,
    }

    impl Bench<'_> {
        fn frame(&mut self, now_s: f64, id: u16, data: &[u8]) {
            self.leg.take(&Frame::new(id, data), now_s, "");
        }

        /// An SDO that reads a number.
        fn read(&mut self, now_s: f64, (index, sub): (u16, u8), value: u32) {
            let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
            self.frame(now_s, 0x601, &[0x40, low, high, sub, 0, 0, 0, 0]);
            self.frame(now_s, 0x581, &[0x43, low, high, sub, a, b, c, d]);
        }

        fn status(&mut self, now_s: f64, bus: &BusStatus<'_>) -> LiveStatus {
            self.leg.report(now_s, "", bus);
            let reports = self.reports.borrow();
            let found = reports.iter().rev().find_map(|report| match report {
                LiveUpdate::Status(status) => Some(status.clone()),
                _ => None,
            });
            found.expect("a status")
        }

        /// Lines of the timeline with this word.
        fn lines(&self, word: &str) -> usize {
            let reports = self.reports.borrow();
            let notes = reports.iter().filter(|report| match report {
                LiveUpdate::Note(note) => note.words.contains(word),
                _ => false,
            });
            notes.count()
        }
    }

    fn with_bench(test: impl FnOnce(&mut Bench<'_>)) {
        let file = LegFile::load(DEFAULT_LEG).expect("shipped");
        let reports = RefCell::new(Vec::new());
        let out = |report| reports.borrow_mut().push(report);
        let leg = Leg::new(&file, &[1, 2], 0, None, &out).expect("the default leg");
        test(&mut Bench { leg, reports: &reports });
    }

    #[test]
    fn a_silent_node_and_the_end_of_the_source_leave_the_state_unknown() {
        with_bench(|bench| {
            bench.frame(1.0, 0x181, &[0x37, 2]);
            let status = bench.status(1.1, &BUS);
            assert_eq!(status.doing, "is unknown: no frame of node 2 (heard: 1, 2)");
            bench.frame(1.2, 0x182, &[0x37, 2]);
            assert_eq!(bench.status(1.3, &BUS).drive, "operation enabled");
            let ended = BusStatus { has_ended: true, ..BUS };
            assert_eq!(bench.status(1.3, &ended).doing, "is unknown: the source has ended");
            let silent = bench.status(2.3, &BUS);
            assert_eq!((silent.drive.as_str(), silent.fault), ("unknown", None));
        });
    }

    #[test]
    fn the_newest_mode_and_the_newest_inputs_count() {
        with_bench(|bench| {
            [0x181, 0x182].into_iter().for_each(|id| bench.frame(1.0, id, &[0x37, 2]));
            bench.read(1.0, (0x6061, 0), 1);
            assert_eq!(bench.status(1.0, &BUS).doing, "follows its host: profile position");
            bench.read(1.1, (0x6060, 0), 8);
            assert_eq!(bench.status(1.1, &BUS).doing, "follows its host: cyclic position");
            bench.frame(1.2, 0x181, &[0x50, 2]);
            bench.read(1.2, (0x219A, 0), 1 << 16);
            bench.frame(1.3, 0x481, &[0, 0, 5, 0]);
            assert_eq!(bench.status(1.3, &BUS).not_enabled, "hip: the joints' zeros are unknown");
        });
    }

    #[test]
    fn the_fault_is_the_newest_one_and_a_started_node_may_report_it_again() {
        with_bench(|bench| {
            let overspeed = [0, 0x84, 0x81, 1, 0, 0, 0, 0];
            bench.frame(1.0, 0x81, &[0x30, 0x81, 0x11, 1, 0, 0, 0, 0]);
            bench.frame(1.1, 0x81, &overspeed);
            // The other node of the leg sends the same.
            bench.frame(1.1, 0x82, &overspeed);
            [0x181, 0x182].into_iter().for_each(|id| bench.frame(1.2, id, &[0x18, 2]));
            let status = bench.status(1.2, &BUS);
            assert_eq!(status.fault.as_deref(), Some("it was faster than 1.1 times its speed limit"));
            assert_eq!(bench.lines("8400"), 1);
            [0x701, 0x702].into_iter().for_each(|id| bench.frame(5.0, id, &[0]));
            bench.frame(6.0, 0x81, &overspeed);
            assert_eq!(bench.lines("8400"), 2);
        });
    }

    #[test]
    fn verdict_reasons_and_parameters_are_shown_as_a_host_reads_them() {
        with_bench(|bench| {
            bench.read(1.0, (0x2100, 8), 2);
            bench.status(1.0, &BUS);
            bench.read(2.0, (0x2100, 9), 1 << 2);
            for base in 1..=13 {
                bench.read(2.0, (0x2120, base), 2.5_f32.to_bits());
                bench.read(2.0, (0x2121, base), 0.5_f32.to_bits());
            }
            bench.status(2.0, &BUS);
            let reports = bench.reports.borrow();
            let outcomes = reports.iter().filter_map(|report| match report {
                LiveUpdate::Outcome(outcome) => Some((outcome.verdict.clone(), outcome.reasons.clone())),
                _ => None,
            });
            let refused = |reasons: &[&str]| {
                ("refused".to_owned(), reasons.iter().map(|reason| (*reason).to_owned()).collect::<Vec<_>>())
            };
            assert_eq!(outcomes.collect::<Vec<_>>(), [refused(&[]), refused(&["residual"])]);
            let estimate = reports.iter().find_map(|report| match report {
                LiveUpdate::Estimate(estimate) => Some(estimate),
                _ => None,
            });
            let values = &estimate.expect("an estimate").values;
            // The true parameters of a real leg are unknown.
            let is_read = |value: &crate::live::report::LiveParameter| {
                (value.value.known(), value.sigma.known(), value.truth.known())
                    == (Some(2.5), Some(0.5), None)
            };
            assert!(values.len() == 13 && values.iter().all(is_read), "{values:?}");
        });
    }

    #[test]
    fn torques_that_come_slower_than_positions_do_not_hold_these_back() {
        with_bench(|bench| {
            for cycle in 0..200_u8 {
                let now_s = f64::from(cycle) * 0.01;
                for node in [1_u16, 2] {
                    bench.frame(now_s + 1e-4 * f64::from(node), 0x280 + node, &[cycle, 0, 0, 0, 0, 0, 0, 0]);
                    if cycle % 20 == 0 {
                        bench.frame(now_s + 1e-3, 0x380 + node, &[10, 0]);
                    }
                }
            }
            let reports = bench.reports.borrow();
            let samples = reports.iter().filter(|report| matches!(report, LiveUpdate::Sample(_))).count();
            assert!((90..=100).contains(&samples), "{samples} samples in 2 s");
        });
    }
}
