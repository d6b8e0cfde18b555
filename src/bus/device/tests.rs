use super::super::tests::{IDENTITY, codes, constants, value};
use super::*;
use crate::bus::identification::ResultsCopy;
use crate::leg::Target;

mod lss;
mod program;
mod storage;

/// No identification result.
const NOTHING: ResultsCopy<2, 1> = ResultsCopy::nothing();

/// A leg that follows its orders, and a host on the bus.
struct Bench {
    device: Device<2, 4>,
    drive: DriveState,
    held: bool,
    blocked: bool,
    rests: bool,
    causes: u32,
    calibrated: bool,
    /// Refusal of the leg when it is to be enabled.
    refuses: Option<Refusal>,
    refused: Option<Refusal>,
    velocity: f32,
    now_us: u64,
    orders: Vec<LegOrder<2>>,
    /// A host that does not have the drive has stopped it.
    stopped: bool,
}

impl Bench {
    fn new() -> Self {
        Self::with(IDENTITY)
    }

    fn with(identity: Identity) -> Self {
        let own = [1, 2].map(|number| NodeId::new(number).expect("a number"));
        let device = Device::new(own, identity, [constants(); 2], Plan::OneTime, 1).with_emergency_inhibit(0);
        let mut bench = Self {
            device,
            drive: DriveState::SwitchOnDisabled,
            held: true,
            blocked: false,
            rests: false,
            causes: 0,
            calibrated: false,
            refuses: None,
            refused: None,
            velocity: 0.0,
            now_us: 0,
            orders: Vec::new(),
            stopped: false,
        };
        assert_eq!(bench.run(4).len(), 2);
        bench
    }

    /// Runs ticks of the leg. Returns the nodes' frames; each node also receives those of the other.
    fn run(&mut self, ticks: u32) -> Vec<Frame> {
        let mut frames = Vec::new();
        for _ in 0..ticks {
            self.tick();
            for joint in 0..2 {
                while let Some(frame) = self.device.poll(joint, self.now_us, &NOTHING) {
                    self.device.receive(&frame, self.now_us, Some(joint), &NOTHING);
                    frames.push(frame);
                }
            }
        }
        frames
    }

    /// Runs one tick of the leg, in which nothing is sent.
    fn tick(&mut self) {
        self.now_us += 250;
        self.drive = self.drive.after(crate::leg::DriveEvent::Tick, 4);
        let drive = if self.rests { DriveState::NotReadyToSwitchOn } else { self.drive };
        let velocity = crate::units::RadianPerSecond(self.velocity);
        let joint = JointStatus { drive, velocity, ..JointStatus::NONE };
        let (held, blocked) = (self.held, self.blocked);
        self.device.update(&LegStatus {
            joints: [joint; 2],
            held,
            blocked,
            rests: self.rests,
            causes: self.causes,
            calibrated: self.calibrated,
            refused: self.refused.take(),
            ..LegStatus::NONE
        });
        self.stopped |= self.device.is_stopped();
        let order = self.device.order();
        if order.request == Some(LegRequest::Power(PowerRequest::EnableOperation)) {
            self.refused = self.refuses;
        }
        if let Some(LegRequest::Power(power)) = order.request.filter(|_| self.refused.is_none()) {
            self.drive = self.drive.after(crate::leg::DriveEvent::Requested(power), 4);
        }
        self.orders.push(order);
    }

    fn receive(&mut self, id: u16, data: &[u8]) {
        self.device.receive(&Frame::new(id, data), self.now_us, None, &NOTHING);
    }

    fn send(&mut self, id: u16, data: &[u8]) -> Vec<Frame> {
        self.receive(id, data);
        self.run(8)
    }

    /// Sends an SDO request and returns its answer.
    fn ask(&mut self, node: u16, request: [u8; 8]) -> [u8; 8] {
        let frames = self.send(0x600 + node, &request);
        let answer = frames.iter().find(|frame| frame.id() == 0x580 + node);
        answer.and_then(Frame::full).expect("an answer")
    }

    fn write(&mut self, node: u16, index: u16, sub: u8, value: u32, size: u8) {
        let ([low, high], [a, b, c, d]) = (index.to_le_bytes(), value.to_le_bytes());
        let answer = self.ask(node, [0x23 | (4 - size) << 2, low, high, sub, a, b, c, d]);
        assert_eq!(answer[0], 0x60, "{index:x}");
    }

    fn read(&mut self, node: u16, index: u16) -> u32 {
        let [low, high] = index.to_le_bytes();
        value(self.ask(node, [0x40, low, high, 0, 0, 0, 0, 0])).expect("a value")
    }

