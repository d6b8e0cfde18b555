//! Shares of the model's torques that the drives give.

use crate::real::is_finite;

/// Largest share of the inertia. With all of it given the leg would follow every touch without resistance,
/// and the delay of the acceleration would make it unstable.
pub const LARGEST_INERTIA: f32 = 0.8;
/// Largest share of a periodic motion's torque, in either direction.
pub const LARGEST_PERIODIC: f32 = 0.5;

/// Shares of the model's torques; the weight of the empty leg is always carried whole.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AssistShares {
    /// Friction's lower bound, 0..1.
    pub friction: f32,
    /// Inertia of the empty leg, 0..[`LARGEST_INERTIA`].
    pub inertia: f32,
    /// Weight of the wearer's leg, 0..1.
    pub weight: f32,
    /// Torque of the wearer's periodic motion, -[`LARGEST_PERIODIC`]..[`LARGEST_PERIODIC`]; negative resists.
    pub periodic: f32,
}

impl AssistShares {
    /// Carries the empty leg's weight and nothing else.
    pub const GRAVITY_ONLY: Self = Self { friction: 0.0, inertia: 0.0, weight: 0.0, periodic: 0.0 };

    /// Whether every share is finite and in its range.
    pub(crate) fn are_permitted(&self) -> bool {
        let Self { friction, inertia, weight, periodic } = *self;
        [friction, inertia, weight, periodic].into_iter().all(is_finite)
            && (0.0..=1.0).contains(&friction)
            && (0.0..=LARGEST_INERTIA).contains(&inertia)
            && (0.0..=1.0).contains(&weight)
            && (-LARGEST_PERIODIC..=LARGEST_PERIODIC).contains(&periodic)
    }

    /// Whether the model of the worn leg is needed too.
    pub(crate) fn need_worn_model(&self) -> bool {
        self.weight != 0.0 || self.periodic != 0.0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_outside_their_range_are_refused() {
        let most = AssistShares { friction: 1.0, inertia: 0.8, weight: 1.0, periodic: -0.5 };
        assert!(most.are_permitted() && AssistShares::GRAVITY_ONLY.are_permitted());
        for wrong in [
            AssistShares { friction: 1.01, ..most },
            AssistShares { inertia: 0.81, ..most },
            AssistShares { weight: -0.01, ..most },
            AssistShares { periodic: 0.51, ..most },
            AssistShares { inertia: f32::NAN, ..most },
        ] {
            assert!(!wrong.are_permitted(), "{wrong:?}");
        }
    }
}
