//! The adapter between port and wire: a bounded queue of a client's frames, and the plug of the boards.
//!
//! ```text
//! most that waits       what the wire carries in 100 ms of the clock; a frame beyond it is refused
//! older than 100 ms     a set-point (`Effect::SetPoint`) is dropped; everything else is still carried out
//! full, and a stop      the oldest frame that is no stop is dropped for it
//! the client ends       its set-points are dropped, its stops leave, then the plug of every board is pulled
//! ```

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use scarab::bus::Frame;

use super::effect::Effect;
use super::network::Network;
use super::wire::{Sent, bits};

/// Age beyond which a set-point is not carried out, and how much of the wire's time the queue holds.
pub const MOST_AGE: Duration = Duration::from_millis(100);
/// Frames that wait at any speed and bit rate.
const LEAST_BITS: u64 = 16 * 135;
/// Frames that are given to the wire before each tick, more than it can carry in one.
const BATCH: usize = 8;
/// Simulated time for which a pulled plug stays pulled at least: the boards notice it.
const PULLED_NS: u64 = 20_000_000;
/// Simulated time within which the stops of a client that is gone leave.
const MOST_LEAVING_NS: u64 = 200_000_000;

#[derive(Clone, Copy, Debug)]
struct Waiting {
    frame: Frame,
    /// Earliest instant at which the client may have sent the frame.
    since: Instant,
    is_stop: bool,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Plug {
    In,
    /// The client is gone, its stops leave.
    Leaving {
        since_ns: u64,
    },
    Out {
        since_ns: u64,
    },
}

/// Frames of clients that were not carried out.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Dropped {
    /// Refused: the queue was full.
    pub refused: u64,
    /// Dropped for a stop while the queue was full.
    pub displaced: u64,
    /// Set-points that were too old.
    pub old: u64,
}

/// See the module.
#[derive(Debug)]
pub struct Adapter {
    queue: VecDeque<Waiting>,
    /// Length of the queue on the wire, and its limit.
    bits: u64,
    most_bits: u64,
    stops: usize,
    /// Frames at the head of the queue that the wire has been given.
    offered: usize,
    /// Frames at the head of the queue that are of a client that is gone.
    leaving: usize,
    plug: Plug,
    has_client: bool,
    dropped: Dropped,
}

impl Adapter {
    /// Plugged in, without a client, on a wire of this bit rate at this speed.
    #[must_use]
    pub fn new(bits_per_s: u64, speed: f64) -> Self {
        let most_bits = (bits_per_s as f64 * speed * MOST_AGE.as_secs_f64()) as u64;
        Self {
            queue: VecDeque::new(),
            bits: 0,
            most_bits: most_bits.max(LEAST_BITS),
            stops: 0,
            offered: 0,
            leaving: 0,
            plug: Plug::In,
            has_client: false,
            dropped: Dropped::default(),
        }
    }

    /// A client has opened the channel.
    pub fn opened(&mut self) {
        self.has_client = true;
    }

    /// The client has closed the channel or is gone: only its stops are still carried out.
    pub fn closed(&mut self, now_ns: u64) {
        self.has_client = false;
        if matches!(self.plug, Plug::Out { .. }) {
            // None of it can leave, and none of it is the next client's.
            self.queue.clear();
        }
        self.queue.retain(|waiting| waiting.is_stop);
        self.bits = self.queue.iter().map(|waiting| u64::from(bits(&waiting.frame))).sum();
        (self.stops, self.leaving) = (self.queue.len(), self.queue.len());
        if self.plug == Plug::In {
            self.plug = Plug::Leaving { since_ns: now_ns };
        }
    }

    /// Queues a frame that was sent at this instant or later; whether there is room.
    pub fn push(&mut self, frame: Frame, since: Instant, effect: Effect) -> bool {
        let (length, is_stop) = (u64::from(bits(&frame)), effect == Effect::Stop);
        while is_stop && self.bits + length > self.most_bits && self.stops < self.queue.len() {
            let Some(oldest) = self.queue.iter().position(|waiting| !waiting.is_stop) else { break };
            self.remove(oldest);
            self.dropped.displaced += 1;
        }
        if self.bits + length > self.most_bits {
            self.dropped.refused += 1;
            return false;
        }
        self.bits += length;
        self.stops += usize::from(is_stop);
        self.queue.push_back(Waiting { frame, since, is_stop });
        true
    }

