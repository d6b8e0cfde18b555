//! A wearer with a body of their own, coupled to the exoskeleton at two cuffs.
//!
//! Why: a leg file's bodies move as one with the wearer. What a drive does to a person, and a person to a
//! drive, is the torque between two bodies. Here it is a truth that tests can measure.
//!
//! ```text
//! exoskeleton  M_e q'' + C_e q' + G_e + friction = motors + J_e' f          crate::leg
//! wearer       M_w a'' + C_w a' + G_w            = muscles + passive - J_w' f
//! cuffs        f(q, q', a, a') at thigh and shank
//! ```
//!
//! | module | content |
//! | --- | --- |
//! | [`description`] | parameters as plain numbers, and what is refused |
//! | `plane` | the sagittal plane in which both bodies are chains of two links |
//! | `body` | thigh and shank of the wearer by Lagrange's equations |
//! | `cuff` | spring and damper with play |
//! | [`muscles`] | feedforward, impedance, delayed reflexes; limp; resisting |
//! | [`motion`] | intended motions |
//!
//! Interaction torque is the torque that the cuffs exert on the exoskeleton's joints, J_e' f: positive where
//! the wearer flexes the exoskeleton. Power of a cuff is that of its force on the wearer.
//!
//! Time steps: both bodies take the step of [`crate::leg`] at once (position Verlet with bilinear centrifugal
//! terms). Cuffs act at the positions of the interval's middle, so the elastic step is symmetric in time and
//! the energy does not drift. Dampers act at the mean of old and new rates, found by a second pass. A step
//! turns the fastest motion of the cuffs by at most `LARGEST_PHASE`. A step in which a joint of the
//! exoskeleton starts, stops or reverses is repeated in `FINE_STEPS` parts.
//!
//! Cost: one evaluation of both bodies a step, two with dampers. A servo tick with a wearer takes about five
//! times as long as one without (1.2 us instead of 0.23 us on a server's core).
//!
//! Known limits: one vertical plane; the trunk is fixed and no foot touches the ground, so motions are those
//! of a leg in the air: swinging, seated or hanging. The wearer's joints have no end stops. Floor, pushes and
//! hands act on the exoskeleton.

mod body;
mod cuff;
pub mod description;
pub mod motion;
pub mod muscles;
mod plane;

use crate::description::LegDescription;
use crate::friction::Contact;
use crate::leg::{FINE_STEPS, Leg, LegState};
use crate::maths::{floor, sqrt};
use crate::mechanism::times;
use body::{Body, LimbState};
use core::f64::consts::PI;
use cuff::{Cuff, CuffLoad};
use description::{WearerDescription, WearerError};
use motion::Intended;
use muscles::{Intention, Muscles};
use plane::{ExoskeletonPlane, LimbSegment, Pair, convert_angles, convert_torques, dot};

/// Largest phase of the cuffs' fastest motion in a step, rad. The energy of that motion errs by at most an
/// eighth of its square.
pub(crate) const LARGEST_PHASE: f64 = 0.1;

/// Fastest permitted motion of the cuffs, rad/s: 64 steps per servo tick.
const FASTEST: f64 = 25_600.0;

/// State and forces of a wearer at the present instant; anatomical, hip before knee, thigh before shank.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WearerTruth {
    /// Angles of the wearer's joints, rad.
    pub position: [f64; 2],
    /// Their rates, rad/s.
    pub velocity: [f64; 2],
    /// Their accelerations, rad/s^2.
    pub acceleration: [f64; 2],
    /// Motion that the wearer intended in the last servo tick; `None` while limp.
    pub intended: Option<Intended>,
    /// Torque of the muscles in the last servo tick, N m.
    pub muscle_torque: [f64; 2],
    /// Passive torque of the wearer's joints, N m.
    pub passive_torque: [f64; 2],
    /// Interaction torque: of the cuffs on the exoskeleton's joints, N m.
    pub interaction_torque: [f64; 2],
    /// Torque of the cuffs on the wearer's joints, N m.
    pub reaction_torque: [f64; 2],
    /// Cuffs at thigh and shank.
    pub cuffs: [CuffTruth; 2],
    /// Energy of the wearer's body with its passive springs, J.
    pub mechanical_energy: f64,
    /// Work of the muscles so far, J.
    pub muscle_work: f64,
    /// Energy lost in passive damping so far, J.
    pub passive_loss: f64,
}

