//! One axis: what the 24 kHz interrupt calls.
//!
//! ```text
//! count -> turn -> electrical angle -> speed ----------------------------------+
//! shunt codes -> currents -> Park(angle) -> current loop -> Park back (angle + 1.5 T w) -> duties
//! bus code -> voltage limit, duties per volt --^                                  ^
//! ```
//!
//! An [`Axis`] exists only with a [`Calibration`], and a calibration only where every check of the wiring was passed: there is
//! no way to torque around it. The configuration and what follows from it never change; what a tick changes is [`Axis`]'s few state words.
//!
//! **Borders.** A target that is not a number, a voltage that is none, a current beyond the bound release the bridge in the
//! same tick. A saturated amplifier, a bus voltage out of range and an encoder step that no motor makes have one tick of
//! patience, in which the duties of the tick before are kept; the second in a row releases, and so does the third of shunts or bus in
//! every other tick. A single step that was not believed is
//! told with the joint's sample, and three of them in 10 ms are the servo's fault (`safety::Monitor`). A code that stays while its
//! phase is asked for something else, and shunts that do not begin at zero, release as well ([`ShuntWatch`]). Released stays released
//! until [`Axis::clear_fault`]. Two wrong index pulses at one place, or more than two turns without a right one, release, switching or not
//! (`index.rs`): looked at with the joint's sample.
//!
//! Once per joint sample the voltages are held against currents and speed ([`ModelWatch`]): an open phase and a drifted zero
//! release, a frozen counter makes the motor a passive brake ([`Axis::brake`]), since a leg whose encoder is gone should not drop.
//!
//! **A brake has bounds.** A shorted motor carries `w flux / sqrt(R^2 + w^2 L^2)`. Where that is more than the overcurrent bound, above
//! 2.5 rad/s of a joint of the default leg, it is released instead, as an overcurrent; so it is when its current passes the bound.
//!
//! **Known limit.** At a lower speed than [`ModelWatch`] derives, and a current that hardly changes, a counter that stops looks
//! like a rotor that is held: the torque falls with the cosine of what is missed, the rotor comes to rest a quarter of an electrical
//! turn further. The index sees it where counts come back too few. Without an index lost counts are not seen.
//!
//! **Signs.** Inside, positive current makes torque towards growing electrical angle. Outside, counts and current both grow
//! with the joint's flexion: [`AxisConfiguration::flexion`] says which way the counter runs then.
//!
//! Cost: `scripts/count-instructions`.

use super::configuration::{AxisConfiguration, AxisError, Constants};
use super::current_loop::DELAY_PERIODS;
use super::model_watch::Shown;
use super::{Calibration, CurrentLoop, ElectricalAngle, ModelWatch, Rotating, ShuntWatch, SpeedTracker};
use crate::checksum::Checksum;
use crate::hal::{AxisCommand, AxisSample, JointSample};
use crate::real::{abs, clamp, is_finite};
use crate::units::Ampere;

mod asked;
mod index;
mod told;
#[cfg(not(target_os = "none"))]
mod upset;
mod window;

pub use asked::{AxisFault, AxisRequest, Wish};
use index::IndexWatch;
use window::Window;

/// What a reading of shunts or bus that is not believed adds to the doubts; each that is believed takes one away. Beyond so many it is a fault:
/// the third of three in every other tick, or the sixth of one in four.
const DOUBT: u8 = 4;
const MOST_DOUBTS: u8 = 8;

/// One axis; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    constants: Constants,
    current_loop: CurrentLoop,
    speed: SpeedTracker,
    /// Counter at the last plausible sample.
    counter: u16,
    /// Of the counter, to that sample.
    step: i32,
    index: IndexWatch,
    /// Within one turn, in the electrical sense.
    place: i32,
    /// Unwrapped, in the joint's sense.
    counts: i32,
    measured: Rotating<Ampere>,
    window: Window,
    model_watch: ModelWatch,
    /// It has not looked since the bridge began to switch.
    begins: bool,
    shunt_watch: ShuntWatch,
    /// Of the constants as they were made.
    checksum: Checksum,
    /// Joint samples until they are looked at.
    unchecked: u8,
    last: AxisCommand,
    doubtful: bool,
    /// About shunts and bus, see [`DOUBT`].
    doubts: u8,
    /// A count since the last joint sample was not believed.
    disbelieved: bool,
    fault: Option<AxisFault>,
    /// Of place or parameters, whatever was found since.
    lost: bool,
}

