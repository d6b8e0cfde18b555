//! Converters ADC1 to ADC3 (RM0090 13): regular and injected groups, triggers, times and flags.
//!
//! ```text
//! trigger ----- sampling ----->| hold ----- 12 clocks ----->| result, then the next rank
//! ```
//!
//! The input is read at the hold. Injected conversions of a scan follow one another; a regular conversion
//! that is interrupted by injected ones starts again. Refused: sequences without scan mode or changed during
//! a conversion, triggers before the converter has settled, a clock above 36 MHz. Known limits: no DMA, no
//! dual mode, no analog watchdog; triggers are TRGO of TIM1 (injected) and TIM8 (regular), and software.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};
use crate::time::{NEVER, TICK_HZ, Ticks};

/// Converters.
pub const COUNT: usize = 3;
/// Sampling times, clocks.
const SAMPLING: [u64; 8] = [3, 15, 28, 56, 84, 112, 144, 480];
/// Clocks of a conversion of 12 bits after the hold; two less for each step of the resolution.
const CONVERSION: u64 = 12;
/// Time from switching on to the first conversion: 3 us.
const SETTLING: Ticks = 3 * TICK_HZ / 1_000_000;

const EOC: u32 = 1 << 1;
const JEOC: u32 = 1 << 2;
const JSTRT: u32 = 1 << 3;
const STRT: u32 = 1 << 4;
const OVR: u32 = 1 << 5;
const SCAN: u32 = 1 << 8;

/// Source of a trigger.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Trigger {
    /// Trigger output of TIM1.
    First,
    /// Trigger output of TIM8.
    Second,
}

/// Group of conversions in progress.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Running {
    injected: bool,
    rank: usize,
    /// Instant of the hold, and of the result.
    hold: Ticks,
    end: Ticks,
    /// Sampled code.
    code: Option<u16>,
}

/// Request of a converter at an instant.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// Read the input of a channel now.
    Hold(u32),
    /// A result was stored.
    Result,
}

/// State of one converter.
#[derive(Clone, Debug, Default)]
pub struct Adc {
    sr: u32,
    cr: [u32; 2],
    smpr: [u32; 2],
    offsets: [u32; 4],
    sqr: [u32; 3],
    jsqr: u32,
    results: [u32; 4],
    result: u32,
    running: Option<Running>,
    /// Regular group that waits for injected conversions.
    waiting: bool,
    on_since: Ticks,
    /// Results that were overwritten before they were read, regular and injected.
    pub lost: [u64; 2],
}

impl Adc {
    /// Name of a register.
    fn name(number: usize, register: &str) -> String {
        format!("ADC{}_{register}", number + 1)
    }

    /// Channel of a rank, and its sampling time in clocks.
    fn channel(&self, injected: bool, rank: usize) -> (u32, u64) {
        let channel = if injected {
            let length = (self.jsqr >> 20 & 3) as usize + 1;
            self.jsqr >> (5 * (4 - length + rank)) & 0x1F
        } else {
            match rank {
                0..=5 => self.sqr[2] >> (5 * rank) & 0x1F,
                6..=11 => self.sqr[1] >> (5 * (rank - 6)) & 0x1F,
                _ => self.sqr[0] >> (5 * (rank - 12)) & 0x1F,
            }
        };
        let code =
            if channel < 10 { self.smpr[1] >> (3 * channel) } else { self.smpr[0] >> (3 * (channel - 10)) };
        (channel, SAMPLING[(code & 7) as usize])
    }

    /// Bits less than 12 of a result (RES).
    fn dropped(&self) -> u32 {
        2 * (self.cr[0] >> 24 & 3)
    }

    fn length(&self, injected: bool) -> usize {
        if self.cr[0] & SCAN == 0 {
            return 1;
        }
        1 + if injected { self.jsqr >> 20 & 3 } else { self.sqr[0] >> 20 & 0xF } as usize
    }

    fn begin(&mut self, injected: bool, rank: usize, now: Ticks, clock: Ticks) {
        let (_, sampling) = self.channel(injected, rank);
        let hold = now + sampling * clock;
        let end = hold + (CONVERSION - u64::from(self.dropped())) * clock;
        self.running = Some(Running { injected, rank, hold, end, code: None });
    }

