//! What a host wants kept.

use super::*;

#[test]
fn what_is_kept_is_ready_for_the_store_and_comes_back_with_a_reset() {
    let mut bench = Bench::new();
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.write(2, 0x2002, 0, 500, 2);
    bench.save(1);
    let (what, kept) = bench.store(true).expect("something to keep");
    assert_eq!((what, bench.store(true)), (Keeping::All, None));
    assert_eq!(bench.station.bit_rate(), Some(500));
    bench.write(1, 0x6065, 0, 1, 4);
    bench.send(0, &[129, 0]);
    assert_eq!(bench.read(1, 0x6065), 12_345);
    // Another start, from what the store gave back.
    let mut other = Bench::new();
    for (joint, kept) in kept.iter().enumerate() {
        other.station.recall(joint, kept.bytes());
    }
    other.run(4);
    assert_eq!(
        (other.read(1, 0x6065), other.read(2, 0x2002), other.station.bit_rate()),
        (12_345, 500, Some(500))
    );
    other.load(2);
    assert_eq!(other.store(true), Some((Keeping::Defaults, [KeptNode::NOTHING; 2])));
    other.send(0, &[129, 0]);
    assert_eq!((other.read(1, 0x6065), other.station.bit_rate()), (87_266, None));
}

#[test]
fn a_store_that_failed_leaves_what_a_reset_brings_back_as_it_was() {
    let mut bench = Bench::new();
    let window = |bench: &mut Bench| {
        bench.send(0, &[129, 0]);
        (bench.read(1, 0x6065), bench.station.bit_rate())
    };
    let set = |bench: &mut Bench, window: u32, rate: u32| {
        bench.write(1, 0x6065, 0, window, 4);
        bench.write(2, 0x2002, 0, rate, 2);
        bench.save(1);
    };
    set(&mut bench, 11_111, 500);
    assert_eq!(bench.store(false).map(|(what, _)| what), Some(Keeping::All));
    assert_eq!(window(&mut bench), (87_266, None));
    set(&mut bench, 22_222, 250);
    // While it is under way nothing of it counts.
    let mut objects = [KeptNode::NOTHING; 2];
    assert_eq!(bench.station.take_store(&mut objects), Some(Keeping::All));
    assert_eq!(window(&mut bench), (87_266, None));
    bench.station.stored(true, &objects);
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    set(&mut bench, 33_333, 125);
    assert!(bench.store(false).is_some());
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    bench.load(2);
    assert_eq!(bench.store(false).map(|(what, _)| what), Some(Keeping::Defaults));
    assert_eq!(window(&mut bench), (22_222, Some(250)));
    bench.load(2);
    assert!(bench.store(true).is_some());
    assert_eq!(window(&mut bench), (87_266, None));
}

