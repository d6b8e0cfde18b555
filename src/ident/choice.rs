//! What is estimated, what is not, and what the data decide.

/// Whether a part of the model is estimated.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Choice {
    /// If the data tell it.
    Auto,
    /// It is.
    On,
    /// It is not.
    #[default]
    Off,
}

impl Choice {
    /// Not ruled out beforehand.
    #[must_use]
    pub const fn is_possible(self) -> bool {
        !matches!(self, Self::Off)
    }
}

/// What the constant part of a joint's torque is taken for. While a joint moves the two are one column: with friction
/// FC+ one way and FC- the other, torque = (FC+ + FC-)/2 sign(v) + (FC+ - FC-)/2. Only what is known of the drive tells
/// them apart, and at rest they differ: friction is undetermined there, an offset is not.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Constant {
    /// An offset of the torque or of its measurement.
    #[default]
    Offset,
    /// Half of what Coulomb friction differs by between the two directions; the measurement is known to have no offset.
    Asymmetry,
}

/// Of one joint's drive: what is estimated, and what of it may be dropped.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct DriveChoice {
    /// Rotor inertia.
    pub rotor: Choice,
    /// The constant part of the torque.
    pub constant: Choice,
    /// What that part is taken for.
    pub meaning: Constant,
}

impl DriveChoice {
    /// Everything, as an offset.
    pub const ALL: Self = Self { rotor: Choice::On, constant: Choice::On, meaning: Constant::Offset };
}

/// How disturbances of a motion are met.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Estimator {
    /// Wild samples are replaced, disturbed stretches count for less.
    #[default]
    Robust,
    /// Every sample counts alike.
    Plain,
}
