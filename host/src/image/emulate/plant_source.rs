//! Simulated leg as a constant of the emulated image: the initial state of a simulation on the host.

use crate::base::error::ToolError;
use crate::formats::leg_file::LegFile;
use crate::rig::options::SimulationOptions;
use crate::rig::pair::{Context, start_position};
use scarab::model::planar::{BASE, JOINTS};

/// Constants of `hal_sim::world::World` as Rust source.
pub fn source(leg: &LegFile, seed: u64) -> Result<String, ToolError> {
    let context = Context::<JOINTS, BASE>::new(leg, &SimulationOptions::of_seed(seed))?;
    let plant = leg.description::<JOINTS>()?;
    let noise = context.current_noise(leg);
    // The debug form of plain data is valid source; `?` writes numbers that read back bit for bit.
    Ok(format!(
        "// The simulated leg `{}`, written by `cargo emulate` from its leg file.\n\n\
         #[rustfmt::skip]\n\
         #[allow(unused_imports, reason = \"not every leg has all of it\")]\n\
         mod constants {{\n\
         use hal_sim::description::{{*, EncoderSide::*}};\n\n\
         /// The leg.\n\
         pub const PLANT: LegDescription<{JOINTS}> = {plant:#?};\n\
         /// Seed of the noise.\n\
         pub const SEED: u64 = {seed};\n\
         /// Initial joint angles [rad].\n\
         pub const START_RAD: [f64; {JOINTS}] = {:?};\n\
         /// Noise of a logged current sample, A.\n\
         pub const CURRENT_NOISE_A: [f64; {JOINTS}] = {noise:?};\n\
         }}\n\
         pub use constants::*;\n",
        leg.name,
        start_position::<JOINTS>(leg),
    ))
}
