//! Level 1: the servo's side of the bus: newest commands in, at most one request, and what came of the tick out.
//!
//! Orders are taken in every tick; the leg tells in every second one, as soon as the bus has taken what it was told before.

use crate::bus::station::{LegOrder, LegRequest, LegTold};
use crate::leg::{ControlRequest, DriveState, Fault, JointCommand, Plan, PowerRequest};

/// Ticks between two of which the bus is told: 2 kHz, twice the fastest cycle that fits the wire.
const TICKS: u32 = 2;

/// What it needs of a board. Every method answers at once.
pub trait HostBoard<const N: usize> {
    /// The next order.
    fn order(&mut self) -> Option<LegOrder<N>>;
    /// The bus has taken what it was told before.
    fn takes_told(&self) -> bool;
    /// What came of the tick.
    fn tell(&mut self, told: LegTold<N>);
    /// The bus runs as soon as the servo is done.
    fn pend(&mut self);
    /// The operator lets the leg be enabled.
    fn held(&self) -> bool;
    /// Nothing forbids to enable.
    fn is_clear(&self) -> bool;
}

/// A request and, where it begins an identification, its plan and seed.
pub type HostRequest<const N: usize> = (ControlRequest<N>, Option<(Plan, u64)>);

/// What the servo remembers of the bus.
#[derive(Debug)]
pub struct HostSide<P, const N: usize> {
    /// What it was made with.
    pub board: P,
    commands: Option<[JointCommand; N]>,
    request: Option<LegRequest>,
    cancel: bool,
    refused: bool,
    tick: u32,
}

impl<P: HostBoard<N>, const N: usize> HostSide<P, N> {
    /// Nothing heard yet.
    #[must_use]
    pub const fn new(board: P) -> Self {
        Self { board, commands: None, request: None, cancel: false, refused: false, tick: 0 }
    }

    /// No tick of the leg: what is asked meanwhile is asked of a leg that has no zeros.
    pub fn rest(&mut self) {
        while self.board.order().is_some() {}
        (self.commands, self.request, self.cancel) = (None, None, false);
        if self.is_due() {
            let blocked = !self.board.is_clear();
            self.board.tell(LegTold { blocked, ..LegTold::NONE });
        }
    }

    /// Takes the newest order; none while a request waits for the operator's hand, which goes first. What a host's loss is a fault of is reported.
    pub fn hear(&mut self, mut report: impl FnMut(Fault)) {
        while self.request.is_none()
            && let Some(order) = self.board.order()
        {
            self.commands = order.commands;
            for (joint, code) in order.faults.into_iter().enumerate() {
                if let Some(code) = code {
                    report(Fault { code, joint: joint as u8 });
                }
            }
            match order.request {
                Some(LegRequest::Cancel) => self.cancel = true,
                Some(request) => self.request = Some(request),
                None => {}
            }
        }
    }

    /// What is asked at this tick: by the operator's hand, or else by a host, once.
    pub fn request(&mut self, by_hand: Option<ControlRequest<N>>) -> Option<HostRequest<N>> {
        if let Some(request) = by_hand {
            return Some((request, None));
        }
        Some(match self.request.take()? {
            LegRequest::Power(power) => (ControlRequest::Power(power), None),
            LegRequest::Identify { plan, seed } => (ControlRequest::Identify, Some((plan, seed))),
            LegRequest::TakeUpdate => (ControlRequest::TakeUpdate, None),
            LegRequest::Cancel => return None,
        })
    }

    /// What is asked while the operator's switch is open, whoever enabled the leg and whatever the housekeeping knows of it.
    pub fn held(&self, request: Option<ControlRequest<N>>, state: DriveState) -> Option<ControlRequest<N>> {
        if self.board.held() {
            return request;
        }
        match request {
            Some(ControlRequest::Power(power)) if !power.enables() => request,
            _ if state == DriveState::OperationEnabled => {
                Some(ControlRequest::Power(PowerRequest::QuickStop))
            }
            // A step that was asked for while the switch was held still.
            _ => None,
        }
    }

    /// What a host commands at this tick, and whether an identification is to be given up; while it has the drive.
    pub fn commands(&mut self) -> Option<(&[JointCommand; N], bool)> {
        let cancel = core::mem::take(&mut self.cancel);
        self.commands.as_ref().map(|commands| (commands, cancel))
    }

    /// What came of the tick; whether a request for power was refused, and the rest where it is due.
    pub fn told(&mut self, refused: bool, tell: impl FnOnce() -> LegTold<N>) {
        self.refused |= refused;
        if self.is_due() {
            let (refused, blocked) = (core::mem::take(&mut self.refused), !self.board.is_clear());
            self.board.tell(LegTold { refused, blocked, rests: false, ..tell() });
        }
    }

    /// The bus has to run, and has taken what it was told before.
    fn is_due(&mut self) -> bool {
        self.tick = self.tick.wrapping_add(1);
        if !self.tick.is_multiple_of(TICKS) {
            return false;
        }
        self.board.pend();
        self.board.takes_told()
    }
}

#[cfg(test)]
mod tests;
