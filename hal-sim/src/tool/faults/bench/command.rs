//! J1 by command: whatever the servo is told, no joint is driven out of its range.
//!
//! The proof of motions (`LegConfiguration::prove`) is left out: the servo is told at once to be somewhere beyond the range, and
//! at some speed, as a motion would that was never proved or a memory that was upset. Ideal drives.

use rayon::prelude::*;
use scarab::hal::LegDrives;
use scarab::leg::IdentifiedModel;
use scarab::motion::MotionState;
use scarab::safety::{DriveState, PowerRequest};
use scarab::servo::{SERVO_RATE_HZ, Servo, ServoCommand};
use scarab::units::Radian;

use super::super::catalogue::JOINTS;
use super::super::dice::Dice;
use super::super::entry::Head;
use super::super::invariants::MARGIN_RAD;
use super::super::run::Outcome;
use super::{Bench, outcome};
use crate::tool::error::ToolError;
use crate::tool::leg_file::LegFile;
use crate::tool::pair::{Context, start_position};
use crate::tool::setup::SetupError;
use crate::tool::simulate::SimulationOptions;
use crate::world::World;

const BASE: usize = 13;

pub(super) const BENCH: Bench = Bench {
    head: Head {
        id: "J1",
        fault: "joint commanded beyond its range, at any speed",
        detector: "stopping-distance clamp",
        state: "Limit, Damp",
        deadline_ms: f64::INFINITY,
        unit: "N m",
        codes: &[],
        lacking: None,
    },
    run: command,
};

/// Radians that the ends of a range are moved by, where the clamp is not to be come to.
const WIDENED: Radian = Radian(2.0);

fn command(head: &Head, leg: &LegFile, seeds: &[u64], blind: bool) -> Result<Vec<Outcome>, ToolError> {
    let mut context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::of_seed(1))?;
    if blind {
        for joint in &mut context.configuration.joints {
            (joint.low, joint.high) = (joint.low - WIDENED, joint.high + WIDENED);
        }
    }
    seeds.par_iter().map(|seed| one(head, leg, &context, *seed)).collect()
}

fn one(head: &Head, leg: &LegFile, context: &Context<JOINTS, BASE>, seed: u64) -> Result<Outcome, ToolError> {
    let mut dice = Dice::new(head.id, seed);
    let mut world = World::<JOINTS>::new(&leg.description()?, seed);
    world.set_current_noise(&context.current_noise(leg));
    world.place(&start_position(leg));
    let unfit = |_| SetupError::new(leg, "the servo refuses its joints");
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
    let mut found = outcome(head, seed, None);
    let margin = MARGIN_RAD;
    for tick in 0..2 * SERVO_RATE_HZ {
        let power = enabling.get(tick as usize).copied().flatten();
        // Another absurdity every 0.4 s or so.
        if tick >= 4 && (tick == 4 || dice.below(1600) == 0) {
            motion = absurd(&mut dice, leg);
        }
        let command = ServoCommand { motion, feedforward: None::<&IdentifiedModel<JOINTS>>, power };
        let output = servo.tick(&sample, &command, context.gravity);
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
            found.broken.push(format!("tick {tick}: more torque was asked for than the cap"));
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

/// Anywhere up to 60 degrees beyond the range, at up to twice the greatest speed; model's angles.
fn absurd(dice: &mut Dice, leg: &LegFile) -> MotionState<JOINTS> {
    let mut motion = MotionState::at_rest([0.0; JOINTS]);
    for (index, joint) in leg.joints.iter().enumerate() {
        let sign = if joint.direction < 0 { -1.0 } else { 1.0 };
        let [low, high] = joint.range_deg;
        let angle = if dice.coin() { high + dice.uniform(0.0, 60.0) } else { low - dice.uniform(0.0, 60.0) };
        motion.position_rad[index] = (sign * angle + joint.zero_offset_deg).to_radians() as f32;
        let speed = 2.0 * joint.speed_limit_deg_s.to_radians();
        motion.velocity_rad_per_s[index] = dice.uniform(-speed, speed) as f32;
    }
    motion
}
