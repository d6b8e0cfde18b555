//! Inductances along and across the flux, by a square wave on top of the current that holds the rotor.
//!
//! The voltage is offset by +u for two periods and by -u for two: along the held current, across it, and
//! between both:
//!
//! ```text
//! di = 2 u / R tanh(R t / (2 L)),   t = two periods      exact for a resistance and an inductance
//! L  = u t / di (1 - x^2 / 3),   x = R di / (2 u)        to x^4 / 5: 1e-4 at x = 0.15
//! ```
//!
//! Why on top of a current: as long as no phase current changes its sign, dead time adds only a constant. So
//! u is raised until `di` is 0.3 of the holding current, or until the allowed voltage is reached with at
//! least 0.03. The swing across then bends the smallest phase current (half the holding one) by 0.26 of the
//! holding current. Across the flux the rotor feels an alternating torque at 6 kHz and does not turn.
//!
//! The command after sample k acts between the samples k+1 and k+2. So the maximum is read three samples
//! after the wave's beginning, the minimum two later. The mean of 512 waves each (85 ms) reduces noise of 0.1
//! A to 6 mA of some amperes.
//!
//! **A loaded rotor** does not lie along the current that holds it. The inverse of the inductance seen
//! along a direction is a constant and a cosine of twice the angle from the flux. Three directions
//! determine it, so the inductances along and across the flux follow as soon as the rotor's angle is known:
//!
//! ```text
//! m(x) = A + B cos 2 (x + y)            x from the held current, y held current from the flux
//! A = (m(0) + m(90)) / 2,  B = (m(0) - m(90)) / 2 cos 2 y + (A - m(45)) sin 2 y
//! L_d = 1 / (A + B),  L_q = 1 / (A - B)
//! ```

use super::hold::Hold;
use super::{Outcome, Reading, Refusal, STRONG_SHARE};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::{ElectricalAngle, Rotation};
use crate::real::{abs, min};
use crate::units::{Henry, Ohm, Volt};
use core::f32::consts::FRAC_1_SQRT_2;

const HALF_WAVE_TICKS: u32 = 2;
const WAVE_TICKS: u32 = 2 * HALF_WAVE_TICKS;
const MEAN_WAVES: u32 = 512;
/// Waves between the end of the amplitude search and the start of the mean.
const SETTLE_WAVES: u32 = 64;
/// Target of di as share of the holding current.
const SWING_SHARE: f32 = 0.3;
/// Smallest share that is measurable at the allowed voltage.
const LEAST_SWING_SHARE: f32 = 0.03;
/// Increase of the amplitude per wave, as share of the allowed voltage.
const RISE_SHARE: f32 = 1.0 / 1024.0;

/// Inductances along and across the flux.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct Inductances {
    pub(crate) direct: Henry,
    pub(crate) quadrature: Henry,
    /// Part of the inverses' swing that contradicts the rotor's angle, over the inverses' mean.
    pub(crate) residual: f32,
}

/// Inductances seen along the held current, across it, and at 45 degrees.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct SeenInductances([Henry; 3]);

impl SeenInductances {
    /// The smallest of them.
    pub(super) fn least(&self) -> Henry {
        let [along, across, between] = self.0;
        Henry(min(along.0, min(across.0, between.0)))
    }

    /// Inductances along and across the flux; the held current is `ahead` of it.
    pub(super) fn along_flux(&self, ahead: ElectricalAngle) -> Inductances {
        let [along, across, between] = self.0.map(|inductance| 1.0 / inductance.0);
        let Rotation { sine, cosine } = ahead.plus(ahead).rotation();
        let mean = 0.5 * (along + across);
        let [half, other] = [0.5 * (along - across), mean - between];
        let swing = half * cosine + other * sine;
        Inductances {
            direct: Henry(1.0 / (mean + swing)),
            quadrature: Henry(1.0 / (mean - swing)),
            residual: abs(half * sine - other * cosine) / mean,
        }
    }
}

