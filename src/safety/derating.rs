//! Derating: reduces the requested torque while a bridge or winding is hot, the bus voltage is low or high,
//! or the supply current is near its limit.
//!
//! Why ramps and not switches: a drive that turns off at a threshold drops its leg. A drive that weakens well
//! before it warns the wearer and mostly never reaches the threshold.
//!
//! ```text
//! ramp(x) = clamp((x - none) / (all - none), 0, 1)
//! |torque| <= cap * ramp(bridge) * joint * ramp(bus, low) * draw        where it drives the joint
//! |torque| <= cap * ramp(bridge) * joint * ramp(bus, high) * charge     where the joint drives it
//! joint = ramp(winding) * share of the first motion
//! draw, charge                   shares that the supply current leaves (super::SupplyCurrent)
//! ```
//!
//! Applied to the request before range and speed are checked ([`super::Barrier`]): stopping a joint at its
//! end and damping keep the whole cap. NaN leaves no torque.
//!
//! Active limits are reported as [`LimitCode`]s. They are no faults: they do not latch and need no reset.
//! Cost: the ramps where temperature and bus voltage are checked. The monitor adds a product, two comparisons
//! and a choice per joint.

use super::barrier::Limited;
use super::limits::JointLimits;
use crate::listed::listed;
use crate::real::{abs, max};
use crate::units::Volt;

listed! {
    /// A limit that reduces the request. Numbers never change.
    #[repr(u8)]
    pub enum LimitCode {
        /// All codes, in the table's order.
        ALL,
        /// Word used in records.
        name;
        /// Torque limit of the joint.
        Torque = 1, "torque";
        /// Current limit of the motor, where it is reached before the torque limit.
        Current = 2, "current";
        /// Speed limit of the joint.
        Speed = 3, "speed";
        /// The joint could otherwise not stop within its range.
        Position = 4, "position";
        /// A bridge is hot.
        Temperature = 5, "temperature";
        /// The bus voltage is low.
        BusLow = 6, "bus_low";
        /// The bus voltage is high.
        BusHigh = 7, "bus_high";
        /// The motor's winding is hot (`Winding`).
        Winding = 8, "winding";
        /// The motor's rotor angle is stored and has not been proven by a motion (`motor::Axis`).
        FirstMotion = 9, "first_motion";
        /// The current from the supply is near its limit (`SupplyCurrent`).
        SupplyCurrent = 10, "supply_current";
        /// The current into the supply is near its limit.
        ChargeCurrent = 11, "charge_current";
    }
}

/// A set of codes: bit n for code n.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LimitCodes(u16);

impl LimitCodes {
    /// Returns whether the set contains a code.
    pub const fn contains(self, code: LimitCode) -> bool {
        self.0 & 1 << code as u8 != 0
    }

    /// Adds a code if `holds`.
    pub const fn with(self, holds: bool, code: LimitCode) -> Self {
        Self(self.0 | (holds as u16) << code as u8)
    }

    /// Removes the codes of another set.
    pub(crate) const fn without(self, others: Self) -> Self {
        Self(self.0 & !others.0)
    }

    /// Returns the code with the lowest number.
    pub(crate) fn first(self) -> Option<LimitCode> {
        // Codes start at 1, so an empty set gives 15 or more, and no entry.
        LimitCode::ALL.get((self.0.trailing_zeros() as usize).wrapping_sub(1)).copied()
    }

    /// Codes of the limits that reduced a joint's request.
    #[inline(never)]
    pub fn new<const N: usize>(
        limited: &Limited,
        limits: &JointLimits,
        derating: &Derating<N>,
        joint: usize,
    ) -> Self {
        if !limited.any() {
            return Self::default();
        }
        let by_current = limits.current.0 * abs(limits.torque_per_ampere.0) < limits.torque.0;
        Self::default()
            .with(limited.torque && !by_current, LimitCode::Torque)
            .with(limited.torque && by_current, LimitCode::Current)
            .with(limited.speed, LimitCode::Speed)
            .with(limited.range, LimitCode::Position)
            .with(limited.derated && derating.bridge < 1.0, LimitCode::Temperature)
            .with(limited.derated && derating.of_joint(joint).winding < 1.0, LimitCode::Winding)
            .with(limited.derated && derating.first_motion(joint) < 1.0, LimitCode::FirstMotion)
            .with(limited.derated && derating.low < 1.0, LimitCode::BusLow)
            .with(limited.derated && derating.high < 1.0, LimitCode::BusHigh)
            .with(limited.derated && derating.supply[0] < 1.0, LimitCode::SupplyCurrent)
            .with(limited.derated && derating.supply[1] < 1.0, LimitCode::ChargeCurrent)
    }
}

/// Remaining shares of one joint's torque cap by its motor, 0..=1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JointShares {
    /// Share that the winding's temperature permits.
    pub(crate) winding: f32,
    /// Share that is permitted until the rotor angle is proven, and while the limit rises afterwards.
    pub(crate) first_motion: f32,
}

