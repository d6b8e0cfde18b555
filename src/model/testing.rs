//! Random chains, legs and motions for this module's tests, from fixed seeds.

use core::f64::consts::{FRAC_PI_2, PI};

use super::chain::{Chain, DenavitHartenberg};
use super::inertia::joint;
use super::log_cholesky::LogCholesky;
use super::newton_euler::JointState;
use super::parameter::LegParameters;
use crate::real::Real;
pub(crate) use crate::testing::TestRandom;
use nalgebra::Vector3;

/// Gravity of the planar leg: straight down along x of the base.
pub(crate) fn down_along_x<T: Real>() -> Vector3<T> {
    Vector3::new(T::from_double(9.81), T::zero(), T::zero())
}

impl TestRandom {
    pub(crate) fn chain<const N: usize>(&mut self) -> Chain<f64, N> {
        let mut joint =
            || DenavitHartenberg { alpha: self.within(PI), a: self.within(0.5), d: self.within(0.3) };
        Chain::new(&core::array::from_fn(|_| joint())).unwrap()
    }

    pub fn state<const N: usize>(&mut self) -> JointState<f64, N> {
        JointState {
            q: core::array::from_fn(|_| self.within(PI)),
            qd: core::array::from_fn(|_| self.within(3.0)),
            qdd: core::array::from_fn(|_| self.within(10.0)),
        }
    }

    pub(crate) fn gravity(&mut self) -> Vector3<f64> {
        Vector3::new(self.within(9.81), self.within(9.81), self.within(9.81))
    }

    /// Coordinates of a body of 0.4 to 20 kg, a few centimetres to decimetres wide,
    /// up to 0.3 m from the origin.
    pub(crate) fn body(&mut self) -> LogCholesky<f64> {
        let mut body = [0.0; 10];
        body[0] = 0.5 + self.within(1.0);
        for logarithm in &mut body[1..4] {
            *logarithm = -2.0 + self.within(1.0);
        }
        for shear in &mut body[4..7] {
            *shear = self.within(0.1);
        }
        for centre in &mut body[7..] {
            *centre = self.within(0.3);
        }
        LogCholesky(body)
    }

    /// Physically consistent links with rotors, friction and offsets.
    pub(crate) fn leg<const N: usize>(&mut self) -> LegParameters<f64, N> {
        core::array::from_fn(|_| {
            let drive =
                [0.5 + self.within(0.4), 3.0 + self.within(2.0), 1.0 + self.within(0.8), self.within(1.0)];
            joint(&self.body().parameters(), &drive)
        })
    }
}

pub(crate) fn rounded_state<T: Real, const N: usize>(state: &JointState<f64, N>) -> JointState<T, N> {
    JointState {
        q: state.q.map(T::from_double),
        qd: state.qd.map(T::from_double),
        qdd: state.qdd.map(T::from_double),
    }
}

/// Hip and knee: parallel axes, thigh of `length` metres.
pub(crate) fn planar_leg<T: Real>(length: f64) -> Chain<T, 2> {
    let joint = |a: f64| DenavitHartenberg { alpha: T::zero(), a: T::from_double(a), d: T::zero() };
    Chain::new(&[joint(0.0), joint(length)]).unwrap()
}

/// The paper's chain: a vertical axis, then two parallel horizontal ones (gravity along -z of the base).
pub(crate) fn paper_chain<T: Real>() -> Chain<T, 3> {
    let joint = |alpha: f64, a: f64| DenavitHartenberg {
        alpha: T::from_double(alpha),
        a: T::from_double(a),
        d: T::zero(),
    };
    Chain::new(&[joint(0.0, 0.0), joint(FRAC_PI_2, 0.0), joint(0.0, 0.45)]).unwrap()
}
