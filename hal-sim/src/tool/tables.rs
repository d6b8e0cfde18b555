//! Formats the report of a run as plain tables.

use std::io::{ErrorKind, Write};

use comfy_table::{CellAlignment, ColumnConstraint, Table, presets};

use super::disturbances::StribeckReport;
use super::error::ToolError;
use super::precision::{plain, sigma, value};
use super::replay::Source;
use super::report::{ConsistentSearchReport, FitReport, Number, RunReport};

/// Writes to standard output; a pipe closed by its reader is not an error.
pub fn print(text: &str) -> Result<(), ToolError> {
    let mut out = std::io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => {
            Err(ToolError::input(format!("standard output cannot be written: {error}")))
        }
        _ => Ok(()),
    }
}

/// `println!` through [`print`]: returns from the function if standard output cannot be written.
macro_rules! say {
    ($($text:tt)*) => { $crate::tool::tables::print(&format!("{}\n", format_args!($($text)*)))? };
}
pub(crate) use say;

/// Empty table without frames.
#[must_use]
pub fn headed(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.to_vec());
    table
}

/// Formats a table without the columns that are unknown, one line per row.
fn text(mut table: Table, unknown: &[usize]) -> String {
    for &index in unknown {
        if let Some(column) = table.column_mut(index) {
            column.set_constraint(ColumnConstraint::Hidden);
        }
    }
    table.trim_fmt() + "\n"
}