    /// Takes a rising edge of a trigger.
    pub fn trigger(&mut self, number: usize, source: Trigger, clock: Ticks, access: &mut Access<'_>) {
        let control = self.cr[1];
        let injected = source == Trigger::First;
        let (edge, event, wanted) = if injected { (20, 16, 1) } else { (28, 24, 14) };
        if control & 1 == 0 || control >> edge & 1 == 0 || control >> event & 0xF != wanted {
            return;
        }
        if access.now < self.on_since + SETTLING {
            access.refuse("conversion triggered before the converter has settled", Self::name(number, "CR2"));
        }
        self.start(injected, number, clock, access);
    }

    fn start(&mut self, injected: bool, number: usize, clock: Ticks, access: &mut Access<'_>) {
        let now = access.now;
        if self.length(injected) == 1 {
            let many = if injected { self.jsqr >> 20 & 3 } else { self.sqr[0] >> 20 & 0xF };
            if many > 0 {
                access.refuse("sequence without scan mode", Self::name(number, "CR1"));
            }
        }
        match self.running {
            // A trigger during its own group is ignored.
            Some(running) if running.injected == injected => {}
            Some(running) if running.injected => self.waiting = true,
            Some(_) => {
                self.waiting = true;
                self.begin(true, 0, now, clock);
            }
            None => self.begin(injected, 0, now, clock),
        }
        self.sr |= if injected { JSTRT } else { STRT };
    }

    /// Instant of the next event.
    pub fn due(&self) -> Ticks {
        self.running.map_or(NEVER, |running| if running.code.is_none() { running.hold } else { running.end })
    }

    /// Processes the event that is due. `clock` is the converters' clock.
    pub fn pass(&mut self, clock: Ticks) -> Option<Event> {
        let running = self.running.as_mut()?;
        if running.code.is_none() {
            let Running { injected, rank, .. } = *running;
            return Some(Event::Hold(self.channel(injected, rank).0));
        }
        let Running { injected, rank, end, code, .. } = *running;
        self.running = None;
        self.store(injected, rank, code.unwrap_or(0));
        if rank + 1 < self.length(injected) {
            self.begin(injected, rank + 1, end, clock);
        } else if self.waiting {
            self.waiting = false;
            self.begin(false, 0, end, clock);
        }
        Some(Event::Result)
    }

    /// Sets the code of the held input.
    pub fn hold(&mut self, code: u16) {
        if let Some(running) = &mut self.running {
            running.code = Some(code);
        }
    }

    fn store(&mut self, injected: bool, rank: usize, code: u16) {
        // To the left, 6 bits are aligned within a byte (RM0090 13.4).
        let (code, dropped) = (u32::from(code) >> self.dropped(), self.dropped());
        let left = if dropped == 6 { 2 } else { 4 + dropped };
        let code = if self.cr[1] & 1 << 11 != 0 { code << left } else { code };
        let last = rank + 1 == self.length(injected);
        if injected {
            self.results[rank] = code.wrapping_sub(self.offsets[rank]) & 0xFFFF;
            if last {
                self.lost[1] += u64::from(self.sr & JEOC != 0);
                self.sr |= JEOC;
            }
            return;
        }
        self.lost[0] += u64::from(self.sr & EOC != 0);
        self.result = code;
        if last || self.cr[1] & 1 << 10 != 0 {
            if self.sr & EOC != 0 && self.cr[1] & 1 << 10 != 0 {
                self.sr |= OVR;
            }
            self.sr |= EOC;
        }
    }

    /// Whether this converter requests the common interrupt.
    pub fn requests(&self) -> bool {
        let enabled = [(EOC, 5), (JEOC, 7), (1, 6), (OVR, 26)];
        enabled.into_iter().any(|(flag, bit)| self.sr & flag != 0 && self.cr[0] >> bit & 1 == 1)
    }

    /// Reads a register of converter `number`.
    pub fn read(&mut self, number: usize, offset: u32, access: &mut Access<'_>) -> u32 {
        match offset {
            0x00 => self.sr,
            0x04 | 0x08 => self.cr[(offset as usize - 4) / 4],
            0x0C | 0x10 => self.smpr[(offset as usize - 0xC) / 4],
            0x14..=0x20 => self.offsets[(offset as usize - 0x14) / 4],
            0x24 => 0xFFF,
            0x28 => 0,
            0x2C..=0x34 => self.sqr[(offset as usize - 0x2C) / 4],
            0x38 => self.jsqr,
            0x3C..=0x48 => self.results[(offset as usize - 0x3C) / 4],
            0x4C => {
                self.sr &= !EOC;
                self.result
            }
            _ => access.no_register(Self::name(number, &format!("{offset:#x}"))),
        }
    }

