use super::super::testing::TestHardware;
use super::*;

/// Counters that every level moves: axes, servo, housekeeping.
fn counters(signals: &Signals<2>) -> [&Word; 4] {
    let statistics = &signals.statistics;
    let [first, second] = &statistics.current_ticks;
    [first, second, &statistics.servo_ticks, &statistics.rounds]
}

/// Runs some checks while all levels run except one.
fn run_checks(
    watch: &mut Watch<2>,
    signals: &Signals<2>,
    hardware: &mut TestHardware<2>,
    checks: u32,
    hung: Option<usize>,
) {
    for _ in 0..checks {
        for (index, counter) in counters(signals).into_iter().enumerate() {
            if hung != Some(index) {
                counter.add();
            }
        }
        watch.check(signals, hardware);
    }
}

#[test]
fn the_watchdog_is_fed_only_while_axes_servo_and_housekeeping_run() {
    for hung in [None, Some(0), Some(1), Some(2), Some(3)] {
        let (signals, mut hardware) = (Signals::new(), TestHardware::new());
        let mut watch = Watch::new(&signals);
        run_checks(&mut watch, &signals, &mut hardware, 10 * CHECKS_PER_FEED, hung);
        assert_eq!(hardware.watchdog.fed, if hung.is_some() { 0 } else { 10 }, "{hung:?}");
        // A level that runs again no longer prevents feeding.
        run_checks(&mut watch, &signals, &mut hardware, CHECKS_PER_FEED, None);
        assert_eq!(hardware.watchdog.fed, if hung.is_some() { 1 } else { 11 }, "{hung:?}");
    }
}

#[test]
fn bridges_without_current_ticks_are_turned_off() {
    for hung in [None, Some(0), Some(1), Some(2), Some(3)] {
        let (signals, mut hardware) = (Signals::new(), TestHardware::new());
        let mut watch = Watch::new(&signals);
        run_checks(&mut watch, &signals, &mut hardware, 2, None);
        (0..2).for_each(|axis| hardware.enable(axis));
        run_checks(&mut watch, &signals, &mut hardware, 1, hung);
        let stops = matches!(hung, Some(0 | 1));
        let causes = if stops { InhibitReason::CurrentTicks.bit() } else { 0 };
        assert_eq!((hardware.is_enabled(), signals.inhibit.causes()), (!stops, causes), "{hung:?}");
    }
}

#[test]
fn stalled_ticks_during_a_flash_write_are_no_fault() {
    let (signals, mut hardware) = (Signals::new(), TestHardware::new());
    let mut watch = Watch::new(&signals);
    run_checks(&mut watch, &signals, &mut hardware, 2, None);
    signals.inhibit.raise(InhibitReason::Storing);
    hardware.enable(0);
    watch.check(&signals, &mut hardware);
    // The bridges are turned off nevertheless.
    assert_eq!((hardware.is_enabled(), signals.inhibit.causes()), (false, InhibitReason::Storing.bit()));
    signals.inhibit.end_storing();
    watch.check(&signals, &mut hardware);
    assert_eq!(signals.inhibit.causes(), InhibitReason::CurrentTicks.bit());
}

#[test]
fn the_brake_resistor_is_off_without_current_ticks() {
    for hung in [None, Some(0), Some(1), Some(2)] {
        let (signals, mut hardware) = (Signals::new(), TestHardware::new());
        let mut watch = Watch::new(&signals);
        run_checks(&mut watch, &signals, &mut hardware, 2, None);
        hardware.brake = 0.5;
        run_checks(&mut watch, &signals, &mut hardware, 1, hung);
        assert_eq!(hardware.brake > 0.0, !matches!(hung, Some(0 | 1)), "{hung:?}");
    }
}
