//! A finite low-pass and its exact derivatives.
//!
//! Why: identification needs angle, speed and acceleration from encoder counts alone. Local polynomials give
//! three estimates that are not derivatives of one another and bias the inertias by about one standard
//! deviation. Here all three weights come from one function of time.
//!
//! ```text
//! h(t)   =  1/W (1/2 c_0 + sum_n c_n cos(n pi t/W)),     |t| <= W
//! h'(t)  = -1/W  sum_n c_n (n pi/W)   sin(n pi t/W)
//! h''(t) = -1/W  sum_n c_n (n pi/W)^2 cos(n pi t/W)
//! ```
//!
//! `W` is the reach in s and `c_n` the gain at the frequency `n/(2 W)`. The design is frequency sampling
//! (Rabiner, Gold and McGonegal 1970) with a flat passband of three samples and four transition samples. The
//! transition samples minimise the largest deviation in both bands under `h(W) = h''(W) = 0`, so `h`, `h'`
//! and `h''` all end without a step. In units of the bandwidth (-3 dB): within 0.1 % of one up to 0.55, below
//! -77 dB from 1.8, reach 1.967 periods. The weights are samples of these functions, so the discrete
//! derivative is exact but for the aliased stopband. Normalisation removes the remaining 1e-5 of a constant,
//! a ramp and a parabola.
//!
//! Cost: built once; about 60 flops for each tap. Memory: `TAPS` numbers for [`LowPass`], three
//! times as many for [`Kernel`].

use crate::real::{self, Real};

/// Gains at the multiples of `1/(2 W)`.
const GAINS: [f64; 7] = [1.0, 1.0, 1.0, 0.952_295, 0.680_526, 0.263_507, 0.035_275];
/// Reach times bandwidth.
const REACH_IN_PERIODS: f64 = 1.966_742;
/// Fewest taps to each side that represent the three functions.
const SMALLEST_REACH: usize = 8;

/// Reason why a kernel cannot be built.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum KernelError {
    /// The bandwidth is not a positive finite number.
    Bandwidth,
    /// The kernel exceeds the reserved memory; a higher bandwidth needs fewer taps.
    TooLong {
        /// Taps needed.
        needed: usize,
    },
    /// The bandwidth is so close to the sampling rate that fewer than eight taps to each side remain.
    TooShort,
}

/// The low-pass alone.
#[derive(Clone, Debug, PartialEq)]
pub struct LowPass<T, const TAPS: usize> {
    reach: usize,
    /// `W` in samples.
    half_width: T,
    weights: [T; TAPS],
    energy: T,
}

impl<T: Real, const TAPS: usize> LowPass<T, TAPS> {
    /// Builds the low-pass that is 3 dB down at `bandwidth_hz`, for samples at `sample_rate_hz`.
    ///
    /// # Errors
    /// [`KernelError`] when the bandwidth is invalid or does not fit `TAPS`.
    pub fn new(bandwidth_hz: T, sample_rate_hz: T) -> Result<Self, KernelError> {
        if !(bandwidth_hz > T::zero() && real::is_finite(bandwidth_hz)) {
            return Err(KernelError::Bandwidth);
        }
        let half_width = T::from_double(REACH_IN_PERIODS) * sample_rate_hz / bandwidth_hz;
        let reach = whole_samples_below(half_width, TAPS);
        if reach < SMALLEST_REACH {
            return Err(KernelError::TooShort);
        }
        if 2 * reach + 1 > TAPS {
            return Err(KernelError::TooLong { needed: 2 * reach + 1 });
        }
        let zero = T::zero();
        let mut low_pass = Self { reach, half_width, weights: [zero; TAPS], energy: zero };
        let taps = low_pass.taps();
        for index in 0..taps {
            low_pass.weights[index] = function_and_derivatives(signed(index, reach), half_width, T::one()).0;
        }
        let gain: T = sum(low_pass.weights());
        for weight in &mut low_pass.weights[..taps] {
            *weight /= gain;
            low_pass.energy += *weight * *weight;
        }
        Ok(low_pass)
    }

    /// Taps to each side of the centre; the output belongs to the sample this many before the newest.
    pub const fn reach(&self) -> usize {
        self.reach
    }