/// Forces and energies of a cuff; pairs are along and across the exoskeleton's segment.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct CuffTruth {
    /// Displacement of the wearer's point from the cuff's centre, m.
    pub deflection: [f64; 2],
    /// Force on the wearer, N.
    pub force: [f64; 2],
    /// Power that the wearer receives, W.
    pub power: f64,
    /// Energy stored in the springs, J.
    pub stored: f64,
    /// Energy that the exoskeleton gave so far, J.
    pub given: f64,
    /// Energy that the wearer received so far, J.
    pub received: f64,
    /// Energy lost in the dampers so far, J.
    pub dissipated: f64,
}

/// Energies that have flown, J.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Ledger {
    given: Pair,
    received: Pair,
    dissipated: Pair,
    muscle_work: f64,
    passive_loss: f64,
}

/// Wearer of an exoskeleton of hip and knee.
#[derive(Clone, Debug, PartialEq)]
pub struct Wearer {
    plane: ExoskeletonPlane,
    body: Body,
    cuffs: [Cuff; 2],
    is_damped: bool,
    /// Upper bound of the cuffs' fastest motion, rad/s.
    fastest: f64,
    muscles: Muscles,
    limb: LimbState,
    ledger: Ledger,
}

/// Result of a step of both bodies.
struct CoupledStep<const N: usize> {
    exoskeleton: LegState<N>,
    limb: LimbState,
    ledger: Ledger,
}

impl Wearer {
    /// A limp wearer in the posture and motion of the exoskeleton.
    ///
    /// # Errors
    /// [`WearerError`] if the leg is not a hip and a knee in a vertical plane, a number is out of range, or
    /// the cuffs are too stiff or too damped to be integrated.
    pub fn new<const N: usize>(
        wearer: &WearerDescription,
        leg: &LegDescription<N>,
        state: &LegState<N>,
    ) -> Result<Self, WearerError> {
        wearer.check()?;
        let plane = ExoskeletonPlane::from_leg(leg)?;
        let body = Body::new(wearer, plane.gravity);
        let [thigh, shank] = &wearer.cuffs;
        let fitted = |segment, cuff| Cuff::fitted(segment, cuff, &plane.chain, &body.chain);
        let cuffs = [fitted(LimbSegment::Thigh, thigh), fitted(LimbSegment::Shank, shank)];
        let is_damped = body.is_damped() || cuffs.iter().any(Cuff::is_damped);
        let muscles = Muscles::new(wearer);
        let limb = LimbState { angles: [0.0; 2], rates: [0.0; 2] };
        let ledger = Ledger::default();
        let mut worn = Self { plane, body, cuffs, is_damped, fastest: 0.0, muscles, limb, ledger };
        worn.fastest = worn.fastest_motion(&Leg::new(leg));
        if !(worn.fastest <= FASTEST) {
            return Err(WearerError::TooFast { rate: worn.fastest, limit: FASTEST });
        }
        worn.limb = worn.exoskeleton(state);
        Ok(worn)
    }

    /// Upper bound of the rates with which the cuffs make the bodies vibrate or settle, rad/s, at nine knee
    /// angles from 0 to half a turn: the trace of stiffness (or damping) times mobility bounds the largest
    /// eigenvalue. NaN for a massless exoskeleton.
    fn fastest_motion<const N: usize>(&self, leg: &Leg<N>) -> f64 {
        let columns = [[1.0, 0.0], [0.0, 1.0]].map(|unit| self.plane.flipped(convert_angles(unit)));
        (0..=8)
            .map(|eighth| {
                let angles = convert_angles([0.0, f64::from(eighth) * PI / 8.0]);
                let joints = self.joint_angles(angles);
                let matrix = leg.mechanism().dynamics(&as_first_two(joints), &[0.0; N]).inertia;
                let of_exoskeleton = columns.map(|row| {
                    columns.map(|column| dot(row, first_two(&times(&matrix, &as_first_two(column)))))
                });
                let of_wearer = self.body.inertia(angles);
                let bodies = [(&self.plane.chain, &of_exoskeleton), (&self.body.chain, &of_wearer)];
                let (mut squared, mut settling) = (0.0, 0.0);
                for cuff in &self.cuffs {
                    let mobility = cuff.mobility(angles, bodies);
                    let (stiffness, damping) = cuff.strongest();
                    squared += stiffness * mobility;
                    settling += damping * mobility;
                }
                sqrt(squared) + settling
            })
            .fold(0.0, |largest, rate| if rate > largest || rate.is_nan() { rate } else { largest })
    }

