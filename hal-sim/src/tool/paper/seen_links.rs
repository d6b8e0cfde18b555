//! Log-Cholesky coordinates without those that no torque depends on.
//!
//! Of a link that turns about an axis along gravity torque sees one number, the inertia about that axis. Nine of its ten
//! coordinates then say nothing that the tenth does not, and a search over them is a search over nothing. Held here are
//! shape and centre of mass of such a link, at a ball of the prior's radius of gyration about the prior's centre of mass;
//! alpha, half the logarithm of its mass, is left and scales its inertia. Of the paper's chain 27 coordinates of 36 are left.
//!
//! Why this loses nothing: torques reached stay the same while the inertia can take every value the prior allows, and it
//! goes with exp(2 alpha), from a fifth to five times the ball's.

use scarab::ident::FullObjective;
use scarab::model::{BaseParameters, INERTIAL_PARAMETERS, LegParameters, Parameter, Standing};
use scarab::swarm::Objective;

/// Largest extent of a link over a ball's, both in the prior's radius of gyration: 1.58 sqrt(3).
const LARGEST_OVER_BALL: f64 = 2.736_64;

/// A leg's cost over the coordinates that count.
pub struct SeenLinks<'a, const N: usize> {
    whole: &'a FullObjective<'a, f32, N>,
    /// Every coordinate of `whole`, with its value where it is held.
    held: Vec<Option<f32>>,
}

impl<'a, const N: usize> SeenLinks<'a, N> {
    /// `None` where every link is seen by more than one number.
    #[must_use]
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

    /// The leg at a position.
    #[must_use]
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
        free.nth(coordinate).map_or((0.0, 0.0), |(place, _)| self.whole.bounds(place))
    }

    fn evaluate(&self, position: &[f32]) -> f32 {
        self.whole.evaluate(&self.all(position))
    }
}