    /// Writes a register of converter `number`.
    pub fn write(&mut self, number: usize, offset: u32, value: u32, clock: Ticks, access: &mut Access<'_>) {
        let name = |register: &str| Self::name(number, register);
        if matches!(offset, 0x2C..=0x38) && self.running.is_some() {
            access.refuse("sequence changed during a conversion", name("SQR, JSQR"));
        }
        match offset {
            // Zeros clear, ones do nothing.
            0x00 => self.sr &= value | !0x3F,
            0x04 => self.cr[0] = access.implemented(value, 0x07C0_FFFF, &name("CR1")),
            0x08 => self.write_control(number, value, clock, access),
            0x0C => self.smpr[0] = access.implemented(value, 0x07FF_FFFF, &name("SMPR1")),
            0x10 => self.smpr[1] = access.implemented(value, 0x3FFF_FFFF, &name("SMPR2")),
            0x14..=0x20 => {
                self.offsets[(offset as usize - 0x14) / 4] = access.implemented(value, 0xFFF, &name("JOFR"));
            }
            0x24 | 0x28 => access.refuse(NOT_MODELLED, name("HTR, LTR")),
            0x2C => self.sqr[0] = access.implemented(value, 0x00FF_FFFF, &name("SQR1")),
            0x30 => self.sqr[1] = access.implemented(value, 0x3FFF_FFFF, &name("SQR2")),
            0x34 => self.sqr[2] = access.implemented(value, 0x3FFF_FFFF, &name("SQR3")),
            0x38 => self.jsqr = access.implemented(value, 0x003F_FFFF, &name("JSQR")),
            0x3C..=0x4C => access.refuse("read-only register written", name(&format!("{offset:#x}"))),
            _ => access.refuse(NO_REGISTER, name(&format!("{offset:#x}"))),
        }
    }

    fn write_control(&mut self, number: usize, value: u32, clock: Ticks, access: &mut Access<'_>) {
        let name = Self::name(number, "CR2");
        let value = access.implemented(value, 0x7F7F_0F03, &name);
        if value & 1 == 1 && self.cr[1] & 1 == 0 {
            self.on_since = access.now;
        }
        let triggers = [(20, 16, 1), (28, 24, 14)];
        if triggers.into_iter().any(|(edge, event, known)| {
            value >> edge & 3 != 0 && (value >> edge & 3 != 1 || value >> event & 0xF != known)
        }) || value & 0x0000_0302 != 0
        {
            access.refuse(NOT_MODELLED, &*name);
        }
        self.cr[1] = value & !(1 << 22 | 1 << 30);
        for (bit, injected) in [(22, true), (30, false)] {
            if value >> bit & 1 == 1 {
                self.start(injected, number, clock, access);
            }
        }
        if value & 1 == 0 {
            (self.running, self.waiting) = (None, false);
        }
    }
}

/// Common registers of all converters.
#[derive(Clone, Debug, Default)]
pub struct Common {
    control: u32,
}

impl Common {
    /// Converters' clock for a clock of their bus, ticks of the model.
    pub fn clock(&self, bus_hz: u64) -> Ticks {
        TICK_HZ / bus_hz * u64::from(2 + 2 * (self.control >> 16 & 3))
    }

    /// Reads a common register, offset from the first converter's base.
    pub fn read(&self, offset: u32, adcs: &[Adc; COUNT], access: &mut Access<'_>) -> u32 {
        match offset {
            0x300 => (0..COUNT).fold(0, |value, number| value | (adcs[number].sr & 0x3F) << (8 * number)),
            0x304 => self.control,
            _ => access.no_register(format!("ADC+{offset:#x}")),
        }
    }

