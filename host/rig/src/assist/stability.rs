//! Largest share of inertia that can be compensated before exoskeleton and wearer oscillate.
//!
//! Why a limit: the acceleration is known late. A torque s M q'' that is late by t has a component
//! s M w sin(w t) in the direction of the velocity: it feeds the vibration of the exoskeleton on the cuffs,
//! at their frequency w. The firmware leads the acceleration by most of the delay, which raises the gain of
//! fast vibrations instead. Damping of cuffs, tissue and drives must take the energy away.
//!
//! Linear about a posture, anatomical joint angles of exoskeleton q and wearer a:
//!
//! ```text
//! M_e q'' + B q' + G_e q             = c + K (a - q) + D (a' - q')
//! M_w a'' + D_w a' + (G_w + K_w) a   =   - K (a - q) - D (a' - q')          limp;  held: a = 0
//! K = sum J' diag(k_along, k_across) J,   D alike
//! J_thigh = [0  0; d  0],   J_shank = [-L sin(knee)  0; L cos(knee) + d  -d]
//! ```
//!
//! M_e is the mass matrix with rotors, B viscous friction, G the slopes of the gravity torques, K_w and D_w
//! passive tissue. The cuffs' springs and dampers act at the joints through the Jacobians J of their points,
//! at distance d from the joint above, along and across the segment; L is the thigh's length.
//!
//! The compensation as the firmware samples it (`scarab::assist`), each step a linear map:
//!
//! ```text
//! 4 kHz    x, v: tracking observer with two poles at 100 Hz            of the last tick
//!          x'' = s^2 H x,  H two poles at 50 Hz, damping ratio 0.7
//!          j: (x'' - x''_before) / T, low-passed at 60 Hz
//!          u = r + s_f B v + s M_e (x'' + lead j)
//!          r on a ramp of 8 ticks to the newest torque
//!          c' = (u - c) / lag                                           drive
//! 500 Hz   m = mean of q over 8 ticks
//!          torque = G_e m + ahead / 8T (G_e m - G_e m_before)           in force from the next tick on
//! ```
//!
//! Plant and drive are discretised exactly for a torque that is linear within a tick. The product of eight
//! ticks is the map Phi of one sample; the loop is stable if all eigenvalues of Phi lie inside the unit
//! circle. Their largest magnitude is computed by Gelfand's formula, lim |Phi^n|^(1/n), with n = 2^26 by
//! repeated squaring. The limit is the smallest over five knee angles, hip flexion half of them: the leg
//! hangs, thigh and shank equally inclined.
//!
//! Known limits: small vibrations about a posture at rest, models without error, cuffs without play, aligned
//! axes, no torque limits. Coulomb friction is left out: it helps small vibrations to end, and its
//! compensation fades to zero at rest. The energy observer's damping is left out too.

use core::f64::consts::{PI, TAU};

use hal_sim::description::{BodyDescription, FrictionDescription, LegDescription};
use hal_sim::wearer::description::{CuffDescription, WearerDescription};
use hal_sim::world::{TICK_S, World};
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};
use rayon::prelude::*;
use scarab::assist::differentiator::LEAD_S;
use scarab::assist::law::AHEAD_S;

use crate::assist::subject::Cuffs;
use crate::report::assist::{StabilityCurve, StabilityReport};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

/// Knee angles of the analysis, degrees.
const KNEES_DEG: [f64; 5] = [10.0, 30.0, 50.0, 70.0, 90.0];
/// Ticks of a sample.
const TICKS: usize = 8;
/// Corner (Hz) and damping ratio of the differentiator.
const CORNER_HZ: f64 = 50.0;
const DAMPING_RATIO: f64 = 0.7;
/// Poles of the servo's observer, Hz.
const OBSERVER_HZ: f64 = 100.0;
/// Low-pass of the acceleration's lead, Hz.
const LEAD_HZ: f64 = 60.0;
/// Time over which the weight is extrapolated, in samples.
const AHEAD_SAMPLES: f64 = AHEAD_S as f64 / (TICKS as f64 * TICK_S);
/// Squarings for the largest eigenvalue.
const SQUARINGS: i32 = 26;
/// Coarse step and final width of the search for the limit.
const STEP: f64 = 0.05;
const WIDTH: f64 = 1e-3;

