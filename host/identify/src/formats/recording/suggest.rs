//! Proposes the columns of a file whose names are not the documented ones. A proposal is only printed: the
//! user repeats the command with it.
//!
//! A name is split into words at punctuation, digits and capitals. A word states the quantity (`position`,
//! `effort`, `timestamp`), another the unit (`_deg`, `[ms]`), a number or a joint's name states the joint.
//! Numbers may begin at any value; the lowest belongs to the first joint. Commands and speeds are no
//! candidates. Names with one typing error are found by their distance to the documented name.

use scarab_base::shell::quoted;
use std::collections::BTreeSet;
use std::mem::discriminant;

use crate::formats::recording::chosen::Names;
use crate::formats::recording::import::{ColumnChoice, ColumnName, Drive, Import};
use crate::formats::recording::signal::{Quantity, Signal, Unit};

/// Similarity from which a name counts as a documented name with a typing error.
const TYPING_ERROR: f64 = 0.75;

/// Similarity from which the nearest name is offered for a stated one.
const NEAREST: f64 = 0.5;

/// What to state of a file without times.
const NO_TIME: &str = "The file has no column of time. If its rows are evenly spaced, state their rate";

/// Words of each quantity.
const TIME: [&str; 9] =
    ["t", "time", "timestamp", "timestamps", "stamp", "times", "elapsed", "clock", "zeit"];
const ANGLE: [&str; 11] =
    ["q", "pos", "position", "positions", "angle", "angles", "theta", "phi", "ang", "winkel", "qpos"];
const TORQUE: [&str; 10] =
    ["tau", "torque", "torques", "effort", "efforts", "trq", "moment", "drehmoment", "tq", "m"];
const CURRENT: [&str; 7] = ["i", "current", "currents", "cur", "iq", "strom", "amps"];
/// Words of a motor's angle.
const MOTOR: [&str; 3] = ["motor", "mot", "rotor"];
/// Words of signals that are not measured angle, torque or current.
const OTHER: [&str; 27] = [
    "cmd",
    "command",
    "commanded",
    "des",
    "desired",
    "ref",
    "reference",
    "target",
    "setpoint",
    "goal",
    "soll",
    "vel",
    "velocity",
    "speed",
    "qd",
    "dq",
    "qdd",
    "ddq",
    "acc",
    "accel",
    "acceleration",
    "err",
    "error",
    "temp",
    "temperature",
    "limit",
    "id",
];

/// Words of a column's name.
#[derive(Default)]
struct Name {
    words: Vec<String>,
    numbers: Vec<usize>,
    unit: Vec<Unit>,
}

impl Name {
    fn parse(text: &str) -> Self {
        let text = ["N m", "N*m", "N.m", "N·m", "N-m"]
            .iter()
            .fold(text.to_owned(), |text, spelt| text.replace(spelt, "Nm"));
        let mut name = Self::default();
        let mut parts: Vec<&str> =
            text.split(|c: char| !c.is_alphanumeric() && c != '°').filter(|part| !part.is_empty()).collect();
        // The first part is what is measured: `t`, `i` or `m` there is not a unit.
        let first = (!parts.is_empty()).then(|| parts.remove(0));
        let is_unit = |part: &&&str| Unit::spelt(part).is_some();
        name.unit.extend(parts.iter().filter(is_unit).filter_map(|part| Unit::spelt(part)));
        parts.retain(|part| Unit::spelt(part).is_none());
        for part in first.into_iter().chain(parts) {
            name.add(part);
        }
        name
    }

    /// Splits at digits and capitals.
    fn add(&mut self, part: &str) {
        let mut word = String::new();
        let mut before = ' ';
        let class = |c: char| (c.is_numeric(), c.is_uppercase());
        for letter in part.chars().chain([' ']) {
            let is_capital_after_small = class(letter).1 && before.is_lowercase();
            if letter == ' ' || class(letter).0 != class(before).0 || is_capital_after_small {
                match word.parse() {
                    Ok(number) => self.numbers.push(number),
                    Err(_) if !word.is_empty() => self.words.push(word.to_lowercase()),
                    Err(_) => {}
                }
                word.clear();
            }
            word.push(letter);
            before = letter;
        }
    }

    fn has(&self, words: &[&str]) -> bool {
        self.words.iter().any(|word| words.contains(&&**word))
    }

    /// Kind of signal, with a joint of 0.
    fn kind(&self) -> Option<Signal> {
        // Degrees per second are a speed.
        let states = |quantity| self.unit.iter().any(|unit| unit.quantity == quantity);
        if self.has(&OTHER) || states(Quantity::Angle) && states(Quantity::Time) {
            return None;
        }
        if self.has(&TORQUE) {
            return Some(Signal::Torque(0));
        }
        if self.has(&CURRENT) {
            return Some(Signal::Current(0));
        }
        if self.has(&ANGLE) {
            return Some(if self.has(&MOTOR) { Signal::MotorAngle(0) } else { Signal::Angle(0) });
        }
        (self.has(&TIME) && self.numbers.is_empty()).then_some(Signal::Time)
    }

