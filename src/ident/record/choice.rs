//! Choices of what to estimate: always, never, or as the data decide.

/// Whether a part of the model is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// Estimated if the data determine it.
    Auto,
    /// Always estimated.
    On,
    /// Never estimated.
    #[default]
    Off,
}

impl Choice {
    /// True unless ruled out beforehand.
    pub const fn is_possible(self) -> bool {
        !matches!(self, Self::Off)
    }
}

/// Interpretation of the constant part of a joint's torque.
///
/// While a joint moves, offset and asymmetric friction are one column. With friction FC+ one way and FC- the
/// other, torque = (FC+ + FC-)/2 sign(v) + (FC+ - FC-)/2. Only knowledge of the drive separates the two. At
/// rest they differ: friction is undetermined there, an offset is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constant {
    /// An offset of the torque or of its measurement.
    #[default]
    Offset,
    /// Half the difference of Coulomb friction between the two directions; the measurement has no offset.
    Asymmetry,
}

/// Choices for one joint's drive: what to estimate and what may be dropped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveChoice {
    /// Rotor inertia.
    pub rotor: Choice,
    /// The constant part of the torque.
    pub constant: Choice,
    /// Interpretation of the constant part.
    pub meaning: Constant,
    /// Standard deviation of the constant part about zero by knowledge of the drive, N m.
    pub within_nm: Option<f32>,
}

impl DriveChoice {
    /// Everything estimated, the constant part as an offset.
    pub const ALL: Self =
        Self { rotor: Choice::On, constant: Choice::On, meaning: Constant::Offset, within_nm: None };
}

/// Treatment of disturbances in a motion.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Outliers are replaced, disturbed stretches get less weight.
    #[default]
    Robust,
    /// All samples have equal weight.
    Plain,
}
