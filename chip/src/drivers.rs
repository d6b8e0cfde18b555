//! A foreign program on the model: embassy-stm32's drivers compared with the model's pins and registers.
//!
//! Why: the model and the firmware come from one reading of the reference manual. The program
//! (`chip/drivers`) sets registers only through another project's drivers. Each row of the result compares
//! what a driver's documentation promises with the model, in physical units. Its computations also run on the
//! host; the words of its exceptions are those that QEMU 7.2 gave (`EXCEPTIONS`). Known limit: no driver
//! with DMA.

use std::path::{Path, PathBuf};
use std::rc::Rc;

use scarab::bus::Frame;
use scarab_base::error::ToolError;
use scarab_boot::Region;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};
use scarab_rig::image::build::{firmware_build, run, target_directory};
use serde::Serialize;

use crate::chip::{Chip, STOP};
use crate::image::Image;
use crate::machine::{End, Machine, TIME_FACTOR};
use crate::peripherals::gpio::Mode;
use crate::peripherals::rcc::ResetReason;
use crate::plant::Plant;
use crate::time::{TICK_HZ, Ticks, seconds, ticks};

#[path = "../drivers/src/computation.rs"]
mod computation;
#[path = "../drivers/src/contract.rs"]
mod contract;

use contract::{FED, STORED};

const PACKAGE: &str =
    "--quiet --profile image --package scarab-chip-drivers --bin drivers --features drivers";
/// Path of the program below the target directory.
const IMAGE: &str = "firmware/thumbv7em-none-eabihf/image/drivers";
/// Offset of sector 11 in the space of the new image.
const LAST_SECTOR: usize = 3 * Region::NEW_IMAGE.sector_bytes as usize;
/// Interval between two polls of the program's step, s.
const POLL_S: f64 = 1e-5;
/// Processor clock that the program sets, Hz.
const CLOCK_HZ: f64 = 168e6;

/// Words of the program's instructions and exceptions (`chip/drivers/src/processor.rs`) on another emulator:
/// QEMU 7.2, `-M netduinoplus2 -icount shift=3`.
#[rustfmt::skip]
const EXCEPTIONS: [u32; 70] = [
    0x0000_0014, 0x1bec_f9e1, 0xa000_0001, 0x0101_0833, 0x0000_0003, 0x1141_5034, 0x8000_0102,
    0x8000_0101, 0x1103_e835, 0x8000_0103, 0x0104_080e, 0x0105_000b, 0xffff_fff1, 0x0501_000e,
    0x8000_0104, 0x0001_0800, 0xa000_0002, 0x0141_5834, 0x8000_0102, 0x0041_5800, 0x0103_0835,
    0x8000_0103, 0x1040_4800, 0x0000_0000, 0x1102_e834, 0x8000_0102, 0x0104_080e, 0x0105_000b,
    0xffff_fff1, 0x0501_000e, 0x8000_0104, 0x0004_0800, 0x0005_0800, 0xa000_0003, 0x0101_0833,
    0x0000_0003, 0x8000_0101, 0x1141_5834, 0x8000_0102, 0x1103_e835, 0x8000_0103, 0x0104_080e,
    0x0105_000b, 0xffff_fff1, 0x0501_000e, 0x8000_0104, 0x0006_0800, 0xa000_0004, 0x0105_080b,
    0xffff_ffe9, 0x0701_0000, 0x0105_080b, 0xffff_fff9, 0x0901_0200, 0x5111_10fc, 0xa000_0005,
    0x0000_0001, 0x0047_0800, 0x0008_0800, 0xa000_0006, 0x004a_4800, 0x0102_0834, 0x8000_0102,
    0x000a_0800, 0x0105_080b, 0xffff_fff9, 0x0301_0000, 0x0102_0834, 0x8000_0102, 0x0000_0003,
];

/// Comparison of one promise with the model.
#[derive(Clone, Debug, Serialize)]
pub struct Row {
    pub peripheral: &'static str,
    /// Request to the driver.
    pub requested: String,
    /// Behaviour of the model.
    pub shown: String,
    pub agrees: bool,
    /// Reason for a permitted difference: the driver breaks its own promise on silicon too, or nothing was
    /// compared.
    pub reason: Option<&'static str>,
}

impl Row {
    /// Whether model and promise agree, or may differ.
    pub const fn is_sound(&self) -> bool {
        self.agrees || self.reason.is_some()
    }

    pub fn verdict(&self) -> &'static str {
        if self.agrees { "equal" } else { self.reason.unwrap_or("DIFFERS") }
    }
}

