//! The report of a run as plain tables.

use comfy_table::{CellAlignment, Table, presets};

use super::report::{FitReport, Number, RunReport};

/// An empty table without frames.
#[must_use]
pub fn headed(header: &[&str]) -> Table {
    let mut table = Table::new();
    table.load_style(presets::NOTHING).set_header(header.to_vec());
    table
}

fn align_numbers(table: &mut Table, from: usize) {
    for index in from..table.column_count() {
        if let Some(column) = table.column_mut(index) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
}

/// A number with four significant digits, or a dash.
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

/// What torque determines: value, sigma, truth and how many sigma lie between.
#[must_use]
pub fn base_parameters(run: &RunReport) -> Table {
    let mut rows = headed(&["base parameter", "value", "sigma", "unit", "truth", "error/sigma", "= sum of"]);
    for base in &run.base_parameters {
        let off = match (base.value.known(), base.truth.known(), base.sigma.known()) {
            (Some(value), Some(truth), Some(sigma)) if sigma > 0.0 => {
                format!("{:+.1}", (value - truth) / sigma)
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
            number(base.value),
            number(base.sigma),
            base.unit.into(),
            number(base.truth),
            off,
            if terms.len() > 1 { terms.join(" + ").replace("+ -", "- ") } else { String::new() },
        ]);
    }
    for column in [1, 2, 4, 5] {
        if let Some(column) = rows.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    rows
}

/// Which of all parameters were measured.
#[must_use]
pub fn parameters(run: &RunReport) -> Table {
    let mut rows = headed(&["parameter", "value", "sigma", "unit", "status", "grouped with", "truth"]);
    for parameter in &run.parameters {
        rows.add_row(vec![
            parameter.name.clone(),
            number(parameter.value),
            number(parameter.sigma),
            parameter.unit.into(),
            parameter.status.into(),
            parameter.grouped_with.join(" "),
            number(parameter.truth),
        ]);
    }
    for column in [1, 2, 6] {
        if let Some(column) = rows.column_mut(column) {
            column.set_cell_alignment(CellAlignment::Right);
        }
    }
    rows
}

/// Torque errors on all motions.
#[must_use]
pub fn fits(run: &RunReport) -> Table {
    let mut rows = headed(&[
        "motion",
        "use",
        "joint",
        "rms N m",
        "% of mean abs",
        "% of rms",
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
            number(fit.percent_of_mean_abs_vs_truth),
            number(Number(fit.sticking_share.known().map(|share| 100.0 * share))),
        ]);
    };
    run.training.iter().for_each(|fit| add(fit, "training"));
    run.validation.iter().for_each(|fit| add(fit, "validation"));
    align_numbers(&mut rows, 3);
    rows
}

/// One run on standard output.
pub fn print_run(run: &RunReport) {
    println!(
        "{}: {} of {} parameters determined in {} sums, condition {}",
        run.leg,
        run.rank,
        run.columns,
        run.rank,
        number(run.condition)
    );
    println!("\n{}\n", base_parameters(run));
    println!("{}\n", fits(run));
    println!(
        "least squares: cost {} chi-square units, exact. beetle swarm: {} iterations, {} evaluations, {} above the \
         optimum in its box",
        number(run.least_squares.cost),
        run.bso.iterations,
        run.bso.evaluations,
        number(run.bso.excess_chi2),
    );
    for tracking in &run.tracking {
        println!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it",
            tracking.joint,
            number(tracking.rms_deg_without_model),
            number(tracking.rms_deg_with_model)
        );
    }
    println!("\n{}", verdict_line(run));
}

/// The verdict in words.
#[must_use]
pub fn verdict_line(run: &RunReport) -> String {
    let seconds = if run.simulated_s > 0.0 && run.wall_s > 0.0 {
        format!(" ({:.1} s in {:.2} s)", run.simulated_s, run.wall_s)
    } else {
        String::new()
    };
    if run.accepted() {
        format!("verdict: accepted{seconds}")
    } else {
        format!("verdict: refused, {}{seconds}", run.reasons.join(", "))
    }
}