    /// Begins an intention at the present posture and time (s).
    ///
    /// # Errors
    /// [`WearerError::OutOfRange`] for a motion with a wrong number.
    pub fn intend(&mut self, intention: Intention, now: f64) -> Result<(), WearerError> {
        if let Intention::Follow(motion) = &intention {
            motion.check()?;
        }
        self.muscles.intend(intention, convert_angles(self.limb.angles), now);
        Ok(())
    }

    /// Sets the wearer at rest at the exoskeleton's posture, where the present intention begins again.
    pub fn move_to<const N: usize>(&mut self, state: &LegState<N>, now: f64) {
        self.limb = LimbState { angles: self.exoskeleton(state).angles, rates: [0.0; 2] };
        self.muscles.restart(convert_angles(self.limb.angles), now);
    }

    /// Decides the muscles' torque of the servo tick that begins now (s).
    pub fn decide(&mut self, tick: u64, now: f64) {
        let (position, velocity) = (convert_angles(self.limb.angles), convert_angles(self.limb.rates));
        self.muscles.decide(&self.body, tick, now, position, velocity);
    }

    /// Joint (D-H) angles of the exoskeleton at directions of its segments.
    fn joint_angles(&self, angles: Pair) -> Pair {
        let position = convert_angles(angles);
        [0, 1].map(|joint| self.plane.anatomy[joint].to_joint_angle(position[joint]))
    }

    /// Directions of the exoskeleton's segments.
    fn exoskeleton<const N: usize>(&self, state: &LegState<N>) -> LimbState {
        LimbState {
            angles: convert_angles(self.plane.position(first_two(&state.angles))),
            rates: convert_angles(self.plane.flipped(first_two(&state.rates))),
        }
    }

    fn loads(&self, exoskeleton: &LimbState, limb: &LimbState) -> [CuffLoad; 2] {
        self.cuffs.map(|cuff| cuff.load([&self.plane.chain, &self.body.chain], exoskeleton, limb))
    }

    /// Interaction torque at a state of the exoskeleton, N m, joint (D-H) sign.
    pub(crate) fn interaction<const N: usize>(&self, state: &LegState<N>) -> [f64; N] {
        let loads = self.loads(&self.exoskeleton(state), &self.limb);
        as_first_two(self.plane.flipped(convert_torques(sum(loads.map(|load| load.on_exoskeleton)))))
    }

    /// Advances both bodies by `duration` s under a torque of motors and surroundings (N m, joint sign) that
    /// changes linearly between two values.
    pub fn advance<const N: usize>(
        &mut self,
        leg: &Leg<N>,
        state: &mut LegState<N>,
        [from, to]: [&[f64; N]; 2],
        duration: f64,
    ) {
        let steps = floor(self.fastest * duration / LARGEST_PHASE) + 1;
        let share = 1.0 / steps as f64;
        let between = |share: f64| -> [f64; N] {
            core::array::from_fn(|joint| from[joint] + share * (to[joint] - from[joint]))
        };
        for number in 0..steps {
            let begun = number as f64 * share;
            let coarse = self.step(leg, state, &between(begun + 0.5 * share), duration * share);
            if coarse.exoskeleton.rates.map(Contact::from_rate) == state.rates.map(Contact::from_rate) {
                self.take(coarse, state);
                continue;
            }
            let fine = share / f64::from(FINE_STEPS);
            for part in 0..FINE_STEPS {
                let middle = begun + (f64::from(part) + 0.5) * fine;
                let step = self.step(leg, state, &between(middle), duration * fine);
                self.take(step, state);
            }
        }
    }

    fn take<const N: usize>(&mut self, step: CoupledStep<N>, state: &mut LegState<N>) {
        (*state, self.limb, self.ledger) = (step.exoskeleton, step.limb, step.ledger);
    }

