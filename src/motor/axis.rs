//! One axis: the code that the 24 kHz interrupt calls.
//!
//! ```text
//! count -> turn -> electrical angle -> speed ----------------------------------+
//! shunt codes -> currents -> Park(angle) -> current loop -> Park back (angle + 1.5 T w) -> duties
//! bus code -> voltage limit, duties per volt --^                                  ^
//! ```
//!
//! An [`Axis`] requires a [`Calibration`], and a calibration exists only after every wiring check has passed.
//! So no torque is possible without these checks. A tick changes only [`Axis`]'s few state words, and of the
//! constants a host may set the current loop's bandwidth.
//!
//! **Limits.** These conditions turn the outputs off:
//!
//! | condition | reaction |
//! | --- | --- |
//! | target or voltage not finite, current beyond the bound | same tick |
//! | shunt amplifier saturated, bus voltage out of range | second in a row, or third of every other tick |
//! | encoder step that no motor makes | second in a row |
//! | shunt code constant while its phase's target changes ([`ShuntWatch`]) | fourth tick |
//! | current offset wrong at enabling ([`ShuntWatch`]) | not enabled |
//! | two wrong index pulses at one position, or none for over two turns (`index.rs`) | next check |
//!
//! During one tick of tolerance the previous tick's duties are repeated. A single implausible encoder step
//! marks the joint sample as doubtful; three within 10 ms are a fault of the servo (`safety::Monitor`). The
//! index is also checked while the outputs are off. Outputs stay off until [`Axis::clear_fault`]; with a lost
//! rotor position the motor brakes instead, unless the outputs are requested off.
//!
//! Once per servo period ([`Axis::check`]) voltages are compared with currents and speed ([`ModelWatch`]). An
//! open phase and a drifted current-sensor offset turn the outputs off. A frozen counter turns the motor into
//! a passive brake (`BridgeRequest::Brake`), so that a leg does not drop when its encoder fails.
//!
//! **First motion.** After a check at standstill the rotor angle is the stored one. Until the back-EMF has
//! agreed, current and speed are limited, and a contradiction counts as a lost rotor position
//! (`first_motion.rs`). Afterwards the current limit rises within 0.75 s.
//!
//! **Limit of braking.** A shorted motor carries `w flux / sqrt(R^2 + w^2 L^2)`. The outputs go off with an
//! overcurrent fault where that exceeds the overcurrent bound, or where the measured current does. On the
//! default leg the first happens above 2.5 rad/s of the joint.
//!
//! **Known limit.** Below the speed that [`ModelWatch`] derives, a counter that stops looks like a held
//! rotor. The torque falls with the cosine of the missed angle, and the rotor comes to rest a quarter of an
//! electrical turn further. The index shows it where too few counts are left between pulses. Without an
//! index, lost counts are not detected.
//!
//! **Signs.** Inside, positive current makes torque towards growing electrical angle. Outside, counts
//! and current both grow with the joint's flexion: [`AxisConfiguration::flexion`] states the
//! counter's direction then.
//!
//! Cost: docs/results/motor.md, instructions.

use super::configuration::{AxisConfiguration, AxisError, Constants};
use super::current_loop::DELAY_PERIODS;
use super::model_watch::Shown;
use super::{
    Calibration, CurrentLoop, ElectricalAngle, ModelWatch, Rotating, Rotation, ShuntWatch, SpeedTracker,
    Stationary,
};
use crate::checksum::Checksum;
use crate::hal::{AxisCommand, AxisSample, JointSample, SERVO_RATE_HZ};
use crate::real::{abs, clamp, is_finite, min};
use crate::units::{Ampere, Hertz};

mod first_motion;
mod index;

use first_motion::{FirstMotion, SPEED_SHARE};
use index::IndexWatch;

/// Weight of a rejected shunt or bus reading. Each accepted reading subtracts one. A sum above
/// [`MOST_DOUBTS`] is a fault: the third rejection of every other tick, or the sixth of one in four.
const DOUBT: u8 = 4;
const MOST_DOUBTS: u8 = 8;
/// Rise of the current limit per check once the rotor angle is proven, as share of the limit: 0.75 s. A step
/// would throw the joint against the hand that pushed it.
const RISE_PER_CHECK: f32 = 1.0 / SERVO_RATE_HZ as f32;

