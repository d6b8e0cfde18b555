//! Counters of TIM1 to TIM5 and TIM8 (RM0090 17, 18): up-counting, centre-aligned and encoder mode.
//!
//! A running counter is a function of time, so it costs nothing until an event is due: an end of the counter
//! (update), a compare match with its interrupt enabled, or an edge of the reference that is the trigger
//! output. The phase is the number of counts within a period:
//!
//! ```text
//! up                phase 0 .. ARR         counter = phase                 update where the phase returns to
//! 0 centre-aligned    phase 0 .. 2 ARR - 1   counter = phase, then 2 ARR - phase; ends at 0 and ARR
//! ```
//!
//! At each end the repetition counter decides whether the update happens: buffered values are taken over and
//! the update flag rises. Only PWM modes 1 and 2 and the fixed levels of a reference are modelled.

use crate::findings::{Access, NO_REGISTER, NOT_MODELLED};
use crate::time::{NEVER, Ticks};

/// Timers of the model, in the order of their numbers.
pub const NAMES: [&str; 6] = ["TIM1", "TIM8", "TIM2", "TIM3", "TIM4", "TIM5"];

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const DIER: u32 = 0x0C;
const SR: u32 = 0x10;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCMR2: u32 = 0x1C;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const PSC: u32 = 0x28;
const ARR: u32 = 0x2C;
const RCR: u32 = 0x30;
const BDTR: u32 = 0x44;
/// Main output enable.
pub const MOE: u32 = 1 << 15;
const UPDATE: u32 = 1;

/// Kind of a timer.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Kind {
    /// Advanced: complementary outputs and repetition counter.
    Advanced,
    /// General purpose, 16 bits.
    #[default]
    General,
    /// General purpose, 32 bits.
    Wide,
}

/// Values that act, apart from the buffered ones in the registers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
struct Acting {
    prescaler: u32,
    top: u32,
    compare: [u32; 4],
}

/// Event of a timer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Event {
    /// An end of the counter; whether values were taken over.
    End(bool),
    /// Rising edge of the trigger output.
    Trigger,
    /// A compare match.
    Match,
}

/// State of a running counter: start and phase of the present count.
#[derive(Clone, Copy, Debug)]
pub struct CounterState {
    begun: Ticks,
    length: Ticks,
    period: u64,
    phase: u64,
}

impl CounterState {
    /// First instant after the present count at which the phase becomes this one.
    pub fn next(&self, phase: u64) -> Ticks {
        let left = if phase > self.phase { phase - self.phase } else { phase + self.period - self.phase };
        self.begun + left * self.length
    }
}

/// State of one timer.
#[derive(Clone, Debug, Default)]
pub struct Timer {
    /// Name in the reference manual.
    pub name: &'static str,
    kind: Kind,
    cr1: u32,
    cr2: u32,
    smcr: u32,
    dier: u32,
    sr: u32,
    ccmr: [u32; 2],
    ccer: u32,
    psc: u32,
    arr: u32,
    rcr: u32,
    ccr: [u32; 4],
    bdtr: u32,
    acting: Acting,
    repetitions: u32,
    /// Length of a clock of the timer.
    clock: Ticks,
    /// Phase at an instant.
    phase: u64,
    origin: Ticks,
    /// Elapsed part of a count when the counter was stopped.
    rest: Ticks,
    /// Instants up to which ends and compare flags were processed.
    processed: Ticks,
    matched: Ticks,
    /// Encoder position at which the counter was set.
    base: u16,
}

impl Timer {
    /// A timer after a reset.
    pub fn new(name: &'static str, kind: Kind) -> Self {
        let top = if kind == Kind::Wide { u32::MAX } else { 0xFFFF };
        let acting = Acting { top, ..Acting::default() };
        Self { name, kind, arr: top, acting, clock: 21, ..Self::default() }
    }

    /// Returns to the state after a reset; the clock stays.
    pub fn reset(&mut self) {
        *self = Self { clock: self.clock, ..Self::new(self.name, self.kind) };
    }

