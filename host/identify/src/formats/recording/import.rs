//! What a user states about the files of a replay: columns, units, dialect, and the drives of the leg.
//!
//! ```text
//! --columns  SIGNAL=COLUMN,..      column: its name in the header, or its number from 1
//! --units    UNIT or SIGNAL=UNIT,..   a unit alone holds for all signals of its quantity
//! ```
//!
//! Nothing is guessed: a signal without a stated column has the documented name (`q1_rad`, or `q1_deg` with
//! `--units deg`), and a column whose name states another unit than the one in use is refused.

use std::collections::BTreeMap;
use std::str::FromStr;

use crate::formats::leg_file::{BodySide, LegFile, Side};
use crate::formats::recording::decode::LARGEST_RATE_HZ;
use crate::formats::recording::dialect::{Decimal, Delimiter};
use crate::formats::recording::signal::{Quantity, Signal, Unit};
use crate::formats::recording::suggest::required;

/// Column as a user names it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum ColumnName {
    Name(String),
    /// Number from 1.
    Number(usize),
}

/// One part of `--columns`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ColumnChoice {
    pub(crate) signal: Signal,
    pub(crate) column: ColumnName,
}

impl FromStr for ColumnChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (signal, column) = text
            .split_once('=')
            .ok_or_else(|| format!("`{text}` must be SIGNAL=COLUMN, for example t=time or q1=2"))?;
        let column = match (column.trim(), column.trim().parse()) {
            ("", _) | (_, Ok(0)) => {
                return Err(format!("`{text}` names no column; columns by number count from 1"));
            }
            (_, Ok(number)) => ColumnName::Number(number),
            (name, Err(_)) => ColumnName::Name(name.to_owned()),
        };
        Ok(Self { signal: signal.trim().parse()?, column })
    }
}

/// One part of `--units`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct UnitChoice {
    /// Signal, or all of the unit's quantity.
    pub(crate) signal: Option<Signal>,
    pub(crate) unit: Unit,
}

impl FromStr for UnitChoice {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (signal, name) = match text.split_once('=') {
            Some((signal, name)) => (Some(signal.trim().parse::<Signal>()?), name.trim()),
            None => (None, text.trim()),
        };
        let unit = Unit::named(name)
            .ok_or_else(|| format!("`{name}` is not a unit; units are {}", Unit::names()))?;
        match signal {
            Some(Signal::Torque(joint)) if unit.quantity == Quantity::Current => Err(format!(
                "tau{joint} is a torque; a motor current is the signal i{joint}: --columns i{joint}=COLUMN"
            )),
            Some(signal) if signal.quantity() != unit.quantity => {
                Err(format!("`{name}` is not a unit of the signal {signal}"))
            }
            _ => Ok(Self { signal, unit }),
        }
    }
}

/// What the leg file states about one joint's drive.
#[derive(Clone, Debug, PartialEq)]
pub struct Drive {
    /// Name of the joint.
    pub joint: String,
    /// Joint torque per motor current, N m/A, negative for a drive that is mounted mirrored; none unless the
    /// leg file states it.
    pub torque_per_ampere: Option<f64>,
    /// Motor turns per joint turn, with the same sign; none unless the leg file states an encoder at the
    /// motor.
    pub motor_ratio: Option<f64>,
}

/// Everything stated about the files.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Import {
    pub columns: BTreeMap<Signal, ColumnName>,
    pub by_quantity: Vec<Unit>,
    pub by_signal: BTreeMap<Signal, Unit>,
    pub delimiter: Option<Delimiter>,
    pub decimal: Option<Decimal>,
    pub skip_bad: bool,
    /// Rate of the rows of a file without a column of time, Hz.
    pub rate_hz: Option<f64>,
    /// Whether an even clock replaces the time stamps, which may then repeat.
    pub even_stamps: bool,
    /// Whether rows that hold some of the signals each are joined by time.
    pub merge_rows: bool,
    /// Drives of the joints to read, proximal first.
    pub drives: Vec<Drive>,
    /// Command line without `--columns` and `--units`, for proposals.
    pub command: String,
}

