//! Level 0: the current loops of all axes, one after the other, each when its converters are done.
//!
//! In this order, every tick of either axis: what forbids to enable is looked at, then the axis' stage answers, then the bridge
//! is told. So from an emergency stop to both bridges off it is half a PWM period at most. Nothing here waits, formats
//! or uses a critical section.
//!
//! A bridge switches only for an axis with a calibration (or one that is being calibrated), with a target of the servo, while
//! the interlock is clear, and while the servo goes on answering. While the flash is written ([`Cause::Storing`]) nothing switches, not even
//! the brake resistor, and everything may stand still: what an erasure lasted through is not known any more, so the joints' zeros are
//! forgotten and the servo ends; no axis holds it against its counter. A target is followed only where all axes run; one that loses its place
//! ends the servo's ticks at once, whatever else is found and told.

use core::num::NonZeroU32;

use super::stage::{Order, Outcome, Stage};
use crate::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, JointSample};
use crate::leg::axis_code;
use crate::motor::{AxisRequest, BrakeBudget, Chopper};
use crate::safety::{Bridges, Cause, ServoWatch, TickState, TickWatch};
use crate::servo::SERVO_RATE_HZ;
use crate::units::Volt;

/// Current ticks for one of the servo.
const TICKS_PER_SERVO: u32 = CURRENT_RATE_HZ / SERVO_RATE_HZ;

/// After so many periods without a tick an axis is seen to have stopped, by the ticks of the others.
const LATE_PERIODS: u32 = 3;

/// Periods without a tick after which nobody knows any more how far a joint went: a sector's erasure, and not the writing of a word
/// (0.1 ms). In 2 ms no motor goes half of the counter's range.
const CERTAIN_PERIODS: u32 = CURRENT_RATE_HZ / 500;

/// So many periods in a row without a conversion of the bus voltage are too many.
const UNCONVERTED: u8 = 2;

/// Ticks after a time without any in which the index is not believed: its interrupt is late by as much, and so is the count it takes. It
/// comes after the first of them.
const LATE_TICKS: u8 = 2;

/// What level 0 needs of a board. Every method answers at once.
pub trait CurrentBoard {
    /// Why nothing may be enabled: the interlock's bits.
    fn causes(&self) -> u32;
    /// More of them.
    fn raise(&mut self, bits: u32);
    /// Both bridges off, now.
    fn release_all(&mut self);
    /// What a bridge does in its next period.
    fn drive(&mut self, axis: usize, command: &AxisCommand);
    /// What the brake resistor does, a share of time.
    fn set_brake(&mut self, duty: f32);
    /// What the servo asks of an axis.
    fn target(&self, axis: usize) -> AxisRequest;
    /// The joints' samples mean nothing any more.
    fn end_servo(&mut self);
    /// Current ticks are missing: the servo has to damp.
    fn damp(&mut self);
    /// An order waits for an axis.
    fn has_order(&self, axis: usize) -> bool;
    /// It.
    fn order(&mut self, axis: usize) -> Option<Order>;
    /// What came of an axis, for the housekeeper.
    fn tell(&mut self, axis: usize, outcome: Outcome);
    /// The mean of a joint's last periods, for the servo.
    fn sample(&mut self, axis: usize, sample: JointSample);
    /// How often the servo has ticked.
    fn servo_ticks(&self) -> u32;
    /// Its next tick is due; `missed` where it did not answer the last call.
    fn call_servo(&mut self, missed: bool);
    /// A tick of an axis came late.
    fn count_missed(&mut self);
}

/// What a board shows at a tick of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Free-running clock.
    pub now: u32,
    /// The emergency stop's contact is open.
    pub emergency_stop: bool,
    /// A gate driver reports a fault.
    pub gate_fault: bool,
    /// Both of the axis' shunts were converted.
    pub complete: bool,
    /// Bus voltage and temperatures were, since the last tick of this axis; asked of the first axis alone.
    pub supply: bool,
    /// Of the axis.
    pub sample: AxisSample,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisLoop {
    stage: Stage,
    /// Since the last sample for the servo.
    ticks: u32,
    /// Clock at the last tick.
    last: Option<u32>,
    watch: TickWatch,
    /// Ticks that the index is not believed in.
    late: u8,
}

/// What level 0 works on.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoops<const N: usize> {
    axes: [AxisLoop; N],
    /// Ticks of the clock between two of one axis.
    period: NonZeroU32,
    servo: ServoWatch,
    /// Periods without a conversion of the bus voltage.
    unconverted: u8,
    /// Of the brake resistor, if there is one.
    chopper: Option<Chopper>,
    budget: BrakeBudget,
    volt_per_code: Volt,
}

impl<const N: usize> CurrentLoops<N> {
    /// Axes in these stages; `period` ticks of the board's clock are one of an axis.
    #[must_use]
    pub fn new(
        stages: [Stage; N],
        period: NonZeroU32,
        chopper: Option<Chopper>,
        volt_per_code: Volt,
    ) -> Self {
        let axes = stages.map(|stage| AxisLoop {
            stage,
            ticks: 0,
            last: None,
            watch: TickWatch::default(),
            late: 0,
        });
        let servo = ServoWatch::default();
        Self { axes, period, servo, unconverted: 0, chopper, budget: BrakeBudget::FULL, volt_per_code }
    }

    /// What an axis does.
    pub fn stage_mut(&mut self, axis: usize) -> Option<&mut Stage> {
        self.axes.get_mut(axis).map(|axis| &mut axis.stage)
    }

