//! Adapter between port and bus: a bounded queue of a client's frames, and the bus plug of the boards.
//!
//! ```text
//! capacity              what the bus carries in 100 ms of the clock; further frames are refused
//! older than 100 ms     a set-point (`Effect::SetPoint`) is dropped; other frames are still sent
//! full, and a stop      displaces the oldest frame that is not a stop, else the older stop that it
//!                       supersedes, else it is queued beyond the capacity
//! the client ends       its set-points are dropped, its stops sent, then every board is disconnected
//! ```

use std::collections::VecDeque;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab_client::wire::{Sent, bits};

use crate::bus::effect::Effect;
use crate::bus::network::Network;

/// Maximum age of a set-point; also the capacity of the queue in bus time.
pub(crate) const MOST_AGE: Duration = Duration::from_millis(100);
/// Least capacity in bits, independent of speed and bit rate.
const LEAST_BITS: u64 = 16 * 135;
/// Frames passed to the bus per tick; more than it can carry in one.
const BATCH: usize = 8;
/// Least simulated time of a disconnection, so that the boards detect it.
const PULLED_NS: u64 = 20_000_000;
/// Simulated time within which a former client's stops are sent.
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
    /// The client has disconnected; its stops are being sent.
    Leaving {
        since_ns: u64,
    },
    Out {
        since_ns: u64,
    },
}

/// Client frames that were not sent.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(crate) struct Dropped {
    /// Refused because the queue was full.
    pub(crate) refused: u64,
    /// Displaced by a stop while the queue was full; an older stop only by a newer one of its kind.
    pub(crate) displaced: u64,
    /// Set-points that were too old.
    pub(crate) old: u64,
}

/// Whether a stop makes an older one superfluous: the same NMT command, object or PDO of the same node.
fn supersedes(newer: &Frame, older: &Frame) -> bool {
    let part = |frame: &Frame| match frame.id() {
        0 => frame.data().to_vec(),
        0x601..=0x67F => frame.data().iter().copied().take(4).collect(),
        _ => Vec::new(),
    };
    newer.id() == older.id() && part(newer) == part(older)
}

/// Queue of one client at a time, and the plug of the boards; see the module.
#[derive(Debug)]
pub(crate) struct Adapter {
    queue: VecDeque<Waiting>,
    /// Bits of the queued frames, and the limit.
    bits: u64,
    most_bits: u64,
    stops: usize,
    /// Frames at the head of the queue that were passed to the bus.
    offered: usize,
    /// Frames at the head of the queue that belong to a former client.
    leaving: usize,
    plug: Plug,
    has_client: bool,
    dropped: Dropped,
}

impl Adapter {
    /// Creates an adapter, plugged in and without a client.
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

    /// The client has opened the channel.
    pub(crate) fn opened(&mut self) {
        self.has_client = true;
    }

    /// The client has closed the channel or disconnected. Only its stops are still sent.
    pub(crate) fn closed(&mut self, now_ns: u64) {
        self.has_client = false;
        if matches!(self.plug, Plug::Out { .. }) {
            // These frames cannot be sent any more, and must not be sent for the next client.
            self.queue.clear();
        }
        self.queue.retain(|waiting| waiting.is_stop);
        self.bits = self.queue.iter().map(|waiting| u64::from(bits(&waiting.frame))).sum();
        (self.stops, self.leaving) = (self.queue.len(), self.queue.len());
        if self.plug == Plug::In {
            self.plug = Plug::Leaving { since_ns: now_ns };
        }
    }

    /// Queues a frame sent at `since` or later. Returns whether it fits.
    pub(crate) fn push(&mut self, frame: Frame, since: Instant, effect: Effect) -> bool {
        let (length, is_stop) = (u64::from(bits(&frame)), effect == Effect::Stop);
        while is_stop && self.bits + length > self.most_bits && self.stops < self.queue.len() {
            let Some(oldest) = self.queue.iter().position(|waiting| !waiting.is_stop) else { break };
            self.remove(oldest);
            self.dropped.displaced += 1;
        }
        if is_stop && self.bits + length > self.most_bits {
            // A stop from a host is never refused. There are few kinds of stops, so the queue stays bounded.
            if let Some(older) = self.queue.iter().position(|waiting| supersedes(&frame, &waiting.frame)) {
                self.remove(older);
                self.dropped.displaced += 1;
            }
        } else if self.bits + length > self.most_bits {
            self.dropped.refused += 1;
            return false;
        }
        self.bits += length;
        self.stops += usize::from(is_stop);
        self.queue.push_back(Waiting { frame, since, is_stop });
        true
    }

    fn remove(&mut self, index: usize) {
        if let Some(waiting) = self.queue.remove(index) {
            self.bits -= u64::from(bits(&waiting.frame));
            self.stops -= usize::from(waiting.is_stop);
            self.leaving -= usize::from(index < self.leaving);
        }
    }