    /// Performs the pending store request and reports its outcome.
    fn store(&mut self, done: bool) -> Option<(StoreCommand, [StoredNode; 2])> {
        let mut objects = [StoredNode::from_bytes(&[0x55; 9]); 2];
        let what = self.device.take_store(&mut objects)?;
        self.device.stored(done, &objects);
        Some((what, objects))
    }

    fn save(&mut self, node: u16) {
        self.write(node, 0x1010, 1, u32::from_le_bytes(*b"save"), 4);
    }

    fn load(&mut self, node: u16) {
        self.write(node, 0x1011, 1, u32::from_le_bytes(*b"load"), 4);
    }

    fn enable(&mut self) {
        for word in [6, 7, 15] {
            self.write(1, 0x6040, 0, word, 2);
            self.write(2, 0x6040, 0, word, 2);
        }
    }

    /// Sends a controlword to both nodes; returns their emergency messages.
    fn word(&mut self, word: u8) -> Vec<Frame> {
        let mut sent = self.send(0x201, &[word, 0]);
        sent.extend(self.send(0x202, &[word, 0]));
        emergencies(sent)
    }

    /// Requests each step in every cycle, as an insistent host does. Returns the nodes' emergency messages.
    fn insist(&mut self, cycles: usize) -> Vec<Frame> {
        let words = [6, 7, 15].into_iter().cycle().take(3 * cycles);
        words.flat_map(|word| self.word(word)).collect()
    }
}

/// Both nodes' emergency messages among these frames.
fn emergencies(mut frames: Vec<Frame>) -> Vec<Frame> {
    frames.retain(|frame| frame.id() & !3 == 0x80);
    frames
}

#[test]
fn the_operator_controls_the_leg_until_a_host_sends_a_controlword() {
    let mut bench = Bench::new();
    bench.drive = DriveState::OperationEnabled;
    bench.orders.clear();
    // NMT start, configuration, reads and PDOs with a controlword of 0 leave control with the operator.
    bench.send(0, &[1, 0]);
    bench.write(1, 0x6060, 0, 8, 1);
    bench.send(0x201, &[0, 0]);
    assert_eq!(bench.read(2, 0x6041) & 0x6F, 0x27);
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::OperationEnabled, false));
    assert!(bench.orders.iter().all(|order| order.request.is_none() && order.commands.is_none()));
    // An NMT stop does not affect the operator's leg either.
    bench.send(0, &[2, 0]);
    assert_eq!(bench.drive, DriveState::OperationEnabled);
    bench.send(0, &[1, 0]);
    bench.write(1, 0x6040, 0, 6, 2);
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::ReadyToSwitchOn, true));
    assert!(bench.orders.last().is_some_and(|order| order.commands.is_some()));
}

#[test]
fn a_host_that_disables_the_operators_leg_stops_it_and_does_not_take_it() {
    use DriveState::{OperationEnabled, ReadyToSwitchOn, SwitchOnDisabled, SwitchedOn};
    for drive in [SwitchOnDisabled, ReadyToSwitchOn, SwitchedOn, OperationEnabled] {
        for (index, sub, value, bytes) in [(0x6040, 0, 0, 2), (0x2100, 1, 2, 1)] {
            let mut bench = Bench::new();
            bench.drive = drive;
            bench.run(4);
            assert!(!bench.stopped);
            bench.write(1, index, sub, value, bytes);
            // The operator hears of it in each state.
            assert!(bench.stopped, "{drive:?}");
            assert!(!bench.device.is_hosted());
            if index == 0x6040 {
                assert_eq!((bench.drive, bench.read(2, 0x6041) & 0x6F), (SwitchOnDisabled, 0x40));
            }
        }
    }
}

#[test]
fn a_reset_of_all_nodes_on_the_way_up_steps_the_leg_down() {
    // Also where the leg has not followed the last word yet.
    for (words, last) in [(&[6][..], None), (&[6, 7], None), (&[6], Some(0xF)), (&[6, 7], Some(0xF))] {
        for option in 0..=3 {
            let mut bench = Bench::new();
            for (word, node) in words.iter().flat_map(|word| [(*word, 1), (*word, 2)]) {
                bench.write(node, 0x6007, 0, option, 2);
                bench.write(node, 0x6040, 0, word, 2);
            }
            assert!(bench.drive != DriveState::SwitchOnDisabled && bench.device.is_hosted());
            for node in last.iter().flat_map(|_| [1, 2]) {
                bench.receive(0x600 + node, &[0x2B, 0x40, 0x60, 0, 0xF, 0, 0, 0]);
            }
            bench.send(0, &[129, 0]);
            bench.run(8);
            let found = (bench.drive, bench.device.is_hosted());
            assert_eq!(found, (DriveState::SwitchOnDisabled, false), "{words:?} {last:?} {option}");
        }
    }
}

