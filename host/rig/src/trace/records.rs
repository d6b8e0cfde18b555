//! Records of a trace as typed values, declared from the firmware's own list (`scarab::trace_records!`).
//!
//! A missing key or an invalid value is an error. Keys that were added to a kind later are unknown in the
//! traces of older images.

use scarab::trace::{Line, LineError};

/// Joints in the list's types; lists of any length are read.
const N: usize = 1;

/// Type of a field, and how its value is read back.
pub trait Field {
    /// What is read.
    type Value;
    /// Reads the text behind a key; `None` if it is invalid.
    fn read(text: &str) -> Option<Self::Value>;
    /// Reads a whole number in base 16.
    fn read_hex(_digits: &str) -> Option<Self::Value> {
        None
    }
}

macro_rules! fields {
    ($($type:ty $(, $from_digits:ident)?;)*) => {$(
        impl Field for $type {
            type Value = Self;
            fn read(text: &str) -> Option<Self> {
                text.parse().ok()
            }
            $(fn read_hex(digits: &str) -> Option<Self> {
                Self::$from_digits(digits, 16).ok()
            })?
        }
    )*};
}
fields!(u64; i32; f32; bool; u16, from_str_radix; u32, from_str_radix;);

/// One byte is a count or an index.
impl Field for u8 {
    type Value = usize;
    fn read(text: &str) -> Option<usize> {
        text.parse::<Self>().ok().map(usize::from)
    }
}

impl Field for &str {
    type Value = String;
    fn read(text: &str) -> Option<String> {
        Some(text.to_owned())
    }
}

impl<F: Field, const COUNT: usize> Field for [F; COUNT] {
    type Value = Vec<F::Value>;
    fn read(text: &str) -> Option<Self::Value> {
        let inside = text.strip_prefix('[')?.strip_suffix(']')?;
        if inside.is_empty() {
            return Some(Vec::new());
        }
        inside.split(", ").map(F::read).collect()
    }
}

/// Reads the value of a key as the format of its kind writes it.
fn value<F: Field>(line: &Line<'_>, key: &'static str, format: &str) -> Result<F::Value, LineError<'static>> {
    let text = line.text(key)?;
    let (_, hint) = format.split_once(&format!(" {key}={{=")).ok_or(LineError::Missing(key))?;
    let is_hex = hint.split('}').next().is_some_and(|hint| hint.ends_with(":#x"));
    let value = if is_hex { text.strip_prefix("0x").and_then(F::read_hex) } else { F::read(text) };
    value.ok_or(LineError::Value(key))
}

/// Returns whether this is the format of a kind.
fn is_of_kind(format: &str, kind: &str) -> bool {
    format.strip_prefix(kind).is_some_and(|rest| rest.starts_with(' '))
}

/// Declares a struct for each kind, and the enumerations of the kinds and of all records.
macro_rules! readers {
    ($(
        $(#[$about:meta])*
        $name:ident $format:tt { $( $(#[$what:meta])* $field:ident: $type:ty, )* }
        $( + { $( $(#[$late_what:meta])* $late:ident: $late_type:ty, )* } )?
    )*) => {
        $(
            #[derive(Clone, Debug, PartialEq)]
            pub struct $name {
                $( pub $field: <$type as Field>::Value, )*
                $( $( pub $late: Option<<$late_type as Field>::Value>, )* )?
            }

            impl $name {
                fn read(line: &Line<'_>) -> Result<Self, LineError<'static>> {
                    Ok(Self {
                        $( $field: value::<$type>(line, stringify!($field), $format)?, )*
                        $( $( $late: value::<$late_type>(line, stringify!($late), $format).ok(), )* )?
                    })
                }
            }
        )*

        /// Kind of a record.
        #[derive(Clone, Copy, Debug, PartialEq, Eq)]
        pub enum Kind { $($name,)* }

        impl Kind {
            /// Kind of this name; `None` for one that this version does not know.
            pub fn from_name(name: &str) -> Option<Self> {
                $( if is_of_kind($format, name) { return Some(Self::$name); } )*
                None
            }
        }

        /// A record that was read.
        #[derive(Clone, Debug, PartialEq)]
        pub enum Received { $($name($name),)* }

        impl Received {
            /// Reads a record of this kind.
            ///
            /// # Errors
            /// A key is missing or a value is invalid.
            pub fn read(kind: Kind, line: &Line<'_>) -> Result<Self, LineError<'static>> {
                Ok(match kind { $( Kind::$name => Self::$name($name::read(line)?), )* })
            }
        }
    };
}
scarab::trace_records!(readers);

/// Description of an error.
pub(crate) fn words(kind: &str, error: LineError<'_>) -> String {
    match error {
        LineError::Kind => "is no record".into(),
        LineError::Pair(pair) => format!("`{kind}`: `{pair}` is not key=value"),
        LineError::Missing(key) => format!("`{kind}`: `{key}` is missing"),
        LineError::Value(key) => format!("`{kind}`: the value of `{key}` cannot be read"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(line: &str) -> Result<Received, LineError<'static>> {
        let line = Line::parse(line).expect(line);
        Received::read(Kind::from_name(line.kind()).expect("a kind"), &line)
    }

    #[test]
    fn a_record_is_read_as_its_format_writes_it() {
        let fault = Fault { tick: 12, code: 0x8400, name: "overspeed".into(), joint: 1 };
        assert_eq!(read("fault n=7 tick=12 code=0x8400 name=overspeed joint=1"), Ok(Received::Fault(fault)));
        assert_eq!(read("fault n=7 tick=12 code=33792 name=a joint=1"), Err(LineError::Value("code")));
        assert_eq!(read("fault n=7 tick=0x12 code=0x1 name=a joint=1"), Err(LineError::Value("tick")));
        assert_eq!(read("fault n=7 tick=12 code=0x1 joint=1"), Err(LineError::Missing("name")));
        let change = read("change n=1 since_s=1.5 joints=[true, false] statistic=[] limit=9");
        assert!(
            matches!(change, Ok(Received::Change(change)) if change.joints == [true, false] && change.statistic.is_empty())
        );
        assert_eq!(Kind::from_name("faults"), None);
    }

    #[test]
    fn keys_of_later_images_are_unknown_in_older_traces() {
        let older = "crash n=0 cause=panic pc=0x1 lr=0x2 status=0x0 address=0x0 line=7 file=a.rs";
        let clock = |line: &str| match read(line) {
            Ok(Received::Crash(crash)) => (crash.released, crash.kept),
            other => panic!("{other:?}"),
        };
        assert_eq!(clock(older), (None, None));
        assert_eq!(clock(&format!("{older} released=3 kept=4")), (Some(3), Some(4)));
    }
}
