//! Files and streams: read and checked, written.

pub mod anthropometry;
pub mod excitation;
pub mod leg_file;
pub mod model_file;
pub mod motion_samples;
pub mod recording;
pub mod robot;
pub mod shard;
pub mod temperature;
pub mod urdf;
