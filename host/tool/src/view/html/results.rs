//! Sections on motions, torques, search and tracking: text and tables beside their figures.

use maud::{Markup, html};
use scarab_base::table::{Table, cells, typeset};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{RunReport, Source, scale};

use crate::view::html::table::ToHtml;
use crate::view::html::{joint_name, number};
use crate::view::tables;

/// Section of a replay's files.
pub(crate) fn sources(run: &RunReport, sources: &[Source]) -> Markup {
    let read = run.read.as_deref().unwrap_or_default();
    html! {
        section {
            h2 { "Recordings" }
            (tables::sources(sources).to_html())
            p.note { (tables::SOURCES) }
            @if let Some(table) = tables::conversions(read) {
                (table.to_html())
                @for line in tables::reading_notes(read) { p.note { (line) } }
            }
        }
    }
}

/// Caption of the angles.
pub(crate) fn trajectory_words(run: &RunReport) -> Markup {
    let words = if run.seed.is_some() {
        "The first motion is identified from, the others are only predicted. The deviation is that of the position loop \
         without a model."
    } else if run.trace.is_some() {
        "Angles as the board logged them, of motions whose log was sent and has no gap. What was commanded is not logged."
    } else {
        "Angles as recorded, on the firmware's grid of 500 samples a second. A recording contains no commands."
    };
    html! { p { (words) } }
}

/// Caption of the torques.
pub(crate) fn torque_words(run: &RunReport) -> Markup {
    html! { p {
        "Measured and predicted torque, both through the filter of the identification. The blue band is two standard \
        deviations of the filtered noise to both sides, as the identification estimates it: nineteen of twenty residuals \
        of a perfect model lie within it. Grey: the joint is at rest, and the row is excluded. Below each motion the blue \
        curve is measured less predicted torque"
        @if run.seed.is_some() { ", the orange one noise-free less predicted, known because the leg is simulated" } "."
    } }
}

/// Caption of the residuals.
pub(crate) fn residual_words() -> Markup {
    html! { p {
        "A model that lacks nothing leaves noise. Then the bars follow the normal curve, and the autocorrelation that of \
        white noise behind the same filter; correlation beyond it is motion that the model does not explain."
    } }
}

/// Table of the residuals on every motion.
pub(crate) fn fits(run: &RunReport, leg: &LegFile) -> Markup {
    html! { h3 { "Torque errors" } (tables::fits(run, |joint| joint_name(leg, joint)).to_html()) }
}

/// Text about the search.
pub fn search(run: &RunReport) -> Markup {
    if run.trace.is_some() {
        return html! { p {
            "The beetle swarm started cold and took " (run.bso.iterations) " iterations and " (run.bso.evaluations)
            " evaluations. A board does not report the excess over the optimum, which needs double precision."
        } };
    }
    let half = run.bso.iterations_to_half_chi2;
    html! { p {
        "The beetle swarm started cold and took " (run.bso.iterations) " iterations and " (run.bso.evaluations)
        " evaluations. It ends " (typeset(&tables::excess(run.bso.excess_chi2))) " chi-square units above the optimum J"
        sub { "C" } " of its box, which double precision finds exactly; one unit is a shift by one standard deviation in one \
        direction."
        @if let Some(iterations) = half { " Half a unit was reached after " (iterations) " iterations." }
        " Least squares costs " (number(run.least_squares.cost)) " units."
    } }
}

/// Units of the parameters and load of the leg; empty for a recording, which contains torques.
pub(crate) fn scale(run: &RunReport) -> Markup {
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
pub(crate) fn consistent(run: &RunReport) -> Markup {
    let found = &run.consistent;
    let mut table = Table::default()
        .text(["search"])
        .numbers([
            "iterations",
            "evaluations",
            "completion steps",
            "excess, chi-square units",
            "iterations to half a unit",
        ])
        .text(["consistent"]);
    let (limits, completed) = if run.has_prior() {
        ("the prior's limits", "base values, completed by the prior")
    } else {
        ("limits by geometry and torque", "base values, completed by a neutral leg")
    };
    let base = (completed, "base", &found.base);
    let full = found.full.as_ref().map(|full| ("whole legs, for comparison", "full", full));
    for (words, name, search) in core::iter::once(base).chain(full) {
        table.row(cells![
            format!("{words}{}", if found.chosen == name { " (the result)" } else { "" }),
            search.iterations,
            search.evaluations,
            search.steps,
            typeset(&tables::excess(search.excess_chi2)),
            search.iterations_to_half_chi2.map_or("\u{2013}".to_owned(), |half| half.to_string()),
            match search.consistent {
                Some(true) => "yes",
                Some(false) => "no",
                None => "\u{2013}",
            },
        ]);
    }
    html! {
        section {
            h2 { "Physically consistent legs" }
            p { "Of all legs whose every link has a mass above zero and an inertia that some body has, within " (limits)
                ", the best costs " (number(found.optimum_over_least_squares)) " chi-square units more than least squares, \
                the result " (typeset(&tables::excess(found.result_over_least_squares))) "."
                @if let Some(freedom) = found.degrees_of_freedom { " Of noise alone that is a chi-square of at most " (freedom) " degrees of freedom." } }
            (table.to_html())
        }
    }
}

/// Effect of the model on the servo.
pub(crate) fn tracking(run: &RunReport, leg: &LegFile) -> Markup {
    let mut table = Table::default().text(["joint"]).numbers([
        "without the model, deg rms",
        "with it, deg rms",
        "smaller by",
    ]);
    for tracking in &run.tracking {
        let (without, with) = (tracking.rms_deg_without_model, tracking.rms_deg_with_model);
        let ratio = without.known().zip(with.known()).filter(|(_, with)| *with > 0.0);
        table.row(cells![
            joint_name(leg, tracking.joint),
            number(without),
            number(with),
            ratio.map_or("\u{2013}".into(), |(without, with)| format!("{:.1} times", without / with)),
        ]);
    }
    html! {
        section {
            h2 { "Tracking" }
            p { "Position error on gait with a cycle of 3 s, same gains: feedback alone, and with the identified model in the \
                feedforward." }
            (table.to_html())
        }
    }
}