/// Cuffs of the drawn curves: stiffness across the segment (N/m) and damping across (N s/m).
const STIFFNESSES: [f64; 14] = [1e3, 1.5e3, 2e3, 3e3, 4e3, 5e3, 6e3, 8e3, 10e3, 12e3, 14e3, 16e3, 18e3, 20e3];
const DAMPINGS: [f64; 5] = [20.0, 40.0, 80.0, 160.0, 320.0];

/// What the wearer's limb does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Limb {
    /// Muscles relaxed.
    Limp,
    /// Limb held still by its muscles or by a seat.
    Held,
}

/// Compensated parts, 0..1.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Compensated {
    /// Share of the inertia.
    pub(crate) inertia: f64,
    /// Share of viscous friction.
    pub(crate) friction: f64,
}

/// Exoskeleton and wearer about a posture, with the sampled compensation.
#[derive(Clone, Copy, Debug)]
pub(crate) struct CompensationLoop {
    /// Mass matrix of the exoskeleton, slopes of its gravity torques, viscous friction.
    inertia: Matrix2<f64>,
    gravity: Matrix2<f64>,
    viscous: Vector2<f64>,
    /// Share of the drives' deviation that remains after a tick.
    remainder: Vector2<f64>,
    /// Maps of a tick, to the plant's state: of that state, of the torque at the tick's begin, of its change.
    free: SMatrix<f64, PLANT, PLANT>,
    steady: SMatrix<f64, PLANT, 2>,
    ramped: SMatrix<f64, PLANT, 2>,
}

/// Pairs of hip and knee that the firmware and the drives remember, in the order of the loop's state. The
/// plant's state follows: positions of exoskeleton and wearer, and their rates.
#[derive(Clone, Copy)]
enum Pair {
    /// Torque of the drives.
    Drive,
    /// Observers.
    Position,
    Velocity,
    /// Sum of the angles since the last sample.
    Sum,
    /// States of the differentiators, and their last acceleration.
    Band,
    Low,
    Acceleration,
    /// Low-passed change of the acceleration per second.
    Jerk,
    /// Weight at the last sample.
    Weight,
    /// Ramp to the newest torque.
    Torque,
    Slope,
}

/// Values before those of the plant, of the plant, and of the whole loop.
const FIRMWARE: usize = 2 * (Pair::Slope as usize + 1);
const PLANT: usize = 8;
const STATES: usize = FIRMWARE + PLANT;
type LoopState = SVector<f64, STATES>;
type SampleMap = SMatrix<f64, STATES, STATES>;

/// Rate at which the states of a held limb decay, 1/s. They begin at zero and act on nothing; the rate only
/// keeps their eigenvalues inside the circle.
const HELD_DECAY: f64 = 1000.0;

impl Pair {
    fn get(self, state: &LoopState) -> Vector2<f64> {
        state.fixed_rows::<2>(2 * self as usize).into_owned()
    }

    fn set(self, state: &mut LoopState, value: Vector2<f64>) {
        state.fixed_rows_mut::<2>(2 * self as usize).copy_from(&value);
    }
}

