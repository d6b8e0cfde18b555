//! What replay, simulation, `excite` and image need from a leg file and do not find, as lines to paste.

use std::fmt::Write;

use scarab::model::planar::JOINTS;
use scarab_base::error::{FileError, ToolError};
use scarab_identify::formats::leg_file::draft::truth_text;
use scarab_identify::formats::leg_file::keys::{KeyLine, PRIOR, TRUTH};
use scarab_identify::formats::leg_file::{JointFile, LegFile, MissingForImage};
use scarab_identify::leg::setup::{DEFAULT_SEED, check_background, check_simulation};
use scarab_identify::run::replay::warnings::rounded_twists;
use scarab_rig::excite::run::designable;
use scarab_rig::image::leg_source::describe;

/// Report on the leg of this name or path.
///
/// # Errors
/// The file cannot be read, or is no valid leg file.
pub fn text(name_or_path: &str) -> Result<String, ToolError> {
    let (leg, missing) = LegFile::load_with_missing(name_or_path)?;
    let names: Vec<_> = leg.joints.iter().map(|joint| format!("`{}`", joint.name)).collect();
    let mut text = format!("{name_or_path}: leg `{}`, joints {}\n", leg.name, names.join(", "));
    for remark in rounded_twists(&leg) {
        let _ = writeln!(text, "{remark}");
    }
    let known = check_background(&leg);
    replay(&mut text, &leg, &known);
    simulation(&mut text, &leg, &known);
    excite(&mut text, &leg, &known);
    image(&mut text, &leg, &missing);
    if text.contains("\n  [[joint]]") || text.contains("\n  before") {
        text.push_str(
            "\nReplace words in capitals; a file with one of them is refused. Keys: docs/files.md.\n",
        );
    }
    Ok(text)
}

// Formatting into a String cannot fail.
fn section(text: &mut String, of: &str, state: &str) {
    let _ = writeln!(text, "\n{of}: {state}");
}

fn impossible(text: &mut String, of: &str, fault: &FileError) {
    section(text, of, &format!("not possible: {}", fault.reason));
}

fn replay(text: &mut String, leg: &LegFile, known: &Result<(), FileError>) {
    if let Err(fault) = known {
        return impossible(text, "replay", fault);
    }
    section(text, "replay", "ready");
    let without: Vec<usize> =
        (0..leg.joints.len()).filter(|joint| leg.joints[*joint].prior.is_none()).collect();
    if !without.is_empty() {
        text.push_str(
            "  without the `prior` of every joint grouped and unobservable parameters have no value:\n",
        );
        without.iter().for_each(|joint| of_joint(text, leg, *joint, &[line(&PRIOR)]));
    }
}

fn simulation(text: &mut String, leg: &LegFile, known: &Result<(), FileError>) {
    if let Err(fault) = known {
        return impossible(text, "simulation", fault);
    }
    let without: Vec<usize> =
        (0..leg.joints.len()).filter(|joint| leg.joints[*joint].truth.is_none()).collect();
    if without.is_empty() {
        return match check_simulation(leg) {
            Ok(()) => {
                section(text, "simulation", "ready");
                let is_noiseless = leg.joints.iter().all(|joint| joint.current_noise_a == 0.0);
                if leg.torque_noise_percent == 0.0 && is_noiseless {
                    text.push_str("  its torque has no noise, unlike a real one: --torque-noise 7\n");
                }
            }
            Err(fault) => impossible(text, "simulation", &fault),
        };
    }
    section(text, "simulation", "keys are missing");
    for joint in without {
        let lines = match &leg.joints[joint].prior {
            Some(prior) => format!("truth = {}  # the prior's values: change them", truth_text(prior)),
            None => line(&TRUTH),
        };
        of_joint(text, leg, joint, &[lines]);
    }
}

/// Whether a motion can be designed, by a short search.
fn excite(text: &mut String, leg: &LegFile, known: &Result<(), FileError>) {
    if let Err(fault) = known {
        return impossible(text, "excite", fault);
    }
    let has = |of: &dyn Fn(&JointFile) -> bool| leg.joints.iter().all(of);
    let noise = has(&|joint| joint.current_noise_a > 0.0) || leg.torque_noise_percent > 0.0;
    let advice = "--torque-noise-nm NM states the torque's noise at rest (standard deviation)\n";
    if !has(&|joint| joint.prior.is_some()) && !has(&|joint| joint.truth.is_some()) {
        section(text, "excite", "keys are missing");
        if !noise {
            text.push_str("  before the first [[joint]]\n    # no key: the option ");
            text.push_str(advice);
        }
        let without = (0..leg.joints.len()).filter(|joint| leg.joints[*joint].prior.is_none());
        return without.for_each(|joint| of_joint(text, leg, joint, &[line(&PRIOR)]));
    }
    match designable(leg) {
        Ok(assumed) => {
            section(text, "excite", "ready");
            if !noise {
                text.push_str("  the option ");
                text.push_str(advice);
            }
            assumed.iter().for_each(|line| {
                let _ = writeln!(text, "  {line}");
            });
        }
        Err(error) => section(text, "excite", &format!("not possible: {error}")),
    }
}

fn image(text: &mut String, leg: &LegFile, missing: &MissingForImage) {
    let is_complete = missing.top.is_empty() && missing.joints.is_empty();
    if is_complete || leg.joints.len() != JOINTS {
        return match describe(leg, DEFAULT_SEED) {
            Ok(_) => section(text, "image", "ready"),
            Err(fault) => impossible(text, "image", &fault),
        };
    }
    section(text, "image", "keys are missing");
    if !missing.top.is_empty() {
        text.push_str("  before the first [[joint]]\n");
        missing.top.iter().for_each(|key| lines(text, &line(key)));
    }
    for lacking in &missing.joints {
        let mut needed = Vec::new();
        if lacking.encoder_is_at_the_joint {
            needed.push("# `encoder.side` is \"joint\": the board needs the encoder at the motor".to_owned());
        }
        if !lacking.in_prior.is_empty() {
            let keys: Vec<_> = lacking.in_prior.iter().map(|key| key.line).collect();
            needed.push(format!("# within `prior = {{ .. }}`: {}", keys.join(", ")));
        }
        needed.extend(lacking.keys.iter().map(|key| line(key)));
        of_joint(text, leg, lacking.joint, &needed);
    }
}

/// Line to paste with its meaning; a table's comment stands on its first line.
fn line(key: &KeyLine) -> String {
    let (first, rest) = key.line.split_once('\n').unwrap_or((key.line, ""));
    let rest = if rest.is_empty() { String::new() } else { format!("\n{rest}") };
    format!("{first}  # {}{rest}", key.meaning)
}

fn of_joint(text: &mut String, leg: &LegFile, joint: usize, needed: &[String]) {
    let _ = writeln!(text, "  [[joint]] {}", leg.joints[joint].name);
    needed.iter().for_each(|needed| lines(text, needed));
}

fn lines(text: &mut String, needed: &str) {
    needed.lines().for_each(|line| {
        let _ = writeln!(text, "    {line}");
    });
}
