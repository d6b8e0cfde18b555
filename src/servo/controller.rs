//! Position and velocity control of one joint, with an integral that cannot wind up.
//!
//! A cascade: the position error commands a velocity, the velocity error a torque. Feedforward is added. The
//! integral covers the gravity and friction that no model describes.
//!
//! ```text
//! torque = feedforward + D (qd_c - qd + kp (q_c - q)) + integral
//! integral' = D kp ki (q_c - q)
//! D = 4 kp J,   kp = 2 pi f / 1.29,   ki = kp / 8
//! ```
//!
//! `q`, `qd` estimated and `q_c`, `qd_c` commanded angle (rad) and velocity (rad/s); `J` the joint's largest
//! inertia, kg m^2; `D` N m s/rad; `kp`, `ki` 1/s; `f` the bandwidth, Hz. Without integral and delay the
//! closed loop has a double pole at 2 kp. It follows a commanded position (no velocity commanded) to -3 dB at
//! 1.29 kp / 2 pi = f. With the commanded velocity, as the servo runs, it follows further.
//!
//! Measured against a simulated knee (2.53 kg m^2, 3.3 N m s/rad, drive of 1 ms, one tick of computing, f = 6
//! Hz): -3 dB at 6.3 Hz without and 40 Hz with the commanded velocity; crossover 19.5 Hz with a phase margin
//! of 47 degrees, 42 degrees at three quarters and 29 at half of the inertia.
//!
//! The integral stops while the monitor limits the torque and the error would increase it. Its
//! magnitude never exceeds the torque cap, and it is zero whenever the drive does not follow. Cost:
//! about 15 operations per joint.

use super::TICK_S;
use crate::checksum::Checksum;
use crate::real::clamp;
use crate::units::{Hertz, KilogramMetreSquared, NewtonMetre, Radian, RadianPerSecond};

/// Ratio of bandwidth and gain: -3 dB of a double pole lies at 0.644 of it, the pole at 2 kp.
const BANDWIDTH_PER_GAIN: f32 = 1.287_2;
/// Ratio of velocity loop and position loop that puts both poles together.
const DAMPING_PER_GAIN: f32 = 4.0;
/// Ratio of position loop and integral: costs some 2 degrees of phase margin.
const GAIN_PER_INTEGRAL: f32 = 8.0;

/// Gains of one joint; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ControllerGains {
    position_per_s: f32,
    damping_nm_s_per_rad: f32,
    integral_nm_per_rad_s: f32,
    cap_nm: f32,
}

impl ControllerGains {
    /// Computes the gains for an inertia and a bandwidth; `cap` limits the integral.
    pub fn new(inertia: KilogramMetreSquared, bandwidth: Hertz, cap: NewtonMetre) -> Self {
        let position_per_s = core::f32::consts::TAU * bandwidth.0 / BANDWIDTH_PER_GAIN;
        let damping_nm_s_per_rad = DAMPING_PER_GAIN * position_per_s * inertia.0;
        let integral_per_s = position_per_s / GAIN_PER_INTEGRAL;
        Self {
            position_per_s,
            damping_nm_s_per_rad,
            integral_nm_per_rad_s: damping_nm_s_per_rad * position_per_s * integral_per_s,
            cap_nm: cap.0,
        }
    }

    /// Returns the gains of the same joint with another bandwidth.
    pub(crate) fn with_bandwidth(&self, bandwidth: Hertz) -> Self {
        let inertia = self.damping_nm_s_per_rad / (DAMPING_PER_GAIN * self.position_per_s);
        Self::new(KilogramMetreSquared(inertia), bandwidth, NewtonMetre(self.cap_nm))
    }

    /// Adds all gains to a checksum.
    pub(crate) fn add_to(&self, sum: Checksum) -> Checksum {
        let Self { position_per_s, damping_nm_s_per_rad, integral_nm_per_rad_s, cap_nm } = *self;
        sum.numbers([position_per_s, damping_nm_s_per_rad, integral_nm_per_rad_s, cap_nm])
    }

    /// Torque per velocity error, N m s/rad.
    pub(crate) fn damping_nm_s_per_rad(&self) -> f32 {
        self.damping_nm_s_per_rad
    }

    /// Torque per position error without the integral, N m/rad.
    pub(crate) fn stiffness_nm_per_rad(&self) -> f32 {
        self.damping_nm_s_per_rad * self.position_per_s
    }
}