impl CompensationLoop {
    /// Loop of an exoskeleton without wearer in its two links, about a posture of hip and knee (rad).
    ///
    /// # Errors
    /// The exoskeleton cannot be simulated.
    pub fn new(
        exoskeleton: &LegFile,
        wearer: &WearerDescription,
        limb: Limb,
        posture: [f64; 2],
    ) -> Result<Self, ToolError> {
        let description = exoskeleton.description::<2>()?;
        let [inertia, gravity] = rigid_body(&description, posture);
        let viscous = Vector2::from(description.joints.map(|joint| joint.friction.viscous));
        let [stiffness, damping] = joint_coupling(wearer, description.joints[1].frame.a, posture[1]);
        let tissue = |value: [f64; 2]| Matrix2::from_diagonal(&Vector2::from(value));
        let [limb_inertia, limb_gravity] = rigid_body(&limb_alone(&description, wearer), posture);
        let limb_stiffness = limb_gravity + tissue(wearer.passive.map(|passive| passive.stiffness));
        let limb_damping = tissue(wearer.passive.map(|passive| passive.damping));
        let own_damping = Matrix2::from_diagonal(&viscous);
        let massless = || ToolError::input(format!("{}: a link has no mass", exoskeleton.name));
        let mobility = inertia.try_inverse().ok_or_else(massless)?;
        let limb_mobility = limb_inertia.try_inverse().ok_or_else(massless)?;
        // Exponential of [A B 0; 0 0 1/T; 0 0 0] T: plant, torque, and change of torque within the tick.
        let mut rates = SMatrix::<f64, { PLANT + 4 }, { PLANT + 4 }>::zeros();
        let mut put = |row: usize, column: usize, block: Matrix2<f64>| {
            rates.fixed_view_mut::<2, 2>(row, column).copy_from(&block);
        };
        put(0, 4, Matrix2::identity());
        put(4, 0, -mobility * (gravity + stiffness));
        put(4, 4, -mobility * (own_damping + damping));
        put(4, PLANT, mobility);
        put(PLANT, PLANT + 2, Matrix2::identity() / TICK_S);
        match limb {
            Limb::Limp => {
                put(2, 6, Matrix2::identity());
                put(4, 2, mobility * stiffness);
                put(4, 6, mobility * damping);
                put(6, 0, limb_mobility * stiffness);
                put(6, 4, limb_mobility * damping);
                put(6, 2, -limb_mobility * (limb_stiffness + stiffness));
                put(6, 6, -limb_mobility * (limb_damping + damping));
            }
            Limb::Held => {
                put(2, 2, Matrix2::identity() * -HELD_DECAY);
                put(6, 6, Matrix2::identity() * -HELD_DECAY);
            }
        }
        let tick = exponential(&(rates * TICK_S));
        let lags = description.joints.map(|joint| joint.drive.lag);
        Ok(Self {
            inertia,
            gravity,
            viscous,
            remainder: Vector2::from(lags.map(|lag| if lag > 0.0 { (-TICK_S / lag).exp() } else { 0.0 })),
            free: tick.fixed_view::<PLANT, PLANT>(0, 0).into_owned(),
            steady: tick.fixed_view::<PLANT, 2>(0, PLANT).into_owned(),
            ramped: tick.fixed_view::<PLANT, 2>(0, PLANT + 2).into_owned(),
        })
    }

    /// Runs the eight ticks of a sample.
    fn advance(&self, state: &mut LoopState, compensated: Compensated) {
        for tick in 1..=TICKS {
            let torque = Pair::Torque.get(state) + Pair::Slope.get(state);
            Pair::Torque.set(state, torque);
            let friction = self.viscous.component_mul(&Pair::Velocity.get(state));
            let inertia = self.inertia * led_acceleration(state);
            let target = torque + compensated.friction * friction + compensated.inertia * inertia;
            let angle: Vector2<f64> = state.fixed_rows::<2>(FIRMWARE).into_owned();
            observe(state, angle);
            let sum = Pair::Sum.get(state) + angle;
            Pair::Sum.set(state, sum);
            if tick == TICKS {
                let weight = self.gravity * sum / TICKS as f64;
                let wanted = weight + AHEAD_SAMPLES * (weight - Pair::Weight.get(state));
                Pair::Weight.set(state, weight);
                Pair::Slope.set(state, (wanted - torque) / TICKS as f64);
                Pair::Sum.set(state, Vector2::zeros());
            }
            let drive = Pair::Drive.get(state);
            let next = target + self.remainder.component_mul(&(drive - target));
            Pair::Drive.set(state, next);
            let plant = state.fixed_rows::<PLANT>(FIRMWARE).into_owned();
            let moved = self.free * plant + self.steady * drive + self.ramped * (next - drive);
            state.fixed_rows_mut::<PLANT>(FIRMWARE).copy_from(&moved);
        }
    }

    /// Map of one sample.
    fn map(&self, compensated: Compensated) -> SampleMap {
        let mut map = SampleMap::identity();
        for mut column in map.column_iter_mut() {
            let mut state: LoopState = column.clone_owned();
            self.advance(&mut state, compensated);
            column.copy_from(&state);
        }
        map
    }

    /// Factor by which the slowest decaying or fastest growing vibration changes in a sample.
    pub(crate) fn growth(&self, compensated: Compensated) -> f64 {
        spectral_radius(self.map(compensated))
    }