    /// Changes the length of a clock.
    pub fn set_clock(&mut self, clock: Ticks, now: Ticks) {
        if clock != self.clock {
            self.rebase(now);
            self.clock = clock;
            self.rest = 0;
            self.origin = now;
            (self.processed, self.matched) = (self.processed.max(now), self.matched.max(now));
        }
    }

    pub fn runs(&self) -> bool {
        self.cr1 & 1 == 1
    }

    fn is_centred(&self) -> bool {
        self.cr1 & 0x60 != 0
    }

    /// Whether the counter follows an encoder.
    pub fn follows_encoder(&self) -> bool {
        (1..=3).contains(&(self.smcr & 7))
    }

    /// Length of a count.
    pub fn count_length(&self) -> Ticks {
        self.clock * (1 + u64::from(self.acting.prescaler))
    }

    fn period(&self) -> u64 {
        let top = u64::from(self.acting.top);
        if self.is_centred() { (2 * top).max(1) } else { top + 1 }
    }

    /// Length of a period.
    pub fn period_length(&self) -> Ticks {
        self.period() * self.count_length()
    }

    /// Value at which the counter turns around or starts again.
    pub fn top(&self) -> u64 {
        self.acting.top.into()
    }

    /// Phase at an instant, counts.
    pub fn phase(&self, now: Ticks) -> u64 {
        if !self.runs() || self.follows_encoder() {
            return self.phase;
        }
        (self.phase + (now - self.origin) / self.count_length()) % self.period()
    }

    /// First instant after another at which the phase becomes this one.
    pub fn next(&self, phase: u64, after: Ticks) -> Ticks {
        self.counter_state(after).next(phase)
    }

    /// State of a running counter at an instant, from which several instants are computed.
    pub fn counter_state(&self, at: Ticks) -> CounterState {
        let (length, period) = (self.count_length(), self.period());
        let passed = (at - self.origin) / length;
        let phase = (self.phase + passed) % period;
        CounterState { begun: self.origin + passed * length, length, period, phase }
    }

    fn counter_of(&self, phase: u64) -> u32 {
        let top = self.top();
        (if self.is_centred() && phase > top { 2 * top - phase } else { phase }) as u32
    }

    /// Takes the present phase as the new origin.
    fn rebase(&mut self, now: Ticks) {
        if self.runs() && !self.follows_encoder() {
            let length = self.count_length();
            let passed = (now - self.origin) / length;
            self.phase = (self.phase + passed) % self.period();
            self.origin += passed * length;
            self.rest = now - self.origin;
            (self.processed, self.matched) = (self.processed.max(self.origin), self.matched.max(self.origin));
        }
    }

    fn set_phase(&mut self, phase: u64, now: Ticks) {
        (self.phase, self.origin, self.rest) = (phase, now, 0);
        (self.processed, self.matched) = (now, now);
    }

    /// Mode of a channel's reference (0 to 3), from its mode register.
    fn mode(&self, channel: usize) -> u32 {
        self.ccmr[channel / 2] >> (4 + 8 * (channel % 2)) & 7
    }

    /// Phases at which a channel's reference rises and falls; `None` where it does not change.
    pub fn edges(&self, channel: usize) -> Option<[u64; 2]> {
        let (compare, top) = (u64::from(self.acting.compare[channel]), self.top());
        if compare == 0 || compare >= top + u64::from(!self.is_centred()) {
            return None;
        }
        let end = if self.is_centred() { 2 * top - compare } else { 0 };
        match self.mode(channel) {
            6 if self.is_centred() => Some([end, compare]),
            6 => Some([0, compare]),
            7 => Some([compare, end]),
            _ => None,
        }
    }

