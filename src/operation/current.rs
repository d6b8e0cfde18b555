//! Level 0: the current loops of all axes, one after the other, each after its conversions.
//!
//! Order in every tick of either axis: inhibit reasons, then the axis state, then its bridge. Nothing here
//! waits or formats. An emergency stop turns both bridges off in its own interrupt. Without that interrupt it
//! takes the rest of the time to the next tick and this tick's path to its bridge.
//!
//! A bridge switches only for an axis with a calibration (or under calibration), with a target of the servo,
//! while the inhibit word is clear and the servo answers. The stop's interrupt may come between any two
//! instructions of a tick. So the inhibit word is read again, with interrupts masked, at the moment of
//! enabling the outputs ([`apply`]). One tick after each joint sample an axis checks its
//! constants ([`Axis::check_constants`](crate::motor::Axis::check_constants)), two ticks later itself
//! ([`Axis::check`](crate::motor::Axis::check)).
//!
//! While the flash is written ([`InhibitReason::Storing`]) nothing switches, not even the brake resistor, and
//! the processor may stall. The joints' motion during an erasure is unknown, so their zeros are discarded and
//! the servo ends. A target is followed only where all axes run. An axis that loses its rotor position ends
//! the servo's ticks at once.

use core::num::NonZeroU32;

use super::axis_state::{AxisState, Outcome};
use super::queues::CurrentEnds;
use super::signals::Signals;
use crate::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, Hardware};
use crate::leg::axis_code;
use crate::motor::{AxisRequest, BrakeBudget, Chopper};
use crate::real::max;
use crate::safety::{BoardFault, Bridges, InhibitReason, ServoWatch, TickState, TickWatch};
use crate::servo::SERVO_RATE_HZ;
use crate::units::Volt;

/// Current ticks per servo tick.
const TICKS_PER_SERVO: u32 = CURRENT_RATE_HZ / SERVO_RATE_HZ;
/// Tick after a joint sample in which an axis compares its constants with their checksum.
const CONSTANTS_TICK: u32 = 1;
/// Tick in which an axis checks itself. Joint sample and both checks lie in different ticks.
const CHECK_TICK: u32 = TICKS_PER_SERVO / 2;

/// Periods without a tick after which the other axes' ticks detect that an axis has stopped.
const LATE_PERIODS: u32 = 3;

/// Periods without a tick after which the joint's motion is unknown: a sector's erasure, not the write of a
/// word (0.1 ms). In 2 ms no motor moves by half of the counter's range.
const CERTAIN_PERIODS: u32 = CURRENT_RATE_HZ / 500;

/// Periods in a row without a conversion of the bus voltage that are a fault.
const UNCONVERTED: u8 = 2;

/// Ticks after a stall in which the index is ignored. Its interrupt was late by the stall, and so is its
/// captured count. The interrupt comes after the first of them.
const LATE_TICKS: u8 = 2;

/// Board state at a tick of an axis.
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
    /// Bus voltage and temperatures were converted since this axis' last tick; set for the first axis only.
    pub supply: bool,
    /// Sample of the axis.
    pub sample: AxisSample,
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct AxisLoop {
    stage: AxisState,
    /// Ticks since the last sample for the servo.
    ticks: u32,
    /// Clock at the last tick.
    last: Option<u32>,
    watch: TickWatch,
    /// Remaining ticks in which the index is ignored.
    late: u8,
    /// Outcome that found the queue to the housekeeping full.
    unsent: Option<Outcome>,
}

/// State of level 0.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CurrentLoops<const N: usize> {
    axes: [AxisLoop; N],
    /// Clock ticks per period of an axis.
    period: NonZeroU32,
    servo: ServoWatch,
    /// Periods without a conversion of the bus voltage.
    unconverted: u8,
    /// Control of the brake resistor, if there is one.
    chopper: Option<Chopper>,
    budget: BrakeBudget,
    volt_per_code: Volt,
}

impl<const N: usize> CurrentLoops<N> {
    /// Creates the loops with these axis states; `period` is the PWM period in ticks of the board's clock.
    pub fn new(
        states: [AxisState; N],
        period: NonZeroU32,
        chopper: Option<Chopper>,
        volt_per_code: Volt,
    ) -> Self {
        let axes = states.map(|stage| AxisLoop {
            stage,
            ticks: 0,
            last: None,
            watch: TickWatch::default(),
            late: 0,
            unsent: None,
        });
        let servo = ServoWatch::default();
        Self { axes, period, servo, unconverted: 0, chopper, budget: BrakeBudget::FULL, volt_per_code }
    }

    /// Removes the brake resistor, as in an image that was built without one; host only.
    #[cfg(not(target_os = "none"))]
    pub fn remove_chopper(&mut self) {
        self.chopper = None;
    }

    /// State of an axis, mutable.
    pub fn axis_state_mut(&mut self, axis: usize) -> Option<&mut AxisState> {
        self.axes.get_mut(axis).map(|axis| &mut axis.stage)
    }

    /// State of an axis.
    pub fn axis_state(&self, axis: usize) -> Option<&AxisState> {
        self.axes.get(axis).map(|axis| &axis.stage)
    }

