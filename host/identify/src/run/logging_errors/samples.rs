//! Samples that no sensor measured: torque at a limit, values that are held, frozen or coarse.
//!
//! Why: clipped or repeated values look like measurements to every later step, and bias the parameters with a
//! small sigma. The columns themselves show them, before any model is fitted.
//!
//! ```text
//! u  step of a column: 5 % quantile of its changes      R  range of a torque      D = max(0.01 R, 0.99 u)
//!    of an angle: or of the changes between its repeated values, if these are larger
//! a  samples within D of an extreme                      b  samples in the next band of width D
//! e  samples equal to the extreme                        c  other samples within D (coarse columns: b)
//!
//! saturation    e >= 20 with a run of 3, and  no column repeats otherwise,  e >= 3 (c + 1) where u <= 0.4 D,
//!               or e >= 6 (c + 1)
//!          or   a >= 20, a >= 3 (b + 1), and less than 0.3 of the noise elsewhere: flattened by a filter
//! held          runs of 2 and more that end in a jump of 3 u: 20 % of the torques, 40 % of the angles
//! zero rows     3 gaps of 1 to 10 rows that are zero in every column, some angle above 0.05 rad beside each
//! frozen        a run of 25 ms, at least 5 samples, in a column that is noisy elsewhere; or an angle that
//!               then jumps by 5 u and 3 times its next step
//! ```
//!
//! Only samples in which the leg moves count, since a leg at rest repeats its values rightly. A smooth peak
//! has a = 2.4 b where it is a parabola and 5.3 b where it is of the fourth order; each limit lies above the
//! ratio of such a peak. A sample without neighbours of its own size is an outlier, not a limit.
//!
//! Saturated and frozen stretches are excluded ([`Screened::spans`]) while they are few. A held column is
//! late by half of its holding time on average, and is refused. Cost: linear in the samples, except
//! sorts. Known limits: a drive at its own limit gives the same torque column as a sensor at its limit; its
//! rows are excluded although they are right. The step of an interpolated angle is found here, but possibly
//! not in `encoder.rs`; its sigma then lacks the bias by the encoder's steps.

use std::ops::Range;

use scarab_base::stats::quantile;

use crate::formats::recording::{JointSeries, Recording};
use crate::report::doubt::SampleFinding;
use crate::run::logging_errors::encoder::Encoder;

/// Finding of saturated torque.
pub(crate) const SATURATION: &str = "saturation";
/// Finding of values that are repeated.
pub(crate) const HELD: &str = "held_samples";
/// Finding of rows that are zero in every column.
pub(crate) const ZERO_ROWS: &str = "zero_rows";
/// Finding of a coarse column; never refuses.
pub(crate) const QUANTISED: &str = "quantised";

/// Speed above which a leg moves, rad/s, and half the time over which it is measured, s.
const MOVING_RADPS: f64 = 0.03;
const MOVING_S: f64 = 0.025;
/// Width of the bands at the extremes, share of the range.
const BAND: f64 = 0.01;
/// Least number of samples at an extreme that show a limit.
const LEAST_AT_LIMIT: usize = 20;
/// Time by which a saturated stretch is widened, s: after it a filter of 50 Hz has settled.
const WIDENED_S: f64 = 0.02;
/// Stretches closer than this are joined, s.
const JOINED_S: f64 = 0.05;
/// Least time, s, and least number of samples of an unchanged value that count as frozen.
const FROZEN_S: f64 = 0.025;
const FROZEN_SAMPLES: usize = 5;
/// Shares of held samples that refuse a recording, of torque and angle.
const HELD_TORQUE: f64 = 0.2;
const HELD_ANGLE: f64 = 0.4;
/// Largest holding time of a column that is not refused, s: two periods of the firmware's log.
const HARMLESS_HOLD_S: f64 = 0.0045;
/// Longest time for which a column that is updated regularly holds a value, s.
const LONGEST_HOLD_S: f64 = 0.1;
/// Angle on both sides of a row of zeros from which the leg cannot have been at zero, rad.
const JUMP_RAD: f64 = 0.05;
/// Most rows of zeros in a row, and fewest such gaps that are no accident.
const LONGEST_GAP: usize = 10;
const LEAST_GAPS: usize = 3;
/// Share of rows of zeros from which a recording is refused; fewer are replaced as outliers.
const LARGEST_ZERO_SHARE: f64 = 0.005;
/// Largest lost share of a recording: beyond it the rest is a biased choice, as with disturbed rows.
const LARGEST_LOSS: f64 = 1.0 / 3.0;
/// Least number of levels from which a column shows the step between them.
const LEAST_LEVELS: usize = 20;
/// Part of a step by which levels that are whole steps apart may miss. By chance a fifth of all distances are
/// so close.
const WHOLE_STEP: f64 = 0.1;
/// Steps from which a column is coarse: 12 bits at the joint, and a share of a torque's range.
const COARSE_RAD: f64 = 1.5e-3;
const COARSE_SHARE: f64 = 0.01;

