//! The chip without its processor core: address map, clock gates, interrupt lines, events in their order.
//!
//! Every part states the time of its next event; the earliest is processed first, at its own instant. The
//! processor may therefore run until that instant without polling.

use crate::findings::{Access, Findings, NOT_MODELLED};
use crate::load::Load;
use crate::nvic::{NMI, Nvic};
use crate::peripherals::adc::{self, Adc, Trigger};
use crate::peripherals::as5047p::Encoder;
use crate::peripherals::can::Can;
use crate::peripherals::debug::Debug;
use crate::peripherals::drv8301::Drivers;
use crate::peripherals::exti::Exti;
use crate::peripherals::flash::Flash;
use crate::peripherals::gpio::{Gpio, Mode, Pin};
use crate::peripherals::iwdg::Iwdg;
use crate::peripherals::pwm::Outputs;
use crate::peripherals::rcc::{Rcc, ResetReason};
use crate::peripherals::spi::Spi;
use crate::peripherals::timer::{Event, Kind, NAMES, Timer};
use crate::plant::{JOINTS, Plant};
use crate::system::System;
use crate::time::{NEVER, Ticks};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;

/// Calls a method of the plant with both bridges' timers and outputs.
macro_rules! with_bridges {
    ($chip:expr, |$plant:ident, $bridges:ident| $call:expr) => {{
        let [first, second, ..] = &$chip.timers;
        let [one, two] = &mut $chip.outputs;
        let ($plant, $bridges) = (&mut $chip.plant, &mut [(first, one), (second, two)]);
        $call
    }};
}

/// Sources of events, in the order in which simultaneous ones are processed.
const TIMERS: usize = 0;
const PLANT: usize = 6;
const ADCS: usize = 7;
const CAN: usize = 10;
const WATCHDOG: usize = 11;
const SOURCES: usize = 12;

/// Addresses of the timers, in the order of [`NAMES`].
const TIMER_BASES: [u32; 6] = [0x4001_0000, 0x4001_0400, 0x4000_0000, 0x4000_0400, 0x4000_0800, 0x4000_0C00];
/// Update and compare interrupts of the timers.
const TIMER_INTERRUPTS: [[u8; 2]; 6] = [[25, 27], [44, 46], [28, 28], [29, 29], [30, 30], [50, 50]];
const ADC_INTERRUPT: u8 = 18;
const CAN_INTERRUPTS: [u8; 4] = [19, 20, 21, 22];

/// Pins of both bridges: high and low side of outputs A, B, C; and the alternate function.
const BRIDGE_PINS: [([[Pin; 2]; 3], u32); JOINTS] = [
    ([[('A', 8), ('B', 13)], [('A', 9), ('B', 14)], [('A', 10), ('B', 15)]], 1),
    ([[('C', 6), ('A', 7)], [('C', 7), ('B', 0)], [('C', 8), ('B', 1)]], 3),
];
/// Encoder inputs of both axes.
const ENCODER_PINS: [[Pin; 2]; JOINTS] = [[('B', 4), ('B', 5)], [('B', 6), ('B', 7)]];
const INDEX_PINS: [Pin; JOINTS] = [('C', 9), ('C', 15)];
const SPI_PINS: [Pin; 3] = [('C', 10), ('C', 11), ('C', 12)];
const SELECTS: [Pin; 2] = [('C', 13), ('C', 14)];
/// Select lines of absolute encoders: an axis' first on GPIO7 or GPIO8, its second on the index input.
const ENCODER_SELECTS: [[Pin; 2]; JOINTS] = [[('A', 15), ('C', 9)], [('B', 3), ('C', 15)]];
/// Axis and number of every such line.
const LINES: [(usize, usize); 4] = [(0, 0), (0, 1), (1, 0), (1, 1)];
const GATE_ENABLE: Pin = ('B', 12);
const CAN_PINS: [Pin; 2] = [('B', 8), ('B', 9)];
const CHOPPER_PIN: Pin = ('B', 11);
/// Pins of the converters' channels.
const ANALOG: [(u32, Pin); 10] = [
    (0, ('A', 0)),
    (1, ('A', 1)),
    (10, ('C', 0)),
    (11, ('C', 1)),
    (12, ('C', 2)),
    (13, ('C', 3)),
    (6, ('A', 6)),
    (15, ('C', 5)),
    (4, ('A', 4)),
    (5, ('A', 5)),
];

