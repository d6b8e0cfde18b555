//! Thread level on the board: the task around `operation::IdentificationLevel`, and the board's records.
//!
//! Urgent records are sent at once, the others at most once in 2 ms, so that the probe keeps up.

use core::sync::atomic::{AtomicU32, Ordering};

use embassy_time::{Duration, Instant, Timer};

use super::SIGNALS;
use super::bus::ThreadEnd;
use super::leg::{BASE, JOINTS, LEG, Leg, LegIdentification};
use crate::board::crash::Crash;
use crate::board::odrive_v3_6::settings::CLOCK_HZ;
use crate::board::odrive_v3_6::settings::analog::temperature_c;
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{brake, converter};
use crate::board::stack;
use crate::leg::{Activity, IdentifyPhase, LoggedSample};
use crate::operation::{IdentificationEnds, IdentificationLevel, Slice};
use crate::servo::{LOG_RATE_HZ, SERVO_RATE_HZ};
use crate::store::ModelRecord;
use crate::trace::{GRAMMAR, Record, Report, words};
use crate::units::Volt;

/// Evaluations of the search per slice: some 0.25 ms.
const EVALUATIONS: u32 = 4;
/// Shortest interval between two records that are not urgent.
const PACE: Duration = Duration::from_millis(2);
/// Interval of the records of the search's progress.
const PROGRESS: Duration = Duration::from_millis(250);
/// Interval of the records of loops and supply.
const LOOPS: Duration = Duration::from_secs(1);
/// Whether every sample of the log is sent; set when the image is built.
const SENDS_LOG: bool = option_env!("SCARAB_TRACE_LOG").is_some();

static NUMBER: AtomicU32 = AtomicU32::new(0);

fn send(record: &Record<JOINTS>) {
    record.emit(NUMBER.fetch_add(1, Ordering::Relaxed));
}

/// State of the thread.
pub struct Thread {
    /// Identification half of the leg.
    pub identification: &'static mut LegIdentification,
    /// The thread's ends of the queues.
    pub ends: IdentificationEnds<'static, JOINTS>,
    /// Bus voltage per code.
    pub volt_per_code: Volt,
    /// Results for the bus, if there is one, and the leg's configuration.
    pub bus: Option<(ThreadEnd, &'static Leg)>,
}

/// Mutable state of the task.
struct State {
    level: IdentificationLevel,
    report: Option<Report>,
    next_paced: Instant,
    next_progress: Instant,
    next_loops: Instant,
}

/// Sends the records of the start.
pub fn introduce(board: &Board) {
    let [uid0, uid1, uid2] = board.identity.unique;
    let [version, version_minor, version_volt] = board.identity.version;
    send(&Record::Boot {
        grammar: GRAMMAR,
        version: env!("CARGO_PKG_VERSION"),
        leg: LEG.name,
        joints: JOINTS as u8,
        base: BASE as u8,
        servo_hz: SERVO_RATE_HZ,
        log_hz: LOG_RATE_HZ,
        reset: board.identity.reset.name(),
    });
    let clock_hz = CLOCK_HZ;
    send(&Record::Board {
        uid0,
        uid1,
        uid2,
        version,
        version_minor,
        version_volt,
        clock_hz,
        brown_out: board.identity.brown_out,
    });
    if let Some(crash) = board.crash {
        let Crash { pc, lr, status, address, line, released, kept, .. } = *crash;
        let (cause, file) = (crash.cause(), crash.file());
        send(&Record::Crash { cause, pc, lr, status, address, line, file, released, kept });
    }
}

/// Task of the thread level.
#[embassy_executor::task]
pub async fn run(mut thread: Thread) -> ! {
    let now = Instant::now();
    let mut state = State {
        level: IdentificationLevel::new(thread.identification.swarm_seed()),
        report: None,
        next_paced: now,
        next_progress: now,
        next_loops: now,
    };
    loop {
        let received = state.level.receive(thread.identification, &mut thread.ends, send, log);
        let working = thread.work(&mut state);
        thread.publish(&mut state);
        thread.fill(&mut state);
        if received || working {
            embassy_futures_yield().await;
        } else {
            Timer::after_millis(1).await;
        }
    }
}

/// Sends a sample of the log, if the image is built for it.
fn log(logged: &LoggedSample<JOINTS>) {
    if SENDS_LOG {
        let (segment, motion) = words::segment(logged.segment);
        let sample = &logged.sample;
        send(&Record::Log {
            tick: sample.tick,
            segment,
            motion,
            position_rad: sample.position_rad,
            torque_nm: sample.torque_nm,
            counts: sample.counts_sum,
        });
    }
}

/// Yields to other tasks of this executor.
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
    /// Runs one slice; returns whether there was work.
    #[inline(never)]
    fn work(&mut self, state: &mut State) -> bool {
        match state.level.work(self.identification, EVALUATIONS, &mut self.ends, &SIGNALS, send) {
            Slice::Idle => false,
            Slice::Busy => true,
            Slice::Judged(model) => {
                state.report = Some(Report::default());
                if let (Some((bus, leg)), Some(model)) = (&mut self.bus, &model) {
                    let (seed, wearing) = (state.level.seed(), state.level.wearing());
                    bus.accept(ModelRecord::new(leg, self.identification, model, 0, seed, wearing));
                }
                true
            }
        }
    }

