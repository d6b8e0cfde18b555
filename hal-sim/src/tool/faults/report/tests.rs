//! What the table says.

use super::super::bounds::bounds;
use super::super::catalogue::{Event, Expected, rows};
use super::super::dice::Dice;
use super::{JUDGED, names};
use crate::tool::leg_file::{DEFAULT_LEG, LegFile};

#[test]
fn false_alarms_are_told_of_rows_with_harmless_runs_and_of_no_others() {
    let bounds = bounds(&LegFile::load(DEFAULT_LEG).expect("shipped")).expect("complete drives");
    for row in rows() {
        let harmless = (1..=64).any(|seed| {
            let scenario = (row.draw)(&mut Dice::new(row.id, seed), &bounds);
            matches!(scenario.expected, Expected::Kept | Expected::Rejected | Expected::Ignored)
                || matches!(
                    scenario.event,
                    Event::Kick(..) | Event::Push(..) | Event::Hold(..) | Event::Touch(_)
                )
        });
        assert_eq!(harmless, JUDGED.contains(&row.id), "{}", row.id);
    }
}

#[test]
fn a_refusal_for_another_reason_is_not_one_for_contact() {
    assert!(names("refused: contact", "refused: contact") && !names("refused: contact", "refused"));
    assert!(names("refused: contact or refused", "refused") && names("Limit, Off", "Off"));
}
