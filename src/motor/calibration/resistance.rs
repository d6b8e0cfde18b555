//! Phase resistance, and with it the wiring of phases and shunts.
//!
//! Current is held along the axes of C, B and A in turn, first the calibration's and then a quarter more.
//! Less would not hold a loaded rotor:
//!
//! ```text
//! R = (v_2 - v_1) / (i_2 - i_1)
//! ```
//!
//! The difference removes what dead time and diodes take, which does not change with the current's size. That
//! constant is the remainder; the back-EMF's measurement needs it. The voltage is the modulator's, so the
//! bridge's own resistance correctly counts as the motor's.
//!
//! The measured current must lie within 15 degrees of the voltage; each wrong wiring bends it by 30 or more
//! on one of the axes, with its own pattern of signs. Where a wrong sign reverses the hold's feedback, a
//! quarter of the current is enough to decide.
//!
//! **Dither.** A timer's step of 48 V / 3500 is 14 mV, against 500 mV of 10 A through 50 mOhm. A constant
//! duty is always rounded the same way, and R would be 1 to 3 % off. So the voltage along the axis follows a
//! saw tooth of 16 ticks and 4/3 of a step. Centred modulation turns that into one step in every phase, up in
//! one and down in two.
//!
//! **From axis to axis** the voltage turns slowly and its size stays, so that a loaded rotor is never
//! released. Sensors decide only when it stands along the next axis.
//!
//! **Along the flux** ([`ResistanceStage::along_flux`]) of a rotor at a known angle the current makes no
//! torque. One axis suffices there, and the current across is controlled to zero. A wrong wiring is refused,
//! but only an open phase by name: the calibration in motion excluded the others before it was stored.
//!
//! While the rotor swings towards the field, its back-EMF adds to the voltage along it. So means of 0.1 s are
//! taken until two in a row agree to 0.2 %. That takes 0.3 to 4 s, twice per axis.

use super::hold::Hold;
use super::repeated::Repeated;
use super::{ElectricalAngle, Outcome, Phase, Reading, Refusal, STRONG_SHARE, Stationary};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{Phases, Rotation};
use crate::real::{min, sign};
use crate::units::{Ampere, Ohm, Volt};

const RISE_TICKS: u32 = CURRENT_RATE_HZ / 10;
const MEAN_TICKS: u32 = CURRENT_RATE_HZ / 10;
/// Period of the dither's saw tooth.
const DITHER_TICKS: u32 = 16;
/// Time in which the voltage turns to the next axis, and the time after it until the current is judged.
const TURN_TICKS: u32 = CURRENT_RATE_HZ / 2;
const TURNED_TICKS: u32 = TURN_TICKS + CURRENT_RATE_HZ / 10;
const LEVEL_TICKS: u32 = 4 * CURRENT_RATE_HZ;
/// Greatest relative difference of two means of a settled rotor.
const SETTLED_SHARE: f32 = 0.002;
/// A backward current beyond this share of the holding current is refused at once: the hold would
/// drive it further.
const JUDGED_SHARE: f32 = 0.25;
/// Tangent of 15 degrees, the greatest angle between voltage and current.
const GREATEST_BEND: f32 = 0.268;
/// Share of the largest phase current below which a phase counts as open.
const NO_CURRENT_SHARE: f32 = 0.15;
const GREATEST_IMBALANCE: f32 = 0.15;

/// Order of the axes; the rotor stays at the last one for the next stage.
const AXES: [Phase; 3] = [Phase::C, Phase::B, Phase::A];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct ResistanceStage {
    axis: usize,
    level: Level,
    /// Ticks since the start of this level.
    ticks: u32,
    hold: Hold,
    sums: Sums,
    /// Sums of the preceding mean.
    before: Option<Sums>,
    low: Sums,
    found: [f32; 3],
    /// Sum over the axes of the voltage that does not grow with the current, V.
    constant_sum: f32,
    /// Angle of the rotor's flux, if the current flows along that alone.
    flux: Option<ElectricalAngle>,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Level {
    Low,
    Full,
    /// The voltage turns to the next axis.
    Turn,
}

/// Voltage that a current takes at rest: a resistance, and a constant by the sign of every phase current.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct VoltageDrop {
    pub(crate) resistance: Ohm,
    /// Standard deviation by the three axes; zero where only one was measured.
    pub(crate) resistance_sigma: Ohm,
    /// Part of dead time and diodes, with the current along the axis of a phase.
    constant: Volt,
}

