//! What runs on the board, at which priority, and how values pass from one to the other.
//!
//! ```text
//! level 0  current     24 kHz, both axes a quarter of a period apart: converter, current loop, bridge       never masked
//! level 1  servo        4 kHz: both joints' samples, leg::Control, targets                                     never masked
//! level 6  housekeeping 500 Hz: operator, gate drivers, temperatures, calibration, watchdog                 executor
//! thread   identify     the rest of the time: leg::Identification, records to the probe                     executor
//! ```
//!
//! | from | to | by |
//! | --- | --- | --- |
//! | current | servo | queue of joint samples, one in six periods; the servo is pended after the second axis' |
//! | servo | current | one atomic word for each axis: the target, or released |
//! | housekeeping | current | queue of orders: a calibrator, an axis, a place, a cleared fault |
//! | current | housekeeping | queue of how calibrations ended |
//! | housekeeping | servo | queue of requests |
//! | servo | housekeeping | queue of drive states |
//! | servo | identify | one queue of samples and events, in their order |
//! | identify | servo | queue of findings |
//! | housekeeping | identify | queue of records |
//! | anyone | anyone | the [`interlock`]: one word that says why nothing may be enabled |
//!
//! Queues are lock-free with one producer and one consumer each; nobody waits for anybody. No critical section masks levels 0 and 1,
//! so the longest that delays them is none; the longest that delays anything else is one record's, some 5,000 instructions.
//! What each level works on lies behind a lock that is only tried: a handler that would interrupt itself finds it taken.

pub mod current;
pub mod housekeeping;
pub mod identify;
pub mod interlock;
pub mod leg;
pub mod links;
pub mod servo;
pub mod statistics;

use embassy_executor::Executor;
use static_cell::StaticCell;

use crate::board::odrive_v3_6::identity::Reset;
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{memory, vectors, watchdog};
use crate::hal::JointSample;
use crate::leg::{Activity, Control};
use interlock::Cause;

/// Builds the leg, hands everything to its level and starts them; does not return.
pub fn run(board: Board) -> ! {
    let (thread, keeping) = hand_out(board);
    vectors::enable();
    watchdog::tighten();
    let housekeeping = vectors::HOUSEKEEPING.start(vectors::HOUSEKEEPING_VECTOR);
    if let (Ok(watch), Ok(run)) = (housekeeping::watch(), housekeeping::run(keeping)) {
        housekeeping.spawn(watch);
        housekeeping.spawn(run);
    }
    static THREAD: StaticCell<Executor> = StaticCell::new();
    THREAD.init(Executor::new()).run(|spawner| {
        if let Some(Ok(task)) = thread.map(identify::run) {
            spawner.spawn(task);
        }
    })
}

/// Everything in its place; apart from [`run`], whose frame stays on the stack for ever.
#[inline(never)]
fn hand_out(board: Board) -> (Option<identify::Thread>, housekeeping::Housekeeping) {
    judge(&board);
    identify::introduce(&board);
    let built = memory::identification();
    let links::Links { orders, outcomes, samples, requests, findings, drive, told, notes } =
        links::Links::new();
    let [(give_1, take_1), (give_2, take_2)] = orders;
    let [(out_1, hear_1), (out_2, hear_2)] = outcomes;
    let [(sample_1, sampled_1), (sample_2, sampled_2)] = samples;
    let divider = analog::divider(board.identity.version).unwrap_or(LARGEST_DIVIDER);
    let loops = current::CurrentLoops::new([(take_1, out_1, sample_1), (take_2, out_2, sample_2)], divider);
    static LOOPS: StaticCell<current::CurrentLoops> = StaticCell::new();
    place(&current::LOOPS, LOOPS.init(loops));

    let control = built.as_ref().and_then(|(configuration, _)| Control::new(configuration).ok());
    match control {
        Some(control) => {
            static SERVO: StaticCell<servo::ServoLoop> = StaticCell::new();
            let servo = SERVO.init(servo::ServoLoop {
                control,
                samples: [sampled_1, sampled_2],
                requests: requests.1,
                findings: findings.1,
                drive: drive.0,
                told: told.0,
                sample: [JointSample::default(); leg::JOINTS],
                state: None,
                activity: Activity::Idle,
                tick: 0,
            });
            place(&servo::SERVO, servo);
        }
        None => interlock::raise(Cause::Configuration),
    }
    let keeping = housekeeping::Housekeeping {
        gate_drivers: board.gate_drivers,
        axes: drives::axes(&leg::LEG, divider),
        orders: [give_1, give_2],
        outcomes: [hear_1, hear_2],
        requests: requests.0,
        drive: drive.1,
        notes: notes.0,
    };
    let thread = built.map(|(_, identification)| identify::Thread {
        identification,
        told: told.1,
        findings: findings.0,
        notes: notes.1,
        volt_per_code: analog::sense(divider).volt_per_code,
    });
    (thread, keeping)
}

/// Of a board whose version is not known: no voltage is then taken for a smaller one, and nothing is enabled.
const LARGEST_DIVIDER: f32 = 19.0;

/// What the start found that speaks against enabling.
fn judge(board: &Board) {
    let found = [
        (board.crash.is_some(), Cause::Crash),
        (board.identity.reset == Reset::Watchdog, Cause::Watchdog),
        (board.gates_configured.contains(&false), Cause::GateConfiguration),
        (!board.timers_in_phase, Cause::Timers),
        (analog::divider(board.identity.version).is_none(), Cause::BoardVersion),
    ];
    for (_, cause) in found.into_iter().filter(|(found, _)| *found) {
        interlock::raise(cause);
    }
}

/// Nobody else holds the lock: the interrupts that take it are not enabled yet.
fn place<T>(home: &spin::Mutex<Option<T>>, value: T) {
    if let Some(mut home) = home.try_lock() {
        *home = Some(value);
    }
}
