//! Adaptive oscillators: phase, frequency and waveform of a periodic motion, learnt from the joint angles.
//!
//! ```text
//! q*_j    = a_j0 + sum_k (a_jk cos k p + b_jk sin k p),   k = 1..4      one phase p for all joints
//! F_j     = q_j - q*_j
//! a_jk'   = 2 eta f F_j cos k p,  b_jk' = 2 eta f F_j sin k p,  a_j0' = eta f F_j
//! e       = sum_j F_j (b_j1 cos p - a_j1 sin p) / (1/2 sum_j (a_j1^2 + b_j1^2) + EPSILON)
//! p'      = w + 0.3 w e,   w' = 0.1 w^2 e,   f = w / 2 pi
//! ```
//!
//! Only the fundamental moves phase and frequency: harmonics learnt at a wrong frequency turn against the
//! phase, and together they can lock a multiple of the motion. The waveform is learnt with eta = 2, half a
//! cycle.
//!
//! The frequency starts from the time between two upward crossings of the mean, which is used whenever the
//! waveform does not fit the motion and both frequencies differ by more than 15 %.
//!
//! Measured on a published gait, from 0.8 Hz: frequency within 4 % and 80 % of the motion predicted after 3
//! cycles at 0.5 to 1.2 Hz, and after 2 cycles when the cadence changes by 20 % (unit tests).
//!
//! Source: Righetti, Buchli and Ijspeert, Dynamic Hebbian learning in adaptive frequency oscillators, 2006;
//! Ronsse et al., 2011, whose pool of one oscillator per harmonic is replaced by one phase. Cost: some 250
//! operations for two joints.

use core::f32::consts::TAU;

use super::law::DT;
use crate::model::JointState;
use crate::real::{abs, clamp, max, sin_cos, sqrt};
use crate::servo::LOG_RATE_HZ;

/// Harmonics of the waveform.
pub const HARMONICS: usize = 4;
/// Learning rate of the waveform per cycle.
const LEARNING: f32 = 2.0;
const PHASE_GAIN: f32 = 0.3;
const FREQUENCY_GAIN: f32 = 0.1;
/// Power of a fundamental that counts as motion, rad^2: 2.6 degrees.
const EPSILON: f32 = 2e-3;
/// Frequency before the first motion, and its limits, Hz.
const START_HZ: f32 = 0.8;
const LOWEST_HZ: f32 = 0.3;
const HIGHEST_HZ: f32 = 2.0;
/// Time constant of the mean whose crossings are timed, s.
const MEAN_S: f32 = 2.0;
/// A crossing counts after an excursion of this share of the standard deviation.
const HYSTERESIS: f32 = 0.3;
/// A joint with less than this share of the variance of another is not timed.
const TIMED_SHARE: f32 = 0.1;
/// Below this predicted share of the motion the timed frequency replaces another one.
const FITS: f32 = 0.8;
/// Relative difference from which the timed frequency is used.
const DIFFERENCE: f32 = 0.15;

/// Mean, variance and upward crossings of one angle.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Crossing {
    mean: f32,
    variance: f32,
    above: bool,
    /// Samples since the last upward crossing; `None` before the first.
    since: Option<u32>,
}

impl Crossing {
    /// Takes an angle; returns the period that ends with it, samples.
    fn push(&mut self, angle: f32) -> Option<u32> {
        let away = angle - self.mean;
        self.mean += DT / MEAN_S * away;
        self.variance += DT / MEAN_S * (away * away - self.variance);
        self.since = self.since.map(|since| since.saturating_add(1));
        let excursion = HYSTERESIS * sqrt(self.variance);
        if away < -excursion {
            self.above = false;
        } else if !self.above && away > excursion {
            self.above = true;
            return self.since.replace(0);
        }
        None
    }
}

/// Learnt waveform of one joint, rad.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Waveform {
    mean: f32,
    cosine: [f32; HARMONICS],
    sine: [f32; HARMONICS],
}

/// Cosine and sine of the multiples of a phase.
fn multiples(phase: f32) -> [(f32, f32); HARMONICS] {
    let (sine, cosine) = sin_cos(phase);
    let mut all = [(cosine, sine); HARMONICS];
    for order in 1..HARMONICS {
        let (before_cosine, before_sine) = all[order - 1];
        all[order] =
            (before_cosine * cosine - before_sine * sine, before_sine * cosine + before_cosine * sine);
    }
    all
}

impl Waveform {
    /// Value and derivatives by the phase.
    fn at(&self, multiples: &[(f32, f32); HARMONICS]) -> [f32; 3] {
        let mut sums = [self.mean, 0.0, 0.0];
        for (order, (cosine, sine)) in multiples.iter().enumerate() {
            let (along, across) = (self.cosine[order], self.sine[order]);
            let number = (order + 1) as f32;
            let value = along * cosine + across * sine;
            sums[0] += value;
            sums[1] += number * (across * cosine - along * sine);
            sums[2] -= number * number * value;
        }
        sums
    }

