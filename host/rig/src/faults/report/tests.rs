//! Tests of the table.

use scarab_base::random::Random;
use scarab_identify::formats::leg_file::{DEFAULT_LEG, LegFile};

use crate::faults::bounds::bounds;
use crate::faults::forks::ROWS;
use crate::faults::report::{JUDGED, names};
use crate::faults::scenario::{Event, Expected};

#[test]
fn only_rows_with_harmless_runs_judge_false_alarms() {
    let bounds = bounds(&LegFile::load(DEFAULT_LEG).expect("shipped")).expect("complete drives");
    for row in &ROWS {
        let harmless = (1..=64).any(|seed| {
            let scenario = (row.draw)(&mut Random::new(row.fault.id, seed), &bounds);
            matches!(scenario.expected, Expected::Kept | Expected::Rejected | Expected::Ignored)
                || matches!(
                    scenario.event,
                    Event::Kick(..) | Event::Push(..) | Event::Hold(..) | Event::Touch(_)
                )
        });
        assert_eq!(harmless, JUDGED.contains(&row.fault.id), "{}", row.fault.id);
    }
}

#[test]
fn a_refusal_for_contact_differs_from_other_refusals() {
    assert!(names("refused: contact", "refused: contact") && !names("refused: contact", "refused"));
    assert!(names("refused: contact or refused", "refused") && names("Limit, Off", "Off"));
}
