//! MCAP: messages `sensor_msgs/msg/JointState` of ROS 2, as rosbag2 writes them.
//!
//! | column | content |
//! | --- | --- |
//! | `time` | stamp in the header of the message, s |
//! | `log_time` | time at which the message was recorded, s |
//! | `position[JOINT]`, `velocity[JOINT]`, `effort[JOINT]` | as published |
//!
//! If several topics carry such messages, `TOPIC:` precedes each name. The file is read once for the names of
//! the joints and once for the values, one record at a time.

use std::collections::BTreeMap;
use std::fs::File;
use std::io::Read;
use std::ops::ControlFlow;
use std::path::{Path, PathBuf};

use byteorder::{BigEndian, LittleEndian};
use mcap::records::Record;
use mcap::sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions};
use serde::Deserialize;

use crate::guarded::guarded;
use crate::{Column, Error, LARGEST_PIECE, Row, Table, Take};

/// Type of the messages.
const SCHEMA: &str = "sensor_msgs/msg/JointState";
/// Its name in ROS 1.
const SCHEMA_OF_ROS1: &str = "sensor_msgs/JointState";
/// Bytes read at once at most.
const READ: usize = 1 << 20;
/// Largest number of joints in a message.
const MOST_JOINTS: usize = 1000;
/// Longest name of a joint, topic or type, bytes.
const LONGEST_NAME: usize = 1000;

#[derive(Deserialize)]
struct Stamp {
    sec: i32,
    nanosec: u32,
}

#[derive(Deserialize)]
struct Header {
    stamp: Stamp,
    #[serde(rename = "frame_id")]
    _frame_id: String,
}

#[derive(Deserialize)]
struct JointState {
    header: Header,
    name: Vec<String>,
    position: Vec<f64>,
    velocity: Vec<f64>,
    effort: Vec<f64>,
}

/// Content of one column.
#[derive(Clone, Debug, PartialEq, Eq)]
enum Content {
    Time,
    LogTime,
    Position(String),
    Velocity(String),
    Effort(String),
}

/// Opened MCAP file, or all files of a bag.
pub struct Mcap {
    /// Files in the order of the recording.
    parts: Vec<PathBuf>,
    columns: Vec<Column>,
    /// Topic and content of each column.
    contents: Vec<(String, Content)>,
}

impl Mcap {
    /// Opens a file, or a folder with the files into which a bag is split, and finds its joints.
    ///
    /// # Errors
    /// A file is damaged, or none holds a message with states of joints.
    pub fn open(path: &Path) -> Result<Self, Error> {
        let parts = if path.is_dir() { parts(path)? } else { vec![path.to_owned()] };
        let mut topics: BTreeMap<String, Vec<String>> = BTreeMap::new();
        let mut others = Vec::new();
        each_message(&parts, &mut others, &mut |topic, message, _| {
            let joints = topics.entry(topic.to_owned()).or_default();
            if joints.len() < MOST_JOINTS {
                // Most messages name the joints of the one before.
                for name in message.state()?.name {
                    check_name(&name)?;
                    if !joints.contains(&name) {
                        joints.push(name);
                    }
                }
            }
            Ok(ControlFlow::Continue(()))
        })?;
        if topics.is_empty() {
            let found = if others.is_empty() { "none".to_owned() } else { others.join(", ") };
            return Err(Error::new(format!(
                "no message of the type {SCHEMA}; message types in the file: {found}"
            )));
        }
        let mut table = Self { parts, columns: Vec::new(), contents: Vec::new() };
        for (topic, joints) in &topics {
            let prefix = if topics.len() > 1 { format!("{topic}:") } else { String::new() };
            let mut add = |name: String, unit, content| {
                table.columns.push(Column { name: format!("{prefix}{name}"), unit });
                table.contents.push((topic.clone(), content));
            };
            add("time".to_owned(), Some("s"), Content::Time);
            add("log_time".to_owned(), Some("s"), Content::LogTime);
            for joint in joints {
                add(format!("position[{joint}]"), None, Content::Position(joint.clone()));
                add(format!("velocity[{joint}]"), None, Content::Velocity(joint.clone()));
                add(format!("effort[{joint}]"), None, Content::Effort(joint.clone()));
            }
        }
        Ok(table)
    }
}

