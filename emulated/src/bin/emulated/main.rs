//! The whole firmware over a simulated leg, for the emulated microcontroller (`cargo emulate`).
//!
//! Leg code, executors, priorities, search and records can run on a Cortex-M4F without a board. Crate and
//! tasks are those of the flash image; only a small board layer differs.
//!
//! | module | replaces |
//! | --- | --- |
//! | [`clock`] | timers: SysTick at 24 kHz, the executors' time, a clock that counts instructions |
//! | [`axes`] | converters and bridges: two axes on simulated sensors |
//! | [`machine`] | registers: only the servo can be requested |
//! | [`plant`] | the leg: `hal_sim::world` with ideal drives, a step per servo tick, outside firmware time |
//! | [`vectors`] | interrupts and their levels |
//! | [`bridges`] | the bridges' main outputs, which only a crash writes |
//! | [`rehearsal`] | causes of crashes |
//!
//! QEMU models neither PWM timers nor converters of this part, so the current loops cannot close here. The
//! loops run and are counted, and ideal drives that follow their targets produce the leg's torque.
//! `cargo sim identify --drive full` closes the loops on the host.
#![no_std]
#![no_main]

mod axes;
mod bridges;
mod clock;
mod machine;
#[path = "../count-instructions/motor.rs"]
mod motor;
mod plant;
mod rehearsal;
mod vectors;

use core::panic::PanicInfo;

use cortex_m_semihosting::{debug, heprintln};
use defmt_semihosting as _;
use embassy_executor::{SpawnToken, raw};
use rehearsal::Start;
use scarab::board::odrive_v3_6::settings::{analog, drives};
use scarab::board::{crash, stack};
use scarab::leg::{Control, Filters};
use scarab::motor::SenseScale;
use scarab::operation::{Ends, EventQueue, Queues, ServoLevel};
use scarab::safety::InhibitReason;
use scarab::task::identify::{BoardFunctions, Introduction, crashed};
use scarab::task::{SIGNALS, identify, leg, servo};
use scarab::trace::Record;
use static_cell::{ConstStaticCell, StaticCell};

#[cortex_m_rt::entry]
fn main() -> ! {
    stack::prepare();
    let found = crash::take();
    let start = rehearsal::start(found.is_some());
    if found.is_some() {
        SIGNALS.inhibit.raise(InhibitReason::Crash);
    }
    let crash = found.map(crashed);
    let introduction = Introduction { unique: [0; 3], version: [0; 3], reset: start.name(), crash };
    identify::introduce(&introduction, FUNCTIONS.clock_hz);
    let thread = hand_out(start);
    vectors::enable();
    SIGNALS.begin_servo();
    clock::start();
    if let Ok(task) = identify::run(thread) {
        spin(task);
    }
    refuse("the task of the identification is already running")
}

/// Polls the thread's executor in an endless loop. `embassy_executor::Executor::run` sleeps in between; the
/// emulator is six times slower for a processor that sleeps and wakes 24,000 times per second.
#[expect(unsafe_code, reason = "an executor is polled")]
fn spin<S>(task: SpawnToken<S>) -> ! {
    static EXECUTOR: StaticCell<raw::Executor> = StaticCell::new();
    let executor: &'static raw::Executor = EXECUTOR.init(raw::Executor::new(THREAD as *mut ()));
    executor.spawner().spawn(task);
    loop {
        // SAFETY: polled here only, at thread level, and never from within itself.
        unsafe { executor.poll() };
        rehearsal::in_thread();
    }
}

/// Identifier of the thread's executor in `embassy_executor`: woken by an event.
const THREAD: usize = usize::MAX;

/// Bus voltage.
const BUS_V: f32 = 48.0;

const FUNCTIONS: BoardFunctions = BoardFunctions {
    clock: clock::instructions,
    clock_hz: clock::INSTRUCTIONS_PER_S,
    stack_used: stack::used,
    stack_bytes: stack::bytes,
    volt_per_code: None,
    temperatures_c: || [f32::NAN; leg::JOINTS + 1],
    chopper_duty: || 0.0,
    reported: || end(true),
};

/// Builds both halves of the leg in place. A separate function like [`hand_out`], so that its stack is freed.
#[inline(never)]
fn halves() -> (Control<{ leg::JOINTS }>, &'static mut leg::LegIdentification) {
    let Ok(configuration) = leg::LEG.configuration() else { refuse("the leg's constants are invalid") };
    let Ok(filters) = Filters::new(configuration.bandwidth_hz) else {
        refuse("the leg's filter does not fit the device")
    };
    static WINDOW: ConstStaticCell<leg::LegWindow> = ConstStaticCell::new(leg::LegWindow::EMPTY);
    static IDENTIFICATION: StaticCell<leg::LegIdentification> = StaticCell::new();
    let place = IDENTIFICATION.uninit();
    let identification = leg::LegIdentification::place(place, &configuration, &filters, WINDOW.take());
    let Ok(control) = Control::new(&configuration) else {
        refuse("the leg's limits and motions are inconsistent")
    };
    (control, identification)
}

/// Passes every value to its level.
#[inline(never)]
fn hand_out(start: Start) -> identify::Thread {
    let (control, identification) = halves();
    static EVENTS: ConstStaticCell<EventQueue<{ leg::JOINTS }>> = ConstStaticCell::new(EventQueue::new());
    static QUEUES: ConstStaticCell<Queues<{ leg::JOINTS }>> = ConstStaticCell::new(Queues::new());
    let Ends { current, servo: ends, mut housekeeping, identification: identification_ends, .. } =
        QUEUES.take().split(EVENTS.take());
    let volt_per_code = analog::sense(SenseScale::DIVIDER).volt_per_code;
    let level = ServoLevel::new(&control, drives::derating(SenseScale::DIVIDER), volt_per_code, None);
    static SERVO: StaticCell<servo::ServoLoop> = StaticCell::new();
    let servo = SERVO.init(servo::ServoLoop { control, level, ends, clock: FUNCTIONS.clock });
    // The ideal drives need no supply; the leg reads a bus voltage that neither derates nor faults.
    SIGNALS.statistics.see_bus((BUS_V / volt_per_code.0) as u16);
    if let Some(mut home) = servo::SERVO.try_lock() {
        *home = Some(servo);
    }
    let causes = SIGNALS.inhibit.causes();
    if causes != 0 {
        let _ =
            housekeeping.notes.enqueue(Record::Refused { why: InhibitReason::Crash.name(), value: causes });
    }
    plant::prepare(current.samples, housekeeping.requests, housekeeping.drive, start);
    identify::Thread { identification, ends: identification_ends, board: FUNCTIONS, bus: None }
}

/// Ends the emulator.
fn end(success: bool) {
    debug::exit(if success { debug::EXIT_SUCCESS } else { debug::EXIT_FAILURE });
}

fn refuse(why: &str) -> ! {
    heprintln!("emulated: {}", why);
    end(false);
    loop {}
}

#[panic_handler]
fn panic(information: &PanicInfo<'_>) -> ! {
    crash::panic(information)
}
