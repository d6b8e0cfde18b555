//! The drivers, one step each, as their documentation shows them: blocking, or futures polled in place.

use cortex_m::peripheral::DWT;
use embassy_futures::block_on;
use embassy_stm32::adc::{Adc, AdcConfig, Resolution, SampleTime};
use embassy_stm32::can::enums::BusError;
use embassy_stm32::can::filter::Mask32;
use embassy_stm32::can::{self, Can, Fifo, Frame, Id};
use embassy_stm32::exti::{self, ExtiInput};
use embassy_stm32::flash::{self, Flash};
use embassy_stm32::gpio::{Input, Level, Output, OutputOpenDrain, OutputType, Pull, Speed};
use embassy_stm32::mode::Blocking;
use embassy_stm32::rcc::{
    self, APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk,
};
use embassy_stm32::spi::{self, Spi};
use embassy_stm32::time::{Hertz, MaybeHertz};
use embassy_stm32::timer::Channel;
use embassy_stm32::timer::complementary_pwm::{ComplementaryPwm, ComplementaryPwmPin};
use embassy_stm32::timer::low_level::CountingMode;
use embassy_stm32::timer::simple_pwm::{PwmPin, SimplePwm};
use embassy_stm32::wdg::IndependentWatchdog;
use embassy_stm32::{Config, Peri, Peripherals, bind_interrupts, interrupt, peripherals};
use embassy_time::{Duration, Timer, block_for};

use super::contract::{FED, STORED};
use super::{give, reach, stop};

bind_interrupts!(struct Interrupts {
    EXTI4 => exti::InterruptHandler<interrupt::typelevel::EXTI4>;
    CAN1_TX => can::TxInterruptHandler<peripherals::CAN1>;
    CAN1_RX0 => can::Rx0InterruptHandler<peripherals::CAN1>;
    CAN1_RX1 => can::Rx1InterruptHandler<peripherals::CAN1>;
    CAN1_SCE => can::SceInterruptHandler<peripherals::CAN1>;
});

/// Runs all steps.
pub fn run(mut core: cortex_m::Peripherals) -> ! {
    core.DCB.enable_trace();
    core.DWT.enable_cycle_counter();
    let p = embassy_stm32::init(configuration());
    clocks(&p);
    pins(p.PA0, p.PA1, p.PA15, p.PB2);
    block_on(edge(p.PC4, p.EXTI4));
    let gates = Output::new(p.PB12, Level::High, Speed::Low);
    bridge(p.TIM1, p.PA8, p.PB13);
    chopper(p.TIM2, p.PB11);
    analog(p.ADC1, p.PA6, p.PC5);
    let spi = Spi::new_blocking(p.SPI3, p.PC10, p.PC12, p.PC11, gate_bus());
    let _other = Output::new(p.PC14, Level::High, Speed::Medium);
    gate_driver(spi, Output::new(p.PC13, Level::High, Speed::Medium));
    drop(gates);
    let bus = Can::new(p.CAN1, p.PB8, p.PB9, Interrupts);
    block_on(frames(bus));
    stored(Flash::new_blocking(p.FLASH));
    watchdog(p.IWDG)
}

/// 168 MHz from the crystal of 8 MHz.
fn configuration() -> Config {
    let mut config = Config::default();
    config.rcc.hse = Some(Hse { freq: Hertz(8_000_000), mode: HseMode::Oscillator });
    config.rcc.pll_src = PllSource::HSE;
    config.rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    config.rcc.sys = Sysclk::PLL1_P;
    config.rcc.apb1_pre = APBPrescaler::DIV4;
    config.rcc.apb2_pre = APBPrescaler::DIV2;
    config
}

/// Result of a function, and the processor cycles that it takes.
fn timed<T>(function: impl FnOnce() -> T) -> (T, u32) {
    let begun = DWT::cycle_count();
    let result = function();
    (result, DWT::cycle_count().wrapping_sub(begun))
}

fn clocks(p: &Peripherals) {
    let clocks = rcc::clocks(&p.RCC);
    let hz = |clock: &MaybeHertz| clock.to_hertz().map_or(0, |hertz| hertz.0);
    give(hz(&clocks.sys));
    give(hz(&clocks.pclk1));
    give(hz(&clocks.pclk2));
    give(hz(&clocks.pclk1_tim));
    give(hz(&clocks.pclk2_tim));
    give(timed(|| block_for(Duration::from_millis(10))).1);
    give(timed(|| block_on(Timer::after(Duration::from_millis(5)))).1);
    reach();
}

