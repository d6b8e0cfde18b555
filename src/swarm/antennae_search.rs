//! Beetle antennae search, for comparison: one beetle, two whiskers, one step towards the lower cost.
//!
//! Per iteration, with d a random unit vector (Eq. 23: entries uniform in -1..1, then normalised):
//!   x_l = x + l d, x_r = x - l d                       (Eq. 21)
//!   x = x - delta d sgn(f(x_l) - f(x_r))               (Eq. 24)
//!   delta = e1 delta + e0                              (Eq. 25)
//!   l = delta / e2                                     (Eq. 26; replaces Eq. 22, which contradicts it)
//! Symbols: delta step length, l whisker length, both in the unit of the coordinates (in the paper a step of
//! 1 in a box of plus or minus 100); e1 decay, e0 offset of the step length, e2 ratio of step to whisker.
//!
//! Source: beetle antennae search (Jiang, Li, 2017); the paper, Eqs (21)-(26), constants of its section 4.1.
//! Cost: 3 evaluations and about 10 D operations per iteration; memory 5 D scalars.
//! Known limits: the step ends at e0 / (1 - e1) = 0.1 and covers about 120 units in 1,000 iterations, for any
//! box; it does not reach the minimum in 30 dimensions.

use crate::real::{Real, dot, sign, sqrt};

use super::objective::{Objective, SwarmError, not_negative, positive};
use super::random::Random;
use super::rows::{add_scaled, live, live_mut, scale};
use super::search::{Best, Search, SearchProgress};

/// Constants of the antennae search; the default is the paper's.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BasSettings<T> {
    /// delta at the first iteration, in the unit of the coordinates; default 1.
    pub first_step: T,
    /// e1, factor on the step length per iteration; default 0.95.
    pub step_decay: T,
    /// e0, added to the step length per iteration; default 0.005.
    pub step_offset: T,
    /// e2, step length over whisker length; default 10, not zero.
    pub step_per_whisker: T,
}

impl<T: Real> Default for BasSettings<T> {
    fn default() -> Self {
        Self {
            first_step: T::one(),
            step_decay: T::from_double(0.95),
            step_offset: T::from_double(0.005),
            step_per_whisker: T::from_double(10.0),
        }
    }
}

/// Next evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage<T> {
    Initial,
    LeftWhisker,
    RightWhisker { left: T },
    Move { smell: T },
}

/// One beetle with capacity for `D` coordinates.
#[derive(Clone, Debug, PartialEq)]
pub struct Bas<T: Real, const D: usize> {
    settings: BasSettings<T>,
    progress: SearchProgress<T, D>,
    random: Random,
    /// Position in the objective's units, inside the box.
    position: [T; D],
    direction: [T; D],
    step_length: T,
    stage: Stage<T>,
}

impl<T: Real, const D: usize> Bas<T, D> {
    /// Places a beetle at random in the objective's box; nothing is evaluated yet.
    pub fn new(
        objective: &impl Objective<T>,
        settings: BasSettings<T>,
        seed: u64,
    ) -> Result<Self, SwarmError> {
        not_negative("first_step", settings.first_step)?;
        not_negative("step_decay", settings.step_decay)?;
        not_negative("step_offset", settings.step_offset)?;
        positive("step_per_whisker", settings.step_per_whisker)?;
        let progress = SearchProgress::<T, D>::open(objective)?;
        let mut random = Random::new(seed);
        let mut point = [T::zero(); D];
        for entry in live_mut(&mut point, progress.dimension()) {
            *entry = random.uniform();
        }
        let position = progress.to_position(&point);
        Ok(Self {
            settings,
            progress,
            random,
            position,
            direction: [T::zero(); D],
            step_length: settings.first_step,
            stage: Stage::Initial,
        })
    }

    /// Draws a direction by Eq. (23). Should all entries be zero, the iteration has no effect.
    fn turn(&mut self) {
        let direction = live_mut(&mut self.direction, self.progress.dimension());
        for entry in direction.iter_mut() {
            *entry = self.random.signed();
        }
        let length = sqrt(dot(direction, direction));
        if length > T::zero() {
            scale(direction, T::one() / length);
        }
    }

    /// Position moved by a signed length along the direction, then to the nearest point of the box.
    fn shifted(&self, length: T) -> [T; D] {
        let mut position = self.position;
        let dimension = self.progress.dimension();
        add_scaled(live_mut(&mut position, dimension), length, live(&self.direction, dimension));
        self.progress.nearest(position)
    }

    fn step(&mut self, objective: &impl Objective<T>) {
        let whisker = self.step_length / self.settings.step_per_whisker;
        self.stage = match self.stage {
            Stage::Initial => {
                self.progress.evaluate_position(objective, self.position);
                Stage::LeftWhisker
            }
            Stage::LeftWhisker => {
                self.turn();
                Stage::RightWhisker {
                    left: self.progress.evaluate_position(objective, self.shifted(whisker)),
                }
            }
            Stage::RightWhisker { left } => {
                let right = self.progress.evaluate_position(objective, self.shifted(-whisker));
                Stage::Move { smell: sign(left - right) }
            }
            Stage::Move { smell } => {
                self.position = self.shifted(-self.step_length * smell);
                self.progress.evaluate_position(objective, self.position);
                self.step_length = self.settings.step_decay * self.step_length + self.settings.step_offset;
                self.progress.close_iteration();
                Stage::LeftWhisker
            }
        };
    }
}

impl<T: Real, const D: usize> Search<T> for Bas<T, D> {
    fn advance(&mut self, objective: &impl Objective<T>, evaluations: u32) -> u32 {
        if !self.progress.accepts(objective) {
            return 0;
        }
        for _ in 0..evaluations {
            self.step(objective);
        }
        evaluations
    }
    fn best(&self) -> Option<Best<'_, T>> {
        self.progress.best()
    }
    fn iterations(&self) -> u32 {
        self.progress.iterations()
    }
    fn evaluations(&self) -> u32 {
        self.progress.evaluations()
    }
}

#[cfg(test)]
mod tests {
    use core::cell::RefCell;

    use super::*;
    use crate::real::abs;

    /// Cost with a slope along a line; stores the evaluated positions.
    struct Slope(RefCell<Vec<f64>>);

    impl Objective<f64> for Slope {
        fn dimension(&self) -> usize {
            1
        }
        fn bounds(&self, _coordinate: usize) -> (f64, f64) {
            (-1e3, 1e3)
        }
        fn evaluate(&self, position: &[f64]) -> f64 {
            self.0.borrow_mut().push(position[0]);
            position[0]
        }
    }

    #[test]
    fn whiskers_and_steps_follow_their_equations() {
        let slope = Slope(RefCell::default());
        let mut beetle = Bas::<f64, 1>::new(&slope, BasSettings::default(), 2).expect("a valid box");
        beetle.advance(&slope, 1 + 3 * 20);
        assert_eq!(beetle.iterations(), 20);
        let positions = slope.0.borrow();
        let (mut at, mut step) = (positions[0], 1.0);
        for iteration in positions[1..].chunks(3) {
            // Positions up to 1e3 leave 1e-13 of rounding.
            assert!(abs(abs(iteration[0] - iteration[1]) - 0.2 * step) < 1e-12, "Eqs (21), (26)");
            assert!(abs(iteration[0] + iteration[1] - 2.0 * at) < 1e-12, "Eq. (21)");
            assert!(abs(iteration[2] - (at - step)) < 1e-12, "Eq. (24): downhill by one step");
            at = iteration[2];
            step = 0.95 * step + 0.005;
        }
    }
}
