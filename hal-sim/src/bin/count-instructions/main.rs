//! Counts instructions on the emulated microcontroller: one axis' tick, its parts, and the same steps of the crate `foc`.
//!
//! Why instructions: the emulator executes them exactly and in the same number every time, and models neither flash wait
//! states nor pipeline. `scripts/count-instructions` builds and runs this image (`qemu-system-arm -M netduinoplus2 -icount
//! shift=0`, where one count of TIM5 is one instruction) and fails above the design's bound.
#![no_std]
#![no_main]

mod axis_tick;
mod counter;
mod motor;
mod peers;

use cortex_m_semihosting::{debug, hprintln};

/// Design: one axis' tick.
const MOST_INSTRUCTIONS_PER_TICK: u32 = 700;

#[cortex_m_rt::entry]
fn main() -> ! {
    let worst = axis_tick::report();
    peers::report();
    if worst <= MOST_INSTRUCTIONS_PER_TICK {
        debug::exit(debug::EXIT_SUCCESS);
    } else {
        hprintln!("{} instructions are more than {}", worst, MOST_INSTRUCTIONS_PER_TICK);
        debug::exit(debug::EXIT_FAILURE);
    }
    loop {}
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    debug::exit(debug::EXIT_FAILURE);
    loop {}
}