impl VoltageDrop {
    /// Voltage across the flux of a rotor at an angle.
    pub(super) fn across(&self, current: Stationary<Ampere>, rotor: Rotation) -> Volt {
        let Phases { a, b, c } = current.to_phases();
        // Along the axis of a phase the signs are 1, -1 and -1: a vector of 4/3.
        let signs = Phases { a: sign(a.0), b: sign(b.0), c: sign(c.0) }.to_stationary();
        let resistive = self.resistance.0 * current.to_rotating(rotor).q.0;
        Volt(resistive + 0.75 * self.constant.0 * signs.to_rotating(rotor).q)
    }
}

/// Sums over the ticks of one mean.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Sums {
    volts: f32,
    current: Stationary<Ampere>,
}

impl Default for ResistanceStage {
    fn default() -> Self {
        Self {
            axis: 0,
            level: Level::Low,
            ticks: 0,
            hold: Hold::along(angle_of(AXES[0])),
            sums: Sums::default(),
            before: None,
            low: Sums::default(),
            found: [0.0; 3],
            constant_sum: 0.0,
            flux: None,
        }
    }
}

fn angle_of(phase: Phase) -> ElectricalAngle {
    ElectricalAngle::from_turns(match phase {
        Phase::A => 0.0,
        Phase::B => 1.0 / 3.0,
        Phase::C => 2.0 / 3.0,
    })
}

impl ResistanceStage {
    /// Measures along the flux of a rotor at this angle only.
    pub(super) fn along_flux(angle: ElectricalAngle) -> Self {
        Self {
            axis: AXES.len() - 1,
            hold: Hold::with_zero_across(angle),
            flux: Some(angle),
            ..Self::default()
        }
    }

    pub(super) fn tick(&mut self, reading: &Reading<'_>) -> Result<Outcome<(VoltageDrop, Hold)>, Refusal> {
        let low = reading.bench.settings.current;
        let full = low * STRONG_SHARE;
        let phase = AXES.get(self.axis).copied().unwrap_or(Phase::A);
        if self.level == Level::Turn {
            return self.turn(reading);
        }
        let target = if self.level == Level::Low { low } else { full };
        let held = self.hold.tick(reading, target);
        let is_bent =
            self.flux.is_some() && self.hold.across_axis(reading.current).abs() > full * JUDGED_SHARE;
        if is_bent || self.hold.along_axis(reading.current) < full * -JUDGED_SHARE {
            return Err(self.diagnosis(reading.current, phase));
        }
        held.map_err(|reason| self.without_current(reading, phase, reason))?;
        self.ticks += 1;
        if let Some(settled) = self.settled(reading)? {
            match self.level {
                Level::Low => {
                    self.judge_direction(settled.current, phase)?;
                    self.low = settled;
                    self.level = Level::Full;
                }
                _ => {
                    self.take(settled, full)?;
                    if self.axis + 1 == AXES.len() {
                        return Ok(Outcome::Passed((self.drop()?, self.hold)));
                    }
                    self.level = Level::Turn;
                }
            }
            (self.ticks, self.before) = (0, None);
        }
        Ok(Outcome::Running(self.hold.voltage_with(self.dither(reading), Volt::ZERO)))
    }

    #[cfg(test)]
    pub(super) fn is_after_the_first_axis(&self) -> bool {
        self.axis > 0
    }

    /// Turns the voltage to the next axis and judges the current there.
    fn turn(&mut self, reading: &Reading<'_>) -> Result<Outcome<(VoltageDrop, Hold)>, Refusal> {
        let [from, to] = [self.axis, self.axis + 1].map(|axis| AXES.get(axis).copied().unwrap_or(Phase::A));
        self.ticks += 1;
        let share = min(self.ticks as f32 / TURN_TICKS as f32, 1.0);
        // Smooth at both ends.
        let share = share * share * (3.0 - 2.0 * share);
        let way = angle_of(to).since(angle_of(from)) * share;
        self.hold.turn_to(angle_of(from).plus(ElectricalAngle::from_turns(way)));
        if self.ticks == TURNED_TICKS {
            self.judge_direction(reading.current, to)?;
            let Self { axis, found, constant_sum, hold, .. } = *self;
            *self = Self { axis: axis + 1, found, constant_sum, hold, ..Self::default() };
        }
        Ok(Outcome::Running(self.hold.voltage()))
    }

    /// Saw tooth of the dither, symmetric about zero.
    fn dither(&self, reading: &Reading<'_>) -> Volt {
        reading.bus * (4.0 / 3.0 * reading.bench.modulator.duty_step()) * saw_tooth(self.ticks)
    }

