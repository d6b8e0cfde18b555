//! Objects from 2100 on: identification and assistance of a leg, available at each of its nodes.
//!
//! ```text
//! 2100   command, state, plan, seed, verdict                      of the leg, equal at each node
//! 2110   fourteen parameters of the node's joint                  value, sigma, status
//! 2120   base parameters                                          of the leg: value, sigma, carrier, flags
//! 2130   fit of the joint's torque, per motion
//! 2140   500 Hz log ([`Log`])
//! 2150   shares of the assistance, per mille
//! 1F50   the program ([`super::program`])
//! 2160   the board ([`super::commissioning`]), and 2170
//! ```
//!
//! A command is passed to the leg at its next tick, like those of the operator's contacts. Numbers are those
//! of the trace. Unknown values are NaN; before the first identification all are.

mod log;
mod results;
mod results_copy;

pub(crate) use log::Log;
pub use results::Results;
pub use results_copy::ResultsCopy;

use super::abort::Abort;
use super::commissioning::BoardObjects;
use super::dictionary::Object;
use super::drive::Axis;
use super::objects::{Lost, Objects};
use super::program::ProgramObjects;
use crate::leg::{
    Activity, AssistPhase, AssistShares, IdentifyPhase, Parameter, Permission, Plan, Reason, Status, Step,
    Wearing,
};
use scarab_boot::Region;

/// Request of a host to the leg, besides power and targets.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum LegCommand {
    /// Start an identification: excite, solve, validate.
    Identify,
    /// Cancel the identification.
    Cancel,
    /// Use the offered model update.
    TakeUpdate,
    /// Begin assistance with the shares of 2150.
    Assist,
    /// Fade the assistance out.
    EndAssist,
}

/// Objects of the leg, shared by its nodes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LegObjects<const N: usize, const L: usize> {
    /// The 500 Hz log.
    pub(crate) log: Log<N, L>,
    /// Activity of the leg; to be updated after each tick.
    pub(crate) activity: Activity,
    /// Model monitor: the model no longer fits; an update is offered. To be updated after each tick.
    pub(crate) change: [bool; 2],
    /// Plan of the next identification: one-time or sequential.
    pub(crate) plan: Plan,
    /// Seed of the next identification's random numbers.
    pub(crate) seed: u64,
    /// Number of models accepted on this board.
    pub(crate) generation: u32,
    /// Whether the leg of the next identification is empty or worn, if a host said so.
    pub(crate) wearing: Option<Wearing>,
    /// Commissioning and telemetry of the board.
    pub(crate) board: BoardObjects<N>,
    /// Program of the board.
    pub(crate) program: ProgramObjects,
    /// Shares of the next assistance.
    pub(crate) shares: AssistShares,
    /// Last command written.
    command: u8,
    requested: Option<LegCommand>,
    /// Pending store request; `true` restores the defaults.
    store: Option<bool>,
}

impl<const N: usize, const L: usize> LegObjects<N, L> {
    /// Creates the objects without a request; `checksum` is that of the running image.
    pub const fn new(plan: Plan, seed: u64, generation: u32, checksum: u32) -> Self {
        Self {
            log: Log::EMPTY,
            activity: Activity::Idle,
            change: [false; 2],
            plan,
            seed,
            generation,
            wearing: None,
            board: BoardObjects::NEW,
            program: ProgramObjects::new(checksum),
            shares: AssistShares::GRAVITY_ONLY,
            command: 0,
            requested: None,
            store: None,
        }
    }

    /// Whether a request is pending that begins a motion.
    pub(crate) fn requests_motion(&self) -> bool {
        matches!(self.requested, Some(LegCommand::Identify | LegCommand::Assist))
    }

