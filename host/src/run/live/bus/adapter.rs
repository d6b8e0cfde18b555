//! Adapter that listens to a bus: slcan over TCP, or on a serial port.

use std::io::{Read, Write};
use std::net::TcpStream;
use std::path::Path;

use crate::base::error::ToolError;
use crate::base::files::serial;

/// Opens the channel of an adapter to listen only, at a bit rate in kbit/s.
///
/// # Errors
/// The adapter cannot be reached or set.
pub fn listen(adapter: &str, bit_rate: u64) -> Result<Box<dyn Read + Send>, ToolError> {
    let rate = match bit_rate {
        125 => 4,
        250 => 5,
        500 => 6,
        _ => 8,
    };
    let commands = format!("C\rS{rate}\rL\r");
    let failed = |error: std::io::Error| ToolError::input(format!("--slcan: {adapter}: {error}"));
    if adapter.starts_with('/') || Path::new(adapter).exists() {
        let mut port = serial::open(Path::new(adapter)).map_err(failed)?;
        port.write_all(commands.as_bytes()).map_err(failed)?;
        return Ok(Box::new(port));
    }
    let mut stream = TcpStream::connect(adapter).map_err(|error| {
        ToolError::input(format!("--slcan: {adapter}: {error}; it must be HOST:PORT or a serial device"))
    })?;
    stream.write_all(commands.as_bytes()).map_err(failed)?;
    Ok(Box::new(stream))
}
