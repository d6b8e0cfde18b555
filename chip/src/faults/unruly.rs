//! B7: hosts without manners, the random sessions of the host's campaign (`scarab_host::faults::random_hosts`)
//! on a leg that its operator has enabled.

use std::collections::VecDeque;

use scarab::bus::Frame;
use scarab::hal::{Contacts, SERVO_RATE_HZ};
use scarab_host::base::error::ToolError;
use scarab_host::base::random::Random;
use scarab_host::faults::random_hosts::{Bounds, HostedLeg, SETTLED, Seen, Session as Hosts, judge};

use crate::faults::{Machines, Verdict, begin};
use crate::machine::Snapshot;
use crate::plant::JOINTS;
use crate::rtt::field;
use crate::session::Session;
use crate::time::ticks;

/// Longest delay of a session's first frame, s.
const DELAY_S: f64 = 10e-3;
/// Servo ticks until the nodes have started.
const START: u32 = 40;
/// Runs that reducing a session may take: some 20 s each.
const MOST_RUNS: u32 = 60;

/// The image's leg. Torque and angle are the plant's, the state is that of the image's records.
struct ChipLeg<'a> {
    session: &'a mut Session,
    range: [[f64; 2]; JOINTS],
    /// Ticks that wait for the records of theirs, which are read up to some ticks later.
    waiting: VecDeque<Seen>,
    /// Records that have been read.
    records: usize,
    state: Seen,
    /// Code of the last record of a fault.
    code: Option<u16>,
}

impl<'a> ChipLeg<'a> {
    fn new(session: &'a mut Session, saved: &Snapshot, delay: f64) -> Result<Self, ToolError> {
        begin(session, saved, ticks(delay))?;
        let state = Seen {
            is_enabled: true,
            fault: None,
            torque: [0.0; JOINTS],
            position: [0.0; JOINTS],
            speed: [0.0; JOINTS],
            returns: [false; JOINTS],
            moves_itself: false,
        };
        let range = core::array::from_fn(|joint| session.leg.joints[joint].range_deg.map(f64::to_radians));
        let records = session.probe.lines.len();
        let mut leg = Self { session, range, waiting: VecDeque::new(), records, state, code: None };
        leg.send(Frame::new(0, &[1, 0]));
        for _ in 0..START {
            leg.tick(&mut |_| {}).map_err(ToolError::Refused)?;
        }
        Ok(leg)
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
                    self.code = self.code.filter(|_| failed || self.state.fault.is_none());
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
    /// The current loop's overshoot and the motor's cogging.
    const OVERSHOOT: f64 = 1.1;

    fn send(&mut self, frame: Frame) {
        self.session.machine.chip_mut().send_frame(frame);
    }

    fn hold(&mut self, contacts: Contacts) {
        self.session.hold(contacts);
    }

    fn plug(&mut self, plugged: bool) {
        self.session.machine.chip_mut().can.connected = plugged;
    }

    fn tick(&mut self, heard: &mut dyn FnMut(&Frame)) -> Result<Option<Seen>, String> {
        self.session.machine.chip_mut().can.sent.clear();
        self.session.run(1.0 / f64::from(SERVO_RATE_HZ)).map_err(|error| error.to_string())?;
        self.session.machine.chip().can.sent.iter().for_each(|(_, frame)| heard(frame));
        self.read_records();
        let plant = &self.session.machine.chip().plant;
        let position = plant.position();
        let returns = core::array::from_fn(|joint| {
            let [low, high] = self.range[joint];
            position[joint] < low || position[joint] > high
        });
        self.waiting.push_back(Seen { torque: plant.torque(), position, returns, ..self.state });
        if self.waiting.len() <= SETTLED as usize {
            return Ok(None);
        }
        let is_enabled = self.waiting.iter().all(|seen| seen.is_enabled);
        let moves_itself = self.waiting.iter().any(|seen| seen.moves_itself);
        let oldest = self.waiting.pop_front();
        Ok(oldest.map(|seen| Seen { is_enabled, moves_itself, fault: self.state.fault, ..seen }))
    }
}

/// The image does not restart, the model has no new findings, and all that holds for the simulated leg holds.
pub fn played(machines: &mut Machines<'_>, seed: u64) -> Result<Verdict, ToolError> {
    let resting = machines.resting()?;
    let bounds = Bounds::of(&machines.session.leg)?;
    let mut random = Random::new("B7 of the chip", seed);
    let delay = random.uniform(0.0, DELAY_S);
    let mut hosts = Hosts::draw(&mut random);
    hosts.by_hand = true;
    let session = &mut *machines.session;
    let mut judged = |hosts: &Hosts| -> Result<Result<(), String>, ToolError> {
        let before = (session.resets.len(), crate::report::findings(session).0.len());
        let found = judge(ChipLeg::new(session, &resting, delay)?, bounds, hosts);
        if let Some(reason) = session.resets.get(before.0) {
            return Ok(Err(format!("the image restarted: {reason:?}")));
        }
        let findings = crate::report::findings(session).0;
        Ok(findings.get(before.1).map_or(found, |finding| Err(format!("{finding:?}"))))
    };
    let Err(first) = judged(&hosts)? else { return Ok(Ok(0.0)) };
    let reduced = hosts.reduced(MOST_RUNS, |hosts| matches!(judged(hosts), Ok(Err(_))));
    let why = judged(&reduced)?.err().unwrap_or(first);
    Ok(Err(format!("{why}; {reduced:?}")))
}
