//! Examines the recordings before anything is identified: copies, and samples that no sensor measured.

use scarab_base::error::ToolError;
use std::ops::Range;
use std::path::PathBuf;

use crate::formats::leg_file::LegFile;
use crate::formats::recording::Recording;
use crate::report::doubt::SampleFinding;
use crate::run::logging_errors::samples::{self, QUANTISED};
use crate::run::logging_errors::stamps;
use scarab::ident::SAMPLE_RATE_HZ;

/// Reach of the smoothing to each side, in periods of the rows' bandwidth.
const REACH_PERIODS: f64 = 0.983;

/// Findings about the recordings, and their stretches to be excluded.
pub(super) struct Screening {
    /// Everything that was found.
    pub(crate) findings: Vec<SampleFinding>,
    spans: Vec<(PathBuf, Vec<Range<f64>>)>,
}

impl Screening {
    /// Examines whole recordings for rows with this bandwidth.
    pub(super) fn new(recordings: &[&Recording], leg: &LegFile, bandwidth_hz: f64) -> Self {
        let (mut findings, mut spans) = (Vec::new(), Vec::new());
        let described_rad: Vec<f64> = leg.joints.iter().map(|joint| joint.encoder.step_rad()).collect();
        let screened = samples::screen(recordings, &described_rad, REACH_PERIODS / bandwidth_hz);
        for (recording, screened) in recordings.iter().zip(screened) {
            findings.extend(screened.findings);
            findings.extend(stamps::examine(recording, &described_rad, bandwidth_hz));
            spans.push((recording.file.clone(), screened.spans));
        }
        Self { findings, spans }
    }

    /// The findings that do not refuse, in words.
    pub(super) fn warnings(&self) -> impl Iterator<Item = String> {
        let findings = self.findings.iter().filter(|finding| !finding.refuses && finding.name != QUANTISED);
        findings.map(|finding| format!("{}: {}", finding.file, finding.text))
    }

    /// Grid points of a recording, from `start_s` at 500 Hz, that touch an excluded stretch.
    pub(super) fn excluded(&self, recording: &Recording, start_s: f64) -> Vec<Range<usize>> {
        // The interpolation at a point uses two samples on either side.
        let margin_s = 2.0 * recording.median_step_s();
        let spans =
            self.spans.iter().filter(|(file, _)| *file == recording.file).flat_map(|(_, spans)| spans);
        let point = |time_s: f64| ((time_s - start_s) * SAMPLE_RATE_HZ).max(0.0);
        spans
            .map(|span| {
                point(span.start - margin_s).floor() as usize..point(span.end + margin_s).ceil() as usize
            })
            .filter(|points| !points.is_empty())
            .collect()
    }
}

/// Refuses recordings that contain the same samples, whatever their names. The same data twice are not a
/// second measurement, and a training motion proves nothing when it is held out. `option` names the others.
pub(super) fn refuse_copies(
    training: &[Recording],
    others: &[Recording],
    option: &str,
) -> Result<(), ToolError> {
    let twice = |files: &[Recording], option: &str| {
        let pairs = files.iter().enumerate();
        pairs.flat_map(|(index, one)| files[index + 1..].iter().map(move |other| (one, other))).find_map(
            |(one, copy)| {
                (one.joints == copy.joints).then(|| {
                    ToolError::input(format!(
                        "{option}{}: holds the same samples as {}: give every recording once",
                        copy.file.display(),
                        one.file.display()
                    ))
                })
            },
        )
    };
    if let Some(error) = twice(training, "").or_else(|| twice(others, &format!("{option} "))) {
        return Err(error);
    }
    for other in others {
        if let Some(same) = training.iter().find(|training| other.joints == training.joints) {
            let advice = match option {
                "--validate" => "it cannot be held out as well (--split holds out a part)",
                _ => "another recording is needed",
            };
            return Err(ToolError::input(format!(
                "{option} {}: holds the same samples as {}, which is identified from: {advice}",
                other.file.display(),
                same.file.display()
            )));
        }
    }
    Ok(())
}

/// Positions at which a stream of grid points breaks: at another file, and after an excluded stretch.
#[derive(Default)]
pub(super) struct Continuity {
    before: Option<(usize, f64)>,
}

impl Continuity {
    /// Whether this point does not continue the previous one.
    pub(super) fn breaks(&mut self, file: usize, time_s: f64) -> bool {
        let before = self.before.replace((file, time_s));
        before.is_some_and(|(last, last_s)| last != file || time_s - last_s > 1.5 * super::rows::GRID_S)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::formats::recording::JointSeries;

    fn recording(name: &str, values: &[f64]) -> Recording {
        Recording {
            file: name.into(),
            time_s: (0..values.len()).map(|sample| sample as f64 * 0.002).collect(),
            joints: vec![JointSeries { position_rad: values.to_vec(), torque_nm: values.to_vec() }],
            joints_in_file: 1,
        }
    }

    #[test]
    fn points_beside_an_excluded_stretch_are_excluded_as_their_interpolation_sees_it() {
        let recording = recording("a.csv", &[0.0; 100]);
        let screening =
            Screening { findings: Vec::new(), spans: vec![("a.csv".into(), vec![0.1..0.12, 0.0..0.001])] };
        // Two steps of 2 ms on either side: 0.096 s to 0.124 s, and up to 0.005 s.
        assert_eq!(screening.excluded(&recording, 0.0), [48..62, 0..3]);
    }

    #[test]
    fn a_stream_breaks_at_a_file_and_at_a_gap() {
        let mut continuity = Continuity::default();
        let points = [(1, 0.0), (1, 0.002), (1, 0.2), (1, 0.202), (2, 0.204)];
        assert_eq!(
            points.map(|(file, time)| continuity.breaks(file, time)),
            [false, false, true, false, true]
        );
    }
}
