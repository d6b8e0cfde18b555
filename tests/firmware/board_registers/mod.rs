//! The board's registers after the start, from the record of writes, compared with known values of the board.
//!
//! `cargo test --test firmware board_registers:: -- --nocapture` prints the record. The values are those of
//! ODrive's firmware v0.5.6 (`Firmware/Board/v3`, `Drivers`, `MotorControl`); the meaning of the bits is
//! RM0090's. The silicon's behaviour needs a test on the board.

mod sampling;
mod timer;

use std::collections::BTreeMap;

use scarab::board::odrive_v3_6::settings::pins::{GATES_OFF, HOLDING_BRAKE, MOTOR_THERMISTORS, Mode, PINS};
use scarab::board::odrive_v3_6::settings::{
    CACHES, CLOCK_HZ, CLOCK_SECURITY, CLOCKS, DEBUG_FREEZE, FAST_TIMER_HZ, SLOW_TIMER_HZ, SUPPLY_DETECTOR,
    Write, analog, can, chopper, converters, external, flash, gate_driver, prepare, timers,
};
use scarab_boot::{HEADER_AT, HEADER_BYTES, Region, SUPPLY_LEVEL};
use timer::Timer;

/// Registers by address. Unwritten ones are zero, as after a reset (except the debug pins' modes).
#[derive(Default)]
struct Registers {
    values: BTreeMap<u32, u32>,
    record: Vec<Write>,
}

impl Registers {
    fn apply(&mut self, writes: &[Write]) {
        for write in writes {
            let before = self.at(write.address);
            self.values.insert(write.address, write.applied_to(before));
            self.record.push(*write);
        }
    }

    fn at(&self, address: u32) -> u32 {
        self.values.get(&address).copied().unwrap_or(0)
    }

    /// Bits `low..low + count` of a register.
    fn bits(&self, address: u32, low: u32, count: u32) -> u32 {
        self.at(address) >> low & ((1 << count) - 1)
    }
}

/// Registers after all writes of the start, in order.
fn started() -> Registers {
    let mut registers = Registers::default();
    registers.apply(&CLOCKS);
    GATES_OFF.iter().for_each(|pin| registers.apply(&pin.writes()));
    for list in [&CACHES[..], &CLOCK_SECURITY, &DEBUG_FREEZE, &SUPPLY_DETECTOR] {
        registers.apply(list);
    }
    prepare(|writes| registers.apply(writes));
    registers.apply(&timers::LOCK_AND_START);
    registers.apply(&timers::TRIGGERS);
    (0..2).for_each(|axis| registers.apply(&[timers::repetition(axis)]));
    registers.apply(&converters::TRIGGERED);
    registers.apply(&external::EXTERNAL);
    registers
}

const TIM1: u32 = 0x4001_0000;
const TIM8: u32 = 0x4001_0400;
const TIM2: u32 = 0x4000_0000;
const TIM3: u32 = 0x4000_0400;
const TIM4: u32 = 0x4000_0800;
const ADC: [u32; 3] = [0x4001_2000, 0x4001_2100, 0x4001_2200];

#[test]
fn the_record_of_writes_is_that_of_the_start() {
    let registers = started();
    println!("register            address       mask      value");
    for write in &registers.record {
        println!("{:<16} {:#010x} {:#010x} {:#010x}", write.register, write.address, write.mask, write.value);
        assert!(write.address.is_multiple_of(4) && write.mask != 0, "{write:?}");
        assert_eq!(write.value & !write.mask, 0, "{write:?} sets a bit that it does not mean");
    }
    println!("{} writes", registers.record.len());
}

