//! Searches of Table IV: the firmware's own, and those of two other crates in their default form.
//!
//! | name | search | constants | iterations | evaluations at most |
//! | --- | --- | --- | --- | --- |
//! | `pso` | particle swarm, 20 particles | the paper's: w 0.8, c 1.4 | one move of all | E |
//! | `pso-constriction` | as `pso` | w 0.7298, c 1.496 (Clerc, Kennedy, 2002) | one move of all | E |
//! | `bas` | beetle antennae search | the paper's | one step | 3,001: the paper's 1,000 iterations |
//! | `bso-paper` | beetle swarm as printed, 20 beetles | the paper's | one move of all | 60,020 |
//! | `bso` | the default beetle swarm, 20 beetles | its own | rounds of its best | 1,000 iterations |
//! | `cma-es` | crate `cmaes`, population 4 + 3 ln D, active | its own | one generation | E |
//! | `cma-es-20` | as `cma-es`, population 20 | its own | one generation | E |
//! | `cma-es-restarts` | `cma-es` with restarts | its own | one generation | E |
//! | `pso-argmin` | crate `argmin`, 20 particles | its own: those of SPSO 2011 | one move of all | E |
//!
//! Equation (29) of `bso-paper` is corrected; its 60,020 evaluations are 1,000 iterations. A round
//! of `bso` takes at least 20 evaluations. `cma-es-restarts` restarts with twice the population
//! where `cma-es` ends (Auger, Hansen, 2005).
//!
//! E = 20 + 1,000 (20 + 2 min(20, D)) is the number of evaluations of 1,000 usual iterations of the
//! default swarm. In the dimensions of Table IV these are 24,020 (D = 2) and 60,020 (D = 10 and
//! 30). Leaps and scattering cost more, up to 6 % at D = 2 where the swarm stagnates.
//!
//! All searches start in the same box. Swarms scatter uniformly; CMA-ES draws its centre uniformly and
//! begins with a sigma of 0.3 of the box's width. Outside the box CMA-ES receives the value at the nearest
//! point of it, plus the squared distance to it in the coordinates' unit. Swarms stay inside by themselves.
//! A first scattered swarm is iteration 0; CMA-ES has none, its first generation is iteration 1.

use argmin::core::{CostFunction, Error, Executor, PopulationState};
use argmin::solver::particleswarm::{Particle, ParticleSwarm};
use cmaes::{CMAESOptions, DVector};
use rand::SeedableRng;
use rand::rngs::StdRng;
use scarab::real::Real;
use scarab::swarm::{
    Bas, BasSettings, Bso, BsoSettings, InertiaWeight, Objective, Pso, PsoSettings, Search, SwarmError,
};
use scarab_base::error::ToolError;
use serde::{Serialize, Serializer};

use super::problems::MOST_COORDINATES;
use super::recorder::Recorder;

/// Beetles and particles of every swarm.
pub const SWARM: u32 = 20;
/// Iterations of the default swarm, and of the paper's searches.
pub const ITERATIONS: u32 = 1_000;
/// Initial standard deviation of CMA-ES, share of the box's width.
const FIRST_SIGMA: f64 = 0.3;
/// Limit of a population: more than any budget here.
const LARGEST_POPULATION: usize = 1 << 16;

/// A search of Table IV.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Algorithm {
    /// Particle swarm, the paper's constants.
    Pso,
    /// Particle swarm, constriction constants.
    PsoConstriction,
    /// Particle swarm of the crate `argmin`.
    PsoArgmin,
    /// Beetle antennae search.
    Bas,
    /// Beetle swarm as printed.
    BsoPaper,
    /// The default beetle swarm.
    Bso,
    /// CMA-ES with its default population.
    CmaEs,
    /// CMA-ES with a population of 20.
    CmaEsTwenty,
    /// CMA-ES with restarts.
    CmaEsRestarts,
}

