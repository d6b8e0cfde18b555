//! Two boards on one bus that start with the same node-IDs.

use super::*;

/// Boards with the serial numbers 21 and 77.
struct Bus([Bench; 2]);

impl Bus {
    fn new() -> Self {
        Self([21, 77].map(|serial| Bench::with(Identity { serial, ..IDENTITY })))
    }

    /// Sends a frame to both boards; returns the data of the answers to LSS.
    fn ask(&mut self, service: u8, value: u32) -> Vec<[u8; 8]> {
        let [a, b, c, d] = value.to_le_bytes();
        let frames = self.0.iter_mut().flat_map(|bench| bench.send(0x7E5, &[service, a, b, c, d, 0, 0, 0]));
        frames.filter(|frame| frame.id() == 0x7E4).filter_map(|frame| frame.full()).collect()
    }

    fn select(&mut self, joint: u32, serial: u32) {
        assert_eq!(self.ask(0x04, 0), [[0; 8]; 0]);
        let fields = [IDENTITY.vendor, IDENTITY.product + joint, IDENTITY.revision, serial];
        let answers: Vec<_> =
            (0x40..).zip(fields).flat_map(|(service, value)| self.ask(service, value)).collect();
        assert_eq!(answers, [[0x44, 0, 0, 0, 0, 0, 0, 0]]);
    }

    fn numbers(&self) -> [[u8; 2]; 2] {
        self.0.each_ref().map(|bench| bench.device.nodes().each_ref().map(|node| node.id().number()))
    }
}

#[test]
fn one_of_two_equal_boards_gets_other_node_ids() {
    let mut bus = Bus::new();
    for (joint, number) in [(0, 3), (1, 4)] {
        bus.select(joint, 77);
        assert_eq!(bus.ask(0x5E, 0), [[0x5E, 1 + joint as u8, 0, 0, 0, 0, 0, 0]]);
        assert_eq!(bus.ask(0x11, number), [[0x11, 0, 0, 0, 0, 0, 0, 0]]);
    }
    // The answer to the store comes after the flash write, from that board only.
    assert_eq!(bus.ask(0x17, 0), [[0; 8]; 0]);
    let [first, second] = &mut bus.0;
    assert_eq!(first.store(true), None);
    assert!(second.store(true).is_some());
    let answers: Vec<_> = second.run(4).into_iter().filter(|frame| frame.id() == 0x7E4).collect();
    assert_eq!(answers, [Frame::new(0x7E4, &[0x17, 0, 0, 0, 0, 0, 0, 0])]);
    assert_eq!(bus.numbers(), [[1, 2], [1, 2]]);
    for bench in &mut bus.0 {
        bench.send(0, &[129, 0]);
    }
    assert_eq!(bus.numbers(), [[1, 2], [3, 4]]);
}

#[test]
fn a_node_id_that_is_not_stored_lasts_until_a_node_reset() {
    let mut bus = Bus::new();
    bus.select(1, 21);
    bus.ask(0x11, 9);
    for (command, expected) in [(130, [[1, 9], [1, 2]]), (129, [[1, 2], [1, 2]])] {
        for bench in &mut bus.0 {
            bench.send(0, &[command, 0]);
        }
        assert_eq!(bus.numbers(), expected);
    }
    // The other node's node-ID: refused by the reset, and not stored.
    bus.select(1, 21);
    bus.ask(0x11, 1);
    bus.ask(0x17, 0);
    let [bench, _] = &mut bus.0;
    assert_eq!(bench.store(true), None);
    assert!(bench.run(4).contains(&Frame::new(0x7E4, &[0x17, 2, 0, 0, 0, 0, 0, 0])));
    bench.send(0, &[130, 0]);
    assert_eq!(bus.numbers(), [[1, 2], [1, 2]]);
}

#[test]
fn nothing_is_stored_while_the_drive_is_on() {
    let mut bus = Bus::new();
    bus.0[0].enable();
    bus.select(0, 21);
    assert_eq!(bus.ask(0x17, 0), [[0x17, 255, 1, 0, 0, 0, 0, 0]]);
}
