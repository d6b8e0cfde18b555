//! Reset and clock control, and the power controller's register that it depends on (RM0090 5.4, 7.3).
//!
//! Oscillators and PLL become ready after a delay. Refused: a PLL without a running source or changed while
//! on, a switch to a clock that is not ready, bus clocks above their limits, and more than 144 MHz at scale
//! 2. A dead crystal never becomes ready; one that dies later raises the clock security's interrupt if
//! enabled.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};
use crate::time::{NEVER, TICK_HZ, Ticks};

/// Start-up of the crystal and lock of the PLL: 2 ms and 0.2 ms.
const CRYSTAL: Ticks = TICK_HZ / 500;
const LOCK: Ticks = TICK_HZ / 5000;
/// Start-up of the watchdog's oscillator: 30 us.
const SLOW: Ticks = TICK_HZ / 33_000;

const HSI_HZ: u64 = 16_000_000;
/// Frequency of the board's crystal, Hz.
const CRYSTAL_HZ: u64 = 8_000_000;

/// Levels of the voltage detector by PLS, V: falling edge, typical (DS8626 table 22).
const DETECTOR_V: [f64; 8] = [2.04, 2.19, 2.35, 2.51, 2.66, 2.82, 2.92, 3.03];

/// Registers with plain storage: offset, name, implemented bits, value after reset.
const STORED: [(u32, &str, u32, u32); 15] = [
    (0x10, "RCC_AHB1RSTR", 0x2060_11FF, 0),
    (0x14, "RCC_AHB2RSTR", 0xF1, 0),
    (0x18, "RCC_AHB3RSTR", 1, 0),
    (0x20, "RCC_APB1RSTR", 0x36FE_C9FF, 0),
    (0x24, "RCC_APB2RSTR", 0x0007_5933, 0),
    (0x30, "RCC_AHB1ENR", 0x6074_11FF, 0x0010_0000),
    (0x34, "RCC_AHB2ENR", 0xF1, 0),
    (0x38, "RCC_AHB3ENR", 1, 0),
    (0x40, "RCC_APB1ENR", 0x36FE_C9FF, 0),
    (0x44, "RCC_APB2ENR", 0x0007_5F33, 0),
    (0x50, "RCC_AHB1LPENR", 0x7E67_91FF, 0x7E67_91FF),
    (0x54, "RCC_AHB2LPENR", 0xF1, 0xF1),
    (0x58, "RCC_AHB3LPENR", 1, 1),
    (0x60, "RCC_APB1LPENR", 0x36FE_C9FF, 0x36FE_C9FF),
    (0x64, "RCC_APB2LPENR", 0x0007_5F33, 0x0007_5F33),
];

/// Reason of a reset, as the bit of RCC_CSR.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u32)]
pub enum ResetReason {
    PowerOn = 1 << 27 | 1 << 25,
    Pin = 0,
    Software = 1 << 28,
    /// Independent watchdog.
    Watchdog = 1 << 29,
}

/// State of clocks and resets.
#[derive(Clone, Debug, Default)]
pub struct Rcc {
    control: u32,
    pll: u32,
    configuration: u32,
    interrupts: u32,
    stored: [u32; STORED.len()],
    backup: u32,
    status: u32,
    power: u32,
    /// Supply of the processor, V.
    pub supply_v: f64,
    /// Instants at which crystal, PLL and slow oscillator are ready.
    crystal_ready: Ticks,
    pll_ready: Ticks,
    slow_ready: Ticks,
    crystal_works: bool,
    /// Processor clock, Hz.
    system_hz: u64,
}

impl Rcc {
    /// State after power-on.
    pub fn new() -> Self {
        let mut rcc = Self { supply_v: 3.3, crystal_works: true, ..Self::default() };
        rcc.reset(ResetReason::PowerOn);
        rcc
    }

