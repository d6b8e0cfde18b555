//! Follower of one joint: turns the commands of a host into a trajectory, tick by tick.
//!
//! ```text
//! profile position     trajectory to the newest set-point; unless immediate, after the previous one
//! profile velocity     trajectory to a velocity
//! profile torque       torque along its slope, no position control; halt ramps it to zero
//! homing               comes to rest and gives the present position the requested value for hosts
//! cyclic               position or velocity interpolated over the period, or the torque directly
//! impedance            torque of a spring and a damper around the target
//! no mode, halt        comes to rest along the profile and holds; a halted set-point goes on afterwards
//! ```
//!
//! A new mode starts from the joint's present position and torque. When a mode or a halt begins or ends,
//! offsets of a held trajectory pass within [`EASE_TICKS`] from the old ones to the new ones. A commanded
//! speed that the joint had not reached is an offset then. A trajectory never leaves the range or exceeds the
//! speed limit. A cyclic position that is out of the following window when it would
//! begin to be followed is not followed: the joint holds its pose until one within the window comes. Fault
//! 8611: the distance to the commanded position exceeds the window for too long. In velocity modes a blocked
//! joint is not a fault: the commanded position stays within the window around the measured one.
//!
//! No setting makes a stop endless: whatever a host has set, a joint slows down from its largest speed, and a
//! torque fades from its limit, within [`LONGEST_STOP_S`].
//!
//! The limits of a host (607D) act within the joint's range. Limits that exclude the joint when a mode begins
//! are extended to its position, so they pull it nowhere.
//!
//! While a joint returns into its range (`safety::Monitor`), every position or velocity mode moves it slowly.
//! Targets are limited to the range, and the commanded position is never farther out than the joint.

use super::command::{ImpedanceTarget, JointCommand, LONGEST_PERIOD, Mode, Reference, SetPoint, Target};
use crate::motion::{Course, Rates};
use crate::real::{abs, clamp, max, min};
use crate::safety::{RETURN_SPEED, RETURN_TORQUE};
use crate::servo::{SERVO_RATE_HZ, TICK_S};
use crate::units::{NewtonMetre, Radian, RadianPerSecond, Second};

/// Speed below which a joint is at rest, rad/s: 0.3 degrees per second, ten times the observer's ripple from
/// the encoder steps of the default leg.
const STANDING: f32 = 0.005;
/// Longest time of a stop from the largest speed, or of a fade from the largest torque, s.
const LONGEST_STOP_S: f32 = 2.0;
/// Least torque that a host leaves a joint to stop and to hold with, as a share of its limit.
const LEAST_TORQUE: f32 = 0.1;
/// Largest angle that homing gives to the present position: a turn.
const LARGEST_HOME_RAD: f32 = core::f32::consts::TAU;

/// Delay from a motion to the torque that answers it, s: one tick, and the current loop. A spring that acts
/// so late is like one with a negative damper, stiffness times this delay. So the place is extrapolated over
/// it, and the damping is never less than that.
const DELAY_S: f32 = 0.0015;
/// Ticks in which the demand on a held joint passes from one mode to the next, or into a halt: 10 ms.
const EASE_TICKS: u8 = (SERVO_RATE_HZ / 100) as u8;

/// Limits of a joint, anatomical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Bounds {
    /// Lowest and highest angle, rad.
    pub(crate) range: [f32; 2],
    /// Largest speed, rad/s.
    pub(crate) speed: f32,
    /// Largest acceleration, rad/s^2.
    pub(crate) acceleration: f32,
    /// Largest torque, N m.
    pub(crate) torque: f32,
    /// Largest stiffness (N m/rad) and damping (N m s/rad) of the impedance mode.
    pub(crate) impedance: [f32; 2],
}

/// Measured values of the previous tick, anatomical.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Measured {
    /// Joint angle.
    pub(crate) position: Radian,
    /// Joint velocity.
    pub(crate) velocity: RadianPerSecond,
    /// Torque that the servo wanted, what of it brakes the joint, and the torque that was applied.
    pub(crate) wanted: NewtonMetre,
    pub(crate) braking: NewtonMetre,
    pub(crate) applied: NewtonMetre,
    /// Whether the joint returns into its range.
    pub(crate) returns: bool,
}

