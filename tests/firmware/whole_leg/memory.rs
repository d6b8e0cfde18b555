//! Memory that a leg needs on the device.

use std::mem::size_of;

use scarab::ident::record::window::{NUMBERS, Window};
use scarab::ident::{Estimate, HeldOut, Record, Recorder, RowFilter, Solver, SwarmSearch};
use scarab::leg::{Control, Identification, Leg, ModelMonitor};
use scarab_rig::pair::{PENDING, TAPS};

use super::*;

/// Static memory of the board, besides 64 KB of core-coupled memory. Pointers are wider on the host, but a
/// leg has none.
const STATIC_BYTES: usize = 48 * 1024;

/// Window of blocks, which only the processor accesses.
const WINDOW_BYTES: usize = size_of::<Window<f32, JOINTS, BASE, NUMBERS>>();
const _: () = assert!(WINDOW_BYTES <= 34 * 1024);

#[test]
fn a_leg_fits_its_reserved_memory() {
    let sizes = [
        ("Leg", size_of::<Leg<JOINTS, BASE, TAPS, PENDING>>(), 49_000 + WINDOW_BYTES),
        ("Control", size_of::<Control<JOINTS>>(), 2_500),
        ("Identification", size_of::<Identification<JOINTS, BASE, TAPS, PENDING>>(), 45_200 + WINDOW_BYTES),
        ("Recorder", size_of::<Recorder<f32, JOINTS, BASE, TAPS, PENDING>>(), 18_000 + WINDOW_BYTES),
        ("Solver", size_of::<Solver<f32, JOINTS, BASE>>(), 17_000),
        ("Record", size_of::<Record<f32, JOINTS, BASE>>(), 2_000),
        ("HeldOut", size_of::<HeldOut<f32, JOINTS, BASE, PENDING>>(), 6_000),
        ("ModelMonitor", size_of::<ModelMonitor<JOINTS, BASE>>(), 2_500),
        ("SwarmSearch", size_of::<SwarmSearch<f32, BASE>>(), 10_200),
    ];
    for (name, bytes, largest) in sizes {
        println!("{name}: {bytes} bytes");
        assert!(bytes <= largest, "{name}: {bytes} bytes");
    }
    assert!(sizes[0].1 <= STATIC_BYTES + WINDOW_BYTES);
    println!("RowFilter: {} bytes", size_of::<RowFilter<f32, JOINTS, BASE, PENDING>>());
    println!("Estimate: {} bytes", size_of::<Estimate<f32, BASE>>());
    println!("Window: {WINDOW_BYTES} bytes");
    println!("Leg of three joints: {} bytes", size_of::<Leg<3, 28, TAPS, PENDING>>());
}
