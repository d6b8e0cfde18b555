//! Every fault of the one list on the bus: current loops, servo and bus level of a leg with a host.

use super::super::super::testing::{NOTHING, RAMPS, VOLT_PER_CODE, device, ends, on_a_bus};
use super::super::super::{BusEnds, BusRound, Handover, ServoLevel, StoreJob};
use super::*;
use crate::bus::device::Device;
use crate::hal::{Contacts, Frame, JointSample};
use crate::leg::testing::{LEG, configuration};
use crate::leg::{Control, Fault, FaultCode, Following};

const AXIS_FAULTS: [AxisFault; 10] = [
    AxisFault::CurrentSense,
    AxisFault::Overcurrent,
    AxisFault::BusVoltage,
    AxisFault::Encoder,
    AxisFault::NotANumber,
    AxisFault::EncoderFrozen,
    AxisFault::OpenPhase,
    AxisFault::CurrentOffset,
    AxisFault::StuckConversion,
    AxisFault::Parameters,
];

/// Level that reports a fault.
#[derive(Clone, Copy, Debug)]
enum Origin {
    /// Axis of joint 2; with `lost`, its rotor position is lost.
    Axis {
        fault: AxisFault,
        lost: bool,
    },
    Reason(InhibitReason),
    /// Check of the board, for joint 2.
    Board(BoardFault),
    /// Servo, monitor or bus, for joint 2.
    Leg,
}

fn origins(code: FaultCode) -> Vec<Origin> {
    let axis = AXIS_FAULTS.into_iter().filter(|fault| axis_code(*fault) == code);
    let mut found: Vec<Origin> =
        axis.flat_map(|fault| [false, true].map(|lost| Origin::Axis { fault, lost })).collect();
    let of_axis = [InhibitReason::EncoderFrozen, InhibitReason::EncoderPosition];
    let reasons = InhibitReason::ALL.into_iter().filter(|reason| reason.code() == Some(code));
    found.extend(reasons.filter(|reason| !of_axis.contains(reason)).map(Origin::Reason));
    found.extend(BoardFault::ALL.into_iter().filter(|fault| fault.code() == code).map(Origin::Board));
    if found.is_empty() || matches!(code, FaultCode::Parameters | FaultCode::NotFinite) {
        found.push(Origin::Leg);
    }
    found
}

struct Bus {
    control: Control<2>,
    level: ServoLevel<2>,
    device: Device<2, 4>,
    round: BusRound,
    hardware: TestHardware<2>,
    signals: Signals<2>,
    ends: Ends<'static, 2>,
    bus: BusEnds<'static, 2>,
    storage: Handover<StoreJob<2>>,
}

impl Bus {
    /// Two nodes, operational, of a leg whose joints have no zeros yet.
    fn resting() -> Self {
        let (mut hardware, host, bus) = on_a_bus();
        let configuration = configuration();
        let control = Control::new(&configuration).expect("a leg");
        let level = ServoLevel::new(&control, RAMPS, VOLT_PER_CODE, Some(Following::new(&configuration)));
        let mut ends = ends();
        ends.servo.host = Some(host);
        hardware.contacts = Contacts { enabling: true, start: false };
        let signals = Signals::new();
        signals.set_permits(true);
        signals.set_bridge_c(0, 30.0);
        signals.statistics.see_bus((48.0 / VOLT_PER_CODE.0) as u16);
        let (device, storage) = (device(), Handover::new(StoreJob::NOTHING));
        let mut bench =
            Self { control, level, device, round: BusRound::new(), hardware, signals, ends, bus, storage };
        bench.run(4);
        bench.send(0, &[1, 0]);
        bench
    }

    /// A host has enabled the leg.
    fn enabled() -> Self {
        let mut bench = Self::resting();
        bench.signals.begin_servo();
        bench.run(4);
        [6, 7, 15].into_iter().for_each(|word| bench.word(word));
        assert_eq!(bench.states(), [0x27; 2]);
        bench
    }

    /// Runs two ticks of the servo and a round of the bus.
    fn run(&mut self, rounds: u32) {
        for _ in 0..rounds {
            for _ in 0..2 {
                for samples in &mut self.ends.current.samples {
                    let sample = JointSample { encoder_counts: 30_000, ..JointSample::default() };
                    assert!(samples.enqueue(sample).is_ok(), "full");
                }
                let Self { level, control, ends, signals, hardware, .. } = self;
                level.tick(control, LEG.gravity, &mut ends.servo, signals, hardware);
                while ends.housekeeping.drive.dequeue().is_some() {}
                while ends.identification.events.dequeue().is_some() {}
            }
            self.hardware.now_us += 500;
            let Self { device, bus, storage, signals, hardware, .. } = self;
            self.round.round(device, bus, storage, signals, hardware, &NOTHING);
            self.hardware.empty_mailboxes();
        }
    }

    fn send(&mut self, id: u16, data: &[u8]) {
        self.hardware.reception().arriving.push_back(Frame::new(id, data));
        self.run(8);
    }

    fn word(&mut self, word: u8) {
        [0x601, 0x602].into_iter().for_each(|id| self.send(id, &[0x2B, 0x40, 0x60, 0, word, 0, 0, 0]));
    }

