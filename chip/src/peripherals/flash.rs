//! Flash interface and cells (RM0090 3.5 to 3.9; times DS8626 table 42).
//!
//! Programming clears bits of one word, erasing sets those of a sector. Both need the keys, the right mode
//! and a width that matches PSIZE; otherwise an error flag rises and nothing changes. While an operation runs
//! the single bank cannot be read: the processor stalls, timers and converters go on. Power can be cut within
//! any operation: a word is then a random mix of old and new, a sector reads as noise. Words of 32 bits need
//! a supply of 2.7 V. The bootloader's sector cannot be changed.
//!
//! Known limits: the brown-out reset has a level but does not act. Contents of the caches are not modelled,
//! except that reading a sector that was erased while the data cache was on and not reset since is a finding;
//! the image's own sectors are not checked for it.

use core::ops::Range;

use rand_core::Rng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab_boot::{FLASH, FLASH_BYTES, Region};

use crate::findings::{Access, NO_REGISTER};
use crate::time::{TICK_HZ, Ticks};

/// Number of sectors.
const SECTORS: usize = 12;
const OPTION_KEYS: [u32; 2] = [0x0819_2A3B, 0x4C5D_6E7F];
/// Option control register of a chip as delivered: locked, brown-out reset off. Its lock, start and level.
const OPTIONS: u32 = 0x0FFF_AAED;
const OPTIONS_LOCKED: u32 = 1;
const OPTIONS_START: u32 = 1 << 1;
const OPTIONS_LEVEL: u32 = 0b11 << 2;
/// Least supply for words of 32 bits, V.
const WORDS_V: f64 = 2.7;

const KEYS: [u32; 2] = [0x4567_0123, 0xCDEF_89AB];
const LOCKED: u32 = 1 << 31;
const PROGRAM: u32 = 1;
const ERASE: u32 = 1 << 1;
const START: u32 = 1 << 16;
/// Errors: sequence, parallelism, alignment, write protection.
const SEQUENCE: u32 = 1 << 7;
const PARALLELISM: u32 = 1 << 6;
const ALIGNMENT: u32 = 1 << 5;
const PROTECTED: u32 = 1 << 4;

/// Typical durations of a word, and of a sector of 16, 64 and 128 KB by the width that is programmed at once
/// (PSIZE).
const WORD: Ticks = 16 * TICK_HZ / 1_000_000;
const SMALL: [Ticks; 4] = [TICK_HZ * 4 / 10, TICK_HZ * 3 / 10, TICK_HZ / 4, TICK_HZ / 4];
const MIDDLE: [Ticks; 4] = [12 * TICK_HZ / 10, 7 * TICK_HZ / 10, 55 * TICK_HZ / 100, 55 * TICK_HZ / 100];
const LARGE: [Ticks; 4] = [2 * TICK_HZ, 13 * TICK_HZ / 10, TICK_HZ, TICK_HZ];

/// Power cut within a later operation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cut {
    /// While this word is programmed, counted from now.
    Word(u64),
    /// After so many erasures, at this share of the next one.
    Erasure(u64, f64),
}

/// State of the flash interface.
#[derive(Clone, Debug)]
pub struct Flash {
    access: u32,
    status: u32,
    control: u32,
    keys: [u32; 2],
    /// Keys were wrong: locked until a reset.
    refused: bool,
    cells: Vec<u8>,
    /// Sectors erased while the data cache was on and not reset since.
    stale: [bool; SECTORS],
    /// Time for which the processor stalls.
    pub stall: Ticks,
    /// Supply of the processor, V.
    pub supply_v: f64,
    /// Option control register; only its level can change.
    options: u32,
    option_keys: [u32; 2],
    /// Duration of an erasure relative to a typical one: up to 2 (DS8626 table 42).
    pub slowness: f64,
    /// Words programmed and sectors erased so far.
    pub words: u64,
    pub erasures: u64,
    /// Bytes of the image's sectors, from its first, that changed and that the processor does not see yet.
    pub changed: Option<Range<usize>>,
    /// Next power cut.
    pub cut: Option<Cut>,
    pub is_cut: bool,
    noise: Xoshiro256PlusPlus,
}