    /// Number of weights, `2 reach + 1`.
    pub const fn taps(&self) -> usize {
        2 * self.reach + 1
    }

    /// Weights, oldest sample first.
    pub fn weights(&self) -> &[T] {
        &self.weights[..self.taps()]
    }

    /// Sum of the squared weights: the share of a white noise's variance that remains.
    pub fn energy(&self) -> T {
        self.energy
    }
}

/// `h`, `h'` and `h''` at `offset` samples from the centre. The derivatives have the sign of a correlation:
/// positive for a rising ramp.
fn function_and_derivatives<T: Real>(offset: T, half_width: T, sample_rate_hz: T) -> (T, T, T) {
    let fundamental = T::from_double(core::f64::consts::PI) / half_width; // rad per sample
    let (sine_one, cosine_one) = real::sin_cos(fundamental * offset);
    let (mut sine, mut cosine) = (T::zero(), T::one());
    let (mut value, mut slope, mut curvature) = (T::from_double(0.5 * GAINS[0]), T::zero(), T::zero());
    for (order, &gain) in GAINS.iter().enumerate().skip(1) {
        (sine, cosine) = (sine * cosine_one + cosine * sine_one, cosine * cosine_one - sine * sine_one);
        let angular = T::from_double(order as f64) * fundamental * sample_rate_hz;
        value += T::from_double(gain) * cosine;
        slope += T::from_double(gain) * angular * sine;
        curvature -= T::from_double(gain) * angular * angular * cosine;
    }
    (value / half_width, slope / half_width, curvature / half_width)
}

/// A low-pass with its first two derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct Kernel<T, const TAPS: usize> {
    low_pass: LowPass<T, TAPS>,
    first_derivative: [T; TAPS],
    second_derivative: [T; TAPS],
}

impl<T: Real, const TAPS: usize> Kernel<T, TAPS> {
    /// Builds the low-pass that is 3 dB down at `bandwidth_hz`, for samples at
    /// `sample_rate_hz`, and its derivatives.
    ///
    /// # Errors
    /// [`KernelError`] when the bandwidth is invalid or does not fit `TAPS`.
    pub fn new(bandwidth_hz: T, sample_rate_hz: T) -> Result<Self, KernelError> {
        let low_pass = LowPass::new(bandwidth_hz, sample_rate_hz)?;
        let mut kernel =
            Self { low_pass, first_derivative: [T::zero(); TAPS], second_derivative: [T::zero(); TAPS] };
        for index in 0..kernel.taps() {
            let offset = signed(index, kernel.reach());
            let (_, slope, curvature) =
                function_and_derivatives(offset, kernel.low_pass.half_width, sample_rate_hz);
            (kernel.first_derivative[index], kernel.second_derivative[index]) = (slope, curvature);
        }
        kernel.normalise(sample_rate_hz);
        Ok(kernel)
    }

    /// Makes the response to 1, t and t^2/2 exact.
    fn normalise(&mut self, sample_rate_hz: T) {
        let taps = self.taps();
        let constant: T = sum(&self.second_derivative[..taps]);
        let (mut ramp, mut parabola) = (T::zero(), T::zero());
        for index in 0..taps {
            let time = signed::<T>(index, self.reach()) / sample_rate_hz;
            self.second_derivative[index] -= constant * self.low_pass.weights[index];
            ramp += self.first_derivative[index] * time;
            parabola += self.second_derivative[index] * time * time * T::from_double(0.5);
        }
        for index in 0..taps {
            self.first_derivative[index] /= ramp;
            self.second_derivative[index] /= parabola;
        }
    }

    /// Taps to each side of the centre.
    pub const fn reach(&self) -> usize {
        self.low_pass.reach()
    }

    /// Number of weights of each of the three filters.
    pub const fn taps(&self) -> usize {
        self.low_pass.taps()
    }

