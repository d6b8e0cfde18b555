//! Log-Cholesky coordinates without those that have no effect on torque.
//!
//! A link that turns about an axis along gravity affects torque only by the inertia about that
//! axis. Nine of its ten coordinates are then redundant, and a search over them is wasted. Its
//! shape and centre of mass are held: a ball of the prior's radius of gyration about the prior's
//! centre of mass. Alpha, half the logarithm of its mass, stays free and scales its inertia. The
//! paper's chain keeps 27 of 36 coordinates.
//!
//! The set of reachable torques stays the same if the inertia covers the prior's range. The inertia scales
//! with exp(2 alpha), from a fifth to five times the ball's.

use scarab::ident::FullObjective;
use scarab::model::{BaseParameters, INERTIAL_PARAMETERS, LegParameters, Parameter, Standing};
use scarab::swarm::Objective;

/// Ratio of a link's largest extent to a ball's, both in the prior's radius of gyration: 1.58 sqrt(3).
const LARGEST_OVER_BALL: f64 = 2.736_64;

/// Cost of a leg over the coordinates with an effect on torque.
pub struct SeenLinks<'a, const N: usize> {
    whole: &'a FullObjective<'a, f32, N>,
    /// Every coordinate of `whole`; `Some` holds it at a value.
    held: Vec<Option<f32>>,
}

impl<'a, const N: usize> SeenLinks<'a, N> {
    /// Creates the cost; `None` if every link affects torque by more than one number.
    pub fn new<const B: usize>(
        whole: &'a FullObjective<'a, f32, N>,
        base: &BaseParameters<f64, N, B>,
    ) -> Option<Self> {
        let mut held = vec![None; whole.dimension()];
        let mut first = 0;
        for joint in 0..N {
            let estimated = |parameter: &Parameter| base.standing(joint, *parameter) != Standing::Off;
            let seen = |parameter: &Parameter| {
                estimated(parameter) && base.standing(joint, *parameter) != Standing::Unseen
            };
            let (inertial, drive) = Parameter::ALL.split_at(INERTIAL_PARAMETERS);
            if inertial.iter().filter(|parameter| seen(parameter)).count() == 1 {
                for (index, value) in
                    held.iter_mut().skip(first).take(INERTIAL_PARAMETERS).enumerate().skip(1)
                {
                    let (low, high) = whole.bounds(first + index);
                    let ball = high - LARGEST_OVER_BALL.ln() as f32;
                    *value = Some(if index <= 3 { ball } else { 0.5 * (low + high) });
                }
            }
            first += INERTIAL_PARAMETERS + drive.iter().filter(|parameter| estimated(parameter)).count();
        }
        held.iter().any(Option::is_some).then_some(Self { whole, held })
    }

    /// Parameters of the leg at a position.
    pub fn parameters(&self, position: &[f32]) -> LegParameters<f32, N> {
        self.whole.parameters(&self.all(position))
    }

    fn all(&self, position: &[f32]) -> Vec<f32> {
        let mut free = position.iter();
        self.held.iter().map(|held| held.or_else(|| free.next().copied()).unwrap_or(0.0)).collect()
    }
}

impl<const N: usize> Objective<f32> for SeenLinks<'_, N> {
    fn dimension(&self) -> usize {
        self.held.iter().filter(|held| held.is_none()).count()
    }

    fn bounds(&self, coordinate: usize) -> (f32, f32) {
        let mut free = self.held.iter().enumerate().filter(|(_, held)| held.is_none());
        free.nth(coordinate).map_or((0.0, 0.0), |(index, _)| self.whole.bounds(index))
    }

    fn evaluate(&self, position: &[f32]) -> f32 {
        self.whole.evaluate(&self.all(position))
    }
}