impl Table for Mcap {
    fn columns(&self) -> &[Column] {
        &self.columns
    }

    fn read(&self, chosen: &[usize], take: Take<'_>) -> Result<(), Error> {
        let contents = chosen
            .iter()
            .map(|index| self.contents.get(*index).ok_or_else(|| Error::new("a column that the file lacks")))
            .collect::<Result<Vec<_>, _>>()?;
        let Some((topic, _)) = contents.first() else { return Ok(()) };
        if let Some((other, _)) = contents.iter().find(|(other, _)| other != topic) {
            return Err(Error::new(format!(
                "columns of the topics {topic} and {other}: choose all columns from one topic, whose messages have one time"
            )));
        }
        let mut number = 0;
        let mut values = vec![0.0; chosen.len()];
        each_message(&self.parts, &mut Vec::new(), &mut |of, message, done| {
            if of != topic {
                return Ok(ControlFlow::Continue(()));
            }
            number += 1;
            let state = message.state()?;
            let mut has_joint = false;
            for (value, (_, content)) in values.iter_mut().zip(&contents) {
                let mut of_joint = |joint: &String, list: &[f64]| {
                    let position = state.name.iter().position(|name| name == joint);
                    has_joint |= position.is_some();
                    position.and_then(|position| list.get(position)).copied().unwrap_or(f64::NAN)
                };
                *value = match content {
                    Content::Time => {
                        f64::from(state.header.stamp.sec) + f64::from(state.header.stamp.nanosec) * 1e-9
                    }
                    Content::LogTime => message.log_time as f64 * 1e-9,
                    Content::Position(joint) => of_joint(joint, &state.position),
                    Content::Velocity(joint) => of_joint(joint, &state.velocity),
                    Content::Effort(joint) => of_joint(joint, &state.effort),
                };
            }
            // Messages about other joints, from another publisher on this topic.
            if !has_joint {
                return Ok(ControlFlow::Continue(()));
            }
            Ok(take(Row { number, values: &values, done }))
        })
    }
}

/// Message on a topic of states of joints.
struct Message<'a> {
    log_time: u64,
    data: &'a [u8],
}

impl Message<'_> {
    /// Decodes the message: four bytes of the encapsulation, then CDR.
    fn state(&self) -> Result<JointState, Error> {
        let damaged =
            |error: cdr_encoding::Error| Error::new(format!("damaged message of joint states ({error})"));
        match self.data {
            [0, 0, _, _, data @ ..] => {
                cdr_encoding::from_bytes::<JointState, BigEndian>(data).map_err(damaged)
            }
            [0, 1, _, _, data @ ..] => {
                cdr_encoding::from_bytes::<JointState, LittleEndian>(data).map_err(damaged)
            }
            [kind, more, ..] => {
                let kind = u16::from_be_bytes([*kind, *more]);
                return Err(Error::new(format!(
                    "messages in encapsulation {kind}; only plain CDR (0 and 1) is read"
                )));
            }
            _ => return Err(Error::new("a message of joint states without content")),
        }
        .map(|(state, _)| state)
    }
}

fn check_name(name: &str) -> Result<(), Error> {
    if name.len() > LONGEST_NAME {
        return Err(Error::new(format!("a name of {} bytes, at most {LONGEST_NAME} are read", name.len())));
    }
    Ok(())
}

