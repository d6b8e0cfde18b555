//! Scarab's simulated hardware.
#![cfg_attr(not(feature = "tool"), no_std)]
#[cfg(feature = "tool")]
pub mod tool;