    /// Returns the sums of a mean that agrees with the preceding one.
    fn settled(&mut self, reading: &Reading<'_>) -> Result<Option<Sums>, Refusal> {
        if self.ticks > LEVEL_TICKS {
            return Err(Refusal::TimeOut);
        }
        if self.ticks <= RISE_TICKS {
            return Ok(None);
        }
        self.sums.volts += self.hold.volts().0;
        self.sums.current.alpha += reading.current.alpha;
        self.sums.current.beta += reading.current.beta;
        if !(self.ticks - RISE_TICKS).is_multiple_of(MEAN_TICKS) {
            return Ok(None);
        }
        let sums = core::mem::take(&mut self.sums);
        let agrees = |before: Sums| (sums.volts - before.volts).abs() <= SETTLED_SHARE * sums.volts.abs();
        Ok(self.before.replace(sums).is_some_and(agrees).then_some(sums))
    }

    fn take(&mut self, settled: Sums, full: Ampere) -> Result<(), Refusal> {
        let (i1, i2) = (self.hold.along_axis(self.low.current).0, self.hold.along_axis(settled.current).0);
        let reached = i2 > 0.95 * MEAN_TICKS as f32 * full.0;
        if !reached || !(i2 > 1.1 * i1) {
            return Err(Refusal::TimeOut);
        }
        let resistance = (settled.volts - self.low.volts) / (i2 - i1);
        self.constant_sum += (self.low.volts - resistance * i1) / MEAN_TICKS as f32;
        if self.flux.is_some() {
            self.found = [resistance; 3];
        } else if let Some(found) = self.found.get_mut(self.axis) {
            *found = resistance;
        }
        Ok(())
    }

    fn drop(&self) -> Result<VoltageDrop, Refusal> {
        let Repeated { mean, sigma } = Repeated::new(&self.found);
        if !(1e-3..=10.0).contains(&mean) {
            return Err(Refusal::MotorConstants);
        }
        if self.found.iter().any(|found| (found - mean).abs() > GREATEST_IMBALANCE * mean) {
            return Err(Refusal::PhaseImbalance);
        }
        let constant = Volt(self.constant_sum / AXES.len() as f32);
        Ok(VoltageDrop { resistance: Ohm(mean), resistance_sigma: Ohm(sigma), constant })
    }

    /// The voltage reached its limit: either no current flows, or the resistance is too large.
    fn without_current(&self, reading: &Reading<'_>, phase: Phase, reason: Refusal) -> Refusal {
        let current = self.hold.along_axis(reading.current).abs();
        if current < reading.bench.settings.current * NO_CURRENT_SHARE {
            Refusal::PhaseOpen(self.flux.map_or(phase, nearest))
        } else {
            self.flux.and_then(|flux| silent_phase(reading.current, flux)).map_or(reason, Refusal::PhaseOpen)
        }
    }

    /// Cause of a bent current along the hold's axis, that of `phase` or the flux.
    fn diagnosis(&self, current: Stationary<Ampere>, phase: Phase) -> Refusal {
        match self.flux {
            None => diagnosis(current, phase),
            Some(angle) => silent_phase(current, angle).map_or(Refusal::CurrentDirection, Refusal::PhaseOpen),
        }
    }

    /// Judges a current along the hold's axis, that of `phase`, after the rotor has come to rest: a rotor
    /// that swings towards the field bends the current as well.
    fn judge_direction(&self, current: Stationary<Ampere>, phase: Phase) -> Result<(), Refusal> {
        let (along, across) = (self.hold.along_axis(current), self.hold.across_axis(current));
        if across.abs() <= along * GREATEST_BEND { Ok(()) } else { Err(self.diagnosis(current, phase)) }
    }
}

/// Cause of a bent current that should flow along `phase`'s axis: in through it, out through the other two.
fn diagnosis(current: Stationary<Ampere>, phase: Phase) -> Refusal {
    let currents = current.to_phases();
    let phases = [(Phase::A, currents.a.0), (Phase::B, currents.b.0), (Phase::C, currents.c.0)];
    let largest = phases.iter().fold(0.0_f32, |largest, (_, current)| largest.max(current.abs()));
    if let Some((open, _)) =
        phases.iter().find(|(each, current)| *each != phase && current.abs() < NO_CURRENT_SHARE * largest)
    {
        return Refusal::PhaseOpen(*open);
    }
    let wrong = phases.map(|(each, current)| (current > 0.0) != (each == phase));
    match wrong {
        [true, true, true] => Refusal::ShuntsInverted,
        [false, true, true] => Refusal::ShuntsSwapped,
        [_, true, false] => Refusal::ShuntInverted(Phase::B),
        [_, false, true] => Refusal::ShuntInverted(Phase::C),
        [_, false, false] => Refusal::CurrentDirection,
    }
}