/// Contact of the emergency stop, closed while the leg may move.
pub const STOP: Pin = ('C', 4);
pub const ENABLING: Pin = ('A', 2);
pub const START: Pin = ('A', 3);
pub const STATUS_LIGHT: Pin = ('B', 2);
/// Fault line of both gate drivers, active low.
pub const GATE_FAULT: Pin = ('D', 2);

/// Conversion of an axis' shunts, for measurements of the sampling instant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sampling {
    pub axis: usize,
    pub trigger: Ticks,
    pub hold: Ticks,
    /// Middle of the lower zero vector: the counter's last zero.
    pub middle: Ticks,
    /// Edges of the other bridge in the time before the hold in which an amplifier settles.
    pub edges: u32,
    /// Amplitude of the other bridge's voltage, V.
    pub other_v: f64,
}

/// Amplitude of three duties' vector, whose common part makes no voltage.
fn amplitude([a, b, c]: [f64; 3]) -> f64 {
    let [alpha, beta] = [(2.0 * a - b - c) / 3.0, (b - c) / 3.0_f64.sqrt()];
    alpha.hypot(beta)
}

/// Triggers that do not reach the converters: in a row, then as many that do, and so on.
#[derive(Clone, Copy, Debug, Default)]
pub struct LostTriggers {
    lost: u32,
    come: u32,
    left: u32,
    phase: u32,
}

impl LostTriggers {
    /// Loses `lost` triggers in a row, lets `come` pass, and so on, until `left` were lost.
    pub const fn new(lost: u32, come: u32, left: u32) -> Self {
        Self { lost, come, left, phase: 0 }
    }

    /// Whether this trigger is lost.
    fn loses(&mut self) -> bool {
        if self.left == 0 {
            return false;
        }
        let is_lost = self.phase < self.lost;
        self.phase = (self.phase + 1) % (self.lost + self.come).max(1);
        self.left -= u32::from(is_lost);
        is_lost
    }
}

/// The chip and the board, except the processor core.
#[derive(Clone, Debug)]
pub struct Chip {
    pub now: Ticks,
    /// Instant of the next event.
    pub due: Ticks,
    dues: [Ticks; SOURCES],
    pub nvic: Nvic,
    pub system: System,
    pub findings: Findings,
    pub load: Load,
    pub rcc: Rcc,
    pub flash: Flash,
    pub gpio: Gpio,
    pub exti: Exti,
    /// Timers, in the order of [`NAMES`].
    pub timers: [Timer; 6],
    outputs: [Outputs; JOINTS],
    pub adcs: [Adc; adc::COUNT],
    common: adc::Common,
    spi: Spi,
    /// Gate drivers.
    pub drivers: Drivers,
    /// Absolute encoders of each axis, by select line.
    pub encoders: [[Encoder; 2]; JOINTS],
    pub can: Can,
    pub iwdg: Iwdg,
    pub debug: Debug,
    pub plant: Plant,
    /// Event flag of WFE.
    pub event: bool,
    pub reset_request: Option<ResetReason>,
    /// Last conversions of both axes' shunts, if recorded.
    pub samplings: Option<Vec<Sampling>>,
    triggers: [Ticks; JOINTS],
    /// Triggers of both axes that the converters miss.
    pub lost_triggers: [LostTriggers; JOINTS],
    /// Converters that no longer convert.
    pub silent_adc: [bool; adc::COUNT],
    /// Instant of the first hard fault since this was cleared.
    pub hard_fault: Option<Ticks>,
    /// Channels reported because their pins have another mode.
    reported: u32,
}

