//! The flash image of the ODrive v3.6 joint drive board: starts the board, the leg and the priority levels.
//!
//! `scarab::task` shows which task runs at which level. Nothing is decided here: a failed start sets an
//! inhibit reason, and the board goes on, so that the host can read it.
#![no_std]
#![no_main]

use core::panic::PanicInfo;

use defmt_rtt as _;
use scarab::board::crash;
use scarab::board::odrive_v3_6::start;
use scarab::task;

#[cortex_m_rt::entry]
fn main() -> ! {
    task::run(start::start(task::leg::LEG.joints.map(|joint| joint.motor.absolute)))
}

#[panic_handler]
fn panic(information: &PanicInfo<'_>) -> ! {
    crash::panic(information)
}
