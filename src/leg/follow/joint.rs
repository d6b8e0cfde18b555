//! One joint that follows what a host tells it, tick by tick.
//!
//! ```text
//! profile position     course to the newest set-point; one that does not interrupt waits for the end of the one before
//! profile velocity     course to a velocity
//! profile torque       torque along its slope, no position held; halt leads it to zero
//! homing               stands still and takes the place for the offset that is asked for
//! cyclic               position or velocity interpolated over the period, or the torque as it is
//! none, halt           comes to rest along the profile and holds
//! ```
//!
//! Nothing jumps: a change of mode begins where the joint is and with the torque it has; a course never leads farther than the
//! range, nor faster than the speed limit. Too far for too long from a commanded position, or a cyclic position that is too far
//! when the mode begins, is a fault (8611). A joint that is told a velocity is no fault while something holds it: it is then
//! commanded to be no farther away than the window.
//!
//! A joint that returns into its range (`safety::Monitor`) is led there slowly by whatever commands a way: targets are those of the
//! range, and where it is commanded to be is never farther out than the joint.

use super::command::{JointCommand, Mode, SetPoint, Target};
use crate::motion::{Course, Rates};
use crate::real::{abs, clamp, max, min};
use crate::safety::{RETURN_SPEED, RETURN_TORQUE};
use crate::servo::{SERVO_RATE_HZ, TICK_S};
use crate::units::{NewtonMetre, Radian, RadianPerSecond, Second};

/// Slower than this a joint stands: 0.3 degrees per second, ten times what the observer makes of the steps of the default leg's
/// encoder.
const STANDING: f32 = 0.005;
/// The longest period that is interpolated: a quarter of a second.
const LONGEST_PERIOD: u32 = SERVO_RATE_HZ / 4;

/// What a joint may do at most, anatomical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// Lowest and highest angle, rad.
    pub range: [f32; 2],
    /// rad/s.
    pub speed: f32,
    /// rad/s^2.
    pub acceleration: f32,
    /// N m.
    pub torque: f32,
}

/// What was measured at the tick before, anatomical.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Measured {
    /// Joint angle.
    pub position: Radian,
    /// Joint velocity.
    pub velocity: RadianPerSecond,
    /// What was applied.
    pub torque: NewtonMetre,
    /// It returns into its range.
    pub returns: bool,
}

/// What a joint is told at one tick, anatomical.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Demand {
    /// Where to be and how to move there.
    pub course: Course,
    /// On top of the course's velocity, rad/s.
    pub velocity_offset: f32,
    /// On top of what holds the course, or alone; N m.
    pub torque: f32,
    /// The course is held, not only the torque given.
    pub held: bool,
    /// The most that is asked for, N m.
    pub largest: f32,
    /// Too far from where it is commanded to be.
    pub failed: bool,
    /// The joint's zero is moved by so much, rad.
    pub shift: Option<f32>,
}

/// What is remembered of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Follower {
    mode: Option<Mode>,
    course: Course,
    /// N m; of the torque modes.
    torque: f32,
    /// [`JointCommand::asked`] of the tick before.
    seen: u8,
    /// Of profile position: on the way to it.
    goal: Option<f32>,
    /// The set-point that follows.
    next: Option<SetPoint>,
    /// Of cyclic modes: the last target, and the ticks of its period that are left.
    target: f32,
    left: u32,
    /// Of cyclic positions: what lay between joint and target when the mode began, on its way to zero.
    gap: Course,
    halted: bool,
    /// It returned at the tick before.
    returned: bool,
    /// Ticks for which the joint has been too far away, or near enough.
    outside: u32,
    inside: u32,
    pub(super) reached: bool,
    pub(super) limited: bool,
    pub(super) homed: bool,
    pub(super) deviates: bool,
}

fn ticks(time: Second) -> u32 {
    (time.0 * SERVO_RATE_HZ as f32 + 0.5) as u32
}

impl Follower {
    /// Nothing told yet.
    pub const NEW: Self = Self {
        mode: None,
        course: Course::at_rest(0.0),
        torque: 0.0,
        seen: 0,
        goal: None,
        next: None,
        target: 0.0,
        left: 0,
        gap: Course::at_rest(0.0),
        halted: false,
        returned: false,
        outside: 0,
        inside: 0,
        reached: false,
        limited: false,
        homed: false,
        deviates: false,
    };

    /// Where the joint is commanded to be.
    #[must_use]
    pub fn course(&self) -> Course {
        self.course.plus(&self.gap)
    }

