//! Current from the supply and into it, estimated from the powers of the axes, and its limits.
//!
//! Why an estimate: the board has no current sensor in its supply. A battery must be neither overloaded nor
//! charged beyond its limit.
//!
//! ```text
//! bridges += (sum of powers / V_bus - bridges) / 8        each servo tick: low-pass of 2 ms
//! current = bridges + duty V_bus / R_brake                 positive from the supply, negative into it
//!
//! brake duty >= (-bridges - 0.75 charge) R_brake / V_bus
//! share -= share clamp(current / limit - 0.9, -0.9, 4) / 40        within 1/64..=1; one share per direction
//! fault: current > 1.25 limit for 0.2 s
//! ```
//!
//! `duty` is what the resistor was given, so an absent or exhausted resistor takes nothing. A torque that
//! drives a joint keeps the share of the draw limit. A torque that a joint drives keeps that of the charge
//! limit.
//!
//! Why a share that integrates: a ramp over the current, like those of [`super::DeratingRamps`], has a loop
//! gain of the leg's greatest current over the ramp's width. With the delay of the loop a small limit would
//! oscillate. Here the gain is that of the logarithm, 1 to 2 for any leg and limit. The crossover is 100 to
//! 200 rad/s; filter and delay leave a phase margin of 60 degrees or more. A current above the limit by a
//! small amount is reduced slowly, by a large one within 10 ms.
//!
//! Reactions: too much draw damps the leg ([`super::FaultCode::SupplyCurrent`]). Too much charge shorts the
//! motors, which returns nothing to the supply ([`super::FaultCode::ChargeCurrent`]).
//!
//! Source of estimate and brake duty: ODrive v0.5.6 (`Ibus_sum`, `max_regen_current`,
//! `dc_max_positive_current`, `dc_max_negative_current`). There the excess is a fault at once.
//!
//! Known limits: iron, gate drivers, logic and a calibration are not in the powers. A wrong bus voltage
//! scales the estimate. Torque at the end of a range and damping are not reduced, only watched.
//! Cost: 36 instructions a tick, and some 120 more while a limit acts.

use super::fault::FaultCode;
use crate::hal::{GREATEST_BRAKE_DUTY, SERVO_RATE_HZ};
use crate::real::{clamp, is_finite};
use crate::units::{Ampere, Ohm, Volt};

/// Share of the low-pass per tick, 2 ms.
const NEW_SHARE: f32 = 1.0 / 8.0;
/// Change of a share per tick and relative excess, 10 ms.
const RATE: f32 = 1.0 / 40.0;
/// Share of a limit that the derating aims at; the rest is for errors of the estimate.
const AIM: f32 = 0.9;
/// Greatest relative excess that counts.
const MOST_EXCESS: f32 = 4.0;
/// Smallest share, from which it can rise again.
const LEAST_SHARE: f32 = 1.0 / 64.0;
/// Share of the charge limit above which the brake resistor takes the current.
const BRAKE_SHARE: f32 = 0.75;
/// Multiple of a limit, and servo ticks (0.2 s), that are a fault.
const FAULT_FACTOR: f32 = 1.25;
const FAULT_TICKS: u16 = (SERVO_RATE_HZ / 5) as u16;
/// Limits of the supply, and its brake resistor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SupplyLimits {
    /// Greatest current from the supply; `None` for no limit.
    pub draw: Option<Ampere>,
    /// Greatest current into the supply; `None` for a supply whose diode lets none in.
    pub charge: Option<Ampere>,
    /// Brake resistor.
    pub brake: Ohm,
}

impl SupplyLimits {
    /// No limit.
    pub const NONE: Self = Self { draw: None, charge: None, brake: Ohm(f32::INFINITY) };
}

/// One direction of the current.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Direction {
    /// Reciprocal of the limit, 1/A; zero without one.
    per_limit: f32,
    /// Remaining share of the torque.
    share: f32,
    /// Ticks in a row with a current that is a fault.
    beyond: u16,
}