impl Flash {
    /// Erased sectors; `noise` sets the state of cells after a power cut.
    pub fn new(noise: Xoshiro256PlusPlus) -> Self {
        Self {
            access: 0,
            status: 0,
            control: LOCKED,
            keys: [0; 2],
            refused: false,
            cells: vec![0xFF; FLASH_BYTES as usize],
            stale: [false; SECTORS],
            stall: 0,
            supply_v: 3.3,
            options: OPTIONS,
            option_keys: [0; 2],
            slowness: 1.0,
            words: 0,
            erasures: 0,
            changed: None,
            cut: None,
            is_cut: false,
            noise,
        }
    }

    /// Resets the registers; cells and the next power cut stay.
    pub fn reset(&mut self) {
        (self.access, self.status, self.control, self.refused) = (0, 0, LOCKED, false);
        (self.stale, self.stall, self.is_cut) = ([false; SECTORS], 0, false);
        self.options |= OPTIONS_LOCKED;
    }

    /// Bytes of the stored parameters.
    pub fn parameters_mut(&mut self) -> &mut [u8] {
        self.region_mut(&Region::PARAMETERS)
    }

    /// Bytes of a region. Those of the image must not be changed while the machine runs.
    pub fn region_mut(&mut self, region: &Region) -> &mut [u8] {
        &mut self.cells[range(region)]
    }

    pub fn region(&self, region: &Region) -> &[u8] {
        &self.cells[range(region)]
    }

    /// Checks wait states against the processor's clock (RM0090 table 10, supply of 2.7 V and more).
    pub fn check_wait_states(&self, processor_hz: u64, access: &mut Access<'_>) {
        if processor_hz > 30_000_000 * (1 + u64::from(self.access & 7)) {
            access.refuse("too few wait states for the clock", "FLASH_ACR");
        }
    }

