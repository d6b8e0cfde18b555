//! Information and torque of a curve, cheap enough for ten thousand evaluations.
//!
//! ```text
//! A       = sum_i (cycles / s_i^2) sum over the rows of joint i  y_i' y_i   information matrix
//! s_i^2   = noise_i^2 / 10                                            variance of one 50 Hz row
//! merit   = ln det A
//! torque  = max over t  |y_i b| + margin sum_k |y_ik b_k|             each b_k off by the margin
//! cut     = max over t  reduction of y_i b +- that margin by the monitor     near an end, too fast to stop
//! ```
//!
//! `y_i` is the base row of joint i (N m per unit), at 50 Hz along one cycle of the commanded
//! curve; `b` are the base parameters of the assumed leg. `noise_i` is the noise of the logged
//! torque in N m, equal for every curve. Noise in percent of a curve's own torque would favour a leg that
//! hangs where it needs no torque: when tried, the hip stayed between 5 and 29 degrees.
//!
//! A row counts unless the joint is at rest in too much of its window, the rule of `ident::record::recorder`.
//! Shares of standstill come from speeds at 100 Hz, linear in between, and the magnitude of the low-pass. The
//! filters themselves are omitted: a curve's harmonics lie in their flat band ([`crate::excite::design`]
//! ensures it).
//!
//! Source of D-optimality: J. Swevers et al., "Optimal robot excitation and identification", IEEE
//! Trans. Robotics and Automation 13 (1997), section III.
//! Known limits: blends are not counted. At each reversal friction holds a real joint a little longer than
//! its command; [`crate::excite::expectation`] includes both.

use nalgebra::SMatrix;
use scarab::ident::{DECIMATION, LARGEST_STILL_SHARE, LowPass, RowModel, SAMPLE_RATE_HZ, Smoothed};
use scarab::motion::{Fourier, MotionState, Phase};
use scarab::safety::Barrier;
use scarab::units::{NewtonMetre, Radian, RadianPerSecond};

use crate::excite::obstacle::OperatingPoint;
use crate::pair::TAPS;

/// Rate of the stillness rule, Hz, and instants per row.
const SPEED_RATE_HZ: f64 = 100.0;
const SPEEDS_PER_ROW: usize = 2;
/// Samples per instant of `SPEED_RATE_HZ`.
const SAMPLES_PER_SPEED: usize = 5;
/// Merit of a curve that leaves a parameter undetermined.
const NOTHING: f64 = -1e4;

/// Data for scoring curves.
#[derive(Clone, Debug)]
pub(crate) struct Scorer<const N: usize, const B: usize> {
    /// Geometry, gravity, base parameters.
    pub(crate) model: RowModel<f64, N, B>,
    /// Base parameters of the assumed leg.
    pub(crate) values: [f64; B],
    /// Standard deviation of each joint's logged torque, N m.
    pub(crate) noise_nm: [f64; N],
    /// Assumed error of each base parameter, as a share.
    pub(crate) margin: f64,
    /// Limits of each joint in the firmware's monitor.
    pub(crate) barriers: [Barrier; N],
    /// Share of the low-pass's magnitude in each 10 ms, from its centre outwards.
    weights: Vec<f64>,
}

/// Reduction of a joint's torque by the monitor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Cut {
    /// Reduction, N m; zero for none.
    pub(crate) by_nm: f64,
    /// Torque that the motion needs, N m.
    pub(crate) wanted_nm: f64,
    /// Torque that the monitor grants, N m.
    pub(crate) granted_nm: f64,
    pub(crate) point: OperatingPoint,
}

/// Score of one curve.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Score<const N: usize> {
    /// ln det of the information of the base parameters.
    pub(crate) merit: f64,
    /// Largest torque of each joint, margin included, N m.
    pub(crate) torque: [f64; N],
    /// Largest reduction of each joint's torque by the monitor, N m.
    pub(crate) cut: [f64; N],
}

impl<const N: usize, const B: usize> Scorer<N, B> {
    /// Creates a scorer for rows of a bandwidth; `None` if the filter cannot be built.
    pub fn new(
        model: RowModel<f64, N, B>,
        values: [f64; B],
        bandwidth_hz: f64,
        noise_nm: [f64; N],
        margin: f64,
        barriers: [Barrier; N],
    ) -> Option<Self> {
        let low_pass = LowPass::<f64, TAPS>::new(bandwidth_hz, SAMPLE_RATE_HZ).ok()?;
        let all: f64 = low_pass.weights().iter().map(|weight| weight.abs()).sum();
        let centre = low_pass.reach();
        let bins = centre.div_ceil(SAMPLES_PER_SPEED) + 1;
        let mut weights = vec![0.0; bins];
        for (tap, weight) in low_pass.weights().iter().enumerate().skip(centre) {
            weights[(tap - centre) / SAMPLES_PER_SPEED] += weight.abs() / all;
        }
        Some(Self { model, values, noise_nm, margin, barriers, weights })
    }

    /// Base rows at one state, N m per unit.
    pub(crate) fn rows(&self, state: &MotionState<N>) -> [[f64; B]; N] {
        let state = Smoothed {
            position: state.position_rad.map(f64::from),
            velocity: state.velocity_rad_per_s.map(f64::from),
            acceleration: state.acceleration_rad_per_s2.map(f64::from),
            torque: [0.0; N],
        };
        self.model.rows(&state).regressor
    }

