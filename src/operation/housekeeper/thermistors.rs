//! Thermistors of the motors: each check of the temperatures takes one conversion and starts the next.
//!
//! A winding is at least as hot as its thermistor, so readings raise the temperature of the thermal model and
//! never lower it. Each reading counts by an eighth, because noise would otherwise heat the model: it cools
//! only with its own time constant. A hotter thermistor acts after a second.
//!
//! A reading is bad if the code has no temperature, if it is [`STEP_K`] from the mean, or [`BEYOND_K`] above
//! the winding's limit: a wire with a partial short looks like heat. Bad readings count twice, and good ones
//! subtract one; [`WORN`] is a fault of the joint. Three bad ones in a row are a fault and two are not; if
//! every other one is bad, the fourth is. The mean begins with two readings that agree.
//!
//! Not detected: a thermistor that has come off its winding, or whose wire adds resistance, reads something
//! colder; a partial short between the limit and [`BEYOND_K`] above it is reported as heat.

use super::{Housekeeper, Level};
use crate::hal::Hardware;
use crate::real::abs;
use crate::safety::BoardFault;

/// Largest distance of a reading from the mean, K; a winding warms by less than 1 K in a reading's time.
const STEP_K: f32 = 20.0;
/// Largest excess over the winding's limit, K; the leg is off long before.
const BEYOND_K: f32 = 20.0;
/// Share of a new reading in the mean.
const SHARE: f32 = 0.125;
/// Count at which a thermistor is unreadable.
const WORN: u8 = 5;

/// Readings of one motor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Readings {
    /// Last reading before there is a mean, degrees Celsius.
    first_c: Option<f32>,
    /// Mean of the good ones, degrees Celsius.
    mean_c: Option<f32>,
    /// Twice the bad readings, less the good ones since.
    worn: u8,
}

impl Readings {
    /// Takes a reading; `None` without a temperature.
    fn take(&mut self, celsius: Option<f32>, limit_c: f32) {
        let reference = self.mean_c.or(self.first_c);
        let near = |celsius: f32| reference.is_some_and(|reference| abs(celsius - reference) <= STEP_K);
        match celsius {
            // Nothing to compare the first one with.
            Some(celsius) if reference.is_none() => self.first_c = Some(celsius),
            Some(celsius) if near(celsius) && celsius <= limit_c + BEYOND_K => {
                self.mean_c = self.mean_c.map(|mean| mean + SHARE * (celsius - mean)).or(Some(celsius));
                self.worn = self.worn.saturating_sub(1);
            }
            _ => {
                self.first_c = celsius;
                self.worn = self.worn.saturating_add(2);
            }
        }
    }
}

/// State between two checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorThermistors<const N: usize> {
    /// Axis of the conversion in progress.
    converting: Option<usize>,
    readings: [Readings; N],
}

impl<const N: usize> MotorThermistors<N> {
    pub(super) const NONE: Self =
        Self { converting: None, readings: [Readings { first_c: None, mean_c: None, worn: 0 }; N] };
}

impl<const N: usize> Housekeeper<N> {
    /// Takes the conversion that the last check started, and starts the next motor's.
    pub(super) fn check_thermistors(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let fitted = |axis: &usize| self.settings.thermistors.get(*axis).is_some_and(Option::is_some);
        let after = self.motor_thermistors.converting.map_or(0, |axis| axis + 1);
        let next = (after..N).chain(0..after.min(N)).find(fitted);
        if let Some(axis) = self.motor_thermistors.converting {
            let code = level.hardware.thermistor_code();
            self.take_reading(axis, code, level);
        }
        if let Some(axis) = next {
            level.hardware.convert_thermistor(axis);
        }
        self.motor_thermistors.converting = next;
    }

    /// Takes the code of an axis' thermistor; `None` if the conversion has not ended.
    fn take_reading(
        &mut self,
        axis: usize,
        code: Option<u16>,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) {
        let settings = &self.settings;
        let (Some(readings), Some(winding), Some(Some(thermistor)), Some(rating)) = (
            self.motor_thermistors.readings.get_mut(axis),
            self.windings.get_mut(axis),
            settings.thermistors.get(axis),
            settings.windings.get(axis),
        ) else {
            return;
        };
        readings.take(code.and_then(|code| thermistor.celsius(code)), rating.limit_c);
        if let Some(celsius) = readings.mean_c {
            winding.at_least(celsius);
        }
        if readings.worn >= WORN {
            level.signals.report(BoardFault::MotorThermistor, axis);
        }
    }
}
