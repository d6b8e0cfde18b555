//! Builds the image with the compiler installed for it, and writes it to a board.

use scarab_base::error::ToolError;
use scarab_base::files;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::leg::setup::DEFAULT_SEED;
use std::env;
use std::ffi::OsStr;
use std::path::{Path, PathBuf};
use std::process::Command;

use crate::image::leg_source::{describe, source};
use crate::image::seal::seal;

/// Image of the only board, and its bootloader.
const IMAGE: &str =
    "--quiet --profile image --package scarab --bin scarab-image --features=board-odrive-v3-6";
const BOOTLOADER: &str =
    "--quiet --profile image --package scarab-boot --bin scarab-boot --features=bootloader";
/// Directory of both below the target directory.
const DIRECTORY: &str = "firmware/thumbv7em-none-eabihf/image";
/// Name of the microcontroller for `probe-rs`.
const CHIP: &str = "STM32F405RGTx";

/// Options of an image.
#[derive(Clone, Debug)]
pub struct Options {
    /// Leg of the image.
    pub leg: LegFile,
    /// Whether every sample of the 500 Hz log is sent.
    pub log: bool,
    /// Whether a brake resistor is connected.
    pub brake_resistor: bool,
    /// Whether a status light is connected.
    pub status_light: bool,
    /// Voltage of a board without a factory version.
    pub board_volts: Option<u8>,
}

/// Workspace from which this tool was built.
fn workspace() -> &'static Path {
    Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../.."))
}

/// Directory of all builds.
pub fn target_directory() -> PathBuf {
    env::var_os("CARGO_TARGET_DIR").map_or_else(|| workspace().join("target"), PathBuf::from)
}

/// What a build leaves.
#[derive(Clone, Debug)]
pub struct Built {
    /// Image with its records' names (ELF).
    pub image: PathBuf,
    /// Plain bytes of the image, for an update over the bus.
    pub program: PathBuf,
    /// Bootloader (ELF).
    pub bootloader: PathBuf,
}

/// Builds image and bootloader.
pub fn build(options: &Options) -> Result<Built, ToolError> {
    let (description, _) = describe(&options.leg, DEFAULT_SEED)?;
    let constant = target_directory().join("firmware").join("leg.rs");
    let constant = write_if_changed(&constant, &source(&description))?;
    let mut command = firmware_build(options.log);
    command.args(IMAGE.split(' ')).env("SCARAB_LEG", constant);
    if options.brake_resistor {
        command.env("SCARAB_BRAKE_RESISTOR", "1");
    }
    if options.status_light {
        command.env("SCARAB_STATUS_LIGHT", "1");
    }
    if let Some(volts) = options.board_volts {
        command.env("SCARAB_BOARD_VOLTS", volts.to_string());
    }
    run(&mut command, "scripts/firmware-build")?;
    run(firmware_build(false).args(BOOTLOADER.split(' ')), "scripts/firmware-build")?;
    let directory = target_directory().join(DIRECTORY);
    let directory = directory.canonicalize().unwrap_or(directory);
    let image = directory.join("scarab-image");
    Ok(Built { program: seal(&image)?, image, bootloader: directory.join("scarab-boot") })
}

/// Writes a file unless it is unchanged, to avoid recompilation; returns the whole path.
pub(crate) fn write_if_changed(path: &Path, text: &str) -> Result<PathBuf, ToolError> {
    if std::fs::read_to_string(path).ok().as_deref() != Some(text) {
        files::write(path, text)?;
    }
    path.canonicalize().map_err(|error| ToolError::cannot_write(path, &error))
}

/// Build command for the microcontroller; with `log` the image sends every sample of the 500 Hz log.
pub fn firmware_build(log: bool) -> Command {
    let mut command = Command::new(workspace().join("scripts/firmware-build"));
    command.env("DEFMT_LOG", "info");
    // Capacity for a report's records between two polls of the probe.
    command.env("DEFMT_RTT_BUFFER_SIZE", "4096");
    // Settings of this tool's build must not affect the image.
    for name in ["RUSTFLAGS", "RUSTC", "RUSTUP_TOOLCHAIN", "CARGO"] {
        command.env_remove(name);
    }
    for name in ["SCARAB_TRACE_LOG", "SCARAB_BRAKE_RESISTOR", "SCARAB_STATUS_LIGHT", "SCARAB_BOARD_VOLTS"] {
        command.env_remove(name);
    }
    if log {
        command.env("SCARAB_TRACE_LOG", "1");
    }
    command
}

/// Writes bootloader and image to the board on the probe, starts it and prints its records until interrupted.
pub fn flash(built: &Built, further: &[String]) -> Result<(), ToolError> {
    // `download` takes those arguments only that select the probe.
    let selects = |name: &String| ["--probe", "--protocol", "--speed"].contains(&name.as_str());
    let pairs = further.windows(2).filter(|pair| selects(&pair[0]));
    let selection: Vec<String> = pairs.flat_map(<[String]>::to_vec).collect();
    probe("download", &selection, &built.bootloader)?;
    probe("run", further, &built.image)
}

/// Runs `probe-rs` with a file.
fn probe(action: &str, further: &[String], file: &Path) -> Result<(), ToolError> {
    let mut command = Command::new("probe-rs");
    command.args([OsStr::new(action), OsStr::new("--chip"), OsStr::new(CHIP)]);
    command.args(further).arg(file);
    run(&mut command, "probe-rs").map_err(|error| {
        if error.to_string().contains("cannot be started") {
            ToolError::input(format!("{error}; it is installed by `cargo install probe-rs-tools --locked`"))
        } else {
            error
        }
    })
}

/// Runs a program to its end.
pub fn run(command: &mut Command, name: &str) -> Result<(), ToolError> {
    match command.status() {
        Err(error) => Err(ToolError::input(format!("{name} cannot be started: {error}"))),
        Ok(status) if status.success() => Ok(()),
        Ok(status) => Err(ToolError::input(format!("{name} failed ({status})"))),
    }
}
