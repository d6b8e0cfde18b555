//! Stored models: predicted torque and its band.
#![expect(clippy::disallowed_methods, reason = "runs on the host only and may use std's mathematics")]

use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_identify::leg::setup::{links, row_model};
use scarab_identify::run::predict::Predictor;

use crate::command::{Folder, Table};
use crate::kept::{model, predict, text};
use hal_sim::leg::Leg;
use scarab::ident::prior_parameters;
use scarab::model::JointState;

fn states() -> [JointState<f64, 2>; 2] {
    [
        JointState { q: [0.3, -0.9], qd: [0.7, -1.1], qdd: [4.0, -6.0] },
        JointState { q: [0.8, -0.2], qd: [-1.3, 0.4], qdd: [-2.0, 9.0] },
    ]
}

#[test]
fn predicted_torque_is_that_of_the_plant_for_true_parameters() {
    let leg = LegFile::load(DEFAULT_LEG).expect("shipped");
    let truth = prior_parameters(&links::<2>(&leg, |joint| joint.truth.as_ref()).expect("simulated"));
    let rows = row_model::<2, 13>(&leg).expect("a base set");
    let mut model = model();
    for (base, value) in model.base_set.parameters.iter_mut().zip(rows.base.project(&truth)) {
        base.value = value;
    }
    let predictor = Predictor::<2>::new(&model).expect("two joints");
    let plant = Leg::new(&leg.description::<2>().expect("simulated"));
    for state in states() {
        let torque = plant.inverse_dynamics(&state.q, &state.qd, &state.qdd);
        let rigid = plant.mechanism().inverse_dynamics(&state.q, &state.qd, &state.qdd);
        for (joint, predicted) in predictor.torques(&state).iter().enumerate() {
            // Rounding of torques up to 60 N m; the base set's factors have 15 digits.
            assert!((predicted.total() - torque[joint]).abs() < 1e-12 * 60.0, "{predicted:?} {torque:?}");
            assert!((predicted.rigid - rigid[joint]).abs() < 1e-12 * 60.0, "{predicted:?} {rigid:?}");
        }
    }
}

#[test]
fn the_band_is_the_covariance_propagated_to_the_torque() {
    let model = model();
    let own = Predictor::<2>::new(&model).expect("two joints");
    for state in states() {
        let before = own.torques(&state);
        // The torque is linear in the values: a difference over 1 is its derivative.
        let slopes: Vec<[f64; 2]> = (0..model.base_set.parameters.len())
            .map(|index| {
                let mut moved = model.clone();
                moved.base_set.parameters[index].value += 1.0;
                let after = Predictor::<2>::new(&moved).expect("two joints").torques(&state);
                [after[0].total() - before[0].total(), after[1].total() - before[1].total()]
            })
            .collect();
        for joint in 0..2 {
            let variance: f64 = (model.base_set.covariance.iter().zip(&slopes))
                .flat_map(|(row, left)| {
                    row.iter().zip(&slopes).map(move |(element, right)| (element, left, right))
                })
                .map(|(element, left, right)| left[joint] * element * right[joint])
                .sum();
            // Differences of torques up to 60 N m have 13 digits; the cancelling covariance costs
            // four of them.
            assert!((before[joint].sigma / variance.sqrt() - 1.0).abs() < 1e-8, "{before:?} {variance}");
        }
    }
}

#[test]
fn the_table_has_total_band_and_parts_in_both_angle_conventions() {
    let folder = Folder::new();
    let run = predict(&folder, &text(), "--out @torque.csv").ends_with(0);
    assert_eq!(run.printed, "");
    let table = folder.table("torque.csv");
    assert_eq!(
        table.header.join(","),
        "t_s,tau1_Nm,tau1_sigma_Nm,tau1_rigid_Nm,tau1_friction_Nm,tau1_offset_Nm,\
         tau2_Nm,tau2_sigma_Nm,tau2_rigid_Nm,tau2_friction_Nm,tau2_offset_Nm"
    );
    assert_eq!(table.column("t_s"), [0.0, 0.5]);
    let model = model();
    let predictor = Predictor::<2>::new(&model).expect("two joints");
    for (row, state) in table.rows.iter().zip(states()) {
        let [hip, knee] = predictor.torques(&state);
        assert_eq!(row[1..3], [hip.total(), hip.sigma]);
        assert_eq!(row[6..], [knee.total(), knee.sigma, knee.rigid, knee.friction, knee.offset]);
        assert_eq!(hip.rigid + hip.friction + hip.offset, hip.total());
        assert!(hip.sigma > 0.0 && knee.sigma > 0.0 && knee.friction != 0.0 && knee.offset != 0.0);
    }
    // The knee's anatomical angle is minus its D-H angle; units in column names and the time are optional.
    let flexed = "q1_rad,q2_rad,qd1_radps,qd2_radps,qdd1_radps2,qdd2_radps2\n0.3,0.9,0.7,1.1,4.0,6.0\n0.8,0.2,-1.3,-0.4,-2.0,-9.0\n";
    folder.write("flexed.csv", flexed);
    let printed = folder.scarab("predict --model @model.toml --states @flexed.csv");
    let anatomical = Table::parse(&printed.ends_with(0).printed);
    assert_eq!(anatomical.column("k"), [0.0, 1.0]);
    for part in ["", "_sigma", "_rigid", "_friction", "_offset"] {
        let sign = if part == "_sigma" { 1.0 } else { -1.0 };
        let other: Vec<f64> =
            table.column(&format!("tau2{part}_Nm")).iter().map(|torque| sign * torque).collect();
        assert_eq!(anatomical.column(&format!("tau2{part}_Nm")), other);
        assert_eq!(anatomical.column(&format!("tau1{part}_Nm")), table.column(&format!("tau1{part}_Nm")));
    }
}
