//! Known masses in recordings: a load that is subtracted, and a mass that determines the scale of the
//! torques.
//!
//! A load is subtracted from the rows of the identification, as on the drive ([`crate::run::scale`]). The
//! checks of the logging chain leave it in: their sigma and directions do not depend on a constant part of
//! the parameters. A mass in a second set of recordings determines recorded over true torque
//! ([`scarab::ident::torque_constant_ratio`]). All torques are divided by that ratio first.

use scarab::ident::{Record, Solver, torque_constant_ratio};
use scarab::model::Payload;
use scarab_base::error::ToolError;

use super::read::{Parts, parts};
use super::rows::{Samples, feed, new_recorder};
use super::{Recordings, ReplayOptions};
use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::anatomy;
use crate::formats::recording::Read;
use crate::leg::additional_torque::Additional;
use crate::leg::background::Background;
use crate::report::reading::ReadReport;
use crate::run::replay::screening::refuse_copies;
use crate::run::scale::{Scale, base_of};

/// Solves a record up to the choice of its columns.
pub(super) fn settled<const N: usize, const B: usize>(
    background: &Background<N, B>,
    record: Record<f32, N, B>,
    options: &ReplayOptions,
) -> Solver<f32, N, B> {
    let prior = background.prior.map(|prior| prior.map(|link| link.convert()));
    let mut solver =
        Solver::new(&background.device, record, options.plan, prior.as_ref(), options.swarm_seed);
    while !solver.is_selected() {
        solver.advance(&background.device, 1);
    }
    solver
}

/// Scale of the torques, and the recordings with the mass.
pub(super) struct Found<const N: usize, const B: usize> {
    pub(crate) scale: Scale<N, B>,
    /// How the recordings with the mass were read.
    pub(crate) read: Vec<ReadReport>,
    pub(crate) warnings: Vec<String>,
}

/// Scale of the torques from the recordings with the mass and those without it.
pub(super) fn scale<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
    payload: &Payload<f64>,
) -> Result<Found<N, B>, ToolError> {
    let recording = |reads: &[Read]| reads.iter().map(|read| read.recording.clone()).collect::<Vec<_>>();
    let with = Recordings { training: recordings.with_payload.clone(), ..Recordings::default() };
    refuse_copies(&recording(&recordings.training), &recording(&with.training), "--with-payload")?;
    let read = with.training.iter().map(|read| read.report.clone()).collect();
    let (without, _) = record(leg, background, recordings, options)?;
    let (with, warnings) = record(leg, background, &with, &ReplayOptions { split: None, ..options.clone() })?;
    let base = base_of(background, payload);
    let scale = Scale {
        payload: Some(*payload),
        ratios: core::array::from_fn(|joint| torque_constant_ratio(&without, &with, joint, &base)),
        load: options.load,
        load_base: load_base(background, options),
    };
    Ok(Found { scale, read, warnings })
}

/// Base parameters of the load; zero without one.
pub(super) fn load_base<const N: usize, const B: usize>(
    background: &Background<N, B>,
    options: &ReplayOptions,
) -> [f32; B] {
    options.load.as_ref().map_or([0.0; B], |load| base_of(background, load))
}

/// Record of the unchanged training recordings, and their warnings.
fn record<const N: usize, const B: usize>(
    leg: &LegFile,
    background: &Background<N, B>,
    recordings: &Recordings,
    options: &ReplayOptions,
) -> Result<(Record<f32, N, B>, Vec<String>), ToolError> {
    let anatomy = anatomy::<N>(leg)?;
    let Parts { training, screening, read, .. } =
        parts(recordings, options, leg, &[1.0; N], &Additional::default())?;
    let mut recorder = Box::new(new_recorder::<N, B>(options.bandwidth_hz)?);
    recorder.set_estimator(options.estimator);
    let samples: Vec<Samples<N>> =
        training.iter().map(|recording| Samples::new(recording, &anatomy, options, &screening)).collect();
    feed(&mut recorder, background, &samples, "training", |_, _, _| {});
    let of_files = read.into_iter().filter_map(|read| read.warning);
    let warnings = of_files.chain(samples.iter().filter_map(Samples::warning)).collect();
    Ok((settled(background, recorder.finish(), options).record().clone(), warnings))
}
