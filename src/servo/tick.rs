//! The servo tick of a leg: sample, command and gravity in, a decision out; no clock, no log, no hardware.
//!
//! Every tick takes these steps in every state, so the cost does not depend on the situation:
//!
//! 1. Each reading passes its step gate and updates its observer. While the drive follows, the commanded
//!    acceleration is added, limited to the joint's ability.
//! 2. Feedforward from the commanded motion, feedback from its error.
//! 3. The monitor decides, last.
//! 4. The integrals are updated with the applied torque.
//!
//! Cost: most of the leg's tick, which `cargo chip load` counts (Cortex-M4F, two joints, enabled).
//!
//! Values that are not finite pass through to the monitor, which switches off in that tick, and enter no
//! state: observers take only integers and a bounded acceleration, integrals are cleared.

use super::configuration::{JointConfiguration, ServoError};
use super::controller::{Controller, ControllerGains};
use super::feedforward::{TorqueModel, feedforward_nm};
use super::observer::{OBSERVER_BANDWIDTH, Observer, ObserverGains};
use super::scale::JointScale;
use super::{SERVO_RATE_HZ, TICK_S};
use crate::checksum::Checksum;
use crate::hal::{DriveCommand, Sample};
use crate::motion::MotionState;
use crate::real::{clamp, is_finite, max, min};
use crate::safety::{
    Decision, DriveState, Fault, Limits, Monitor, Observation, Permission, PowerRequest, Reading, Request,
    StepGate,
};
use crate::units::{Hertz, NewtonMetre, Radian, RadianPerSecond};

/// Largest encoder step as a multiple of the speed limit, and extra counts for quantisation.
const STEP_PER_SPEED: f32 = 2.0;
const STEP_COUNTS: u32 = 2;

/// Command to a leg at one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoCommand<'model, const N: usize, M> {
    /// Commanded motion, model's angles.
    pub motion: MotionState<N>,
    /// Model for the feedforward, if there is one.
    pub feedforward: Option<&'model M>,
    /// Power request of the operator, only at the tick of the request.
    pub power: Option<PowerRequest>,
}

/// Torque command of a joint beside the motion.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Effort {
    /// Torque in addition to the motion's, or alone.
    pub(crate) torque: NewtonMetre,
    /// True if the motion is held; otherwise `torque` is the whole command.
    pub(crate) held: bool,
    /// Limit of the commanded torque; the motion's control does not wind up against it.
    pub(crate) largest: NewtonMetre,
    /// Share of the controller's damping that acts while the motion is not held, 0..1.
    pub(crate) damping_share: f32,
}

impl Effort {
    /// Effort of the motion alone.
    pub(crate) const HELD: Self = Self {
        torque: NewtonMetre::ZERO,
        held: true,
        largest: NewtonMetre(f32::INFINITY),
        damping_share: 0.0,
    };
}

/// Result of one tick, in the model's angles and signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ServoOutput<const N: usize> {
    /// Estimated angles.
    pub position: [Radian; N],
    /// Estimated velocities.
    pub velocity: [RadianPerSecond; N],
    /// Encoder counts; those of the observer where the reading was impossible.
    pub(crate) accepted_counts: [i32; N],
    /// Commanded minus estimated angles.
    pub tracking_error: [Radian; N],
    /// Torques of feedforward and feedback before the monitor.
    pub wanted_torque: [NewtonMetre; N],
    /// Damping within the wanted torques that opposes the joints' own velocities.
    pub(crate) braking_torque: [NewtonMetre; N],
    /// Decision of the monitor; its command is for the drives.
    pub decision: Decision<N>,
}

impl<const N: usize> ServoOutput<N> {
    /// Command for the drives.
    pub fn drive(&self) -> &DriveCommand<N> {
        &self.decision.command
    }
}

/// Constants of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Joint {
    scale: JointScale,
    count_per_radian: f32,
    controller: ControllerGains,
    /// Gains at the configuration's bandwidth.
    configured: ControllerGains,
    largest_acceleration_rad_per_s2: f32,
}

/// Servo of one leg; see the module's steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Servo<const N: usize> {
    joints: [Joint; N],
    observer_gains: ObserverGains,
    gates: [StepGate; N],
    observers: [Observer; N],
    controllers: [Controller; N],
    pub(crate) monitor: Monitor<N>,
}

