//! Recording that is played back, as a source of a live picture.
//!
//! The verdict is that of `replay` on the same file and split, computed before the first sample is shown, so
//! that bad input is refused at once. Estimates and predictions of the part to identify from are those of the
//! samples played so far; those of the held-out part use the result.

use scarab::ident::SAMPLE_RATE_HZ;
use scarab::leg::Segment;
use scarab::servo::SERVO_RATE_HZ;
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::recording::Recording;
use scarab_identify::report::RunReport;
use scarab_identify::run::progress::{ChainSample, Progress, ProgressOptions, progress};
use scarab_identify::run::replay::{Recordings, ReplayOptions, replay};
use scarab_identify::run::resample::Resampled;

use crate::live::clock::Clock;
use crate::live::picture::{HALF_SAMPLE_S, Picture, scene};
use crate::live::report::{EstimateOrigin, LiveStatus, LiveUpdate, RATE_HZ, Severity};

/// Samples between two looks at the clock.
const SAMPLES_PER_LOOK: usize = (SAMPLE_RATE_HZ as u32 / RATE_HZ) as usize;

/// Plays the first recording of a replay and reports it to `out`; returns the report of the replay.
///
/// # Errors
/// Those of `replay`.
pub(crate) fn play(
    leg: &LegFile,
    recordings: &Recordings,
    options: &ReplayOptions,
    speed: f64,
    out: &dyn Fn(LiveUpdate),
) -> Result<RunReport, ToolError> {
    let none = || ToolError::input("no recording to be played");
    let recording = recordings.training.first().ok_or_else(none)?.recording.clone();
    let replayed = replay(leg, recordings, options)?;
    replayed.warnings.iter().for_each(|warning| eprintln!("warning: {warning}"));
    let report = replayed.run;
    let progress = progress(
        leg,
        &ProgressOptions {
            prior: options.prior,
            seed: options.swarm_seed,
            bandwidth_hz: options.bandwidth_hz,
            estimator: options.estimator,
            plan: options.plan,
            reports_truth: true,
        },
    )?;
    let name = recording.file.file_name().unwrap_or_default().display();
    let source = format!("recording {name}, {:.1} s", recording.duration_s());
    out(LiveUpdate::Scene(scene(leg, source, speed)));
    let picture = Picture::new(leg, out)?.without_currents();
    let mut player = Player { picture, clock: Clock::new(speed), progress, report: &report };
    let first_s = recording.time_s.first().copied().unwrap_or(0.0);
    let (training, held_out) = match options.split {
        Some(share) => {
            let (training, held_out) = recording.split(share)?;
            (training, Some(held_out))
        }
        None => (recording, None),
    };
    player.part(&training, first_s, Segment::Training);
    if let Some(held_out) = &held_out {
        player.use_result();
        player.part(held_out, first_s, Segment::Validation(0));
    }
    player.picture.conclude(&report);
    player.picture.note(Severity::Note, "the source has ended");
    Ok(report)
}

struct Player<'a> {
    picture: Picture<'a>,
    clock: Clock,
    progress: Box<dyn Progress>,
    report: &'a RunReport,
}

impl Player<'_> {
    /// Plays a part; `first_s` is the recording's first time stamp.
    fn part(&mut self, recording: &Recording, first_s: f64, segment: Segment) {
        let grid = Resampled::new(recording);
        self.picture.restart();
        for point in 0..grid.len() {
            let time_s = grid.time_s(point) - first_s;
            let joints = || self.picture.anatomy().iter().zip(&grid.joints);
            let position = joints().map(|(joint, series)| joint.angle_to_chain(series.position_rad[point]));
            let torque = joints().map(|(joint, series)| joint.to_chain(series.torque_nm[point]));
            let logged = ChainSample {
                position_rad: position.map(|angle| angle as f32).collect(),
                torque_nm: torque.map(|torque| torque as f32).collect(),
                segment: Some(segment),
            };
            self.picture.time_s = time_s + HALF_SAMPLE_S;
            self.picture.learn(&logged, &mut *self.progress);
            // Times may be negative by rounding, and a tick is 0.25 ms.
            let ticks = (time_s.max(0.0) * f64::from(SERVO_RATE_HZ)).round() as u64;
            if point % SAMPLES_PER_LOOK == 0 {
                self.status(segment, (grid.len() - point) as f64 / SAMPLE_RATE_HZ);
                self.clock.wait(ticks);
            }
        }
    }

    /// Predicts with the result of the replay from now on.
    fn use_result(&mut self) {
        let report = self.report;
        let value = |name: &str| {
            report
                .base_parameters
                .iter()
                .find(|found| found.name == name)
                .and_then(|found| found.value.known())
        };
        let curves = report.stribeck.iter().filter_map(|found| {
            Some((found.joint - 1, found.surplus_nm.known()?, found.speed_rad_s.known()?))
        });
        self.progress.use_named(&value, &curves.collect::<Vec<_>>());
        self.picture.estimate(
            EstimateOrigin::Candidate,
            self.report.bso.iterations,
            &self.report.base_parameters,
        );
    }

    fn status(&mut self, segment: Segment, left_s: f64) {
        let doing = match segment {
            Segment::Training => "is played back; this part is identified from",
            _ => "is played back; this part is predicted only",
        };
        let status = LiveStatus {
            leg: 0,
            time_s: self.picture.time_s,
            run: 1,
            drive: "unknown in a recording".into(),
            doing: doing.into(),
            waits_for: "the end of this part".into(),
            left_s: left_s.into(),
            not_enabled: String::new(),
            fault: None,
            limits: None,
            speed: self.clock.measured,
            processor: String::new(),
            bus: String::new(),
        };
        self.picture.send(LiveUpdate::Status(status));
    }
}