/// Findings of one recording, and the stretches that must be excluded.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Screened {
    /// Findings about the samples.
    pub(crate) findings: Vec<SampleFinding>,
    /// Times without a valid sample in some column, on the recording's clock, s; ordered, not overlapping.
    pub(crate) spans: Vec<Range<f64>>,
}

/// Examines recordings of one machine. Limits of the torque are searched in each recording alone and in all
/// together. `described_rad` are the steps of the encoders by the leg file. `reach_s` is the time lost on
/// either side of an excluded stretch.
pub(crate) fn screen(recordings: &[&Recording], described_rad: &[f64], reach_s: f64) -> Vec<Screened> {
    let mut examinations: Vec<Examination> =
        recordings.iter().map(|recording| Examination::new(recording, described_rad)).collect();
    for examination in &mut examinations {
        examination.find_limits();
    }
    if examinations.len() > 1 {
        find_common_limits(&mut examinations);
    }
    examinations.into_iter().map(|examination| examination.finish(reach_s)).collect()
}

/// One recording under examination.
struct Examination<'a> {
    recording: &'a Recording,
    /// Step of each joint's angle, rad.
    angle_steps: Vec<f64>,
    is_moving: Vec<bool>,
    /// Marks samples of a frozen column.
    is_frozen: Vec<bool>,
    /// Joint, limit and samples of each saturated side.
    limits: Vec<Limit>,
}

struct Limit {
    joint: usize,
    upper: bool,
    limit_nm: f64,
    is_at: Vec<bool>,
}

impl<'a> Examination<'a> {
    fn new(recording: &'a Recording, described_rad: &[f64]) -> Self {
        let angles = recording.joints.iter().map(|joint| &joint.position_rad);
        let angle_steps: Vec<f64> = angles
            .clone()
            .zip(described_rad)
            .map(|(values, &described_rad)| {
                let encoder = Encoder::detect(values, described_rad).map_or(0.0, |encoder| encoder.step_rad);
                step(values).max(level_step(values)).max(encoder)
            })
            .collect();
        let is_moving = moving(recording, &angle_steps);
        let mut is_frozen = vec![false; recording.time_s.len()];
        let mut examination = Self {
            recording,
            angle_steps: angle_steps.clone(),
            is_moving,
            is_frozen: Vec::new(),
            limits: Vec::new(),
        };
        for (values, &u) in angles.zip(&angle_steps) {
            if examination.held(values, u, &[]).share > HELD_ANGLE {
                continue;
            }
            for run in frozen_runs(recording, values).filter(|run| ends_in_jump(values, run, u)) {
                is_frozen[run].fill(true);
            }
        }
        examination.is_frozen = is_frozen;
        examination
    }

    /// Samples with valid neighbours and motion on both sides; the edges of a rest are excluded.
    fn usable(&self) -> Vec<bool> {
        let half = half_window(self.recording);
        let mut usable: Vec<bool> = self.is_frozen.iter().map(|&frozen| !frozen).collect();
        for run in runs(&self.is_moving).filter(|run| !self.is_moving[run.start]) {
            let end = (run.end + half).min(usable.len());
            usable[run.start.saturating_sub(half)..end].fill(false);
        }
        usable
    }

    /// Searches limits of every torque that is not held.
    fn find_limits(&mut self) {
        let usable = self.usable();
        for (joint, series) in self.recording.joints.iter().enumerate() {
            if self.held_torque(&series.torque_nm, &[]).share > HELD_TORQUE {
                continue;
            }
            let part = Part { values: &series.torque_nm, usable: &usable, rate_hz: self.rate_hz() };
            for upper in [true, false] {
                if let Some((limit_nm, mut at)) = limit(&[part], upper) {
                    self.limits.push(Limit { joint, upper, limit_nm, is_at: at.remove(0) });
                }
            }
        }
    }

