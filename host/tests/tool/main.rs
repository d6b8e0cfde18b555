//! Command-line tests of the tool: each command with its output, files and rejections. One program,
//! so helpers are shared.

mod bus;
mod chain;
mod command;
mod crash;
mod emulation;
mod excite;
mod faults;
mod figures;
mod files;
mod fuzz;
mod image;
mod kept;
mod kept_file;
mod leg_options;
mod model_choice;
mod model_file;
mod model_predict;
mod model_urdf;
mod monitor;
mod motor;
mod pendulum;
mod regressor;
mod replay;
mod replay_doubt;
mod replay_mass;
mod replay_mujoco;
mod replay_real;
mod replay_recordings;
mod replay_refusals;
mod report_page;
mod robust;
mod samples;
mod scale;
mod serve;
mod shards;
mod trace;
mod verdict;

/// Program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_scarab");