/// Builds the program.
///
/// # Errors
/// The compiler is missing or fails.
pub fn build() -> Result<PathBuf, ToolError> {
    run(firmware_build(false).args(PACKAGE.split(' ')), "scripts/firmware-build")?;
    Ok(target_directory().join(IMAGE))
}

/// Runs the program and compares.
///
/// # Errors
/// The program cannot be read or lacks a symbol, or the model does not support an action of the processor.
pub fn check(path: &Path) -> Result<Vec<Row>, ToolError> {
    let mut check = Check::new(path)?;
    if let Err(error) = check.run() {
        check.row("program", "reaches every step", error.to_string(), false);
    }
    Ok(check.rows)
}

struct Check {
    machine: Machine,
    /// Addresses of the program's words.
    step_at: u32,
    go_at: u32,
    count_at: u32,
    results_at: u32,
    rows: Vec<Row>,
    /// Steps, results and findings so far.
    step: u32,
    results: u32,
    findings: usize,
}

impl Check {
    fn new(path: &Path) -> Result<Self, ToolError> {
        let image: Rc<Image> = Image::load(path)?;
        let plant = Plant::new(&LegFile::load(DEFAULT_LEG)?, 1)?;
        let symbol = |name: &str| {
            let missing = || ToolError::input(format!("{}: no symbol {name}", path.display()));
            image.address(name).ok_or_else(missing)
        };
        Ok(Self {
            machine: Machine::new(&image, Chip::new(plant, 1), TIME_FACTOR)?,
            step_at: symbol("DRIVERS_STEP")?,
            go_at: symbol("DRIVERS_GO")?,
            count_at: symbol("DRIVERS_COUNT")?,
            results_at: symbol("DRIVERS_RESULTS")?,
            rows: Vec::new(),
            step: 0,
            results: 0,
            findings: 0,
        })
    }

    fn run(&mut self) -> Result<(), ToolError> {
        type Step = fn(&mut Check) -> Result<(), ToolError>;
        let steps: [(&str, Step); 9] = [
            ("processor", Self::processor),
            ("RCC", Self::clocks),
            ("GPIO, EXTI", Self::pins),
            ("TIM1, TIM2", Self::bridge),
            ("ADC1", Self::analog),
            ("SPI3", Self::gates),
            ("CAN1", Self::frames),
            ("FLASH", Self::flash),
            ("IWDG", Self::watchdog),
        ];
        for (peripheral, step) in steps {
            step(self)?;
            self.note_findings(peripheral);
        }
        Ok(())
    }

    fn word(&self, address: u32) -> u32 {
        let mut bytes = [0; 4];
        self.machine.memory(address, &mut bytes);
        u32::from_le_bytes(bytes)
    }

    /// Next results.
    fn take<const N: usize>(&mut self) -> [u32; N] {
        let first = self.results;
        self.results += N as u32;
        core::array::from_fn(|index| self.word(self.results_at + 4 * (first + index as u32)))
    }

    /// Lets the program run until its next step, at most for a time, s; `with` is added to the release.
    fn next(&mut self, longest: f64, with: u32) -> Result<(), ToolError> {
        self.machine.set_memory(self.go_at, &(self.step | with).to_le_bytes());
        let end = self.machine.chip().now + ticks(longest);
        while self.machine.chip().now < end {
            self.pass(POLL_S)?;
            if self.word(self.step_at) == self.step + 1 {
                self.step += 1;
                return Ok(());
            }
        }
        self.note_findings("last step");
        let results = self.word(self.count_at);
        Err(ToolError::input(format!(
            "step {} was not reached within {longest} s, after {results} results",
            self.step + 1
        )))
    }

    /// Runs for a time, s.
    fn pass(&mut self, duration: f64) -> Result<End, ToolError> {
        self.machine.run(self.machine.chip().now + ticks(duration))
    }

    fn row(&mut self, peripheral: &'static str, requested: &str, shown: String, agrees: bool) {
        self.rows.push(Row { peripheral, requested: requested.to_owned(), shown, agrees, reason: None });
    }

    /// Gives the last row's reason, if it differs.
    fn explain(&mut self, reason: &'static str) {
        if let Some(row) = self.rows.last_mut().filter(|row| !row.agrees) {
            row.reason = Some(reason);
        }
    }