    fn rate_hz(&self) -> f64 {
        1.0 / self.recording.median_step_s().max(1e-9)
    }

    /// Share and median duration of held values of a column with steps `u`; samples marked in `known` are
    /// skipped.
    fn held(&self, values: &[f64], u: f64, known: &[bool]) -> Held {
        let counts = |sample: usize| self.is_moving[sample] && !known.get(sample).is_some_and(|&known| known);
        let longest = (LONGEST_HOLD_S / self.recording.median_step_s().max(1e-9)).round() as usize;
        let (mut lengths, mut held) = (Vec::new(), 0);
        for run in runs(values).filter(|run| run.len() <= longest) {
            let jump = values.get(run.end).map_or(0.0, |next| (next - values[run.start]).abs());
            if run.len() > 1 && jump > 0.0 && jump >= 3.0 * u && counts(run.start) {
                held += run.len();
                lengths.extend(std::iter::repeat_n(run.len(), run.len()));
            }
        }
        lengths.sort_unstable();
        let all = (0..values.len()).filter(|&sample| counts(sample)).count();
        Held {
            share: (held as f64 / all.max(1) as f64).min(1.0),
            time_s: lengths.get(lengths.len() / 2).map_or(0.0, |&length| length as f64)
                * self.recording.median_step_s(),
        }
    }

    fn held_torque(&self, values: &[f64], known: &[bool]) -> Held {
        self.held(values, step(values), known)
    }

    fn finish(mut self, reach_s: f64) -> Screened {
        let at_limit: Vec<bool> = (0..self.recording.time_s.len())
            .map(|k| self.limits.iter().any(|limit| limit.is_at[k]))
            .collect();
        self.find_frozen_torque(&at_limit);
        let known: Vec<bool> =
            self.is_frozen.iter().zip(&at_limit).map(|(&frozen, &at)| frozen || at).collect();
        let mut findings = self.columns(&known);
        findings.extend(self.zero_rows());
        let is_held = findings.iter().any(|finding| finding.name == HELD && finding.refuses);
        let spans = if is_held { Vec::new() } else { self.spans(&at_limit) };
        let lost = lost_share(self.recording, &spans, reach_s);
        let excluded = Excluded { lost: (!is_held).then_some(lost), refuses: lost > LARGEST_LOSS };
        findings.extend(self.limits.iter().map(|limit| self.saturated(limit, &excluded)));
        findings.extend(self.frozen(&excluded));
        Screened { findings, spans }
    }

    fn finding(&self, name: &'static str, joint: Option<usize>, text: String) -> SampleFinding {
        let file = self.recording.file.display().to_string();
        let joint = joint.map(|joint| joint + 1);
        SampleFinding { name, file, joint, unit: "s", text, ..SampleFinding::default() }
    }

    /// Columns that repeat their values, and those with coarse steps.
    fn columns(&self, known: &[bool]) -> Vec<SampleFinding> {
        let mut findings = Vec::new();
        for (joint, series) in self.recording.joints.iter().enumerate() {
            let columns = [
                (&series.torque_nm, step(&series.torque_nm), "tau", "Nm", HELD_TORQUE),
                (&series.position_rad, self.angle_steps[joint], "q", "rad", HELD_ANGLE),
            ];
            for (values, u, symbol, unit, limit) in columns {
                let name = format!("{symbol}{}_{unit}", joint + 1);
                let held = self.held(values, u, known);
                if held.share > limit {
                    let text = format!(
                        "{name} repeats its values: {:.0} % of the samples are held, for {:.1} ms each. On average they \
                         are {:.1} ms late: record every value when it is measured",
                        100.0 * held.share,
                        1e3 * held.time_s,
                        0.5e3 * held.time_s
                    );
                    findings.push(SampleFinding {
                        value: held.time_s,
                        share: held.share,
                        refuses: held.time_s > HARMLESS_HOLD_S,
                        ..self.finding(HELD, Some(joint), text)
                    });
                }
                if let Some(finding) = coarse(values, &name, unit) {
                    let file = self.recording.file.display().to_string();
                    findings.push(SampleFinding { file, joint: Some(joint + 1), ..finding });
                }
            }
        }
        findings
    }

