//! Start of the board in the only safe order: nothing here switches an output on.

use embassy_stm32::interrupt::Priority;
use embassy_stm32::rcc::{
    APBPrescaler, Hse, HseMode, Pll, PllMul, PllPDiv, PllPreDiv, PllQDiv, PllSource, Sysclk, mux,
};
use embassy_stm32::spi::Spi;
use embassy_stm32::time::Hertz;

use super::gate_driver::{self, GateDrivers};
use super::identity::Identity;
use super::registers::{apply, load, store};
use super::settings::timers::{BASES, CNT, CR1, DOWN, SR, TOP};
use super::settings::{
    CACHES, CLOCK_SECURITY, CLOCKS, DEBUG_FREEZE, SUPPLY_DETECTOR, converters, external, pins, prepare, timers,
};
use super::{interrupts, watchdog};
use crate::board::crash::{self, Crash};
use crate::board::stack;
use crate::leg::AbsoluteEncoders;

/// A started board, all outputs off.
pub struct Board {
    /// Gate drivers, for repeated checks.
    pub gate_drivers: GateDrivers,
    /// Identity of the board.
    pub identity: Identity,
    /// Crash record of the previous run.
    pub crash: Option<&'static Crash>,
    /// Whether each axis' gate driver holds its configuration.
    pub gates_configured: [bool; 2],
    /// Whether both bridges' timers run half a period apart and take compare values over at zero.
    pub timers_in_phase: bool,
}

/// Longest wait for a timer event: more than two periods.
const PATIENCE: u32 = 100_000;

/// Readings of the bridges' shift, one of which must be right: an interrupt between the loads falsifies one.
const SHIFT_READINGS: u32 = 4;

/// Starts everything but the interrupts of the current loops. Call once, before anything else. `encoders` of
/// each axis share the gate drivers' bus.
pub fn start(encoders: [AbsoluteEncoders; 2]) -> Board {
    stack::prepare();
    apply(&CLOCKS);
    for pin in &pins::GATES_OFF {
        apply(&pin.writes());
    }
    watchdog::start();
    interrupts::set_levels();
    let peripherals = embassy_stm32::init(configuration());
    for list in [&CACHES[..], &CLOCK_SECURITY, &DEBUG_FREEZE, &SUPPLY_DETECTOR] {
        apply(list);
    }
    let identity = Identity::read();
    let crash = crash::take();

    prepare(apply);

    let spi = Spi::new_blocking(
        peripherals.SPI3,
        peripherals.PC10,
        peripherals.PC12,
        peripherals.PC11,
        gate_driver::configuration(),
    );
    let mut gate_drivers = GateDrivers::new(spi, encoders);
    gate_drivers.restart();
    let gates_configured = gate_drivers.configure();

    let timers_in_phase = start_timers();
    apply(&converters::TRIGGERED);
    apply(&external::EXTERNAL);
    gate_drivers.mask_indices();
    let mut core = cortex_m::Peripherals::take();
    if let Some(core) = core.as_mut() {
        core.DCB.enable_trace();
        core.DWT.enable_cycle_counter();
    }
    Board { gate_drivers, identity, crash, gates_configured, timers_in_phase }
}

/// 8 MHz crystal, 168 MHz, buses at 42 and 84 MHz (`Board/v3/Src/main.c:170-197`). Without oscillation the
/// wait lasts until the watchdog resets.
fn configuration() -> embassy_stm32::Config {
    let mut configuration = embassy_stm32::Config::default();
    // DMA is not used; its vectors would otherwise be at level 0.
    configuration.dma_interrupt_priority = Priority::P6;
    // Missed current ticks are counted in cycles, and the cycle counter stands in sleep without DBG_SLEEP.
    configuration.enable_debug_during_sleep = true;
    let rcc = &mut configuration.rcc;
    rcc.hse = Some(Hse { freq: Hertz(8_000_000), mode: HseMode::Oscillator });
    rcc.pll_src = PllSource::HSE;
    rcc.pll = Some(Pll {
        prediv: PllPreDiv::DIV4,
        mul: PllMul::MUL168,
        divp: Some(PllPDiv::DIV2),
        divq: Some(PllQDiv::DIV7),
        divr: None,
    });
    rcc.sys = Sysclk::PLL1_P;
    rcc.apb1_pre = APBPrescaler::DIV4;
    rcc.apb2_pre = APBPrescaler::DIV2;
    rcc.mux.clk48sel = mux::Clk48sel::PLL1_Q;
    configuration
}

/// Starts both bridges' timers in one cycle, half a period apart, and makes them take compare values over at
/// zero. Returns whether both conditions hold.
fn start_timers() -> bool {
    apply(&timers::LOCK_AND_START);
    let running = wait(|| BASES.iter().all(|base| load(base + CR1) & 1 == 1));
    apply(&timers::TRIGGERS);
    let mut in_phase = running;
    for (axis, &base) in BASES.iter().enumerate() {
        // Well inside the falling half, so that no end passes before the write.
        in_phase &= wait(|| is_falling(base) && (TOP / 4..3 * (TOP / 4)).contains(&count(base)));
        apply(&[timers::repetition(axis)]);
        in_phase &= takes_over_at_zero(base);
    }
    in_phase && (0..SHIFT_READINGS).any(|_| half_a_period_apart())
}

/// Reads both counters while TIM1's falls in the middle of its range; TIM8's must rise there.
fn half_a_period_apart() -> bool {
    let [first, second] = BASES;
    let reached = wait(|| is_falling(first) && (TOP / 4..3 * (TOP / 4)).contains(&count(first)));
    let counts = [count(first), count(second), count(first)];
    reached && !is_falling(second) && timers::half_a_period_apart(counts)
}

/// An update flag cleared while the counter rises must not return at the top and must return at zero.
fn takes_over_at_zero(base: u32) -> bool {
    // One period later the repetition counter is loaded.
    let settled = wait(|| !is_falling(base)) && wait(|| is_falling(base)) && wait(|| !is_falling(base));
    store(base + SR, !1);
    let top_is_silent = wait(|| is_falling(base)) && load(base + SR) & 1 == 0;
    let zero_speaks = wait(|| !is_falling(base)) && load(base + SR) & 1 == 1;
    settled && top_is_silent && zero_speaks
}

fn is_falling(base: u32) -> bool {
    load(base + CR1) & DOWN != 0
}

fn count(base: u32) -> u16 {
    load(base + CNT) as u16
}

fn wait(reached: impl Fn() -> bool) -> bool {
    (0..PATIENCE).any(|_| reached())
}
