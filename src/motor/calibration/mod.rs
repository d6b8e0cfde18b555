//! Calibrates an unknown motor on unknown wiring: yields a [`Calibration`], or the reason for refusing one.
//!
//! ```text
//! current-sensor offsets (bridge off) -> resistance at C, B, A: wiring of phases and shunts
//!    -> inductances at A
//!    -> scan, the field turns slowly forwards and back: counts, direction, pole pairs, index
//!    -> refinement, the rotor turns under load with both signs of the direct current: offset, flux, friction
//!    -> Calibration
//! ```
//!
//! After a power-up with stored values, and once the joint was turned by hand over its index
//! ([`IndexSearch`]), the rotor's angle is known and nothing has to turn:
//!
//! ```text
//! current-sensor offsets (bridge off) -> resistance along the rotor's flux -> inductances there
//!    -> Calibration with the stored offset, unproven until the motor has turned
//! ```
//!
//! A current along the flux makes no torque. A rotor that moves all the same is refused, and the next
//! calibration has to turn the motor ([`Calibrator::turning`]).
//!
//! Why here and nowhere else: an [`super::Axis`] cannot be made without a [`Calibration`], and a
//! [`Calibration`] has no constructor but the end of a [`Calibrator`]. Until then the motor receives voltages
//! along angles that the state machine chooses. Only the refinement, after direction and counts were found
//! right, controls the rotor's position. Limits apply in every tick: current vector, voltage, bus, rails,
//! travel, time of every stage.
//!
//! | defect | symptom | reason |
//! | --- | --- | --- |
//! | a phase open, or its shunt silent | no current along its axis, or none in it | [`Refusal::PhaseOpen`] |
//! | one shunt inverted | signs of the phase currents | [`Refusal::ShuntInverted`] |
//! | both shunts inverted | signs of the phase currents | [`Refusal::ShuntsInverted`] |
//! | shunts exchanged | signs of the phase currents | [`Refusal::ShuntsSwapped`] |
//! | two motor leads or A and B of the encoder exchanged | runs against field | [`Refusal::Direction`] |
//! | encoder without counts, rotor blocked | travel | [`Refusal::NoCounts`] |
//! | pole pairs | counts per electrical turn | [`Refusal::PolePairs`] |
//! | counts per turn | counts per electrical turn | [`Refusal::CountsPerTurn`] |
//! | torque per ampere | back-EMF while the rotor turns | [`Refusal::Flux`] |
//! | no index, or at several positions | index | [`Refusal::NoIndex`], [`Refusal::IndexMoved`] |
//! | load, friction or cogging too large | travel and deviation, both ways | [`Refusal::Slipped`] |
//! | load too large | torque while the rotor turns | [`Refusal::Load`] |
//! | rotor torn away by a load, or too long a path | travel | [`Refusal::Travel`] |
//! | encoder moved on its shaft since it was stored | offset at the index | [`Refusal::StoredOffset`] |
//! | wrong stored offset or index, or a push | travel at standstill | [`Refusal::Moved`] |
//! | not the stored motor | resistance, inductances | [`Refusal::OtherMotor`] |
//!
//! Nothing is corrected silently. Exchanged motor leads and an exchanged encoder look alike here: the counter
//! runs against the field. But the second also reverses the joint's angle. So the direction is part of the
//! commissioned configuration, and the other one is refused. All three leads moved on by one are the same
//! motor with another offset, which is found. Counts per electrical turn distinguish wrong pole pairs from
//! wrong counts per turn only where whole pole pairs result.
//!
//! **What cannot be detected.** Two motor leads *and* the encoder's A and B exchanged together are an
//! electrically sound drive that turns the other way. Field, counter and torque agree, but the joint's sense
//! is reversed. Inside the drive the flexion direction of the joint is unknown. So commissioning ends with a
//! manual step, to be repeated after every work on leads or encoder: with the outputs off, flex the joint;
//! its angle must grow.
//!
//! Results are valid for the calibrated configuration only: [`super::Axis::new`] refuses another direction,
//! other pole pairs and other counts.
//!
//! The gear and the leg may stay on: a load of up to 0.6 of the torque that the current holds is permitted.
//! The rotor returns to where it began; then the current falls and the leg with it, unless friction holds it.
//!
//! Known limits: gain errors of shunts and of the bus divider scale R, L and flux.