impl Measured {
    /// Parts of the applied torque that hold the joint and that brake it, N m.
    fn holding_and_braking(&self) -> (f32, f32) {
        let NewtonMetre(applied) = self.applied;
        let holding = clamp((self.wanted - self.braking).0, min(applied, 0.0), max(applied, 0.0));
        (holding, applied - holding)
    }
}

/// Demand on the servo at one tick, anatomical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Demand {
    /// Trajectory: position, velocity, acceleration.
    pub(crate) course: Course,
    /// Added to the trajectory's velocity, rad/s.
    pub(crate) velocity_offset: f32,
    /// Added to the controller's torque, or the whole torque if the trajectory is not held, N m.
    pub(crate) torque: f32,
    /// Whether the trajectory is held; otherwise only the torque is applied.
    pub(crate) held: bool,
    /// Torque limit, N m.
    pub(crate) largest: f32,
    /// Whether the following error is a fault.
    pub(crate) failed: bool,
    /// New zero for hosts: what they read where the joint's own angle is zero.
    pub(crate) zero: Option<Radian>,
}

/// What is added to a held trajectory.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Added {
    /// A host's offsets: velocity, rad/s, and torque, N m. The controller's integral may balance them.
    velocity: f32,
    torque: f32,
    /// Speed that the trajectory had and the joint had not reached, rad/s.
    unreached: f32,
}

impl Added {
    const NONE: Self = Self { velocity: 0.0, torque: 0.0, unreached: 0.0 };
}

/// State of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Follower {
    mode: Option<Mode>,
    course: Course,
    /// Torque of the torque modes and of the impedance, N m.
    torque: f32,
    /// Impedance: difference of the spring to the torque before the mode, which decays, N m.
    carried: f32,
    /// Impedance: difference of the damper to the braking torque before the mode, which decays, N m. Never
    /// beyond the damper's torque: it would push the joint on once it is slow.
    damper_gap: f32,
    /// [`JointCommand::is_requested`] of the previous tick.
    seen: u8,
    /// Profile position: the active set-point.
    goal: Option<f32>,
    /// Whether the active set-point is reached.
    arrived: bool,
    /// The next set-point.
    next: Option<SetPoint>,
    /// Cyclic modes: the last target, and the remaining ticks of its period.
    target: f32,
    left: u32,
    /// Cyclic position: distance from target to joint at the start of the mode, reduced to zero over time.
    gap: Course,
    /// Cyclic position: no target within the window has come yet.
    waits: bool,
    halted: bool,
    /// What the previous tick added to the trajectory; nothing if it was not held.
    added: Added,
    /// Copy of it at the last change of mode or halt, and the ticks for which that still fades.
    before: Added,
    easing: u8,
    /// Velocity of the trajectory at that change, rad/s. What it has regained since is not added again.
    eased_at: f32,
    /// Whether the trajectory was held in the previous tick.
    held: bool,
    /// Whether the joint is held before a mode without position control begins.
    settles: bool,
    /// The host's limits (607D) as stated, and the range that they leave. When they come into force, at the
    /// beginning of a mode or by a change, they are extended to the joint: they must not pull it.
    stated: Option<[Radian; 2]>,
    range: [f32; 2],
    /// Whether the joint returned in the previous tick.
    returned: bool,
    /// Ticks for which the joint has been outside the following window, or inside the position window.
    outside: u32,
    inside: u32,
    /// Ticks for which the joint has not been faster than the standing speed.
    still: u32,
    pub(super) follows: bool,
    pub(super) stands: bool,
    pub(super) reached: bool,
    pub(super) limited: bool,
    pub(super) homed: bool,
    pub(super) deviates: bool,
}

/// Commands, measured values and limits of one tick.
struct Tick<'a> {
    command: &'a JointCommand,
    measured: &'a Measured,
    /// Limits, narrower while the joint returns into its range.
    bounds: Bounds,
    /// Limits without a return.
    whole: &'a Bounds,
    /// Range that the host's own limits leave.
    range: [f32; 2],
    /// Torque limit, N m.
    largest: f32,
    /// Whether the target begins to apply: new mode, end of a halt or of a return.
    starts: bool,
}

