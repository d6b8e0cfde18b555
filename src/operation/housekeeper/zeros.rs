//! Zeros of the joints: stated by the operator, or by absolute encoders at the joints; and the checks of all
//! absolute encoders.
//!
//! A stated pose is the anatomical zero. Where each joint has an encoder of its own, the readings at that
//! pose are kept with the calibration. After the next power-up they set the zeros as soon as all axes are
//! calibrated and the leg has stood still for half a second.

use super::super::axis_state::Order;
use super::super::contacts::{OperatorRequest, RATE_HZ};
use super::super::encoders::{EncoderCheck, EncoderSettings, Finding};
use super::{Calibration, Housekeeper, Level};
use crate::hal::{AbsoluteEncoderSide, Hardware, JointSample};
use crate::leg::StoredCalibration;
use crate::motor::absolute::within_half_a_turn;
use crate::motor::reference::{ReferenceStep, StatedPose};
use crate::motor::{AbsoluteAngle, JointZero};
use crate::safety::BoardFault;
use crate::trace::Record;
use crate::units::Hertz;

/// A reference in progress: joints that must stand still, and which of them have.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reference<const N: usize> {
    poses: [(StatedPose, bool); N],
    /// The encoders at the joints set the zeros, not the pose.
    is_absolute: bool,
}

impl<const N: usize> Reference<N> {
    /// The pose is the zero.
    pub(super) fn by_operator() -> Option<Self> {
        let pose = StatedPose::new(Hertz(RATE_HZ as f32))?;
        Some(Self { poses: [(pose, false); N], is_absolute: false })
    }

    fn by_encoders() -> Option<Self> {
        Some(Self { is_absolute: true, ..Self::by_operator()? })
    }
}

/// Reading of an absolute encoder.
fn reading<const N: usize>(
    axis: usize,
    side: AbsoluteEncoderSide,
    level: &mut Level<'_, '_, N, impl Hardware<N>>,
) -> Option<AbsoluteAngle> {
    AbsoluteAngle::from_frame(level.hardware.encoder_frame(axis, side))
}

/// Two readings of an absolute encoder that agree to two steps, of three attempts: one frame may be
/// disturbed.
fn steady_reading<const N: usize>(
    axis: usize,
    side: AbsoluteEncoderSide,
    level: &mut Level<'_, '_, N, impl Hardware<N>>,
) -> Option<AbsoluteAngle> {
    (0..3).find_map(|_| {
        let (first, second) = (reading(axis, side, level)?, reading(axis, side, level)?);
        let apart = i32::from(first.steps()) - i32::from(second.steps());
        (within_half_a_turn(apart, AbsoluteAngle::STEPS).abs() <= 2).then_some(second)
    })
}

/// Counts of a joint at the servo's last tick.
fn counts<const N: usize, H>(axis: usize, level: &Level<'_, '_, N, H>) -> i32 {
    level.signals.statistics.counts.get(axis).map_or(0, |count| count.get().cast_signed())
}

impl<const N: usize> Housekeeper<N> {
    /// Follows the counters of axes with an absolute encoder at the rotor. A flash write may let a counter
    /// wrap unseen, so the checks restart after it.
    pub(super) fn follow_counters(&mut self, level: &Level<'_, '_, N, impl Hardware<N>>) {
        if level.signals.inhibit.is_storing() {
            self.checks = [EncoderCheck::default(); N];
        }
        for (axis, (check, encoders)) in self.checks.iter_mut().zip(&self.settings.encoders).enumerate() {
            if encoders.absolute.rotor {
                check.follow(encoders, level.hardware.encoder_count(axis));
            }
        }
    }

    /// Compares an axis' absolute encoders with its counter.
    #[inline(never)]
    pub(super) fn check_encoders(&mut self, axis: usize, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        let Some(encoders) = self.settings.encoders.get(axis).copied() else { return };
        if encoders.absolute.rotor {
            let reading = reading(axis, AbsoluteEncoderSide::Rotor, level);
            let after = level.hardware.encoder_count(axis);
            let check = |check: &mut EncoderCheck| check.rotor(&encoders, reading, after);
            let finding = self.checks.get_mut(axis).map_or(Finding::Sound, check);
            self.react(axis, finding, "absolute_encoder", level);
        }
        if encoders.absolute.joint.is_some() {
            let reading = reading(axis, AbsoluteEncoderSide::Joint, level);
            let counts = counts(axis, level);
            let zero = self.joint_zeros.get(axis).and_then(Option::as_ref);
            let zero = zero.filter(|_| level.signals.has_begun());
            let check = |check: &mut EncoderCheck| check.joint(&encoders, reading, zero, counts);
            let finding = self.checks.get_mut(axis).map_or(Finding::Sound, check);
            self.react(axis, finding, "joint_encoder", level);
        }
    }