impl Chip {
    /// A chip after power-on, on a board with this plant.
    pub fn new(plant: Plant, seed: u64) -> Self {
        let kinds = [Kind::Advanced, Kind::Advanced, Kind::Wide, Kind::General, Kind::General, Kind::Wide];
        let mut noise = Xoshiro256PlusPlus::seed_from_u64(seed);
        noise.jump();
        let mut chip = Self {
            now: 0,
            due: 0,
            dues: [NEVER; SOURCES],
            nvic: Nvic::new(),
            system: System::default(),
            findings: Findings::default(),
            load: Load::new(),
            rcc: Rcc::new(),
            flash: Flash::new(noise),
            gpio: Gpio::new(),
            exti: Exti::default(),
            timers: core::array::from_fn(|index| Timer::new(NAMES[index], kinds[index])),
            outputs: Default::default(),
            adcs: Default::default(),
            common: adc::Common::default(),
            spi: Spi::default(),
            drivers: Drivers::default(),
            encoders: [[Encoder::default(); 2]; JOINTS],
            can: Can::new(),
            iwdg: Iwdg::new(),
            debug: Debug::new(),
            plant,
            event: false,
            reset_request: None,
            samplings: None,
            triggers: [0; JOINTS],
            lost_triggers: [LostTriggers::default(); JOINTS],
            silent_adc: [false; adc::COUNT],
            hard_fault: None,
            reported: 0,
        };
        for (pin, level) in [(STOP, true), (ENABLING, false), (START, false), (GATE_FAULT, true)] {
            chip.gpio.apply(pin, level);
        }
        (0..SOURCES).for_each(|source| chip.update(source));
        chip
    }

    /// Resets the chip; memory, flash cells and plant stay.
    pub fn reset(&mut self, reason: ResetReason) {
        self.advance_plant();
        self.rcc.reset(reason);
        self.flash.reset();
        self.gpio.reset();
        self.timers.iter_mut().for_each(Timer::reset);
        self.adcs = Default::default();
        (self.common, self.spi) = (adc::Common::default(), Spi::default());
        (self.exti, self.system, self.nvic) = (Exti::default(), System::default(), Nvic::new());
        self.can.reset();
        self.iwdg.reset();
        self.load.reset(self.now);
        (self.event, self.reset_request) = (false, None);
        self.follow_pins();
        self.follow_clocks();
        self.refresh_plant();
        (0..SOURCES).for_each(|source| self.update(source));
    }

    /// Sets a level that the board applies to a pin.
    pub fn set_pin(&mut self, pin: Pin, level: bool) {
        if let Some(level) = self.gpio.apply(pin, level) {
            self.exti.edge(pin.0 as u32 - 'A' as u32, pin.1, level);
            self.update_exti();
        }
    }

    pub fn stop_crystal(&mut self) {
        self.advance_plant();
        if self.rcc.stop_crystal() {
            self.nvic.pend(NMI, self.now);
            self.timers.iter_mut().for_each(Timer::break_now);
        }
        self.follow_clocks();
        self.refresh_plant();
    }

    // Events.

    /// Processes all events up to the present.
    pub fn advance(&mut self) {
        let now = self.now;
        while self.due <= now {
            let mut source = 0;
            for (index, due) in self.dues.iter().enumerate() {
                if *due < self.dues[source] {
                    source = index;
                }
            }
            self.now = self.dues[source];
            self.pass(source);
            self.update(source);
        }
        self.now = now;
    }

    fn pass(&mut self, source: usize) {
        match source {
            PLANT => {
                let edge = with_bridges!(self, |plant, bridges| plant.pass(self.now, bridges));
                if let Some((axis, level)) = edge {
                    self.set_pin(INDEX_PINS[axis], level);
                }
            }
            CAN => {
                self.can.pass(self.now);
                self.update_can();
            }
            WATCHDOG => {
                self.reset_request = Some(ResetReason::Watchdog);
                self.iwdg.reset();
            }
            ADCS..CAN => self.pass_adc(source - ADCS),
            timer => self.pass_timer(timer),
        }
    }

    fn pass_timer(&mut self, index: usize) {
        let is_bridge = index < JOINTS;
        if is_bridge {
            self.advance_plant();
        }
        let (mut trigger, mut updated) = (false, false);
        self.timers[index].pass(self.now, |event| match event {
            Event::Trigger => trigger = true,
            Event::End(taken_over) => updated |= taken_over,
            Event::Match => {}
        });
        if is_bridge && updated {
            self.refresh_plant();
        }
        if index == 2 && updated {
            self.follow_chopper();
        }
        if trigger && is_bridge && !self.lost_triggers[index].loses() {
            self.triggers[index] = self.now;
            let source = [Trigger::First, Trigger::Second][index];
            let clock = self.adc_clock();
            for number in 0..adc::COUNT {
                if self.silent_adc[number] {
                    continue;
                }
                let access = &mut Access { now: self.now, findings: &mut self.findings };
                self.adcs[number].trigger(number, source, clock, access);
                self.update(ADCS + number);
            }
        }
        self.update_timer_lines(index);
    }