    /// Simulates one tick of the network, with the frames at the head of the queue.
    pub(crate) fn tick<const N: usize, const B: usize>(
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

    /// Passes the frames at the head of the queue to the bus, except set-points that are too old.
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
                // Its effect may turn the next frame into a set-point.
                break;
            }
        }
    }

    /// Frames not sent since the last call.
    pub(crate) fn take_dropped(&mut self) -> Dropped {
        std::mem::take(&mut self.dropped)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::bus::serve::{ServeOptions, network};
    use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

    const MS: Duration = Duration::from_millis(1);
    const TICKS_PER_MS: u32 = 4;

    struct Bench {
        network: Network<2, 13>,
        adapter: Adapter,
        now: Instant,
        /// Frames on the wire; `true` for a client's.
        sent: Vec<(bool, Frame)>,
    }

    impl Bench {
        fn new() -> Self {
            let options = ServeOptions::local(1);
            let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
            let network = network(&leg, &options, None, &[]).expect("the default leg");
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

        /// COB-IDs and first bytes of the client's frames sent since the last call.
        fn carried_out(&mut self) -> Vec<(u16, u8)> {
            let sent = std::mem::take(&mut self.sent);
            let clients = sent.iter().filter(|(is_clients, _)| *is_clients);
            clients.map(|(_, frame)| (frame.id(), frame.data().first().copied().unwrap_or(0))).collect()
        }
    }

    #[test]
    fn the_queue_holds_100_ms_of_bus_time() {
        let mut bench = Bench::new();
        let taken = (0..10_000).filter(|_| bench.push(0x301, &[0x55; 4])).count();
        let length = f64::from(bits(&Frame::new(0x301, &[0x55; 4])));
        assert_eq!(taken, (100_000.0 / length) as usize);
        let refused = 10_000 - taken as u64;
        assert_eq!(bench.adapter.take_dropped(), Dropped { refused, ..Dropped::default() });
        // All are sent while they are young; then the queue accepts frames again.
        bench.run(101);
        assert_eq!((bench.carried_out().len(), bench.adapter.queue.len()), (taken, 0));
        assert!(bench.push(0x301, &[0x55; 4]));
    }

    #[test]
    fn old_set_points_are_dropped_and_old_stops_are_sent() {
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
        // Younger frames are sent, whatever their effect.
        assert!(bench.push(0x201, &[15, 0]));
        bench.now += 90 * MS;
        bench.run(2);
        assert_eq!(bench.carried_out(), [(0x201, 15)]);
    }

    #[test]
    fn an_old_controlword_behind_an_old_start_is_dropped() {
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
    fn a_stop_displaces_another_frame_in_a_full_queue() {
        let mut bench = Bench::new();
        assert!((0..10_000).any(|_| !bench.push(0x301, &[0x55; 4])), "the queue is unbounded");
        assert!(bench.push(0x201, &[0, 0]));
        let dropped = bench.adapter.take_dropped();
        assert_eq!(dropped, Dropped { refused: 1, displaced: 1, old: 0 });
        // A stop is never refused, and the queue stays bounded.
        for number in 0..10_000_u32 {
            let [low, high, ..] = (number << 4).to_le_bytes();
            assert!(bench.push(0x201, &[low, high]) && bench.push(0, &[2, (number % 128) as u8]));
        }
        assert!((1000..2000).contains(&bench.adapter.queue.len()), "{}", bench.adapter.queue.len());
        for (id, data) in [(0x202, &[0, 0][..]), (0x601, &[0x2B, 0x40, 0x60, 0, 0, 0, 0, 0])] {
            assert!(bench.push(id, data), "{id:x}");
        }
        // Other frames are.
        assert!(!bench.push(0x301, &[0x55; 4]));
        bench.run(150);
        let sent = bench.carried_out();
        assert_eq!(sent[sent.len() - 2..], [(0x202, 0), (0x601, 0x2B)]);
        assert_eq!(bench.adapter.queue.len(), 0);
    }

    #[test]
    fn boards_are_disconnected_after_a_former_clients_stops() {
        let mut bench = Bench::new();
        for (id, data) in [(0x201, [15, 0]), (0x201, [0, 0]), (0x202, [0, 0])] {
            assert!(bench.push(id, &data));
        }
        bench.adapter.closed(bench.network.now_ns());
        // Another client opens the channel at once; its frames wait until the boards have detected the
        // disconnection.
        bench.adapter.opened();
        assert!(bench.push(0x601, &[0x40, 0x03, 0x10, 1, 0, 0, 0, 0]));
        bench.run(10);
        assert_eq!(bench.carried_out(), [(0x201, 0), (0x202, 0)]);
        bench.run(30);
        let sent: Vec<(u16, u16)> = bench
            .sent
            .iter()
            .filter(|(is_clients, frame)| !is_clients && (0x81..0x100).contains(&frame.id()))
            .map(|(_, frame)| (frame.id(), u16::from_le_bytes([frame.data()[0], frame.data()[1]])))
            .collect();
        // The error is reported when the plug is back, and ends then.
        for node in [0x81, 0x82] {
            let codes: Vec<u16> = sent.iter().filter(|(id, _)| *id == node).map(|(_, code)| *code).collect();
            assert_eq!(codes, [0x8120, 0], "{sent:x?}");
        }
        let answer = bench.sent.iter().find(|(_, frame)| frame.id() == 0x581).expect("an answer");
        assert_eq!(answer.1.data()[4..6], [0x20, 0x81]);
    }
}
