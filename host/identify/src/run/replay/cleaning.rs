//! Replaces outliers of a recording at its own rate: resampling would smear each over its neighbours.
//!
//! The filter is the board's ([`scarab::ident::signal::hampel`]). Two cases occur in recordings only:
//!
//! - Recordings slower than [`SPARSEST_HZ`]: vibrations of the machine are as fast as its samples, and
//!   neighbours do not predict them. In a correct recording at 200 Hz 2 to 3 % would count as outliers. There
//!   only the filter after resampling is used.
//! - Coarse sensors: a last bit that flickers at rest is not an outlier. Deviations within [`QUANTA`] steps
//!   of the sensor stay.

use scarab::ident::signal::hampel::{Cleaned, Hampel, Quantity};

use crate::formats::recording::Recording;

/// Rate from which neighbours predict a sample: four of them then span 10 ms.
const SPARSEST_HZ: f64 = 400.0;
/// Steps of the sensor within which no sample is an outlier.
const QUANTA: f64 = 2.0;

/// Recording without its isolated outliers, and their number for each joint.
pub(super) fn cleaned<const N: usize>(recording: &Recording) -> (Recording, [u32; N]) {
    let (mut clean, mut replaced) = (recording.clone(), [0; N]);
    if !(recording.median_step_s() * SPARSEST_HZ <= 1.0) {
        return (clean, replaced);
    }
    for (series, count) in clean.joints.iter_mut().zip(&mut replaced) {
        *count += clean_series(&mut series.position_rad, Quantity::Angle);
        *count += clean_series(&mut series.torque_nm, Quantity::Torque);
    }
    (clean, replaced)
}

fn clean_series(values: &mut [f64], quantity: Quantity) -> u32 {
    let harmless = QUANTA * quantum(values);
    let mut filter = Hampel::<f64>::new(quantity);
    let mut cleaned: Vec<Cleaned<f64>> = values.iter().filter_map(|&value| filter.push(value)).collect();
    while let Some(last) = filter.finish() {
        cleaned.push(last);
    }
    let mut replaced = 0;
    for (value, cleaned) in values.iter_mut().zip(&cleaned) {
        if cleaned.outlier && (*value - cleaned.value).abs() > harmless {
            *value = cleaned.value;
            replaced += 1;
        }
    }
    replaced
}

/// Smallest step between two different samples: the sensor's last bit, or less than any noise.
fn quantum(values: &[f64]) -> f64 {
    let steps = values.windows(2).map(|pair| (pair[1] - pair[0]).abs()).filter(|&step| step > 0.0);
    let smallest = steps.fold(f64::INFINITY, f64::min);
    if smallest.is_finite() { smallest } else { 0.0 }
}
