//! Tables of a run's report, for the terminal and the page, and its text.

use scarab_base::error::ToolError;
use scarab_base::number::{Number, number};
use scarab_base::output::print;
use scarab_base::precision::{exact, plain, sigma, value};
use scarab_base::table::{Cell, Table, cells};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::disturbances::StribeckReport;
use scarab_identify::report::findings::{FindingReport, hardly_tested};
use scarab_identify::report::series::Role;
use scarab_identify::report::{
    AddedMassReport, BaseReport, ComparisonReport, ParameterReport, RunReport, Source, reading::ReadReport,
};
use std::collections::BTreeMap;

use crate::view::html::parameters::{badge, bar, split};
use crate::view::html::table::html_cell;

/// Table of the base parameters: value, sigma with its parts, truth and error in sigma.
pub(crate) fn base_parameters(run: &RunReport) -> Table {
    let any = |known: fn(&BaseReport) -> Number| {
        run.base_parameters.iter().any(|base| known(base).known().is_some())
    };
    let (misfit, truth) = (any(|base| base.sigma_misfit), any(|base| base.truth));
    let mut table = Table::default()
        .label("base parameter")
        .numbers(["value", "sigma"])
        .numbers_if(misfit, ["of noise", "of misfit"])
        .unit()
        .numbers_if(truth, ["truth", "error/sigma"])
        .numbers_if(any(|base| base.cramer_rao), ["Cram\u{e9}r-Rao"])
        .html_only()
        .text(["= sum of"])
        .styled("terms");
    for base in &run.base_parameters {
        let off = match (base.value.known(), base.truth.known(), base.sigma.known()) {
            (Some(found), Some(truth), Some(deviation)) if deviation > 0.0 => {
                format!("{:+.1}", (found - truth) / deviation)
            }
            _ => "-".into(),
        };
        table.row(cells![
            &base.name,
            value(base.value, base.sigma),
            sigma(base.sigma),
            sigma(base.sigma_noise),
            sigma(base.sigma_misfit),
            base.unit,
            value(base.truth, base.sigma),
            off,
            sigma(Number(base.cramer_rao.known().filter(|bound| *bound > 0.0))),
            Cell::Typeset(terms(&base.terms)),
        ]);
    }
    table
}

/// Sum of several parameters with their factors; empty for a single one.
fn terms(terms: &BTreeMap<String, f64>) -> String {
    if terms.len() < 2 {
        return String::new();
    }
    // A computed factor of one equals one up to rounding.
    let term = |(name, factor): (&String, &f64)| match factor {
        factor if (factor - 1.0).abs() <= 1e-9 => name.clone(),
        factor if (factor + 1.0).abs() <= 1e-9 => format!("-{name}"),
        factor => format!("{} {name}", exact((*factor).into())),
    };
    terms.iter().map(term).collect::<Vec<_>>().join(" + ").replace("+ -", "- ")
}

/// Table of parameters with their status.
pub(crate) fn parameters<'a>(
    parameters: impl Iterator<Item = &'a ParameterReport>,
    is_truth_known: bool,
) -> Table {
    let mut table = Table::with_class("parameters")
        .label("parameter")
        .numbers(["value", "sigma"])
        .unit()
        .text(["status"])
        .text(["value, sigma, truth, prior"])
        .html_only()
        .numbers_if(is_truth_known, ["truth"])
        .text(["grouped with"])
        .styled("terms");
    for parameter in parameters {
        table.row(cells![
            &parameter.name,
            value(parameter.value, parameter.sigma),
            sigma(parameter.sigma),
            parameter.unit,
            Cell::Html(parameter.status.into(), badge(parameter.status).into_string()),
            html_cell(bar(parameter)),
            value(parameter.truth, parameter.sigma),
            parameter.grouped_with.join(", "),
        ]);
    }
    table
}

/// All parameters, and the meaning of their status.
pub(crate) fn all_parameters(run: &RunReport) -> String {
    let truth = run.parameters.iter().any(|parameter| parameter.truth.known().is_some());
    parameters(run.parameters.iter(), truth).to_text()
        + &format!(
            "\nidentified: measured alone. grouped: only sums with the parameters beside it are measured, {}.\nweak: measured \
             with little certainty. prior: does not show in the torque.\n",
            split(run.has_prior())
        )
}