    /// Adds a row for the findings since the last call.
    fn note_findings(&mut self, peripheral: &str) {
        let image = self.machine.image();
        let list = self.machine.chip().findings.list(|pc| image.function(pc));
        let new = list.iter().filter(|finding| finding.known().is_none()).skip(self.findings);
        let texts: Vec<String> = new
            .map(|finding| format!("{}: {} in {}", finding.register, finding.what, finding.function))
            .collect();
        self.findings += texts.len();
        if !texts.is_empty() {
            let requested = format!("{peripheral}: registers as silicon allows");
            self.row("findings", &requested, texts.join("; "), false);
        }
    }

    fn processor(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let [integers, floats]: [u32; 2] = self.take();
        let expected = [computation::integers(), computation::floats()];
        let shown = format!("{integers:08x}, {floats:08x}, host {expected:08x?}");
        self.row("processor", "integers and floats", shown, [integers, floats] == expected);
        let words: [u32; EXCEPTIONS.len()] = self.take();
        let differ: Vec<String> = (words.iter().zip(&EXCEPTIONS).enumerate())
            .filter(|(_, (word, other))| word != other)
            .map(|(index, (word, other))| format!("[{index}] {word:08x}, QEMU {other:08x}"))
            .collect();
        let count = self.word(self.count_at);
        let shown = format!("{} words, {} differ {}", words.len(), differ.len(), differ.join("; "));
        self.row("processor", "exceptions as in QEMU", shown, differ.is_empty() && count == self.results);
        Ok(())
    }

    fn clocks(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let requested = self.take::<5>().map(u64::from);
        let rcc = &self.machine.chip().rcc;
        let timer = |bus| TICK_HZ / rcc.timer_cycle(bus);
        let shown = [rcc.processor_hz(), rcc.bus_hz(1), rcc.bus_hz(2), timer(1), timer(2)];
        let mhz = |hz: [u64; 5]| hz.map(|hz| format!("{}", hz as f64 * 1e-6)).join(", ");
        self.row(
            "RCC",
            &format!("{} MHz", mhz(requested)),
            format!("{} MHz", mhz(shown)),
            requested == shown,
        );
        for (requested, expected) in [("block_for 10 ms on TIM4", 10e-3), ("Timer::after 5 ms on TIM4", 5e-3)]
        {
            let [cycles] = self.take();
            let taken = f64::from(cycles) / CLOCK_HZ;
            // Up to a tick of 1 us earlier or later, and some hundred instructions.
            let agrees = (expected - 1e-6..expected + 12e-6).contains(&taken);
            self.row("time", requested, format!("{:.4} ms by the cycle counter", 1e3 * taken), agrees);
        }
        Ok(())
    }

    fn pins(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let gpio = &self.machine.chip().gpio;
        let modes = [('A', 0), ('A', 1), ('A', 15), ('B', 2)].map(|pin| gpio.mode(pin));
        let levels = [('A', 0), ('A', 1)].map(|pin| gpio.level(pin));
        let expected = [Mode::Output, Mode::Output, Mode::Analog, Mode::Input];
        let shown = format!("{modes:?}, PA0 {}, PA1 {}", levels[0], levels[1]);
        let requested = "PA0 high, PA1 open and pulled up, PA15 dropped, PB2 input";
        self.row("GPIO", requested, shown, modes == expected && levels == [true; 2]);
        let chip = self.machine.chip_mut();
        chip.set_pin(('B', 2), true);
        chip.set_pin(('A', 1), false);
        self.next(0.1, 0)?;
        let [levels] = self.take();
        // Open drain: low while driven, otherwise the level from outside.
        let requested = "pulled up 1, down 0, PB2 0 then 1, PA1 0 then 0 from outside, PA0 set 1";
        self.row("GPIO", requested, format!("read {levels:07b} from the last"), levels == 0b100_1001);
        self.machine.set_memory(self.go_at, &self.step.to_le_bytes());
        let mut steps = Vec::new();
        for level in [true, false, true] {
            self.machine.chip_mut().set_pin(STOP, level);
            self.pass(2e-4)?;
            steps.push(self.word(self.step_at) == self.step + 1);
        }
        self.step += 1;
        let entries = self.machine.chip().load.usage(16 + 10).entries;
        let shown = format!("woken at edges {steps:?}, {entries} interrupts of EXTI4");
        self.row(
            "EXTI",
            "wait for a rising edge of PC4",
            shown,
            steps == [false, false, true] && entries == 1,
        );
        Ok(())
    }