impl<'a> Tick<'a> {
    fn new(
        command: &'a JointCommand,
        measured: &'a Measured,
        whole: &'a Bounds,
        range: [f32; 2],
        starts: bool,
    ) -> Self {
        let mut bounds = *whole;
        if measured.returns {
            bounds.speed = min(whole.speed, RETURN_SPEED);
            bounds.torque *= RETURN_TORQUE;
        }
        let stops = command.halt || command.target == Target::Hold;
        let least = if stops { LEAST_TORQUE * bounds.torque } else { 0.0 };
        let largest = clamp(command.largest_torque.0, least, bounds.torque);
        Self { command, measured, bounds, whole, range, largest, starts }
    }

    /// Rates of the profile.
    fn rates(&self) -> Rates {
        let Self { command, bounds, whole, .. } = self;
        let gentlest = min(whole.speed / LONGEST_STOP_S, whole.acceleration);
        Rates {
            speed: min(command.velocity.0, bounds.speed),
            acceleration: min(command.acceleration.0, bounds.acceleration),
            deceleration: clamp(command.deceleration.0, gentlest, bounds.acceleration),
        }
    }

    /// Slope of a torque that fades, N m/s.
    fn fading_slope(&self) -> f32 {
        max(self.command.torque_slope_nm_per_s, self.whole.torque / LONGEST_STOP_S)
    }

    /// Rates with the joint's own speed limit instead of the profile's.
    fn braking(&self) -> Rates {
        Rates { speed: self.bounds.speed, ..self.rates() }
    }
}

fn ticks(time: Second) -> u32 {
    (time.0 * SERVO_RATE_HZ as f32 + 0.5) as u32
}

impl Follower {
    /// Initial state, without a command.
    pub(crate) const NEW: Self = Self {
        mode: None,
        course: Course::at_rest(0.0),
        torque: 0.0,
        carried: 0.0,
        damper_gap: 0.0,
        seen: 0,
        goal: None,
        arrived: false,
        next: None,
        target: 0.0,
        left: 0,
        gap: Course::at_rest(0.0),
        waits: false,
        halted: false,
        added: Added::NONE,
        before: Added::NONE,
        easing: 0,
        eased_at: 0.0,
        held: true,
        settles: false,
        stated: None,
        range: [0.0; 2],
        returned: false,
        outside: 0,
        inside: 0,
        still: 0,
        follows: false,
        stands: false,
        reached: false,
        limited: false,
        homed: false,
        deviates: false,
    };

    /// Whether the joint is commanded to be at rest, without offsets.
    pub(crate) fn is_still(&self) -> bool {
        self.course().velocity() == 0.0 && self.added == Added::NONE
    }

    /// Holds the joint for [`EASE_TICKS`] before a mode without position control begins: such a mode begins
    /// from the torque that holds the joint, and a speed that the joint has not reached ends first.
    pub(crate) fn settle(&mut self, command: &mut JointCommand, bounds: &Bounds) {
        let mode = command.target.mode();
        let settles = matches!(mode, Some(Mode::ProfileTorque | Mode::Impedance))
            && self.held
            && mode != self.mode
            && (self.mode.is_some() || self.easing > 0);
        let settled = core::mem::replace(&mut self.settles, settles);
        if settles {
            command.target = Target::Hold;
        } else if settled {
            self.ease(bounds);
        }
    }

    /// Commanded trajectory.
    pub(crate) fn course(&self) -> Course {
        self.course.plus(&self.gap)
    }

    /// Active mode.
    pub(crate) const fn mode(&self) -> Option<Mode> {
        self.mode
    }

    /// Whether no further set-point can be taken.
    pub(crate) const fn is_full(&self) -> bool {
        matches!(self.mode, Some(Mode::ProfilePosition)) && self.next.is_some()
    }

    /// [`JointCommand::request_count`] of the last tick.
    pub(crate) const fn requests_seen(&self) -> u8 {
        self.seen
    }

    /// Starts following from `course`. Requests made before are discarded.
    pub(crate) fn start(&mut self, command: &JointCommand, course: Course) {
        *self = Self { seen: command.request_count, course, homed: self.homed, ..Self::NEW };
    }

