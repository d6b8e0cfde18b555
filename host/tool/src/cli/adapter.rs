//! Adapter of a bus: arguments of every command that is a host on it.

use clap::Args;
use clap::builder::{PossibleValuesParser, TypedValueParser};
use scarab_base::error::ToolError;
use scarab_client::adapter::open;
use scarab_client::master::Client;

/// Adapter and its bit rate.
#[derive(Args, Debug)]
pub(crate) struct AdapterOptions {
    /// Adapter of the bus (slcan): HOST:PORT or a serial device.
    #[arg(long, value_name = "ADAPTER")]
    slcan: String,
    /// Bit rate of the bus, kbit/s.
    #[arg(long, value_name = "KBIT", default_value = "1000", value_parser = bit_rates())]
    bit_rate: u64,
}

impl AdapterOptions {
    /// Opens the bus as a host.
    pub(crate) fn client(&self) -> Result<Client, ToolError> {
        Client::new(open(&self.slcan, self.bit_rate)?)
    }
}

/// Bit rates of the board's controller, kbit/s (object 2002).
pub(crate) fn bit_rates() -> impl TypedValueParser<Value = u64> {
    PossibleValuesParser::new(["125", "250", "500", "1000"]).try_map(|rate| rate.parse::<u64>())
}