    /// Torque of one row, and its error bound.
    pub fn torque(&self, row: &[f64; B]) -> (f64, f64) {
        let terms = row.iter().zip(&self.values).map(|(element, value)| element * value);
        let (sum, absolute) =
            terms.fold((0.0, 0.0), |(sum, absolute), term: f64| (sum + term, absolute + term.abs()));
        (sum, self.margin * absolute)
    }

    /// Reduction of a joint's torque by the monitor at one instant; the monitor must still be able to stop
    /// the joint.
    pub(crate) fn cut(
        &self,
        joint: usize,
        position: f32,
        velocity: f32,
        torque: f64,
        uncertainty: f64,
    ) -> Cut {
        let mut worst = Cut::default();
        for wanted_nm in [torque + uncertainty, torque - uncertainty] {
            let (allowed, _) = self.barriers[joint].bound(
                Radian(position),
                RadianPerSecond(velocity),
                NewtonMetre(wanted_nm as f32),
                false,
            );
            let granted_nm = f64::from(allowed.0);
            // Differences within single precision do not count as a reduction.
            let by_nm = (wanted_nm - granted_nm).abs() - 1e-5 * wanted_nm.abs();
            if by_nm > worst.by_nm {
                let point =
                    OperatingPoint { position_rad: f64::from(position), velocity_rad_s: f64::from(velocity) };
                worst = Cut { by_nm, wanted_nm, granted_nm, point };
            }
        }
        worst
    }

    /// Scores `cycles` cycles of a curve.
    pub(crate) fn score(&self, curve: &Fourier<N>, cycles: u32) -> Score<N> {
        let rows = ((f64::from(curve.period().0) * SPEED_RATE_HZ) as usize / SPEEDS_PER_ROW).max(8);
        let speeds = rows * SPEEDS_PER_ROW;
        let states: Vec<_> =
            (0..speeds).map(|index| curve.state_at(&Phase::steady(index as f32 / speeds as f32))).collect();
        let mut information = [SMatrix::<f64, B, B>::zeros(); N];
        let (mut torque, mut cut) = ([0.0_f64; N], [0.0_f64; N]);
        let still: [Vec<f64>; N] = core::array::from_fn(|joint| {
            let speed = |index: usize| f64::from(states[index % speeds].velocity_rad_per_s[joint]);
            self.still_shares(speed, self.model.still_speed[joint], speeds)
        });
        for (index, state) in states.iter().enumerate().step_by(SPEEDS_PER_ROW) {
            for (joint, row) in self.rows(state).iter().enumerate() {
                let (value, uncertainty) = self.torque(row);
                torque[joint] = torque[joint].max(value.abs() + uncertainty);
                let (position, velocity) = (state.position_rad[joint], state.velocity_rad_per_s[joint]);
                cut[joint] = cut[joint].max(self.cut(joint, position, velocity, value, uncertainty).by_nm);
                if still[joint][index] <= LARGEST_STILL_SHARE {
                    add_square(&mut information[joint], row);
                }
            }
        }
        let mut all = SMatrix::<f64, B, B>::zeros();
        for joint in 0..N {
            let weight =
                f64::from(cycles) * DECIMATION as f64 / (self.noise_nm[joint] * self.noise_nm[joint]);
            all += information[joint] * weight;
        }
        Score { merit: log_determinant(&all, self.model.base.rank()), torque, cut }
    }

    /// Share of each instant's window in which a joint is slower than the limit (rad/s), along one cycle.
    fn still_shares(&self, speed: impl Fn(usize) -> f64, limit: f64, count: usize) -> Vec<f64> {
        let mut shares = vec![0.0; count];
        for index in 0..count {
            let still = still_share(speed(index), speed(index + 1), limit);
            if still == 0.0 {
                continue;
            }
            for (away, weight) in self.weights.iter().enumerate() {
                // The interval from `index` to the next instant, seen from both ends outwards.
                shares[(index + count - away % count) % count] += weight * still;
                shares[(index + 1 + away) % count] += weight * still;
            }
        }
        shares
    }
}

/// Share of an interval in which a linearly changing speed is below the stillness limit.
fn still_share(from: f64, to: f64, limit: f64) -> f64 {
    let (low, high) = if from < to { (from, to) } else { (to, from) };
    if high - low < 1e-12 {
        return f64::from(u8::from(low.abs() < limit));
    }
    (high.min(limit) - low.max(-limit)).max(0.0) / (high - low)
}

fn add_square<const B: usize>(sum: &mut SMatrix<f64, B, B>, row: &[f64; B]) {
    for (column, &right) in row.iter().enumerate() {
        if right != 0.0 {
            for (line, &left) in row.iter().enumerate().skip(column) {
                sum[(line, column)] += left * right;
            }
        }
    }
}

/// ln det of the leading `rank` rows and columns of a symmetric matrix given by its lower half.
pub(crate) fn log_determinant<const B: usize>(lower: &SMatrix<f64, B, B>, rank: usize) -> f64 {
    let mut scaled = SMatrix::<f64, B, B>::identity();
    let mut merit = 0.0;
    for column in 0..rank {
        let own = lower[(column, column)];
        if !(own > 0.0 && own.is_finite()) {
            return NOTHING;
        }
        merit += own.ln();
        for line in column..rank {
            scaled[(line, column)] = lower[(line, column)] / (own * lower[(line, line)]).sqrt();
        }
    }
    scaled.cholesky().map_or(NOTHING, |factor| {
        merit + 2.0 * factor.l_dirty().diagonal().iter().map(|element| element.ln()).sum::<f64>()
    })
}
