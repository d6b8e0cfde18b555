//! Calibrates an unknown motor on unknown wiring: yields a [`Calibration`], or the reason for refusing one.
//!
//! ```text
//! current-sensor offsets (bridge off) -> resistance at C, B, A: wiring of phases and shunts
//!    -> inductances at A
//!    -> scan, the field turns slowly forwards and back: counts, direction, pole pairs, offset, index
//!    -> Calibration
//! ```
//!
//! Why here and nowhere else: an [`super::Axis`] cannot be made without a [`Calibration`], and a
//! [`Calibration`] has no constructor but the end of a [`Calibrator`]. Until then the motor receives voltages
//! along angles that the state machine chooses, never a quadrature current. A free rotor follows the field
//! and stops with it, whatever the encoder reads. Limits apply in every tick: current vector, voltage, bus,
//! rails, time of every stage.
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
//! | no index, or at several positions | index | [`Refusal::NoIndex`], [`Refusal::IndexMoved`] |
//! | load, friction or cogging too large | travel and deviation, both ways | [`Refusal::Slipped`] |
//! | encoder moved on its shaft since it was stored | offset at the index | [`Refusal::StoredOffset`] |
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
//! Known limits: gain errors of shunts and of the bus divider scale R and L. A constant torque
//! (gravity) shifts the offset by asin(torque / holding torque), friction does not. Calibrate with the
//! leg hanging or unloaded.

mod current_offsets;
mod field;
mod found;
mod hold;
mod inductance;
mod refusal;
mod resistance;
mod scan;
mod track;

use super::configuration::{AxisConfiguration, AxisError, Direction};
use super::{
    CountScale, CurrentGains, ElectricalAngle, Modulator, MotorConstants, Rotating, SenseScale, Stationary,
};
use crate::hal::{AxisCommand, AxisSample};
use crate::units::{Ampere, Hertz, Ohm, Volt, Weber};
use current_offsets::CurrentOffsets;
pub use found::{Calibration, EncoderSetting, StoredCalibration};
use hold::Hold;
use inductance::{InductanceStage, Inductances};
pub use refusal::{Phase, Refusal};
use resistance::ResistanceStage;
use scan::{Scan, ScanResult};
pub(super) use track::INDEX_WIDTH;

/// Limits of a calibration.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CalibrationSettings {
    /// Current that holds and turns the rotor; must overcome friction and cogging several times.
    pub current: Ampere,
    /// Longest voltage vector while the motor's constants are unknown.
    pub voltage: Volt,
    /// Speed of the scan's field, electrical turns per second, 0.5..=20.
    pub turns_per_s: f32,
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
    bus_codes: [u16; 2],
    overcurrent_square: f32,
}

/// Input of a stage in one tick.
#[derive(Clone, Copy)]
struct Reading<'a> {
    bench: &'a Bench,
    sample: &'a AxisSample,
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
    Finished(Result<Calibration, Refusal>),
}

/// State machine of a calibration; one tick per PWM period, and every tick returns a result.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Calibrator {
    bench: Bench,
    stored: Option<StoredCalibration>,
    current_offsets: [f32; 2],
    resistance: Ohm,
    inductances: Inductances,
    stage: Stage,
}

