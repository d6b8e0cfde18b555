//! Panic, hard fault, a failed crystal, an interrupt nobody handles: bridges off first, then a record, then a reset.
//!
//! The record lies in memory that a reset leaves alone. The next start finds it, tells it, and refuses to enable until the
//! operator has reset the fault. Nothing is told from here: a record to the probe may be what crashed.
//!
//! A stack that ran out cannot be used to handle that: the hard fault's entry takes the whole stack anew before it calls
//! anything. What was on it is lost, the record lies elsewhere.
#![expect(unsafe_code, reason = "memory that outlives a reset, and the stack pointer itself")]

use core::panic::PanicInfo;
use core::ptr;

use cortex_m::peripheral::SCB;
use cortex_m_rt::exception;
use static_cell::StaticCell;

use super::bridge;
use super::registers::{apply, load};
use super::settings::CLOCK_FAILURE_SEEN;

/// Fault status and address registers of the processor.
const FAULT_STATUS: u32 = 0xE000_ED28;
const BUS_FAULT_ADDRESS: u32 = 0xE000_ED38;
/// The address register holds the address of the fault (BFARVALID).
const ADDRESS_IS_VALID: u32 = 1 << 15;

/// Memory in which a frame of an exception may lie.
const MEMORY: core::ops::Range<u32> = 0x2000_0000..0x2001_FFE0;

const MAGIC: u32 = 0x4352_5348;
/// Of a panic's file name so much is kept: its end.
const NAME: usize = 40;

/// What ended the image before this one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(C)]
pub struct Crash {
    magic: u32,
    cause: u32,
    /// Where.
    pub pc: u32,
    /// Called from.
    pub lr: u32,
    /// Fault status, or the number of an interrupt.
    pub status: u32,
    /// Address of a bus fault, or all ones.
    pub address: u32,
    /// Of a panic.
    pub line: u32,
    length: u32,
    name: [u8; NAME],
    check: u32,
}

/// Kinds of crashes.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
enum Cause {
    Panic = 1,
    HardFault,
    Interrupt,
    Clock,
}

impl Crash {
    const NONE: Self = Self {
        magic: MAGIC,
        cause: 0,
        pc: 0,
        lr: 0,
        status: 0,
        address: u32::MAX,
        line: 0,
        length: 0,
        name: [0; NAME],
        check: 0,
    };

    fn sum(&self) -> u32 {
        let words = [self.magic, self.cause, self.pc, self.lr, self.status, self.address, self.line, self.length];
        let names = self.name.iter().map(|&byte| u32::from(byte));
        words.into_iter().chain(names).fold(0x811C_9DC5, |sum, word| (sum ^ word).wrapping_mul(0x0100_0193))
    }

    /// The word in records.
    #[must_use]
    pub const fn cause(&self) -> &'static str {
        match self.cause {
            1 => "panic",
            2 => "hard_fault",
            3 => "interrupt",
            4 => "clock",
            _ => "unknown",
        }
    }

    /// End of a panic's file name, or `-`.
    #[must_use]
    pub fn file(&self) -> &str {
        let name = self.name.get(..self.length as usize).unwrap_or(&[]);
        let name = core::str::from_utf8(name).unwrap_or("");
        if name.is_empty() { "-" } else { name }
    }
}

#[unsafe(link_section = ".uninit.crash")]
static mut RECORD: core::mem::MaybeUninit<Crash> = core::mem::MaybeUninit::uninit();

/// The record of the image before this one, once.
pub(super) fn take() -> Option<&'static Crash> {
    static FOUND: StaticCell<Crash> = StaticCell::new();
    let place = (&raw mut RECORD).cast::<Crash>();
    // SAFETY: the static is there, aligned, and every pattern of bits is a `Crash`; volatile, because what it holds was
    // written before this image began. Nobody else reaches it: this runs before interrupts do.
    let found = unsafe { ptr::read_volatile(place) };
    // SAFETY: as above.
    unsafe { ptr::write_volatile(place, Crash { magic: 0, ..Crash::NONE }) };
    (found.magic == MAGIC && found.check == found.sum()).then(|| &*FOUND.init(found))
}

fn end(mut crash: Crash) -> ! {
    crash.check = crash.sum();
    // SAFETY: the static is there and aligned; whoever else might be writing it was interrupted by this and never returns.
    unsafe { ptr::write_volatile((&raw mut RECORD).cast::<Crash>(), crash) };
    SCB::sys_reset()
}

/// What a panic does.
pub fn panic(information: &PanicInfo<'_>) -> ! {
    bridge::release_all();
    cortex_m::interrupt::disable();
    let mut crash = Crash { cause: Cause::Panic as u32, ..Crash::NONE };
    if let Some(location) = information.location() {
        let name = location.file().as_bytes();
        let kept = name.get(name.len().saturating_sub(NAME)..).unwrap_or(&[]);
        for (slot, &byte) in crash.name.iter_mut().zip(kept) {
            *slot = byte;
        }
        (crash.line, crash.length) = (location.line(), kept.len() as u32);
    }
    end(crash)
}

/// Takes the frame's address and the whole stack, then handles the fault.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault_entry() {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "ldr r1, =_stack_start",
        "msr msp, r1",
        "b {handle}",
        handle = sym hard_fault,
    )
}

extern "C" fn hard_fault(frame: u32) -> ! {
    bridge::release_all();
    let status = load(FAULT_STATUS);
    let address = if status & ADDRESS_IS_VALID != 0 { load(BUS_FAULT_ADDRESS) } else { u32::MAX };
    // Of a frame outside the memory nothing was stored.
    let stored = MEMORY.contains(&frame) && frame.is_multiple_of(4);
    let word = |place: u32| if stored { load(frame + 4 * place) } else { 0 };
    end(Crash {
        cause: Cause::HardFault as u32,
        pc: word(6),
        lr: word(5),
        status,
        address,
        ..Crash::NONE
    })
}

#[exception]
unsafe fn DefaultHandler(number: i16) {
    bridge::release_all();
    end(Crash { cause: Cause::Interrupt as u32, status: number.cast_unsigned().into(), ..Crash::NONE })
}

/// The crystal failed: the hardware has switched both bridges' outputs off and runs on its own oscillator.
#[exception]
unsafe fn NonMaskableInt() {
    bridge::release_all();
    apply(&[CLOCK_FAILURE_SEEN]);
    end(Crash { cause: Cause::Clock as u32, ..Crash::NONE })
}
