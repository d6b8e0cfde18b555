//! Cost of identification: each 500 Hz sample, closing a motion, and the search.

use core::hint::black_box;
use core::mem::MaybeUninit;

use cortex_m_semihosting::hprintln;
use scarab::ident::{LinkPrior, MotionWindow, Plan, Record, Recorder, SearchState, Solver};
use scarab::model::{JointState, joint_torques};
use scarab::servo::{LOG_RATE_HZ, TICKS_PER_LOG};
use static_cell::ConstStaticCell;

use crate::account::{Account, CYCLES_PER_INSTRUCTION, PROCESSOR_HZ};
use crate::counter::{Tally, count, heading};
use crate::leg::{self, BASE, JOINTS, Model};

/// Design bound of both joints, per sample.
const MOST_INSTRUCTIONS_PER_SAMPLE: u32 = 30_000;
/// Design bound from the end of the motion to the verdict, processor time.
const MOST_SEARCH_S: f32 = 0.5;
const INSTRUCTIONS_PER_S: f32 = PROCESSOR_HZ / CYCLES_PER_INSTRUCTION;

/// Filter size as on the host, for the default leg's bandwidth.
const TAPS: usize = 256;
const PENDING: usize = 26;
/// Noise of the logged torque: 7 % of the mean absolute torque.
const NOISE_NM: [f32; JOINTS] = [2.0, 1.0];
/// More evaluations than any search takes.
const MOST_EVALUATIONS: u32 = 100_000;

/// Nearly normal noise: the sum of twelve uniform numbers.
fn noise(seed: &mut u32) -> f32 {
    let mut sum = -6.0;
    for _ in 0..12 {
        *seed = seed.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        sum += (*seed >> 8) as f32 / 16_777_216.0;
    }
    sum
}

/// Prints the table; returns whether the bounds are met. `None` if the motion cannot be created or recorded.
#[inline(never)]
pub fn report(model: &Model, account: &mut Account) -> Option<bool> {
    heading("identification of two joints, 500 Hz");
    let record = recorded(model, account)?;
    let believed = searched(model, record.clone(), Some(&leg::prior()), "with the prior");
    let unbelieved = searched(model, record, None, "without a prior");
    Some(believed && unbelieved)
}

#[inline(never)]
fn recorded(model: &Model, account: &mut Account) -> Option<Record<f32, JOINTS, BASE>> {
    let (motion, truth, scales) = (leg::excitation()?, leg::truth(), leg::scales());
    type Window = MotionWindow<f32, JOINTS, BASE>;
    static WINDOW: ConstStaticCell<Window> = ConstStaticCell::new(Window::EMPTY);
    let window = WINDOW.take();
    let mut recorder =
        Recorder::<f32, JOINTS, BASE, TAPS, PENDING, _>::with_window(leg::BANDWIDTH_HZ, window).ok()?;
    let (mut tally, mut with_rows, mut seed) = (Tally::default(), Tally::default(), 1);
    for sample in 0..motion.duration_ticks() / TICKS_PER_LOG {
        let state = motion.state_at(sample * TICKS_PER_LOG);
        let (q, qd, qdd) = (state.position_rad, state.velocity_rad_per_s, state.acceleration_rad_per_s2);
        let mut torque = joint_torques(&model.chain, &truth, &JointState { q, qd, qdd }, &model.gravity);
        for (torque, size) in torque.iter_mut().zip(NOISE_NM) {
            *torque += size * noise(&mut seed);
        }
        let position = core::array::from_fn(|joint| {
            let step = scales[joint].radian_per_count.0;
            (q[joint] / step) as i32 as f32 * step
        });
        let (instructions, progress) = count(|| {
            black_box(&mut recorder).push(black_box(model), black_box(&position), black_box(&torque))
        });
        tally.push(instructions);
        if progress.is_some_and(|progress| progress.rows.is_some()) {
            with_rows.push(instructions);
        }
    }
    tally.print("Recorder::push, every sample");
    account.add(
        "identification of a sample, Recorder::push",
        tally,
        MOST_INSTRUCTIONS_PER_SAMPLE,
        LOG_RATE_HZ,
    );
    with_rows.print("  of those, the ones that finish a row");
    let (instructions, record) = count(|| recorder.finish());
    hprintln!("{:<48} {:>8}", "once: closing the motion, weights and Stribeck", instructions);
    Some(record)
}

/// Runs the search to its end; returns whether it met its time bound.
#[inline(never)]
fn searched(
    model: &Model,
    record: Record<f32, JOINTS, BASE>,
    prior: Option<&[LinkPrior<f32>; JOINTS]>,
    name: &str,
) -> bool {
    heading(name);
    let mut slot = MaybeUninit::uninit();
    let (instructions, solver) = count(|| Solver::place(&mut slot, model, record, Plan::default(), prior, 1));
    hprintln!("{:<48} {:>8}", "once: Solver::new, least squares included", instructions);
    let (mut evaluation, mut completion) = (Tally::default(), Tally::default());
    let (mut last, mut total) = (0, 0_u64);
    for _ in 0..MOST_EVALUATIONS {
        let before = solver.search().evaluations();
        let (instructions, state) = count(|| black_box(&mut *solver).advance(model, 1));
        total += u64::from(instructions);
        let searching = solver.search().state() == SearchState::Running;
        match (solver.search().evaluations() > before, searching) {
            (true, true) => evaluation.push(instructions),
            (true, false) => last = instructions,
            (false, _) => completion.push(instructions),
        }
        if state != SearchState::Running {
            break;
        }
    }
    evaluation.print("one evaluation of the swarm, all its work");
    hprintln!("{:<48} {:>8}", "once: the last one, and the start of the completion", last);
    completion.print("one step of the completion to a leg");
    let seconds = total as f32 / INSTRUCTIONS_PER_S;
    let is_within = solver.search().state() == SearchState::Done && seconds <= MOST_SEARCH_S;
    let word = if is_within { "kept" } else { "MISSED" };
    let (evaluations, iterations) = (solver.search().evaluations(), solver.search().iterations());
    hprintln!(
        "in all, million instructions: {}; {} iterations, {} evaluations",
        total / 1_000_000,
        iterations,
        evaluations
    );
    hprintln!(
        "seconds of the processor at 168 MHz and 1.34 cycles each: {:.2}   goal {}: {}",
        seconds,
        MOST_SEARCH_S,
        word
    );
    is_within
}
