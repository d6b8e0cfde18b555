use super::super::dictionary::{Access, Type};
use super::super::table::{ROWS, is_of_leg};
use super::*;
use crate::leg::{FoundBase, FoundFit, FoundParameter, LoggedSample, Segment, Verdict};

/// Results of two joints in which every number differs.
struct Numbers(Option<Verdict>);

impl Results for Numbers {
    fn parameter(&self, joint: usize, parameter: Parameter) -> Option<FoundParameter> {
        self.0?;
        let value = joint as f32 * 100.0 + parameter.index() as f32;
        Some(FoundParameter { value: Some(value), sigma: None, status: Status::Weak })
    }

    fn base_parameter(&self, base: usize) -> Option<FoundBase> {
        self.0.filter(|_| base < 13)?;
        Some(FoundBase {
            carrier: (1, Parameter::ALL[base]),
            grouped: true,
            dropped: false,
            value: Some(base as f32),
            sigma: Some(0.5),
            least_squares: 2.0,
        })
    }

    fn fit(&self, motion: usize, joint: usize) -> Option<FoundFit> {
        self.0.filter(|_| motion < 4)?;
        Some(FoundFit {
            rows: 700,
            rms_nm: Some((motion + 10 * joint) as f32),
            mean_absolute_nm: 12.0,
            torque_rms_nm: 14.0,
            speed_rms: 1.0,
            disturbed_share: 0.0,
            disturbed_longest_s: 0.0,
            replaced: 0,
        })
    }

    fn verdict(&self) -> Option<Verdict> {
        self.0
    }

    fn search(&self) -> [u32; 2] {
        [125, 8000]
    }
}

const ACCEPTED: Numbers = Numbers(Some(Verdict::ACCEPTED));

fn leg() -> LegObjects<2, 8> {
    LegObjects::new(Plan::OneTime, 0x1234_5678_9ABC_DEF0, 3, 0)
}