impl JointShares {
    /// The whole cap.
    pub(crate) const ALL: Self = Self { winding: 1.0, first_motion: 1.0 };
    const NONE: Self = Self { winding: 0.0, first_motion: 0.0 };
}

/// Remaining shares of the joints' torque caps, 0..=1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Derating<const N: usize> {
    bridge: f32,
    low: f32,
    high: f32,
    /// Shares of the draw limit and of the charge limit.
    supply: [f32; 2],
    joints: [JointShares; N],
}

impl<const N: usize> Derating<N> {
    /// No derating.
    pub const NONE: Self =
        Self { bridge: 1.0, low: 1.0, high: 1.0, supply: [1.0; 2], joints: [JointShares::ALL; N] };

    /// Adds the shares of a torque that drives a joint and of one that a joint drives, by the supply current.
    pub const fn with_supply(self, supply: [f32; 2]) -> Self {
        Self { supply, ..self }
    }

    /// Shares of a joint for a torque that drives it and for one that it drives.
    pub(crate) fn shares(&self, joint: usize) -> [f32; 2] {
        let JointShares { winding, first_motion } = self.of_joint(joint);
        let both = self.bridge * winding * first_motion;
        let [draw, charge] = self.supply;
        [both * self.low * draw, both * self.high * charge]
    }

    /// Share of a joint's current until its rotor angle is proven.
    pub(crate) fn first_motion(&self, joint: usize) -> f32 {
        self.of_joint(joint).first_motion
    }

    fn of_joint(&self, joint: usize) -> JointShares {
        self.joints.get(joint).copied().unwrap_or(JointShares::NONE)
    }
}

/// Linear ramp from the full share to none.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Ramp {
    all: f32,
    per_unit: f32,
}

impl Ramp {
    /// A ramp with share 1 at `all` and 0 at `none`. Equal ends panic, in a constant at compile time.
    pub const fn new(all: f32, none: f32) -> Self {
        assert!(all < none || none < all, "a ramp has two ends");
        Self { all, per_unit: 1.0 / (none - all) }
    }

    /// Remaining share at a value; 0 for NaN.
    #[inline(never)]
    pub(crate) fn share(&self, value: f32) -> f32 {
        let taken = (value - self.all) * self.per_unit;
        // NaN fails the comparison and takes the second branch.
        if taken < 1.0 { 1.0 - max(taken, 0.0) } else { 0.0 }
    }
}

/// Derating ramps of a board.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DeratingRamps {
    /// Over the temperature of the hottest bridge, degrees Celsius.
    pub(crate) temperature_c: Ramp,
    /// Over a falling bus voltage, V.
    pub(crate) low: Ramp,
    /// Over a rising bus voltage, V.
    pub(crate) high: Ramp,
}

impl DeratingRamps {
    /// Creates the ramps from pairs of full share and none. Equal ends panic, in a constant at compile time.
    pub const fn new(temperature_c: [f32; 2], low: [Volt; 2], high: [Volt; 2]) -> Self {
        Self {
            temperature_c: Ramp::new(temperature_c[0], temperature_c[1]),
            low: Ramp::new(low[0].0, low[1].0),
            high: Ramp::new(high[0].0, high[1].0),
        }
    }

    /// Shares at a temperature of the bridges (degrees Celsius) and a bus voltage, with those of each joint.
    pub fn at<const N: usize>(&self, temperature_c: f32, bus: Volt, joints: [JointShares; N]) -> Derating<N> {
        Derating {
            bridge: self.temperature_c.share(temperature_c),
            joints,
            low: self.low.share(bus.0),
            high: self.high.share(bus.0),
            supply: [1.0; 2],
        }
    }
}

/// Detects a failing supply: the bus voltage fell by a fifth of its own average.
///
/// ```text
/// slow += (bus - slow) / 4096 each tick (1 s);      bus < 0.8 slow, four ticks in a row (1 ms)
/// ```
///
/// Why relative: a supply may deliver 22 V or 50 V. A load of 40 A takes 2 V from an intact one, much less
/// than a fifth. At 48 V and 1.5 mF the capacitor still holds 0.6 of 1.7 J above the 20 V at which the
/// bridges turn off. Together with what a moving leg returns, that suffices to start damping. A bus that
/// falls by less than a fifth per second is left to the ramp.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct SupplyWatch {
    slow_v: f32,
    fallen: u8,
}

impl SupplyWatch {
    /// Runs one servo tick and returns whether the supply is failing; true once per drop.
    pub fn check(&mut self, bus: Volt) -> bool {
        const SHARE: f32 = 1.0 / 4096.0;
        const LOST: f32 = 0.8;
        const PATIENCE: u8 = 4;
        if self.slow_v == 0.0 {
            self.slow_v = bus.0;
        }
        self.slow_v += SHARE * (bus.0 - self.slow_v);
        self.fallen = if bus.0 < LOST * self.slow_v { PATIENCE.min(self.fallen).wrapping_add(1) } else { 0 };
        self.fallen == PATIENCE
    }
}

