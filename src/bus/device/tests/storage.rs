//! Tests of the stored parameters.

use super::*;
use crate::bus::dictionary::Object;

#[test]
fn stored_parameters_are_recalled_by_a_reset_and_a_start() {
    let mut bench = Bench::new();
    bench.write(1, 0x1017, 0, 50, 2);
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.write(2, 0x2002, 0, 500, 2);
    bench.save(1);
    let (what, stored) = bench.store(true).expect("a store request");
    assert_eq!((what, bench.store(true)), (StoreCommand::All, None));
    assert_eq!(bench.device.bit_rate(), Some(500));
    // A communication reset leaves the drive objects unchanged.
    for (command, expected) in [(130, (50, 777)), (129, (50, 12_345))] {
        bench.write(1, 0x1017, 0, 90, 2);
        bench.write(1, 0x6065, 0, 777, 4);
        bench.send(0, &[command, 0]);
        assert_eq!((bench.read(1, 0x1017), bench.read(1, 0x6065)), expected, "{command}");
    }
    // Another start, with the stored bytes.
    let mut other = Bench::new();
    for (joint, stored) in stored.iter().enumerate() {
        other.device.recall(joint, stored.bytes());
    }
    other.run(4);
    assert_eq!((other.read(1, 0x6065), other.read(2, 0x2002)), (12_345, 500));
    assert_eq!(other.device.bit_rate(), Some(500));
    other.load(2);
    assert_eq!(other.store(true), Some((StoreCommand::Defaults, [StoredNode::NOTHING; 2])));
    other.send(0, &[129, 0]);
    assert_eq!((other.read(1, 0x6065), other.device.bit_rate()), (87_266, None));
}

#[test]
fn a_failed_store_leaves_the_recalled_parameters_unchanged() {
    let mut bench = Bench::new();
    let window = |bench: &mut Bench| {
        bench.send(0, &[129, 0]);
        (bench.read(1, 0x6065), bench.device.bit_rate())
    };
    let set = |bench: &mut Bench, window: u32, rate: u32| {
        bench.write(1, 0x6065, 0, window, 4);
        bench.write(2, 0x2002, 0, rate, 2);
        bench.save(1);
    };
    set(&mut bench, 11_111, 500);
    assert_eq!(bench.store(false).map(|(what, _)| what), Some(StoreCommand::All));
    assert_eq!(window(&mut bench), (87_266, None));
    set(&mut bench, 22_222, 250);
    // Until the store has finished, the old parameters apply.
    let mut objects = [StoredNode::NOTHING; 2];
    assert_eq!(bench.device.take_store(&mut objects), Some(StoreCommand::All));
    assert_eq!(window(&mut bench), (87_266, None));
    bench.device.stored(true, &objects);
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    set(&mut bench, 33_333, 125);
    assert!(bench.store(false).is_some());
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    bench.load(2);
    assert_eq!(bench.store(false).map(|(what, _)| what), Some(StoreCommand::Defaults));
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    bench.load(2);
    assert!(bench.store(true).is_some());
    assert_eq!(window(&mut bench), (87_266, None));
}

#[test]
fn parameters_that_do_not_fit_are_refused_and_reported() {
    let mut bench = Bench::new();
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.save(1);
    assert!(bench.store(true).is_some());
    // Every PDO with eight objects: dummies received, modes of operation sent.
    for pdo in 0..4 {
        for (mapping, object) in [(0x1600 + pdo, 0x0005_0008), (0x1A00 + pdo, 0x6061_0008)] {
            let (parameters, identifier) = (mapping - 0x200, 0x4000_0181 + u32::from(pdo));
            bench.write(1, parameters, 1, 1 << 31 | identifier, 4);
            bench.write(1, mapping, 0, 0, 1);
            for sub in 1..=8 {
                bench.write(1, mapping, sub, object, 4);
            }
            bench.write(1, mapping, 0, 8, 1);
        }
    }
    bench.write(2, 0x6065, 0, 777, 4);
    bench.save(1);
    assert_eq!(bench.store(true), None);
    let emergencies = |bench: &mut Bench| {
        let mut sent = codes(&bench.run(4));
        sent.sort_by_key(|(id, _)| *id);
        sent
    };
    let failed = [(0x81, 0xFF0D), (0x81, 0x5530), (0x82, 0xFF0D), (0x82, 0x5530)];
    assert_eq!(emergencies(&mut bench), failed);
    // A second failure is reported too.
    bench.save(1);
    assert_eq!(bench.store(true), None);
    assert_eq!(emergencies(&mut bench), failed);
    // A node reset does not hide the failure.
    let frames = bench.send(0, &[129, 0]);
    assert_eq!(codes(&frames), [(0x81, 0x5530), (0x82, 0x5530)]);
    assert_eq!(bench.read(1, 0x1001) & 1, 1);
    assert_eq!((bench.read(1, 0x6065), bench.read(2, 0x6065)), (12_345, 87_266));
}

