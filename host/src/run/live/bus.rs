//! Legs on a CANopen bus as a source of a live picture. It listens only, so no host is disturbed.
//!
//! | part | content |
//! | --- | --- |
//! | [`adapter`] | opens an slcan adapter |
//! | [`node`] | object values that a node's frames show |
//! | [`leg`] | motion, torque, result and state of a leg from the values of its nodes |
//! | [`words`] | sentences about them |
//!
//! Positions between two PDOs are interpolated. Torque is predicted by a stored model, or by the base
//! parameters that a host reads.

pub mod adapter;
pub mod leg;
pub mod node;
pub mod words;

use std::io::{BufRead, BufReader, Read};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab::servo::SERVO_RATE_HZ;

use crate::base::error::ToolError;
use crate::formats::candump;
use crate::formats::leg_file::LegFile;
use crate::formats::model_file::ModelFile;
use crate::report::live::{LegScene, LiveNote, LiveUpdate, Severity};
use crate::rig::bus::slcan;
use crate::rig::bus::wire::bits;
use crate::run::live::bus::leg::Leg;
use crate::run::live::clock::Clock;
use crate::run::live::picture::scene;

/// Frames between reader and picture.
const MOST_WAITING: usize = 1024;
/// Longest line; longer ones are no frames.
const LONGEST_LINE: u64 = 256;
/// Time between two statuses, s.
const STATUS_S: f64 = 0.2;
/// Silence after which the status is reported without a frame.
const SILENCE: Duration = Duration::from_millis(200);
/// Lines without a frame that are reported one by one.
const MOST_REPORTED: u32 = 5;

/// Form of the lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Lines {
    /// Lines of an slcan adapter; they arrive now.
    Slcan,
    /// Lines of `candump`, with their own times.
    Candump,
}

/// Frames of a bus, and its nodes.
pub struct BusInput {
    /// Lines with the frames.
    pub input: Box<dyn Read + Send>,
    /// Form of the lines.
    pub lines: Lines,
    /// Name for messages.
    pub name: String,
    /// Node-IDs, leg by leg, proximal joint first.
    pub nodes: Vec<u8>,
    /// Bit rate, for the load.
    pub bits_per_s: u64,
    /// Model that predicts the torque.
    pub model: Option<ModelFile>,
    /// Seconds of the bus per second; `None` for frames that arrive now.
    pub speed: Option<f64>,
}

/// What the reader has found.
enum Found {
    Frame(f64, Frame),
    /// A line that is no frame, or an error of the input.
    Bad(String),
}

/// Reads the lines to their end, with times in seconds.
fn read(input: Box<dyn Read + Send>, lines: Lines, found: &SyncSender<Found>) {
    let begin = Instant::now();
    let end = if lines == Lines::Slcan { b'\r' } else { b'\n' };
    let mut input = BufReader::new(input);
    for number in 1_u64.. {
        let mut line = Vec::new();
        let read = input.by_ref().take(LONGEST_LINE).read_until(end, &mut line);
        let report = match read {
            Ok(0) => return,
            Ok(_) => {
                let text = String::from_utf8_lossy(&line);
                let parsed = match lines {
                    Lines::Slcan => {
                        slcan::decode(&text).map(|frame| Some((begin.elapsed().as_secs_f64(), frame?)))
                    }
                    Lines::Candump => candump::parse(&text).map_err(|why| format!("line {number}: {why}")),
                };
                match parsed {
                    Ok(None) => continue,
                    Ok(Some((time_s, frame))) => Found::Frame(time_s, frame),
                    Err(why) => Found::Bad(why),
                }
            }
            Err(error) if error.kind() == std::io::ErrorKind::Interrupted => continue,
            Err(error) => {
                let _ = found.send(Found::Bad(format!("cannot be read any further ({error})")));
                return;
            }
        };
        if found.send(report).is_err() {
            return;
        }
    }
}

/// Bits on the wire over the last second.
struct Load {
    bits_per_s: u64,
    since_s: f64,
    bits: u64,
    frames: u32,
    words: String,
}

impl Load {
    fn add(&mut self, frame: &Frame) {
        self.bits += u64::from(bits(frame));
        self.frames += 1;
    }