fn align_numbers(table: &mut Table, columns: impl IntoIterator<Item = usize>) {
    for index in columns {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// Formats a number with four significant digits, or a dash.
#[must_use]
pub fn number(value: Number) -> String {
    match value.known() {
        None => "-".into(),
        Some(0.0) => "0".into(),
        Some(value) if value.abs() >= 1e5 || value.abs() < 1e-4 => format!("{value:.2e}"),
        Some(value) => {
            let digits = (3 - value.abs().log10().floor() as i32).clamp(0, 7) as usize;
            format!("{value:.digits$}")
        }
    }
}

/// Table of the base parameters: value, sigma, truth and error in sigma.
#[must_use]
pub fn base_parameters(run: &RunReport) -> String {
    let mut rows = headed(&["base parameter", "value", "sigma", "unit", "truth", "error/sigma", "= sum of"]);
    for base in &run.base_parameters {
        let off = match (base.value.known(), base.truth.known(), base.sigma.known()) {
            (Some(found), Some(truth), Some(deviation)) if deviation > 0.0 => {
                format!("{:+.1}", (found - truth) / deviation)
            }
            _ => "-".into(),
        };
        let terms: Vec<String> =
            base.terms
                .iter()
                .map(|(name, factor)| {
                    if *factor == 1.0 { name.clone() } else { format!("{} {name}", number((*factor).into())) }
                })
                .collect();
        rows.add_row(vec![
            base.name.clone(),
            value(base.value, base.sigma),
            sigma(base.sigma),
            base.unit.into(),
            value(base.truth, base.sigma),
            off,
            if terms.len() > 1 { terms.join(" + ").replace("+ -", "- ") } else { String::new() },
        ]);
    }
    align_numbers(&mut rows, [1, 2, 4, 5]);
    let known = run.base_parameters.iter().any(|base| base.truth.known().is_some());
    text(rows, if known { &[] } else { &[4, 5] })
}

/// Table of all parameters with their status.
#[must_use]
pub fn parameters(run: &RunReport) -> String {
    let mut rows = headed(&["parameter", "value", "sigma", "unit", "status", "grouped with", "truth"]);
    for parameter in &run.parameters {
        rows.add_row(vec![
            parameter.name.clone(),
            value(parameter.value, parameter.sigma),
            sigma(parameter.sigma),
            parameter.unit.into(),
            parameter.status.into(),
            parameter.grouped_with.join(" "),
            value(parameter.truth, parameter.sigma),
        ]);
    }
    align_numbers(&mut rows, [1, 2, 6]);
    let known = run.parameters.iter().any(|parameter| parameter.truth.known().is_some());
    text(rows, if known { &[] } else { &[6] })
        + "\nidentified: measured alone. grouped: only sums with the parameters beside it are measured, the prior \
           splits them.\nweak: measured with little certainty. prior: does not show in the torque.\n"
}

/// Table of the torque errors on all motions.
#[must_use]
pub fn fits(run: &RunReport) -> String {
    let mut rows = headed(&[
        "motion",
        "use",
        "joint",
        "rms N m",
        "% of mean abs",
        "% of rms",
        "set aside %",
        "% of mean abs, noise-free",
        "sticking %",
    ]);
    let mut add = |fit: &FitReport, role: &str| {
        rows.add_row(vec![
            fit.motion.clone(),
            role.into(),
            fit.joint.to_string(),
            number(fit.rms_nm),
            number(fit.percent_of_mean_abs),
            number(fit.percent_of_rms),
            number(Number(fit.disturbed_share.known().map(|share| 100.0 * share))),
            number(fit.percent_of_mean_abs_vs_truth),
            number(Number(fit.sticking_share.known().map(|share| 100.0 * share))),
        ]);
    };
    run.training.iter().for_each(|fit| add(fit, "training"));
    run.validation.iter().for_each(|fit| add(fit, "validation"));
    align_numbers(&mut rows, 3..9);
    let mut all = run.training.iter().chain(&run.validation);
    let known = all.any(|fit| fit.percent_of_mean_abs_vs_truth.known().is_some());
    text(rows, if known { &[] } else { &[7, 8] })
}

/// Table of the training and validation files, with the rows used for each joint.
#[must_use]
pub fn sources(sources: &[Source]) -> String {
    let joints = sources.first().map_or(0, |source| source.used.len());
    let mut header = vec!["file".to_owned(), "use".into(), "from s".into(), "length s".into(), "Hz".into()];
    (1..=joints).for_each(|joint| header.extend([format!("rows {joint}"), format!("still {joint}")]));
    let mut rows = headed(&header.iter().map(String::as_str).collect::<Vec<_>>());
    for source in sources {
        let mut cells = vec![
            source.file.display().to_string(),
            source.role.into(),
            format!("{:.2}", source.start_s),
            format!("{:.2}", source.duration_s),
            format!("{:.0}", source.rate_hz),
        ];
        for used in &source.used {
            cells.extend([used.to_string(), (source.rows - used).to_string()]);
        }
        rows.add_row(cells);
    }
    align_numbers(&mut rows, 2..5 + 2 * joints);
    text(rows, &[])
        + "rows: filtered to 50 a second and used for that joint's torque; still: left out, because friction at rest \
           is undetermined.\n\n"
}

/// Prints one run.
pub fn print_run(run: &RunReport) -> Result<(), ToolError> {
    print(&run_text(run))
}

fn run_text(run: &RunReport) -> String {
    let combinations = run.base_parameters.len();
    let determined = if run.rank == combinations {
        "all of them determined".to_owned()
    } else {
        format!("only {} of them determined", run.rank)
    };
    let mut lines = vec![
        format!(
            "{}: torque depends on {combinations} combinations of {} parameters; {determined}, condition {}",
            run.leg,
            run.columns,
            number(run.condition)
        ),
        String::new(),
        base_parameters(run),
        fits(run),
        search_line(run),
    ];
    lines.push(consistent_line(run));
    lines.extend(run.stribeck.iter().map(StribeckReport::line));
    lines.extend(super::model_choice::lines(&run.model_choice, &run.asymmetric_coulomb));
    lines.extend(run.outliers.line());
    lines.extend(run.tracking.iter().map(|tracking| {
        format!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it",
            tracking.joint,
            number(tracking.rms_deg_without_model),
            number(tracking.rms_deg_with_model)
        )
    }));
    lines.extend(super::scale::lines(run));
    lines.push(String::new());
    lines.push(verdict_line(run));
    let failed = run.findings.iter().filter(|finding| !finding.passed);
    lines.extend(failed.map(|finding| format!("  {}: {}", finding.reason, finding.words)));
    if !run.validated && run.seed.is_none() {
        lines.push("  not validated: no motion was held out (--validate, --split)".into());
    }
    lines.extend(run.compared.as_ref().map(|compared| {
        format!(
            "compared with {}: {} (chi-square {} of at most {})",
            compared.model,
            compared.line,
            number(compared.chi2.into()),
            number(compared.chi2_limit.into())
        )
    }));
    lines.extend(
        run.compared
            .as_ref()
            .and_then(|compared| compared.warning.as_ref())
            .map(|words| format!("warning: {words}")),
    );
    lines.join("\n") + "\n"
}

/// Effort and result of the search; a board sends the effort only.
fn search_line(run: &RunReport) -> String {
    let swarm =
        format!("beetle swarm: {} iterations, {} evaluations", run.bso.iterations, run.bso.evaluations);
    if run.trace.is_some() {
        return swarm;
    }
    format!(
        "least squares: cost {} chi-square units. {swarm}, ends {} units above the optimum of its box",
        number(run.least_squares.cost),
        number(run.bso.excess_chi2),
    )
}

/// Cost of physical consistency, and both searches for it.
fn consistent_line(run: &RunReport) -> String {
    let found = &run.consistent;
    let search = |search: &ConsistentSearchReport| {
        format!(
            "{} iterations, {} evaluations, {} steps, {} above",
            search.iterations,
            search.evaluations,
            search.steps,
            number(search.excess_chi2)
        )
    };
    let Some(full) = &found.full else {
        return format!(
            "legs that can exist: the result costs {} chi-square units more than least squares ({} steps)",
            plain(found.result_over_least_squares),
            found.base.steps
        );
    };
    format!(
        "legs that can exist: the best of them costs {} chi-square units more than least squares. base values, completed \
         (the result): {}. whole legs: {}",
        plain(found.optimum_over_least_squares),
        search(&found.base),
        search(full)
    )
}

/// Explanation of a reason from the closed list.
#[must_use]
pub fn explanation(reason: &str) -> &'static str {
    match reason {
        "unphysical" => {
            "no leg can have these parameters (negative friction, inertia or kinetic energy), or none that the prior allows"
        }
        "unexcited" => "a joint hardly moved, or the motion does not tell the parameters apart",
        "residual" => "what the model leaves unexplained is not noise",
        "validation" => {
            "torque of the motion held out is predicted worse than the training lets expect, or not at all"
        }
        "not_a_measurement" => "the torque was computed, not measured",
        "outliers" => "too many outliers",
        "contact" => "the leg touched something",
        "input" => "too few rows in which the joints move, or a torque that is always zero",
        _ => "",
    }
}

/// Verdict in words.
#[must_use]
pub fn verdict_line(run: &RunReport) -> String {
    let seconds = if run.simulated_s > 0.0 && run.wall_s > 0.0 {
        format!(" ({:.1} s of motion in {:.2} s)", run.simulated_s, run.wall_s)
    } else {
        String::new()
    };
    if run.accepted() {
        let validated = if run.validated { "" } else { ", not validated" };
        format!("verdict: accepted{validated}{seconds}")
    } else {
        format!("verdict: refused, {}{seconds}", run.reasons.join(", "))
    }
}