#[test]
fn two_nodes_never_share_a_node_id() {
    let mut bench = Bench::new();
    bench.write(1, 0x2001, 0, 2, 1);
    bench.save(1);
    assert_eq!(bench.store(true), None);
    assert_eq!(codes(&bench.run(4)).last(), Some(&(0x82, 0x5530)));
    // Exchanged node-IDs are valid.
    bench.write(2, 0x2001, 0, 1, 1);
    bench.save(1);
    let (_, [hip, knee]) = bench.store(true).expect("a store request");
    bench.send(0, &[129, 0]);
    assert_eq!(bench.device.nodes().each_ref().map(|node| node.id().number()), [2, 1]);
    // Conflicting bytes from another source: both nodes use their defaults.
    let mut other = Bench::new();
    let mut bytes = [0; 5];
    crate::bus::write_stored(Object::at(0x2001, 0), 1, &mut bytes).expect("it fits");
    other.device.recall(1, &bytes);
    assert_eq!(other.device.nodes().each_ref().map(|node| node.id().number()), [1, 2]);
    // The first node's change frees its node-ID for the second, in either order of recall.
    for order in [[0, 1], [1, 0]] {
        let mut other = Bench::new();
        for joint in order {
            other.device.recall(joint, [&hip, &knee][joint].bytes());
        }
        assert_eq!(other.device.nodes().each_ref().map(|node| node.id().number()), [2, 1]);
    }
}

#[test]
fn both_nodes_share_the_bit_rate() {
    let mut bench = Bench::new();
    bench.device = bench.device.with_emergency_inhibit(100);
    bench.write(2, 0x2002, 0, 500, 2);
    assert_eq!(bench.read(1, 0x2002), 500);
    bench.save(1);
    assert!(bench.store(true).is_some());
    // Default bit rate again, written at the other node.
    bench.write(1, 0x2002, 0, 1000, 2);
    bench.save(1);
    let (_, stored) = bench.store(true).expect("a store request");
    assert_eq!((bench.device.bit_rate(), bench.read(2, 0x2002)), (None, 1000));
    assert_eq!(stored, [StoredNode::NOTHING; 2]);
    // A bit rate stored for one node only, as by an older version or a tool, applies to both and survives a
    // reset of either.
    let mut bytes = [0; 8];
    let length = crate::bus::write_stored(Object::at(0x2002, 0), 500, &mut bytes).expect("it fits");
    for joint in 0..2 {
        let mut other = Bench::new();
        other.device.recall(joint, &bytes[..length]);
        other.run(4);
        for node in [1, 2] {
            other.send(0, &[129, node]);
            assert_eq!((other.read(1, 0x2002), other.read(2, 0x2002)), (500, 500), "{joint} {node}");
        }
    }
    // A bit rate that was written but not stored ends with a reset of either node.
    bench.write(1, 0x2002, 0, 250, 2);
    bench.send(0, &[129, 2]);
    assert_eq!((bench.read(1, 0x2002), bench.read(2, 0x2002)), (1000, 1000));
}

#[test]
fn the_controller_state_survives_a_node_reset() {
    let mut bench = Bench::new();
    bench.device.on_controller(Controller::Passive, &NOTHING);
    bench.run(4);
    // A lost frame is not a lasting state.
    bench.device.on_controller(Controller::Overrun, &NOTHING);
    let frames = bench.send(0, &[129, 1]);
    assert_eq!(codes(&frames).first(), Some(&(0x81, 0x8120)), "{frames:?}");
    assert_eq!(bench.read(1, 0x1001), 0x11);
    bench.device.on_controller(Controller::Active, &NOTHING);
    // The reset node has the default inhibit time again.
    assert_eq!(codes(&bench.run(50)), [(0x82, 0), (0x81, 0)]);
}

#[test]
fn an_inhibit_reason_prevents_storing() {
    let mut bench = Bench::new();
    bench.blocked = true;
    bench.run(4);
    let answer = bench.ask(1, [0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e']);
    assert_eq!(answer, [0x80, 0x10, 0x10, 1, 0x22, 0, 0, 0x08]);
    assert_eq!(bench.store(true), None);
}

#[test]
fn hosts_are_informed_before_a_flash_write_and_of_its_outcome() {
    let mut bench = Bench::new();
    for (storing, code) in [(Storing::Busy, 0xFF0D), (Storing::Failed, 0x5530), (Storing::Done, 0)] {
        bench.device.storing(storing);
        bench.device.storing(storing);
        assert_eq!(codes(&bench.run(4)), [(0x81, code), (0x82, code)]);
    }
}

#[test]
fn the_heartbeat_timeout_restarts_after_the_board_stood_still() {
    let is_missed = |frames: &[Frame]| codes(frames).contains(&(0x81, 0x8130));
    let mut bench = Bench::new();
    bench.write(1, 0x1016, 1, 0x70 << 16 | 100, 4);
    bench.device.watch(bench.now_us, &NOTHING);
    bench.send(0x770, &[5]);
    // The board erases a sector; frames of the host are lost in that time.
    bench.now_us += 2_000_000;
    bench.device.watch(bench.now_us, &NOTHING);
    assert!(!is_missed(&bench.run(8)));
    let missed_after_ms = (0..200).find(|_| {
        bench.device.watch(bench.now_us, &NOTHING);
        is_missed(&bench.run(4))
    });
    // The full timeout applies again.
    assert!(missed_after_ms.is_some_and(|ms| (90..=102).contains(&ms)), "{missed_after_ms:?}");
}

#[test]
fn the_heartbeat_timeout_restarts_after_a_store() {
    let mut bench = Bench::new();
    bench.write(1, 0x1016, 1, 0x70 << 16 | 100, 4);
    bench.save(1);
    let mut objects = [StoredNode::NOTHING; 2];
    bench.send(0x770, &[5]);
    bench.run(320);
    assert!(bench.device.take_store(&mut objects).is_some());
    // On a board the clock does not advance during a store, and a heartbeat is lost.
    bench.device.stored(true, &objects);
    bench.run(8);
    bench.device.watch(bench.now_us, &NOTHING);
    let sent = codes(&bench.run(320));
    assert!(sent.iter().all(|(_, code)| *code != 0x8130), "{sent:x?}");
    assert!(codes(&bench.run(100)).contains(&(0x81, 0x8130)));
}
