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
//! Before, in the first start of a board, the brown-out reset is set to level 3. A chip is delivered without
//! one: between 2.7 and 1.8 V it would run at 168 MHz and write its flash outside its specification. Why here
//! and not by the debug probe: no watchdog runs yet that could reset the chip within the change.
//!
//! Everything but flash controller, voltage detector and watchdog stays as after the reset: clocks, pins, and
//! the reason of the reset, which the image reads. All bridges are off: their pins are inputs.
//!
//! The swap is `embassy-boot`'s: six sectors of 128 KB are erased (1 s each, at most 2) and written (0.5 s
//! each, at most 3.3). That is 9 s, at most 32 (DS8626 table 42).
//!
//! Words of 32 bits are erased at once, twice as fast as the bytes of `embassy-stm32`'s driver. This needs a
//! supply of 2.7 V and more: a swap waits while the voltage detector shows less than 2.9 V.
#![no_std]
#![no_main]

use core::cell::RefCell;
use core::panic::PanicInfo;

use cortex_m::peripheral::SCB;
use embassy_boot_stm32::{BlockingFirmwareState, BootLoader, BootLoaderConfig, State};
use embassy_embedded_hal::flash::partition::BlockingPartition;
use embassy_stm32::Peri;
use embassy_stm32::flash::{Error, Flash};
use embassy_stm32::pac;
use embassy_stm32::peripherals::{FLASH, IWDG};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_sync::blocking_mutex::Mutex;
use embassy_sync::blocking_mutex::raw::NoopRawMutex;
use embedded_storage::nor_flash::{ErrorType, NorFlash, ReadNorFlash};
use scarab_boot::{Check, Region};

/// Bytes that are copied at once.
const BUFFER: usize = 1024;
/// Time in which an unconfirmed image must have taken over the watchdog.
const TRIAL_US: u32 = 2_000_000;
/// First address of the sectors of 16 KB, and of those of 128 KB.
const SMALL_SECTORS: u32 = Region::BOOTLOADER.address;
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
    let small = Mutex::<NoopRawMutex, _>::new(RefCell::new(ByWords(regions.bank1_region1)));
    let large = Mutex::<NoopRawMutex, _>::new(RefCell::new(ByWords(regions.bank1_region3)));
    let part =
        |region: Region| BlockingPartition::new(&large, region.address - LARGE_SECTORS, region.bytes());
    let state_part = || {
        let offset = Region::STATE.address - SMALL_SECTORS;
        BlockingPartition::new(&small, offset, Region::STATE.bytes())
    };
    supply::watch();
    set_brown_out_reset();
    let loader = BootLoader::try_prepare::<_, _, _, BUFFER>(BootLoaderConfig {
        active: part(Region::IMAGE),
        dfu: part(Region::NEW_IMAGE),
        state: state_part(),
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
            if is_sound && BlockingFirmwareState::new(state_part(), &mut word).mark_updated().is_ok() {
                SCB::sys_reset()
            }
            stop()
        }
    }
}

/// Sets brown-out reset level 3 in the option bytes; it acts from the next power-on reset (RM0090 3.6.5).
/// Leaves them alone where it is set, or where the chip is read-protected.
fn set_brown_out_reset() {
    const UNPROTECTED: u8 = 0xAA;
    const LEVEL_3: u8 = 0;
    let options = pac::FLASH.optcr().read();
    if options.bor_lev() == LEVEL_3 || options.rdp() != UNPROTECTED {
        return;
    }
    supply::wait();
    OPTION_KEYS.into_iter().for_each(|key| pac::FLASH.optkeyr().write_value(key));
    pac::FLASH.optcr().modify(|w| w.set_bor_lev(LEVEL_3));
    pac::FLASH.optcr().modify(|w| w.set_optstrt(true));
    while pac::FLASH.sr().read().bsy() {}
    pac::FLASH.optcr().modify(|w| w.set_optlock(true));
}

/// Flash that is erased by words of 32 bits, while the supply suffices.
struct ByWords<F>(F);

impl<F: ErrorType> ErrorType for ByWords<F> {
    type Error = F::Error;
}

impl<F: ReadNorFlash> ReadNorFlash for ByWords<F> {
    const READ_SIZE: usize = F::READ_SIZE;

    fn read(&mut self, offset: u32, bytes: &mut [u8]) -> Result<(), F::Error> {
        self.0.read(offset, bytes)
    }

    fn capacity(&self) -> usize {
        self.0.capacity()
    }
}

impl<F: NorFlash<Error = Error>> NorFlash for ByWords<F> {
    const WRITE_SIZE: usize = F::WRITE_SIZE;
    const ERASE_SIZE: usize = F::ERASE_SIZE;

    fn erase(&mut self, from: u32, to: u32) -> Result<(), Error> {
        supply::wait();
        // The driver keeps the width of a flash that is unlocked already; it locks it afterwards.
        if pac::FLASH.cr().read().lock() {
            KEYS.into_iter().for_each(|key| pac::FLASH.keyr().write_value(key));
        }
        pac::FLASH.cr().write(|w| w.set_psize(pac::flash::vals::Psize::PSIZE32));
        self.0.erase(from, to)
    }

    fn write(&mut self, offset: u32, bytes: &[u8]) -> Result<(), Error> {
        supply::wait();
        self.0.write(offset, bytes)
    }
}

/// Keys that unlock the flash (RM0090 3.6.1), and its option bytes (3.6.5).
const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const OPTION_KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];

/// Voltage detector (RM0090 5.2.3).
mod supply {
    use embassy_stm32::pac;
    use scarab_boot::SUPPLY_LEVEL;

    /// Starts the detector.
    pub fn watch() {
        pac::RCC.apb1enr().modify(|w| w.set_pwren(true));
        pac::PWR.cr1().modify(|w| {
            w.set_pls(SUPPLY_LEVEL);
            w.set_pvde(true);
        });
    }

    /// Waits until the supply suffices for changing the flash. All outputs are off.
    pub fn wait() {
        while pac::PWR.csr1().read().pvdo() {}
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
    for (index, byte) in into.iter_mut().enumerate() {
        // SAFETY: `Check` reads within the length of an image, which lies within its region of the flash.
        *byte = unsafe { core::ptr::read_volatile((address + index as u32) as *const u8) };
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
