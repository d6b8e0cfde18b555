//! Memory copies of several words at a time.
//!
//! The compiler calls these functions for each move of a value longer than a few words.
//!
//! Why: the compiler's own library copies one word in five instructions, which took a third of the servo's
//! tick. Eight words in four instructions need multi-register loads and stores, which no Rust code generates.
//! The library's functions are weak symbols, so these replace them.
//!
//! ```text
//! both aligned   32 bytes a round in 4 instructions, then 16, 8, 4, 2, 1
//! otherwise      16 bytes a round in 10 instructions, then as above; memory allows unaligned words
//! ```
//!
//! Not for registers of peripherals, where a word must be aligned.
//! Source: Arm, Run-time ABI for the Arm Architecture (IHI 0043), section 4.3.4.
#![expect(unsafe_code, reason = "the compiler calls these functions by their names")]

use core::arch::naked_asm;

/// Copies `length` bytes between aligned ranges that do not overlap.
///
/// # Safety The compiler is the caller: both ranges are valid for `length` bytes and aligned to 4.
#[unsafe(naked)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn __aeabi_memcpy4(to: *mut u8, from: *const u8, length: usize) {
    // Registers r3 and r12 are the callee's; r4 to r9 are restored. Subtracting 32 leaves the low five bits
    // of the length.
    naked_asm!(
        "subs r2, #32",
        "blo 2f",
        "push {{r4, r5, r6, r7, r8, r9}}",
        "1:",
        "ldmia r1!, {{r3, r4, r5, r6, r7, r8, r9, r12}}",
        "stmia r0!, {{r3, r4, r5, r6, r7, r8, r9, r12}}",
        "subs r2, #32",
        "bhs 1b",
        "pop {{r4, r5, r6, r7, r8, r9}}",
        "2:",
        "lsls r3, r2, #28",
        "bcc 3f",
        "ldmia r1!, {{r3, r12}}",
        "stmia r0!, {{r3, r12}}",
        "ldmia r1!, {{r3, r12}}",
        "stmia r0!, {{r3, r12}}",
        "3:",
        "tst r2, #8",
        "itt ne",
        "ldmiane r1!, {{r3, r12}}",
        "stmiane r0!, {{r3, r12}}",
        "tst r2, #4",
        "itt ne",
        "ldrne r3, [r1], #4",
        "strne r3, [r0], #4",
        "lsls r2, r2, #31",
        "itt cs",
        "ldrhcs r3, [r1], #2",
        "strhcs r3, [r0], #2",
        "itt mi",
        "ldrbmi r3, [r1]",
        "strbmi r3, [r0]",
        "bx lr",
    )
}

/// Copies `length` bytes between ranges that are aligned to 8 and do not overlap.
///
/// # Safety
/// As for [`__aeabi_memcpy4`].
#[unsafe(naked)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn __aeabi_memcpy8(to: *mut u8, from: *const u8, length: usize) {
    naked_asm!("b {aligned}", aligned = sym __aeabi_memcpy4)
}

/// Copies `length` bytes between ranges that do not overlap.
///
/// # Safety The compiler is the caller: both ranges are valid for `length` bytes.
#[unsafe(naked)]
#[unsafe(no_mangle)]
pub unsafe extern "C" fn __aeabi_memcpy(to: *mut u8, from: *const u8, length: usize) {
    naked_asm!(
        "orr r3, r0, r1",
        "lsls r3, r3, #30",
        "beq {aligned}",
        "subs r2, #16",
        "blo 2f",
        "1:",
        "ldr r3, [r1], #4",
        "ldr r12, [r1], #4",
        "str r3, [r0], #4",
        "str r12, [r0], #4",
        "ldr r3, [r1], #4",
        "ldr r12, [r1], #4",
        "str r3, [r0], #4",
        "str r12, [r0], #4",
        "subs r2, #16",
        "bhs 1b",
        "2:",
        "tst r2, #8",
        "itttt ne",
        "ldrne r3, [r1], #4",
        "ldrne r12, [r1], #4",
        "strne r3, [r0], #4",
        "strne r12, [r0], #4",
        "tst r2, #4",
        "itt ne",
        "ldrne r3, [r1], #4",
        "strne r3, [r0], #4",
        "lsls r2, r2, #31",
        "itt cs",
        "ldrhcs r3, [r1], #2",
        "strhcs r3, [r0], #2",
        "itt mi",
        "ldrbmi r3, [r1]",
        "strbmi r3, [r0]",
        "bx lr",
        aligned = sym __aeabi_memcpy4,
    )
}
