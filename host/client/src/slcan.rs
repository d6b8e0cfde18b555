//! Serial line protocol of CAN adapters (Lawicel, "slcan"): the adapter's side, and lines that it sends.
//!
//! ```text
//! S0 .. S8, s...   bit rate        reply CR      O   open      CR      C   close   CR
//!                                                L   listen    CR; a frame to be sent gets a bell
//! tIIILDD..        frame           reply z CR; bell if the queue is full
//! TIIIIIIIILDD..   29-bit frame    reply z CR; dropped
//! rIIIL            remote frame    reply z CR; dropped
//! V, v, N, F, Z, M, m              version, number, flags, settings
//! anything else, or a frame while the channel is closed: bell
//! ```
//!
//! Source: Lawicel CANUSB manual, version 2; the driver `slcan` of Linux; python-can's `slcan` interface.

use std::io::{BufRead, ErrorKind};

use scarab::bus::Frame;

use scarab_base::output::printable;

/// A line that the caller must decide and answer. All other lines are answered here.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Received {
    /// A frame for the bus: [`TAKEN`] or [`BELL`].
    Frame(Frame),
    /// Request to open the channel: [`DONE`], or a refusal.
    Open,
    /// The channel was opened to listen only: [`DONE`].
    Listen,
    /// The open channel was closed: [`DONE`].
    Close,
}

/// Length of the longest line: a frame with a 29-bit identifier.
const LONGEST: usize = 1 + 8 + 1 + 16;
/// Longest line that an adapter or a file of frames may send; longer ones are no frames.
pub const LONGEST_LINE: usize = 256;
/// Answer to a line that was refused.
pub const BELL: &[u8] = b"\x07";
/// Answer to a frame that was queued.
pub const TAKEN: &[u8] = b"z\r";
/// Answer to a command.
pub const DONE: &[u8] = b"\r";

/// State of the line to one client.
#[derive(Clone, Debug, Default)]
pub struct Line {
    bytes: Vec<u8>,
    /// The line is too long; it is discarded up to the next CR.
    overlong: bool,
    is_open: bool,
    listens_only: bool,
}

impl Line {
    /// Processes a byte from the client. Answers go to `out`, except the one to a returned line.
    pub fn receive(&mut self, byte: u8, out: &mut Vec<u8>) -> Option<Received> {
        match byte {
            b'\r' => {
                let bytes = std::mem::take(&mut self.bytes);
                if std::mem::take(&mut self.overlong) {
                    out.extend_from_slice(BELL);
                    return None;
                }
                match self.execute(&bytes) {
                    Ok(received) => return Some(received),
                    Err(answer) => out.extend_from_slice(answer),
                }
            }
            b'\n' => {}
            _ if self.bytes.len() < LONGEST => self.bytes.push(byte),
            _ => self.overlong = true,
        }
        None
    }

    fn execute(&mut self, line: &[u8]) -> Result<Received, &'static [u8]> {
        match line {
            [b'S' | b's', ..] if self.is_open => Err(BELL),
            [command @ (b'O' | b'L')] if !self.is_open => {
                (self.is_open, self.listens_only) = (true, *command == b'L');
                Ok(if self.listens_only { Received::Listen } else { Received::Open })
            }
            [b'C'] if self.is_open => {
                (self.is_open, self.listens_only) = (false, false);
                Ok(Received::Close)
            }
            // Clients begin with a few empty lines.
            [] | [b'O' | b'L' | b'C'] | [b'S' | b's' | b'Z' | b'M' | b'm', ..] => Err(DONE),
            [b'V'] => Err(b"V1013\r"),
            [b'v'] => Err(b"v1013\r"),
            [b'N'] => Err(b"N5CA2\r"),
            [b'F'] => Err(b"F00\r"),
            [b't' | b'T' | b'r' | b'R', ..] if self.listens_only => Err(BELL),
            [b't', rest @ ..] if self.is_open => frame(rest).map(Received::Frame).ok_or(BELL),
            [b'T' | b'r' | b'R', ..] if self.is_open => Err(TAKEN),
            _ => Err(BELL),
        }
    }
}