    /// Runs one tick.
    pub(crate) fn follow(&mut self, command: &JointCommand, measured: &Measured, bounds: &Bounds) -> Demand {
        let begins = command.target.mode() != self.mode;
        if begins {
            self.begin(command, measured, bounds);
        }
        let is_new = core::mem::replace(&mut self.seen, command.request_count) != command.request_count;
        // A request of the mode before starts nothing in the one that begins.
        let is_requested = is_new && !begins;
        let was_halted = core::mem::replace(&mut self.halted, command.halt);
        // A joint that settles comes to rest anyway, and halts must not delay its end.
        if command.halt != was_halted && !self.settles {
            if command.halt {
                self.brake_from(measured, bounds);
            } else {
                self.ease(bounds);
            }
        }
        self.follows = command.target.mode().is_some() && !command.halt;
        self.stand(command, measured);
        let ends = core::mem::replace(&mut self.returned, measured.returns) && !measured.returns;
        self.limited = false;
        if self.stated != Some(command.range) {
            self.limit_range(command, measured, bounds);
        }
        let starts = begins || was_halted && !command.halt || ends;
        let tick = Tick::new(command, measured, bounds, self.range, starts);
        let demand = Demand {
            course: self.course,
            velocity_offset: 0.0,
            torque: 0.0,
            held: true,
            largest: tick.largest,
            failed: false,
            zero: None,
        };
        let demand = match command.target {
            Target::ProfileTorque(target) => {
                self.fade(target.0, &tick);
                return self.give(demand, measured);
            }
            Target::CyclicTorque(target) if !command.halt => {
                self.torque = self.torque_target(target.0, &tick);
                self.reached = true;
                return self.give(demand, measured);
            }
            Target::ProfilePosition(point) => {
                self.take(point, is_requested, &tick);
                if command.halt {
                    self.stop(&tick);
                } else {
                    self.go(&tick);
                }
                demand
            }
            _ if command.halt => {
                self.close_gap();
                self.stop(&tick);
                demand
            }
            Target::Hold | Target::CyclicTorque(_) => {
                self.stop(&tick);
                demand
            }
            Target::Impedance(target) => {
                self.yield_to(&target, &tick);
                return self.give(demand, measured);
            }
            Target::ProfileVelocity(velocity) => {
                self.run(velocity.0, &tick);
                demand
            }
            Target::Homing { offset } => {
                self.stop(&tick);
                let zero = if is_requested { self.home(offset, measured) } else { None };
                Demand { zero, ..demand }
            }
            Target::CyclicPosition { position, velocity_offset, torque_offset } => {
                if self.track_position(position.0, &tick) {
                    let torque = self.limited(torque_offset, bounds.torque);
                    Demand { velocity_offset: velocity_offset.0, torque, ..demand }
                } else {
                    demand
                }
            }
            Target::CyclicVelocity { velocity, torque_offset } => {
                self.track_velocity(velocity.0, &tick);
                Demand { torque: self.limited(torque_offset, bounds.torque), ..demand }
            }
        };
        self.conclude(demand, &tick)
    }

    /// Range that the host's limits leave.
    fn limit_range(&mut self, command: &JointCommand, measured: &Measured, bounds: &Bounds) {
        let within = |angle: Radian| clamp(angle.0, bounds.range[0], bounds.range[1]);
        let ([low, high], position) = (command.range.map(within), within(measured.position));
        (self.stated, self.range) = (Some(command.range), [min(low, position), max(high, position)]);
    }

    /// Updates whether the joint stands.
    fn stand(&mut self, command: &JointCommand, measured: &Measured) {
        let is_slow = abs(measured.velocity.0) <= command.standing_speed.0;
        self.still = if is_slow { self.still.saturating_add(1) } else { 0 };
        self.stands = is_slow && self.still > ticks(command.standing_time);
    }

    /// Torque that a torque mode is to give; none in a halt.
    fn torque_target(&mut self, target: f32, tick: &Tick<'_>) -> f32 {
        if tick.command.halt { 0.0 } else { self.limited(NewtonMetre(target), tick.largest) }
    }