#[cfg(test)]
pub(crate) mod tests {
    use super::super::limits::tests::HIP;
    use super::*;

    pub(crate) const RAMPS: DeratingRamps = DeratingRamps {
        temperature_c: Ramp::new(80.0, 100.0),
        low: Ramp::new(24.0, 21.0),
        high: Ramp::new(55.0, 57.5),
    };

    #[test]
    fn shares_follow_their_ramps_and_nan_leaves_none() {
        let left = |temperature, bus| RAMPS.at(temperature, Volt(bus), [JointShares::ALL]).shares(0);
        assert_eq!(left(25.0, 48.0), [1.0; 2]);
        for (temperature, bus, expected) in [
            (90.0, 48.0, [0.5, 0.5]),
            (100.0, 48.0, [0.0, 0.0]),
            (25.0, 22.5, [0.5, 1.0]),
            (25.0, 56.25, [1.0, 0.5]),
            (25.0, 10.0, [0.0, 1.0]),
            (f32::NAN, 48.0, [0.0, 0.0]),
            (25.0, f32::NAN, [0.0, 0.0]),
        ] {
            let left = left(temperature, bus);
            assert!(left.iter().zip(expected).all(|(one, other)| (one - other).abs() < 1e-5), "{left:?}");
        }
    }

    #[test]
    fn a_joints_shares_and_those_of_the_board_are_multiplied() {
        let half = JointShares { winding: 0.5, first_motion: 0.5 };
        let derating = RAMPS.at(90.0, Volt(22.5), [JointShares::ALL, half]);
        assert_eq!([0, 1, 2].map(|joint| derating.shares(joint)), [[0.25, 0.5], [0.0625, 0.125], [0.0; 2]]);
        assert_eq!(derating.with_supply([0.5, 0.25]).shares(0), [0.125, 0.125]);
    }

    #[test]
    fn every_limit_has_its_code() {
        let none = Limited::default();
        let usual = [JointShares::ALL];
        let hot = RAMPS.at(90.0, Volt(48.0), usual);
        let of = |limited: Limited, derating: &Derating<1>| LimitCodes::new(&limited, &HIP, derating, 0).0;
        assert_eq!(of(none, &hot), 0, "nothing was limited");
        assert_eq!(of(Limited { torque: true, ..none }, &Derating::NONE), 1 << 1);
        let weak = JointLimits { current: crate::units::Ampere(40.0), ..HIP };
        let codes = LimitCodes::new(&Limited { torque: true, ..none }, &weak, &Derating::<1>::NONE, 0);
        assert_eq!(codes.0, 1 << 2);
        assert_eq!(of(Limited { speed: true, range: true, ..none }, &Derating::NONE), 1 << 3 | 1 << 4);
        assert_eq!(of(Limited { derated: true, ..none }, &hot), 1 << 5);
        assert_eq!(of(Limited { derated: true, ..none }, &RAMPS.at(25.0, Volt(22.0), usual)), 1 << 6);
        assert_eq!(of(Limited { derated: true, ..none }, &RAMPS.at(25.0, Volt(56.0), usual)), 1 << 7);
        let joint = |joint| RAMPS.at(25.0, Volt(48.0), [joint]);
        let winding = joint(JointShares { winding: 0.9, ..JointShares::ALL });
        assert_eq!(of(Limited { derated: true, ..none }, &winding), 1 << 8);
        let first = joint(JointShares { first_motion: 0.25, ..JointShares::ALL });
        assert_eq!(of(Limited { derated: true, ..none }, &first), 1 << 9);
        for (supply, code) in [([0.9, 1.0], 10), ([1.0, 0.9], 11)] {
            let supplied = Derating::NONE.with_supply(supply);
            assert_eq!(of(Limited { derated: true, ..none }, &supplied), 1 << code);
        }
    }

    #[test]
    fn a_failing_supply_is_detected_and_a_load_is_not() {
        let mut watch = SupplyWatch::default();
        assert!((0..8000).all(|_| !watch.check(Volt(48.0))));
        // 40 A at 50 mOhm, and the rise after a stop.
        assert!([46.0, 54.0, 48.0, 44.0].into_iter().all(|bus| (0..400).all(|_| !watch.check(Volt(bus)))));
        // 3 V per millisecond.
        let mut bus = 48.0;
        let mut ticks = 0;
        while !watch.check(Volt(bus)) {
            bus -= 0.75;
            ticks += 1;
            assert!(ticks < 40);
        }
        assert!((34.0..38.5).contains(&bus), "{bus} V");
        assert!((0..400).all(|_| !watch.check(Volt(20.0))), "reported once");
    }
}
