//! Sessions of assistance: their beginning, torque and end; see [`crate::assist`].
//!
//! A session begins from rest, holds no position, and ends in the pose in which the leg then is. The law runs
//! elsewhere, at 500 Hz: it gets a session by [`Control::take_session`] and answers every logged sample by
//! [`Control::receive_torque`].

use super::{Activity, Control};
use crate::assist::{AssistDemand, AssistEnd, AssistSession, AssistShares, AssistTick, AssistTorque};
use crate::leg::activity::AssistPhase;
use crate::leg::model::IdentifiedModel;
use crate::listed::listed;
use crate::real::abs;
use crate::servo::{Effort, ServoOutput};
use crate::units::NewtonMetre;

/// Measured speed below which a leg rests, rad/s.
const FASTEST_REST: f32 = 0.05;

/// Whether the leg is worn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Wearing {
    /// The exoskeleton alone.
    Empty,
    /// The exoskeleton with its wearer.
    Worn,
}

listed! {
    /// Reason why a session is refused.
    pub enum AssistRefusal {
        /// All reasons, in the order of the enum.
        ALL,
        /// Word used in records.
        name;
        /// The drive is not enabled, moves, or does something else.
        Busy, "busy";
        /// A share is out of its range.
        Shares, "shares";
        /// No model of the empty leg.
        NoEmptyModel, "no_empty_model";
        /// No model of the worn leg, which the shares need.
        NoWornModel, "no_worn_model";
        /// The model monitor reports a change.
        Changed, "changed";
    }
}

/// Event of a session, for a record.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum AssistNote {
    /// A session was refused.
    Refused(AssistRefusal),
    /// A session is ending.
    Ending(AssistEnd),
}

/// Models, and the session of assistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Assistance<const N: usize> {
    pub(super) empty: Option<IdentifiedModel<N>>,
    pub(super) worn: Option<IdentifiedModel<N>>,
    /// Wearing of the leg of the next identification.
    pub(super) wearing: Option<Wearing>,
    /// The model monitor reported a change after these models were accepted.
    is_changed: bool,
    tick: Option<AssistTick<N>>,
    /// Shares of a session that the law has not taken yet, and gravity in the base frame, m/s^2.
    begun: Option<(AssistShares, [f32; 3])>,
    /// Number of the newest session.
    number: u32,
    /// Event that was not recorded yet.
    note: Option<AssistNote>,
    position: [f32; N],
    velocity: [f32; N],
    torque: [f32; N],
}

impl<const N: usize> Assistance<N> {
    pub(super) fn new() -> Self {
        Self {
            empty: None,
            worn: None,
            wearing: None,
            is_changed: false,
            tick: None,
            begun: None,
            number: 0,
            note: None,
            position: [0.0; N],
            velocity: [0.0; N],
            torque: [0.0; N],
        }
    }

    /// Drops the session without a fade, because the drive gives no torque.
    pub(super) fn interrupt(&mut self) {
        (self.tick, self.begun) = (None, None);
    }

    /// Fades the session out.
    pub(super) fn leave(&mut self, why: AssistEnd) {
        if let Some(tick) = &mut self.tick {
            tick.leave(why);
        }
    }

    /// Ends the session because the leg has changed, and permits none until one of its models is accepted
    /// again.
    pub(super) fn change(&mut self) {
        self.is_changed = true;
        self.leave(AssistEnd::Changed);
    }

    /// Takes the servo's results of this tick.
    pub(super) fn measure(&mut self, output: &ServoOutput<N>) {
        for joint in 0..N {
            self.position[joint] = output.position[joint].0;
            self.velocity[joint] = output.velocity[joint].0;
            self.torque[joint] = output.decision.torque[joint].0;
        }
    }

    /// Sets the accepted model of the leg that the operator named.
    pub(super) fn accept(&mut self, model: &IdentifiedModel<N>) {
        self.is_changed = false;
        match self.wearing {
            // The difference to a model of another empty leg would be no wearer.
            Some(Wearing::Empty) => (self.empty, self.worn) = (Some(*model), None),
            Some(Wearing::Worn) => self.worn = Some(*model),
            None => {}
        }
    }
}

impl<const N: usize> Control<N> {
    /// Sets whether the leg of the next identifications is empty or worn; its accepted model becomes that of
    /// [`Self::model_of`].
    pub(crate) fn set_wearing(&mut self, wearing: Option<Wearing>) {
        self.assistance.wearing = wearing;
    }

    /// What was said about the leg.
    pub(crate) fn wearing(&self) -> Option<Wearing> {
        self.assistance.wearing
    }

    /// Model of the empty or the worn leg.
    pub fn model_of(&self, wearing: Wearing) -> Option<&IdentifiedModel<N>> {
        match wearing {
            Wearing::Empty => self.assistance.empty.as_ref(),
            Wearing::Worn => self.assistance.worn.as_ref(),
        }
    }

