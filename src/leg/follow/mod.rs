//! Follows the commands of a host, tick by tick, with every joint of a leg.
//!
//! Why a separate activity: identification and tracking use motions that were proved beforehand; here the
//! next target is unknown. Each joint has a [`Follower`](joint::Follower) that turns the commands into a
//! trajectory. The servo and the safety monitor behind it are unchanged; the monitor has the last word.
//!
//! ```text
//! JointCommand (anatomical) --Follower--> Demand --anatomy--> MotionState, Effort (model)
//! MotionState, Effort --> servo --> safety monitor
//! ```
//!
//! The commands use anatomical angles, the servo those of the model; both are converted only here. Homing
//! gives a joint another zero for hosts alone: the offset is added to what they read and subtracted from what
//! they command. Servo and safety monitor stay with the zero of the operator's reference, because a host must
//! not move the range that limits it.
//!
//! Cost: docs/results/bus.md, instructions.

mod command;
mod joint;

pub(crate) use command::LONGEST_PERIOD;
pub use command::{ImpedanceTarget, JointCommand, JointStatus, Mode, Reference, SetPoint, Target};

use joint::{Bounds, Demand, Follower, Measured};

use super::configuration::LegConfiguration;
use super::control::ControlOutput;
use crate::model::AnatomicalJoint;
use crate::motion::{Course, MotionState};
use crate::safety::{Fault, FaultCode, RANGE_TOLERANCE, RefusalReason};
use crate::servo::{Effort, ServoOutput};
use crate::units::{NewtonMetre, Radian, RadianPerSecond, Volt};

/// Command for the servo at one tick, in the model's angles and signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Commanded<const N: usize> {
    /// Commanded motion.
    pub(crate) motion: MotionState<N>,
    /// Additional torques.
    pub(crate) efforts: [Effort; N],
    /// Following error of a joint.
    pub(crate) fault: Option<Fault>,
}

/// Followers of all joints of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following<const N: usize> {
    joints: [Follower; N],
    bounds: [Bounds; N],
    anatomy: [AnatomicalJoint<f32>; N],
    measured: [Measured; N],
    largest: [NewtonMetre; N],
    /// Angle that hosts read where the operator's reference is zero; set by homing.
    zeros: [Radian; N],
}

impl<const N: usize> Following<N> {
    /// Creates the followers without a command.
    pub fn new<const B: usize>(configuration: &LegConfiguration<N, B>) -> Self {
        let anatomy = configuration.joints.map(|joint| joint.scale.anatomy);
        Self {
            joints: [Follower::NEW; N],
            bounds: core::array::from_fn(|joint| {
                let limits = configuration.joints[joint].limits();
                let ends = [limits.low.0, limits.high.0].map(|end| anatomy[joint].angle_from_chain(end));
                Bounds {
                    range: if ends[0] <= ends[1] { ends } else { [ends[1], ends[0]] },
                    speed: limits.speed.0,
                    acceleration: configuration.acceleration[joint].0,
                    torque: limits.torque_cap().0,
                    impedance: configuration.joints[joint].stiffest_impedance(),
                }
            }),
            anatomy,
            measured: [Measured::default(); N],
            largest: [NewtonMetre::ZERO; N],
            zeros: [Radian::ZERO; N],
        }
    }

    /// Resets after a new reference; the zeros set by homing are discarded.
    pub(crate) fn restart(&mut self) {
        self.zeros = [Radian::ZERO; N];
        self.joints = [Follower::NEW; N];
        self.measured = [Measured::default(); N];
    }

    /// Starts following from the commanded motion. Requests made before are discarded.
    pub(crate) fn begin(&mut self, commands: &[JointCommand; N], motion: &MotionState<N>) {
        for joint in 0..N {
            let anatomy = &self.anatomy[joint];
            let angle = anatomy.angle_from_chain(motion.position_rad[joint]);
            let velocity = anatomy.from_chain(motion.velocity_rad_per_s[joint]);
            self.joints[joint].start(&commands[joint], Course::moving(angle, velocity));
        }
    }

    /// Whether all joints are commanded to be at rest, without offsets.
    pub(crate) fn is_still(&self) -> bool {
        self.joints.iter().all(Follower::is_still)
    }

    /// Takes over the servo's output of the last tick.
    pub(crate) fn measure(&mut self, output: &ServoOutput<N>) {
        for joint in 0..N {
            self.measured[joint] = self.measured(joint, output).unwrap_or_default();
        }
    }