/// Request to an axis for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisRequest {
    /// Whether the bridge switches.
    pub enabled: bool,
    /// Quadrature current in the joint's sense, clamped to the configuration's limit.
    pub current: Ampere,
}

impl AxisRequest {
    /// Outputs off.
    pub const OFF: Self = Self { enabled: false, current: Ampere::ZERO };
}

/// Why an axis turned its outputs off or brakes by itself.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum AxisFault {
    /// A shunt amplifier at its rail: two ticks in a row, or too many within few ticks.
    CurrentSense,
    /// Current vector longer than the bound.
    Overcurrent,
    /// Bus voltage out of range, as often as in [`Self::CurrentSense`].
    BusVoltage,
    /// Two implausible encoder steps in a row, two index pulses at one wrong position, or none at the right
    /// one. The rotor position is lost and requires a new calibration.
    Encoder,
    /// Target, voltage or duty not finite.
    NotANumber,
    /// The counter is constant while the motor turns. The motor brakes until the fault is cleared; the rotor
    /// position is lost.
    EncoderFrozen,
    /// Voltage and current disagree: a phase does not conduct.
    OpenPhase,
    /// The current-sensor offsets drifted.
    CurrentOffset,
    /// A shunt code does not change while its phase's target current does.
    StuckConversion,
    /// Checksum of gains and limits changed.
    Parameters,
}

/// Requested state of the bridge for one tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum BridgeRequest {
    /// Outputs off.
    Off,
    /// Follow a quadrature current in the joint's sense.
    Follow(Ampere),
    /// Low sides on: a passive brake.
    Brake,
}

impl From<AxisRequest> for BridgeRequest {
    fn from(request: AxisRequest) -> Self {
        if request.enabled { Self::Follow(request.current) } else { Self::Off }
    }
}

/// One axis; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    constants: Constants,
    current_loop: CurrentLoop,
    speed: SpeedTracker,
    /// Counter at the last plausible sample.
    counter: u16,
    /// Change of the counter at that sample.
    step: i32,
    index: IndexWatch,
    /// Rotor position within one turn, electrical sense, counts.
    position: i32,
    /// Unwrapped counts, joint's sense.
    counts: i32,
    measured: Rotating<Ampere>,
    window: Window,
    model_watch: ModelWatch,
    /// The model watch has not run since the bridge began to switch.
    begins: bool,
    shunt_watch: ShuntWatch,
    first_motion: FirstMotion,
    /// Greatest quadrature current, A; from the constants, in every check.
    current_limit: f32,
    /// Checksum of the constants at construction, or after the last change of the bandwidth.
    checksum: Checksum,
    /// Calls of [`Axis::check_constants`] since that checksum was compared; wraps at 256.
    unchecked: u8,
    last: AxisCommand,
    doubtful: bool,
    /// Weighted count of rejected shunt and bus readings, see [`DOUBT`].
    doubts: u8,
    /// An encoder step since the last joint sample was implausible.
    rejected_step: bool,
    fault: Option<AxisFault>,
    /// Rotor position or parameters are lost; [`Self::clear_fault`] has no effect.
    lost: bool,
}

impl Axis {
    /// Creates an axis at rest with outputs off; counts begin at zero. `sample` is the newest one. Since the
    /// calibration the counter may not have moved by more than half of its range.
    ///
    /// # Errors Names the invalid part of the configuration.
    pub fn new(
        configuration: &AxisConfiguration,
        calibration: &Calibration,
        sample: &AxisSample,
    ) -> Result<Self, AxisError> {
        let constants = Constants::new(configuration, calibration)?;
        let position = calibration.position_of(&constants.scale, configuration.counter, sample.encoder_count);
        let first_motion = if calibration.is_proven() {
            FirstMotion::PROVEN
        } else {
            FirstMotion::before(&constants.scale, 0)
        };
        Ok(Self {
            current_limit: constants.current_limit * first_motion.current_share(),
            first_motion,
            constants,
            current_loop: CurrentLoop::default(),
            speed: SpeedTracker::at(constants.scale.angle(position).plus(constants.offset)),
            counter: sample.encoder_count,
            step: 0,
            index: IndexWatch::at(0),
            position,
            counts: 0,
            measured: Rotating::default(),
            window: Window::EMPTY,
            model_watch: ModelWatch::EMPTY,
            begins: true,
            shunt_watch: ShuntWatch::EMPTY,
            checksum: constants.checksum(),
            unchecked: 0,
            last: AxisCommand::OFF,
            doubtful: false,
            doubts: 0,
            rejected_step: false,
            fault: None,
            lost: false,
        })
    }

