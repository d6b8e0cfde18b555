//! Level 0 on the board: reads converters and counters for `operation::CurrentLoops`.

use core::num::NonZeroU32;

use cortex_m::peripheral::DWT;

use super::SIGNALS;
use super::leg::JOINTS;
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::board::odrive_v3_6::settings::{CLOCK_HZ, analog, drives};
use crate::board::odrive_v3_6::{contacts, converter, encoder};
use crate::hal::{AxisSample, CURRENT_RATE_HZ};
use crate::motor::Chopper;
use crate::operation::{AxisState, CurrentEnds, CurrentLoops, Tick};

/// Whether a brake resistor is connected; set when the image is built.
const HAS_BRAKE_RESISTOR: bool = option_env!("SCARAB_BRAKE_RESISTOR").is_some();

/// Processor cycles between two ticks of one axis.
const CYCLES: NonZeroU32 = NonZeroU32::new(CLOCK_HZ / CURRENT_RATE_HZ).expect("more than one");

/// State of level 0.
pub struct Current {
    loops: CurrentLoops<JOINTS>,
    ends: CurrentEnds<'static, JOINTS>,
}

/// State of level 0, once the start has set it.
pub static LOOPS: spin::Mutex<Option<&'static mut Current>> = spin::Mutex::new(None);

impl Current {
    /// Both axes off, on a board with this bus-voltage divider.
    pub fn new(ends: CurrentEnds<'static, JOINTS>, divider: f32) -> Self {
        let [begin, full] = drives::chopper(divider);
        let chopper = if HAS_BRAKE_RESISTOR { Chopper::new(begin, full) } else { None };
        let volt_per_code = analog::sense(divider).volt_per_code;
        let loops = CurrentLoops::new([AxisState::OFF; JOINTS], CYCLES, chopper, volt_per_code);
        Self { loops, ends }
    }

    /// Runs one tick of one axis; `complete` if both of its shunts were converted.
    #[inline(never)]
    fn tick(&mut self, axis: usize, complete: bool) {
        let begun = DWT::cycle_count();
        let tick = Tick {
            now: begun,
            emergency_stop: contacts::emergency_stop(),
            gate_fault: contacts::gate_fault(),
            complete,
            supply: axis != 0 || converter::supply_finished(),
            sample: AxisSample {
                shunt_codes: converter::shunts(axis),
                bus_code: converter::bus(),
                encoder_count: encoder::sample(axis),
                index_count: encoder::index(axis),
            },
        };
        self.loops.tick(axis, &tick, &mut self.ends, &SIGNALS, &mut Odrive);
        SIGNALS.statistics.current_worst.raise(DWT::cycle_count().wrapping_sub(begun));
    }
}

/// Interrupt of the converters.
#[inline(always)]
pub fn interrupt() {
    let finished = converter::finished();
    // Once the interrupt is enabled, only this handler takes the lock.
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
