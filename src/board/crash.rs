//! Handling of a panic, hard fault, stack overflow or unhandled interrupt.
//!
//! The order is: outputs off, then a record, then a reset.
//!
//! The record lies in memory that survives a reset. The next start finds it, reports it, and refuses to
//! enable until the operator has reset the fault. Nothing is reported from here: the output of a record may
//! be what crashed.
//!
//! **Off, and staying off.** A current loop that interrupts a handler would switch its bridge on again. So an
//! interruptible handler first masks interrupts, which is one instruction, then turns the outputs off. The
//! function for that is the board's, found by the linker: a pointer to it would be memory that the crash may
//! have overwritten.
//!
//! **Stack overflow** cannot be handled on the same stack: the hard fault's entry resets the stack pointer
//! where little of the stack is left. The processor could not store the fault's address. Instead the record
//! names the caller of the deepest function, found at the bottom of the stack.
//!
//! Cost: `cargo chip crashes`, in docs/results/board.md.
//! Known limit: after an overflow the caller is the first word at the stack's bottom that may be a return
//! address. A code address in an array would be mistaken for it.
#![expect(
    unsafe_code,
    reason = "memory that outlives a reset, the stack pointer, and what the linker provides"
)]

use core::panic::PanicInfo;
use core::ptr;

use cortex_m::peripheral::SCB;
use static_cell::StaticCell;
use zerocopy::{FromBytes, Immutable, IntoBytes};

use super::stack;
use crate::checksum::Checksum;
use crate::listed::listed;

/// Active vector of the processor, its fault status and address registers.
const ACTIVE: *const u32 = 0xE000_ED04 as *const u32;
const FAULT_STATUS: *const u32 = 0xE000_ED28 as *const u32;
const BUS_FAULT_ADDRESS: *const u32 = 0xE000_ED38 as *const u32;
/// Set where the address register holds the address of the fault (BFARVALID).
const ADDRESS_IS_VALID: u32 = 1 << 15;

const MAGIC: u32 = 0x4352_5348;
/// Stored length of a panic's file name, taken from its end.
const NAME: usize = 40;
/// Number of words at the stack's bottom that are searched for a return address.
const SEARCHED: u32 = 512;

unsafe extern "C" {
    /// Turns both bridges off without lock or wait, and returns the clock as in records. Provided by the
    /// image's board.
    safe fn scarab_disable_all() -> u32;
    static __stext: u32;
    static __etext: u32;
}

/// Crash record of the previous run.
#[derive(Clone, Copy, Debug, PartialEq, Eq, FromBytes, IntoBytes, Immutable)]
#[repr(C)]
pub struct Crash {
    magic: u32,
    cause: u32,
    /// Program counter; zero where the processor could not store it.
    pub pc: u32,
    /// Return address.
    pub lr: u32,
    /// Fault status, or the number of an interrupt.
    pub status: u32,
    /// Address of a bus fault, or all ones.
    pub address: u32,
    /// Line of a panic.
    pub line: u32,
    /// Clock when the outputs were off.
    pub released: u32,
    /// Clock when this record was complete except for its checksum.
    pub kept: u32,
    length: u32,
    name: [u8; NAME],
    check: u32,
}

/// Words of a record; the last is its checksum.
const WORDS: usize = size_of::<Crash>() / 4;

listed! {
    /// Kind of crash.
    #[repr(u32)]
    pub enum CrashCause {
        /// All causes, in the order of their numbers.
        ALL,
        /// Word used in records.
        name;
        /// Rust panic.
        Panic = 1, "panic";
        /// Hard fault of the processor.
        HardFault, "hard_fault";
        /// Interrupt without a handler.
        Interrupt, "interrupt";
        /// Failure of the crystal.
        Clock, "clock";
        /// The stack left its memory.
        StackOverflow, "stack_overflow";
    }
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
        released: 0,
        kept: 0,
        length: 0,
        name: [0; NAME],
        check: 0,
    };

    fn new(cause: CrashCause, released: u32) -> Self {
        Self { cause: cause as u32, released, ..Self::NONE }
    }

    /// Checksum over all words but the last.
    fn sum(&self) -> u32 {
        let words: [u32; WORDS] = zerocopy::transmute!(*self);
        words.iter().take(WORDS - 1).fold(Checksum::EMPTY, |sum, &word| sum.word(word)).value()
    }

    /// Name used in records.
    pub fn cause(&self) -> &'static str {
        CrashCause::ALL.get(self.cause.wrapping_sub(1) as usize).map_or("unknown", |cause| cause.name())
    }

    /// End of a panic's file name, or `-`.
    pub fn file(&self) -> &str {
        let name = self.name.get(..self.length as usize).unwrap_or(&[]);
        let name = core::str::from_utf8(name).unwrap_or("");
        if name.is_empty() { "-" } else { name }
    }
}