    /// Resets all but the flags of earlier resets and the crystal itself.
    pub fn reset(&mut self, reason: ResetReason) {
        let flags = self.status & 0xFE00_0000;
        (self.control, self.pll, self.configuration, self.interrupts) = (0x81, 0x2400_3010, 0, 0);
        self.stored = STORED.map(|(.., reset)| reset);
        (self.crystal_ready, self.pll_ready, self.slow_ready) = (NEVER, NEVER, NEVER);
        self.power = 0x4000;
        self.system_hz = HSI_HZ;
        // The pin's bit accompanies every other one.
        self.status = flags | reason as u32 | 1 << 26;
    }

    /// Processor clock, ticks of the model.
    pub fn cycle(&self) -> Ticks {
        TICK_HZ / self.processor_hz()
    }

    pub fn processor_hz(&self) -> u64 {
        let divider = match self.configuration >> 4 & 0xF {
            code @ 8..=11 => 2 << (code - 8),
            code @ 12..=15 => 64 << (code - 12),
            _ => 1,
        };
        self.system_hz / divider
    }

    /// Clock of a peripheral bus (1 or 2), Hz.
    pub fn bus_hz(&self, bus: u32) -> u64 {
        self.processor_hz() / self.bus_divider(bus)
    }

    fn bus_divider(&self, bus: u32) -> u64 {
        match self.configuration >> (if bus == 1 { 10 } else { 13 }) & 7 {
            code @ 4..=7 => 2 << (code - 4),
            _ => 1,
        }
    }

    /// Clock of the timers on a peripheral bus, ticks of the model: twice the bus' clock if that is divided.
    pub fn timer_cycle(&self, bus: u32) -> Ticks {
        let factor = if self.bus_divider(bus) == 1 { 1 } else { 2 };
        TICK_HZ / (factor * self.bus_hz(bus))
    }

    /// Whether the clock of a peripheral is enabled, by its enable register's offset and bit.
    pub fn is_clocked(&self, register: u32, bits: u32) -> bool {
        let index = STORED.iter().position(|(offset, ..)| *offset == register);
        index.is_some_and(|index| self.stored[index] & bits != 0)
    }

    /// Stops the crystal. Returns whether the clock security detected it and switched to the internal
    /// oscillator.
    pub fn stop_crystal(&mut self) -> bool {
        self.crystal_works = false;
        (self.crystal_ready, self.pll_ready) = (NEVER, NEVER);
        let watched = self.control & 1 << 19 != 0;
        if watched {
            self.control &= !(1 << 16 | 1 << 24 | 1 << 19);
            self.configuration &= !3;
            self.interrupts |= 1 << 7;
        }
        // Without clock security a PLL without reference runs at its lowest frequency; here as with clock
        // security.
        self.system_hz = HSI_HZ;
        watched
    }

    pub fn read(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        let ready = |at: Ticks| u32::from(access.now >= at);
        match offset {
            0x00 => {
                self.control & !0x0202_0002
                    | (self.control & 1) << 1
                    | ready(self.crystal_ready) << 17
                    | ready(self.pll_ready) << 25
            }
            0x04 => self.pll,
            0x08 => self.configuration & !0xC | (self.configuration & 3) << 2,
            0x0C => self.interrupts,
            0x70 => self.backup,
            0x74 => self.status & !2 | ready(self.slow_ready) << 1,
            0x80 | 0x84 => 0,
            _ => match STORED.iter().position(|(known, ..)| *known == offset) {
                Some(index) => self.stored[index],
                None => access.no_register(format!("RCC+{offset:#x}")),
            },
        }
    }