#[test]
fn bridges_start_off_at_24_khz_with_119_ns_dead_time() {
    let registers = started();
    for base in [TIM1, TIM8] {
        let period = f64::from(registers.at(base + 0x2C)) * 2.0 * f64::from(registers.at(base + 0x28) + 1);
        assert_eq!(f64::from(FAST_TIMER_HZ) / period, 24_000.0);
        assert_eq!(registers.bits(base, 5, 2), 0b11, "centre-aligned 3");
        assert_eq!(registers.bits(base, 8, 2), 0, "dead time of the undivided clock");
        let dead_time = registers.bits(base + 0x44, 0, 8);
        assert!(dead_time < 128, "linear range");
        let dead_time_ns = f64::from(dead_time) / f64::from(FAST_TIMER_HZ) * 1e9;
        assert!((dead_time_ns - 119.0).abs() < 0.1, "{dead_time_ns}");
        assert_eq!(registers.bits(base + 0x44, 15, 1), 0, "main output off");
        assert_eq!(registers.bits(base + 0x44, 14, 1), 0, "never switched on by hardware");
        assert_eq!(registers.bits(base + 0x44, 10, 2), 0b11, "idle levels are driven");
        // No break circuit: its pins are taken, so a failed crystal turns outputs off by the interrupt.
        assert_eq!(registers.bits(base + 0x44, 12, 1), 0);
        for channel in 0..3 {
            let shift = 8 * (channel % 2);
            let mode = registers.bits(base + 0x18 + 4 * (channel / 2), shift, 8);
            assert_eq!(mode, 0b0111_1000, "PWM mode 2, buffered, channel {}", channel + 1);
            assert_eq!(registers.bits(base + 0x20, 4 * channel, 4), 0b0101, "both outputs, active high");
        }
        assert_eq!(registers.bits(base + 0x04, 4, 3), 0b111, "channel 4 triggers the converters");
        assert_eq!(registers.at(base + 0x30), 1, "compare values are taken over once a period");
    }
}

#[test]
fn timers_hold_outputs_off_before_any_pin_or_trigger() {
    let registers = started();
    let order: Vec<_> = registers.record.iter().map(|write| write.register).collect();
    let rank = |name: &str| order.iter().rposition(|register| *register == name).expect(name);
    let begins = |name: &str| order.iter().position(|register| *register == name).expect(name);
    // TIM8 waits for TIM1 before TIM1 starts, and is detached before either triggers.
    let lock = timers::LOCK_AND_START;
    assert_eq!((lock[1].register, lock[1].value), ("TIM8_SMCR", 0b110));
    assert_eq!((lock[2].register, lock[2].value & 1), ("TIM1_CR1", 1));
    assert_eq!(registers.at(TIM8 + 0x08), 0);
    assert!(rank("ADC3_CR2") > rank("TIM8_CR2") && rank("TIM8_CR2") > rank("TIM1_CR1"));
    assert!(begins("TIM1_BDTR") < begins("TIM1_CCER"));
}

#[test]
fn the_converters_sample_the_shunts_of_the_board() {
    let registers = started();
    assert_eq!(f64::from(SLOW_TIMER_HZ) / f64::from(converters::CLOCK_HZ), 4.0);
    assert_eq!(registers.bits(0x4001_2304, 16, 2), 0b01, "84 MHz / 4");
    // M0: B on IN10 by ADC2, C on IN11 by ADC3, injected by TIM1's trigger. M1: B on IN13, C on IN12, regular
    // by TIM8's.
    for (adc, injected, regular) in [(ADC[1], 10, 13), (ADC[2], 11, 12)] {
        assert_eq!((registers.bits(adc + 0x38, 20, 2), registers.bits(adc + 0x38, 15, 5)), (0, injected));
        assert_eq!((registers.bits(adc + 0x2C, 20, 4), registers.bits(adc + 0x34, 0, 5)), (0, regular));
        assert_eq!((registers.bits(adc + 0x08, 16, 4), registers.bits(adc + 0x08, 20, 2)), (0b0001, 0b01));
        assert_eq!((registers.bits(adc + 0x08, 24, 4), registers.bits(adc + 0x08, 28, 2)), (0b1110, 0b01));
        assert_eq!((registers.at(adc + 0x0C), registers.at(adc + 0x10)), (0, 0), "3 cycles");
    }
    // Bus voltage IN6, thermistors IN15, IN4, IN5: four injected conversions in a row.
    let sequence = registers.at(ADC[0] + 0x38);
    assert_eq!(registers.bits(ADC[0] + 0x38, 20, 2), 3);
    assert_eq!([0, 5, 10, 15].map(|shift| sequence >> shift & 0x1F), [6, 15, 4, 5]);
    assert_eq!(registers.bits(ADC[0] + 0x04, 8, 1), 1, "scan");
    // Thermistors of the motors on IN0 (PA0) and IN1 (PA1): one regular conversion by software, 480 cycles.
    assert_eq!(converters::MOTORS, [0, 1]);
    let pins = MOTOR_THERMISTORS.map(|pin| (pin.port, pin.number, pin.mode));
    assert_eq!(pins, [(b'A', 0, Mode::Analog), (b'A', 1, Mode::Analog)]);
    assert_eq!((registers.at(ADC[0] + 0x2C), registers.at(ADC[0] + 0x10) & 0o77), (0, 0o77));
    let triggered = registers.at(ADC[0] + converters::CR2);
    assert_eq!(converters::START, triggered | 1 << 30, "the injected trigger stays");
    let down = 1 << 4;
    let idle =
        [(0, 1000), (down, 1000), (down, 168), (down, 169)].map(|(cr1, cnt)| converters::is_idle(cr1, cnt));
    assert_eq!(idle, [false, true, false, true]);
    // ADC2 and ADC3 interrupt, at the end of either kind; all resolve 12 bits, right-aligned.
    let interrupts = ADC.map(|adc| registers.bits(adc + 0x04, 5, 3));
    assert_eq!(interrupts, [0, 0b101, 0b101]);
    for adc in ADC {
        assert_eq!((registers.bits(adc + 0x04, 24, 2), registers.bits(adc + 0x08, 11, 1)), (0, 0));
        assert_eq!(registers.bits(adc + 0x08, 0, 1), 1);
    }
}

