//! Detection thresholds of the firmware for the simulated leg: they separate detectable faults from others.

use core::f64::consts::TAU;

use hal_sim::drive::description::BridgeDescription;
use scarab::hal::SERVO_RATE_HZ;
use scarab::motor::AxisConfiguration;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::{JointFile, LegFile, MotorFile};

use crate::board::{BUS, axis_configuration};
use crate::faults::scenario::Bounds;
use crate::faulty_board::PERIODS_PER_S;
use scarab::model::planar::JOINTS;

/// Thresholds of the firmware's voltage model (`scarab::motor::model_watch`) for this joint, by its
/// equations.
fn voltages(bounds: &mut Bounds, joint: &JointFile, motor: &MotorFile, configuration: &AxisConfiguration) {
    let dead = f64::from(configuration.timing.dead_time.0) * PERIODS_PER_S as f64;
    let still = 2.0 * 4.0 / 3.0 * dead * f64::from(configuration.bus[1].0);
    // Resistance of winding and switch.
    let resistance = motor.resistance_ohm + BridgeDescription::default().on_resistance;
    let current = f64::from(configuration.current_limit.0);
    let per_joint = f64::from(configuration.pole_pairs) * joint.encoder.ratio;
    let frozen = [still, 0.35 * resistance].map(|volts| volts / f64::from(configuration.flux.0) / per_joint);
    bounds.frozen_speed = core::array::from_fn(|part| bounds.frozen_speed[part].max(frozen[part]));
    // Counts a servo period from which no rotor stops within the next one.
    let counts = (configuration.counts_per_turn / 2048).max(4);
    let turns = f64::from(counts) / f64::from(configuration.counts_per_turn) * f64::from(SERVO_RATE_HZ);
    bounds.stopped_speed = bounds.stopped_speed.max(TAU * turns / joint.encoder.ratio);
    bounds.judged_speed = bounds.judged_speed.max(TAU / 0.025 / per_joint);
    // 2 * 4/3 of the dead time's voltage is `still`. The gain of so fast a loop is that of its inductance.
    let inductance = 1e-6 * motor.inductance_d_uh.min(motor.inductance_q_uh);
    let ohm = TAU * f64::from(configuration.bandwidth.0) * inductance;
    bounds.stuck_a = bounds.stuck_a.max(1.25 * 0.5 * still / ohm);
    let offset = (0.4 * still + 0.06 * resistance * current) / (resistance * 2.0 / 3.0_f64.sqrt());
    // Ten percent for errors of the calibration's estimates, and dead time of opposite sign.
    bounds.smallest_offset_a = bounds.smallest_offset_a.max(1.1 * offset + 0.5 * still / resistance / 1.15);
}

pub(super) fn bounds(leg: &LegFile) -> Result<Bounds, ToolError> {
    if leg.joints.len() != JOINTS {
        return Err(leg.error("faults are injected into legs of two joints").into());
    }
    let mut steps = [0; JOINTS];
    let mut bounds = Bounds {
        greatest_step: steps,
        counts_per_turn: u32::MAX,
        overcurrent_a: 0.0,
        bus_v: [0.0; 2],
        frozen_speed: [0.0; 2],
        stopped_speed: 0.0,
        judged_speed: 0.0,
        stuck_a: 1.0,
        smallest_offset_a: 0.0,
    };
    for (joint, step) in leg.joints.iter().zip(&mut steps) {
        let motor = joint.motor.as_ref().ok_or_else(|| {
            leg.error(format!("joint `{}` has no [joint.motor]: faults need complete drives", joint.name))
        })?;
        let configuration = axis_configuration(joint, motor);
        let turns = configuration.greatest_speed.0 / (core::f32::consts::TAU * PERIODS_PER_S as f32);
        // Rounding as in `AxisConfiguration`.
        *step = (turns * configuration.counts_per_turn as f32) as i32 + 2;
        bounds.counts_per_turn = bounds.counts_per_turn.min(configuration.counts_per_turn);
        bounds.overcurrent_a = f64::from(configuration.overcurrent.0);
        voltages(&mut bounds, joint, motor, &configuration);
    }
    bounds.bus_v = BUS.map(|volts| f64::from(volts.0));
    bounds.greatest_step = [steps[0].min(steps[1]), steps[0].max(steps[1])];
    Ok(bounds)
}