    /// Takes over the leg's activity and the model monitor's state after a tick.
    pub(crate) fn update(&mut self, activity: Activity, change: [bool; 2]) {
        let identifies = |activity| matches!(activity, Activity::Identify(_));
        if identifies(activity) && !identifies(self.activity) {
            // The statement belonged to the identification that begins.
            self.wearing = None;
        }
        (self.activity, self.change) = (activity, change);
    }

    /// Discards what a host said about the next identification and assistance, when its session ends, and its
    /// request to begin one. A request to end one stays.
    pub(crate) fn end_session(&mut self) {
        (self.wearing, self.shares) = (None, AssistShares::GRAVITY_ONLY);
        self.requested =
            self.requested.filter(|command| matches!(command, LegCommand::Cancel | LegCommand::EndAssist));
    }

    /// Takes the pending request.
    pub(crate) fn take_request(&mut self) -> Option<LegCommand> {
        self.requested.take()
    }

    /// Takes the pending store request; `true` restores the defaults.
    pub(crate) fn take_store(&mut self) -> Option<bool> {
        self.store.take()
    }

    /// Reads 2100.
    fn read(&self, sub: u8, results: &impl Results) -> Result<u32, Abort> {
        let verdict = results.verdict();
        Ok(match sub {
            1 => u32::from(self.command),
            2 => u32::from(state(self.activity).0),
            3 => u32::from(state(self.activity).1),
            4 => u32::from(self.plan == Plan::Sequential),
            5 => self.seed as u32,
            6 => (self.seed >> 32) as u32,
            7 => self.generation,
            8 => verdict.map_or(0, |verdict| if verdict.is_accepted() { 1 } else { 2 }),
            9 => verdict.map_or(0, |verdict| {
                let bits = Reason::ALL.into_iter().enumerate();
                bits.fold(0, |bits, (index, reason)| bits | u32::from(verdict.has(reason)) << index)
            }),
            10 => results.search()[0],
            11 => results.search()[1],
            12 => match self.change {
                [_, true] => 2,
                [changed, _] => u32::from(changed),
            },
            13 => match self.wearing {
                None => 0,
                Some(Wearing::Empty) => 1,
                Some(Wearing::Worn) => 2,
            },
            _ => return Err(Abort::NoSubindex),
        })
    }

    fn write(&mut self, sub: u8, value: u32) -> Result<(), Abort> {
        let is_identifying = matches!(self.activity, Activity::Identify(_));
        match (sub, value) {
            (1, 0..=5) => {
                // A cancel that the leg has not taken yet stays.
                let is_cancelled = self.requested == Some(LegCommand::Cancel);
                self.requested = match value {
                    _ if is_cancelled => Some(LegCommand::Cancel),
                    1 => Some(LegCommand::Identify),
                    2 => Some(LegCommand::Cancel),
                    3 => Some(LegCommand::TakeUpdate),
                    4 => Some(LegCommand::Assist),
                    5 => Some(LegCommand::EndAssist),
                    _ => None,
                };
                self.command = value as u8;
            }
            // Plan, seed and leg are locked during an identification.
            (4..=6 | 13, _) if is_identifying => return Err(Abort::State),
            (4, 0) => self.plan = Plan::OneTime,
            (4, 1) => self.plan = Plan::Sequential,
            (5, _) => self.seed = self.seed & !0xFFFF_FFFF | u64::from(value),
            (6, _) => self.seed = self.seed & 0xFFFF_FFFF | u64::from(value) << 32,
            (13, 0) => self.wearing = None,
            (13, 1) => self.wearing = Some(Wearing::Empty),
            (13, 2) => self.wearing = Some(Wearing::Worn),
            _ => return Err(Abort::Range),
        }
        Ok(())
    }

    /// Share of 2150, and its place.
    fn share(&mut self, sub: u8) -> Result<&mut f32, Abort> {
        Ok(match sub {
            1 => &mut self.shares.friction,
            2 => &mut self.shares.inertia,
            3 => &mut self.shares.weight,
            4 => &mut self.shares.periodic,
            _ => return Err(Abort::NoSubindex),
        })
    }

