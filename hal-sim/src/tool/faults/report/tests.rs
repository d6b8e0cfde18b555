//! What the table says.

use super::names;

#[test]
fn a_refusal_for_another_reason_is_not_one_for_contact() {
    assert!(names("refused: contact", "refused: contact") && !names("refused: contact", "refused"));
    assert!(names("refused: contact or refused", "refused") && names("Limit, Off", "Off"));
}