    /// Levels of the references of channels 1 to 3 at an instant.
    pub fn references(&self, now: Ticks) -> [bool; 3] {
        let phase = self.phase(now);
        let counter = u64::from(self.counter_of(phase));
        let falling = self.is_centred() && phase >= self.top();
        core::array::from_fn(|channel| {
            let compare = u64::from(self.acting.compare[channel]);
            // RM0090 17.4.7: in mode 1 active below the value while rising, and up to it while falling.
            let below = if falling { counter <= compare } else { counter < compare };
            match self.mode(channel) {
                5 => true,
                6 => below,
                7 => !below,
                _ => false,
            }
        })
    }

    /// Enable and polarity bits of a channel's outputs.
    pub fn outputs(&self, channel: usize) -> u32 {
        self.ccer >> (4 * channel) & 0xF
    }

    /// Register with dead time and main output.
    pub fn main_output(&self) -> u32 {
        self.bdtr
    }

    /// Idle levels of a channel's two outputs.
    pub fn idle_levels(&self, channel: usize) -> [bool; 2] {
        [8, 9].map(|bit| self.cr2 >> (bit + 2 * channel) & 1 == 1)
    }

    /// Share of a period in which a channel's reference is active; only PWM modes have one.
    pub fn duty(&self, channel: usize) -> f64 {
        let counts = self.acting.top as f64 + f64::from(u8::from(!self.is_centred()));
        let below = (f64::from(self.acting.compare[channel]) / counts).clamp(0.0, 1.0);
        match self.mode(channel) {
            5 => 1.0,
            6 => below,
            7 => 1.0 - below,
            _ => 0.0,
        }
    }

    /// Acting compare value of a channel.
    pub fn compare(&self, channel: usize) -> u32 {
        self.acting.compare[channel]
    }

    /// Length of the dead-time generator's clock.
    pub fn dead_time_clock(&self) -> Ticks {
        self.clock << (self.cr1 >> 8 & 3).min(2)
    }

    /// Clears the main output at once, as a break does.
    pub fn break_now(&mut self) {
        if self.bdtr & 1 << 12 != 0 {
            self.bdtr &= !MOE;
            self.sr |= 1 << 7;
        }
    }

    /// Selected trigger output (MMS).
    fn master_mode(&self) -> u32 {
        self.cr2 >> 4 & 7
    }

    /// Phase at which the trigger output rises, if a reference is selected.
    fn trigger_phase(&self) -> Option<u64> {
        let channel = self.master_mode().checked_sub(4)? as usize;
        self.edges(channel).map(|[rise, _]| rise)
    }

    fn has_buffered(&self) -> bool {
        self.acting.compare != self.ccr || self.acting.top != self.arr || self.acting.prescaler != self.psc
    }

    /// Instant of the next event.
    pub fn due(&self) -> Ticks {
        if !self.runs() || self.follows_encoder() {
            return NEVER;
        }
        let mut due = NEVER;
        let counter = self.counter_state(self.processed);
        if self.kind == Kind::Advanced || self.dier & 1 != 0 || self.has_buffered() || !self.is_centred() {
            due = self.next_end(&counter);
        }
        if let Some(phase) = self.trigger_phase() {
            due = due.min(counter.next(phase));
        }
        for channel in (0..4).filter(|channel| self.dier >> (channel + 1) & 1 == 1) {
            due = due.min(self.next_match(channel, self.processed));
        }
        due
    }

    fn next_end(&self, counter: &CounterState) -> Ticks {
        let zero = counter.next(0);
        if self.is_centred() { zero.min(counter.next(self.top())) } else { zero }
    }

    /// Next match of a channel; both directions count.
    fn next_match(&self, channel: usize, after: Ticks) -> Ticks {
        let (compare, top) = (u64::from(self.acting.compare[channel]), self.top());
        if compare > top {
            return NEVER;
        }
        let rising = self.next(compare, after);
        if self.is_centred() && compare > 0 {
            rising.min(self.next(2 * top - compare, after))
        } else {
            rising
        }
    }

