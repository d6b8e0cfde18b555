//! Description of a simulated leg as plain numbers, without heap or text.
//!
//! A host tool fills these structures from a leg file. Bodies are given as
//! the firmware's users state them, in modified Denavit-Hartenberg frames; `conventions` translates. Nothing
//! is checked here; readers of external numbers check them (the host's `formats::leg_file` does).

/// One leg of `N` joints (1 to 3), proximal first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LegDescription<const N: usize> {
    /// Gravity's acceleration in the base frame, m/s^2.
    pub gravity: [f64; 3],
    /// Joints, proximal first.
    pub joints: [JointDescription; N],
    /// Whether drives are mounted mirrored, as on a left leg: motors and encoders turn against the anatomical
    /// direction.
    pub mirrored: bool,
    /// Pushes by the wearer, if any.
    pub pushes: Option<PushDescription>,
}

/// One joint with the link it moves.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointDescription {
    /// Position of the joint's frame in the previous one.
    pub frame: DenavitHartenberg,
    /// Sign (+1 or -1) of the joint (D-H) angle's rate in the anatomical one.
    pub direction: f64,
    /// D-H angle at the anatomical zero, rad.
    pub zero_offset: f64,
    /// The link beyond the joint.
    pub body: BodyDescription,
    /// Rotor inertia reflected to the joint (gear ratio squared times the rotor's own), kg m^2.
    pub rotor_inertia: f64,
    /// Angles of the mechanical end stops, rad, anatomical; a joint without them turns freely.
    pub stops: Option<[f64; 2]>,
    /// Friction of the joint.
    pub friction: FrictionDescription,
    /// Motor and current loop.
    pub drive: DriveDescription,
    /// Angle sensor.
    pub encoder: EncoderDescription,
    /// Current sensor.
    pub current_sensor: CurrentSensorDescription,
}

/// Modified (Khalil, Craig) parameters: T(i-1, i) = Rx(alpha) Tx(a) Rz(q) Tz(d).
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct DenavitHartenberg {
    /// Twist, rad.
    pub alpha: f64,
    /// Length, m.
    pub a: f64,
    /// Offset along the joint's axis, m.
    pub d: f64,
}

/// A rigid link in its own D-H frame.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct BodyDescription {
    /// Mass, kg.
    pub mass: f64,
    /// Centre of mass, m.
    pub com: [f64; 3],
    /// Tensor elements XX XY XZ YY YZ ZZ about the centre of mass, kg m^2.
    pub inertia_com: [f64; 6],
}

impl BodyDescription {
    /// The body with a point mass (kg) fixed at a position (m) in its D-H frame. The inertia follows from the
    /// parallel axis theorem about the common centre of mass. A negative mass removes a point mass.
    pub fn with_point_mass(&self, mass: f64, at: [f64; 3]) -> Self {
        let whole = self.mass + mass;
        let com: [f64; 3] =
            core::array::from_fn(|axis| (self.mass * self.com[axis] + mass * at[axis]) / whole);
        let mut inertia_com = self.inertia_com;
        for (part, centre) in [(self.mass, self.com), (mass, at)] {
            let [x, y, z]: [f64; 3] = core::array::from_fn(|axis| centre[axis] - com[axis]);
            let about = [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y];
            for (element, square) in inertia_com.iter_mut().zip(about) {
                *element += part * square;
            }
        }
        Self { mass: whole, com, inertia_com }
    }
}

/// Friction of one joint, all at the joint, D-H sign.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrictionDescription {
    /// Coulomb level, N m.
    pub coulomb: f64,
    /// Viscous coefficient, N m s/rad.
    pub viscous: f64,
    /// Constant torque that the motor must add at any motion, N m.
    pub offset: f64,
    /// Higher level at rest, if any.
    pub stribeck: Option<Stribeck>,
}

/// Friction level at rest, and its fall to Coulomb's with speed.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stribeck {
    /// Torque at which a resting joint breaks away, N m; at least the Coulomb level.
    pub static_level: f64,
    /// Speed at which the surplus has fallen to 1/e, rad/s.
    pub speed: f64,
}

/// Ideal drive: a current that follows its target with a lag.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DriveDescription {
    /// Torque at the joint per ampere of motor current, N m/A.
    pub torque_per_ampere: f64,
    /// Largest magnitude of the current, A.
    pub current_limit: f64,
    /// Time constant of the first-order lag, s; 0 for none.
    pub lag: f64,
}

/// Encoder; its count 0 lies at the anatomical zero.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderDescription {
    /// Counts per encoder turn; for one at the joint, per joint turn.
    pub counts: f64,
    /// Motor turns per joint turn; 1 for an encoder at the joint.
    pub ratio: f64,
}

/// Motor current sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CurrentSensorDescription {
    /// Standard deviation of the mean of eight samples, that is of a logged 500 Hz sample, A. A single 4 kHz
    /// sample has sqrt(8) times as much; the noise is white and Gaussian.
    pub noise: f64,
    /// Constant error, A.
    pub offset: f64,
    /// Width of a conversion step, A; 0 for none.
    pub step: f64,
    /// Isolated outliers, if any.
    pub outliers: Option<OutlierDescription>,
}

/// Outliers of a current sensor: each lasts for the eight ticks of one logged 500 Hz sample.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct OutlierDescription {
    /// Share of the logged samples, 0..1.
    pub share: f64,
    /// Largest error, A; errors are uniform between minus and plus this value.
    pub current: f64,
}

/// Pushes by the wearer: half-sine torque pulses on random joints at random instants.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PushDescription {
    /// Mean number of pushes per second, from the end of one to the start of the next.
    pub rate: f64,
    /// Largest peak, N m; peaks are uniform in magnitude up to this value, of either sign.
    pub torque: f64,
    /// Mean duration, s; durations are uniform in half to one and a half of this.
    pub duration: f64,
}
