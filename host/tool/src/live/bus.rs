//! Legs on a CANopen bus as a source of a live picture. It listens only, so no host is disturbed.
//!
//! | part | content |
//! | --- | --- |
//! | [`node`] | object values that a node's frames show |
//! | [`leg`] | motion, torque, result and state of a leg from the values of its nodes |
//! | [`scarab_client::words`] | sentences about them |
//!
//! Positions between two PDOs are interpolated. Torque is predicted by a stored model, or by the base
//! parameters that a host reads.

pub(crate) mod leg;
pub(crate) mod node;

use std::collections::BTreeSet;
use std::io::{BufReader, Read};
use std::path::Path;
use std::sync::mpsc::{RecvTimeoutError, SyncSender, sync_channel};
use std::thread;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab::servo::SERVO_RATE_HZ;
use scarab_base::error::ToolError;
use scarab_base::output::printable;
use scarab_client::candump;
use scarab_client::slcan::{self, LONGEST_LINE, next_line};
use scarab_client::wire::bits;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::model_file::ModelFile;

use crate::live::bus::leg::Leg;
use crate::live::clock::Clock;
use crate::live::picture::scene;
use crate::live::report::{LegScene, LiveNote, LiveUpdate, Severity};

/// Frames between reader and picture.
const MOST_WAITING: usize = 1024;
/// An slcan adapter refuses a command.
const BELL: u8 = slcan::BELL[0];
/// Time stamps may go back by this without a gap, and forward, s.
const MOST_BACK_S: f64 = 1.0;
const MOST_SILENT_S: f64 = 30.0;
/// Gap in the picture where the time stamps jump, s.
const GAP_S: f64 = 1.0;
/// Time between two statuses, s.
const STATUS_S: f64 = 0.2;
/// Silence after which the status is reported without a frame.
const SILENCE: Duration = Duration::from_millis(200);
/// Lines without a frame that are reported one by one.
const MOST_REPORTED: u32 = 5;

/// Form of the lines.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Lines {
    /// Lines of an slcan adapter; they arrive now.
    Slcan,
    /// Lines of `candump`, with their own times.
    Candump,
}

impl Lines {
    /// Bytes that end a line.
    const fn ends(self) -> &'static [u8] {
        match self {
            Self::Slcan => b"\r\x07",
            Self::Candump => b"\n",
        }
    }
}

/// Frames of a bus, and its nodes.
pub(crate) struct BusInput {
    /// Lines with the frames.
    pub(crate) input: Box<dyn Read + Send>,
    /// Form of the lines.
    pub(crate) lines: Lines,
    /// Name for messages.
    pub(crate) name: String,
    /// Node-IDs, leg by leg, proximal joint first.
    pub(crate) nodes: Vec<u8>,
    /// Bit rate, for the load.
    pub(crate) bits_per_s: u64,
    /// Model that predicts the torque.
    pub(crate) model: Option<ModelFile>,
    /// Seconds of the bus per second; `None` for frames that arrive now.
    pub(crate) speed: Option<f64>,
}

/// Frame or line that the reader has received.
enum Received {
    Frame(f64, Frame),
    /// A line that is no frame, or an error of the input.
    Bad(String),
}

/// Reads the lines to their end, with times in seconds; returns the reason of the end.
fn read(input: Box<dyn Read + Send>, lines: Lines, received: &SyncSender<Received>) -> String {
    let begin = Instant::now();
    let mut input = BufReader::new(input);
    for number in 1_u64.. {
        let line = match next_line(&mut input, lines.ends()) {
            Ok(Some(line)) => line,
            Ok(None) => break,
            Err(error) => return format!("it cannot be read any further ({error})"),
        };
        let parsed = match (lines, String::from_utf8_lossy(&line)) {
            _ if line.len() == LONGEST_LINE => Err(format!("line {number}: it is too long for a frame")),
            (Lines::Slcan, _) if line == [BELL] => {
                Err("the adapter refuses a command; it may not be able to listen only (L)".into())
            }
            (Lines::Slcan, text) => {
                slcan::decode(&text).map(|frame| Some((begin.elapsed().as_secs_f64(), frame?)))
            }
            (Lines::Candump, text) => {
                candump::parse(&text).map_err(|why| format!("line {number}: {}", printable(&why)))
            }
        };
        let report = match parsed {
            Ok(None) => continue,
            Ok(Some((time_s, frame))) => Received::Frame(time_s, frame),
            Err(why) => Received::Bad(why),
        };
        if received.send(report).is_err() {
            break;
        }
    }
    match lines {
        Lines::Slcan => "the adapter closed the connection".into(),
        Lines::Candump => "the frames have ended".into(),
    }
}

/// What the status shows of the bus itself.
pub(crate) struct BusStatus<'a> {
    /// Load in words.
    pub(crate) load: &'a str,
    /// Nodes that were heard.
    pub(crate) heard: &'a str,
    /// Whether no further frame can come.
    pub(crate) has_ended: bool,
}