    pub fn read(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0x00 => self.access,
            0x0C => self.status,
            0x10 => self.control,
            0x14 => self.options,
            0x04 | 0x08 => 0,
            _ => access.no_register(format!("FLASH+{offset:#x}")),
        }
    }

    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        match offset {
            0x00 => self.write_access(access.implemented(value, 0x1F07, "FLASH_ACR"), access),
            0x04 => self.write_key(value, access),
            0x0C => self.status &= !(access.implemented(value, 0xF3, "FLASH_SR") & 0xF3),
            0x10 => self.write_control(value, access),
            0x08 => {
                self.option_keys = [self.option_keys[1], value];
                if self.option_keys == OPTION_KEYS {
                    self.options &= !OPTIONS_LOCKED;
                }
            }
            0x14 => self.write_options(value, access),
            _ => access.refuse(NO_REGISTER, format!("FLASH+{offset:#x}")),
        }
    }

    fn write_options(&mut self, value: u32, access: &mut Access<'_>) {
        if self.options & OPTIONS_LOCKED != 0 {
            return access.refuse("option bytes written while locked", "FLASH_OPTCR");
        }
        if (value ^ self.options) & !(OPTIONS_LOCKED | OPTIONS_START | OPTIONS_LEVEL) != 0 {
            return access.refuse("option bytes other than the brown-out level changed", "FLASH_OPTCR");
        }
        self.options = value & !OPTIONS_START;
        if value & OPTIONS_START != 0 {
            self.stall += SMALL[2];
        }
    }

    fn write_access(&mut self, value: u32, access: &mut Access<'_>) {
        for (enable, reset) in [(1 << 9, 1 << 11), (1 << 10, 1 << 12)] {
            if value & reset != 0 && self.access & enable != 0 {
                access.refuse("cache reset while it is on", "FLASH_ACR");
            }
        }
        if value & 1 << 12 != 0 {
            self.stale = [false; SECTORS];
        }
        self.access = value;
    }

    fn write_key(&mut self, value: u32, access: &mut Access<'_>) {
        if self.control & LOCKED == 0 {
            self.refused = true;
            self.control |= LOCKED;
            return access.refuse("key written while unlocked: locked until a reset", "FLASH_KEYR");
        }
        self.keys = [self.keys[1], value];
        if value == KEYS[0] {
            return;
        }
        if self.keys == KEYS && !self.refused {
            self.control &= !LOCKED;
        } else {
            self.refused = true;
            access.refuse("wrong key: locked until a reset", "FLASH_KEYR");
        }
        self.keys = [0; 2];
    }

    fn write_control(&mut self, value: u32, access: &mut Access<'_>) {
        let value = access.implemented(value, 0x8301_037F, "FLASH_CR");
        if self.control & LOCKED != 0 {
            return access.refuse("control register written while locked", "FLASH_CR");
        }
        self.control = value & !START;
        if value & START == 0 {
            return;
        }
        if value & (PROGRAM | ERASE | 1 << 2) != ERASE {
            return access.refuse("start without a sector erase", "FLASH_CR");
        }
        let number = value >> 3 & 0xF;
        self.check_supply(access);
        match Region::ALL[1..].iter().find(|region| number.wrapping_sub(region.sector) < region.sectors) {
            Some(region) => self.erase(region, number),
            None => {
                self.status |= PROTECTED;
                access.refuse("erase of a sector of the bootloader", "FLASH_CR");
            }
        }
    }

    /// Words of 32 bits need a supply of 2.7 V (DS8626 table 16).
    fn check_supply(&self, access: &mut Access<'_>) {
        if self.supply_v < WORDS_V && self.control >> 8 & 3 >= 2 {
            access.refuse("flash changed by words at a supply below 2.7 V", "FLASH_CR");
        }
    }

    fn erase(&mut self, region: &Region, number: u32) {
        let bytes = region.sector_bytes as usize;
        let first = range(region).start + (number - region.sector) as usize * bytes;
        self.note(first..first + bytes);
        let cells = &mut self.cells[first..first + bytes];
        self.erasures += 1;
        self.stale[sector_of(first)] = self.access & 1 << 10 != 0;
        let durations = match region.sector_bytes >> 10 {
            16 => SMALL,
            64 => MIDDLE,
            _ => LARGE,
        };
        self.stall += (durations[(self.control >> 8 & 3) as usize] as f64 * self.slowness) as Ticks;
        if let Some(Cut::Erasure(left @ 1.., _)) = &mut self.cut {
            *left -= 1;
        } else if let Some(Cut::Erasure(0, share)) = self.cut {
            self.stall = (self.stall as f64 * share) as Ticks;
            (self.cut, self.is_cut) = (None, true);
            return self.noise.fill_bytes(cells);
        }
        cells.fill(0xFF);
    }

    /// Notes a change of the image's sectors.
    fn note(&mut self, changed: Range<usize>) {
        let image = range(&Region::IMAGE);
        if !image.contains(&changed.start) {
            return;
        }
        let changed = changed.start - image.start..changed.end - image.start;
        self.changed = Some(match self.changed.take() {
            Some(before) => before.start.min(changed.start)..before.end.max(changed.end),
            None => changed,
        });
    }

    /// Reads bytes of the sectors, little-endian.
    pub fn load(&self, offset: u32, size: usize, access: &mut Access<'_>) -> u32 {
        let offset = offset as usize;
        if self.access & 1 << 10 != 0 && self.stale.get(sector_of(offset)) == Some(&true) {
            access.refuse("read of an erased sector through a data cache that was not reset", "FLASH_ACR");
        }
        let bytes = self.cells.get(offset..offset + size).unwrap_or_default();
        bytes.iter().rev().fold(0, |value, &byte| value << 8 | u32::from(byte))
    }

    /// Programs a word of the sectors.
    pub fn store(&mut self, offset: u32, size: usize, value: u32, access: &mut Access<'_>) {
        if self.control & (LOCKED | PROGRAM | ERASE) != PROGRAM {
            self.status |= SEQUENCE;
            return access.refuse("flash written without keys or programming mode", "FLASH_CR");
        }
        if 8 * size as u32 != 8 << (self.control >> 8 & 3) {
            self.status |= PARALLELISM;
            return access.refuse("width of a flash write differs from PSIZE", "FLASH_CR");
        }
        if !(offset as usize).is_multiple_of(size) {
            self.status |= ALIGNMENT;
            return access.refuse("flash write is not aligned", "FLASH_SR");
        }
        let range = offset as usize..offset as usize + size;
        self.note(range.clone());
        self.check_supply(access);
        let Some(cells) = self.cells.get_mut(range) else { return };
        self.words += 1;
        self.stall += WORD;
        let cut = match &mut self.cut {
            Some(Cut::Word(0)) => true,
            Some(Cut::Word(left)) => {
                *left -= 1;
                false
            }
            _ => false,
        };
        let mut raised = false;
        for (cell, byte) in cells.iter_mut().zip(value.to_le_bytes()) {
            raised |= byte & !*cell != 0;
            let programmed = *cell & byte;
            let changed = if cut { (*cell ^ programmed) & self.noise.next_u32() as u8 } else { 0xFF };
            *cell ^= (*cell ^ programmed) & changed;
        }
        if raised {
            access.refuse("bit programmed from 0 to 1 without an erase", "FLASH");
        }
        if cut {
            (self.cut, self.is_cut) = (None, true);
        }
    }
}