    /// Acts on a finding. A contradiction is recorded once; which encoder is wrong is not known, so the rotor
    /// position is lost, and a stored zero of the joint is not used again.
    #[cold]
    #[inline(never)]
    fn react(
        &mut self,
        axis: usize,
        finding: Finding,
        name: &'static str,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) {
        match finding {
            Finding::Sound => {}
            // Before that a calibration or a reference is refused.
            Finding::Silent if !level.signals.has_begun() => {}
            Finding::Silent => level.signals.report(BoardFault::AbsoluteEncoder, axis),
            Finding::Contradiction => {
                let is_calibrating = self.calibrating == Some(axis);
                let order = if is_calibrating { Order::Off } else { Order::LosePosition };
                // A full queue is tried again at the next check.
                if self.is_contradicted(axis) || !level.order(axis, order) {
                    return;
                }
                if let Some(contradicted) = self.contradicted.get_mut(axis) {
                    *contradicted = true;
                }
                self.must_turn(axis, true);
                level.record(Record::AxisFault { tick: self.round, joint: axis as u8 + 1, name });
                if let Some(zero) = self.joint_zeros.get_mut(axis) {
                    *zero = None;
                }
            }
        }
    }

    /// Discards the joints' zeros, also a reference in progress.
    pub(super) fn forget_zeros(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        level.signals.end_servo();
        (self.reference, self.placed) = (None, false);
        // The servo sends the state of a leg that rests; its fault may have come before.
        self.drive = self.drive.filter(|drive| drive.fault().is_some());
    }

    /// Sets the rotor position at count zero of an axis that begins to run at this counter reading.
    #[inline(never)]
    pub(super) fn set_origin(&mut self, axis: usize, calibration: &Calibration, counter: u16) {
        if let Some((origin, configuration)) = self.origins.get_mut(axis).zip(self.settings.axes.get(axis))
            && let Ok(scale) = configuration.scale()
        {
            let position = calibration.position_of(&scale, configuration.counter, counter);
            *origin = configuration.flexion.sign() * configuration.counter.sign() * position;
        }
    }

    /// Begins a reference by the joints' encoders, once all axes are calibrated and all zeros are known.
    fn begin_reference(&mut self, level: &Level<'_, '_, N, impl Hardware<N>>) {
        let is_known = self.joint_zeros.iter().all(Option::is_some);
        let is_due = self.is_calibrated() && !level.signals.has_begun() && !self.placed;
        if is_known && is_due && self.reference.is_none() && !self.contradicted.contains(&true) {
            self.reference = Reference::by_encoders();
        }
    }

    pub(super) fn advance_reference(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) {
        if core::mem::take(&mut self.placed) && self.is_calibrated() {
            level.signals.begin_servo();
        }
        self.begin_reference(level);
        let Some(mut reference) = self.reference else { return };
        let mut standing = true;
        for (joint, (pose, found)) in reference.poses.iter_mut().enumerate() {
            let sample = JointSample { encoder_counts: counts(joint, level), ..JointSample::default() };
            match pose.tick(&sample) {
                ReferenceStep::Running => {}
                ReferenceStep::Found => *found = true,
                ReferenceStep::Moved => standing = false,
            }
        }
        self.reference = Some(reference).filter(|_| standing);
        let all = reference.poses.iter().all(|(_, found)| *found);
        let accepted = match (standing, reference.is_absolute) {
            // A position that an axis does not get would be a wrong zero.
            (true, _) if !all || !level.takes_orders() => return,
            // The encoders need no decision of the operator, so they wait for a leg at rest.
            (false, true) => return,
            (true, true) => {
                let agrees = self.set_zeros_by_encoders(level);
                self.reference = None;
                let Some(agrees) = agrees else { return };
                agrees
            }
            (true, false) => self.set_zeros_at_pose(level),
            (false, false) => false,
        };
        self.reference = None;
        // The operator's accepted request was recorded when it came.
        if reference.is_absolute || !accepted {
            let name = OperatorRequest::Reference.name();
            level.record(Record::Request { tick: self.round, name, accepted });
        }
    }

