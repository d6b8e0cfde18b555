//! Configuration of an axis, its validation, and the constants derived from it.

use super::{
    BridgeTiming, Calibration, CountScale, CurrentGains, DeadTime, ElectricalAngle, EncoderSetting,
    ModelLimits, Modulator, MotorConstants, SenseScale, ShuntWatch,
};
use crate::checksum::Checksum;
use crate::hal::CURRENT_RATE_HZ;
use crate::real::{min, sqrt};
use crate::units::{Ampere, Hertz, RadianPerSecond, Volt, Weber};

/// Direction of a counter or a joint.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Direction {
    /// Growing.
    #[default]
    Up,
    /// Falling.
    Down,
}

impl Direction {
    /// 1 or -1.
    pub(crate) const fn sign(self) -> i32 {
        match self {
            Self::Up => 1,
            Self::Down => -1,
        }
    }
}

/// Configuration of one axis: board, motor, encoder, limits.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConfiguration {
    /// Scales of the shunt amplifiers and the converter.
    pub sense: SenseScale,
    /// Times that a PWM period has to leave free.
    pub timing: BridgeTiming,
    /// Compensation of the bridge's dead time.
    pub dead_time: DeadTime,
    /// Pole pairs of the motor, 1..=64.
    pub pole_pairs: u8,
    /// Flux linkage of the magnets: torque per ampere of the motor is 3/2 pole pairs times this.
    pub flux: Weber,
    /// Counts per turn of the encoder at the motor, 16..=65,536, four per line.
    pub counts_per_turn: u32,
    /// Whether the encoder has an index pulse.
    pub index: bool,
    /// Whether an absolute encoder at the rotor replaces the index.
    pub absolute: bool,
    /// Direction of the counter while the field turns from A over B to C, as the axis was commissioned.
    pub counter: Direction,
    /// Direction of the counter while the joint flexes.
    pub flexion: Direction,
    /// Bandwidth of the current loop, 50..=2000 Hz.
    pub bandwidth: Hertz,
    /// Whether cross-coupling and back-EMF are fed forward.
    pub feedforward: bool,
    /// Greatest quadrature current the axis requests from the motor.
    pub current_limit: Ampere,
    /// Length of the current vector above which the outputs go off.
    pub overcurrent: Ampere,
    /// Range of bus voltage in which the bridge may switch; at most `SenseScale::greatest_bus`.
    pub bus: [Volt; 2],
    /// Greatest speed of the motor. At this speed a bridge with outputs off must not rectify more than the
    /// greatest bus voltage.
    pub greatest_speed: RadianPerSecond,
}

/// Invalid part of a configuration.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisError {
    /// Amplifiers, converter or divider.
    Sense,
    /// Dead time, settling or conversion leave less than half of the period, or the compensation's
    /// band is invalid.
    Timing,
    /// Counts per turn, pole pairs, or an index beside an absolute encoder.
    Encoder,
    /// Greatest speed: must be positive, below a twelfth of an electrical turn and below 32,767 counts per
    /// tick.
    Speed,
    /// Flux, inductances, resistance or bandwidth.
    Motor,
    /// The current limit must be positive and below the overcurrent bound, the latter within
    /// the amplifiers' range.
    Current,
    /// Bus voltages: the first must be at least 5 V and below the second, the second within
    /// the converter's range.
    Bus,
    /// At the greatest speed the outputs, when off, rectify more than the greatest bus voltage: sqrt(3) pole
    /// pairs speed flux.
    BackEmf,
    /// The calibration was made with another counter direction, other pole pairs or other counts per turn.
    Calibration,
}

impl AxisConfiguration {
    /// Checks everything that needs no calibration.
    ///
    /// # Errors Names the first invalid part.
    pub fn check(&self) -> Result<(), AxisError> {
        let must = |holds: bool, error| if holds { Ok(()) } else { Err(error) };
        must(self.sense.is_sensible(), AxisError::Sense)?;
        self.modulator()?;
        self.scale()?;
        self.greatest_step()?;
        must(!(self.index && self.absolute), AxisError::Encoder)?;
        must((1e-4..=1.0).contains(&self.flux.0), AxisError::Motor)?;
        must((50.0..=2000.0).contains(&self.bandwidth.0), AxisError::Motor)?;
        let currents = self.current_limit.0 > 0.0
            && self.current_limit < self.overcurrent
            && self.overcurrent <= self.sense.range(ZERO_SPREAD_CODES);
        must(currents, AxisError::Current)?;
        let [low, high] = self.bus;
        let buses = low.0 >= 5.0 && low < high && high <= self.sense.greatest_bus();
        must(buses, AxisError::Bus)?;
        let rectified = SQRT_3 * f32::from(self.pole_pairs) * self.greatest_speed.0 * self.flux.0;
        must(rectified <= high.0, AxisError::BackEmf)
    }

    /// Scale from counts to the electrical angle.
    ///
    /// # Errors [`AxisError::Encoder`].
    pub(crate) fn scale(&self) -> Result<CountScale, AxisError> {
        CountScale::new(self.counts_per_turn, self.pole_pairs).ok_or(AxisError::Encoder)
    }

    pub(super) fn modulator(&self) -> Result<Modulator, AxisError> {
        Modulator::new(self.timing, self.dead_time).ok_or(AxisError::Timing)
    }

    /// Greatest plausible step, counts per tick, with margin for rounding.
    pub(super) fn greatest_step(&self) -> Result<i32, AxisError> {
        let turns = self.greatest_speed.0 / (core::f32::consts::TAU * CURRENT_RATE_HZ as f32);
        let counts = turns * self.counts_per_turn as f32;
        let sensible = turns > 0.0 && turns * f32::from(self.pole_pairs) < 1.0 / 12.0 && counts < 32_767.0;
        if sensible { Ok(counts as i32 + 2) } else { Err(AxisError::Speed) }
    }

