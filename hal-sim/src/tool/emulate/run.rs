//! Builds the emulated image and runs it.

use std::fs::File;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use super::plant_source;
use crate::tool::error::ToolError;
use crate::tool::image::build::{firmware_build, target_directory, write_if_changed};
use crate::tool::image::leg_source;
use crate::tool::leg_file::LegFile;

const ARGUMENTS: [&str; 9] = [
    "--quiet",
    "--release",
    "--package",
    "hal-sim",
    "--bin",
    "emulated",
    "--no-default-features",
    "--features",
    "emulated",
];
/// Below the target directory.
const IMAGE: &str = "firmware/thumbv7em-none-eabihf/release/emulated";
const EMULATOR: &str = "qemu-system-arm";
const MACHINE: [&str; 13] = [
    "-M",
    "netduinoplus2",
    "-nographic",
    "-monitor",
    "none",
    "-serial",
    "null",
    "-semihosting-config",
    "enable=on,target=native",
    "-icount",
    "shift=3",
    "-no-reboot",
    "-kernel",
];
/// An identification takes some tens of seconds.
const LONGEST: Duration = Duration::from_secs(300);

/// Builds the image of a leg; `log`: it tells every sample of the 500 Hz log.
pub fn build(leg: &LegFile, seed: u64, log: bool) -> Result<PathBuf, ToolError> {
    let directory = target_directory().join("firmware");
    let (description, _) = leg_source::describe(leg, seed)?;
    let constant = write_if_changed(&directory.join("emulated-leg.rs"), &leg_source::source(&description))?;
    let plant = write_if_changed(&directory.join("emulated-plant.rs"), &plant_source::source(leg, seed)?)?;
    let mut command = firmware_build(log);
    command.args(ARGUMENTS).env("SCARAB_LEG", constant).env("SCARAB_PLANT", plant);
    crate::tool::image::build::run(&mut command, "scripts/firmware-build")?;
    Ok(target_directory().join(IMAGE))
}

/// Runs an image to its end; its records go to a file. How long it took.
pub fn run(image: &Path, trace: &Path) -> Result<Duration, ToolError> {
    let output = File::create(trace).map_err(|error| ToolError::cannot_write(trace, &error))?;
    let started = Instant::now();
    let mut emulator = Command::new(EMULATOR)
        .args(MACHINE)
        .arg(image)
        .stdin(Stdio::null())
        .stdout(output)
        .spawn()
        .map_err(|error| {
            ToolError::input(format!(
                "{EMULATOR} cannot be started: {error}; it is installed by `apt-get install qemu-system-arm`, `brew install \
                 qemu` or from qemu.org"
            ))
        })?;
    loop {
        let ended = emulator.try_wait().map_err(|error| ToolError::input(format!("{EMULATOR}: {error}")))?;
        // What the image thinks of its end is in its records.
        if ended.is_some() {
            return Ok(started.elapsed());
        }
        if started.elapsed() > LONGEST {
            let _ = emulator.kill();
            let _ = emulator.wait();
            return Err(ToolError::input(format!(
                "{EMULATOR}: no end after {} s; what it told is in {}",
                LONGEST.as_secs(),
                trace.display()
            )));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}
