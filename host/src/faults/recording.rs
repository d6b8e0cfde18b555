//! Records the curves of a run.

use crate::report::fault_curves::FaultCurves;
use crate::rig::faulty_board::{PERIOD_MS, Rig};
use scarab::model::planar::JOINTS;

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
