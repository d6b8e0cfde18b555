//! Supported boards, one file each with its parts; the layers above are the same on all of them.
//!
//! Requirements on a board, and how to port: docs/board.md.

#[cfg(all(target_arch = "arm", target_os = "none"))]
pub mod copy;
#[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))]
pub mod crash;
#[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))]
pub mod critical_section;
pub mod odrive_v3_6;
#[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))]
pub mod stack;
#[cfg(all(feature = "board-odrive-v3-6", target_os = "none"))]
pub mod windings;
