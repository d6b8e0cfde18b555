//! Ablation study of the default beetle swarm: one part is disabled at a time (results in
//! `docs/results/bso.md`).
//!
//! `cargo run --release --example swarm_ablation -- [runs] [first seed]`
//!
//! A cell holds the iterations to f - f* <= 0.1: median and 95 % quantile of all runs, at most 1,000
//! iterations. A failed run counts as infinite and is shown as "-" with the share of successes. No test and
//! no table of `docs/results/paper.md` uses these seeds, and no setting was chosen with them.

use std::sync::Mutex;
use std::thread;

use scarab::real::{Real, sqrt};
use scarab::swarm::{
    AdaptiveSettings, Bso, BsoSettings, Objective, Part, Random, Search, SwarmError, TestFunction,
    TestProblem,
};

use crate::functions::{Instance, Shape, quantile};

#[path = "swarm_rotated/functions.rs"]
#[allow(dead_code, reason = "the other example uses more of it")]
mod functions;

const BEETLES: usize = 20;
const CAPACITY: usize = 30;
const TOLERANCE: f64 = 0.1;
const ITERATIONS: u32 = 1_000;
const FIRST_SEED: u64 = 300_000_001;
const THREADS: usize = 2;

const PROBLEMS: [(TestFunction, usize); 9] = [
    (TestFunction::SixHumpCamel, 2),
    (TestFunction::Ackley, 2),
    (TestFunction::Ackley, 30),
    (TestFunction::ShiftedRotatedAckley, 30),
    (TestFunction::ShiftedEllipsoid, 30),
    (TestFunction::Rosenbrock, 10),
    (TestFunction::Levy, 10),
    (TestFunction::Rastrigin, 2),
    (TestFunction::Rastrigin, 10),
];

fn main() -> Result<(), SwarmError> {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>().ok());
    let runs = arguments.next().flatten().unwrap_or(40).max(1);
    let first_seed = arguments.next().flatten().unwrap_or(FIRST_SEED);
    println!("{runs} runs from seed {first_seed}\n");
    let names = PROBLEMS.map(|(function, dimension)| format!("{function:?} {dimension}"));
    println!("| without | {} |\n|{}", names.join(" | "), " --- |".repeat(PROBLEMS.len() + 1));
    let variants = variants::<f64>();
    let lines = Mutex::new(vec![String::new(); variants.len()]);
    let next = Mutex::new(0..variants.len());
    thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some(index) = next.lock().ok().and_then(|mut next| next.next()) {
                    let (name, settings) = &variants[index];
                    if let (Ok(line), Ok(mut lines)) = (line(name, *settings, runs, first_seed), lines.lock())
                    {
                        lines[index] = line;
                    }
                }
            });
        }
    });
    for line in lines.into_inner().unwrap_or_default() {
        println!("{line}");
    }
    println!("{}", line::<f32>("nothing, single precision", AdaptiveSettings::default(), runs, first_seed)?);
    plane(runs, first_seed)?;
    rotated(runs, first_seed)?;
    noise(runs, first_seed)
}

/// The complete swarm, and every part that can be disabled.
fn variants<T: Real>() -> Vec<(&'static str, AdaptiveSettings<T>)> {
    let whole = AdaptiveSettings::default();
    let without = |part| AdaptiveSettings { without: Some(part), ..whole };
    let still = AdaptiveSettings {
        inertia_weight: T::zero(),
        individual_learning: T::zero(),
        global_learning: T::zero(),
        ..whole
    };
    vec![
        ("nothing", whole),
        ("parabola: one whisker downhill", without(Part::Parabola)),
        ("sharing: own direction only", without(Part::Sharing)),
        ("learned metric", without(Part::Metric)),
        ("convexity gate", without(Part::ConvexityGate)),
        ("retreat", without(Part::Retreat)),
        ("whisker adaptation: 5 % shorter each time", without(Part::WhiskerAdaptation)),
        ("kink: whiskers shrink at kinks too", without(Part::Kink)),
        ("distance of beetles: no whisker for it", without(Part::Distance)),
        ("pair directions", AdaptiveSettings { pair_directions: 0, ..whole }),
        ("gradient direction", without(Part::GradientDirection)),
        ("trust adaptation: full trust", without(Part::TrustAdaptation)),
        ("ranking: always the same readers", without(Part::Ranking)),
        ("moves for the best: all move in every round", without(Part::BestMove)),
        ("velocity", still),
        ("four failed leaps: eight", AdaptiveSettings { leaps: 8, ..whole }),
        ("leaps: scattered after 25 iterations", AdaptiveSettings { leaps: 0, patience: 25, ..whole }),
        ("leaps and scattering", AdaptiveSettings { patience: u32::MAX, ..whole }),
    ]
}

fn line<T: Real>(
    name: &str,
    settings: AdaptiveSettings<T>,
    runs: u64,
    first_seed: u64,
) -> Result<String, SwarmError> {
    let mut line = format!("| {name} |");
    for (function, dimension) in PROBLEMS {
        let problem = TestProblem::new(function, dimension);
        let goal = T::from_double(problem.minimum() + TOLERANCE);
        let mut reached = Vec::new();
        for seed in first_seed..first_seed + runs {
            let settings = BsoSettings::Adaptive(settings);
            let mut swarm = Bso::<T, BEETLES, CAPACITY>::new(&problem, settings, seed)?;
            if swarm.reach(&problem, goal, ITERATIONS) {
                reached.push(swarm.iterations());
            }
        }
        line += &format!(" {} |", cell(reached, runs));
    }
    Ok(line)
}

fn cell(mut reached: Vec<u32>, runs: u64) -> String {
    let success = success(reached.len(), runs);
    format!("{}/{}{success}", quantile(&mut reached, runs, 0.5), quantile(&mut reached, runs, 0.95))
}

