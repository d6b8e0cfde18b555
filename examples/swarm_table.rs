//! Prints what each search needs to come within 0.1 of the minimum of each test function.
//!
//! `cargo run --release --example swarm_table -- [runs] [first seed]`
//!
//! Iterations are the median and the 95th percentile over all runs, "-" where fewer runs succeed within 1,000;
//! evaluations are the median, whiskers, first placing and restarts counted. Searches differ in evaluations per
//! iteration (3 for bas, 20 for pso, 60 for bso-paper, 20 + 2 min(20, D) for bso): compare the evaluations.

use scarab::real::Real;
use scarab::swarm::{
    Bas, BasSettings, Bso, BsoSettings, Pso, PsoSettings, Search, SwarmError, TestFunction, TestProblem,
};

const BEETLES: usize = 20;
const CAPACITY: usize = 30;
const TOLERANCE: f64 = 0.1;
const ITERATIONS: u32 = 1_000;

const PROBLEMS: [(TestFunction, usize); 16] = [
    (TestFunction::Sphere, 2),
    (TestFunction::SixHumpCamel, 2),
    (TestFunction::Branin, 2),
    (TestFunction::Ackley, 2),
    (TestFunction::Sphere, 30),
    (TestFunction::Ackley, 30),
    (TestFunction::ShiftedRotatedAckley, 2),
    (TestFunction::ShiftedRotatedAckley, 30),
    (TestFunction::ShiftedEllipsoid, 30),
    (TestFunction::Rosenbrock, 10),
    (TestFunction::ShiftedGriewank, 30),
    (TestFunction::ShiftedSchwefel, 30),
    (TestFunction::Levy, 10),
    (TestFunction::Rastrigin, 2),
    (TestFunction::Rastrigin, 10),
    (TestFunction::AckleyAsPrinted, 2),
];

/// Iterations and evaluations of one run, `None` where it did not come close enough.
type Outcome = Option<(u32, u32)>;

fn main() -> Result<(), SwarmError> {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>().ok());
    let runs = arguments.next().flatten().unwrap_or(40);
    let first_seed = arguments.next().flatten().unwrap_or(1);
    println!("{runs} runs from seed {first_seed}, to f - f* <= {TOLERANCE}, at most {ITERATIONS} iterations");
    println!(
        "{:<21} {:>2} {:<4} {:<10} {:>6} {:>6} {:>11} {:>9}",
        "function", "D", "", "search", "median", "95 %", "evaluations", "success"
    );
    for (function, dimension) in PROBLEMS {
        let problem = TestProblem::new(function, dimension);
        for search in ["pso", "bas", "bso-paper", "bso"] {
            report::<f64>("f64", search, problem, dimension, runs, first_seed)?;
        }
        report::<f32>("f32", "bso", problem, dimension, runs, first_seed)?;
    }
    Ok(())
}

fn report<T: Real>(
    precision: &str,
    search: &str,
    problem: TestProblem,
    dimension: usize,
    runs: u64,
    first_seed: u64,
) -> Result<(), SwarmError> {
    let outcomes = (0..runs)
        .map(|run| run_one::<T>(search, problem, first_seed + run))
        .collect::<Result<Vec<_>, _>>()?;
    let successes = outcomes.iter().flatten().count();
    println!(
        "{:<21} {:>2} {:<4} {:<10} {:>6} {:>6} {:>11} {:>7.1} %",
        format!("{:?}", problem.function()),
        dimension,
        precision,
        search,
        quantile(&outcomes, 0.5, |outcome| outcome.0),
        quantile(&outcomes, 0.95, |outcome| outcome.0),
        quantile(&outcomes, 0.5, |outcome| outcome.1),
        100.0 * successes as f64 / runs as f64,
    );
    Ok(())
}

fn run_one<T: Real>(search: &str, problem: TestProblem, seed: u64) -> Result<Outcome, SwarmError> {
    Ok(match search {
        "pso" => run(Pso::<T, BEETLES, CAPACITY>::new(&problem, PsoSettings::default(), seed)?, problem),
        "bas" => run(Bas::<T, CAPACITY>::new(&problem, BasSettings::default(), seed)?, problem),
        "bso-paper" => run(Bso::<T, BEETLES, CAPACITY>::new(&problem, BsoSettings::paper(), seed)?, problem),
        _ => run(Bso::<T, BEETLES, CAPACITY>::new(&problem, BsoSettings::default(), seed)?, problem),
    })
}

fn run<T: Real>(mut search: impl Search<T>, problem: TestProblem) -> Outcome {
    let goal = T::of(problem.minimum() + TOLERANCE);
    search.reach(&problem, goal, ITERATIONS).then(|| (search.iterations(), search.evaluations()))
}

/// Smallest count that a share of all runs, failed ones included, does not exceed.
fn quantile(outcomes: &[Outcome], share: f64, count: impl Fn(&(u32, u32)) -> u32) -> String {
    let mut counts: Vec<u32> = outcomes.iter().flatten().map(count).collect();
    counts.sort_unstable();
    let rank = (share * outcomes.len() as f64).ceil() as usize;
    counts.get(rank.max(1) - 1).map_or_else(|| String::from("-"), u32::to_string)
}
