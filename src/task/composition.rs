//! Composition of the ODrive v3.6 image: hands every value to its level.

use embassy_executor::Executor;
use heapless::spsc::{Consumer, Producer};
use static_cell::{ConstStaticCell, StaticCell};

use super::leg::JOINTS;
use super::surroundings::{Introduction, Surroundings, crashed};
use super::{SIGNALS, bus, current, housekeeping, identify, keep, leg, servo};
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::board::odrive_v3_6::identity::{Identity, Reset};
use crate::board::odrive_v3_6::settings::analog::{HOTTEST_C, temperature_c};
use crate::board::odrive_v3_6::settings::can::USUAL_KBIT;
use crate::board::odrive_v3_6::settings::drives::CALIBRATION;
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{brake, can, converter, memory, vectors, watchdog};
use crate::board::stack;
use crate::bus::drive::{AxisConstants, Mode};
use crate::bus::{LONGEST, NodeId, Storing};
use crate::leg::{Control, Following, StoredCalibration};
use crate::operation::{
    Calibrated, Ends, HostEnds, Housekeeper, HousekeepingEnds, HousekeepingSettings, Queues, ServoLevel,
};
use crate::safety::Cause;
use crate::trace::Record;
use cortex_m::peripheral::DWT;

/// Arguments of the housekeeping's task.
type Housekeeping = (Housekeeper<JOINTS>, HousekeepingEnds<'static, JOINTS>, Odrive);

/// Builds the leg, hands everything to its level and starts the levels; does not return.
pub fn run(board: Board) -> ! {
    let (thread, keeping, keeper) = hand_out(board);
    vectors::enable();
    if !watchdog::tighten_at_once() {
        // The keeper asks again until the watchdog has its time; without a keeper nothing does.
        SIGNALS.inhibit.raise(if keeper.is_some() { Cause::Watchdog } else { Cause::Configuration });
    }
    let housekeeping = vectors::HOUSEKEEPING.start(vectors::HOUSEKEEPING_VECTOR);
    let (housekeeper, ends, board) = keeping;
    if let (Ok(watch), Ok(run)) = (housekeeping::watch(), housekeeping::run(housekeeper, ends, board)) {
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

/// Builds and hands out everything. Separate from [`run`], whose frame stays on the stack for ever.
#[inline(never)]
fn hand_out(board: Board) -> (Option<identify::Thread>, Housekeeping, Option<&'static mut keep::Keeper>) {
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
        // The probe reads at its own pace; nothing to do.
        told: || (),
    };
    identify::introduce(&introduction(&board), board.clock_hz);
    let built = memory::identification();
    static QUEUES: ConstStaticCell<Queues<JOINTS>> = ConstStaticCell::new(Queues::new());
    let Ends {
        current,
        servo: mut servo_ends,
        housekeeping: mut housekeeping_ends,
        identification,
        calibrated,
    } = QUEUES.take().split(memory::events());
    static LOOPS: StaticCell<current::Current> = StaticCell::new();
    place(&current::LOOPS, LOOPS.init(current::Current::new(current, divider)));

    let mut control = built.as_ref().and_then(|(configuration, _)| Control::new(configuration).ok());
    let notes = &mut housekeeping_ends.notes;
    let Joined { host, following, results, keeper, stored } = match (&built, &mut control) {
        (Some((configuration, _)), Some(control)) => {
            join(configuration, control, &board.identity, calibrated, notes)
        }
        _ => Joined::default(),
    };
    servo_ends.host = host;
    match control {
        Some(control) => {
            let volt_per_code = analog::sense(divider).volt_per_code;
            let level = ServoLevel::new(&control, drives::derating(divider), volt_per_code, following);
            static SERVO: StaticCell<servo::ServoLoop> = StaticCell::new();
            let clock = surroundings.clock;
            place(&servo::SERVO, SERVO.init(servo::ServoLoop { control, level, ends: servo_ends, clock }));
        }
        None => SIGNALS.inhibit.raise(Cause::Configuration),
    }
    let axes = drives::axes(&leg::LEG, divider);
    let settings = HousekeepingSettings { axes, calibration: [CALIBRATION; JOINTS], hottest_c: HOTTEST_C };
    let housekeeper = Housekeeper::new(settings).with_stored(stored);
    let thread = built.map(|(configuration, built)| identify::Thread {
        identification: built,
        ends: identification,
        surroundings,
        bus: results.map(|results| (results, configuration)),
    });
    (thread, (housekeeper, housekeeping_ends, Odrive::new(board.gate_drivers)), keeper)
}

/// Default node numbers of hip and knee.
const NODES: [NodeId; JOINTS] = match (NodeId::new(1), NodeId::new(2)) {
    (Some(hip), Some(knee)) => [hip, knee],
    _ => panic!("both are numbers of nodes"),
};

/// Ends of the bus for servo, identification and storage; and the stored calibrations.
#[derive(Default)]
struct Joined {
    host: Option<HostEnds<'static, JOINTS>>,
    following: Option<Following<JOINTS>>,
    results: Option<bus::ThreadEnd>,
    keeper: Option<&'static mut keep::Keeper>,
    stored: [Option<StoredCalibration>; JOINTS],
}

/// Builds the bus with the stored parameters; from here on the controller takes part.
#[inline(never)]
fn join(
    configuration: &leg::Leg,
    control: &mut Control<JOINTS>,
    identity: &Identity,
    calibrated: Consumer<'static, Calibrated>,
    notes: &mut Producer<'static, Record<JOINTS>>,
) -> Joined {
    let modes = Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit());
    let constants = core::array::from_fn(|joint| {
        let (joint, motor) = (&configuration.joints[joint], &leg::LEG.joints[joint].motor);
        AxisConstants {
            rated_torque: joint.limits().torque_cap(),
            rated_current: joint.current,
            modes,
            torque_per_ampere: joint.scale.torque_per_ampere,
            speed: joint.speed,
            counts_per_turn: motor.counts_per_turn,
            ratio: motor.ratio,
        }
    });
    let [low, middle, high] = identity.unique;
    let told = crate::bus::Identity::scarab(low ^ middle ^ high, "ODrive v3.6");
    let (plan, seed) = (configuration.plan, configuration.swarm_seed);
    let device = memory::device(|| bus::BoardDevice::new(NODES, told, constants, plan, seed));
    let mut keeper = memory::keeper();
    let mut calibrations = [None; JOINTS];
    // Reading may repair the effects of a power loss, which erases flash. Nothing may switch yet, and the
    // watchdog still has the 4 s of the start.
    if let Some(keeper) = &mut keeper {
        calibrations = keeper.calibrations();
        for joint in 0..JOINTS {
            let mut bytes = [0; LONGEST];
            match keeper.objects(joint, &mut bytes) {
                Some(length) => device.recall(joint, bytes.get(..length).unwrap_or_default()),
                // Reports to hosts that stored parameters are lost.
                None => device.storing(Storing::Failed),
            }
        }
        match keeper.model(configuration) {
            Some(Some((model, generation))) if control.adopt(model) => device.set_generation(generation),
            Some(None) => {}
            _ => device.storing(Storing::Failed),
        }
    }
    // A controller that does not answer stays off (`can::status`): the operator keeps the leg, and a record
    // reports the fault.
    if !can::start(device.bit_rate().unwrap_or(USUAL_KBIT)) {
        let _ = notes.enqueue(Record::AxisFault { tick: 0, joint: 0, name: "bus_controller" });
    }
    let (frames, servo, thread, end, bus) = memory::bus().split(device);
    static BUS: StaticCell<bus::BusLoop> = StaticCell::new();
    place(&bus::BUS, BUS.init(bus));
    place(&bus::FRAMES_IN, frames);
    if let Some(keeper) = &mut keeper {
        keeper.serve(end, calibrated);
    }
    let following = Some(Following::new(configuration));
    Joined { host: Some(servo), following, results: Some(thread), keeper, stored: calibrations }
}

/// Divider for a board of unknown version: no voltage reads too low with it, and nothing is enabled.
const LARGEST_DIVIDER: f32 = 19.0;

fn introduction(board: &Board) -> Introduction {
    let identity = &board.identity;
    let crash = board.crash.map(crashed);
    Introduction { unique: identity.unique, version: identity.version, reset: identity.reset.name(), crash }
}

/// Raises the inhibit reasons that the start found.
fn judge(board: &Board) {
    let found = [
        (board.crash.is_some(), Cause::Crash),
        (board.identity.reset == Reset::Watchdog, Cause::Watchdog),
        (board.gates_configured.contains(&false), Cause::GateConfiguration),
        (!board.timers_in_phase, Cause::Timers),
        (analog::divider(board.identity.version).is_none(), Cause::BoardVersion),
    ];
    for (_, cause) in found.into_iter().filter(|(found, _)| *found) {
        SIGNALS.inhibit.raise(cause);
    }
}

/// Fills a lock. No other code holds it: the interrupts that take it are not enabled yet.
fn place<T>(home: &spin::Mutex<Option<T>>, value: T) {
    if let Some(mut home) = home.try_lock() {
        *home = Some(value);
    }
}