    /// The mode it is in.
    pub const fn mode(&self) -> Option<Mode> {
        self.mode
    }

    /// Follows from here on: what was asked until now is not done later.
    pub fn start(&mut self, command: &JointCommand, course: Course) {
        *self = Self { seen: command.asked, course, homed: self.homed, ..Self::NEW };
    }

    /// One tick.
    pub fn follow(&mut self, command: &JointCommand, measured: &Measured, bounds: &Bounds) -> Demand {
        let begins = command.target.mode() != self.mode;
        if begins {
            self.begin(command, measured);
        }
        let asked = core::mem::replace(&mut self.seen, command.asked) != command.asked;
        let resumes = core::mem::replace(&mut self.halted, command.halt) && !command.halt;
        let returns = measured.returns;
        let ends = core::mem::replace(&mut self.returned, returns) && !returns;
        let slow = Bounds {
            speed: min(bounds.speed, RETURN_SPEED),
            torque: RETURN_TORQUE * bounds.torque,
            ..*bounds
        };
        let bounds = if returns { &slow } else { bounds };
        let [low, high] = bounds.range;
        let range = [max(low, command.range[0].0), min(high, command.range[1].0)];
        let rates = Rates {
            speed: min(command.velocity.0, bounds.speed),
            acceleration: min(command.acceleration.0, bounds.acceleration),
            deceleration: min(command.deceleration.0, bounds.acceleration),
        };
        self.limited = false;
        let largest = min(command.largest_torque.0, bounds.torque);
        let demand = Demand {
            course: self.course,
            velocity_offset: 0.0,
            torque: 0.0,
            held: true,
            largest,
            failed: false,
            shift: None,
        };
        let period = ticks(command.period).clamp(1, LONGEST_PERIOD);
        let mut demand = match command.target {
            Target::ProfileTorque(target) => {
                let target = if command.halt { 0.0 } else { self.bounded(target.0, -largest, largest) };
                let most = command.torque_slope_nm_per_s * TICK_S;
                self.torque += clamp(target - self.torque, -most, most);
                self.reached = self.torque == target;
                return self.give(demand, measured);
            }
            Target::CyclicTorque(target) => {
                self.torque = if command.halt { 0.0 } else { self.bounded(target.0, -largest, largest) };
                self.reached = true;
                return self.give(demand, measured);
            }
            _ if command.halt => {
                (self.goal, self.next) = (None, None);
                self.close_gap();
                self.stop(&rates, bounds, measured);
                demand
            }
            Target::Hold => {
                self.stop(&rates, bounds, measured);
                demand
            }
            Target::ProfilePosition(point) => {
                self.take(point, asked);
                self.go(command, &rates, range, bounds, measured);
                demand
            }
            Target::ProfileVelocity(velocity) => {
                let wanted = self.bounded(velocity.0, -rates.speed, rates.speed);
                let rates = Rates { speed: bounds.speed, ..rates };
                self.course.accelerate(wanted, &rates, range, TICK_S);
                self.course.keep_within(command.following_window.0, measured.position.0);
                self.reached = self.course.velocity() == wanted;
                demand
            }
            Target::Homing { offset } => {
                self.stop(&rates, bounds, measured);
                let shift = if asked { self.home(offset, measured, bounds) } else { None };
                Demand { shift, ..demand }
            }
            Target::CyclicPosition { position, velocity_offset, torque_offset } => {
                let target = self.bounded(position.0, range[0], range[1]);
                // Of a joint outside, the end of the range that it returns to.
                let place = if returns { clamp(measured.position.0, low, high) } else { measured.position.0 };
                let is_far = abs(target - place) > command.following_window.0;
                if begins || resumes || ends {
                    self.gap = Course::moving(self.course.position() - target, self.course.velocity());
                    (self.course, self.target) = (Course::at_rest(target), target);
                }
                if is_far && (returns || begins || resumes || ends) {
                    self.outside = u32::MAX - 1;
                }
                self.count(target, period);
                if returns {
                    self.close_gap();
                    self.course.approach(target, &rates, TICK_S);
                } else {
                    self.course.interpolate_position(target, self.left, bounds.speed, TICK_S);
                }
                self.left = self.left.saturating_sub(1);
                if self.gap != Course::at_rest(0.0) {
                    self.gap.approach(0.0, &rates, TICK_S);
                }
                let near = abs(target - measured.position.0) <= command.position_window.0;
                self.reach(near, command.position_time);
                Demand { velocity_offset: velocity_offset.0, torque: torque_offset.0, ..demand }
            }
            Target::CyclicVelocity { velocity, torque_offset } => {
                let target = self.bounded(velocity.0, -bounds.speed, bounds.speed);
                self.count(target, period);
                let rates = Rates { speed: bounds.speed, ..rates };
                self.course.interpolate_velocity(target, self.left, &rates, range, TICK_S);
                self.course.keep_within(command.following_window.0, measured.position.0);
                self.left = self.left.saturating_sub(1);
                self.reached = self.course.velocity() == target;
                Demand { torque: torque_offset.0, ..demand }
            }
        };
        if let Some(shift) = demand.shift {
            self.course.shift(shift);
        }
        if returns {
            let place = measured.position.0;
            self.course.keep_between(min(low, place), max(high, place));
        }
        demand.course = self.course();
        demand.failed = demand.shift.is_none() && self.deviated(command, measured);
        demand
    }

