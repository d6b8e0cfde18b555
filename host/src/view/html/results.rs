//! Sections on motions, torques, search and tracking: text and tables beside their figures.

use maud::{Markup, html};

use crate::base::number::Number;
use crate::formats::leg_file::LegFile;
use crate::report::series::Role;
use crate::report::{ConsistentSearchReport, FitReport, RunReport, Source, scale};
use crate::view::html::{joint_name, number};

/// Table of a replay's files.
pub fn sources(sources: &[Source]) -> Markup {
    html! {
        section {
            h2 { "Recordings" }
            div.wide { table {
                thead { tr {
                    th scope="col" { "file" } th scope="col" { "use" }
                    th.n scope="col" { "from, s" } th.n scope="col" { "length, s" } th.n scope="col" { "rate, Hz" }
                    th.n scope="col" { "rows" } th.n scope="col" { "used, by joint" }
                } }
                tbody { @for source in sources { tr {
                    td { (source.file.display()) } td { (source.role) }
                    td.n { (format!("{:.2}", source.start_s)) } td.n { (format!("{:.2}", source.duration_s)) }
                    td.n { (format!("{:.0}", source.rate_hz)) } td.n { (source.rows) }
                    td.n { (source.used.iter().map(u32::to_string).collect::<Vec<_>>().join(", ")) }
                } } }
            } }
            p.note { "Rows are filtered to 50 a second. Those in which a joint stands still are not used for it: friction at \
                rest is undetermined." }
        }
    }
}

/// Caption of the angles.
pub fn trajectory_words(run: &RunReport) -> Markup {
    let words = if run.seed.is_some() {
        "The first motion is identified from, the others are only predicted. The deviation is that of the position loop \
         without a model."
    } else if run.trace.is_some() {
        "Angles as the board logged them, of motions whose log was sent and has no gap. What was commanded is not logged."
    } else {
        "Angles as recorded, on the firmware's grid of 500 samples a second. A recording does not tell what was commanded."
    };
    html! { p { (words) } }
}

/// Caption of the torques.
pub fn torque_words(run: &RunReport) -> Markup {
    html! { p {
        "Measured and predicted torque, both through the filter of the identification. The blue band is two standard \
        deviations of the filtered noise to both sides, as the identification estimates it: nineteen of twenty residuals \
        of a perfect model lie within it. Grey: the joint stands still, and the row is left out."
        @if run.seed.is_some() { " The noise-free torque is known because the leg is simulated." }
    } }
}

/// Caption of the residuals.
pub fn residual_words() -> Markup {
    html! { p {
        "A model that lacks nothing leaves noise. Then the bars follow the normal curve, and the autocorrelation that of \
        white noise behind the same filter; correlation beyond it is motion that the model does not explain."
    } }
}

/// Table of the residuals on every motion.
pub fn fits(run: &RunReport, leg: &LegFile) -> Markup {
    let all = || run.training.iter().chain(&run.validation);
    let truth = all().any(|fit| fit.percent_of_mean_abs_vs_truth.known().is_some());
    // Figures use this name for the motion identified from, too.
    let is_recorded = run.seed.is_none() && run.trace.is_none();
    let motion = |fit: &FitReport, role: Role| match role {
        Role::Training if !is_recorded => "excitation".to_owned(),
        _ => fit.motion.clone(),
    };
    let row = |fit: &FitReport, role: Role| {
        html! { tr {
            td { (motion(fit, role)) } td { (role.name()) } td { (joint_name(leg, fit.joint)) }
            td.n { (number(fit.rms_nm)) } td.n { (number(fit.percent_of_mean_abs)) } td.n { (number(fit.percent_of_rms)) }
            td.n { (number(Number(fit.disturbed_share.known().map(|share| 100.0 * share)))) }
            @if truth {
                td.n { (number(fit.percent_of_mean_abs_vs_truth)) }
                td.n { (number(Number(fit.sticking_share.known().map(|share| 100.0 * share)))) }
            }
        } }
    };
    html! {
        h3 { "Torque errors" }
        div.wide { table {
            thead { tr {
                th scope="col" { "motion" } th scope="col" { "use" } th scope="col" { "joint" }
                th.n scope="col" { "rms, N\u{a0}m" } th.n scope="col" { "% of mean abs" } th.n scope="col" { "% of rms" }
                th.n scope="col" { "set aside, %" }
                @if truth { th.n scope="col" { "% of mean abs, noise-free" } th.n scope="col" { "sticking, %" } }
            } }
            tbody {
                @for fit in &run.training { (row(fit, Role::Training)) }
                @for fit in &run.validation { (row(fit, Role::Validation)) }
            }
        } }
    }
}

