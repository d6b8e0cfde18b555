//! Report of a trace compared with the run's own.

use scarab_rig::options::SimulationOptions;
use scarab_rig::simulate::simulate;
use scarab_rig::traced::curves::curves;
use scarab_rig::traced::run_report;
use serde_json::Value;

use super::session::{accepted, default_leg, quiet, read, refused, renumbered, text};
use crate::command::{Folder, assert_contains, base, list, reasons};

/// Keys of a run's report that a board does not send: searches in double precision, gains of
/// columns, the noise's seed, noise-free torques, the truth, the Cramer-Rao bound, tracking, constants.
const NOT_TOLD: [&str; 26] = [
    "seed",
    "truth",
    "cramer_rao",
    "gain_chi2",
    "limit_chi2",
    "why",
    "percent_of_mean_abs_vs_truth",
    "sticking_share",
    "cost",
    "cost_over_least_squares",
    "excess_chi2",
    "iterations_to_half_chi2",
    "optimum_over_least_squares",
    "degrees_of_freedom",
    "full",
    "settled",
    "consistent",
    "parameters",
    "tracking",
    "torque_constant",
    "drive",
    "simulated_s",
    "wall_s",
    "trace",
    "FS1",
    "FS2",
];

/// Every reported value equals the run's own to the last bit. Both sides use single precision, numbers are
/// written so that reading restores their bits, and sums have the same order.
fn compare(path: &str, reported: &Value, own: &Value, compared: &mut usize) {
    match (reported, own) {
        (Value::Object(reported), Value::Object(own)) => {
            for key in reported.keys().chain(own.keys()) {
                let path = format!("{path}.{key}");
                let is_nested =
                    ["parameters", "consistent"].contains(&key.as_str()) && !path.contains("consistent.");
                if NOT_TOLD.contains(&key.as_str())
                    && !(is_nested && own[key].is_array() | own[key].is_object())
                {
                    continue;
                }
                let (Some(reported), Some(own)) = (reported.get(key), own.get(key)) else {
                    panic!("{path} is in one report only");
                };
                compare(&path, reported, own, compared);
            }
        }
        (Value::Array(reported), Value::Array(own)) => {
            assert_eq!(reported.len(), own.len(), "{path}");
            for (index, (reported, own)) in reported.iter().zip(own).enumerate() {
                compare(&format!("{path}[{index}]"), reported, own, compared);
            }
        }
        _ => {
            assert_eq!(reported.to_string(), own.to_string(), "{path}");
            *compared += 1;
        }
    }
}

#[test]
fn the_report_of_a_trace_equals_that_of_its_run() {
    let leg = default_leg();
    let own = simulate(&leg, &SimulationOptions::with_seed(1)).expect("simulated").report;
    let reported = run_report(&read(accepted()), &leg).expect("a complete result");
    let json = |run| serde_json::to_value(run).expect("JSON");
    let mut compared = 0;
    compare("", &json(&reported), &json(&own), &mut compared);
    // At least 28 parameters, 13 base parameters with their terms, 8 fits and the findings.
    assert!(compared > 600, "{compared}");
    assert_eq!(reported.detail, own.detail, "data of a model file");
    assert_eq!((reported.validated, reported.verdict), (true, "accepted"));
}

#[test]
fn the_log_of_a_trace_equals_the_run_s_and_replay_agrees() {
    let folder = Folder::new();
    folder.write("trace.txt", text(accepted()));
    folder.scarab("identify --seed 1 --log @own.csv").ends_with(0);
    let (run, reported) = folder.reported("trace --csv @log.csv @trace.txt --report @reported.html", 0);
    run.prints("verdict: accepted");
    assert!(folder.read("own.csv") == folder.read("log.csv"), "the trace's log differs from the run's");
    run.prints("samples of motion 0; the trace contains motions 1, 2, 3");

    // Another motion on request: the expected number of samples at its own angles.
    folder.scarab("trace --csv-motion 2 --csv @other.csv @trace.txt").ends_with(0);
    let count = accepted().iter().filter(|line| line.contains("segment=validation motion=2 ")).count();
    let (first, other) = (folder.table("log.csv"), folder.table("other.csv"));
    assert_eq!((&other.header, other.rows.len()), (&first.header, count));
    assert_ne!(other.rows[100], first.rows[100]);
    let none = folder.scarab("trace --csv-motion 9 --csv @none.csv @trace.txt").ends_with(2);
    none.warns("no log of motion 9, but of 0, 1, 2, 3");
    let page = folder.read("reported.html");
    assert_contains(&page, "board 000000330000002200000011");
    assert_contains(&page, "trace of a board");
    for figure in ["motions.svg", "torque-1.svg", "torque-2.svg", "residuals.svg", "base-parameters.svg"] {
        assert!(page.contains(figure), "{figure} is drawn from the log");
    }

    // The host resamples and filters again: its result from the log differs from the board's by less than a
    // quarter of a sigma.
    let (_, replayed) = folder.reported("replay --leg x2-wearer-75kg @log.csv", 0);
    for entry in list(&reported, "base_parameters") {
        let name = entry["name"].as_str().expect("a name");
        let Some(sigma) = entry["sigma"].as_f64() else { continue };
        let off = base(&reported, name, "value") - base(&replayed, name, "value");
        assert!(off.abs() < 0.25 * sigma, "{name}: {off} of {sigma}");
    }
}