    /// Reading of an axis' joint encoder: `Some(None)` without one, `None` where it does not answer.
    fn joint_reading(
        &self,
        axis: usize,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) -> Option<Option<AbsoluteAngle>> {
        match self.settings.encoders.get(axis)?.absolute.joint {
            Some(_) => steady_reading(axis, AbsoluteEncoderSide::Joint, level).map(Some),
            None => Some(None),
        }
    }

    /// Takes the joints' pose as zero, and keeps the readings of their encoders. Returns whether all answer.
    fn set_zeros_at_pose(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) -> bool {
        let readings: [_; N] = core::array::from_fn(|axis| self.joint_reading(axis, level));
        let all = readings.iter().all(Option::is_some);
        for (axis, reading) in readings.into_iter().enumerate().filter(|_| all) {
            self.keep_zero(axis, reading.flatten(), level);
        }
        all
    }

    /// Takes a joint's pose as zero, with this reading of its encoder.
    #[inline(never)]
    fn keep_zero(
        &mut self,
        axis: usize,
        reading: Option<AbsoluteAngle>,
        level: &mut Level<'_, '_, N, impl Hardware<N>>,
    ) {
        let rotor = self.set_counts(axis, 0, level);
        let setting = self.settings.encoders.get(axis).map_or(0, EncoderSettings::joint_setting);
        let zero = reading.map(|joint| JointZero { rotor, joint, setting });
        if let Some(slot) = self.joint_zeros.get_mut(axis) {
            *slot = zero;
        }
        if zero.is_some()
            && let Some(passed) = self.passed.get(axis).copied().flatten()
        {
            self.passes(axis, Some(StoredCalibration { joint_zero: zero, ..passed }));
        }
    }

    /// Present counts of a joint from its zero by this reading; `None` where that and the rotor's position
    /// contradict each other.
    #[inline(never)]
    fn counts_from_zero(
        &self,
        axis: usize,
        reading: Option<AbsoluteAngle>,
        level: &Level<'_, '_, N, impl Hardware<N>>,
    ) -> Option<i32> {
        let rotor = self.origins.get(axis)?.wrapping_add(counts(axis, level));
        let zero = self.joint_zeros.get(axis)?.as_ref()?;
        self.settings.encoders.get(axis)?.counts_from_zero(zero, rotor, reading?)
    }

    /// Sets the zeros by the joints' encoders. Returns whether all agree with the rotors' positions;
    /// otherwise the operator has to state the pose. `None` where an encoder does not answer now.
    fn set_zeros_by_encoders(&mut self, level: &mut Level<'_, '_, N, impl Hardware<N>>) -> Option<bool> {
        let readings: [_; N] = core::array::from_fn(|axis| self.joint_reading(axis, level));
        if readings.contains(&None) {
            return None;
        }
        let mut readings = readings.into_iter();
        let wanted: [_; N] = core::array::from_fn(|axis| {
            self.counts_from_zero(axis, readings.next().flatten().flatten(), level)
        });
        if wanted.contains(&None) {
            self.joint_zeros = [None; N];
            return Some(false);
        }
        for (axis, counts) in wanted.into_iter().enumerate() {
            self.set_counts(axis, counts.unwrap_or_default(), level);
        }
        Some(true)
    }

    /// Sets a joint's present count; returns the rotor's position in the joint's sense.
    #[inline(never)]
    fn set_counts(&mut self, axis: usize, to: i32, level: &mut Level<'_, '_, N, impl Hardware<N>>) -> i32 {
        self.placed = true;
        let Some(origin) = self.origins.get_mut(axis) else { return 0 };
        let rotor = origin.wrapping_add(counts(axis, level));
        *origin = rotor.wrapping_sub(to);
        // There is space: checked before.
        level.order(axis, Order::SetCounts(to));
        rotor
    }
}