    /// Writes a common register.
    pub fn write(&mut self, offset: u32, value: u32, bus_hz: u64, access: &mut Access<'_>) {
        if offset != 0x304 {
            return access.refuse(NO_REGISTER, format!("ADC+{offset:#x}"));
        }
        let value = access.implemented(value, 0x00C3_EF1F, "ADC_CCR");
        if value & 0xDF1F != 0 {
            access.refuse(NOT_MODELLED, "ADC_CCR");
        }
        self.control = value;
        if TICK_HZ / self.clock(bus_hz) > 36_000_000 {
            access.refuse("converter clock above 36 MHz", "ADC_CCR");
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    const CLOCK: Ticks = 16;

    struct Bench {
        adc: Adc,
        findings: Findings,
    }

    impl Bench {
        fn new(setup: &[(u32, u32)]) -> Self {
            let mut bench = Self { adc: Adc::default(), findings: Findings::default() };
            for &(offset, value) in setup {
                let access = &mut Access { now: 0, findings: &mut bench.findings };
                bench.adc.write(1, offset, value, CLOCK, access);
            }
            bench
        }

        fn trigger(&mut self, now: Ticks, source: Trigger) {
            self.adc.trigger(1, source, CLOCK, &mut Access { now, findings: &mut self.findings });
        }

        /// Instants of holds (with channels) and results.
        fn run(&mut self) -> Vec<(Ticks, Option<u32>)> {
            let mut seen = Vec::new();
            while self.adc.due() != NEVER {
                let now = self.adc.due();
                match self.adc.pass(CLOCK) {
                    Some(Event::Hold(channel)) => {
                        self.adc.hold(100 + channel as u16);
                        seen.push((now, Some(channel)));
                    }
                    _ => seen.push((now, None)),
                }
            }
            seen
        }
    }

    #[test]
    fn a_scan_holds_each_rank_after_its_sampling_time() {
        let mut bench = Bench::new(&[
            (0x04, SCAN),
            (0x38, 1 << 20 | 6 << 10 | 4 << 15),
            (0x10, 1 << 12),
            (0x08, 1 | 1 << 16 | 1 << 20),
        ]);
        bench.trigger(2000, Trigger::First);
        let seen = bench.run();
        assert_eq!(seen, [(2048, Some(6)), (2240, None), (2240 + 240, Some(4)), (2240 + 432, None)]);
        assert_eq!(bench.adc.results[..2], [106, 104]);
        assert_eq!(bench.adc.sr, JEOC | JSTRT);
        assert!(bench.findings.is_empty(), "{:?}", bench.findings);
    }

    #[test]
    fn a_resolution_of_8_bits_drops_four_and_takes_four_clocks_less() {
        let mut bench = Bench::new(&[(0x04, 2 << 24), (0x38, 6 << 15), (0x08, 1 | 1 << 16 | 1 << 20)]);
        bench.trigger(2000, Trigger::First);
        assert_eq!(bench.run(), [(2048, Some(6)), (2048 + 8 * CLOCK, None)]);
        assert_eq!(bench.adc.results[0], 106 >> 4);
    }

    #[test]
    fn a_regular_conversion_starts_again_after_injected_ones() {
        let setup = [(0x34, 13), (0x38, 10 << 15), (0x08, 1 | 1 << 16 | 1 << 20 | 14 << 24 | 1 << 28)];
        let mut bench = Bench::new(&setup);
        bench.trigger(2000, Trigger::Second);
        bench.trigger(2010, Trigger::First);
        let holds: Vec<_> =
            bench.run().into_iter().filter_map(|(at, channel)| Some((at, channel?))).collect();
        assert_eq!(holds, [(2058, 10), (2250 + 48, 13)]);
        assert_eq!((bench.adc.results[0], bench.adc.result), (110, 113));
    }

    #[test]
    fn sequences_need_scan_mode_and_a_settled_converter() {
        let mut bench = Bench::new(&[(0x38, 1 << 20), (0x08, 1 | 1 << 16 | 1 << 20)]);
        bench.trigger(10, Trigger::First);
        assert!(bench.findings.has("sequence without scan mode"));
        assert!(bench.findings.has("conversion triggered before the converter has settled"));
        assert_eq!(bench.run().len(), 2);
    }

    #[test]
    fn an_unread_result_is_counted_when_it_is_overwritten() {
        let mut bench = Bench::new(&[(0x34, 13), (0x08, 1 | 14 << 24 | 1 << 28)]);
        for now in [2000, 9000] {
            bench.trigger(now, Trigger::Second);
            bench.run();
        }
        assert_eq!(bench.adc.lost, [1, 0]);
    }
}
