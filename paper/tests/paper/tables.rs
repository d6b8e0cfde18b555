//! `paper`: the report of Tables III and IV as an interface, and properties of any few runs.

use std::collections::BTreeSet;
use std::sync::OnceLock;

use crate::command::{Folder, Run, list, scarab};
use serde_json::Value;

/// Table IV of two runs, shared by all tests here.
fn rows() -> &'static [Value] {
    static REPORT: OnceLock<Value> = OnceLock::new();
    list(REPORT.get_or_init(|| table_four().1), "rows")
}

fn table_four() -> (Run, Value) {
    Folder::new().reported("--table IV --seeds 2", 0)
}

fn texts(key: &str) -> BTreeSet<&'static str> {
    rows().iter().filter_map(|row| row[key].as_str()).collect()
}

fn find(function: &str, dimension: u64, algorithm: &str, tolerance: f64, precision: &str) -> &'static Value {
    let is_meant = |row: &&Value| {
        row["function"] == function
            && row["reading"] == "intended"
            && row["dimension"] == dimension
            && row["algorithm"] == algorithm
            && row["tolerance"] == tolerance
            && row["precision"] == precision
    };
    rows().iter().find(is_meant).unwrap_or_else(|| panic!("{function} {dimension} {algorithm} is missing"))
}

#[test]
fn rows_have_every_function_search_reading_and_precision() {
    let functions = [
        "f1",
        "f2",
        "f3",
        "f4",
        "f4-shifted-rotated",
        "ellipsoid-1e4",
        "ellipsoid-1e6",
        "rosenbrock",
        "griewank",
        "schwefel-1.2",
        "levy",
        "rastrigin",
    ];
    let searches = [
        "pso",
        "pso-constriction",
        "pso-argmin",
        "bas",
        "bso-paper",
        "bso",
        "cma-es",
        "cma-es-20",
        "cma-es-restarts",
    ];
    assert_eq!(texts("function"), BTreeSet::from(functions));
    assert_eq!(texts("algorithm"), BTreeSet::from(searches));
    assert_eq!(texts("reading"), BTreeSet::from(["intended", "printed"]));
    assert_eq!(texts("precision"), BTreeSet::from(["f64", "f32"]));
    let identity = |row: &Value| {
        ["function", "reading", "dimension", "algorithm", "tolerance", "precision"]
            .map(|key| row[key].to_string())
    };
    let distinct: BTreeSet<_> = rows().iter().map(identity).collect();
    assert_eq!(distinct.len(), rows().len(), "a row occurs twice");
}

#[test]
fn a_count_is_null_if_too_few_runs_succeed() {
    for row in rows() {
        assert_eq!(row["runs"], 2, "{row}");
        let success = row["success_rate"].as_f64().expect("a number");
        assert!([0.0, 0.5, 1.0].contains(&success), "{row}");
        // With two runs the median is the better one, the 95th percentile the worse.
        assert_eq!(row["iterations_median"].is_u64(), success >= 0.5, "{row}");
        assert_eq!(row["evaluations_median"].is_u64(), success >= 0.5, "{row}");
        assert_eq!(row["iterations_p95"].is_u64(), success >= 1.0, "{row}");
        assert!(row["iterations_median"].is_u64() || row["iterations_median"].is_null(), "{row}");
    }
}

#[test]
fn printed_swarm_never_reaches_thirty_dimensions_and_the_default_always_does() {
    for function in ["f1", "f4", "f4-shifted-rotated"] {
        assert_eq!(find(function, 30, "bso-paper", 0.1, "f64")["success_rate"], 0.0);
        for precision in ["f64", "f32"] {
            let row = find(function, 30, "bso", 0.1, precision);
            // Known medians are 16 to 25; 60 evaluations per iteration, 20 before.
            let (iterations, evaluations) =
                (row["iterations_p95"].as_u64(), row["evaluations_median"].as_u64());
            assert!(iterations.is_some_and(|count| (5..=40).contains(&count)), "{row}");
            let fits = |count: u64| (20 + 60 * 4..=20 + 60 * 40).contains(&count);
            assert!(evaluations.is_some_and(fits), "{row}");
        }
    }
}

