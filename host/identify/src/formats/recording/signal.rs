//! Signals of a recording and the units in which files hold them.
//!
//! | signal | content | unit |
//! | --- | --- | --- |
//! | `t` | time | s |
//! | `q1`, `q2`, .. | joint angle | rad |
//! | `motor1`, .. | angle of the motor, which the leg file's gear ratio makes a joint angle | rad |
//! | `tau1`, .. | torque at the joint | N m |
//! | `i1`, .. | motor current, which the leg file's torque constant makes a torque | A |

use std::f64::consts::{PI, TAU};
use std::fmt;
use std::str::FromStr;

/// Physical quantity of a column.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Quantity {
    Time,
    Angle,
    Torque,
    Current,
}

impl Quantity {
    pub(crate) const ALL: [Self; 4] = [Self::Time, Self::Angle, Self::Torque, Self::Current];

    /// SI unit, which is the default.
    pub(crate) fn si(self) -> Unit {
        match self {
            Self::Time => UNITS[0],
            Self::Angle => UNITS[4],
            Self::Torque => UNITS[8],
            Self::Current => UNITS[10],
        }
    }
}

/// Unit of a column.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Unit {
    /// Name on the command line and in names of columns.
    pub(crate) name: &'static str,
    pub(crate) quantity: Quantity,
    /// SI value = value * `times` / `over`. Two numbers, so that 1 ms is the double nearest to 0.001 s.
    times: f64,
    over: f64,
}

const fn unit(name: &'static str, quantity: Quantity, times: f64, over: f64) -> Unit {
    Unit { name, quantity, times, over }
}

/// Known units; the SI unit of a quantity comes first.
const UNITS: [Unit; 12] = [
    unit("s", Quantity::Time, 1.0, 1.0),
    unit("ms", Quantity::Time, 1.0, 1e3),
    unit("us", Quantity::Time, 1.0, 1e6),
    unit("ns", Quantity::Time, 1.0, 1e9),
    unit("rad", Quantity::Angle, 1.0, 1.0),
    unit("mrad", Quantity::Angle, 1.0, 1e3),
    unit("deg", Quantity::Angle, PI, 180.0),
    unit("turn", Quantity::Angle, TAU, 1.0),
    unit("Nm", Quantity::Torque, 1.0, 1.0),
    unit("mNm", Quantity::Torque, 1.0, 1e3),
    unit("A", Quantity::Current, 1.0, 1.0),
    unit("mA", Quantity::Current, 1.0, 1e3),
];

/// Other spellings of units in names of columns, in lower case.
const SPELLINGS: [(&str, &str); 23] = [
    ("sec", "s"),
    ("secs", "s"),
    ("second", "s"),
    ("seconds", "s"),
    ("msec", "ms"),
    ("millis", "ms"),
    ("milliseconds", "ms"),
    ("usec", "us"),
    ("micros", "us"),
    ("microseconds", "us"),
    ("µs", "us"),
    ("nsec", "ns"),
    ("nanos", "ns"),
    ("nanosec", "ns"),
    ("nanoseconds", "ns"),
    ("radian", "rad"),
    ("radians", "rad"),
    ("degree", "deg"),
    ("degrees", "deg"),
    ("°", "deg"),
    ("turns", "turn"),
    ("rev", "turn"),
    ("amps", "A"),
];

impl Unit {
    /// Value in the SI unit.
    pub(crate) fn to_si(self, value: f64) -> f64 {
        value * self.times / self.over
    }

    /// SI value of one unit.
    pub(crate) fn factor(&self) -> f64 {
        self.times / self.over
    }

    /// Units of a quantity, the SI unit first.
    pub(crate) fn for_quantity(quantity: Quantity) -> impl Iterator<Item = Self> {
        UNITS.into_iter().filter(move |unit| unit.quantity == quantity)
    }

    /// Unit of this name on the command line.
    pub(crate) fn named(name: &str) -> Option<Self> {
        UNITS.into_iter().find(|unit| unit.name == name)
    }

    /// Unit that a word of a column's name states, in any case and spelling.
    pub(crate) fn spelt(word: &str) -> Option<Self> {
        let lower = word.to_lowercase();
        let name =
            SPELLINGS.iter().find(|(spelling, _)| *spelling == lower).map_or(&*lower, |(_, name)| name);
        UNITS.into_iter().find(|unit| unit.name.eq_ignore_ascii_case(name))
    }

    /// Names of all units, for messages.
    pub(crate) fn names() -> String {
        UNITS.map(|unit| unit.name).join(", ")
    }
}

/// Signal that a column can hold; joints count from 1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Signal {
    Time,
    Angle(usize),
    MotorAngle(usize),
    Torque(usize),
    Current(usize),
}

impl Signal {
    pub(crate) fn quantity(self) -> Quantity {
        match self {
            Self::Time => Quantity::Time,
            Self::Angle(_) | Self::MotorAngle(_) => Quantity::Angle,
            Self::Torque(_) => Quantity::Torque,
            Self::Current(_) => Quantity::Current,
        }
    }

    /// Joint, from 1; none for the time.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Time => None,
            Self::Angle(joint) | Self::MotorAngle(joint) | Self::Torque(joint) | Self::Current(joint) => {
                Some(joint)
            }
        }
    }

    /// Name of its column in a file that follows the documented names.
    pub(crate) fn column(self, unit: Unit) -> String {
        format!("{self}_{}", unit.name)
    }
}

impl fmt::Display for Signal {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Time => formatter.write_str("t"),
            Self::Angle(joint) => write!(formatter, "q{joint}"),
            Self::MotorAngle(joint) => write!(formatter, "motor{joint}"),
            Self::Torque(joint) => write!(formatter, "tau{joint}"),
            Self::Current(joint) => write!(formatter, "i{joint}"),
        }
    }
}

impl FromStr for Signal {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        if text == "t" {
            return Ok(Self::Time);
        }
        let split = text.find(|letter: char| letter.is_ascii_digit()).unwrap_or(text.len());
        let (word, number) = text.split_at(split);
        let signal = match (word, number.parse()) {
            ("q", Ok(joint @ 1..=9)) => Some(Self::Angle(joint)),
            ("motor", Ok(joint @ 1..=9)) => Some(Self::MotorAngle(joint)),
            ("tau", Ok(joint @ 1..=9)) => Some(Self::Torque(joint)),
            ("i", Ok(joint @ 1..=9)) => Some(Self::Current(joint)),
            _ => None,
        };
        signal
            .ok_or_else(|| {
                format!(
                    "`{text}` is not a signal; signals are t, q1, q2, .. (joint angle), motor1, .. (motor angle), tau1, .. \
                     (joint torque), i1, .. (motor current)"
                )
            })
    }
}