#[test]
fn what_does_not_fit_is_not_kept_and_hosts_are_told() {
    let mut bench = Bench::new();
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.save(1);
    assert!(bench.store(true).is_some());
    // Every PDO with eight objects: bytes of nothing in, modes out.
    for place in 0..4 {
        for (mapping, object) in [(0x1600 + place, 0x0005_0008), (0x1A00 + place, 0x6061_0008)] {
            let (parameters, identifier) = (mapping - 0x200, 0x4000_0181 + u32::from(place));
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
    let told = |bench: &mut Bench| {
        let mut told = codes_of(&bench.run(4));
        told.sort_by_key(|(id, _)| *id);
        told
    };
    let failed = [(0x81, 0xFF0D), (0x81, 0x5530), (0x82, 0xFF0D), (0x82, 0x5530)];
    assert_eq!(told(&mut bench), failed);
    // So is a second one that fails like the first.
    bench.save(1);
    assert_eq!(bench.store(true), None);
    assert_eq!(told(&mut bench), failed);
    // A node that is reset does not hide it.
    let frames = bench.send(0, &[129, 0]);
    assert_eq!(codes_of(&frames), [(0x81, 0x5530), (0x82, 0x5530)]);
    assert_eq!(bench.read(1, 0x1001) & 1, 1);
    assert_eq!((bench.read(1, 0x6065), bench.read(2, 0x6065)), (12_345, 87_266));
}

/// Emergency messages: identifier and code.
fn codes_of(frames: &[Frame]) -> Vec<(u16, u16)> {
    let emergencies = frames.iter().filter(|frame| frame.id() & 0x780 == 0x80);
    emergencies.map(|frame| (frame.id(), u16::from_le_bytes([frame.data()[0], frame.data()[1]]))).collect()
}

#[test]
fn two_nodes_of_one_number_are_not_kept_and_do_not_start() {
    let mut bench = Bench::new();
    bench.write(1, 0x2001, 0, 2, 1);
    bench.save(1);
    assert_eq!(bench.store(true), None);
    assert_eq!(codes_of(&bench.run(4)).last(), Some(&(0x82, 0x5530)));
    // Exchanged they are two.
    bench.write(2, 0x2001, 0, 1, 1);
    bench.save(1);
    let (_, [hip, knee]) = bench.store(true).expect("something to keep");
    bench.send(0, &[129, 0]);
    assert_eq!(bench.station.nodes().each_ref().map(|node| node.id().number()), [2, 1]);
    // A memory that somebody else wrote: both begin with their own.
    let mut other = Bench::new();
    let mut bytes = [0; 5];
    crate::bus::write_kept(crate::bus::dictionary::Object::at(0x2001, 0), 1, &mut bytes).expect("it fits");
    other.station.recall(1, &bytes);
    assert_eq!(other.station.nodes().each_ref().map(|node| node.id().number()), [1, 2]);
    // The first moves away and makes room, in whatever order they are recalled.
    for order in [[0, 1], [1, 0]] {
        let mut other = Bench::new();
        for joint in order {
            other.station.recall(joint, [&hip, &knee][joint].bytes());
        }
        assert_eq!(other.station.nodes().each_ref().map(|node| node.id().number()), [2, 1]);
    }
}

#[test]
fn a_reset_of_the_communication_leaves_the_other_objects_as_they_are() {
    let mut bench = Bench::new();
    bench.write(1, 0x1017, 0, 50, 2);
    bench.write(1, 0x6065, 0, 12_345, 4);
    bench.save(1);
    assert!(bench.store(true).is_some());
    for (command, expected) in [(130, (50, 777)), (129, (50, 12_345))] {
        bench.write(1, 0x1017, 0, 90, 2);
        bench.write(1, 0x6065, 0, 777, 4);
        bench.send(0, &[command, 1]);
        assert_eq!((bench.read(1, 0x1017), bench.read(1, 0x6065)), expected, "{command}");
    }
}

#[test]
fn the_bit_rate_is_one_for_both_nodes() {
    let mut bench = Bench::new();
    bench.write(2, 0x2002, 0, 500, 2);
    assert_eq!(bench.read(1, 0x2002), 500);
    bench.save(1);
    assert!(bench.store(true).is_some());
    // The usual one again, written at the other node.
    bench.write(1, 0x2002, 0, 1000, 2);
    bench.save(1);
    let (_, kept) = bench.store(true).expect("something to keep");
    assert_eq!((bench.station.bit_rate(), bench.read(2, 0x2002)), (None, 1000));
    assert_eq!(kept, [KeptNode::NOTHING; 2]);
    // Kept of one node alone, as before it was one object, or by a tool: it holds for both, and outlives either's reset.
    let mut bytes = [0; 8];
    let rate = crate::bus::dictionary::Object::at(0x2002, 0);
    let length = crate::bus::write_kept(rate, 500, &mut bytes).expect("it fits");
    for joint in 0..2 {
        let mut other = Bench::new();
        other.station.recall(joint, &bytes[..length]);
        other.run(4);
        for node in [1, 2] {
            other.send(0, &[129, node]);
            assert_eq!((other.read(1, 0x2002), other.read(2, 0x2002)), (500, 500), "{joint} {node}");
        }
    }
    // Written and not kept, it ends with either node.
    bench.write(1, 0x2002, 0, 250, 2);
    bench.send(0, &[129, 2]);
    assert_eq!((bench.read(1, 0x2002), bench.read(2, 0x2002)), (1000, 1000));
}

#[test]
fn what_the_controller_told_outlives_a_node_that_is_reset() {
    let mut bench = Bench::new();
    bench.station.on_controller(Controller::Passive, &NOTHING);
    bench.run(4);
    // A frame that was lost is over at once.
    bench.station.on_controller(Controller::Overrun, &NOTHING);
    let frames = bench.send(0, &[129, 1]);
    assert_eq!(codes_of(&frames).first(), Some(&(0x81, 0x8120)), "{frames:?}");
    assert_eq!(bench.read(1, 0x1001), 0x11);
    bench.station.on_controller(Controller::Active, &NOTHING);
    assert_eq!(codes_of(&bench.run(4)), [(0x81, 0), (0x82, 0)]);
}

#[test]
fn nothing_is_kept_while_something_blocks() {
    let mut bench = Bench::new();
    bench.blocked = true;
    bench.run(4);
    let frames = bench.send(0x601, &[0x23, 0x10, 0x10, 1, b's', b'a', b'v', b'e']);
    let answer = frames.iter().find(|frame| frame.id() == 0x581).expect("an answer");
    assert_eq!(answer.data(), [0x80, 0x10, 0x10, 1, 0x22, 0, 0, 0x08]);
    assert_eq!(bench.store(true), None);
}

#[test]
fn hosts_are_told_before_the_flash_is_written_and_how_it_ended() {
    let mut bench = Bench::new();
    for (storing, code) in [(Storing::Busy, 0xFF0D), (Storing::Failed, 0x5530), (Storing::Done, 0)] {
        bench.station.storing(storing);
        bench.station.storing(storing);
        assert_eq!(codes_of(&bench.run(4)), [(0x81, code), (0x82, code)]);
    }
}

#[test]
fn a_host_is_not_missed_for_the_time_in_which_the_board_stood_still() {
    let is_missed = |frames: &[Frame]| {
        frames.iter().any(|frame| frame.id() == 0x81 && frame.data().starts_with(&[0x30, 0x81]))
    };
    let mut bench = Bench::new();
    bench.write(1, 0x1016, 1, 0x70 << 16 | 100, 4);
    bench.station.watch(bench.now_us, &NOTHING);
    bench.send(0x770, &[5]);
    // A sector is erased, and what the host sends meanwhile is lost.
    bench.now_us += 2_000_000;
    bench.station.watch(bench.now_us, &NOTHING);
    assert!(!is_missed(&bench.run(8)));
    let mut missed_after_ms = None;
    for ms in 0..200 {
        bench.station.watch(bench.now_us, &NOTHING);
        if is_missed(&bench.run(4)) {
            missed_after_ms = Some(ms);
            break;
        }
    }
    // It has its whole time again, and no more.
    assert!(missed_after_ms.is_some_and(|ms| (90..=102).contains(&ms)), "{missed_after_ms:?}");
}

#[test]
fn whoever_was_silent_while_something_was_stored_has_all_of_his_time_again() {
    let mut bench = Bench::new();
    bench.write(1, 0x1016, 1, 0x70 << 16 | 100, 4);
    bench.save(1);
    let mut objects = [KeptNode::NOTHING; 2];
    bench.send(0x770, &[5]);
    bench.run(320);
    assert!(bench.station.take_store(&mut objects).is_some());
    // On a board time stands meanwhile, and the heartbeat that came then is lost.
    bench.station.stored(true, &objects);
    bench.run(8);
    bench.station.watch(bench.now_us, &NOTHING);
    let codes = codes_of(&bench.run(320));
    assert!(codes.iter().all(|(_, code)| *code != 0x8130), "{codes:x?}");
    assert!(codes_of(&bench.run(100)).contains(&(0x81, 0x8130)));
}
