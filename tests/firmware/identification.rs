//! Identification on synthetic motion: torque from Newton-Euler in double precision, noise of known size.
//!
//! There is no plant: these tests check the filter chain, the information factor and the statistics alone.

use scarab::ident::{
    Estimate, Evidence, Plan, Problem, Reason, Recorder, RowModel, SAMPLE_RATE_HZ, Thresholds, Verdict,
    VerdictBuilder,
};
use scarab::model::planar::BASE;
use scarab::model::{JointState, joint_torques};

use crate::planar_leg::{GRAVITY, TRUTH, chain, row_model};
use crate::testing::TestRandom;

const LENGTH_M: f64 = 0.45;

type LegRecorder = Recorder<f32, 2, BASE, 256, 26>;

fn model<T: scarab::real::Real>() -> RowModel<T, 2, BASE> {
    row_model(LENGTH_M)
}

/// Five harmonics of 0.1 Hz on each joint, D-H angles.
fn motion(time: f64) -> JointState<f64, 2> {
    const HIP: [(f64, f64); 5] = [(-0.15, -0.01), (-0.09, 0.17), (0.10, 0.23), (0.05, -0.06), (0.03, -0.12)];
    const KNEE: [(f64, f64); 5] =
        [(-0.22, 0.22), (0.37, -0.26), (-0.19, -0.03), (-0.28, -0.30), (0.06, -0.15)];
    let mut state = JointState { q: [0.35, -0.8], qd: [0.0; 2], qdd: [0.0; 2] };
    for (joint, coefficients) in [HIP, KNEE].iter().enumerate() {
        for (order, (a, b)) in coefficients.iter().enumerate() {
            let omega = 2.0 * std::f64::consts::PI * 0.1 * (order + 1) as f64;
            let (sine, cosine) = scarab::real::sin_cos(omega * time);
            state.q[joint] += (a * sine - b * cosine) / omega;
            state.qd[joint] += a * cosine + b * sine;
            state.qdd[joint] += omega * (b * cosine - a * sine);
        }
    }
    state
}

fn torque(state: &JointState<f64, 2>) -> [f64; 2] {
    joint_torques(&chain(LENGTH_M), &TRUTH, state, &GRAVITY)
}

fn mean_absolute_torque() -> [f64; 2] {
    let mut sum = [0.0; 2];
    for index in 0..1000 {
        let torques = torque(&motion(f64::from(index) * 0.01));
        sum = std::array::from_fn(|joint| sum[joint] + torques[joint].abs() / 1000.0);
    }
    sum
}

fn record(recorder: &mut LegRecorder, seconds: f64, noise_share: f64, seed: u64) {
    let model = model();
    let mut random = TestRandom::new(seed);
    let mean = mean_absolute_torque();
    for index in 0..(seconds * SAMPLE_RATE_HZ) as usize {
        let state = motion(index as f64 / SAMPLE_RATE_HZ);
        let exact = torque(&state);
        let noisy =
            std::array::from_fn(|joint| (exact[joint] + noise_share * mean[joint] * random.normal()) as f32);
        recorder.push(&model, &state.q.map(|angle| angle as f32), &noisy);
    }
}

fn estimate(seconds: f64, noise_share: f64, seed: u64, plan: Plan) -> Estimate<f32, BASE> {
    let mut recorder = LegRecorder::new(8.0).expect("fits");
    record(&mut recorder, seconds, noise_share, seed);
    let record = recorder.finish();
    Problem::new(&record, &model()).least_squares(plan)
}

fn true_base() -> [f64; BASE] {
    model::<f64>().base.project(&TRUTH)
}

#[test]
fn noise_free_torque_restores_the_base_parameters() {
    for plan in [Plan::OneTime, Plan::Sequential] {
        let found = estimate(22.0, 0.0, 1, plan);
        for (value, truth) in found.values.iter().zip(true_base()) {
            // Tolerance: flatness of the filter 1.6e-4, single precision, and a sign change
            // between two samples.
            assert!((f64::from(*value) - truth).abs() < 2e-3 * truth.abs().max(0.5), "{value} {truth}");
        }
    }
}

#[test]
fn reported_sigma_has_its_nominal_coverage() {
    for plan in [Plan::OneTime, Plan::Sequential] {
        let (mut within_one, mut within_three, mut all) = (0, 0, 0);
        for seed in 0..60 {
            let found = estimate(21.0, 0.07, 1000 + seed, plan);
            for (base, truth) in true_base().iter().enumerate() {
                let sigma = f64::from(found.sigma(base).expect("determined"));
                let error = (f64::from(found.values[base]) - truth).abs();
                within_one += u32::from(error < sigma);
                within_three += u32::from(error < 3.0 * sigma);
                all += 1;
            }
        }
        let share = |count: u32| f64::from(count) / f64::from(all);
        // The 780 draws are correlated: the binomial spread of 68 % is 1.7 %, within a run about 4 %.
        assert!((0.60..=0.76).contains(&share(within_one)), "{plan:?}: {}", share(within_one));
        assert!(share(within_three) >= 0.98, "{plan:?}: {}", share(within_three));
    }
}

fn judge(recorder: &mut LegRecorder) -> Verdict {
    let (record, model, thresholds) = (recorder.finish(), model(), Thresholds::default());
    let problem = Problem::new(&record, &model);
    let found = problem.least_squares(Plan::OneTime);
    let mut unheard = |_: &Evidence<f32>| {};
    let mut builder = VerdictBuilder::new(&mut unheard);
    thresholds.judge_input(&model, &record, &mut builder);
    thresholds.judge_excitation(&problem.whole(), found.rank(), &mut builder);
    thresholds.judge_physics(&model, &record, &found, &mut builder);
    builder.verdict()
}

#[test]
fn no_samples_and_a_short_log_are_refused_as_input() {
    let mut recorder = LegRecorder::new(8.0).expect("fits");
    assert!(judge(&mut recorder).has(Reason::Input));
    record(&mut recorder, 1.5, 0.07, 3);
    assert!(judge(&mut recorder).has(Reason::Input));
}

#[test]
fn a_nan_sample_is_refused_as_input_and_loses_only_its_window() {
    let mut recorder = LegRecorder::new(8.0).expect("fits");
    record(&mut recorder, 12.0, 0.07, 3);
    recorder.break_off();
    let before = recorder.rows();
    assert!(recorder.push(&model(), &[f32::NAN, 0.0], &[0.0; 2]).is_none());
    record(&mut recorder, 12.0, 0.07, 4);
    let record_of_both = recorder.finish();
    assert!(judge(&mut recorder).has(Reason::Input));
    assert_eq!(record_of_both.rows, before.map(|rows| 2 * rows));
    let found = Problem::new(&record_of_both, &model()).least_squares(Plan::OneTime);
    assert!((f64::from(found.values[0]) / true_base()[0] - 1.0).abs() < 0.1);
}

#[test]
fn an_implausible_last_angle_is_refused_and_leaves_no_nan() {
    let mut recorder = LegRecorder::new(8.0).expect("fits");
    record(&mut recorder, 12.0, 0.07, 3);
    for _ in 0..200 {
        recorder.push(&model(), &[3e38, 0.0], &[0.0; 2]);
    }
    let record = recorder.finish();
    assert!(record.rejected > 0 && record.factors.iter().all(|factor| factor.residual().is_finite()));
    let mut unheard = |_: &Evidence<f32>| {};
    let mut builder = VerdictBuilder::new(&mut unheard);
    Thresholds::default().judge_input(&model(), &record, &mut builder);
    assert!(builder.verdict().has(Reason::Input));
}