impl Axis {
    /// An axis at rest with its bridge released; counts begin at zero. `sample` is the newest there is: since the calibration
    /// the counter may not have moved by more than half of its range.
    ///
    /// # Errors
    /// The part of the configuration that makes no sense.
    pub fn new(
        configuration: &AxisConfiguration,
        calibration: &Calibration,
        sample: &AxisSample,
    ) -> Result<Self, AxisError> {
        let constants = Constants::new(configuration, calibration)?;
        let place = calibration.place_of(&constants.scale, configuration.counter, sample.encoder_count);
        Ok(Self {
            constants,
            current_loop: CurrentLoop::default(),
            speed: SpeedTracker::at(constants.scale.angle(place).plus(constants.offset)),
            counter: sample.encoder_count,
            step: 0,
            index: IndexWatch::at(0),
            place,
            counts: 0,
            measured: Rotating::default(),
            window: Window::EMPTY,
            model_watch: ModelWatch::EMPTY,
            begins: true,
            shunt_watch: ShuntWatch::EMPTY,
            checksum: constants.checksum(),
            unchecked: 0,
            last: AxisCommand::RELEASED,
            doubtful: false,
            doubts: 0,
            disbelieved: false,
            fault: None,
            lost: false,
        })
    }

    /// States that the joint now stands at `counts`.
    pub fn set_counts(&mut self, counts: i32) {
        self.index.shift(counts.wrapping_sub(self.counts));
        self.counts = counts;
        self.window = Window::EMPTY;
    }

    /// One PWM period: what the bridge does in the next one.
    pub fn tick(&mut self, sample: &AxisSample, request: AxisRequest) -> AxisCommand {
        self.act(sample, request.into())
    }

    /// One PWM period in which the motor is a passive brake, below the overcurrent bound.
    pub fn brake(&mut self, sample: &AxisSample) -> AxisCommand {
        self.act(sample, Wish::Brake)
    }

    /// Either; with a fault released, but for a counter that is frozen or lost its place, with which a motor that is to do anything
    /// brakes.
    #[inline(always)]
    pub fn act(&mut self, sample: &AxisSample, wish: Wish) -> AxisCommand {
        let wish = match (wish, self.fault) {
            (Wish::Released, _) => Wish::Released,
            (wish, None) => wish,
            (_, Some(AxisFault::EncoderFrozen | AxisFault::Encoder)) => Wish::Brake,
            _ => Wish::Released,
        };
        // Field by field: a copy of the whole would carry the bytes between the fields, one by one.
        let AxisCommand { enabled, duty } = match self.step(sample, wish) {
            Ok(command) => command,
            Err(fault) => {
                self.found(fault);
                self.current_loop.reset();
                AxisCommand::RELEASED
            }
        };
        self.last = AxisCommand { enabled, duty };
        AxisCommand { enabled, duty }
    }

    #[cold]
    #[inline(never)]
    fn found(&mut self, fault: AxisFault) {
        self.fault = Some(fault);
        // A counter that froze may show itself as something else first.
        let doubted =
            self.last.enabled && !self.begins && self.model_watch.doubts(&self.constants.model, self.place);
        self.lost |=
            doubted || matches!(fault, AxisFault::Encoder | AxisFault::EncoderFrozen | AxisFault::Parameters);
    }

