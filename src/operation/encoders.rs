//! Absolute encoders of one axis, checked against the counter, and the joint's zero by them.
//!
//! ```text
//! rotor   position = first reading + counts since
//!         contradicts   |reading - position| > 4 counts + 1/512 turn + motion while it was read
//! joint   expected = reading at the joint's zero + direction * counts / counts per step
//!         contradicts   |reading - expected| > 2.5 degrees
//! zero    coarse = distance of the joint's readings in counts
//!         counts = coarse + r,   r = rotor position - that at the zero - coarse, within half a turn
//!         refused   |r| > a quarter of a motor turn, or 2.5 degrees of the joint
//! ```
//!
//! One contradiction or invalid frame is noise. Two contradictions in a row make the rotor position lost, and
//! both motors brake: which of the encoders is wrong is unknown. Five invalid frames in a row are a fault
//! that damps, because the counter still works.
//!
//! Why 2.5 degrees: an AS5047P errs by up to 0.8 degrees, at the zero and elsewhere in opposite directions;
//! the rest is for backlash and a mounting off the axis. The rotor's position removes these errors from the
//! zero.
//!
//! Known limits: the zero compares both encoders within a motor turn only. A joint encoder that was turned on
//! its shaft while the power was off goes unnoticed where that is near whole motor turns, for instance 7.2
//! degrees at 50:1; then the zero is wrong by as much. A gear that slipped by less than a quarter of a motor
//! turn goes unnoticed too.

use crate::leg::MotorDescription;
use crate::motor::absolute::within_half_a_turn;
use crate::motor::{AbsoluteAngle, AbsoluteEncoders, Direction, JointZero};

/// Encoders of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EncoderSettings {
    /// Absolute encoders.
    pub(crate) absolute: AbsoluteEncoders,
    /// Counts per turn of the motor.
    pub(crate) counts_per_turn: u32,
    /// Motor turns per joint turn.
    pub(crate) ratio: f32,
}

impl EncoderSettings {
    /// Encoders of a motor.
    pub const fn new(motor: &MotorDescription) -> Self {
        Self { absolute: motor.absolute, counts_per_turn: motor.counts_per_turn, ratio: motor.ratio }
    }

    /// Check of direction and ratio, for which a joint's zero holds.
    pub(super) fn joint_setting(&self) -> u8 {
        let [a, b, c, d] = self.ratio.to_le_bytes();
        let direction = if self.absolute.joint == Some(Direction::Down) { 1 } else { 0 };
        direction ^ a.rotate_left(1) ^ b.rotate_left(2) ^ c.rotate_left(3) ^ d.rotate_left(4)
    }

    fn turn(&self) -> i32 {
        self.counts_per_turn.cast_signed()
    }

    /// Counts per step of an encoder at the joint.
    fn counts_per_step(&self) -> f32 {
        self.counts_per_turn as f32 * self.ratio / AbsoluteAngle::STEPS as f32
    }

    /// Steps of the joint's encoder from its reading at the zero, in the joint's sense, within half a turn.
    fn beyond_zero(&self, direction: Direction, zero: &JointZero, reading: AbsoluteAngle) -> i32 {
        let steps = i32::from(reading.steps()) - i32::from(zero.joint.steps());
        direction.sign() * within_half_a_turn(steps, AbsoluteAngle::STEPS)
    }

    /// Counts of a joint from its zero, for the rotor's position and the reading at the joint. `None` without
    /// an encoder at the joint, and where both contradict each other.
    pub(super) fn counts_from_zero(
        &self,
        zero: &JointZero,
        rotor: i32,
        reading: AbsoluteAngle,
    ) -> Option<i32> {
        let steps = self.beyond_zero(self.absolute.joint?, zero, reading) as f32;
        let coarse = (steps * self.counts_per_step()) as i32;
        let rest = within_half_a_turn(rotor.wrapping_sub(zero.rotor).wrapping_sub(coarse), self.turn());
        let most = (JOINT_STEPS as f32 * self.counts_per_step()) as i32;
        (rest.abs() <= most.min(self.turn() / 4)).then(|| coarse + rest)
    }
}