/// Receives topic, message, and the share of the file that is read.
type TakeMessage<'a> = &'a mut dyn FnMut(&str, Message<'_>, f64) -> Result<ControlFlow<()>, Error>;

/// Passes every message with states of joints to `take`, and collects the names of all other message types.
fn each_message(parts: &[PathBuf], others: &mut Vec<String>, take: TakeMessage<'_>) -> Result<(), Error> {
    let mut is_ended = false;
    for (number, part) in parts.iter().enumerate() {
        let mut take_part = |topic: &str, message: Message<'_>, done: f64| {
            let flow = take(topic, message, (number as f64 + done) / parts.len() as f64)?;
            is_ended |= flow.is_break();
            Ok(flow)
        };
        let read = guarded(|| read_messages(part, others, &mut take_part));
        read.map_err(|error| match part.file_name() {
            Some(name) if parts.len() > 1 => Error::new(format!("{}: {error}", name.to_string_lossy())),
            _ => error,
        })?;
        if is_ended {
            break;
        }
    }
    Ok(())
}

/// MCAP files of a folder, in the order of the number at the end of their names, then by name.
///
/// # Errors
/// The folder cannot be read, or holds no such file.
fn parts(folder: &Path) -> Result<Vec<PathBuf>, Error> {
    let mut parts = Vec::new();
    for entry in std::fs::read_dir(folder)? {
        let path = entry?.path();
        if path.extension().is_some_and(|extension| extension == "mcap") {
            parts.push(path);
        }
    }
    if parts.is_empty() {
        return Err(Error::new("the folder holds no `.mcap` file"));
    }
    // `bag_10` follows `bag_9`.
    let number = |path: &Path| {
        let stem = path.file_stem()?.to_str()?;
        stem[stem.trim_end_matches(|c: char| c.is_ascii_digit()).len()..].parse::<u64>().ok()
    };
    parts.sort_by(|one, other| number(one).cmp(&number(other)).then_with(|| one.cmp(other)));
    Ok(parts)
}

fn read_messages(path: &Path, others: &mut Vec<String>, take: TakeMessage<'_>) -> Result<(), Error> {
    let damaged = |error: mcap::McapError| Error::new(format!("damaged MCAP file ({error})"));
    let mut file = File::open(path)?;
    let (length, mut position) = (file.metadata()?.len().max(1), 0);
    let options = LinearReaderOptions::default()
        .with_record_length_limit(LARGEST_PIECE)
        .with_validate_chunk_crcs(true)
        .with_skip_end_magic(true);
    let mut reader = LinearReader::new_with_options(options);
    let mut schemas: BTreeMap<u16, String> = BTreeMap::new();
    let mut topics: BTreeMap<u16, String> = BTreeMap::new();
    while let Some(event) = reader.next_event() {
        let (opcode, data) = match event.map_err(damaged)? {
            LinearReadEvent::ReadRequest(need) => {
                let read = file.read(reader.insert(need.clamp(1, READ)))?;
                reader.notify_read(read);
                position += read as u64;
                continue;
            }
            LinearReadEvent::Record { opcode, data } => (opcode, data),
        };
        match mcap::parse_record(opcode, data).map_err(damaged)? {
            Record::Schema { header, .. } => {
                check_name(&header.name)?;
                schemas.insert(header.id, header.name);
            }
            Record::Channel(channel) => {
                check_name(&channel.topic)?;
                let schema = schemas.get(&channel.schema_id).map_or("", String::as_str);
                if schema == SCHEMA_OF_ROS1 || channel.message_encoding == "ros1" {
                    return Err(Error::new(
                        "messages of ROS 1: convert the bag to ROS 2 by `rosbags-convert --src run.bag --dst NEW --dst-storage mcap`",
                    ));
                }
                if schema != SCHEMA {
                    if !others.iter().any(|other| other == schema) && others.len() < MOST_JOINTS {
                        others.push(schema.to_owned());
                    }
                } else if channel.message_encoding == "cdr" {
                    topics.insert(channel.id, channel.topic);
                } else {
                    return Err(Error::new(format!(
                        "topic {}: messages in the encoding `{}`; only `cdr` of ROS 2 is read",
                        channel.topic, channel.message_encoding
                    )));
                }
            }
            Record::Message { header, data } => {
                let Some(topic) = topics.get(&header.channel_id) else { continue };
                let message = Message { log_time: header.log_time, data: &data };
                if take(topic, message, position as f64 / length as f64)?.is_break() {
                    return Ok(());
                }
            }
            _ => {}
        }
    }
    Ok(())
}
