use super::*;
use crate::hal::SERVO_RATE_HZ;

const SETTINGS: EndStopSettings = EndStopSettings {
    rate: Hertz(SERVO_RATE_HZ as f32),
    counts_per_s: -20_000.0,
    current: Ampere(6.0),
    lead: 2000.0,
    damping: 2e-5,
    way: 200_000,
    back_off: 8000,
    tolerance: 100,
};

/// Simulated joint with friction, gravity and a stop, in counts and amperes.
struct Joint {
    place: f64,
    speed: f64,
    stop: f64,
    friction: f64,
    /// An obstacle that stops the joint once.
    obstacle: Option<f64>,
}

impl Joint {
    fn to(stop: f64) -> Self {
        Self { place: 0.0, speed: 0.0, stop, friction: 1.5, obstacle: None }
    }

    fn step(&mut self, current: f64) -> JointSample {
        let step = 1.0 / f64::from(SERVO_RATE_HZ);
        self.speed += step * 2e5 * (current - 2e-5 * self.speed);
        let friction = step * 2e5 * self.friction;
        self.speed -= self.speed.clamp(-friction, friction);
        self.place += step * self.speed;
        let wall = self.obstacle.unwrap_or(self.stop).max(self.stop);
        if self.place < wall {
            (self.place, self.speed) = (wall, 0.0);
        }
        JointSample {
            encoder_counts: 77_000 + self.place.floor() as i32,
            current: Ampere(current as f32),
            doubtful: false,
        }
    }
}

fn search(
    joint: &mut Joint,
    settings: EndStopSettings,
    mut meddle: impl FnMut(&mut Joint, usize),
) -> ReferenceStep {
    let mut machine = EndStopSearch::new(settings).expect("sensible");
    let mut sample = joint.step(0.0);
    for tick in 0..400_000 {
        meddle(joint, tick);
        match machine.tick(&sample) {
            ReferenceStep::Running(current) => {
                assert!(current.0.abs() <= settings.current.0);
                sample = joint.step(f64::from(current.0));
            }
            end => return end,
        }
    }
    panic!("no end");
}

#[test]
fn the_stop_is_found_twice_at_the_same_place() {
    for stop in [-20_000.0, -150_000.0] {
        let found = search(&mut Joint::to(stop), SETTINGS, |_, _| ());
        assert_eq!(found, ReferenceStep::Found(77_000 + stop as i32));
    }
}

#[test]
fn a_way_without_a_stop_a_joint_that_sticks_and_an_obstacle_are_refused() {
    let refused = |joint: &mut Joint| search(joint, SETTINGS, |_, _| ());
    assert_eq!(refused(&mut Joint::to(-300_000.0)), ReferenceStep::Refused(ReferenceRefusal::NoStop));
    let stuck = &mut Joint { friction: 8.0, ..Joint::to(-50_000.0) };
    assert_eq!(refused(stuck), ReferenceStep::Refused(ReferenceRefusal::Stuck));
    // A knee in the way that withdraws as soon as the joint backs off.
    let obstacle = &mut Joint { obstacle: Some(-30_000.0), ..Joint::to(-50_000.0) };
    let mut touched = false;
    let found = search(obstacle, SETTINGS, |joint, _| {
        touched |= joint.place <= -29_999.0;
        if touched && joint.place > -25_000.0 {
            joint.obstacle = None;
        }
    });
    assert_eq!(found, ReferenceStep::Refused(ReferenceRefusal::Unrepeatable));
}

#[test]
fn a_stated_pose_wants_a_joint_that_stands() {
    let sample = |count| JointSample { encoder_counts: count, ..JointSample::default() };
    let mut pose = StatedPose::new(Hertz(SERVO_RATE_HZ as f32)).expect("usual");
    let mut ticks = 1;
    while pose.tick(&sample(-5)) == ReferenceStep::Running(Ampere::ZERO) {
        ticks += 1;
    }
    assert_eq!((ticks, pose.tick(&sample(-5))), (2000, ReferenceStep::Found(-5)));
    let mut pose = StatedPose::new(Hertz(SERVO_RATE_HZ as f32)).expect("usual");
    let _ = pose.tick(&sample(-5));
    assert_eq!(pose.tick(&sample(10)), ReferenceStep::Refused(ReferenceRefusal::Moved));
    assert!(StatedPose::new(Hertz(f32::NAN)).is_none());
}

#[test]
fn settings_that_make_no_sense_are_refused() {
    let refused = |change: fn(&mut EndStopSettings)| {
        let mut settings = SETTINGS;
        change(&mut settings);
        EndStopSearch::new(settings) == Err(ReferenceRefusal::Settings)
    };
    assert!(refused(|s| s.current.0 = 0.0) && refused(|s| s.counts_per_s = f32::NAN));
    assert!(refused(|s| s.tolerance = i32::MAX) && refused(|s| s.way = i32::MAX));
    assert!(refused(|s| s.way = 0) && refused(|s| s.back_off = 50) && !refused(|_| ()));
}

#[test]
fn a_search_has_twice_the_time_of_its_way_and_5_s() {
    // The joint creeps over its way in 30 s; the way takes 10 s at the speed of the search.
    let mut machine = EndStopSearch::new(SETTINGS).expect("sensible");
    let ticks = (1..=120_000).find(|tick| {
        let counts = 77_000 - tick * 199 / 120;
        let sample = JointSample { encoder_counts: counts, ..JointSample::default() };
        machine.tick(&sample) == ReferenceStep::Refused(ReferenceRefusal::TimeOut)
    });
    // 25 s of 4,000 ticks.
    assert_eq!(ticks, Some(100_001));
}
