//! B7: random host sessions, those of the host's campaign (`scarab_rig::faults::random_hosts`)
//! on a leg that its operator has enabled.

use std::collections::VecDeque;

use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_rig::faults::random_hosts::{
    HostSession, HostedLeg, JointBounds, LegState, check_session, is_like,
};

use crate::faults::{Machines, Verdict, begin};
use crate::machine::Snapshot;
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;
use crate::time::ticks;

/// Longest delay of a session's first frame, s.
const DELAY_S: f64 = 10e-3;
/// Distance from the end of its range within which the safety monitor bounds a joint's torque, rad.
const BOUNDED_RAD: f64 = 0.2;
/// Longest delay of a record, ticks.
const DELAY: u32 = 8;
/// Runs that reducing a session may take: some 8 s each.
const MOST_RUNS: u32 = 40;

/// The image's leg. Torque and angle are the plant's, the state is that of the image's records.
struct ChipLeg<'a> {
    session: &'a mut Session,
    range: [[f64; 2]; JOINTS],
    /// Ticks that wait for the records of theirs, which are read up to some ticks later.
    waiting: VecDeque<LegState>,
    /// Records that have been read.
    records: usize,
    state: LegState,
    /// Code of the last record of a fault.
    code: Option<u16>,
}

impl<'a> ChipLeg<'a> {
    fn new(session: &'a mut Session, saved: &Snapshot, delay: f64) -> Result<Self, ToolError> {
        begin(session, saved, ticks(delay))?;
        let range = core::array::from_fn(|joint| session.leg.joints[joint].range_deg.map(f64::to_radians));
        let records = session.probe.lines.len();
        Ok(Self { session, range, waiting: VecDeque::new(), records, state: LegState::AT_REST, code: None })
    }

    fn read_records(&mut self) {
        for (_, line) in &self.session.probe.lines[self.records..] {
            match line.split(' ').next() {
                Some("fault") => {
                    let code = field(line, "code").and_then(|code| code.strip_prefix("0x"));
                    self.code = code.and_then(|code| u16::from_str_radix(code, 16).ok());
                }
                Some("state") => {
                    let drive = field(line, "drive");
                    self.state.is_enabled = drive == Some("operation_enabled");
                    let failed = matches!(drive, Some("fault" | "fault_reaction_active"));
                    if !failed && self.state.fault.is_some() {
                        self.code = None;
                    }
                    self.state.fault = self.code.filter(|_| failed);
                    self.state.moves_itself = !matches!(field(line, "activity"), Some("idle" | "follow"));
                }
                _ => {}
            }
        }
        self.records = self.session.probe.lines.len();
    }
}

impl HostedLeg for ChipLeg<'_> {
    const DELAY: u32 = DELAY;
    /// The current loop's overshoot and the motor's cogging.
    const OVERSHOOT: f64 = 1.1;

    fn send(&mut self, frame: Frame) {
        let chip = self.session.chip_mut();
        if chip.can.connected {
            chip.send_frame(frame);
        }
    }

    fn hold(&mut self, contacts: Contacts) {
        self.session.hold(contacts);
    }

    fn plug(&mut self, plugged: bool) {
        let can = &mut self.session.chip_mut().can;
        can.connected = plugged;
        if !plugged {
            can.partner.clear();
        }
    }

    fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<LegState>, String> {
        self.session.forget_frames();
        self.session.run(1.0 / f64::from(SERVO_RATE_HZ)).map_err(|error| error.to_string())?;
        self.session.chip().can.sent.iter().for_each(|(_, frame)| heard(frame));
        self.read_records();
        let plant = &self.session.chip().plant;
        let position = plant.position();
        let is_near_end = |margin: f64| {
            core::array::from_fn(|joint| {
                let [low, high] = self.range[joint];
                position[joint] < low + margin || position[joint] > high - margin
            })
        };
        let (returns, bounded) = (is_near_end(0.0), is_near_end(BOUNDED_RAD));
        self.waiting.push_back(LegState {
            torque: plant.torque(),
            position,
            speed: None,
            returns,
            bounded,
            ..self.state
        });
        if self.waiting.len() <= DELAY as usize {
            return Ok(None);
        }
        let is_enabled = self.waiting.iter().all(|seen| seen.is_enabled);
        let moves_itself = self.waiting.iter().any(|seen| seen.moves_itself);
        let oldest = self.waiting.pop_front();
        Ok(oldest.map(|seen| LegState { is_enabled, moves_itself, fault: self.state.fault, ..seen }))
    }
}

/// The image does not restart, the model has no new findings, and all that holds for the simulated leg holds.
pub fn played(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let resting = machines.resting()?;
    let bounds = JointBounds::from_leg(&machines.session.leg)?;
    let mut random = Random::new("B7 of the chip", seed);
    let delay = random.uniform(0.0, DELAY_S);
    let mut hosts = HostSession::draw(&mut random);
    hosts.by_hand = true;
    let session = &mut *machines.session;
    let mut judged = |hosts: &HostSession| -> Result<Result<(), String>, ToolError> {
        let resets = session.resets.len();
        let found = check_session(ChipLeg::new(session, &resting, delay)?, bounds, hosts);
        if let Some(reason) = session.resets.get(resets) {
            return Ok(Err(format!("restart: {reason:?}")));
        }
        let findings = crate::report::findings(session).0;
        Ok(findings.first().map_or(found, |finding| Err(format!("finding: {finding:?}"))))
    };
    let Err(first) = judged(&hosts)? else { return Ok(Ok(0.0)) };
    let reduced = hosts.reduced(MOST_RUNS, |hosts| {
        judged(hosts).is_ok_and(|found| found.is_err_and(|why| is_like(&why, &first)))
    });
    let why = judged(&reduced)?.err().unwrap_or(first);
    Ok(Err(format!("{why}; {reduced:?}")))
}