    /// Value, slope (1/s) and curvature (1/s^2) at the centre of a window of [`Self::taps`] samples. The
    /// window comes in two pieces, oldest first, as a ring buffer holds them.
    pub fn apply(&self, older: &[T], newer: &[T], centre: T) -> (T, T, T) {
        // Differences from the centre: large constants cancel before they cost digits.
        let (mut value, mut slope, mut curvature) = (T::zero(), T::zero(), T::zero());
        // Piece by piece: a chained iterator would test at every sample which piece is current.
        let mut begin = 0;
        for piece in [older, newer] {
            let rest = begin.min(TAPS)..;
            let (low, first) = (&self.low_pass.weights[rest.clone()], &self.first_derivative[rest.clone()]);
            let weights = low.iter().zip(first).zip(&self.second_derivative[rest]);
            for (&sample, ((&low, &first), &second)) in piece.iter().zip(weights) {
                let difference = sample - centre;
                value += low * difference;
                slope += first * difference;
                curvature += second * difference;
            }
            begin += piece.len();
        }
        (centre + value, slope, curvature)
    }
}

/// The largest whole number not above `length`, at most `limit`.
fn whole_samples_below<T: Real>(length: T, limit: usize) -> usize {
    (length.to_count() as usize).min(limit)
}

fn signed<T: Real>(index: usize, centre: usize) -> T {
    T::from_double(index as f64) - T::from_double(centre as f64)
}

fn sum<T: Real>(values: &[T]) -> T {
    values.iter().fold(T::zero(), |total, &value| total + value)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn response<T: Real>(bandwidth: f64, frequency: f64) -> (f64, f64, f64) {
        let kernel = Kernel::<T, 512>::new(T::from_double(bandwidth), T::from_double(500.0)).expect("fits");
        let omega = 2.0 * core::f64::consts::PI * frequency;
        let mut window = [T::zero(); 512];
        let mut sine_window = [T::zero(); 512];
        for index in 0..kernel.taps() {
            let time = (index as f64 - kernel.reach() as f64) / 500.0;
            let (sine, cosine) = real::sin_cos(omega * time);
            window[index] = T::from_double(cosine);
            sine_window[index] = T::from_double(sine);
        }
        let (value, _, curvature) = kernel.apply(&window[..kernel.taps()], &[], T::one());
        let (_, slope, _) = kernel.apply(&sine_window[..kernel.taps()], &[], T::zero());
        (value.to_double(), slope.to_double() / omega, -curvature.to_double() / (omega * omega))
    }

    #[test]
    fn derivatives_have_the_response_of_the_low_pass_itself() {
        for frequency in [0.2, 1.0, 3.0, 6.0, 9.0] {
            let (value, slope, curvature) = response::<f64>(8.0, frequency);
            assert!((slope - value).abs() < 3e-5, "{frequency}: {slope} {value}");
            assert!((curvature - value).abs() < 3e-5, "{frequency}: {curvature} {value}");
        }
    }

    #[test]
    fn passband_is_flat_edge_is_3_db_down_and_stopband_is_closed() {
        assert!((response::<f64>(8.0, 0.55 * 8.0).0 - 1.0).abs() < 1.1e-3);
        assert!((response::<f64>(8.0, 8.0).0 - core::f64::consts::FRAC_1_SQRT_2).abs() < 5e-3);
        for step in 0..40 {
            assert!(response::<f64>(8.0, 15.0 + f64::from(step)).0.abs() < 2.5e-4);
        }
    }

    #[test]
    fn single_precision_agrees_with_double() {
        for frequency in [0.5, 2.0, 5.0] {
            let (single, double) = (response::<f32>(8.0, frequency), response::<f64>(8.0, frequency));
            assert!((single.0 - double.0).abs() < 1e-6);
            assert!((single.1 - double.1).abs() < 1e-5);
            assert!((single.2 - double.2).abs() < 2e-4 / frequency, "{frequency}: {single:?} {double:?}");
        }
    }

    #[test]
    fn absurd_bandwidths_are_named_errors() {
        type Short = LowPass<f32, 64>;
        assert_eq!(Short::new(f32::NAN, 500.0), Err(KernelError::Bandwidth));
        assert_eq!(Short::new(0.0, 500.0), Err(KernelError::Bandwidth));
        assert_eq!(Short::new(200.0, 500.0), Err(KernelError::TooShort));
        assert!(matches!(Short::new(1e-30, 500.0), Err(KernelError::TooLong { .. })));
        assert!(matches!(Short::new(8.0, 500.0), Err(KernelError::TooLong { .. })));
    }
}