impl Algorithm {
    /// All searches, in the order of the report.
    pub const ALL: [Self; 9] = [
        Self::Pso,
        Self::PsoConstriction,
        Self::PsoArgmin,
        Self::Bas,
        Self::BsoPaper,
        Self::Bso,
        Self::CmaEs,
        Self::CmaEsTwenty,
        Self::CmaEsRestarts,
    ];

    /// Name in the report.
    pub const fn id(self) -> &'static str {
        match self {
            Self::Pso => "pso",
            Self::PsoConstriction => "pso-constriction",
            Self::PsoArgmin => "pso-argmin",
            Self::Bas => "bas",
            Self::BsoPaper => "bso-paper",
            Self::Bso => "bso",
            Self::CmaEs => "cma-es",
            Self::CmaEsTwenty => "cma-es-20",
            Self::CmaEsRestarts => "cma-es-restarts",
        }
    }
}

impl Serialize for Algorithm {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.id())
    }
}

/// Evaluations of 1,000 usual iterations of the default swarm, in the dimensions of Table IV.
pub fn budget(dimension: usize) -> u32 {
    SWARM + ITERATIONS * (SWARM + 2 * SWARM.min(dimension as u32))
}

/// Runs one of the firmware's searches until the recorder has seen all goals or the budget is spent.
pub fn run_own<T: Real>(
    algorithm: Algorithm,
    recorder: &Recorder<'_, T, impl Objective<T>>,
    seed: u64,
) -> Result<(), ToolError> {
    const D: usize = MOST_COORDINATES;
    const N: usize = SWARM as usize;
    let refused = |error: SwarmError| ToolError::input(format!("{}: {error:?}", algorithm.id()));
    let evaluations = budget(recorder.dimension());
    let pso = |settings| -> Result<(), ToolError> {
        let search = Pso::<T, N, D>::new(recorder, settings, seed).map_err(refused)?;
        follow(search, recorder, SWARM, u32::MAX, evaluations);
        Ok(())
    };
    let bso = |settings| -> Result<(), ToolError> {
        let search = Bso::<T, N, D>::new(recorder, settings, seed).map_err(refused)?;
        follow(search, recorder, SWARM, ITERATIONS, u32::MAX);
        Ok(())
    };
    match algorithm {
        Algorithm::Pso => pso(PsoSettings::default()),
        Algorithm::PsoConstriction => pso(PsoSettings {
            inertia_weight: InertiaWeight::constant(T::from_double(0.7298)),
            individual_learning: T::from_double(1.496),
            global_learning: T::from_double(1.496),
            ..PsoSettings::default()
        }),
        Algorithm::BsoPaper => bso(BsoSettings::paper()),
        Algorithm::Bso => bso(BsoSettings::default()),
        Algorithm::Bas => {
            let search = Bas::<T, D>::new(recorder, BasSettings::default(), seed).map_err(refused)?;
            follow(search, recorder, 1, ITERATIONS, u32::MAX);
            Ok(())
        }
        Algorithm::CmaEs | Algorithm::CmaEsTwenty | Algorithm::CmaEsRestarts | Algorithm::PsoArgmin => {
            Err(ToolError::input("this search runs in double precision only"))
        }
    }
}

/// Runs any search in double precision.
pub fn run(
    algorithm: Algorithm,
    recorder: &Recorder<'_, f64, impl Objective<f64>>,
    seed: u64,
) -> Result<(), ToolError> {
    let default = 4 + (3.0 * (recorder.dimension() as f64).ln()).floor() as usize;
    match algorithm {
        Algorithm::CmaEs => cma_es(recorder, default, false, seed),
        Algorithm::CmaEsTwenty => cma_es(recorder, SWARM as usize, false, seed),
        Algorithm::CmaEsRestarts => cma_es(recorder, default, true, seed),
        Algorithm::PsoArgmin => {
            argmin_swarm(recorder, seed).map_err(|error| ToolError::input(format!("pso-argmin: {error}")))
        }
        own => run_own(own, recorder, seed),
    }
}