fn pins(
    pushed: Peri<'_, peripherals::PA0>,
    open: Peri<'_, peripherals::PA1>,
    pulled: Peri<'_, peripherals::PA15>,
    read: Peri<'_, peripherals::PB2>,
) {
    let mut pushed = Output::new(pushed, Level::Low, Speed::Low);
    pushed.set_high();
    let mut open = OutputOpenDrain::new_pull(open, Level::Low, Speed::Low, Pull::Up);
    let held = open.is_high();
    open.set_high();
    let mut pulled = pulled;
    let up = Input::new(pulled.reborrow(), Pull::Up).is_high();
    let down = Input::new(pulled, Pull::Down).is_high();
    let read = Input::new(read, Pull::Down);
    let before = read.is_high();
    reach();
    let levels = [up, down, before, read.is_high(), held, open.is_high(), pushed.is_set_high()];
    give(levels.iter().rev().fold(0, |word, level| word << 1 | u32::from(*level)));
}

async fn edge(pin: Peri<'_, peripherals::PC4>, line: Peri<'_, peripherals::EXTI4>) {
    let mut input = ExtiInput::new(pin, line, Pull::None, Interrupts);
    reach();
    input.wait_for_rising_edge().await;
    reach();
}

/// Channel 1 with a dead time, edge-aligned at 20 kHz, then centre-aligned at 24 kHz.
fn bridge(
    mut timer: Peri<'_, peripherals::TIM1>,
    mut high: Peri<'_, peripherals::PA8>,
    mut low: Peri<'_, peripherals::PB13>,
) {
    let modes = [
        (CountingMode::EdgeAlignedUp, 20_000, 100),
        (CountingMode::CenterAlignedBothInterrupts, 24_000, 300),
    ];
    for (mode, hz, dead) in modes {
        let high = PwmPin::new(high.reborrow(), OutputType::PushPull);
        let low = ComplementaryPwmPin::new(low.reborrow(), OutputType::PushPull);
        let timer = timer.reborrow();
        let (high, low, hz) = (Some(high), Some(low), Hertz(hz));
        let mut pwm = ComplementaryPwm::new(timer, high, low, None, None, None, None, None, None, hz, mode);
        let top = pwm.get_max_duty();
        give(top);
        pwm.set_dead_time(dead);
        pwm.set_duty(Channel::Ch1, top / 4);
        pwm.enable(Channel::Ch1);
        block_for(Duration::from_millis(1));
        reach();
    }
}

/// Channel 4 at 1 kHz and 30 %.
fn chopper(timer: Peri<'_, peripherals::TIM2>, pin: Peri<'_, peripherals::PB11>) {
    let pin = PwmPin::new(pin, OutputType::PushPull);
    let mode = CountingMode::EdgeAlignedUp;
    let mut pwm = SimplePwm::new(timer, None, None, None, Some(pin), Hertz(1000), mode);
    pwm.ch4().set_duty_cycle_percent(30);
    pwm.ch4().enable();
    block_for(Duration::from_millis(3));
    reach();
}

fn analog(
    mut converter: Peri<'_, peripherals::ADC1>,
    mut bus: Peri<'_, peripherals::PA6>,
    mut warm: Peri<'_, peripherals::PC5>,
) {
    // The bus recovers from the brake resistor's load.
    block_for(Duration::from_millis(2));
    for resolution in [Resolution::BITS8, Resolution::BITS12] {
        let configuration = AdcConfig { resolution: Some(resolution) };
        let mut adc = Adc::new_with_config(converter.reborrow(), configuration);
        give(adc.blocking_read(&mut warm, SampleTime::CYCLES144).into());
    }
    let mut adc = Adc::new(converter);
    give((0..16).map(|_| u32::from(adc.blocking_read(&mut bus, SampleTime::CYCLES84))).sum());
    reach();
}

/// Frames of a DRV8301: second edge, 16 bits. 2.6 MHz.
fn gate_bus() -> spi::Config {
    let mut config = spi::Config::default();
    config.mode = spi::MODE_1;
    config.frequency = Hertz(2_600_000);
    config
}

