//! Tests of the limit against its theory, on rows that overlap as the filter makes them.

use super::*;

use crate::testing::TestRandom;

const BANDWIDTH: f64 = 16.0;

fn low_pass() -> LowPass<f64, 256> {
    LowPass::new(BANDWIDTH, SAMPLE_RATE_HZ).expect("fits")
}

/// White noise of 500 Hz through the low-pass, one row in ten samples, variance 1.
struct Rows {
    random: TestRandom,
    window: Vec<f64>,
    weights: Vec<f64>,
}

impl Rows {
    fn new(seed: u64) -> Self {
        let low_pass = low_pass();
        let size = real::sqrt(low_pass.energy());
        let weights: Vec<_> = low_pass.weights().iter().map(|weight| weight / size).collect();
        let mut rows = Self { random: TestRandom::new(seed), window: vec![0.0; weights.len()], weights };
        for _ in 0..20 {
            rows.next();
        }
        rows
    }

    fn next(&mut self) -> f64 {
        self.window.drain(..DECIMATION);
        for _ in 0..DECIMATION {
            let value = self.random.normal();
            self.window.push(value);
        }
        self.window.iter().zip(&self.weights).map(|(sample, weight)| sample * weight).sum()
    }
}

fn settings(time: f64, margin: f64, persistence: f64) -> MonitorSettings<f64> {
    MonitorSettings {
        time_between_false_alarms_s: time,
        noise_margin: margin,
        persistence_s: persistence,
        ..MonitorSettings::default()
    }
}

/// Seconds to the alarm; a row's error is noise times `scale` plus `shift`.
fn run_length(settings: &MonitorSettings<f64>, seed: u64, scale: f64, shift: f64) -> f64 {
    let mut monitor = Monitor::<f64, 1>::new(&low_pass(), settings);
    let mut rows = Rows::new(seed);
    for row in 1..2_000_000_u32 {
        let error = rows.next() * scale + shift;
        if monitor.take(&[Some(error * error)]).is_some() {
            return f64::from(row) / ROW_RATE_HZ;
        }
    }
    panic!("no alarm in 11 hours");
}

fn mean(lengths: impl Iterator<Item = f64>) -> f64 {
    let lengths: Vec<_> = lengths.collect();
    lengths.iter().sum::<f64>() / lengths.len() as f64
}

#[test]
fn false_alarms_are_as_rare_as_requested_and_not_much_rarer() {
    // One a minute, so that they can be counted; no clipping, which would make them rarer still.
    let asked = 60.0;
    for margin in [1.0, 1.2] {
        let scale = real::sqrt(margin);
        let settings = settings(asked, margin, 0.0);
        let found = mean((0..60).map(|seed| run_length(&settings, seed, scale, 0.0)));
        println!("margin {margin}: {found} s, asked for {asked} s");
        // The mean of 60 times with an exponential distribution is known to 13 %. Lorden's bound neglects the
        // overshoot and the reflections at zero, together worth a factor of 3 to 10. A bound wrong by the row
        // correlation would be off by a factor of e.
        assert!(found > 0.7 * asked && found < 12.0 * asked, "margin {margin}: {found} s");
    }
}

/// Time to an alarm, s, once a joint that is never at rest has a residual with `energy` times that at
/// acceptance; `None` for an energy that raises no alarm.
fn delay_s(monitor: &Monitor<f64, 1>, energy: f64) -> Option<f64> {
    let step = real::min(monitor.step(energy), monitor.largest_step);
    (step > 0.0).then(|| monitor.limit / step * BLOCK_S)
}

#[test]
fn a_change_is_noticed_after_the_time_that_is_stated() {
    let settings = settings(3600.0, 1.0, 0.0);
    let monitor = Monitor::<f64, 1>::new(&low_pass(), &settings);
    for energy in [2.0, 3.0, 6.0] {
        let stated = delay_s(&monitor, energy).expect("above the silent energy");
        let found = mean((100..130).map(|seed| run_length(&settings, seed, 1.0, real::sqrt(energy - 1.0))));
        // Whole blocks: half a block on average, plus one for the overshoot.
        assert!((found - stated).abs() < 0.15 * stated + 0.75, "{energy}: {found} s, stated {stated} s");
    }
    assert_eq!(delay_s(&monitor, 0.99 * settings.silent_energy()), None);
}

#[test]
fn a_push_is_no_change_however_hard_and_a_load_that_stays_is() {
    let settings = MonitorSettings::default();
    let (mut pushed, mut loaded) =
        (Monitor::<f64, 2>::new(&low_pass(), &settings), Monitor::<f64, 2>::new(&low_pass(), &settings));
    let mut noticed = None;
    for row in 0..180_000_u32 {
        // A push of 0.3 s plus the reach of both filters, every 10 s; it begins anywhere in a block.
        let square = if row % 501 < 35 { 1e6 } else { 1.0 };
        assert_eq!(pushed.take(&[Some(square), Some(1.0)]), None, "row {row}");
        if row >= 1000 && noticed.is_none() {
            noticed = loaded.take(&[Some(1.0), Some(1e6)]).map(|change| (row - 999, change));
        } else if noticed.is_none() {
            assert_eq!(loaded.take(&[Some(1.0), Some(1.0)]), None);
        }
    }
    let (rows, change) = noticed.expect("a load");
    assert_eq!(f64::from(rows) / ROW_RATE_HZ, settings.persistence_s);
    assert_eq!(change.joints, [false, true]);
    // The alarm dates back to the block in which the sum was last zero.
    assert!((change.since_s - settings.persistence_s).abs() <= BLOCK_S);
}

#[test]
fn a_joint_that_stands_still_is_not_counted() {
    let mut monitor = Monitor::<f64, 1>::new(&low_pass(), &MonitorSettings::default());
    for _ in 0..100_000 {
        assert_eq!(monitor.take(&[None]), None);
    }
    assert_eq!(monitor.statistic(), [0.0]);
}

#[test]
fn overlapping_rows_count_for_less() {
    let freedom = block_freedom(low_pass().weights());
    // The mean of nu degrees of freedom has the variance 2 / nu.
    let (mut rows, blocks) = (Rows::new(9), 20_000);
    let variance = mean((0..blocks).map(|_| {
        let energy = mean((0..ROWS_PER_BLOCK).map(|_| rows.next()).map(|error| error * error));
        (energy - 1.0) * (energy - 1.0)
    }));
    // 20,000 blocks determine a variance to 1 %, that of a skewed distribution a little worse.
    assert!((2.0 / variance - freedom).abs() < 0.05 * freedom, "{freedom}, found {}", 2.0 / variance);
    assert!(freedom < 20.0);
    assert!((block_freedom(&[1.0_f64]) - 25.0).abs() < 1e-12);
}

#[test]
fn the_exponent_solves_its_equation_in_single_precision() {
    for (ratio, margin) in [(2.0_f32, 1.1), (2.0, 1.3), (1.5, 1.1), (4.0, 1.5)] {
        let t = f64::from(exponent(ratio, margin));
        let (ratio, margin) = (f64::from(ratio), f64::from(margin));
        let left = t * real::ln(ratio) + real::ln(1.0 - t * margin * (1.0 - 1.0 / ratio));
        // The curve's slope there is of the order of a tenth; t has single precision.
        assert!(t > 0.05 && t < 1.0 && left.abs() < 1e-5, "{ratio} {margin}: {t} {left}");
    }
    assert_eq!(exponent(2.0_f32, 1.0), 1.0);
}