    fn is_of(&self, drive: &Drive) -> bool {
        let joint = Self::parse(&drive.joint);
        !joint.words.is_empty() && joint.words.iter().all(|word| self.words.contains(word))
    }
}

/// Unit that a column's name states for this quantity.
pub(crate) fn unit_in_name(name: &str, quantity: Quantity) -> Option<Unit> {
    Name::parse(name).unit.into_iter().rev().find(|unit| unit.quantity == quantity)
}

/// Proposed column of one signal.
struct Proposal {
    signal: Signal,
    index: usize,
    unit: Unit,
    /// Whether neither the user nor the name states the unit.
    is_assumed: bool,
}

/// Advice on these column names: the complete command, or what is missing. `certain` holds the columns that
/// are stated or have documented names.
pub(crate) fn advice(stated: &Names, import: &Import, certain: &[(Signal, usize)]) -> String {
    let names = &stated.names;
    let topics = topics(names);
    let mut all: Vec<(Vec<Proposal>, Vec<Signal>)> =
        topics.iter().map(|topic| proposals(stated, import, certain, topic)).collect();
    let best = all.iter().position(|(_, missing)| missing.is_empty()).unwrap_or(0);
    let complete = topics.iter().zip(&all).filter(|(_, (_, missing))| missing.is_empty());
    let others: Vec<_> =
        complete.map(|(topic, _)| topic.as_str()).filter(|topic| *topic != topics[best]).collect();
    let (mut found, missing) = all.swap_remove(best);
    let has_time = missing[..] != [Signal::Time];
    if !missing.is_empty() && has_time {
        let missing: Vec<String> = missing.iter().map(ToString::to_string).collect();
        return format!(". No name resembles {}. {}", missing.join(", "), by_number(names.len(), import));
    }
    found.sort_by_key(|found| found.signal);
    let columns: Vec<String> = found
        .iter()
        .map(|found| format!("{}={}", found.signal, word(names, found.index, stated.are_stated)))
        .collect();
    let assumed: Vec<String> = found
        .iter()
        .filter(|found| found.is_assumed)
        .map(|found| format!("`{}`", names[found.index]))
        .collect();
    let assumed = match assumed.len() {
        0 => String::new(),
        _ => format!(
            "\n  ({} without a unit: SI is assumed, change --units if that is wrong)",
            assumed.join(", ")
        ),
    };
    let others = match others.len() {
        0 => String::new(),
        _ => format!("\n  (topics with such columns too: {})", others.join(", ")),
    };
    let (question, rate) = if has_time {
        ("If these columns are meant, repeat the command with them", "")
    } else {
        (NO_TIME, " --rate HZ")
    };
    format!(
        ". {question}:\n  {} --columns {} --units {}{rate}{assumed}{others}",
        import.command,
        quoted(&columns.join(",")),
        units(&found.iter().map(|found| (found.signal, found.unit)).collect::<Vec<_>>()),
    )
}

/// Topics of which the names of all columns begin with one and a colon; one empty topic otherwise.
fn topics(names: &[String]) -> Vec<String> {
    let mut topics: Vec<String> = Vec::new();
    for name in names {
        let Some((topic, _)) = name.split_once(':').filter(|_| name.starts_with('/')) else {
            return vec![String::new()];
        };
        if !topics.iter().any(|other| other == topic) {
            topics.push(topic.to_owned());
        }
    }
    if topics.is_empty() { vec![String::new()] } else { topics }
}

