//! The two sectors of the flash that keep what outlives the power, and what writes them.
//!
//! Sectors 10 and 11, 128 KB each, as ODrive's firmware uses them; the image ends before them (layout.x).
//! Source: `Drivers/STM32/stm32_nvm.c:9-10`, `Board/v3/STM32F405RGTx_FLASH.ld:47`; registers RM0090 3.9.

/// Where the first begins.
pub const FIRST: u32 = 0x080C_0000;
/// Bytes of a sector.
pub const SECTOR: u32 = 128 * 1024;
/// The sectors' numbers.
pub const NUMBERS: [u32; 2] = [10, 11];
/// Bytes of both.
pub const BYTES: u32 = SECTOR * NUMBERS.len() as u32;

const FLASH: u32 = 0x4002_3C00;
/// Caches: data cache on (DCEN), emptied (DCRST).
pub const ACR: u32 = FLASH;
/// See there.
pub const CACHE: [u32; 2] = [1 << 10, 1 << 12];
/// Takes both keys, in this order.
pub const KEYR: u32 = FLASH + 0x04;
/// See there.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Status: busy, and everything that went wrong (OPERR, WRPERR, PGAERR, PGPERR, PGSERR), cleared by ones.
pub const SR: u32 = FLASH + 0x0C;
/// See there.
pub const BUSY: u32 = 1 << 16;
/// See there.
pub const WRONG: u32 = 1 << 1 | 0b1111 << 4;
/// Control.
pub const CR: u32 = FLASH + 0x10;
/// Locked, as after the start.
pub const LOCK: u32 = 1 << 31;
/// Words of 32 bits (PSIZE), for a supply of 2.7 V and more.
const WORDS: u32 = 0b10 << 8;
/// Programs what is stored from then on (PG).
pub const PROGRAM: u32 = WORDS | 1;

/// Chooses a sector to be erased (SER, SNB).
#[must_use]
pub const fn erase(number: u32) -> u32 {
    WORDS | number << 3 | 1 << 1
}

/// Begins with what was chosen (STRT).
pub const START: u32 = 1 << 16;