    /// Sets the joint's count at its present position.
    pub fn set_counts(&mut self, counts: i32) {
        self.index.shift(counts.wrapping_sub(self.counts));
        self.counts = counts;
        if self.first_motion.is_limited() {
            self.first_motion = FirstMotion::before(&self.constants.scale, counts);
        }
        self.window = Window::EMPTY;
    }

    /// Resumes after a time without ticks, in which the outputs were off while the counter ran on. The
    /// present count is accepted with any step.
    ///
    /// Set `long` where the counter may have wrapped. The position within a turn then stays valid only where
    /// the counter's range is a multiple of the turn, as 65,536 of 8,192; otherwise it is lost. Counts may be
    /// off by multiples of the range; the caller has to correct them.
    pub(crate) fn resume(&mut self, sample: &AxisSample, long: bool) {
        let constants = &self.constants;
        let step = i32::from(sample.encoder_count.wrapping_sub(self.counter).cast_signed());
        self.position = constants.scale.within_turn(self.position + constants.counter_sign * step);
        self.counts = self.counts.wrapping_add(constants.flexion_sign * step);
        (self.counter, self.step) = (sample.encoder_count, 0);
        self.index = IndexWatch::at(self.counts);
        self.speed = SpeedTracker::at(self.angle());
        self.window = Window::EMPTY;
        (self.doubtful, self.doubts, self.rejected_step) = (false, 0, false);
        if long && constants.scale.within_turn(1 << 16) != 0 {
            self.found(AxisFault::Encoder);
        }
    }

    /// Sets the bandwidth of the current loop. It may follow a current: voltage and integrals stay.
    #[cold]
    #[inline(never)]
    pub(crate) fn set_bandwidth(&mut self, bandwidth: Hertz) {
        // A wrong checksum stays wrong.
        let is_sound = self.constants.checksum() == self.checksum;
        self.constants.set_bandwidth(bandwidth);
        if is_sound {
            self.checksum = self.constants.checksum();
        }
    }

    /// Marks the rotor position as lost, because an absolute encoder contradicts it: the motor brakes.
    pub(crate) fn lose_position(&mut self) {
        self.found(AxisFault::Encoder);
    }

    /// Currents of the last tick, in the electrical sense.
    pub(crate) fn measured(&self) -> Rotating<Ampere> {
        self.measured
    }

    /// The fault that stopped the axis, if any.
    pub fn fault(&self) -> Option<AxisFault> {
        self.fault
    }

    /// Whether the rotor angle was measured or has agreed with the back-EMF. Until then current and speed are
    /// limited.
    #[inline(always)]
    pub fn is_proven(&self) -> bool {
        !self.first_motion.is_limited()
    }

    /// Share of the current limit that is permitted now, 0..=1.
    pub(crate) fn current_share(&self) -> f32 {
        self.current_limit / self.constants.current_limit
    }

    /// Rotor position or parameters are lost and require a new calibration.
    pub(crate) fn is_lost(&self) -> bool {
        self.lost
    }

    /// Clears a fault, so that a request may enable again. Returns `false` where the axis is lost.
    pub fn clear_fault(&mut self) -> bool {
        if !self.lost {
            self.fault = None;
        }
        !self.lost
    }

    /// Runs one PWM period and returns the bridge's command for the next one.
    pub fn tick(&mut self, sample: &AxisSample, request: AxisRequest) -> AxisCommand {
        self.act(sample, request.into())
    }

