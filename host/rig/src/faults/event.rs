//! Events that act on a machine besides its ports.

use scarab_identify::formats::leg_file::LegFile;

use crate::faults::scenario::Event;
use crate::faulty_board::Rig;
use scarab::model::planar::JOINTS;

/// Applies an event now.
pub fn apply<const B: usize>(event: Event, leg: &LegFile, rig: &mut Rig<JOINTS, B>) {
    match event {
        Event::Supply(volts) => {
            if let Some(drives) = rig.world.complete_drives_mut() {
                drives.supply_mut().set_source(volts);
            }
        }
        Event::Kick(joint, peak, seconds) | Event::Push(joint, peak, seconds) => {
            rig.world.push(joint, peak, seconds);
        }
        Event::Hold(joint, strength, seconds) => rig.world.hold(joint, strength, seconds),
        Event::Touch(seconds) => {
            let truth = leg.joints.last().and_then(|joint| joint.truth.as_ref());
            let com = truth.map_or([0.0; 3], |truth| truth.com);
            // The foot is about twice as far from the knee as the centre of mass of shank and foot.
            rig.world.touch(com.map(|element| 2.0 * element), 0.0, seconds);
        }
        Event::OpenPhase(joint, output) => {
            if let Some(drives) = rig.world.complete_drives_mut() {
                drives.break_wire(joint, output);
            }
        }
        Event::Oscillator(hz) => rig.set_oscillator(hz),
        Event::Upset { of_axis, joint, number, bit } => rig.upset(of_axis, joint, number, bit),
        Event::Modulation(joint) => rig.spoil_modulation(joint),
        Event::None | Event::Hands => {}
    }
}
