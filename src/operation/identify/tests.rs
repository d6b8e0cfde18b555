use super::super::Ends;
use super::super::queues::LegEvent;
use super::super::testing;
use super::*;
use crate::bus::identification::Results;
use crate::leg::testing::{BASE, configuration};
use crate::leg::{LogSample, Plan, Step, VALIDATION_MOTIONS};

struct Bench {
    level: IdentificationLevel,
    identification: Box<Identification<2, BASE, 256, 26>>,
    ends: Ends<'static, 2>,
    signals: Signals<2>,
    records: Vec<Record<2>>,
    /// Ticks of the received samples.
    samples: Vec<u32>,
}

impl Bench {
    fn new() -> Self {
        let identification = Identification::new(&configuration()).expect("a leg");
        Self {
            level: IdentificationLevel::new(identification.swarm_seed()),
            identification: Box::new(identification),
            ends: testing::ends(),
            signals: Signals::new(),
            records: Vec::new(),
            samples: Vec::new(),
        }
    }

    /// Sends events, lets the level take them, and returns whether there were any.
    fn receive(&mut self, events: impl IntoIterator<Item = LegEvent<2>>) -> bool {
        for event in events {
            assert!(self.ends.servo.events.enqueue(event).is_ok(), "full");
        }
        let Self { level, identification, ends, records, samples, .. } = self;
        let record = |record: &Record<2>| records.push(*record);
        level.receive(identification, &mut ends.identification, record, |logged| {
            samples.push(logged.sample.tick)
        })
    }

    fn work(&mut self) -> Slice<2> {
        let Self { level, identification, ends, signals, records, .. } = self;
        let record = |record: &Record<2>| records.push(*record);
        level.work(identification, 4, &mut ends.identification, signals, record)
    }

    fn finding(&mut self) -> Option<Finding<2>> {
        self.ends.servo.findings.dequeue()
    }

    fn lost(&self) -> usize {
        let lost = |record: &&Record<2>| matches!(record, Record::Refused { why: "samples_lost", .. });
        self.records.iter().filter(lost).count()
    }
}

fn logged(tick: u32, segment: Option<Segment>) -> LegEvent<2> {
    let sample = LogSample { position_rad: [0.1; 2], torque_nm: [1.0; 2], counts_sum: [0; 2], tick };
    LegEvent::Sample(LoggedSample { sample, segment })
}

fn phase(phase: IdentifyPhase) -> LegEvent<2> {
    LegEvent::Activity(Activity::Identify(phase))
}

/// Samples of the training motion at these ticks.
fn training(ticks: &[u32]) -> impl Iterator<Item = LegEvent<2>> {
    ticks.iter().map(|tick| logged(*tick, Some(Segment::Training)))
}

#[test]
fn a_missing_sample_ends_the_identification_with_refused_input() {
    for waits in [IdentifyPhase::Settle, IdentifyPhase::Solve, IdentifyPhase::Judge] {
        let mut bench = Bench::new();
        bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Excite)]);
        bench.level.published();
        // The sample at 24 was lost.
        bench.signals.statistics.samples_lost.add();
        bench.receive(training(&[8, 16, 32, 40]));
        // While the leg moves no verdict is expected.
        assert_eq!((bench.work(), bench.finding(), bench.lost()), (Slice::Idle, None, 0));
        bench.receive([logged(48, None), phase(waits)]);
        assert_eq!(bench.work(), Slice::Idle);
        let verdict = Verdict::refused(Reason::Input);
        assert_eq!(bench.finding(), Some(Finding::Judged { verdict, model: None }), "{waits:?}");
        assert_eq!(bench.records, [Record::Refused { why: "samples_lost", value: 1 }]);
        assert_eq!(bench.level.unpublished(), None, "control has not taken it yet");
        bench.receive([LegEvent::TookResult]);
        assert_eq!((bench.work(), bench.level.unpublished()), (Slice::Judged(None), Some(Some(verdict))));
        // Cancelled: the recorded motion has no further result.
        bench.receive([logged(56, None)]);
        assert_eq!((bench.work(), bench.finding(), bench.lost()), (Slice::Idle, None, 1));
        assert!(bench.identification.solver().is_none());
    }
}

#[test]
fn samples_of_several_motions_one_after_the_other_have_no_gap() {
    let mut bench = Bench::new();
    bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Excite)]);
    // The tick wraps.
    bench.receive(training(&[u32::MAX - 11, u32::MAX - 3, 4, 12]));
    let (first, second) = (Some(Segment::Validation(0)), Some(Segment::Validation(1)));
    bench.receive([logged(20, None), logged(800, first), logged(808, first), logged(1600, second)]);
    bench.receive([phase(IdentifyPhase::Settle)]);
    bench.work();
    assert!(!bench.level.gap && bench.lost() == 0);
    assert_eq!(bench.samples, [u32::MAX - 11, u32::MAX - 3, 4, 12, 20, 800, 808, 1600]);
    assert_eq!(bench.level.tick(), 1600);
}

