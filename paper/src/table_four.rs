//! Table IV: searches on the test functions, compared with the paper's printed results.

use scarab_base::error::ToolError;
use scarab_base::table::Table;

use super::contenders::{Algorithm, ITERATIONS};
use super::goals::GOALS;
use super::problems::{CASES, Case, Reading};
use super::runs::RowRuns;
use super::searches::{self, Hits, TOLERANCES};
use super::statistics::Row;
use super::{PaperOptions, Part, Section};

/// Runs of each row by default.
pub const RUNS: u64 = 100;

/// Iterations on f1 to f4 in the paper's Table IV.
const PRINTED: [(Algorithm, [u32; 4]); 3] = [
    (Algorithm::Pso, [99, 38, 42, 52]),
    (Algorithm::Bas, [748, 678, 603, 688]),
    (Algorithm::BsoPaper, [39, 15, 18, 27]),
];

/// Searches that are asked for.
fn wanted(options: &PaperOptions) -> Vec<Algorithm> {
    let all = Algorithm::ALL.into_iter();
    all.filter(|one| options.algorithms.is_empty() || options.algorithms.contains(one)).collect()
}

/// Runs the searches.
pub fn runs(options: &PaperOptions) -> Result<RowRuns<Hits>, ToolError> {
    searches::runs(&wanted(options), options.runs(RUNS), options.shard)
}

/// Tables, text and JSON of this part.
pub fn section(options: &PaperOptions, runs: &[Vec<Hits>]) -> Result<Section, ToolError> {
    let rows = searches::rows(&wanted(options), runs);
    let runs = rows.first().map_or(0, |row| row.runs);
    let has_default = rows.iter().any(|row| row.algorithm == Algorithm::Bso);
    let of_default = |part: fn(&[Row]) -> String| if has_default { part(&rows) } else { String::new() };
    let mut parts = vec![
        format!(
            "{runs} runs of each row. Success is f - f* <= 0.1 with the true f*, on the first evaluation that gets there; \
             iterations are median / 95 % of all runs, failed ones endless (-, with the share that succeeds); a scattered \
             swarm is iteration 0. {ITERATIONS} iterations for the beetles, as many evaluations as the default swarm's for all \
             others."
        ),
        beside_the_paper(&rows),
        matrix(&rows, TOLERANCES[0], "iterations to 0.1, median / 95 %", iterations),
        matrix(&rows, TOLERANCES[0], "evaluations to 0.1, median", evaluations),
        matrix(&rows, TOLERANCES[1], "evaluations to 1e-6, median", evaluations),
        of_default(comparisons),
        of_default(precisions),
        of_default(goals),
    ];
    parts.retain(|part| !part.is_empty());
    Section::new(Part::TableFour, "rows", &rows, parts.join("\n\n") + "\n", Vec::new())
}

fn find<'r>(
    rows: &'r [Row],
    case: &Case,
    algorithm: Algorithm,
    tolerance: f64,
    precision: &str,
) -> Option<&'r Row> {
    rows.iter().find(|row| {
        row.is_of(case)
            && row.algorithm == algorithm
            && row.tolerance == tolerance
            && row.precision == precision
    })
}

/// Function, dimension, and the reading if it is not the intended one.
fn name(case: &Case) -> String {
    let reading = if case.reading == Reading::Printed { ", printed" } else { "" };
    format!("{} ({}{reading})", case.id, case.dimension)
}

/// Count, or the share of successful runs if too few succeed.
fn count(value: Option<u32>, row: &Row) -> String {
    value.map_or_else(|| format!("- ({} %)", percent(row)), |value| value.to_string())
}

fn percent(row: &Row) -> f64 {
    (1000.0 * row.success_rate).round() / 10.0
}

fn iterations(row: &Row, _best: Option<u32>) -> String {
    match (row.iterations_median, row.iterations_p95) {
        (Some(median), Some(p95)) => format!("{median} / {p95}"),
        (Some(median), None) => format!("{median} / - ({} %)", percent(row)),
        _ => format!("- ({} %)", percent(row)),
    }
}

/// Evaluations; in bold if fewer than the default swarm's.
fn evaluations(row: &Row, default: Option<u32>) -> String {
    let text = count(row.evaluations_median, row);
    match (row.evaluations_median, default) {
        (Some(own), Some(default)) if own < default => format!("**{text}**"),
        (Some(_), None) => format!("**{text}**"),
        _ => text,
    }
}

