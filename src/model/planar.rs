//! Dimensions of the leg that all boards and examples have: hip and knee about parallel axes.

/// Joints, and axes of the board.
pub const JOINTS: usize = 2;
/// Base parameters with rotor inertia, both frictions and offset of each joint.
pub const BASE: usize = 13;
