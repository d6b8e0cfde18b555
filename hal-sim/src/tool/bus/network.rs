//! Legs, one wire, and a host on it.

use scarab::bus::Frame;

use super::board::{Board, TICK_NS};
use super::effect::Effect;
use super::wire::{Mailbox, Sent, Wire};
use crate::tool::faults::rig::Rig;

/// Everything on one bus.
#[derive(Clone, Debug)]
pub struct Network<const N: usize, const B: usize> {
    boards: Vec<Board<N, B>>,
    /// Of the host's adapter.
    host: Mailbox,
    /// A node that always has this to send, and its controller.
    babble: Option<Frame>,
    babbler: Mailbox,
    wire: Wire,
    now_ns: u64,
}

impl<const N: usize, const B: usize> Network<N, B> {
    /// These boards on a wire of this bit rate.
    #[must_use]
    pub fn new(boards: Vec<Board<N, B>>, bits_per_s: u64) -> Self {
        Self {
            boards,
            host: Mailbox::in_order(),
            babble: None,
            babbler: Mailbox::default(),
            wire: Wire::new(bits_per_s),
            now_ns: 0,
        }
    }

    /// A frame of the host's.
    pub fn send(&mut self, frame: Frame) {
        self.host.push(frame, self.now_ns);
    }

    /// A frame of the host's that is to leave at an instant to come.
    pub fn send_at(&mut self, frame: Frame, at_ns: u64) {
        self.host.push(frame, at_ns);
    }

    /// Takes back the host's frames that are not on the wire.
    pub fn recall(&mut self) {
        self.host.clear();
    }

    /// Pulls the plug of every board, or puts it back.
    pub fn set_plugged(&mut self, plugged: bool) {
        for board in &mut self.boards {
            board.set_plugged(plugged);
        }
    }

    /// What a frame of the host's would do at its nodes now.
    #[must_use]
    pub fn effect(&self, frame: &Frame) -> Effect {
        Effect::of(frame, self.boards.iter().flat_map(|board| board.nodes()), self.now_ns / 1000)
    }

    /// From now on another node sends this as often as the wire lets it; or no longer does.
    pub fn babble(&mut self, frame: Option<Frame>) {
        self.babble = frame;
        self.babbler.clear();
    }

    /// Frames of the host's that have not been sent yet.
    #[must_use]
    pub fn waiting(&self) -> usize {
        self.host.len()
    }

    /// One servo tick of all legs and what the wire carries in it; every frame is shown, the host's (`sender` 0) as well.
    pub fn tick(&mut self, show: impl FnMut(&Sent)) {
        self.tick_watched(show, |_| {});
    }

    /// The same; every PWM period of every leg is shown as well.
    pub fn tick_watched(&mut self, mut show: impl FnMut(&Sent), mut watch: impl FnMut(&Rig<N, B>)) {
        let now_ns = self.now_ns;
        self.boards.iter_mut().for_each(|board| board.tick(now_ns, &mut watch));
        let end_ns = now_ns + TICK_NS;
        let mut now_ns = now_ns;
        loop {
            if let Some(frame) = self.babble.filter(|_| self.babbler.is_empty()) {
                self.babbler.push(frame, now_ns);
            }
            let nodes = self.boards.iter_mut().map(Board::mailbox);
            let mut mailboxes: Vec<&mut Mailbox> = core::iter::once(&mut self.host).chain(nodes).collect();
            mailboxes.push(&mut self.babbler);
            let Some(sent) = self.wire.advance(end_ns, &mut mailboxes) else { break };
            now_ns = now_ns.max(sent.end_ns);
            for (place, board) in self.boards.iter_mut().enumerate() {
                if sent.sender == 1 + place {
                    board.sent(sent.end_ns);
                } else {
                    board.hear(&sent.frame, sent.end_ns);
                }
            }
            show(&sent);
        }
        self.now_ns = end_ns;
    }

    /// Simulated so far.
    #[must_use]
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// The legs.
    pub fn boards(&mut self) -> &mut [Board<N, B>] {
        &mut self.boards
    }

    /// The wire.
    #[must_use]
    pub fn wire(&self) -> &Wire {
        &self.wire
    }
}
