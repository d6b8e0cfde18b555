//! Detects shunts whose code is stuck, and drifted current-sensor offsets.
//!
//! ```text
//! stuck:  code unchanged for 4 ticks in which the phase's target differs from that at the code's last change
//!         by more than 1.25 * 4/3 t_d f V_bus / K_p, 1 A at least
//! zero:   i0 += (i - i0) / 64 while the outputs are off;   enabling refused where |i0| > 2 A
//! ```
//!
//! **Stuck** (C3). A phase at zero current stays there until its voltage outweighs the dead time's, 4/3 t_d f
//! V_bus. On the board at its highest bus that is 0.22 V. So the target must change until the loop's
//! proportional part gives that voltage and a quarter more at once. With K_p = 0.094 ohm of the default leg
//! that is 2.9 A, twice that at half the loop's bandwidth. (With 1 A, a leg at rest under host control was
//! turned off once in 500 times.)
//!
//! After such a change the loop (1 kHz) has moved a code by 17 in its third tick. Codes that agree in all
//! four ticks do so by noise with a probability below 1e-9 each time. A stuck code with a constant target is
//! right and not detected. Slow changes show in the voltage ([`super::ModelWatch`]).
//!
//! **Offset** (C1). With the outputs off no current flows, so the low-pass (2.7 ms, settled to 2 % in 10 ms)
//! measures the offset's drift since the calibration. The limit is 43 codes of one shunt. DRV8301: 10 uV/K of
//! drift are 1.2 A after 60 K. So 2 A, 3 N m at a joint of the default leg, is not yet a defect. Noise of one
//! code leaves 4 mA.
//!
//! Cost: two comparisons and two differences per tick.

use super::Stationary;
use crate::real::{abs, max};
use crate::units::{Ampere, Volt};

/// Ticks for which a code may stay unchanged while it should move.
const PATIENCE: u8 = 4;
/// Least change of a phase's target current that is evaluated, A.
const LEAST_CHANGE_A: f32 = 1.0;
/// Factor on the mean dead-time voltage: its vector of 4/3, and a quarter more.
const BEYOND_DEAD_TIME: f32 = 1.25 * 4.0 / 3.0;
/// Share of a new sample in the low-pass.
const ZERO_SHARE: f32 = 1.0 / 64.0;
/// Longest offset vector at which enabling is allowed, A.
const ZERO_A: f32 = 2.0;

/// State of one shunt.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Shunt {
    code: u16,
    /// Target current of its phase at the code's last change.
    target: f32,
    /// Ticks since it should have moved.
    overdue: u8,
}

/// Shunt checks of one axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct ShuntWatch {
    shunts: [Shunt; 2],
    zero: Stationary<f32>,
}

impl ShuntWatch {
    /// State before the first tick.
    pub(crate) const EMPTY: Self = Self {
        // Larger than any code.
        shunts: [Shunt { code: u16::MAX, target: 0.0, overdue: 0 }; 2],
        zero: Stationary { alpha: 0.0, beta: 0.0 },
    };

    /// Updates the offset in a tick with the outputs off.
    #[inline(always)]
    pub(crate) fn disabled(&mut self, currents: Stationary<Ampere>) {
        self.zero.alpha += ZERO_SHARE * (currents.alpha.0 - self.zero.alpha);
        self.zero.beta += ZERO_SHARE * (currents.beta.0 - self.zero.beta);
    }

    /// Before the bridge switches: whether the offset is within its limit. Also restarts the check
    /// for stuck codes.
    pub(crate) fn begins_at_zero(&mut self) -> bool {
        self.shunts = Self::EMPTY.shunts;
        let Stationary { alpha, beta } = self.zero;
        alpha * alpha + beta * beta <= ZERO_A * ZERO_A
    }

    /// Change of a phase's target current beyond which its code must move; see the module. `dead` is the mean
    /// voltage that dead time takes, `ohm` the loop's proportional gain.
    pub(crate) fn target_change(dead: Volt, ohm: f32) -> Ampere {
        Ampere(max(LEAST_CHANGE_A, BEYOND_DEAD_TIME * dead.0 / ohm))
    }

    /// Whether a code is stuck, in a tick in which the bridge switches; `least_change_a` is the
    /// change of [`Self::target_change`].
    #[inline(always)]
    pub(crate) fn is_stuck(
        &mut self,
        codes: [u16; 2],
        target: Stationary<Ampere>,
        least_change_a: f32,
    ) -> bool {
        let phases = target.to_phases();
        let [b, c] = &mut self.shunts;
        let b = b.is_stuck(codes[0], phases.b.0, least_change_a);
        let c = c.is_stuck(codes[1], phases.c.0, least_change_a);
        b || c
    }
}

impl Shunt {
    #[inline(always)]
    fn is_stuck(&mut self, code: u16, target: f32, least_change_a: f32) -> bool {
        if code != self.code {
            *self = Self { code, target, overdue: 0 };
        } else if abs(target - self.target) > least_change_a {
            self.overdue += 1;
        }
        self.overdue >= PATIENCE
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn offsets_up_to_2_a_in_any_direction_may_begin() {
        for (alpha, beta, begins) in [
            (1.99, 0.0, true),
            (0.0, -1.99, true),
            (-1.4, 1.4, true),
            (2.01, 0.0, false),
            (0.0, -2.01, false),
            (0.5, 1.95, false),
            (f32::NAN, 0.0, false),
        ] {
            let zero = Stationary { alpha, beta };
            let mut watch = ShuntWatch { zero, ..ShuntWatch::EMPTY };
            assert_eq!(watch.begins_at_zero(), begins, "{zero:?}");
        }
    }
}
