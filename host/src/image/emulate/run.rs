//! Builds the emulated image and runs it.

use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};
use std::time::{Duration, Instant};

use crate::base::error::ToolError;
use crate::base::files::NewFile;
use crate::formats::leg_file::LegFile;
use crate::image::build::{firmware_build, target_directory, write_if_changed};
use crate::image::emulate::crash::CrashKind;
use crate::image::emulate::plant_source;
use crate::image::leg_source;

const ARGUMENTS: [&str; 9] = [
    "--quiet",
    "--profile",
    "image",
    "--package",
    "scarab-emulated",
    "--bin",
    "emulated",
    "--features",
    "emulated",
];
/// Path of the image below the target directory.
const IMAGE: &str = "firmware/thumbv7em-none-eabihf/image/emulated";
const EMULATOR: &str = "qemu-system-arm";
const MACHINE: [&str; 9] =
    ["-M", "netduinoplus2", "-nographic", "-monitor", "none", "-serial", "null", "-icount", "shift=3"];
/// Semihosting carries the records out and the requests to the image in.
const SEMIHOSTING: [&str; 2] = ["-semihosting-config", "enable=on,target=native"];
/// Logged events: exceptions, resets, and writes to unmodelled devices.
const LOGGED: [&str; 2] = ["-d", "int,unimp,cpu_reset"];
/// Limit of a run; an identification takes some tens of seconds.
const LONGEST: Duration = Duration::from_secs(300);

/// Whether the emulator is installed.
#[must_use]
pub fn is_there() -> bool {
    let silent = || Stdio::null();
    let mut emulator = Command::new(EMULATOR);
    emulator.arg("--version").stdin(silent()).stdout(silent()).stderr(silent());
    emulator.status().is_ok_and(|status| status.success())
}

/// Builds the image of a leg; with `log` it sends every sample of the 500 Hz log.
pub fn build(leg: &LegFile, seed: u64, log: bool) -> Result<PathBuf, ToolError> {
    let directory = target_directory().join("firmware");
    let (description, _) = leg_source::describe(leg, seed)?;
    let constant = write_if_changed(&directory.join("emulated-leg.rs"), &leg_source::source(&description))?;
    let plant = write_if_changed(&directory.join("emulated-plant.rs"), &plant_source::source(leg, seed)?)?;
    let mut command = firmware_build(log);
    command.args(ARGUMENTS).env("SCARAB_LEG", constant).env("SCARAB_PLANT", plant);
    crate::image::build::run(&mut command, "scripts/firmware-build")?;
    Ok(target_directory().join(IMAGE))
}

/// Runs an image to its end and writes its records to a file; returns the duration.
pub fn run(image: &Path, trace: &Path) -> Result<Duration, ToolError> {
    let started = Instant::now();
    let mut emulator = Command::new(EMULATOR);
    emulator.args(MACHINE).args(SEMIHOSTING).arg("-kernel").arg(image);
    wait(emulator, trace)?;
    Ok(started.elapsed())
}

/// Crashes an image in a servo tick; writes its records and the emulator's log to files. Returns
/// the clock at the start of the crash.
pub fn crash(image: &Path, trace: &Path, log: &Path, kind: CrashKind, tick: u32) -> Result<u32, ToolError> {
    let [option, semihosting] = SEMIHOSTING;
    let crash = format!("{semihosting},arg=scarab,arg=crash={}@{tick}", kind.name());
    let mut emulator = Command::new(EMULATOR);
    emulator.args(MACHINE).args([option, &crash]).args(LOGGED).arg("-D").arg(log).arg("-kernel").arg(image);
    emulator.stderr(Stdio::piped());
    let said = wait(emulator, trace)?;
    let begun = said.lines().find_map(|line| line.rsplit_once(" was begun at instruction ")?.1.parse().ok());
    begun.ok_or_else(|| {
        ToolError::input(format!("the image does not report the instruction of its crash: `{}`", said.trim()))
    })
}

/// Waits for the end of the emulator and returns its captured output.
fn wait(mut emulator: Command, trace: &Path) -> Result<String, ToolError> {
    let output = NewFile::create(trace)?;
    let started = Instant::now();
    let mut emulator = emulator.stdin(Stdio::null()).stdout(output.handle()?).spawn().map_err(|error| {
        ToolError::input(format!(
            "{EMULATOR} cannot be started: {error}; it is installed by `apt-get install qemu-system-arm`, `brew install qemu` or \
             from qemu.org"
        ))
    })?;
    loop {
        let ended = emulator.try_wait().map_err(|error| ToolError::input(format!("{EMULATOR}: {error}")))?;
        // The image's own view of its end is in its records.
        if ended.is_some() {
            output.finish()?;
            let mut said = String::new();
            if let Some(mut errors) = emulator.stderr.take() {
                let _ = errors.read_to_string(&mut said);
            }
            return Ok(said);
        }
        if started.elapsed() > LONGEST {
            let _ = emulator.kill();
            let _ = emulator.wait();
            output.finish()?;
            return Err(ToolError::input(format!(
                "{EMULATOR}: not finished after {} s; its records are in {}",
                LONGEST.as_secs(),
                trace.display()
            )));
        }
        std::thread::sleep(Duration::from_millis(50));
    }
}