/// Offsets of a region's bytes.
const fn range(region: &Region) -> Range<usize> {
    let first = (region.address - FLASH) as usize;
    first..first + region.bytes() as usize
}

/// Number of the sector at an offset.
fn sector_of(offset: usize) -> usize {
    let region =
        Region::ALL.into_iter().rfind(|region| range(region).start <= offset).unwrap_or(Region::BOOTLOADER);
    region.sector as usize + (offset - range(&region).start) / region.sector_bytes as usize
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;
    use rand_xoshiro::rand_core::SeedableRng;

    struct Bench {
        flash: Flash,
        findings: Findings,
    }

    impl Bench {
        fn new() -> Self {
            let noise = Xoshiro256PlusPlus::seed_from_u64(1);
            Self { flash: Flash::new(noise), findings: Findings::default() }
        }

        fn write(&mut self, offset: u32, value: u32) {
            self.flash.write(offset, value, &mut Access { now: 0, findings: &mut self.findings });
        }

        fn store(&mut self, offset: u32, size: usize, value: u32) {
            self.flash.store(offset, size, value, &mut Access { now: 0, findings: &mut self.findings });
        }

        fn load(&mut self, offset: u32) -> u32 {
            self.flash.load(offset, 4, &mut Access { now: 0, findings: &mut self.findings })
        }

        fn unlock(&mut self) {
            KEYS.into_iter().for_each(|key| self.write(4, key));
        }
    }

    #[test]
    fn a_word_is_programmed_only_with_keys_mode_and_width() {
        let mut bench = Bench::new();
        bench.store(8, 4, 0x1234_5678);
        assert_eq!((bench.load(8), bench.flash.status), (u32::MAX, SEQUENCE));
        bench.unlock();
        bench.write(0x10, PROGRAM);
        bench.store(8, 4, 0x1234_5678);
        assert_eq!((bench.load(8), bench.flash.status), (u32::MAX, SEQUENCE | PARALLELISM));
        bench.write(0x10, PROGRAM | 2 << 8);
        bench.store(8, 4, 0x1234_5678);
        assert_eq!((bench.load(8), bench.flash.stall), (0x1234_5678, WORD));
        assert!(!bench.findings.has("bit programmed from 0 to 1 without an erase"));
        bench.store(8, 4, 0x0000_FFFF);
        assert_eq!(bench.load(8), 0x0000_5678);
        assert!(bench.findings.has("bit programmed from 0 to 1 without an erase"));
    }

    #[test]
    fn a_wrong_key_locks_until_a_reset() {
        let mut bench = Bench::new();
        bench.write(4, KEYS[1]);
        bench.unlock();
        assert_ne!(bench.flash.control & LOCKED, 0);
        bench.flash.reset();
        bench.unlock();
        assert_eq!(bench.flash.control & LOCKED, 0);
    }

    #[test]
    fn an_erase_sets_one_sector_and_stalls_by_its_size_and_width() {
        let mut bench = Bench::new();
        bench.flash.cells.fill(0);
        bench.unlock();
        let (tenth, eleventh) = (0x080C_0000 - FLASH, 0x080E_0000 - FLASH);
        bench.write(0x10, ERASE | 2 << 8 | 11 << 3);
        bench.write(0x10, ERASE | 2 << 8 | 11 << 3 | START);
        assert_eq!((bench.load(tenth), bench.load(eleventh)), (0, u32::MAX));
        assert_eq!(bench.flash.stall, TICK_HZ);
        bench.write(0x10, ERASE | 11 << 3 | START);
        assert_eq!(bench.flash.stall, 3 * TICK_HZ);
        assert_eq!(bench.flash.changed, None);
        for (sector, duration) in [(1, SMALL[2]), (2, SMALL[2]), (4, MIDDLE[2])] {
            let (stall, region) =
                (bench.flash.stall, Region::ALL[1..4].iter().find(|one| one.sector == sector));
            let offset = region.expect("a region").address - FLASH;
            bench.write(0x10, ERASE | 2 << 8 | sector << 3 | START);
            assert_eq!((bench.load(offset), bench.flash.stall), (u32::MAX, stall + duration));
        }
        bench.write(0x10, ERASE | 2 << 8 | 6 << 3 | START);
        assert_eq!(bench.flash.changed, Some(0x2_0000..0x4_0000));
        assert!(!bench.findings.has("erase of a sector of the bootloader"));
        bench.write(0x10, ERASE | 2 << 8 | START);
        assert!(bench.findings.has("erase of a sector of the bootloader") && bench.load(0) == 0);
    }

    #[test]
    fn the_brown_out_level_changes_with_its_keys_only() {
        let mut bench = Bench::new();
        bench.write(0x14, 0x0FFF_AAE0);
        assert!(bench.findings.has("option bytes written while locked") && bench.flash.options == OPTIONS);
        OPTION_KEYS.into_iter().for_each(|key| bench.write(8, key));
        bench.write(0x14, 0x0FFF_AAE0);
        bench.write(0x14, 0x0FFF_AAE2);
        assert_eq!((bench.flash.options, bench.flash.stall), (0x0FFF_AAE0, SMALL[2]));
        bench.write(0x14, 0x0FFF_55E0);
        assert!(bench.findings.has("option bytes other than the brown-out level changed"));
    }

    #[test]
    fn words_below_2_7_v_are_a_finding() {
        let mut bench = Bench::new();
        bench.flash.supply_v = 2.6;
        bench.unlock();
        bench.write(0x10, ERASE | 1 << 8 | 11 << 3 | START);
        assert!(bench.findings.is_empty());
        bench.write(0x10, PROGRAM | 2 << 8);
        bench.store(8, 4, 0);
        assert!(bench.findings.has("flash changed by words at a supply below 2.7 V"));
    }

    #[test]
    fn a_power_cut_mixes_a_word_and_randomises_a_sector() {
        let mut bench = Bench::new();
        bench.unlock();
        bench.write(0x10, PROGRAM | 2 << 8);
        bench.flash.cut = Some(Cut::Word(1));
        bench.store(0, 4, 0);
        assert!(!bench.flash.is_cut);
        bench.store(4, 4, 0);
        assert!(bench.flash.is_cut && bench.load(0) == 0);
        assert!(bench.load(4) != 0 && bench.load(4) != u32::MAX);
        let state = Region::STATE.address - FLASH;
        bench.write(0x10, ERASE | 2 << 8 | 1 << 3);
        bench.flash.cut = Some(Cut::Erasure(0, 0.5));
        bench.write(0x10, ERASE | 2 << 8 | 1 << 3 | START);
        assert!(bench.load(state + 0x100) != u32::MAX && bench.load(state + 0x4000) == u32::MAX);
    }
}
