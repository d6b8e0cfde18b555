//! Current control along a fixed angle, for a motor with unknown constants.
//!
//! ```text
//! v += k (i_target - i . n),   v n the voltage,   k = 10 V/(A s)
//! ```
//!
//! Along the axis of a phase the current across must show a wrong wiring, so only the current along is
//! controlled. Along any other angle dead time bends the current: up to 1.8 A for 50 mOhm at 48 V. There
//! the current across is controlled to zero as well ([`Hold::with_zero_across`]).
//!
//! Integral control alone is slow and needs neither R nor L. With them its damping is R / (2 sqrt(k L)): 1.6
//! for 50 mOhm and 25 uH, above 0.3 down to 10 mOhm. The target rises in 50 ms.

use super::{ElectricalAngle, Reading, Refusal, Stationary};
use crate::hal::CURRENT_RATE_HZ;
use crate::motor::Rotation;
use crate::units::{Ampere, Volt};

const INTEGRAL_V_PER_A: f32 = 10.0 / CURRENT_RATE_HZ as f32;
const RISE_PER_TICK: f32 = 20.0 / CURRENT_RATE_HZ as f32;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Hold {
    axis: Rotation,
    target_a: f32,
    volts: f32,
    /// Voltage across the angle; zero unless the current across is controlled.
    across_v: f32,
    controls_across: bool,
}

impl Hold {
    pub(super) fn along(angle: ElectricalAngle) -> Self {
        Self { axis: angle.rotation(), target_a: 0.0, volts: 0.0, across_v: 0.0, controls_across: false }
    }

    /// Holds the current along any angle and controls the current across to zero.
    pub(super) fn with_zero_across(angle: ElectricalAngle) -> Self {
        Self { controls_across: true, ..Self::along(angle) }
    }

    /// Runs one tick: moves the target towards `target` and adapts the voltage. The target's slope follows
    /// from the settings' holding current.
    ///
    /// # Errors [`Refusal::MotorConstants`] where the allowed voltage is insufficient.
    pub(super) fn tick(&mut self, reading: &Reading<'_>, target: Ampere) -> Result<(), Refusal> {
        let rise = reading.bench.settings.current.0 * RISE_PER_TICK;
        self.target_a += (target.0 - self.target_a).max(-rise).min(rise);
        self.volts += INTEGRAL_V_PER_A * (self.target_a - self.along_axis(reading.current).0);
        if self.controls_across {
            self.across_v -= INTEGRAL_V_PER_A * self.across_axis(reading.current).0;
        }
        let most = reading.bench.settings.voltage.0;
        if self.volts * self.volts + self.across_v * self.across_v > most * most {
            return Err(Refusal::MotorConstants);
        }
        Ok(())
    }

    /// Turns the angle; the voltage stays.
    pub(super) fn turn_to(&mut self, angle: ElectricalAngle) {
        self.axis = angle.rotation();
    }

    /// Component of a current along the angle.
    pub(super) fn along_axis(&self, current: Stationary<Ampere>) -> Ampere {
        current.to_rotating(self.axis).d
    }

    /// Component of a current a quarter turn ahead.
    pub(super) fn across_axis(&self, current: Stationary<Ampere>) -> Ampere {
        current.to_rotating(self.axis).q
    }

    pub(super) fn volts(&self) -> Volt {
        Volt(self.volts)
    }

    pub(super) fn voltage(&self) -> Stationary<Volt> {
        self.voltage_with(Volt::ZERO, Volt::ZERO)
    }

    /// The holding voltage plus components along and across the angle.
    pub(super) fn voltage_with(&self, along: Volt, across: Volt) -> Stationary<Volt> {
        super::Rotating { d: self.volts() + along, q: Volt(self.across_v) + across }.to_stationary(self.axis)
    }
}