fn with<R: Results, T>(
    leg: &mut LegObjects<2, 8>,
    results: &R,
    ask: impl FnOnce(&mut JointObjects<'_, R, 2, 8>) -> T,
) -> T {
    let mut axis = super::super::tests::axis();
    ask(&mut JointObjects { axis: &mut axis, joint: 1, leg, results })
}

#[test]
fn every_object_of_the_table_is_answered_with_and_without_a_result() {
    for results in [Numbers(None), ACCEPTED] {
        for row in ROWS.iter().filter(|row| is_of_leg(row.index)) {
            for sub in (row.sub..row.sub + row.subs).filter(|_| row.access != Access::Const) {
                let object = Object::at(row.index, sub);
                let read = with(&mut leg(), &results, |objects| match row.kind {
                    Type::Domain => objects.bytes(object, 0, &mut [0; 7]),
                    _ => objects.read(object),
                });
                assert!(read.is_ok(), "{object:x?}");
            }
        }
    }
}

#[test]
fn objects_hold_the_results_and_unknown_values_are_nan() {
    let read = |results: &Numbers, index, sub| {
        with(&mut leg(), results, |objects| objects.read(Object::at(index, sub))).expect("a value")
    };
    assert_eq!(f32::from_bits(read(&ACCEPTED, 0x2110, 10)), 109.0);
    assert!(f32::from_bits(read(&ACCEPTED, 0x2111, 10)).is_nan());
    assert_eq!((read(&ACCEPTED, 0x2112, 1), read(&Numbers(None), 0x2112, 1)), (3, 0));
    assert_eq!(f32::from_bits(read(&ACCEPTED, 0x2120, 13)), 12.0);
    assert_eq!((read(&ACCEPTED, 0x2122, 3), read(&ACCEPTED, 0x2123, 3)), (0x0203, 0b011));
    assert_eq!((f32::from_bits(read(&ACCEPTED, 0x2130, 4)), read(&ACCEPTED, 0x2133, 1)), (13.0, 700));
    assert!(f32::from_bits(read(&Numbers(None), 0x2110, 1)).is_nan());
    assert_eq!((read(&ACCEPTED, 0x2100, 8), read(&ACCEPTED, 0x2100, 9)), (1, 0));
    let refused = Numbers(Some(Verdict::refused(Reason::Contact).and(Verdict::refused(Reason::Residual))));
    assert_eq!((read(&refused, 0x2100, 8), read(&refused, 0x2100, 9)), (2, 0b100_0100));
    assert_eq!((read(&ACCEPTED, 0x2100, 5), read(&ACCEPTED, 0x2100, 6)), (0x9ABC_DEF0, 0x1234_5678));
}

#[test]
fn a_copy_answers_every_object_like_the_original() {
    let mut found = ResultsCopy::<2, 13>::nothing();
    found.take(&ACCEPTED, ACCEPTED.0);
    let mut forgotten = found.clone();
    forgotten.forget();
    assert_eq!((Results::verdict(&found), Results::verdict(&forgotten)), (ACCEPTED.0, None));
    assert_eq!(forgotten, ResultsCopy::nothing());
    let refusal = Some(Verdict::refused(Reason::Contact));
    forgotten.take(&Numbers(refusal), refusal);
    assert_eq!(Results::verdict(&forgotten), refusal);
    let mut compared = 0;
    for row in ROWS.iter().filter(|row| (0x2100..0x2140).contains(&row.index)) {
        for object in (row.sub..row.sub + row.subs).map(|sub| Object::at(row.index, sub)) {
            let copy = with(&mut leg(), &found, |objects| objects.read(object));
            let original = with(&mut leg(), &ACCEPTED, |objects| objects.read(object));
            assert_eq!(copy, original, "{object:x?}");
            compared += 1;
        }
    }
    assert!(compared > 100, "{compared}");
}

#[test]
fn a_command_is_passed_once_and_settings_are_locked_meanwhile() {
    let mut leg = leg();
    let write = |leg: &mut LegObjects<2, 8>, sub, value| {
        with(leg, &ACCEPTED, |objects| objects.write(Object::at(0x2100, sub), value))
    };
    assert_eq!([(4, 1), (5, 7), (6, 0)].map(|(sub, value)| write(&mut leg, sub, value)), [Ok(()); 3]);
    assert_eq!((leg.plan, leg.seed), (Plan::Sequential, 7));
    assert_eq!(write(&mut leg, 1, 1), Ok(()));
    assert_eq!((leg.take_request(), leg.take_request()), (Some(LegCommand::Identify), None));
    leg.activity = Activity::Identify(IdentifyPhase::Excite);
    assert_eq!((write(&mut leg, 4, 0), write(&mut leg, 5, 1)), (Err(Abort::State), Err(Abort::State)));
    assert_eq!(write(&mut leg, 1, 2), Ok(()));
    assert_eq!((leg.take_request(), write(&mut leg, 1, 9)), (Some(LegCommand::Cancel), Err(Abort::Range)));
}

#[test]
fn the_log_delivers_each_sample_once_and_counts_lost_ones() {
    let mut log = Log::<2, 8>::EMPTY;
    let sample = |tick: u32| LoggedSample {
        sample: crate::leg::LogSample {
            position_rad: [tick as f32, 0.5],
            torque_nm: [-1.0, 2.0],
            counts_sum: [0; 2],
            tick,
        },
        segment: Some(Segment::Validation(2)),
    };
    let (mut pushed, mut taken, mut next) = (0_u32, Vec::new(), 5);
    for _ in 0..50 {
        for _ in 0..next {
            log.push(&sample(pushed));
            pushed += 1;
        }
        log.hold(true);
        // A sample that arrives while the block is held.
        log.push(&sample(pushed));
        pushed += 1;
        let size = log.bytes(0, &mut []);
        assert_eq!(size as usize, log.held() as usize * Log::<2, 8>::BYTES);
        let mut block = vec![0; size as usize];
        for (index, piece) in block.chunks_mut(7).enumerate() {
            assert_eq!(log.bytes(7 * index as u32, piece), size);
        }
        for sample in block.chunks(24) {
            let word =
                |index: usize| u32::from_le_bytes(sample[index..index + 4].try_into().expect("four bytes"));
            let [position, torque] = [8, 16].map(|index| f32::from_bits(word(index)));
            assert_eq!((word(4), position, torque), (5, word(0) as f32, -1.0));
            taken.push(word(0));
        }
        log.hold(false);
        next = next % 9 + 1;
    }
    assert!(taken.windows(2).all(|pair| pair[0] < pair[1]));
    assert!(log.lost() > 0);
    assert_eq!(taken.len() as u32 + log.lost() + log.waiting(), pushed);
}

#[test]
fn nothing_is_stored_while_the_drive_may_switch() {
    let mut leg = leg();
    assert_eq!(with(&mut leg, &ACCEPTED, |objects| objects.store(false)), Ok(()));
    assert_eq!((leg.take_store(), leg.take_store()), (Some(false), None));
    use crate::leg::{DriveState, JointStatus};
    let mut axis = super::super::tests::axis();
    axis.update(&JointStatus { drive: DriveState::OperationEnabled, ..JointStatus::NONE });
    let mut objects = JointObjects { axis: &mut axis, joint: 0, leg: &mut leg, results: &ACCEPTED };
    assert_eq!(objects.store(true), Err(Abort::State));
}

#[test]
fn shares_are_written_within_their_limits_and_read_back() {
    let mut leg = leg();
    let mut write = |sub: u8, value: i16| {
        let value = u32::from(value.cast_unsigned());
        with(&mut leg, &ACCEPTED, |objects| objects.write(Object::at(0x2150, sub), value))
    };
    let cases = [(1, 1000), (2, 800), (3, 0), (4, -500)];
    for (sub, value) in cases {
        assert_eq!(write(sub, value), Ok(()), "{sub}");
    }
    for (sub, value) in [(1, 1001), (2, 801), (3, -1), (4, 501)] {
        assert_eq!(write(sub, value), Err(Abort::Range), "{sub}");
    }
    for (sub, value) in cases {
        let found = with(&mut leg, &ACCEPTED, |objects| objects.read(Object::at(0x2150, sub)));
        assert_eq!(found.map(|found| found as i16), Ok(value), "{sub}");
    }
}
