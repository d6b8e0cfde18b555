//! Level 0: the current loops of both axes, one after the other, each when its converters are done.
//!
//! In this order, every tick of either axis: what forbids to enable is looked at, then the axis' machine answers, then the bridge
//! is told. So from an emergency stop to both bridges off it is half a PWM period at most. Nothing here waits, formats
//! or uses a critical section.
//!
//! A bridge switches only for an axis with a calibration (or one that is being calibrated), with a target of the servo, while
//! the interlock is clear, and while the servo goes on answering. A target is followed only where both axes run; one that loses its place
//! ends the servo's ticks at once, whatever else is found and told.

use cortex_m::peripheral::DWT;
use heapless::spsc::{Consumer, Producer};

use super::interlock::{self, Cause};
use super::leg::JOINTS;
use super::links::{Order, Outcome};
use super::servo::{self, target};
use super::statistics;
use crate::board::odrive_v3_6::settings::{CLOCK_HZ, analog, drives};
use crate::board::odrive_v3_6::{brake, bridge, contacts, converter, encoder, interrupts};
use crate::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, JointSample};
use crate::leg::axis_code;
use crate::motor::{Axis, AxisFault, BrakeBudget, CalibrationStep, Calibrator, Chopper, Wish};
use crate::safety::{Bridges, FaultCode, ServoWatch, TickState, TickWatch};
use crate::servo::SERVO_RATE_HZ;
use crate::units::Volt;

/// Current ticks for one of the servo.
const TICKS_PER_SERVO: u32 = CURRENT_RATE_HZ / SERVO_RATE_HZ;
/// Processor cycles between two ticks of one axis.
const CYCLES: u32 = CLOCK_HZ / CURRENT_RATE_HZ;

/// So long after its last tick an axis is seen to have stopped, by the ticks of the other.
const LATE_CYCLES: u32 = 3 * CYCLES;

/// A brake resistor is connected: said when the image is built.
const HAS_BRAKE_RESISTOR: bool = option_env!("SCARAB_BRAKE_RESISTOR").is_some();

/// What an axis does.
#[expect(clippy::large_enum_variant, reason = "there is one of each axis, and no heap to box it on")]
enum Stage {
    Off,
    Calibrating(Calibrator),
    Running(Axis),
}

/// One axis.
struct AxisLoop {
    stage: Stage,
    orders: Consumer<'static, Order>,
    outcomes: Producer<'static, Outcome>,
    samples: Producer<'static, JointSample>,
    /// Since the last sample for the servo.
    ticks: u32,
    /// Cycle counter at the last tick.
    last: Option<u32>,
    watch: TickWatch,
    /// What was told of.
    faulted: Option<AxisFault>,
}

/// What level 0 works on.
pub struct CurrentLoops {
    axes: [AxisLoop; JOINTS],
    servo: ServoWatch,
    /// Of the brake resistor, if there is one.
    chopper: Option<Chopper>,
    budget: BrakeBudget,
    volt_per_code: Volt,
}

/// What level 0 works on, once it is there.
pub static LOOPS: spin::Mutex<Option<&'static mut CurrentLoops>> = spin::Mutex::new(None);

