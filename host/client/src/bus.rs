//! The bus as a client sees it: frames and a clock. Behind it is an adapter, a simulated network, or a model
//! of the microcontroller.

use std::io::{BufReader, Write};
use std::sync::mpsc::{Receiver, RecvTimeoutError, sync_channel};
use std::sync::{Arc, Mutex, PoisonError, Weak};
use std::thread;
use std::time::{Duration, Instant};

use scarab::bus::Frame;
use scarab_base::error::ToolError;

use crate::adapter::Adapter;
use crate::master::{HOST, RequestError};
use crate::slcan::{self, BELL, LONGEST_LINE, next_line};

/// Frames between reader and client.
const MOST_WAITING: usize = 4096;
/// Interval of this host's heartbeats, and their frame: operational.
const HEARTBEAT: Duration = Duration::from_millis(100);
const ALIVE: (u16, u8) = (0x700, 5);

/// Frames to and from the nodes, and the time that they live in.
pub trait Bus {
    /// Sends a frame.
    ///
    /// # Errors
    /// The bus failed.
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError>;

    /// Receives the next frame; `None` if none comes before [`Bus::now`] is `until`. Frames that have arrived
    /// are returned even if it is later.
    ///
    /// # Errors
    /// The bus failed, or no node can answer any more.
    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError>;

    /// Time since an instant that does not change.
    fn now(&self) -> Duration;
}

impl<B: Bus> Bus for &mut B {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        (**self).send(frame)
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        (**self).receive(until)
    }

    fn now(&self) -> Duration {
        (**self).now()
    }
}

/// Bus behind an slcan adapter, in real time.
pub struct Line {
    /// Shared with the heartbeats.
    adapter: Arc<Mutex<Adapter>>,
    frames: Receiver<Result<Frame, String>>,
    begun: Instant,
}

impl Line {
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

    /// Sends heartbeats from now on, as long as this line exists: nodes that watch it (1016) stop when the
    /// process ends.
    pub fn begin_heartbeats(&self) {
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

impl Bus for Line {
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        send(&self.adapter, frame).map_err(|error| RequestError::Adapter(error.to_string()))
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        match self.frames.recv_timeout(until.saturating_sub(self.now())) {
            Ok(Ok(frame)) => Ok(Some(frame)),
            Ok(Err(why)) => Err(RequestError::Adapter(why)),
            Err(RecvTimeoutError::Timeout) => Ok(None),
            Err(RecvTimeoutError::Disconnected) => {
                Err(RequestError::Adapter("the adapter closed the connection".into()))
            }
        }
    }

    fn now(&self) -> Duration {
        self.begun.elapsed()
    }
}

impl Drop for Line {
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
