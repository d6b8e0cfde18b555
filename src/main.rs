//! The flash image of the ODrive v3.6 joint drive board: brings up the board, builds the leg, starts the levels.
//!
//! What runs where: `scarab::task`. Nothing here decides anything; what speaks against enabling is raised in the interlock,
//! and the board goes on, so that it can be told.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use defmt_rtt as _;
use scarab::board::crash;
use scarab::board::odrive_v3_6::start;
use scarab::task;

#[cortex_m_rt::entry]
fn main() -> ! {
    task::run(start::start())
}

#[panic_handler]
fn panic(information: &PanicInfo<'_>) -> ! {
    crash::panic(information)
}
