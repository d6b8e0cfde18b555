//! What the ODrive v3.6's image is put together from: every value to its level.

use embassy_executor::Executor;
use heapless::spsc::{Consumer, Producer, Queue};
use static_cell::{ConstStaticCell, StaticCell};

use super::interlock::{self, Cause};
use super::leg::JOINTS;
use super::surroundings::{Introduction, Surroundings, crashed};
use super::{bus, current, host, housekeeping, identify, keep, leg, links, servo};
use crate::board::odrive_v3_6::identity::{Identity, Reset};
use crate::board::odrive_v3_6::settings::analog::temperature_c;
use crate::board::odrive_v3_6::settings::can::USUAL_KBIT;
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{brake, can, converter, memory, vectors, watchdog};
use crate::board::stack;
use crate::bus::drive::{AxisConstants, Mode};
use crate::bus::{LONGEST, NodeId, Storing};
use crate::leg::{Control, Following, StoredCalibration};
use crate::trace::Record;
use cortex_m::peripheral::DWT;

/// Builds the leg, hands everything to its level and starts them; does not return.
pub fn run(board: Board) -> ! {
    let (thread, keeping, keeper) = hand_out(board);
    vectors::enable();
    if !watchdog::tighten_at_once() {
        interlock::raise(Cause::Watchdog);
    }
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
        if let Some(Ok(task)) = keeper.map(keep::run) {
            spawner.spawn(task);
        }
    })
}

/// Everything in its place; apart from [`run`], whose frame stays on the stack for ever.
#[inline(never)]
fn hand_out(
    board: Board,
) -> (Option<identify::Thread>, housekeeping::Housekeeping, Option<&'static mut keep::Keeper>) {
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
    let links::Links { orders, outcomes, samples, requests, findings, drive, told, mut notes } =
        links::Links::new(memory::told());
    let [(give_1, take_1), (give_2, take_2)] = orders;
    let [(out_1, hear_1), (out_2, hear_2)] = outcomes;
    let [(sample_1, sampled_1), (sample_2, sampled_2)] = samples;
    let loops = current::Current::new([(take_1, out_1, sample_1), (take_2, out_2, sample_2)], divider);
    static LOOPS: StaticCell<current::Current> = StaticCell::new();
    place(&current::LOOPS, LOOPS.init(loops));

    let mut control = built.as_ref().and_then(|(configuration, _)| Control::new(configuration).ok());
    static CALIBRATED: ConstStaticCell<Queue<keep::Calibrated, 4>> = ConstStaticCell::new(Queue::new());
    let (tell, calibrated) = CALIBRATED.take().split();
    let (link, results, keeper, stored) = match (&built, &mut control) {
        (Some((configuration, _)), Some(control)) => {
            join(configuration, control, &board.identity, calibrated, &mut notes.0)
        }
        _ => Joined::default(),
    };
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
                link,
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
        stored,
        calibrated: tell,
        requests: requests.0,
        drive: drive.1,
        notes: notes.0,
    };
    let thread = built.map(|(configuration, identification)| identify::Thread {
        identification,
        told: told.1,
        findings: findings.0,
        notes: notes.1,
        surroundings,
        bus: results.map(|results| (results, configuration)),
    });
    (thread, keeping, keeper)
}

/// The numbers of hip and knee, where nothing else is kept.
const NODES: [NodeId; JOINTS] = match (NodeId::new(1), NodeId::new(2)) {
    (Some(hip), Some(knee)) => [hip, knee],
    _ => panic!("both are numbers of nodes"),
};

const WIRE: bus::Wire = bus::Wire {
    now_us: || embassy_time::Instant::now().as_micros(),
    waiting: can::waiting,
    send: can::send,
    give_up: can::give_up,
    status: can::status,
    held: housekeeping::permits,
};

/// Ends of the bus: the servo's, the identification's, the keeper; and the calibrations that are kept.
type Joined = (
    Option<host::HostLink>,
    Option<bus::ThreadEnd>,
    Option<&'static mut keep::Keeper>,
    [Option<StoredCalibration>; JOINTS],
);

/// The bus, with what was kept before; the controller takes part from here on.
#[inline(never)]
fn join(
    configuration: &leg::Leg,
    control: &mut Control<JOINTS>,
    identity: &Identity,
    calibrated: Consumer<'static, keep::Calibrated>,
    notes: &mut Producer<'static, Record<JOINTS>>,
) -> Joined {
    let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
    let constants = configuration.joints.each_ref().map(|joint| AxisConstants {
        rated_torque: joint.limits().torque_cap(),
        rated_current: joint.current,
        modes,
    });
    let [low, middle, high] = identity.unique;
    let told = crate::bus::Identity::scarab(low ^ middle ^ high, "ODrive v3.6");
    let (plan, seed) = (configuration.plan, configuration.swarm_seed);
    let station = memory::station(|| bus::BoardStation::new(NODES, told, constants, plan, seed));
    let mut keeper = memory::keeper();
    let mut calibrations = [None; JOINTS];
    // Reading may repair what a cut of the power left, which erases: nothing may switch yet, and the watchdog still has the start's 4 s.
    if let Some(keeper) = &mut keeper {
        calibrations = keeper.calibrations();
        for joint in 0..JOINTS {
            let mut bytes = [0; LONGEST];
            match keeper.objects(joint, &mut bytes) {
                Some(length) => station.recall(joint, bytes.get(..length).unwrap_or_default()),
                // Hosts are told that what was kept is lost.
                None => station.storing(Storing::Failed),
            }
        }
        match keeper.model(configuration) {
            Some(Some((model, generation))) if control.adopt(model) => station.set_generation(generation),
            Some(None) => {}
            _ => station.storing(Storing::Failed),
        }
    }
    // One that does not answer is off the bus for good (`can::status`): the leg is its operator's, and who listens is told.
    if !can::start(station.bit_rate().unwrap_or(USUAL_KBIT)) {
        let _ = notes.enqueue(Record::AxisFault { tick: 0, joint: 0, name: "bus_controller" });
    }
    let (frames, servo, thread, end, bus) = memory::bus().split(station, WIRE);
    static BUS: StaticCell<bus::BusLoop> = StaticCell::new();
    place(&bus::BUS, BUS.init(bus));
    place(&bus::FRAMES_IN, frames);
    if let Some(keeper) = &mut keeper {
        keeper.serve(end, calibrated);
    }
    let link = host::HostLink::new(servo, Following::new(configuration), can::pend, housekeeping::permits);
    (Some(link), Some(thread), keeper, calibrations)
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
