//! Columns of a recording's signals, with the conversion of each to the SI value of time, joint angle and
//! joint torque.

use std::collections::BTreeMap;

use crate::formats::recording::columns::Column;
use crate::formats::recording::fault::Fault;
use crate::formats::recording::import::{ColumnName, Import};
use crate::formats::recording::signal::{Quantity, Signal, Unit};
use crate::formats::recording::suggest::{
    Reading, advice, choices_of_joint, command, documented, nearest, readings, unit_in_name, without_header,
};
use crate::formats::recording::{LARGEST_POSITION_RAD, LARGEST_TIME_S, LARGEST_TORQUE_NM};
use crate::report::reading::ColumnReport;

/// Names of a file's columns.
pub(crate) struct Names {
    pub(crate) names: Vec<String>,
    /// Units that the file states beside the names; may be shorter.
    pub(crate) units: Vec<Option<Unit>>,
    /// Whether the file states the names; otherwise they are its first row.
    pub(crate) are_stated: bool,
}

impl Names {
    /// Unit of this quantity that the file or the column's name states.
    pub fn unit(&self, index: usize, quantity: Quantity) -> Option<Unit> {
        let of_file = self.units.get(index).copied().flatten().filter(|unit| unit.quantity == quantity);
        of_file.or_else(|| unit_in_name(self.names.get(index)?, quantity))
    }
}

/// Column of one signal.
#[derive(Clone, Debug)]
pub(crate) struct Chosen {
    pub(crate) signal: Signal,
    pub(crate) column: Column,
    unit: Unit,
    /// Effect of the joint's drive: torque constant, or one over the gear ratio.
    drive: f64,
    by: Option<&'static str>,
    /// Largest plausible SI value.
    limit: f64,
}

impl Chosen {
    /// SI value of the time, joint angle or joint torque.
    pub(crate) fn value(&self, number: f64) -> Result<f64, Fault> {
        let value = self.si(number);
        if value.abs() > self.limit {
            return Err(Fault::Absurd {
                column: self.column.name.clone(),
                value: number,
                limit: self.largest(),
                advice: String::new(),
            });
        }
        Ok(value)
    }

    fn factor(&self) -> f64 {
        self.unit.factor() * self.drive
    }

    /// SI value, also of a number out of range.
    pub(crate) fn si(&self, number: f64) -> f64 {
        self.unit.to_si(number) * self.drive
    }

    /// Largest magnitude accepted, as the file holds it.
    pub(crate) fn largest(&self) -> f64 {
        self.limit / self.factor().abs()
    }

    /// How the column is read, for a proposal.
    pub fn reading(&self) -> Reading {
        let Column { index, name } = &self.column;
        let column = if name.contains(',') { (index + 1).to_string() } else { name.clone() };
        Reading { signal: self.signal, column, unit: self.unit }
    }

    pub(crate) fn report(&self) -> ColumnReport {
        ColumnReport {
            signal: self.signal.to_string(),
            column: self.column.name.clone(),
            unit: self.unit.name.to_owned(),
            factor: self.factor(),
            by: self.by,
        }
    }
}

/// Columns of time, then angle and torque of each joint; and the number of joints that the file holds.
pub(crate) fn choose(names: &Names, import: &Import) -> Result<(Vec<Chosen>, usize), Fault> {
    let joints = import.drives.len();
    let finder = Finder { names, import };
    let mut found = BTreeMap::new();
    let mut missing = None;
    let mut order = Vec::new();
    if import.rate_hz.is_some() && finder.has_documented(&[Signal::Time]) {
        return Err(Fault::RateAndTime(Signal::Time.column(import.unit(Signal::Time).0)));
    }
    for choices in import.required() {
        match finder.find(&choices)? {
            Some((signal, column)) => {
                found.insert(signal, column);
                order.push(signal);
            }
            None => {
                missing.get_or_insert(choices[0]);
            }
        }
    }
    for (index, one) in order.iter().enumerate() {
        let column: &Column = &found[one];
        if let Some(other) = order[index + 1..].iter().find(|other| found[*other].index == column.index) {
            return Err(Fault::SharedColumn { column: column.name.clone(), one: *one, other: *other });
        }
    }
    if let Some(signal) = missing {
        return Err(finder.missing(signal, &found));
    }
    let columns = order.iter().map(|signal| finder.chosen(*signal, &found)).collect::<Result<Vec<_>, _>>()?;
    let has_joint =
        |joint: &usize| choices_of_joint(*joint).iter().all(|choices| finder.has_documented(choices));
    let documented = (1..=names.names.len()).take_while(has_joint).count();
    Ok((columns, documented.max(joints)))
}

struct Finder<'a> {
    names: &'a Names,
    import: &'a Import,
}

