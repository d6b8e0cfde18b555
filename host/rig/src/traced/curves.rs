//! The log of a trace as curves, for figures: measured and predicted torque, residuals.
//!
//! The reported identification's samples pass the filter chain once more, as in a simulated run. A motion
//! with a missing sample is not drawn, because the filter would join separate samples.

use scarab::ident::no_stribeck;
use scarab::model::Parameter;
use scarab::model::friction::Stribeck;
use scarab::servo::TICKS_PER_LOG;
use scarab_base::error::ToolError;
use scarab_base::names::VALIDATION_NAMES;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::formats::leg_file::geometry::anatomy;
use scarab_identify::report::series::{Reader, Role, Series};
use scarab_identify::with_leg_size;

use crate::pair::{PENDING, TAPS};
use crate::trace::read::Trace;
use crate::trace::records::Log;
use crate::trace::result_records::ResultRecords;
use crate::traced::report::{TracedResult, known};

/// Curves of the last complete result; empty where no motion was logged.
///
/// # Errors
/// The result belongs to another leg.
pub fn curves(trace: &Trace, leg: &LegFile) -> Result<Series, ToolError> {
    let Some(records) = trace.results.last() else { return Ok(Series::default()) };
    with_leg_size!(leg, of_size(trace, records, leg))
}

fn of_size<const N: usize, const B: usize>(
    trace: &Trace,
    records: &ResultRecords,
    leg: &LegFile,
) -> Result<Series, ToolError> {
    let mut background = known::<N, B>(records, leg)?;
    let Some(solver) = &records.solver else { return Ok(Series::default()) };
    let (estimate, _) = TracedResult { background: &background, leg, records }.base(solver)?;
    let mut stribeck = no_stribeck();
    for found in records.stribeck.iter().filter(|found| (1..=N).contains(&found.joint)) {
        let coulomb = background.device.drive(found.joint - 1, Parameter::FC);
        let coulomb = coulomb.map_or(0.0, |base| estimate.values[base]);
        if coulomb > 0.0 {
            let excess = (found.surplus_nm / coulomb).max(0.0);
            stribeck[found.joint - 1] = Stribeck { excess, velocity: found.speed_rad_s };
        }
    }
    background.device.stribeck = stribeck;
    let mut reader = Reader::<N, B, TAPS, PENDING>::new(
        &background.device,
        anatomy(leg)?,
        estimate.values,
        leg.bandwidth_hz as f32,
    )
    .map_err(|error| ToolError::input(format!("the filter does not fit the device: {error:?}")))?;
    let of_result = trace.log.iter().filter(|(results, _)| results + 1 == trace.results.len());
    let samples: Vec<&Log> =
        of_result.map(|(_, sample)| sample).filter(|sample| sample.counts.len() == N).collect();
    let parts = samples.chunk_by(|before, after| {
        (before.segment == after.segment, before.motion == after.motion, after.tick > before.tick)
            == (true, true, true)
    });
    let whole = parts.filter(|part| part.windows(2).all(|pair| pair[1].tick - pair[0].tick == TICKS_PER_LOG));
    let mut motions = Vec::new();
    for part in whole {
        let (name, role) = match (part[0].segment.as_str(), part[0].motion) {
            ("training", _) => ("excitation", Role::Training),
            ("validation", motion) => {
                let name = motion.checked_sub(1).and_then(|motion| VALIDATION_NAMES.get(motion));
                (name.copied().unwrap_or("validation"), Role::Validation)
            }
            _ => continue,
        };
        let array = |list: &[f32]| core::array::from_fn(|joint| list[joint]);
        let samples = part.iter().map(|sample| (array(&sample.position_rad), array(&sample.torque_nm)));
        motions.push(reader.motion(name, role, 0.0, samples));
    }
    let fits = records.fits.iter().filter(|fit| fit.motion == 0);
    // The noise of filtered torque is the model's residual on the motion identified from. Its
    // degrees of freedom need no correction: a motion has far more rows than there are parameters.
    let noise_nm = fits.map(|fit| f64::from(fit.rms_nm)).collect();
    Ok(Series { noise_nm, ..reader.of_motions(motions) })
}
