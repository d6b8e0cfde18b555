//! Several legs and a host on one CAN bus.

use scarab::bus::Frame;
use scarab_client::wire::{Mailbox, Sent, Wire};

use crate::bus::board::{Board, TICK_NS};
use crate::bus::effect::Effect;
use crate::faulty_board::Rig;

/// All participants of one bus.
#[derive(Clone, Debug)]
pub struct Network<const N: usize, const B: usize> {
    boards: Vec<Board<N, B>>,
    /// Queue of the host's adapter.
    host: Mailbox,
    /// Frame that a faulty node sends continuously, and its mailbox.
    babble: Option<Frame>,
    babbler: Mailbox,
    wire: Wire,
    now_ns: u64,
}

impl<const N: usize, const B: usize> Network<N, B> {
    /// Connects the boards by a bus of this bit rate.
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

    /// Sends a frame of the host.
    pub fn send(&mut self, frame: Frame) {
        self.host.push(frame, self.now_ns);
    }

    /// Sends a frame of the host at a future instant.
    pub fn send_at(&mut self, frame: Frame, at_ns: u64) {
        self.host.push(frame, at_ns);
    }

    /// Removes the host's frames that are not on the wire yet.
    pub(crate) fn recall(&mut self) {
        self.host.clear();
    }

    /// Connects or disconnects the bus plug of every board.
    pub(crate) fn set_plugged(&mut self, plugged: bool) {
        for board in &mut self.boards {
            board.set_plugged(plugged);
        }
    }

    /// Effect that a frame of the host would have on its nodes now.
    pub(crate) fn effect(&self, frame: &Frame) -> Effect {
        Effect::from_frame(frame, self.boards.iter().flat_map(|board| board.nodes()), self.now_ns / 1000)
    }

    /// Sets the frame that a faulty node sends as often as the bus allows; `None` stops it.
    pub(crate) fn babble(&mut self, frame: Option<Frame>) {
        self.babble = frame;
        self.babbler.clear();
    }

    /// Number of the host's frames not sent yet.
    pub fn waiting(&self) -> usize {
        self.host.len()
    }

    /// Simulates one servo tick of all legs and the bus. Every frame is shown, also the host's (`sender` 0).
    pub fn tick(&mut self, show: impl FnMut(&Sent)) {
        self.tick_watched(show, |_| {});
    }

    /// Like [`Self::tick`]; every PWM period of every leg is shown as well.
    pub(crate) fn tick_watched(&mut self, mut show: impl FnMut(&Sent), mut watch: impl FnMut(&Rig<N, B>)) {
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
            for (index, board) in self.boards.iter_mut().enumerate() {
                if sent.sender == 1 + index {
                    board.sent(sent.end_ns);
                } else {
                    board.receive(&sent.frame, sent.end_ns);
                }
            }
            show(&sent);
        }
        self.now_ns = end_ns;
    }

    /// Simulated time.
    pub fn now_ns(&self) -> u64 {
        self.now_ns
    }

    /// Returns the boards.
    pub fn boards(&mut self) -> &mut [Board<N, B>] {
        &mut self.boards
    }

    /// Returns the bus.
    pub fn wire(&self) -> &Wire {
        &self.wire
    }
}
