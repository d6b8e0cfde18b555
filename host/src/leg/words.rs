//! Describes the firmware's error codes so that a user can act on them.

use scarab::ident::KernelError;
use scarab::leg::LegError;
use scarab::motion::Quantity;
use scarab::safety::{DriveState, LimitQuantity};
use scarab::servo::ServoError;

use crate::formats::leg_file::LegFile;

fn joint_name(leg: &LegFile, joint: usize) -> &str {
    leg.joints.get(joint).map_or("?", |joint| &joint.name)
}

/// Reason why the firmware rejects a leg.
#[must_use]
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
            let allowed = match error.quantity {
                LimitQuantity::Range => {
                    "range_deg must lie within -360..360 in the chain's angle and span 2 degrees"
                }
                LimitQuantity::Speed => "speed_limit_deg_s must be above 0 and at most 2864 (50 rad/s)",
                LimitQuantity::Torque => "torque_limit_nm must be above 0 and at most 1000",
                LimitQuantity::Current => "the current limit must be above 0 and at most 300 A",
                LimitQuantity::TorquePerAmpere => "torque_per_ampere must be 0.001 to 100",
                LimitQuantity::Inertia => {
                    "the inertia it moves (prior, else truth) must be 0.0001 to 100 kg m2"
                }
            };
            format!("joint {}: {allowed}", joint_name(leg, error.joint))
        }
        LegError::Limit(violation) => {
            let quantity = match violation.quantity {
                Quantity::Low | Quantity::High => "angle",
                Quantity::Speed => "speed",
                Quantity::Acceleration => "acceleration",
            };
            format!(
                "joint {}: a motion's {quantity} reaches {:.3}, the limit is {:.3} (rad, s)",
                joint_name(leg, violation.joint),
                violation.bound,
                violation.limit
            )
        }
        LegError::Motion(error) => format!("a motion is invalid: {error:?}"),
        LegError::Kernel(KernelError::TooLong { .. }) => {
            "bandwidth_hz must be at least 7.7 on the device".into()
        }
        LegError::Kernel(_) => "bandwidth_hz does not fit the device's filter".into(),
    }
}

/// Reason why a drive is no longer enabled.
#[must_use]
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