    /// Runs one tick of one axis.
    #[inline(always)]
    pub fn tick<H: Hardware<N>>(
        &mut self,
        axis: usize,
        tick: &Tick,
        ends: &mut CurrentEnds<'_, N>,
        signals: &Signals<N>,
        hardware: &mut H,
    ) {
        if axis == 0 {
            self.brake(tick, signals, hardware);
        }
        self.check_other_axes(axis, tick.now, signals);
        let all_run = self.axes.iter().all(|axis| axis.stage.is_running());
        let period = self.period;
        let Some(this) = self.axes.get_mut(axis) else { return };
        if let Some(outcome) = this.unsent.take() {
            this.unsent = send(axis, outcome, ends);
        }
        let mut sample = tick.sample;
        if let Some(stood) = this.check(axis, tick, period, signals) {
            if stood > 0 {
                this.late = LATE_TICKS;
            }
            if this.late > 0 {
                this.late -= 1;
                sample.index_count = None;
            }
            let long = stood > CERTAIN_PERIODS;
            if stood > 0 && this.stage.stood_still(&sample, long) && long {
                report(axis, Outcome::StoodStill, &mut this.unsent, ends, signals);
            }
        }
        let bridges = Bridges::from_causes(signals.inhibit.causes());
        if bridges == Bridges::Off {
            hardware.disable_all();
        }
        if ends.orders.get(axis).is_some_and(|orders| orders.ready()) {
            let order = ends.orders.get_mut(axis).and_then(|orders| orders.dequeue());
            if let Some(outcome) = order.and_then(|order| this.stage.apply_order(order)) {
                report(axis, outcome, &mut this.unsent, ends, signals);
            }
        }
        let target = if all_run { signals.target(axis) } else { AxisRequest::OFF };
        let command = this.stage.tick(&sample, bridges, target, |outcome, switching, command| {
            let command = react(axis, &outcome, switching, command, signals, hardware);
            report(axis, outcome, &mut this.unsent, ends, signals);
            command
        });
        apply(axis, &command, signals, hardware);
        this.ticks += 1;
        if (this.ticks == CONSTANTS_TICK || this.ticks == CHECK_TICK)
            && let Some(running) = this.stage.axis_mut()
        {
            if this.ticks == CHECK_TICK { running.check() } else { running.check_constants() }
        }
        if this.ticks >= TICKS_PER_SERVO {
            this.ticks = 0;
            signals.add_i2t(axis, this.stage.square_a2());
            if let Some(running) = this.stage.axis_mut()
                && let Some(samples) = ends.samples.get_mut(axis)
            {
                signals.set_current_share(axis, running.current_share());
                signals.set_power(axis, running.power_w());
                signals.set_rotor_currents(axis, running.measured(), running.angle());
                // A servo that does not read its samples is detected below.
                let _ = samples.enqueue(running.joint_sample());
            }
            if axis + 1 == N {
                let (missed, forbids) = self.servo.check(signals.statistics.servo_ticks.get());
                signals.inhibit.raise_bits(forbids);
                if missed {
                    signals.statistics.servo_missed.add();
                }
                hardware.pend_servo();
            }
        }
        if let Some(ticks) = signals.statistics.current_ticks.get(axis) {
            ticks.count();
        }
        // Both axes see the same reading.
        if axis == 0 {
            signals.statistics.see_bus(tick.sample.bus_code);
        }
    }

    /// Sets the brake resistor to the larger duty of chopper and servo. Without a bus voltage the resistor
    /// stays off. One missing reading is tolerated, as at the start.
    #[inline(always)]
    fn brake<H: Hardware<N>>(&mut self, tick: &Tick, signals: &Signals<N>, hardware: &mut H) {
        let stands = signals.inhibit.is_storing();
        let misses = !tick.supply && !stands;
        self.unconverted = if misses { self.unconverted.saturating_add(1) } else { 0 };
        let unknown = self.unconverted >= UNCONVERTED;
        if unknown {
            signals.inhibit.raise(InhibitReason::Conversion);
        }
        // During a flash write no tick would turn the resistor off again.
        if self.chopper.is_some() {
            let bus = (!stands && !unknown).then(|| self.volt_per_code * f32::from(tick.sample.bus_code));
            self.resist(bus, signals, hardware);
        }
    }

    /// Sets the brake resistor at this bus voltage.
    #[inline(always)]
    fn resist<H: Hardware<N>>(&mut self, bus: Option<Volt>, signals: &Signals<N>, hardware: &mut H) {
        let by_voltage = self.chopper.as_ref().zip(bus).is_some_and(|(chopper, bus)| chopper.conducts(bus));
        let is_wanted = by_voltage || signals.wants_brake();
        // Usual case: no demand and a full budget.
        let duty = if is_wanted || !self.budget.is_full() { self.brake_duty(bus, signals) } else { 0.0 };
        hardware.set_brake(duty);
        signals.set_given_brake(duty);
    }

