//! One sample of the 500 Hz log in, one torque for the 4 kHz tick out.
//!
//! Why a level of its own: with every share, a sample takes about 10,000 instructions. Once per sample they
//! cost 4 % of the processor; in the tick they would not fit.
//!
//! The torque belongs to a time [`AHEAD_S`] after the sample's: half of the eight ticks of its mean, the
//! computation, and the ramp of the tick. Weight is extrapolated over that time. Acceleration must not wait
//! for it: the tick multiplies its own with the mass matrix that the law gives.

use super::differentiator::{Derivatives, Differentiator, Gains};
use super::energy::EnergyObserver;
use super::model::CompensationModel;
use super::periodic::PeriodicAssist;
use super::shares::AssistShares;
use crate::model::JointState;
use crate::real::is_finite;
use crate::servo::{LOG_RATE_HZ, LogSample};

/// Time between two samples, s.
pub(super) const DT: f32 = 1.0 / LOG_RATE_HZ as f32;
/// Time from the middle of a sample to the middle of the ramp that its torque commands, plus the drive's
/// lag of 1 ms, s.
pub const AHEAD_S: f32 = 0.003;

/// Shares and models of one session of assistance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AssistSession<const N: usize> {
    /// Number of the session; torques of another one are ignored.
    pub(crate) number: u32,
    /// Shares of the torques.
    pub(crate) shares: AssistShares,
    /// Models of the empty and the worn leg.
    pub(crate) model: CompensationModel<N>,
}

/// Torque for the 4 kHz tick, joint (D-H) sign.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct AssistTorque<const N: usize> {
    /// Number of the session.
    pub(crate) session: u32,
    /// Whole torque besides inertia, friction and damping, N m.
    pub(crate) torque_nm: [f32; N],
    /// The part of `torque_nm` that carries weight, N m.
    pub(crate) support_nm: [f32; N],
    /// Compensated mass matrix, kg m^2.
    pub(crate) inertia: [[f32; N]; N],
    /// Damping that the energy observer requires, N m s/rad.
    pub(crate) damping: f32,
    /// Whether the session must end: the energy budget is used up.
    pub(crate) is_exhausted: bool,
}

/// State during a session.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Running<const N: usize> {
    session: AssistSession<N>,
    angles: [Differentiator; N],
    torques: [Differentiator; N],
    last_angle: [f32; N],
    last_support: [f32; N],
    last_assist: [f32; N],
    energy: EnergyObserver<N>,
    periodic: PeriodicAssist<N>,
}

/// The law of one leg; idle between sessions.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AssistLaw<const N: usize> {
    session: Option<AssistSession<N>>,
    running: Option<Running<N>>,
}

impl<const N: usize> AssistLaw<N> {
    /// Idle law.
    pub const fn new() -> Self {
        Self { session: None, running: None }
    }

    /// Begins a session with the next sample.
    pub(crate) fn begin(&mut self, session: AssistSession<N>) {
        (self.session, self.running) = (Some(session), None);
    }

    /// Ends the session.
    pub(crate) fn end(&mut self) {
        (self.session, self.running) = (None, None);
    }

    /// Energy observer of the present session.
    pub fn energy(&self) -> Option<&EnergyObserver<N>> {
        self.running.as_ref().map(|running| &running.energy)
    }

    /// Assistance of a periodic motion in the present session.
    pub fn periodic(&self) -> Option<&PeriodicAssist<N>> {
        self.running.as_ref().map(|running| &running.periodic)
    }

    /// Takes a sample; `None` between sessions.
    pub(crate) fn step(&mut self, sample: &LogSample<N>) -> Option<AssistTorque<N>> {
        if let Some(session) = self.session.take() {
            self.running = Some(Running::begin(session, sample));
        }
        Some(self.running.as_mut()?.step(sample))
    }
}

impl<const N: usize> Running<N> {
    fn begin(session: AssistSession<N>, sample: &LogSample<N>) -> Self {
        Self {
            last_support: support(&session, &sample.position_rad),
            session,
            angles: sample.position_rad.map(Differentiator::at),
            torques: sample.torque_nm.map(Differentiator::at),
            last_angle: sample.position_rad,
            last_assist: [0.0; N],
            energy: EnergyObserver::new(),
            periodic: PeriodicAssist::new(),
        }
    }

    fn step(&mut self, sample: &LogSample<N>) -> AssistTorque<N> {
        let AssistSession { shares, model, .. } = &self.session;
        let mut state = JointState { q: [0.0; N], qd: [0.0; N], qdd: [0.0; N] };
        let (mut torque, mut velocity) = ([0.0; N], [0.0; N]);
        for joint in 0..N {
            let Derivatives { value, first, second } =
                self.angles[joint].push(&Gains::LOG, sample.position_rad[joint]);
            (state.q[joint], state.qd[joint], state.qdd[joint]) = (value, first, second);
            torque[joint] = self.torques[joint].push(&Gains::LOG, sample.torque_nm[joint]).value;
            velocity[joint] = (sample.position_rad[joint] - self.last_angle[joint]) * LOG_RATE_HZ as f32;
        }
        let support = support(&self.session, &sample.position_rad);
        let certain = shares.inertia * model.assured.inertia_share;
        // Torques of the way between the two samples.
        let excepted = core::array::from_fn(|joint| {
            0.5 * (support[joint] + self.last_support[joint]) + self.last_assist[joint]
        });
        let measured = [&sample.position_rad, &sample.torque_nm, &velocity];
        self.energy.push(model, measured, &excepted, certain);
        let mut assist = [0.0; N];
        if shares.periodic != 0.0 {
            let moved = 1.0 - certain;
            let needed = model.wearer_needs(&state, moved, shares.weight);
            let (inertia, weight) = (model.inertia(&state), model.weight(&state.q));
            let carried = model.wearer_weight(&state.q).map(|weight| shares.weight * weight);
            let friction = model.assured.friction(&state.qd);
            let own = core::array::from_fn(|joint| {
                needed[joint] + carried[joint] + certain * inertia[joint] + weight[joint] + friction[joint]
                    - torque[joint]
            });
            let taken = [shares.periodic, moved, shares.weight];
            assist = self.periodic.step(model, taken, &sample.position_rad, [&own, &needed], AHEAD_S);
        }
        let mut output = AssistTorque {
            session: self.session.number,
            torque_nm: [0.0; N],
            inertia: model.mass_matrix(&sample.position_rad, certain),
            support_nm: [0.0; N],
            damping: self.energy.damping(),
            is_exhausted: self.energy.is_exhausted(),
        };
        let centrifugal = model.inertia(&JointState { qdd: [0.0; N], ..state });
        for joint in 0..N {
            let change = (support[joint] - self.last_support[joint]) * (AHEAD_S / DT);
            output.support_nm[joint] = support[joint] + change;
            output.torque_nm[joint] = output.support_nm[joint] + certain * centrifugal[joint] + assist[joint];
        }
        let inertia = output.inertia.iter().flatten();
        output.is_exhausted |= !output.torque_nm.iter().chain(inertia).copied().all(is_finite);
        (self.last_angle, self.last_support, self.last_assist) = (sample.position_rad, support, assist);
        output
    }
}

/// Torque that carries weight: the empty leg's, and a share of the wearer's.
fn support<const N: usize>(session: &AssistSession<N>, q: &[f32; N]) -> [f32; N] {
    let AssistSession { shares, model, .. } = session;
    let mut support = model.weight(q);
    if shares.weight != 0.0 {
        for (support, weight) in support.iter_mut().zip(model.wearer_weight(q)) {
            *support += shares.weight * weight;
        }
    }
    support
}
