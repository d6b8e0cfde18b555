//! The default beetle swarm on rotated functions whose minimum lies anywhere in the box (results in
//! `docs/results/bso.md`).
//!
//! `cargo run --release --example swarm_rotated -- [runs] [first seed]`
//!
//! Double precision unless named otherwise, at most 2,000 evaluations per dimension. Every run has its own
//! rotation and minimum. No test uses these seeds, and no setting was chosen with them.

use std::sync::Mutex;
use std::thread;

use scarab::real::Real;
use scarab::swarm::{AdaptiveSettings, SwarmError};

use crate::functions::{Instance, Shape, quantile};

mod functions;

const FIRST_SEED: u64 = 700_000_001;
const THREADS: usize = 2;

/// Name, function, whether it is rotated, scale, constant that is added, goal above the minimum, dimensions.
type Row = (&'static str, Shape, bool, f64, f64, f64, &'static [usize]);

const ROWS: [Row; 15] = [
    ("ellipsoid", Shape::Ellipsoid, true, 1.0, 0.0, 1e-6, &[2, 10, 30]),
    ("ellipsoid + 1000", Shape::Ellipsoid, true, 1.0, 1e3, 1e-6, &[10]),
    ("discus", Shape::Discus, true, 1.0, 0.0, 1e-6, &[10, 30]),
    ("bent cigar", Shape::BentCigar, true, 1.0, 0.0, 1e-6, &[2, 10, 30]),
    ("bent cigar + 1000", Shape::BentCigar, true, 1.0, 1e3, 1e-6, &[10]),
    ("sharp ridge", Shape::SharpRidge, true, 1.0, 0.0, 1e-6, &[2, 10, 20]),
    ("sharp ridge, y = p", Shape::ScaledRidge, true, 1.0, 0.0, 1e-6, &[10]),
    ("powers", Shape::Powers, true, 1.0, 0.0, 1e-6, &[10]),
    ("Rosenbrock along the box", Shape::Rosenbrock, false, 1.0, 0.0, 1e-6, &[10, 30]),
    ("Rastrigin", Shape::Rastrigin, true, 1.0, 0.0, 0.1, &[2, 10, 20, 30]),
    ("Rastrigin, s = 1/2", Shape::Rastrigin, true, 0.5, 0.0, 0.1, &[10]),
    ("Rastrigin, s = 2", Shape::Rastrigin, true, 2.0, 0.0, 0.1, &[10]),
    ("Rastrigin, s = 3", Shape::Rastrigin, true, 3.0, 0.0, 0.1, &[10]),
    ("Rastrigin along the box", Shape::Rastrigin, false, 1.0, 0.0, 0.1, &[10]),
    ("Ackley", Shape::Ackley, true, 1.0, 0.0, 0.1, &[10, 30]),
];

/// Rows in single precision.
const SINGLE: [Row; 6] = [
    ("ellipsoid, single precision", Shape::Ellipsoid, true, 1.0, 0.0, 1e-3, &[10]),
    ("bent cigar, single precision", Shape::BentCigar, true, 1.0, 0.0, 1e-3, &[10]),
    ("sharp ridge, single precision", Shape::SharpRidge, true, 1.0, 0.0, 1e-3, &[10]),
    ("Rosenbrock along the box, single precision", Shape::Rosenbrock, false, 1.0, 0.0, 1e-3, &[10, 30]),
    ("Rastrigin, single precision", Shape::Rastrigin, true, 1.0, 0.0, 0.1, &[10]),
    ("Ackley, single precision", Shape::Ackley, true, 1.0, 0.0, 0.1, &[30]),
];

type Line = fn(&Row, usize, u64, u64) -> Result<String, SwarmError>;

fn main() -> Result<(), SwarmError> {
    let mut arguments = std::env::args().skip(1).map(|argument| argument.parse::<u64>().ok());
    let runs = arguments.next().flatten().unwrap_or(40).max(1);
    let first_seed = arguments.next().flatten().unwrap_or(FIRST_SEED);
    println!("{runs} runs from seed {first_seed}\n");
    println!(
        "| function, to | D | runs that arrive | evaluations, median | 90 % |\n| --- | --- | --- | --- | --- |"
    );
    let double = ROWS.iter().map(|row| (row, line::<f64> as Line));
    let rows = double.chain(SINGLE.iter().map(|row| (row, line::<f32> as Line)));
    let cases: Vec<(&Row, Line, usize)> =
        rows.flat_map(|(row, line)| row.6.iter().map(move |dimension| (row, line, *dimension))).collect();
    let lines = Mutex::new(vec![Ok(String::new()); cases.len()]);
    let next = Mutex::new(0..cases.len());
    thread::scope(|scope| {
        for _ in 0..THREADS {
            scope.spawn(|| {
                while let Some(index) = next.lock().ok().and_then(|mut next| next.next()) {
                    let (row, line, dimension) = cases[index];
                    let line = line(row, dimension, runs, first_seed);
                    if let Ok(mut lines) = lines.lock() {
                        lines[index] = line;
                    }
                }
            });
        }
    });
    for line in lines.into_inner().unwrap_or_default() {
        println!("{}", line?);
    }
    Ok(())
}

fn line<T: Real>(row: &Row, dimension: usize, runs: u64, first_seed: u64) -> Result<String, SwarmError> {
    let (name, shape, is_rotated, scale, constant, goal, _) = *row;
    let mut arrived = Vec::new();
    for seed in first_seed..first_seed + runs {
        let cost = Instance { scale, constant, ..Instance::new(shape, dimension, is_rotated, seed) };
        arrived.extend(cost.evaluations(AdaptiveSettings::<T>::default(), goal, seed)?);
    }
    let count = arrived.len();
    let [median, most] = [0.5, 0.9].map(|share| quantile(&mut arrived, runs, share));
    Ok(format!("| {name}, {goal:e} | {dimension} | {count} of {runs} | {median} | {most} |"))
}
