use super::*;

const TURN: i32 = 4000;
const SETTINGS: EncoderSettings = EncoderSettings {
    absolute: AbsoluteEncoders { rotor: true, joint: Some(Direction::Up) },
    counts_per_turn: TURN as u32,
    ratio: 50.0,
};

/// Reading of an encoder at this position, rounded down.
fn reading(position: f64, turn: f64) -> AbsoluteAngle {
    let share = (position / turn).rem_euclid(1.0);
    AbsoluteAngle::from_steps((share * 16_384.0) as u16)
}

/// A rotor at a travel in counts, its counter and its absolute encoder.
struct Rotor {
    check: EncoderCheck,
    travel: i32,
    /// Counts that the counter has lost.
    lost: i32,
}

impl Rotor {
    fn new(travel: i32) -> Self {
        let mut rotor = Self { check: EncoderCheck::default(), travel, lost: 0 };
        rotor.check.follow(&SETTINGS, rotor.counter());
        rotor
    }

    fn counter(&self) -> u16 {
        (self.travel - self.lost) as u16
    }

    fn check_once(&mut self) -> Finding {
        self.check.follow(&SETTINGS, self.counter());
        let angle = reading(f64::from(self.travel) + 0.5, f64::from(TURN));
        self.check.rotor(&SETTINGS, Some(angle), self.counter())
    }
}

#[test]
fn a_counter_that_follows_is_right_over_many_wraps_of_16_bits_and_turns() {
    for step in [37, -53, 1999, 0] {
        let mut rotor = Rotor::new(3000);
        for _ in 0..5000 {
            rotor.travel += step;
            assert_eq!(rotor.check_once(), Finding::Sound, "{step} {}", rotor.travel);
        }
        let (counter, position) = rotor.check.position().expect("a reading");
        assert_eq!(counter, rotor.counter());
        assert!(within_half_a_turn(position - rotor.travel, TURN).abs() <= 1);
    }
}

#[test]
fn lost_counts_beyond_the_tolerance_contradict_twice() {
    // 4 + 4000 / 512 counts; a count is rounded.
    for (lost, found) in [(10, Finding::Sound), (13, Finding::Contradiction), (-13, Finding::Contradiction)] {
        let mut rotor = Rotor::new(100);
        assert_eq!(rotor.check_once(), Finding::Sound);
        rotor.lost = lost;
        assert_eq!(rotor.check_once(), Finding::Sound, "once is noise");
        assert_eq!(rotor.check_once(), found, "{lost}");
        rotor.lost = 0;
        assert_eq!((rotor.check_once(), rotor.check_once()), (Finding::Sound, Finding::Sound));
    }
}

#[test]
fn a_frozen_counter_and_a_frozen_encoder_contradict_within_a_few_counts() {
    for is_counter in [true, false] {
        let mut rotor = Rotor::new(100);
        assert_eq!(rotor.check_once(), Finding::Sound);
        let frozen = reading(100.5, f64::from(TURN));
        let moved = (1..100).find(|moved| {
            rotor.travel = 100 + moved;
            if is_counter {
                rotor.lost = *moved;
                return rotor.check_once() == Finding::Contradiction;
            }
            rotor.check.follow(&SETTINGS, rotor.counter());
            rotor.check.rotor(&SETTINGS, Some(frozen), rotor.counter()) == Finding::Contradiction
        });
        assert!(moved.is_some_and(|moved| (12..=15).contains(&moved)), "{moved:?}");
    }
}

#[test]
fn motion_while_a_frame_is_read_is_no_contradiction() {
    let mut rotor = Rotor::new(100);
    assert_eq!(rotor.check_once(), Finding::Sound);
    for moved in [30, -30] {
        for share in [0.0, 0.5, 1.0] {
            rotor.check.follow(&SETTINGS, rotor.counter());
            let at = f64::from(rotor.travel) + share * f64::from(moved);
            rotor.travel += moved;
            let angle = reading(at + 0.5, f64::from(TURN));
            for _ in 0..2 {
                assert_eq!(rotor.check.rotor(&SETTINGS, Some(angle), rotor.counter()), Finding::Sound);
            }
        }
    }
    // The first reading needs a rotor at rest.
    let mut check = EncoderCheck::default();
    check.follow(&SETTINGS, 10);
    check.rotor(&SETTINGS, Some(reading(10.0, 4000.0)), 11);
    assert_eq!(check.position(), None);
}

