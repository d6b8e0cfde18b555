//! First filter step: angle, speed and acceleration of one past instant, and the torque at that instant.
//!
//! A window of the last `2 reach + 1` angles goes through the three weights of one [`Kernel`]. The torque is
//! only delayed to the same instant, because the second step filters it together with the whole regressor.
//!
//! Cost: 3 `taps` multiplications for each joint and sample. Memory: 2 `TAPS` numbers for each joint.

use super::kernel::Kernel;
use crate::real::Real;

/// Motion and torque of one instant, D-H angles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Smoothed<T, const N: usize> {
    /// Angle, rad.
    pub position: [T; N],
    /// Speed, rad/s.
    pub velocity: [T; N],
    /// Acceleration, rad/s^2.
    pub acceleration: [T; N],
    /// Measured torque, N m.
    pub torque: [T; N],
}

/// Window of samples that gives a [`Smoothed`].
#[derive(Clone, Debug, PartialEq)]
pub struct Smoother<T, const N: usize, const TAPS: usize> {
    positions: [[T; TAPS]; N],
    torques: [[T; TAPS]; N],
    next: usize,
    filled: usize,
}

impl<T: Real, const N: usize, const TAPS: usize> Smoother<T, N, TAPS> {
    /// An empty window.
    pub fn new() -> Self {
        Self { positions: [[T::zero(); TAPS]; N], torques: [[T::zero(); TAPS]; N], next: 0, filled: 0 }
    }

    /// Discards all samples.
    pub fn clear(&mut self) {
        self.next = 0;
        self.filled = 0;
    }

    /// Takes one sample; returns the instant `reach` samples ago once the window is full.
    pub fn push(
        &mut self,
        kernel: &Kernel<T, TAPS>,
        position: &[T; N],
        torque: &[T; N],
    ) -> Option<Smoothed<T, N>> {
        let taps = kernel.taps();
        for joint in 0..N {
            *self.positions[joint].get_mut(self.next)? = position[joint];
            *self.torques[joint].get_mut(self.next)? = torque[joint];
        }
        self.next = if self.next + 1 >= taps { 0 } else { self.next + 1 };
        self.filled = (self.filled + 1).min(taps);
        if self.filled < taps {
            return None;
        }
        // The ring holds exactly the window: its oldest sample is where the next one will go.
        let centre = if self.next + kernel.reach() >= taps {
            self.next + kernel.reach() - taps
        } else {
            self.next + kernel.reach()
        };
        let mut smoothed = Smoothed {
            position: [T::zero(); N],
            velocity: [T::zero(); N],
            acceleration: [T::zero(); N],
            torque: [T::zero(); N],
        };
        for joint in 0..N {
            let window = self.positions[joint].get(..taps)?;
            let (newer, older) = window.split_at_checked(self.next)?;
            (smoothed.position[joint], smoothed.velocity[joint], smoothed.acceleration[joint]) =
                kernel.apply(older, newer, *window.get(centre)?);
            smoothed.torque[joint] = *self.torques[joint].get(centre)?;
        }
        Some(smoothed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real;

    #[test]
    fn a_slow_sine_comes_back_with_its_derivatives_at_the_right_instant() {
        let kernel = Kernel::<f32, 256>::new(8.0, 500.0).expect("fits");
        let mut smoother = Smoother::<f32, 1, 256>::new();
        let omega = 2.0 * core::f32::consts::PI * 0.5;
        let mut seen = 0;
        for index in 0..2000_usize {
            let time = index as f32 / 500.0;
            let sample = [0.7 + 0.4 * real::sin_cos(omega * time).0];
            let Some(smoothed) = smoother.push(&kernel, &sample, &[index as f32]) else { continue };
            let (sine, cosine) = real::sin_cos(omega * (index - kernel.reach()) as f32 / 500.0);
            // The passband is flat to 1.6e-4; single precision adds 1e-7 of 1 rad
            // through a curvature gain of 1e4.
            assert!((smoothed.position[0] - 0.7 - 0.4 * sine).abs() < 1.6e-4 * 0.4 + 1e-6);
            assert!((smoothed.velocity[0] - 0.4 * omega * cosine).abs() < 1.6e-4 * 0.4 * omega + 1e-5);
            let error = smoothed.acceleration[0] + 0.4 * omega * omega * sine;
            assert!(error.abs() < 1.6e-4 * 0.4 * 9.9 + 1e-3);
            assert_eq!(smoothed.torque[0], (index - kernel.reach()) as f32);
            seen += 1;
        }
        assert_eq!(seen, 2000 - 2 * kernel.reach());
    }
}