mod current_offsets;
mod field;
mod found;
mod hold;
mod inductance;
mod refine;
mod refusal;
mod repeated;
mod resistance;
mod scan;
mod search;
mod track;

use super::configuration::{AxisConfiguration, AxisError, Direction};
use super::{
    CountScale, CurrentGains, CurrentLoop, ElectricalAngle, Modulator, MotorConstants, Rotating, Rotation,
    SenseScale, Stationary,
};
use crate::hal::{AxisCommand, AxisSample};
use crate::real::{min, sqrt};
use crate::units::{Ampere, Hertz, KilogramMetreSquared, Volt, Weber};
use current_offsets::CurrentOffsets;
pub use found::{Calibration, EncoderSetting, JointZero, MotorFindings, StoredCalibration};
use hold::Hold;
use inductance::{InductanceStage, Inductances, SeenInductances};
use refine::{QUADRATURE_SHARE, Refine, Refined};
pub use refusal::{Mismatch, MotorConstant, Phase, Refusal};
use resistance::{ResistanceStage, VoltageDrop};
pub(crate) use scan::ALIGNMENT_TURNS;
use scan::Scan;
pub use search::IndexSearch;
pub(super) use track::INDEX_WIDTH;
use track::Track;

/// Limits of a calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationSettings {
    /// Current for which loads are permitted up to 0.6 of the torque that it holds. Stages use up to 1.25
    /// of it along the field, the refinement 1.6 of it across the flux.
    pub current: Ampere,
    /// Longest voltage vector while the motor's constants are unknown.
    pub voltage: Volt,
    /// Speed of the scan's field and of the refinement's motions, electrical turns per second, 0.5..=20.
    pub turns_per_s: f32,
    /// Greatest travel of the rotor from where it began, motor turns, at most 2. The index is passed for
    /// certain with a turn and 1.4 electrical turns.
    pub travel_turns: f32,
    /// Inertia that the motor turns, at the rotor: rotor, gear and leg. Within a factor of three.
    pub inertia: KilogramMetreSquared,
}

/// Result of one calibration tick.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CalibrationStep {
    /// Still running; the bridge's next command.
    Running(AxisCommand),
    /// Passed; turn the outputs off.
    Done(Calibration),
    /// Refused; turn the outputs off.
    Refused(Refusal),
}

/// Constants that all stages read.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Bench {
    settings: CalibrationSettings,
    sense: SenseScale,
    scale: CountScale,
    modulator: Modulator,
    pole_pairs: u8,
    direction: Direction,
    index: bool,
    encoder: EncoderSetting,
    /// Greatest plausible step of the counter in a period.
    greatest_step: i32,
    bus_codes: [u16; 2],
    overcurrent_square: f32,
    flux: Weber,
    /// Greatest quadrature current of the refinement, A.
    quadrature_a: f32,
    /// Greatest difference of the encoder's errors at two positions, electrical turns.
    encoder_error: f32,
}

impl Bench {
    /// Converts counts to electrical turns by the configured scale.
    fn electrical(&self, counts: i32) -> f32 {
        counts as f32 * f32::from(self.pole_pairs) / self.scale.counts_per_turn() as f32
    }

    /// Assumed electrical angle after so many counts.
    fn angle(&self, way: i32) -> ElectricalAngle {
        self.scale.angle(self.scale.within_turn(way))
    }

    /// Refusal where so many counts per turn fit instead of the configured ones.
    fn other_counts(&self, found: u32) -> Refusal {
        Refusal::CountsPerTurn { stated: self.scale.counts_per_turn().unsigned_abs(), found }
    }
}

/// Current of both components in a frame, for instance that of a field.
#[derive(Clone, Copy, Debug, PartialEq)]
struct FieldCurrent {
    gains: CurrentGains,
    current_loop: CurrentLoop,
}

impl FieldCurrent {
    /// Takes over from a voltage along the frame's first axis.
    fn holding(gains: CurrentGains, along: Volt) -> Self {
        Self { gains, current_loop: CurrentLoop::holding(Rotating { d: along, q: Volt::ZERO }) }
    }

    /// Describes this current in a frame that lies back by this angle.
    fn turned(self, back: ElectricalAngle) -> Self {
        let Rotating { d, q } = self.current_loop.integral_v();
        let Rotation { sine, cosine } = back.rotation();
        let turned = Rotating { d: Volt(d * cosine - q * sine), q: Volt(d * sine + q * cosine) };
        Self { current_loop: CurrentLoop::holding(turned), ..self }
    }

