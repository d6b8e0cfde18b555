//! Tests of the tool: its commands with their output, files and rejections, and its formats. One program, so
//! helpers are shared and the tool is linked once.

mod chain;
mod command;
mod eds;
mod excite;
mod excite_samples;
mod faults;
mod figures;
mod files;
mod fuzz;
mod image;
mod image_source;
mod imports;
mod kept;
mod leg_command;
mod leg_files;
mod leg_options;
mod live;
mod model_choice;
mod model_file;
mod model_predict;
mod model_urdf;
mod monitor;
mod motor;
mod other_hosts;
mod parameter_file;
mod pendulum;
mod recordings;
mod regressor;
mod replay;
mod replay_doubt;
mod replay_mass;
mod replay_mujoco;
mod replay_real;
mod replay_recordings;
mod replay_refusals;
mod report_page;
mod resampling;
mod robots;
mod robust;
mod samples;
mod scale;
mod serve;
mod shards;
mod trace;
mod verdict;

/// Program under test.
const PROGRAM: &str = env!("CARGO_BIN_EXE_scarab");

/// Largest memory of a process so far, KB; 0 where the system does not report it.
fn largest_memory_kb(process: u32) -> u64 {
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).unwrap_or_default();
    let line = status.lines().find(|line| line.starts_with("VmHWM:"));
    line.and_then(|line| line.split_whitespace().nth(1)?.parse().ok()).unwrap_or(0)
}
