//! The chain compared with an independent rigid-body library (`tests/data/planar_hip_knee`).

use nalgebra::Vector3;
use scarab::model::{
    Chain, DenavitHartenberg, JointState, LegParameters, Parameter, joint_torques, regressor,
    rigid_body_torques,
};
use scarab::real::Real;
use serde_json::Value;

const FOLDER: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../tests/data/planar_hip_knee");

struct Sample {
    state: JointState<f64, 2>,
    rigid: [f64; 2],
    friction: [f64; 2],
    /// Rows for each torque: ten columns of link 1, ten of link 2.
    rows: [[f64; 20]; 2],
}

fn table(name: &str) -> Vec<Vec<f64>> {
    let mut reader = csv::Reader::from_path(format!("{FOLDER}/{name}")).unwrap();
    let row = |record: csv::StringRecord| record.iter().map(|field| field.parse().unwrap()).collect();
    reader.records().map(|record| row(record.unwrap())).collect()
}

fn samples() -> Vec<Sample> {
    let rows = table("regressor.csv");
    let samples: Vec<Sample> = table("torque.csv")
        .iter()
        .zip(rows.chunks(2))
        .map(|(line, rows)| {
            let pair = |first: usize| [line[first], line[first + 1]];
            let numbers = [rows[0][0], rows[0][1], rows[1][1]];
            assert_eq!(numbers, [line[0], 1.0, 2.0], "the files have different rows");
            Sample {
                state: JointState { q: pair(1), qd: pair(3), qdd: pair(5) },
                rigid: pair(7),
                friction: pair(9),
                rows: [0, 1].map(|joint: usize| rows[joint][2..].try_into().unwrap()),
            }
        })
        .collect();
    assert_eq!(samples.len(), 50);
    samples
}

/// Chain, parameters and gravity of the reference.
fn leg() -> (Chain<f64, 2>, LegParameters<f64, 2>, Vector3<f64>) {
    let truth: Value =
        serde_json::from_str(&std::fs::read_to_string(format!("{FOLDER}/truth.json")).unwrap()).unwrap();
    let number = |value: &Value| value.as_f64().unwrap();
    let geometry = [0, 1].map(|joint: usize| {
        let [alpha, a, d] = ["alpha", "a", "d"].map(|name| number(&truth["dh"][joint][name]));
        DenavitHartenberg { alpha, a, d }
    });
    let parameters = [0, 1].map(|joint: usize| {
        Parameter::ALL.map(|parameter| match parameter {
            Parameter::FC => number(&truth["friction"][joint]["fc"]),
            Parameter::FV => number(&truth["friction"][joint]["fv"]),
            Parameter::IA | Parameter::OFF => 0.0,
            inertial => number(&truth["links"][joint][inertial.symbol()]),
        })
    });
    let gravity = Vector3::from_fn(|axis, _| number(&truth["gravity_in_frame0_mps2"][axis]));
    (Chain::new(&geometry).unwrap(), parameters, gravity)
}

/// Largest deviations from the reference in precision `T`, relative to the largest torque and the largest
/// entry.
fn deviations<T: Real>() -> (f64, f64) {
    let (chain, parameters, gravity) = leg();
    let chain = chain.convert::<T>();
    let parameters = parameters.map(|joint| joint.map(T::from_double));
    let gravity = gravity.map(T::from_double);
    let (mut torque_error, mut largest_torque) = (0.0_f64, 0.0_f64);
    let (mut entry_error, mut largest_entry) = (0.0_f64, 0.0_f64);
    for sample in samples() {
        let [q, qd, qdd] =
            [sample.state.q, sample.state.qd, sample.state.qdd].map(|values| values.map(T::from_double));
        let state = JointState { q, qd, qdd };
        let rigid = rigid_body_torques(&chain, &parameters, &state, &gravity);
        let total = joint_torques(&chain, &parameters, &state, &gravity);
        let rows = regressor(&chain, &state, &gravity);
        for joint in 0..2 {
            let expected = sample.rigid[joint] + sample.friction[joint];
            largest_torque = largest_torque.max(expected.abs());
            torque_error = torque_error
                .max((rigid[joint].to_double() - sample.rigid[joint]).abs())
                .max((total[joint].to_double() - expected).abs());
            for column in 0..20 {
                let expected = sample.rows[joint][column];
                largest_entry = largest_entry.max(expected.abs());
                entry_error =
                    entry_error.max((rows[joint][column / 10][column % 10].to_double() - expected).abs());
            }
        }
    }
    (torque_error / largest_torque, entry_error / largest_entry)
}

#[test]
fn torque_and_regressor_agree_with_the_reference_in_double_precision() {
    let (torque, entry) = deviations::<f64>();
    // Tolerance: the files have 15 digits.
    assert!(torque < 1e-9 && entry < 1e-9, "torque {torque:e}, regressor {entry:e}");
}

#[test]
fn torque_and_regressor_agree_with_the_reference_in_single_precision() {
    let (torque, entry) = deviations::<f32>();
    // Tolerance: about ten roundings of 6e-8, on angles that are themselves rounded.
    assert!(torque < 1e-4 && entry < 1e-4, "torque {torque:e}, regressor {entry:e}");
}

#[test]
fn a_leg_at_rest_hangs_straight_down_at_zero_angle() {
    let (chain, mut parameters, gravity) = leg();
    for joint in &mut parameters {
        joint[Parameter::HY.index()] = 0.0;
    }
    let torques = joint_torques(&chain, &parameters, &JointState::at_rest([0.0; 2]), &gravity);
    assert_eq!(torques, [0.0, 0.0]);
    let lifted = joint_torques(&chain, &parameters, &JointState::at_rest([0.3, 0.0]), &gravity);
    assert!(lifted[0] > 0.0 && lifted[1] > 0.0);
}