    /// Profile torque: changes the torque along its slope.
    fn fade(&mut self, target: f32, tick: &Tick<'_>) {
        let target = self.torque_target(target, tick);
        let change = target - self.torque;
        let fades = change * self.torque < 0.0;
        let most = TICK_S * if fades { tick.fading_slope() } else { tick.command.torque_slope_nm_per_s };
        self.torque += clamp(change, -most, most);
        self.reached = self.torque == target;
    }

    /// Impedance: spring and damper; the difference to the torque before decays.
    fn yield_to(&mut self, target: &ImpedanceTarget, tick: &Tick<'_>) {
        let Tick { command, measured, .. } = tick;
        let (spring, damper) = self.spring(target, tick.range, &tick.bounds, measured);
        let damper = clamp(damper, -tick.largest, tick.largest);
        if tick.starts {
            let (holding, braking) = measured.holding_and_braking();
            (self.carried, self.damper_gap) = (holding - spring, damper - braking);
        }
        let most = tick.fading_slope() * TICK_S;
        self.carried -= clamp(self.carried, -most, most);
        self.damper_gap -= clamp(self.damper_gap, -most, most);
        self.damper_gap = clamp(self.damper_gap, min(damper, 0.0), max(damper, 0.0));
        let torque = spring + damper - self.damper_gap + self.carried;
        self.torque = self.limited(NewtonMetre(torque), tick.largest);
        let near = abs(target.position.0 - measured.position.0) <= command.position_window.0;
        self.reach(near, command.position_time);
    }

    /// Profile velocity: changes the velocity along its ramp.
    fn run(&mut self, velocity: f32, tick: &Tick<'_>) {
        let Tick { command, measured, bounds, .. } = tick;
        let wanted = self.bounded(velocity, -bounds.speed, bounds.speed);
        self.course.accelerate(wanted, &tick.braking(), tick.range, TICK_S);
        self.course.keep_within(command.following_window.0, measured.position.0);
        let near = abs(wanted - measured.velocity.0) <= command.velocity_window.0;
        self.reach(near, command.velocity_time);
    }

    /// Cyclic position: interpolates over the period. Returns whether the target is followed.
    fn track_position(&mut self, position: f32, tick: &Tick<'_>) -> bool {
        let Tick { command, measured, bounds, range, .. } = tick;
        let target = self.bounded(position, range[0], range[1]);
        let actual = measured.position.0;
        // For a joint outside its range: the end of the range that it returns to.
        let from = if measured.returns { clamp(actual, bounds.range[0], bounds.range[1]) } else { actual };
        let is_far = abs(target - from) > command.following_window.0;
        let waited = self.waits;
        self.waits |= tick.starts || measured.returns && is_far;
        if self.waits && is_far {
            if !waited {
                self.ease(&tick.bounds);
            }
            self.close_gap();
            self.stop(tick);
            (self.follows, self.reached) = (false, false);
            return false;
        }
        if core::mem::take(&mut self.waits) {
            self.ease(&tick.bounds);
            self.gap = Course::moving(self.course.position() - target, self.course.velocity());
            (self.course, self.target) = (Course::at_rest(target), target);
        }
        self.count(target, tick);
        if measured.returns {
            self.close_gap();
            self.course.approach(target, &tick.rates(), TICK_S);
        } else {
            self.course.interpolate_position(target, self.left, bounds.speed, TICK_S);
        }
        self.left = self.left.saturating_sub(1);
        if self.gap != Course::at_rest(0.0) {
            self.gap.approach(0.0, &tick.rates(), TICK_S);
        }
        self.reach(abs(target - actual) <= command.position_window.0, command.position_time);
        true
    }

    /// Cyclic velocity: interpolates over the period.
    fn track_velocity(&mut self, velocity: f32, tick: &Tick<'_>) {
        let target = self.bounded(velocity, -tick.bounds.speed, tick.bounds.speed);
        self.count(target, tick);
        let (most, rates) = (tick.bounds.acceleration, tick.braking());
        self.course.interpolate_velocity(target, self.left, most, &rates, tick.range, TICK_S);
        self.course.keep_within(tick.command.following_window.0, tick.measured.position.0);
        self.left = self.left.saturating_sub(1);
        self.reached = self.course.velocity() == target;
    }

