//! One CANopen node: frames and time in, frames out; no clock and no hardware.
//!
//! ```text
//! on_frame(frame, now_us)  handles NMT, SYNC, SDO, LSS, heartbeats of others, received PDOs; sends nothing
//! poll(now_us)             returns the next frame to send, until there is none
//!                          order: boot-up, emergency, heartbeat, LSS, PDO, SDO
//! ```
//!
//! Two nodes run on one board and share only the frames. Cost of one call: an SDO request searches the table
//! once. A received PDO writes at most eight objects. A poll reads the objects of the PDOs that are due. The
//! number of iterations never depends on the content of a frame. Memory: docs/results/bus.md.
//!
//! Source: CiA 301 version 4.2. Not implemented: RTR, node guarding, TIME, NMT master, SYNC producer.

use super::access::Dictionary;
use super::communication::{Communication, Identity};
use super::emergency::{ErrorReport, Source};
use super::heartbeat::Change;
use super::lss::{self, Lss, Setting};
use super::nmt::{self, Command, NmtState, Reset};
use super::node_id::NodeId;
use super::objects::{Lost, Objects};
use super::pdo::PDOS;
use super::pdo::receive::{Receive, Received};
use super::sdo::Server;
use super::silence::{Kind, Silence};
use crate::hal::{Controller, Frame};
use crate::leg::{FaultCode, NoticeCode};

impl Controller {
    fn error(self) -> Option<ErrorReport> {
        let code = match self {
            Self::Active => return None,
            Self::Overrun => NoticeCode::Overrun.number(),
            Self::Passive => FaultCode::BusPassive.number(),
            Self::Off => FaultCode::BusOff.number(),
        };
        Some(ErrorReport::code(code))
    }
}

/// State of storing parameters.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Storing {
    /// Idle; the last store operation succeeded.
    Done,
    /// The flash is about to be written. The node may be silent for seconds, heartbeats included.
    Busy,
    /// The last store operation failed.
    Failed,
}

impl Storing {
    fn error(self) -> Option<ErrorReport> {
        let code = match self {
            Self::Done => return None,
            Self::Busy => NoticeCode::Storing,
            Self::Failed => NoticeCode::StoreFailed,
        };
        Some(ErrorReport::code(code.number()))
    }
}

/// Result of a received frame.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum FrameEffect {
    /// Not addressed to this node, or a heartbeat in time.
    Nothing,
    /// The node's state may have changed; poll it.
    Something,
    /// The node was reset; its stored parameters of that extent must be recalled.
    Reset(Reset),
}

/// One CANopen node.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Node {
    communication: Communication,
    server: Server,
    lss: Lss,
    /// Next PDO to check; round robin, so that no PDO starves.
    next_pdo: usize,
    /// Extent of the reset since the last boot-up message.
    pending_reset: Option<Reset>,
}

impl Node {
    /// Creates a node that has not sent its boot-up message.
    pub fn new(node: NodeId, identity: Identity) -> Self {
        Self {
            communication: Communication::new(node, identity),
            server: Server::IDLE,
            lss: Lss::default(),
            next_pdo: 0,
            pending_reset: None,
        }
    }

    /// Returns the node-ID.
    pub const fn id(&self) -> NodeId {
        self.communication.node
    }

    pub(super) const fn communication_mut(&mut self) -> &mut Communication {
        &mut self.communication
    }

    /// Returns the NMT state.
    pub const fn state(&self) -> NmtState {
        self.communication.state
    }