/// Components along and across the held current of each direction of the wave.
const DIRECTIONS: [[f32; 2]; 3] = [[1.0, 0.0], [0.0, 1.0], [FRAC_1_SQRT_2; 2]];

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct InductanceStage {
    hold: Hold,
    direction: usize,
    tick: u32,
    amplitude: f32,
    /// Waves since the amplitude was found.
    waves: u32,
    rising: bool,
    highest: f32,
    swing_sum: f32,
    found: SeenInductances,
}

impl InductanceStage {
    pub(super) fn new(hold: Hold) -> Self {
        Self {
            hold,
            direction: 0,
            tick: 0,
            amplitude: 0.0,
            waves: 0,
            rising: true,
            highest: 0.0,
            swing_sum: 0.0,
            found: SeenInductances::default(),
        }
    }

    pub(super) fn tick(
        &mut self,
        reading: &Reading<'_>,
        resistance: Ohm,
    ) -> Result<Outcome<(SeenInductances, Hold)>, Refusal> {
        let settings = &reading.bench.settings;
        self.hold.tick(reading, settings.current * STRONG_SHARE)?;
        let [along, across] = DIRECTIONS.get(self.direction).copied().unwrap_or_default();
        let current =
            self.hold.along_axis(reading.current) * along + self.hold.across_axis(reading.current) * across;
        match self.tick % WAVE_TICKS {
            3 => self.highest = current.0,
            1 => self.wave(self.highest - current.0, reading)?,
            _ => {}
        }
        if self.waves == SETTLE_WAVES + MEAN_WAVES {
            let inductance = self.inductance(resistance)?;
            if let Some(found) = self.found.0.get_mut(self.direction) {
                *found = inductance;
            }
            let (direction, found) = (self.direction + 1, self.found);
            if direction == DIRECTIONS.len() {
                return Ok(Outcome::Passed((found, self.hold)));
            }
            *self = Self { direction, found, ..Self::new(self.hold) };
            return Ok(Outcome::Running(self.hold.voltage()));
        }
        let sign = if self.tick % WAVE_TICKS < HALF_WAVE_TICKS { 1.0 } else { -1.0 };
        self.tick += 1;
        let wave = Volt(sign * self.amplitude);
        Ok(Outcome::Running(self.hold.voltage_with(wave * along, wave * across)))
    }

    /// Evaluates one wave's swing.
    fn wave(&mut self, swing: f32, reading: &Reading<'_>) -> Result<(), Refusal> {
        let settings = &reading.bench.settings;
        if self.rising {
            if swing >= SWING_SHARE * settings.current.0 {
                self.rising = false;
            } else {
                self.amplitude += RISE_SHARE * settings.voltage.0;
                if self.amplitude >= settings.voltage.0 {
                    if !(swing >= LEAST_SWING_SHARE * settings.current.0) {
                        return Err(Refusal::MotorConstants);
                    }
                    self.rising = false;
                }
            }
            return Ok(());
        }
        self.waves += 1;
        if self.waves > SETTLE_WAVES {
            self.swing_sum += swing;
        }
        Ok(())
    }

