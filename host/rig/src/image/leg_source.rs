//! Writes a leg file as a constant of the firmware.
//!
//! The numbers are those of the simulation's configuration in the device's precision. The board
//! derives the same configuration from them, and a test compares the two.

use nalgebra::Matrix3;
use scarab::ident::{LinkPrior, Plan};
use scarab::leg::{JointDescription, LegConfiguration, LegDescription, LinkDescription, MotorDescription};
use scarab::model::DenavitHartenberg;
use scarab::motion::{ExcitationTable, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::Radian;

use scarab::model::planar::{BASE, JOINTS};
use scarab_base::error::FileError;
use scarab_identify::formats::leg_file::geometry::chain;
use scarab_identify::formats::leg_file::{JointFile, LegFile, Side};
use scarab_identify::leg::setup::{PriorChoice, background, base_rank, configuration};

/// Constant of an image, and the configuration it stands for.
pub(crate) type Described = (LegDescription<JOINTS>, LegConfiguration<JOINTS, BASE>);

/// Description of a leg of two joints with up to 13 base parameters, the capacity of the board.
pub fn describe(leg: &LegFile, swarm_seed: u64) -> Result<Described, FileError> {
    if leg.joints.len() != JOINTS || base_rank(leg) > BASE {
        return Err(leg.error("an image supports two joints with up to 13 base parameters"));
    }
    let background = background::<JOINTS, BASE>(leg, PriorChoice::Default, swarm_seed)?;
    let (configuration, _) = configuration(leg, &background, Plan::default(), swarm_seed)?;
    chain::<JOINTS>(leg)?;
    let named = |joint: &JointFile| {
        motor(joint).map_err(|reason| leg.error(format!("joint `{}`: {reason}", joint.name)))
    };
    let motors = [named(&leg.joints[0])?, named(&leg.joints[1])?];
    let model = &configuration.model;
    let joints = core::array::from_fn(|index| {
        let (joint, file) = (&configuration.joints[index], &leg.joints[index]);
        let single = |value: f64| value as f32;
        JointDescription {
            geometry: DenavitHartenberg {
                alpha: single(file.dh.twist()),
                a: single(file.dh.a),
                d: single(file.dh.d),
            },
            direction: if file.direction < 0 { -1 } else { 1 },
            zero_offset: joint.scale.anatomy.zero_offset(),
            mirrored: joint.scale.mirrored,
            radian_per_count: joint.scale.radian_per_count,
            torque_per_ampere: joint.scale.torque_per_ampere,
            range: [joint.low, joint.high] as [Radian; 2],
            speed: joint.speed,
            acceleration: configuration.acceleration[index],
            torque: joint.torque,
            current: joint.current,
            inertia: joint.inertia,
            bandwidth: joint.bandwidth,
            drive: model.drive_choice[index],
            stribeck: model.stribeck_choice[index],
            motor: motors[index],
        }
    });
    let description = LegDescription {
        name: Box::leak(leg.name.replace(char::is_whitespace, "_").into_boxed_str()),
        gravity: model.gravity.into(),
        supply: leg.supply_limits(),
        holding_brake: leg.brake_delays(),
        assist: leg.assist.map(|assist| assist.shares()),
        joints,
        prior: configuration.prior.map(|prior| prior.map(|link| link_description(&link))),
        plan: configuration.plan,
        swarm_seed: configuration.swarm_seed,
        estimator: configuration.estimator,
        bandwidth_hz: configuration.bandwidth_hz,
        excitation: table(&configuration.excitation),
        validation: configuration.validation.map(|motion| table(&motion)),
    };
    Ok((description, configuration))
}

/// Motor according to the leg file; without one, the reason why it cannot be commutated.
fn motor(joint: &JointFile) -> Result<MotorDescription, &'static str> {
    let Some(motor) = &joint.motor else {
        return Err("has no `[joint.motor]`: an image needs the motor's pole pairs and flux");
    };
    if joint.encoder.side != Side::Motor {
        return Err("its encoder is at the joint: the board commutates the motor by an encoder at the motor");
    }
    Ok(motor.for_firmware(joint))
}

fn link_description(link: &LinkPrior<f32>) -> LinkDescription {
    let inertia: Matrix3<f32> = link.body.inertia;
    LinkDescription {
        mass: link.body.mass,
        centre_of_mass: link.body.centre_of_mass.into(),
        inertia: core::array::from_fn(|row| core::array::from_fn(|column| inertia[(row, column)])),
        rotor_inertia: link.rotor_inertia,
        coulomb_friction: link.coulomb_friction,
        viscous_friction: link.viscous_friction,
        offset: link.offset,
    }
}

fn table(motion: &Periodic<JOINTS>) -> ExcitationTable<JOINTS> {
    let (blend, all) = (motion.blend_ticks(), motion.duration_ticks());
    ExcitationTable {
        period_s: motion.curve().period().0,
        blend_s: blend as f32 / SERVO_RATE_HZ as f32,
        cycles: (all - 2 * blend) / motion.period_ticks(),
        centre_rad: motion.curve().centre_rad(),
        sine_rad: motion.curve().sine_rad(),
        cosine_rad: motion.curve().cosine_rad(),
    }
}

/// Constant as Rust source, to be included where `crate` is the firmware.
pub fn source(description: &LegDescription<JOINTS>) -> String {
    let has_direction = description.joints.iter().any(|joint| joint.motor.absolute.joint.is_some());
    let direction = if has_direction { "use crate::motor::Direction::*;\n" } else { "" };
    let delays = if description.holding_brake.is_some() { "BrakeDelays, " } else { "" };
    let shares = if description.assist.is_some() { "AssistShares, " } else { "" };
    let has_thermistor = description.joints.iter().any(|joint| joint.motor.thermistor.is_some());
    let thermistor = if has_thermistor { "Thermistor, " } else { "" };
    // The debug form of plain data is valid source; `?` writes numbers that read back bit for bit.
    format!(
        "// The leg `{}`, written by `cargo fw --leg ... --source ...`. Change its leg file instead.\n\n\
         #[rustfmt::skip]\n\
         mod described {{\n\
         use crate::ident::{{Choice::*, Constant::*, DriveChoice, Estimator::*, Plan::*}};\n\
         use crate::leg::{{{shares}JointDescription, LegDescription, LinkDescription, MotorDescription}};\n\
         use crate::model::DenavitHartenberg;\n\
         use crate::motion::ExcitationTable;\n\
         use crate::motor::AbsoluteEncoders;\n\
         {direction}\
         use crate::safety::{{{delays}SupplyLimits, {thermistor}WindingRating}};\n\
         use crate::units::*;\n\n\
         /// The leg.\n\
         pub const LEG: LegDescription<{JOINTS}> = {description:#?};\n\
         }}\n\
         pub use described::LEG;\n",
        description.name,
    )
}