/// Time of the picture, s, from the time stamps of the frames.
struct Times {
    /// Longest silence; longer ones are jumps of the time stamps, s.
    most_silent_s: f64,
    /// Difference of time stamp and picture, s.
    offset_s: Option<f64>,
    now_s: f64,
}

impl Times {
    fn new(lines: Lines) -> Self {
        // The clock of this program does not jump.
        let most_silent_s = if lines == Lines::Slcan { f64::INFINITY } else { MOST_SILENT_S };
        Self { most_silent_s, offset_s: None, now_s: 0.0 }
    }

    /// Takes a time stamp, s. Returns a sentence if it jumped; the picture then goes on after a gap.
    fn take(&mut self, stamp_s: f64) -> Option<String> {
        let offset_s = *self.offset_s.get_or_insert(stamp_s);
        let step_s = stamp_s - offset_s - self.now_s;
        if (-MOST_BACK_S..=self.most_silent_s).contains(&step_s) {
            self.now_s += step_s.max(0.0);
            return None;
        }
        self.now_s += GAP_S;
        self.offset_s = Some(stamp_s - self.now_s);
        Some(format!("the time stamps jump by {step_s:.1} s; the picture goes on after {GAP_S} s"))
    }
}

/// Node of a frame that only the node itself sends: emergency, SDO answer, heartbeat.
fn sender(frame: &Frame) -> Option<u8> {
    let node = (frame.id() & 0x7F) as u8;
    (node > 0 && matches!(frame.id() & 0x780, 0x080 | 0x580 | 0x700)).then_some(node)
}

/// Bits on the wire over the last second.
#[derive(Default)]
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
        if lasted_s < 0.0 {
            (self.since_s, self.bits, self.frames) = (now_s, 0, 0);
        } else if lasted_s >= 1.0 {
            let percent = 100.0 * self.bits as f64 / (self.bits_per_s as f64 * lasted_s);
            let frames = f64::from(self.frames) / lasted_s;
            self.words = format!("{percent:.0} % of {} kbit/s, {frames:.0} frames/s", self.bits_per_s / 1000);
            (self.since_s, self.bits, self.frames) = (now_s, 0, 0);
        }
    }
}

/// Describes the bus and its legs; returns these, each with the beginning of its lines in the timeline.
fn legs<'a>(
    leg: &'a LegFile,
    source: &BusInput,
    out: &'a dyn Fn(LiveUpdate),
) -> Result<Vec<(String, Leg<'a>)>, ToolError> {
    let ids: Vec<&[u8]> = source.nodes.chunks_exact(leg.joints.len()).collect();
    let shown = if source.lines == Lines::Candump {
        Path::new(&source.name).file_name().unwrap_or_default()
    } else {
        source.name.as_ref()
    };
    let mut described = scene(leg, format!("CANopen bus, {}", shown.display()), source.speed.unwrap_or(1.0));
    let joints = described.legs.first().map(|leg| leg.joints.clone()).unwrap_or_default();
    described.legs =
        ids.iter().map(|ids| LegScene { name: leg_name(leg, ids), joints: joints.clone() }).collect();
    out(LiveUpdate::Scene(described));
    let mut legs = Vec::new();
    for (index, own) in ids.iter().enumerate() {
        let prefix = if ids.len() > 1 { format!("leg {}: ", index + 1) } else { String::new() };
        legs.push((prefix, Leg::new(leg, own, index, source.model.as_ref(), out)?));
    }
    Ok(legs)
}

