//! Description of a complete drive as plain numbers, without validation.
//!
//! The trigger time of the shunts' converters is the firmware's constant, as in the board's registers.
//!
//! Defaults are those of a board of the ODrive v3.6 class (48 V and more). Facts: 500 uOhm shunts, amplifiers
//! at 40 V/V, 12 bits over 3.3 V, bus divider 19. Further: dead time of 20 clocks at 168 MHz, 3,500 timer
//! clocks per half period. Amplifier settling, rails, noise, diode drop and capacitance are typical values of
//! such parts, not measurements.

use scarab::hal::{BRIDGE_CLOCK_HZ, SHUNT_TRIGGER_CLOCKS};

/// Quarters of a PWM period between the axes of the board.
pub const SHIFT_QUARTERS: u32 = 2;

/// A permanent-magnet synchronous motor, star connected.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MotorDescription {
    /// Resistance of one phase at 20 degrees Celsius, ohm.
    pub resistance: f64,
    /// Inductance along the magnets' axis, H.
    pub inductance_d: f64,
    /// Inductance across the magnets' axis, H.
    pub inductance_q: f64,
    /// Peak of the magnets' flux linkage with a phase, V s.
    pub flux: f64,
    /// Electrical turns per turn of the rotor.
    pub pole_pairs: u32,
    /// Electrical angle where the rotor's angle is 0, rad.
    pub electrical_zero: f64,
    /// Peak of the cogging torque at the rotor, N m.
    pub cogging: f64,
    /// Periods of the cogging torque per turn of the rotor.
    pub cogging_periods: u32,
    /// Thermal resistance from winding to surroundings, K/W.
    pub thermal_resistance: f64,
    /// Thermal time constant of the winding, s.
    pub thermal_time: f64,
    /// Thermistor in the winding, if there is one.
    pub thermistor: Option<ThermistorDescription>,
}

/// Thermistor in a motor, from the board's pin to ground.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ThermistorDescription {
    /// Resistor from the pin to the converter's supply, ohm.
    pub pull_up: f64,
    /// Resistance at 25 degrees Celsius, ohm.
    pub at_25_c: f64,
    /// Constant beta, K.
    pub beta: f64,
    /// Time constant with which its temperature follows the winding's, s.
    pub lag: f64,
}

/// Three half bridges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeDescription {
    /// Dead time: both switches of a leg are off at each edge, s.
    pub dead_time: f64,
    /// Resistance of a switch that is on, ohm.
    pub on_resistance: f64,
    /// Forward voltage of a diode, V.
    pub diode_drop: f64,
    /// Steps of the duty.
    pub duty_steps: f64,
}

impl Default for BridgeDescription {
    fn default() -> Self {
        Self { dead_time: 20.0 / 168e6, on_resistance: 0.002, diode_drop: 0.8, duty_steps: 3500.0 }
    }
}

/// Shunts of the outputs B and C with amplifiers and converter.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShuntDescription {
    /// Shunt resistance, ohm.
    pub resistance: f64,
    /// Amplifier gain, V/V.
    pub gain: f64,
    /// Time constant of the amplifier's first-order settling, s: 1 % after 1.2 us.
    pub settling: f64,
    /// Delay from the middle of the lower zero vector to the converter's hold, s.
    pub delay: f64,
    /// Range of the amplifier's output, V.
    pub rails: [f64; 2],
    /// Code without current, less half of the range.
    pub offset_codes: [f64; 2],
    /// Relative error of shunt and amplifier.
    pub gain_error: [f64; 2],
    /// Standard deviation of amplifier and converter, codes.
    pub noise_codes: f64,
}

impl Default for ShuntDescription {
    fn default() -> Self {
        Self {
            resistance: 500e-6,
            gain: 40.0,
            settling: 0.26e-6,
            delay: Self::delay_of(f64::from(SHUNT_TRIGGER_CLOCKS)),
            rails: [0.15, 3.15],
            offset_codes: [12.0, -9.0],
            gain_error: [0.0; 2],
            noise_codes: 1.0,
        }
    }
}

impl ShuntDescription {
    /// Delay from the middle of the lower zero vector to the hold, s, for a trigger this number of timer
    /// clocks after that middle. The converter samples for three of its clocks of 21 MHz.
    pub fn delay_of(trigger_clocks: f64) -> f64 {
        trigger_clocks / f64::from(BRIDGE_CLOCK_HZ) + 3.0 / 21e6
    }
}

