//! A user's own objective: the five parameters of a damped oscillation, from samples.
//!
//! Generic, without `std` and without a heap: the example and a test use this file.
//!
//!   y(t) = amplitude exp(-decay t) cos(frequency t + phase) + offset,   cost = mean of (y - sample)^2

use scarab::real::{Real, exp, sin_cos};
use scarab::swarm::Objective;

/// Unknowns.
pub const UNKNOWNS: usize = 5;

/// Name, unit, lowest and highest value of each unknown.
pub const BOX: [(&str, &str, f64, f64); UNKNOWNS] = [
    ("amplitude", "V", 0.1, 5.0),
    ("decay", "1/s", 0.0, 3.0),
    ("frequency", "rad/s", 2.0, 20.0),
    ("phase", "rad", -3.2, 3.2),
    ("offset", "V", -1.0, 1.0),
];

/// Samples and the time between them, s.
pub struct DampedOscillation<'a, T> {
    pub samples: &'a [T],
    pub interval: T,
}

/// y(t).
pub fn oscillation<T: Real>(unknowns: &[T], time: T) -> T {
    let &[amplitude, decay, frequency, phase, offset] = unknowns else { return T::zero() };
    amplitude * exp(-decay * time) * sin_cos(frequency * time + phase).1 + offset
}

impl<T: Real> Objective<T> for DampedOscillation<'_, T> {
    fn dimension(&self) -> usize {
        UNKNOWNS
    }

    fn bounds(&self, coordinate: usize) -> (T, T) {
        BOX.get(coordinate)
            .map_or((T::zero(), T::one()), |&(_, _, low, high)| (T::from_double(low), T::from_double(high)))
    }

    fn evaluate(&self, position: &[T]) -> T {
        let (mut sum, mut time, mut count) = (T::zero(), T::zero(), T::zero());
        for &sample in self.samples {
            let error = oscillation(position, time) - sample;
            sum += error * error;
            time += self.interval;
            count += T::one();
        }
        sum / count
    }
}