#[test]
fn a_silent_converter_is_detected_by_the_other_one() {
    let (injected, regular) = (converters::JEOC, converters::EOC);
    for (ends, axes) in [
        ([0, 0], [None, None]),
        ([injected; 2], [Some(true), None]),
        ([regular; 2], [None, Some(true)]),
        ([injected | regular; 2], [Some(true), Some(true)]),
        ([injected, 0], [Some(false), None]),
        ([0, regular], [None, Some(false)]),
    ] {
        assert_eq!(converters::finished_axes(ends), axes);
    }
}

#[test]
fn currents_voltages_and_temperatures_are_those_of_the_board() {
    let sense = analog::sense(19.0);
    assert_eq!(sense, scarab::motor::SenseScale::ODRIVE_3_6);
    // 500 uOhm, 40 V/V, 3.3 V of 4096 codes: 0.0403 A per code, 60.75 A at 0.9 of 1.35 V.
    for scale in sense.ampere_per_code {
        assert!((scale.0 - 3.3 / 4096.0 / gate_driver::GAIN / 500e-6).abs() < 1e-6, "{scale:?}");
    }
    // Rails of 0.3 V and 3.0 V.
    assert_eq!(sense.rails, [372, 3723]);
    assert!((analog::sense(11.0).volt_per_code.0 - 3.3 * 11.0 / 4096.0).abs() < 1e-7);
    for (version, ratio) in [
        ([3, 6, 56], Some(19.0)),
        ([3, 5, 48], Some(19.0)),
        ([3, 6, 24], Some(11.0)),
        ([3, 4, 24], None),
        ([4, 4, 58], None),
        ([analog::BLANK; 3], None),
    ] {
        assert_eq!(analog::divider(version), ratio, "{version:?}");
    }
    assert_eq!(analog::divider(analog::stated(Some("24"))), Some(11.0));
    assert_eq!([None, Some("48")].map(|volts| analog::divider(analog::stated(volts))), [None; 2]);
    // The temperature grows monotonically with the code.
    let degrees: Vec<f32> = (0..4096_u16).filter_map(analog::temperature_c).collect();
    assert!(degrees.windows(2).all(|pair| pair[0] < pair[1]), "not monotonic");
    assert!(degrees[0] < 0.0 && *degrees.last().expect("some") > 120.0);
    assert_eq!([0, 4095].map(analog::temperature_c), [None; 2]);
}

#[test]
fn encoders_count_every_edge_behind_a_filter_and_their_index_pulses_interrupt() {
    let registers = started();
    for base in [TIM3, TIM4] {
        assert_eq!(registers.bits(base + 0x08, 0, 3), 0b011, "both inputs");
        assert_eq!(registers.at(base + 0x2C), 0xFFFF);
        assert_eq!(registers.at(base + 0x18), 0x4141, "inputs 1 and 2, filter 4");
        assert_eq!(registers.at(base + 0x20), 0, "not inverted");
        assert_eq!(registers.bits(base, 0, 1), 1);
    }
    // Index lines PC9 and PC15.
    assert_eq!(registers.bits(0x4001_3810, 4, 4), 2);
    assert_eq!(registers.bits(0x4001_3814, 12, 4), 2);
    assert_eq!(registers.at(0x4001_3C08), 1 << 9 | 1 << 15, "as they rise");
}

