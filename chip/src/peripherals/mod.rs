//! Peripherals of the STM32F405, one file each, after reference manual RM0090.
//!
//! | module | peripheral | chapter |
//! | --- | --- | --- |
//! | [`rcc`] | clocks and resets | 7 |
//! | [`flash`] | flash interface, and the power controller's bits for it | 3, 5 |
//! | [`gpio`] | ports | 8 |
//! | [`exti`] | external interrupts and their selection (SYSCFG) | 9, 12 |
//! | [`timer`] | counters of TIM1 to TIM5 and TIM8 | 17, 18 |
//! | [`pwm`] | outputs of TIM1 and TIM8: dead time, main output | 17 |
//! | [`adc`] | converters ADC1 to ADC3 | 13 |
//! | [`spi`] | SPI3 | 28 |
//! | [`as5047p`] | absolute encoders on it | AS5047P data sheet |
//! | [`drv8301`] | both gate drivers on it | DRV8301 data sheet |
//! | [`can`] | CAN1 | 32 |
//! | [`iwdg`] | independent watchdog | 21 |
//! | [`debug`] | DBGMCU, unique number, one-time programmable memory, cycle counter | 38, 39 |

pub mod adc;
pub mod as5047p;
pub mod can;
pub mod debug;
pub mod drv8301;
pub mod exti;
pub mod flash;
pub mod gpio;
pub mod iwdg;
pub mod pwm;
pub mod rcc;
pub mod spi;
pub mod timer;
