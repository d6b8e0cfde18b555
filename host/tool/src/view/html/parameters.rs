//! Sections of base parameters, and of all fourteen parameters of every joint with a bar of their
//! uncertainty.

use maud::{Markup, html};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{ParameterReport, RunReport};

use crate::view::html::table::ToHtml;
use crate::view::html::{measured, sigma};
use crate::view::tables;

/// Width and height of a bar, pixels.
const BAR: (f64, f64) = (150.0, 16.0);

/// Section of the base parameters.
pub(crate) fn base(run: &RunReport) -> Markup {
    let bounded = run.base_parameters.iter().any(|base| base.cramer_rao.known().is_some());
    let misfit = run.base_parameters.iter().any(|base| base.sigma_misfit.known().is_some());
    html! {
        h3 { "What torque determines" }
        p { "Base parameters: the sums of parameters that show in the torque, by the swarm, with their standard deviation."
            @if misfit { " Sigma is the larger of its part by noise and its part by the model's misfit, with the bias of \
            the encoders and possible logging errors." }
            @if bounded { " No unbiased estimator can have a smaller one than the Cram\u{e9}r-Rao bound." } }
        (tables::base_parameters(run).to_html())
    }
}

/// Tables of all parameters, one for each joint.
pub(crate) fn all(run: &RunReport, leg: &LegFile) -> Markup {
    let truth = run.parameters.iter().any(|parameter| parameter.truth.known().is_some());
    let joints = run.parameters.iter().map(|parameter| parameter.joint).max().unwrap_or(0);
    html! {
        h3 { "All parameters" }
        (statuses(run.has_prior()))
        p.note { "Bars, each row on its own scale: dot the value, thick one sigma, thin three; hollow where no sigma is known. "
            span.truth-key { "\u{25c6}" } " truth" @if !truth { " (not known here)" } ", "
            span.prior-key { "\u{25b2}" } " prior"
            @if run.has_prior() { ", at the edge where it lies beyond" } @else { " (none was given)" }
            ". Values have the digits that sigma supports, three without sigma." }
        @for joint in 1..=joints {
            h4 { "Joint " (joint) @if let Some(file) = leg.joints.get(joint - 1) { ": " (file.name) } }
            (tables::parameters(run.parameters.iter().filter(|parameter| parameter.joint == joint), truth).to_html())
        }
    }
}

/// What splits a measured sum of parameters.
pub(crate) const fn split(has_prior: bool) -> &'static str {
    if has_prior { "the prior splits them" } else { "without a prior nothing splits them" }
}

/// Meaning of each status.
fn statuses(has_prior: bool) -> Markup {
    html! {
        p { (badge("identified")) " measured alone. " (badge("grouped"))
            " only sums with the parameters beside it are measured, " (split(has_prior)) ". " (badge("weak"))
            " measured, hardly distinguishable from others. " (badge("prior")) " does not show in the torque"
            @if !has_prior { ", so it has no value without a prior" } "." }
    }
}

/// Status of a parameter.
pub(crate) fn badge(status: &str) -> Markup {
    html! { span class={ "badge " (status) } { (status) } }
}

/// Half the range of a bar around the value: four sigma, including the truth if known.
fn half_range(parameter: &ParameterReport, value: f64) -> f64 {
    let sigma = parameter.sigma.known().map_or(0.0, |sigma| 4.0 * sigma);
    let truth = parameter.truth.known().map_or(0.0, |truth| 1.2 * (truth - value).abs());
    let prior = parameter.prior.known().map_or(0.0, |prior| 1.2 * (prior - value).abs());
    // Without a sigma the range may be wide; with one the sigma must stay visible.
    let half = if sigma > 0.0 { sigma.max(truth) } else { truth.max(prior) };
    // Smaller ranges are the rounding of a zero.
    if half > 1e-9 { half } else { value.abs().max(1e-9) }
}

/// Bar with value, sigma, truth and prior.
pub(crate) fn bar(parameter: &ParameterReport) -> Markup {
    let Some(value) = parameter.value.known() else {
        return html! { "\u{2013}" };
    };
    let half = half_range(parameter, value);
    let (width, height) = BAR;
    let (middle, margin) = (height / 2.0, 7.0);
    let to_x = |x: f64| {
        let share = ((x - value) / half).clamp(-1.0, 1.0);
        width / 2.0 + share * (width / 2.0 - margin)
    };
    let whisker = |sigmas: f64, thickness: f64| {
        let reach = parameter.sigma.known().map(|sigma| sigmas * sigma);
        html! { @if let Some(reach) = reach {
            line.sigma x1=(short(to_x(value - reach))) x2=(short(to_x(value + reach))) y1=(middle) y2=(middle)
                stroke-width=(thickness) {}
        } }
    };
    let words = format!(
        "{} {} \u{b1} {}",
        parameter.name,
        measured(parameter.value, parameter.sigma),
        sigma(parameter.sigma)
    );
    html! {
        svg.bar width=(width) height=(height) viewBox={ "0 0 " (width) " " (height) } role="img" aria-label=(words) {
            line.axis x1="0" x2=(width) y1=(middle) y2=(middle) {}
            (whisker(3.0, 1.5))
            (whisker(1.0, 6.0))
            @if let Some(prior) = parameter.prior.known() {
                path.prior d={ "M" (short(to_x(prior))) " " (middle + 1.0) "l3.5 6h-7z" } {}
            }
            @if let Some(truth) = parameter.truth.known() {
                path.truth d={ "M" (short(to_x(truth))) " " (middle - 8.0) "l3 4l-3 4l-3 -4z" } {}
            }
            circle.value.open[parameter.sigma.known().is_none()] cx=(short(to_x(value))) cy=(middle) r="2.6" {}
        }
    }
}

fn short(pixels: f64) -> String {
    format!("{pixels:.1}")
}
