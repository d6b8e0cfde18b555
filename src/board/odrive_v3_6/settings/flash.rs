//! Registers that change the flash (RM0090 3.9). Its sectors: `scarab_boot::Region`.

const FLASH: u32 = 0x4002_3C00;
/// Access control register with the data cache.
pub const ACR: u32 = FLASH;
/// Data cache on (DCEN), and reset (DCRST).
pub const CACHE: [u32; 2] = [1 << 10, 1 << 12];
/// Register that takes both keys, in order.
pub const KEYR: u32 = FLASH + 0x04;
/// Keys that unlock the control register.
pub const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
/// Status register; ones clear its error flags.
pub const SR: u32 = FLASH + 0x0C;
/// Operation in progress (BSY).
pub const BUSY: u32 = 1 << 16;
/// All error flags (OPERR, WRPERR, PGAERR, PGPERR, PGSERR).
pub const WRONG: u32 = 1 << 1 | 0b1111 << 4;
/// Control register.
pub const CR: u32 = FLASH + 0x10;
/// Locked, as after the start.
pub const LOCK: u32 = 1 << 31;
/// Option control register, and the lowest bit of its brown-out reset level (BOR_LEV).
pub const OPTCR: u32 = FLASH + 0x14;
const BOR_LEV: u32 = 2;

/// Brown-out reset level in a value of the option control register: 3 resets below 2.83 V (typical, DS8626
/// table 22), 0 is off, as delivered. The bits count the other way.
pub const fn brown_out_level(options: u32) -> u8 {
    3 - (options >> BOR_LEV & 3) as u8
}

/// Words of 32 bits (PSIZE), for a supply of 2.7 V and more.
const WORDS: u32 = 0b10 << 8;
/// Programming mode (PG): every following store programs a word.
pub const PROGRAM: u32 = WORDS | 1;

/// Control value that selects a sector for erasing (SER, SNB).
pub const fn erase(number: u32) -> u32 {
    WORDS | number << 3 | 1 << 1
}

/// Starts the selected erase (STRT).
pub const START: u32 = 1 << 16;