impl Direction {
    fn new(limit: Option<Ampere>) -> Self {
        Self { per_limit: limit.map_or(0.0, |limit| 1.0 / limit.0), share: 1.0, beyond: 0 }
    }

    /// Runs one tick; returns whether the current has been too large for too long.
    fn advance(&mut self, current_a: f32) -> bool {
        let relative = current_a * self.per_limit;
        let excess = clamp(relative - AIM, -AIM, MOST_EXCESS);
        self.share = clamp(self.share - self.share * excess * RATE, LEAST_SHARE, 1.0);
        self.beyond = if relative > FAULT_FACTOR { self.beyond.saturating_add(1) } else { 0 };
        self.beyond >= FAULT_TICKS
    }
}

/// Estimate and limits of the supply current; see the module.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct SupplyCurrent {
    draw: Direction,
    charge: Direction,
    /// Current into the bridges, A, low-passed.
    bridges_a: f32,
    /// Current above which the torque is reduced, A.
    draw_from_a: f32,
    /// Charging current above which the brake resistor conducts, A.
    brake_from_a: f32,
    brake: Ohm,
    brake_siemens: f32,
    brake_duty: f32,
    /// A torque is reduced, or the brake resistor is wanted.
    limits: bool,
}

impl SupplyCurrent {
    /// State without current.
    pub fn new(limits: SupplyLimits) -> Self {
        let share = |limit: Option<Ampere>, share| limit.map_or(f32::INFINITY, |limit| share * limit.0);
        Self {
            draw: Direction::new(limits.draw),
            charge: Direction::new(limits.charge),
            bridges_a: 0.0,
            draw_from_a: share(limits.draw, AIM),
            brake_from_a: share(limits.charge, BRAKE_SHARE),
            brake: limits.brake,
            brake_siemens: 1.0 / limits.brake.0,
            brake_duty: 0.0,
            limits: false,
        }
    }

    /// Runs one servo tick with the sum of the axes' powers, W, and the duty that the brake resistor was
    /// given. Returns a current that has been too large for too long.
    #[inline(always)]
    pub fn advance(&mut self, power_w: f32, brake_given: f32, bus: Volt) -> Option<FaultCode> {
        let per_volt = 1.0 / if bus.0 > 1.0 { bus.0 } else { 1.0 };
        self.bridges_a += NEW_SHARE * (power_w * per_volt - self.bridges_a);
        let current_a = self.bridges_a + brake_given * bus.0 * self.brake_siemens;
        // NaN fails the comparisons.
        if current_a < self.draw_from_a && self.bridges_a > -self.brake_from_a && !self.limits {
            return None;
        }
        self.limit(current_a, per_volt)
    }

    /// Handles a current near a limit, or one that was.
    #[cold]
    #[inline(never)]
    fn limit(&mut self, current_a: f32, per_volt: f32) -> Option<FaultCode> {
        let [drawn_a, charged_a] = if is_finite(current_a) {
            [current_a, -current_a]
        } else {
            // An unknown current counts as too large in both directions.
            self.bridges_a = 0.0;
            [f32::INFINITY; 2]
        };
        let wanted = (-self.bridges_a - self.brake_from_a) * self.brake.0 * per_volt;
        self.brake_duty = clamp(wanted, 0.0, GREATEST_BRAKE_DUTY);
        let (drawn, charged) = (self.draw.advance(drawn_a), self.charge.advance(charged_a));
        self.limits = self.draw.share < 1.0 || self.charge.share < 1.0 || self.brake_duty > 0.0;
        if charged {
            Some(FaultCode::ChargeCurrent)
        } else if drawn {
            Some(FaultCode::SupplyCurrent)
        } else {
            None
        }
    }

    /// Least duty of the brake resistor.
    pub(crate) fn brake_duty(&self) -> f32 {
        self.brake_duty
    }

    /// Shares of a torque that drives a joint and of one that a joint drives.
    pub(crate) fn shares(&self) -> [f32; 2] {
        [self.draw.share, self.charge.share]
    }
}

#[cfg(test)]
mod tests;