    /// Processes the events of one instant, at which one is due.
    pub fn pass(&mut self, now: Ticks, mut report: impl FnMut(Event)) {
        let counter = self.counter_state(self.processed);
        let trigger = self.trigger_phase().is_some_and(|phase| counter.next(phase) == now);
        let matches = (0..4).any(|channel| {
            self.dier >> (channel + 1) & 1 == 1 && self.next_match(channel, self.processed) == now
        });
        let ends = self.next_end(&counter) == now;
        self.processed = now;
        if matches {
            self.collect_matches(now);
            report(Event::Match);
        }
        if ends {
            let updates = self.repetitions == 0;
            if updates {
                self.update(now, true)
            } else {
                self.repetitions -= 1
            }
            report(Event::End(updates));
        }
        if trigger {
            report(Event::Trigger);
        }
    }

    /// Raises the flags of compare matches since they were last collected.
    fn collect_matches(&mut self, now: Ticks) {
        if !self.runs() || self.follows_encoder() {
            return;
        }
        for channel in 0..4 {
            if self.next_match(channel, self.matched) <= now {
                self.sr |= 2 << channel;
            }
        }
        self.matched = now;
    }

    /// Takes buffered values over.
    fn update(&mut self, now: Ticks, flag: bool) {
        self.collect_matches(now);
        self.repetitions = self.rcr;
        if self.cr1 & 2 != 0 {
            return;
        }
        if self.acting.top != self.arr || self.acting.prescaler != self.psc {
            self.rebase(now);
            (self.acting.top, self.acting.prescaler) = (self.arr, self.psc);
            self.phase %= self.period();
        }
        self.acting.compare = self.ccr;
        if flag {
            self.sr |= UPDATE;
        }
    }

    /// Whether the interrupt for updates, or the one for other events, is requested.
    pub fn requests(&self) -> [bool; 2] {
        let raised = self.sr & self.dier;
        [raised & 1 != 0, raised & 0x1E != 0]
    }

    /// Starts the counter, as its enable bit or a trigger does.
    pub fn start(&mut self, now: Ticks) {
        if !self.runs() {
            self.cr1 |= 1;
            (self.origin, self.processed, self.matched) = (now - self.rest, now, now);
        }
    }

    /// Whether an enable of TIM1 starts this timer (trigger mode with internal trigger 0).
    pub fn is_started_by_first(&self) -> bool {
        self.smcr & 0x77 == 6
    }

    /// Reads a register; `position` is that of the encoder at this timer.
    pub fn read(&mut self, offset: u32, position: u16, access: &mut Access<'_>) -> u32 {
        let now = access.now;
        match offset {
            CR1 => {
                let falling = u32::from(self.phase(now) >= self.top()) << 4;
                self.cr1 & !0x10 | if self.is_centred() { falling } else { self.cr1 & 0x10 }
            }
            CR2 => self.cr2,
            SMCR => self.smcr,
            DIER => self.dier,
            SR => {
                self.collect_matches(now);
                self.sr
            }
            EGR => 0,
            CCMR1 => self.ccmr[0],
            CCMR2 => self.ccmr[1],
            CCER => self.ccer,
            CNT if self.follows_encoder() => self.encoder_count(position),
            CNT => self.counter_of(self.phase(now)),
            PSC => self.psc,
            ARR => self.arr,
            RCR if self.kind == Kind::Advanced => self.rcr,
            0x34..=0x40 => self.ccr[(offset as usize - 0x34) / 4],
            BDTR if self.kind == Kind::Advanced => self.bdtr,
            0x48 | 0x4C => 0,
            _ => access.no_register(self.register(offset)),
        }
    }

    fn encoder_count(&self, position: u16) -> u32 {
        // Inputs that are not mapped to the channels do not count.
        if self.ccmr[0] & 0x0303 != 0x0101 || !self.runs() {
            return self.phase as u32;
        }
        let reversed = (self.ccer >> 1 ^ self.ccer >> 5) & 1 == 1;
        let moved = position.wrapping_sub(self.base);
        let moved = if reversed { moved.wrapping_neg() } else { moved };
        let moved = if self.smcr & 7 == 3 { moved } else { ((moved as i16) >> 1) as u16 };
        u32::from((self.phase as u16).wrapping_add(moved))
    }

