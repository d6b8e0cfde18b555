//! Section on parameters that torque cannot determine in this run.

use maud::{Markup, html};
use scarab_identify::report::RunReport;

use crate::view::html::count;
use crate::view::html::parameters::split;

/// Paragraph with the affected parameters.
pub(crate) fn section(run: &RunReport) -> Markup {
    let with = |status: &str| -> Vec<&str> {
        let all = run.parameters.iter().filter(|parameter| parameter.status == status);
        all.map(|parameter| parameter.name.as_str()).collect()
    };
    let (grouped, weak, prior) = (with("grouped"), with("weak"), with("prior"));
    html! {
        section.limits {
            h2 { "What torque does not determine" }
            p {
                "Joint torque depends on " (count(run.base_parameters.len(), "combination")) " of the "
                (count(run.columns, "parameter")) " that were estimated, and on nothing else. However long the leg moves, the \
                rest does not show. "
                @if run.has_prior() {
                    "Its values come from the prior, and a model completed by another prior predicts the same torque."
                } @else {
                    "Without a prior it has no values here; whatever they are, the predicted torque is the same."
                }
            }
            ul {
                @if !grouped.is_empty() {
                    li { strong { "Grouped: " } (grouped.join(", ")) ". Only their sums are measured, " (split(run.has_prior())) "." }
                }
                @if !prior.is_empty() {
                    li { strong { "Prior: " } (prior.join(", ")) ". Torque does not depend on them, or they were not estimated." }
                }
                @if !weak.is_empty() {
                    li { strong { "Weak: " } (weak.join(", ")) ". Measured, but hardly distinguishable from the others on this motion." }
                }
                @if run.scale.scale == "absolute" {
                    li { strong { "Scale: " } "determined by the known mass of a second run, not by this motion." }
                } @else {
                    li { strong { "Scale: " } "a wrong torque constant scales every parameter alike, which one run does not \
                        show. All values are relative to it." }
                }
                li { strong { "Rest: " } "friction of a joint at rest takes any value up to breakaway; stretches in which a \
                    joint is at rest (grey) are excluded and cannot be predicted." }
                @if !run.is_replay() {
                    li { strong { "Sigma: " } "counts noise of the torque, not of the encoder, and no error of the model itself." }
                }
            }
        }
    }
}
