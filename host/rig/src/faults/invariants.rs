//! Invariants: conditions that hold in every period of every run, whatever fault is injected.

use core::f64::consts::TAU;

use hal_sim::faults::{Channel, Injection};
use scarab::hal::AxisCommand;
use scarab::leg::{Activity, IdentifiedModel};
use scarab::safety::FaultCode;
use scarab_identify::formats::leg_file::{JointFile, LegFile};

use crate::faults::forks::encoder::LOST_TURNS;
use crate::faults::scenario::Event;
use crate::faulty_board::{Edges, PERIODS_PER_S, Rig};

/// Longest damping: 300 ms, and one servo tick until its end is visible.
const LONGEST_DAMPING: u64 = PERIODS_PER_S * 3 / 10 + 12;
/// Largest excursion of a driven joint, rad, beyond its range or beyond its rest position outside. The
/// monitor permits the same 0.5 degrees.
pub(crate) const MARGIN_RAD: f64 = 0.008_727;
/// Largest torque of a servo tick relative to the cap: ripple, and a step of the current.
const TORQUE_MARGIN: f64 = 1.1;

/// Invariants for whose violation the firmware, not the injection, is responsible.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Scope {
    /// The measured currents are the true ones.
    pub(crate) torque: bool,
    /// No push is stronger than the drive.
    pub(crate) range: bool,
    /// Counts reach the servo unchanged.
    pub(crate) rotor_position: bool,
}

impl Scope {
    /// Scope of a run with these injections and events.
    pub fn new<'a>(mut injections: impl Iterator<Item = &'a Injection> + Clone, events: &[Event]) -> Self {
        use Channel::{Counter, Index, JointCounts, ShuntB, ShuntC, Target};
        let lies = |injection: &Injection| matches!(injection.channel, ShuntB | ShuntC);
        // With a wrong position or target, the joint cannot be kept in its range.
        let lost =
            |injection: &Injection| matches!(injection.channel, Counter | Index | JointCounts | Target);
        Self {
            torque: !injections.clone().any(lies),
            rotor_position: !injections.clone().any(|injection| injection.channel == JointCounts),
            range: !injections.any(lost)
                && !events.iter().any(|event| matches!(event, Event::Kick(..) | Event::Touch(_))),
        }
    }
}

/// Periods for which a joint may be driven with a wrong rotor position before the detection is late.
const MOST_WRONG_PERIODS: u64 = PERIODS_PER_S / 50;

/// Checks one run.
#[derive(Clone, Debug)]
pub(crate) struct Invariants<const N: usize> {
    scope: Scope,
    /// Ranges of the joints, anatomical, rad.
    range: [[f64; 2]; N],
    cap_nm: [f64; N],
    /// Period in which the bridges were turned off for a fault.
    released: Option<u64>,
    damped: u64,
    /// Last period with the emergency stop open.
    stop_open: Option<u64>,
    /// Model in use and activity at the last check.
    model: Option<IdentifiedModel<N>>,
    judging: bool,
    /// Counts beyond those of the joints' angles, counts per rad, and tolerated deviation in counts.
    rotor_positions: [f64; N],
    counts_per_rad: [f64; N],
    tolerance: [f64; N],
    /// Whether positions are checked; periods for which a joint has been driven with a wrong one.
    watched: bool,
    wrong_periods: u64,
    /// Angles at the last enabling, rad, and the motion within which lost counts are detected, rad.
    enabled_at: [f64; N],
    turn: [f64; N],
    /// Angles when the drive was last off or braking, rad. A leg outside its range is enabled only to return.
    off_at: [f64; N],
    broken: Vec<String>,
}

impl<const N: usize> Invariants<N> {
    /// Invariants of a run of this leg.
    pub fn new<const B: usize>(leg: &LegFile, scope: Scope, rig: &Rig<N, B>) -> Self {
        let counts_per_rad = core::array::from_fn(|joint| counts_per_rad(&leg.joints[joint]));
        Self {
            scope,
            range: core::array::from_fn(|joint| leg.joints[joint].range_deg.map(f64::to_radians)),
            cap_nm: core::array::from_fn(|joint| cap_nm(&leg.joints[joint])),
            released: None,
            damped: 0,
            stop_open: None,
            model: rig.leg.control().model().copied(),
            judging: is_judging(rig),
            rotor_positions: core::array::from_fn(|joint| rotor_position(rig, joint, counts_per_rad[joint])),
            counts_per_rad,
            tolerance: core::array::from_fn(|joint| eighth_of_an_electrical_turn(&leg.joints[joint])),
            watched: false,
            wrong_periods: 0,
            enabled_at: [0.0; N],
            turn: core::array::from_fn(|joint| LOST_TURNS * TAU / leg.joints[joint].encoder.ratio),
            off_at: [0.0; N],
            broken: Vec::new(),
        }
    }