    fn register(&self, offset: u32) -> String {
        format!("{}+{offset:#x}", self.name)
    }

    fn named(&self, register: &str) -> String {
        format!("{}_{register}", self.name)
    }

    /// Value without reserved bits; the masks are those of an advanced and of a general timer.
    fn implemented(&self, value: u32, masks: [u32; 2], register: &str, access: &mut Access<'_>) -> u32 {
        self.masked(value, masks[usize::from(self.kind != Kind::Advanced)], register, access)
    }

    /// Value without reserved bits; the name is composed only for a finding.
    fn masked(&self, value: u32, mask: u32, register: &str, access: &mut Access<'_>) -> u32 {
        if value & !mask == 0 { value } else { access.implemented(value, mask, &self.named(register)) }
    }

    fn counts(&self, value: u32, register: &str, access: &mut Access<'_>) -> u32 {
        let mask = if self.kind == Kind::Wide { u32::MAX } else { 0xFFFF };
        self.masked(value, mask, register, access)
    }

    /// Writes a register; `position` is that of the encoder at this timer. Returns whether the counter's
    /// enable bit rose while it is the trigger output.
    pub fn write(&mut self, offset: u32, value: u32, position: u16, access: &mut Access<'_>) -> bool {
        let now = access.now;
        // Earlier events were processed, or had no effect.
        self.processed = self.processed.max(now);
        match offset {
            CR1 => return self.write_control(value, position, access),
            CR2 => {
                let value = self.implemented(value, [0x7FFD, 0xF8], "CR2", access);
                if value >> 4 & 7 == 3 {
                    access.refuse(NOT_MODELLED, self.named("CR2"));
                }
                let idle = if self.lock() >= 1 { self.cr2 & 0x7F00 } else { value & 0x7F00 };
                self.cr2 = value & !0x7F00 | idle;
            }
            SMCR => self.write_slave(value, position, access),
            DIER => self.dier = self.implemented(value, [0x7FFF, 0x5F5F], "DIER", access),
            // Zeros clear, ones do nothing.
            SR => {
                self.collect_matches(now);
                self.sr &= value;
            }
            EGR => self.generate(value, access),
            CCMR1 | CCMR2 => self.write_mode((offset - CCMR1) as usize / 4, value, access),
            CCER => {
                let value = self.implemented(value, [0x3FFF, 0xBBBB], "CCER", access);
                let polarity = if self.kind == Kind::Advanced { 0x2AAA } else { 0 };
                if self.lock() >= 2 && (value ^ self.ccer) & polarity != 0 {
                    access.refuse("locked bits written", self.named("CCER"));
                }
                self.ccer = value;
            }
            CNT => self.write_counter(value, position, access),
            PSC => self.psc = self.masked(value, 0xFFFF, "PSC", access),
            ARR => {
                self.arr = self.counts(value, "ARR", access);
                if self.cr1 & 0x80 == 0 {
                    self.rebase(now);
                    self.acting.top = self.arr;
                    self.phase %= self.period();
                }
            }
            RCR if self.kind == Kind::Advanced => {
                self.rcr = self.masked(value, 0xFF, "RCR", access);
            }
            0x34..=0x40 => self.write_compare((offset as usize - 0x34) / 4, value, access),
            BDTR if self.kind == Kind::Advanced => self.write_break(value, access),
            0x48 | 0x4C => access.refuse(NOT_MODELLED, self.register(offset)),
            _ => access.refuse(NO_REGISTER, self.register(offset)),
        }
        false
    }

    fn lock(&self) -> u32 {
        self.bdtr >> 8 & 3
    }

