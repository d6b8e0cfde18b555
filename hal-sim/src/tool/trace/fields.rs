//! Records to values: every key that a report needs, or which one is missing.

use scarab::trace::{Line, LineError};

/// Most joints of a leg.
pub const JOINTS: usize = 3;

/// A list of as many as there are.
pub fn list<V: std::str::FromStr>(line: &Line<'_>, key: &'static str) -> Result<Vec<V>, LineError<'static>> {
    let wrong = LineError::Value(key);
    let text = text(line, key)?;
    let inside = text.strip_prefix('[').and_then(|text| text.strip_suffix(']')).ok_or(wrong)?;
    if inside.is_empty() {
        return Ok(Vec::new());
    }
    inside.split(", ").map(|item| item.parse().map_err(|_| wrong)).collect()
}

/// A value.
pub fn value<V: std::str::FromStr>(line: &Line<'_>, key: &'static str) -> Result<V, LineError<'static>> {
    text(line, key)?.parse().map_err(|_| LineError::Value(key))
}

/// A word.
pub fn text(line: &Line<'_>, key: &'static str) -> Result<String, LineError<'static>> {
    // The line's own lookup ties the error to the line's text; here only the key is wanted.
    line.text(key).map(str::to_owned).map_err(|_| LineError::Missing(key))
}

/// A number in base 16.
pub fn hex(line: &Line<'_>, key: &'static str) -> Result<u32, LineError<'static>> {
    let text = text(line, key)?;
    let digits = text.strip_prefix("0x").ok_or(LineError::Value(key))?;
    u32::from_str_radix(digits, 16).map_err(|_| LineError::Value(key))
}

/// What is wrong, in words.
#[must_use]
pub fn words(kind: &str, error: LineError<'_>) -> String {
    match error {
        LineError::Kind => "is no record".into(),
        LineError::Pair(pair) => format!("`{kind}`: `{pair}` is not key=value"),
        LineError::Missing(key) => format!("`{kind}`: `{key}` is missing"),
        LineError::Value(key) => format!("`{kind}`: the value of `{key}` cannot be read"),
    }
}

/// Declares a record that is read: its fields are the keys, read in the way that is named.
macro_rules! told {
    ($(#[$about:meta])* $name:ident { $( $(#[$what:meta])* $field:ident: $type:ty = $way:ident, )* }) => {
        $(#[$about])*
        #[derive(Clone, Debug, PartialEq)]
        pub struct $name { $( $(#[$what])* pub $field: $type, )* }

        impl $name {
            /// Reads a record.
            ///
            /// # Errors
            /// A key that is missing, a value that is none.
            pub fn read(line: &Line<'_>) -> Result<Self, LineError<'static>> {
                Ok(Self { $( $field: $way(line, stringify!($field))?, )* })
            }
        }
    };
}

told! {
    /// The image started.
    Boot {
        /// Of the records.
        grammar: u8 = value,
        /// Of the firmware.
        version: String = text,
        /// It is built for.
        leg: String = text,
        /// Of the leg.
        joints: usize = value,
        /// Base parameters.
        base: usize = value,
        /// Ticks per second.
        servo_hz: u32 = value,
        /// Samples per second.
        log_hz: u32 = value,
        /// Why it started.
        reset: String = text,
    }
}
told! {
    /// Which board.
    Board {
        /// Unique number.
        uid0: u32 = hex,
        /// The same.
        uid1: u32 = hex,
        /// The same.
        uid2: u32 = hex,
        /// Burnt in.
        version: u8 = value,
        /// The same.
        version_minor: u8 = value,
        /// The same.
        version_volt: u8 = value,
        /// Of the processor.
        clock_hz: u32 = value,
    }
}
told! {
    /// The search goes on.
    Progress {
        /// Servo tick.
        tick: u32 = value,
        /// Of the swarm.
        iterations: u32 = value,
        /// Of the swarm.
        evaluations: u32 = value,
        /// Above least squares.
        excess_chi2: f32 = value,
    }
}
told! {
    /// What the leg does.
    State {
        /// Servo tick.
        tick: u32 = value,
        /// Of the drive.
        drive: String = text,
        /// Of the leg.
        activity: String = text,
        /// Of the activity.
        phase: String = text,
        /// Of the validation, from 1.
        motion: u8 = value,
    }
}
told! {
    /// One sample of the log.
    Sample {
        /// Last of its servo ticks.
        tick: u32 = value,
        /// What for.
        segment: String = text,
        /// Of the validation, from 1.
        motion: u8 = value,
        /// Of the model.
        position_rad: Vec<f32> = list,
        /// Of the model.
        torque_nm: Vec<f32> = list,
        /// Sums.
        counts: Vec<i32> = list,
    }
}
told! {
    /// How the loops do.
    Loops {
        /// Servo tick.
        tick: u32 = value,
        /// Longest since the record before.
        current_worst: u32 = value,
        /// Longest since the record before.
        servo_worst: u32 = value,
        /// Since the start.
        current_missed: u32 = value,
        /// Since the start.
        servo_missed: u32 = value,
        /// Of the servo.
        cycles_per_tick: u32 = value,
        /// Deepest.
        stack_used: u32 = value,
        /// There are.
        stack_bytes: u32 = value,
        /// Since the start.
        samples_lost: u32 = value,
        /// Since the start.
        records_lost: u32 = value,
    }
}
told! {
    /// Supply and temperatures.
    Supply {
        /// Servo tick.
        tick: u32 = value,
        /// Lowest since the record before.
        bus_low_v: f32 = value,
        /// Highest since the record before.
        bus_high_v: f32 = value,
        /// Of each bridge.
        bridge_c: Vec<f32> = list,
        /// Of the chopper.
        chopper_c: f32 = value,
    }
}

pub(super) use told;