    /// Runs one PWM period of either kind. During a fault the outputs are off. With a frozen counter or a
    /// lost rotor position, however, the motor brakes unless the outputs are requested off. Not inlined: the
    /// caller's registers would be spilled in the middle of it.
    #[inline(never)]
    pub(crate) fn act(&mut self, sample: &AxisSample, request: BridgeRequest) -> AxisCommand {
        let request = match (request, self.fault) {
            (BridgeRequest::Off, _) => BridgeRequest::Off,
            (request, None) => request,
            (_, Some(AxisFault::EncoderFrozen | AxisFault::Encoder)) => BridgeRequest::Brake,
            _ => BridgeRequest::Off,
        };
        if let Err(fault) = self.step(sample, request) {
            self.found(fault);
            self.current_loop.reset();
            self.last = AxisCommand::OFF;
        }
        // Field by field: copying the whole struct would also carry the padding, byte by byte.
        let AxisCommand { enabled, duty } = self.last;
        AxisCommand { enabled, duty }
    }

    #[cold]
    #[inline(never)]
    fn found(&mut self, fault: AxisFault) {
        self.fault = Some(fault);
        // A frozen counter may first show as another fault.
        let doubted = self.last.enabled
            && !self.begins
            && self.model_watch.doubts(&self.constants.model, self.position);
        self.lost |=
            doubted || matches!(fault, AxisFault::Encoder | AxisFault::EncoderFrozen | AxisFault::Parameters);
    }

    /// Runs one PWM period; its command becomes `self.last`.
    #[inline(always)]
    fn step(&mut self, sample: &AxisSample, request: BridgeRequest) -> Result<(), AxisFault> {
        let plausible = self.count(sample);
        let constants = &self.constants;
        let angle = self.angle();
        self.speed.track(angle);
        let rotor = angle.rotation();
        let acting = self.speed.ahead(rotor, DELAY_PERIODS);
        let currents = constants.sense.currents(sample.shunt_codes, constants.current_offsets);
        let switching = request != BridgeRequest::Off;
        self.measured = match currents {
            Some(currents) => currents.to_rotating(rotor),
            None if switching => self.measured,
            None => Rotating::default(),
        };
        self.window.push(self.counts, self.measured.q.0 * constants.current_sign);

        let [low, high] = constants.bus_codes;
        // Braking needs neither rotor position nor bus voltage.
        let doubt = if !plausible && request != BridgeRequest::Brake {
            Some(AxisFault::Encoder)
        } else if switching && currents.is_none() {
            Some(AxisFault::CurrentSense)
        } else if switching && request != BridgeRequest::Brake && !(low..=high).contains(&sample.bus_code) {
            Some(AxisFault::BusVoltage)
        } else {
            None
        };
        if let Some(fault) = doubt {
            self.rejected_step |= !plausible;
            // When switching starts there is no previous command to repeat.
            self.doubts = self.doubts.saturating_add(u8::from(plausible) * DOUBT);
            if self.doubtful || self.doubts > MOST_DOUBTS || switching && !self.last.enabled {
                return Err(fault);
            }
            self.doubtful = true;
            if !switching {
                self.last = AxisCommand::OFF;
            }
            return Ok(());
        }
        self.doubtful = false;
        self.doubts = self.doubts.saturating_sub(1);
        if !switching {
            if let Some(currents) = currents {
                self.shunt_watch.disabled(currents);
            }
            self.current_loop.reset();
            self.last = AxisCommand::OFF;
            return Ok(());
        }
        if self.square_a2() > constants.overcurrent_square {
            return Err(AxisFault::Overcurrent);
        }
        let BridgeRequest::Follow(wanted) = request else {
            if abs(self.speed.rad_per_s()) > constants.brake_speed {
                return Err(AxisFault::Overcurrent);
            }
            self.current_loop.reset();
            self.last = AxisCommand::BRAKE;
            return Ok(());
        };
        self.follow(sample, wanted, acting)
    }

    /// Counts the encoder's step since the last sample. Returns whether a motor can have made it.
    #[inline(always)]
    fn count(&mut self, sample: &AxisSample) -> bool {
        let constants = &self.constants;
        let step = i32::from(sample.encoder_count.wrapping_sub(self.counter).cast_signed());
        // A return from a wrong reading just small enough to be accepted is no jump.
        let plausible =
            step.abs() <= constants.greatest_step || (step + self.step).abs() <= constants.greatest_step;
        if plausible {
            self.counter = sample.encoder_count;
            self.step = step;
            self.counts = self.counts.wrapping_add(constants.flexion_sign * step);
            self.position = constants.scale.moved(self.position, constants.counter_sign * step);
            if let Some(at) = sample.index_count {
                let since =
                    constants.counter_sign * i32::from(sample.encoder_count.wrapping_sub(at).cast_signed());
                self.index.on_pulse(self.position - since, step);
            }
        }
        plausible
    }

