//! A leg without power falls on its mechanical end stops.

use crate::plant::common::planar_leg;
use hal_sim::mechanism::Mechanism;
use hal_sim::world::{TICK_S, World};
use scarab::hal::DriveCommand;
use scarab::units::Ampere;

const STOPS: [[f64; 2]; 2] = [[-0.2, 2.0], [-0.1, 2.4]];
/// Largest penetration of a buffer in the falls from these poses, rad.
const DEEPEST: f64 = 0.06;
/// Integration error between two contacts, J; the legs have some 10 J.
const ERROR_J: f64 = 5e-3;

#[test]
fn a_falling_leg_ends_at_its_stops_without_gaining_energy() {
    let mut leg = planar_leg();
    leg.joints.iter_mut().zip(STOPS).for_each(|(joint, stops)| joint.stops = Some(stops));
    let mechanism = Mechanism::new(&leg);
    let off = DriveCommand { enabled: false, currents: [Ampere(0.0); 2] };
    for pose in [[1.2, 0.8], [1.8, 2.3], [-0.15, 2.0], [0.9, 0.0]] {
        let mut world = World::new(&leg, 1);
        world.move_to(&pose);
        let mut lowest = mechanism.potential_energy(&pose);
        let begin = lowest;
        let (mut contacts, mut was_inside) = (0, true);
        for _ in 0..(20.0 / TICK_S) as u32 {
            world.tick(&off);
            let (position, velocity) = (world.anatomical_position(), world.velocity());
            let depth = |joint: usize| {
                let [low, high] = STOPS[joint];
                (low - position[joint]).max(position[joint] - high)
            };
            assert!(depth(0) < DEEPEST && depth(1) < DEEPEST, "{pose:?}: {position:?}");
            let is_inside = depth(0) <= 0.0 && depth(1) <= 0.0;
            contacts += u32::from(was_inside && !is_inside);
            was_inside = is_inside;
            // Away from the buffers, which store energy.
            if is_inside {
                let energy =
                    mechanism.kinetic_energy(&position, &velocity) + mechanism.potential_energy(&position);
                assert!(energy < lowest + ERROR_J, "{pose:?}: {energy} J after {lowest} J");
                lowest = lowest.min(energy);
            }
        }
        assert!(contacts > 3 && lowest < begin - 1.0, "{pose:?}: {contacts} contacts, {begin} to {lowest} J");
    }
}
