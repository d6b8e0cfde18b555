//! Shunts that say the same for too long, and zeros that are none any more.
//!
//! ```text
//! stuck:  code as it was, while what is asked of its phase has changed by more than 1.25 * 4/3 t_d f V_bus / K_p, 1 A at least: 4 ticks of it
//! zero:   i0 += (i - i0) / 64 while the bridge is released;   |i0| > 2 A when it is to switch: refused
//! ```
//!
//! **Stuck** (C3). A phase whose current is zero stays there until its voltage outweighs the dead time, 4/3 t_d f V_bus (0.22 V on the board at
//! its highest bus): what is asked for has to be so much more that the loop's proportional part K_p (0.094 ohm on the default leg) gives that and a quarter more
//! at once, 2.9 A. (With 1 A a leg that stood still under its host was released once in 500 times.) After such a change the loop (1 kHz) has
//! moved a code by 17 in its third tick, so codes that agree in all four do so by noise with less than 1e-9 each time. A code that is stuck while nothing is asked to
//! change is right, and is not seen; slow changes are worth their voltage ([`super::ModelWatch`]).
//!
//! **Zero** (C1). With the bridge released no current flows: the low-pass (2.7 ms, settled to 2 % in 10 ms) has the shunts' drift
//! since the calibration, 43 codes of one shunt. DRV8301: 10 uV/K of drift are 1.2 A after 60 K, so 2 A is not yet a defect, and 3 N m at a
//! joint of the default leg. Noise of a code leaves 4 mA.
//!
//! Cost: two comparisons and two differences per tick.

use super::Stationary;
use crate::real::{abs, max};
use crate::units::{Ampere, Volt};

/// Ticks for which a code may stay while it should have moved, counted until it moves, less one.
const PATIENCE: u8 = 4;
/// Least that a phase has to be asked for anew, A.
const ASKED_A: f32 = 1.0;
/// Of the voltage that dead time takes from a phase; a quarter more.
const BEYOND_DEAD_TIME: f32 = 1.25 * 4.0 / 3.0;
/// Share of the low-pass.
const ZERO_SHARE: f32 = 1.0 / 64.0;
/// Longest vector that is no current, A.
const ZERO_A: f32 = 2.0;

/// One shunt.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shunt {
    code: u16,
    /// What was asked of its phase when the code was last another one.
    asked: f32,
    /// Ticks since it should have moved.
    overdue: u8,
}

/// The shunts of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ShuntWatch {
    shunts: [Shunt; 2],
    zero: Stationary<f32>,
}

impl ShuntWatch {
    /// Nothing seen yet.
    pub const EMPTY: Self = Self {
        // No code is that large.
        shunts: [Shunt { code: u16::MAX, asked: 0.0, overdue: 0 }; 2],
        zero: Stationary { alpha: 0.0, beta: 0.0 },
    };

    /// A tick in which the bridge is released.
    #[inline(always)]
    pub fn released(&mut self, currents: Stationary<Ampere>) {
        self.zero.alpha += ZERO_SHARE * (currents.alpha.0 - self.zero.alpha);
        self.zero.beta += ZERO_SHARE * (currents.beta.0 - self.zero.beta);
    }

    /// Before the bridge switches: whether what no current makes is none; the codes are looked at anew.
    pub fn begins_at_zero(&mut self) -> bool {
        self.shunts = Self::EMPTY.shunts;
        let Stationary { alpha, beta } = self.zero;
        alpha * alpha + beta * beta <= ZERO_A * ZERO_A
    }

    /// What a phase has to be asked for anew before its code has to move: see the module; `dead` is the mean of what dead time takes, `ohm`
    /// the loop's gain.
    #[must_use]
    pub fn asked(dead: Volt, ohm: f32) -> Ampere {
        Ampere(max(ASKED_A, BEYOND_DEAD_TIME * dead.0 / ohm))
    }

    /// A tick in which the bridge switches, with what is asked of the phases and how much of it has to show: whether a code is stuck.
    #[inline(always)]
    pub fn is_stuck(&mut self, codes: [u16; 2], target: Stationary<Ampere>, asked_a: f32) -> bool {
        let phases = target.to_phases();
        let [b, c] = &mut self.shunts;
        let b = b.is_stuck(codes[0], phases.b.0, asked_a);
        let c = c.is_stuck(codes[1], phases.c.0, asked_a);
        b || c
    }
}

impl Shunt {
    #[inline(always)]
    fn is_stuck(&mut self, code: u16, asked: f32, asked_a: f32) -> bool {
        if code != self.code {
            *self = Self { code, asked, overdue: 0 };
        } else if abs(asked - self.asked) > asked_a {
            self.overdue += 1;
        }
        self.overdue >= PATIENCE
    }
}
