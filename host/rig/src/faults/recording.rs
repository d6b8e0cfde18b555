//! Curves of a run with a fault, for its figure.

use scarab::model::planar::JOINTS;

use crate::faulty_board::{PERIOD_MS, Rig};

/// Curves of one run, one value per PWM period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FaultCurves {
    /// Time since the injection.
    pub time_ms: Vec<f64>,
    /// Speeds of the joints, deg/s, anatomical.
    pub speed: [Vec<f64>; JOINTS],
    /// Torques of the motors at the joints, N m, anatomical.
    pub torque: [Vec<f64>; JOINTS],
    /// Bus voltage, V.
    pub bus: Vec<f64>,
    /// Whether both bridges are off.
    pub released: Vec<bool>,
}

impl FaultCurves {
    /// Records the period that has ended.
    pub fn see<const B: usize>(&mut self, rig: &Rig<JOINTS, B>, begun: u64) {
        self.time_ms.push((rig.period - begun) as f64 * PERIOD_MS);
        let (speed, torque) = (rig.world.velocity(), rig.world.motor_torque());
        for joint in 0..JOINTS {
            self.speed[joint].push(speed[joint].to_degrees());
            self.torque[joint].push(torque[joint]);
        }
        self.bus.push(rig.world.complete_drives().map_or(f64::NAN, |drives| drives.supply().voltage()));
        self.released.push(!rig.is_switching());
    }
}
