//! What a host commands tick by tick, carried out by every joint of a leg.
//!
//! Why beside the other activities: identifying and tracking follow motions that were proved beforehand; here nobody knows the
//! next target. Each joint has a [`Follower`](joint::Follower) that makes a course of what it is told; the servo and the monitor
//! behind it are the same as ever, and the monitor decides last.
//!
//! ```text
//! JointCommand (anatomical) --Follower--> Demand --anatomy--> MotionState + Effort (model) --> servo --> monitor
//! ```
//!
//! The joints are told anatomical angles and the model's are commanded; both are converted here and nowhere else. What a
//! joint's zero was moved by homing is kept in counts and added to every reading.
//!
//! Cost: `scripts/count-instructions`.

mod command;
mod joint;

pub use command::{JointCommand, JointStatus, Mode, SetPoint, Target};

use joint::{Bounds, Demand, Follower, Measured};

use super::configuration::LegConfiguration;
use super::control::ControlOutput;
use crate::hal::Sample;
use crate::model::AnatomicalJoint;
use crate::motion::{Course, MotionState};
use crate::safety::{Fault, FaultCode, RANGE_TOLERANCE, RefusalReason};
use crate::servo::{Effort, JointScale, ServoOutput};
use crate::units::{NewtonMetre, Radian, RadianPerSecond, Volt};

/// What the servo is told at one tick, in the model's angles and signs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Commanded<const N: usize> {
    /// Where to be.
    pub motion: MotionState<N>,
    /// Torques beside it.
    pub efforts: [Effort; N],
    /// A joint is too far from where it is commanded to be.
    pub fault: Option<Fault>,
    /// Counts by which homing moves the joints' zeros at this tick.
    pub shifts: Option<[i32; N]>,
}

/// All joints of a leg; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Following<const N: usize> {
    joints: [Follower; N],
    bounds: [Bounds; N],
    anatomy: [AnatomicalJoint<f32>; N],
    count_per_radian: [f32; N],
    measured: [Measured; N],
    largest: [NewtonMetre; N],
    zeros: [i32; N],
}

impl<const N: usize> Following<N> {
    /// Nothing told yet.
    #[must_use]
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
                }
            }),
            anatomy,
            count_per_radian: configuration.joints.map(|joint| {
                let JointScale { radian_per_count, mirrored, .. } = joint.scale;
                if mirrored { -1.0 / radian_per_count.0 } else { 1.0 / radian_per_count.0 }
            }),
            measured: [Measured::default(); N],
            largest: [NewtonMetre::ZERO; N],
            zeros: [0; N],
        }
    }

    /// A sample with the zeros that homing found.
    #[must_use]
    pub fn placed(&self, sample: &Sample<N>) -> Sample<N> {
        let mut placed = *sample;
        for (joint, zero) in placed.joints.iter_mut().zip(self.zeros) {
            joint.encoder_counts = joint.encoder_counts.wrapping_add(zero);
        }
        placed
    }

    /// Other zeros than homing found: those that the board knows.
    pub fn forget_zeros(&mut self) {
        self.zeros = [0; N];
        self.joints = [Follower::NEW; N];
    }

    /// The leg follows from here on, where it is commanded to be; what was asked before is not done later.
    pub fn begin(&mut self, commands: &[JointCommand; N], motion: &MotionState<N>) {
        for joint in 0..N {
            let anatomy = &self.anatomy[joint];
            let place = anatomy.angle_from_chain(motion.position_rad[joint]);
            let velocity = anatomy.from_chain(motion.velocity_rad_per_s[joint]);
            self.joints[joint].start(&commands[joint], Course::moving(place, velocity));
        }
    }

    /// All joints are commanded to stand still.
    #[must_use]
    pub fn is_still(&self) -> bool {
        self.joints.iter().all(|joint| joint.course().velocity() == 0.0)
    }

    /// What came of the servo's tick.
    pub fn measure(&mut self, output: &ServoOutput<N>) {
        for joint in 0..N {
            self.measured[joint] = self.measured(joint, output).unwrap_or_default();
        }
    }

    /// A joint as the servo has it, whoever commands.
    fn measured(&self, joint: usize, output: &ServoOutput<N>) -> Option<Measured> {
        let anatomy = self.anatomy.get(joint)?;
        Some(Measured {
            position: Radian(anatomy.angle_from_chain(output.position.get(joint)?.0)),
            velocity: RadianPerSecond(anatomy.from_chain(output.velocity.get(joint)?.0)),
            torque: NewtonMetre(anatomy.from_chain(output.decision.torque.get(joint)?.0)),
            returns: *output.decision.returns.get(joint)?,
        })
    }

    /// One tick of all joints.
    pub fn follow(&mut self, commands: &[JointCommand; N]) -> Commanded<N> {
        let mut commanded = Commanded {
            motion: MotionState::at_rest([0.0; N]),
            efforts: [Effort::HELD; N],
            fault: None,
            shifts: None,
        };
        let mut shifts = [0; N];
        for joint in 0..N {
            let Demand { course, velocity_offset, torque, held, largest, failed, shift } =
                self.joints[joint].follow(&commands[joint], &self.measured[joint], &self.bounds[joint]);
            let anatomy = &self.anatomy[joint];
            let motion = &mut commanded.motion;
            motion.position_rad[joint] = anatomy.angle_to_chain(course.position());
            motion.velocity_rad_per_s[joint] = anatomy.to_chain(course.velocity() + velocity_offset);
            motion.acceleration_rad_per_s2[joint] = anatomy.to_chain(course.acceleration());
            commanded.efforts[joint] =
                Effort { torque: NewtonMetre(anatomy.to_chain(torque)), held, largest: NewtonMetre(largest) };
            self.largest[joint] = NewtonMetre(largest);
            if failed {
                let fault = Fault { code: FaultCode::FollowingError, joint: joint as u8 };
                commanded.fault = commanded.fault.or(Some(fault));
            }
            if let Some(shift) = shift {
                shifts[joint] = (shift * self.count_per_radian[joint]) as i32;
                self.zeros[joint] = self.zeros[joint].wrapping_add(shifts[joint]);
                commanded.shifts = Some(shifts);
            }
        }
        commanded
    }

    /// What a host is told of a joint whose motor gives this torque of the model's sign; further inputs and the bus voltage are the board's.
    #[must_use]
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
        Some(JointStatus {
            drive: decision.state,
            position: measured.position,
            velocity: measured.velocity,
            torque: NewtonMetre(anatomy.from_chain(torque.0)),
            position_demand: Radian(anatomy.angle_from_chain(*output.motion.position_rad.get(joint)?)),
            velocity_demand: RadianPerSecond(
                anatomy.from_chain(*output.motion.velocity_rad_per_s.get(joint)?),
            ),
            torque_demand: measured.torque,
            mode: follower.mode().filter(|_| follows).map_or(0, |mode| mode as i8),
            reached: follows && follower.reached,
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