    /// Publishes results to the bus.
    #[inline(never)]
    fn publish(&mut self, state: &mut State) {
        let Some(verdict) = state.level.unpublished() else { return };
        if verdict.is_none() {
            state.report = None;
        }
        let Some((bus, _)) = &mut self.bus else { return state.level.published() };
        let identification = &*self.identification;
        let published = bus.publish(|found| match verdict {
            None => found.forget(),
            Some(_) => found.take(identification, verdict),
        });
        if published {
            state.level.published();
        }
    }

    /// Sends at most one record that is not urgent.
    #[inline(never)]
    fn fill(&mut self, state: &mut State) {
        let now = Instant::now();
        if now < state.next_paced {
            return;
        }
        state.next_paced = now + PACE;
        if let Some(note) = self.ends.notes.dequeue() {
            return send(&note);
        }
        if let Some(report) = &mut state.report {
            match report.advance(self.identification) {
                Some(record) => return send(&record),
                None => {
                    state.report = None;
                    self.send_loops(state);
                }
            }
        }
        if now >= state.next_progress
            && matches!(state.level.activity(), Activity::Identify(IdentifyPhase::Solve))
        {
            state.next_progress = now + PROGRESS;
            return self.send_progress(state);
        }
        if now >= state.next_loops {
            state.next_loops = now + LOOPS;
            self.send_loops(state);
            self.send_supply(state);
        }
    }

    fn send_progress(&self, state: &State) {
        let Some(solver) = self.identification.solver() else { return };
        let search = solver.search();
        send(&Record::Progress {
            tick: state.level.tick(),
            iterations: search.iterations(),
            evaluations: search.evaluations(),
            excess_chi2: search.stage_excess().unwrap_or(f32::NAN),
        });
    }

    fn send_supply(&self, state: &State) {
        let [now, low, high] = &SIGNALS.statistics.bus;
        let volt = |code: u32| self.volt_per_code.0 * code.min(4095) as f32;
        let [first, second, chopper] =
            converter::thermistors().map(|code| temperature_c(code).unwrap_or(f32::NAN));
        send(&Record::Supply {
            tick: state.level.tick(),
            bus_v: volt(now.get()),
            bus_low_v: volt(low.swap(u32::MAX)),
            bus_high_v: volt(high.swap(0)),
            bridge_c: [first, second],
            chopper_c: chopper,
            chopper_duty: brake::duty(),
            winding_c: core::array::from_fn(|joint| SIGNALS.winding_c(joint)),
        });
    }

    fn send_loops(&self, state: &State) {
        let statistics = &SIGNALS.statistics;
        let [current_worst, servo_worst] =
            [&statistics.current_worst, &statistics.servo_worst].map(|worst| worst.swap(0));
        for (longest, cycles) in statistics.longest_ns.iter().zip([current_worst, servo_worst]) {
            longest.set((cycles as f32 * (1e9 / CLOCK_HZ as f32)) as u32);
        }
        send(&Record::Loops {
            tick: state.level.tick(),
            current_worst,
            servo_worst,
            current_missed: statistics.current_missed.get(),
            servo_missed: statistics.servo_missed.get(),
            cycles_per_tick: CLOCK_HZ / SERVO_RATE_HZ,
            stack_used: stack::used(),
            stack_bytes: stack::bytes(),
            samples_lost: statistics.samples_lost.get(),
            records_lost: statistics.records_lost.get(),
        });
    }
}