    /// Largest share of inertia below which every share is stable, at most 1, within `WIDTH`.
    pub(crate) fn largest_inertia(&self, friction: f64) -> f64 {
        let is_stable = |inertia: f64| self.growth(Compensated { inertia, friction }) < 1.0;
        if !is_stable(0.0) {
            return 0.0;
        }
        let mut stable = 0.0;
        while stable < 1.0 && is_stable(stable + STEP) {
            stable += STEP;
        }
        if stable >= 1.0 {
            return 1.0;
        }
        let mut unstable = stable + STEP;
        while unstable - stable > WIDTH {
            let middle = 0.5 * (stable + unstable);
            if is_stable(middle) {
                stable = middle;
            } else {
                unstable = middle;
            }
        }
        stable
    }
}

/// Runs the observers for a tick.
fn observe(state: &mut LoopState, angle: Vector2<f64>) {
    let beta: f64 = (-TAU * OBSERVER_HZ * TICK_S).exp();
    let rate = Pair::Velocity.get(state);
    let predicted = Pair::Position.get(state) + TICK_S * rate;
    let error = angle - predicted;
    let gain = (1.0 - beta) * (1.0 - beta) / TICK_S;
    Pair::Position.set(state, predicted + (1.0 - beta * beta) * error);
    Pair::Velocity.set(state, rate + gain * error);
}

/// Runs the differentiators for a tick; returns the acceleration with its lead.
fn led_acceleration(state: &mut LoopState) -> Vector2<f64> {
    let corner = (PI * CORNER_HZ * TICK_S).tan();
    let (band, low) = (Pair::Band.get(state), Pair::Low.get(state));
    let scale = 1.0 / (1.0 + 2.0 * DAMPING_RATIO * corner + corner * corner);
    let high = scale * (Pair::Position.get(state) - (2.0 * DAMPING_RATIO + corner) * band - low);
    let middle = corner * high + band;
    Pair::Band.set(state, band + 2.0 * corner * high);
    Pair::Low.set(state, low + 2.0 * corner * middle);
    let rate = 2.0 * corner / TICK_S;
    let now = rate * rate * high;
    let change = (now - Pair::Acceleration.get(state)) / TICK_S;
    Pair::Acceleration.set(state, now);
    let jerk = Pair::Jerk.get(state);
    let jerk = change + (-TAU * LEAD_HZ * TICK_S).exp() * (jerk - change);
    Pair::Jerk.set(state, jerk);
    now + f64::from(LEAD_S) * jerk
}

/// Matrix exponential by its series, for norms of about 1: the last term is below 1e-20.
fn exponential<const SIZE: usize>(matrix: &SMatrix<f64, SIZE, SIZE>) -> SMatrix<f64, SIZE, SIZE> {
    let (mut sum, mut term) = (SMatrix::identity(), SMatrix::identity());
    for order in 1..=24 {
        term = term * matrix / f64::from(order);
        sum += term;
    }
    sum
}

/// Largest magnitude of an eigenvalue.
fn spectral_radius(mut map: SampleMap) -> f64 {
    // |map^(2^n)| = exp(2^n logarithm), the power divided by its norm after each squaring.
    let mut logarithm = 0.0_f64;
    for squaring in 0..SQUARINGS {
        let norm = map.norm();
        logarithm += norm.ln() * 2_f64.powi(-squaring);
        map /= norm;
        map = map * map;
    }
    (logarithm + map.norm().ln() * 2_f64.powi(-SQUARINGS)).exp()
}

/// Mass matrix (kg m^2) and slopes of the gravity torques (N m/rad) of a leg at a posture (rad).
fn rigid_body(leg: &LegDescription<2>, at: [f64; 2]) -> [Matrix2<f64>; 2] {
    const SLOPE_STEP: f64 = 1e-5;
    let world = World::new(leg, 0);
    let rest = [0.0; 2];
    let torque = |position: [f64; 2], acceleration: [f64; 2]| {
        Vector2::from(world.inverse_dynamics(&position, &rest, &acceleration))
    };
    let still = torque(at, rest);
    let columns = [[1.0, 0.0], [0.0, 1.0]].map(|unit| {
        let moved = |sign: f64| [0, 1].map(|joint| at[joint] + sign * SLOPE_STEP * unit[joint]);
        let slope = (torque(moved(1.0), rest) - torque(moved(-1.0), rest)) / (2.0 * SLOPE_STEP);
        [torque(at, unit) - still, slope]
    });
    [0, 1].map(|matrix| Matrix2::from_columns(&columns.map(|column| column[matrix])))
}

