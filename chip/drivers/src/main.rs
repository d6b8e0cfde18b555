//! A foreign program for the model of the chip (`cargo chip drivers`): embassy-stm32's drivers alone.
//!
//! Model and firmware were written from the same reading of the reference manual, so a shared error would not
//! show. Here the drivers of another project set the registers, and the check compares what their
//! documentation promises with the model's pins. The program does not use the crate `scarab`.
//!
//! | module | content |
//! | --- | --- |
//! | [`contract`] | steps and results; also compiled into the check |
//! | [`computation`] | arithmetic whose words every machine gives; also compiled into the check |
//! | [`processor`] | exceptions; their words are those of another emulator |
//! | [`steps`] | drivers, one step each |
#![no_std]
#![no_main]

mod computation;
mod contract;
#[expect(unsafe_code, reason = "exceptions are requested, masked and inspected")]
mod processor;
mod steps;

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

/// Capacity for results.
const WORDS: usize = 128;

/// Declares a word or words that the check finds by name.
macro_rules! shared {
    ($($name:ident: $type:ty = $value:expr;)*) => {$(
        #[expect(unsafe_code, reason = "the check finds the symbol by its name")]
        #[unsafe(no_mangle)]
        static $name: $type = $value;
    )*};
}

shared! {
    DRIVERS_STEP: AtomicU32 = AtomicU32::new(0);
    DRIVERS_GO: AtomicU32 = AtomicU32::new(0);
    DRIVERS_COUNT: AtomicU32 = AtomicU32::new(0);
    DRIVERS_RESULTS: [AtomicU32; WORDS] = [const { AtomicU32::new(0) }; WORDS];
}

#[cortex_m_rt::entry]
fn main() -> ! {
    let Some(mut core) = cortex_m::Peripherals::take() else { stop() };
    processor::run(&mut core);
    reach();
    steps::run(core)
}

/// Reports a finished step and waits for its release, which is returned.
fn reach() -> u32 {
    let step = 1 + DRIVERS_STEP.fetch_add(1, Relaxed);
    loop {
        let go = DRIVERS_GO.load(Relaxed);
        if go & 0xFF >= step {
            return go;
        }
    }
}

/// Appends a result.
fn give(value: u32) {
    let index = DRIVERS_COUNT.fetch_add(1, Relaxed) as usize;
    if let Some(result) = DRIVERS_RESULTS.get(index) {
        result.store(value, Relaxed);
    }
}

/// Ends the program; the check times out at its next step.
fn stop() -> ! {
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    stop()
}