    fn voltage(
        &mut self,
        reading: &Reading<'_>,
        frame: ElectricalAngle,
        target: Rotating<Ampere>,
    ) -> Stationary<Volt> {
        let frame = frame.rotation();
        let measured = reading.current.to_rotating(frame);
        let limit = reading.bench.settings.voltage;
        self.current_loop.voltage(&self.gains, target, measured, 0.0, limit).to_stationary(frame)
    }
}

/// Input of a stage in one tick.
#[derive(Clone, Copy)]
struct Reading<'a> {
    bench: &'a Bench,
    /// Motion since the calibration began.
    track: &'a Track,
    /// Whether the rotor is beyond the permitted travel.
    is_beyond: bool,
    current: Stationary<Ampere>,
    bus: Volt,
}

impl Reading<'_> {
    fn command(&self, voltage: Stationary<Volt>) -> AxisCommand {
        let duty = self.bench.modulator.duties(voltage, 1.0 / self.bus.0, Stationary::default());
        AxisCommand { enabled: true, duty }
    }
}

/// Result of one tick of a stage.
enum Outcome<R> {
    Running(Stationary<Volt>),
    Passed(R),
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Stage {
    CurrentOffsets(CurrentOffsets),
    Resistance(ResistanceStage),
    Inductance(InductanceStage),
    Scan(Scan),
    Refine(Refine),
    Finished(Result<Calibration, Refusal>),
}

/// State machine of a calibration; one tick per PWM period, and every tick returns a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrator {
    bench: Bench,
    stored: Option<StoredCalibration>,
    /// Stored values may be checked at standstill.
    may_stand: bool,
    /// Travel at which the field was laid along the flux; `None` where the motor turns.
    stands_at: Option<i32>,
    current_offsets: [f32; 2],
    square_a2: f32,
    drop: VoltageDrop,
    seen: SeenInductances,
    /// Travel at which the inductances were measured along phase A.
    seen_at: i32,
    track: Track,
    stage: Stage,
}

impl Calibrator {
    /// Starts a calibration that measures everything.
    ///
    /// # Errors Names the invalid part of the configuration; invalid settings give [`AxisError::Current`].
    pub fn new(configuration: &AxisConfiguration, settings: CalibrationSettings) -> Result<Self, AxisError> {
        configuration.check()?;
        let pairs = f32::from(configuration.pole_pairs);
        let sensible = settings.current.0 > 0.0
            && settings.current * STRONG_SHARE <= configuration.current_limit
            && settings.voltage.0 > 0.0
            && settings.voltage.0 < 0.5 * configuration.bus[0].0
            && (0.5..=20.0).contains(&settings.turns_per_s)
            && settings.current.0 * LONGEST_SHARE < configuration.overcurrent.0
            && settings.travel_turns * pairs >= LEAST_TRAVEL_TURNS
            && (!configuration.index || settings.travel_turns * pairs >= pairs + ALIGNMENT_TURNS)
            && settings.travel_turns <= 2.0
            && (1e-6..=10.0).contains(&settings.inertia.0);
        if !sensible {
            return Err(AxisError::Current);
        }
        let bench = Bench {
            settings,
            sense: configuration.sense,
            scale: configuration.scale()?,
            modulator: configuration.modulator()?,
            pole_pairs: configuration.pole_pairs,
            direction: configuration.counter,
            index: configuration.index,
            encoder: EncoderSetting::new(configuration),
            greatest_step: configuration.greatest_step()?,
            bus_codes: configuration.bus_codes(),
            overcurrent_square: configuration.overcurrent.0 * configuration.overcurrent.0,
            flux: configuration.flux,
            quadrature_a: min(QUADRATURE_SHARE * settings.current.0, across(configuration, settings.current)),
            encoder_error: if configuration.absolute {
                min(pairs * MAGNETIC_ERROR_TURNS, GREATEST_ENCODER_ERROR)
            } else {
                0.0
            },
        };
        Ok(Self {
            bench,
            stored: None,
            may_stand: false,
            stands_at: None,
            current_offsets: [0.0; 2],
            square_a2: 0.0,
            drop: VoltageDrop::default(),
            seen: SeenInductances::default(),
            seen_at: 0,
            track: Track::default(),
            stage: Stage::CurrentOffsets(CurrentOffsets::default()),
        })
    }

