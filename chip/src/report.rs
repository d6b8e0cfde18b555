//! Results of a run as JSON.

use std::collections::BTreeMap;

use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::{BaseReport, RunReport};
use scarab_rig::identify::identify_one;
use scarab_rig::options::SimulationOptions;
use scarab_rig::traced::report::run_report;
use serde::Serialize;

use crate::findings::Finding;
use crate::load::{CURRENT, LEVELS};
use crate::session::Session;
use crate::time::{TICK_HZ, microseconds, seconds};

/// Shares of the processor's time.
#[derive(Clone, Debug, Default, Serialize)]
pub struct LoadReport {
    /// Time awake.
    pub total: f64,
    /// Current loops, index pulses and the emergency stop's contact.
    pub level0: f64,
    pub servo: f64,
    /// Bus, both levels.
    pub bus: f64,
    /// Law of the assistance.
    pub assist: f64,
    /// Housekeeping and its clock.
    pub housekeeping: f64,
    pub thread: f64,
}

/// Use by one interrupt.
#[derive(Clone, Debug, Default, Serialize)]
pub struct InterruptReport {
    /// Entries per second.
    pub per_second: f64,
    /// Mean instructions of an entry.
    pub mean_instructions: f64,
    /// Most instructions of an entry, without preempting interrupts.
    pub worst_instructions: u64,
    /// Longest time from pending to entry, us.
    pub worst_latency_us: f64,
    /// Longest time from entry to return, preemption included, us.
    pub longest_us: f64,
}

/// Result of a run.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ChipReport {
    /// `accepted`, `refused`, or `none` without an identification.
    pub verdict: String,
    pub reasons: Vec<String>,
    pub base_parameters: Vec<BaseReport>,
    /// Error of each base parameter against the plant, over the sigma for the leg file's torque noise.
    pub errors: BTreeMap<String, f64>,
    /// Findings that are not listed as harmless.
    pub findings: Vec<Finding>,
    /// Harmless findings with their reason.
    pub known_findings: Vec<(Finding, &'static str)>,
    /// Missed ticks by the image's own count.
    pub missed_current_ticks: u32,
    /// Missed servo ticks by the image's own count.
    pub servo_missed: u32,
    /// Conversions that were overwritten before they were read.
    pub lost_conversions: u64,
    /// Shares of the processor's time since the last step began.
    pub load: LoadReport,
    /// Use by interrupt since the last step began.
    pub interrupts: BTreeMap<&'static str, InterruptReport>,
    /// Most instructions by interrupt.
    pub worst_instructions: BTreeMap<&'static str, u64>,
    /// Emergency stops at the end of the run; `None` if no bridge was on then.
    pub stop: Option<crate::stops::Situation>,
    pub resets: Vec<String>,
    /// Deepest use of the stack, bytes, and its size.
    pub stack: [u32; 2],
    /// Records read and lost.
    pub records: [u64; 2],
    pub simulated_s: f64,
    pub instructions: u64,
    /// Cycles per instruction.
    pub time_factor: f64,
    pub seed: u64,
}

/// Findings of a session, split into unknown and known ones.
pub fn findings(session: &Session) -> (Vec<Finding>, Vec<(Finding, &'static str)>) {
    let image = session.machine.image();
    let all = session.chip().findings.list(|pc| image.function(pc)).into_iter();
    let (known, unknown): (Vec<_>, Vec<_>) = all.partition(|finding| finding.known().is_some());
    let with_reason = |finding: Finding| finding.known().map(|reason| (finding, reason));
    (unknown, known.into_iter().filter_map(with_reason).collect())
}

/// Shares of the processor's time.
pub fn load(session: &Session) -> LoadReport {
    let chip = session.chip();
    let share = |names: &[&str]| {
        let levels = LEVELS.iter().filter(|(name, _)| names.contains(name));
        levels.map(|(_, exception)| chip.load.share(*exception, chip.now)).sum()
    };
    LoadReport {
        total: chip.load.awake(chip.now),
        level0: share(&["stop", CURRENT, "index_0", "index_1"]),
        servo: share(&["servo"]),
        bus: share(&["bus_receive", "bus"]),
        assist: share(&["assist"]),
        housekeeping: share(&["housekeeping", "clock"]),
        thread: chip.load.share(0, chip.now),
    }
}

/// Use of the processor by interrupt.
pub fn interrupts(session: &Session) -> BTreeMap<&'static str, InterruptReport> {
    let chip = session.chip();
    let measured = chip.load.measured(chip.now);
    let report = |exception: u8| {
        let used = chip.load.usage(exception);
        InterruptReport {
            per_second: used.entries as f64 * TICK_HZ as f64 / measured as f64,
            mean_instructions: used.instructions as f64 / used.entries.max(1) as f64,
            worst_instructions: used.worst,
            worst_latency_us: microseconds(used.latency),
            longest_us: microseconds(used.longest),
        }
    };
    LEVELS.into_iter().map(|(name, exception)| (name, report(exception))).collect()
}

