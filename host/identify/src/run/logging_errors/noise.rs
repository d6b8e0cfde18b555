//! Noise of the torque at a recording's own rate, from its own scatter.
//!
//! ```text
//! m       samples to a bin, so that a bin lasts 1 / (8 bandwidth)
//! y_k,t_k means of torque and time over bin k
//! d_k     third divided difference over four neighbouring bins = sum_i w_i y_i
//! sigma   = median |d_k| / sqrt(sum_i w_i^2 / m) / 0.674490      of one sample; D = sigma^2 dt its density
//! ```
//!
//! Divided differences hold for any time stamps, the density for any rate between 50 Hz and 20 kHz. The bins
//! see noise up to four times the bandwidth: all that the low-pass passes, and little of the band that a
//! recorder's own filter removed. Limits: a motion at half the bandwidth leaves 1.3 % of its amplitude; the
//! density of noise that is not white is wrong.

use scarab_base::stats::quantile;

/// Median of the absolute value of a standard normal number.
const NORMAL_MEDIAN: f64 = 0.674_490;
/// Least number of differences for an estimate.
const FEWEST: usize = 20;

/// Scatter of one file's torque in units of sqrt(density), one number for each difference.
pub(crate) fn scatter(time_s: &[f64], torque: &[f64], bandwidth_hz: f64) -> Vec<f64> {
    let samples = time_s.len().min(torque.len());
    if samples < 8 {
        return Vec::new();
    }
    let step = (time_s[samples - 1] - time_s[0]) / (samples - 1) as f64;
    let count = (1.0 / (8.0 * bandwidth_hz * step)).round().max(1.0) as usize;
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let bins: Vec<(f64, f64)> =
        time_s.chunks_exact(count).zip(torque.chunks_exact(count)).map(|(t, y)| (mean(t), mean(y))).collect();
    let difference = |four: &[(f64, f64)]| {
        let (mut sum, mut power) = (0.0, 0.0);
        for (index, (time, value)) in four.iter().enumerate() {
            let others = four.iter().enumerate().filter(|(other, _)| *other != index);
            let weight: f64 = others.map(|(_, (other, _))| 1.0 / (time - other)).product();
            sum += weight * value;
            power += weight * weight / count as f64;
        }
        (sum / power.sqrt()).abs() * step.sqrt()
    };
    bins.windows(4).map(difference).filter(|value| value.is_finite()).collect()
}

/// Density of the noise, (N m)^2 s, from the scatter of all files; `None` with too few differences.
pub(crate) fn density(scatter: Vec<f64>) -> Option<f64> {
    (scatter.len() >= FEWEST).then(|| (quantile(scatter, 0.5) / NORMAL_MEDIAN).powi(2))
}

#[cfg(test)]
mod tests {
    use super::*;
    use scarab_base::random::Random;

    #[test]
    fn the_density_is_the_same_at_any_rate_and_with_uneven_stamps() {
        // White noise of density 1e-3 (N m)^2 s under a motion of 1 Hz; 20 s give 1,280 differences, whose
        // median scatters by 4 %.
        for (rate_hz, jitter) in [(64.0_f64, 0.0), (100.0, 0.3), (500.0, 0.4), (1000.0, 0.0), (20_000.0, 0.4)]
        {
            let mut random = Random::new("", 3);
            let sigma = (1e-3_f64 * rate_hz).sqrt();
            let (mut times, mut torques) = (Vec::new(), Vec::new());
            for sample in 0..(20.0 * rate_hz) as u32 {
                let time = (f64::from(sample) + jitter * random.uniform(-0.5, 0.5)) / rate_hz;
                times.push(time);
                torques.push(20.0 * (std::f64::consts::TAU * time).sin() + sigma * random.normal());
            }
            let found = density(scatter(&times, &torques, 8.0)).expect("enough");
            assert!((found / 1e-3 - 1.0).abs() < 0.2, "{rate_hz} Hz: {found}");
        }
    }

    #[test]
    fn a_short_recording_has_no_density() {
        assert_eq!(density(scatter(&[0.0, 0.1, 0.2], &[1.0; 3], 8.0)), None);
    }
}