    /// Value of an object at both nodes.
    fn read(&mut self, index: u16, sub: u8) -> [u32; 2] {
        let [low, high] = index.to_le_bytes();
        [1, 2].map(|node| {
            let before = self.hardware.can.sent.len();
            self.send(0x600 + node, &[0x40, low, high, sub, 0, 0, 0, 0]);
            let sent = &self.hardware.can.sent[before..];
            let answer = sent.iter().find(|(frame, _, _)| frame.id() == 0x580 + node).expect("an answer").0;
            let data = answer.data();
            // An abort has no value.
            if data[0] == 0x80 { u32::MAX } else { u32::from_le_bytes([data[4], data[5], data[6], data[7]]) }
        })
    }

    /// State bits of both statuswords.
    fn states(&mut self) -> [u32; 2] {
        self.read(0x6041, 0).map(|word| word & 0x6F)
    }

    /// Emergency messages of both nodes since the last call.
    fn emergencies(&mut self) -> [Vec<[u8; 4]>; 2] {
        let sent = core::mem::take(&mut self.hardware.can.sent);
        [0x81, 0x82].map(|id| {
            let of_node = sent.iter().filter(|(frame, _, _)| frame.id() == id);
            of_node.map(|(frame, _, _)| core::array::from_fn(|byte| frame.data()[byte])).collect()
        })
    }

    fn inject(&mut self, code: FaultCode, origin: Origin) {
        let Self { ends, signals, hardware, control, .. } = self;
        match origin {
            Origin::Axis { fault, lost } => {
                let outcome = Outcome::Fault { fault, lost };
                react(1, &outcome, true, AxisCommand::OFF, signals, hardware);
                report(1, outcome, &mut None, &mut ends.current, signals);
            }
            Origin::Reason(reason) => signals.inhibit.raise(reason),
            Origin::Board(fault) => signals.report(fault, 1),
            Origin::Leg => control.report(Fault { code, joint: 1 }),
        }
    }
}

/// What both nodes report of a fault, and how it ends.
fn reports(mut bench: Bus, code: FaultCode, origin: Origin, case: &str) {
    let number = code.number();
    let joint = if matches!(origin, Origin::Reason(_)) { 1 } else { 2 };
    bench.emergencies();
    bench.inject(code, origin);
    bench.run(4);
    for state in bench.states() {
        assert!(matches!(state, 0x0F | 0x08), "{case}: state {state:02X}");
    }
    assert_eq!(bench.read(0x603F, 0), [u32::from(number); 2], "{case}: 603F");
    let [register, other] = bench.read(0x1001, 0);
    assert!(register & 1 == 1 && other == register, "{case}: 1001 {register:02X} {other:02X}");
    let newest = u32::from(number) | joint << 16;
    assert_eq!((bench.read(0x1003, 0), bench.read(0x1003, 1)), ([1; 2], [newest; 2]), "{case}: 1003");
    // Longer than every reaction.
    bench.run(700);
    let [low, high] = number.to_le_bytes();
    let begin = [low, high, register as u8, joint as u8];
    assert_eq!(bench.emergencies(), [(); 2].map(|()| Vec::from([begin])), "{case}: emergency");
    assert_eq!(bench.states(), [0x08; 2], "{case}: latched");
    // A fault stays while its reason does; then a host resets it, also at rest.
    bench.word(0x80);
    bench.word(0);
    let stays = !bench.signals.inhibit.is_clear();
    assert_eq!(bench.states() == [0x08; 2], stays, "{case}: reset");
    bench.signals.inhibit.reset();
    if !bench.signals.inhibit.is_clear() {
        return;
    }
    bench.word(0x80);
    bench.word(0);
    let is_begun = bench.signals.has_begun();
    assert_eq!(bench.states(), [if is_begun { 0x40 } else { 0 }; 2], "{case}: after the reset");
    assert_eq!(bench.read(0x1001, 0), [0; 2], "{case}: 1001 after the reset");
    let end = [0, 0, 0, 0];
    assert_eq!(bench.emergencies(), [(); 2].map(|()| Vec::from([end])), "{case}: end");
    // No zero of the joints comes back with the reset, and the fault does not.
    bench.signals.begin_servo();
    bench.run(4);
    [6, 7, 15].into_iter().for_each(|word| bench.word(word));
    assert_eq!(bench.states(), [0x27; 2], "{case}: enabled again");
}

#[test]
fn every_fault_of_the_list_reaches_both_nodes_and_ends_by_a_reset() {
    for code in FaultCode::ALL {
        for origin in origins(code) {
            reports(Bus::enabled(), code, origin, &format!("{code:?} by {origin:?}, enabled"));
            reports(Bus::resting(), code, origin, &format!("{code:?} by {origin:?}, resting"));
        }
    }
}

#[test]
fn a_fault_stays_when_the_joints_lose_their_zeros_and_get_new_ones() {
    let mut bench = Bus::enabled();
    bench.inject(FaultCode::PositionLimit, Origin::Leg);
    bench.run(700);
    bench.signals.end_servo();
    bench.run(4);
    assert_eq!(bench.states(), [0x08; 2]);
    bench.signals.begin_servo();
    bench.run(4);
    assert_eq!((bench.states(), bench.read(0x603F, 0)), ([0x08; 2], [0x8500; 2]));
}