    fn pass_adc(&mut self, number: usize) {
        let clock = self.adc_clock();
        match self.adcs[number].pass(clock) {
            Some(adc::Event::Hold(channel)) => {
                let code = self.held(channel);
                self.adcs[number].hold(code);
                if number == 2 {
                    self.record(channel);
                }
            }
            Some(adc::Event::Result) => self.update_adc(),
            None => {}
        }
    }

    /// Code of a channel's input now.
    fn held(&mut self, channel: u32) -> u16 {
        let pin = ANALOG.iter().find(|(known, _)| *known == channel).map(|(_, pin)| *pin);
        if pin.is_none_or(|pin| self.gpio.mode(pin) != Mode::Analog) && self.reported >> channel & 1 == 0 {
            self.reported |= 1 << channel;
            self.findings.add("channel converted whose pin is not analog", format!("ADC channel {channel}"));
        }
        if matches!(channel, 6 | 10..=13) {
            self.advance_plant();
        }
        self.plant.code(channel, self.now, [self.drivers.gain(0), self.drivers.gain(1)])
    }

    /// Records the sampling instant of an axis, whose shunt C is held by the third converter.
    fn record(&mut self, channel: u32) {
        let Some(samplings) = &mut self.samplings else { return };
        let axis = usize::from(channel == 12);
        let timer = &self.timers[axis];
        let middle = timer.next(0, self.now) - timer.period_length();
        // The time in which an amplifier settles to 1 %: 1.2 us.
        let window = crate::time::ticks(1.2e-6);
        let (edges, _) = self.plant.axes[1 - axis].edges_within(window, self.now);
        let duties = [0, 1, 2].map(|channel| self.timers[1 - axis].duty(channel));
        let is_on = self.plant.axes[1 - axis].is_armed;
        let other_v = if is_on { self.plant.supply.voltage() * amplitude(duties) } else { 0.0 };
        samplings.push(Sampling {
            axis,
            trigger: self.triggers[axis],
            hold: self.now,
            middle,
            edges,
            other_v,
        });
    }

    fn adc_clock(&self) -> Ticks {
        self.common.clock(self.rcc.bus_hz(2))
    }

    /// Instant of a source's next event, and the earliest of all.
    fn update(&mut self, source: usize) {
        self.dues[source] = match source {
            PLANT => self.plant.due(),
            CAN => self.can.due(),
            WATCHDOG => self.iwdg.due(),
            ADCS..CAN => self.adcs[source - ADCS].due(),
            timer => self.timers[timer - TIMERS].due(),
        };
        self.due = self.dues.iter().copied().min().unwrap_or(NEVER);
    }

    fn advance_plant(&mut self) {
        with_bridges!(self, |plant, bridges| plant.advance(self.now, bridges));
    }

    fn refresh_plant(&mut self) {
        with_bridges!(self, |plant, bridges| plant.refresh(self.now, bridges));
    }

    // Interrupt lines.

    fn update_exti(&mut self) {
        for (interrupt, level) in self.exti.lines() {
            self.nvic.set_line(interrupt, level, self.now);
        }
    }

    fn update_adc(&mut self) {
        let level = self.adcs.iter().any(Adc::requests);
        self.nvic.set_line(ADC_INTERRUPT, level, self.now);
    }

    fn update_can(&mut self) {
        for (interrupt, level) in CAN_INTERRUPTS.into_iter().zip(self.can.requests()) {
            self.nvic.set_line(interrupt, level, self.now);
        }
    }

    fn update_timer_lines(&mut self, index: usize) {
        let ([update, compare], [updated, matched]) =
            (TIMER_INTERRUPTS[index], self.timers[index].requests());
        if update == compare {
            return self.nvic.set_line(update, updated || matched, self.now);
        }
        self.nvic.set_line(update, updated, self.now);
        self.nvic.set_line(compare, matched, self.now);
    }

    // Consequences of register writes.

    fn follow_clocks(&mut self) {
        for (index, timer) in self.timers.iter_mut().enumerate() {
            timer.set_clock(self.rcc.timer_cycle(if index < JOINTS { 2 } else { 1 }), self.now);
        }
        self.can.bus_hz = self.rcc.bus_hz(1);
        self.debug.set_cycle(self.rcc.cycle(), self.now);
        (0..SOURCES).for_each(|source| self.update(source));
    }