/// Table of the torque errors on all motions; `joint` names a joint.
pub(crate) fn fits(run: &RunReport, joint: impl Fn(usize) -> String) -> Table {
    // Figures use this name for the motion identified from, too: an unused one may have the same course.
    let is_recorded = run.seed.is_none() && run.trace.is_none();
    let all = || {
        let training = run.training.iter().map(|fit| (fit, Role::Training));
        training.chain(run.validation.iter().map(|fit| (fit, Role::Validation)))
    };
    let known = all().any(|(fit, _)| fit.percent_of_mean_abs_vs_truth.known().is_some());
    let mut table = Table::default()
        .text(["motion", "use", "joint"])
        .numbers(["rms, N m", "% of mean abs", "% of rms", "excluded, %"])
        .numbers_if(known, ["% of mean abs, noise-free", "sticking, %"]);
    let percent = |share: Number| number(Number(share.known().map(|share| 100.0 * share)));
    for (fit, role) in all() {
        table.row(cells![
            if role == Role::Training && !is_recorded { "excitation" } else { fit.motion.as_str() },
            role.name(),
            joint(fit.joint),
            number(fit.rms_nm),
            number(fit.percent_of_mean_abs),
            number(fit.percent_of_rms),
            percent(fit.disturbed_share),
            number(fit.percent_of_mean_abs_vs_truth),
            percent(fit.sticking_share),
        ]);
    }
    table
}

/// Table of the training and validation files, with the rows used for each joint.
pub(crate) fn sources(sources: &[Source]) -> Table {
    let joints = sources.first().map_or(0, |source| source.used.len());
    let mut table = Table::default()
        .text(["file", "use"])
        .numbers(["from, s", "length, s", "rate, Hz"])
        .numbers((1..=joints).flat_map(|joint| [format!("rows {joint}"), format!("still {joint}")]));
    for source in sources {
        let cells = cells![
            source.file.display().to_string(),
            source.role,
            format!("{:.2}", source.start_s),
            format!("{:.2}", source.duration_s),
            format!("{:.0}", source.rate_hz),
        ];
        let counts = source.used.iter().flat_map(|used| cells![*used, source.rows - used]);
        table.row(cells.into_iter().chain(counts));
    }
    table
}

/// Table of the columns and conversions of the files, if any differs from the documented format.
pub(crate) fn conversions(read: &[ReadReport]) -> Option<Table> {
    let mut table = Table::default().text(["file", "signal", "column", "unit", "times", "by"]);
    let mut files: Vec<&ReadReport> = Vec::new();
    for file in read.iter().filter(|file| file.is_notable()) {
        if files.contains(&file) {
            continue;
        }
        files.push(file);
        for column in &file.columns {
            table.row(cells![
                file.file.clone(),
                column.signal.clone(),
                column.column.clone(),
                column.unit.clone(),
                format!("{}", column.factor),
                column.by.unwrap_or("-"),
            ]);
        }
    }
    (!files.is_empty()).then_some(table)
}

/// Format and skipped rows of the same files, one line each.
pub fn reading_notes(read: &[ReadReport]) -> Vec<String> {
    let mut lines = Vec::new();
    for file in read.iter().filter(|file| file.is_notable()) {
        let header = if file.header { "" } else { ", no header" };
        let rows = file.samples + file.skipped;
        let mut line = format!("{}: {}{header}; {rows} rows", file.file, file.format);
        if file.skipped > 0 {
            let reasons = file.skipped_why.iter().map(|why| match why.rows {
                1 => format!("line {}: {}", why.line, why.reason),
                rows => format!("{rows} from line {}: {}", why.line, why.reason),
            });
            line += &format!(", {} skipped ({})", file.skipped, reasons.collect::<Vec<_>>().join("; "));
        }
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    lines
}

/// Meaning of the rows in the table of the files.
pub(crate) const SOURCES: &str = "rows: decimated to 50 a second and used for that joint's torque; still: excluded, at rest \
                           or near a reversal, because friction at rest is undetermined.";

/// Prints one run of a leg.
pub(crate) fn print_run(run: &RunReport, leg: &LegFile) -> Result<(), ToolError> {
    print(&run_text(run, leg))
}

/// Tables and verdict of one run of a leg.
pub fn run_text(run: &RunReport, leg: &LegFile) -> String {
    let joint = |number: usize| {
        let file = number.checked_sub(1).and_then(|index| leg.joints.get(index));
        file.map_or_else(|| number.to_string(), |file| format!("{number} {}", file.name))
    };
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
        base_parameters(run).to_text(),
        fits(run, joint).to_text(),
        search_line(run),
    ];
    lines.push(consistent_line(run));
    lines.extend(run.stribeck.iter().map(StribeckReport::line));
    lines.extend(scarab_identify::report::model_choice::lines(&run.model_choice, &run.asymmetric_coulomb));
    lines.extend(run.outliers.line());
    lines.extend(run.tracking.iter().map(|tracking| {
        format!(
            "tracking on gait, joint {}: {} deg rms without the model, {} with it",
            tracking.joint,
            number(tracking.rms_deg_without_model),
            number(tracking.rms_deg_with_model)
        )
    }));
    lines.extend(scarab_identify::report::scale::lines(run));
    lines.extend(run.doubt.iter().flat_map(scarab_identify::report::doubt::DoubtReport::lines));
    lines.push(String::new());
    lines.push(verdict_line(run));
    let cause = run.doubt.as_ref().and_then(|doubt| doubt.likely_cause.as_ref());
    let failed = run.findings.iter().filter(|finding| !finding.passed);
    lines.extend(failed.map(|finding| format!("  {}: {}", finding.reason, failure(run, finding))));
    lines.extend(cause.map(|cause| format!("  {}", cause.line())));
    if !run.validated && run.seed.is_none() {
        lines.push("  not validated: no motion was held out (--validate, --split)".into());
    }
    if run.is_replay() {
        lines.extend(hardly_tested(run).into_iter().map(|words| format!("  {words}")));
    }
    lines.extend(run.compared.iter().flat_map(comparison_lines));
    lines.join("\n") + "\n"
}

