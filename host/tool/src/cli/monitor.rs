//! `monitor`: a leg is identified and walks, something changes, and the firmware's reaction is reported.

use clap::Args;
use rayon::prelude::*;
use scarab_base::error::{EXIT_ACCEPTED, EXIT_REFUSED, ToolError};
use scarab_identify::formats::leg_file::{LegFile, PushesFile};
use scarab_identify::leg::placed_mass::PlacedMass;
use scarab_identify::leg::setup::DEFAULT_SEED;
use scarab_identify::report::SCHEMA;
use scarab_rig::monitor::{Disturbance, MonitorOptions, watch};
use scarab_rig::report::monitor::{MonitorRun, MonitorRuns};

use crate::cli::arguments::Output;
use crate::cli::common::write_json;
use crate::cli::leg_options::LegOptions;
use crate::view::monitor::print_runs;

/// Changes, their time, and the time without a change.
#[derive(Args, Debug)]
pub(crate) struct MonitorArguments {
    #[command(flatten)]
    leg: LegOptions,
    /// Mass fixed to a link during the walk, KG@JOINT:X_M[:Y_M]; a minus sign removes a mass. Default: 3 kg
    /// at 0.2 m of the last link.
    #[arg(long, allow_hyphen_values = true)]
    payload: Option<String>,
    /// Factor on Coulomb and viscous friction of all joints.
    #[arg(long, allow_hyphen_values = true)]
    friction: Option<f64>,
    /// Duration of the change of friction, s.
    #[arg(long, requires = "friction", default_value_t = 0.0)]
    over: f64,
    /// Walking time before the change, s.
    #[arg(long, default_value_t = 20.0, allow_hyphen_values = true)]
    at: f64,
    /// Walking time without a change, hours: counts false alarms.
    #[arg(long, default_value_t = 0.0)]
    hours: f64,
    /// Pushes of the wearer while walking, PER_MINUTE:PEAK_NM; each lasts half a second on average.
    #[arg(long)]
    pushes: Option<String>,
    /// Seed of noise and pushes.
    #[arg(long, conflicts_with = "seeds")]
    seed: Option<u64>,
    /// Run each seed from A to B, both included: A..B.
    #[arg(long, value_parser = crate::cli::identify::parse_seeds)]
    seeds: Option<(u64, u64)>,
    /// Write the report as JSON here, for exit codes 0 and 3.
    #[arg(long)]
    json: Option<Output>,
}

/// Limits far beyond plausible friction and duration of a walk; larger values are typing errors.
const LARGEST_FRICTION_FACTOR: f64 = 10.0;
const LARGEST_WAIT_S: f64 = 3600.0;
const LARGEST_HOURS: f64 = 200.0;
const LARGEST_PUSHES_PER_MINUTE: f64 = 120.0;
const LARGEST_PUSH_NM: f64 = 500.0;

fn in_range(option: &str, value: f64, low: f64, high: f64) -> Result<f64, ToolError> {
    if (low..=high).contains(&value) {
        return Ok(value);
    }
    Err(ToolError::input(format!("{option}: {value} is outside {low}..{high}")))
}

/// Parses a mass to be attached, or with a leading minus to be removed.
fn payload(leg: &LegFile, text: &str) -> Result<Disturbance, ToolError> {
    let (off, stated) = text.strip_prefix('-').map_or((false, text), |rest| (true, rest));
    let placed: PlacedMass =
        stated.parse().map_err(|error| ToolError::input(format!("--payload {text}: {error}")))?;
    let mut payload = placed.on(leg, "--payload")?;
    let link =
        leg.joints.get(payload.joint).and_then(|joint| joint.truth.as_ref()).map_or(0.0, |link| link.mass);
    if off && payload.mass >= link {
        return Err(ToolError::input(format!("--payload {text}: removes more than the link's {link} kg")));
    }
    if off {
        payload.mass = -payload.mass;
    }
    Ok(Disturbance::Payload(payload))
}

fn pushes(text: &str) -> Result<PushesFile, ToolError> {
    let wrong = || ToolError::input(format!("--pushes {text}: is not PER_MINUTE:PEAK_NM"));
    let (rate, peak) = text.split_once(':').ok_or_else(wrong)?;
    let (rate, peak) = (rate.parse::<f64>().map_err(|_| wrong())?, peak.parse::<f64>().map_err(|_| wrong())?);
    Ok(PushesFile {
        per_minute: in_range("--pushes PER_MINUTE", rate, f64::MIN_POSITIVE, LARGEST_PUSHES_PER_MINUTE)?,
        torque_nm: in_range("--pushes PEAK_NM", peak, 0.0, LARGEST_PUSH_NM)?,
        duration_s: 0.5,
    })
}

/// Monitors and reports; the exit code is that of the worst run.
pub(crate) fn run(arguments: &MonitorArguments) -> Result<u8, ToolError> {
    let leg = &arguments.leg.load()?;
    let mut disturbances = Vec::new();
    if let Some(text) = &arguments.payload {
        disturbances.push(payload(leg, text)?);
    }
    if let Some(factor) = arguments.friction {
        let factor = in_range("--friction", factor, 0.0, LARGEST_FRICTION_FACTOR)?;
        let over_s = in_range("--over", arguments.over, 0.0, LARGEST_WAIT_S)?;
        disturbances.push(Disturbance::Friction { factor, over_s });
    }
    let hours = in_range("--hours", arguments.hours, 0.0, LARGEST_HOURS)?;
    if disturbances.is_empty() && hours == 0.0 {
        let last = leg.joints.last().map_or("", |joint| joint.name.as_str());
        disturbances.push(payload(leg, &format!("3@{last}:0.2"))?);
    }
    let pushes = arguments.pushes.as_deref().map(pushes).transpose()?;
    let at_s = in_range("--at", arguments.at, 0.0, LARGEST_WAIT_S)?;
    let (first, last) = arguments.seeds.unwrap_or_else(|| {
        let seed = arguments.seed.unwrap_or(DEFAULT_SEED);
        (seed, seed)
    });
    let options: Vec<_> = (first..=last)
        .map(|seed| MonitorOptions { seed, disturbances: disturbances.clone(), at_s, hours, pushes })
        .collect();
    let runs: Vec<MonitorRun> =
        options.par_iter().map(|options| watch(leg, options)).collect::<Result<_, _>>()?;
    let runs = MonitorRuns { schema: SCHEMA, leg: leg.name.clone(), runs };
    if let Some(path) = &arguments.json {
        write_json(path, &runs)?;
    }
    print_runs(&runs)?;
    Ok(if runs.runs.iter().all(MonitorRun::is_as_it_should_be) { EXIT_ACCEPTED } else { EXIT_REFUSED })
}
