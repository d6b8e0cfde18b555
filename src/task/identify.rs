//! Thread: the identification, in slices, whenever nobody else wants the processor; and every record that leaves the board.
//!
//! Records are sent from here alone: whoever sends one holds a critical section for up to 5,000 instructions, which delays nothing
//! that matters from here. At most one in two milliseconds is sent of what can wait, so that the probe keeps up.
//!
//! **Gaps.** Samples come with their tick. One that is missing would bend every row it should have been in: the identification
//! is broken off, and what control waits for is told as refused for its input.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::{Duration, Instant, Timer};
use heapless::spsc::{Consumer, Producer};

use super::bus::{SEARCH, ThreadEnd};
use super::leg::{BASE, JOINTS, LEG, Leg, LegIdentification};
use super::links::Told;
use super::statistics;
use super::surroundings::{Introduction, Surroundings};
use crate::leg::{Activity, Finding, IdentifyPhase, LoggedSample, Reason, SearchState, Segment, Verdict};
use crate::servo::{LOG_RATE_HZ, SERVO_RATE_HZ, TICKS_PER_LOG};
use crate::store::KeptModel;
use crate::trace::{GRAMMAR, Record, Report, judged, words};

/// Evaluations of the search in one slice: some 0.25 ms.
const EVALUATIONS: u32 = 4;
/// What can wait is told at most this often.
const PACE: Duration = Duration::from_millis(2);
/// Progress of the search, loops and supply.
const PROGRESS: Duration = Duration::from_millis(250);
const LOOPS: Duration = Duration::from_secs(1);
/// Every sample of the log is told: asked for when the image is built.
const TELLS_LOG: bool = option_env!("SCARAB_TRACE_LOG").is_some();

static NUMBER: AtomicU32 = AtomicU32::new(0);

fn tell(record: &Record<JOINTS>) {
    record.emit(NUMBER.fetch_add(1, Ordering::Relaxed));
}

/// What the thread works on.
pub struct Thread {
    /// The half of the leg that finds out.
    pub identification: &'static mut LegIdentification,
    /// From the servo.
    pub told: Consumer<'static, Told>,
    /// To the servo.
    pub findings: Producer<'static, Finding<JOINTS>>,
    /// From the housekeeping.
    pub notes: Consumer<'static, Record<JOINTS>>,
    /// The board.
    pub surroundings: Surroundings,
    /// The bus, where there is one, and what the leg was built from.
    pub bus: Option<(ThreadEnd, &'static Leg)>,
}

/// What changes.
struct State {
    activity: Activity,
    /// Tick and segment of the sample before.
    last: Option<(u32, Segment)>,
    /// A sample was lost in this identification.
    gap: bool,
    /// Of this identification's random numbers.
    seed: u64,
    /// The bus is to answer with what there is now, and this verdict.
    publish: Option<Option<Verdict>>,
    report: Option<Report>,
    next_paced: Instant,
    next_progress: Instant,
    next_loops: Instant,
}

/// What is told once at the start.
pub fn introduce(introduction: &Introduction, clock_hz: u32) {
    let Introduction { unique, version, reset, crash } = introduction;
    let ([uid0, uid1, uid2], [version, version_minor, version_volt]) = (*unique, *version);
    tell(&Record::Boot {
        grammar: GRAMMAR,
        version: env!("CARGO_PKG_VERSION"),
        leg: LEG.name,
        joints: JOINTS as u8,
        base: BASE as u8,
        servo_hz: SERVO_RATE_HZ,
        log_hz: LOG_RATE_HZ,
        reset,
    });
    tell(&Record::Board { uid0, uid1, uid2, version, version_minor, version_volt, clock_hz });
    if let Some(crash) = crash {
        tell(crash);
    }
}

/// Runs for ever.
#[embassy_executor::task]
pub async fn run(mut thread: Thread) -> ! {
    let now = Instant::now();
    let mut state = State {
        activity: Activity::Idle,
        last: None,
        gap: false,
        seed: thread.identification.swarm_seed(),
        publish: None,
        report: None,
        next_paced: now,
        next_progress: now,
        next_loops: now,
    };
    loop {
        let heard = thread.hear(&mut state);
        let working = thread.work(&mut state);
        thread.publish(&mut state);
        thread.speak(&mut state);
        if heard || working {
            embassy_futures_yield().await;
        } else {
            Timer::after_millis(1).await;
        }
    }
}

/// Gives others of this executor their turn.
async fn embassy_futures_yield() {
    let mut yielded = false;
    core::future::poll_fn(|context| {
        if core::mem::replace(&mut yielded, true) {
            return core::task::Poll::Ready(());
        }
        context.waker().wake_by_ref();
        core::task::Poll::Pending
    })
    .await;
}

impl Thread {
    /// Takes what the servo told; whether there was anything.
    #[inline(never)]
    fn hear(&mut self, state: &mut State) -> bool {
        let mut heard = false;
        // No more than there is room for at once, so that the search is not starved by what comes meanwhile.
        for _ in 0..super::links::TOLD {
            let Some(told) = self.told.dequeue() else { break };
            heard = true;
            match told {
                Told::Sample(logged) => self.take(&logged, state),
                Told::Begun(prepared) => {
                    self.identification.cancel();
                    if let Some((plan, seed)) = prepared {
                        self.identification.prepare(plan, seed);
                        state.seed = seed;
                    }
                    (state.gap, state.report) = (false, None);
                    state.publish = Some(None);
                }
                Told::Activity(activity) => {
                    state.activity = activity;
                    if !matches!(activity, Activity::Identify(_)) {
                        self.identification.cancel();
                    }
                }
                Told::TookUpdate => self.identification.take_update(),
                Told::Say(record) => tell(&record),
            }
        }
        heard
    }