/// Text about the search.
pub fn search(run: &RunReport) -> Markup {
    if run.trace.is_some() {
        return html! { p {
            "The beetle swarm started cold and took " (run.bso.iterations) " iterations and " (run.bso.evaluations)
            " evaluations. How far it ends above the optimum of its box a board does not tell: that takes double precision."
        } };
    }
    let half = run.bso.iterations_to_half_chi2;
    html! { p {
        "The beetle swarm started cold and took " (run.bso.iterations) " iterations and " (run.bso.evaluations)
        " evaluations. It ends " (number(run.bso.excess_chi2)) " chi-square units above the optimum J"
        sub { "C" } " of its box, which double precision finds exactly; one unit is a shift by one standard deviation in one \
        direction."
        @if let Some(iterations) = half { " Half a unit was reached after " (iterations) " iterations." }
        " Least squares costs " (number(run.least_squares.cost)) " units; the swarm's cost over that, less one, is "
        (number(run.bso.cost_over_least_squares)) "."
    } }
}

/// Units of the parameters and load of the leg; empty for a recording, which contains torques.
pub fn scale(run: &RunReport) -> Markup {
    let lines = scale::lines(run);
    html! { @if !lines.is_empty() {
        section { h2 { "Scale and load" } @for line in lines { p { (capital(&line)) "." } } }
    } }
}

fn capital(words: &str) -> String {
    let mut letters = words.chars();
    letters.next().map_or(String::new(), |first| first.to_uppercase().chain(letters).collect())
}

/// Searches for a physically consistent leg.
pub fn consistent(run: &RunReport) -> Markup {
    let found = &run.consistent;
    let row = |words: &str, name: &str, search: &ConsistentSearchReport| {
        html! { tr {
            td { (words) @if found.chosen == name { " (the result)" } } td.n { (search.iterations) } td.n { (search.evaluations) }
            td.n { (search.steps) } td.n { (number(search.excess_chi2)) }
            td.n { @match search.iterations_to_half_chi2 { Some(half) => { (half) }, None => { "\u{2013}" } } }
            td { (match search.consistent { Some(true) => "yes", Some(false) => "no", None => "\u{2013}" }) }
        } }
    };
    html! {
        section {
            h2 { "Physically consistent legs" }
            p { "Of all legs whose every link has a mass above zero and an inertia that some body has, within the prior's \
                limits, the best costs " (number(found.optimum_over_least_squares)) " chi-square units more than least squares, \
                the result " (number(found.result_over_least_squares)) "."
                @if let Some(freedom) = found.degrees_of_freedom { " Of noise alone that is a chi-square of at most " (freedom) " degrees of freedom." } }
            div.wide { table {
                thead { tr {
                    th scope="col" { "search" } th.n scope="col" { "iterations" } th.n scope="col" { "evaluations" }
                    th.n scope="col" { "completion steps" } th.n scope="col" { "excess, chi-square units" }
                    th.n scope="col" { "iterations to half a unit" } th scope="col" { "consistent" }
                } }
                tbody {
                    (row("base values, completed by the prior", "base", &found.base))
                    @if let Some(full) = &found.full { (row("whole legs", "full", full)) }
                }
            } }
        }
    }
}

/// Effect of the model on the servo.
pub fn tracking(run: &RunReport, leg: &LegFile) -> Markup {
    html! {
        section {
            h2 { "Tracking" }
            p { "Position error on gait with a cycle of 3 s, same gains: feedback alone, and with the identified model in the \
                feedforward." }
            div.wide { table {
                thead { tr {
                    th scope="col" { "joint" } th.n scope="col" { "without the model, deg rms" }
                    th.n scope="col" { "with it, deg rms" } th.n scope="col" { "smaller by" }
                } }
                tbody { @for tracking in &run.tracking {
                    @let ratio = tracking.rms_deg_without_model.known().zip(tracking.rms_deg_with_model.known());
                    tr {
                        td { (joint_name(leg, tracking.joint)) }
                        td.n { (number(tracking.rms_deg_without_model)) } td.n { (number(tracking.rms_deg_with_model)) }
                        td.n { @match ratio {
                            Some((without, with)) if with > 0.0 => { (format!("{:.1} times", without / with)) },
                            _ => { "\u{2013}" },
                        } }
                    }
                } }
            } }
        }
    }
}
