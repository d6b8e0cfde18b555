//! Verification motion of the paper, Equations (31) and (32), repaired, for the three-joint chain.
//!
//! ```text
//! hip, knee      scarab::motion::gait: (31), and (32) with a tenth of its two large amplitudes; closed,
//!                six harmonics, offset into the paper's working range; one 6.5 s cycle, from and to rest
//! hip rotation   10 degrees sin(2 pi t / 6.5 s), ours
//! ```
//!
//! A motion of joint 1 is added because (31) and (32) do not define one. Axis 1 lies along gravity. The other
//! joints change its torque only through masses beside the plane of the leg. Friction holds a resting joint
//! against that small torque, which then would not test it.

use scarab::ident::{Smoothed, prior_parameters};
use scarab::motion::gait::{self, GaitJoint};
use scarab::motion::{Fourier, HARMONICS, MotionError, Periodic, Phase};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::{Radian, Second};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::setup;

use super::chain::{JOINTS, ROOM};

/// Period of one cycle; the repaired knee then has the paper's acceleration.
pub const PERIOD: Second = Second(6.5);
/// Amplitude of the hip's rotation.
pub const ROTATION_DEG: f32 = 10.0;
const BLEND: Second = Second(1.0);

/// The motion in the model's angles.
pub fn motion(leg: &LegFile) -> Result<Periodic<JOINTS>, ToolError> {
    curve(leg)
        .and_then(|curve| Periodic::new(curve, BLEND, 1, SERVO_RATE_HZ))
        .map_err(|error| ToolError::input(format!("{}: no verification motion: {error:?}", leg.name)))
}

fn curve(leg: &LegFile) -> Result<Fourier<JOINTS>, MotionError> {
    let walking = gait::curve([GaitJoint::Hip, GaitJoint::Hip, GaitJoint::Knee], PERIOD)?;
    let (mut centre, mut sine, mut cosine) = (walking.centre_rad(), walking.sine_rad(), walking.cosine_rad());
    centre[0] = 0.0;
    sine[0] = [0.0; HARMONICS];
    sine[0][0] = ROTATION_DEG.to_radians();
    cosine[0] = [0.0; HARMONICS];
    let scale = core::array::from_fn(|joint| if leg.joints[joint].direction < 0 { -1.0 } else { 1.0 });
    let offset = core::array::from_fn(|joint| Radian(leg.joints[joint].zero_offset_deg.to_radians() as f32));
    Fourier::new(PERIOD, centre, sine, cosine)?.mapped(scale, offset)
}

/// Mean absolute torque of the links alone, without rotors and friction, on the gait cycle with
/// joint 1 held still, N m.
pub fn links_alone(leg: &LegFile) -> Result<[f64; JOINTS], ToolError> {
    const INSTANTS: u32 = 1000;
    let model = setup::row_model::<JOINTS, ROOM>(leg)?;
    let links =
        setup::links::<JOINTS>(leg, |joint| joint.truth.as_ref()).ok_or_else(|| leg.error("has no truth"))?;
    let bodies = prior_parameters(&links)
        .map(|joint| scarab::model::inertia::joint(&scarab::model::inertia::inertial(&joint), &[0.0; 4]));
    let values = model.base.project(&bodies);
    let motion = motion(leg)?;
    let mut sum = [0.0; JOINTS];
    for instant in 0..INSTANTS {
        let state = motion.curve().state_at(&Phase::steady(instant as f32 / INSTANTS as f32));
        let still = |of: [f32; JOINTS]| [0.0, f64::from(of[1]), f64::from(of[2])];
        let rows = model.rows(&Smoothed {
            position: still(state.position_rad),
            velocity: still(state.velocity_rad_per_s),
            acceleration: still(state.acceleration_rad_per_s2),
            torque: [0.0; JOINTS],
        });
        for (sum, row) in sum.iter_mut().zip(&rows.regressor) {
            let torque: f64 = row.iter().zip(&values).map(|(element, value)| element * value).sum();
            *sum += torque.abs() / f64::from(INSTANTS);
        }
    }
    Ok(sum)
}