    /// Reads a share, per mille.
    fn read_share(&self, sub: u8) -> Result<u32, Abort> {
        let AssistShares { friction, inertia, weight, periodic } = self.shares;
        let share = *[friction, inertia, weight, periodic]
            .get(usize::from(sub).wrapping_sub(1))
            .ok_or(Abort::NoSubindex)?;
        let rounded = if share < 0.0 { share * PER_MILLE - 0.5 } else { share * PER_MILLE + 0.5 };
        Ok((rounded as i32).cast_unsigned())
    }

    /// Writes a share, per mille; one outside its range is refused.
    fn write_share(&mut self, sub: u8, value: u32) -> Result<(), Abort> {
        let before = self.shares;
        *self.share(sub)? = f32::from(value as i16) / PER_MILLE;
        if !self.shares.are_permitted() {
            self.shares = before;
            return Err(Abort::Range);
        }
        Ok(())
    }
}

/// Unit of the shares on the bus.
const PER_MILLE: f32 = 1000.0;

/// State number of 2100:2, and the validation motion, counted from 1.
const fn state(activity: Activity) -> (u8, u8) {
    match activity {
        Activity::Idle => (0, 0),
        Activity::Identify(IdentifyPhase::Approach) => (1, 0),
        Activity::Identify(IdentifyPhase::Excite) => (2, 0),
        Activity::Identify(IdentifyPhase::Settle) => (3, 0),
        Activity::Identify(IdentifyPhase::Solve) => (4, 0),
        Activity::Identify(IdentifyPhase::Validate { motion, step: Step::Approach }) => {
            (5, motion.saturating_add(1))
        }
        Activity::Identify(IdentifyPhase::Validate { motion, step: Step::Run }) => {
            (6, motion.saturating_add(1))
        }
        Activity::Identify(IdentifyPhase::Judge) => (7, 0),
        Activity::Track(_) => (8, 0),
        Activity::Follow => (9, 0),
        Activity::Assist(AssistPhase::Enter) => (10, 0),
        Activity::Assist(AssistPhase::Run) => (11, 0),
        Activity::Assist(AssistPhase::Leave) => (12, 0),
    }
}

/// All objects of one node from 2000 on: joint, leg and results.
pub(crate) struct JointObjects<'a, R, const N: usize, const L: usize> {
    /// Axis of the joint.
    pub(crate) axis: &'a mut Axis,
    /// Index of the joint, from 0.
    pub(crate) joint: usize,
    /// Objects of the leg.
    pub(crate) leg: &'a mut LegObjects<N, L>,
    /// Identification results.
    pub(crate) results: &'a R,
}

impl<R: Results, const N: usize, const L: usize> JointObjects<'_, R, N, L> {
    fn is_off(&self) -> bool {
        self.axis.drive().permission() == Permission::Off
    }

    fn found(&self, object: Object) -> Result<u32, Abort> {
        let index = usize::from(object.sub).wrapping_sub(1);
        let number = |value: Option<f32>| value.unwrap_or(f32::NAN).to_bits();
        let parameter = || {
            let parameter = *Parameter::ALL.get(index)?;
            self.results.parameter(self.joint, parameter)
        };
        let base = || self.results.base_parameter(index);
        let fit = || self.results.fit(index, self.joint);
        Ok(match object.index {
            0x2110 => number(parameter().and_then(|found| found.value)),
            0x2111 => number(parameter().and_then(|found| found.sigma)),
            0x2112 => parameter().map_or(0, |found| match found.status {
                Status::Identified => 1,
                Status::Grouped => 2,
                Status::Weak => 3,
                Status::Prior => 4,
            }),
            0x2120 => number(base().and_then(|found| found.value)),
            0x2121 => number(base().and_then(|found| found.sigma)),
            0x2122 => base().map_or(0, |found| {
                let (joint, parameter) = found.carrier;
                ((joint as u32 + 1) << 8) | (parameter.index() as u32 + 1)
            }),
            0x2123 => base().map_or(0, |found| {
                u32::from(found.value.is_some())
                    | u32::from(found.grouped) << 1
                    | u32::from(found.dropped) << 2
            }),
            0x2124 => number(base().map(|found| found.least_squares)),
            0x2130 => number(fit().and_then(|fit| fit.rms_nm)),
            0x2131 => number(fit().map(|fit| fit.mean_absolute_nm)),
            0x2132 => number(fit().map(|fit| fit.torque_rms_nm)),
            0x2133 => fit().map_or(0, |fit| fit.rows),
            _ => return Err(Abort::NoObject),
        })
    }
}