/// Columns of one topic for each signal, and the signals without one.
fn proposals(
    stated: &Names,
    import: &Import,
    certain: &[(Signal, usize)],
    topic: &str,
) -> (Vec<Proposal>, Vec<Signal>) {
    let names = &stated.names;
    let own = |name: &&String| topic.is_empty() || name.split_once(':').is_some_and(|(of, _)| of == topic);
    let mut found: Vec<Proposal> = Vec::new();
    let mut missing = Vec::new();
    let candidates: Vec<(usize, Name, Signal)> = names
        .iter()
        .enumerate()
        .filter(|(_, name)| own(name))
        .filter_map(|(index, text)| {
            let text = if topic.is_empty() { text.as_str() } else { text.get(topic.len() + 1..)? };
            let name = Name::parse(text);
            let kind = name.kind()?;
            Some((index, name, kind))
        })
        .collect();
    let with_typing_error = |signal: Signal| {
        let documented = signal.column(signal.quantity().si()).to_lowercase();
        let likeness =
            |name: &String| strsim::normalized_damerau_levenshtein(&name.to_lowercase(), &documented);
        let digits = |text: &str| text.chars().filter(char::is_ascii_digit).collect::<String>();
        let close = names.iter().enumerate().filter(|(_, name)| {
            own(name) && (TYPING_ERROR..1.0).contains(&likeness(name)) && digits(name) == digits(&documented)
        });
        close.max_by(|(_, a), (_, b)| likeness(a).total_cmp(&likeness(b))).map(|(index, _)| index)
    };
    for choices in import.required() {
        let known = certain.iter().find(|(signal, _)| choices.contains(signal));
        let proposed = known.copied().or_else(|| {
            choices.iter().find_map(|&signal| {
                let index = named_column(&candidates, import, signal).or_else(|| with_typing_error(signal));
                index.map(|index| (signal, index))
            })
        });
        match proposed {
            Some((signal, index)) if !found.iter().any(|other| other.index == index) => {
                let (in_use, is_stated) = import.unit(signal);
                let named = stated.unit(index, signal.quantity());
                let unit = named.unwrap_or(in_use);
                found.push(Proposal { signal, index, unit, is_assumed: !is_stated && named.is_none() });
            }
            _ => missing.push(choices[0]),
        }
    }
    (found, missing)
}

/// Column whose name states a signal: with the joint's name, by the order of the numbers, or alone.
fn named_column(candidates: &[(usize, Name, Signal)], import: &Import, signal: Signal) -> Option<usize> {
    let joint = signal.joint().unwrap_or(0);
    let of_kind: Vec<_> =
        candidates.iter().filter(|(.., kind)| discriminant(kind) == discriminant(&signal)).collect();
    let drive = import.drives.get(joint.wrapping_sub(1));
    if let Some((index, ..)) =
        of_kind.iter().find(|(_, name, _)| drive.is_some_and(|drive| name.is_of(drive)))
    {
        return Some(*index);
    }
    let numbers: BTreeSet<usize> =
        of_kind.iter().filter_map(|(_, name, _)| name.numbers.last().copied()).collect();
    match (numbers.iter().nth(joint.saturating_sub(1)), &of_kind[..]) {
        (Some(number), _) => {
            of_kind.iter().find(|(_, name, _)| name.numbers.last() == Some(number)).map(|(index, ..)| *index)
        }
        (None, [(index, ..), ..]) if signal == Signal::Time => Some(*index),
        (None, [(index, ..)]) if import.drives.len() == 1 => Some(*index),
        _ => None,
    }
}

/// Signals that give the angle, and those that give the torque, of one joint.
pub(crate) fn choices_of_joint(joint: usize) -> [Vec<Signal>; 2] {
    [
        vec![Signal::Angle(joint), Signal::MotorAngle(joint)],
        vec![Signal::Torque(joint), Signal::Current(joint)],
    ]
}

/// Signals that a recording of so many joints must have, each with those that replace it.
pub(crate) fn required(joints: usize) -> impl Iterator<Item = Vec<Signal>> {
    std::iter::once(vec![Signal::Time]).chain((1..=joints).flat_map(choices_of_joint))
}

/// Signals of a recording of so many joints in the documented format.
pub(crate) fn documented(joints: usize) -> impl Iterator<Item = Signal> {
    required(joints).map(|choices| choices[0])
}

/// Signal that is read from a column in a unit.
#[derive(Clone, Debug)]
pub(crate) struct Reading {
    pub(crate) signal: Signal,
    /// Column as `--columns` takes it.
    pub(crate) column: String,
    pub(crate) unit: Unit,
}

/// Readings of a command: the stated columns and units, else the documented names.
pub(crate) fn readings(import: &Import) -> Vec<Reading> {
    let reading = |choices: &[Signal]| {
        let signal =
            *choices.iter().find(|signal| import.columns.contains_key(signal)).unwrap_or(&choices[0]);
        let unit = import.unit(signal).0;
        let column = match import.columns.get(&signal) {
            Some(ColumnName::Name(name)) => name.clone(),
            Some(ColumnName::Number(number)) => number.to_string(),
            None => signal.column(unit),
        };
        Reading { signal, column, unit }
    };
    import.required().map(|choices| reading(&choices)).collect()
}

/// Complete command with these readings.
pub fn command(import: &Import, readings: &[Reading]) -> String {
    format!("{} {}", import.command, options(readings))
}

/// Options of these readings.
pub(crate) fn options(readings: &[Reading]) -> String {
    let mut readings = readings.to_vec();
    readings.sort_by_key(|reading| reading.signal);
    let columns: Vec<String> =
        readings.iter().map(|reading| format!("{}={}", reading.signal, reading.column)).collect();
    let all: Vec<_> = readings.iter().map(|reading| (reading.signal, reading.unit)).collect();
    format!("--columns {} --units {}", quoted(&columns.join(",")), units(&all))
}