    fn learn(&mut self, error: f32, rate: f32, multiples: &[(f32, f32); HARMONICS]) {
        self.mean += 0.5 * rate * error;
        for (order, (cosine, sine)) in multiples.iter().enumerate() {
            self.cosine[order] += rate * error * cosine;
            self.sine[order] += rate * error * sine;
        }
    }
}

/// Oscillators of all joints.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Oscillator<const N: usize> {
    phase: f32,
    /// Angular frequency, rad/s.
    frequency: f32,
    waveforms: [Waveform; N],
    crossings: [Crossing; N],
    /// Mean squares of the last cycle: of the error, and of the motion about its mean, rad^2.
    error: f32,
    motion: f32,
    begun: bool,
}

impl<const N: usize> Oscillator<N> {
    /// Oscillators without a motion.
    pub fn new() -> Self {
        Self {
            phase: 0.0,
            frequency: TAU * START_HZ,
            waveforms: [Waveform::default(); N],
            crossings: [Crossing::default(); N],
            error: 0.0,
            motion: 0.0,
            begun: false,
        }
    }

    /// Takes the joints' angles (rad), one sample at 500 Hz.
    pub fn push(&mut self, angles: &[f32; N]) {
        if !self.begun {
            self.begun = true;
            for joint in 0..N {
                self.waveforms[joint].mean = angles[joint];
                self.crossings[joint].mean = angles[joint];
            }
        }
        self.time_crossings(angles);
        let multiples = multiples(self.phase);
        let (cosine, sine) = multiples[0];
        let cycles = self.frequency / TAU * DT;
        let (mut quadrature, mut power) = (0.0, EPSILON);
        let (mut squared, mut moved) = (0.0, 0.0);
        for (waveform, &angle) in self.waveforms.iter_mut().zip(angles) {
            let error = angle - waveform.at(&multiples)[0];
            let (along, across) = (waveform.cosine[0], waveform.sine[0]);
            quadrature += error * (across * cosine - along * sine);
            power += 0.5 * (along * along + across * across);
            squared += error * error;
            moved += (angle - waveform.mean) * (angle - waveform.mean);
            waveform.learn(error, 2.0 * LEARNING * cycles, &multiples);
        }
        let turned = clamp(quadrature / power, -1.0, 1.0);
        let frequency = self.frequency;
        self.phase += DT * frequency * (1.0 + PHASE_GAIN * turned);
        if self.phase >= TAU {
            self.phase -= TAU;
        }
        let faster = frequency + DT * FREQUENCY_GAIN * frequency * frequency * turned;
        self.frequency = clamp(faster, TAU * LOWEST_HZ, TAU * HIGHEST_HZ);
        self.error += cycles * (squared - self.error);
        self.motion += cycles * (moved - self.motion);
    }

    /// Sets the frequency from the crossings of a moving joint while the waveform does not fit.
    fn time_crossings(&mut self, angles: &[f32; N]) {
        let largest = self.crossings.iter().fold(0.0, |largest, crossing| max(largest, crossing.variance));
        let mut period = None;
        for (crossing, &angle) in self.crossings.iter_mut().zip(angles) {
            let found = crossing.push(angle);
            // The first joint with enough motion: a knee crosses its mean twice in some gaits.
            if period.is_none() && crossing.variance > TIMED_SHARE * largest {
                period = Some(found);
            }
        }
        let Some(Some(samples)) = period else { return };
        let hertz = LOG_RATE_HZ as f32 / samples as f32;
        let differs = abs(TAU * hertz - self.frequency) > DIFFERENCE * self.frequency;
        if differs && self.predicted_share() < FITS && (LOWEST_HZ..=HIGHEST_HZ).contains(&hertz) {
            self.frequency = TAU * hertz;
        }
    }

    /// Predicted share of the motion's mean square over about one cycle, at most 1; small motions count as
    /// not predicted.
    pub(crate) fn predicted_share(&self) -> f32 {
        1.0 - (self.error + EPSILON * 0.1) / (self.motion + EPSILON * 0.1)
    }

    /// Frequency, Hz.
    pub fn hertz(&self) -> f32 {
        self.frequency / TAU
    }

    /// Phase, rad, 0..2 pi.
    pub fn phase(&self) -> f32 {
        self.phase
    }

