//! Bandwidths that a host writes reach the other levels.

use super::*;
use crate::units::Hertz;

#[test]
fn a_written_bandwidth_reaches_servo_and_housekeeping() {
    let mut bench = Bench::new();
    assert_eq!(bench.signals.position_bandwidths(), [None; 2]);
    // SDO downloads of two bytes: 4.50 Hz to 2021:1 of the hip, 600 Hz to 2021:4 of the knee.
    bench.send(0x601, &[0x2B, 0x21, 0x20, 1, 0xC2, 0x01, 0, 0]);
    bench.run(4);
    bench.send(0x602, &[0x2B, 0x21, 0x20, 4, 0x58, 0x02, 0, 0]);
    bench.run(4);
    assert_eq!(bench.signals.position_bandwidths(), [Some(Hertz(4.5)), None]);
    assert_eq!(bench.signals.current_bandwidths(), [None, Some(Hertz(600.0))]);
}