    fn saturated(&self, limit: &Limit, excluded: &Excluded) -> SampleFinding {
        let share = count(&limit.is_at) / self.recording.time_s.len().max(1) as f64;
        let text = format!(
            "tau{}_Nm ends at a limit of {:.4} N m, where {:.1} % of the samples lie, first at {}{}",
            limit.joint + 1,
            limit.limit_nm,
            100.0 * share,
            self.first(&limit.is_at),
            excluded.words("record with a larger range of the torque, or a calmer motion")
        );
        SampleFinding {
            value: limit.limit_nm,
            unit: "N m",
            share,
            refuses: excluded.refuses,
            ..self.finding(SATURATION, Some(limit.joint), text)
        }
    }

    /// Rows without any angle and torque between rows with some, into which the leg cannot have moved.
    fn zero_rows(&self) -> Option<SampleFinding> {
        let is_zero = |row: usize| {
            let joints = &self.recording.joints;
            joints.iter().all(|joint| joint.position_rad[row] == 0.0 && joint.torque_nm[row] == 0.0)
        };
        let rows: Vec<bool> = (0..self.recording.time_s.len()).map(is_zero).collect();
        let is_apart = |run: &Range<usize>| {
            let (Some(before), true) = (run.start.checked_sub(1), run.end < rows.len()) else { return false };
            let from_zero = |joint: &JointSeries| {
                let [before, after] = [before, run.end].map(|row| joint.position_rad[row]);
                before * after > 0.0 && before.abs().min(after.abs()) > JUMP_RAD
            };
            rows[run.start] && run.len() <= LONGEST_GAP && self.recording.joints.iter().any(from_zero)
        };
        let gaps: Vec<Range<usize>> = runs(&rows).filter(is_apart).collect();
        let first = gaps.first().filter(|_| gaps.len() >= LEAST_GAPS)?;
        let share = gaps.iter().map(Range::len).sum::<usize>() as f64 / rows.len() as f64;
        let time_s = self.recording.time_s[first.start];
        let text = format!(
            "{:.2} % of the rows are zero in every column between rows that are not, first at {time_s:.3} s: does another \
             program publish on the same topic, or are messages lost? Remove these rows",
            100.0 * share
        );
        let finding = self.finding(ZERO_ROWS, None, text);
        Some(SampleFinding { value: time_s, share, refuses: share > LARGEST_ZERO_SHARE, ..finding })
    }

    /// Stretches in which a column is constant while the leg moves.
    fn frozen(&self, excluded: &Excluded) -> Option<SampleFinding> {
        let share = count(&self.is_frozen) / self.recording.time_s.len().max(1) as f64;
        let frozen_s = share * self.recording.duration_s();
        let text = format!(
            "columns are constant for {frozen_s:.2} s in all while the leg moves, first at {}{}",
            self.first(&self.is_frozen),
            excluded.words("the recorder loses samples")
        );
        let finding = self.finding(HELD, None, text);
        (frozen_s > 0.0).then_some(SampleFinding {
            value: frozen_s,
            share,
            refuses: excluded.refuses,
            ..finding
        })
    }

    /// Time of the first marked sample, in words.
    fn first(&self, is_marked: &[bool]) -> String {
        let sample = is_marked.iter().position(|&is_marked| is_marked).unwrap_or(0);
        format!("{:.3} s", self.recording.time_s.get(sample).copied().unwrap_or(0.0))
    }

    /// Marks constant stretches of torque where the column is noisy and not at its limit.
    fn find_frozen_torque(&mut self, at_limit: &[bool]) {
        for joint in 0..self.recording.joints.len() {
            let values = &self.recording.joints[joint].torque_nm;
            if !is_noisy(values) || self.held_torque(values, at_limit).share > HELD_TORQUE {
                continue;
            }
            for run in frozen_runs(self.recording, values) {
                let known = run.clone().filter(|&sample| at_limit[sample]).count();
                if 2 * known < run.len() && run.clone().any(|sample| self.is_moving[sample]) {
                    self.is_frozen[run].fill(true);
                }
            }
        }
    }

    /// Times to be excluded: frozen stretches unchanged, saturated ones widened.
    fn spans(&self, at_limit: &[bool]) -> Vec<Range<f64>> {
        let time = &self.recording.time_s;
        let mut spans: Vec<Range<f64>> = Vec::new();
        for (marks, wider) in [(at_limit, WIDENED_S), (&self.is_frozen[..], 0.0)] {
            for run in runs(marks).filter(|run| marks[run.start]) {
                // The sample after a run is measured again; values between both are interpolated.
                let end = time[run.end.min(time.len() - 1)];
                spans.push(time[run.start] - wider..end + wider);
            }
        }
        spans.sort_by(|one, other| one.start.total_cmp(&other.start));
        let mut joined: Vec<Range<f64>> = Vec::new();
        for span in spans {
            match joined.last_mut() {
                Some(last) if span.start <= last.end + JOINED_S => last.end = last.end.max(span.end),
                _ => joined.push(span),
            }
        }
        joined
    }
}