    fn remove(&mut self, place: usize) {
        if let Some(waiting) = self.queue.remove(place) {
            self.bits -= u64::from(bits(&waiting.frame));
            self.stops -= usize::from(waiting.is_stop);
            self.leaving -= usize::from(place < self.leaving);
        }
    }

    /// One tick of the network, with the frames at the head of the queue.
    pub fn tick<const N: usize, const B: usize>(
        &mut self,
        network: &mut Network<N, B>,
        now: Instant,
        show: impl FnMut(&Sent),
    ) {
        self.turn_plug(network);
        self.offer(network, now);
        network.tick(show);
        for _ in network.waiting()..self.offered {
            self.remove(0);
        }
        network.recall();
        self.offered = 0;
    }

    fn turn_plug<const N: usize, const B: usize>(&mut self, network: &mut Network<N, B>) {
        let now_ns = network.now_ns();
        match self.plug {
            Plug::Leaving { since_ns } if self.leaving == 0 || now_ns - since_ns >= MOST_LEAVING_NS => {
                self.plug = Plug::Out { since_ns: now_ns };
                network.set_plugged(false);
            }
            Plug::Out { since_ns } if self.has_client && now_ns - since_ns >= PULLED_NS => {
                self.plug = Plug::In;
                network.set_plugged(true);
            }
            _ => {}
        }
    }

    /// Gives the wire what is at the head of the queue, but for set-points that are too old.
    fn offer<const N: usize, const B: usize>(&mut self, network: &mut Network<N, B>, now: Instant) {
        let most = match self.plug {
            Plug::In => BATCH,
            Plug::Leaving { .. } => BATCH.min(self.leaving),
            Plug::Out { .. } => 0,
        };
        while self.offered < most {
            let Some(waiting) = self.queue.get(self.offered).copied() else { break };
            let is_old = now.saturating_duration_since(waiting.since) > MOST_AGE;
            if is_old && network.effect(&waiting.frame) == Effect::SetPoint {
                self.remove(self.offered);
                self.dropped.old += 1;
                continue;
            }
            network.send(waiting.frame);
            self.offered += 1;
            if is_old {
                // What it changes may make a set-point of the next one.
                break;
            }
        }
    }

