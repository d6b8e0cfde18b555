//! Bandwidths of the current loops that a host sets.

use super::*;
use crate::bus::drive::LoopBandwidths;

const SLOWER: Hertz = Hertz(600.0);

impl Bench {
    fn set_bandwidths(&self, bandwidths: [Option<Hertz>; 2]) {
        self.signals.set_bandwidths(&bandwidths.map(|current| LoopBandwidths { position: None, current }));
    }
}

#[test]
fn a_bandwidth_is_ordered_once() {
    let mut bench = Bench::new(Housekeeper::ready(HOUSEKEEPING));
    assert_eq!(bench.hold(true, false), []);
    bench.set_bandwidths([None, Some(SLOWER)]);
    assert_eq!(bench.hold(true, false), [(1, Order::Bandwidth(SLOWER))]);
    assert_eq!(bench.hold(true, false), []);
    bench.set_bandwidths([None; 2]);
    assert_eq!(bench.hold(true, false), [(1, Order::Bandwidth(CONFIGURATION.bandwidth))]);
}

#[test]
fn an_axis_begins_with_the_bandwidth_that_was_set_before_its_calibration() {
    let calibration = measured();
    let mut bench = Bench::new(Housekeeper::new(HOUSEKEEPING));
    bench.set_bandwidths([Some(SLOWER), None]);
    assert!(matches!(bench.press()[..], [(0, Order::Calibrate(_))]));
    // A change during the calibration waits for its end.
    bench.set_bandwidths([Some(SLOWER), Some(SLOWER)]);
    let of = |bandwidth| {
        let mut axis = Axis::new(&CONFIGURATION, &calibration, &AxisSample::default()).expect("usual");
        axis.set_bandwidth(bandwidth);
        axis
    };
    let orders = bench.ends(0, Outcome::Calibrated(calibration));
    assert!(matches!(&orders[..], [(0, Order::Run(axis)), (1, Order::Calibrate(_))] if *axis == of(SLOWER)));
    let orders = bench.ends(1, Outcome::Calibrated(calibration));
    let designed = of(CONFIGURATION.bandwidth);
    assert!(
        matches!(&orders[..], [(1, Order::Run(axis)), (1, Order::Bandwidth(SLOWER))] if *axis == designed)
    );
}