/// Share of runs that arrive, in brackets; empty where all do.
fn success(arrived: usize, runs: u64) -> String {
    let share = 100.0 * arrived as f64 / runs as f64;
    if arrived as u64 == runs { String::new() } else { format!(" ({share:.1} %)") }
}

/// Evaluations in the plane, where a round moves few of the beetles: to f - f* <= 0.1, median.
fn plane(runs: u64, first_seed: u64) -> Result<(), SwarmError> {
    const PLANE: [TestFunction; 7] = [
        TestFunction::Sphere,
        TestFunction::SixHumpCamel,
        TestFunction::Branin,
        TestFunction::Ackley,
        TestFunction::ShiftedRotatedAckley,
        TestFunction::CamelAsPrinted,
        TestFunction::Rastrigin,
    ];
    let names = PLANE.map(|function| format!("{function:?}"));
    println!("\n| evaluations, D = 2 | {} |\n|{}", names.join(" | "), " --- |".repeat(PLANE.len() + 1));
    for (name, without) in [("the best move", None), ("all move", Some(Part::BestMove))] {
        let mut line = format!("| {name} |");
        for function in PLANE {
            let problem = TestProblem::new(function, 2);
            let goal = problem.minimum() + TOLERANCE;
            let mut evaluations = Vec::new();
            for seed in first_seed..first_seed + runs {
                let settings =
                    BsoSettings::Adaptive(AdaptiveSettings { without, ..AdaptiveSettings::default() });
                let mut swarm = Bso::<f64, BEETLES, CAPACITY>::new(&problem, settings, seed)?;
                let has_arrived =
                    |swarm: &Bso<f64, BEETLES, CAPACITY>| swarm.best().is_some_and(|best| best.value <= goal);
                while !has_arrived(&swarm) && swarm.iterations() < ITERATIONS {
                    swarm.advance(&problem, 1);
                }
                evaluations.push(if has_arrived(&swarm) { swarm.evaluations() } else { u32::MAX });
            }
            evaluations.sort_unstable();
            line += &format!(" {} |", evaluations[(runs as usize).div_ceil(2) - 1]);
        }
        println!("{line}");
    }
    Ok(())
}

/// Median of evaluations of the whole swarm and its variants on rotated functions.
fn rotated(runs: u64, first_seed: u64) -> Result<(), SwarmError> {
    const ROTATED: [(&str, Shape, usize, f64); 6] = [
        ("ellipsoid 10", Shape::Ellipsoid, 10, 1e-6),
        ("bent cigar 10", Shape::BentCigar, 10, 1e-6),
        ("sharp ridge 10", Shape::SharpRidge, 10, 1e-6),
        ("powers 10", Shape::Powers, 10, 1e-6),
        ("Rastrigin 10", Shape::Rastrigin, 10, 0.1),
        ("Ackley 10", Shape::Ackley, 10, 0.1),
    ];
    let names = ROTATED.map(|(name, ..)| name).join(" | ");
    println!("\n| without | {names} |\n|{}", " --- |".repeat(ROTATED.len() + 1));
    for (name, settings) in variants::<f64>() {
        let mut line = format!("| {name} |");
        for (_, shape, dimension, goal) in ROTATED {
            let mut arrived = Vec::new();
            for seed in first_seed..first_seed + runs {
                arrived
                    .extend(Instance::new(shape, dimension, true, seed).evaluations(settings, goal, seed)?);
            }
            let success = success(arrived.len(), runs);
            line += &format!(" {}{success} |", quantile(&mut arrived, runs, 0.5));
        }
        println!("{line}");
    }
    Ok(())
}

/// A test function with independent noise in every call.
struct Noisy {
    problem: TestProblem,
    size: f64,
    random: std::cell::RefCell<Random>,
}

impl Objective<f64> for Noisy {
    fn dimension(&self) -> usize {
        Objective::<f64>::dimension(&self.problem)
    }
    fn bounds(&self, coordinate: usize) -> (f64, f64) {
        self.problem.bounds(coordinate)
    }
    fn evaluate(&self, position: &[f64]) -> f64 {
        // variance 1/3
        let bell: f64 = self.random.borrow_mut().bell();
        let value: f64 = self.problem.evaluate(position);
        value + self.size * sqrt(3.0) * bell
    }
}

/// Median of the true value at the reported best, above the minimum, after 150 iterations.
fn noise(runs: u64, first_seed: u64) -> Result<(), SwarmError> {
    const SIZES: [f64; 4] = [0.0, 0.01, 0.1, 1.0];
    println!("\n| standard deviation of the noise | 0 | 0.01 | 0.1 | 1 |\n| --- | --- | --- | --- | --- |");
    for (function, dimension) in [
        (TestFunction::Sphere, 30),
        (TestFunction::Ackley, 30),
        (TestFunction::ShiftedEllipsoid, 30),
        (TestFunction::Rosenbrock, 10),
    ] {
        let problem = TestProblem::new(function, dimension);
        let mut line = format!("| {function:?} {dimension} |");
        for size in SIZES {
            let mut values = Vec::new();
            for seed in first_seed..first_seed + runs {
                let noisy = Noisy { problem, size, random: Random::new(!seed).into() };
                let settings = BsoSettings::default();
                let mut swarm = Bso::<f64, BEETLES, CAPACITY>::new(&noisy, settings, seed)?;
                swarm.reach(&noisy, f64::MIN, 150);
                let found = swarm.best().map_or(f64::INFINITY, |best| problem.evaluate(best.position));
                values.push(found - problem.minimum());
            }
            values.sort_by(f64::total_cmp);
            line += &format!(" {:.1e} |", values[values.len() / 2]);
        }
        println!("{line}");
    }
    Ok(())
}
