//! Register values of the microcontroller, as plain data.
//!
//! A test on the host (`cargo test --test firmware board_registers:: -- --nocapture`) applies these lists to
//! empty registers. The test derives frequency, phase, dead time, channels and pins, and prints the table.

pub mod absolute_encoders;
pub mod analog;
pub mod can;
pub mod chopper;
pub mod converters;
pub mod drives;
pub mod encoders;
pub mod external;
pub mod flash;
pub mod gate_driver;
pub mod pins;
pub mod timers;

use scarab_boot::SUPPLY_LEVEL;

/// Write of a register, or of some of its bits.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Write {
    /// Name as in RM0090; the device has no use for it.
    #[cfg(not(target_os = "none"))]
    pub register: &'static str,
    /// Address of the register.
    pub address: u32,
    /// Bits to write; with all bits the register is not read first.
    pub mask: u32,
    /// Value of those bits.
    pub value: u32,
}

impl Write {
    /// Writes a whole register.
    pub const fn whole(register: &'static str, address: u32, value: u32) -> Self {
        Self::bits(register, address, u32::MAX, value)
    }

    /// Writes some bits of a register.
    pub const fn bits(register: &'static str, address: u32, mask: u32, value: u32) -> Self {
        #[cfg(target_os = "none")]
        let _ = register;
        Self {
            #[cfg(not(target_os = "none"))]
            register,
            address,
            mask,
            value,
        }
    }

    /// Value of a register after this write, for its value `before`.
    pub const fn applied_to(&self, before: u32) -> u32 {
        (before & !self.mask) | (self.value & self.mask)
    }
}

/// The processor's clock, Hz: 8 MHz / 4 * 168 / 2 (`Board/v3/Src/main.c:177-182`).
pub const CLOCK_HZ: u32 = 168_000_000;
/// Clock of the timers on APB2 (TIM1, TIM8), Hz.
pub const FAST_TIMER_HZ: u32 = crate::hal::BRIDGE_CLOCK_HZ;
/// Clock of the timers on APB1 (TIM2 to TIM5), Hz.
pub const SLOW_TIMER_HZ: u32 = 84_000_000;

const RCC: u32 = 0x4002_3800;
const FLASH: u32 = 0x4002_3C00;
const DEBUG: u32 = 0xE004_2000;
const PWR: u32 = 0x4000_7000;

/// Flash prefetch and both caches, which reset and `embassy-stm32` leave off (RM0090 3.9.1:
/// PRFTEN, ICEN, DCEN).
pub const CACHES: [Write; 1] = [Write::bits("FLASH_ACR", FLASH, 7 << 8, 7 << 8)];

/// Clock enables of the used peripherals (RM0090 7.3): ports A to D; TIM2, TIM3, TIM4; TIM1, TIM8, ADC1 to
/// ADC3, SYSCFG; the power controller.
pub const CLOCKS: [Write; 3] = [
    Write::bits("RCC_AHB1ENR", RCC + 0x30, 0b1111, 0b1111),
    Write::bits("RCC_APB1ENR", RCC + 0x40, 1 << 28 | 0b111, 1 << 28 | 0b111),
    Write::bits("RCC_APB2ENR", RCC + 0x44, 0x4703, 0x4703),
];

/// While a debugger holds the processor, the bridges' timers stand with their outputs off (RM0090 38.16:
/// DBG_TIM1_STOP, DBG_TIM8_STOP). The watchdog runs on and ends the halt after 16 ms (DBG_IWDG_STOP = 0),
/// since the brake resistor's timer would hold its last duty for the whole halt.
pub const DEBUG_FREEZE: [Write; 2] = [
    Write::bits("DBGMCU_APB1_FZ", DEBUG + 0x08, 1 << 12, 0),
    Write::bits("DBGMCU_APB2_FZ", DEBUG + 0x0C, 0b11, 0b11),
];

/// Clock security: failure of the crystal raises the non-maskable interrupt (RCC_CR CSSON), which turns the
/// bridges off. Until then the timers run on, 10.5 times slower. Their break input, which would act in
/// hardware, needs BKE, and its pins are in use.
pub const CLOCK_SECURITY: [Write; 1] = [Write::bits("RCC_CR", RCC, 1 << 19, 1 << 19)];

/// Voltage detector of the processor's supply (PWR_CR PVDE, PLS).
pub const SUPPLY_DETECTOR: [Write; 1] =
    [Write::bits("PWR_CR", PWR, 0b1111 << 4, (SUPPLY_LEVEL as u32) << 5 | 1 << 4)];
/// PWR_CSR, and its bit that shows a supply below the detector's level (PVDO).
pub const SUPPLY: (u32, u32) = (PWR + 0x04, 1 << 2);

/// Clears the interrupt of clock security (RCC_CIR CSSC).
pub const CLOCK_FAILURE_SEEN: Write = Write::bits("RCC_CIR", RCC + 0x0C, 1 << 23, 1 << 23);

/// RCC_CSR, with the reasons of the last reset from bit 25 on, and the bit that clears them (RMVF).
pub const RESET_REASONS: Write = Write::bits("RCC_CSR", RCC + 0x74, 1 << 24, 1 << 24);

/// Writes timers, pins and converters in the order of the start: a pin is connected only to a timer that
/// holds it off.
pub fn prepare(mut write: impl FnMut(&[Write])) {
    (0..2).for_each(|axis| write(&timers::bridge(axis)));
    write(&chopper::CHOPPER);
    encoders::ENCODERS.iter().for_each(|list| write(list));
    write(&timers::ready());
    pins::PINS.iter().for_each(|pin| write(&pin.writes()));
    write(&converters::CONVERTERS);
}