    /// Checks the period that has ended; `stop` is true if the emergency stop was open in it.
    pub(crate) fn see<const B: usize>(&mut self, rig: &Rig<N, B>, stop: bool) {
        if stop {
            self.stop_open = Some(rig.period);
        }
        let switching = rig.is_switching();
        self.commands(rig, rig.commands());
        self.parameters(rig);
        self.check_rotor_positions(rig);
        if let Some(output) = &rig.output {
            let torque = output.servo.decision.torque;
            let over = |joint: usize| f64::from(torque[joint].abs().0) > self.cap_nm[joint] * 1.000_001;
            if (0..N).any(over) {
                self.note(rig, "requested torque above the cap");
            }
        }
        // A braking motor is not damped by the servo, whatever the servo did before.
        let damping = switching && !rig.is_braking() && rig.state().fault().is_some();
        self.damped = if damping { self.damped + 1 } else { 0 };
        if self.damped == LONGEST_DAMPING + 1 {
            self.note(rig, "damped for more than 300 ms");
        }
        if switching && self.scope.torque {
            let torque = rig.world.motor_torque();
            if (0..N).any(|joint| torque[joint].abs() > TORQUE_MARGIN * self.cap_nm[joint]) {
                self.note(rig, "motor torque above the cap");
            }
        }
        // A braking motor is not driven: the leg's weight may lower it.
        let position = rig.world.anatomical_position();
        if !switching || rig.is_braking() {
            self.off_at = position;
        } else if self.scope.range {
            let beyond = |joint: usize| {
                let ([low, high], off_at) = (self.range[joint], self.off_at[joint]);
                position[joint] < low.min(off_at) - MARGIN_RAD
                    || position[joint] > high.max(off_at) + MARGIN_RAD
            };
            if (0..N).any(beyond) {
                self.note(rig, "driven beyond a joint's range, or farther out than its rest position");
            }
        }
        match (self.released, switching) {
            (None, false) if rig.alarm().is_some() => self.released = Some(rig.period),
            (Some(since), true) => {
                if !self.was_asked(rig, since) {
                    self.note(rig, "enabled again without a reset and an operator's edge after it");
                }
                self.released = None;
            }
            _ => {}
        }
    }

    /// Checks the rotor positions of switching axes from now on, once the rotors have turned. Lost counts at
    /// rest are detected at the index, a frozen counter by the motor's voltage.
    pub(crate) fn check_positions_from_now(&mut self) {
        self.watched = self.scope.rotor_position;
    }

    fn check_rotor_positions<const B: usize>(&mut self, rig: &Rig<N, B>) {
        let follows = rig.is_switching() && !rig.is_braking();
        let position = rig.world.anatomical_position();
        if !self.watched || !follows || rig.is_restarted() {
            (self.wrong_periods, self.enabled_at) = (0, position);
            return;
        }
        let wrong = |joint: usize| {
            let off = rotor_position(rig, joint, self.counts_per_rad[joint]) - self.rotor_positions[joint];
            off.abs() > self.tolerance[joint]
                && (position[joint] - self.enabled_at[joint]).abs() > self.turn[joint]
        };
        self.wrong_periods = if (0..N).any(wrong) { self.wrong_periods + 1 } else { 0 };
        if self.wrong_periods == MOST_WRONG_PERIODS {
            self.note(rig, "enabled again with wrong rotor counts");
        }
    }

    /// Checks that the parameters in use change only with a verdict that accepts them.
    fn parameters<const B: usize>(&mut self, rig: &Rig<N, B>) {
        let model = rig.leg.control().model();
        if model != self.model.as_ref() {
            let accepted = rig.leg.control().verdict().is_some_and(|verdict| verdict.is_accepted());
            if !(self.judging && accepted && rig.alarm().is_none()) {
                self.note(rig, "parameters changed without an accepting verdict");
            }
            self.model = model.copied();
        }
        self.judging = is_judging(rig);
    }

    fn was_asked<const B: usize>(&self, rig: &Rig<N, B>, since: u64) -> bool {
        let after = self.stop_open.map_or(since, |stop| stop.max(since));
        let Edges { reset, closed } = rig.edges();
        match (reset, closed) {
            (Some(reset), Some(closed)) => reset >= after && closed > reset,
            _ => false,
        }
    }

    fn commands<const B: usize>(&mut self, rig: &Rig<N, B>, commands: &[AxisCommand; N]) {
        let sensible = |command: &AxisCommand| {
            command.duty.iter().all(|duty| duty.is_finite() && (0.0..=1.0).contains(duty))
        };
        if !commands.iter().all(sensible) {
            self.note(rig, "a duty not finite or outside 0..1");
        }
        if commands.iter().any(|command| command.enabled) && !commands.iter().all(|command| command.enabled) {
            self.note(rig, "one axis switches, the other does not");
        }
    }

    /// Notes a broken invariant.
    pub(crate) fn note<const B: usize>(&mut self, rig: &Rig<N, B>, what: &str) {
        if self.broken.len() < 4 {
            let alarm = rig.alarm().map_or("none", FaultCode::name);
            self.broken.push(format!("period {}: {what} (alarm: {alarm})", rig.period));
        }
    }

    /// Descriptions of the broken invariants.
    pub(crate) fn into_broken(self) -> Vec<String> {
        self.broken
    }
}

fn is_judging<const N: usize, const B: usize>(rig: &Rig<N, B>) -> bool {
    // The verdict may come in the tick in which the last motion ends. The start of this identification
    // cleared that of an earlier one.
    matches!(rig.leg.control().activity(), Activity::Identify(_))
}

/// Torque cap of a joint, from its file alone, N m.
fn cap_nm(joint: &JointFile) -> f64 {
    joint.torque_limit_nm.min(joint.current_limit() * joint.torque_per_ampere.abs())
}

/// Counts of a joint beyond those of its angle.
fn rotor_position<const N: usize, const B: usize>(rig: &Rig<N, B>, joint: usize, counts_per_rad: f64) -> f64 {
    f64::from(rig.counts()[joint]) - counts_per_rad * rig.world.anatomical_position()[joint]
}

fn counts_per_rad(joint: &JointFile) -> f64 {
    f64::from(joint.encoder.counts) * joint.encoder.ratio / TAU
}

/// Counts of an eighth of an electrical turn: a requested torque is then 0.7 of its value.
fn eighth_of_an_electrical_turn(joint: &JointFile) -> f64 {
    let pole_pairs = joint.motor.as_ref().map_or(1.0, |motor| motor.pole_pairs as f64);
    f64::from(joint.encoder.counts) / pole_pairs / 8.0
}
