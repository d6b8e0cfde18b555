//! Formats the report of a run as plain tables.

use crate::base::error::ToolError;
use crate::base::number::{Number, number};
use crate::base::output::print;
use crate::base::precision::{plain, sigma, value};
use crate::base::text_table::{align_numbers, headed, text};
use crate::report::disturbances::StribeckReport;
use crate::report::{
    AddedMassReport, ComparisonReport, ConsistentSearchReport, FitReport, RunReport, Source,
};

/// Table of the base parameters: value, sigma with its parts, truth and error in sigma.
#[must_use]
pub fn base_parameters(run: &RunReport) -> String {
    let mut rows = headed(&[
        "base parameter",
        "value",
        "sigma",
        "of noise",
        "of misfit",
        "unit",
        "truth",
        "error/sigma",
        "= sum of",
    ]);
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
            sigma(base.sigma_noise),
            sigma(base.sigma_misfit),
            base.unit.into(),
            value(base.truth, base.sigma),
            off,
            if terms.len() > 1 { terms.join(" + ").replace("+ -", "- ") } else { String::new() },
        ]);
    }
    align_numbers(&mut rows, [1, 2, 3, 4, 6, 7]);
    let misfit = run.base_parameters.iter().any(|base| base.sigma_misfit.known().is_some());
    let known = run.base_parameters.iter().any(|base| base.truth.known().is_some());
    let absent: Vec<usize> = [(misfit, [3, 4]), (known, [6, 7])]
        .into_iter()
        .filter(|(is_shown, _)| !is_shown)
        .flat_map(|(_, columns)| columns)
        .collect();
    text(rows, &absent)
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
    lines.extend(crate::report::model_choice::lines(&run.model_choice, &run.asymmetric_coulomb));
    lines.extend(run.outliers.line());
    lines.extend(run.tracking.iter().map(|tracking| {
        format!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it",
            tracking.joint,
            number(tracking.rms_deg_without_model),
            number(tracking.rms_deg_with_model)
        )
    }));
    lines.extend(crate::report::scale::lines(run));
    lines.extend(run.doubt.iter().flat_map(crate::report::doubt::DoubtReport::lines));
    lines.push(String::new());
    lines.push(verdict_line(run));
    let failed = run.findings.iter().filter(|finding| !finding.passed);
    lines.extend(failed.map(|finding| format!("  {}: {}", finding.reason, finding.words)));
    let cause = run.doubt.as_ref().and_then(|doubt| doubt.likely_cause.as_ref());
    lines.extend(cause.map(|cause| format!("  {}", cause.line())));
    if !run.validated && run.seed.is_none() {
        lines.push("  not validated: no motion was held out (--validate, --split)".into());
    }
    lines.extend(run.compared.iter().flat_map(comparison_lines));
    lines.join("\n") + "\n"
}

/// Comparison with a stored model, and the mass that explains the difference.
#[must_use]
pub fn comparison_lines(compared: &ComparisonReport) -> Vec<String> {
    let mut lines = vec![format!(
        "compared with {}: {} (chi-square {} of at most {})",
        compared.model,
        compared.line,
        number(compared.chi2.into()),
        number(compared.chi2_limit.into())
    )];
    let explaining: Vec<String> =
        compared.added_mass.iter().filter(|mass| mass.explains()).map(added_mass_line).collect();
    if explaining.is_empty() {
        lines.push("  a mass added to one link does not explain the difference".into());
    }
    lines.extend(explaining);
    lines.extend(compared.warning.iter().map(|words| format!("warning: {words}")));
    lines
}

fn added_mass_line(found: &AddedMassReport) -> String {
    let with_sigma = |quantity: Number, deviation: Number, unit: &str| {
        quantity.known().map_or("not determined".to_owned(), |_| {
            format!("{} +- {} {unit}", value(quantity, deviation), sigma(deviation))
        })
    };
    let pair = |quantities: &[Number; 2], deviations: &[Number; 2], unit: &str| {
        let one = |axis: usize, name: &str| {
            format!("{name} {}", with_sigma(quantities[axis], deviations[axis], unit))
        };
        format!("{}, {}", one(0, "x"), one(1, "y"))
    };
    format!(
        "  as a mass added to link {}: {}; place: {}; first moment: {}",
        found.joint,
        with_sigma(found.mass_kg, found.mass_sigma_kg, "kg"),
        pair(&found.place_m, &found.place_sigma_m, "m"),
        pair(&found.moment_kgm, &found.moment_sigma_kgm, "kg m"),
    )
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
