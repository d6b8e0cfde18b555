//! Beetle swarm search: particles with two whiskers each, in the adaptive (default) or the paper's mode.
//!
//! Why one type for both: swarm, whiskers, moves, budget and progress are shared. A mode decides only the
//! whiskers' directions and the use of their readings. Evaluations are requested one at a time, so a run can
//! be sliced or cancelled anywhere, even inside an iteration:
//!
//! ```text
//! Initial 0..N --> [ Right 0, Left 0, Right 1, Left 1, ... --> Move 0, 1, ... ] --> next round
//!     ^                                                                         |
//!     +------------------- leaps failed: scatter once more ---------------------+
//! ```
//!
//! A mode decides how many beetles have whiskers and how many move in a round. An iteration takes as many
//! rounds as spend N evaluations, the cost of one move of all beetles. That is one round in the paper's mode,
//! and in the other from five coordinates on.
//!
//! Memory in scalars: 3 N D swarm, 2 D^2 metric, 3 N D frame, 7 D gradient, leap, best and box, 11 N values
//! and readings, and 45 words. The frame uses its first min(N, D) rows. `size_of` is 9,016 bytes for
//! `Bso<f32, 20, 13>` and 21,560 for `Bso<f32, 20, 28>`. Stack, Cortex-M4F, D = 28: `advance` about 1.5 kB.
//! [`Bso::new`] builds the value on the stack before the move (7 kB at opt-level 3, about 45 kB at "s").
//! Cost: adaptive.rs, paper.rs. The longest computation between two evaluations is the end of an adaptive
//! round, 4 D^2 min(N, D) operations (63,000 at D = 28).

mod adaptive;
mod frame;
mod leap;
mod learning;
mod metric;
mod paper;
mod rules;
mod settings;

use crate::real::Real;

use super::objective::{Objective, SwarmError};
use super::particles::Particles;
use super::random::Random;
use super::search::{Best, Search, SearchProgress};
use adaptive::AdaptiveRules;
use paper::PaperRules;
use rules::{Opening, Rules, Side};
pub use settings::{AdaptiveSettings, BsoSettings, PaperSettings, Part};

/// Beetle swarm of `N` beetles (at least 2) with capacity for `D` coordinates.
///
/// ```
/// use scarab::swarm::{Bso, BsoSettings, Search, TestFunction, TestProblem};
///
/// let cost = TestProblem::new(TestFunction::Sphere, 13);
/// let mut swarm = Bso::<f32, 20, 13>::new(&cost, BsoSettings::default(), 1)?;
/// while swarm.iterations() < 40 {
///     swarm.advance(&cost, 7);
/// }
/// assert!(swarm.best().is_some_and(|best| best.value < 0.1));
/// # Ok::<(), scarab::swarm::SwarmError>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Bso<T: Real, const N: usize, const D: usize> {
    swarm: Swarm<T, N, D>,
    mode: Mode<T, N, D>,
}

#[derive(Clone, Debug, PartialEq)]
enum Mode<T: Real, const N: usize, const D: usize> {
    Adaptive(AdaptiveRules<T, N, D>),
    Paper(PaperRules<T, N>),
}

impl<T: Real, const N: usize, const D: usize> Mode<T, N, D> {
    fn new(settings: BsoSettings<T>, dimension: usize) -> Self {
        match settings {
            BsoSettings::Adaptive(settings) => Self::Adaptive(AdaptiveRules::new(settings, dimension)),
            BsoSettings::Paper(settings) => Self::Paper(PaperRules::new(settings)),
        }
    }
}

impl<T: Real, const N: usize, const D: usize> Bso<T, N, D> {
    /// Scatters a swarm over the objective's box; nothing is evaluated yet.
    pub fn new(
        objective: &impl Objective<T>,
        settings: BsoSettings<T>,
        seed: u64,
    ) -> Result<Self, SwarmError> {
        let progress = SearchProgress::open(objective)?;
        settings.check()?;
        let mode = Mode::new(settings, progress.dimension());
        Ok(Self { swarm: Swarm::new(progress, seed), mode })
    }
}

