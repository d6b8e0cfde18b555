//! The hardware of this image: a board with memory words as registers.
//!
//! Each method accesses as many words as the board's own accesses registers, so the instructions of a level
//! are those of the flash image. The program sets the values that a level reads.

use scarab::board::odrive_v3_6::settings::timers::{MOE, TOP, bridge, compare};
use scarab::hal::{AxisCommand, Contacts, Controller, EncoderPlace, Frame, Hardware};
use scarab::operation::Word;

use crate::account::{CYCLES_PER_INSTRUCTION, PROCESSOR_HZ};
use crate::counter;

/// Time per instruction while the levels above the bus take a third of the processor.
const US_PER_INSTRUCTION: f32 = 1e6 / PROCESSOR_HZ * CYCLES_PER_INSTRUCTION / (1.0 - 0.33);
/// Register value with the main output off, and duties of no voltage.
const OFF: u32 = bridge(0)[0].value;
const NO_VOLTAGE: u32 = TOP as u32 / 2;

/// Registers of one converter.
#[derive(Debug)]
pub struct Converter {
    /// End-of-conversion flags.
    pub status: Word,
    /// First injected result, and the regular one.
    pub results: [Word; 2],
}

/// Registers of one bridge's timer.
#[derive(Debug)]
struct Timer {
    duties: [Word; 3],
    output: Word,
}

/// Registers that the levels access.
#[derive(Debug)]
pub struct Registers {
    /// Bus voltage, shunts of B, shunts of C.
    pub converters: [Converter; 3],
    /// Cycle counter of the processor.
    pub cycles: Word,
    /// Levels of the contacts' port and of the gate drivers' fault line; all ones means no fault.
    pub ports: [Word; 2],
    /// Encoder counters.
    pub counters: [Word; 2],
    /// Counts at index pulses, flagged by a higher bit; 0 without a pulse.
    pub indices: [Word; 2],
    /// Requests of the servo and of the bus.
    pub requests: [Word; 2],
    timers: [Timer; 2],
}

/// Board of this image.
pub static REGISTERS: Registers = Registers {
    converters: [const { Converter { status: Word::new(0), results: [const { Word::new(0) }; 2] } }; 3],
    cycles: Word::new(0),
    ports: [const { Word::new(u32::MAX) }; 2],
    counters: [const { Word::new(0) }; 2],
    indices: [const { Word::new(0) }; 2],
    requests: [const { Word::new(0) }; 2],
    timers: [const { Timer { duties: [const { Word::new(0) }; 3], output: Word::new(0) } }; 2],
};

/// Command in a bridge's registers.
pub fn command(axis: usize) -> AxisCommand {
    let Some(timer) = REGISTERS.timers.get(axis) else { return AxisCommand::OFF };
    let duty = timer.duties.each_ref().map(|duty| 1.0 - duty.get() as f32 / f32::from(TOP));
    AxisCommand { enabled: timer.output.get() & MOE != 0, duty }
}

/// The board at the levels' interface, and the wire of the bus.
#[derive(Debug, Default)]
pub struct Machine {
    /// Time at which the present round of the bus began.
    pub now_us: u64,
    /// The counter at that time.
    pub begun: u32,
    /// Frames that were sent.
    pub sent: u32,
    /// Bits of the frames that were sent.
    pub bits: u32,
}

/// Bits of a frame on the wire, with the following pause.
pub fn bits(frame: &Frame) -> u32 {
    47 + 8 * frame.data().len() as u32
}

impl Hardware<2> for Machine {
    #[inline(always)]
    fn masked(&mut self, step: impl FnOnce(&mut Self)) {
        cortex_m::interrupt::free(|_| step(self));
    }

    #[inline(always)]
    fn disable_all(&mut self) {
        REGISTERS.timers.iter().for_each(|timer| timer.output.set(OFF));
    }

    #[inline(always)]
    fn disable(&mut self, axis: usize) {
        let Some(timer) = REGISTERS.timers.get(axis) else { return };
        timer.output.set(OFF);
        timer.duties.iter().for_each(|duty| duty.set(NO_VOLTAGE));
    }

    #[inline(always)]
    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]) {
        let Some(timer) = REGISTERS.timers.get(axis) else { return };
        let ([a, b, c], [to_a, to_b, to_c]) = (*duty, &timer.duties);
        to_a.set(compare(a).into());
        to_b.set(compare(b).into());
        to_c.set(compare(c).into());
    }

    #[inline(always)]
    fn enable(&mut self, axis: usize) {
        if let Some(timer) = REGISTERS.timers.get(axis) {
            timer.output.set(OFF | MOE);
        }
    }

    fn set_brake(&mut self, duty: f32) {
        let [low, high] = scarab::board::odrive_v3_6::settings::chopper::compare(duty);
        REGISTERS.requests[0].set(u32::from(low) | u32::from(high) << 16);
    }

    fn set_holding_brake(&mut self, _: bool) {}
    fn set_status_light(&mut self, _: bool) {}

    #[inline(always)]
    fn pend_servo(&mut self) {
        REGISTERS.requests[0].set(1);
    }

    #[inline(always)]
    fn pend_bus(&mut self) {
        REGISTERS.requests[1].set(1);
    }

    #[inline(always)]
    fn pend_assist(&mut self) {
        REGISTERS.requests[1].set(2);
    }

    fn contacts(&self) -> Contacts {
        let port = REGISTERS.ports[0].get();
        Contacts { enabling: port & 1 << 2 != 0, start: port & 1 << 3 != 0 }
    }

    fn encoder_count(&self, axis: usize) -> u16 {
        REGISTERS.counters.get(axis).map_or(0, |counter| counter.get() as u16)
    }

    fn encoder_frame(&mut self, _: usize, _: EncoderPlace) -> u16 {
        u16::MAX
    }

    fn temperature(&self, _: usize) -> Option<f32> {
        Some(25.0)
    }

    fn convert_thermistor(&mut self, _: usize) {}

    fn thermistor_code(&mut self) -> Option<u16> {
        None
    }

    fn gate_holds(&mut self, _: usize) -> bool {
        true
    }

    fn gate_status(&mut self, _: usize) -> u32 {
        0
    }

    fn switch_gates(&mut self, _: bool) {}

    fn configure_gates(&mut self) -> bool {
        true
    }

    fn now_us(&self) -> u64 {
        self.now_us + u64::from((counter::now().wrapping_sub(self.begun) as f32 * US_PER_INSTRUCTION) as u32)
    }

    fn controller(&mut self) -> Controller {
        Controller::Active
    }

    fn mailboxes_waiting(&self) -> u32 {
        0
    }

    fn send(&mut self, _: u32, frame: &Frame) {
        self.sent += 1;
        self.bits += bits(frame);
    }

    fn abort_transmission(&mut self) {}

    fn feed_watchdog(&mut self) {}

    fn stretch_watchdog(&mut self) -> bool {
        true
    }

    fn tighten_watchdog(&mut self) -> bool {
        true
    }
}