    /// Starts a calibration after a power-up. Everything is measured as by [`Self::new`] and must agree with
    /// the stored values; of these only the offset is used. Where an index search is certain
    /// (`Self::take_index`), or an absolute encoder gave the position ([`Self::at_position`]), the motor
    /// stands still and the offset is not measured.
    ///
    /// # Errors As [`Self::new`]. Also [`AxisError::Encoder`] without index and absolute encoder, and
    /// [`AxisError::Calibration`] where the stored values belong to another configuration.
    pub fn from_stored(
        configuration: &AxisConfiguration,
        settings: CalibrationSettings,
        stored: StoredCalibration,
    ) -> Result<Self, AxisError> {
        if !configuration.index && !configuration.absolute {
            return Err(AxisError::Encoder);
        }
        if stored.encoder != EncoderSetting::new(configuration) {
            return Err(AxisError::Calibration);
        }
        Ok(Self { stored: Some(stored), may_stand: true, ..Self::new(configuration, settings)? })
    }

    /// Forbids a check at standstill: the motor turns, whatever an index search has found.
    pub fn turning(self) -> Self {
        Self { may_stand: false, ..self }
    }

    /// Takes the rotor position of an index search, before the first tick. Where that is certain and stored
    /// values may be checked at standstill, the motor does not turn.
    pub(crate) fn take_index(&mut self, search: &IndexSearch) {
        let Bench { scale, greatest_step, direction, .. } = &self.bench;
        let may_stand = self.may_stand && self.bench.index;
        if let Some((counter, since)) = search.position(scale, *greatest_step).filter(|_| may_stand) {
            self.track = Track::beyond_index(counter, direction.sign() * since);
            self.stands_at = Some(0);
        }
    }

    /// Sets the rotor position by an absolute encoder, before the first tick: a counter reading, and its
    /// distance from the encoder's zero in the counter's direction. Where stored values may be checked at
    /// standstill, the motor does not turn.
    pub fn at_position(self, counter: u16, counts: i32) -> Self {
        let track = Track::beyond_index(counter, self.bench.direction.sign() * counts);
        Self { track, stands_at: self.may_stand.then_some(0), ..self }
    }

    /// Electrical angle at travel zero by the stored offset, where the motor stands still and its index is
    /// known.
    fn offset_at_standstill(&self) -> Option<ElectricalAngle> {
        self.stands_at?;
        let index = self.track.index?;
        Some(self.stored?.offset.plus(self.bench.angle(0)).minus(self.bench.angle(index)))
    }

    /// Runs one PWM period.
    pub fn tick(&mut self, sample: &AxisSample) -> CalibrationStep {
        match self.advance(sample) {
            Ok(command) => CalibrationStep::Running(command),
            Err(end) => {
                self.stage = Stage::Finished(end);
                end.map_or_else(CalibrationStep::Refused, CalibrationStep::Done)
            }
        }
    }

    /// Square of the current vector at the last tick with a bridge on, A^2.
    pub(crate) const fn square_a2(&self) -> f32 {
        self.square_a2
    }

