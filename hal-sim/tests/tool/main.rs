//! Command-line tests of the tool: each command with its output, files and rejections. One program,
//! so helpers are shared.
#![cfg(feature = "tool")]

mod bus;
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
mod paper;
mod paper_chain;
mod pendulum;
mod regressor;
mod replay;
mod replay_mujoco;
mod replay_real;
mod replay_refusals;
mod report_page;
mod robust;
mod scale;
mod serve;
mod trace;
mod verdict;