impl<const N: usize> Servo<N> {
    /// Builds a servo with the drive off; the error names the first invalid joint.
    pub fn new(joints: [JointConfiguration; N]) -> Result<Self, ServoError> {
        for (joint, configuration) in joints.iter().enumerate() {
            configuration.check(joint)?;
        }
        let limits =
            Limits::new(joints.map(|configuration| configuration.limits())).map_err(ServoError::Limits)?;
        Ok(Self {
            joints: joints.map(|configuration| {
                let cap = configuration.limits().torque_cap();
                let gains = ControllerGains::new(configuration.inertia, configuration.bandwidth, cap);
                Joint {
                    scale: configuration.scale,
                    count_per_radian: 1.0 / configuration.scale.signed_radian_per_count(),
                    controller: gains,
                    configured: gains,
                    largest_acceleration_rad_per_s2: cap.0 / configuration.inertia.0,
                }
            }),
            observer_gains: ObserverGains::new(OBSERVER_BANDWIDTH),
            gates: joints.map(|configuration| {
                let step = STEP_PER_SPEED * configuration.speed.0 * TICK_S;
                StepGate::new((step / configuration.scale.radian_per_count.0) as u32 + STEP_COUNTS)
            }),
            observers: [Observer::default(); N],
            controllers: [Controller::default(); N],
            monitor: Monitor::new(limits, SERVO_RATE_HZ),
        })
    }

    /// Runs instead of a tick while the joints have no valid readings ([`Monitor::stand_by`]).
    pub(crate) fn stand_by(&mut self, resets: bool) -> Option<Fault> {
        self.monitor.stand_by(resets)
    }

    /// Resets to drive off without readings: for joints whose counts get another meaning. A fault stays.
    pub(crate) fn restart(&mut self) {
        self.gates.iter_mut().for_each(StepGate::restart);
        self.observers = [Observer::default(); N];
        self.controllers.iter_mut().for_each(Controller::reset);
        self.monitor.restart();
    }

    /// State of the drive.
    pub fn state(&self) -> DriveState {
        self.monitor.state()
    }

    /// Sets the bandwidth of each position loop; `None`: the configuration's. Only with the drive off, since
    /// other gains are a step of torque.
    pub(crate) fn set_bandwidths(&mut self, bandwidths: &[Option<Hertz>; N]) {
        for (joint, bandwidth) in self.joints.iter_mut().zip(bandwidths) {
            let configured = joint.configured;
            joint.controller = bandwidth.map_or(configured, |bandwidth| configured.with_bandwidth(bandwidth));
        }
    }

    /// Checksum of gains, scales and limits. Only [`Self::set_bandwidths`] changes it.
    pub(crate) fn checksum(&self) -> Checksum {
        self.joints.iter().fold(self.monitor.checksum(), |sum, joint| {
            let Joint { scale, count_per_radian, controller, configured, largest_acceleration_rad_per_s2 } =
                joint;
            let signed = [scale.signed_radian_per_count(), scale.signed_torque_per_ampere().0];
            configured
                .add_to(controller.add_to(sum))
                .numbers(signed)
                .numbers([*count_per_radian, *largest_acceleration_rad_per_s2])
        })
    }

    /// Damping of a joint's controller, N m s/rad; zero beyond the last joint.
    pub(crate) fn damping(&self, joint: usize) -> f32 {
        self.joints.get(joint).map_or(0.0, |joint| joint.controller.damping_nm_s_per_rad())
    }

    /// Limits of each joint.
    pub fn limits(&self) -> &Limits<N> {
        self.monitor.limits()
    }

    /// Conversion of each joint.
    pub(crate) fn scales(&self) -> [JointScale; N] {
        self.joints.map(|joint| joint.scale)
    }