    #[inline(always)]
    fn step(&mut self, sample: &AxisSample, wish: Wish) -> Result<AxisCommand, AxisFault> {
        let constants = &self.constants;
        let step = i32::from(sample.encoder_count.wrapping_sub(self.counter).cast_signed());
        // The way back from a wrong reading that was just small enough to be believed is no jump.
        let plausible =
            step.abs() <= constants.greatest_step || (step + self.step).abs() <= constants.greatest_step;
        if plausible {
            self.counter = sample.encoder_count;
            self.step = step;
            self.counts = self.counts.wrapping_add(constants.flexion_sign * step);
            self.place = constants.scale.moved(self.place, constants.counter_sign * step);
            if let Some(at) = sample.index_count {
                let since =
                    constants.counter_sign * i32::from(sample.encoder_count.wrapping_sub(at).cast_signed());
                self.index.came(self.place - since, step);
            }
        }
        let angle = self.angle();
        self.speed.track(angle);
        // Both rotations of a tick side by side: they share their polynomials' constants.
        let [rotor, acting] =
            [angle, self.speed.ahead(angle, DELAY_PERIODS)].map(|angle| angle.rotation(constants.sine));
        let currents = constants.sense.currents(sample.shunt_codes, constants.zeros);
        let switching = wish != Wish::Released;
        self.measured = match currents {
            Some(currents) => currents.to_rotating(rotor),
            None if switching => self.measured,
            None => Rotating::default(),
        };
        self.window.push(self.counts, self.measured.q.0 * constants.current_sign);

        let [low, high] = constants.bus_codes;
        // A motor that brakes needs neither place nor bus.
        let doubt = if !plausible && wish != Wish::Brake {
            Some(AxisFault::Encoder)
        } else if switching && currents.is_none() {
            Some(AxisFault::CurrentSense)
        } else if switching && wish != Wish::Brake && !(low..=high).contains(&sample.bus_code) {
            Some(AxisFault::BusVoltage)
        } else {
            None
        };
        if let Some(fault) = doubt {
            self.disbelieved |= !plausible;
            // Who is about to switch has no command to keep until the next reading.
            self.doubts = self.doubts.saturating_add(u8::from(plausible) * DOUBT);
            if self.doubtful || self.doubts > MOST_DOUBTS || switching && !self.last.enabled {
                return Err(fault);
            }
            self.doubtful = true;
            return Ok(if switching { self.last } else { AxisCommand::RELEASED });
        }
        self.doubtful = false;
        self.doubts = self.doubts.saturating_sub(1);
        if !switching {
            if let Some(currents) = currents {
                self.shunt_watch.released(currents);
            }
            self.current_loop.reset();
            return Ok(AxisCommand::RELEASED);
        }
        let (d, q) = (self.measured.d.0, self.measured.q.0);
        if d * d + q * q > constants.overcurrent_square {
            return Err(AxisFault::Overcurrent);
        }
        let Wish::Follow(wanted) = wish else {
            if abs(self.speed.rad_per_s()) > constants.brake_speed {
                return Err(AxisFault::Overcurrent);
            }
            self.current_loop.reset();
            return Ok(AxisCommand::BRAKE);
        };
        if !is_finite(wanted.0) {
            return Err(AxisFault::NotANumber);
        }
        if !self.last.enabled {
            self.begins = true;
            if !self.shunt_watch.begins_at_zero() {
                return Err(AxisFault::CurrentZero);
            }
        }
        let bus = constants.sense.bus(sample.bus_code);
        let limit = constants.current_limit;
        let target = Ampere(clamp(wanted.0 * constants.current_sign, -limit, limit));
        let voltage = self.current_loop.voltage(
            &constants.gains,
            target,
            self.measured,
            self.speed.rad_per_s(),
            constants.modulator.voltage_limit(bus),
        );
        if !is_finite(voltage.d.0 + voltage.q.0) {
            return Err(AxisFault::NotANumber);
        }
        let target = Rotating { d: Ampere::ZERO, q: target }.to_stationary(acting);
        if self.shunt_watch.is_stuck(sample.shunt_codes, target, constants.stuck_asked) {
            return Err(AxisFault::StuckConversion);
        }
        let duty = constants.modulator.duties(voltage.to_stationary(acting), 1.0 / bus.0, target);
        // They are within 0..1 or no numbers.
        if !(duty[0] + duty[1] + duty[2] >= 0.0) {
            return Err(AxisFault::NotANumber);
        }
        Ok(AxisCommand { enabled: true, duty })
    }

    /// Of the place.
    #[inline(always)]
    fn angle(&self) -> ElectricalAngle {
        self.constants.scale.angle(self.place).plus(self.constants.offset)
    }

    /// Whether index pulses say that the place is lost.
    fn is_off_the_index(&mut self) -> bool {
        let Constants { indexed, unindexed, scale, .. } = &self.constants;
        *indexed && self.index.is_lost(self.counts, scale, *unindexed)
    }

    /// Means of count and current since the last call, in the joint's sense; both of the same ticks, so that they belong to one
    /// instant, 2.5 ticks (104 us) before the last of six. Without a tick since then the newest values.
    ///
    /// Holds the voltages against currents and speed meanwhile, once per call: what is found is a fault from here on, and acts from
    /// the next tick on.
    pub fn joint_sample(&mut self) -> JointSample {
        // Every 64 ms.
        self.unchecked = self.unchecked.wrapping_add(1);
        if self.unchecked == 0 && self.constants.checksum() != self.checksum {
            self.found(AxisFault::Parameters);
        }
        // A motor that brakes needs no place.
        if self.is_off_the_index() && self.fault.is_none() && self.last != AxisCommand::BRAKE {
            self.found(AxisFault::Encoder);
        }
        // A motor that brakes is given no voltage that could be held against anything.
        let follows = self.last.enabled && self.last != AxisCommand::BRAKE;
        if follows && self.fault.is_none() && self.window.ticks > 0 {
            if core::mem::take(&mut self.begins) {
                self.model_watch = ModelWatch::EMPTY;
            }
            let angle = self.angle();
            let shown = Shown {
                current_loop: &self.current_loop,
                current: self.measured,
                speed_rad_per_s: self.speed.rad_per_s(),
                place: self.place,
                angle,
                sine: self.constants.sine,
            };
            if let Some(fault) = self.model_watch.look(&self.constants.model, &shown) {
                if fault == AxisFault::EncoderFrozen {
                    // Whether a brake may begin is a matter of the speed that was not counted.
                    self.speed =
                        SpeedTracker::turning(angle, self.model_watch.uncounted(&self.constants.model));
                }
                self.found(fault);
            }
        }
        let sample = self.window.mean().unwrap_or(JointSample {
            encoder_counts: self.counts,
            current: self.measured.q * self.constants.current_sign,
            doubtful: false,
        });
        self.window = Window::EMPTY;
        JointSample { doubtful: core::mem::take(&mut self.disbelieved), ..sample }
    }
}

#[cfg(test)]
mod tests;