#[test]
fn a_host_does_not_start_an_identification_of_the_operators_leg() {
    let identifies = |order: &LegOrder<2>| matches!(order.request, Some(LegRequest::Identify { .. }));
    let mut bench = Bench::new();
    bench.drive = DriveState::OperationEnabled;
    bench.write(1, 0x2100, 1, 1, 1);
    assert!(!bench.device.is_hosted() && !bench.orders.iter().any(identifies));
    // Where the host controls the leg, this write starts one.
    let mut bench = Bench::new();
    bench.enable();
    bench.write(1, 0x2100, 1, 1, 1);
    assert!(bench.device.is_hosted() && bench.orders.iter().any(identifies));
}

#[test]
fn a_reset_of_all_nodes_stops_the_leg_and_ends_host_control() {
    let mut bench = Bench::new();
    bench.enable();
    assert_eq!(bench.drive, DriveState::OperationEnabled);
    bench.orders.clear();
    bench.send(0, &[129, 0]);
    let stop = Some(LegRequest::Power(PowerRequest::QuickStop));
    assert!(bench.orders.iter().any(|order| order.request == stop));
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::SwitchOnDisabled, false));
    // After a reset of one node only, the host still controls the leg.
    bench.enable();
    bench.send(0, &[129, 1]);
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::SwitchOnDisabled, true));
}

#[test]
fn a_host_that_a_reset_left_in_control_is_missed_without_a_controlword() {
    let mut bench = Bench::new();
    bench.enable();
    [1, 2].into_iter().for_each(|node| bench.write(node, 0x6007, 0, 0, 2));
    bench.send(0, &[129, 0]);
    bench.send(0, &[1, 0]);
    for _ in 0..50 {
        bench.send(0x401, &[0, 0, 0, 0]);
    }
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::OperationEnabled, true));
    bench.run(4000);
    assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
}

#[test]
fn targets_that_wait_for_a_sync_end_with_their_session() {
    for end in ["none", "lost", "disabled"] {
        let mut bench = Bench::new();
        bench.send(0, &[1, 0]);
        // The leg stays enabled without its host, and the node operational.
        for (index, sub, value, size) in
            [(0x6007, 0, 0, 2), (0x1029, 1, 1, 1), (0x1402, 2, 1, 1), (0x6060, 0, 3, 1)]
        {
            bench.write(1, index, sub, value, size);
        }
        bench.enable();
        if end == "lost" {
            bench.write(1, 0x1016, 1, 0x7F << 16 | 20, 4);
            bench.send(0x77F, &[5]);
        }
        bench.send(0x401, &[0, 0, 1, 0]);
        bench.run(100);
        if end == "disabled" {
            bench.write(2, 0x6040, 0, 0, 2);
            bench.enable();
        }
        bench.send(0x80, &[]);
        assert_eq!(bench.drive, DriveState::OperationEnabled, "{end}");
        let command = bench.device.axes[0].command();
        assert_eq!(command.target == Target::Hold, end != "none", "{end}");
        // What is sent afterwards acts at its SYNC.
        bench.send(0x401, &[0, 0, 1, 0]);
        bench.send(0x80, &[]);
        assert_ne!(bench.device.axes[0].command().target, Target::Hold, "{end}");
    }
}

#[test]
fn a_sync_of_void_values_still_restarts_their_event_timer() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    bench.write(1, 0x1402, 2, 1, 1);
    bench.write(1, 0x1402, 5, 20, 2);
    bench.enable();
    bench.send(0x401, &[0, 0, 1, 0]);
    bench.send(0x80, &[]);
    bench.send(0x401, &[0, 0, 1, 0]);
    bench.write(2, 0x6040, 0, 0, 2);
    assert_ne!(bench.drive, DriveState::OperationEnabled);
    // 12 ms, SYNC, 12 ms: more than the time since the first SYNC, less than since the second one.
    let is_late = |frames: &[Frame]| codes(frames).iter().any(|(_, code)| *code == 0x8250);
    let before = bench.run(48);
    bench.send(0x80, &[]);
    assert!(!is_late(&before) && !is_late(&bench.run(48)));
    assert!(is_late(&bench.run(48)));
}

