//! A model of the STM32F405 that runs Scarab's unmodified flash image over hal-sim's motors and leg.
//!
//! Why: the board layer, the tasks and the interrupts run nowhere else before a real board. The image's own
//! instructions execute on the Unicorn engine. Peripherals, interrupt controller and time are modelled here,
//! from the reference manual and not from the firmware. Every access that silicon would refuse is a finding.
//!
//! | module | content |
//! | --- | --- |
//! | `time` | ticks of 1/336 MHz |
//! | `findings` | violated rules, with function and reason |
//! | `nvic`, `system` | interrupt controller, system control block |
//! | `peripherals` | one file each |
//! | `plant` | motors, shunts, encoders, supply, leg at the pins |
//! | `chip` | all of it: address map, events, interrupt lines |
//! | `image`, `load` | the ELF; use of the processor |
//! | `machine` | the processor core around the chip; save and restore |
//! | `rtt` | records of the image, as a debug probe reads them |
//! | `session` | an operator at the contacts: calibrate, reference, enable, identify |
//! | `assist` | a session of assistance on a wearer, image against host |
//! | `report` | results as JSON |
//! | `situations` | the processor's load, from idle to a host at 1 kHz |
//! | `stops`, `sampling` | emergency stops over the PWM period; sampling instants |
//! | `update` | a new image over the bus, with damaged images and power cuts |
//! | `store_cuts`, `hangs` | power cuts within flash operations; levels that hang |
//! | `crashes` | panic, hard fault, stack overflow, unhandled interrupt |
//! | `faults` | rows of the fault catalogue |
//! | `drivers` | another project's drivers on the model, against their documentation |
//! | `serve` | the image on the simulated bus, for existing host software |
//! | `cli` | the command line |

#![expect(missing_docs, reason = "part of a program: names and units are stated where they are not obvious")]
#![expect(
    clippy::disallowed_methods,
    reason = "the model runs on the host only and may use std's mathematics"
)]

mod assist;
pub mod chip;
pub mod cli;
mod crashes;
mod drivers;
mod faults;
mod findings;
mod hangs;
pub mod image;
mod load;
pub mod machine;
mod nvic;
mod peripherals;
pub mod plant;
mod report;
mod rtt;
mod sampling;
mod serve;
mod session;
mod situations;
mod stops;
mod store_cuts;
mod system;
pub mod time;
mod update;
