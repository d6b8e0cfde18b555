//! Counts instructions on the emulated microcontroller.
//!
//! The program counts one axis' tick and its parts, the whole current interrupt, a leg's 4 kHz tick, the
//! steps of its identification, the iterations of the default swarm, and the frames of the bus.
//!
//! Instructions are counted because the emulator executes exactly the same number every time, and models
//! neither flash wait states nor pipeline. `scripts/count-instructions` builds and runs this image
//! (`qemu-system-arm -M netduinoplus2 -icount shift=0`, where one count of TIM5 is one instruction). The
//! script fails if a design bound is exceeded.
#![no_std]
#![no_main]

mod account;
mod assist;
mod axis_parts;
mod axis_tick;
mod bus;
mod bus_round;
mod copies;
mod counter;
mod identification;
mod interrupt;
mod leg;
mod leg_tick;
mod machine;
mod motor;
#[path = "../../../../examples/damped_oscillation/objective.rs"]
mod objective;
mod own_objective;
mod swarm;

use cortex_m_semihosting::{debug, hprintln};

#[cortex_m_rt::entry]
fn main() -> ! {
    let is_within = counter::start() && {
        let mut account = account::Account::default();
        let axis = copies::report() & axis_tick::report() & interrupt::report(&mut account);
        let search = leg::model().and_then(|model| {
            leg_tick::report(&model, &mut account)?;
            assist::report(&model, &mut account)?;
            identification::report(&model, &mut account)
        });
        let swarm = swarm::report().and_then(|()| own_objective::report()).and_then(|()| bus::report());
        let bus = bus_round::report();
        let is_within = account.report();
        axis && search == Some(true) && swarm.is_some() && bus == Some(true) && is_within
    };
    end(is_within)
}

fn end(is_within: bool) -> ! {
    debug::exit(if is_within { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
    loop {
        core::hint::spin_loop();
    }
}

#[panic_handler]
fn panic(info: &core::panic::PanicInfo<'_>) -> ! {
    hprintln!("{}", info);
    end(false)
}