    /// Motion predicted for `ahead` s after the last sample: rad, rad/s, rad/s^2.
    pub(crate) fn predict(&self, ahead: f32) -> JointState<f32, N> {
        let multiples = multiples(self.phase + self.frequency * ahead);
        let mut state = JointState { q: [0.0; N], qd: [0.0; N], qdd: [0.0; N] };
        for (joint, waveform) in self.waveforms.iter().enumerate() {
            let [value, slope, bend] = waveform.at(&multiples);
            state.q[joint] = value;
            state.qd[joint] = self.frequency * slope;
            state.qdd[joint] = self.frequency * self.frequency * bend;
        }
        state
    }
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// Amplitudes (degrees) and phases of hip and knee in a published gait, as in the simulated wearer.
    const GAIT: [(f32, [[f32; 2]; 4]); 2] = [
        (7.5, [[12.9, -1.86], [4.8, -2.21], [2.5, -3.01], [0.1, -2.95]]),
        (22.7, [[23.7, -0.55], [18.5, -1.16], [4.2, -2.57], [1.1, 0.16]]),
    ];

    /// Angles of the gait, rad, at a phase.
    pub(in crate::assist) fn gait(phase: f32) -> [f32; 2] {
        GAIT.map(|(mean, harmonics)| {
            let mut sum = mean;
            for (order, [amplitude, start]) in harmonics.into_iter().enumerate() {
                sum += amplitude * sin_cos((order + 1) as f32 * phase + start).1;
            }
            sum.to_radians()
        })
    }

    /// Cycles of `hertz` from a time on until the frequency stays within 4 % and 80 % is predicted.
    fn cycles_to_lock(first: f32, second: f32, change_s: f32) -> [f32; 2] {
        let mut oscillator = Oscillator::<2>::new();
        let (mut phase, mut last) = (0.0_f32, [0.0_f32; 2]);
        let rest = gait(0.0);
        for sample in 0..20_000 {
            let time = sample as f32 * DT;
            let hertz = if time < change_s { first } else { second };
            phase = (phase + TAU * hertz * DT) % TAU;
            // The motion fades in within a second.
            let share = clamp(time, 0.0, 1.0);
            let angles = gait(phase);
            oscillator.push(&[0, 1].map(|joint| rest[joint] + share * (angles[joint] - rest[joint])));
            let locked = abs(oscillator.hertz() / hertz - 1.0) < 0.04 && oscillator.predicted_share() > 0.8;
            if !locked {
                last[usize::from(time >= change_s)] = time;
            }
        }
        [last[0] * first, (last[1] - change_s) * second]
    }

    #[test]
    fn a_gait_is_locked_in_three_cycles_and_followed_in_two() {
        for (first, second) in [(0.5, 0.6), (0.5, 0.4), (0.8, 0.96), (0.8, 0.64), (1.2, 1.44), (1.2, 1.0)] {
            let [start, change] = cycles_to_lock(first, second, 20.0);
            // One of the first cycles at least is the motion's own fade.
            assert!(start < 3.3 && change < 2.2, "{first} Hz: {start} cycles, then {second} Hz: {change}");
        }
    }

    #[test]
    fn a_locked_oscillator_predicts_the_motion_and_its_derivatives() {
        let mut oscillator = Oscillator::<2>::new();
        let phase = |time: f32| (TAU * 0.8 * time) % TAU;
        for sample in 0..10_000 {
            oscillator.push(&gait(phase(sample as f32 * DT)));
        }
        let time = 9_999.0 * DT;
        for ahead in [0.0, 0.1, 0.5] {
            // `push` has moved the phase one sample on.
            let predicted = oscillator.predict(ahead - DT);
            let [before, now, after] = [-0.01, 0.0, 0.01].map(|step| gait(phase(time + ahead + step)));
            for joint in 0..2 {
                let velocity = (after[joint] - before[joint]) / 0.02;
                let acceleration = (after[joint] - 2.0 * now[joint] + before[joint]) / 1e-4;
                assert!(abs(predicted.q[joint] - now[joint]) < 0.01, "{ahead}");
                assert!(abs(predicted.qd[joint] - velocity) < 0.08);
                assert!(abs(predicted.qdd[joint] - acceleration) < 1.0);
            }
        }
    }

    #[test]
    fn a_motion_that_stops_is_not_predicted_after_a_cycle() {
        let mut oscillator = Oscillator::<2>::new();
        for sample in 0..10_000 {
            oscillator.push(&gait((TAU * 0.8 * sample as f32 * DT) % TAU));
        }
        assert!(oscillator.predicted_share() > 0.98);
        let rest = gait((TAU * 0.8 * 10_000.0 * DT) % TAU);
        let samples = (1.0 / (0.8 * DT)) as u32;
        for _ in 0..samples {
            oscillator.push(&rest);
        }
        // The gate of the assistance closes below this.
        assert!(oscillator.predicted_share() < 0.8, "{}", oscillator.predicted_share());
    }
}
