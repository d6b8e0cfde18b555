//! The ODrive v3.6 (and v3.5) joint drive board: STM32F405RG, two bridges with DRV8301, one board per leg.
//!
//! Why register tables: the drivers of `embassy-stm32` lack what this board needs (two timers locked in
//! phase, conversions triggered by both, a chopper). The register writes are a list of plain values
//! ([`settings`]) that a test on the host compares with the board's facts. On the device one loop writes the
//! list. Clocks, SPI, time and executors are `embassy`'s.
//!
//! Order of start (`start`): bridges off by reset, gate drivers off, watchdog, interrupt priorities, clocks,
//! caches, timers without outputs. Then gate drivers configured and read back, timers in phase, triggers,
//! interrupts. The start never switches an output on. Only the current loop does, for a calibrated axis
//! without an inhibit reason.
//!
//! Source of every constant: ODrive firmware v0.5.6 (`Board/v3`, MIT) and ST's RM0090; each names its own.

pub mod settings;

macro_rules! target_only {
    ($($item:item)*) => { $( #[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))] $item )* };
}

target_only! {
    pub mod brake;
    pub mod bridge;
    pub mod can;
    pub mod contacts;
    pub mod converter;
    pub mod crash;
    pub mod encoder;
    pub mod flash;
    pub mod gate_driver;
    pub mod hardware;
    pub mod holding_brake;
    pub mod identity;
    pub mod interrupts;
    pub mod program;
    mod registers;
    pub mod start;
    pub mod status_light;
    pub mod watchdog;
}