    fn step<const N: usize>(
        &self,
        leg: &Leg<N>,
        state: &LegState<N>,
        torque: &[f64; N],
        duration: f64,
    ) -> CoupledStep<N> {
        let half = 0.5 * duration;
        let before = [self.exoskeleton(state), self.limb];
        let mut middle =
            before.map(|body| LimbState { angles: extrapolated(body.angles, half, body.rates), ..body });
        let passes = if self.is_damped { 2 } else { 1 };
        let mut step = CoupledStep { exoskeleton: *state, limb: self.limb, ledger: self.ledger };
        let mut loads = [CuffLoad::default(); 2];
        let muscle = self.muscles.torque();
        for _ in 0..passes {
            loads = self.loads(&middle[0], &middle[1]);
            let on_exoskeleton = convert_torques(sum(loads.map(|load| load.on_exoskeleton)));
            let cuffs: [f64; N] = as_first_two(self.plane.flipped(on_exoskeleton));
            let acting = core::array::from_fn(|joint| torque[joint] + cuffs[joint]);
            step.exoskeleton = leg.step(state, &acting, duration);
            let elastic = self.body.elastic(convert_angles(middle[1].angles));
            let damping = self.body.damping(convert_angles(middle[1].rates));
            let own = convert_torques([0, 1].map(|joint| muscle[joint] + elastic[joint] + damping[joint]));
            let forces = sum([own, sum(loads.map(|load| load.on_wearer))]);
            let rates = self.body.rates_after(middle[1].angles, before[1].rates, forces, duration);
            step.limb = LimbState { angles: extrapolated(middle[1].angles, half, rates), rates };
            let after = self.exoskeleton(&step.exoskeleton);
            middle[0].rates = sum([before[0].rates, after.rates]).map(|rate| 0.5 * rate);
            middle[1].rates = sum([before[1].rates, rates]).map(|rate| 0.5 * rate);
        }
        // Displacement is the mean rate times the duration, exactly.
        let ledger = &mut step.ledger;
        for (number, load) in loads.iter().enumerate() {
            ledger.given[number] -= duration * dot(load.on_exoskeleton, middle[0].rates);
            ledger.received[number] += duration * dot(load.on_wearer, middle[1].rates);
            ledger.dissipated[number] += duration * load.dissipated;
        }
        let velocity = convert_angles(middle[1].rates);
        ledger.muscle_work += duration * dot(muscle, velocity);
        ledger.passive_loss -= duration * dot(self.body.damping(velocity), velocity);
        step
    }

    /// True state now.
    pub fn truth<const N: usize>(&self, state: &LegState<N>) -> WearerTruth {
        let limb = &self.limb;
        let loads = self.loads(&self.exoskeleton(state), limb);
        let (position, velocity) = (convert_angles(limb.angles), convert_angles(limb.rates));
        let (elastic, damping) = (self.body.elastic(position), self.body.damping(velocity));
        let (muscle, passive) = (self.muscles.torque(), sum([elastic, damping]));
        let on_wearer = sum(loads.map(|load| load.on_wearer));
        let forces = sum([on_wearer, convert_torques(sum([muscle, passive]))]);
        WearerTruth {
            position,
            velocity,
            acceleration: convert_angles(self.body.accelerations(limb, forces)),
            intended: self.muscles.intended(),
            muscle_torque: muscle,
            passive_torque: passive,
            interaction_torque: convert_torques(sum(loads.map(|load| load.on_exoskeleton))),
            reaction_torque: convert_torques(on_wearer),
            cuffs: [0, 1].map(|number| {
                let load = &loads[number];
                CuffTruth {
                    deflection: load.deflection,
                    force: load.force,
                    power: load.received,
                    stored: load.stored,
                    given: self.ledger.given[number],
                    received: self.ledger.received[number],
                    dissipated: self.ledger.dissipated[number],
                }
            }),
            mechanical_energy: self.body.kinetic_energy(limb) + self.body.potential_energy(limb.angles),
            muscle_work: self.ledger.muscle_work,
            passive_loss: self.ledger.passive_loss,
        }
    }
}

/// First two of `N` values; 0 for a missing one.
fn first_two<const N: usize>(values: &[f64; N]) -> Pair {
    [0, 1].map(|number: usize| values.get(number).copied().unwrap_or(0.0))
}

/// The two values as the first of `N`.
fn as_first_two<const N: usize>(values: Pair) -> [f64; N] {
    core::array::from_fn(|number| values.get(number).copied().unwrap_or(0.0))
}

fn sum([one, other]: [Pair; 2]) -> Pair {
    [one[0] + other[0], one[1] + other[1]]
}

/// Angles after some seconds at constant rates.
fn extrapolated(angles: Pair, seconds: f64, rates: Pair) -> Pair {
    [angles[0] + seconds * rates[0], angles[1] + seconds * rates[1]]
}
