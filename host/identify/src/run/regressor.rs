//! `regressor`: torques and regressor of given states, for comparison with other rigid-body software.
//!
//! Only rigid bodies: ten inertial parameters of each link, without rotor inertia, friction or
//! offset. Torques come from Newton-Euler and the regressor from its own equations. A reader can
//! therefore check one against the other, and both against other software.
//!
//! | | columns |
//! | --- | --- |
//! | in | states of motion ([`crate::leg::states`]) |
//! | out | `k` from 0; `tau1..tauN` N m; `y1_XX1..y1_M1, y1_XX2..`: row of torque 1, then of torque 2 |
//!
//! Torques and rows have the sign of the given angles. The parameters stay those of the D-H frames,
//! so torque = row times parameters in either convention. Numbers are written with the digits that
//! restore the f64 exactly; in the device's arithmetic, the f64 that equals the f32. All states are
//! read and computed before anything is written.

use std::path::Path;

use nalgebra::Vector3;
use scarab::ident::prior_parameters;
use scarab::model::{
    AnatomicalJoint, Chain, INERTIAL_PARAMETERS, JointState, LegParameters, Parameter, regressor,
    rigid_body_torques,
};
use scarab::real::Real;
use scarab_base::error::ToolError;

use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::chain;
use crate::leg::setup::links;
use crate::leg::states::{Angles, States};

/// Options of the computation.
#[derive(Clone, Copy, Debug)]
pub struct RegressorOptions {
    /// Convention of angles and torques.
    pub angles: Angles,
    /// Whether the device's arithmetic is used.
    pub single_precision: bool,
}

/// Table for a leg of any size, as CSV text.
pub fn table(leg: &LegFile, states: &Path, options: &RegressorOptions) -> Result<String, ToolError> {
    match leg.joints.len() {
        1 => table_of::<1>(leg, states, options),
        2 => table_of::<2>(leg, states, options),
        _ => table_of::<3>(leg, states, options),
    }
}

fn table_of<const N: usize>(
    leg: &LegFile,
    states: &Path,
    options: &RegressorOptions,
) -> Result<String, ToolError> {
    let bodies = Bodies::<N>::from_leg(leg)?;
    let to_chain = options.angles.to_chain::<N>(leg)?;
    let states = States::read(states, &to_chain)?;
    let mut out = header::<N>();
    for (k, state) in states.rows.iter().enumerate() {
        let state = &state.motion;
        let row = if options.single_precision { bodies.row::<f32>(state) } else { bodies.row::<f64>(state) };
        if !row.is_finite() {
            return Err(states.out_of_range(k).into());
        }
        out += &row.turned(&to_chain).line(k);
    }
    Ok(out)
}

fn header<const N: usize>() -> String {
    let mut text = String::from("k");
    (1..=N).for_each(|joint| text += &format!(",tau{joint}"));
    for row in 1..=N {
        for link in 1..=N {
            for parameter in &Parameter::ALL[..INERTIAL_PARAMETERS] {
                text += &format!(",y{row}_{}{link}", parameter.symbol());
            }
        }
    }
    text.push('\n');
    text
}

/// Geometry, gravity and, if the leg file has them for every joint, parameters.
struct Bodies<const N: usize> {
    chain: Chain<f64, N>,
    gravity: Vector3<f64>,
    parameters: Option<LegParameters<f64, N>>,
}

impl<const N: usize> Bodies<N> {
    fn from_leg(leg: &LegFile) -> Result<Self, ToolError> {
        let truth = links::<N>(leg, |joint| joint.truth.as_ref());
        let parameters = truth.or_else(|| links::<N>(leg, |joint| joint.prior.as_ref()));
        Ok(Self {
            chain: chain(leg)?,
            gravity: Vector3::from(leg.gravity),
            parameters: parameters.map(|links| prior_parameters(&links)),
        })
    }

    /// Computes one line of the table in precision `T`.
    fn row<T: Real>(&self, state: &JointState<f64, N>) -> Row<N> {
        let chain = self.chain.convert::<T>();
        let gravity = self.gravity.map(T::from_double);
        let [q, qd, qdd] = [state.q, state.qd, state.qdd].map(|numbers| numbers.map(T::from_double));
        let state = JointState { q, qd, qdd };
        let torques = self.parameters.map(|parameters| {
            rigid_body_torques(&chain, &parameters.map(|joint| joint.map(T::from_double)), &state, &gravity)
        });
        let elements = regressor(&chain, &state, &gravity)
            .map(|row| row.map(|link| core::array::from_fn(|column| link[column].to_double())));
        Row { torques: torques.map(|torques| torques.map(T::to_double)), elements }
    }
}

struct Row<const N: usize> {
    /// Torques, N m.
    torques: Option<[f64; N]>,
    /// Elements by torque, link and inertial parameter.
    elements: [[[f64; INERTIAL_PARAMETERS]; N]; N],
}

impl<const N: usize> Row<N> {
    /// Converts torques and elements to the sign of the given angles.
    fn turned(mut self, to_chain: &[AnatomicalJoint<f64>; N]) -> Self {
        for (joint, anatomy) in to_chain.iter().enumerate() {
            let turn = |number: &mut f64| *number = anatomy.from_chain(*number);
            self.torques.iter_mut().for_each(|torques| turn(&mut torques[joint]));
            self.elements[joint].as_flattened_mut().iter_mut().for_each(turn);
        }
        self
    }

    fn is_finite(&self) -> bool {
        let elements = self.elements.as_flattened().as_flattened();
        self.torques.iter().flatten().chain(elements).all(|number| number.is_finite())
    }

    fn line(&self, k: usize) -> String {
        // Adding 0 turns -0 into 0.
        let number = |number: f64| format!("{:e}", number + 0.0);
        let torque = |joint: usize| self.torques.map_or_else(String::new, |torques| number(torques[joint]));
        let elements = self.elements.as_flattened().as_flattened().iter().copied().map(number);
        let fields: Vec<String> =
            std::iter::once(k.to_string()).chain((0..N).map(torque)).chain(elements).collect();
        fields.join(",") + "\n"
    }
}