    /// Complementary outputs: period, widths and gaps in clocks of the timer.
    fn waveform(&mut self) -> Result<Option<[Ticks; 5]>, ToolError> {
        self.machine.chip_mut().plant.axes[0].pin_changes = Some(Vec::new());
        self.pass(3e-4)?;
        let changes = self.machine.chip_mut().plant.axes[0].pin_changes.take().unwrap_or_default();
        let changes: Vec<(Ticks, [bool; 2])> = changes.iter().map(|(at, pins)| (at / 2, pins[0])).collect();
        let Some(first) = changes.iter().position(|(_, pins)| *pins == [true, false]) else {
            return Ok(None);
        };
        // High side on, off, low side on, off, high side on.
        let Some([on, off, low, end, again]) =
            changes.get(first..first + 5).and_then(|five| five.first_chunk())
        else {
            return Ok(None);
        };
        let widths = [again.0 - on.0, off.0 - on.0, end.0 - low.0, low.0 - off.0, again.0 - end.0];
        let order = [off, low, end, again].map(|(_, pins)| *pins);
        let right = order == [[false; 2], [false, true], [false; 2], [true, false]];
        Ok(right.then_some(widths))
    }

    fn bridge(&mut self) -> Result<(), ToolError> {
        for (hz, dead, centred) in [(20_000, 100, false), (24_000, 300, true)] {
            self.next(0.1, 0)?;
            let widths = self.waveform()?;
            let [top] = self.take().map(u64::from);
            let (period, duty) = if centred { (2 * top, 2 * (top / 4)) } else { (top, top / 4) };
            let expected = [period, duty - dead, period - duty - dead, dead, dead];
            let alignment = if centred { "centre" } else { "edge" };
            let requested = format!("{alignment}-aligned {hz} Hz, duty 25 %, dead time {dead} clocks");
            let shown = widths.map_or("no such outputs".into(), |[period, high, low, gap, other]| {
                let hz = 168e6 / period as f64;
                format!("{hz:.1} Hz; high {high}, low {low}, gaps {gap} and {other} clocks")
            });
            self.row("TIM1", &requested, shown, widths == Some(expected));
            let actual = widths.map_or(0.0, |[period, ..]| 168e6 / period as f64);
            let requested = format!("at most {hz} Hz (\"rounds towards slower\")");
            self.row("TIM1", &requested, format!("{actual:.1} Hz"), actual <= f64::from(hz));
            if centred && widths == Some(expected) && actual < 1.001 * f64::from(hz) {
                self.explain(
                    "driver: ARR is one too small, as a centre-aligned period is 2 ARR (RM0090 17.3.2)",
                );
            }
        }
        self.next(0.1, 0)?;
        let duty = self.machine.chip().plant.brake;
        self.row(
            "TIM2",
            "PB11 at 1 kHz, 30 %",
            format!("brake at {:.2} %", 100.0 * duty),
            (duty - 0.3).abs() < 1e-3,
        );
        Ok(())
    }

    fn analog(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        // 12 bits over 3.3 V behind the board's divider.
        let [short, long, sum] = self.take();
        let read = f64::from(sum) / 16.0 * 3.3 / 4096.0 * 19.0;
        let volt = self.machine.chip().plant.supply.voltage();
        let code = u32::from(self.machine.chip().plant.thermistors[0]);
        self.row(
            "ADC1",
            "mean of 16 codes of PA6",
            format!("{read:.3} V of {volt:.3} V"),
            (read - volt).abs() < 0.02,
        );
        self.row(
            "ADC1",
            "PC5 with 8 and 12 bits",
            format!("{short} and {long} of {code}"),
            long == code && short == code >> 4,
        );
        Ok(())
    }

    fn gates(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let [answer, cycles] = self.take();
        let frames = self.machine.chip().drivers.frames;
        let shown = format!("{answer:#06x}, frames {frames:?}");
        self.row(
            "SPI3",
            "control register 1 = 0x2a9, read back",
            shown,
            answer == 0x12A9 && frames == [3, 0],
        );
        // 42 MHz / 16 are the fastest clock up to 2.6 MHz by the driver's table.
        let (taken, wire) = (f64::from(cycles) / CLOCK_HZ, 16.0 / 2.625e6);
        let shown = format!("{:.2} us for {:.2} us on the wire", 1e6 * taken, 1e6 * wire);
        self.row("SPI3", "16 bits at 2.6 MHz", shown, (wire..wire + 1e-6).contains(&taken));
        Ok(())
    }