#[test]
fn a_request_to_begin_ends_with_its_session_and_one_to_end_stays() {
    for (command, stays) in [(1, false), (4, false), (2, true), (5, true)] {
        let mut bench = Bench::new();
        bench.write(1, 0x6007, 0, 0, 2);
        bench.enable();
        bench.orders.clear();
        bench.receive(0x601, &[0x2F, 0x00, 0x21, 1, command, 0, 0, 0]);
        bench.send(0, &[130, 1]);
        assert_eq!(bench.orders.iter().any(|order| order.request.is_some()), stays, "{command}");
    }
}

#[test]
fn a_request_to_enable_ends_with_its_host() {
    for why in ["heartbeat", "reset"] {
        let mut bench = Bench::new();
        bench.send(0, &[1, 0]);
        bench.write(1, 0x6007, 0, 0, 2);
        bench.write(1, 0x1016, 1, 0x7F << 16 | 40, 4);
        bench.send(0x77F, &[5]);
        [6, 7, 0xF].into_iter().for_each(|word| bench.write(1, 0x6040, 0, word, 2));
        if why == "reset" {
            bench.send(0, &[129, 1]);
        } else {
            bench.run(200);
        }
        [6, 7, 0xF].into_iter().for_each(|word| bench.write(2, 0x6040, 0, word, 2));
        assert_ne!(bench.drive, DriveState::OperationEnabled, "{why}");
    }
}

#[test]
fn settings_of_the_next_identification_and_assistance_end_with_the_session() {
    use crate::leg::{AssistShares, Wearing};
    let settings = |bench: &Bench| (bench.device.leg.wearing, bench.device.leg.shares);
    let unset = (None, AssistShares::GRAVITY_ONLY);
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    bench.write(1, 0x2100, 13, 2, 1);
    bench.write(1, 0x2150, 3, 500, 2);
    bench.enable();
    let shares = settings(&bench).1;
    assert_ne!(shares, unset.1);
    // The leg is worn in this identification, and unknown in the next one.
    bench.write(1, 0x2100, 1, 1, 1);
    let worn = |order: &LegOrder<2>| matches!(order.request, Some(LegRequest::Identify { wearing, .. }) if wearing == Some(Wearing::Worn));
    assert!(bench.orders.iter().any(worn));
    assert_eq!(settings(&bench), (Some(Wearing::Worn), shares), "not begun");
    bench.device.leg.update(Activity::Identify(crate::leg::IdentifyPhase::Approach), [false; 2]);
    assert_eq!(settings(&bench), (None, shares));
    bench.run(1);
    for end in [[129, 0], [130, 1], [128, 2]] {
        bench.write(2, 0x2100, 13, 1, 1);
        bench.write(2, 0x2150, 3, 500, 2);
        bench.send(0, &end);
        assert_eq!(settings(&bench), unset, "{end:?}");
        bench.send(0, &[1, 0]);
    }
}

#[test]
fn a_host_whose_synchronous_pdos_wait_for_a_sync_is_lost() {
    let mut bench = Bench::new();
    bench.write(1, 0x1401, 2, 1, 1);
    // The other node watches nothing.
    bench.write(2, 0x2013, 0, 0, 1);
    bench.send(0, &[1, 0]);
    bench.enable();
    for _ in 0..50 {
        bench.send(0x301, &[0, 0, 0, 0]);
        bench.send(0x80, &[]);
    }
    assert_eq!(bench.drive, DriveState::OperationEnabled);
    // Its frames go on, but none of its values becomes valid.
    for _ in 0..100 {
        bench.send(0x301, &[0, 0, 0, 0]);
    }
    assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
}

#[test]
fn a_leg_that_is_taken_over_node_by_node_stays_enabled() {
    let mut bench = Bench::new();
    bench.drive = DriveState::OperationEnabled;
    bench.send(0, &[1, 0]);
    // The host's PDO to the other node still has its first content.
    for frames in [[0x202, 0x201], [0x201, 0x202]] {
        for _ in 0..3 {
            for id in frames {
                bench.send(id, &[if id == 0x201 { 0xF } else { 0 }, 0]);
            }
        }
    }
    assert_eq!((bench.drive, bench.device.is_hosted()), (DriveState::OperationEnabled, true));
    bench.send(0x202, &[0xF, 0]);
    bench.send(0x202, &[0, 0]);
    assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
}

#[test]
fn a_cancel_that_waits_for_the_leg_is_not_replaced() {
    let mut bench = Bench::new();
    bench.enable();
    for command in [0, 1, 3] {
        bench.orders.clear();
        for (node, command) in [(0x601, 2), (0x602, command)] {
            bench.receive(node, &[0x2F, 0x00, 0x21, 1, command, 0, 0, 0]);
            bench.device.poll(0, bench.now_us, &NOTHING);
        }
        bench.run(8);
        let requests: Vec<LegRequest> = bench.orders.iter().filter_map(|order| order.request).collect();
        assert_eq!(requests, [LegRequest::Cancel], "{command}");
        bench.enable();
    }
}