    /// Handles a received frame.
    pub fn on_frame<O: Objects>(&mut self, frame: &Frame, now_us: u64, objects: &mut O) -> FrameEffect {
        let node = self.communication.node;
        match frame.id() {
            nmt::COMMAND => {
                match nmt::command(frame.data(), node.number()) {
                    None => return FrameEffect::Nothing,
                    // A node that has not sent its boot-up message since is still reset.
                    Some(Command::Reset(reset)) if self.pending_reset >= Some(reset) => {
                        return FrameEffect::Nothing;
                    }
                    Some(Command::Reset(reset)) => {
                        self.apply_command(Command::Reset(reset), objects);
                        return FrameEffect::Reset(reset);
                    }
                    Some(command) => self.apply_command(command, objects),
                }
            }
            lss::REQUEST => match frame.full() {
                Some(request) => self.set_layer(request, objects),
                None => return FrameEffect::Nothing,
            },
            id if u32::from(id) == self.communication.sync => self.synchronise(frame, now_us, objects),
            id if id == node.on(0x600) => {
                if let (true, Some(request)) = (self.communication.state.serves(), frame.full()) {
                    if matches!(request, [0x20..=0x3F, 0x40, 0x60, 0, ..]) {
                        self.receive_cycle(Kind::Word, now_us);
                    }
                    let mut dictionary = Dictionary { communication: &mut self.communication, objects };
                    self.server.request(request, now_us, &mut dictionary);
                }
            }
            id @ 0x701..=0x77F => {
                let mut received = FrameEffect::Nothing;
                for index in 0..self.communication.consumers.len() {
                    let consumer = self.communication.consumers.get_mut(index);
                    let change = consumer.and_then(|consumer| consumer.received((id & 0x7F) as u8, now_us));
                    if change.is_some() {
                        received = FrameEffect::Something;
                    }
                    self.watch(index as u8, change, objects);
                }
                return received;
            }
            id => return self.receive(id, frame, now_us, objects),
        }
        FrameEffect::Something
    }

    /// Returns the next frame to send. Call it until it returns `None`.
    pub fn poll<O: Objects>(&mut self, now_us: u64, objects: &mut O) -> Option<Frame> {
        let node = self.communication.node;
        if self.communication.state == NmtState::Initialising {
            self.communication.state = NmtState::PreOperational;
            self.pending_reset = None;
            return Some(Frame::new(node.on(nmt::HEARTBEAT), &[0]));
        }
        self.check_timeouts(now_us, objects);
        let communication = &mut self.communication;
        // A stopped node holds its emergency messages back until it leaves the state.
        let emergency =
            if communication.state.serves() { communication.emergency.poll(now_us) } else { None };
        if emergency.is_some() {
            return emergency;
        }
        if communication.heartbeat.is_due(1000 * u64::from(communication.heartbeat_ms), now_us) {
            return Some(Frame::new(node.on(nmt::HEARTBEAT), &[communication.state as u8]));
        }
        if let Some(answer) = self.lss.take_answer() {
            return Some(Frame::new(lss::ANSWER, &answer));
        }
        let pdo = self.transmit(now_us, objects);
        if pdo.is_some() {
            return pdo;
        }
        let mut dictionary = Dictionary { communication: &mut self.communication, objects };
        let answer = self.server.poll(now_us, &mut dictionary)?;
        Some(Frame::new(node.on(0x580), &answer))
    }

    /// Whether a frame is this node's emergency or boot-up message, which is sent only once.
    pub(super) fn reports_once(&self, frame: &Frame) -> bool {
        let Communication { node, emergency, .. } = &self.communication;
        u32::from(frame.id()) == emergency.identifier
            || frame.id() == node.on(nmt::HEARTBEAT) && frame.data() == [0]
    }

    /// Handles a change of the CAN controller's state.
    pub(crate) fn on_controller<O: Objects>(&mut self, controller: Controller, objects: &mut O) {
        match controller {
            Controller::Active => {}
            Controller::Passive => self.lose(Lost::Bus(false), objects),
            // The lost frame may have been a stop command.
            Controller::Off | Controller::Overrun => self.lose(Lost::Bus(true), objects),
        }
        self.communication.emergency.set(Source::Controller, controller.error());
    }

    /// Handles the drive's error after a tick of the leg.
    pub(super) fn on_drive(&mut self, error: Option<ErrorReport>) {
        self.communication.emergency.set(Source::Drive, error);
    }

    /// Handles a change of the store's state.
    pub(crate) fn on_store(&mut self, storing: Storing) {
        self.communication.emergency.set(Source::Store, storing.error());
    }

    /// Handles the begin of a store, or of one of the defaults.
    pub(super) fn store_begins(&mut self, of_defaults: bool) {
        self.lss.store_begins(of_defaults);
    }

    /// Handles the outcome of a store request.
    pub(super) fn stored(&mut self, is_done: bool) {
        self.lss.stored(is_done);
    }

    /// Restores the board's conditions after a reset, so that hosts receive their messages again.
    pub(super) fn goes_on(&mut self, controller: Controller, storing: Storing) {
        self.communication.emergency.set(Source::Controller, controller.error());
        self.on_store(storing);
    }