    #[inline(never)]
    fn take(&mut self, logged: &LoggedSample<JOINTS>, state: &mut State) {
        let tick = logged.sample.tick;
        if let (Some((before, segment)), Some(now)) = (state.last, logged.segment)
            && segment == now
            && tick.wrapping_sub(before) != TICKS_PER_LOG
        {
            state.gap = true;
        }
        state.last = logged.segment.map(|segment| (tick, segment));
        if TELLS_LOG {
            let (segment, motion) = words::segment(logged.segment);
            let sample = &logged.sample;
            tell(&Record::Log {
                tick,
                segment,
                motion,
                position_rad: sample.position_rad,
                torque_nm: sample.torque_nm,
                counts: sample.counts_sum,
            });
        }
        if !state.gap {
            self.identification.push(logged);
        }
    }

    /// One slice; whether there was anything to do.
    #[inline(never)]
    fn work(&mut self, state: &mut State) -> bool {
        use IdentifyPhase::{Judge, Settle, Solve};
        if state.gap {
            if let Activity::Identify(Settle | Solve | Judge) = state.activity {
                state.gap = false;
                self.identification.cancel();
                let verdict = Verdict::refused(Reason::Input);
                tell(&Record::Refused { why: "samples_lost", value: statistics::SAMPLES_LOST.get() });
                let _ = self.findings.enqueue(Finding::Judged { verdict, model: None });
                state.publish = Some(Some(verdict));
            }
            return false;
        }
        let Some(finding) = self.identification.advance(EVALUATIONS) else {
            let Some(solver) = self.identification.solver() else { return false };
            let search = solver.search();
            SEARCH[0].set(search.iterations());
            SEARCH[1].set(search.evaluations());
            return search.state() == SearchState::Running;
        };
        match &finding {
            Finding::Solved => {}
            Finding::Judged { verdict, model } => {
                state.report = Some(Report::default());
                state.publish = Some(Some(*verdict));
                if let (Some((bus, leg)), Some(model)) = (&mut self.bus, model) {
                    bus.accept(KeptModel::of(leg, self.identification, model, 0, state.seed));
                }
            }
            Finding::Changed(change) => tell(&Record::Change {
                since_s: change.since_s,
                joints: change.joints,
                statistic: change.statistic,
                limit: change.limit,
            }),
            Finding::Updated { cause, verdict, model } => {
                let (cause, link) = words::cause(*cause);
                let verdict = judged(verdict.is_accepted());
                tell(&Record::Update { cause, link, verdict, offered: model.is_some() });
            }
        }
        // Control takes one in every tick.
        let _ = self.findings.enqueue(finding);
        true
    }

    /// Results as the bus answers with them.
    #[inline(never)]
    fn publish(&mut self, state: &mut State) {
        let (Some(verdict), Some((bus, _))) = (state.publish, &mut self.bus) else { return };
        let identification = &*self.identification;
        let published = bus.publish(|found| match verdict {
            None => found.forget(),
            Some(_) => found.take(identification, verdict),
        });
        if published {
            state.publish = None;
        }
    }

    /// What can wait.
    #[inline(never)]
    fn speak(&mut self, state: &mut State) {
        let now = Instant::now();
        if now < state.next_paced {
            return;
        }
        state.next_paced = now + PACE;
        if let Some(note) = self.notes.dequeue() {
            return tell(&note);
        }
        if let Some(report) = &mut state.report {
            match report.advance(self.identification) {
                Some(record) => return tell(&record),
                None => {
                    state.report = None;
                    self.tell_loops(state);
                    (self.surroundings.told)();
                }
            }
        }
        if now >= state.next_progress && matches!(state.activity, Activity::Identify(IdentifyPhase::Solve)) {
            state.next_progress = now + PROGRESS;
            return self.tell_progress(state);
        }
        if now >= state.next_loops {
            state.next_loops = now + LOOPS;
            self.tell_loops(state);
            self.tell_supply(state);
        }
    }

    fn tell_progress(&self, state: &State) {
        let Some(solver) = self.identification.solver() else { return };
        let search = solver.search();
        tell(&Record::Progress {
            tick: state.last.map_or(0, |(tick, _)| tick),
            iterations: search.iterations(),
            evaluations: search.evaluations(),
            excess_chi2: search.stage_excess().unwrap_or(f32::NAN),
        });
    }

    fn tell_supply(&self, state: &State) {
        let board = &self.surroundings;
        let Some(volt_per_code) = board.volt_per_code else { return };
        let [now, low, high] = &statistics::BUS;
        let volt = |code: u32| volt_per_code.0 * code.min(4095) as f32;
        let [first, second, chopper] = (board.temperatures_c)();
        tell(&Record::Supply {
            tick: state.last.map_or(0, |(tick, _)| tick),
            bus_v: volt(now.get()),
            bus_low_v: volt(low.swap(u32::MAX)),
            bus_high_v: volt(high.swap(0)),
            bridge_c: [first, second],
            chopper_c: chopper,
            chopper_duty: (board.chopper_duty)(),
        });
    }

    fn tell_loops(&self, state: &State) {
        let board = &self.surroundings;
        tell(&Record::Loops {
            tick: state.last.map_or(0, |(tick, _)| tick),
            current_worst: statistics::CURRENT_WORST.swap(0),
            servo_worst: statistics::SERVO_WORST.swap(0),
            current_missed: statistics::CURRENT_MISSED.get(),
            servo_missed: statistics::SERVO_MISSED.get(),
            cycles_per_tick: board.clock_hz / SERVO_RATE_HZ,
            stack_used: (board.stack_used)(),
            stack_bytes: (board.stack_bytes)(),
            samples_lost: statistics::SAMPLES_LOST.get(),
            records_lost: statistics::RECORDS_LOST.get(),
        });
    }
}