    /// Returns the command, or the end of the calibration.
    fn advance(&mut self, sample: &AxisSample) -> Result<AxisCommand, Result<Calibration, Refusal>> {
        let [low, high] = self.bench.bus_codes;
        if !(low..=high).contains(&sample.bus_code) {
            return Err(Err(Refusal::BusVoltage));
        }
        self.track.follow(&self.bench, sample);
        let current_offsets = self.current_offsets;
        let travel = self.bench.electrical(self.track.way).abs();
        let is_beyond = travel > self.bench.settings.travel_turns * f32::from(self.bench.pole_pairs);
        if is_beyond && !matches!(self.stage, Stage::Scan(_) | Stage::Finished(_)) {
            return Err(Err(Refusal::Travel));
        }
        let moved = self.stands_at.map_or(0.0, |at| self.bench.electrical(self.track.way.wrapping_sub(at)));
        if moved.abs() > GREATEST_MOTION {
            match self.stage {
                Stage::CurrentOffsets(_) => return Err(Err(Refusal::Turning)),
                Stage::Resistance(_) | Stage::Inductance(_) => return Err(Err(Refusal::Moved)),
                Stage::Scan(_) | Stage::Refine(_) | Stage::Finished(_) => {}
            }
        }
        let square_a2 = &mut self.square_a2;
        let mut reading = |current_offsets| {
            let current = self
                .bench
                .sense
                .currents(sample.shunt_codes, current_offsets)
                .ok_or(Refusal::CurrentSense)?;
            let (alpha, beta) = (current.alpha.0, current.beta.0);
            *square_a2 = alpha * alpha + beta * beta;
            if *square_a2 > self.bench.overcurrent_square {
                return Err(Refusal::Overcurrent);
            }
            let bus = self.bench.sense.bus(sample.bus_code);
            Ok(Reading { bench: &self.bench, track: &self.track, is_beyond, current, bus })
        };
        match &mut self.stage {
            Stage::Finished(end) => Err(*end),
            Stage::CurrentOffsets(stage) => {
                if let Some(found) = stage.tick(sample).map_err(Err)? {
                    self.current_offsets = found;
                    self.stage = Stage::Resistance(self.resistance_stage());
                }
                Ok(AxisCommand::OFF)
            }
            Stage::Resistance(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed((drop, hold)) => {
                        let command = reading.command(hold.voltage());
                        self.drop = drop;
                        self.agrees(MotorConstant::Resistance, drop.resistance.0).map_err(Err)?;
                        self.stage = Stage::Inductance(InductanceStage::new(hold));
                        Ok(command)
                    }
                }
            }
            Stage::Inductance(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading, self.drop.resistance).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed((seen, hold)) => {
                        let command = reading.command(hold.voltage());
                        (self.seen, self.seen_at) = (seen, self.track.way);
                        if let Some(found) = self.at_standstill() {
                            return Err(self.passed(&found, sample));
                        }
                        self.stage = self.scan(hold).map_err(Err)?;
                        Ok(command)
                    }
                }
            }
            Stage::Scan(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed((found, mut current)) => {
                        let held =
                            Rotating { d: self.bench.settings.current * STRONG_SHARE, q: Ampere::ZERO };
                        let command = reading.command(current.voltage(&reading, found.field, held));
                        self.stage = Stage::Refine(Refine::new(&self.bench, current, found));
                        Ok(command)
                    }
                }
            }
            Stage::Refine(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                let seen = (&self.seen, self.seen_at);
                match stage.tick(&reading, seen, &self.drop).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed(found) => Err(self.passed(&found, sample)),
                }
            }
        }
    }

    /// Ends with [`Refusal::OtherMotor`] where the measured value contradicts the stored one.
    fn agrees(&self, constant: MotorConstant, found: f32) -> Result<(), Refusal> {
        let Some(stored) = &self.stored else { return Ok(()) };
        let (share, stored) = match constant {
            MotorConstant::Resistance => (RESISTANCE_SHARE, stored.resistance.0),
            MotorConstant::DirectInductance => (INDUCTANCE_SHARE, stored.direct_inductance.0),
            MotorConstant::QuadratureInductance => (INDUCTANCE_SHARE, stored.quadrature_inductance.0),
        };
        let mismatch = Mismatch::beyond(share, stored, found);
        mismatch.map_or(Ok(()), |mismatch| Err(Refusal::OtherMotor(constant, mismatch)))
    }

    /// Resistance stage along the phases, or along the known flux of a rotor that stands still.
    fn resistance_stage(&mut self) -> ResistanceStage {
        let way = self.track.way;
        let Some(offset) = self.offset_at_standstill() else { return ResistanceStage::default() };
        self.stands_at = Some(way);
        ResistanceStage::along_flux(self.bench.angle(way).plus(offset))
    }

    /// Results at standstill: the stored offset, and the inductances seen from the held current.
    fn at_standstill(&self) -> Option<Refined> {
        let offset = self.offset_at_standstill()?;
        let ahead = self.bench.angle(self.stands_at?).minus(self.bench.angle(self.seen_at));
        Some(Refined { offset, inductances: self.seen.along_flux(ahead), findings: None })
    }

    fn scan(&self, hold: Hold) -> Result<Stage, Refusal> {
        // The smaller inductance: where the frame lies in the rotor is not known yet.
        let least = self.seen.least();
        let motor = MotorConstants {
            resistance: self.drop.resistance,
            direct_inductance: least,
            quadrature_inductance: least,
            flux: Weber::ZERO,
        };
        let gains = CurrentGains::new(&motor, SCAN_BANDWIDTH, false).ok_or(Refusal::MotorConstants)?;
        Ok(Stage::Scan(Scan::new(FieldCurrent::holding(gains, hold.volts()))))
    }

    /// The calibration, or what contradicts the stored one.
    fn passed(&self, found: &Refined, sample: &AxisSample) -> Result<Calibration, Refusal> {
        // Counts were lost after the scan.
        if self.track.index_distance.is_some() {
            return Err(Refusal::IndexMoved);
        }
        let Inductances { direct, quadrature, .. } = found.inductances;
        self.agrees(MotorConstant::DirectInductance, direct.0)?;
        self.agrees(MotorConstant::QuadratureInductance, quadrature.0)?;
        let flux = found.findings.map_or(self.bench.flux, |found| found.flux);
        if let Some(mismatch) = Mismatch::beyond(FLUX_SHARE, self.bench.flux.0, flux.0) {
            return Err(Refusal::Flux(mismatch));
        }
        // Rotor positions count from the index, if there is one.
        let index = self.track.index.unwrap_or(0);
        let measured = found.offset.plus(self.bench.angle(index)).minus(self.bench.angle(0));
        let offset = match self.stored {
            Some(stored)
                if measured.since(stored.offset).abs() > GREATEST_STORED_ERROR + self.bench.encoder_error =>
            {
                let (stated, found) = (stored.offset.turns(), measured.turns());
                return Err(Refusal::StoredOffset(Mismatch { stated, found }));
            }
            Some(stored) => stored.offset,
            None => measured,
        };
        Ok(Calibration {
            encoder: self.bench.encoder,
            current_offsets: self.current_offsets,
            resistance: self.drop.resistance,
            inductances: found.inductances,
            offset,
            counter: sample.encoder_count,
            position: self.bench.scale.within_turn(self.track.way.wrapping_sub(index)),
            indexed: self.track.index.is_some(),
            findings: found.findings,
        })
    }
}

