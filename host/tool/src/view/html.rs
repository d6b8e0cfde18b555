//! Report of a run as one HTML page: results, their uncertainty, and their limits.
//!
//! Why one page: a result must be easy to view, print, share and archive. The page needs no network, font or
//! script; its figures are the SVG drawings of [`crate::view::figures`]. All text from files, for example a
//! leg's name, is escaped by maud. Only the drawings are inserted unescaped, because the backend has escaped
//! their texts.
//!
//! Keys without a section of their own, for example from a later report, are shown in a generic
//! table (`html/generic.rs`).

mod choices;
mod generic;
mod head;
mod limits;
pub(crate) mod parameters;
mod results;
pub(crate) mod seeds;
pub mod table;
mod verdict;

use jiff::{Timestamp, Unit};
use maud::{DOCTYPE, Markup, PreEscaped, html};
use scarab_base::error::ToolError;
use scarab_base::names::BY_CARGO;
use scarab_base::number::Number;
use scarab_base::precision;
use scarab_base::shell::quoted;
use scarab_base::table::typeset;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{RunReport, Source};

use crate::view::figures::{Figure, Group};

/// Colours, print rules, narrow screens.
const STYLE: &str = concat!(include_str!("palette.css"), include_str!("html/style.css"));
/// Content policy: nothing is fetched or executed, independent of a file's text.
const POLICY: &str = "default-src 'none'; style-src 'unsafe-inline'; img-src data:";

/// Current time, UTC, in seconds.
///
/// `SOURCE_DATE_EPOCH` (s since 1970) replaces it, for reproducible pages.
pub(crate) fn time_utc() -> String {
    let stated = std::env::var("SOURCE_DATE_EPOCH").ok().and_then(|seconds| seconds.parse().ok());
    let now = stated.and_then(|seconds| Timestamp::from_second(seconds).ok()).unwrap_or_else(Timestamp::now);
    now.round(Unit::Second).unwrap_or(now).to_string()
}

/// Circumstances of a run.
#[derive(Clone, Debug)]
pub struct Circumstances {
    /// Time, UTC.
    pub(crate) time_utc: String,
    /// Command line.
    pub command: String,
    /// Identified leg.
    pub(crate) leg: LegFile,
}

impl Circumstances {
    /// Command line of this process and the current time ([`time_utc`]).
    pub(crate) fn now(leg: &LegFile) -> Self {
        Self::from_command(leg, std::env::args().skip(1).filter(|word| word != BY_CARGO))
    }

    /// Command line of these words and the current time, as in `Self::now`.
    pub fn from_command(leg: &LegFile, words: impl IntoIterator<Item = String>) -> Self {
        let words: Vec<String> = words.into_iter().map(|word| quoted(&word)).collect();
        Self {
            time_utc: time_utc(),
            command: format!("cargo sim {}", words.join(" ")).trim_end().to_owned(),
            leg: leg.clone(),
        }
    }
}

/// Creates the page.
pub fn page(
    circumstances: &Circumstances,
    run: &RunReport,
    sources: &[Source],
    figures: &[Figure],
) -> Result<String, ToolError> {
    let rest = generic::sections(run)?;
    let group = |group: Group| -> Markup {
        html! { @for figure in figures.iter().filter(|figure| figure.group == group) { (drawing(figure)) } }
    };
    let page = html! {
        (DOCTYPE)
        html lang="en" {
            (page_head(&format!("Identification of {}: {}", run.leg, run.verdict)))
            body {
                main {
                    (head::title(circumstances, run))
                    (verdict::alarms(run))
                    (verdict::banner(run))
                    (head::facts(circumstances, run))
                    section { h2 { "At a glance" } (head::numbers(run, &circumstances.leg)) (group(Group::Summary)) }
                    @if !sources.is_empty() { (results::sources(run, sources)) }
                    section {
                        h2 { "Parameters" }
                        (parameters::base(run))
                        (group(Group::BaseParameters))
                        (parameters::all(run, &circumstances.leg))
                    }
                    section { h2 { "Trajectories" } (results::trajectory_words(run)) (group(Group::Trajectories)) }
                    section { h2 { "Torque" } (results::torque_words(run)) (group(Group::Torque)) (results::fits(run, &circumstances.leg)) }
                    section { h2 { "Residuals" } (results::residual_words()) (group(Group::Residuals)) }
                    section { h2 { "Search" } (results::search(run)) (group(Group::Search)) }
                    (results::consistent(run))
                    (choices::model(run, &circumstances.leg))
                    (choices::outliers(run, &circumstances.leg))
                    (choices::comparison(run))
                    @if !run.tracking.is_empty() { (results::tracking(run, &circumstances.leg)) }
                    (results::scale(run))
                    (rest)
                    (verdict::doubts(run))
                    (verdict::tests(&run.findings, &circumstances.leg))
                    (limits::section(run))
                    (head::colophon(run))
                }
            }
        }
    };
    Ok(page.into_string())
}

/// Drawing with a title for screen readers.
pub(crate) fn drawing(figure: &Figure) -> Markup {
    let svg = figure.svg.replacen("<svg ", "<svg role=\"img\" aria-labelledby=\"", 1);
    let identity = figure.file.replace('.', "-");
    let svg = svg.replacen("aria-labelledby=\"", &format!("aria-labelledby=\"{identity}\" "), 1);
    html! {
        figure {
            div.drawing { (PreEscaped(svg)) }
            figcaption id=(identity) { (figure.title) " " span.file { (figure.file) } }
        }
    }
}

/// Formats three significant digits.
fn number(value: Number) -> String {
    typeset(&precision::plain(value))
}

/// Formats an exact number, for example a limit.
fn exact(value: Number) -> String {
    typeset(&precision::exact(value))
}

/// Formats a value, rounded by its standard deviation.
fn measured(value: Number, sigma: Number) -> String {
    typeset(&precision::value(value, sigma))
}

/// Formats a standard deviation.
fn sigma(value: Number) -> String {
    typeset(&precision::sigma(value))
}

/// Name of a joint, from 1.
fn joint_name(leg: &LegFile, joint: usize) -> String {
    let file = joint.checked_sub(1).and_then(|index| leg.joints.get(index));
    file.map_or_else(|| format!("joint {joint}"), |file| file.name.clone())
}

/// Formats a number with its sign.
fn signed(value: f64) -> String {
    typeset(&format!("{value:+.1}"))
}

/// `1 thing`, `2 things`.
fn count(number: usize, thing: &str) -> String {
    format!("{number} {thing}{}", if number == 1 { "" } else { "s" })
}

/// Head of every page: no network, no script.
pub(crate) fn page_head(title: &str) -> Markup {
    html! {
        head {
            meta charset="utf-8";
            meta name="viewport" content="width=device-width, initial-scale=1";
            meta http-equiv="Content-Security-Policy" content=(POLICY);
            meta name="color-scheme" content="light";
            link rel="icon" href="data:,";
            title { (title) }
            style { (PreEscaped(STYLE)) }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn unknown_values_are_dashes_and_negative_values_have_a_minus() {
        assert_eq!(number(Number::UNKNOWN), "\u{2013}");
        assert_eq!(number((-0.79941).into()), "\u{2212}0.799");
        assert_eq!(number(f64::NAN.into()), "\u{2013}");
    }
}