/// Greatest difference of the joint's encoder from the counter: 2.5 degrees.
const JOINT_STEPS: i32 = 114;
/// Greatest difference of the rotor's encoder from the counter, counts, and the part of a turn added to it.
const ROTOR_COUNTS: i32 = 4;
const ROTOR_PART: i32 = 512;
/// Contradictions, and invalid frames, in a row that have an effect.
const CONTRADICTIONS: u8 = 2;
const INVALID: u8 = 5;

/// Result of a check.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Finding {
    /// No objection yet.
    Sound,
    /// No valid frame for a while.
    Silent,
    /// Reading and counter contradict each other.
    Contradiction,
}

/// Debounce counters of one encoder: checks in a row.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct DebounceCounters {
    invalid: u8,
    wrong: u8,
}

impl DebounceCounters {
    fn judge(&mut self, is_right: Option<bool>) -> Finding {
        let (invalid, wrong) = match is_right {
            None => (self.invalid.saturating_add(1), self.wrong),
            Some(is_right) => (0, if is_right { 0 } else { self.wrong.saturating_add(1) }),
        };
        *self = Self { invalid, wrong };
        match () {
            () if wrong >= CONTRADICTIONS => Finding::Contradiction,
            () if invalid >= INVALID => Finding::Silent,
            () => Finding::Sound,
        }
    }
}

/// Checks of one axis' absolute encoders; see the module.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct EncoderCheck {
    counter: u16,
    /// Rotor position in the counter's direction, counts from the absolute encoder's zero; `None` before the
    /// first reading.
    rotor: Option<i32>,
    at_rotor: DebounceCounters,
    at_joint: DebounceCounters,
}

impl EncoderCheck {
    /// Follows the counter; call it while the counter moves by less than half of its range.
    pub(super) fn follow(&mut self, settings: &EncoderSettings, counter: u16) {
        let step = i32::from(counter.wrapping_sub(self.counter).cast_signed());
        self.counter = counter;
        self.rotor =
            self.rotor.map(|rotor| (rotor + step).checked_rem_euclid(settings.turn()).unwrap_or_default());
    }

    /// Compares a reading at the rotor, in which the counter moved to `after`. Returns the result.
    pub(super) fn rotor(
        &mut self,
        settings: &EncoderSettings,
        reading: Option<AbsoluteAngle>,
        after: u16,
    ) -> Finding {
        let counts = reading.map(|reading| reading.counts(settings.turn()));
        let moved = i32::from(after.wrapping_sub(self.counter).cast_signed());
        let Some(rotor) = self.rotor else {
            // A rotor at rest, so that counter and reading belong together.
            self.rotor = counts.filter(|_| moved == 0);
            return self.at_rotor.judge(reading.map(|_| true));
        };
        let most = ROTOR_COUNTS + settings.turn() / ROTOR_PART + moved.abs();
        let is_right = counts.map(|counts| within_half_a_turn(counts - rotor, settings.turn()).abs() <= most);
        self.at_rotor.judge(is_right)
    }

    /// Compares a reading at the joint with its counts from the zero.
    pub(super) fn joint(
        &mut self,
        settings: &EncoderSettings,
        reading: Option<AbsoluteAngle>,
        zero: Option<&JointZero>,
        counts: i32,
    ) -> Finding {
        let is_right = reading.map(|reading| {
            let (Some(direction), Some(zero)) = (settings.absolute.joint, zero) else { return true };
            let expected = (counts as f32 / settings.counts_per_step()) as i32;
            let steps = settings.beyond_zero(direction, zero, reading) - expected;
            within_half_a_turn(steps, AbsoluteAngle::STEPS).abs() <= JOINT_STEPS
        });
        self.at_joint.judge(is_right)
    }

    /// Counter and rotor position of the last check, if there was a valid reading.
    pub(super) fn position(&self) -> Option<(u16, i32)> {
        self.rotor.map(|rotor| (self.counter, rotor))
    }
}

#[cfg(test)]
mod tests;
