//! `fw` and `flash-leg`: builds the flash image, prints its size, and writes it to a board.

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_base::{files, output};
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_rig::image::build::{Built, Options, build, flash};
use scarab_rig::image::leg_source::{describe, source};
use scarab_rig::image::panics::Panics;
use scarab_rig::image::size::ImageSize;

use crate::cli::arguments::Output;
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;

/// Options of an image.
#[derive(Args, Debug)]
pub(crate) struct ImageOptions {
    #[command(flatten)]
    leg: LegOptions,
    /// Send every sample of the 500 Hz log.
    #[arg(long)]
    log: bool,
    /// Use the brake resistor that is connected.
    #[arg(long)]
    brake_resistor: bool,
    /// Use the status light that is connected to GPIO6.
    #[arg(long)]
    status_light: bool,
    /// Voltage of a board without a factory version: 24 or 56. A board with a version keeps its own.
    #[arg(long, value_name = "V", value_parser = board_volts)]
    board_volts: Option<u8>,
}

fn board_volts(text: &str) -> Result<u8, String> {
    match text {
        "24" => Ok(24),
        "56" => Ok(56),
        _ => Err(format!("`{text}` is neither 24 nor 56")),
    }
}

impl ImageOptions {
    fn load(&self) -> Result<Options, ToolError> {
        let leg = self.leg.load_for_image()?;
        if self.status_light && leg.brake.is_some() {
            return Err(ToolError::input(
                "--status-light: GPIO6 is the pin of the holding brake in the leg file; a leg has one of them",
            ));
        }
        Ok(Options {
            leg,
            log: self.log,
            brake_resistor: self.brake_resistor,
            status_light: self.status_light,
            board_volts: self.board_volts,
        })
    }
}

/// Image and outputs of its size.
#[derive(Args, Debug)]
pub(crate) struct FirmwareArguments {
    #[command(flatten)]
    image: ImageOptions,
    /// Write the sizes as JSON here.
    #[arg(long)]
    json: Option<Output>,
    /// Do not build; write the leg as the image's Rust constant here.
    #[arg(long, value_name = "FILE.rs")]
    source: Option<Output>,
}

/// Image and options of the probe.
#[derive(Args, Debug)]
pub(crate) struct FlashArguments {
    #[command(flatten)]
    image: ImageOptions,
    /// Arguments for `probe-rs run`.
    #[arg(last = true)]
    probe: Vec<String>,
}

/// Builds and prints the sizes; exit code 3 if a goal is missed or an interrupt can panic.
pub(crate) fn firmware(arguments: &FirmwareArguments) -> Result<u8, ToolError> {
    let options = arguments.image.load()?;
    if let Some(path) = &arguments.source {
        let (description, _) = describe(&options.leg, DEFAULT_SEED)?;
        files::write(path, source(&description))?;
        return Ok(EXIT_ACCEPTED);
    }
    let Built { image, program, bootloader } = build(&options)?;
    let size = ImageSize::read(&image)?;
    let panics = Panics::read(&image)?;
    let boot = ImageSize::read(&bootloader)?.flash();
    output::print(&format!(
        "image                     {}\nprogram for an update     {}\nbootloader, {boot} bytes    {}\n\n{}\n{}",
        image.display(),
        program.display(),
        bootloader.display(),
        size.text(),
        panics.text()
    ))?;
    if let Some(path) = &arguments.json {
        write_json(path, &size)?;
    }
    if let Some(warning) = size.warning() {
        eprintln!("warning: {warning}");
    }
    let missed = size.missed();
    for goal in &missed {
        eprintln!("too large: {goal}");
    }
    for site in panics.missed() {
        eprintln!("{site}");
    }
    let kept = missed.is_empty() && panics.missed().is_empty();
    Ok(if kept { EXIT_ACCEPTED } else { EXIT_REFUSED })
}

/// Builds, checks the size, writes the image to the board and prints its records.
pub(crate) fn flash_leg(arguments: &FlashArguments) -> Result<u8, ToolError> {
    arguments.image.leg.require("cargo flash-leg --leg my-leg.toml")?;
    let built = build(&arguments.image.load()?)?;
    let missed = ImageSize::read(&built.image)?.missed();
    if !missed.is_empty() {
        return Err(ToolError::Refused(format!("the image is too large: {}", missed.join("; "))));
    }
    flash(&built, &arguments.probe)?;
    Ok(EXIT_ACCEPTED)
}
