//! Results of a board's trace beyond those of a run.

use serde::Serialize;

/// Further data of a board's trace.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct TraceReport {
    /// Version of the firmware.
    pub firmware: Option<String>,
    /// Description of the board.
    pub board: Option<String>,
    /// Records read.
    pub records: u64,
    /// Records lost on the way.
    pub lost_records: u64,
    /// Unreadable lines that contain a record.
    pub unreadable_lines: u64,
    /// Complete identifications in the trace; the last one is reported.
    pub identifications: usize,
    /// Faults, crashes and refusals to be enabled, in order.
    pub faults: Vec<String>,
    /// Other warnings.
    pub warnings: Vec<String>,
    /// Statistics of the loops.
    pub loops: Option<LoopReport>,
}

/// Statistics over all records; counts since a start are summed over the starts.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LoopReport {
    /// Longest current tick, processor cycles.
    pub current_worst: u32,
    /// Longest servo tick, processor cycles, including the current ticks that interrupt it.
    pub servo_worst: u32,
    /// Current ticks that were late or missed.
    pub current_missed: u32,
    /// Servo ticks that were late or missed.
    pub servo_missed: u32,
    /// Processor cycles per servo tick.
    pub cycles_per_tick: u32,
    /// Deepest use of the stack, bytes.
    pub stack_used: u32,
    /// Size of the stack, bytes.
    pub stack_bytes: u32,
    /// Logged samples that identification did not take in time.
    pub samples_lost: u32,
    /// Records that the board discarded because its buffer was not read.
    pub records_lost: u32,
}