    /// Bus voltage limits as converter codes.
    pub(super) fn bus_codes(&self) -> [u16; 2] {
        self.bus.map(|voltage| (voltage.0 / self.sense.volt_per_code.0) as u16)
    }
}

const SQRT_3: f32 = 1.732_050_8;

/// Greatest distance of a current-sensor offset from the middle of the converter's range: 6 A on
/// the board's scale.
pub(crate) const ZERO_SPREAD_CODES: u16 = 150;

/// Values that a tick reads and never writes. A host may set the bandwidth between two ticks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Constants {
    pub sense: SenseScale,
    pub(crate) current_offsets: [f32; 2],
    pub(crate) bus_codes: [u16; 2],
    pub(crate) scale: CountScale,
    pub(crate) offset: ElectricalAngle,
    /// Index pulses are checked.
    pub(crate) indexed: bool,
    /// Greatest travel without an index pulse, counts; unlimited without an index.
    pub(crate) unindexed: u32,
    pub(crate) counter_sign: i32,
    pub(crate) flexion_sign: i32,
    /// Sign from the joint's sense to the electrical one.
    pub(crate) current_sign: f32,
    pub(crate) greatest_step: i32,
    pub(crate) gains: CurrentGains,
    pub(crate) modulator: Modulator,
    /// Mean voltage that the dead time takes at the highest bus voltage.
    pub(crate) dead: Volt,
    pub(crate) model: ModelLimits,
    /// Target current of a phase beyond which its shunt code must change, A.
    pub(crate) stuck_change: f32,
    pub current_limit: f32,
    pub(crate) overcurrent_square: f32,
    /// Electrical speed at which a shorted motor carries the overcurrent bound, rad/s.
    pub(crate) brake_speed: f32,
}

impl Constants {
    /// Checksum of gains, limits, current-sensor offsets, directions and the flux offset.
    pub(super) fn checksum(&self) -> Checksum {
        let words = [
            self.offset.units().cast_unsigned(),
            u32::from(self.bus_codes[0]) | u32::from(self.bus_codes[1]) << 16,
            self.greatest_step.cast_unsigned(),
            self.counter_sign.cast_unsigned(),
            self.flexion_sign.cast_unsigned(),
            self.scale.counts_per_turn().cast_unsigned(),
            u32::from(self.indexed),
            self.unindexed,
        ];
        let limits = [
            self.current_offsets[0],
            self.current_offsets[1],
            self.current_sign,
            self.current_limit,
            self.overcurrent_square,
            self.brake_speed,
        ];
        words.into_iter().fold(self.gains.add_to(Checksum::EMPTY), Checksum::word).numbers(limits)
    }

    /// Sets the bandwidth of the current loop, and the change of target current that the watch for stuck
    /// shunts then needs.
    pub(super) fn set_bandwidth(&mut self, bandwidth: Hertz) {
        self.gains.set_bandwidth(bandwidth);
        self.stuck_change = ShuntWatch::target_change(self.dead, self.gains.least_ohm()).0;
    }

    pub(super) fn new(
        configuration: &AxisConfiguration,
        calibration: &Calibration,
    ) -> Result<Self, AxisError> {
        configuration.check()?;
        if calibration.encoder() != EncoderSetting::new(configuration) {
            return Err(AxisError::Calibration);
        }
        let motor = MotorConstants {
            resistance: calibration.resistance(),
            direct_inductance: calibration.direct_inductance(),
            quadrature_inductance: calibration.quadrature_inductance(),
            flux: configuration.flux,
        };
        let gains = CurrentGains::new(&motor, configuration.bandwidth, configuration.feedforward)
            .ok_or(AxisError::Motor)?;
        let scale = configuration.scale()?;
        let dead = configuration.bus[1] * (configuration.timing.dead_time.0 * CURRENT_RATE_HZ as f32);
        // Without a captured index, its absence is no fault. An absolute encoder is checked elsewhere.
        let indexed = configuration.index && calibration.indexed();
        let signs = [configuration.counter.sign(), configuration.flexion.sign()];
        Ok(Self {
            sense: configuration.sense,
            current_offsets: calibration.current_offsets(),
            bus_codes: configuration.bus_codes(),
            scale,
            offset: calibration.offset(),
            indexed,
            unindexed: if indexed { scale.counts_per_turn().unsigned_abs() / 8 * 17 } else { u32::MAX },
            counter_sign: signs[0],
            flexion_sign: signs[1],
            current_sign: (signs[0] * signs[1]) as f32,
            greatest_step: configuration.greatest_step()?,
            gains,
            modulator: configuration.modulator()?,
            model: ModelLimits::new(configuration, &motor, scale),
            dead,
            stuck_change: ShuntWatch::target_change(dead, gains.least_ohm()).0,
            current_limit: configuration.current_limit.0,
            overcurrent_square: configuration.overcurrent.0 * configuration.overcurrent.0,
            brake_speed: brake_speed(&motor, configuration.overcurrent),
        })
    }
}

/// Electrical speed at which a shorted motor carries a current, rad/s: `i R / sqrt(flux^2 - (i L)^2)`.
/// Infinite where the current never reaches that value.
fn brake_speed(motor: &MotorConstants, current: Ampere) -> f32 {
    let reactance = current.0 * min(motor.direct_inductance.0, motor.quadrature_inductance.0);
    let square = motor.flux.0 * motor.flux.0 - reactance * reactance;
    if square > 0.0 { current.0 * motor.resistance.0 / sqrt(square) } else { f32::INFINITY }
}
