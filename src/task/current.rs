//! Level 0 on the board: converters, bridges and queues beneath `operation::CurrentLoops`.

use core::num::NonZeroU32;

use cortex_m::peripheral::DWT;
use heapless::spsc::{Consumer, Producer};

use super::interlock;
use super::leg::JOINTS;
use super::servo;
use super::statistics;
use crate::board::odrive_v3_6::settings::{CLOCK_HZ, analog, drives};
use crate::board::odrive_v3_6::{brake, bridge, contacts, converter, encoder, interrupts};
use crate::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ, JointSample};
use crate::motor::{AxisRequest, Chopper};
use crate::operation::{CurrentBoard, CurrentLoops, Order, Outcome, Stage, Tick};
use crate::safety::FaultCode;

/// A brake resistor is connected: said when the image is built.
const HAS_BRAKE_RESISTOR: bool = option_env!("SCARAB_BRAKE_RESISTOR").is_some();

/// Processor cycles between two ticks of one axis.
const CYCLES: NonZeroU32 = NonZeroU32::new(CLOCK_HZ / CURRENT_RATE_HZ).expect("more than one");

/// An axis' end of each of its queues.
pub type Ends = (Consumer<'static, Order>, Producer<'static, Outcome>, Producer<'static, JointSample>);

/// What level 0 works on.
pub struct Current {
    loops: CurrentLoops<JOINTS>,
    ends: [Ends; JOINTS],
}

/// What level 0 works on, once it is there.
pub static LOOPS: spin::Mutex<Option<&'static mut Current>> = spin::Mutex::new(None);

impl Current {
    /// Both axes off, on a board with this divider of the bus voltage.
    #[must_use]
    pub fn new(ends: [Ends; JOINTS], divider: f32) -> Self {
        let [begin, full] = drives::chopper(divider);
        let chopper = if HAS_BRAKE_RESISTOR { Chopper::new(begin, full) } else { None };
        let volt_per_code = analog::sense(divider).volt_per_code;
        let loops = CurrentLoops::new([Stage::OFF; JOINTS], CYCLES, chopper, volt_per_code);
        Self { loops, ends }
    }

    /// One tick of one axis; `complete` if both of its shunts were converted.
    #[inline(never)]
    fn tick(&mut self, axis: usize, complete: bool) {
        let begun = DWT::cycle_count();
        let bus = converter::bus();
        let tick = Tick {
            now: begun,
            emergency_stop: contacts::emergency_stop(),
            gate_fault: contacts::gate_fault(),
            complete,
            supply: axis != 0 || converter::supply_finished(),
            sample: AxisSample {
                shunt_codes: converter::shunts(axis),
                bus_code: bus,
                encoder_count: encoder::sample(axis),
                index_count: encoder::index(axis),
            },
        };
        self.loops.tick(axis, &tick, &mut Ports { ends: &mut self.ends });
        let [now, low, high] = &statistics::BUS;
        now.set(bus.into());
        low.lower(bus.into());
        high.raise(bus.into());
        if let Some(ticks) = statistics::CURRENT_TICKS.get(axis) {
            ticks.add();
        }
        statistics::CURRENT_WORST.raise(DWT::cycle_count().wrapping_sub(begun));
    }
}

/// The board as level 0 has it.
struct Ports<'a> {
    ends: &'a mut [Ends; JOINTS],
}

impl CurrentBoard for Ports<'_> {
    #[inline(always)]
    fn causes(&self) -> u32 {
        interlock::causes()
    }

    #[inline(always)]
    fn raise(&mut self, bits: u32) {
        interlock::raise_bits(bits);
    }

    #[inline(always)]
    fn release_all(&mut self) {
        bridge::release_all();
    }

    #[inline(always)]
    fn drive(&mut self, axis: usize, command: &AxisCommand) {
        bridge::set(axis, command);
    }

    #[inline(always)]
    fn set_brake(&mut self, duty: f32) {
        brake::set(duty);
    }

    #[inline(always)]
    fn target(&self, axis: usize) -> AxisRequest {
        servo::target(axis)
    }

    fn end_servo(&mut self) {
        servo::end();
    }

    fn damp(&mut self) {
        servo::report(FaultCode::CurrentTicks);
    }

    #[inline(always)]
    fn has_order(&self, axis: usize) -> bool {
        self.ends.get(axis).is_some_and(|(orders, ..)| orders.ready())
    }

    fn order(&mut self, axis: usize) -> Option<Order> {
        self.ends.get_mut(axis)?.0.dequeue()
    }

    fn tell(&mut self, axis: usize, outcome: Outcome) {
        if let Some((_, outcomes, _)) = self.ends.get_mut(axis) {
            let _ = outcomes.enqueue(outcome);
        }
    }

    fn sample(&mut self, axis: usize, sample: JointSample) {
        if let Some((.., samples)) = self.ends.get_mut(axis) {
            let _ = samples.enqueue(sample);
        }
    }

    fn servo_ticks(&self) -> u32 {
        statistics::SERVO_TICKS.get()
    }

    fn call_servo(&mut self, missed: bool) {
        if missed {
            statistics::SERVO_MISSED.add();
        }
        interrupts::pend_servo();
    }

    fn count_missed(&mut self) {
        statistics::CURRENT_MISSED.add();
    }
}

/// The converters' vector.
#[inline(always)]
pub fn interrupt() {
    let finished = converter::finished();
    // Nothing else takes this lock once the interrupt is enabled.
    if let Some(mut current) = LOOPS.try_lock()
        && let Some(current) = current.as_mut()
    {
        for (axis, done) in finished.into_iter().enumerate() {
            if let Some(complete) = done {
                current.tick(axis, complete);
            }
        }
    }
}