    fn write_control(&mut self, value: u32, position: u16, access: &mut Access<'_>) -> bool {
        let now = access.now;
        let mut value = self.masked(value, 0x3FF, "CR1", access);
        if self.runs() && (value ^ self.cr1) & 0x60 != 0 && (self.cr1 & 0x60 == 0 || value & 0x60 == 0) {
            access.refuse("alignment changed while the counter runs", self.named("CR1"));
            value = value & !0x60 | self.cr1 & 0x60;
        }
        if value & 0x60 == 0 && value & 0x10 != 0 || value & 0x08 != 0 {
            access.refuse(NOT_MODELLED, self.named("CR1"));
        }
        let starts = value & 1 == 1 && !self.runs();
        if value & 1 == 0 && self.runs() {
            self.collect_matches(now);
            if self.follows_encoder() {
                self.phase = self.encoder_count(position).into();
            }
            self.rebase(now);
        }
        self.cr1 = value & !1 | self.cr1 & 1;
        if starts {
            self.base = position;
            self.start(now);
        } else if value & 1 == 0 {
            self.cr1 &= !1;
        }
        starts && self.master_mode() == 1
    }

    fn write_slave(&mut self, value: u32, position: u16, access: &mut Access<'_>) {
        let value = self.masked(value, 0xFFF7, "SMCR", access);
        if !matches!(value & 7, 0 | 1..=3 | 6) || value & 0xFF80 != 0 || value & 7 == 6 && value & 0x70 != 0 {
            access.refuse(NOT_MODELLED, self.named("SMCR"));
        }
        if self.runs() && (value ^ self.smcr) & 7 != 0 && (value | self.smcr) & 7 != 6 {
            access.refuse("slave mode changed while the counter runs", self.named("SMCR"));
        }
        self.smcr = value;
        self.base = position;
    }

    fn generate(&mut self, value: u32, access: &mut Access<'_>) {
        let value = self.implemented(value, [0xFF, 0x5F], "EGR", access);
        self.sr |= value & 0x1E;
        if value & 1 == 1 {
            // The flag stays down where only ends of the counter raise it (URS).
            self.update(access.now, self.cr1 & 4 == 0);
            self.set_phase(0, access.now);
        }
    }

    fn write_mode(&mut self, index: usize, value: u32, access: &mut Access<'_>) {
        let name = ["CCMR1", "CCMR2"][index];
        let value = self.masked(value, 0xFFFF, name, access);
        let changed = value ^ self.ccmr[index];
        for half in 0..2 {
            let channel = 2 * index + half;
            if changed >> (8 * half) & 3 != 0 && self.outputs(channel) & 1 == 1 {
                access.refuse("direction of an enabled channel changed", self.named(name));
            }
            if value >> (8 * half) & 3 == 0 && !matches!(value >> (8 * half + 4) & 7, 0 | 4..=7) {
                access.refuse(NOT_MODELLED, self.named(name));
            }
        }
        if self.lock() >= 3 && changed & 0x7878 != 0 {
            return access.refuse("locked bits written", self.named(name));
        }
        self.ccmr[index] = value;
    }

    fn write_counter(&mut self, value: u32, position: u16, access: &mut Access<'_>) {
        let value = self.counts(value, "CNT", access);
        if self.is_centred() && self.runs() {
            access.refuse("counter written while it runs centre-aligned", self.named("CNT"));
        }
        if value > self.acting.top {
            access.refuse("counter set above its top", self.named("CNT"));
        }
        self.base = position;
        // Zero makes the counter rise, the top makes it fall (RM0090 17.3.10).
        let falling = self.is_centred() && self.phase(access.now) > self.top() && value != 0;
        let phase = if falling { 2 * self.top() - u64::from(value) } else { value.into() };
        self.set_phase(phase, access.now);
    }

    fn write_compare(&mut self, channel: usize, value: u32, access: &mut Access<'_>) {
        self.ccr[channel] = self.counts(value, ["CCR1", "CCR2", "CCR3", "CCR4"][channel], access);
        let buffered = self.ccmr[channel / 2] >> (3 + 8 * (channel % 2)) & 1 == 1;
        if !buffered && self.acting.compare[channel] != self.ccr[channel] {
            self.collect_matches(access.now);
            self.acting.compare[channel] = self.ccr[channel];
        }
    }