/// Sentence of a failed test, or the name of the likely cause that says the same.
pub(crate) fn failure(run: &RunReport, finding: &FindingReport) -> String {
    let cause = run.doubt.as_ref().and_then(|doubt| doubt.likely_cause.as_ref());
    match cause.filter(|cause| cause.says(finding)) {
        Some(cause) => format!("{}, see the likely cause", cause.name.replace('_', " ")),
        None => finding.words.clone(),
    }
}

/// Comparison with a stored model, and the mass that explains the difference.
pub(crate) fn comparison_lines(compared: &ComparisonReport) -> Vec<String> {
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
        "  as a mass added to link {}: {}; position: {}; first moment: {}",
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
        excess(run.bso.excess_chi2),
    )
}

/// Formats chi-square units above an optimum; smaller ones than 1e-6 are rounding.
pub(crate) fn excess(units: Number) -> String {
    match units.known() {
        Some(units) if units.abs() < 1e-6 => "< 1e-6".into(),
        _ => plain(units),
    }
}

/// Cost of physical consistency, and both searches for it.
fn consistent_line(run: &RunReport) -> String {
    let found = &run.consistent;
    let Some(full) = &found.full else {
        return format!(
            "physically consistent legs: the result costs {} chi-square units more than least squares ({} steps)",
            plain(found.result_over_least_squares),
            found.base.steps
        );
    };
    format!(
        "physically consistent legs: the best costs {} chi-square units more than least squares. the result, base values \
         completed in {} steps, ends {} units above the best. for comparison, a swarm over whole legs: {} iterations, {} \
         evaluations, ends {} units above it",
        plain(found.optimum_over_least_squares),
        found.base.steps,
        excess(found.base.excess_chi2),
        full.iterations,
        full.evaluations,
        excess(full.excess_chi2)
    )
}

/// Explanation of a reason from the closed list.
pub(crate) fn explanation(reason: &str) -> &'static str {
    match reason {
        "unphysical" => {
            "no physically consistent leg has these parameters (friction, inertia, kinetic energy), or none within its limits"
        }
        "unexcited" => "a joint hardly moved, or the motion does not distinguish the parameters",
        "residual" => "the residual of the model is not noise",
        "validation" => {
            "the held-out torque is predicted worse than noise and the accepted error permit, or not at all"
        }
        "not_a_measurement" => "the torque was computed, not measured",
        "outliers" => "too many outliers",
        "contact" => "the leg touched something",
        "input" => {
            "too few rows in which the joints move, a torque that is always zero, or values in another unit"
        }
        _ => "",
    }
}

/// Misfit over noise in words.
pub fn misfit(ratio: f64) -> String {
    if ratio.is_finite() {
        format!("a misfit of {ratio:.1} times the noise")
    } else {
        "a misfit beside unknown noise".into()
    }
}

/// Verdict in words.
pub fn verdict_line(run: &RunReport) -> String {
    let seconds = if run.simulated_s > 0.0 && run.wall_s > 0.0 {
        format!(" ({:.1} s of motion in {:.2} s)", run.simulated_s, run.wall_s)
    } else {
        String::new()
    };
    if run.accepted() {
        let misfit = run.accepted_misfit().map_or(String::new(), |ratio| format!(", with {}", misfit(ratio)));
        let validated = if run.validated { "" } else { ", not validated" };
        format!("verdict: accepted{misfit}{validated}{seconds}")
    } else {
        format!("verdict: refused, {}{seconds}", run.reasons.join(", "))
    }
}