/// Disturbance of an axis' shunts by the edges of other axes' bridges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CouplingDescription {
    /// Added to the measured current for each rising edge in the window, subtracted for each falling one, A.
    pub ampere_per_edge: f64,
    /// Time before the converter's hold in which an edge disturbs, s.
    pub window: f64,
}

impl Default for CouplingDescription {
    /// No disturbance; the window is the time in which an amplifier settles to 1 %.
    fn default() -> Self {
        Self { ampere_per_edge: 0.0, window: 1.2e-6 }
    }
}

/// Quadrature counter of the motor's encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CounterDescription {
    /// Counts per turn of the rotor.
    pub counts: f64,
    /// Counter value at rotor angle 0.
    pub start: u16,
    /// Rotor angle at which the index pulse comes, and at which an absolute encoder reads zero, rad.
    pub index: f64,
    /// Peak of the encoder's error over a turn, rad.
    pub error: f64,
    /// Whether it is also read as an absolute encoder, and has no index.
    pub absolute: bool,
}

/// Absolute encoder at a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointEncoderDescription {
    /// Direction relative to the motor's encoder, 1 or -1.
    pub direction: f64,
    /// Reading at joint angle 0, rad.
    pub zero: f64,
    /// Peak of its error over a turn, rad.
    pub error: f64,
}

/// Error of an AS5047P with a well mounted magnet, rad: 0.8 degrees.
pub const AS5047P_ERROR: f64 = 0.8 * core::f64::consts::PI / 180.0;

/// Electrical connections of an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Wiring {
    /// The motor's phase (0 to 2) on each of the bridge's outputs A, B and C.
    pub phases: [usize; 3],
    /// Output with a broken wire.
    pub open: Option<usize>,
    /// Whether the codes of B and C are exchanged.
    pub shunts_exchanged: bool,
    /// Shunts with a wrong sign, B and C.
    pub shunts_inverted: [bool; 2],
    /// Connection of the encoder.
    pub encoder: EncoderWiring,
}

impl Default for Wiring {
    fn default() -> Self {
        Self {
            phases: [0, 1, 2],
            open: None,
            shunts_exchanged: false,
            shunts_inverted: [false; 2],
            encoder: EncoderWiring::Forward,
        }
    }
}

/// Connection of an encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum EncoderWiring {
    /// Counts up with the rotor's angle.
    #[default]
    Forward,
    /// Counts down with the rotor's angle.
    Reversed,
    /// Does not count.
    Missing,
}

/// Complete description of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisDescription {
    /// Motor.
    pub motor: MotorDescription,
    /// Bridge.
    pub bridge: BridgeDescription,
    /// Current sensing.
    pub shunts: ShuntDescription,
    /// Encoder.
    pub counter: CounterDescription,
    /// Absolute encoder at the joint, if there is one.
    pub joint_encoder: Option<JointEncoderDescription>,
    /// Connectors.
    pub wiring: Wiring,
    /// Rotor turns per joint turn.
    pub ratio: f64,
}

/// Supply of the bridges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyDescription {
    /// Voltage without load, V.
    pub voltage: f64,
    /// Resistance of source and cable, ohm.
    pub resistance: f64,
    /// Capacitance of the bus, F.
    pub capacitance: f64,
    /// Brake resistor, ohm; infinite for none.
    pub brake_resistance: f64,
    /// Bus voltage per voltage at the converter.
    pub divider: f64,
    /// Whether the source takes current, as a battery does; otherwise a diode blocks.
    pub takes_charge: bool,
}

impl Default for SupplyDescription {
    fn default() -> Self {
        Self {
            voltage: 48.0,
            resistance: 0.05,
            capacitance: 1.5e-3,
            brake_resistance: 2.0,
            divider: 19.0,
            takes_charge: false,
        }
    }
}

/// Complete drives of a leg.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CompleteDescription<const N: usize> {
    /// Axes, proximal first.
    pub axes: [AxisDescription; N],
    /// Supply, common to all axes.
    pub supply: SupplyDescription,
    /// Quarters of a PWM period by which each axis begins after the preceding one.
    pub shift_quarters: u32,
    /// Disturbance of each axis by the edges of the others.
    pub coupling: CouplingDescription,
}

impl<const N: usize> CompleteDescription<N> {
    /// Axes half a period apart, as on the board, without coupling.
    pub fn new(axes: [AxisDescription; N], supply: SupplyDescription) -> Self {
        Self { axes, supply, shift_quarters: SHIFT_QUARTERS, coupling: CouplingDescription::default() }
    }
}