    /// One tick of one axis.
    #[inline(always)]
    pub fn tick(&mut self, axis: usize, tick: &Tick, board: &mut impl CurrentBoard) {
        if axis == 0 {
            // Who does not know the bus cannot brake into it. One may be missing: the first of all.
            let misses = !tick.supply && !is_storing(board);
            self.unconverted = if misses { self.unconverted.saturating_add(1) } else { 0 };
            let unknown = self.unconverted >= UNCONVERTED;
            if unknown {
                board.raise(Cause::Conversion.bit());
            }
            if let Some(chopper) = &self.chopper {
                // Nobody would take it back while the flash stands; it refuses as long as there is one.
                let wanted = match is_storing(board) || unknown {
                    true => 0.0,
                    false => chopper.duty(self.volt_per_code * f32::from(tick.sample.bus_code)),
                };
                board.set_brake(self.budget.spend(wanted));
            }
        }
        self.look_at_the_others(axis, tick.now, board);
        let all_run = self.axes.iter().all(|axis| axis.stage.is_running());
        let period = self.period;
        let Some(this) = self.axes.get_mut(axis) else { return };
        let mut sample = tick.sample;
        if let Some(stood) = this.look(tick, period, board) {
            if stood > 0 {
                this.late = LATE_TICKS;
            }
            if this.late > 0 {
                this.late -= 1;
                sample.index_count = None;
            }
            let long = stood > CERTAIN_PERIODS;
            if stood > 0 && this.stage.stood_still(&sample, long) && long {
                forget(axis, Outcome::StoodStill, board);
            }
        }
        let bridges = Bridges::of(board.causes());
        if bridges == Bridges::Release {
            board.release_all();
        }
        if board.has_order(axis) {
            let ended = board.order(axis).and_then(|order| this.stage.obey(order));
            if let Some(outcome) = ended {
                forget(axis, outcome, board);
            }
        }
        let target = if all_run { board.target(axis) } else { AxisRequest::RELEASED };
        let (mut command, told) = this.stage.tick(&sample, bridges, target);
        if let Some((outcome, switching)) = told {
            command = found::<N>(axis, outcome, switching, command, board);
        }
        board.drive(axis, &command);
        this.ticks += 1;
        if this.ticks >= TICKS_PER_SERVO {
            this.ticks = 0;
            if let Some(running) = this.stage.axis_mut() {
                // A servo that does not fetch is noticed below.
                board.sample(axis, running.joint_sample());
            }
            if axis + 1 == N {
                let (missed, forbids) = self.servo.look(board.servo_ticks());
                board.raise(forbids);
                board.call_servo(missed);
            }
        }
    }

    /// An axis whose ticks no longer come cannot say so itself, and its bridge does what it was told last.
    #[inline(always)]
    fn look_at_the_others(&self, axis: usize, now: u32, board: &mut impl CurrentBoard) {
        let late = LATE_PERIODS.wrapping_mul(self.period.get());
        let stands = is_storing(board);
        for (other, that) in self.axes.iter().enumerate() {
            if other != axis && !stands && that.last.is_some_and(|last| now.wrapping_sub(last) > late) {
                board.raise(Cause::CurrentTicks.bit());
            }
        }
    }
}

/// The flash is being written: bridges are released, and ticks that do not come are nobody's fault.
#[inline(always)]
fn is_storing(board: &impl CurrentBoard) -> bool {
    board.causes() & Cause::Storing.bit() != 0
}

impl AxisLoop {
    /// What forbids to enable is looked at before anything else: contacts, conversion, the time since the last tick. While the flash is
    /// written a time without ticks is nobody's fault, nor are conversions that nobody fetched: so many periods it was.
    #[inline(always)]
    fn look(&mut self, tick: &Tick, period: NonZeroU32, board: &mut impl CurrentBoard) -> Option<u32> {
        // Half a period late is one missed; a gap of three periods two.
        let since = |last| tick.now.wrapping_sub(last).saturating_add(period.get() / 2) / period;
        let periods = self.last.map_or(1, since).saturating_sub(1);
        let stood = is_storing(board).then_some(periods);
        let missed = if stood.is_some() { 0 } else { periods.min(255) as u8 };
        self.last = Some(tick.now);
        if missed > 0 {
            board.count_missed();
        }
        let state = TickState {
            emergency_stop: tick.emergency_stop,
            gate_fault: tick.gate_fault,
            complete: tick.complete || stood.is_some(),
            missed,
        };
        let (forbids, damp) = self.watch.look(&state);
        board.raise(forbids);
        if damp {
            board.damp();
        }
        stood
    }
}

/// What came of an axis, and what its bridge does then: a fault takes the others at once, whether they are released or brake.
#[inline(never)]
fn found<const N: usize>(
    axis: usize,
    outcome: Outcome,
    switching: bool,
    command: AxisCommand,
    board: &mut impl CurrentBoard,
) -> AxisCommand {
    let mut command = command;
    if let Outcome::Fault { fault, .. } = outcome {
        board.raise(Cause::of_axis(axis, axis_code(fault), switching).bit());
        match Bridges::of(board.causes()) {
            Bridges::Follow => {}
            Bridges::Brake => {
                command = AxisCommand::BRAKE;
                (0..N).for_each(|other| board.drive(other, &command));
            }
            Bridges::Release => {
                command = AxisCommand::RELEASED;
                board.release_all();
            }
        }
    }
    forget(axis, outcome, board);
    command
}

/// With the place goes what the joints' samples mean.
fn forget(axis: usize, outcome: Outcome, board: &mut impl CurrentBoard) {
    if matches!(outcome, Outcome::Fault { lost: true, .. } | Outcome::StoodStill) {
        board.end_servo();
    }
    board.tell(axis, outcome);
}

#[cfg(test)]
mod tests;