fn digit(byte: u8) -> Option<u16> {
    char::from(byte).to_digit(16).map(|digit| digit as u16)
}

/// Reads the next line without its end, which is one of these bytes; `None` at the end of the input. A bell
/// is a line of its own where it ends lines. The rest of a line of [`LONGEST_LINE`] bytes is dropped.
///
/// # Errors
/// Those of the input.
pub fn next_line(input: &mut impl BufRead, ends: &[u8]) -> std::io::Result<Option<Vec<u8>>> {
    let mut line = Vec::new();
    loop {
        let bytes = match input.fill_buf() {
            Err(error) if error.kind() == ErrorKind::Interrupted => continue,
            bytes => bytes?,
        };
        if bytes.is_empty() {
            return Ok(Some(line).filter(|line| !line.is_empty()));
        }
        let end = bytes.iter().position(|byte| ends.contains(byte));
        let part = &bytes[..end.map_or(bytes.len(), |end| end + usize::from(bytes[end] == BELL[0]))];
        line.extend(part.iter().take(LONGEST_LINE - line.len()));
        let used = end.map_or(bytes.len(), |end| end + 1);
        input.consume(used);
        if end.is_some() {
            return Ok(Some(line));
        }
    }
}

/// Decodes a line of an adapter. `None` for an answer to a command, and for frames that this bus does not
/// carry. A time stamp of four digits at the end is ignored.
///
/// # Errors
/// What is wrong with the line.
pub fn decode(line: &str) -> Result<Option<Frame>, String> {
    let line = line.trim_matches(|letter: char| letter.is_ascii_control() || letter == ' ');
    let Some(digits) = line.strip_prefix('t') else {
        let is_answer = line.is_empty() || line.starts_with(['z', 'Z', 'V', 'v', 'N', 'F', 'T', 'r', 'R']);
        return if is_answer { Ok(None) } else { Err(format!("the adapter says `{}`", printable(line))) };
    };
    let stamped = digits.len().checked_sub(4).and_then(|length| digits.get(..length));
    let found = frame(digits.as_bytes()).or_else(|| frame(stamped?.as_bytes()));
    found.map(Some).ok_or_else(|| format!("`{}` is not a frame of slcan", printable(line)))
}

/// Decodes `IIILDD..`.
fn frame(text: &[u8]) -> Option<Frame> {
    let (id, rest) = text.split_at_checked(3)?;
    let id = id.iter().try_fold(0, |id, byte| Some(id << 4 | digit(*byte)?))?;
    let (length, rest) = rest.split_first()?;
    let length = usize::from(digit(*length)?);
    if length > 8 || rest.len() != 2 * length || id > 0x7FF {
        return None;
    }
    let mut data = Vec::with_capacity(8);
    for pair in rest.chunks(2) {
        data.push((digit(pair[0])? << 4 | digit(pair[1])?) as u8);
    }
    Some(Frame::new(id, &data))
}

