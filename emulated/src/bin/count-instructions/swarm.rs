//! Cost of the default beetle swarm by itself: an iteration, and a search for the sphere's minimum to 0.1.
//!
//! The sphere costs 2 to 3 instructions per coordinate, so nearly the whole count is the swarm's. On the
//! sphere the metric learns in every iteration, which is the swarm's most expensive work.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::swarm::{Bso, BsoSettings, TestFunction, TestProblem};

use crate::counter::{Tally, count, heading};

const BEETLES: usize = 20;
/// Target of the search, f - f*.
const GOAL: f32 = 0.1;
/// Bound of iterations: 1.5 times the worst of 1,000 runs on the host.
const MOST_ITERATIONS: u32 = 40;
/// Least number of counted iterations: the first one has no gradient yet.
const LEAST_ITERATIONS: u32 = 10;

/// Prints the table; `None` if a search does not end.
#[inline(never)]
pub fn report() -> Option<()> {
    heading("default swarm of 20 beetles, sphere");
    searched::<2>()?;
    searched::<10>()?;
    searched::<21>()?;
    searched::<28>()?;
    searched::<30>()
}

#[inline(never)]
fn searched<const D: usize>() -> Option<()> {
    let problem = TestProblem::new(TestFunction::Sphere, D);
    let mut swarm = Bso::<f32, BEETLES, D>::new(&problem, BsoSettings::default(), 1).ok()?;
    let (scattering, _) = count(|| black_box(&mut swarm).advance(&problem, BEETLES as u32));
    let (mut tally, mut total, mut reached) = (Tally::default(), u64::from(scattering), None);
    while reached.is_none() || swarm.iterations() < LEAST_ITERATIONS {
        if swarm.iterations() >= MOST_ITERATIONS {
            return None;
        }
        let (instructions, ()) = count(|| iterate(black_box(&mut swarm), &problem));
        tally.push(instructions);
        total += u64::from(instructions);
        if reached.is_none() && swarm.best().is_some_and(|best| best.value <= GOAL) {
            reached = Some((swarm.iterations(), swarm.evaluations(), total));
        }
    }
    let (iterations, evaluations, total) = reached?;
    let name = match D {
        2 => "one iteration, D = 2, 24 evaluations",
        10 => "one iteration, D = 10, 40 evaluations",
        21 => "one iteration, D = 21, 60 evaluations",
        28 => "one iteration, D = 28, 60 evaluations",
        _ => "one iteration, D = 30, 60 evaluations",
    };
    tally.print(name);
    hprintln!(
        "  to 0.1: {} iterations, {} evaluations, {} thousand instructions",
        iterations,
        evaluations,
        total / 1000
    );
    Some(())
}

/// Advances to the end of the present iteration.
fn iterate<const D: usize>(swarm: &mut Bso<f32, BEETLES, D>, problem: &TestProblem) {
    let before = swarm.iterations();
    while swarm.iterations() == before {
        swarm.advance(problem, 1);
    }
}