/// Writes the first control register, requests it, and reads the answer with the frame after that.
fn gate_driver(mut spi: Spi<'_, Blocking, spi::mode::Master>, mut select: Output<'_>) {
    block_for(Duration::from_millis(12));
    let (mut answer, mut cycles) = (0, 0);
    for word in [0x2 << 11 | 0x2A9, 1 << 15 | 0x2 << 11, 1 << 15 | 0x2 << 11] {
        let mut words = [word];
        select.set_low();
        let (outcome, taken) = timed(|| spi.blocking_transfer_in_place::<u16>(&mut words));
        select.set_high();
        block_for(Duration::from_micros(2));
        (answer, cycles) = (if outcome.is_ok() { words[0].into() } else { u32::MAX }, taken);
    }
    give(answer);
    give(cycles);
    reach();
}

fn frame(identifier: u16, data: &[u8]) -> Frame {
    let Ok(frame) = Frame::new_standard(identifier, data) else { stop() };
    frame
}

fn identifier(of: Id) -> u32 {
    match of {
        Id::Standard(identifier) => identifier.as_raw().into(),
        Id::Extended(identifier) => identifier.as_raw() | 1 << 31,
    }
}

async fn frames(mut bus: Can<'_>) {
    bus.modify_filters().enable_bank(0, Fifo::Fifo0, Mask32::accept_all());
    bus.set_bitrate(1_000_000);
    bus.enable().await;
    bus.write(&frame(0x123, &[1, 2, 3])).await;
    bus.write(&frame(0x124, &[])).await;
    bus.flush_all().await;
    reach();
    if let Ok(envelope) = bus.read().await {
        let (header, data) = (envelope.frame.header(), envelope.frame.raw_data());
        let word = |from: usize| {
            data[from..from + 4].iter().rev().fold(0, |word, byte| word << 8 | u32::from(*byte))
        };
        give(identifier(*header.id()));
        give(header.len().into());
        give(word(0));
        give(word(4));
    }
    reach();
    alone(&mut bus).await;
    reach();
}

/// No node acknowledges: an error is reported; a more urgent frame replaces the least urgent of three.
async fn alone(bus: &mut Can<'_>) {
    bus.write(&frame(0x300, &[])).await;
    // The second mailbox sent a frame with this identifier before and is empty.
    give(bus.try_write(&frame(0x124, &[])).is_ok().into());
    give(match bus.read().await {
        Err(BusError::Acknowledge) => 1,
        Err(_) => 2,
        Ok(_) => 3,
    });
    bus.write(&frame(0x100, &[])).await;
    // Until the most urgent of them is on the wire.
    block_for(Duration::from_millis(1));
    let replaced = bus.try_write(&frame(0x050, &[]));
    let replaced = replaced.ok().and_then(|status| status.dequeued_frame().copied());
    give(replaced.map_or(0, |frame| identifier(*frame.id())));
}

/// Sector 11.
fn stored(mut flash: Flash<'_, flash::Blocking>) {
    const SECTOR: u32 = 0xE_0000;
    reach();
    let (erased, cycles) = timed(|| flash.blocking_erase(SECTOR, SECTOR + 0x2_0000));
    give(cycles);
    reach();
    let mut bytes = [0; 16];
    let blank = flash.blocking_read(SECTOR + 0x1_FFF0, &mut bytes);
    give(bytes.iter().fold(u32::MAX, |all, byte| all & (0xFFFF_FF00 | u32::from(*byte))));
    for (slot, word) in bytes.chunks_exact_mut(4).zip(STORED) {
        slot.copy_from_slice(&word.to_le_bytes());
    }
    let (written, cycles) = timed(|| flash.blocking_write(SECTOR + 0x40, &bytes));
    give(cycles);
    let mut back = [0; 16];
    let read = flash.blocking_read(SECTOR + 0x40, &mut back);
    let outcomes = [erased.is_ok(), blank.is_ok(), written.is_ok(), read.is_ok(), back == bytes];
    give(outcomes.iter().rev().fold(0, |word, outcome| word << 1 | u32::from(*outcome)));
    reach();
}

/// 100 ms.
fn watchdog(unit: Peri<'_, peripherals::IWDG>) -> ! {
    let mut watchdog = IndependentWatchdog::new(unit, 100_000);
    let fed = reach() & FED != 0;
    watchdog.unleash();
    if fed {
        watchdog.pet();
    }
    reach();
    stop()
}
