//! The beetle swarm on your own objective: fits a damped oscillation to noisy samples, in single precision.
//!
//! `cargo run --release --example damped_oscillation -- [seed]`
//!
//! The search advances in slices of a few evaluations, as in a task of low priority. It ends when its cost
//! has reached the noise, when its budget is spent, or when it is cancelled. The objective
//! (objective.rs) is generic over the precision.

mod objective;

use objective::{BOX, DampedOscillation, UNKNOWNS, oscillation};
use scarab::swarm::{Bso, BsoSettings, Random, Search, SwarmError};

const TRUTH: [f32; UNKNOWNS] = [2.0, 0.8, 9.0, 0.7, 0.2];
const SAMPLES: usize = 100;
const INTERVAL_S: f32 = 0.02;
/// Standard deviation of the samples' noise.
const NOISE: f32 = 0.05;
/// Evaluations between two checks of the clock and of a cancellation.
const SLICE: u32 = 16;
/// Limit of the evaluations; a fit that needs more has failed.
const BUDGET: u32 = 20_000;

fn main() -> Result<(), SwarmError> {
    let seed = std::env::args().nth(1).and_then(|argument| argument.parse().ok()).unwrap_or(1);
    let mut random = Random::new(!seed);
    let samples: [f32; SAMPLES] = core::array::from_fn(|index| {
        // variance of a bell-shaped number: 1/3
        oscillation(&TRUTH, index as f32 * INTERVAL_S) + NOISE * 1.732 * random.bell::<f32>()
    });
    let cost = DampedOscillation { samples: &samples, interval: INTERVAL_S };
    let mut swarm = Bso::<f32, 20, UNKNOWNS>::new(&cost, BsoSettings::default(), seed)?;

    // Cancelled after a tenth of a second of a slow processor: the best values found until then can be used.
    swarm.advance(&cost, 3 * SLICE);
    let early = swarm.best().map(|best| best.value);
    println!("after {} evaluations: cost {early:?}", swarm.evaluations());

    let good_enough = 1.2 * NOISE * NOISE;
    while swarm.evaluations() < BUDGET && !swarm.best().is_some_and(|best| best.value < good_enough) {
        swarm.advance(&cost, SLICE);
    }
    println!("after {} evaluations, {} iterations:", swarm.evaluations(), swarm.iterations());
    if let Some(best) = swarm.best() {
        for ((&(name, unit, ..), found), truth) in BOX.iter().zip(best.position).zip(TRUTH) {
            println!("  {name:<10} {found:>8.3} {unit:<6} truth {truth}");
        }
        println!("  cost       {:>8.5} noise {:.5}", best.value, NOISE * NOISE);
    }
    println!("memory of the swarm: {} bytes", size_of_val(&swarm));
    Ok(())
}
