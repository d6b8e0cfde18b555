//! World with complete drives: one exchange per PWM period.
//!
//! ```text
//! servo tick  |  period 0  |  period 1  | ... |  period 5  |          6 periods of 1/24 ms
//! ```
//!
//! In a period the rotors turn at the leg's initial speed and the drives produce their torque. Then the leg
//! moves by the period's mean torque. The wearer's push is that of the middle of the servo tick, the floor's
//! that of the period's start. Joint accelerations stay below 100 rad/s^2, so the speed error is below 4
//! mrad/s at the joint, and that of a rotor's electrical angle below 2e-5 rad. A command computed from the
//! samples of one period is set in the next and acts at the start of each axis' period.
//!
//! A leg file states noise per logged sample. Therefore [`World::observe`] adds it to the logged current, as
//! for ideal drives. The shunts' own noise (0.04 A per sample, about 6 mA in the mean of a logged sample's
//! 48) comes in addition. In the codes, 7 % per logged sample would be about 9 A each, which no current loop
//! would follow and no board would show.

use super::{TICK_S, World, worn};
use crate::description::LegDescription;
use crate::drive::axis::PERIOD_S;
use crate::drive::complete::{CompleteDrives, Rotor};
use crate::drive::counter::steps;
use crate::drive::description::CompleteDescription;
use crate::maths::sin_cos;
use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, Sample};
use scarab::units::Ampere;

/// PWM periods per servo tick.
pub const PERIODS_PER_TICK: u32 = CURRENT_RATE_HZ / super::TICK_RATE_HZ as u32;

/// Complete drives with their phase in the servo tick.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Electric<const N: usize> {
    drives: CompleteDrives<N>,
    /// Rotor turns per joint turn.
    ratio: [f64; N],
    /// Completed periods of the servo tick.
    period: u32,
    /// Torque of the wearer, N m, anatomical.
    pushed: [f64; N],
    /// Torque at the joints in this servo tick so far, and mean of the last one, N m, direction of the
    /// motors.
    sum: [f64; N],
    torque: [f64; N],
}

impl<const N: usize> Electric<N> {
    /// Mean torque of the last servo tick at the joints, N m, direction of the motors.
    pub(super) fn torque(&self) -> &[f64; N] {
        &self.torque
    }

    /// Sets the rotors to the joints' angles (anatomical, direction of the motors), without current.
    pub(super) fn move_to(&mut self, angles: &[f64; N]) {
        self.drives.move_to(&core::array::from_fn(|joint| self.ratio[joint] * angles[joint]));
    }
}

impl<const N: usize> World<N> {
    /// A leg at rest at its anatomical zero, with complete drives and their bridges off. [`World::period`]
    /// moves it; commands to ideal drives have no effect.
    pub fn with_complete_drives(
        description: &LegDescription<N>,
        drives: &CompleteDescription<N>,
        seed: u64,
    ) -> Self {
        let mut world = Self::new(description, seed);
        // Independent of the other streams of the same seed.
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

    /// Runs one PWM period: each axis takes its command and returns its sample at its start. `brake` is the
    /// duty of the brake resistor. A world with ideal drives does not move and returns default samples.
    pub fn period(&mut self, commands: &[AxisCommand; N], brake: f64) -> [AxisSample; N] {
        let Some(period) = self.electric.as_ref().map(|electric| electric.period) else {
            return [AxisSample::default(); N];
        };
        let now = self.time() + f64::from(period) * PERIOD_S;
        if period == 0 {
            self.decide_muscles();
        }
        let (gripped, stopped) = (self.gripped(now), self.stopped());
        let Some(electric) = &mut self.electric else { return [AxisSample::default(); N] };
        if electric.period == 0 {
            electric.pushed = self.pushes.torque((self.tick as f64 + 0.5) * TICK_S);
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
        worn::advance(&self.leg, &mut self.wearer, state, [&acting, &acting], PERIOD_S);
        electric.period += 1;
        if electric.period == PERIODS_PER_TICK {
            (electric.period, electric.torque, electric.sum) = (0, electric.sum, [0.0; N]);
            self.tick += 1;
        }
        samples
    }

    /// Reading of the absolute encoder at a joint, 14 bits; `None` without one.
    pub fn joint_steps(&self, joint: usize) -> Option<u16> {
        let axis = self.electric.as_ref()?.drives.axes().get(joint)?;
        let encoder = axis.description().joint_encoder?;
        let angle = self.mounting * self.anatomical_position().get(joint)?;
        let seen = angle + encoder.error * sin_cos(angle).0;
        Some(steps(encoder.direction * seen + encoder.zero))
    }

    /// Complete drives, if present.
    pub fn complete_drives(&self) -> Option<&CompleteDrives<N>> {
        self.electric.as_ref().map(|electric| &electric.drives)
    }

    /// Complete drives, mutable, if present.
    pub fn complete_drives_mut(&mut self) -> Option<&mut CompleteDrives<N>> {
        self.electric.as_mut().map(|electric| &mut electric.drives)
    }

    /// Adds the leg's current-sensor errors to the currents that a board measured at this servo tick: noise,
    /// offset, conversion steps and outliers as described.
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
