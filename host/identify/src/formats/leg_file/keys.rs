//! Keys that a leg file may lack, as lines to paste.
//!
//! Why words in capitals instead of values: a pasted example would pass for a measured number. A word in
//! capitals is no TOML, so a forgotten one is refused with its line.

/// Key with the line that states it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct KeyLine {
    pub(crate) key: &'static str,
    /// Line or lines of TOML, with words in capitals to replace.
    pub line: &'static str,
    /// Meaning and accepted values.
    pub meaning: &'static str,
}

/// Side of the body.
pub(crate) const SIDE: KeyLine = KeyLine {
    key: "side",
    line: "side = SIDE",
    meaning: "\"right\"; \"left\": the drives are mounted mirrored",
};

/// Simulated parameters of a joint.
pub const TRUTH: KeyLine = KeyLine {
    key: "truth",
    line: "truth = { mass = KG, com = [X_M, Y_M, Z_M], inertia_com = [XX, XY, XZ, YY, YZ, ZZ], rotor_inertia = KG_M2, \
           coulomb = NM, viscous = NM_S_RAD }",
    meaning: "simulated; inertia about the centre of mass, kg m2",
};

/// Belief about a joint's parameters.
pub const PRIOR: KeyLine = KeyLine {
    key: "prior",
    line: "prior = { mass = KG, com = [X_M, Y_M, Z_M], inertia_com = [XX, XY, XZ, YY, YZ, ZZ], rotor_inertia = KG_M2, \
           coulomb = NM, viscous = NM_S_RAD }",
    meaning: "assumed before measuring; inertia about the centre of mass, kg m2",
};

/// Keys of each joint that an image needs, in the order in which they are written.
pub(crate) const JOINT: [KeyLine; 10] = [
    KeyLine {
        key: "direction",
        line: "direction = SIGN",
        meaning: "1 or -1: D-H angle = direction x anatomical angle + zero offset",
    },
    KeyLine { key: "zero_offset_deg", line: "zero_offset_deg = DEG", meaning: "-360..360" },
    KeyLine { key: "range_deg", line: "range_deg = [LOWER, UPPER]", meaning: "anatomical" },
    KeyLine { key: "speed_limit_deg_s", line: "speed_limit_deg_s = DEG_S", meaning: "above 0, to 2800" },
    KeyLine {
        key: "acceleration_limit_deg_s2",
        line: "acceleration_limit_deg_s2 = DEG_S2",
        meaning: "above 0, to 1e5",
    },
    KeyLine {
        key: "torque_limit_nm",
        line: "torque_limit_nm = NM",
        meaning: "at the joint, above 0, to 1000",
    },
    KeyLine {
        key: "torque_per_ampere",
        line: "torque_per_ampere = NM_A",
        meaning: "at the joint: 1.5 x pole pairs x flux x gear ratio, 0.001..100",
    },
    KeyLine {
        key: "encoder",
        line: "encoder = { side = SIDE, counts = COUNTS, ratio = RATIO }",
        meaning: "\"motor\" or \"joint\"; counts per encoder turn; encoder turns per joint turn",
    },
    PRIOR,
    KeyLine {
        key: "motor",
        line: "[joint.motor]\npole_pairs = PAIRS\nresistance_ohm = OHM\ninductance_d_uh = UH\ninductance_q_uh = UH",
        meaning: "after the joint's other keys; one phase at 20 degrees Celsius",
    },
];

/// Keys of each joint's `prior` that an image needs.
pub(crate) const IN_PRIOR: [KeyLine; 3] = [
    KeyLine { key: "rotor_inertia", line: "rotor_inertia = KG_M2", meaning: "at the joint, 0..100" },
    KeyLine { key: "coulomb", line: "coulomb = NM", meaning: "0..1000" },
    KeyLine { key: "viscous", line: "viscous = NM_S_RAD", meaning: "0..1000" },
];
