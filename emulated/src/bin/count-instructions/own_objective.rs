//! A user's own objective on the microcontroller: the file of the example `damped_oscillation`, minimised.

use core::hint::black_box;

use cortex_m_semihosting::hprintln;
use scarab::swarm::{Bso, BsoSettings};

use crate::counter::{Tally, count};
use crate::objective::{DampedOscillation, UNKNOWNS, oscillation};

const BEETLES: usize = 20;

/// Prints one line; `None` if the oscillation was not found.
#[inline(never)]
pub fn report() -> Option<()> {
    const TRUTH: [f32; UNKNOWNS] = [2.0, 0.8, 9.0, 0.7, 0.2];
    let samples: [f32; 100] = core::array::from_fn(|index| oscillation(&TRUTH, index as f32 * 0.02));
    let cost = DampedOscillation { samples: &samples, interval: 0.02 };
    let mut swarm = Bso::<f32, BEETLES, UNKNOWNS>::new(&cost, BsoSettings::default(), 1).ok()?;
    let mut tally = Tally::default();
    for _ in 0..5_000 {
        let (instructions, _) = count(|| black_box(&mut swarm).advance(&cost, 1));
        tally.push(instructions);
        if swarm.best().is_some_and(|best| best.value < 1e-4) {
            hprintln!(
                "a damped oscillation, {} samples, cost below 1e-4 after {} evaluations, {} million instructions",
                samples.len(),
                swarm.evaluations(),
                u64::from(tally.mean()) * u64::from(tally.number()) / 1_000_000
            );
            return Some(());
        }
    }
    None
}