impl Calibrator {
    /// Starts a calibration that measures everything.
    ///
    /// # Errors Names the invalid part of the configuration; invalid settings give [`AxisError::Current`].
    pub fn new(configuration: &AxisConfiguration, settings: CalibrationSettings) -> Result<Self, AxisError> {
        configuration.check()?;
        let sensible = settings.current.0 > 0.0
            && settings.current <= configuration.current_limit
            && settings.current.0 * 1.3 < configuration.overcurrent.0
            && settings.voltage.0 > 0.0
            && settings.voltage.0 < 0.5 * configuration.bus[0].0
            && (0.5..=20.0).contains(&settings.turns_per_s);
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
            encoder: EncoderSetting::of(configuration),
            bus_codes: configuration.bus_codes(),
            overcurrent_square: configuration.overcurrent.0 * configuration.overcurrent.0,
        };
        Ok(Self {
            bench,
            stored: None,
            current_offsets: [0.0; 2],
            resistance: Ohm::ZERO,
            inductances: Inductances::default(),
            stage: Stage::CurrentOffsets(CurrentOffsets::default()),
        })
    }

    /// Starts a calibration after a power-up. Everything is measured as by [`Self::new`] and must agree with
    /// the stored values; of these only the offset is used.
    ///
    /// # Errors As [`Self::new`]. Also [`AxisError::Encoder`] without an index, and
    /// [`AxisError::Calibration`] where the stored values belong to another configuration.
    pub fn from_stored(
        configuration: &AxisConfiguration,
        settings: CalibrationSettings,
        stored: StoredCalibration,
    ) -> Result<Self, AxisError> {
        if !configuration.index {
            return Err(AxisError::Encoder);
        }
        if stored.encoder != EncoderSetting::of(configuration) {
            return Err(AxisError::Calibration);
        }
        Ok(Self { stored: Some(stored), ..Self::new(configuration, settings)? })
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

    /// Returns the command, or the end of the calibration.
    fn advance(&mut self, sample: &AxisSample) -> Result<AxisCommand, Result<Calibration, Refusal>> {
        let [low, high] = self.bench.bus_codes;
        if !(low..=high).contains(&sample.bus_code) {
            return Err(Err(Refusal::BusVoltage));
        }
        let current_offsets = self.current_offsets;
        let reading = |current_offsets| {
            let current = self
                .bench
                .sense
                .currents(sample.shunt_codes, current_offsets)
                .ok_or(Refusal::CurrentSense)?;
            let (alpha, beta) = (current.alpha.0, current.beta.0);
            if alpha * alpha + beta * beta > self.bench.overcurrent_square {
                return Err(Refusal::Overcurrent);
            }
            let bus = self.bench.sense.bus(sample.bus_code);
            Ok(Reading { bench: &self.bench, sample, current, bus })
        };
        match &mut self.stage {
            Stage::Finished(end) => Err(*end),
            Stage::CurrentOffsets(stage) => {
                if let Some(found) = stage.tick(sample).map_err(Err)? {
                    self.current_offsets = found;
                    self.stage = Stage::Resistance(ResistanceStage::default());
                }
                Ok(AxisCommand::OFF)
            }
            Stage::Resistance(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed((resistance, hold)) => {
                        let command = reading.command(hold.voltage());
                        self.resistance = resistance;
                        self.agrees(|stored| (stored.resistance.0, resistance.0), RESISTANCE_SHARE)?;
                        self.stage = Stage::Inductance(InductanceStage::new(hold));
                        Ok(command)
                    }
                }
            }
            Stage::Inductance(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading, self.resistance).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed((inductances, hold)) => {
                        let command = reading.command(hold.voltage());
                        let Inductances { direct, quadrature } = inductances;
                        self.inductances = inductances;
                        self.agrees(|stored| (stored.direct_inductance.0, direct.0), INDUCTANCE_SHARE)?;
                        self.agrees(
                            |stored| (stored.quadrature_inductance.0, quadrature.0),
                            INDUCTANCE_SHARE,
                        )?;
                        self.stage = self.scan(hold).map_err(Err)?;
                        Ok(command)
                    }
                }
            }
            Stage::Scan(stage) => {
                let reading = reading(current_offsets).map_err(Err)?;
                match stage.tick(&reading).map_err(Err)? {
                    Outcome::Running(voltage) => Ok(reading.command(voltage)),
                    Outcome::Passed(found) => Err(Ok(self.passed(found, sample))),
                }
            }
        }
    }

    /// Ends with [`Refusal::OtherMotor`] where stored and measured value differ by more than this share of
    /// the stored one.
    fn agrees(
        &self,
        values: impl Fn(&StoredCalibration) -> (f32, f32),
        share: f32,
    ) -> Result<(), Result<Calibration, Refusal>> {
        match self.stored.as_ref().map(values) {
            Some((stored, found)) if !((found - stored).abs() <= share * stored) => {
                Err(Err(Refusal::OtherMotor))
            }
            _ => Ok(()),
        }
    }

    fn scan(&self, hold: Hold) -> Result<Stage, Refusal> {
        let motor = MotorConstants {
            resistance: self.resistance,
            direct_inductance: self.inductances.direct,
            quadrature_inductance: self.inductances.quadrature,
            flux: Weber::ZERO,
        };
        let gains = CurrentGains::new(&motor, SCAN_BANDWIDTH, false).ok_or(Refusal::MotorConstants)?;
        Ok(Stage::Scan(Scan::new(gains, hold.volts(), self.stored.map(|stored| stored.offset))))
    }

    fn passed(&self, found: ScanResult, sample: &AxisSample) -> Calibration {
        Calibration {
            encoder: self.bench.encoder,
            current_offsets: self.current_offsets,
            resistance: self.resistance,
            inductances: self.inductances,
            offset: found.offset,
            counter: sample.encoder_count,
            position: found.position,
            indexed: self.bench.index,
        }
    }
}

/// Copper 100 K warmer or colder has 39 % more or less resistance.
const RESISTANCE_SHARE: f32 = 0.4;
/// Both measurements are within 2 % each (100 motors of `hal-sim/tests/calibration`), so 4 % together.
/// Magnets 100 K warmer have 12 % less flux, and so saturate the iron less: at most 12 % of inductance.
/// Together 16 %, and a margin.
const INDUCTANCE_SHARE: f32 = 0.2;
/// The field turns slowly. A loop this fast holds the current and tolerates an inductance of half the
/// measured one.
const SCAN_BANDWIDTH: Hertz = Hertz(300.0);

#[cfg(test)]
pub(crate) mod tests;