/// Appends a frame from the bus as a line.
pub fn encode(frame: &Frame, out: &mut Vec<u8>) {
    out.extend_from_slice(format!("t{:03X}{}", frame.id(), frame.data().len()).as_bytes());
    for byte in frame.data() {
        out.extend_from_slice(format!("{byte:02X}").as_bytes());
    }
    out.push(b'\r');
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_base::random::Random;

    fn exchange(line: &mut Line, text: &str) -> (Vec<Frame>, String) {
        let mut out = Vec::new();
        let mut frames = Vec::new();
        for byte in text.bytes() {
            match line.receive(byte, &mut out) {
                Some(Received::Frame(frame)) => {
                    frames.push(frame);
                    out.extend_from_slice(TAKEN);
                }
                Some(Received::Open | Received::Listen | Received::Close) => out.extend_from_slice(DONE),
                None => {}
            }
        }
        (frames, String::from_utf8(out).expect("ASCII"))
    }

    #[test]
    fn frames_pass_unchanged_once_the_channel_is_open() {
        let mut line = Line::default();
        assert_eq!(exchange(&mut line, "t0000\r"), (Vec::new(), "\x07".into()));
        assert_eq!(exchange(&mut line, "C\rS8\rO\r"), (Vec::new(), "\r\r\r".into()));
        let frame = Frame::new(0x601, &[0x40, 0x41, 0x60, 0, 0, 0, 0, 0]);
        assert_eq!(exchange(&mut line, "t60184041600000000000\r"), (vec![frame], "z\r".into()));
        let mut text = Vec::new();
        encode(&frame, &mut text);
        assert_eq!(text, b"t60184041600000000000\r");
        assert_eq!(exchange(&mut line, "C\r").1, "\r");
        assert!(!line.is_open);
    }

    #[test]
    fn a_listener_sends_nothing_until_it_opens_the_channel_again() {
        let mut line = Line::default();
        assert_eq!(exchange(&mut line, "C\rS8\rL\rt0000\rr0012\r"), (Vec::new(), "\r\r\r\x07\x07".into()));
        assert_eq!(exchange(&mut line, "C\rO\rt0000\r"), (vec![Frame::new(0, &[])], "\r\rz\r".into()));
    }

    #[test]
    fn lines_of_an_adapter_are_frames_answers_or_refusals() {
        let frame = Frame::new(0x181, &[0x37, 0x06]);
        for line in ["t18123706", "t18123706\r", "\x07t18123706", "t18123706A1F0"] {
            assert_eq!(decode(line), Ok(Some(frame)), "{line:?}");
        }
        for line in ["", "\r", "z\r", "V1013", "T000000010", "r1010"] {
            assert_eq!(decode(line), Ok(None), "{line:?}");
        }
        let hostile = decode("x\u{1b}[2J\u{202e}x").expect_err("no frame");
        assert_eq!(hostile, "the adapter says `x\\u{1b}[2J\\u{202e}x`");
        for line in ["t18", "t1812370", "t8000", "#refused: 127.0.0.1:9 has the channel", "tä1"] {
            assert!(decode(line).is_err(), "{line:?}");
        }
    }

    #[test]
    fn an_invalid_line_gets_a_bell_and_has_no_further_effect() {
        let mut line = Line::default();
        assert_eq!(exchange(&mut line, "O\r").1, "\r");
        for text in ["x", "t60", "t6019", "tFFF0", "t60110", "t6011xx", "t6010Z", "O1", &"t".repeat(300)] {
            assert_eq!(exchange(&mut line, &format!("{text}\r")), (Vec::new(), "\x07".into()), "{text}");
        }
        assert_eq!(exchange(&mut line, "t0010\r").0, [Frame::new(1, &[])]);
        // Frames that this bus does not carry are acknowledged and dropped.
        assert_eq!(exchange(&mut line, "T000000012AABB\rr0012\r"), (Vec::new(), "z\rz\r".into()));
    }

    #[test]
    fn random_bytes_cause_no_panic() {
        let mut line = Line::default();
        let mut random = Random::new("slcan", 1);
        let mut out = Vec::new();
        let letters = b"tTrROCSVvNFZMm0123456789ABCDEFabcdef\r\r\r\n\x00\xFF";
        for _ in 0..200_000 {
            let _ = line.receive(letters[random.below(letters.len() as u64) as usize], &mut out);
            out.clear();
        }
        for _ in 0..50_000 {
            let length = random.below(30);
            let line: Vec<u8> =
                (0..length).map(|_| letters[random.below(letters.len() as u64) as usize]).collect();
            let _ = decode(&String::from_utf8_lossy(&line));
        }
    }
}