    fn follow_pins(&mut self) {
        for (outputs, (pins, function)) in self.outputs.iter_mut().zip(BRIDGE_PINS) {
            outputs.connected =
                pins.map(|pins| pins.map(|pin| self.gpio.mode(pin) == Mode::Alternate(function)));
        }
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        self.drivers.set_enabled(self.gpio.is_driven_high(GATE_ENABLE), access);
        self.plant.gates = self.drivers.drive();
    }

    fn is_selected(&self, pin: Pin) -> bool {
        self.gpio.mode(pin) == Mode::Output && !self.gpio.level(pin)
    }

    fn selected(&self) -> [bool; 2] {
        SELECTS.map(|pin| self.is_selected(pin))
    }

    /// Axis and line of the selected encoder.
    fn selected_encoder(&self) -> Option<(usize, usize)> {
        LINES.into_iter().find(|(axis, line)| {
            self.plant.encoder_at(*axis, *line).is_some() && self.is_selected(ENCODER_SELECTS[*axis][*line])
        })
    }

    /// Duty of the brake resistor from TIM2: high side on channel 4, low side on channel 3.
    fn follow_chopper(&mut self) {
        let timer = &self.timers[2];
        let connected = self.gpio.mode(CHOPPER_PIN) == Mode::Alternate(1);
        let on = connected && timer.runs() && timer.outputs(3) & 1 == 1;
        let (low, high) = (timer.compare(2), timer.compare(3));
        self.plant.brake = if on { timer.duty(3) } else { 0.0 };
        if on && timer.outputs(2) & 1 == 1 && low > high {
            self.findings.add("both sides of the brake resistor's half bridge on", "TIM2_CCR3");
        }
    }

    /// Position of the encoder at a timer's inputs.
    fn encoder(&mut self, index: usize) -> u16 {
        let Some(axis) = index.checked_sub(3).filter(|axis| *axis < JOINTS) else { return 0 };
        let connected = ENCODER_PINS[axis].iter().all(|pin| self.gpio.mode(*pin) == Mode::Alternate(2));
        if connected { self.plant.encoder(axis, self.now) } else { 0 }
    }

    // Address map.

    /// Clock enable of a peripheral: register's offset and bits. `None` for those that need none.
    fn gate(address: u32) -> Option<(u32, u32)> {
        Some(match address & !0x3FF {
            0x4000_0000 => (0x40, 1),
            0x4000_0400 => (0x40, 1 << 1),
            0x4000_0800 => (0x40, 1 << 2),
            0x4000_0C00 => (0x40, 1 << 3),
            0x4000_3C00 => (0x40, 1 << 15),
            0x4000_6400 => (0x40, 1 << 25),
            0x4000_7000 => (0x40, 1 << 28),
            0x4001_0000 => (0x44, 1),
            0x4001_0400 => (0x44, 1 << 1),
            // One of the three converters' clocks; the common registers need any.
            0x4001_2000 => (0x44, if address & 0x300 == 0x300 { 0x700 } else { 0x100 << (address >> 8 & 3) }),
            0x4001_3800 => (0x44, 1 << 14),
            base @ 0x4002_0000..0x4002_2400 => (0x30, 1 << ((base - 0x4002_0000) / 0x400)),
            _ => return None,
        })
    }

    fn is_clocked(&mut self, address: u32) -> bool {
        let clocked = Self::gate(address).is_none_or(|(register, bits)| self.rcc.is_clocked(register, bits));
        if !clocked {
            self.findings.add("register accessed without its clock", format!("{address:#010x}"));
        }
        clocked
    }

    /// Reads a peripheral register.
    pub fn read(&mut self, address: u32) -> u32 {
        if !self.is_clocked(address) {
            return 0;
        }
        if let Some(index) = TIMER_BASES.iter().position(|base| *base == address & !0x3FF) {
            let position = self.encoder(index);
            let access = &mut Access { now: self.now, findings: &mut self.findings };
            return self.timers[index].read(address & 0x3FF, position, access);
        }
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        let offset = address & 0x3FF;
        match address & !0x3FF {
            0x4000_3000 => self.iwdg.read(offset, access),
            0x4000_3C00 => self.spi.read(offset, access),
            0x4000_6400 => self.can.read(offset, access),
            0x4000_7000 => self.rcc.read_power(offset, access),
            0x4001_2000 if offset >= 0x300 => self.common.read(offset, &self.adcs, access),
            0x4001_2000 => {
                let value =
                    self.adcs[(offset >> 8) as usize].read((offset >> 8) as usize, offset & 0xFF, access);
                if offset & 0xFF == 0x4C {
                    self.update_adc();
                }
                value
            }
            0x4001_3800 => self.exti.read_selection(offset, access),
            0x4001_3C00 => self.exti.read(offset, access),
            0x4002_0000..0x4002_2400 => self.gpio.read(address - 0x4002_0000, access),
            0x4002_3800 => self.rcc.read(offset, access),
            0x4002_3C00 => self.flash.read(offset, access),
            _ => {
                access.refuse(NOT_MODELLED, format!("{address:#010x}"));
                0
            }
        }
    }