    /// Follows a quadrature current in the joint's sense with the voltage that acts at `acting`.
    #[inline(always)]
    fn follow(&mut self, sample: &AxisSample, wanted: Ampere, acting: Rotation) -> Result<(), AxisFault> {
        let constants = &self.constants;
        if !is_finite(wanted.0) {
            return Err(AxisFault::NotANumber);
        }
        if !self.last.enabled {
            self.begins = true;
            if !self.shunt_watch.begins_at_zero() {
                return Err(AxisFault::CurrentOffset);
            }
        }
        let bus = constants.sense.bus(sample.bus_code);
        let limit = self.current_limit;
        let quadrature = Ampere(clamp(wanted.0 * constants.current_sign, -limit, limit));
        let voltage = self.current_loop.voltage(
            &constants.gains,
            Rotating { d: Ampere::ZERO, q: quadrature },
            self.measured,
            self.speed.rad_per_s(),
            constants.modulator.voltage_limit(bus),
        );
        if !is_finite(voltage.d.0 + voltage.q.0) {
            return Err(AxisFault::NotANumber);
        }
        let target = Stationary::from_quadrature(quadrature, acting);
        if self.shunt_watch.is_stuck(sample.shunt_codes, target, constants.stuck_change) {
            return Err(AxisFault::StuckConversion);
        }
        let duty = constants.modulator.duties(voltage.to_stationary(acting), 1.0 / bus.0, target);
        // Duties are within 0..1 or NaN.
        if !(duty[0] + duty[1] + duty[2] >= 0.0) {
            return Err(AxisFault::NotANumber);
        }
        self.last = AxisCommand { enabled: true, duty };
        Ok(())
    }

    /// Whether the index pulses show a lost rotor position.
    fn is_off_the_index(&mut self) -> bool {
        let Constants { indexed, unindexed, scale, .. } = &self.constants;
        *indexed && self.index.is_lost(self.counts, scale, *unindexed)
    }

    /// Square of the current vector at the last tick, A^2.
    #[inline(always)]
    pub(crate) const fn square_a2(&self) -> f32 {
        let (d, q) = (self.measured.d.0, self.measured.q.0);
        d * d + q * q
    }

    /// Electrical angle of the current rotor position.
    #[inline(always)]
    pub(crate) fn angle(&self) -> ElectricalAngle {
        self.constants.scale.angle(self.position).plus(self.constants.offset)
    }

    /// Electrical power into the motor at the last tick, W; negative where the motor returns energy to the
    /// bus. Valid while the bridge follows a current or is off, not while it brakes.
    #[inline(always)]
    pub(crate) fn power_w(&self) -> f32 {
        self.current_loop.power_w(&self.constants.gains, self.measured, self.speed.rad_per_s())
    }

    /// Takes the means of count and current since the last call, in the joint's sense. Both cover the same
    /// ticks and so belong to one instant, 2.5 ticks (104 us) before the last of six. Without a tick since
    /// then, returns the newest values.
    pub fn joint_sample(&mut self) -> JointSample {
        let sample = self.window.mean().unwrap_or(JointSample {
            encoder_counts: self.counts,
            current: self.measured.q * self.constants.current_sign,
            doubtful: false,
        });
        self.window = Window::EMPTY;
        JointSample { doubtful: core::mem::take(&mut self.rejected_step), ..sample }
    }

    /// Compares the constants with their checksum in every 256th call. Called once per servo period, so every
    /// 64 ms. A fault found here acts from the next tick on.
    pub fn check_constants(&mut self) {
        self.unchecked = self.unchecked.wrapping_add(1);
        if self.unchecked == 0 && self.constants.checksum() != self.checksum {
            self.found(AxisFault::Parameters);
        }
    }