/// Table with a row per function and a column per search.
fn matrix(rows: &[Row], tolerance: f64, title: &str, cell: fn(&Row, Option<u32>) -> String) -> String {
    let run: Vec<_> =
        Algorithm::ALL.into_iter().filter(|one| rows.iter().any(|row| row.algorithm == *one)).collect();
    let mut table = Table::default()
        .label(format!("{title}: function (D)"))
        .numbers(run.iter().map(|algorithm| algorithm.id()));
    for case in &CASES {
        let row = |algorithm| find(rows, case, algorithm, tolerance, "f64");
        let default = row(Algorithm::Bso).and_then(|row| row.evaluations_median);
        let cells =
            run.iter().map(|algorithm| row(*algorithm).map_or_else(String::new, |row| cell(row, default)));
        table.row([name(case)].into_iter().chain(cells));
    }
    table.to_markdown().trim_end().to_owned()
}

/// Compares the paper's iterations for f1 to f4 in the plane with ours.
fn beside_the_paper(rows: &[Row]) -> String {
    let mut table = Table::default().label("iterations to 0.1").numbers(["f1", "f2", "f3", "f4"]);
    let cases = ["f1", "f2", "f3", "f4"].map(|id| {
        CASES.iter().find(|case| case.id == id && case.dimension == 2 && case.reading == Reading::Intended)
    });
    let ours = |algorithm: Algorithm| {
        let cells = cases.map(|case| {
            let row = case.and_then(|case| find(rows, case, algorithm, TOLERANCES[0], "f64"));
            row.map_or_else(String::new, |row| iterations(row, None))
        });
        [algorithm.id().to_owned()].into_iter().chain(cells)
    };
    for (algorithm, printed) in PRINTED {
        let label = format!("paper's {}", algorithm.id().trim_end_matches("-paper").to_uppercase());
        table.row([label].into_iter().chain(printed.map(|count| count.to_string())));
        table.row(ours(algorithm));
    }
    table.row(ours(Algorithm::Bso));
    table.to_markdown().trim_end().to_owned()
}

/// Cases in which another search needs fewer evaluations than the default swarm although the latter
/// succeeds.
fn comparisons(rows: &[Row]) -> String {
    let mut lines = Vec::new();
    for (kind, others) in [
        ("CMA-ES variants", [Algorithm::CmaEs, Algorithm::CmaEsTwenty, Algorithm::CmaEsRestarts]),
        ("particle swarms", [Algorithm::Pso, Algorithm::PsoConstriction, Algorithm::PsoArgmin]),
    ] {
        for (tolerance, digits) in TOLERANCES.into_iter().zip(["0.1", "1e-6"]) {
            let mut fewer = Vec::new();
            let mut contests = 0;
            for case in &CASES {
                let of = |algorithm| find(rows, case, algorithm, tolerance, "f64")?.evaluations_median;
                let counts = others.iter().filter_map(|other| Some((of(*other)?, other)));
                let Some((best, other)) = counts.min_by_key(|(count, _)| *count) else { continue };
                let own = of(Algorithm::Bso);
                contests += 1;
                if own.is_none_or(|own| best < own) {
                    let own = own.map_or_else(|| "-".to_owned(), |own| own.to_string());
                    fewer.push(format!("{} ({} {best}, bso {own})", name(case), other.id()));
                }
            }
            if contests == 0 {
                continue;
            }
            let fewer = if fewer.is_empty() { "none".to_owned() } else { fewer.join(", ") };
            lines.push(format!(
                "- To {digits}, half of the runs of one of the {kind} succeed on {contests} of {} functions; fewer \
                 evaluations than the default swarm on: {fewer}.",
                CASES.len()
            ));
        }
    }
    lines.join("\n")
}

/// Compares the default swarm in single and double precision.
fn precisions(rows: &[Row]) -> String {
    let mut table =
        Table::default().label("bso to 0.1: function (D)").numbers(["f64", "success", "f32", "success"]);
    for case in &CASES {
        let cells = ["f64", "f32"].map(|precision| {
            find(rows, case, Algorithm::Bso, TOLERANCES[0], precision)
                .map_or_else(Default::default, |row| [iterations(row, None), format!("{} %", percent(row))])
        });
        table.row([name(case)].into_iter().chain(cells.into_iter().flatten()));
    }
    table.to_markdown().trim_end().to_owned()
}

/// Table of the goals of the default swarm.
fn goals(rows: &[Row]) -> String {
    let mut table = Table::default()
        .label("bso, goal: function (D)")
        .numbers(["at most", "f64", "reached", "f32", "reached"]);
    for goal in GOALS {
        let cells = ["f64", "f32"].map(|precision| {
            goal.row(rows, precision).map_or_else(Default::default, |row| {
                let reached = if goal.is_reached_by(row) { "yes" } else { "no" };
                [format!("{}, {} %", iterations(row, None), percent(row)), reached.to_owned()]
            })
        });
        let first = [
            format!("{} ({})", goal.function, goal.dimension),
            format!("{} / {}, 100 %", goal.median, goal.p95),
        ];
        table.row(first.into_iter().chain(cells.into_iter().flatten()));
    }
    table.to_markdown().trim_end().to_owned()
}