impl Import {
    /// Documented format with this number of joints.
    pub fn plain(joints: usize) -> Self {
        let drive =
            |joint: usize| Drive { joint: joint.to_string(), torque_per_ampere: None, motor_ratio: None };
        let drives = (1..=joints).map(drive).collect();
        Self { drives, command: "cargo sim replay".to_owned(), ..Self::default() }
    }

    /// Documented format for a leg whose file holds this text.
    pub fn from_leg(leg: &LegFile, text: &str) -> Self {
        let states_constant = LegFile::joints_that_state(text, "torque_per_ampere");
        let states_encoder = LegFile::joints_that_state(text, "encoder");
        let mounting = if leg.side == BodySide::Left { -1.0 } else { 1.0 };
        let states = |stated: &[bool], joint: usize| stated.get(joint).copied().unwrap_or(false);
        let drives = leg.joints.iter().enumerate().map(|(number, joint)| {
            let is_at_motor = joint.encoder.side == Side::Motor && states(&states_encoder, number);
            Drive {
                joint: joint.name.clone(),
                torque_per_ampere: states(&states_constant, number)
                    .then_some(mounting * joint.torque_per_ampere),
                motor_ratio: is_at_motor.then_some(mounting * joint.encoder.ratio),
            }
        });
        Self { drives: drives.collect(), ..Self::plain(0) }
    }

    /// With these columns and units.
    ///
    /// # Errors
    /// Signals or units that are stated twice or contradict each other, or joints that the leg lacks.
    pub fn with(mut self, columns: &[ColumnChoice], units: &[UnitChoice]) -> Result<Self, String> {
        let joints = self.drives.len();
        if self.rate_hz.is_some_and(|rate| !(rate > 0.0 && rate <= LARGEST_RATE_HZ)) {
            return Err(format!("--rate: must be above 0 and at most {LARGEST_RATE_HZ} Hz"));
        }
        if self.rate_hz.is_some() && columns.iter().any(|choice| choice.signal == Signal::Time) {
            return Err("--rate is for files without a column of time: leave out `t` of --columns".to_owned());
        }
        let check = |option: &str, signal: Signal| match signal.joint() {
            Some(joint) if joint > joints => Err(format!(
                "{option} {signal}: the leg has {joints} joint{}",
                if joints == 1 { "" } else { "s" }
            )),
            _ => Ok(()),
        };
        for ColumnChoice { signal, column } in columns {
            check("--columns", *signal)?;
            if self.columns.insert(*signal, column.clone()).is_some() {
                return Err(format!("--columns: {signal} is named twice"));
            }
        }
        for joint in 1..=joints {
            for (one, other) in [
                (Signal::Angle(joint), Signal::MotorAngle(joint)),
                (Signal::Torque(joint), Signal::Current(joint)),
            ] {
                if self.columns.contains_key(&one) && self.columns.contains_key(&other) {
                    return Err(format!(
                        "--columns: {one} and {other} are the same quantity of joint {joint}: name one"
                    ));
                }
            }
        }
        for UnitChoice { signal, unit } in units {
            let is_repeated = match signal {
                Some(signal) => {
                    check("--units", *signal)?;
                    self.by_signal.insert(*signal, *unit).is_some()
                }
                None => {
                    let is_repeated = self.by_quantity.iter().any(|other| other.quantity == unit.quantity);
                    self.by_quantity.push(*unit);
                    is_repeated
                }
            };
            if is_repeated {
                return Err(format!("--units: `{}` is a second unit of the same signals", unit.name));
            }
        }
        Ok(self)
    }

    /// Signals that a file must hold, each with those that replace it.
    pub(crate) fn required(&self) -> impl Iterator<Item = Vec<Signal>> {
        required(self.drives.len()).skip(usize::from(self.rate_hz.is_some()))
    }

    /// Unit in use, and whether the user stated it.
    pub fn unit(&self, signal: Signal) -> (Unit, bool) {
        let quantity = signal.quantity();
        let by_quantity = || self.by_quantity.iter().find(|unit| unit.quantity == quantity);
        match self.by_signal.get(&signal).or_else(by_quantity) {
            Some(unit) => (*unit, true),
            None => (quantity.si(), false),
        }
    }
}