    /// Completes the demand of a mode that holds a position.
    fn conclude(&mut self, demand: Demand, tick: &Tick<'_>) -> Demand {
        let Tick { command, measured, bounds, .. } = tick;
        if measured.returns {
            let ([low, high], actual) = (bounds.range, measured.position.0);
            self.course.keep_between(min(low, actual), max(high, actual));
        }
        let (kept, before) = (self.added, self.before);
        self.added = Added { velocity: demand.velocity_offset, torque: demand.torque, unreached: 0.0 };
        if self.easing > 0 {
            self.easing -= 1;
            let share = f32::from(self.easing) / f32::from(EASE_TICKS);
            let part = |before: f32, now: f32| share * before + (1.0 - share) * now;
            let (fading, regained) = (share * before.unreached, self.course().velocity() - self.eased_at);
            self.added = Added {
                velocity: part(before.velocity, self.added.velocity),
                torque: part(before.torque, self.added.torque),
                unreached: clamp(fading - regained, min(fading, 0.0), max(fading, 0.0)),
            };
        }
        if self.settles {
            (self.added.velocity, self.added.torque) = (kept.velocity, kept.torque);
        }
        self.held = true;
        let Added { velocity, torque, unreached } = self.added;
        let (velocity_offset, failed) = (velocity + unreached, self.deviated(command, measured));
        Demand { course: self.course(), velocity_offset, torque, failed, ..demand }
    }

    /// Lets the present offsets fade, those of the next mode or halt come. A speed beyond the one that asks
    /// for the joint's largest torque ends at once.
    fn ease(&mut self, bounds: &Bounds) {
        let (Added { velocity, torque, unreached }, [_, damping]) = (self.added, bounds.impedance);
        let limited = |speed: f32| clamp(speed, -bounds.torque / damping, bounds.torque / damping);
        self.before = Added { velocity: limited(velocity), torque, unreached: limited(unreached) };
        (self.easing, self.eased_at) = (EASE_TICKS, self.course().velocity());
    }

    /// Starts a new mode from the present position, velocity and torque.
    fn begin(&mut self, command: &JointCommand, measured: &Measured, bounds: &Bounds) {
        self.mode = command.target.mode();
        self.brake_from(measured, bounds);
        (self.torque, _) = measured.holding_and_braking();
        (self.goal, self.next, self.left) = (None, None, 0);
        (self.arrived, self.waits) = (false, false);
        (self.outside, self.inside, self.reached, self.deviates) = (0, 0, false, false);
        // NaN: the first target of a cyclic mode always starts a period.
        (self.target, self.stated) = (f32::NAN, None);
    }

    /// Continues with no more than the joint's own velocity. A cyclic target that has jumped leaves the
    /// course with a velocity that the joint has not reached, and a stop must not drive it up to that.
    fn brake_from(&mut self, measured: &Measured, bounds: &Bounds) {
        self.close_gap();
        let velocity = self.course.velocity();
        let own = clamp(measured.velocity.0, min(velocity, 0.0), max(velocity, 0.0));
        self.course = Course::moving(self.course.position(), own);
        if self.held {
            self.added.unreached += velocity - own;
        }
        self.ease(bounds);
    }

    /// Merges the gap into the course.
    fn close_gap(&mut self) {
        self.course = self.course();
        self.gap = Course::at_rest(0.0);
    }

    /// Torques of spring and damper at the joint's present place, each within its limits.
    fn spring(
        &mut self,
        target: &ImpedanceTarget,
        [low, high]: [f32; 2],
        bounds: &Bounds,
        measured: &Measured,
    ) -> (f32, f32) {
        let [stiffest, strongest] = bounds.impedance;
        let stiffness = self.bounded(target.stiffness, 0.0, stiffest);
        let damping = self.bounded(target.damping, DELAY_S * stiffness, strongest);
        let predicted = measured.position.0 + DELAY_S * measured.velocity.0;
        let position = self.bounded(target.position.0, low, high);
        let velocity = self.bounded(target.velocity.0, -bounds.speed, bounds.speed);
        let spring = stiffness * (position - predicted) + target.torque.0;
        (spring, damping * (velocity - measured.velocity.0))
    }

