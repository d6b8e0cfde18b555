//! What a run looked like, for its figure.

use super::catalogue::JOINTS;
use super::rig::{PERIOD_MS, Rig};

/// Curves of one run, a value for each PWM period.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Recording {
    /// Since the injection.
    pub time_ms: Vec<f64>,
    /// Of the joints, deg/s, anatomical.
    pub speed: [Vec<f64>; JOINTS],
    /// Of the motors at the joints, N m, anatomical.
    pub torque: [Vec<f64>; JOINTS],
    /// V.
    pub bus: Vec<f64>,
    /// Both bridges.
    pub released: Vec<bool>,
}

impl Recording {
    /// A period that is over.
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