struct Held {
    share: f64,
    time_s: f64,
}

/// Stretches that are excluded from a recording.
struct Excluded {
    /// Share of the recording that is lost with them; `None` if held columns refuse it anyway.
    lost: Option<f64>,
    refuses: bool,
}

impl Excluded {
    /// What becomes of the stretches, in words; `advice` where too much is lost.
    fn words(&self, advice: &str) -> String {
        match self.lost.map(|lost| 100.0 * lost) {
            None => String::new(),
            Some(lost) if self.refuses => {
                format!(
                    ". {lost:.0} % of the recording would be lost, limit {:.0} %: {advice}",
                    100.0 * LARGEST_LOSS
                )
            }
            Some(lost) => format!(". These stretches are excluded, {lost:.1} % of the recording"),
        }
    }
}

fn count(is_marked: &[bool]) -> f64 {
    is_marked.iter().filter(|&&is_marked| is_marked).count() as f64
}

/// Share of a recording that is lost by excluded spans and by windows that need `reach_s` on either side.
fn lost_share(recording: &Recording, spans: &[Range<f64>], reach_s: f64) -> f64 {
    let (Some(&first), Some(&last)) = (recording.time_s.first(), recording.time_s.last()) else { return 0.0 };
    if spans.is_empty() {
        return 0.0;
    }
    let starts = std::iter::once(first).chain(spans.iter().map(|span| span.end));
    let ends = spans.iter().map(|span| span.start).chain(std::iter::once(last));
    let left: f64 = starts.zip(ends).map(|(start, end)| (end - start - 2.0 * reach_s).max(0.0)).sum();
    1.0 - left / (last - first - 2.0 * reach_s).max(1e-9)
}

/// Column with coarse steps; file and joint are added by the caller.
fn coarse(values: &[f64], column: &str, unit: &'static str) -> Option<SampleFinding> {
    let u = step(values);
    let (low, high) = range(values);
    let changes = changes(values);
    // Steps of a sensor are equal; those of a continuous signal are not.
    let single = changes.iter().filter(|&&change| (change - u).abs() < 0.01 * u).count();
    let is_coarse = if unit == "rad" { u >= COARSE_RAD } else { u > COARSE_SHARE * (high - low) };
    (is_coarse && 4 * single > changes.len()).then(|| SampleFinding {
        name: QUANTISED,
        value: u,
        unit: if unit == "rad" { "rad" } else { "N m" },
        share: 1.0,
        text: format!("{column} has steps of {u:.3e}: a coarse sensor"),
        ..SampleFinding::default()
    })
}

/// Finds limits of the torque that only all recordings together show.
fn find_common_limits(examinations: &mut [Examination]) {
    let joints = examinations.iter().map(|examination| examination.recording.joints.len()).min().unwrap_or(0);
    let usable: Vec<Vec<bool>> = examinations.iter().map(Examination::usable).collect();
    for joint in 0..joints {
        let is_held = |examination: &Examination| {
            examination.held_torque(&examination.recording.joints[joint].torque_nm, &[]).share > HELD_TORQUE
        };
        if examinations.iter().any(is_held) {
            continue;
        }
        let parts: Vec<Part> = examinations
            .iter()
            .zip(&usable)
            .map(|(examination, usable)| Part {
                values: &examination.recording.joints[joint].torque_nm,
                usable,
                rate_hz: examination.rate_hz(),
            })
            .collect();
        for upper in [true, false] {
            let Some((limit_nm, at)) = limit(&parts, upper) else { continue };
            for (examination, is_at) in examinations.iter_mut().zip(at) {
                let is_known =
                    examination.limits.iter().any(|limit| limit.joint == joint && limit.upper == upper);
                if !is_known && is_at.contains(&true) {
                    examination.limits.push(Limit { joint, upper, limit_nm, is_at });
                }
            }
        }
    }
}

