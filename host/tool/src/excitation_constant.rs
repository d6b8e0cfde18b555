//! Exciting motion as Rust source: a constant for an image.

use std::fmt::Write;

use scarab::motion::HARMONICS;

use scarab_identify::formats::excitation::Excitation;

/// Source of a module with one constant, `EXCITATION`; depends only on `scarab::motion`.
pub fn source(motion: &Excitation) -> String {
    let joints = motion.joints.len();
    let names: Vec<_> = motion.joints.iter().map(|joint| joint.name.as_str()).collect();
    let mut text = format!(
        "//! Exciting motion of the leg {:?} (geometry {}), joints {}.\n\
         //! Written by `scarab excite`.\n\
         //!\n\
         //! Model's (D-H) joint angles. A leg accepts it only after `LegConfiguration::prove`.\n\n\
         use scarab::motion::ExcitationTable;\n\n\
         /// {:.1} s, blends included.\n\
         #[rustfmt::skip]\n\
         pub const EXCITATION: ExcitationTable<{joints}, {HARMONICS}> = ExcitationTable {{\n",
        motion.leg,
        motion.geometry,
        names.join(", "),
        motion.duration_s(),
    );
    // Formatting into a String cannot fail.
    let _ = writeln!(text, "    period_s: {:?},", motion.period_s);
    let _ = writeln!(text, "    blend_s: {:?},", motion.blend_s);
    let _ = writeln!(text, "    cycles: {},", motion.cycles);
    let centres: Vec<_> = motion.joints.iter().map(|joint| format!("{:?}", joint.centre_rad)).collect();
    let _ = writeln!(text, "    centre_rad: [{}],", centres.join(", "));
    for (key, of) in [
        ("sine_rad", motion.joints.iter().map(|joint| &joint.sine_rad).collect::<Vec<_>>()),
        ("cosine_rad", motion.joints.iter().map(|joint| &joint.cosine_rad).collect()),
    ] {
        let _ = writeln!(text, "    {key}: [");
        for amplitudes in of {
            let mut all = amplitudes.clone();
            all.resize(HARMONICS, 0.0);
            let all: Vec<_> = all.iter().map(|amplitude| format!("{amplitude:?}")).collect();
            let _ = writeln!(text, "        [{}],", all.join(", "));
        }
        text.push_str("    ],\n");
    }
    text.push_str("};\n");
    text
}