    /// Duty of the brake resistor, by bus voltage, servo and budget.
    #[cold]
    #[inline(never)]
    fn brake_duty(&mut self, bus: Option<Volt>, signals: &Signals<N>) -> f32 {
        let chopper = self.chopper.as_ref().zip(bus);
        let wanted = chopper.map_or(0.0, |(chopper, bus)| max(chopper.duty(bus), signals.wanted_brake()));
        self.budget.spend(wanted)
    }

    /// Checks the other axes' ticks. A stopped axis cannot report itself, and its bridge repeats its last
    /// command.
    #[inline(always)]
    fn check_other_axes(&self, axis: usize, now: u32, signals: &Signals<N>) {
        let late = LATE_PERIODS.wrapping_mul(self.period.get());
        let stands = signals.inhibit.is_storing();
        for (other, that) in self.axes.iter().enumerate() {
            if other != axis && !stands && that.last.is_some_and(|last| now.wrapping_sub(last) > late) {
                signals.inhibit.raise(InhibitReason::CurrentTicks);
            }
        }
    }
}

/// Applies a command to a bridge. Its outputs are enabled only if the inhibit word still allows it: a stop
/// since the word was read has already turned them off.
#[inline(always)]
fn apply<const N: usize, H: Hardware<N>>(
    axis: usize,
    command: &AxisCommand,
    signals: &Signals<N>,
    hardware: &mut H,
) {
    if !command.enabled {
        return hardware.disable(axis);
    }
    hardware.set_duty(axis, &command.duty);
    hardware.masked(|hardware| {
        if Bridges::from_causes(signals.inhibit.causes()) != Bridges::Off {
            hardware.enable(axis);
        }
    });
}

impl AxisLoop {
    /// Sets inhibit reasons from contacts, conversion and the time since the last tick. During a flash write
    /// missing ticks and conversions are no fault; returns the number of missed periods then.
    #[inline(always)]
    fn check<const N: usize>(
        &mut self,
        axis: usize,
        tick: &Tick,
        period: NonZeroU32,
        signals: &Signals<N>,
    ) -> Option<u32> {
        // Rounded: half a period late is one missed period, a gap of three periods two. No division on time.
        let since = self.last.map_or(0, |last| tick.now.wrapping_sub(last));
        let half = period.get() / 2;
        let is_late = since.saturating_add(half) >= 2 * period.get();
        let periods = if is_late { (since.saturating_add(half) / period).saturating_sub(1) } else { 0 };
        let stood = signals.inhibit.is_storing().then_some(periods);
        let missed = if stood.is_some() { 0 } else { periods.min(255) as u8 };
        self.last = Some(tick.now);
        if missed > 0 {
            signals.statistics.current_missed.add();
        }
        let state = TickState {
            emergency_stop: tick.emergency_stop,
            gate_fault: tick.gate_fault,
            complete: tick.complete || stood.is_some(),
            missed,
        };
        let (forbids, damp) = self.watch.check(&state);
        signals.inhibit.raise_bits(forbids);
        if damp {
            signals.report(BoardFault::CurrentTicks, axis);
        }
        stood
    }
}

/// Returns the command of an axis' bridge after an outcome. A fault applies to the other axes at once.
#[inline(never)]
fn react<const N: usize, H: Hardware<N>>(
    axis: usize,
    outcome: &Outcome,
    switching: bool,
    command: AxisCommand,
    signals: &Signals<N>,
    hardware: &mut H,
) -> AxisCommand {
    let mut command = command;
    if let Outcome::Fault { fault, .. } = *outcome {
        let code = axis_code(fault);
        signals.inhibit.raise(InhibitReason::from_axis_fault(axis, code, switching));
        signals.report_axis(code, axis);
        match Bridges::from_causes(signals.inhibit.causes()) {
            Bridges::Follow => {}
            Bridges::Brake => {
                command = AxisCommand::BRAKE;
                (0..N).for_each(|other| apply(other, &command, signals, hardware));
            }
            Bridges::Off => {
                command = AxisCommand::OFF;
                hardware.disable_all();
            }
        }
    }
    command
}

/// Sends an outcome to the housekeeping. Without the rotor's position the joints' samples are invalid; the
/// servo reports the axis' fault to the bus all the same.
#[inline(never)]
fn report<const N: usize>(
    axis: usize,
    outcome: Outcome,
    unsent: &mut Option<Outcome>,
    ends: &mut CurrentEnds<'_, N>,
    signals: &Signals<N>,
) {
    if matches!(outcome, Outcome::Fault { lost: true, .. } | Outcome::StoodStill) {
        signals.end_servo();
    }
    let left = send(axis, outcome, ends);
    // A later pulse repeats what a lost one says. The other outcomes answer an order, so no two of them wait.
    if left.is_some_and(|outcome| !matches!(outcome, Outcome::Index(_))) {
        *unsent = left;
    }
}

/// Sends an outcome; returns it if its queue is full.
#[inline(never)]
fn send<const N: usize>(axis: usize, outcome: Outcome, ends: &mut CurrentEnds<'_, N>) -> Option<Outcome> {
    ends.outcomes.get_mut(axis)?.enqueue(outcome).err()
}

#[cfg(test)]
mod tests;