#[test]
fn an_open_switch_or_an_inhibit_reason_stops_every_step_up() {
    for (held, blocked) in [(false, false), (true, true), (false, true)] {
        let mut bench = Bench::new();
        (bench.held, bench.blocked) = (held, blocked);
        bench.orders.clear();
        bench.enable();
        assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
        assert!(bench.orders.iter().all(|order| order.request.is_none()));
        assert_eq!(bench.read(1, 0x6041) & 0x6F, 0x40, "the node follows the leg down");
        assert_eq!(bench.read(1, 0x60FD), u32::from(held) << 16 | u32::from(blocked) << 17);
        // A request made before the reason is gone does not take effect later.
        (bench.held, bench.blocked) = (true, false);
        bench.run(40);
        assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
        bench.enable();
        assert_eq!(bench.drive, DriveState::OperationEnabled);
    }
}

#[test]
fn a_target_received_after_the_tick_is_in_the_next_order() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    bench.write(1, 0x6060, 0, 8, 1);
    bench.enable();
    bench.receive(0x301, &500_000_i32.to_le_bytes());
    let commands = bench.device.order().commands.expect("a host has the drive");
    let Target::CyclicPosition { position, .. } = commands[0].target else {
        panic!("{:?}", commands[0].target)
    };
    assert!((position.0 - 0.5).abs() < 1e-6);
}

#[test]
fn a_reset_node_restarts_once_even_on_a_full_bus() {
    let mut bench = Bench::new();
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.save(1);
    assert!(bench.store(true).is_some());
    bench.write(1, 0x6065, 0, 1, 4);
    // Communication reset, then node reset; no mailbox is free for the boot-up message.
    for command in [130, 129, 129] {
        bench.receive(0, &[command, 0]);
    }
    assert_eq!(bench.device.pending_reset, [Some(Reset::Node); 2]);
    bench.device.watch(bench.now_us, &NOTHING);
    assert_eq!(bench.device.pending_reset, [None; 2]);
    for id in [0x080, 0x201, 0x601, 0x700] {
        bench.receive(id, &[0; 8]);
    }
    assert_eq!(bench.device.pending_reset, [None; 2], "no second restart");
    let boots = bench.run(4).iter().filter(|frame| frame.id() & 0x780 == 0x700).count();
    assert_eq!((boots, bench.read(1, 0x6065)), (2, 12_345));
}

#[test]
fn only_emergency_and_boot_up_messages_are_sent_once() {
    let bench = Bench::new();
    let once = |id: u16, data: &[u8]| bench.device.reports_once(&Frame::new(id, data));
    assert!([0x081, 0x082].into_iter().all(|id| once(id, &[0; 8])));
    assert!([0x701, 0x702].into_iter().all(|id| once(id, &[0])));
    // Heartbeats, process data, SDO answers, and another node's messages.
    assert!(![0x701, 0x702].into_iter().any(|id| once(id, &[5])));
    assert!(![0x181, 0x281, 0x581, 0x582, 0x083].into_iter().any(|id| once(id, &[0; 8])));
    assert!(!once(0x703, &[0]));
}

