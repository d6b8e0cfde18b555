//! Bandwidths of the position loops that a host sets.

use super::*;
use crate::bus::drive::LoopBandwidths;
use crate::units::Hertz;

const SLOWER: LoopBandwidths = LoopBandwidths { position: Some(Hertz(3.0)), current: None };

impl Bench {
    fn set_bandwidths(&self, hip: LoopBandwidths) {
        self.signals.set_bandwidths(&[hip, LoopBandwidths::default()]);
    }
}

#[test]
fn a_bandwidth_applies_from_when_the_drive_is_off() {
    let mut bench = Bench::enabled();
    let designed = bench.control.checksum();
    bench.set_bandwidths(SLOWER);
    bench.run(1000);
    assert_eq!(bench.control.checksum(), designed);
    bench.ask(ControlRequest::Power(PowerRequest::QuickStop));
    bench.run(1000);
    assert_eq!(bench.control.state().permission(), Permission::Damp);
    assert_eq!(bench.control.checksum(), designed);
    bench.run(4000);
    assert_eq!(bench.control.state().permission(), Permission::Off);
    assert_ne!(bench.control.checksum(), designed);
    // 0 in 2021 is the designed one, to the last bit.
    bench.set_bandwidths(LoopBandwidths::default());
    bench.run(1000);
    assert_eq!(bench.control.checksum(), designed);
    assert_eq!(bench.fault(), None);
}

#[test]
fn a_damaged_constant_is_found_although_a_host_changes_the_bandwidth() {
    let mut bench = Bench::begun();
    bench.tick();
    bench.control.flip_bit(1, 0, 20);
    bench.set_bandwidths(SLOWER);
    bench.run(1000);
    assert_eq!(bench.fault().map(|fault| fault.code), Some(FaultCode::Parameters));
}