#[test]
fn five_invalid_frames_in_a_row_are_silence_and_fewer_are_noise() {
    let mut rotor = Rotor::new(0);
    assert_eq!(rotor.check_once(), Finding::Sound);
    for invalid in [4, 5, 6] {
        let mut last = Finding::Sound;
        for _ in 0..invalid {
            last = rotor.check.rotor(&SETTINGS, None, rotor.counter());
        }
        assert_eq!(last == Finding::Silent, invalid >= 5, "{invalid}");
        assert_eq!(rotor.check_once(), Finding::Sound);
    }
    // An invalid frame between two contradictions neither counts nor ends them.
    rotor.lost = 100;
    assert_eq!(rotor.check_once(), Finding::Sound);
    assert_eq!(rotor.check.rotor(&SETTINGS, None, rotor.counter()), Finding::Sound);
    assert_eq!(rotor.check_once(), Finding::Contradiction);
}

/// A joint at an angle in degrees, with its rotor and an encoder that errs by some degrees.
fn joint(degrees: f64, error: f64, rotor_zero: i32, sign: f64) -> (i32, i32, AbsoluteAngle) {
    let counts = (degrees / 360.0 * 50.0 * f64::from(TURN)).round() as i32;
    (counts, rotor_zero + counts, reading(sign * (degrees + error) + 77.0, 360.0))
}

#[test]
fn the_zero_of_a_joint_returns_to_the_count() {
    for sign in [1.0, -1.0] {
        let direction = if sign > 0.0 { Direction::Up } else { Direction::Down };
        let settings = EncoderSettings {
            absolute: AbsoluteEncoders { rotor: true, joint: Some(direction) },
            ..SETTINGS
        };
        let (_, rotor, at_zero) = joint(0.0, 0.0, 1234, sign);
        let zero = JointZero { rotor, joint: at_zero, setting: 0 };
        for degrees in [-170.0, -20.0, -0.3, 0.0, 5.0, 50.0, 95.5, 170.0] {
            for error in [-1.6, 0.0, 1.6] {
                // The rotor position of the second day is known within a turn only.
                let (counts, rotor, angle) = joint(degrees, error, 1234 + 7 * TURN, sign);
                assert_eq!(settings.counts_from_zero(&zero, rotor, angle), Some(counts), "{degrees} {error}");
            }
            for error in [-2.6, 2.6, -1.9] {
                let (_, rotor, angle) = joint(degrees, error, 1234, sign);
                let is_beyond = settings.counts_from_zero(&zero, rotor, angle).is_none();
                // A quarter of a motor turn is 1.8 degrees of this joint.
                assert!(is_beyond, "{degrees} {error}");
            }
        }
    }
}

#[test]
fn a_joint_that_leaves_its_counts_contradicts() {
    let zero = JointZero { rotor: 0, joint: reading(77.0, 360.0), setting: 0 };
    for (error, found) in
        [(2.4, Finding::Sound), (2.6, Finding::Contradiction), (-2.6, Finding::Contradiction)]
    {
        for degrees in [-30.0, 0.0, 95.0] {
            let mut check = EncoderCheck::default();
            let (counts, _, angle) = joint(degrees, error, 0, 1.0);
            assert_eq!(check.joint(&SETTINGS, Some(angle), Some(&zero), counts), Finding::Sound);
            assert_eq!(check.joint(&SETTINGS, Some(angle), Some(&zero), counts), found, "{error}");
            // Without a zero nothing can be compared.
            assert_eq!(check.joint(&SETTINGS, Some(angle), None, counts), Finding::Sound);
        }
    }
}

#[test]
fn a_zero_holds_for_its_direction_and_ratio_only() {
    let with = |joint, ratio| {
        let absolute = AbsoluteEncoders { rotor: true, joint: Some(joint) };
        EncoderSettings { absolute, ratio, ..SETTINGS }.joint_setting()
    };
    let all = [
        with(Direction::Up, 50.0),
        with(Direction::Down, 50.0),
        with(Direction::Up, 51.0),
        with(Direction::Up, 6.0),
        with(Direction::Up, 100.0),
    ];
    for (index, one) in all.iter().enumerate() {
        assert!(all[..index].iter().all(|other| other != one), "{all:?}");
    }
}
