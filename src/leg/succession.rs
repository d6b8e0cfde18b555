//! Which model feeds the servo forward, and how one makes room for the next.
//!
//! A model comes into use, goes out of it and gives way to an update without a step of torque: its share of the
//! feedforward, and an update's share of the model, move by 1/2000 a tick, half a second from end to end, while the
//! controller's integral makes room. Torque is linear in the parameters, so the model between two is the mean of theirs.
//!
//! Cost: some 30 multiplications a tick while an update fades in, else two.

use super::model::IdentifiedModel;
use crate::real::clamp;
use crate::servo::{SERVO_RATE_HZ, TorqueModel};

/// Half a second.
const FADE_PER_TICK: f32 = 1.0 / (SERVO_RATE_HZ / 2) as f32;

/// What follows the model in use.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Next<const N: usize> {
    Nothing,
    /// An update that the operator may take.
    Offered(IdentifiedModel<N>),
    /// The model before an update fades out: share of the update, 0..1.
    Fading {
        from: IdentifiedModel<N>,
        share: f32,
    },
}

/// The model of a leg and its share of the feedforward.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Succession<const N: usize> {
    model: Option<IdentifiedModel<N>>,
    next: Next<N>,
    wanted: bool,
    /// Share of the model in the feedforward, 0..1.
    share: f32,
}

/// A model at a share of its torque.
pub struct Faded<'a, const N: usize> {
    model: &'a IdentifiedModel<N>,
    share: f32,
}

impl<const N: usize> TorqueModel<N> for Faded<'_, N> {
    fn torques(&self, q: &[f32; N], qd: &[f32; N], qdd: &[f32; N], gravity: [f32; 3]) -> [f32; N] {
        self.model.torques(q, qd, qdd, gravity).map(|torque| self.share * torque)
    }
}

impl<const N: usize> Succession<N> {
    /// No model. No constant: of one the whole image would lie in flash, to set two bytes of it.
    #[must_use]
    pub fn new() -> Self {
        Self { model: None, next: Next::Nothing, wanted: false, share: 0.0 }
    }

    /// Whether the model is to feed forward from now on.
    pub fn want(&mut self, wanted: bool) {
        self.wanted = wanted;
    }

    /// Fades on by one tick; the model between two where an update fades in, for [`Self::faded`].
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

    /// What feeds forward in this tick.
    #[must_use]
    pub fn faded<'a>(&'a self, mixed: Option<&'a IdentifiedModel<N>>) -> Option<Faded<'a, N>> {
        let model = mixed.or(self.model.as_ref())?;
        (self.share > 0.0).then_some(Faded { model, share: self.share })
    }

    /// The model is neither wholly in use nor wholly out of it, as it is wanted.
    #[must_use]
    pub fn is_fading(&self) -> bool {
        self.model.is_some() && self.share != if self.wanted { 1.0 } else { 0.0 }
    }

    /// A model that was accepted; an update of the one before is none of this one.
    pub fn accept(&mut self, model: IdentifiedModel<N>) {
        (self.model, self.next) = (Some(model), Next::Nothing);
    }

    /// The drive gives no torque: once it does again, the model comes into use from nothing.
    pub fn interrupt(&mut self) {
        self.share = 0.0;
    }

    /// Another model in place of the one that was there; refused (`false`) while that one feeds forward, where it would
    /// be a step of torque.
    #[must_use]
    pub fn adopt(&mut self, model: IdentifiedModel<N>) -> bool {
        let free = self.model.is_none() || !(self.share > 0.0);
        if free {
            self.accept(model);
            (self.wanted, self.share) = (false, 0.0);
        }
        free
    }

    /// An update that may be taken.
    pub fn offer(&mut self, update: IdentifiedModel<N>) {
        self.next = Next::Offered(update);
    }

    /// Whether there is an update to take.
    #[must_use]
    pub fn is_offered(&self) -> bool {
        matches!(self.next, Next::Offered(_))
    }

    /// The offer no longer stands; an update that fades in does so to its end.
    pub fn withdraw(&mut self) {
        if self.is_offered() {
            self.next = Next::Nothing;
        }
    }

    /// Takes the update that is offered; the model before it fades out.
    pub fn take(&mut self) {
        if let (Next::Offered(update), Some(from)) = (self.next, self.model) {
            self.model = Some(update);
            self.next = Next::Fading { from, share: 0.0 };
        }
    }

    /// The model.
    #[must_use]
    pub fn model(&self) -> Option<&IdentifiedModel<N>> {
        self.model.as_ref()
    }
}
