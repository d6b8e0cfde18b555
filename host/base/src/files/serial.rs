//! Serial ports.

use std::fs::File;
use std::path::Path;

/// Speed of the port, bit/s; adapters on USB ignore it.
#[cfg(unix)]
const BAUD: u32 = 115_200;

/// Opens a serial port without echo and line editing.
///
/// # Errors
/// Those of the device.
#[cfg(unix)]
pub fn open(device: &Path) -> std::io::Result<File> {
    use std::os::unix::fs::OpenOptionsExt;

    use rustix::fs::OFlags;
    use rustix::termios::{ControlModes, OptionalActions, tcgetattr, tcsetattr};

    let no_terminal = OFlags::NOCTTY.bits().cast_signed();
    let port = File::options().read(true).write(true).custom_flags(no_terminal).open(device)?;
    let mut settings = tcgetattr(&port)?;
    settings.make_raw();
    settings.control_modes |= ControlModes::CLOCAL | ControlModes::CREAD;
    settings.set_speed(BAUD)?;
    tcsetattr(&port, OptionalActions::Now, &settings)?;
    Ok(port)
}

/// Opens a serial port.
///
/// # Errors
/// Always.
#[cfg(not(unix))]
pub fn open(_: &Path) -> std::io::Result<File> {
    Err(std::io::Error::other("serial ports are supported on Unix only; use a TCP port"))
}