    /// Writes a register. Returns whether a clock may have changed.
    pub fn write(&mut self, offset: u32, value: u32, access: &mut Access<'_>) -> bool {
        match offset {
            0x00 => self.write_control(access.implemented(value, 0x0F0F_FFFB, "RCC_CR"), access),
            0x04 => self.write_pll(access.implemented(value, 0x0F43_7FFF, "RCC_PLLCFGR"), access),
            0x08 => {
                self.write_configuration(access.implemented(value, !0x0000_0300, "RCC_CFGR"), access);
                return true;
            }
            0x0C => {
                let clear = value >> 16 & 0xBF;
                self.interrupts = (self.interrupts & 0xBF & !clear) | value & 0x3F00;
            }
            0x70 => self.write_backup(value, access),
            0x74 => {
                let before = self.status;
                self.status = self.status & !1 | value & 1;
                if value & 1 << 24 != 0 {
                    self.status &= 1;
                }
                if value & 1 == 0 {
                    self.slow_ready = NEVER;
                } else if before & 1 == 0 {
                    self.slow_ready = access.now + SLOW;
                }
            }
            0x80 | 0x84 => access.refuse(NOT_MODELLED, format!("RCC+{offset:#x}")),
            _ => match STORED.iter().position(|(known, ..)| *known == offset) {
                Some(index) => {
                    let (_, name, mask, _) = STORED[index];
                    self.stored[index] = access.implemented(value, mask, name);
                }
                None => access.refuse(NO_REGISTER, format!("RCC+{offset:#x}")),
            },
        }
        false
    }

    fn write_control(&mut self, value: u32, access: &mut Access<'_>) {
        let rises = |bit: u32| value >> bit & 1 == 1 && self.control >> bit & 1 == 0;
        let falls = |bit: u32| value >> bit & 1 == 0 && self.control >> bit & 1 == 1;
        let source = self.configuration & 3;
        if falls(0) && source == 0 || falls(16) && source == 1 || falls(24) && source == 2 {
            return access.refuse("clock switched off that the processor uses", "RCC_CR");
        }
        if rises(16) && self.crystal_works {
            self.crystal_ready = access.now + CRYSTAL;
        }
        if rises(24) {
            let has_source = if self.pll >> 22 & 1 == 1 { access.now >= self.crystal_ready } else { true };
            if !has_source {
                access.refuse("PLL switched on before its source is ready", "RCC_CR");
            }
            self.check_pll(access);
            self.pll_ready = access.now + LOCK;
        }
        if value & 1 << 19 != 0 && self.control & 1 << 19 == 0 && access.now < self.crystal_ready {
            access.refuse("clock security enabled before the crystal is ready", "RCC_CR");
        }
        if falls(16) {
            self.crystal_ready = NEVER;
        }
        if falls(24) {
            self.pll_ready = NEVER;
        }
        // The clock security cannot be switched off.
        self.control = value | self.control & 1 << 19;
    }

    fn write_pll(&mut self, value: u32, access: &mut Access<'_>) {
        if self.control & 1 << 24 != 0 {
            return access.refuse("PLL changed while it is on", "RCC_PLLCFGR");
        }
        self.pll = value | self.pll & 0x2000_0000;
    }

    /// Input of the voltage-controlled oscillator, its output, and the PLL's main output, Hz.
    fn pll_hz(&self) -> [u64; 3] {
        let source = if self.pll >> 22 & 1 == 1 { CRYSTAL_HZ } else { HSI_HZ };
        let input = source / u64::from(self.pll & 0x3F).max(1);
        let oscillator = input * u64::from(self.pll >> 6 & 0x1FF);
        [input, oscillator, oscillator / (2 * u64::from(1 + (self.pll >> 16 & 3)))]
    }

    fn check_pll(&self, access: &mut Access<'_>) {
        let [input, oscillator, output] = self.pll_hz();
        let usb = u64::from(self.pll >> 24 & 0xF);
        if self.pll & 0x3F < 2
            || !(1_000_000..=2_000_000).contains(&input)
            || !(100_000_000..=432_000_000).contains(&oscillator)
            || output > 168_000_000
            || usb < 2
            || oscillator / usb > 48_000_000
        {
            access.refuse("PLL frequencies outside their limits", "RCC_PLLCFGR");
        }
    }

