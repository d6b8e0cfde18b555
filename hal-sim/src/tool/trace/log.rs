//! The 500 Hz log of a trace as recordings that `replay` reads.

use std::path::Path;

use scarab::leg::{LoggedSample, Segment};
use scarab::servo::{LogSample, TICKS_PER_LOG};

use super::fields::Sample;
use super::read::Trace;
use crate::tool::error::ToolError;
use crate::tool::identify::write_log;
use crate::tool::leg_file::LegFile;
use crate::with_leg_size;

/// What was written.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Samples.
    pub samples: usize,
    /// Samples that are missing between them.
    pub missing: u64,
}

/// Writes the motion identified from, of the last identification that logged one: anatomical angles and torques.
///
/// # Errors
/// Nothing was logged, the leg has other joints, or the file cannot be written.
pub fn write(trace: &Trace, leg: &LegFile, path: &Path) -> Result<Written, ToolError> {
    let training = || trace.log.iter().filter(|(_, sample)| sample.segment == "training");
    let Some((last, _)) = training().next_back() else {
        return Err(ToolError::input(
            "--csv: the trace holds no log of a motion that was identified from (records `log`, sent on request)",
        ));
    };
    let samples: Vec<&Sample> =
        training().filter(|(results, _)| results == last).map(|(_, sample)| sample).collect();
    if let Some(sample) = samples.iter().find(|sample| sample.counts.len() != leg.joints.len()) {
        let (told, own) = (sample.counts.len(), leg.joints.len());
        return Err(ToolError::input(format!("--csv: the log is of {told} joints, the leg has {own}")));
    }
    // An identification that was begun twice logs its motion twice: the last one counts.
    let begins = samples.windows(2).rposition(|pair| is_another_motion(pair[0].tick, pair[1].tick));
    let samples = &samples[begins.map_or(0, |before| before + 1)..];
    let steps =
        samples.windows(2).map(|pair| u64::from(pair[1].tick - pair[0].tick) / u64::from(TICKS_PER_LOG));
    let missing = steps.map(|steps| steps.saturating_sub(1)).sum();
    with_leg_size!(leg, write_sized(path, leg, samples))?;
    Ok(Written { samples: samples.len(), missing })
}

/// The ticks began anew, or nothing was logged for longer than a gap may be.
fn is_another_motion(before: u32, after: u32) -> bool {
    const LONGEST_TICKS: u32 = scarab::servo::SERVO_RATE_HZ;
    after <= before || after - before > LONGEST_TICKS
}

fn write_sized<const N: usize, const B: usize>(
    path: &Path,
    leg: &LegFile,
    samples: &[&Sample],
) -> Result<(), ToolError> {
    let logged: Vec<LoggedSample<N>> = samples
        .iter()
        .map(|told| LoggedSample {
            sample: LogSample {
                position_rad: core::array::from_fn(|joint| told.position_rad[joint]),
                torque_nm: core::array::from_fn(|joint| told.torque_nm[joint]),
                counts_sum: core::array::from_fn(|joint| told.counts[joint]),
                tick: told.tick,
            },
            segment: Some(Segment::Training),
        })
        .collect();
    write_log(path, leg, &logged)
}