/// Name most similar to this one, if it is similar enough for a typing error; without a comma, which
/// `--columns` cannot hold.
pub(crate) fn nearest<'a>(names: &'a [String], name: &str) -> Option<&'a str> {
    let likeness =
        |other: &str| strsim::normalized_damerau_levenshtein(&other.to_lowercase(), &name.to_lowercase());
    let close = names.iter().filter(|other| !other.contains(',')).map(|other| (likeness(other), other));
    let nearest =
        close.filter(|(likeness, _)| *likeness >= NEAREST).max_by(|one, other| one.0.total_cmp(&other.0));
    nearest.map(|(_, other)| other.as_str())
}

/// Example of a command that names so many columns by number, or why they are too few.
pub(crate) fn by_number(columns: usize, import: &Import) -> String {
    let joints = import.drives.len();
    let needed = 1 + 2 * joints;
    if columns < needed {
        let fewer =
            if joints > 1 { "; for a recording of fewer joints give a leg file of those joints" } else { "" };
        return format!(
            "The leg needs {needed} columns, the time and each joint's angle and torque, and the file has {columns}{fewer}"
        );
    }
    let numbers: Vec<String> = std::iter::once("t=1".to_owned()).chain(numbered(joints, 2)).collect();
    format!(
        "Name the columns by --columns SIGNAL=COLUMN,.. (a name, or a number from 1) and their units by --units, for \
         example, if this is their order:\n  {} --columns {} --units s,rad,Nm",
        import.command,
        numbers.join(",")
    )
}

/// Example of a command for a file without names; the missing column may be the time's.
pub(crate) fn without_header(columns: usize, import: &Import) -> String {
    let joints = import.drives.len();
    if columns != 2 * joints {
        return by_number(columns, import);
    }
    let numbers: Vec<String> = numbered(joints, 1).collect();
    format!(
        "{}. If only the time is missing, and the rows are evenly spaced, state their rate, for example, if this is their \
         order:\n  {} --columns {} --units rad,Nm --rate HZ",
        by_number(columns, import),
        import.command,
        numbers.join(",")
    )
}

/// Angles, then torques, in columns from `first` on.
fn numbered(joints: usize, first: usize) -> impl Iterator<Item = String> {
    let angles = (0..joints).map(move |joint| format!("q{}={}", joint + 1, joint + first));
    angles.chain((0..joints).map(move |joint| format!("tau{}={}", joint + 1, joint + joints + first)))
}

/// One unit for each quantity, and the exceptions.
fn units(found: &[(Signal, Unit)]) -> String {
    let mut words = Vec::new();
    for quantity in Quantity::ALL {
        let mut of_quantity = found.iter().filter(|(_, unit)| unit.quantity == quantity);
        let Some((_, first)) = of_quantity.next() else { continue };
        words.push(first.name.to_owned());
        let others = of_quantity.filter(|(_, unit)| unit != first);
        words.extend(others.map(|(signal, unit)| format!("{signal}={}", unit.name)));
    }
    words.join(",")
}

/// Column as `--columns` takes it: its name, or its number where the name is not unique or cannot be written.
fn word(names: &[String], index: usize, has_header: bool) -> String {
    let name = &names[index];
    let is_unique = names.iter().filter(|other| *other == name).count() == 1;
    let is_number =
        matches!(format!("t={name}").parse(), Ok(ColumnChoice { column: ColumnName::Number(_), .. }));
    if has_header && is_unique && !is_number && !name.is_empty() && !name.contains(',') {
        name.clone()
    } else {
        (index + 1).to_string()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Proposal for columns of these names.
    fn proposed(names: &[&str]) -> String {
        let names = names.iter().map(|name| (*name).to_owned()).collect();
        advice(&Names { names, units: Vec::new(), are_stated: true }, &Import::plain(1), &[])
    }

    #[test]
    fn columns_are_proposed_from_one_topic_that_has_all() {
        let names = [
            "/clock:time",
            "/clock:log_time",
            "/joint_states:time",
            "/joint_states:log_time",
            "/joint_states:position[1]",
            "/joint_states:effort[1]",
            "/other:time",
            "/other:position[1]",
            "/other:effort[1]",
        ];
        let all = proposed(&names);
        let columns = "t=/joint_states:time,q1=/joint_states:position[1],tau1=/joint_states:effort[1]";
        assert!(all.contains(&format!("--columns '{columns}' --units s,rad,Nm")), "{all}");
        assert!(all.ends_with("(topics with such columns too: /other)"), "{all}");
        let one = proposed(&names[2..6]);
        assert!(one.contains(columns) && !one.contains("such columns too"), "{one}");
        assert!(proposed(&names[..2]).contains("No name resembles"));
    }
}