/// State of one joint's controller: the integral's torque.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Controller {
    integral_nm: f32,
}

impl Controller {
    /// Feedback torque for errors of position and velocity (commanded minus estimated).
    pub(crate) fn torque(
        &self,
        gains: &ControllerGains,
        position_error: Radian,
        velocity_error: RadianPerSecond,
    ) -> NewtonMetre {
        let velocity_error = velocity_error.0 + gains.position_per_s * position_error.0;
        NewtonMetre(gains.damping_nm_s_per_rad * velocity_error + self.integral_nm)
    }

    /// Updates the integral from the wanted and the applied torque.
    pub(crate) fn settle(
        &mut self,
        gains: &ControllerGains,
        position_error: Radian,
        wanted: NewtonMetre,
        applied: NewtonMetre,
    ) {
        let taken_nm = wanted.0 - applied.0;
        if taken_nm * position_error.0 > 0.0 {
            return;
        }
        let integral_nm = self.integral_nm + gains.integral_nm_per_rad_s * TICK_S * position_error.0;
        self.integral_nm = clamp(integral_nm, -gains.cap_nm, gains.cap_nm);
    }

    /// Sets the integral to this torque, within its cap.
    pub(crate) fn preset(&mut self, gains: &ControllerGains, torque: NewtonMetre) {
        self.integral_nm = clamp(torque.0, -gains.cap_nm, gains.cap_nm);
    }

    /// Empties the integral.
    pub(crate) fn reset(&mut self) {
        self.integral_nm = 0.0;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn gains() -> ControllerGains {
        ControllerGains::new(KilogramMetreSquared(2.0), Hertz(6.0), NewtonMetre(100.0))
    }

    #[test]
    fn another_bandwidth_gives_the_gains_of_the_same_inertia() {
        let (inertia, cap) = (KilogramMetreSquared(2.53), NewtonMetre(85.0));
        let slower = ControllerGains::new(inertia, Hertz(6.0), cap).with_bandwidth(Hertz(1.5));
        let expected = ControllerGains::new(inertia, Hertz(1.5), cap);
        assert!((slower.stiffness_nm_per_rad() / expected.stiffness_nm_per_rad() - 1.0).abs() < 1e-5);
        assert!((slower.damping_nm_s_per_rad() / expected.damping_nm_s_per_rad() - 1.0).abs() < 1e-5);
        assert!((slower.integral_nm_per_rad_s / expected.integral_nm_per_rad_s - 1.0).abs() < 1e-5);
    }

    #[test]
    fn gains_give_an_inertia_a_double_pole() {
        let gains = gains();
        let discriminant = gains.damping_nm_s_per_rad * gains.damping_nm_s_per_rad
            - 4.0 * 2.0 * gains.stiffness_nm_per_rad();
        // Single precision of numbers of some 50,000.
        assert!(discriminant.abs() < 0.1, "{discriminant}");
        let pole_hz = gains.damping_nm_s_per_rad / (2.0 * 2.0) / core::f32::consts::TAU;
        // The half power of a double pole is at (sqrt(2) - 1)^(1/2).
        assert!((pole_hz * 0.643_594 - 6.0).abs() < 1e-3, "{pole_hz}");
    }

    #[test]
    fn the_integral_does_not_grow_into_what_the_monitor_takes_away() {
        let gains = gains();
        let mut controller = Controller::default();
        let error = Radian(0.1);
        controller.settle(&gains, error, NewtonMetre(150.0), NewtonMetre(100.0));
        assert_eq!(NewtonMetre(controller.integral_nm), NewtonMetre::ZERO);
        controller.settle(&gains, error, NewtonMetre(90.0), NewtonMetre(90.0));
        let grown = NewtonMetre(controller.integral_nm);
        assert!(grown.0 > 0.0);
        // Shrinking is always allowed.
        controller.settle(&gains, -error, NewtonMetre(150.0), NewtonMetre(100.0));
        assert!(NewtonMetre(controller.integral_nm) < grown);
        for _ in 0..1_000_000 {
            controller.settle(&gains, error, NewtonMetre(90.0), NewtonMetre(90.0));
        }
        assert_eq!(NewtonMetre(controller.integral_nm), NewtonMetre(100.0));
        controller.reset();
        assert_eq!(NewtonMetre(controller.integral_nm), NewtonMetre::ZERO);
    }
}
