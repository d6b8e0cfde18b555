//! Configuration of a leg: everything that is constant while it runs.

use super::activity::VALIDATION_MOTIONS;
use crate::ident::{Estimator, KernelError, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds};
use crate::motion::{JointEnvelope, LimitViolation, Motion, Periodic};
use crate::servo::{JointConfiguration, ServoError};
use crate::units::{RadianPerSecond, RadianPerSecondSquared};

/// Share of the speed and acceleration limits used on the approach to a motion's start.
const APPROACH_SHARE: f32 = 0.25;

/// Configuration of a leg. Angles and torques have the model's (D-H) sign.
#[derive(Clone, Debug, PartialEq)]
pub struct LegConfiguration<const N: usize, const B: usize> {
    /// Scales, limits and bandwidth of each joint.
    pub joints: [JointConfiguration; N],
    /// Largest commanded acceleration.
    pub acceleration: [RadianPerSecondSquared; N],
    /// Geometry, gravity and base parameters.
    pub model: RowModel<f32, N, B>,
    /// Prior knowledge of links and drives, if any.
    pub prior: Option<[LinkPrior<f32>; N]>,
    /// One-time or sequential identification.
    pub plan: Plan,
    /// Seed of the swarm's random numbers.
    pub swarm_seed: u64,
    /// Acceptance limits of a result.
    pub thresholds: Thresholds<f32>,
    /// Model monitor: when a tracked motion shows that the model no longer fits.
    pub monitor: MonitorSettings<f32>,
    /// Robust or plain estimator for the training motion.
    pub estimator: Estimator,
    /// 3 dB bandwidth of the identification's low-pass, Hz.
    pub bandwidth_hz: f32,
    /// Training motion.
    pub excitation: Periodic<N>,
    /// Validation motions.
    pub validation: [Periodic<N>; VALIDATION_MOTIONS],
}

/// A motion proved to stay within a leg's limits, so that the tick need not check it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProvedMotion<const N: usize>(Periodic<N>);

impl<const N: usize> ProvedMotion<N> {
    /// Returns the motion.
    pub fn motion(&self) -> &Periodic<N> {
        &self.0
    }
}

/// Reason why a leg cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegError {
    /// A joint's limits or scales are invalid.
    Servo(ServoError),
    /// A motion exceeds the limits.
    Limit(LimitViolation),
    /// The filter cannot be built.
    Kernel(KernelError),
}

impl<const N: usize, const B: usize> LegConfiguration<N, B> {
    /// Limits for every motion.
    pub fn envelope(&self) -> [JointEnvelope; N] {
        core::array::from_fn(|joint| JointEnvelope {
            low: self.joints[joint].low,
            high: self.joints[joint].high,
            speed: self.joints[joint].speed,
            acceleration: self.acceleration[joint],
        })
    }

    /// Speed and acceleration limits of the approach to a motion's start.
    pub fn approach(&self) -> ([RadianPerSecond; N], [RadianPerSecondSquared; N]) {
        (
            self.joints.map(|joint| joint.speed * APPROACH_SHARE),
            self.acceleration.map(|acceleration| acceleration * APPROACH_SHARE),
        )
    }

    /// Proves that a motion stays within the limits. Cost: 206,000 instructions, so not within a tick.
    ///
    /// # Errors
    /// [`LegError::Limit`] names the first joint and quantity that exceed the limits.
    pub fn prove(&self, motion: Periodic<N>) -> Result<ProvedMotion<N>, LegError> {
        Motion::Periodic(motion).prove(&self.envelope()).map_err(LegError::Limit)?;
        Ok(ProvedMotion(motion))
    }
}