    /// Compares voltages with currents and speed (`ModelWatch`), and index pulses with the counter. Called
    /// once per servo period, halfway between two joint samples. A fault found here acts from the next tick
    /// on.
    pub fn check(&mut self) {
        let most = self.constants.current_limit * self.first_motion.current_share();
        self.current_limit = min(self.current_limit + RISE_PER_CHECK * most, most);
        // Braking needs no rotor position.
        if self.is_off_the_index() && self.fault.is_none() && self.last != AxisCommand::BRAKE {
            self.found(AxisFault::Encoder);
        }
        // While braking, no commanded voltage exists to compare with.
        let follows = self.last.enabled && self.last != AxisCommand::BRAKE;
        if follows && self.fault.is_none() && self.window.ticks > 0 {
            let angle = self.angle();
            if core::mem::take(&mut self.begins) {
                self.model_watch = ModelWatch::EMPTY;
                if self.first_motion.is_limited() {
                    self.first_motion = FirstMotion::before(&self.constants.scale, self.counts);
                }
            }
            let shown = Shown {
                current_loop: &self.current_loop,
                current: self.measured,
                speed_rad_per_s: self.speed.rad_per_s(),
                position: self.position,
                angle,
            };
            let mut found = self.model_watch.check(&self.constants.model, &shown);
            if self.first_motion.is_limited() {
                let model = &self.constants.model;
                let watch = &self.model_watch;
                let volts = [model.back_emf(&shown), watch.residual(), watch.tolerance()];
                self.first_motion.advance(&self.constants.scale, self.counts, volts);
                let greatest = SPEED_SHARE * model.frozen_speed(Ampere(self.current_limit));
                // A wrong angle looks like an open phase.
                if found == Some(AxisFault::OpenPhase)
                    || found.is_none() && abs(shown.speed_rad_per_s) > greatest
                {
                    found = Some(AxisFault::Encoder);
                }
            }
            if let Some(fault) = found {
                if fault == AxisFault::EncoderFrozen {
                    // The brake's speed limit needs the speed that the frozen counter did not show.
                    self.speed =
                        SpeedTracker::turning(angle, self.model_watch.uncounted(&self.constants.model));
                }
                self.found(fault);
            }
        }
    }
}

/// Sums since the last joint sample: means of count and current cover the same ticks, so belong to one
/// instant.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Window {
    first: i32,
    /// Sum of counts minus `first`.
    counts: i32,
    current_a: f32,
    ticks: i32,
}

impl Window {
    const EMPTY: Self = Self { first: 0, counts: 0, current_a: 0.0, ticks: 0 };
    /// Longest window, ticks. If no one reads the sample, averaging restarts.
    const MOST: i32 = 48;

    #[inline(always)]
    fn push(&mut self, counts: i32, current_a: f32) {
        if self.ticks == 0 || self.ticks == Self::MOST {
            *self = Self { first: counts, ..Self::EMPTY };
        }
        self.counts += counts.wrapping_sub(self.first);
        self.current_a += current_a;
        self.ticks += 1;
    }

    fn mean(&self) -> Option<JointSample> {
        (self.ticks > 0).then(|| JointSample {
            encoder_counts: self.first.wrapping_add(self.counts.div_euclid(self.ticks)),
            current: Ampere(self.current_a / self.ticks as f32),
            doubtful: false,
        })
    }
}

/// Fault injection, host only: bit flips that the checksum must find (row M2 of docs/safety.md).
#[cfg(not(target_os = "none"))]
impl Axis {
    /// Number of values in which a bit can be flipped.
    pub const NUMBERS: u8 = 6;

    /// Flips one bit (of 32, from the lowest) of a constant. In order: current limit, square of the
    /// overcurrent bound, both current-sensor offsets, sign of the current, proportional gain of
    /// the current loop.
    pub fn flip_bit(&mut self, number: u8, bit: u8) {
        let constants = &mut self.constants;
        let [offset_b, offset_c] = &mut constants.current_offsets;
        let flipped = match number {
            0 => &mut constants.current_limit,
            1 => &mut constants.overcurrent_square,
            2 => offset_b,
            3 => offset_c,
            4 => &mut constants.current_sign,
            _ => constants.gains.proportional_mut(),
        };
        *flipped = f32::from_bits(flipped.to_bits() ^ 1 << (bit % 32));
    }

    /// Makes the modulator's constants NaN, which no input can do (row N1).
    pub const fn invalidate_modulation(&mut self) {
        self.constants.modulator.invalidate();
    }
}

#[cfg(test)]
mod tests;