    /// Runs one tick, with torques beside the motion if there are any; `gravity` in the base frame, m/s^2.
    #[must_use]
    #[inline]
    pub fn tick<M: TorqueModel<N>>(
        &mut self,
        sample: &Sample<N>,
        command: &ServoCommand<'_, N, M>,
        efforts: Option<&[Effort; N]>,
        gravity: [f32; 3],
    ) -> ServoOutput<N> {
        let motion = &command.motion;
        let rejected = self.observe(sample, motion);
        // One loop, not a closure for each: a size-optimised build would call every closure for every joint.
        let mut accepted_counts = [0; N];
        let mut position = [Radian::ZERO; N];
        let mut velocity = [RadianPerSecond::ZERO; N];
        let mut tracking_error = [Radian::ZERO; N];
        for joint in 0..N {
            let (observer, scale) = (&self.observers[joint], &self.joints[joint].scale);
            let reading = sample.joints[joint].encoder_counts;
            accepted_counts[joint] = if rejected[joint] { observer.nearest_counts() } else { reading };
            position[joint] = scale.position(observer.position_counts());
            velocity[joint] =
                RadianPerSecond(scale.signed_radian_per_count() * observer.velocity_counts_per_s());
            tracking_error[joint] = Radian(motion.position_rad[joint]) - position[joint];
        }

        let feedforward = feedforward_nm(command.feedforward, motion, gravity);
        let wanted_torque: [NewtonMetre; N] = core::array::from_fn(|joint| {
            let velocity_error = RadianPerSecond(motion.velocity_rad_per_s[joint]) - velocity[joint];
            let gains = &self.joints[joint].controller;
            let held = NewtonMetre(feedforward[joint])
                + self.controllers[joint].torque(gains, tracking_error[joint], velocity_error);
            match efforts.map(|efforts| &efforts[joint]) {
                None => held,
                Some(Effort { torque, held: true, .. }) => held + *torque,
                Some(Effort { torque, damping_share, .. }) => {
                    *torque - self.damped(joint, *damping_share, velocity[joint])
                }
            }
        });

        // A reading that the axis rejected is absent from the sample but flagged, and counts as rejected too.
        let rejected = core::array::from_fn(|joint| rejected[joint] || sample.joints[joint].doubtful);
        let observation =
            Observation { position, velocity, current: sample.joints.map(|joint| joint.current), rejected };
        let torque = match efforts {
            None => wanted_torque,
            // NaN passes through to the monitor, which switches off.
            Some(efforts) => core::array::from_fn(|joint| match wanted_torque[joint] {
                wanted if wanted.abs() > efforts[joint].largest => wanted.limited(efforts[joint].largest),
                wanted => wanted,
            }),
        };
        let request = Request { torque, power: command.power };
        let decision = self.monitor.decide(&observation, &request);
        self.settle(&tracking_error, &wanted_torque, &decision);
        for joint in 0..N {
            if let Some(Effort { held: false, damping_share, .. }) = efforts.map(|efforts| &efforts[joint]) {
                // Preset, so that the motion's control later starts from the present torque.
                let damping = self.damped(joint, *damping_share, velocity[joint]);
                // The held tick adds the feedforward.
                let preset = decision.torque[joint] + damping - NewtonMetre(feedforward[joint]);
                self.controllers[joint].preset(&self.joints[joint].controller, preset);
            }
        }
        let braking_torque = core::array::from_fn(|joint| {
            let opposite = -velocity[joint].0;
            let (share, braking) = match efforts.map(|efforts| &efforts[joint]) {
                Some(Effort { held: false, damping_share, .. }) => (*damping_share, opposite),
                // No more than the joint's own velocity: the rest of the error may carry a load.
                _ => {
                    let error = motion.velocity_rad_per_s[joint] + opposite;
                    (1.0, clamp(error, min(opposite, 0.0), max(opposite, 0.0)))
                }
            };
            self.damped(joint, share, RadianPerSecond(braking))
        });
        ServoOutput {
            position,
            velocity,
            accepted_counts,
            tracking_error,
            wanted_torque,
            braking_torque,
            decision,
        }
    }

    /// Torque of a share of the controller's damping.
    fn damped(&self, joint: usize, share: f32, velocity: RadianPerSecond) -> NewtonMetre {
        NewtonMetre(share * self.joints[joint].controller.damping_nm_s_per_rad() * velocity.0)
    }

    /// Moves the observers by one tick; returns which readings were rejected.
    fn observe(&mut self, sample: &Sample<N>, motion: &MotionState<N>) -> [bool; N] {
        let follows = self.monitor.state().permission() == Permission::Follow;
        core::array::from_fn(|joint| {
            let Joint { count_per_radian, largest_acceleration_rad_per_s2: largest, .. } = self.joints[joint];
            let commanded = motion.acceleration_rad_per_s2[joint];
            let acceleration = if follows && is_finite(commanded) {
                count_per_radian * clamp(commanded, -largest, largest)
            } else {
                0.0
            };
            let counts = sample.joints[joint].encoder_counts;
            let reading = self.gates[joint].judge(counts);
            let observer = &mut self.observers[joint];
            match reading {
                Reading::Good => observer.update(&self.observer_gains, counts, acceleration),
                Reading::Rejected => observer.coast(acceleration),
                Reading::Jumped => observer.reseat(counts),
            }
            reading != Reading::Good
        })
    }

    fn settle(&mut self, error: &[Radian; N], wanted: &[NewtonMetre; N], decision: &Decision<N>) {
        let follows = decision.state.permission() == Permission::Follow;
        for joint in 0..N {
            let controller = &mut self.controllers[joint];
            if follows {
                let gains = &self.joints[joint].controller;
                controller.settle(gains, error[joint], wanted[joint], decision.torque[joint]);
            } else {
                controller.reset();
            }
        }
    }
}

/// Fault injection, host only: bit flips that the checksum must find (row M2 of docs/safety.md).
#[cfg(not(target_os = "none"))]
impl<const N: usize> Servo<N> {
    /// Numbers of a joint that can be flipped.
    pub const NUMBERS: u8 = 6;

    /// Flips one bit (of 32, from the lowest) of one of a joint's constants: counts per radian, largest
    /// acceleration, current per torque, overspeed bound, either end of the range.
    pub(crate) fn flip_bit(&mut self, joint: usize, number: u8, bit: u8) {
        let Some(this) = self.joints.get_mut(joint) else { return };
        let flipped = match number {
            0 => &mut this.count_per_radian,
            1 => &mut this.largest_acceleration_rad_per_s2,
            number => match self.monitor.number_mut(joint, number - 2) {
                Some(flipped) => flipped,
                None => return,
            },
        };
        *flipped = f32::from_bits(flipped.to_bits() ^ 1 << (bit % 32));
    }
}

#[cfg(test)]
mod tests;