/// One column of torques.
#[derive(Clone, Copy)]
struct Part<'a> {
    values: &'a [f64],
    usable: &'a [bool],
    rate_hz: f64,
}

/// Limit at the upper or lower end of the torques, and the samples of each part that lie at it.
fn limit(parts: &[Part], upper: bool) -> Option<(f64, Vec<Vec<bool>>)> {
    let sign = if upper { 1.0 } else { -1.0 };
    let (low, high) = parts
        .iter()
        .map(|part| range(part.values))
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), (lower, higher)| {
            (low.min(lower), high.max(higher))
        });
    let (range, top) = (high - low, if upper { high } else { -low });
    if !(range > 0.0) {
        return None;
    }
    let u = parts.iter().map(|part| step(part.values)).fold(f64::INFINITY, f64::min);
    let band = (BAND * range).max(0.99 * u);
    // Distance of one sample below the limit.
    let below = |part: &Part, sample: usize| top - sign * part.values[sample];
    // Samples at the limit, moving or not; those that count are usable as well.
    let at: Vec<Vec<bool>> =
        parts.iter().map(|part| within_band(part.values.len(), band, |sample| below(part, sample))).collect();
    let near: Vec<Vec<bool>> = parts
        .iter()
        .zip(&at)
        .map(|(part, at)| at.iter().zip(part.usable).map(|(&at, &usable)| at && usable).collect())
        .collect();
    let all = || parts.iter().zip(&near);
    let count = |test: &dyn Fn(&Part, &Vec<bool>, usize) -> bool| -> usize {
        all().map(|(part, near)| (0..near.len()).filter(|&sample| test(part, near, sample)).count()).sum()
    };
    let within = count(&|_, near, sample| near[sample]);
    if within < LEAST_AT_LIMIT {
        return None;
    }
    let equal = count(&|part, near, sample| near[sample] && below(part, sample) <= 0.0);
    let next =
        count(&|part, _, sample| part.usable[sample] && (band..2.0 * band).contains(&below(part, sample)));
    let longest = all()
        .flat_map(|(part, near)| {
            let top: Vec<bool> =
                (0..near.len()).map(|sample| near[sample] && below(part, sample) <= 0.0).collect();
            runs(&top).filter(|run| top[run.start]).map(|run| run.len()).collect::<Vec<_>>()
        })
        .max()
        .unwrap_or(0);
    let others = if u < band { within - equal } else { next };
    let repeats = count(&|part, near, sample| {
        sample > 0 && part.usable[sample] && !near[sample] && part.values[sample] == part.values[sample - 1]
    });
    let apart = count(&|part, near, sample| part.usable[sample] && !near[sample]);
    let is_exact = equal >= LEAST_AT_LIMIT
        && longest >= 3
        && (50 * repeats < apart
            || (u <= 0.4 * band && equal >= 3 * (others + 1))
            || equal >= 6 * (others + 1));
    let slowest = parts.iter().map(|part| part.rate_hz).fold(f64::INFINITY, f64::min);
    let ratio = if slowest >= 200.0 { 3 } else { 6 };
    let is_flat = within >= ratio * (next + 1) && is_flattened(parts, &near, range);
    (is_exact || is_flat).then_some((sign * top, at))
}

/// Samples within `band` of an extreme, from which each is so far `below`; without outliers, which have no
/// neighbour within ten bands.
fn within_band(samples: usize, band: f64, below: impl Fn(usize) -> f64) -> Vec<bool> {
    let close =
        |sample: Option<usize>| sample.is_some_and(|sample| sample < samples && below(sample) < 10.0 * band);
    (0..samples)
        .map(|sample| below(sample) < band && (close(sample.checked_sub(1)) || close(Some(sample + 1))))
        .collect()
}

/// Whether the samples `near` a limit are far less noisy than the others: a filter has flattened them.
fn is_flattened(parts: &[Part], near: &[Vec<bool>], range: f64) -> bool {
    let roughness = |inside: bool| {
        let rough: Vec<f64> = parts
            .iter()
            .zip(near)
            .flat_map(|(part, near)| {
                (3..near.len())
                    .filter(move |&last| (last - 3..=last).all(|k| part.usable[k] && near[k] == inside))
                    .map(move |last| third_difference(&part.values[last - 3..=last]))
            })
            .collect();
        (rough.len() >= 8).then(|| quantile(rough, 0.5))
    };
    match (roughness(true), roughness(false)) {
        (Some(inside), Some(outside)) => inside < 0.3 * outside && outside > NOISY * range,
        _ => false,
    }
}