impl<R: Results, const N: usize, const L: usize> Objects for JointObjects<'_, R, N, L> {
    fn read(&self, object: Object) -> Result<u32, Abort> {
        match (object.index, object.sub) {
            (0x1F50..=0x1F57, _) => self.leg.program.read(object.index),
            (0x2100, sub) => self.leg.read(sub, self.results),
            (0x2120, 0) => self.axis.read(object),
            (0x2140, 1) => Ok(self.leg.log.held()),
            (0x2140, 3) => Ok(self.leg.log.waiting()),
            (0x2140, 4) => Ok(self.leg.log.lost()),
            (0x2150, sub) => self.leg.read_share(sub),
            (0x2160, sub) => self.leg.board.commissioning(sub),
            (0x2170, sub) => self.leg.board.telemetry(self.joint, sub),
            (0x2101..=0x2193, _) => self.found(object),
            _ => self.axis.read(object),
        }
    }

    fn write(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        match (object.index, object.sub) {
            (0x1F50..=0x1F57, _) => self.leg.program.command(value, self.is_off()),
            (0x2100, sub) => self.leg.write(sub, value),
            (0x2140, 1) => {
                self.leg.log.hold(value != 0);
                Ok(())
            }
            (0x2150, sub) => self.leg.write_share(sub, value),
            (0x2160, sub) => self.leg.board.ask(sub, value),
            _ => self.axis.write(object, value),
        }
    }

    fn write_mapped(&mut self, object: Object, value: u32) -> Result<(), Abort> {
        // No other object that can be mapped is held here.
        self.axis.write_mapped(object, value)
    }

    fn bytes(&self, object: Object, offset: u32, into: &mut [u8]) -> Result<u32, Abort> {
        match (object.index, object.sub) {
            (0x1F50, _) => Err(Abort::WriteOnly),
            (0x2140, 2) => Ok(self.leg.log.bytes(offset, into)),
            _ => self.axis.bytes(object, offset, into),
        }
    }

    fn begin_domain(&mut self, object: Object, size: Option<u32>) -> Result<(), Abort> {
        match object.index {
            0x1F50 if size.is_some_and(|size| size > Region::IMAGE.bytes()) => Err(Abort::TooLong),
            0x1F50 => self.leg.program.begin(),
            _ => Err(Abort::ReadOnly),
        }
    }

    fn room(&self) -> usize {
        self.leg.program.room()
    }

    fn push(&mut self, byte: u8) -> Result<(), Abort> {
        self.leg.program.push(byte)
    }

    fn lost(&mut self, why: Lost) {
        self.axis.lost(why);
        self.leg.end_session();
    }

    fn misses_host(&self) -> bool {
        self.axis.misses_host()
    }

    fn reset(&mut self) {
        self.axis.reset();
    }

    fn store(&mut self, defaults: bool) -> Result<(), Abort> {
        // Not with an active inhibit reason either: the motors may be braking.
        if !self.is_off() || self.axis.is_blocked() {
            return Err(Abort::State);
        }
        self.leg.store = Some(defaults);
        Ok(())
    }
}

#[cfg(test)]
mod tests;
