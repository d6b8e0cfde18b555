//! Head of the page: title, circumstances, and the main numbers.

use maud::{Markup, html};
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{FitReport, RunReport};

use crate::view::html::{Circumstances, exact, joint_name, number, signed};

/// Title: name of the leg and date.
pub(crate) fn title(circumstances: &Circumstances, run: &RunReport) -> Markup {
    let kind = match (&run.trace, run.seed) {
        (Some(_), _) => "trace of a board",
        (None, Some(_)) => "simulated run",
        (None, None) => "recording",
    };
    html! {
        header {
            p.over { "Scarab \u{b7} identification report \u{b7} " (kind) }
            h1 { (run.leg) }
            p.when { (circumstances.time_utc) " (UTC)" }
        }
    }
}

/// Circumstances of the run.
pub(crate) fn facts(circumstances: &Circumstances, run: &RunReport) -> Markup {
    let leg = &circumstances.leg;
    let joints: Vec<&str> = leg.joints.iter().map(|joint| joint.name.as_str()).collect();
    let gravity: Vec<String> = leg.gravity.iter().map(|element| exact((*element).into())).collect();
    let rows = [
        ("Leg", format!("{}: {}", run.leg, joints.join(", "))),
        ("Gravity in the base frame", format!("{} m/s\u{b2}", gravity.join(", "))),
        (
            "Scale",
            match (run.scale.scale, run.seed.is_some() || run.trace.is_some()) {
                ("absolute", _) => "absolute: identified torque constants",
                (_, true) => "relative to the torque constants",
                (_, false) => "that of the recorded torque",
            }
            .into(),
        ),
        ("Noise seed", run.seed.map_or("\u{2013} (recorded)".into(), |seed| seed.to_string())),
        ("Swarm seed", run.swarm_seed.to_string()),
        ("Prior", prior(&run.prior)),
        ("Plan", run.plan.into()),
        (
            "Temperature",
            run.temperature_c.known().map_or("unknown".into(), |celsius| format!("{celsius} \u{b0}C")),
        ),
        (
            if run.seed.is_some() { "Simulated time" } else { "Recorded time" },
            format!("{:.1} s", run.simulated_s),
        ),
        ("Version", format!("scarab {}, report schema {}", env!("CARGO_PKG_VERSION"), run.schema)),
    ];
    let drives = run.drive.map(|name| ("Drive", drive(name)));
    html! {
        section {
            h2 { "What was run" }
            dl.facts {
                @for (name, value) in rows.into_iter().chain(drives) { div { dt { (name) } dd { (value) } } }
                div.command { dt { "Command" } dd { code { (circumstances.command) } } }
            }
        }
    }
}

/// Description of the simulated drives.
pub(crate) fn drive(name: &str) -> String {
    match name {
        "ideal" => "simulated; currents follow their targets with a lag".into(),
        "full" => "simulated with motors, inverters, current and angle sensors, supply".into(),
        _ => name.into(),
    }
}

/// Description of a prior.
pub(crate) fn prior(name: &str) -> String {
    match (name, name.strip_prefix("wrong:")) {
        ("none", _) => "none".into(),
        ("file", _) => "the leg file's".into(),
        (_, Some(percent)) => format!("wrong by {percent} % in every number"),
        _ => name.into(),
    }
}

/// Worst value of each kind, and its motion.
pub fn numbers(run: &RunReport, leg: &LegFile) -> Markup {
    let worst = |value: &dyn Fn(&FitReport) -> Option<f64>| -> Option<(f64, String)> {
        let known = run
            .validation
            .iter()
            .filter_map(|fit| Some((value(fit)?, format!("{}, {}", fit.motion, joint_name(leg, fit.joint)))));
        known.max_by(|one, other| one.0.total_cmp(&other.0))
    };
    let percent = |found: Option<(f64, String)>| match found {
        Some((value, note)) => (format!("{} %", number(value.into())), note),
        None => ("\u{2013}".into(), "no motion was held out".into()),
    };
    let measured = percent(worst(&|fit| fit.percent_of_mean_abs.known()));
    let noise_free = worst(&|fit| fit.percent_of_mean_abs_vs_truth.known());
    let errors = run.base_parameters.iter().filter_map(|base| {
        let sigma = base.sigma.known().filter(|sigma| *sigma > 0.0)?;
        Some(((base.value.known()? - base.truth.known()?) / sigma, base.name.clone()))
    });
    let farthest = errors.max_by(|one, other| one.0.abs().total_cmp(&other.0.abs()));
    let combinations = run.base_parameters.len();
    let mut cards =
        vec![("worst torque error on unused motions, of mean absolute torque", measured.0, measured.1)];
    if noise_free.is_some() {
        let (value, note) = percent(noise_free);
        cards.push(("the same against the noise-free torque", value, note));
    }
    cards.push((
        "combinations of parameters that the data determine",
        format!("{} of {combinations}", run.rank),
        format!("of {} parameters; condition {}", run.columns, number(run.condition)),
    ));
    if let Some((sigmas, name)) = farthest {
        cards.push(("largest error of a base parameter", format!("{} sigma", signed(sigmas)), name));
    }
    html! { dl.cards { @for (what, value, note) in cards {
        div { dt { (what) } dd { span.value { (value) } span.place { (note) } } }
    } } }
}

/// Last line of the page.
pub(crate) fn colophon(run: &RunReport) -> Markup {
    let time = if run.trace.is_some() { String::new() } else { format!(" in {:.2} s", run.wall_s) };
    html! {
        footer {
            p { "Made by Scarab " (env!("CARGO_PKG_VERSION")) (time) ". Values are SI; sigma is one standard deviation"
                @if !run.is_replay() { ", of the torque's noise alone" } "." }
        }
    }
}
