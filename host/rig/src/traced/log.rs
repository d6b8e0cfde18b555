//! Writes the 500 Hz log of a trace as recordings for `replay`, one motion per file.

use std::path::Path;

use scarab::leg::{LoggedSample, Segment};
use scarab::servo::{LogSample, TICKS_PER_LOG};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::with_leg_size;

use crate::simulate::recorded;
use crate::trace::read::Trace;
use crate::trace::records::Log;

/// Size of a written recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Written {
    /// Samples written.
    pub samples: usize,
    /// Samples missing between them.
    pub missing: u64,
}

/// Number of the motion identified from; predicted motions follow.
pub const TRAINING: u8 = 0;

/// Writes one motion of the last identification that logged it, as anatomical angles and torques.
///
/// # Errors
/// The motion was not logged, the leg has another number of joints, or the file cannot be written.
pub fn write(trace: &Trace, leg: &LegFile, motion: u8, path: &Path) -> Result<Written, ToolError> {
    let of_motion = || trace.log.iter().filter(|(_, sample)| number(sample) == Some(motion));
    let Some((last, _)) = of_motion().next_back() else {
        return Err(ToolError::input(match others(trace, motion) {
            others if others.is_empty() => {
                "--csv: the trace holds no log of a motion (records `log`, sent on request)".to_owned()
            }
            others => format!("--csv: the trace holds no log of motion {motion}, but of {others}"),
        }));
    };
    let samples: Vec<&Log> =
        of_motion().filter(|(results, _)| results == last).map(|(_, sample)| sample).collect();
    if let Some(sample) = samples.iter().find(|sample| sample.counts.len() != leg.joints.len()) {
        let (recorded, own) = (sample.counts.len(), leg.joints.len());
        return Err(ToolError::input(format!("--csv: the log has {recorded} joints, the leg has {own}")));
    }
    // A restarted identification logs its motion twice: the last one counts.
    let begins = samples.windows(2).rposition(|pair| is_another_motion(pair[0].tick, pair[1].tick));
    let samples = &samples[begins.map_or(0, |before| before + 1)..];
    let steps =
        samples.windows(2).map(|pair| u64::from(pair[1].tick - pair[0].tick) / u64::from(TICKS_PER_LOG));
    let missing = steps.map(|steps| steps.saturating_sub(1)).sum();
    with_leg_size!(leg, write_sized(path, leg, samples))?;
    Ok(Written { samples: samples.len(), missing })
}

/// Comma-separated list of the other logged motions; empty without any.
pub fn others(trace: &Trace, motion: u8) -> String {
    let mut numbers: Vec<u8> = trace.log.iter().filter_map(|(_, sample)| number(sample)).collect();
    numbers.sort_unstable();
    numbers.dedup();
    let others = numbers.iter().filter(|number| **number != motion).map(u8::to_string);
    others.collect::<Vec<_>>().join(", ")
}

/// Number of the motion that a sample belongs to.
fn number(sample: &Log) -> Option<u8> {
    match sample.segment.as_str() {
        "training" => Some(TRAINING),
        "validation" => u8::try_from(sample.motion).ok(),
        _ => None,
    }
}

/// Returns whether the ticks restarted, or the log paused for longer than a permitted gap.
fn is_another_motion(before: u32, after: u32) -> bool {
    const LONGEST_TICKS: u32 = scarab::servo::SERVO_RATE_HZ;
    after <= before || after - before > LONGEST_TICKS
}

fn write_sized<const N: usize, const B: usize>(
    path: &Path,
    leg: &LegFile,
    samples: &[&Log],
) -> Result<(), ToolError> {
    let logged: Vec<LoggedSample<N>> = samples
        .iter()
        .map(|recorded| LoggedSample {
            sample: LogSample {
                position_rad: core::array::from_fn(|joint| recorded.position_rad[joint]),
                torque_nm: core::array::from_fn(|joint| recorded.torque_nm[joint]),
                counts_sum: core::array::from_fn(|joint| recorded.counts[joint]),
                tick: recorded.tick,
            },
            segment: Some(Segment::Training),
        })
        .collect();
    recorded(path, leg, &logged).save(path)
}