impl<T: Real, const N: usize, const D: usize> Search<T> for Bso<T, N, D> {
    fn advance(&mut self, objective: &impl Objective<T>, evaluations: u32) -> u32 {
        if !self.swarm.progress.accepts(objective) {
            return 0;
        }
        match &mut self.mode {
            Mode::Adaptive(rules) => self.swarm.advance(rules, objective, evaluations),
            Mode::Paper(rules) => self.swarm.advance(rules, objective, evaluations),
        }
        evaluations
    }

    fn best(&self) -> Option<Best<'_, T>> {
        self.swarm.progress.best()
    }

    fn iterations(&self) -> u32 {
        self.swarm.progress.iterations()
    }

    fn evaluations(&self) -> u32 {
        self.swarm.progress.evaluations()
    }
}

/// Next evaluation.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage<T> {
    Initial { beetle: usize },
    Right { beetle: usize },
    Left { beetle: usize, right: T },
    Move { beetle: usize },
}

/// State and order of evaluations shared by both modes.
#[derive(Clone, Debug, PartialEq)]
struct Swarm<T, const N: usize, const D: usize> {
    progress: SearchProgress<T, D>,
    random: Random,
    beetles: Particles<T, N, D>,
    /// Values found by the moves of the current round.
    found: [T; N],
    stage: Stage<T>,
}

impl<T: Real, const N: usize, const D: usize> Swarm<T, N, D> {
    fn new(progress: SearchProgress<T, D>, seed: u64) -> Self {
        let mut random = Random::new(seed);
        let mut beetles = Particles::new(progress.dimension());
        beetles.scatter(&mut random);
        Self { progress, random, beetles, found: [T::zero(); N], stage: Stage::Initial { beetle: 0 } }
    }

    fn advance(&mut self, rules: &mut impl Rules<T, N, D>, objective: &impl Objective<T>, evaluations: u32) {
        for _ in 0..evaluations {
            self.step(rules, objective);
        }
    }

    /// Makes one evaluation and all its consequences.
    fn step(&mut self, rules: &mut impl Rules<T, N, D>, objective: &impl Objective<T>) {
        self.stage = match self.stage {
            Stage::Initial { beetle } => {
                let beetle = beetle.min(N - 1);
                let value = self.progress.evaluate(objective, &self.beetles.position[beetle]);
                self.beetles.record(beetle, value);
                if beetle + 1 < N { Stage::Initial { beetle: beetle + 1 } } else { self.open(rules) }
            }
            Stage::Right { beetle } => {
                rules.aim(beetle, &self.beetles, &mut self.random);
                let tip = rules.tip(beetle, Side::Right, &self.beetles);
                Stage::Left { beetle, right: self.progress.evaluate(objective, &tip) }
            }
            Stage::Left { beetle, right } => {
                let tip = rules.tip(beetle, Side::Left, &self.beetles);
                let left = self.progress.evaluate(objective, &tip);
                rules.smell(beetle, &self.beetles, right, left);
                if beetle + 1 < rules.whiskered() {
                    Stage::Right { beetle: beetle + 1 }
                } else {
                    Stage::Move { beetle: 0 }
                }
            }
            Stage::Move { beetle } => {
                let beetle = beetle.min(N - 1);
                rules.displace(beetle, &mut self.beetles, &mut self.random);
                self.found[beetle] = self.progress.evaluate(objective, &self.beetles.position[beetle]);
                let moved = rules.moved().min(N);
                if beetle + 1 < moved {
                    Stage::Move { beetle: beetle + 1 }
                } else {
                    rules.close(&mut self.beetles, &self.found[..moved]);
                    if rules.closes_iteration() {
                        self.progress.close_iteration();
                    }
                    self.open(rules)
                }
            }
        };
    }

    /// Begins a round, or scatters the swarm where the rules have given up.
    fn open(&mut self, rules: &mut impl Rules<T, N, D>) -> Stage<T> {
        match rules.open(&mut self.beetles) {
            Opening::Search => Stage::Right { beetle: 0 },
            Opening::Scatter => {
                self.beetles.scatter(&mut self.random);
                Stage::Initial { beetle: 0 }
            }
        }
    }
}
