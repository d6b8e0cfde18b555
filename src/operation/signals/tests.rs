use super::*;

#[test]
fn a_target_is_followed_only_while_the_drive_is_enabled() {
    let signals = Signals::<2>::new();
    assert_eq!(signals.target(1), AxisRequest::OFF);
    signals.set_targets(&DriveCommand { enabled: true, currents: [Ampere(1.0), Ampere(-2.0)] });
    assert_eq!(signals.target(1), AxisRequest { enabled: true, current: Ampere(-2.0) });
    signals.begin_servo();
    signals.end_servo();
    assert_eq!((signals.target(0), signals.has_begun()), (AxisRequest::OFF, false));
    assert_eq!(signals.target(2), AxisRequest::OFF);
}

#[test]
fn a_reset_clears_neither_permanent_reasons_nor_a_flash_write() {
    let inhibit = Inhibit::new();
    InhibitReason::ALL.into_iter().for_each(|cause| inhibit.raise(cause));
    inhibit.reset();
    assert_eq!(inhibit.causes(), InhibitReason::for_ever() | InhibitReason::Storing.bit());
    inhibit.end_storing();
    assert_eq!(inhibit.causes(), InhibitReason::for_ever());
}