    /// Another mode: from where the joint is, with the torque it has.
    fn begin(&mut self, command: &JointCommand, measured: &Measured) {
        self.mode = command.target.mode();
        self.close_gap();
        self.torque = measured.torque.0;
        (self.goal, self.next, self.left) = (None, None, 0);
        (self.outside, self.inside, self.reached, self.deviates) = (0, 0, false, false);
        // What a cyclic mode finds is new.
        self.target = f32::NAN;
    }

    /// One course of both.
    fn close_gap(&mut self) {
        self.course = self.course();
        self.gap = Course::at_rest(0.0);
    }

    /// Only the torque.
    fn give(&mut self, demand: Demand, measured: &Measured) -> Demand {
        self.deviates = false;
        self.course = Course::moving(measured.position.0, measured.velocity.0);
        Demand { course: self.course, torque: self.torque, held: false, ..demand }
    }

    /// To rest along the profile.
    fn stop(&mut self, rates: &Rates, bounds: &Bounds, measured: &Measured) {
        let rates = Rates { speed: bounds.speed, ..*rates };
        self.course.accelerate(0.0, &rates, bounds.range, TICK_S);
        self.reached = self.course.velocity() == 0.0 && abs(measured.velocity.0) < STANDING;
    }

    /// Held to bounds; told where it was beyond.
    fn bounded(&mut self, value: f32, low: f32, high: f32) -> f32 {
        let held = min(max(value, low), high);
        self.limited |= held != value;
        held
    }

    fn take(&mut self, point: SetPoint, asked: bool) {
        if asked {
            self.next = Some(point);
        }
        if let Some(point) = self.next
            && (point.immediately || self.goal.is_none() || self.reached)
        {
            let from = if point.relative { self.course.position() } else { 0.0 };
            (self.goal, self.next) = (Some(from + point.position.0), None);
            (self.reached, self.inside) = (false, 0);
        }
    }

    fn go(
        &mut self,
        command: &JointCommand,
        rates: &Rates,
        [low, high]: [f32; 2],
        bounds: &Bounds,
        measured: &Measured,
    ) {
        let Some(goal) = self.goal else {
            return self.stop(rates, bounds, measured);
        };
        let goal = self.bounded(goal, low, high);
        self.course.approach(goal, rates, TICK_S);
        let near = self.course == Course::at_rest(goal)
            && abs(goal - measured.position.0) <= command.position_window.0;
        self.reach(near, command.position_time);
    }

    fn reach(&mut self, near: bool, time: Second) {
        self.inside = if near { self.inside.saturating_add(1) } else { 0 };
        self.reached = near && self.inside >= ticks(time);
    }

    /// Of a cyclic mode: a new target begins a new period.
    fn count(&mut self, target: f32, period: u32) {
        if self.target != target {
            (self.target, self.left) = (target, period);
        }
    }

    fn home(&mut self, offset: Radian, measured: &Measured, bounds: &Bounds) -> Option<f32> {
        let [low, high] = bounds.range;
        self.homed = self.reached && offset.0 >= low && offset.0 <= high;
        self.deviates = !self.homed;
        self.homed.then_some(offset.0 - measured.position.0)
    }

    /// Too far from where it is commanded to be for too long.
    fn deviated(&mut self, command: &JointCommand, measured: &Measured) -> bool {
        let place = match self.mode {
            Some(Mode::CyclicPosition) if !measured.returns => self.target,
            _ => self.course().position(),
        };
        let is_outside = abs(place - measured.position.0) > command.following_window.0;
        self.outside = if is_outside { self.outside.saturating_add(1) } else { 0 };
        if self.mode != Some(Mode::Homing) {
            self.deviates = is_outside;
        }
        self.outside > ticks(command.following_time)
    }
}
