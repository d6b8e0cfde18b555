//! The boards Scarab runs on, one file each with its parts; everything above is the same on all of them.
//!
//! What a board must provide, and how to port: docs/board.md.

pub mod odrive_v3_6;
