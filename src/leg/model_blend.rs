//! Model in the feedforward, and the blend to its successor.
//!
//! A model is switched on, switched off or replaced by an update without a step of torque. Two shares move by
//! 1/2000 a tick, half a second from end to end: that of the model in the feedforward, and that of an update
//! in the model. The controller's integral compensates during the blend. Torque is linear in the parameters,
//! so the blend of two models is their weighted mean.
//!
//! Cost: about 30 multiplications a tick during a blend, otherwise two.

use super::model::IdentifiedModel;
use crate::real::clamp;
use crate::servo::{SERVO_RATE_HZ, TorqueModel};

/// Step of a share: half a second from 0 to 1.
const FADE_PER_TICK: f32 = 1.0 / (SERVO_RATE_HZ / 2) as f32;

/// Successor of the model in use.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Next<const N: usize> {
    Nothing,
    /// An update offered to the operator.
    Offered(IdentifiedModel<N>),
    /// Blend from the previous model; `share` of the update, 0..1.
    Fading {
        from: IdentifiedModel<N>,
        share: f32,
    },
}

/// The model of a leg and its share of the feedforward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ModelBlend<const N: usize> {
    model: Option<IdentifiedModel<N>>,
    next: Next<N>,
    wanted: bool,
    /// Share of the model in the feedforward, 0..1.
    share: f32,
}

/// A model scaled by its share.
pub(crate) struct Faded<'a, const N: usize> {
    model: &'a IdentifiedModel<N>,
    share: f32,
}

impl<const N: usize> TorqueModel<N> for Faded<'_, N> {
    fn torques(&self, q: &[f32; N], qd: &[f32; N], qdd: &[f32; N], gravity: [f32; 3]) -> [f32; N] {
        self.model.torques(q, qd, qdd, gravity).map(|torque| self.share * torque)
    }
}

impl<const N: usize> ModelBlend<N> {
    /// Creates the state without a model. A function and no constant, because a constant would place the
    /// whole value in flash to set two bytes of it.
    pub fn new() -> Self {
        Self { model: None, next: Next::Nothing, wanted: false, share: 0.0 }
    }

    /// Sets whether the model is used as feedforward from now on.
    pub(crate) fn want(&mut self, wanted: bool) {
        self.wanted = wanted;
    }

    /// Advances the shares by one tick. Returns the blended model while an update fades in, for
    /// [`Self::faded`].
    #[must_use]
    pub fn advance(&mut self) -> Option<IdentifiedModel<N>> {
        let step = if self.wanted { FADE_PER_TICK } else { -FADE_PER_TICK };
        self.share = clamp(self.share + step, 0.0, 1.0);
        let Next::Fading { from, share } = &mut self.next else { return None };
        *share = clamp(*share + FADE_PER_TICK, 0.0, 1.0);
        let mixed = from.towards(self.model.as_ref()?, *share);
        if *share >= 1.0 {
            self.next = Next::Nothing;
        }
        Some(mixed)
    }

    /// Returns the feedforward of this tick.
    pub(crate) fn faded<'a>(&'a self, mixed: Option<&'a IdentifiedModel<N>>) -> Option<Faded<'a, N>> {
        let model = mixed.or(self.model.as_ref())?;
        (self.share > 0.0).then_some(Faded { model, share: self.share })
    }

    /// Whether the model's share has not reached its target yet.
    pub(crate) fn is_fading(&self) -> bool {
        self.model.is_some() && self.share != if self.wanted { 1.0 } else { 0.0 }
    }

    /// Sets an accepted model. Any update of the previous one is discarded.
    pub fn accept(&mut self, model: IdentifiedModel<N>) {
        (self.model, self.next) = (Some(model), Next::Nothing);
    }

    /// Resets the share when the drive gives no torque; the model fades in again afterwards.
    pub(crate) fn interrupt(&mut self) {
        self.share = 0.0;
    }

    /// Replaces the model. Refused (`false`) while the present one is in the feedforward, because the torque
    /// would step.
    #[must_use]
    pub(crate) fn adopt(&mut self, model: IdentifiedModel<N>) -> bool {
        let free = self.model.is_none() || !(self.share > 0.0);
        if free {
            self.accept(model);
            (self.wanted, self.share) = (false, 0.0);
        }
        free
    }

    /// Offers an update.
    pub(crate) fn offer(&mut self, update: IdentifiedModel<N>) {
        self.next = Next::Offered(update);
    }

    /// Whether an update is offered.
    pub(crate) fn is_offered(&self) -> bool {
        matches!(self.next, Next::Offered(_))
    }

    /// Withdraws the offer. An update that already fades in continues.
    pub(crate) fn withdraw(&mut self) {
        if self.is_offered() {
            self.next = Next::Nothing;
        }
    }

    /// Uses the offered update; the previous model fades out.
    pub(crate) fn take(&mut self) {
        if let (Next::Offered(update), Some(from)) = (self.next, self.model) {
            self.model = Some(update);
            self.next = Next::Fading { from, share: 0.0 };
        }
    }

    /// Returns the model.
    pub fn model(&self) -> Option<&IdentifiedModel<N>> {
        self.model.as_ref()
    }
}