#[test]
fn the_emergency_stop_interrupts_as_its_contact_opens() {
    let registers = started();
    // Contact on PC4, closed to 3.3 V.
    assert_eq!(registers.bits(0x4001_380C, 0, 4), 2);
    assert_eq!(registers.at(0x4001_3C0C), 1 << 4, "as it falls");
    assert_eq!(registers.at(0x4001_3C00), 1 << 4 | 1 << 9 | 1 << 15, "no other line");
}

#[test]
fn the_chopper_stays_off() {
    let registers = started();
    let top = registers.at(TIM2 + 0x2C);
    let frequency = f64::from(SLOW_TIMER_HZ) / (2.0 * f64::from(top));
    assert!((frequency - 10_254.0).abs() < 1.0, "{frequency}");
    // Low side on below 0, high side on from above the top: never.
    assert_eq!((registers.at(TIM2 + 0x3C), registers.at(TIM2 + 0x40)), (0, top + 1));
    assert_eq!(registers.at(TIM2 + 0x1C), 0x7878, "PWM mode 2 on channels 3 and 4, buffered");
    assert_eq!(registers.bits(TIM2 + 0x20, 8, 8), 0b0001_0011, "channel 3 active low, 4 high");
    for duty in [0.0, 0.3, 0.95, 1.0, f32::NAN, -1.0] {
        let [low, high] = chopper::compare(duty).map(u32::from);
        assert!(high - low >= chopper::GAP && high <= chopper::TOP, "{duty}");
        let share = f64::from(top - high) / f64::from(top);
        assert!((share - f64::from(duty.clamp(0.0, 0.95))).abs() < 3e-4 || duty.is_nan(), "{duty}: {share}");
    }
}

/// Whether neither side of the chopper is driven at any counter value: channel 3 is active low, channel 4
/// active high.
fn is_off(chopper: &Timer) -> bool {
    // Rising from zero on, falling from the top on.
    let rising = (0..chopper.top()).map(|counter| (counter, false));
    let falling = (1..=chopper.top()).map(|counter| (counter, true));
    rising.chain(falling).all(|(counter, falling)| {
        let [low, high] = [2, 3].map(|channel| chopper.reference_at(channel, counter, falling));
        low && !high
    })
}

/// Replays writes on the chopper's timer; returns the first after which an enabled side is driven.
fn driven_after(writes: &[Write]) -> Option<&'static str> {
    let mut chopper = Timer::new(TIM2);
    for write in writes {
        let changed = chopper.apply(write);
        let through = chopper.is_let_through(2) || chopper.is_let_through(3);
        if changed && through && !is_off(&chopper) {
            return Some(write.register);
        }
    }
    // Also none after the counter's ends, where buffered values are taken over.
    (0..4 * chopper::TOP).for_each(|_| chopper.clock());
    (!is_off(&chopper)).then_some("end of the counter")
}

#[test]
fn the_chopper_s_sides_are_off_after_each_write_of_the_start() {
    let record = started().record;
    assert_eq!(driven_after(&record), None);
    // Without the update the outputs are enabled with the compare values of a reset.
    let without: Vec<Write> = record.iter().copied().filter(|write| write.register != "TIM2_EGR").collect();
    assert_eq!(driven_after(&without), Some("TIM2_CCER"));
}

/// Pins and functions of `Board/v3/Inc/main.h` for version 3.5 and later: analog `a`, input `i`, output `o`,
/// or the alternate function's number.
const BOARD_PINS: &str = "A8:1 A9:1 A10:1 B13:1 B14:1 B15:1 C6:3 C7:3 C8:3 A7:3 B0:3 B1:3 C0:a C1:a C2:a C3:a A6:a C5:a A4:a A5:a \
     B4:2 B5:2 B6:2 B7:2 C9:i C15:i D2:i C4:i A2:i A3:i B10:1 B11:1 B12:o C13:o C14:o";

