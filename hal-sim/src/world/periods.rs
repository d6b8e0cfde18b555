//! A world whose drives are complete: one exchange per PWM period.
//!
//! ```text
//! servo tick  |  period 0  |  period 1  | ... |  period 5  |          6 periods of 1/24 ms
//! ```
//!
//! In a period the rotors turn at the speed the leg has at its beginning, the drives make their torque, and then the leg moves by the
//! period's mean torque (the wearer's push is that of the middle of the servo tick, the floor's that of the period's
//! beginning). Joint accelerations stay below 100 rad/s^2, so the speed held is wrong by less than 4 mrad/s at the joint, and a
//! rotor's electrical angle by less than 2e-5 rad. What is computed from the samples of one period is handed over with
//! the next, and acts when each axis begins.
//!
//! The noise that a leg file states per logged sample is added to the logged current ([`World::observe`]), where it is added to
//! an ideal drive's. The shunts' own noise (0.04 A per sample, some 6 mA in the mean of a logged sample's 48) is there
//! besides. Put into the codes, 7 % per logged sample would be some 9 A in each, which no current loop would follow and no
//! board would show.

use super::{TICK_S, World};
use crate::description::LegDescription;
use crate::drive::axis::PERIOD_S;
use crate::drive::complete::{CompleteDrives, Rotor};
use crate::drive::description::CompleteDescription;
use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, Sample};
use scarab::units::Ampere;

/// PWM periods of a servo tick.
pub const PERIODS_PER_TICK: u32 = CURRENT_RATE_HZ / super::TICK_RATE_HZ as u32;

/// Complete drives and their place in the servo tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Electric<const N: usize> {
    drives: CompleteDrives<N>,
    /// Rotor turns per joint turn.
    ratio: [f64; N],
    /// Periods of the servo tick that are over.
    period: u32,
    /// The wearer's, N m, anatomical.
    pushed: [f64; N],
    /// At the joints in this servo tick so far, and in the last one, N m, sense of the motors.
    sum: [f64; N],
    torque: [f64; N],
}

impl<const N: usize> Electric<N> {
    /// Mean torque of the last servo tick at the joints, N m, sense of the motors.
    pub(super) fn torque(&self) -> &[f64; N] {
        &self.torque
    }

    /// Puts the rotors where the joints are (anatomical, sense of the motors), without current.
    pub(super) fn place(&mut self, angles: &[f64; N]) {
        self.drives.place(&core::array::from_fn(|joint| self.ratio[joint] * angles[joint]));
    }
}

impl<const N: usize> World<N> {
    /// A leg at rest at its anatomical zero, with complete drives and their bridges released. [`World::period`] moves it;
    /// commands to ideal drives mean nothing to it.
    #[must_use]
    pub fn with_complete_drives(
        description: &LegDescription<N>,
        drives: &CompleteDescription<N>,
        seed: u64,
    ) -> Self {
        let mut world = Self::new(description, seed);
        // Apart from the other streams of the same seed.
        let mut noise: Xoshiro256PlusPlus = world.sensor_faults.clone();
        noise.jump();
        let ratio = drives.axes.map(|axis| axis.ratio);
        let position = world.anatomical_position();
        let angles = core::array::from_fn(|joint| ratio[joint] * world.mounting * position[joint]);
        world.electric = Some(Electric {
            drives: CompleteDrives::new(drives, &angles, noise.next_u64()),
            ratio,
            period: 0,
            pushed: [0.0; N],
            sum: [0.0; N],
            torque: [0.0; N],
        });
        world
    }

    /// One PWM period: each axis takes its command and gives its sample where it begins. `brake` is the share of time for
    /// which the brake resistor is on. A world with ideal drives stands still and says nothing.
    pub fn period(&mut self, commands: &[AxisCommand; N], brake: f64) -> [AxisSample; N] {
        let Some(period) = self.electric.as_ref().map(|electric| electric.period) else {
            return [AxisSample::default(); N];
        };
        let now = self.tick as f64 * TICK_S + f64::from(period) * PERIOD_S;
        let (gripped, stopped) = (self.gripped(now), self.stopped());
        let Some(electric) = &mut self.electric else { return [AxisSample::default(); N] };
        if electric.period == 0 {
            electric.pushed = self.wearer.torque((self.tick as f64 + 0.5) * TICK_S);
        }
        let (anatomy, state, mounting) = (&self.anatomy, &mut self.state, self.mounting);
        let stood = match &mut self.floor {
            Some(floor) => floor.torque(self.leg.mechanism(), state, now),
            None => [0.0; N],
        };
        let rotors = core::array::from_fn(|joint| {
            let turns = electric.ratio[joint] * mounting;
            Rotor {
                angle: turns * anatomy[joint].to_anatomical_angle(state.angles[joint]),
                speed: turns * anatomy[joint].flip(state.rates[joint]),
            }
        });
        let (samples, torque) = electric.drives.period(&rotors, commands, brake);
        let acting = core::array::from_fn(|joint| {
            let motor = electric.ratio[joint] * torque[joint];
            electric.sum[joint] += motor / f64::from(PERIODS_PER_TICK);
            let pushed = electric.pushed[joint] + gripped[joint];
            anatomy[joint].flip(mounting * motor + pushed) + stood[joint] + stopped[joint]
        });
        self.leg.advance(state, &acting, &acting, PERIOD_S);
        electric.period += 1;
        if electric.period == PERIODS_PER_TICK {
            (electric.period, electric.torque, electric.sum) = (0, electric.sum, [0.0; N]);
            self.tick += 1;
        }
        samples
    }

    /// The complete drives, if there are.
    #[must_use]
    pub fn complete_drives(&self) -> Option<&CompleteDrives<N>> {
        self.electric.as_ref().map(|electric| &electric.drives)
    }

    /// The complete drives to be changed, if there are.
    pub fn complete_drives_mut(&mut self) -> Option<&mut CompleteDrives<N>> {
        self.electric.as_mut().map(|electric| &mut electric.drives)
    }

    /// What the leg's current sensors add to currents measured by a board at this servo tick: noise, offset, conversion
    /// steps and wild readings as described.
    pub fn observe(&mut self, measured: &Sample<N>) -> Sample<N> {
        let mut observed = *measured;
        self.begin_reading();
        for (joint, sensor) in observed.joints.iter_mut().zip(&self.current_sensors) {
            let current = sensor.read(f64::from(joint.current.0), &mut self.sensor_noise);
            joint.current = Ampere(current as f32);
        }
        observed
    }
}
