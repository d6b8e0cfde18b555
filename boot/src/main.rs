//! Bootloader: swaps a new image in, swaps it back if it did not confirm itself, and runs no image whose
//! check sum differs.
//!
//! ```text
//! reset --> swap requested?    new image in, one sector after the other; resumes after a power cut
//!           swapped, not confirmed?    the image before comes back
//!       --> check the image    differs: reset, which swaps it back; where that one is damaged too: swaps in
//!                              what lies in the space of the new image, if it is sound; otherwise stop
//!       --> run it             under the watchdog, as long as it has not confirmed itself
//! ```
//!
//! Everything but the flash controller and the watchdog stays as after the reset: clocks, pins, and the
//! reason of the reset, which the image reads. All bridges are off: their pins are inputs.
//!
//! The swap is `embassy-boot`'s. It takes 12 s, at most 30: four sectors are erased eight bits at a
//! time and written.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use embassy_boot_stm32::{BlockingFirmwareState, BootLoader, BootLoaderConfig, State};
use embassy_embedded_hal::flash::partition::BlockingPartition;
use embassy_stm32::Peri;
use embassy_stm32::flash::Flash;
use embassy_stm32::peripherals::{FLASH, IWDG};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use scarab_boot::{Check, Region};

/// Bytes that are copied at once.
const BUFFER: usize = 1024;
/// Time in which an unconfirmed image must have taken over the watchdog.
const TRIAL_US: u32 = 2_000_000;
/// First address of the sectors of 128 KB.
const LARGE_SECTORS: u32 = Region::IMAGE.address;

/// State of an update in a board that is flashed: none, in the format of `embassy-boot`.
#[used]
#[expect(unsafe_code, reason = "section of the linker script")]
#[unsafe(link_section = ".update_state")]
static NO_UPDATE: [u8; 4] = [0xD0; 4];

#[cortex_m_rt::entry]
fn main() -> ! {
    let (flash, watchdog) = peripherals();
    let regions = Flash::new_blocking(flash).into_blocking_regions();
    let small = Mutex::<NoopRawMutex, _>::new(RefCell::new(regions.bank1_region2));
    let large = Mutex::<NoopRawMutex, _>::new(RefCell::new(regions.bank1_region3));
    let part =
        |region: Region| BlockingPartition::new(&large, region.address - LARGE_SECTORS, region.bytes());
    let loader = BootLoader::try_prepare::<_, _, _, BUFFER>(BootLoaderConfig {
        active: part(Region::IMAGE),
        dfu: part(Region::NEW_IMAGE),
        state: BlockingPartition::new(&small, 0, Region::STATE.bytes()),
    });
    let is_sound = Check::whole(|offset, into| copy(Region::IMAGE.address + offset, into)).is_ok();
    // A failed access to the flash leaves a swap unfinished: as on trial, and the next start resumes it.
    let state = loader.map_or(State::Swap, |loader| loader.state);
    match (is_sound, &state) {
        (true, _) => {
            if state == State::Swap {
                IndependentWatchdog::new(watchdog, TRIAL_US).unleash();
            }
            run(BootLoader { state })
        }
        // The next start swaps back what this one swapped.
        (false, State::Swap) => SCB::sys_reset(),
        (false, _) => {
            let is_sound =
                Check::whole(|offset, into| copy(Region::NEW_IMAGE.address + offset, into)).is_ok();
            let mut word = [0; 4];
            let state = BlockingPartition::new(&small, 0, Region::STATE.bytes());
            if is_sound && BlockingFirmwareState::new(state, &mut word).mark_updated().is_ok() {
                SCB::sys_reset()
            }
            stop()
        }
    }
}

/// The two peripherals that are used, without a start of the chip.
#[expect(unsafe_code, reason = "peripherals without a start of the chip")]
fn peripherals() -> (Peri<'static, FLASH>, Peri<'static, IWDG>) {
    // SAFETY: called once; nothing else uses them, and interrupts are off.
    unsafe { (FLASH::steal(), IWDG::steal()) }
}

/// Runs the image.
#[expect(unsafe_code, reason = "jump into the image")]
fn run(loader: BootLoader) -> ! {
    // SAFETY: the image begins with its vector table; it was checked.
    unsafe { loader.load(Region::IMAGE.address) }
}

/// Copies bytes of the flash.
#[expect(unsafe_code, reason = "memory by its address")]
fn copy(address: u32, into: &mut [u8]) -> bool {
    for (place, byte) in into.iter_mut().enumerate() {
        // SAFETY: `Check` reads within the length of an image, which lies within its region of the flash.
        *byte = unsafe { core::ptr::read_volatile((address + place as u32) as *const u8) };
    }
    true
}

/// Nothing can run; all outputs stay off.
fn stop() -> ! {
    loop {
        cortex_m::asm::wfe();
    }
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    stop()
}