    fn apply_command<O: Objects>(&mut self, command: Command, objects: &mut O) {
        let Communication { node, identity, state, .. } = self.communication;
        match command {
            Command::Go(next) if next == state || state == NmtState::Initialising => {}
            Command::Go(next) => {
                self.communication.state = next;
                if state == NmtState::Operational || next == NmtState::Stopped {
                    self.lose(Lost::Stopped, objects);
                }
                if next == NmtState::Stopped {
                    self.server = Server::IDLE;
                }
                self.communication.silence = Silence::default();
                for receive in &mut self.communication.receive {
                    receive.stop();
                }
                for transmit in &mut self.communication.transmit {
                    transmit.restart();
                }
            }
            Command::Reset(reset) => {
                self.lose(Lost::Reset, objects);
                if reset == Reset::Node {
                    objects.reset();
                }
                if self.pending_reset.is_none() {
                    *self = Self::new(node, identity);
                }
                self.pending_reset = Some(reset);
            }
        }
    }

    /// Handles a request of the layer setting services.
    fn set_layer<O: Objects>(&mut self, request: [u8; 8], objects: &mut O) {
        let Communication { node, identity, .. } = &self.communication;
        match self.lss.request(request, identity, *node) {
            Some(Setting::Write(object, value)) => self.lss.written(objects.write(object, value).is_ok()),
            Some(Setting::Store) if objects.store(false).is_err() => self.lss.refused(),
            Some(Setting::Store) | None => {}
        }
    }

    /// Notes a frame that a host may send in every cycle.
    fn receive_cycle(&mut self, kind: Kind, now_us: u64) {
        self.communication.silence.received(kind, now_us);
        self.communication.emergency.set(Source::Silence, None);
    }

    fn synchronise<O: Objects>(&mut self, frame: &Frame, now_us: u64, objects: &mut O) {
        if self.communication.state != NmtState::Operational {
            return;
        }
        let counter = match (self.communication.sync_overflow, frame.data()) {
            (0, _) => None,
            (overflow, &[counter]) if (1..=overflow).contains(&counter) => Some(counter),
            (_, [_]) => return,
            _ => {
                let report = ErrorReport::code(NoticeCode::SyncLength.number());
                return self.communication.emergency.set(Source::Sync, Some(report));
            }
        };
        self.receive_cycle(Kind::Sync, now_us);
        self.communication.emergency.set(Source::Sync, None);
        for index in 0..PDOS {
            if self.communication.receive.get_mut(index).is_some_and(|receive| receive.at_sync(now_us)) {
                self.apply_received(index, now_us, objects);
            }
        }
        objects.synchronise();
        // The statusword is sent first.
        self.next_pdo = 0;
        for transmit in &mut self.communication.transmit {
            transmit.at_sync(counter);
        }
    }

    fn receive<O: Objects>(&mut self, id: u16, frame: &Frame, now_us: u64, objects: &mut O) -> FrameEffect {
        if self.communication.state != NmtState::Operational {
            return FrameEffect::Nothing;
        }
        let mut found = self.communication.receive.iter_mut().enumerate();
        let Some((index, receive)) = found.find(|(_, pdo)| pdo.parameters.identifier() == Some(id)) else {
            return FrameEffect::Nothing;
        };
        let received = receive.take(frame, now_us);
        match received {
            Received::Now => self.apply_received(index, now_us, objects),
            // Values that wait for a SYNC command nothing yet, and those of a short frame never do.
            Received::AtSync => {}
            Received::TooShort => {
                let error = ErrorReport::code(NoticeCode::ShortPdo.number());
                self.communication.emergency.set(Source::Receive(index as u8), Some(error));
            }
        }
        FrameEffect::Something
    }

    /// Handles a received PDO whose values are valid now.
    fn apply_received<O: Objects>(&mut self, index: usize, now_us: u64, objects: &mut O) {
        self.receive_cycle(Kind::Receive(index as u8), now_us);
        self.communication.emergency.set(Source::Receive(index as u8), None);
        self.write_received(index, objects);
    }

    /// Writes the objects of a received PDO. An object that rejects its value keeps the old one.
    fn write_received<O: Objects>(&mut self, index: usize, objects: &mut O) {
        let found = self.communication.receive.get(index);
        let Some(receive) = found.filter(|receive| !receive.is_void()) else { return };
        let (parameters, data) = (receive.parameters, receive.data());
        let mut bytes = data.into_iter();
        for mapped in parameters.mapped() {
            let mut value = [0; 4];
            for (slot, byte) in value.iter_mut().zip(bytes.by_ref().take(usize::from(mapped.size))) {
                *slot = byte;
            }
            if !mapped.is_dummy() {
                // The host sees the old value of an object that it maps to be sent.
                let _ = objects.write_mapped(mapped.object, u32::from_le_bytes(value));
            }
        }
    }