#[test]
fn searches_of_other_crates_are_really_run() {
    // Known medians of 100 runs to 0.1: about 2,400 and 3,000 evaluations in thirty dimensions, 430
    // for the particle swarm in two.
    for (function, dimension, search, least, most) in [
        ("f1", 30, "cma-es", 1_500, 4_000),
        ("f1", 30, "cma-es-20", 1_800, 4_500),
        ("f1", 2, "pso-argmin", 100, 1_200),
    ] {
        let row = find(function, dimension, search, 0.1, "f64");
        let count = row["evaluations_median"].as_u64();
        assert!(count.is_some_and(|count| (least..=most).contains(&count)), "{row}");
    }
}

#[test]
fn the_same_command_gives_the_same_rows() {
    let (run, report) = table_four();
    assert_eq!(report["schema"], 1);
    assert_eq!(list(&report, "rows"), rows());
    run.prints("paper's BSO");
}

#[test]
fn least_values_are_those_of_the_standard_functions_and_not_the_listed_ones() {
    let folder = Folder::new();
    let (_, report) = folder.reported("--table III", 0);
    let minima = list(&report, "minima");
    // Grid, compass search and stated value agree to 1e-9.
    for (function, reading, least) in [
        ("f1", "intended", 0.0),
        ("f2", "intended", -1.031_628_453),
        ("f2", "printed", -941.373_185_460),
        ("f3", "intended", 0.397_887_358),
        ("f3", "printed", 0.397_887_358),
        ("f4", "intended", 0.0),
        ("f4", "printed", -core::f64::consts::E),
    ] {
        let entry = minima.iter().find(|entry| entry["function"] == function && entry["reading"] == reading);
        let found = entry.and_then(|entry| entry["minimum"].as_f64()).expect("a number");
        assert!((found - least).abs() < 1e-6, "{function} {reading}: {found}");
    }
}

#[test]
fn a_document_changes_only_between_its_markers() {
    let folder = Folder::new();
    let text = "before\n<!-- paper: table-iii -->\nold\n<!-- end of table-iii -->\nafter\n";
    folder.write("a.md", text);
    folder.scarab("--table III --docs @a.md").ends_with(0);
    let written = folder.read("a.md");
    assert!(written.starts_with("before\n<!-- paper: table-iii -->\n"), "{written}");
    assert!(written.ends_with("<!-- end of table-iii -->\nafter\n") && !written.contains("old"), "{written}");
    assert!(written.contains("-1.031628"), "{written}");
    folder.write("b.md", "nothing\n");
    folder.scarab("--table III --docs @b.md").ends_with(2).warns("paper: table-iii");
}

#[test]
fn impossible_requests_are_refused() {
    for (arguments, named) in [
        ("--seeds 0", "--seeds"),
        ("--seeds 100001", "--seeds"),
        ("--table VII", "--table"),
        ("--figure 6", "--figure"),
        ("--table III --docs nowhere.md", "nowhere.md"),
    ] {
        scarab(arguments).refuses(named);
    }
}

#[test]
fn figure_five_is_drawn_for_each_function_small_and_well_formed() {
    let folder = Folder::new();
    folder.scarab("--figure 5 --seeds 5 --out @drawn").ends_with(0);
    for function in ["f1", "f2", "f3", "f4"] {
        let svg = folder.read(&format!("drawn/figure-5-{function}.svg"));
        roxmltree::Document::parse(&svg).unwrap_or_else(|error| panic!("{function}: {error}"));
        assert!(!svg.contains("NaN") && !svg.contains("inf,"), "{function}");
        // Suitable size for a repository.
        assert!(svg.len() < 250_000, "{function}: {} bytes", svg.len());
        for word in ["bso-paper", "pso", "bas", "iterations", "evaluations"] {
            assert!(svg.contains(word), "{function}: `{word}` is missing");
        }
    }
}
