//! Random wearers and exoskeletons, from a seed each.
//!
//! | quantity | range | source |
//! | --- | --- | --- |
//! | body mass | 45 to 110 kg | adults |
//! | segment masses beside anthropometry | 0.9 to 1.1 | error of the fractions for one person |
//! | knee axes apart along the thigh | at most 10 mm | an exoskeleton that was adjusted |
//! | hip axes apart, along and forward | at most 15 mm | as above |
//! | cuff stiffness across | 3 to 20 kN/m, log-uniform | 8 kN/m of the padded cuff, a factor of 2.5 |
//! | cuff stiffness along | 0.15 to 0.4 of across | skin and straps that shear |
//! | cuff damping across | 30 to 200 N s/m, log-uniform | 80 N s/m of the padded cuff, a factor of 2.5 |
//! | cuff damping along | 0.3 to 0.7 of across | |
//! | cuff play | none, or up to 5 mm | loose straps in every second wearer |
//! | neural delay | 50 to 100 ms | long-latency and voluntary reactions |
//! | muscles' impedance | 0.5 to 1.5 of relaxed or firm | reflexes stay stable with every delay |
//! | link masses of the exoskeleton | 0.8 to 1.2 | |
//! | rotor inertia, Coulomb and viscous friction | 0.5 to 1.5 | friction of one type varies that much |
//! | static friction above Coulomb | none, or up to 50 % at 0.02 to 0.2 rad/s | in every second one |
//!
//! All are assumptions, except where a source is named.

use hal_sim::wearer::description::{Impedance, MuscleDescription, WearerDescription};

use scarab_base::random::Random;
use scarab_identify::formats::anthropometry::Wearer;
use scarab_identify::formats::leg_file::{LegFile, StribeckFile};
use scarab_identify::leg::two_bodies::{MuscleTone, description};

/// Body masses of drawn wearers, kg.
pub(crate) const BODY_MASS_KG: [f64; 2] = [45.0, 110.0];
/// Largest distance of the knee axes along the thigh, m.
const KNEE_OFFSET_M: f64 = 0.010;
/// Largest distance of the hip axes in each direction, m.
const HIP_OFFSET_M: f64 = 0.015;

/// Wearer of this seed for an exoskeleton that is adjusted to these lengths.
pub fn wearer(lengths: &Wearer, seed: u64) -> WearerDescription {
    let mut random = Random::new("wearer", seed);
    let [lightest, heaviest] = BODY_MASS_KG;
    let person = Wearer { mass: random.uniform(lightest, heaviest), ..*lengths };
    let tone = if random.coin() { MuscleTone::Relaxed } else { MuscleTone::Firm };
    let mut wearer = description(&person, tone);
    for segment in [&mut wearer.thigh, &mut wearer.shank] {
        let factor = random.uniform(0.9, 1.1);
        segment.mass *= factor;
        segment.inertia_com *= factor;
    }
    wearer.thigh_length += random.uniform(-KNEE_OFFSET_M, KNEE_OFFSET_M);
    wearer.hip_offset = [0; 2].map(|_: i32| random.uniform(-HIP_OFFSET_M, HIP_OFFSET_M));
    let (stiffness, damping) = (random.logarithmic(3e3, 20e3), random.logarithmic(30.0, 200.0));
    let play = if random.coin() { random.uniform(0.0, 0.005) } else { 0.0 };
    for cuff in &mut wearer.cuffs {
        (cuff.across.stiffness, cuff.across.damping, cuff.across.play) = (stiffness, damping, play);
        cuff.along.stiffness = random.uniform(0.15, 0.4) * stiffness;
        cuff.along.damping = random.uniform(0.3, 0.7) * damping;
        cuff.along.play = play;
    }
    wearer.neural_delay = random.uniform(0.05, 0.1);
    for muscle in &mut wearer.muscles {
        scale(muscle, random.uniform(0.5, 1.5));
    }
    wearer
}

/// Scales the impedance of the active muscles. Reflexes stay: they are stable as they are.
fn scale(muscle: &mut MuscleDescription, factor: f64) {
    for Impedance { stiffness, damping } in [&mut muscle.intrinsic, &mut muscle.resisting] {
        *stiffness *= factor;
        *damping *= factor;
    }
}

/// Exoskeleton of this seed: the truth of a leg file with other masses, rotors and friction. The prior stays.
pub fn exoskeleton(leg: &LegFile, seed: u64) -> LegFile {
    let mut random = Random::new("exo", seed);
    let mut drawn = leg.clone();
    drawn.name += &format!(" drawn {seed}");
    for joint in &mut drawn.joints {
        let Some(truth) = &mut joint.truth else { continue };
        let mass = random.uniform(0.8, 1.2);
        truth.mass *= mass;
        truth.inertia_com = truth.inertia_com.map(|element| mass * element);
        for value in [&mut truth.rotor_inertia, &mut truth.coulomb, &mut truth.viscous] {
            *value *= random.uniform(0.5, 1.5);
        }
        joint.stribeck = random.coin().then(|| StribeckFile {
            static_nm: truth.coulomb * random.uniform(1.0, 1.5),
            speed_rad_s: random.logarithmic(0.02, 0.2),
        });
    }
    drawn
}

#[cfg(test)]
mod tests {
    use hal_sim::world::World;

    use super::*;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;
    use scarab_identify::leg::two_bodies::TwoBodies;

    #[test]
    fn drawn_wearers_and_exoskeletons_are_permitted_and_differ() {
        let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
        let bodies = TwoBodies::from_leg(&leg).expect("a worn leg");
        let mut masses = Vec::new();
        for seed in 1..=200 {
            let drawn = exoskeleton(&bodies.exoskeleton, seed);
            assert_eq!(LegFile::parse(&drawn.to_toml(), "drawn").as_ref(), Ok(&drawn), "{seed}");
            let wearer = wearer(&bodies.person, seed);
            let mut world = World::<2>::new(&drawn.description().expect("simulated"), seed);
            world.wear(&wearer).expect("permitted");
            masses.push(wearer.thigh.mass);
        }
        assert_eq!(wearer(&bodies.person, 7), wearer(&bodies.person, 7));
        // A thigh is a tenth of the body, within 10 %.
        let [low, high] = [f64::min, f64::max].map(|extreme| masses.iter().copied().reduce(extreme));
        assert!(low.is_some_and(|mass| (4.05..5.5).contains(&mass)), "{low:?}");
        assert!(high.is_some_and(|mass| (10.0..12.1).contains(&mass)), "{high:?}");
    }
}