/// Phases with the current that each carries of one ampere along an angle.
fn shares(angle: ElectricalAngle) -> [(Phase, f32); 3] {
    let along = super::Rotating { d: Ampere(1.0), q: Ampere::ZERO };
    let shares = along.to_stationary(angle.rotation()).to_phases();
    [(Phase::A, shares.a.0), (Phase::B, shares.b.0), (Phase::C, shares.c.0)]
}

/// Phase whose axis lies nearest to an angle.
fn nearest(angle: ElectricalAngle) -> Phase {
    let larger =
        |one: (Phase, f32), other: (Phase, f32)| if other.1.abs() > one.1.abs() { other } else { one };
    shares(angle).into_iter().fold((Phase::A, 0.0), larger).0
}

/// Phase that should carry current along an angle and does not.
fn silent_phase(current: Stationary<Ampere>, angle: ElectricalAngle) -> Option<Phase> {
    let currents = current.to_phases();
    let currents = [currents.a.0, currents.b.0, currents.c.0];
    let largest = currents.iter().fold(0.0_f32, |largest, current| largest.max(current.abs()));
    let mut phases = shares(angle).into_iter().zip(currents);
    phases
        .find(|((_, share), current)| {
            share.abs() > 2.0 * NO_CURRENT_SHARE && current.abs() < NO_CURRENT_SHARE * largest
        })
        .map(|((phase, _), _)| phase)
}

/// Saw tooth between -0.5 and 0.5.
fn saw_tooth(ticks: u32) -> f32 {
    ((ticks % DITHER_TICKS) as f32 + 0.5) / DITHER_TICKS as f32 - 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_dither_takes_every_level_once_and_has_no_mean() {
        let levels = (0..DITHER_TICKS).map(|tick| saw_tooth(tick + 7 * DITHER_TICKS));
        let step = 1.0 / DITHER_TICKS as f32;
        for (tick, level) in (0..DITHER_TICKS).zip(levels.clone()) {
            assert!((level + 0.5 - (tick as f32 + 0.5) * step).abs() < 1e-6, "{tick}: {level}");
        }
        assert!(levels.sum::<f32>().abs() < 1e-5);
    }

    #[test]
    fn a_current_s_voltage_across_the_flux_is_that_of_resistance_and_dead_time() {
        let drop = VoltageDrop { resistance: Ohm(0.05), constant: Volt(0.18), ..VoltageDrop::default() };
        // Mean over a turn of a current of 15 A along and 8 A across: dead time takes 3 / pi of the constant
        // along the current's direction.
        let current = super::super::Rotating { d: Ampere(-15.0), q: Ampere(8.0) };
        let mean = (0..360_u16).map(|degree| {
            let rotor = ElectricalAngle::from_turns((f32::from(degree) + 0.5) / 360.0).rotation();
            f64::from(drop.across(current.to_stationary(rotor), rotor).0) / 360.0
        });
        let expected = 8.0 * (0.05 + 0.18 * 3.0 / core::f64::consts::PI / 17.0);
        assert!((mean.sum::<f64>() / expected - 1.0).abs() < 1e-3);
        // Along the axis of phase A.
        let along = Stationary { alpha: Ampere(10.0), beta: Ampere::ZERO };
        let rotor = ElectricalAngle::from_turns(-0.25).rotation();
        assert!((drop.across(along, rotor).0 - 0.68).abs() < 1e-5);
    }

    #[test]
    fn the_dither_spans_one_step_of_the_duty() {
        use super::super::tests::SETTINGS;
        use crate::motor::testing::CONFIGURATION;
        let calibrator = super::super::Calibrator::new(&CONFIGURATION, SETTINGS).expect("usual");
        let (bench, bus) = (&calibrator.bench, Volt(48.0));
        let track = super::super::Track::default();
        let reading = Reading { bench, track: &track, is_beyond: false, current: Stationary::default(), bus };
        let at = |ticks| ResistanceStage { ticks, ..ResistanceStage::default() }.dither(&reading).0;
        // 4/3 of one step of the duty: 48 V in 3,500 steps.
        let span = (at(DITHER_TICKS - 1) - at(0)) * DITHER_TICKS as f32 / (DITHER_TICKS - 1) as f32;
        assert!((span / (48.0 / 3500.0) - 4.0 / 3.0).abs() < 1e-4, "{span}");
    }
}
