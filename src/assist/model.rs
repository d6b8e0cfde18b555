//! The models `empty` and `worn` in the form that the assistance needs.

use nalgebra::Vector3;

use crate::model::mass_matrix::mass_matrix;
use crate::model::{Chain, JointState, LegParameters, Parameter, rigid_body_torques};
use crate::real::clamp;

/// Lower confidence bounds of an identified model, value - 2 sigma and at least zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Assured<const N: usize> {
    /// Coulomb friction, N m.
    pub coulomb_nm: [f32; N],
    /// Viscous friction, N m s/rad.
    pub viscous: [f32; N],
    /// Share of the mass matrix that is certain in every posture and direction, 0..1.
    pub inertia_share: f32,
}

impl<const N: usize> Assured<N> {
    /// Bounds of a model whose uncertainty is unknown: only its weight may be carried.
    pub const NOTHING: Self = Self { coulomb_nm: [0.0; N], viscous: [0.0; N], inertia_share: 0.0 };

    /// Lower bound of the friction of moving joints, N m. The sign of Coulomb friction is linear within
    /// [`FRICTION_BAND`].
    #[inline]
    pub(crate) fn friction(&self, qd: &[f32; N]) -> [f32; N] {
        let mut torque = [0.0; N];
        for joint in 0..N {
            let sign = clamp(qd[joint] * (1.0 / FRICTION_BAND), -1.0, 1.0);
            torque[joint] = self.coulomb_nm[joint] * sign + self.viscous[joint] * qd[joint];
        }
        torque
    }
}

/// Torques of the empty leg, and of the wearer's leg if that is known.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompensationModel<const N: usize> {
    /// Geometry.
    pub(crate) chain: Chain<f32, N>,
    /// Gravity in the base frame, m/s^2.
    pub(crate) gravity: [f32; 3],
    /// Equivalent parameters of the empty leg.
    pub(crate) empty: LegParameters<f32, N>,
    /// Equivalent parameters of the worn leg minus those of the empty one. Torque is linear in the
    /// parameters, so their difference gives the torque of the wearer's leg.
    pub(crate) wearer: Option<LegParameters<f32, N>>,
    /// Constant torque of each joint's drive, N m.
    pub(crate) offset_nm: [f32; N],
    /// Bounds of the empty leg.
    pub(crate) assured: Assured<N>,
}

/// Speed below which compensated Coulomb friction fades to zero, rad/s. Friction at rest is not compensated:
/// it can take either sign there, and a torque that helps it one way pushes the other way.
pub(crate) const FRICTION_BAND: f32 = 0.05;

/// Torque of one set of parameters with their rotors' inertia, N m.
fn torques<const N: usize>(
    chain: &Chain<f32, N>,
    parameters: &LegParameters<f32, N>,
    state: &JointState<f32, N>,
    gravity: [f32; 3],
) -> [f32; N] {
    let mut torque = rigid_body_torques(chain, parameters, state, &Vector3::from(gravity));
    for joint in 0..N {
        torque[joint] += parameters[joint][Parameter::IA.index()] * state.qdd[joint];
    }
    torque
}

impl<const N: usize> CompensationModel<N> {
    /// Weight of the empty leg with the drives' offsets, N m.
    pub(crate) fn weight(&self, q: &[f32; N]) -> [f32; N] {
        let state = JointState { q: *q, qd: [0.0; N], qdd: [0.0; N] };
        let mut torque = torques(&self.chain, &self.empty, &state, self.gravity);
        for (torque, offset) in torque.iter_mut().zip(self.offset_nm) {
            *torque += offset;
        }
        torque
    }

    /// Torque of the empty leg's inertia and centrifugal terms, without gravity, N m.
    pub(crate) fn inertia(&self, state: &JointState<f32, N>) -> [f32; N] {
        torques(&self.chain, &self.empty, state, [0.0; 3])
    }

    /// Weight of the wearer's leg, N m; zero while unknown.
    pub fn wearer_weight(&self, q: &[f32; N]) -> [f32; N] {
        self.wearer_torque(&JointState { q: *q, qd: [0.0; N], qdd: [0.0; N] })
    }

    /// Torque that moves the wearer's leg alone, N m; zero while unknown.
    pub(crate) fn wearer_torque(&self, state: &JointState<f32, N>) -> [f32; N] {
        match &self.wearer {
            Some(wearer) => torques(&self.chain, wearer, state, self.gravity),
            None => [0.0; N],
        }
    }

    /// Torque that moves the wearer's leg and a share of the empty leg's inertia, less the carried share of
    /// the wearer's weight, N m: that of a wearer in a transparent leg.
    pub(crate) fn wearer_needs(
        &self,
        state: &JointState<f32, N>,
        inertia_share: f32,
        carried_share: f32,
    ) -> [f32; N] {
        let mut torque = self.wearer_torque(state);
        for (torque, inertia) in torque.iter_mut().zip(self.inertia(state)) {
            *torque += inertia_share * inertia;
        }
        if carried_share != 0.0 {
            for (torque, weight) in torque.iter_mut().zip(self.wearer_weight(&state.q)) {
                *torque -= carried_share * weight;
            }
        }
        torque
    }

    /// Share of the empty leg's mass matrix, kg m^2.
    pub fn mass_matrix(&self, q: &[f32; N], share: f32) -> [[f32; N]; N] {
        let matrix = mass_matrix(&self.chain, &self.empty, q);
        core::array::from_fn(|row| core::array::from_fn(|column| share * matrix[(row, column)]))
    }

    /// Kinetic energy of the empty leg, J.
    pub(crate) fn kinetic_energy(&self, q: &[f32; N], qd: &[f32; N]) -> f32 {
        let matrix = mass_matrix(&self.chain, &self.empty, q);
        let mut energy = 0.0;
        for row in 0..N {
            for column in 0..N {
                energy += 0.5 * qd[row] * matrix[(row, column)] * qd[column];
            }
        }
        energy
    }
}
