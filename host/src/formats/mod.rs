//! Files and streams: read and checked, written.

pub mod anthropometry;
pub mod candump;
pub mod eds;
pub mod excitation;
pub mod excitation_constant;
pub mod kept_file;
pub mod leg_file;
pub mod model_file;
pub mod motion_samples;
pub mod recording;
pub mod robot;
pub mod shard;
pub mod slcan;
pub mod temperature;
pub mod trace;
pub mod urdf;