#[test]
fn a_new_identification_starts_without_the_previous_gap() {
    let mut bench = Bench::new();
    bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Excite)]);
    bench.receive(training(&[8, 24]));
    assert!(bench.level.gap);
    bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Settle)]);
    bench.work();
    assert_eq!((bench.level.gap, bench.finding(), bench.lost()), (false, None, 0));
}

#[test]
fn a_hosts_identification_begins_with_its_plan_and_seed() {
    let mut bench = Bench::new();
    let seed = bench.identification.swarm_seed();
    assert_eq!(bench.level.seed(), seed);
    bench.receive([LegEvent::Begun(None, None)]);
    assert_eq!((bench.level.seed(), bench.identification.swarm_seed()), (seed, seed));
    for plan in [Plan::OneTime, Plan::Sequential] {
        let mut expected = bench.identification.clone();
        expected.prepare(plan, seed + 7);
        bench.level.published();
        bench.receive([LegEvent::Begun(Some((plan, seed + 7)), None)]);
        assert!(*bench.identification == *expected, "{plan:?}");
        assert_eq!((bench.level.seed(), bench.identification.swarm_seed()), (seed + 7, seed + 7));
        // The new identification has no results yet.
        assert_eq!(bench.level.unpublished(), Some(None));
    }
}

#[test]
fn a_leg_that_stops_identifying_cancels_the_search() {
    let is_searching = |activity: LegEvent<2>| {
        let mut bench = Bench::new();
        bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Excite)]);
        let ticks: Vec<u32> = (1..=80).map(|sample| 8 * sample).collect();
        bench.receive(training(&ticks));
        bench.receive([logged(648, None), activity]);
        bench.work() != Slice::Idle || bench.finding().is_some()
    };
    assert!(is_searching(phase(IdentifyPhase::Solve)));
    assert!(!is_searching(LegEvent::Activity(Activity::Idle)));
    assert!(!is_searching(LegEvent::Activity(Activity::Track(Step::Run))));
}

#[test]
fn records_pass_in_order_and_the_activity_is_known() {
    let mut bench = Bench::new();
    assert!(!bench.receive([]));
    let records = [1, 2].map(|tick| Record::Request { tick, name: "identify", accepted: true });
    assert!(bench.receive(records.map(LegEvent::Record).into_iter().chain([phase(IdentifyPhase::Approach)])));
    assert_eq!(bench.records, records);
    assert_eq!(bench.level.activity(), Activity::Identify(IdentifyPhase::Approach));
}

#[test]
fn a_result_counts_only_after_control_has_taken_it() {
    let ticks: Vec<u32> = (1..=80).map(|sample| 8 * sample).collect();
    let judged = || {
        let mut bench = Bench::new();
        assert_eq!(Results::verdict(&*bench.identification), None);
        bench.receive([LegEvent::Begun(None, None), phase(IdentifyPhase::Excite)]);
        bench.level.published();
        bench.receive(training(&ticks));
        bench.receive([logged(648, None), phase(IdentifyPhase::Solve)]);
        let find = |bench: &mut Bench| {
            let slices = (0..100_000).find_map(|_| {
                assert!(!matches!(bench.work(), Slice::Judged(_)));
                bench.finding()
            });
            slices.expect("a finding")
        };
        let mut finding = find(&mut bench);
        if finding == Finding::Solved {
            for motion in 0..VALIDATION_MOTIONS as u8 {
                let at = 1000 * (1 + u32::from(motion));
                let samples =
                    (0..80).map(|sample| logged(at + 8 * sample, Some(Segment::Validation(motion))));
                bench.receive(samples.chain([logged(at + 640, None), phase(IdentifyPhase::Judge)]));
            }
            finding = find(&mut bench);
        }
        let Finding::Judged { verdict, .. } = finding else { panic!("{finding:?}") };
        assert!(!verdict.is_accepted(), "too few rows");
        assert_eq!(Results::verdict(&*bench.identification), Some(verdict));
        (bench, verdict)
    };
    let (mut bench, verdict) = judged();
    assert_eq!((bench.work(), bench.level.unpublished()), (Slice::Idle, None));
    // The result is taken and the leg does something else before the thread runs again.
    bench.receive([LegEvent::TookResult, LegEvent::Activity(Activity::Idle)]);
    assert_eq!((bench.work(), bench.level.unpublished()), (Slice::Judged(None), Some(Some(verdict))));
    bench.receive([]);
    assert_eq!(bench.work(), Slice::Idle, "once");
    // The operator stopped while the verdict was computed: control never takes it.
    let (mut bench, _) = judged();
    bench.receive([LegEvent::Activity(Activity::Idle)]);
    assert_eq!((bench.work(), bench.level.unpublished()), (Slice::Idle, None));
}