    fn transmit<O: Objects>(&mut self, now_us: u64, objects: &mut O) -> Option<Frame> {
        if self.communication.state != NmtState::Operational {
            return None;
        }
        for _ in 0..PDOS {
            let index = self.next_pdo;
            self.next_pdo = (index + 1) % PDOS;
            let transmit = self.communication.transmit.get_mut(index)?;
            if !transmit.is_wanted(now_us) {
                continue;
            }
            let parameters = transmit.parameters;
            let dictionary = Dictionary { communication: &mut self.communication, objects: &mut *objects };
            let mut data = [0; 8];
            let mut free = data.iter_mut();
            for mapped in parameters.mapped() {
                let bytes = dictionary.value(mapped.object).unwrap_or(0).to_le_bytes();
                for (to, from) in free.by_ref().take(usize::from(mapped.size)).zip(bytes) {
                    *to = from;
                }
            }
            let transmit = self.communication.transmit.get_mut(index)?;
            if let Some(frame) = transmit.frame(data, now_us) {
                return Some(frame);
            }
        }
        None
    }

    /// Checks all timeouts; [`Node::poll`] does so too.
    pub(crate) fn check_timeouts<O: Objects>(&mut self, now_us: u64, objects: &mut O) {
        for index in 0..self.communication.consumers.len() {
            let consumer = self.communication.consumers.get_mut(index);
            let change = consumer.and_then(|consumer| consumer.poll(now_us));
            self.watch(index as u8, change, objects);
        }
        for index in 0..PDOS {
            if self.communication.receive.get_mut(index).is_some_and(|pdo| pdo.is_missed(now_us)) {
                let late = ErrorReport::code(FaultCode::LatePdo.number());
                self.communication.emergency.set(Source::Receive(index as u8), Some(late));
                self.fail(Lost::ReceivedPdo, objects);
            }
        }
        self.check_silence(now_us, objects);
    }

    fn check_silence<O: Objects>(&mut self, now_us: u64, objects: &mut O) {
        if self.communication.silence.begins(now_us) && objects.misses_host() {
            let silent = ErrorReport::code(FaultCode::HostSilent.number());
            self.communication.emergency.set(Source::Silence, Some(silent));
            self.fail(Lost::Silent, objects);
        }
    }

    /// Restarts all timeouts after the board could not receive, as while it writes its flash. The hosts are
    /// not at fault for that time.
    pub(crate) fn stood_still(&mut self, now_us: u64) {
        self.communication.consumers.iter_mut().for_each(|consumer| consumer.wait(now_us));
        self.communication.receive.iter_mut().for_each(|pdo| pdo.wait(now_us));
        self.communication.silence.wait(now_us);
        self.server.wait(now_us);
    }

    fn watch<O: Objects>(&mut self, consumer: u8, change: Option<Change>, objects: &mut O) {
        let Some(change) = change else { return };
        let lost = ErrorReport::code(FaultCode::Heartbeat.number());
        let error = (change == Change::Lost).then_some(lost);
        self.communication.emergency.set(Source::Heartbeat(consumer), error);
        if change == Change::Lost {
            self.fail(Lost::Heartbeat, objects);
        }
    }

    /// Makes values void that wait for a SYNC, because the session ends in which they were sent.
    pub(super) fn void_waiting(&mut self) {
        self.communication.receive.iter_mut().for_each(Receive::void);
    }

    /// Reacts to a lost host.
    fn lose<O: Objects>(&mut self, why: Lost, objects: &mut O) {
        self.void_waiting();
        objects.lost(why);
    }

    /// Stops the drive by its option code and changes the NMT state by 1029:1.
    fn fail<O: Objects>(&mut self, why: Lost, objects: &mut O) {
        self.lose(why, objects);
        match (self.communication.on_error, self.communication.state) {
            (0, NmtState::Operational) => self.apply_command(Command::Go(NmtState::PreOperational), objects),
            (2, _) => self.apply_command(Command::Go(NmtState::Stopped), objects),
            _ => {}
        }
    }
}

#[cfg(test)]
mod tests;