#[unsafe(link_section = ".uninit.crash")]
static mut RECORD: core::mem::MaybeUninit<Crash> = core::mem::MaybeUninit::uninit();

/// Takes the crash record of the previous run, if there is one.
pub fn take() -> Option<&'static Crash> {
    static FOUND: StaticCell<Crash> = StaticCell::new();
    let address = (&raw mut RECORD).cast::<u32>();
    // SAFETY: the static exists, is aligned, has so many words, and any bit pattern is a valid word. The read
    // is volatile because the content was written before this image began. The only other access is a crash,
    // which never returns.
    let words =
        core::array::from_fn::<u32, WORDS, _>(|word| unsafe { ptr::read_volatile(address.add(word)) });
    // SAFETY: as above; the first word is the magic number.
    unsafe { ptr::write_volatile(address, 0) };
    let found: Crash = zerocopy::transmute!(words);
    let whole = found.magic == MAGIC && found.check == found.sum();
    whole.then(|| FOUND.try_init(found)).flatten().map(|found| &*found)
}

fn end(mut crash: Crash) -> ! {
    crash.kept = scarab_disable_all();
    crash.check = crash.sum();
    let words: [u32; WORDS] = zerocopy::transmute!(crash);
    let address = (&raw mut RECORD).cast::<u32>();
    for (address, word) in (0..WORDS).map(|word| address.wrapping_add(word)).zip(words) {
        // SAFETY: the static exists, is aligned and has so many words. Any other writer was interrupted by
        // this one and never resumes.
        unsafe { ptr::write_volatile(address, word) };
    }
    SCB::sys_reset()
}

/// Panic handler: outputs off, record, reset.
pub fn panic(information: &PanicInfo<'_>) -> ! {
    cortex_m::interrupt::disable();
    let mut crash = Crash::new(CrashCause::Panic, scarab_disable_all());
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

/// Ends the run from a board's own handler; the caller chooses the meaning of `status`.
pub fn give_up(cause: CrashCause, status: u32) -> ! {
    cortex_m::interrupt::disable();
    end(Crash { status, ..Crash::new(cause, scarab_disable_all()) })
}

/// Passes the frame's address to [`hard_fault`], resetting the stack pointer where less than half a kilobyte
/// is left.
#[unsafe(naked)]
#[unsafe(export_name = "HardFault")]
unsafe extern "C" fn hard_fault_entry() {
    core::arch::naked_asm!(
        "mrs r0, msp",
        "ldr r1, =_stack_end + 512",
        "cmp r0, r1",
        "bhs 1f",
        "ldr r1, =_stack_start",
        "msr msp, r1",
        "1: b {handle}",
        handle = sym hard_fault,
    )
}

/// Runs at a level that no interrupt reaches, so masking is not needed.
extern "C" fn hard_fault(frame: u32) -> ! {
    let released = scarab_disable_all();
    // A frame outside the stack was never stored.
    let stored = stack::word(frame).is_some();
    let cause = if stored { CrashCause::HardFault } else { CrashCause::StackOverflow };
    let word = |index: u32| stack::word(frame.wrapping_add(4 * index));
    let status = load(FAULT_STATUS);
    end(Crash {
        pc: word(6).unwrap_or(0),
        lr: word(5).or_else(deepest_caller).unwrap_or(0),
        status,
        address: if status & ADDRESS_IS_VALID != 0 { load(BUS_FAULT_ADDRESS) } else { u32::MAX },
        ..Crash::new(cause, released)
    })
}

/// Returns the first word at the stack's bottom that may be a return address: odd, and within the code.
fn deepest_caller() -> Option<u32> {
    let code = (&raw const __stext as u32)..(&raw const __etext as u32);
    (0..SEARCHED)
        .filter_map(|index| stack::word(stack::bottom() + 4 * index))
        .find(|word| word & 1 == 1 && code.contains(word))
}

#[unsafe(export_name = "DefaultHandler")]
extern "C" fn unhandled() -> ! {
    cortex_m::interrupt::disable();
    let released = scarab_disable_all();
    let number = (load(ACTIVE) & 0x1FF) as i16 - 16;
    end(Crash { status: number.cast_unsigned().into(), ..Crash::new(CrashCause::Interrupt, released) })
}

fn load(register: *const u32) -> u32 {
    // SAFETY: the callers pass registers of the processor's system control block, readable without
    // a side effect.
    unsafe { ptr::read_volatile(register) }
}