    /// Writes a peripheral register.
    pub fn write(&mut self, address: u32, value: u32, size: usize) {
        if !self.is_clocked(address) {
            return;
        }
        if let Some(index) = TIMER_BASES.iter().position(|base| *base == address & !0x3FF) {
            return self.write_timer(index, address & 0x3FF, value);
        }
        let offset = address & 0x3FF;
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        match address & !0x3FF {
            0x4000_3000 => {
                self.iwdg.write(offset, value, access);
                self.update(WATCHDOG);
            }
            0x4000_3C00 => self.write_spi(offset, value, size),
            0x4000_6400 => {
                self.can.write(offset, value, access);
                if CAN_PINS.iter().any(|pin| self.gpio.mode(*pin) != Mode::Alternate(9)) {
                    self.findings.add("controller used while its pins are not connected", "CAN1");
                }
                self.update_can();
                self.update(CAN);
            }
            0x4000_7000 => self.rcc.write_power(offset, value, access),
            0x4001_2000 => self.write_adc(offset, value),
            0x4001_3800 => self.exti.write_selection(offset, value, access),
            0x4001_3C00 => {
                self.exti.write(offset, value, access);
                self.update_exti();
            }
            0x4002_0000..0x4002_2400 => self.write_gpio(address - 0x4002_0000, value),
            0x4002_3800 => self.write_rcc(offset, value),
            0x4002_3C00 => self.flash.write(offset, value, access),
            _ => access.refuse(NOT_MODELLED, format!("{address:#010x}")),
        }
    }

    fn write_timer(&mut self, index: usize, offset: u32, value: u32) {
        let position = self.encoder(index);
        if index < JOINTS {
            self.advance_plant();
        }
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        let enabled = self.timers[index].write(offset, value, position, access);
        if enabled && index == 0 && self.timers[1].is_started_by_first() {
            self.timers[1].start(self.now);
            self.update(1);
        }
        if index < JOINTS {
            self.refresh_plant();
        }
        if index == 2 {
            self.follow_chopper();
        }
        self.update_timer_lines(index);
        self.update(index);
    }

    fn write_adc(&mut self, offset: u32, value: u32) {
        let (bus_hz, clock) = (self.rcc.bus_hz(2), self.adc_clock());
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        if offset >= 0x300 {
            return self.common.write(offset, value, bus_hz, access);
        }
        let number = (offset >> 8) as usize;
        self.adcs[number].write(number, offset & 0xFF, value, clock, access);
        self.update_adc();
        self.update(ADCS + number);
    }

    fn write_gpio(&mut self, offset: u32, value: u32) {
        let (before, encoder) = (self.selected(), self.selected_encoder());
        let changes_outputs = offset & 0x3FF != 0x18 || value & 0x1000_1000 != 0;
        if changes_outputs {
            self.advance_plant();
        }
        self.gpio.write(offset, value, &mut Access { now: self.now, findings: &mut self.findings });
        if before.contains(&true) && !self.selected().contains(&true) {
            if self.spi.is_busy(self.now) {
                self.findings.add("gate driver deselected while a frame is on the wire", "GPIOC_BSRR");
            }
            self.drivers.released = self.now;
        }
        if let Some((axis, line)) = encoder.filter(|_| self.selected_encoder().is_none()) {
            if self.spi.is_busy(self.now) {
                self.findings.add("encoder deselected while a frame is on the wire", "GPIO_BSRR");
            }
            self.encoders[axis][line].released = self.now;
        }
        if changes_outputs {
            self.follow_pins();
            self.follow_chopper();
            self.refresh_plant();
        }
    }

