//! Adapter to a bus: slcan over TCP, or on a serial port.

use std::fs::File;
use std::io::{BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab_base::error::ToolError;
use scarab_base::files::serial;

use crate::bus::{Bus, HOST, RequestError};
use crate::slcan::{self, BELL, LONGEST_LINE, next_line};

/// Frames between reader and client.
const MOST_WAITING: usize = 4096;
/// Interval of this host's heartbeats, and their frame: operational.
const HEARTBEAT: Duration = Duration::from_millis(100);
const ALIVE: (u16, u8) = (0x700, 5);

/// Line to an adapter.
pub enum Adapter {
    /// slcan over TCP.
    Tcp(TcpStream),
    /// slcan on a serial port.
    Serial(File),
}

impl Adapter {
    /// Opens the line; the channel stays closed.
    fn new(adapter: &str) -> Result<Self, ToolError> {
        if adapter.starts_with('/') || Path::new(adapter).exists() {
            return serial::open(Path::new(adapter))
                .map(Self::Serial)
                .map_err(|error| failed(adapter, &error));
        }
        let refused = |error: std::io::Error| {
            let advice = if adapter.contains(':') {
                "does a program serve that port?"
            } else {
                "it must be HOST:PORT or a serial device"
            };
            ToolError::input(format!("--slcan: {adapter}: {error}; {advice}"))
        };
        let stream = TcpStream::connect(adapter).map_err(refused)?;
        stream.set_nodelay(true).map_err(refused)?;
        Ok(Self::Tcp(stream))
    }

    /// Returns a second handle of the same line.
    ///
    /// # Errors
    /// Those of the operating system.
    pub(crate) fn try_clone(&self) -> std::io::Result<Self> {
        Ok(match self {
            Self::Tcp(stream) => Self::Tcp(stream.try_clone()?),
            Self::Serial(port) => Self::Serial(port.try_clone()?),
        })
    }
}

impl Read for Adapter {
    fn read(&mut self, bytes: &mut [u8]) -> std::io::Result<usize> {
        match self {
            Self::Tcp(stream) => stream.read(bytes),
            Self::Serial(port) => port.read(bytes),
        }
    }
}

impl Write for Adapter {
    fn write(&mut self, bytes: &[u8]) -> std::io::Result<usize> {
        match self {
            Self::Tcp(stream) => stream.write(bytes),
            Self::Serial(port) => port.write(bytes),
        }
    }

    fn flush(&mut self) -> std::io::Result<()> {
        match self {
            Self::Tcp(stream) => stream.flush(),
            Self::Serial(port) => port.flush(),
        }
    }
}

fn failed(adapter: &str, error: &std::io::Error) -> ToolError {
    ToolError::input(format!("--slcan: {adapter}: {error}"))
}

/// Sets the bit rate (kbit/s) and opens the channel by a command.
fn begin(adapter: &str, bit_rate: u64, open: char) -> Result<Adapter, ToolError> {
    let rate = match bit_rate {
        125 => 4,
        250 => 5,
        500 => 6,
        _ => 8,
    };
    let mut line = Adapter::new(adapter)?;
    line.write_all(format!("C\rS{rate}\r{open}\r").as_bytes()).map_err(|error| failed(adapter, &error))?;
    Ok(line)
}

/// Opens the channel of an adapter to listen only, at a bit rate in kbit/s.
///
/// # Errors
/// The adapter cannot be reached or set.
pub fn listen(adapter: &str, bit_rate: u64) -> Result<Adapter, ToolError> {
    begin(adapter, bit_rate, 'L')
}

/// Opens the channel of an adapter, at a bit rate in kbit/s.
///
/// # Errors
/// The adapter cannot be reached or set.
pub fn open(adapter: &str, bit_rate: u64) -> Result<Adapter, ToolError> {
    begin(adapter, bit_rate, 'O')
}

/// Bus behind an slcan adapter, in real time.
pub struct AdapterBus {
    /// Shared with the heartbeats.
    adapter: Arc<Mutex<Adapter>>,
    frames: Receiver<Result<Frame, String>>,
    begun: Instant,
}

impl AdapterBus {
    /// Takes over an adapter with an open channel, which is closed at the end.
    ///
    /// # Errors
    /// Those of the operating system.
    pub fn new(adapter: Adapter) -> Result<Self, ToolError> {
        let reader = adapter.try_clone().map_err(|error| ToolError::input(format!("--slcan: {error}")))?;
        let (give, frames) = sync_channel(MOST_WAITING);
        thread::spawn(move || {
            let mut reader = BufReader::new(reader);
            while let Some(line) = next_line(&mut reader, &[b'\r', BELL[0]]).transpose() {
                let decoded = match line {
                    Ok(line) if line.len() == LONGEST_LINE => Err(format!(
                        "the adapter sends a line of {LONGEST_LINE} bytes or more, which is no frame"
                    )),
                    Ok(line) => slcan::decode(&String::from_utf8_lossy(&line)),
                    Err(error) => Err(error.to_string()),
                };
                let ends = decoded.is_err();
                if let Some(found) = decoded.transpose()
                    && (give.send(found).is_err() || ends)
                {
                    return;
                }
            }
            let _ = give.send(Err("the adapter closed the connection".into()));
        });
        Ok(Self { adapter: Arc::new(Mutex::new(adapter)), frames, begun: Instant::now() })
    }

    /// Sends heartbeats from now on, as long as this bus exists: nodes that watch it (1016) stop when the
    /// process ends.
    pub(crate) fn begin_heartbeats(&self) {
        let adapter: Weak<Mutex<Adapter>> = Arc::downgrade(&self.adapter);
        let (identifier, operational) = ALIVE;
        let alive = Frame::new(identifier + u16::from(HOST), &[operational]);
        thread::spawn(move || {
            while let Some(adapter) = adapter.upgrade() {
                if send(&adapter, &alive).is_err() {
                    return;
                }
                drop(adapter);
                thread::sleep(HEARTBEAT);
            }
        });
    }
}

impl Bus for AdapterBus {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        send(&self.adapter, frame).map_err(lost)
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        match self.frames.recv_timeout(until.saturating_sub(self.now())) {
            Ok(Ok(frame)) => Ok(Some(frame)),
            Ok(Err(why)) => Err(lost(why)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => Err(lost("the adapter closed the connection")),
        }
    }

    fn now(&self) -> Duration {
        self.begun.elapsed()
    }
}

impl Drop for AdapterBus {
    fn drop(&mut self) {
        let _ = self.adapter.lock().unwrap_or_else(PoisonError::into_inner).write_all(b"C\r");
    }
}

/// Sends a frame as one line.
fn send(adapter: &Mutex<Adapter>, frame: &Frame) -> std::io::Result<()> {
    let mut text = Vec::new();
    slcan::encode(frame, &mut text);
    adapter.lock().unwrap_or_else(PoisonError::into_inner).write_all(&text)
}

fn lost(why: impl std::fmt::Display) -> RequestError {
    RequestError::Failed(format!(
        "--slcan: {why}; run the command again once the bus is free and its boards answer"
    ))
}