/// Shows the legs of a bus until the input ends; returns the reason of the end.
///
/// # Errors
/// The input has no frame, or the leg file does not fit.
pub(crate) fn watch(leg: &LegFile, source: BusInput, out: &dyn Fn(LiveUpdate)) -> Result<String, ToolError> {
    let mut legs = legs(leg, &source, out)?;
    let BusInput { input, lines, name, bits_per_s, speed, .. } = source;
    let note = |time_s: f64, weight, words: String| out(LiveUpdate::Note(LiveNote { time_s, weight, words }));
    let mut load = Load { bits_per_s, ..Load::default() };
    let mut clock = speed.map(Clock::new);
    let (send, received) = sync_channel(MOST_WAITING);
    let reader = thread::spawn(move || read(input, lines, &send));
    let (mut times, mut due_s, mut arrived) = (Times::new(lines), 0.0, Instant::now());
    let (mut bad, mut first_bad, mut heard) = (0, None, BTreeSet::new());
    loop {
        match received.recv_timeout(SILENCE) {
            Ok(Received::Frame(stamp_s, frame)) => {
                arrived = Instant::now();
                if let Some(words) = times.take(stamp_s) {
                    note(times.now_s, Severity::Warning, words);
                }
                if let Some(clock) = &mut clock {
                    clock.wait((times.now_s * f64::from(SERVO_RATE_HZ)) as u64);
                }
                load.add(&frame);
                heard.extend(sender(&frame));
                for (prefix, leg) in &mut legs {
                    leg.take(&frame, times.now_s, prefix);
                }
            }
            Ok(Received::Bad(words)) => {
                bad += 1;
                if bad <= MOST_REPORTED {
                    note(times.now_s, Severity::Warning, format!("{name}: {words}"));
                }
                first_bad.get_or_insert(words);
            }
            Err(RecvTimeoutError::Timeout) => {}
            Err(RecvTimeoutError::Disconnected) => break,
        }
        // On a silent bus only the status is new.
        let silent_s = if clock.is_none() { arrived.elapsed().as_secs_f64() } else { 0.0 };
        let now_s = times.now_s + if silent_s > SILENCE.as_secs_f64() { silent_s } else { 0.0 };
        load.at(now_s);
        if now_s >= due_s || now_s + STATUS_S < due_s {
            due_s = now_s + STATUS_S;
            let numbers: Vec<String> = heard.iter().map(u8::to_string).collect();
            let bus = BusStatus { load: &load.words, heard: &numbers.join(", "), has_ended: false };
            legs.iter_mut().for_each(|(prefix, leg)| leg.report(now_s, prefix, &bus));
        }
    }
    let reason = reader.join().unwrap_or_else(|_| "its reader failed".into());
    if times.offset_s.is_none() {
        return Err(no_frame(&name, &reason, bad, first_bad));
    }
    let bus = BusStatus { load: &load.words, heard: "", has_ended: true };
    legs.iter_mut().for_each(|(prefix, leg)| leg.report(times.now_s, prefix, &bus));
    note(times.now_s, Severity::Note, "the source has ended".into());
    Ok(format!("{name}: {reason}"))
}

/// Refusal of an input without a frame, with the first of the lines that are none.
fn no_frame(name: &str, reason: &str, bad: u32, first: Option<String>) -> ToolError {
    let first = first.map_or_else(String::new, |why| format!("; {bad} lines are none, the first: {why}"));
    ToolError::input(format!("{name}: no CAN frame: {reason}{first}"))
}

/// Name of a leg with its nodes.
fn leg_name(leg: &LegFile, ids: &[u8]) -> String {
    let ids: Vec<String> = ids.iter().map(u8::to_string).collect();
    format!("{}, nodes {}", leg.name, ids.join(" and "))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn split(text: &[u8], lines: Lines) -> Vec<Vec<u8>> {
        let mut input = BufReader::with_capacity(7, text);
        core::iter::from_fn(|| next_line(&mut input, lines.ends()).expect("memory can be read")).collect()
    }

    #[test]
    fn lines_end_where_the_adapter_ends_them_and_a_bell_is_a_line() {
        assert_eq!(split(b"t1230\r\x07z\rrest", Lines::Slcan), [&b"t1230"[..], b"\x07", b"z", b"rest"]);
        assert_eq!(split(b"one\n\ntwo", Lines::Candump), [&b"one"[..], b"", b"two"]);
        let long = [&[b'x'; 1000][..], b"\nnext\n"].concat();
        let lines = split(&long, Lines::Candump);
        assert_eq!((lines.len(), lines[0].len(), &lines[1][..]), (2, LONGEST_LINE, &b"next"[..]));
    }

    #[test]
    fn time_stamps_that_jump_leave_a_gap_of_a_second() {
        let mut times = Times::new(Lines::Candump);
        for (stamp_s, now_s, jumps) in [
            (1e9, 0.0, false),
            (1e9 + 2.0, 2.0, false),
            (1e9 + 1.5, 2.0, false),
            (1e9 + 22.0, 22.0, false),
            (1e9 - 4000.0, 23.0, true),
            (1e9 - 3999.0, 24.0, false),
            (1e300, 25.0, true),
            (5.0, 26.0, true),
        ] {
            assert_eq!(times.take(stamp_s).is_some(), jumps, "{stamp_s}");
            assert!((times.now_s - now_s).abs() < 1e-6, "{stamp_s}: {} instead of {now_s}", times.now_s);
        }
        let mut arrivals = Times::new(Lines::Slcan);
        assert_eq!((arrivals.take(1.0), arrivals.take(3601.0), arrivals.now_s), (None, None, 3600.0));
    }

    #[test]
    fn the_load_is_counted_again_after_time_goes_back() {
        let mut load = Load { bits_per_s: 1_000_000, ..Load::default() };
        load.at(100.0);
        load.at(5.0);
        (0..100).for_each(|_| load.add(&Frame::new(0x80, &[])));
        load.at(6.0);
        assert!(load.words.ends_with("% of 1000 kbit/s, 100 frames/s"), "{}", load.words);
    }
}