    /// Frames that wait.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.queue.len()
    }

    /// What was not carried out since this was asked last.
    pub fn take_dropped(&mut self) -> Dropped {
        std::mem::take(&mut self.dropped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tool::bus::serve::{ServeOptions, network};
    use crate::tool::leg_file::{DEFAULT_LEG, LegFile};

    const MS: Duration = Duration::from_millis(1);
    const TICKS_PER_MS: u32 = 4;

    struct Bench {
        network: Network<2, 13>,
        adapter: Adapter,
        now: Instant,
        /// Frames that were on the wire, the clients' (`true`) and the nodes'.
        sent: Vec<(bool, Frame)>,
    }

    impl Bench {
        fn new() -> Self {
            let options = ServeOptions {
                address: ([127, 0, 0, 1], 0).into(),
                legs: 1,
                speed: 1.0,
                flash: None,
                seed: 1,
                bits_per_s: 1_000_000,
            };
            let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
            let network = network(&leg, &options, None).expect("the default leg");
            let adapter = Adapter::new(1_000_000, 1.0);
            let mut bench = Self { network, adapter, now: Instant::now(), sent: Vec::new() };
            bench.adapter.opened();
            bench.run(5);
            assert!(bench.push(0, &[1, 0]));
            bench.run(5);
            bench.sent.clear();
            bench
        }

        fn run(&mut self, ms: u32) {
            for _ in 0..ms {
                self.now += MS;
                for _ in 0..TICKS_PER_MS {
                    let sent = &mut self.sent;
                    let show = |frame: &Sent| sent.push((frame.sender == 0, frame.frame));
                    self.adapter.tick(&mut self.network, self.now, show);
                }
            }
        }

        fn push(&mut self, id: u16, data: &[u8]) -> bool {
            let frame = Frame::new(id, data);
            let effect = self.network.effect(&frame);
            self.adapter.push(frame, self.now, effect)
        }

        /// Identifiers and first bytes of the client's frames that were on the wire, and no longer are.
        fn carried_out(&mut self) -> Vec<(u16, u8)> {
            let sent = std::mem::take(&mut self.sent);
            let clients = sent.iter().filter(|(is_clients, _)| *is_clients);
            clients.map(|(_, frame)| (frame.id(), frame.data().first().copied().unwrap_or(0))).collect()
        }
    }

    #[test]
    fn the_queue_holds_what_the_wire_carries_in_100_ms_and_no_more() {
        let mut bench = Bench::new();
        let taken = (0..10_000).filter(|_| bench.push(0x301, &[0x55; 4])).count();
        let length = f64::from(bits(&Frame::new(0x301, &[0x55; 4])));
        assert_eq!(taken, (100_000.0 / length) as usize);
        let refused = 10_000 - taken as u64;
        assert_eq!(bench.adapter.take_dropped(), Dropped { refused, ..Dropped::default() });
        // The wire carries them all while they are young; then there is room again.
        bench.run(101);
        assert_eq!((bench.carried_out().len(), bench.adapter.waiting()), (taken, 0));
        assert!(bench.push(0x301, &[0x55; 4]));
    }

    #[test]
    fn old_set_points_are_dropped_and_old_stops_are_carried_out() {
        let mut bench = Bench::new();
        for (id, data) in [
            (0x201, &[15, 0][..]),
            (0x80, &[]),
            (0x201, &[2, 0]),
            (0x301, &[1, 2, 3, 4]),
            (0x750, &[5]),
            (0, &[2, 1]),
        ] {
            assert!(bench.push(id, data));
        }
        bench.now += 101 * MS;
        bench.run(2);
        assert_eq!(bench.carried_out(), [(0x80, 0), (0x201, 2), (0x750, 5), (0, 2)]);
        assert_eq!(bench.adapter.take_dropped(), Dropped { old: 2, ..Dropped::default() });
        // Younger ones are carried out, whatever they do.
        assert!(bench.push(0x201, &[15, 0]));
        bench.now += 90 * MS;
        bench.run(2);
        assert_eq!(bench.carried_out(), [(0x201, 15)]);
    }

    #[test]
    fn an_old_start_makes_no_set_point_of_an_old_word_behind_it() {
        let mut bench = Bench::new();
        assert!(bench.push(0, &[128, 0]));
        bench.run(5);
        bench.carried_out();
        assert!(bench.push(0, &[1, 0]) && bench.push(0x201, &[15, 0]));
        bench.now += 101 * MS;
        bench.run(2);
        assert_eq!(bench.carried_out(), [(0, 1)]);
    }

    #[test]
    fn a_stop_finds_room_in_a_full_queue() {
        let mut bench = Bench::new();
        assert!((0..10_000).any(|_| !bench.push(0x301, &[0x55; 4])), "the queue has no bound");
        assert!(bench.push(0x201, &[0, 0]));
        let dropped = bench.adapter.take_dropped();
        assert_eq!(dropped, Dropped { refused: 1, displaced: 1, old: 0 });
        // Stops alone are bounded as well.
        let taken = (0..10_000).filter(|_| bench.push(0x201, &[0, 0])).count();
        assert!((1000..2000).contains(&taken), "{taken}");
        bench.run(101);
        assert!(bench.carried_out().iter().all(|(id, _)| *id == 0x201));
        assert_eq!(bench.adapter.waiting(), 0);
    }

    #[test]
    fn the_plug_is_pulled_once_a_gone_clients_stops_have_left() {
        let mut bench = Bench::new();
        for (id, data) in [(0x201, [15, 0]), (0x201, [0, 0]), (0x202, [0, 0])] {
            assert!(bench.push(id, &data));
        }
        bench.adapter.closed(bench.network.now_ns());
        // Another client opens the channel at once: its frames wait until the boards have noticed.
        bench.adapter.opened();
        assert!(bench.push(0x601, &[0x40, 0x03, 0x10, 1, 0, 0, 0, 0]));
        bench.run(10);
        assert_eq!(bench.carried_out(), [(0x201, 0), (0x202, 0)]);
        bench.run(30);
        let told: Vec<(u16, u16)> = bench
            .sent
            .iter()
            .filter(|(is_clients, frame)| !is_clients && (0x81..0x100).contains(&frame.id()))
            .map(|(_, frame)| (frame.id(), u16::from_le_bytes([frame.data()[0], frame.data()[1]])))
            .collect();
        // Told once the plug is back, and over then.
        for node in [0x81, 0x82] {
            let codes: Vec<u16> = told.iter().filter(|(id, _)| *id == node).map(|(_, code)| *code).collect();
            assert_eq!(codes, [0x8120, 0], "{told:x?}");
        }
        let answer = bench.sent.iter().find(|(_, frame)| frame.id() == 0x581).expect("an answer");
        assert_eq!(answer.1.data()[4..6], [0x20, 0x81]);
    }
}
