//! What does not change about a leg while it runs.

use super::activity::VALIDATION_MOTIONS;
use crate::ident::{Estimator, KernelError, LinkPrior, MonitorSettings, Plan, RowModel, Thresholds};
use crate::motion::{JointEnvelope, LimitViolation, Motion, MotionError, Periodic};
use crate::servo::{JointConfiguration, ServoError};
use crate::units::{RadianPerSecond, RadianPerSecondSquared};

/// Share of the speed and acceleration limits at which a leg approaches a motion's start.
const APPROACH_SHARE: f32 = 0.25;

/// Everything a leg is built from. Angles and torques have the model's (D-H) sign.
#[derive(Clone, Debug, PartialEq)]
pub struct LegConfiguration<const N: usize, const B: usize> {
    /// Scales, limits and bandwidth of each joint.
    pub joints: [JointConfiguration; N],
    /// Largest acceleration that is commanded.
    pub acceleration: [RadianPerSecondSquared; N],
    /// Geometry, gravity and base parameters.
    pub model: RowModel<f32, N, B>,
    /// What is believed before measuring, if anything.
    pub prior: Option<[LinkPrior<f32>; N]>,
    /// One-time or sequential.
    pub plan: Plan,
    /// Of the swarm's random numbers.
    pub swarm_seed: u64,
    /// What a result must keep.
    pub thresholds: Thresholds<f32>,
    /// When a tracked motion says that the model no longer fits.
    pub monitor: MonitorSettings<f32>,
    /// How disturbances of the motion identified from are met.
    pub estimator: Estimator,
    /// Where the low-pass of the identification is 3 dB down, Hz.
    pub bandwidth_hz: f32,
    /// The motion identified from.
    pub excitation: Periodic<N>,
    /// The motions predicted.
    pub validation: [Periodic<N>; VALIDATION_MOTIONS],
}

/// A motion that was shown to stay within a leg's limits, so that the tick need not show it again.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ProvedMotion<const N: usize>(Periodic<N>);

impl<const N: usize> ProvedMotion<N> {
    /// The motion.
    #[must_use]
    pub fn motion(&self) -> &Periodic<N> {
        &self.0
    }
}

/// Why a leg cannot be built.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LegError {
    /// A joint's limits or scales make no sense.
    Servo(ServoError),
    /// A motion does not stay within the limits.
    Limit(LimitViolation),
    /// A motion makes no sense.
    Motion(MotionError),
    /// The filter cannot be built.
    Kernel(KernelError),
}

impl From<ServoError> for LegError {
    fn from(error: ServoError) -> Self {
        Self::Servo(error)
    }
}

impl From<LimitViolation> for LegError {
    fn from(error: LimitViolation) -> Self {
        Self::Limit(error)
    }
}

impl From<MotionError> for LegError {
    fn from(error: MotionError) -> Self {
        Self::Motion(error)
    }
}

impl From<KernelError> for LegError {
    fn from(error: KernelError) -> Self {
        Self::Kernel(error)
    }
}

impl<const N: usize, const B: usize> LegConfiguration<N, B> {
    /// What every motion must keep.
    #[must_use]
    pub fn envelope(&self) -> [JointEnvelope; N] {
        core::array::from_fn(|joint| JointEnvelope {
            low: self.joints[joint].low,
            high: self.joints[joint].high,
            speed: self.joints[joint].speed,
            acceleration: self.acceleration[joint],
        })
    }

    /// Speed and acceleration at which a motion's start is approached.
    #[must_use]
    pub fn approach(&self) -> ([RadianPerSecond; N], [RadianPerSecondSquared; N]) {
        (
            self.joints.map(|joint| joint.speed * APPROACH_SHARE),
            self.acceleration.map(|acceleration| acceleration * APPROACH_SHARE),
        )
    }

    /// Shows that a motion stays within the limits: 206,000 instructions, outside the tick.
    ///
    /// # Errors
    /// [`LegError::Limit`] names the first joint and quantity that do not.
    pub fn prove(&self, motion: Periodic<N>) -> Result<ProvedMotion<N>, LegError> {
        Motion::Periodic(motion).prove(&self.envelope())?;
        Ok(ProvedMotion(motion))
    }
}
