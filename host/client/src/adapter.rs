//! Adapter to a bus: slcan over TCP, or on a serial port.

use std::fs::File;
use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use scarab_base::error::ToolError;
use scarab_base::files::serial;

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
    pub fn try_clone(&self) -> std::io::Result<Self> {
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
