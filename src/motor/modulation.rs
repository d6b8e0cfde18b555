//! Space-vector modulation: from a voltage to the duties of three half-bridges.
//!
//! Why a common shift: only differences between phases reach the motor, so all three may be moved together.
//! Centring the largest and the smallest about one half gives the waveform of space-vector modulation. The
//! voltage gain over a sine against the midpoint is 2/sqrt(3).
//!
//! ```text
//! x = phases(v) / V_bus
//! shift = 1/2 - (max x + min x) / 2,   lowered where max x + shift exceeds d_max
//! duty = x + shift + t_d f clamp(i_target / band)                        dead-time compensation
//! |v| <= V_bus (d_max - 2 t_d f) / sqrt(3)                               largest circle within that hexagon
//! ```
//!
//! **Minimum zero vector.** The shunts lie below the low sides, and are sampled in the middle of the time in
//! which all three conduct. Dead time and the amplifier's settling must fit between the last high side's
//! turn-off and that middle. The converter's sampling and conversion must fit after it:
//!
//! ```text
//! (1 - d_max) / (2 f) >= max(t_d + t_settle, t_adc)
//! ```
//!
//! Numbers: 119 ns + 1.2 us settling. The settling time is assumed for the DRV8301 at 40 V/V to 1 % of 2 V
//! and to be measured on the board. If it were 0.3 us longer, it would lower d_max by 0.0144, 1.5 % of the
//! voltage. After the middle, [`SHUNT_TRIGGER_CLOCKS`] and 3 + 12 cycles of 21 MHz: 0.83 us. So at 24 kHz
//! d_max = 0.9367.
//!
//! Duties are centred about one half and not about d_max / 2: only equal zero vectors make the sample the
//! mean of the ripple. With a shift s the error is v s / (2 L f) at most; a shift arises only above 0.873 of
//! the largest voltage.
//!
//! **Dead time** takes t_d f V_bus from a phase with current out of the bridge, and adds it to one with
//! current into it. At 119 ns that is 0.14 V of 48 V. Compensation uses the sign of the *target* current,
//! smooth within `band`. With the measured current it would act as a negative resistance of V_d / band, which
//! the loop would have to outweigh.
//!
//! The circle leaves up to 1 - sqrt(3)/2 of the hexagon unused at its corners; using it would put a sixth
//! harmonic on the torque.
//! Source: van der Broeck, Skudelny, Stanke (1988); dead time: Sukegawa et al. (1991).

use super::{Phases, Stationary};
use crate::hal::{BRIDGE_CLOCK_HZ, CURRENT_RATE_HZ, SHUNT_TRIGGER_CLOCKS};
use crate::units::{Ampere, Second, Volt};

const ONE_OVER_SQRT_3: f32 = 0.577_350_26;
/// Units of one band of dead-time compensation: the currents at which a conversion to `i32` saturates.
const BAND: f32 = 2_147_483_648.0;

/// Times that the bridge and the converter need in a PWM period.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BridgeTiming {
    /// Dead time: both sides are off for this long at every edge.
    pub dead_time: Second,
    /// Time from a phase current's commutation to a settled shunt amplifier.
    pub(crate) settling: Second,
    /// From the middle of the lower zero vector to the end of the conversion.
    pub conversion: Second,
    /// Resolution of a duty, as share of a period.
    pub(crate) duty_step: f32,
}

impl BridgeTiming {
    /// ODrive v3.6. Dead time: 20 cycles of 168 MHz. Settling: DRV8301 at 40 V/V. Conversion: the trigger and
    /// 15 cycles of 21 MHz. Duty: 3,500 steps up and as many down.
    pub const ODRIVE_3_6: Self = Self {
        dead_time: Second(119e-9),
        settling: Second(1.2e-6),
        conversion: Second(SHUNT_TRIGGER_CLOCKS as f32 / BRIDGE_CLOCK_HZ as f32 + 15.0 / 21e6),
        duty_step: 1.0 / 3500.0,
    };
}

