//! Exciting motion of the leg "x2-wearer-75kg" (geometry 7deaf1c6bfce81bb), joints hip, knee.
//! Written by `scarab excite`.
//!
//! Model's (D-H) joint angles. A leg accepts it only after `LegConfiguration::prove`.

use scarab::motion::ExcitationTable;

/// 22.0 s, blends included.
#[rustfmt::skip]
pub const EXCITATION: ExcitationTable<2, 6> = ExcitationTable {
    period_s: 3.333,
    blend_s: 1.0,
    cycles: 6,
    centre_rad: [0.458959, -1.125179],
    sine_rad: [
        [0.203224, 0.025132, 0.065994, -0.058659, -0.013859, -0.024714],
        [-0.077365, 0.086558, 0.139031, -0.092257, 0.202771, 0.038026],
    ],
    cosine_rad: [
        [-0.169187, -0.0365, 0.009744, -0.076697, -0.047753, -0.047343],
        [-0.333369, 0.281781, 0.007222, 0.037411, 0.006277, 0.042178],
    ],
};