/// The wearer's limb in place of the exoskeleton's links, without rotors and friction.
pub(crate) fn limb_alone(leg: &LegDescription<2>, wearer: &WearerDescription) -> LegDescription<2> {
    let mut limb = *leg;
    limb.joints[1].frame.a = wearer.thigh_length;
    for (joint, segment) in limb.joints.iter_mut().zip([wearer.thigh, wearer.shank]) {
        let [along, forward] = segment.com;
        joint.body = BodyDescription {
            mass: segment.mass,
            com: [along, forward, 0.0],
            inertia_com: [0.0, 0.0, 0.0, 0.0, 0.0, segment.inertia_com],
        };
        (joint.rotor_inertia, joint.friction) = (0.0, FrictionDescription::default());
    }
    limb
}

/// Stiffness (N m/rad) and damping (N m s/rad) of the cuffs between the joints of both bodies.
fn joint_coupling(wearer: &WearerDescription, thigh: f64, knee: f64) -> [Matrix2<f64>; 2] {
    let (sine, cosine) = knee.sin_cos();
    let [upper, lower] = wearer.cuffs.map(|cuff| cuff.distance);
    let jacobians = [
        Matrix2::new(0.0, 0.0, upper, 0.0),
        Matrix2::new(-thigh * sine, 0.0, thigh * cosine + lower, -lower),
    ];
    let joined = |values: fn(&CuffDescription) -> [f64; 2]| {
        jacobians.iter().zip(&wearer.cuffs).fold(Matrix2::zeros(), |sum, (jacobian, cuff)| {
            sum + jacobian.transpose() * Matrix2::from_diagonal(&Vector2::from(values(cuff))) * jacobian
        })
    };
    [
        joined(|cuff| [cuff.along.stiffness, cuff.across.stiffness]),
        joined(|cuff| [cuff.along.damping, cuff.across.damping]),
    ]
}

/// Largest stable share of inertia over all knee angles.
///
/// # Errors
/// The exoskeleton cannot be simulated.
pub(crate) fn largest_inertia(
    exoskeleton: &LegFile,
    wearer: &WearerDescription,
    limb: Limb,
    friction: f64,
) -> Result<f64, ToolError> {
    KNEES_DEG.iter().try_fold(1.0_f64, |least, knee_deg| {
        let knee = knee_deg.to_radians();
        let found = CompensationLoop::new(exoskeleton, wearer, limb, [0.5 * knee, knee])?;
        Ok(least.min(found.largest_inertia(friction)))
    })
}

/// Limits for these cuffs, and curves over other ones, with a compensated share of viscous friction.
///
/// # Errors
/// The exoskeleton cannot be simulated.
pub(crate) fn limits(
    exoskeleton: &LegFile,
    wearer: &WearerDescription,
    friction: f64,
) -> Result<StabilityReport, ToolError> {
    let limbs = [(Limb::Limp, "limp"), (Limb::Held, "held")];
    let rows: Vec<_> = limbs.iter().flat_map(|limb| DAMPINGS.map(|damping| (*limb, damping))).collect();
    let curves = rows
        .par_iter()
        .map(|&((limb, words), damping)| {
            let largest_share = STIFFNESSES
                .iter()
                .map(|stiffness| {
                    let wearer = Cuffs { stiffness: *stiffness, damping }.on(wearer);
                    largest_inertia(exoskeleton, &wearer, limb, friction)
                })
                .collect::<Result<_, _>>()?;
            Ok(StabilityCurve {
                limb: words,
                damping_n_s_per_m: damping,
                stiffness_n_per_m: STIFFNESSES.to_vec(),
                largest_share,
            })
        })
        .collect::<Result<_, ToolError>>()?;
    let own = |limb| largest_inertia(exoskeleton, wearer, limb, friction);
    let across = wearer.cuffs[0].across;
    Ok(StabilityReport {
        friction_share: friction,
        stiffness_n_per_m: across.stiffness,
        damping_n_s_per_m: across.damping,
        largest_share_limp: own(Limb::Limp)?,
        largest_share_held: own(Limb::Held)?,
        curves,
    })
}

#[cfg(test)]
mod tests;