    fn write_configuration(&mut self, value: u32, access: &mut Access<'_>) {
        let hz = match value & 3 {
            0 => Some(HSI_HZ),
            1 if access.now >= self.crystal_ready => Some(CRYSTAL_HZ),
            2 if access.now >= self.pll_ready => Some(self.pll_hz()[2]),
            _ => None,
        };
        let Some(hz) = hz else {
            return access.refuse("switch to a clock that is not ready", "RCC_CFGR");
        };
        self.configuration = value & !0xC;
        self.system_hz = hz;
        if hz > 144_000_000 && self.power & 0x4000 == 0 {
            access.refuse("more than 144 MHz at voltage scale 2", "RCC_CFGR");
        }
        if self.bus_hz(1) > 42_000_000 || self.bus_hz(2) > 84_000_000 {
            access.refuse("bus clock above its limit", "RCC_CFGR");
        }
    }

    fn write_backup(&mut self, value: u32, access: &mut Access<'_>) {
        if self.power & 1 << 8 == 0 {
            if value != self.backup {
                access.refuse("backup domain written while protected", "RCC_BDCR");
            }
            return;
        }
        self.backup = access.implemented(value, 0x0001_8305, "RCC_BDCR");
    }

    /// Reads a register of the power controller.
    pub fn read_power(&mut self, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0 => self.power,
            // The regulator's output is ready; the voltage detector.
            4 => 1 << 14 | u32::from(self.supply_is_low()) << 2,
            _ => access.no_register(format!("PWR+{offset:#x}")),
        }
    }

    /// Whether the voltage detector is on and the supply below its level.
    fn supply_is_low(&self) -> bool {
        self.power & 1 << 4 != 0 && self.supply_v < DETECTOR_V[(self.power >> 5 & 7) as usize]
    }

    /// Writes a register of the power controller.
    pub fn write_power(&mut self, offset: u32, value: u32, access: &mut Access<'_>) {
        match offset {
            0 => {
                let value = access.implemented(value, 0x43FF, "PWR_CR");
                if (value ^ self.power) & 1 << 14 != 0 && self.control & 1 << 24 != 0 {
                    access.refuse("voltage scale changed while the PLL is on", "PWR_CR");
                }
                self.power = value & !0xC;
            }
            4 => {
                access.implemented(value, 0x300, "PWR_CSR");
            }
            _ => access.refuse(NO_REGISTER, format!("PWR+{offset:#x}")),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    fn write(rcc: &mut Rcc, findings: &mut Findings, now: Ticks, offset: u32, value: u32) {
        rcc.write(offset, value, &mut Access { now, findings });
    }

    #[test]
    fn an_early_pll_and_an_early_switch_are_findings() {
        let (mut rcc, mut findings) = (Rcc::new(), Findings::default());
        write(&mut rcc, &mut findings, 0, 0x04, 4 | 168 << 6 | 1 << 22 | 7 << 24);
        write(&mut rcc, &mut findings, 0, 0x00, 0x101_0081);
        assert!(findings.has("PLL switched on before its source is ready"));
        write(&mut rcc, &mut findings, 1, 0x08, 2);
        assert!(findings.has("switch to a clock that is not ready"));
        write(&mut rcc, &mut findings, 1, 0x04, 0);
        assert!(findings.has("PLL changed while it is on"));
    }

    #[test]
    fn reset_reasons_accumulate_until_they_are_cleared() {
        let (mut rcc, mut findings) = (Rcc::new(), Findings::default());
        rcc.reset(ResetReason::Watchdog);
        let status = rcc.read(0x74, &mut Access { now: 0, findings: &mut findings });
        assert_eq!(status >> 25, 0b001_0111);
        write(&mut rcc, &mut findings, 0, 0x74, 1 << 24);
        rcc.reset(ResetReason::Software);
        let status = rcc.read(0x74, &mut Access { now: 0, findings: &mut findings });
        assert_eq!(status >> 25, 0b000_1010);
    }
}
