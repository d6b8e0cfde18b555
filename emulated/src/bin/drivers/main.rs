//! A foreign program for the model of the microcontroller (`cargo chip drivers`): embassy-stm32's drivers only.
//!
//! Why: model and firmware were written from the same reading of the reference manual, so a shared mistake
//! would not show. Here the drivers of another project set the registers, and the check compares what their
//! documentation promises with what the model's pins show. Nothing of the crate `scarab` is used.
//!
//! | module | content |
//! | --- | --- |
//! | [`contract`] | steps, results and their symbols; also compiled into the check |
//! | [`computation`] | arithmetic whose words every machine gives; also compiled into the check |
//! | [`processor`] | exceptions; compared with the emulator |
//! | [`steps`] | drivers, one step each |
#![no_std]
#![no_main]

mod computation;
mod contract;
#[expect(unsafe_code, reason = "exceptions are requested, masked and looked into")]
mod processor;
mod steps;

use core::sync::atomic::{AtomicU32, Ordering::Relaxed};

use contract::{PROCESSOR_WORDS, Place, Step};

/// Number of results; those of the processor come first.
const WORDS: usize = PROCESSOR_WORDS + 32;

#[expect(unsafe_code, reason = "the check finds the symbol by its name")]
#[unsafe(no_mangle)]
static DRIVERS_STEP: AtomicU32 = AtomicU32::new(0);
#[expect(unsafe_code, reason = "the check finds the symbol by its name")]
#[unsafe(no_mangle)]
static DRIVERS_GO: AtomicU32 = AtomicU32::new(0);
#[expect(unsafe_code, reason = "the check finds the symbol by its name")]
#[unsafe(no_mangle)]
static DRIVERS_RESULTS: [AtomicU32; WORDS] = [const { AtomicU32::new(0) }; WORDS];
static NOTED: AtomicU32 = AtomicU32::new(0);

#[cortex_m_rt::entry]
fn main() -> ! {
    let mut core = cortex_m::Peripherals::take().unwrap_or_else(|| unreachable!("taken once"));
    processor::run(&mut core);
    reach(Step::Processor);
    steps::run(core)
}

/// Tells the check that a step is done, and waits for its release.
fn reach(step: Step) -> u32 {
    DRIVERS_STEP.store(step as u32, Relaxed);
    loop {
        let go = DRIVERS_GO.load(Relaxed);
        if go & 0xFF >= step as u32 {
            return go;
        }
    }
}

/// Stores a result.
fn give(place: Place, value: u32) {
    if let Some(result) = DRIVERS_RESULTS.get(place as usize) {
        result.store(value, Relaxed);
    }
}

/// Adds a result of the processor's step.
fn note(value: u32) {
    let index = NOTED.fetch_add(1, Relaxed) as usize;
    if let Some(result) = DRIVERS_RESULTS[..PROCESSOR_WORDS].get(index) {
        result.store(value, Relaxed);
    }
}

#[panic_handler]
fn panic(_: &core::panic::PanicInfo<'_>) -> ! {
    DRIVERS_STEP.store(u32::MAX, Relaxed);
    loop {
        core::hint::spin_loop();
    }
}
