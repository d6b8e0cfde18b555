//! Report of an identification on the emulated microcontroller.

use serde::Serialize;
use sha2::{Digest, Sha256};

use crate::report::RunReport;
use crate::report::trace::LoopReport;

/// Identification on the emulated microcontroller.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct EmulationReport {
    /// Report as of any trace.
    #[serde(flatten)]
    pub run: RunReport,
    /// Current and servo ticks that were late or missed.
    pub missed_ticks: u32,
    /// Longest servo tick including its current ticks.
    pub worst_tick_instructions: u32,
    /// Instructions counted by the firmware during the run.
    pub instructions: Instructions,
    /// Deepest use of the stack.
    pub stack_bytes: u32,
    /// Size of the records as sent.
    pub trace_bytes: usize,
    /// SHA-256 of the records as sent, hexadecimal.
    pub trace_sha256: String,
}

/// Instruction counts; one instruction takes 8 ns of emulated time.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
pub struct Instructions {
    /// Longest current tick of both axes together, at 24 kHz.
    pub current_tick_worst: u32,
    /// Longest servo tick including its current ticks, at 4 kHz.
    pub servo_tick_worst: u32,
    /// Instructions between two servo ticks.
    pub servo_period: u32,
}

impl EmulationReport {
    /// Report of a run with its loops and its records as sent.
    #[must_use]
    pub fn new(run: RunReport, loops: &LoopReport, trace: &[u8]) -> Self {
        Self {
            run,
            missed_ticks: loops.current_missed + loops.servo_missed,
            worst_tick_instructions: loops.servo_worst,
            instructions: Instructions {
                current_tick_worst: loops.current_worst,
                servo_tick_worst: loops.servo_worst,
                servo_period: loops.cycles_per_tick,
            },
            stack_bytes: loops.stack_used,
            trace_bytes: trace.len(),
            trace_sha256: Sha256::digest(trace).iter().map(|byte| format!("{byte:02x}")).collect(),
        }
    }

    /// Summary in a few lines.
    #[must_use]
    pub fn lines(&self, stack_there_is: u32, wall_s: f64) -> String {
        let Instructions { current_tick_worst, servo_tick_worst, servo_period } = self.instructions;
        format!(
            "\nemulated processor: {} ticks missed; longest servo tick {servo_tick_worst} of {servo_period} instructions, current \
             ticks in it included; longest current tick of both axes {current_tick_worst} of {}\n\
             stack: {} of {stack_there_is} bytes used; trace: {} bytes, SHA-256 {}\n\
             the run took {wall_s:.0} s\n",
            self.missed_ticks,
            servo_period / 6,
            self.stack_bytes,
            self.trace_bytes,
            self.trace_sha256,
        )
    }
}