#[test]
fn storing_while_the_other_node_resets_stores_its_old_parameters() {
    let mut bench = Bench::new();
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.save(2);
    let before = bench.store(true);
    assert!(before.is_some());
    bench.receive(0, &[129, 1]);
    bench.receive(0x602, &[0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e']);
    assert_eq!(bench.store(true), before);
}

#[test]
fn nothing_is_sent_while_bus_off_and_only_new_frames_afterwards() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    bench.write(1, 0x1800, 2, 255, 1);
    bench.device.on_controller(Controller::Off, &NOTHING);
    for _ in 0..50 {
        bench.receive(0x080, &[]);
        assert_eq!(bench.run(4), []);
    }
    bench.drive = DriveState::ReadyToSwitchOn;
    bench.device.on_controller(Controller::Active, &NOTHING);
    let frames = bench.run(1);
    assert_eq!(codes(&frames), [(0x81, 0x8140), (0x81, 0), (0x82, 0x8140), (0x82, 0)]);
    // The present statusword is sent once.
    let words: Vec<&[u8]> = frames.iter().filter(|frame| frame.id() == 0x181).map(Frame::data).collect();
    assert_eq!(words.len(), 1, "{frames:?}");
    assert_eq!(words[0][0] & 0x6F, 0x21);
}

#[test]
fn a_request_waits_for_a_step_of_the_drive() {
    let mut bench = Bench::new();
    bench.enable();
    // In one tick: the drive steps down and the update is requested.
    let ask = |bench: &mut Bench, command: u8| {
        bench.orders.clear();
        for data in [[0x2F, 0x00, 0x21, 1, command, 0, 0, 0], [0x2B, 0x40, 0x60, 0, 7, 0, 0, 0]] {
            bench.receive(0x601, &data);
            bench.device.poll(0, bench.now_us, &NOTHING);
        }
        bench.run(8);
        bench.orders.iter().filter_map(|order| order.request).collect::<Vec<LegRequest>>()
    };
    for (command, asked) in [(3, LegRequest::TakeUpdate), (2, LegRequest::Cancel)] {
        bench.enable();
        assert_eq!(bench.drive, DriveState::OperationEnabled);
        let requests = ask(&mut bench, command);
        assert_eq!(requests, [LegRequest::Power(PowerRequest::DisableOperation), asked]);
    }
}

#[test]
fn an_identification_requested_on_the_way_up_is_discarded() {
    let mut bench = Bench::new();
    for word in [6, 7] {
        bench.write(1, 0x6040, 0, word, 2);
        bench.write(2, 0x6040, 0, word, 2);
    }
    bench.write(1, 0x6040, 0, 15, 2);
    bench.orders.clear();
    bench.receive(0x602, &[0x2B, 0x40, 0x60, 0, 15, 0, 0, 0]);
    bench.send(0x601, &[0x2F, 0x00, 0x21, 1, 1, 0, 0, 0]);
    assert_eq!(bench.drive, DriveState::OperationEnabled);
    let identifies = |order: &LegOrder<2>| matches!(order.request, Some(LegRequest::Identify { .. }));
    assert!(!bench.orders.iter().any(identifies));
    // A new request starts it.
    bench.send(0x601, &[0x2F, 0x00, 0x21, 1, 1, 0, 0, 0]);
    assert_eq!(bench.orders.iter().filter(|order| identifies(order)).count(), 1);
}

#[test]
fn lost_frames_act_like_a_lost_bus_only_under_host_control() {
    for (option, drive) in [
        (0, DriveState::OperationEnabled),
        (1, DriveState::OperationEnabled),
        (2, DriveState::SwitchOnDisabled),
        (3, DriveState::SwitchOnDisabled),
    ] {
        let mut bench = Bench::new();
        for node in [1, 2] {
            bench.write(node, 0x6007, 0, option, 2);
        }
        bench.enable();
        assert_eq!(bench.drive, DriveState::OperationEnabled);
        bench.orders.clear();
        bench.device.on_controller(Controller::Overrun, &NOTHING);
        bench.device.on_controller(Controller::Active, &NOTHING);
        let frames = bench.run(40);
        assert_eq!(bench.drive, drive, "{option}");
        assert_eq!(codes(&frames).iter().filter(|code| **code == (0x81, 0x8110)).count(), 1);
        // With option 1 the leg reacts to the fault itself.
        let fault = bench.orders.iter().find_map(|order| order.faults[0]);
        assert_eq!(fault, (option == 1).then_some(FaultCode::BusOff));
    }
    let mut bench = Bench::new();
    bench.drive = DriveState::OperationEnabled;
    bench.device.on_controller(Controller::Overrun, &NOTHING);
    bench.run(40);
    assert_eq!(bench.drive, DriveState::OperationEnabled);
}

#[test]
fn a_leg_without_a_reference_reports_why_it_is_not_enabled() {
    let mut bench = Bench::new();
    bench.rests = true;
    bench.enable();
    assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
    // Neither calibrated nor referenced.
    assert_eq!(bench.read(1, 0x60FD) >> 16, 0b1101);
    assert_ne!(bench.read(1, 0x6041) & 0x6F, 0x27);
    // Storing is still possible.
    bench.save(1);
    assert!(bench.store(true).is_some());
    bench.rests = false;
    bench.run(4);
    bench.enable();
    assert_eq!((bench.drive, bench.read(1, 0x60FD) >> 16), (DriveState::OperationEnabled, 0b001));
}

#[test]
fn each_refusal_reason_is_reported_once_until_it_ends() {
    type Inject = fn(&mut Bench);
    let reasons: [(u8, [u8; 2], Inject); 4] = [
        (16, [0; 2], |bench| bench.held = false),
        (17, [0x21, 0x80], |bench| (bench.blocked, bench.causes) = (true, 0x8021)),
        (18, [0; 2], |bench| (bench.rests, bench.calibrated) = (true, true)),
        (19, [0; 2], |bench| bench.rests = true),
    ];
    for (reason, [low, high], inject) in reasons {
        let mut bench = Bench::new();
        bench.send(0, &[1, 0]);
        inject(&mut bench);
        assert_eq!(emergencies(bench.run(40)), [], "no request yet");
        bench.orders.clear();
        let refused = [0x81, 0x82].map(|id| Frame::new(id, &[0x0E, 0xFF, 0x81, 0, reason, low, high, 0]));
        assert_eq!(bench.insist(30), refused, "{reason}");
        assert_ne!(bench.drive, DriveState::OperationEnabled);
        assert_eq!((bench.read(1, 0x603F), bench.read(2, 0x603F)), (0xFF0E, 0xFF0E));
        let bit = bench.read(1, 0x60FD) >> reason & 1;
        assert_eq!(bit, u32::from(reason != 16), "{reason}");
        let noted = bench.orders.iter().filter_map(|order| order.refused);
        assert!(noted.map(|noted| (noted.number(), noted.reason as u8)).eq([(0, reason)]), "{reason}");
        // The first word of a new attempt ends it.
        bench.send(0x201, &[0, 0]);
        bench.send(0x202, &[0, 0]);
        (bench.held, bench.blocked, bench.rests) = (true, false, false);
        let over = [0x81, 0x82].map(|id| Frame::new(id, &[0; 8]));
        assert_eq!(emergencies(bench.run(8)), over, "{reason}");
        assert_eq!(bench.insist(1), []);
        assert_eq!((bench.drive, bench.read(1, 0x603F)), (DriveState::OperationEnabled, 0xFF0E));
    }
}

#[test]
fn a_refusal_of_the_leg_is_reported_with_its_joint_until_it_ends() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    let refusal = Refusal { joint: 1, reason: RefusalReason::Moving };
    (bench.refuses, bench.velocity) = (Some(refusal), 0.5);
    bench.orders.clear();
    let refused = [0x81, 0x82].map(|id| Frame::new(id, &[0x0E, 0xFF, 0x81, 2, 21, 0, 0, 0]));
    assert_eq!(bench.insist(30), refused);
    assert_eq!((bench.read(1, 0x60FD) >> 21, bench.read(2, 0x60FD) >> 21), (0, 1));
    // The leg records its own refusals.
    assert!(bench.orders.iter().all(|order| order.refused.is_none()));
    (bench.refuses, bench.velocity) = (None, 0.0);
    assert_eq!(bench.insist(1), [0x81, 0x82].map(|id| Frame::new(id, &[0; 8])));
    assert_eq!((bench.drive, bench.read(2, 0x60FD) >> 21), (DriveState::OperationEnabled, 0));
}

