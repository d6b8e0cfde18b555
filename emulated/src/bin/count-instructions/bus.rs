//! Cost of one bus node per frame: cyclic frames, rare frames, and the most expensive random frames.

use core::hint::black_box;

use scarab::bus::drive::{Axis, AxisConstants, Mode};
use scarab::bus::{Frame, Identity, Node, NodeId};
use scarab::units::{Ampere, NewtonMetre};

use crate::counter::{Tally, count, heading};

/// Longer than a block of 127 segments.
const TEXT: &str = match core::str::from_utf8(&[b'x'; 1000]) {
    Ok(text) => text,
    Err(_) => "",
};
const RANDOM_FRAMES: u32 = 20_000;

struct Bench {
    node: Node,
    axis: Axis,
    now_us: u64,
    received: Tally,
    polled: Tally,
}

impl Bench {
    fn new() -> Option<Self> {
        let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
        let constants = AxisConstants {
            rated_torque: NewtonMetre(40.0),
            rated_current: Ampere(20.0),
            modes,
            ..AxisConstants::UNKNOWN
        };
        let identity = Identity::scarab(1, TEXT);
        let mut bench = Self {
            node: Node::new(NodeId::new(1)?, identity),
            axis: Axis::new(constants),
            now_us: 0,
            received: Tally::default(),
            polled: Tally::default(),
        };
        bench.poll();
        bench.receive(0, &[1, 1]);
        bench.poll();
        (bench.received, bench.polled) = (Tally::default(), Tally::default());
        Some(bench)
    }

    fn receive(&mut self, id: u16, data: &[u8]) {
        let frame = Frame::new(id, data);
        let (instructions, _) =
            count(|| black_box(&mut self.node).on_frame(&frame, self.now_us, &mut self.axis));
        self.received.push(instructions);
    }

    /// Sends all waiting frames; the last poll returns none.
    fn poll(&mut self) {
        loop {
            let (instructions, frame) = count(|| black_box(&mut self.node).poll(self.now_us, &mut self.axis));
            self.polled.push(instructions);
            if frame.is_none() {
                return;
            }
        }
    }
}

/// Prints the table; `None` if the node cannot be created.
#[inline(never)]
pub fn report() -> Option<()> {
    heading("a node of the bus");
    let mut bench = Bench::new()?;
    for _ in 0..100 {
        bench.now_us += 1000;
        bench.poll();
    }
    bench.polled.print("a poll that says nothing");

    let mut bench = Bench::new()?;
    for _ in 0..100 {
        bench.receive(0x301, &[1, 2, 3, 4]);
    }
    bench.received.print("a received PDO with one target");

    let mut bench = Bench::new()?;
    for _ in 0..100 {
        bench.now_us += 1000;
        bench.receive(0x80, &[]);
        bench.poll();
    }
    bench.received.print("a SYNC");
    bench.polled.print("a poll after it: three PDOs, four objects");

    let mut bench = Bench::new()?;
    for sub in [1, 2, 3, 5] {
        bench.receive(0x601, &[0x40, 0x00, 0x18, sub, 0, 0, 0, 0]);
        bench.poll();
    }
    bench.received.print("an SDO that reads");

    let mut bench = Bench::new()?;
    bench.receive(0x601, &[0xA4, 0x09, 0x10, 0, 127, 0, 0, 0]);
    bench.poll();
    bench.receive(0x601, &[0xA3, 0, 0, 0, 0, 0, 0, 0]);
    bench.polled = Tally::default();
    bench.poll();
    bench.polled.print("a poll that sends a segment of a block");
    bench.received = Tally::default();
    bench.receive(0x601, &[0xA2, 126, 127, 0, 0, 0, 0, 0]);
    bench.received.print("a block of which the last segment was lost");

    let mut bench = Bench::new()?;
    let mut random = 1_u64;
    let mut next = || {
        random ^= random << 13;
        random ^= random >> 7;
        random ^= random << 17;
        random.to_le_bytes()
    };
    for _ in 0..RANDOM_FRAMES {
        let ([a, b, c, ..], data) = (next(), next());
        let id = match a % 4 {
            0 => 0x601,
            1 => [0x80, 0x201, 0x301, 0x401][usize::from(b % 4)],
            _ => u16::from_le_bytes([b, c]) & 0x7FF,
        };
        bench.now_us += 1000;
        bench.receive(id, data.get(..usize::from(c % 9))?);
        bench.poll();
    }
    bench.received.print("random frames: one that comes");
    bench.polled.print("random frames: one poll");
    Some(())
}