    fn write_rcc(&mut self, offset: u32, value: u32) {
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        if self.rcc.write(offset, value, access) {
            self.advance_plant();
            let access = &mut Access { now: self.now, findings: &mut self.findings };
            self.flash.check_wait_states(self.rcc.processor_hz(), access);
            self.follow_clocks();
        }
        match offset {
            0x20 => {
                for (index, bit) in [(2, 0), (3, 1), (4, 2), (5, 3)] {
                    if value >> bit & 1 == 1 {
                        self.timers[index].reset();
                    }
                }
                if value >> 15 & 1 == 1 {
                    self.spi = Spi::default();
                }
                if value >> 25 & 1 == 1 {
                    self.can.reset();
                }
            }
            0x24 => {
                for index in (0..JOINTS).filter(|index| value >> index & 1 == 1) {
                    self.advance_plant();
                    self.timers[index].reset();
                    self.refresh_plant();
                }
            }
            _ => {}
        }
    }

    fn write_spi(&mut self, offset: u32, value: u32, size: usize) {
        let bus_hz = self.rcc.bus_hz(1);
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        let Some(sent) = self.spi.write(offset, value, size, bus_hz, access) else { return };
        if SPI_PINS.iter().any(|pin| self.gpio.mode(*pin) != Mode::Alternate(6)) {
            self.findings.add("frame sent while the pins are not connected", "SPI3_DR");
            return self.spi.answer(u16::MAX);
        }
        let encoders = LINES.into_iter().filter(|(axis, line)| self.plant.encoder_at(*axis, *line).is_some());
        let mut selects = encoders.map(|(axis, line)| ENCODER_SELECTS[axis][line]).chain(SELECTS);
        if selects.any(|pin| self.gpio.is_floating(pin)) {
            self.findings.add("frame sent while a device's select line floats", "SPI3_DR");
        }
        let selected = self.selected();
        let encoder = self.selected_encoder().filter(|_| selected == [false; 2]);
        let angle = encoder.and_then(|(axis, line)| self.plant.encoder_steps(axis, line, self.now));
        let access = &mut Access { now: self.now, findings: &mut self.findings };
        let answer = match (encoder, angle) {
            (Some((axis, line)), Some(angle)) => self.encoders[axis][line].frame(&sent, angle, access),
            _ => self.drivers.frame(&sent, selected, access),
        };
        self.spi.answer(answer);
    }

    /// Sets the supply of the processor, V.
    pub fn set_supply(&mut self, volts: f64) {
        (self.rcc.supply_v, self.flash.supply_v) = (volts, volts);
    }

    pub fn load_flash(&mut self, offset: u32, size: usize) -> u32 {
        self.flash.load(offset, size, &mut Access { now: self.now, findings: &mut self.findings })
    }

    pub fn program_flash(&mut self, offset: u32, size: usize, value: u32) {
        self.flash.store(offset, size, value, &mut Access { now: self.now, findings: &mut self.findings });
    }

    /// Conversions that were overwritten before they were read.
    pub fn lost_conversions(&self) -> u64 {
        self.adcs.iter().flat_map(|adc| adc.lost).sum()
    }

    /// Adds a frame that the partner on the bus sends.
    pub fn send_frame(&mut self, frame: scarab::bus::Frame) {
        self.can.partner.push_back(frame);
        self.can.start(self.now);
        self.update(CAN);
    }

    /// Recomputes all due instants after a part was changed from outside.
    pub fn reschedule(&mut self) {
        (0..SOURCES).for_each(|source| self.update(source));
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn triggers_are_lost_in_their_pattern_and_then_come() {
        let pattern = |mut lost: LostTriggers| [(); 8].map(|()| u8::from(lost.loses()));
        assert_eq!(pattern(LostTriggers::default()), [0; 8]);
        assert_eq!(pattern(LostTriggers::new(3, 0, 3)), [1, 1, 1, 0, 0, 0, 0, 0]);
        assert_eq!(pattern(LostTriggers::new(1, 1, 3)), [1, 0, 1, 0, 1, 0, 0, 0]);
    }

    #[test]
    fn a_common_part_of_duties_is_no_voltage() {
        assert!(amplitude([0.7; 3]) < 1e-12);
        for angle in [0.0_f64, 1.0, 4.0] {
            let duties =
                [0.0, 1.0, 2.0].map(|phase| 0.5 + 0.3 * (angle - phase * 2.094_395_102_393_195_5).cos());
            assert!((amplitude(duties) - 0.3).abs() < 1e-12);
        }
    }
}