/// Third difference, as a share of the range, from which a column counts as noisy.
const NOISY: f64 = 5e-4;

fn third_difference(values: &[f64]) -> f64 {
    match values {
        [a, b, c, d] => (d - 3.0 * c + 3.0 * b - a).abs(),
        _ => 0.0,
    }
}

/// Whether neighbouring samples differ by noise. False for a coarse column that rarely changes.
fn is_noisy(values: &[f64]) -> bool {
    let (low, high) = range(values);
    let repeated =
        runs(values).filter(|run| run.len() < FROZEN_SAMPLES).map(|run| run.len() - 1).sum::<usize>();
    let rough = values.windows(4).map(third_difference).collect();
    // NaN of a short column is not above.
    20 * repeated < values.len() && quantile(rough, 0.5) > NOISY * (high - low)
}

/// Samples on either side over which a speed is measured.
fn half_window(recording: &Recording) -> usize {
    ((MOVING_S / recording.median_step_s().max(1e-9)).round() as usize).max(1)
}

/// Samples in which some joint moves.
fn moving(recording: &Recording, steps: &[f64]) -> Vec<bool> {
    let time = &recording.time_s;
    let half = half_window(recording);
    (0..time.len())
        .map(|sample| {
            let (before, after) = (sample.saturating_sub(half), (sample + half).min(time.len() - 1));
            recording.joints.iter().zip(steps).any(|(joint, &u)| {
                let travel = (joint.position_rad[after] - joint.position_rad[before]).abs();
                travel > (MOVING_RADPS * (time[after] - time[before])).max(2.5 * u)
            })
        })
        .collect()
}

/// Runs of unchanged values that are long enough to count as frozen.
fn frozen_runs<'a>(recording: &Recording, values: &'a [f64]) -> impl Iterator<Item = Range<usize>> + use<'a> {
    let least = (FROZEN_S / recording.median_step_s().max(1e-9)).round() as usize;
    runs(values).filter(move |run| run.len() >= least.max(FROZEN_SAMPLES))
}

/// Whether an angle jumps after a run by far more than its next step: then the joint moved during the run.
fn ends_in_jump(values: &[f64], run: &Range<usize>, u: f64) -> bool {
    let (Some(after), Some(next)) = (values.get(run.end), values.get(run.end + 1)) else { return false };
    let jump = (after - values[run.start]).abs();
    jump > 0.0 && jump >= 5.0 * u && jump >= 3.0 * (next - after).abs()
}

/// Runs of equal values.
pub(super) fn runs<T: PartialEq>(values: &[T]) -> impl Iterator<Item = Range<usize>> + use<'_, T> {
    let mut start = 0;
    std::iter::from_fn(move || {
        let value = values.get(start)?;
        let length = values[start..].iter().take_while(|&other| other == value).count();
        let run = start..start + length;
        start = run.end;
        Some(run)
    })
}

fn range(values: &[f64]) -> (f64, f64) {
    values
        .iter()
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), &value| (low.min(value), high.max(value)))
}

/// Changes between neighbouring samples, in ascending order, without zeros.
fn changes(values: &[f64]) -> Vec<f64> {
    let mut changes: Vec<f64> =
        values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|&change| change > 0.0).collect();
    changes.sort_by(f64::total_cmp);
    changes
}

/// Step of a column: the sensor's last bit, or less than its typical change.
pub(super) fn step(values: &[f64]) -> f64 {
    let changes = changes(values);
    changes.get(changes.len() / 20).copied().unwrap_or(0.0)
}

/// Step between the levels of a column, which are its repeated values: the sensor's last bit. Interpolation
/// to another clock, which leaves fractions of a bit, does not change it. Zero with few levels, and where the
/// levels are not whole steps apart: an exact angle repeats its values wherever the joint rests.
fn level_step(values: &[f64]) -> f64 {
    let levels: Vec<f64> = runs(values).filter(|run| run.len() > 1).map(|run| values[run.start]).collect();
    if levels.len() < LEAST_LEVELS {
        return 0.0;
    }
    let u = step(&levels);
    let changes = changes(&levels);
    let whole =
        changes.iter().filter(|&&change| (change / u - (change / u).round()).abs() < WHOLE_STEP).count();
    if 2 * whole > changes.len() { u } else { 0.0 }
}

#[cfg(test)]
mod tests;