    fn write_break(&mut self, value: u32, access: &mut Access<'_>) {
        let value = self.masked(value, 0xFFFF, "BDTR", access);
        let locked = match self.lock() {
            0 => 0,
            1 => 0x73FF,
            _ => 0x7FFF,
        };
        if (value ^ self.bdtr) & locked != 0 {
            access.refuse("locked bits written", self.named("BDTR"));
        }
        self.bdtr = value & !locked | self.bdtr & locked;
        // Silicon accepts this; a half bridge behind the pins would be destroyed.
        let pairs = self.ccer & self.ccer >> 2 & 0x111;
        if self.bdtr & MOE != 0 && self.bdtr & 0xFF == 0 && pairs != 0 {
            access.refuse("complementary outputs enabled without dead time", self.named("BDTR"));
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::findings::Findings;

    /// Hundred counts of ten clocks, and the interrupt at their end.
    const HUNDRED: [(u32, u32); 6] = [(PSC, 9), (ARR, 99), (EGR, 1), (SR, 0), (DIER, 1), (CR1, 1)];

    struct Bench {
        timer: Timer,
        findings: Findings,
        position: u16,
    }

    impl Bench {
        /// A timer after these writes of registers.
        fn new(kind: Kind, setup: &[(u32, u32)]) -> Self {
            let mut timer = Timer::new("TIM1", kind);
            timer.set_clock(2, 0);
            let mut bench = Self { timer, findings: Findings::default(), position: 0 };
            setup.iter().for_each(|&(offset, value)| bench.write(0, offset, value));
            bench
        }

        fn write(&mut self, now: Ticks, offset: u32, value: u32) {
            let access = &mut Access { now, findings: &mut self.findings };
            self.timer.write(offset, value, self.position, access);
        }

        fn read(&mut self, now: Ticks, offset: u32) -> u32 {
            self.timer.read(offset, self.position, &mut Access { now, findings: &mut self.findings })
        }

        /// Processes events up to an instant and returns them.
        fn run(&mut self, until: Ticks) -> Vec<(Ticks, Event)> {
            let mut events = Vec::new();
            while self.timer.due() <= until {
                let now = self.timer.due();
                self.timer.pass(now, |event| events.push((now, event)));
            }
            events
        }
    }

    #[test]
    fn a_clock_changed_between_two_events_continues_from_there() {
        let mut bench = Bench::new(Kind::General, &HUNDRED);
        bench.run(2000);
        bench.timer.set_clock(21, 3000);
        assert_eq!(bench.timer.due(), 3000 + 50 * 10 * 21);
    }

    #[test]
    fn an_up_counter_counts_its_prescaled_clock_and_updates_at_its_top() {
        let mut bench = Bench::new(Kind::General, &HUNDRED);
        assert_eq!(bench.read(20 * 42 + 19, CNT), 42);
        assert_eq!(bench.run(2000), [(2000, Event::End(true))]);
        assert_eq!((bench.read(2000, CNT), bench.read(2000, SR) & 1), (0, 1));
        assert_eq!(bench.timer.requests(), [true, false]);
        bench.write(2000, SR, !1);
        assert_eq!(bench.timer.requests(), [false, false]);
        // A stopped counter keeps its value and its part of a count.
        bench.write(2000 + 105, CR1, 0);
        assert_eq!(bench.read(9000, CNT), 5);
        bench.write(9000, CR1, 1);
        assert_eq!((bench.read(9014, CNT), bench.read(9015, CNT)), (5, 6));
    }

    #[test]
    fn a_compare_match_raises_its_flag_and_its_interrupt() {
        let mut bench = Bench::new(Kind::Wide, &[(ARR, 0xFFFF), (0x38, 500), (DIER, 1 << 2), (CR1, 1)]);
        assert_eq!(bench.timer.due(), 1000);
        assert_eq!(bench.run(1000), [(1000, Event::Match)]);
        assert_eq!(bench.timer.requests(), [false, true]);
    }

    #[test]
    fn an_odd_repetition_written_while_falling_updates_at_zero_only() {
        let mut bench = Bench::new(Kind::Advanced, &[(CR1, 0x60), (ARR, 3500), (EGR, 1), (CR1, 0x61)]);
        let updates = |events: Vec<(Ticks, Event)>| -> Vec<Ticks> {
            events.into_iter().filter(|(_, event)| *event == Event::End(true)).map(|(at, _)| at).collect()
        };
        assert_eq!(updates(bench.run(14_000)), [7000, 14_000]);
        bench.run(22_000);
        bench.write(22_000, RCR, 1);
        assert_eq!(updates(bench.run(60_000)), [28_000, 42_000, 56_000]);
        assert_eq!(bench.read(60_000, CR1) & 0x10, 0);
        assert_eq!(bench.read(64_000, CR1) & 0x10, 0x10);
        assert_eq!(bench.read(64_000, CNT), 7000 - 4000);
    }

    #[test]
    fn buffered_compare_values_wait_for_the_update() {
        let setup = [(CR1, 0xE0), (ARR, 100), (CCMR1, 0x78), (0x34, 40), (EGR, 1), (CR1, 0xE1)];
        let mut bench = Bench::new(Kind::Advanced, &setup);
        assert_eq!(bench.timer.edges(0), Some([40, 160]));
        assert!(!bench.timer.references(78)[0] && bench.timer.references(80)[0]);
        assert!(bench.timer.references(318)[0] && !bench.timer.references(320)[0]);
        bench.write(100, 0x34, 60);
        assert_eq!(bench.timer.compare(0), 40);
        bench.run(200);
        assert_eq!(bench.timer.compare(0), 60);
    }

    #[test]
    fn a_duty_is_below_the_compare_value_in_mode_1_and_above_it_in_mode_2() {
        let mut bench = Bench::new(Kind::Wide, &[(ARR, 99), (CCMR2, 0x6060), (0x3C, 30), (0x40, 200)]);
        assert_eq!([2, 3].map(|channel| bench.timer.duty(channel)), [0.3, 1.0]);
        bench.write(0, CCMR2, 0x4070);
        assert_eq!([2, 3].map(|channel| bench.timer.duty(channel)), [0.7, 0.0]);
    }

    #[test]
    fn an_encoder_counts_all_four_edges_in_mode_3_and_wraps() {
        let mut bench = Bench::new(Kind::General, &[]);
        bench.position = 100;
        for (offset, value) in [(CCMR1, 0x4141), (SMCR, 3), (CR1, 1)] {
            bench.write(0, offset, value);
        }
        assert_eq!(bench.read(5, CNT), 0);
        bench.position = 107;
        assert_eq!(bench.read(6, CNT), 7);
        bench.position = 99;
        assert_eq!(bench.read(7, CNT), 0xFFFF);
        assert!(bench.findings.is_empty());
    }

    #[test]
    fn locked_bits_reserved_bits_and_a_running_counter_are_protected() {
        let mut bench = Bench::new(Kind::Advanced, &[]);
        bench.write(0, CCER, 0b101);
        bench.write(0, BDTR, MOE | 20);
        assert!(!bench.findings.has("complementary outputs enabled without dead time"));
        bench.write(0, BDTR, MOE);
        assert!(bench.findings.has("complementary outputs enabled without dead time"));
        bench.write(0, BDTR, 1 << 8 | 20);
        bench.write(0, BDTR, 1 << 8 | 30);
        assert_eq!(bench.timer.main_output() & 0xFF, 20);
        assert!(bench.findings.has("locked bits written"));
        bench.write(0, CR1, 1 << 12);
        assert!(bench.findings.has("reserved bit set"));
        bench.write(0, CR1, 0x61);
        bench.write(9, CNT, 5);
        assert!(bench.findings.has("counter written while it runs centre-aligned"));
    }
}
