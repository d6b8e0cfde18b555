//! Model of an STM32F405 timer by its registers: buffered values, centre-aligned counting, compare outputs.
//!
//! Source: RM0090 chapters 17 and 18 (TIM1 and TIM8, TIM2). The test applies recorded writes in order and
//! then clocks the model.
//!
//! ```text
//! counter   0, 1 .. top - 1, top, top - 1 .. 1, 0          falls from the top on and rises from zero on
//! update    every (repetition + 1)th end, or EGR.UG: compare values, top and repetition are taken over
//! mode 1    rising: active below the compare value; falling: inactive above it     mode 2 is the inverse
//! ```
//!
//! Known limits: no prescaler, no edge-aligned counting, no break; the only slave mode is the start
//! by a trigger.

use std::collections::BTreeMap;

use scarab::board::odrive_v3_6::settings::Write;

const CR1: u32 = 0x00;
const CR2: u32 = 0x04;
const SMCR: u32 = 0x08;
const EGR: u32 = 0x14;
const CCMR1: u32 = 0x18;
const CCER: u32 = 0x20;
const CNT: u32 = 0x24;
const ARR: u32 = 0x2C;
const RCR: u32 = 0x30;
const CCR1: u32 = 0x34;

/// Registers of one timer, and its internal state.
#[derive(Clone, Default)]
pub struct Timer {
    base: u32,
    registers: BTreeMap<u32, u32>,
    pub counter: u32,
    pub falling: bool,
    /// Active values: those of the registers at the last update where the registers are buffered.
    top: u32,
    compare: [u32; 4],
    /// Ends of the counter until the next update.
    repetition: u32,
}

impl Timer {
    /// A timer after a reset.
    pub fn new(base: u32) -> Self {
        Self { base, ..Self::default() }
    }

    /// Applies a write; a write to another peripheral has no effect. Returns whether it was for this timer.
    pub fn apply(&mut self, write: &Write) -> bool {
        let Some(offset) = write.address.checked_sub(self.base).filter(|offset| *offset < 0x400) else {
            return false;
        };
        let value = write.applied_to(self.at(offset));
        match offset {
            // Software sets the direction only while the counter is edge-aligned.
            CR1 if !self.is_centred() => self.falling = value >> 4 & 1 == 1,
            CNT => {
                self.counter = value;
                if self.is_centred() && value == 0 {
                    self.falling = false;
                } else if self.is_centred() && value == self.top {
                    self.falling = true;
                }
            }
            _ => {}
        }
        self.registers.insert(offset, value);
        if offset == EGR && value & 1 == 1 {
            self.update();
            (self.counter, self.falling) = (0, false);
        }
        if self.at(CR1) >> 7 & 1 == 0 {
            self.top = self.at(ARR);
        }
        for channel in 0..4 {
            if self.mode(channel) >> 3 & 1 == 0 {
                self.compare[channel as usize] = self.at(CCR1 + 4 * channel);
            }
        }
        true
    }

    /// Advances by one clock.
    pub fn clock(&mut self) {
        if !self.is_running() {
            return;
        }
        self.counter = if self.falling { self.counter - 1 } else { self.counter + 1 };
        assert!(self.counter <= 0xFFFF, "the counter is outside its range");
        let (at_top, at_zero) = (!self.falling && self.counter == self.top, self.counter == 0);
        if at_top || at_zero {
            self.falling = at_top;
            if self.repetition == 0 {
                self.update();
            } else {
                self.repetition -= 1;
            }
        }
    }

    fn update(&mut self) {
        self.top = self.at(ARR);
        self.compare = [0, 1, 2, 3].map(|channel| self.at(CCR1 + 4 * channel));
        self.repetition = self.at(RCR);
    }

    fn at(&self, offset: u32) -> u32 {
        self.registers.get(&offset).copied().unwrap_or(0)
    }

    /// Mode and buffering of a channel (from 0): its eight bits of CCMR1 or CCMR2.
    fn mode(&self, channel: u32) -> u32 {
        self.at(CCMR1 + 4 * (channel / 2)) >> (8 * (channel % 2)) & 0xFF
    }

    fn is_centred(&self) -> bool {
        self.at(CR1) >> 5 & 0b11 != 0
    }

    /// Whether the counter is enabled.
    pub fn is_running(&self) -> bool {
        self.at(CR1) & 1 == 1
    }

    /// Whether an output of a channel is enabled.
    pub fn is_let_through(&self, channel: u32) -> bool {
        self.at(CCER) >> (4 * channel) & 0b101 != 0
    }

    /// Present reference output of a channel.
    pub fn reference(&self, channel: u32) -> bool {
        self.reference_at(channel, self.counter, self.falling)
    }

    /// Reference output of a channel at a counter value, with the active compare value.
    pub fn reference_at(&self, channel: u32, counter: u32, falling: bool) -> bool {
        let compare = self.compare[channel as usize];
        let below = if falling { counter <= compare } else { counter < compare };
        match self.mode(channel) >> 4 & 0b111 {
            0b110 => below,
            0b111 => !below,
            mode => panic!("channel {channel}: mode {mode:#05b} is not modelled"),
        }
    }

    /// Active top of the counter.
    pub fn top(&self) -> u32 {
        self.top
    }
}

/// Both bridges' timers; TIM1's enable starts TIM8 where the registers say so.
pub struct Bridges {
    pub timers: [Timer; 2],
    /// Clocks since the first write.
    pub now: u64,
}

impl Bridges {
    pub fn new(bases: [u32; 2]) -> Self {
        Self { timers: bases.map(Timer::new), now: 0 }
    }

    pub fn apply(&mut self, writes: &[Write]) {
        for write in writes {
            let ran = self.timers[0].is_running();
            for timer in &mut self.timers {
                timer.apply(write);
            }
            let [master, slave] = &mut self.timers;
            // Master mode 001 sends the enable; slave mode 110 starts at the trigger, number 0 of
            // which is TIM1's.
            let enable_is_sent = master.at(CR2) >> 4 & 0b111 == 0b001;
            let slave_waits = slave.at(SMCR) & 0b111_0111 == 0b110;
            if !ran && master.is_running() && enable_is_sent && slave_waits {
                let started = Write::whole("TIM8_CR1", slave.base + CR1, slave.at(CR1) | 1);
                slave.apply(&started);
            }
        }
    }

    pub fn clock(&mut self) {
        self.timers.iter_mut().for_each(Timer::clock);
        self.now += 1;
    }
}
