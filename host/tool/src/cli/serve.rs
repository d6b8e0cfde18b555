//! `serve`: legs on a CANopen bus, reached by host software through a TCP port.

use std::net::{SocketAddr, ToSocketAddrs};
use std::path::Path;

use clap::Args;
use scarab_base::error::{EXIT_ACCEPTED, ToolError};
use scarab_identify::leg::exercise::Exercise;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_rig::bus::serve::{Beginning, ServeOptions, serve};
use scarab_rig::worn::CADENCE_HZ;

use crate::cli::adapter::bit_rates;
use crate::cli::arguments::{Choice, Updated, one_of};
use crate::cli::leg_options::LegOptions;

/// Motions of a wearer.
const MOTIONS: &[Choice<Exercise>] = &[
    ("gait", Exercise::Gait(CADENCE_HZ), "Walks in the air"),
    ("kicking", Exercise::Kicking, "Kicks with the knee"),
    ("extension", Exercise::Extension, "Extends the knee slowly, seated"),
    ("reaching", Exercise::Reaching, "Reaches random postures"),
];

/// Legs, address and speed.
#[derive(Args, Debug)]
pub(crate) struct ServeArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Address and port of the simulated CAN adapter (slcan over TCP); port 0 selects a free one.
    #[arg(long, value_name = "HOST:PORT", value_parser = address)]
    slcan: SocketAddr,
    /// Number of boards on the bus, each with this leg.
    #[arg(long, default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=4))]
    legs: u8,
    /// All boards have the node-IDs 1 and 2, as new ones. Otherwise the second has 3 and 4, and so on.
    #[arg(long)]
    new: bool,
    /// Each leg is on a wearer who moves so while it assists, and is limp otherwise. The boards know the
    /// models of the empty and the worn leg.
    #[arg(long, value_parser = one_of(MOTIONS), help_heading = "Simulated wearer")]
    motion: Option<Exercise>,
    /// The boards are neither calibrated nor have zeros, and the operator's contacts are open. A calibration
    /// is refused, because the legs hang on their motors.
    #[arg(long, conflicts_with = "enabled_by_contacts")]
    uncalibrated: bool,
    /// The operator's contacts have enabled the legs before a host comes.
    #[arg(long)]
    enabled_by_contacts: bool,
    /// Simulated seconds per second.
    #[arg(long, value_name = "K", default_value_t = 1.0)]
    speed: f64,
    /// Bit rate of the bus, kbit/s.
    #[arg(long, value_name = "KBIT", default_value = "1000", value_parser = bit_rates())]
    bit_rate: u64,
    /// File with the boards' flash; created if missing.
    #[arg(long, value_name = "FILE")]
    flash: Option<Updated>,
    /// Seed of the noise.
    #[arg(long, default_value_t = DEFAULT_SEED)]
    seed: u64,
}

/// Resolves a host name or number; of several addresses the first of version 4.
fn address(text: &str) -> Result<SocketAddr, String> {
    let mut found: Vec<SocketAddr> = text.to_socket_addrs().map_err(|error| error.to_string())?.collect();
    found.sort_by_key(SocketAddr::is_ipv6);
    found.first().copied().ok_or_else(|| "no address".into())
}

/// Serves until SIGTERM; returns the exit code.
pub(crate) fn run(arguments: &ServeArguments) -> Result<u8, ToolError> {
    let leg = arguments.leg.load()?;
    if !(arguments.speed > 0.0 && arguments.speed <= 100.0) {
        return Err(ToolError::input(format!(
            "--speed: {} must be above 0 and at most 100",
            arguments.speed
        )));
    }
    let options = ServeOptions {
        address: arguments.slcan,
        legs: arguments.legs.into(),
        are_new: arguments.new,
        speed: arguments.speed,
        flash: arguments.flash.as_deref().map(Path::to_owned),
        seed: arguments.seed,
        bits_per_s: 1000 * arguments.bit_rate,
        beginning: match (arguments.uncalibrated, arguments.enabled_by_contacts) {
            (true, _) => Beginning::Uncalibrated,
            (_, true) => Beginning::EnabledByContacts,
            _ => Beginning::Ready,
        },
        wearer: arguments.motion,
    };
    serve(&leg, &options)?;
    Ok(EXIT_ACCEPTED)
}