    /// Ends a second.
    fn at(&mut self, now_s: f64) {
        let lasted_s = now_s - self.since_s;
        if lasted_s >= 1.0 {
            let percent = 100.0 * self.bits as f64 / (self.bits_per_s as f64 * lasted_s);
            let frames = f64::from(self.frames) / lasted_s;
            self.words = format!("{percent:.0} % of {} kbit/s, {frames:.0} frames/s", self.bits_per_s / 1000);
            (self.since_s, self.bits, self.frames) = (now_s, 0, 0);
        }
    }
}

/// Shows the legs of a bus until the input ends.
///
/// # Errors
/// The input has no frame, or the leg file does not fit.
pub fn watch<const N: usize, const B: usize>(
    leg: &LegFile,
    source: BusInput,
    out: &dyn Fn(LiveUpdate),
) -> Result<(), ToolError> {
    let BusInput { input, lines, name, nodes, bits_per_s, model, speed } = source;
    let ids: Vec<[u8; N]> = nodes.chunks_exact(N).filter_map(|ids| ids.try_into().ok()).collect();
    let heard = if lines == Lines::Candump {
        Path::new(&name).file_name().unwrap_or_default()
    } else {
        name.as_ref()
    };
    let mut described = scene(leg, format!("CANopen bus, {}", heard.display()), speed.unwrap_or(1.0));
    let joints = described.legs.first().map(|leg| leg.joints.clone()).unwrap_or_default();
    described.legs =
        ids.iter().map(|ids| LegScene { name: leg_name(leg, ids), joints: joints.clone() }).collect();
    out(LiveUpdate::Scene(described));
    let mut legs: Vec<Leg<N, B>> = Vec::new();
    let mut called: Vec<String> = Vec::new();
    for (place, own) in ids.iter().enumerate() {
        legs.push(Leg::new(leg, *own, place, model.as_ref(), out)?);
        called.push(if ids.len() > 1 { format!("leg {}: ", place + 1) } else { String::new() });
    }
    let note = |time_s: f64, weight, words: String| out(LiveUpdate::Note(LiveNote { time_s, weight, words }));
    let mut load = Load { bits_per_s, since_s: 0.0, bits: 0, frames: 0, words: String::new() };
    let mut clock = speed.map(Clock::new);
    let (send, found) = sync_channel(MOST_WAITING);
    thread::spawn(move || read(input, lines, &send));
    let (mut first_s, mut now_s, mut due_s, mut bad) = (None, 0.0_f64, 0.0, 0);
    let mut arrived = Instant::now();
    loop {
        match found.recv_timeout(SILENCE) {
            Ok(Found::Frame(time_s, frame)) => {
                now_s = (time_s - *first_s.get_or_insert(time_s)).max(now_s);
                arrived = Instant::now();
                if let Some(clock) = &mut clock {
                    clock.wait((now_s * f64::from(SERVO_RATE_HZ)) as u64);
                }
                load.add(&frame);
                for (leg, called) in legs.iter_mut().zip(&called) {
                    leg.take(&frame, now_s, called);
                }
            }
            Ok(Found::Bad(words)) => {
                bad += 1;
                if bad <= MOST_REPORTED {
                    note(now_s, Severity::Warning, format!("{name}: {words}"));
                }
            }
            Err(RecvTimeoutError::Timeout) if first_s.is_some() && clock.is_none() => {
                // A silent bus: only the status is new.
                now_s += arrived.elapsed().as_secs_f64();
                arrived = Instant::now();
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        load.at(now_s);
        if now_s >= due_s {
            due_s = now_s + STATUS_S;
            for (leg, called) in legs.iter_mut().zip(&called) {
                leg.report(now_s, called, load.words.clone());
            }
        }
    }
    if first_s.is_none() {
        return Err(ToolError::input(format!("{name}: no CAN frame; {bad} lines are none")));
    }
    for (leg, called) in legs.iter_mut().zip(&called) {
        leg.report(now_s, called, load.words.clone());
    }
    note(now_s, Severity::Note, "the source has ended".into());
    Ok(())
}

/// Name of a leg with its nodes.
fn leg_name(leg: &LegFile, ids: &[u8]) -> String {
    let ids: Vec<String> = ids.iter().map(u8::to_string).collect();
    format!("{}, nodes {}", leg.name, ids.join(" and "))
}