    fn inductance(&self, resistance: Ohm) -> Result<Henry, Refusal> {
        const SECONDS: f32 = HALF_WAVE_TICKS as f32 / CURRENT_RATE_HZ as f32;
        let swing = self.swing_sum / MEAN_WAVES as f32;
        let x = resistance.0 * swing / (2.0 * self.amplitude);
        let inductance = self.amplitude * SECONDS / swing * (1.0 - x * x / 3.0);
        if swing > 0.0 && x < 0.5 && (1e-6..=1e-2).contains(&inductance) {
            Ok(Henry(inductance))
        } else {
            Err(Refusal::MotorConstants)
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use core::f32::consts::TAU;

    /// Inductance found for the swing of a known resistance and inductance at an amplitude.
    fn found(resistance: f64, inductance: f64, amplitude: f64) -> Result<Henry, Refusal> {
        let seconds = 2.0 / f64::from(CURRENT_RATE_HZ);
        let tangent = |y: f64| 1.0 - 2.0 / (crate::real::exp(2.0 * y) + 1.0);
        let swing = 2.0 * amplitude / resistance * tangent(resistance * seconds / (2.0 * inductance));
        let stage = InductanceStage {
            amplitude: amplitude as f32,
            swing_sum: (swing * f64::from(MEAN_WAVES)) as f32,
            ..InductanceStage::new(Hold::along(ElectricalAngle::ZERO))
        };
        stage.inductance(Ohm(resistance as f32))
    }

    #[test]
    fn the_inductance_is_that_of_the_swing_whatever_the_resistance_takes() {
        for (resistance, inductance, amplitude) in
            [(0.05, 25e-6, 1.0), (0.2, 60e-6, 3.0), (1.0, 150e-6, 12.0), (0.01, 10e-6, 0.2)]
        {
            let found = f64::from(found(resistance, inductance, amplitude).expect("usual").0);
            let x: f64 = resistance * 2.0 / f64::from(CURRENT_RATE_HZ) / (2.0 * inductance);
            // Tolerance: truncation of the series, and single precision.
            let error = x * x * x * x / 5.0 + 1e-5;
            assert!((found / inductance - 1.0).abs() < error, "{found} for {inductance}, x {x}");
        }
    }

    #[test]
    fn the_inductances_of_the_flux_follow_from_any_angle_of_the_rotor() {
        let (direct, quadrature) = (24e-6_f32, 30e-6);
        for degrees in [0.0_f32, 20.0, 45.0, -60.0, 110.0] {
            let seen = DIRECTIONS.map(|[along, across]| {
                let (sine, cosine) = crate::real::sin_cos(degrees.to_radians());
                // The direction's components along and across the flux.
                let (d, q) = (along * cosine - across * sine, along * sine + across * cosine);
                Henry(1.0 / (d * d / direct + q * q / quadrature))
            });
            let found = SeenInductances(seen).along_flux(ElectricalAngle::from_turns(degrees / 360.0));
            assert!((found.direct.0 / direct - 1.0).abs() < 1e-4, "{degrees}: {found:?}");
            assert!((found.quadrature.0 / quadrature - 1.0).abs() < 1e-4, "{degrees}: {found:?}");
        }
    }

    #[test]
    fn a_measurement_that_contradicts_the_angle_shows_in_the_residual() {
        let angle = ElectricalAngle::from_turns(0.1);
        let seen = |error: f32| {
            // Inverses 1.0 and 0.8 along and across the flux.
            let inverse = |turns: f32| 0.9 + 0.1 * crate::real::sin_cos(2.0 * TAU * (turns + 0.1)).1;
            let [along, across, between] = [0.0, 0.25, 0.125].map(|turns| Henry(1.0 / inverse(turns)));
            SeenInductances([along, across, Henry(between.0 * (1.0 + error))])
        };
        let found = |error| seen(error).along_flux(angle).residual;
        assert!(found(0.0) < 1e-6, "{}", found(0.0));
        // The inverse at 45 degrees, 0.805, falls by 1 %; its part is cos 72 degrees, over the mean of 0.9.
        assert!((found(0.01) - 0.0028).abs() < 1e-4, "{}", found(0.01));
    }

    #[test]
    fn a_swing_that_is_mostly_resistance_is_refused() {
        // At x = 0.5 the exponential has come to three quarters of its final value.
        assert!(found(1.0, 100e-6, 1.0).is_ok());
        assert_eq!(found(1.0, 50e-6, 1.0), Err(Refusal::MotorConstants));
        assert_eq!(found(1e-6, 20e-3, 1.0), Err(Refusal::MotorConstants), "beyond the range of a motor");
    }
}