/// Drives a search by single evaluations; the first `first` belong to iteration 0.
fn follow<T: Real>(
    mut search: impl Search<T>,
    recorder: &Recorder<'_, T, impl Objective<T>>,
    first: u32,
    iterations: u32,
    evaluations: u32,
) {
    while !recorder.is_done() && search.iterations() < iterations && recorder.evaluations() < evaluations {
        recorder.begin(if recorder.evaluations() < first { 0 } else { search.iterations() + 1 });
        if search.advance(recorder, 1) == 0 {
            return;
        }
    }
}

/// Drives CMA-ES by generations; when its own criteria end it, the run ends or restarts.
fn cma_es(
    recorder: &Recorder<'_, f64, impl Objective<f64>>,
    mut population: usize,
    has_restarts: bool,
    seed: u64,
) -> Result<(), ToolError> {
    let mut random = StdRng::seed_from_u64(seed);
    let bounds: Vec<_> = (0..recorder.dimension()).map(|coordinate| recorder.bounds(coordinate)).collect();
    let width = bounds.iter().map(|(low, high)| high - low).fold(0.0, f64::max);
    let most = budget(recorder.dimension());
    let mut generation = 0;
    loop {
        let centre: Vec<f64> =
            bounds.iter().map(|(low, high)| rand::Rng::random_range(&mut random, *low..*high)).collect();
        let mut state = CMAESOptions::new(centre, FIRST_SIGMA * width)
            .population_size(population)
            .seed(rand::Rng::random(&mut random))
            .build(|position: &DVector<f64>| inside(recorder, &bounds, position.as_slice()))
            .map_err(|error| ToolError::input(format!("cma-es: {error:?}")))?;
        loop {
            if recorder.is_done() || recorder.evaluations() >= most {
                return Ok(());
            }
            generation += 1;
            recorder.begin(generation);
            if state.next().is_some() {
                break;
            }
        }
        if !has_restarts {
            return Ok(());
        }
        population = (2 * population).min(LARGEST_POPULATION);
    }
}

/// Value at the nearest point of the box plus the squared distance to it.
fn inside(objective: &impl Objective<f64>, bounds: &[(f64, f64)], position: &[f64]) -> f64 {
    let nearest: Vec<f64> =
        position.iter().zip(bounds).map(|(x, (low, high))| x.clamp(*low, *high)).collect();
    let distance: f64 = position.iter().zip(&nearest).map(|(x, near)| (x - near) * (x - near)).sum();
    objective.evaluate(&nearest) + distance
}

/// Objective for `argmin`.
struct Cost<'r, 'o, O>(&'r Recorder<'o, f64, O>);

impl<O: Objective<f64>> CostFunction for Cost<'_, '_, O> {
    type Param = Vec<f64>;
    type Output = f64;

    fn cost(&self, position: &Self::Param) -> Result<f64, Error> {
        self.0.begin(self.0.evaluations() / SWARM);
        Ok(self.0.evaluate(position))
    }
}

fn argmin_swarm(recorder: &Recorder<'_, f64, impl Objective<f64>>, seed: u64) -> Result<(), Error> {
    let (low, high) = (0..recorder.dimension()).map(|coordinate| recorder.bounds(coordinate)).unzip();
    let solver = ParticleSwarm::<Vec<f64>, f64, _>::new((low, high), SWARM as usize)
        .with_rng_generator(StdRng::seed_from_u64(seed));
    let iterations = (budget(recorder.dimension()) / SWARM).into();
    let goal = recorder.last_goal().unwrap_or(f64::NEG_INFINITY);
    Executor::new(Cost(recorder), solver)
        .configure(|state: PopulationState<Particle<Vec<f64>, f64>, f64>| {
            state.max_iters(iterations).target_cost(goal)
        })
        .timer(false)
        .run()?;
    Ok(())
}