/// Current across that the axis' limit leaves beside this one, A.
fn across(configuration: &AxisConfiguration, along: Ampere) -> f32 {
    let limit = configuration.current_limit.0;
    sqrt(limit * limit - along.0 * along.0)
}

/// Current that holds and drags the rotor, over the calibration's.
pub const STRONG_SHARE: f32 = 1.25;
/// Greatest travel of a rotor whose flux the field lies along, electrical turns: 11 degrees. A stored offset
/// that is 5 degrees off, as permitted, moves a rotor without friction by 5.
const GREATEST_MOTION: f32 = 1.0 / 32.0;
/// Greatest difference of measured and stored offset, electrical turns.
const GREATEST_STORED_ERROR: f32 = 5.0 / 360.0;
/// Error of an absolute encoder, which is a magnetic one, at two positions: twice 0.8 degrees (AS5047P,
/// nonlinearity with an aligned magnet), motor turns.
const MAGNETIC_ERROR_TURNS: f32 = 2.0 * 0.8 / 360.0;
/// Greatest permitted error of an encoder, electrical turns: that of 14 pole pairs.
const GREATEST_ENCODER_ERROR: f32 = 14.0 * MAGNETIC_ERROR_TURNS;
/// Longest current vector of the refinement over the calibration's current, with a margin: the direct
/// current and 1.6 of it across.
const LONGEST_SHARE: f32 = 1.1 * 1.89;
/// Least permitted travel, electrical turns: alignment and a path of two turns.
const LEAST_TRAVEL_TURNS: f32 = 3.4;
/// Copper 100 K warmer or colder has 39 % more or less resistance.
const RESISTANCE_SHARE: f32 = 0.4;
/// A measurement is within 2 % (100 motors of `hal-sim/tests/hardware/calibration`), at standstill within 4 %
/// (400 legs there), so 6 % together. Magnets 100 K warmer have 12 % less flux, so they saturate the iron
/// less: at most 12 % of inductance. Together 18 %, and a margin.
const INDUCTANCE_SHARE: f32 = 0.2;
/// The flux of a data sheet is up to 10 % off, magnets 100 K warmer have 12 % less, and a margin.
const FLUX_SHARE: f32 = 0.25;
/// The field turns slowly. A loop this fast holds the current and tolerates an inductance of half the
/// measured one.
const SCAN_BANDWIDTH: Hertz = Hertz(300.0);

#[cfg(test)]
pub(crate) mod tests;