    /// Torque only, without position control.
    fn give(&mut self, demand: Demand, measured: &Measured) -> Demand {
        self.deviates = false;
        self.course = Course::moving(measured.position.0, measured.velocity.0);
        (self.added, self.easing, self.held) = (Added::NONE, 0, false);
        Demand { course: self.course, torque: self.torque, held: false, ..demand }
    }

    /// Slows down to rest along the profile, faster where the range ends before.
    fn stop(&mut self, tick: &Tick<'_>) {
        let (velocity, [low, high]) = (self.course.velocity(), tick.bounds.range);
        let left = if velocity > 0.0 { high - self.course.position() } else { self.course.position() - low };
        let most = tick.bounds.acceleration;
        let needed = if left > 0.0 { 0.5 * velocity * velocity / left } else { most };
        let rates = tick.braking();
        let rates = Rates { deceleration: min(max(rates.deceleration, needed), most), ..rates };
        self.course.accelerate(0.0, &rates, tick.bounds.range, TICK_S);
        self.reached = self.is_still() && abs(tick.measured.velocity.0) < STANDING;
    }

    /// Limits a torque and notes if it was larger. Offsets of a held joint have the joint's own limit: that
    /// of a host or a return limits the sum with the controller's torque, which answers the offset.
    fn limited(&mut self, torque: NewtonMetre, most: f32) -> f32 {
        let limited = torque.limited(NewtonMetre(most));
        self.limited |= limited != torque;
        limited.0
    }

    /// Clamps a value to bounds and notes if it was outside.
    fn bounded(&mut self, value: f32, low: f32, high: f32) -> f32 {
        let held = clamp(value, low, high);
        self.limited |= held != value;
        held
    }

    fn take(&mut self, point: SetPoint, is_requested: bool, tick: &Tick<'_>) {
        if is_requested {
            self.next = Some(point);
        }
        if let Some(point) = self.next
            && (point.immediately || self.goal.is_none() || self.arrived)
        {
            let (demand, [low, high]) = (self.course.position(), tick.range);
            let from = match point.relative_to {
                None => 0.0,
                Some(Reference::Target) => self.goal.map_or(demand, |goal| clamp(goal, low, high)),
                Some(Reference::Demand) => demand,
                Some(Reference::Actual) => tick.measured.position.0,
            };
            (self.goal, self.next) = (Some(from + point.position.0), None);
            (self.arrived, self.reached, self.inside) = (false, false, 0);
        }
    }

    fn go(&mut self, tick: &Tick<'_>) {
        let Some(goal) = self.goal else {
            return self.stop(tick);
        };
        let Tick { command, measured, range: [low, high], .. } = *tick;
        let goal = self.bounded(goal, low, high);
        self.course.approach(goal, &tick.rates(), TICK_S);
        let near = self.course == Course::at_rest(goal)
            && abs(goal - measured.position.0) <= command.position_window.0;
        self.reach(near, command.position_time);
        self.arrived = self.reached;
    }

    fn reach(&mut self, near: bool, time: Second) {
        self.inside = if near { self.inside.saturating_add(1) } else { 0 };
        self.reached = near && self.inside >= ticks(time);
    }

    /// Cyclic modes: a new target starts a new period.
    fn count(&mut self, target: f32, tick: &Tick<'_>) {
        if self.target != target {
            let period = ticks(tick.command.period).clamp(1, ticks(LONGEST_PERIOD));
            (self.target, self.left) = (target, period);
        }
    }

    fn home(&mut self, offset: Radian, measured: &Measured) -> Option<Radian> {
        self.homed = self.reached && abs(offset.0) <= LARGEST_HOME_RAD;
        self.deviates = !self.homed;
        self.homed.then_some(offset - measured.position)
    }

    /// Whether the following error has lasted too long.
    fn deviated(&mut self, command: &JointCommand, measured: &Measured) -> bool {
        let expected = match self.mode {
            Some(Mode::CyclicPosition) if !measured.returns && !self.waits && !self.halted => self.target,
            _ => self.course().position(),
        };
        let is_outside = abs(expected - measured.position.0) > command.following_window.0;
        self.outside = if is_outside { self.outside.saturating_add(1) } else { 0 };
        if self.mode != Some(Mode::Homing) {
            self.deviates = is_outside || self.waits;
        }
        is_outside && !self.settles && self.outside > ticks(command.following_time)
    }
}