    fn frames(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let can = &self.machine.chip().can;
        let sent: Vec<Frame> = can.sent.iter().map(|(_, frame)| *frame).collect();
        let texts: Vec<String> =
            sent.iter().map(|frame| format!("{:x} {:x?}", frame.id(), frame.data())).collect();
        let shown = format!("{} bit/s, {}", can.rate(), texts.join(", "));
        let agrees =
            sent == [Frame::new(0x123, &[1, 2, 3]), Frame::new(0x124, &[])] && can.rate() == 1_000_000;
        self.row("CAN1", "1 Mbit/s, frames 123 with bytes 1, 2, 3 and 124", shown, agrees);
        self.machine.chip_mut().send_frame(Frame::new(0x45A, &[9, 8, 7, 6, 5]));
        self.next(0.1, 0)?;
        let read: [u32; 4] = self.take();
        let shown = format!("read {read:x?}");
        self.row("CAN1", "frame 45a of 5 bytes from the partner", shown, read == [0x45A, 5, 0x0607_0809, 5]);
        self.machine.chip_mut().can.connected = false;
        self.machine.chip_mut().can.sent.clear();
        self.next(0.1, 0)?;
        let [repeated, error, replaced] = self.take();
        self.row("CAN1", "error without a partner: not acknowledged", format!("kind {error}"), error == 1);
        let requested = "frame of an identifier that was sent before: accepted";
        self.row("CAN1", requested, format!("accepted {repeated}"), repeated == 1);
        self.row(
            "CAN1",
            "50 replaces 300 of 300, 124, 100",
            format!("{replaced:x} replaced"),
            replaced == 0x300,
        );
        self.machine.chip_mut().can.connected = true;
        self.pass(2e-3)?;
        let sent: Vec<u16> = self.machine.chip().can.sent.iter().map(|(_, frame)| frame.id()).collect();
        self.row("CAN1", "then 50, 100, 124 leave", format!("{sent:x?}"), sent == [0x50, 0x100, 0x124]);
        Ok(())
    }

    fn flash(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        self.machine.chip_mut().flash.region_mut(&Region::NEW_IMAGE)[LAST_SECTOR..].fill(0);
        self.next(5.0, 0)?;
        let blank = self.machine.chip_mut().flash.region_mut(&Region::NEW_IMAGE)[LAST_SECTOR..]
            .iter()
            .all(|cell| *cell == 0xFF);
        self.next(0.1, 0)?;
        let [erase, read, write, outcomes] = self.take();
        let cells = &self.machine.chip_mut().flash.region_mut(&Region::NEW_IMAGE)[LAST_SECTOR + 0x40..][..16];
        let words: Vec<u32> = cells
            .chunks_exact(4)
            .map(|cell| u32::from_le_bytes([cell[0], cell[1], cell[2], cell[3]]))
            .collect();
        let shown = format!("blank {blank}, {words:08x?}, outcomes {outcomes:05b}");
        let agrees = blank && words == STORED && outcomes == 0b1_1111 && read == u32::MAX;
        self.row("FLASH", "sector 11 erased, 4 words written and read", shown, agrees);
        let [erase, write] = [erase, write].map(|cycles| f64::from(cycles) / CLOCK_HZ);
        // DS8626 table 42: typical times; the driver erases by bytes and programs by words.
        let shown = format!("{erase:.3} s, {:.1} us a word", 1e6 * write / 4.0);
        let agrees = (2.0..2.01).contains(&erase) && (16e-6..20e-6).contains(&(write / 4.0));
        self.row("FLASH", "erase by bytes 2 s, word 16 us", shown, agrees);
        Ok(())
    }

    fn watchdog(&mut self) -> Result<(), ToolError> {
        self.next(0.1, 0)?;
        let (saved, step) = (self.machine.save()?, self.step);
        for (fed, requested, expected) in
            [(FED, "100 ms, started and fed", 0.1), (0, "100 ms, started without a feed", 0.512)]
        {
            self.machine.restore(&saved)?;
            self.step = step;
            self.next(0.1, fed)?;
            let begun = self.machine.chip().now;
            let end = self.pass(1.0)?;
            let taken = seconds(self.machine.chip().now - begun);
            let shown = format!("{end:?} after {:.2} ms", 1e3 * taken);
            let is_right = end == End::Reset(ResetReason::Watchdog) && (taken - expected).abs() < 1e-3;
            self.row("IWDG", requested, shown, is_right && fed != 0);
            if is_right {
                self.explain(
                    "driver: a start counts from 0xFFF, only a feed loads the reload value (RM0090 21.3)",
                );
            }
        }
        Ok(())
    }
}