/// Treatment of the bridge's dead time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum DeadTime {
    /// No compensation; the current loop corrects it.
    Uncompensated,
    /// Compensated by the sign of the target's phase currents, smooth within a band.
    Compensated {
        /// Half the width of the transition, positive.
        band: Ampere,
    },
}

/// Constants of the modulator; see the module's equations.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Modulator {
    greatest_duty: f32,
    circle_per_bus: f32,
    /// Duty lost to dead time; 0 without compensation.
    dead_duty: f32,
    /// Duty lost to dead time per unit of [`BAND`].
    dead_duty_per_unit: f32,
    /// Units of [`BAND`] per ampere.
    units_per_ampere: f32,
    duty_step: f32,
}

impl Modulator {
    /// Returns `None` unless at least half of the period remains for conduction and the band is positive.
    pub fn new(timing: BridgeTiming, dead_time: DeadTime) -> Option<Self> {
        let rate = CURRENT_RATE_HZ as f32;
        let before = timing.dead_time.0 + timing.settling.0;
        let greatest_duty = 1.0 - 2.0 * rate * before.max(timing.conversion.0);
        let (dead_duty, units_per_ampere) = match dead_time {
            DeadTime::Uncompensated => (0.0, 0.0),
            DeadTime::Compensated { band } => (timing.dead_time.0 * rate, BAND / band.0),
        };
        let times = [timing.dead_time, timing.settling, timing.conversion];
        let sensible = times.iter().all(|time| (0.0..1.0).contains(&time.0))
            && greatest_duty >= 0.5
            && (0.0..=100.0 * BAND).contains(&units_per_ampere)
            && (0.0..=0.01).contains(&timing.duty_step)
            && dead_duty < 0.1;
        let circle_per_bus = (greatest_duty - 2.0 * dead_duty) * ONE_OVER_SQRT_3;
        sensible.then_some(Self {
            greatest_duty,
            circle_per_bus,
            dead_duty,
            dead_duty_per_unit: dead_duty / BAND,
            units_per_ampere,
            duty_step: timing.duty_step,
        })
    }

    /// Smallest change of a duty, as share of a period.
    pub(crate) const fn duty_step(&self) -> f32 {
        self.duty_step
    }

    /// Longest voltage vector that is available in any direction.
    pub fn voltage_limit(&self, bus: Volt) -> Volt {
        bus * self.circle_per_bus
    }

    /// Computes the duties of A, B and C for a voltage. `per_bus` is one over the bus voltage, `target` the
    /// target current while they act. A voltage that is not finite gives duties that are NaN.
    #[inline(always)]
    pub fn duties(&self, voltage: Stationary<Volt>, per_bus: f32, target: Stationary<Ampere>) -> [f32; 3] {
        let Phases { a, b, c } =
            Stationary { alpha: voltage.alpha.0 * per_bus, beta: voltage.beta.0 * per_bus }.to_phases();
        let (low, high) = if a < b { (a, b) } else { (b, a) };
        let low = if c < low { c } else { low };
        let high = if c > high { c } else { high };
        let mut shift = 0.5 - 0.5 * (low + high);
        let room = self.greatest_duty - self.dead_duty - high;
        if shift > room {
            shift = room;
        }
        let current = Stationary {
            alpha: target.alpha.0 * self.units_per_ampere,
            beta: target.beta.0 * self.units_per_ampere,
        };
        let current = current.to_phases();
        // The conversion to an integer saturates at plus and minus one band.
        let given =
            |wanted: f32, current: f32| wanted + shift + self.dead_duty_per_unit * (current as i32) as f32;
        let duties = [given(a, current.a), given(b, current.b), given(c, current.c)];
        // Bounds on all three duties: smallest minus and largest plus the full dead time. Mostly these are
        // within range.
        let within =
            low + shift - self.dead_duty >= 0.0 && high + shift + self.dead_duty <= self.greatest_duty;
        let [a, b, c] = duties;
        if within { duties } else { [self.limited(a), self.limited(b), self.limited(c)] }
    }

    /// Makes every further duty NaN. Host only; row N1 of docs/safety.md.
    #[cfg(not(target_os = "none"))]
    pub(super) const fn invalidate(&mut self) {
        (self.dead_duty, self.dead_duty_per_unit) = (f32::NAN, f32::NAN);
    }

