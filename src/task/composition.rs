//! What the ODrive v3.6's image is put together from: every value to its level.

use embassy_executor::Executor;
use static_cell::StaticCell;

use super::interlock::{self, Cause};
use super::surroundings::{Introduction, Surroundings, crashed};
use super::{current, housekeeping, identify, leg, links, servo};
use crate::board::odrive_v3_6::identity::Reset;
use crate::board::odrive_v3_6::settings::analog::temperature_c;
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{brake, converter, memory, vectors, watchdog};
use crate::board::stack;
use crate::leg::Control;
use cortex_m::peripheral::DWT;

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
    let divider = analog::divider(board.identity.version).unwrap_or(LARGEST_DIVIDER);
    let surroundings = Surroundings {
        clock: DWT::cycle_count,
        clock_hz: board.clock_hz,
        stack_used: stack::used,
        stack_bytes: stack::bytes,
        volt_per_code: Some(analog::sense(divider).volt_per_code),
        temperatures_c: || converter::thermistors().map(|code| temperature_c(code).unwrap_or(f32::NAN)),
        chopper_duty: brake::duty,
        // Whoever listens has all the time there is.
        told: || (),
    };
    identify::introduce(&introduction(&board), board.clock_hz);
    let built = memory::identification();
    let links::Links { orders, outcomes, samples, requests, findings, drive, told, notes } =
        links::Links::new(memory::told());
    let [(give_1, take_1), (give_2, take_2)] = orders;
    let [(out_1, hear_1), (out_2, hear_2)] = outcomes;
    let [(sample_1, sampled_1), (sample_2, sampled_2)] = samples;
    let loops = current::Current::new([(take_1, out_1, sample_1), (take_2, out_2, sample_2)], divider);
    static LOOPS: StaticCell<current::Current> = StaticCell::new();
    place(&current::LOOPS, LOOPS.init(loops));

    let control = built.as_ref().and_then(|(configuration, _)| Control::new(configuration).ok());
    match control {
        Some(control) => {
            static SERVO: StaticCell<servo::ServoLoop> = StaticCell::new();
            let servo = SERVO.init(servo::ServoLoop::new(
                control,
                [sampled_1, sampled_2],
                requests.1,
                findings.1,
                drive.0,
                told.0,
                divider,
                surroundings.clock,
            ));
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
        surroundings,
    });
    (thread, keeping)
}

/// Of a board whose version is not known: no voltage is then taken for a smaller one, and nothing is enabled.
const LARGEST_DIVIDER: f32 = 19.0;

fn introduction(board: &Board) -> Introduction {
    let identity = &board.identity;
    let crash = board.crash.map(crashed);
    Introduction { unique: identity.unique, version: identity.version, reset: identity.reset.name(), crash }
}

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