    /// Sets a restored model of the empty or the worn leg. Refused (`false`) during an activity.
    #[must_use]
    pub fn set_model(&mut self, wearing: Wearing, model: IdentifiedModel<N>) -> bool {
        let is_idle = matches!(self.activity, Activity::Idle | Activity::Follow);
        if is_idle {
            match wearing {
                Wearing::Empty => self.assistance.empty = Some(model),
                Wearing::Worn => self.assistance.worn = Some(model),
            }
        }
        is_idle
    }

    /// Session that began since the last call; for the law.
    #[must_use]
    pub(crate) fn take_session(&mut self) -> Option<AssistSession<N>> {
        let (shares, gravity) = self.assistance.begun.take()?;
        let empty = self.assistance.empty.as_ref()?;
        let worn = self.assistance.worn.as_ref().filter(|_| shares.need_worn_model());
        let number = self.assistance.number;
        Some(AssistSession { number, shares, model: empty.compensation(worn, gravity) })
    }

    /// Takes the law's answer to a logged sample.
    pub(crate) fn receive_torque(&mut self, torque: &AssistTorque<N>) {
        if let Some(tick) = &mut self.assistance.tick {
            tick.receive(torque);
        }
    }

    /// Event of a session since the last call.
    #[must_use]
    pub(crate) fn take_assist_note(&mut self) -> Option<AssistNote> {
        self.assistance.note.take()
    }

    /// Whether the leg rests and does nothing else: a push or a swing does not count as rest.
    pub(super) fn rests_for_assist(&self) -> bool {
        matches!(self.activity, Activity::Idle | Activity::Follow)
            && !self.servo.monitor.returns().contains(&true)
            && self.assistance.velocity.iter().all(|speed| abs(*speed) < FASTEST_REST)
    }

    /// Reason why these shares cannot be given, besides an activity or a motion.
    pub(super) fn assist_refusal(&self, shares: &AssistShares) -> Option<AssistRefusal> {
        let models = &self.assistance;
        if !shares.are_permitted() {
            Some(AssistRefusal::Shares)
        } else if models.empty.is_none() {
            Some(AssistRefusal::NoEmptyModel)
        } else if models.worn.is_none() && shares.need_worn_model() {
            Some(AssistRefusal::NoWornModel)
        } else {
            models.is_changed.then_some(AssistRefusal::Changed)
        }
    }

    /// Notes why a session was refused.
    pub(super) fn note_refusal(&mut self, shares: &AssistShares) {
        let why = self.assist_refusal(shares).unwrap_or(AssistRefusal::Busy);
        self.assistance.note = Some(AssistNote::Refused(why));
    }

    /// Begins a session.
    pub(super) fn begin_assist(&mut self, shares: AssistShares, gravity: [f32; 3]) {
        let Some(empty) = &self.assistance.empty else { return };
        self.assistance.number = self.assistance.number.wrapping_add(1);
        let cap = self.servo.limits().joints().map(|joint| joint.torque_cap().0);
        let Assistance { number, position, velocity, torque, .. } = self.assistance;
        // The session damps as the controller did, so that is no part of the torque that holds the leg.
        let hold = core::array::from_fn(|joint| torque[joint] + self.servo.damping(joint) * velocity[joint]);
        let friction = (shares.friction, *empty.assured());
        self.assistance.tick = Some(AssistTick::begin(number, friction, position, hold, cap));
        self.assistance.begun = Some((shares, gravity));
        self.models.want(false);
        self.activity = Activity::Assist(AssistPhase::Enter);
    }

    /// Efforts of the session in this tick.
    pub(super) fn assist(&mut self) -> Option<[Effort; N]> {
        if !self.activity.assists() {
            return None;
        }
        let Assistance { position, velocity, .. } = self.assistance;
        let tick = self.assistance.tick.as_mut()?;
        let AssistDemand { torque_nm, damping_share } = tick.advance(&position, &velocity);
        let phase = match (tick.end(), tick.is_complete()) {
            (Some(_), _) => AssistPhase::Leave,
            (None, true) => AssistPhase::Run,
            (None, false) => AssistPhase::Enter,
        };
        if let Some(why) = tick.end()
            && self.activity != Activity::Assist(AssistPhase::Leave)
        {
            self.assistance.note = Some(AssistNote::Ending(why));
        }
        self.activity = Activity::Assist(phase);
        let torques = torque_nm.map(NewtonMetre);
        Some(torques.map(|torque| Effort { torque, held: false, damping_share, ..Effort::HELD }))
    }

    /// Ends a session that has faded out, in the present pose.
    pub(super) fn end_assist(&mut self) {
        if self.assistance.tick.as_ref().is_none_or(AssistTick::has_ended) {
            self.assistance.interrupt();
            self.activity = Activity::Idle;
        }
    }
}