    /// Clamps to 0 and the greatest duty. NaN stays NaN, for the caller's check.
    #[inline(always)]
    fn limited(&self, duty: f32) -> f32 {
        if duty < 0.0 {
            0.0
        } else if duty > self.greatest_duty {
            self.greatest_duty
        } else {
            duty
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::real::{sin_cos, sqrt};

    const PLAIN: DeadTime = DeadTime::Uncompensated;
    const NO_CURRENT: Stationary<Ampere> = Stationary { alpha: Ampere::ZERO, beta: Ampere::ZERO };

    fn at(length: f32, degrees: usize) -> Stationary<Volt> {
        let (sine, cosine) = sin_cos((degrees as f32).to_radians());
        Stationary { alpha: Volt(length * cosine), beta: Volt(length * sine) }
    }

    #[test]
    fn duties_give_the_requested_voltage_up_to_the_limit() {
        let modulator = Modulator::new(BridgeTiming::ODRIVE_3_6, PLAIN).expect("usual");
        let limit = modulator.voltage_limit(Volt(48.0)).0;
        for share in [0.0, 0.1, 0.5, 0.87, 0.999] {
            for degrees in 0..360 {
                let wanted = at(share * limit, degrees);
                let [a, b, c] =
                    modulator.duties(wanted, 1.0 / 48.0, NO_CURRENT).map(|duty| Volt(duty * 48.0));
                let given = Phases { a, b, c }.to_stationary();
                let error = (given.alpha - wanted.alpha).abs().0.max((given.beta - wanted.beta).abs().0);
                assert!(error < 1e-5 * 48.0, "{share} at {degrees}: {error} V");
            }
        }
    }

    #[test]
    fn the_low_sides_always_conduct_long_enough_to_be_read_and_no_duty_leaves_its_range() {
        for dead_time in [PLAIN, DeadTime::Compensated { band: Ampere(0.5) }] {
            let modulator = Modulator::new(BridgeTiming::ODRIVE_3_6, dead_time).expect("usual");
            // Expected: 2 * (0.119 + 1.2) us of 41.667 us.
            assert!((modulator.greatest_duty - 0.9367).abs() < 1e-4, "{}", modulator.greatest_duty);
            for length in [5.0, 25.0, 1000.0, f32::INFINITY, f32::NAN] {
                for degrees in 0..360 {
                    let target = Stationary { alpha: Ampere(60.0), beta: Ampere(-20.0) };
                    let duties = modulator.duties(at(length, degrees), 1.0 / 48.0, target);
                    let within = |duty: &f32| (0.0..=modulator.greatest_duty).contains(duty);
                    if length.is_finite() {
                        assert!(duties.iter().all(within), "{duties:?}");
                    } else {
                        // An invalid voltage shows as an invalid duty.
                        assert!(duties.iter().any(|duty| duty.is_nan()), "{duties:?}");
                    }
                }
            }
        }
    }

    #[test]
    fn zero_vectors_are_equal_as_long_as_the_sample_leaves_room() {
        let modulator = Modulator::new(BridgeTiming::ODRIVE_3_6, PLAIN).expect("usual");
        let limit = modulator.voltage_limit(Volt(48.0)).0;
        for degrees in 0..360 {
            let duties = modulator.duties(at(0.87 * limit, degrees), 1.0 / 48.0, NO_CURRENT);
            let (low, high) = duties.iter().fold((1.0_f32, 0.0_f32), |(l, h), &d| (l.min(d), h.max(d)));
            assert!((low + high - 1.0).abs() < 1e-6, "{degrees}: {low} {high}");
        }
    }

    #[test]
    fn dead_time_compensation_follows_the_sign_of_each_phase_smoothly_through_zero() {
        let modulator = Modulator::new(BridgeTiming::ODRIVE_3_6, DeadTime::Compensated { band: Ampere(0.5) })
            .expect("usual");
        let duties = |current| modulator.duties(at(0.0, 0), 1.0 / 48.0, current);
        // Expected: 119 ns of 41.667 us.
        let full = 119e-9 * CURRENT_RATE_HZ as f32;
        let [a, b, c] = duties(Stationary { alpha: Ampere(10.0), beta: Ampere::ZERO });
        assert!((a - 0.5 - full).abs() < 1e-6 && (b - 0.5 + full).abs() < 1e-6 && (c - b).abs() < 1e-7);
        let [a, ..] = duties(Stationary { alpha: Ampere(-0.25), beta: Ampere::ZERO });
        assert!((a - 0.5 + 0.5 * full).abs() < 1e-6);
        assert_eq!(duties(NO_CURRENT), [0.5; 3]);
    }

    #[test]
    fn duties_are_those_of_each_phase_limited_by_itself_to_the_last_bit() {
        let band = Ampere(0.5);
        let modulator =
            Modulator::new(BridgeTiming::ODRIVE_3_6, DeadTime::Compensated { band }).expect("usual");
        let limit = modulator.voltage_limit(Volt(48.0)).0;
        let (mut limited, mut free) = (0, 0);
        for share in [0.0, 0.5, 0.99, 1.0, 1.003, 1.2, 30.0] {
            for degrees in 0..720 {
                let target = at(0.7, 7 * degrees);
                let target = Stationary { alpha: Ampere(target.alpha.0), beta: Ampere(target.beta.0) };
                let voltage = at(share * limit, degrees);
                let duties = modulator.duties(voltage, 1.0 / 48.0, target);
                let per_bus = 1.0 / 48.0;
                let wanted = Stationary { alpha: voltage.alpha.0 * per_bus, beta: voltage.beta.0 * per_bus }
                    .to_phases();
                let in_bands =
                    Stationary { alpha: target.alpha.0 * 2.0, beta: target.beta.0 * 2.0 }.to_phases();
                let (low, high) =
                    (wanted.a.min(wanted.b).min(wanted.c), wanted.a.max(wanted.b).max(wanted.c));
                let room = modulator.greatest_duty - modulator.dead_duty - high;
                let shift = (0.5 - 0.5 * (low + high)).min(room);
                let expected = [(wanted.a, in_bands.a), (wanted.b, in_bands.b), (wanted.c, in_bands.c)].map(
                    |(wanted, current)| {
                        let duty = wanted + shift + modulator.dead_duty * current.clamp(-1.0, 1.0);
                        limited += u32::from(duty != duty.clamp(0.0, modulator.greatest_duty));
                        free += u32::from(duty == duty.clamp(0.0, modulator.greatest_duty));
                        duty.clamp(0.0, modulator.greatest_duty)
                    },
                );
                assert_eq!(duties, expected, "{share} at {degrees}");
            }
        }
        assert!(limited > 1000 && free > 1000, "{limited} {free}");
    }

    #[test]
    fn the_circle_touches_the_hexagon() {
        let modulator = Modulator::new(BridgeTiming::ODRIVE_3_6, PLAIN).expect("usual");
        let limit = modulator.voltage_limit(Volt(48.0)).0;
        // The tightest direction is between two phases' axes: at 30 degrees the span is sqrt(3)
        // of the length.
        let [a, _, c] = modulator.duties(at(limit, 30), 1.0 / 48.0, NO_CURRENT);
        assert!((a - modulator.greatest_duty).abs() < 1e-5 && c.abs() < 1e-5, "{a} {c}");
        assert!((limit * sqrt(3.0) / 48.0 - modulator.greatest_duty).abs() < 1e-5);
    }

    #[test]
    fn timing_that_leaves_no_room_is_refused() {
        let timing = BridgeTiming::ODRIVE_3_6;
        assert_eq!(Modulator::new(BridgeTiming { settling: Second(12e-6), ..timing }, PLAIN), None);
        assert_eq!(Modulator::new(BridgeTiming { dead_time: Second(f32::NAN), ..timing }, PLAIN), None);
        assert_eq!(Modulator::new(timing, DeadTime::Compensated { band: Ampere(0.0) }), None);
    }
}
