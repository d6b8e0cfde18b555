//! Identification of a simulated pair up to its verdict.

use hal_sim::world::TICK_S;
use scarab::leg::{Activity, ControlRequest};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::pair::{Context, Pair};

/// Limit of an identification, which takes 53 s.
const LONGEST_IDENTIFICATION_S: f64 = 300.0;

/// Enables and identifies a resting pair. The inner `Err` holds the reasons of a refused result.
///
/// # Errors
/// The drive cannot be enabled, stops, or takes too long.
pub fn identify<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    pair: &mut Pair<N, B>,
) -> Result<Result<(), Vec<&'static str>>, ToolError> {
    if !pair.enable(context.gravity) {
        return Err(leg.error("the drive refused to be enabled at the start").into());
    }
    let mut request = Some(ControlRequest::Identify);
    while pair.leg.control().verdict().is_none() {
        pair.tick(request.take(), context.gravity);
        let identifying = matches!(pair.leg.control().activity(), Activity::Identify(_));
        let is_late = pair.ticks > (LONGEST_IDENTIFICATION_S / TICK_S) as u64;
        if is_late || (!identifying && pair.leg.control().verdict().is_none()) {
            return Err(leg.error(pair.stop_words(leg)).into());
        }
    }
    let reasons = pair.leg.control().verdict().into_iter().flat_map(|verdict| verdict.reasons());
    let reasons: Vec<_> = reasons.map(scarab::ident::Reason::name).collect();
    Ok(if pair.leg.control().model().is_some() { Ok(()) } else { Err(reasons) })
}
