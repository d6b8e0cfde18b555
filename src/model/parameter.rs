//! The 14 parameters of a joint and their order, fixed once.
//!
//! Logs, reports, regressor columns and stored models all use this order, so it never changes.

use crate::listed::listed;

/// Parameters of one joint: ten of the link's inertia, rotor inertia, three of friction.
pub const PARAMETERS_PER_JOINT: usize = 14;

const _: () = assert!(Parameter::ALL.len() == PARAMETERS_PER_JOINT);

/// Parameters of one joint in the order of [`Parameter`].
pub type JointParameters<T> = [T; PARAMETERS_PER_JOINT];

/// Parameters of all joints, proximal first.
pub type LegParameters<T, const N: usize> = [JointParameters<T>; N];

/// Derivative of one torque by each parameter of each joint.
pub type RegressorRow<T, const N: usize> = [JointParameters<T>; N];

listed! {
    /// One of the parameters of a joint; the discriminant is its index in [`JointParameters`].
    #[derive(PartialOrd, Ord)]
    #[repr(u8)]
    pub enum Parameter {
        /// All parameters, in order.
        ALL,
        /// Symbol used in reports and files.
        symbol;
        /// Inertia tensor element about the joint frame's origin, integral of (y2 + z2) dm.
        XX, "XX";
        /// Inertia tensor element, minus the integral of x y dm.
        XY, "XY";
        /// Inertia tensor element, minus the integral of x z dm.
        XZ, "XZ";
        /// Inertia tensor element, integral of (x2 + z2) dm.
        YY, "YY";
        /// Inertia tensor element, minus the integral of y z dm.
        YZ, "YZ";
        /// Inertia tensor element, integral of (x2 + y2) dm.
        ZZ, "ZZ";
        /// First moment of mass along x.
        HX, "HX";
        /// First moment of mass along y.
        HY, "HY";
        /// First moment of mass along z.
        HZ, "HZ";
        /// Mass.
        M, "M";
        /// Rotor inertia seen at the joint (rotor inertia times gear ratio squared).
        IA, "IA";
        /// Coulomb friction.
        FC, "FC";
        /// Viscous friction.
        FV, "FV";
        /// Torque offset: a constant of the current measurement or of the friction.
        OFF, "OFF";
    }
}

impl Parameter {
    /// Index in [`JointParameters`], 0..14.
    pub const fn index(self) -> usize {
        self as usize
    }

    /// True if no physically consistent leg has a negative value of it, regrouped or not.
    pub const fn is_never_negative(self) -> bool {
        matches!(self, Self::ZZ | Self::M | Self::IA | Self::FC | Self::FV)
    }

    /// Unit, in ASCII.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::XX | Self::XY | Self::XZ | Self::YY | Self::YZ | Self::ZZ | Self::IA => "kg m2",
            Self::HX | Self::HY | Self::HZ => "kg m",
            Self::M => "kg",
            Self::FC | Self::OFF => "N m",
            Self::FV => "N m s/rad",
        }
    }
}

/// Converts parameters from double precision, each rounded once.
#[cfg(test)]
pub(crate) fn rounded<T: crate::real::Real, const N: usize>(
    parameters: &LegParameters<f64, N>,
) -> LegParameters<T, N> {
    parameters.map(|joint| joint.map(T::from_double))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_parameter_stands_where_its_index_says() {
        for (index, parameter) in Parameter::ALL.iter().enumerate() {
            assert_eq!(parameter.index(), index);
        }
        let symbols = ["XX", "XY", "XZ", "YY", "YZ", "ZZ", "HX", "HY", "HZ", "M", "IA", "FC", "FV", "OFF"];
        assert_eq!(Parameter::ALL.map(Parameter::symbol), symbols);
    }
}