impl Finder<'_> {
    /// Column of the first of these signals that is stated, or else has a documented name.
    fn find(&self, choices: &[Signal]) -> Result<Option<(Signal, Column)>, Fault> {
        for signal in choices {
            match self.import.columns.get(signal) {
                Some(ColumnName::Number(number)) => {
                    let columns = self.names.names.len();
                    let name = self.names.names.get(number - 1).ok_or(Fault::NoSuchColumn {
                        signal: *signal,
                        number: *number,
                        columns,
                    })?;
                    let name = if self.names.are_stated { name.clone() } else { number.to_string() };
                    return Ok(Some((*signal, Column { index: number - 1, name })));
                }
                Some(ColumnName::Name(name)) if self.names.are_stated => {
                    let column = self.named(name)?.ok_or_else(|| self.unnamed(*signal, name))?;
                    return Ok(Some((*signal, column)));
                }
                Some(ColumnName::Name(_)) => return Err(self.no_header()),
                None => {}
            }
        }
        for signal in choices.iter().filter(|_| self.names.are_stated) {
            if let Some(column) = self.named(&signal.column(self.import.unit(*signal).0))? {
                return Ok(Some((*signal, column)));
            }
        }
        Ok(None)
    }

    /// Only column of this name.
    fn named(&self, name: &str) -> Result<Option<Column>, Fault> {
        Column::named(self.names.names.iter().map(String::as_str), name)
    }

    fn has_documented(&self, choices: &[Signal]) -> bool {
        self.names.are_stated
            && choices
                .iter()
                .any(|signal| matches!(self.named(&signal.column(self.import.unit(*signal).0)), Ok(Some(_))))
    }

    fn chosen(&self, signal: Signal, found: &BTreeMap<Signal, Column>) -> Result<Chosen, Fault> {
        let column = found[&signal].clone();
        let (unit, is_stated) = self.import.unit(signal);
        let named = self.names.unit(column.index, signal.quantity());
        if let Some(named) = named.filter(|named| !is_stated && *named != unit) {
            return Err(Fault::OtherUnit {
                column: column.name,
                named: named.name,
                signal,
                used: unit.name,
                advice: self.advice(found),
            });
        }
        let drive = signal.joint().map(|joint| &self.import.drives[joint - 1]);
        let lacks = |key: &'static str| Fault::NoDrive {
            column: column.name.clone(),
            key,
            joint: drive.map_or(String::new(), |drive| drive.joint.clone()),
        };
        let (limit, factor, by) = match (signal, drive) {
            (Signal::MotorAngle(_), Some(drive)) => {
                let ratio = drive.motor_ratio.ok_or_else(|| lacks("encoder"))?;
                (LARGEST_POSITION_RAD, 1.0 / ratio, Some("encoder.ratio"))
            }
            (Signal::Current(_), Some(drive)) => {
                let constant = drive.torque_per_ampere.ok_or_else(|| lacks("torque_per_ampere"))?;
                (LARGEST_TORQUE_NM, constant, Some("torque_per_ampere"))
            }
            (Signal::Torque(_), _) => (LARGEST_TORQUE_NM, 1.0, None),
            (Signal::Time, _) => (LARGEST_TIME_S, 1.0, None),
            _ => (LARGEST_POSITION_RAD, 1.0, None),
        };
        Ok(Chosen { signal, column, unit, drive: factor, by, limit })
    }

    fn missing(&self, signal: Signal, found: &BTreeMap<Signal, Column>) -> Fault {
        if !self.names.are_stated {
            return self.no_header();
        }
        self.missing_column(signal.column(self.import.unit(signal).0), self.advice(found))
    }

    /// Stated name that the header lacks, with the nearest one of the header.
    fn unnamed(&self, signal: Signal, name: &str) -> Fault {
        let advice = nearest(&self.names.names, name).map_or(String::new(), |near| {
            let mut readings = readings(self.import);
            readings
                .iter_mut()
                .filter(|reading| reading.signal == signal)
                .for_each(|reading| near.clone_into(&mut reading.column));
            format!(
                ". The nearest name is `{near}`. If it is meant, repeat the command with it:\n  {}",
                command(self.import, &readings)
            )
        });
        self.missing_column(name.to_owned(), advice)
    }

    fn missing_column(&self, column: String, advice: String) -> Fault {
        let needed =
            documented(self.import.drives.len()).map(|signal| match self.import.columns.get(&signal) {
                Some(ColumnName::Name(name)) => name.clone(),
                Some(ColumnName::Number(number)) => format!("column {number}"),
                None => signal.column(self.import.unit(signal).0),
            });
        Fault::MissingColumn {
            column,
            present: self.names.names.join(", "),
            needed: needed.collect::<Vec<_>>().join(", "),
            advice,
        }
    }

    fn no_header(&self) -> Fault {
        Fault::NoHeader {
            first: self.names.names.join(", "),
            columns: self.names.names.len(),
            advice: without_header(self.names.names.len(), self.import),
        }
    }

    fn advice(&self, found: &BTreeMap<Signal, Column>) -> String {
        let certain: Vec<_> = found.iter().map(|(signal, column)| (*signal, column.index)).collect();
        advice(self.names, self.import, &certain)
    }
}
