//! Thermistors of the motors: one conversion at a time, with each check of the temperatures.
//!
//! A motor's winding is at least as hot as its thermistor, so a reading raises the temperature of the thermal
//! model and never lowers it. The lower of two readings counts: one disturbed conversion would heat the model
//! for minutes. A thermistor that is unreadable [`UNREADABLE`] times in a row is a fault of its joint.
//!
//! Not detected: a thermistor that has come off its winding and reads something colder.

use super::{Housekeeper, Level};
use crate::hal::Hardware;
use crate::real::min;
use crate::safety::BoardFault;

/// Unreadable conversions in a row that are a fault.
const UNREADABLE: u8 = 3;

/// State between two checks.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct MotorThermistors<const N: usize> {
    /// Axis of the conversion in progress.
    converting: Option<usize>,
    /// Last reading of each axis, degrees Celsius.
    last_c: [Option<f32>; N],
    /// Unreadable conversions of each axis in a row.
    unreadable: [u8; N],
}

impl<const N: usize> MotorThermistors<N> {
    pub(super) const NONE: Self = Self { converting: None, last_c: [None; N], unreadable: [0; N] };
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
        let thermistor = self.settings.thermistors.get(axis).and_then(Option::as_ref);
        let MotorThermistors { last_c, unreadable, .. } = &mut self.motor_thermistors;
        let (Some(last), Some(unreadable)) = (last_c.get_mut(axis), unreadable.get_mut(axis)) else {
            return;
        };
        let celsius = thermistor.zip(code).and_then(|(thermistor, code)| thermistor.celsius(code));
        if let (Some(winding), Some(before), Some(now)) = (self.windings.get_mut(axis), *last, celsius) {
            winding.at_least(min(before, now));
        }
        *last = celsius;
        *unreadable = if celsius.is_some() { 0 } else { unreadable.saturating_add(1) };
        if *unreadable >= UNREADABLE {
            level.signals.report(BoardFault::MotorThermistor, axis);
        }
    }
}