#[test]
fn a_refusal_of_one_tick_is_reported_after_the_bus_was_busy() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    for word in [6, 7] {
        assert_eq!(bench.word(word), []);
    }
    bench.refuses = Some(Refusal { joint: 0, reason: RefusalReason::Moving });
    [0x201, 0x202].into_iter().for_each(|id| bench.receive(id, &[15, 0]));
    // The joint comes to rest at once, while every mailbox is occupied.
    (0..4).for_each(|_| bench.tick());
    let begin = [0x0E, 0xFF, 0x81, 1, 21, 0, 0, 0];
    let expected = [0x81, 0x82].map(|id| [Frame::new(id, &begin), Frame::new(id, &[0; 8])]);
    assert_eq!(emergencies(bench.run(1)), expected.as_flattened());
    assert_eq!((bench.read(1, 0x603F), bench.read(2, 0x603F)), (0xFF0E, 0xFF0E));
}

#[test]
fn refusals_begin_at_most_once_a_second() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    let mut begins = Vec::new();
    while bench.now_us < 5 * REFUSAL_US {
        // A host that repeats words for which there is no step, and takes them back.
        for word in [15, 0] {
            let sent = bench.word(word);
            let is_begin = |frame: &&Frame| frame.data()[0] == 0x0E;
            begins.extend(sent.iter().filter(is_begin).map(|frame| (frame.id(), bench.now_us)));
        }
    }
    for node in [0x81, 0x82] {
        let times: Vec<u64> = begins.iter().filter(|(id, _)| *id == node).map(|(_, us)| *us).collect();
        assert_eq!(times.len(), 5, "{times:?}");
        assert!(times.windows(2).all(|pair| pair[1] - pair[0] > REFUSAL_US - 10_000), "{times:?}");
    }
}

