//! Reads records into typed values; a missing key or invalid value is an error.

use scarab::trace::{Line, LineError};

/// Most joints of a leg.
pub const JOINTS: usize = 3;

/// Reads a list of values of any length.
pub fn list<V: std::str::FromStr>(line: &Line<'_>, key: &'static str) -> Result<Vec<V>, LineError<'static>> {
    let wrong = LineError::Value(key);
    let text = text(line, key)?;
    let inside = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).ok_or(wrong)?;
    if inside.is_empty() {
        return Ok(Vec::new());
    }
    inside.split(", ").map(|item| item.parse().map_err(|_| wrong)).collect()
}

/// Reads a value.
pub fn value<V: std::str::FromStr>(line: &Line<'_>, key: &'static str) -> Result<V, LineError<'static>> {
    text(line, key)?.parse().map_err(|_| LineError::Value(key))
}

/// Reads a word.
pub fn text(line: &Line<'_>, key: &'static str) -> Result<String, LineError<'static>> {
    // The line's own lookup returns an error tied to the line's text; only the key is needed here.
    line.text(key).map(str::to_owned).map_err(|_| LineError::Missing(key))
}

/// Reads a hexadecimal number.
pub fn hex(line: &Line<'_>, key: &'static str) -> Result<u32, LineError<'static>> {
    let text = text(line, key)?;
    let digits = text.strip_prefix("0x").ok_or(LineError::Value(key))?;
    u32::from_str_radix(digits, 16).map_err(|_| LineError::Value(key))
}

/// Description of an error.
#[must_use]
pub fn words(kind: &str, error: LineError<'_>) -> String {
    match error {
        LineError::Kind => "is not a record".into(),
        LineError::Pair(pair) => format!("`{kind}`: `{pair}` is not key=value"),
        LineError::Missing(key) => format!("`{kind}`: `{key}` is missing"),
        LineError::Value(key) => format!("`{kind}`: the value of `{key}` cannot be read"),
    }
}

/// Declares a record: its fields are the keys, each read by the named function.
macro_rules! record {
    ($(#[$about:meta])* $name:ident { $( $(#[$what:meta])* $field:ident: $type:ty = $way:ident, )* }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $( $(#[$what])* pub $field: $type, )* }

        impl $name {
            /// Reads the record from a line.
            ///
            /// # Errors
            /// A key is missing or a value is invalid.
            pub fn read(line: &Line<'_>) -> Result<Self, LineError<'static>> {
                Ok(Self { $( $field: $way(line, stringify!($field))?, )* })
            }
        }
    };
}

record! {
    /// Start of the image.
    Boot {
        /// Version of the records' grammar.
        grammar: u8 = value,
        /// Version of the firmware.
        version: String = text,
        /// Leg that the image is built for.
        leg: String = text,
        /// Number of joints.
        joints: usize = value,
        /// Number of base parameters.
        base: usize = value,
        /// Servo ticks per second.
        servo_hz: u32 = value,
        /// Logged samples per second.
        log_hz: u32 = value,
        /// Cause of the reset.
        reset: String = text,
    }
}
record! {
    /// Identity of the board.
    Board {
        /// Unique number of the processor, first word.
        uid0: u32 = hex,
        /// Unique number, second word.
        uid1: u32 = hex,
        /// Unique number, third word.
        uid2: u32 = hex,
        /// Hardware version burnt into the board.
        version: u8 = value,
        /// Minor hardware version.
        version_minor: u8 = value,
        /// Voltage variant of the hardware.
        version_volt: u8 = value,
        /// Clock of the processor, Hz.
        clock_hz: u32 = value,
    }
}
record! {
    /// Progress of a running search.
    Progress {
        /// Servo tick.
        tick: u32 = value,
        /// Iterations the swarm has run.
        iterations: u32 = value,
        /// Evaluations of the swarm's cost.
        evaluations: u32 = value,
        /// Chi-square of the best cost above least squares.
        excess_chi2: f32 = value,
    }
}
record! {
    /// State of the leg.
    State {
        /// Servo tick.
        tick: u32 = value,
        /// State of the drive.
        drive: String = text,
        /// Activity of the leg.
        activity: String = text,
        /// Phase of the activity.
        phase: String = text,
        /// Motion of the validation, from 1.
        motion: u8 = value,
    }
}
record! {
    /// One sample of the log.
    Sample {
        /// Last of the sample's eight servo ticks.
        tick: u32 = value,
        /// Purpose: training or validation.
        segment: String = text,
        /// Motion of the validation, from 1.
        motion: u8 = value,
        /// Joint angles in the model's convention.
        position_rad: Vec<f32> = list,
        /// Joint torques in the model's convention.
        torque_nm: Vec<f32> = list,
        /// Sums of eight encoder counts, in the drive's sign: the same angles, exact.
        counts: Vec<i32> = list,
    }
}
record! {
    /// Statistics of the loops.
    Loops {
        /// Servo tick.
        tick: u32 = value,
        /// Longest current tick since the last record.
        current_worst: u32 = value,
        /// Longest servo tick since the last record.
        servo_worst: u32 = value,
        /// Current ticks missed since the start.
        current_missed: u32 = value,
        /// Servo ticks missed since the start.
        servo_missed: u32 = value,
        /// Processor cycles per servo tick.
        cycles_per_tick: u32 = value,
        /// Deepest use of the stack, bytes.
        stack_used: u32 = value,
        /// Size of the stack, bytes.
        stack_bytes: u32 = value,
        /// Samples lost since the start.
        samples_lost: u32 = value,
        /// Records lost since the start.
        records_lost: u32 = value,
    }
}
record! {
    /// Supply and temperatures.
    Supply {
        /// Servo tick.
        tick: u32 = value,
        /// Lowest bus voltage since the last record.
        bus_low_v: f32 = value,
        /// Highest bus voltage since the last record.
        bus_high_v: f32 = value,
        /// Temperature of each bridge.
        bridge_c: Vec<f32> = list,
        /// Temperature of the brake chopper.
        chopper_c: f32 = value,
    }
}

pub(super) use record;