/// Errors of base parameters. Truth and sigma are those of an identification of the simulated leg, because a
/// trace does not contain the truth, and the plant of this model has less noise than a machine.
fn errors(leg: &LegFile, run: &RunReport, seed: u64) -> Result<BTreeMap<String, f64>, ToolError> {
    let options = &SimulationOptions::with_seed(seed);
    let (simulated, _) = identify_one(leg, options, None)?;
    let pairs = run.base_parameters.iter().filter_map(|base| {
        let other = simulated.base_parameters.iter().find(|other| other.name == base.name)?;
        let error = base.value.known()? - other.truth.known()?;
        Some((base.name.clone(), error / other.sigma.known()?))
    });
    let errors: BTreeMap<_, _> = pairs.collect();
    if errors.len() == run.base_parameters.len() {
        return Ok(errors);
    }
    Err(ToolError::input("the simulated leg has other base parameters than the image"))
}

impl ChipReport {
    /// Returns whether the stack is at least 1.5 times its deepest use.
    pub const fn stack_suffices(&self) -> bool {
        let [used, size] = self.stack;
        3 * used <= 2 * size
    }

    /// Whether every base parameter is within one sigma of the plant's.
    pub fn agrees_with_the_plant(&self) -> bool {
        self.errors.values().all(|error| error.abs() <= 1.0)
    }

    /// Report of a session.
    ///
    /// # Errors
    /// The records belong to another leg.
    pub fn new(session: &mut Session, identified: bool, factor: f64, seed: u64) -> Result<Self, ToolError> {
        session.probe.trace.finish();
        let run = if identified { Some(run_report(&session.probe.trace, &session.leg)?) } else { None };
        let errors = match &run {
            Some(run) => errors(&session.leg, run, seed)?,
            None => BTreeMap::new(),
        };
        let (unknown, known) = findings(session);
        let interrupts = interrupts(session);
        let loops = session.probe.trace.statistics.loops();
        let chip = session.chip();
        Ok(Self {
            verdict: run.as_ref().map_or_else(|| "none".into(), |run| run.verdict.into()),
            reasons: run
                .as_ref()
                .map_or_else(Vec::new, |run| run.reasons.iter().map(ToString::to_string).collect()),
            errors,
            base_parameters: run.map_or_else(Vec::new, |run| run.base_parameters),
            findings: unknown,
            known_findings: known,
            missed_current_ticks: loops.as_ref().map_or(0, |loops| loops.current_missed),
            servo_missed: loops.as_ref().map_or(0, |loops| loops.servo_missed),
            lost_conversions: chip.lost_conversions(),
            load: load(session),
            worst_instructions: interrupts
                .iter()
                .map(|(name, used)| (*name, used.worst_instructions))
                .collect(),
            interrupts,
            stop: None,
            resets: session.resets.iter().map(|reason| format!("{reason:?}")).collect(),
            stack: loops.as_ref().map_or([0; 2], |loops| [loops.stack_used, loops.stack_bytes]),
            records: [session.probe.trace.records, session.probe.trace.lost()],
            simulated_s: seconds(chip.now),
            instructions: chip.load.instructions,
            time_factor: factor,
            seed,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_base::number::Number;
    use serde_json::Value;

    /// A report in which every list has an entry.
    fn report() -> ChipReport {
        let base = BaseReport {
            name: "ZZR1".into(),
            terms: BTreeMap::from([("ZZ1".into(), 1.0)]),
            value: Number(Some(1.0)),
            unit: "kg m^2",
            sigma: Number(Some(0.01)),
            sigma_from: "noise",
            sigma_noise: Number(Some(0.01)),
            sigma_misfit: Number::UNKNOWN,
            truth: Number::UNKNOWN,
            cramer_rao: Number::UNKNOWN,
        };
        let finding = Finding {
            what: "reserved bit set",
            register: "CAN_MCR".into(),
            pc: 0x0800_0200,
            function: "start".into(),
            count: 1,
        };
        ChipReport {
            reasons: vec!["residual".into()],
            base_parameters: vec![base],
            errors: BTreeMap::from([("ZZR1".into(), 0.1)]),
            findings: vec![finding],
            interrupts: BTreeMap::from([("servo", InterruptReport::default())]),
            worst_instructions: LEVELS.into_iter().map(|(name, _)| (name, 0)).collect(),
            stop: Some(crate::stops::Situation::default()),
            resets: vec!["Software".into()],
            ..ChipReport::default()
        }
    }

    /// Compares names and kinds of all fields.
    fn assert_shape(path: &str, shown: &Value, documented: &Value) {
        match (shown, documented) {
            (Value::Object(shown), Value::Object(documented)) => {
                let names = |object: &serde_json::Map<String, Value>| {
                    object.keys().cloned().collect::<std::collections::BTreeSet<_>>()
                };
                assert_eq!(names(shown), names(documented), "{path}");
                shown.iter().for_each(|(name, value)| {
                    assert_shape(&format!("{path}.{name}"), value, &documented[name]);
                });
            }
            (Value::Array(shown), Value::Array(documented)) => {
                assert_eq!(shown.len(), documented.len(), "{path}");
                shown.iter().zip(documented).for_each(|(one, other)| assert_shape(path, one, other));
            }
            (shown, documented) => {
                assert_eq!(core::mem::discriminant(shown), core::mem::discriminant(documented), "{path}");
                assert_eq!(shown.is_f64(), documented.is_f64(), "{path}");
            }
        }
    }

    #[test]
    fn json_of_a_run_has_the_documented_fields() {
        let readme = include_str!("../README.md");
        let documented = readme.split("```json\n").nth(1).and_then(|rest| rest.split("```").next());
        let documented: Value = serde_json::from_str(documented.expect("an example")).expect("JSON");
        let shown = serde_json::to_value(report()).expect("JSON");
        assert_shape("", &shown, &documented);
    }
}