#[test]
fn every_pin_has_the_function_of_the_board_s_wiring() {
    let registers = started();
    let mut expected = 0;
    for entry in BOARD_PINS.split_whitespace() {
        let (pin, function) = entry.split_once(':').expect("pin:function");
        let number: u32 = pin[1..].parse().expect("a number");
        let port = 0x4002_0000 + 0x400 * u32::from(pin.as_bytes()[0] - b'A');
        let mode = registers.bits(port, 2 * number, 2);
        let alternate = registers.bits(port + 0x20 + 4 * (number / 8), 4 * (number % 8), 4);
        let found = match mode {
            0 => "i".into(),
            1 => "o".into(),
            2 => alternate.to_string(),
            _ => "a".to_owned(),
        };
        assert_eq!(found, function, "P{pin}");
        expected += 1;
    }
    assert_eq!(PINS.len() + GATES_OFF.len(), expected);
    // Contacts and outputs that must be low without their driver are pulled down, the fault line up.
    let pull = |port: u32, number: u32| registers.bits(0x4002_000C + 0x400 * port, 2 * number, 2);
    assert_eq!([pull(2, 4), pull(0, 2), pull(0, 3), pull(3, 2), pull(0, 8), pull(1, 1)], [2, 2, 2, 1, 2, 2]);
    // The debug port PA13, PA14 is untouched.
    assert!(PINS.iter().all(|pin| pin.port != b'A' || !(13..=14).contains(&pin.number)));
    // First levels written: enable low, selects high.
    let levels: Vec<u32> = GATES_OFF.iter().map(|pin| pin.writes()[0].value).collect();
    assert_eq!(levels, [1 << (12 + 16), 1 << 13, 1 << 14]);
}

#[test]
fn only_a_leg_with_a_holding_brake_drives_its_pin_low_first() {
    let mut registers = started();
    let mode = |registers: &Registers| registers.bits(0x4002_0400, 4, 2);
    assert_eq!(mode(&registers), 0, "PB2 is an input");
    let writes = HOLDING_BRAKE.writes();
    assert_eq!((writes[0].address, writes[0].value), (0x4002_0418, 1 << (2 + 16)), "engaged before driven");
    registers.apply(&writes);
    assert_eq!(mode(&registers), 1, "output");
}

#[test]
fn a_duty_is_the_share_of_the_period_above_its_compare_value() {
    for (duty, compare) in [(0.0, 3500), (0.5, 1750), (1.0, 0), (0.9367, 222), (2.0, 0), (-1.0, 3500)] {
        assert_eq!(timers::compare(duty), compare, "{duty}");
    }
    // NaN leaves the low side on.
    assert_eq!(timers::compare(f32::NAN), 3500);
    assert_eq!(timers::compare(f32::INFINITY), 0);
}

#[test]
fn gate_driver_frames_have_the_driver_s_format() {
    use gate_driver::{CONTROL_1, CONTROL_2, Register, data, read, write};
    assert_eq!(CONTROL_1, 0x0550, "number 21, latched shutdown, six inputs, 1.7 A");
    assert_eq!(CONTROL_2, 0x0008, "40 V/V");
    assert_eq!(write(Register::Control1, CONTROL_1), 0x1550);
    assert_eq!(write(Register::Control2, CONTROL_2), 0x1808);
    assert_eq!([read(Register::Status1), read(Register::Control2)], [0x8000, 0x9800]);
    assert_eq!(data(0x1550), Some(0x0550));
    assert_eq!(data(0xBEEF), None);
}

#[test]
fn clocks_and_caches_are_on_and_a_failed_crystal_is_detected() {
    let registers = started();
    assert_eq!(CLOCK_HZ, 8_000_000 / 4 * 168 / 2);
    assert_eq!(registers.bits(0x4002_3C00, 8, 3), 0b111, "prefetch, instruction and data cache");
    assert_eq!(registers.bits(0x4002_3800, 19, 1), 1, "clock security");
    // Ports A to D; TIM2 to TIM4; TIM1, TIM8, ADC1 to ADC3, SYSCFG.
    assert_eq!(registers.at(0x4002_3830), 0b1111);
    assert_eq!(registers.at(0x4002_3840), 1 << 28 | 0b111);
    assert_eq!(registers.at(0x4002_3844), 1 | 1 << 1 | 0b111 << 8 | 1 << 14);
    // Both bridges' timers stop while a debugger halts the processor; the watchdog runs on.
    assert_eq!((registers.at(0xE004_2008), registers.at(0xE004_200C)), (0, 0b11));
}

