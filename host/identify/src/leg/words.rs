//! Describes the firmware's error codes so that a user can act on them.

use scarab::ident::KernelError;
use scarab::leg::LegError;
use scarab::motion::Quantity;
use scarab::safety::{DriveState, LimitQuantity};
use scarab::servo::ServoError;

use crate::formats::leg_file::check::LARGEST_CURRENT_A;
use crate::formats::leg_file::{JointFile, LegFile};

fn joint_name(leg: &LegFile, joint: usize) -> &str {
    leg.joints.get(joint).map_or("?", |joint| &joint.name)
}

/// Limit of a joint that the firmware rejects: its key, the value and what is accepted.
fn limit_words(joint: &JointFile, quantity: LimitQuantity) -> String {
    match quantity {
        LimitQuantity::Range => {
            let [low, high] = joint.range_deg;
            let ends = joint.range_deg.map(|end| joint.direction as f64 * end + joint.zero_offset_deg);
            let [least, most] = [ends[0].min(ends[1]), ends[0].max(ends[1])];
            format!(
                "`range_deg` {low:.1} to {high:.1} is {least:.1} to {most:.1} as D-H angle (`direction`, `zero_offset_deg`), \
                 which must lie within -360..360 and span 2 degrees: narrow it"
            )
        }
        LimitQuantity::Speed => {
            let limit = joint.speed_limit_deg_s;
            format!("`speed_limit_deg_s` is {limit}; it must be above 0 and at most 2864 (50 rad/s)")
        }
        LimitQuantity::Torque => {
            let limit = joint.torque_limit_nm;
            format!("`torque_limit_nm` is {limit}; it must be above 0 and at most 1000")
        }
        LimitQuantity::Current => format!(
            "its current limit is {:.1} A (`current_limit_a`, else `torque_limit_nm` {} / `torque_per_ampere` {}); it must be \
             above 0 and at most {LARGEST_CURRENT_A}",
            joint.current_limit(),
            joint.torque_limit_nm,
            joint.torque_per_ampere
        ),
        LimitQuantity::TorquePerAmpere => {
            format!("`torque_per_ampere` is {}; it must be 0.001 to 100", joint.torque_per_ampere)
        }
        LimitQuantity::Inertia => {
            "the inertia that it moves (`prior`, else `truth`, with `rotor_inertia`) must be 0.0001 to \
                                   100 kg m2: correct `inertia_com`, or state `rotor_inertia`"
                .to_owned()
        }
    }
}

/// Reason why the firmware rejects a leg.
pub fn leg_error(leg: &LegFile, error: LegError) -> String {
    match error {
        LegError::Servo(ServoError::Scale { joint }) => format!(
            "joint {}: an encoder step must be 1e-7 to 0.1 rad at the joint (counts, ratio), zero_offset_deg within 360",
            joint_name(leg, joint)
        ),
        LegError::Servo(ServoError::Bandwidth { joint }) => {
            format!("joint {}: the position loop's bandwidth must be 0.5 to 8 Hz", joint_name(leg, joint))
        }
        LegError::Servo(ServoError::Limits(error)) => {
            let reason = match leg.joints.get(error.joint) {
                Some(joint) => limit_words(joint, error.quantity),
                None => format!("{:?} is impossible", error.quantity),
            };
            format!("joint {}: {reason}", joint_name(leg, error.joint))
        }
        LegError::Limit(violation) => {
            let (quantity, key, unit) = match violation.quantity {
                Quantity::Low | Quantity::High => ("angle", "range_deg", "degrees (D-H)"),
                Quantity::Speed => ("speed", "speed_limit_deg_s", "degrees/s"),
                Quantity::Acceleration => ("acceleration", "acceleration_limit_deg_s2", "degrees/s2"),
            };
            format!(
                "joint {}: a motion's {quantity} reaches {:.1}, the limit is {:.1} {unit} (`{key}`)",
                joint_name(leg, violation.joint),
                violation.bound.to_degrees(),
                violation.limit.to_degrees()
            )
        }
        LegError::Kernel(KernelError::TooLong { .. }) => {
            "bandwidth_hz must be at least 7.7 on the device".into()
        }
        LegError::Kernel(_) => "bandwidth_hz does not fit the device's filter".into(),
    }
}

/// Reason why a drive is no longer enabled.
pub fn drive_stop(leg: &LegFile, state: DriveState) -> String {
    let Some(fault) = state.fault() else {
        return "the drive was switched off during identification".into();
    };
    let cause = fault.code.words();
    format!(
        "the drive stopped during identification with fault {:#06x}: joint {}, {cause}",
        fault.code as u16,
        joint_name(leg, usize::from(fault.joint))
    )
}
