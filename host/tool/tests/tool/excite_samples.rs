//! Samples of a motion for other controllers: the servo's own states, their derivatives, both formats.

use scarab_identify::formats::excitation::{Excitation, geometry};
use scarab_identify::formats::leg_file::LegFile;
use std::path::Path;

use crate::command::{Folder, Table, assert_contains, scarab};
use scarab::servo::SERVO_RATE_HZ;
use serde_json::Value;

const SHIPPED: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/tests/data/excitation/x2_wearer_75kg.toml");

/// Leg with a knee that turns against its axis and has a zero offset, and a motion for it.
fn offset_leg(folder: &Folder) -> (LegFile, Excitation) {
    let mut leg = LegFile::load("x2-wearer-75kg").expect("shipped");
    let mut motion = Excitation::load(Path::new(SHIPPED)).expect("shipped with the tests");
    let knee = &mut leg.joints[1];
    assert_eq!(knee.direction, -1);
    knee.zero_offset_deg = 10.0;
    knee.name = "the \"knee\": #1".into();
    motion.joints[1].name = knee.name.clone();
    motion.joints[1].centre_rad += 10.0_f32.to_radians();
    // Bodies turn with the zero, so limits of torque are not what this test is about.
    knee.torque_limit_nm = 400.0;
    leg.joints[0].torque_limit_nm = 400.0;
    motion.geometry = geometry(&leg);
    folder.write("leg.toml", leg.to_toml());
    folder.write("motion.toml", motion.to_toml());
    (leg, motion)
}

/// Both files at a rate.
fn sampled(folder: &Folder, rate: u32) -> (Table, Vec<Value>) {
    let files = "--leg @leg.toml --excitation @motion.toml --csv @motion.csv --trajectory @motion.yaml";
    folder.scarab(&format!("excite --torque-margin 0 --rate {rate} {files}")).ends_with(0);
    let points = folder.read("motion.yaml");
    let points = points.lines().filter_map(|line| line.strip_prefix("- ")).map(flow).collect();
    (folder.table("motion.csv"), points)
}

/// Mapping in YAML's flow style whose keys are plain words, as JSON.
fn flow(text: &str) -> Value {
    let mut json = String::new();
    for part in text.split_inclusive(['{', ',', ' ']) {
        match part.strip_suffix(": ").or_else(|| part.trim_end().strip_suffix(':')) {
            Some(key) => json += &format!("\"{key}\": "),
            None => json += part,
        }
    }
    serde_json::from_str(&json).unwrap_or_else(|error| panic!("{error}: {json}"))
}

#[test]
fn samples_are_the_states_that_the_servo_follows() {
    let folder = Folder::new();
    let (leg, motion) = offset_leg(&folder);
    let motion = motion.motion::<2>().expect("a motion");
    for rate in [500, 4000] {
        let (table, points) = sampled(&folder, rate);
        let header = "t_s,q1_rad,qd1_radps,qdd1_radps2,q2_rad,qd2_radps,qdd2_radps2";
        assert_eq!(table.header.join(","), header);
        assert_eq!(points.len(), table.rows.len());
        for (row, point) in table.rows.iter().zip(&points) {
            let tick = (row[0] * f64::from(SERVO_RATE_HZ)).round() as u32;
            let state = motion.state_at(tick);
            for (joint, described) in leg.joints.iter().enumerate() {
                let sign = described.direction as f64;
                let zero = described.zero_offset_deg.to_radians();
                let expected = [
                    sign * (f64::from(state.position_rad[joint]) - zero),
                    sign * f64::from(state.velocity_rad_per_s[joint]),
                    sign * f64::from(state.acceleration_rad_per_s2[joint]),
                ];
                assert_eq!(row[1 + 3 * joint..4 + 3 * joint], expected, "tick {tick}");
                for (key, expected) in ["positions", "velocities", "accelerations"].iter().zip(expected) {
                    assert_eq!(point[key][joint].as_f64(), Some(expected), "{key} at tick {tick}");
                }
            }
            let time = &point["time_from_start"];
            let nanoseconds = |key: &str| time[key].as_u64().expect("a whole number");
            assert_eq!(
                nanoseconds("sec") * 1_000_000_000 + nanoseconds("nanosec"),
                u64::from(tick) * 250_000
            );
        }
        // From rest to rest, with every tick of the rate.
        let step = SERVO_RATE_HZ / rate;
        assert_eq!(table.rows.len() as u32, motion.duration_ticks().div_ceil(step) + 1);
        for end in [table.rows.first(), table.rows.last()] {
            let row = end.expect("rows");
            assert!([2, 3, 5, 6].iter().all(|column| row[*column] == 0.0), "{row:?}");
        }
    }
    let text = folder.read("motion.yaml");
    assert_contains(&text, "\njoint_names: [\"hip\", \"the \\\"knee\\\": #1\"]\npoints:\n- {positions: [");
}

#[test]
fn the_samples_are_states_for_predict_and_regressor() {
    let folder = Folder::new();
    offset_leg(&folder);
    let (table, _) = sampled(&folder, 50);
    let printed = folder.scarab("regressor --leg @leg.toml --states @motion.csv").ends_with(0).printed;
    assert_eq!(printed.lines().count(), table.rows.len() + 1);
}

#[test]
fn a_rate_between_the_ticks_is_refused_with_the_nearest() {
    for (rate, reason) in [
        ("300", "nearest: 250 Hz, 400 Hz"),
        ("0", "nearest: 1 Hz"),
        ("8000", "nearest: 4000 Hz"),
        ("-1", "is not a whole number from 1 to 4000 Hz"),
        ("nan", "is not a whole number"),
        ("99999999999", "is not a whole number"),
    ] {
        scarab(&format!("excite --csv no.csv --rate={rate}")).refuses(reason);
    }
    let same = scarab("excite --csv same.yaml --trajectory same.yaml").refusal();
    assert_contains(&same, "is the same file as");
    assert!(!Path::new("same.yaml").exists() && !Path::new("no.csv").exists());
}