/// An end of each queue that level 0 has.
pub type Ends = (Consumer<'static, Order>, Producer<'static, Outcome>, Producer<'static, JointSample>);

impl CurrentLoops {
    /// Both axes off, on a board with this divider of the bus voltage.
    #[must_use]
    pub fn new(ends: [Ends; JOINTS], divider: f32) -> Self {
        let axes = ends.map(|(orders, outcomes, samples)| AxisLoop {
            stage: Stage::Off,
            orders,
            outcomes,
            samples,
            ticks: 0,
            last: None,
            watch: TickWatch::default(),
            faulted: None,
        });
        let [begin, full] = drives::chopper(divider);
        let chopper = if HAS_BRAKE_RESISTOR { Chopper::new(begin, full) } else { None };
        let volt_per_code = analog::sense(divider).volt_per_code;
        Self { axes, servo: ServoWatch::default(), chopper, budget: BrakeBudget::FULL, volt_per_code }
    }

    /// One tick of one axis; `complete` if both of its shunts were converted.
    #[inline(never)]
    fn tick(&mut self, axis: usize, complete: bool) {
        let begun = DWT::cycle_count();
        let bus = converter::bus();
        if axis == 0
            && let Some(chopper) = &self.chopper
        {
            let wanted = chopper.duty(self.volt_per_code * f32::from(bus));
            brake::set(self.budget.spend(wanted));
        }
        self.look_at_the_others(axis, begun);
        let all_run = self.axes.iter().all(|axis| matches!(axis.stage, Stage::Running(_)));
        let Some(this) = self.axes.get_mut(axis) else { return };
        this.watch(begun, complete);
        let sample = AxisSample {
            shunt_codes: converter::shunts(axis),
            bus_code: bus,
            encoder_count: encoder::count(axis),
            index_count: encoder::index(axis),
        };
        let bridges = Bridges::of(interlock::causes());
        if bridges == Bridges::Release {
            bridge::release_all();
        }
        let command = this.step(axis, &sample, bridges, all_run);
        bridge::set(axis, &command);
        this.ticks += 1;
        if this.ticks >= TICKS_PER_SERVO {
            this.ticks = 0;
            if let Stage::Running(axis) = &mut this.stage {
                // A servo that does not fetch is noticed below.
                let _ = this.samples.enqueue(axis.joint_sample());
            }
            if axis + 1 == JOINTS {
                self.call_servo();
            }
        }
        let [now, low, high] = &statistics::BUS;
        now.set(bus.into());
        low.lower(bus.into());
        high.raise(bus.into());
        if let Some(ticks) = statistics::CURRENT_TICKS.get(axis) {
            ticks.add();
        }
        statistics::CURRENT_WORST.raise(DWT::cycle_count().wrapping_sub(begun));
    }

    /// An axis whose ticks no longer come cannot say so itself, and its bridge does what it was told last.
    #[inline(always)]
    fn look_at_the_others(&self, axis: usize, now: u32) {
        for (other, that) in self.axes.iter().enumerate() {
            if other != axis && that.last.is_some_and(|last| now.wrapping_sub(last) > LATE_CYCLES) {
                interlock::raise(Cause::CurrentTicks);
            }
        }
    }

    fn call_servo(&mut self) {
        let (missed, forbids) = self.servo.look(statistics::SERVO_TICKS.get());
        if missed {
            statistics::SERVO_MISSED.add();
        }
        interlock::raise_bits(forbids);
        interrupts::pend_servo();
    }
}

impl AxisLoop {
    /// What forbids to enable is looked at before anything else: contacts, conversion, the time since the last tick.
    fn watch(&mut self, now: u32, complete: bool) {
        // Half a period late is one missed; a gap of three periods two.
        let periods = self.last.map_or(1, |last| (now.wrapping_sub(last) + CYCLES / 2) / CYCLES);
        self.last = Some(now);
        let missed = periods.saturating_sub(1).min(255) as u8;
        if missed > 0 {
            statistics::CURRENT_MISSED.add();
        }
        let state = TickState {
            emergency_stop: contacts::emergency_stop(),
            gate_fault: contacts::gate_fault(),
            complete,
            missed,
        };
        let (forbids, damp) = self.watch.look(&state);
        interlock::raise_bits(forbids);
        if damp {
            servo::report(FaultCode::CurrentTicks);
        }
    }

    fn step(&mut self, axis: usize, sample: &AxisSample, bridges: Bridges, all_run: bool) -> AxisCommand {
        if self.orders.ready() {
            self.obey();
        }
        match &mut self.stage {
            Stage::Off => AxisCommand::RELEASED,
            Stage::Calibrating(_) if bridges != Bridges::Follow => {
                self.end_calibration(Outcome::Interrupted);
                AxisCommand::RELEASED
            }
            Stage::Calibrating(calibrator) => match calibrator.tick(sample) {
                CalibrationStep::Running(command) => command,
                CalibrationStep::Done(calibration) => {
                    self.end_calibration(Outcome::Calibrated(calibration));
                    AxisCommand::RELEASED
                }
                CalibrationStep::Refused(refusal) => {
                    self.end_calibration(Outcome::Refused(refusal));
                    AxisCommand::RELEASED
                }
            },
            Stage::Running(running) => {
                let wish = match bridges {
                    Bridges::Follow if all_run => target(axis).into(),
                    Bridges::Brake => Wish::Brake,
                    Bridges::Follow | Bridges::Release => Wish::Released,
                };
                let command = running.act(sample, wish);
                if let Some(fault) = running.fault().filter(|fault| self.faulted != Some(*fault)) {
                    self.faulted = Some(fault);
                    let cause = Cause::of_axis(axis, axis_code(fault), wish != Wish::Released);
                    interlock::raise(cause);
                    // A fault of one axis takes the other: at once, or in its own next tick where both brake.
                    if Bridges::of(cause.bit()) == Bridges::Release {
                        bridge::release_all();
                    }
                    let lost = running.is_lost();
                    if lost {
                        servo::end();
                    }
                    let _ = self.outcomes.enqueue(Outcome::Fault { fault, lost });
                }
                command
            }
        }
    }

    /// The queue has room: a calibration is ordered only after the one before has been heard of.
    fn end_calibration(&mut self, outcome: Outcome) {
        self.stage = Stage::Off;
        let _ = self.outcomes.enqueue(outcome);
    }

    #[inline(never)]
    fn obey(&mut self) {
        let Some(order) = self.orders.dequeue() else { return };
        match order {
            Order::Off if matches!(self.stage, Stage::Calibrating(_)) => {
                self.end_calibration(Outcome::Interrupted);
            }
            Order::Off => self.stage = Stage::Off,
            Order::Calibrate(calibrator) => self.stage = Stage::Calibrating(calibrator),
            Order::Run(axis) => {
                self.faulted = None;
                self.stage = Stage::Running(axis);
            }
            Order::Place(counts) => {
                if let Stage::Running(axis) = &mut self.stage {
                    axis.set_counts(counts);
                }
            }
            Order::ClearFault => {
                if let Stage::Running(axis) = &mut self.stage {
                    // A place that was lost stays lost: only a new calibration helps, and the fault is told again. A motor
                    // that brakes is let go, and to be calibrated as well.
                    let is_clear = axis.clear_fault();
                    self.faulted = None;
                    if !is_clear {
                        self.stage = Stage::Off;
                    }
                }
            }
        }
    }
}

/// The converters' vector.
#[inline(always)]
pub fn interrupt() {
    let finished = converter::finished();
    // Nothing else takes this lock once the interrupt is enabled.
    if let Some(mut loops) = LOOPS.try_lock()
        && let Some(loops) = loops.as_mut()
    {
        for (axis, done) in finished.into_iter().enumerate() {
            if let Some(complete) = done {
                loops.tick(axis, complete);
            }
        }
    }
}