#[test]
fn a_refused_result_exits_with_three_and_its_reasons() {
    let folder = Folder::new();
    folder.write("trace.txt", text(refused()));
    let (run, report) = folder.reported("trace @trace.txt", 3);
    let reasons = reasons(&report);
    assert!(!reasons.is_empty());
    run.prints(&format!("verdict: refused, {}", reasons.join(", ")));
    run.prints("identification REFUSED");
    for finding in list(&report, "findings").iter().filter(|found| found["passed"] == false) {
        run.prints(finding["words"].as_str().expect("words"));
    }
}

#[test]
fn the_last_of_two_identifications_is_reported() {
    let (first, second) = (refused(), quiet());
    // Without a start between them the numbering continues.
    let all = renumbered(first.iter().chain(second.iter().filter(|line| !line.starts_with("boot "))));
    for (lines, starts) in [(all, 1), ([first, second.as_slice()].concat(), 2)] {
        let trace = read(&lines);
        assert_eq!((trace.results.len(), trace.starts, trace.lost()), (2, starts, 0));
        assert!(!trace.results[0].reasons.is_empty() && trace.results[1].reasons.is_empty());
        let run = run_report(&trace, &default_leg()).expect("complete");
        assert_eq!(run.verdict, "accepted");
        assert_eq!(run.trace.expect("of a trace").identifications, 2);
    }
}

#[test]
fn a_model_identified_by_the_board_can_be_stored() {
    let folder = Folder::new();
    folder.write("trace.txt", text(&quiet()));
    folder.scarab("trace --save-model @reported.toml @trace.txt").ends_with(0);
    folder.scarab("identify --seed 1 --save-model @own.toml").ends_with(0);
    folder.scarab("identify --seed 1 --compare-model @reported.toml").ends_with(0).prints("same");
    let base = |name| folder.read(name).split("[base_set").nth(1).map(str::to_owned).expect("a base set");
    assert_eq!(base("reported.toml"), base("own.toml"), "values and covariance to the last bit");
}

#[test]
fn the_documented_kinds_and_keys_are_exactly_those_of_the_code() {
    let document = include_str!("../../../../../docs/files.md");
    let (_, section) = document.split_once("\n## Trace\n").expect("a section of the trace");
    let (section, _) = section.split_once("\n## ").expect("a section after it");
    let rows = section.lines().filter_map(|line| {
        let mut cells = line.strip_prefix("| `")?.split(" | ");
        let kind = cells.next()?.strip_suffix('`')?;
        let keys: Vec<&str> = cells.next()?.split(' ').map(|key| key.trim_matches('`')).collect();
        let about = cells.next()?;
        scarab::trace::Line::parse(kind).is_ok().then_some((kind, keys, about.len()))
    });
    let rows: Vec<_> = rows.collect();
    let formats = scarab::trace::Record::<2>::FORMATS.iter().map(|format| {
        let mut pairs = format.split(' ').map(|pair| pair.split('=').next().expect("a key"));
        (pairs.next().expect("a kind"), pairs.skip(1).collect::<Vec<_>>())
    });
    let documented: Vec<_> = rows.iter().map(|(kind, keys, _)| (*kind, keys.clone())).collect();
    assert_eq!(documented, formats.collect::<Vec<_>>());
    assert!(rows.iter().all(|(.., about)| *about > 5));
}

/// Curves from the board's log equal those of the run: samples, filter and result are shared.
#[test]
fn the_curves_of_a_trace_are_those_of_the_run() {
    let leg = default_leg();
    let options = SimulationOptions { with_series: true, ..SimulationOptions::with_seed(1) };
    let own = simulate(&leg, &options).expect("simulated").series;
    let reported = curves(&read(accepted()), &leg).expect("a trace of this leg");
    assert_eq!((reported.motions.len(), &reported.white_correlation), (4, &own.white_correlation));
    for (reported, own) in reported.motions.iter().zip(&own.motions) {
        assert_eq!((&reported.name, reported.role, &reported.time_s), (&own.name, own.role, &own.time_s));
        for (reported, own) in reported.joints.iter().zip(&own.joints) {
            assert!(!reported.measured_nm.is_empty());
            assert_eq!(
                (&reported.measured_nm, &reported.predicted_nm),
                (&own.measured_nm, &own.predicted_nm)
            );
            assert_eq!((&reported.measured_deg, &reported.still), (&own.measured_deg, &own.still));
        }
    }
    // The noise is the residual; the identification subtracts its parameters, thirteen of a thousand rows.
    for (reported, own) in reported.noise_nm.iter().zip(&own.noise_nm) {
        assert!((reported / own - 1.0).abs() < 0.02, "{reported} {own}");
    }
    // A motion with a missing sample is not drawn.
    let hole =
        accepted().iter().position(|line| line.contains(" segment=validation motion=2 ")).expect("a log");
    let mut lines = accepted().to_vec();
    lines.remove(hole + 500);
    let names: Vec<_> = curves(&read(&lines), &leg)
        .expect("a trace of this leg")
        .motions
        .into_iter()
        .map(|motion| motion.name)
        .collect();
    assert_eq!(names, ["excitation", "gait-6.5", "fourier"]);
}
