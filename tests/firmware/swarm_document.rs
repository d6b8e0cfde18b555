//! Compares `docs/bso.md` with the code's constants and settings, and solves the example's objective.

#[path = "../../examples/damped_oscillation/objective.rs"]
mod objective;

use std::collections::BTreeMap;
use std::fs;

use objective::{BOX, DampedOscillation, UNKNOWNS, oscillation};
use scarab::swarm::{AdaptiveSettings, Bso, BsoSettings, Search};

/// Files with the constants of the default swarm.
const FILES: [&str; 5] = [
    "particles.rs",
    "beetle_swarm/adaptive.rs",
    "beetle_swarm/frame.rs",
    "beetle_swarm/leap.rs",
    "beetle_swarm/learning.rs",
];

/// Constants of ablations, which are not part of the algorithm.
const NOT_OF_THE_DEFAULT: [&str; 1] = ["WHISKER_DECAY"];

fn read(path: &str) -> String {
    let whole = format!("{}/../../{path}", env!("CARGO_MANIFEST_DIR"));
    fs::read_to_string(&whole).unwrap_or_else(|error| panic!("{path}: {error}"))
}

/// Rows `| name in backticks | number | ...` of the document.
fn documented() -> BTreeMap<String, f64> {
    let document = read("docs/bso.md");
    let row = |line: &str| {
        let mut cells = line.strip_prefix("| `")?.split(" | ");
        let name = cells.next()?.strip_suffix('`')?.to_owned();
        Some((name, cells.next()?.trim().parse().ok()?))
    };
    document.lines().filter_map(row).collect()
}

/// Constants `const NAME: f64 = number;` of the code, without tests.
fn constants() -> BTreeMap<String, f64> {
    let mut constants = BTreeMap::new();
    for file in FILES {
        let text = read(&format!("src/swarm/{file}"));
        let code = text.split("#[cfg(test)]").next().unwrap_or_default();
        for line in code.lines() {
            let Some((_, rest)) = line.split_once("const ") else { continue };
            let Some((name, rest)) = rest.split_once(": ") else { continue };
            let Some((kind, value)) = rest.split_once(" = ") else { continue };
            if !["f64", "u32", "usize"].contains(&kind) || NOT_OF_THE_DEFAULT.contains(&name) {
                continue;
            }
            let value = value.trim_end_matches(';').parse().unwrap_or_else(|_| panic!("{file}: {line}"));
            constants.insert(name.to_owned(), value);
        }
    }
    constants
}

fn settings() -> BTreeMap<String, f64> {
    let AdaptiveSettings {
        inertia_weight,
        individual_learning,
        global_learning,
        velocity_limit,
        velocity_share,
        step_limit,
        pair_directions,
        patience,
        leaps,
        without,
    } = AdaptiveSettings::<f64>::default();
    assert_eq!(without, None, "the default disables no part");
    [
        ("inertia_weight", inertia_weight),
        ("individual_learning", individual_learning),
        ("global_learning", global_learning),
        ("velocity_limit", velocity_limit),
        ("velocity_share", velocity_share),
        ("step_limit", step_limit),
        ("pair_directions", pair_directions as f64),
        ("patience", f64::from(patience)),
        ("leaps", f64::from(leaps)),
    ]
    .map(|(name, value)| (name.to_owned(), value))
    .into()
}

#[test]
fn the_document_lists_every_constant_of_the_default_swarm() {
    let mut code = constants();
    assert_eq!(code.len(), 33, "{:?}", code.keys());
    code.extend(settings());
    assert_eq!(documented(), code);
}

#[test]
fn a_damped_oscillation_is_found_in_either_precision_from_any_seed() {
    fn found<T: scarab::real::Real>(seed: u64) -> bool {
        let truth = [2.0, 0.8, 9.0, 0.7, 0.2].map(T::from_double);
        let samples: Vec<T> =
            (0..100).map(|index| oscillation(&truth, T::from_double(0.02 * f64::from(index)))).collect();
        let cost = DampedOscillation { samples: &samples, interval: T::from_double(0.02) };
        let mut swarm =
            Bso::<T, 20, UNKNOWNS>::new(&cost, BsoSettings::default(), seed).expect("the box is valid");
        // A cost of 1e-5 V^2 is 3 mV of 2 V: only the right frequency and phase reach it.
        swarm.reach(&cost, T::from_double(1e-5), 500)
    }
    assert!(BOX.iter().all(|&(_, _, low, high)| low < high));
    for seed in 600_000_001..600_000_021 {
        assert!(found::<f64>(seed) && found::<f32>(seed), "seed {seed}");
    }
}