    /// Measured values of a joint, from the servo's output.
    fn measured(&self, joint: usize, output: &ServoOutput<N>) -> Option<Measured> {
        let anatomy = self.anatomy.get(joint)?;
        let torque = |of: &[NewtonMetre; N]| Some(NewtonMetre(anatomy.from_chain(of.get(joint)?.0)));
        Some(Measured {
            position: Radian(anatomy.angle_from_chain(output.position.get(joint)?.0)),
            velocity: RadianPerSecond(anatomy.from_chain(output.velocity.get(joint)?.0)),
            wanted: torque(&output.wanted_torque)?,
            braking: torque(&output.braking_torque)?,
            applied: torque(&output.decision.torque)?,
            returns: *output.decision.returns.get(joint)?,
        })
    }

    /// Runs one tick of all joints.
    pub(crate) fn follow(&mut self, commands: &[JointCommand; N]) -> Commanded<N> {
        let mut commanded =
            Commanded { motion: MotionState::at_rest([0.0; N]), efforts: [Effort::HELD; N], fault: None };
        for joint in 0..N {
            let mut command = commands[joint].seen_from(self.zeros[joint]);
            self.joints[joint].settle(&mut command, &self.bounds[joint]);
            let Demand { course, velocity_offset, torque, held, largest, failed, zero } =
                self.joints[joint].follow(&command, &self.measured[joint], &self.bounds[joint]);
            self.zeros[joint] = zero.unwrap_or(self.zeros[joint]);
            let anatomy = &self.anatomy[joint];
            let motion = &mut commanded.motion;
            motion.position_rad[joint] = anatomy.angle_to_chain(course.position());
            motion.velocity_rad_per_s[joint] = anatomy.to_chain(course.velocity() + velocity_offset);
            motion.acceleration_rad_per_s2[joint] = anatomy.to_chain(course.acceleration());
            commanded.efforts[joint] = Effort {
                torque: NewtonMetre(anatomy.to_chain(torque)),
                held,
                largest: NewtonMetre(largest),
                damping_share: 0.0,
            };
            self.largest[joint] = NewtonMetre(largest);
            if failed {
                let fault = Fault { code: FaultCode::FollowingError, joint: joint as u8 };
                commanded.fault = commanded.fault.or(Some(fault));
            }
        }
        commanded
    }

    /// Status of a joint for a host. `torque` is the motor's, with the model's sign. The board adds inputs
    /// and voltage.
    pub fn status(
        &self,
        joint: usize,
        torque: NewtonMetre,
        follows: bool,
        output: &ControlOutput<N>,
    ) -> Option<JointStatus> {
        let (follower, anatomy) = (self.joints.get(joint)?, self.anatomy.get(joint)?);
        let measured = self.measured(joint, &output.servo)?;
        let [low, high] = self.bounds.get(joint)?.range;
        let tolerance = RANGE_TOLERANCE.0;
        let is_inside = measured.position.0 >= low - tolerance && measured.position.0 <= high + tolerance;
        let decision = &output.servo.decision;
        let zero = *self.zeros.get(joint)?;
        Some(JointStatus {
            drive: decision.state,
            position: measured.position + zero,
            velocity: measured.velocity,
            torque: NewtonMetre(anatomy.from_chain(torque.0)),
            position_demand: Radian(anatomy.angle_from_chain(*output.motion.position_rad.get(joint)?)) + zero,
            velocity_demand: RadianPerSecond(
                anatomy.from_chain(*output.motion.velocity_rad_per_s.get(joint)?),
            ),
            torque_demand: NewtonMetre(anatomy.from_chain(decision.torque.get(joint)?.0)),
            mode: follower.mode().filter(|_| follows).map_or(0, |mode| mode as i8),
            follows: follows && follower.follows,
            is_full: follows && follower.is_full(),
            requests_seen: follower.requests_seen(),
            reached: follows && follower.reached,
            stands: follows && follower.stands,
            limited: follows
                && (follower.limited
                    || output.servo.wanted_torque.get(joint)?.abs() > *self.largest.get(joint)?)
                || decision.limited.get(joint)?.any(),
            homed: follower.homed,
            deviates: follows && follower.deviates,
            inputs: if is_inside { 0 } else { RefusalReason::OutOfRange.bit() },
            bus: Volt::ZERO,
        })
    }
}