#[test]
fn a_refusal_under_operator_control_is_not_sent_to_hosts() {
    let mut bench = Bench::new();
    bench.send(0, &[1, 0]);
    bench.held = false;
    bench.refused = Some(Refusal { joint: 0, reason: RefusalReason::Encoder });
    assert_eq!(emergencies(bench.run(40)), []);
    bench.write(1, 0x2012, 0, 0, 1);
    assert_eq!(bench.orders.last().map(|order| order.may_return), Some([false, true]));
}

/// Emergency messages of both nodes: a step of this joint that does not exist, and its end.
fn out_of_order(joint: u8) -> [[Frame; 2]; 2] {
    let message = |data: [u8; 8]| [0x81, 0x82].map(|id| Frame::new(id, &data));
    [message([0x0E, 0xFF, 0x81, joint, 23, 0, 0, 0]), message([0; 8])]
}

#[test]
fn a_step_that_does_not_exist_is_reported_until_a_step_is_made() {
    let [begins, ends] = out_of_order(1);
    for word in [7, 15, 0x86, 0x8F] {
        let mut bench = Bench::new();
        bench.send(0, &[1, 0]);
        bench.orders.clear();
        assert_eq!(bench.word(word), begins, "{word:x}");
        assert_eq!((bench.drive, bench.read(1, 0x603F)), (DriveState::SwitchOnDisabled, 0xFF0E));
        assert_eq!([1, 2].map(|node| bench.read(node, 0x60FD) >> 23), [1, 0]);
        // Once, however often it is repeated.
        assert_eq!((0..50).flat_map(|_| bench.word(word)).collect::<Vec<_>>(), []);
        let noted: Vec<Refusal> = bench.orders.iter().filter_map(|order| order.refused).collect();
        assert_eq!(noted, [Refusal { joint: 0, reason: RefusalReason::NoTransition }]);
        // The second joint still has the word when the first one goes on, a second later.
        bench.now_us += REFUSAL_US;
        let sent: Vec<Frame> = [6, 7, 15].into_iter().flat_map(|word| bench.word(word)).collect();
        assert_eq!(sent, [out_of_order(2)[0].to_vec(), ends.to_vec()].concat(), "{word:x}");
        assert_eq!(bench.drive, DriveState::OperationEnabled);
        assert_eq!(bench.read(1, 0x60FD) >> 23, 0);
    }
}

#[test]
fn a_step_during_a_quick_stop_is_reported_as_refused() {
    for word in [6, 7, 15] {
        let mut bench = Bench::new();
        bench.send(0, &[1, 0]);
        bench.enable();
        bench.receive(0x201, &[2, 0]);
        bench.run(2);
        assert!(matches!(bench.drive, DriveState::QuickStopActive { .. }));
        bench.receive(0x201, &[word, 0]);
        assert_eq!(emergencies(bench.run(1)), out_of_order(1)[0], "{word:x}");
        assert!(matches!(bench.drive, DriveState::QuickStopActive { .. }));
        // The word is not carried out later; sent again, a 6 is.
        bench.run(20);
        assert_eq!(bench.drive, DriveState::SwitchOnDisabled);
        assert_eq!(bench.word(6), out_of_order(1)[1]);
        assert_eq!(bench.drive, DriveState::ReadyToSwitchOn);
    }
}

#[test]
fn usual_words_cause_no_report_of_order() {
    // Enabling by 6, 7, F and by 6, F; repeated words while one joint stops both; stops; fault resets.
    let words: [&[[u8; 2]]; 7] = [
        &[[6, 6], [7, 7], [15, 15], [15, 15], [7, 7], [15, 15], [6, 6], [0, 0]],
        &[[6, 0], [15, 0], [15, 6], [15, 15], [15, 0], [15, 0], [0, 0]],
        &[[6, 6], [15, 15], [2, 15], [2, 15], [2, 2], [0, 0]],
        &[[6, 6], [15, 15], [0, 15], [0, 15], [0, 0]],
        &[[6, 6], [15, 15], [6, 15], [6, 15], [0, 0]],
        &[[0, 0], [0x80, 0x80], [0, 0], [6, 6], [0x80, 0x80], [0, 0]],
        &[[6, 6], [15, 15], [0x3F, 0x1F], [0x0F, 0x0F], [0, 0]],
    ];
    for words in words {
        let mut bench = Bench::new();
        let mut sent = bench.send(0, &[1, 0]);
        for [hip, knee] in words {
            sent.extend(bench.send(0x201, &[*hip, 0]));
            sent.extend(bench.send(0x202, &[*knee, 0]));
        }
        assert_eq!(emergencies(sent), [], "{words:?}");
    }
}
