//! A stored model offered to a leg after a restart.

use scarab::leg::{Assured, RestoreError, StoredModel, Stribeck};
use scarab::units::{NewtonMetrePerAmpere, Radian};

use super::*;

/// Stored model of the identified leg.
fn kept() -> StoredModel<JOINTS> {
    let pair = identified();
    context().configuration.to_stored(pair.leg.control().model().expect("accepted"))
}

#[test]
fn a_stored_model_is_restored_and_used_at_the_next_start() {
    let first = identified();
    let found = first.leg.control().model().expect("accepted");
    let restored = context().configuration.restore(&kept()).expect("the same leg");
    assert_eq!(&restored, found);

    // The next start has no model until one is adopted.
    let mut pair = enabled(&default_leg(), 2);
    assert_eq!(pair.leg.control().model(), None);
    assert!(pair.leg.adopt(restored));
    assert_eq!(pair.leg.control().model(), Some(&restored));
}

#[test]
fn a_model_of_another_leg_length_or_torque_constant_is_refused() {
    let stored = kept();
    let own = context().configuration.fingerprint();
    let refused = |leg: &LegFile, what: &str| {
        let other = Context::new(leg, &SimulationOptions::with_seed(1)).expect(what);
        let expected = RestoreError::AnotherLeg { stored: own, own: other.configuration.fingerprint() };
        assert_eq!(other.configuration.restore(&stored), Err(expected), "{what}");
    };
    for joint in 0..JOINTS {
        let mut leg = default_leg();
        leg.joints[joint].torque_per_ampere *= 1.01;
        refused(&leg, "torque constant");
        let mut leg = default_leg();
        leg.joints[joint].zero_offset_deg += 0.1;
        refused(&leg, "zero");
    }
    let mut leg = default_leg();
    leg.joints[1].dh.a += 0.001;
    refused(&leg, "length");
    let mut configuration = context().configuration.clone();
    configuration.joints.swap(0, 1);
    assert!(matches!(configuration.restore(&stored), Err(RestoreError::AnotherLeg { .. })), "joints' order");

    let mut configuration = context().configuration.clone();
    configuration.joints.iter_mut().for_each(|joint| joint.scale.mirrored = true);
    assert!(matches!(configuration.restore(&stored), Err(RestoreError::AnotherLeg { .. })), "other side");

    // Changes that leave the parameters' meaning unchanged do not refuse the model.
    let mut configuration = context().configuration.clone();
    configuration.joints[0].low = Radian(0.1);
    configuration.joints[0].scale.radian_per_count = Radian(1e-5);
    configuration.swarm_seed += 1;
    assert!(configuration.restore(&stored).is_ok());
    configuration.joints[0].scale.torque_per_ampere = NewtonMetrePerAmpere(1.6);
    assert!(configuration.restore(&stored).is_err());
}

#[test]
fn invalid_numbers_of_a_stored_model_are_refused_with_their_joint() {
    let stored = kept();
    let assured = stored.assured;
    assert!(assured.inertia_share > 0.5, "{assured:?}");
    assert!(assured.coulomb_nm.iter().all(|bound| *bound > 0.0), "{assured:?}");
    let refused = |change: &dyn Fn(&mut StoredModel<JOINTS>), reason: RestoreError| {
        let mut changed = stored;
        change(&mut changed);
        assert_eq!(context().configuration.restore(&changed), Err(reason));
    };
    for joint in 0..JOINTS {
        for value in [f32::NAN, f32::INFINITY] {
            refused(&|model| model.parameters[joint][7] = value, RestoreError::NotFinite { joint });
        }
        // A speed of 0 makes the torque of a joint at rest NaN.
        for (excess, velocity) in [(0.0, 0.0), (-0.1, 0.1), (f32::NAN, 0.1), (0.4, f32::INFINITY)] {
            let curve = Stribeck { excess, velocity };
            refused(&|model| model.stribeck[joint] = curve, RestoreError::Stribeck { joint });
        }
        for value in [-0.01, f32::NAN, f32::INFINITY] {
            let reason = RestoreError::FrictionBound { joint };
            refused(&|model| model.assured.coulomb_nm[joint] = value, reason);
            refused(&|model| model.assured.viscous[joint] = value, reason);
        }
    }
    for share in [-0.01, 1.01, f32::NAN, f32::INFINITY] {
        refused(&|model| model.assured.inertia_share = share, RestoreError::InertiaShare);
    }
    let whole = StoredModel { assured: Assured { inertia_share: 1.0, ..assured }, ..stored };
    let none = StoredModel { assured: Assured::NOTHING, ..stored };
    for stored in [whole, none] {
        let restored = context().configuration.restore(&stored).expect("valid bounds");
        assert_eq!(restored.assured(), &stored.assured);
    }
}

#[test]
fn a_model_is_not_exchanged_in_motion_or_while_in_use() {
    let restored = context().configuration.restore(&kept()).expect("the same leg");
    let mut pair = during_excitation();
    assert!(!pair.leg.adopt(restored));

    let mut pair = identified();
    track_gait(&mut pair, context());
    assert!(!pair.leg.adopt(restored), "tracking");
    assert!(run_until(&mut pair, |pair| activity(pair) == Activity::Idle));
    assert!(!pair.leg.adopt(restored), "at rest, the model still holds the leg");
}