const CAN1: u32 = 0x4000_6400;

#[test]
fn the_bus_has_the_stored_rate_and_receives_every_11_bit_frame() {
    for (kbit, bits_per_s) in [(125, 125e3), (250, 250e3), (500, 500e3), (1000, 1e6), (800, 1e6), (0, 1e6)] {
        let mut registers = started();
        registers.apply(&can::CLOCK);
        can::PINS.iter().for_each(|pin| registers.apply(&pin.writes()));
        registers.apply(&can::EDGES);
        registers.apply(&can::BEGIN);
        // Timing is written in initialisation mode, which is left afterwards.
        assert_eq!(registers.bits(CAN1, 0, 2), 0b01);
        registers.apply(&can::set_up(kbit));
        registers.apply(&can::TAKE_PART);
        assert_eq!(registers.bits(CAN1, 0, 2), 0);
        assert_eq!(registers.bits(0x4002_3840, 25, 1), 1, "clocked");
        let timing = CAN1 + 0x1C;
        let [before, after] = [(16, 4), (20, 3)].map(|(low, count)| registers.bits(timing, low, count) + 1);
        let quanta = f64::from(1 + before + after);
        assert_eq!(42e6 / f64::from(registers.bits(timing, 0, 10) + 1) / quanta, bits_per_s);
        // Values of ODrive: 16 and 4, jump width 4.
        assert_eq!((before, after, registers.bits(timing, 24, 2) + 1), (16, 4, 4));
        assert_eq!(registers.bits(timing, 30, 2), 0, "neither loop back nor silent");
        // Mailboxes in order, automatic recovery from bus-off, retransmission.
        assert_eq!(registers.bits(CAN1, 2, 5), 0b10011);
        // Filter 0: one mask of 32 bits into the first queue; identifiers ignored, IDE and RTR must be 0.
        assert_eq!((registers.bits(CAN1 + 0x21C, 0, 28), registers.bits(CAN1 + 0x200, 0, 1)), (1, 0));
        assert_eq!((registers.bits(CAN1 + 0x204, 0, 1), registers.bits(CAN1 + 0x20C, 0, 1)), (0, 1));
        assert_eq!((registers.at(CAN1 + 0x240), registers.at(CAN1 + 0x244)), (0, 0b110));
        // PB8 and PB9: function 9, pulled up, driven with medium edges.
        assert_eq!((registers.bits(0x4002_0424, 0, 8), registers.bits(0x4002_0400, 16, 4)), (0x99, 0b1010));
        assert_eq!((registers.bits(0x4002_040C, 16, 4), registers.bits(0x4002_0408, 18, 2)), (0b0101, 0b01));
    }
}

#[test]
fn images_are_linked_to_their_sectors_and_the_header_follows_the_vectors() {
    // The linker scripts take the regions from the build scripts, which write them from `Region`.
    let image = include_str!("../../../src/board/odrive_v3_6/layout.x");
    assert!(image.contains(&format!(".image_header ORIGIN(FLASH) + {HEADER_AT:#x} :")));
    let code = HEADER_AT + HEADER_BYTES as u32;
    assert!(image.contains(&format!("_stext = ORIGIN(FLASH) + {code:#x};")));
    // Four sectors of 16 KB, one of 64 KB, and the rest of 128 KB (RM0090 table 5).
    let kilobytes = |sector: u32| match sector {
        0..4 => 16,
        4 => 64,
        _ => 128,
    };
    for region in Region::ALL {
        let before: u32 = (0..region.sector).map(kilobytes).sum();
        assert_eq!(region.address, 0x0800_0000 + (before << 10));
        for number in region.sector..region.sector + region.sectors {
            assert_eq!(region.sector_bytes, kilobytes(number) << 10);
            assert_eq!(flash::erase(number) >> 3 & 0xF, number);
        }
    }
}

#[test]
fn the_detector_of_the_supply_is_on_at_its_level() {
    let registers = started();
    assert_eq!(registers.bits(0x4000_7000, 4, 4), u32::from(SUPPLY_LEVEL) << 1 | 1);
    // Power controller's clock; the level as delivered is off, level 3 has both bits clear.
    assert_eq!(registers.bits(0x4002_3840, 28, 1), 1);
    assert_eq!([0x0FFF_AAED, 0x0FFF_AAE1].map(flash::brown_out_level), [0, 3]);
}
