//! J1 by command: no command to the servo drives a joint out of its range.
//!
//! The proof of motions (`LegConfiguration::prove`) is bypassed. The servo is commanded directly to a
//! position beyond the range, at some speed, as by an unproved motion or corrupted memory. Ideal drives.

use hal_sim::world::World;
use rayon::prelude::*;
use scarab::hal::LegDrives;
use scarab::leg::IdentifiedModel;
use scarab::motion::MotionState;
use scarab::safety::{DriveState, PowerRequest};
use scarab::servo::{SERVO_RATE_HZ, Servo, ServoCommand};
use scarab::units::Radian;
use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::formats::leg_file::LegFile;

use crate::faults::bench::{Outcomes, outcome};
use crate::faults::catalogue::Fault;
use crate::faults::invariants::MARGIN_RAD;
use crate::faults::run::Outcome;
use crate::options::SimulationOptions;
use crate::pair::{Context, start_position};
use scarab::model::planar::{BASE, JOINTS};

/// Distance by which the ends of a range are moved when the clamp is disabled.
const WIDENED: Radian = Radian(2.0);

pub(super) fn command(fault: &Fault, leg: &LegFile, seeds: &[u64], blind: bool) -> Outcomes {
    let mut context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::with_seed(1))?;
    if blind {
        for joint in &mut context.configuration.joints {
            (joint.low, joint.high) = (joint.low - WIDENED, joint.high + WIDENED);
        }
    }
    seeds.par_iter().map(|seed| one(fault, leg, &context, *seed)).collect()
}

fn one(
    fault: &Fault,
    leg: &LegFile,
    context: &Context<JOINTS, BASE>,
    seed: u64,
) -> Result<Outcome, ToolError> {
    let mut random = Random::new(fault.id, seed);
    let mut world = World::<JOINTS>::new(&leg.description()?, seed);
    world.set_current_noise(&context.current_noise(leg));
    world.move_to(&start_position(leg));
    let unfit = |_| leg.error("the servo rejects its joint configuration");
    let mut servo = Servo::new(context.configuration.joints).map_err(unfit)?;
    let mut sample = world.sample();
    let mut motion = MotionState::at_rest([0.0; JOINTS]);
    let enabling = [
        None,
        Some(PowerRequest::Shutdown),
        Some(PowerRequest::SwitchOn),
        Some(PowerRequest::EnableOperation),
    ];
    let (mut limited, mut furthest) = (false, 0.0_f64);
    let mut found = outcome(fault, seed, None);
    let margin = MARGIN_RAD;
    for tick in 0..2 * SERVO_RATE_HZ {
        let power = enabling.get(tick as usize).copied().flatten();
        // Another implausible command about every 0.4 s.
        if tick >= 4 && (tick == 4 || random.below(1600) == 0) {
            motion = implausible(&mut random, leg);
        }
        let command = ServoCommand { motion, feedforward: None::<&IdentifiedModel<JOINTS>>, power };
        let output = servo.tick(&sample, &command, None, context.gravity);
        if tick < 4 {
            motion = MotionState::at_rest(output.position.map(|angle| angle.0));
        }
        limited |= output.decision.limited.iter().any(|limited| limited.any());
        sample = world.tick(output.drive());
        let position = world.anatomical_position();
        if output.drive().enabled {
            for (joint, angle) in leg.joints.iter().zip(position) {
                let [low, high] = joint.range_deg.map(f64::to_radians);
                furthest = furthest.max(angle - high).max(low - angle);
            }
        }
        let caps = servo.limits().joints().map(|joint| joint.torque_cap().0);
        if output.decision.torque.iter().zip(caps).any(|(torque, cap)| torque.0.abs() > cap * 1.000_001) {
            found.broken.push(format!("tick {tick}: requested torque above the cap"));
            break;
        }
    }
    if furthest > margin {
        found.broken.push(format!("driven {:.2} degrees beyond a joint's range", furthest.to_degrees()));
    }
    let damped = matches!(servo.state(), DriveState::FaultReactionActive { .. } | DriveState::Fault { .. });
    found.state = Some(if damped { "Damp" } else { "Limit" }).filter(|_| limited || damped);
    found.detected = found.state.is_some() && found.broken.is_empty();
    Ok(found)
}

/// Position up to 60 degrees beyond the range, speed up to twice the limit; model's angles.
fn implausible(random: &mut Random, leg: &LegFile) -> MotionState<JOINTS> {
    let mut motion = MotionState::at_rest([0.0; JOINTS]);
    for (index, joint) in leg.joints.iter().enumerate() {
        let sign = if joint.direction < 0 { -1.0 } else { 1.0 };
        let [low, high] = joint.range_deg;
        let angle =
            if random.coin() { high + random.uniform(0.0, 60.0) } else { low - random.uniform(0.0, 60.0) };
        motion.position_rad[index] = (sign * angle + joint.zero_offset_deg).to_radians() as f32;
        let speed = 2.0 * joint.speed_limit_deg_s.to_radians();
        motion.velocity_rad_per_s[index] = random.uniform(-speed, speed) as f32;
    }
    motion
}
