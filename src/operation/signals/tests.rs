use super::*;

#[test]
fn a_reset_clears_neither_permanent_reasons_nor_a_flash_write() {
    let inhibit = Inhibit::new();
    InhibitReason::ALL.into_iter().for_each(|cause| inhibit.raise(cause));
    inhibit.reset();
    assert_eq!(inhibit.causes(), InhibitReason::for_ever() | InhibitReason::Storing.bit());
    inhibit.end_storing();
    assert_eq!(inhibit.causes(), InhibitReason::for_ever());
}
