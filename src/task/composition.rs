//! Composition of the ODrive v3.6 image: hands every value to its level.

use embassy_executor::Executor;
use heapless::spsc::{Consumer, Producer};
use static_cell::{ConstStaticCell, StaticCell};

use super::leg::JOINTS;
use super::{SIGNALS, assist, bus, current, housekeeping, identify, leg, memory, servo, storage, vectors};
use crate::board::odrive_v3_6::hardware::Odrive;
use crate::board::odrive_v3_6::identity::{Identity, Reset};
use crate::board::odrive_v3_6::settings::analog::HOTTEST_C;
use crate::board::odrive_v3_6::settings::can::USUAL_KBIT;
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::board::odrive_v3_6::start::Board;
use crate::board::odrive_v3_6::{can, converter, holding_brake, program, status_light, watchdog};
use crate::board::windings;
use crate::bus::drive::AxisConstants;
use crate::bus::{LONGEST, NodeId, Storing};
use crate::leg::{Control, Following, StoredCalibration};
use crate::motor::SenseScale;
use crate::operation::{
    AssistQueues, Calibrated, EncoderSettings, Ends, HostEnds, Housekeeper, HousekeepingEnds,
    HousekeepingSettings, Queues, ServoLevel,
};
use crate::safety::InhibitReason;
use crate::store::Key;
use crate::trace::Record;

/// Arguments of the housekeeping's task.
type Housekeeping = (Housekeeper<JOINTS>, HousekeepingEnds<'static, JOINTS>, Odrive);

/// Builds the leg, hands everything to its level and starts the levels; does not return.
pub fn run(board: Board) -> ! {
    let (thread, keeping, storage) = hand_out(board);
    vectors::enable();
    if !watchdog::tighten_at_once() {
        // The storage task requests it again until the watchdog has its time; without that task nothing does.
        SIGNALS.inhibit.raise(if storage.is_some() {
            InhibitReason::Watchdog
        } else {
            InhibitReason::Configuration
        });
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
        if let Some(Ok(task)) = storage.map(storage::run) {
            spawner.spawn(task);
        }
    })
}

/// Builds and hands out everything. Separate from [`run`], whose frame stays on the stack for ever.
#[inline(never)]
fn hand_out(
    board: Board,
) -> (Option<identify::Thread>, Housekeeping, Option<&'static mut storage::StorageTask>) {
    judge(&board);
    // With the largest divider no voltage reads too low; a board of unknown version enables nothing.
    let divider = analog::divider(board.identity.version).unwrap_or(SenseScale::DIVIDER);
    let volt_per_code = analog::sense(divider).volt_per_code;
    identify::introduce(&board);
    let built = memory::identification();
    static QUEUES: ConstStaticCell<Queues<JOINTS>> = ConstStaticCell::new(Queues::new());
    const { assert!(!status_light::HAS_LIGHT || leg::LEG.holding_brake.is_none(), "both use GPIO6") };
    status_light::prepare();
    let Ends {
        current,
        servo: mut servo_ends,
        housekeeping: mut housekeeping_ends,
        identification,
        calibrated,
    } = QUEUES.take().split(memory::events());
    static LOOPS: StaticCell<current::Current> = StaticCell::new();
    install(&current::LOOPS, LOOPS.init(current::Current::new(current, divider)));
    static ASSIST_QUEUES: ConstStaticCell<AssistQueues<JOINTS>> = ConstStaticCell::new(AssistQueues::new());
    let (servo_assist, assist_ends) = ASSIST_QUEUES.take().split();
    servo_ends.assist = Some(servo_assist);
    static ASSIST: StaticCell<assist::AssistLoop> = StaticCell::new();
    install(&assist::ASSIST, ASSIST.init(assist::AssistLoop::new(assist_ends)));

    let mut control = built.as_ref().and_then(|(configuration, _)| Control::new(configuration).ok());
    let notes = &mut housekeeping_ends.notes;
    let Joined { host, following, results, storage, stored } = match (&built, &mut control) {
        (Some((configuration, _)), Some(control)) => {
            join(configuration, control, &board.identity, calibrated, notes)
        }
        _ => Joined::default(),
    };
    servo_ends.host = host;
    match control {
        Some(control) => {
            let level = ServoLevel::new(&control, drives::derating(divider), volt_per_code, following)
                .with_supply(leg::LEG.supply)
                .with_holding_brake(leg::LEG.holding_brake);
            if leg::LEG.holding_brake.is_some() {
                holding_brake::prepare();
            }
            static SERVO: StaticCell<servo::ServoLoop> = StaticCell::new();
            install(&servo::SERVO, SERVO.init(servo::ServoLoop { control, level, ends: servo_ends }));
        }
        None => SIGNALS.inhibit.raise(InhibitReason::Configuration),
    }
    let axes = drives::axes(&leg::LEG, divider);
    let calibration = drives::calibrations(&leg::LEG);
    let windings = leg::LEG.joints.map(|joint| joint.motor.winding);
    let encoders = leg::LEG.joints.map(|joint| EncoderSettings::new(&joint.motor));
    let thermistors = leg::LEG.joints.map(|joint| joint.motor.thermistor);
    converter::prepare_thermistors(thermistors.map(|thermistor| thermistor.is_some()));
    let hottest_c = HOTTEST_C;
    let assist = leg::LEG.assist;
    let settings =
        HousekeepingSettings { axes, calibration, hottest_c, windings, thermistors, encoders, assist };
    let mut housekeeper = Housekeeper::new(settings).with_stored(stored);
    // Random memory after a power-up does not have the checksum.
    if let Some(celsius) = windings::stored() {
        housekeeper = housekeeper.with_windings(celsius);
    }
    let thread = built.map(|(configuration, built)| identify::Thread {
        identification: built,
        ends: identification,
        volt_per_code,
        bus: results.map(|results| (results, configuration)),
    });
    (thread, (housekeeper, housekeeping_ends, Odrive::new(board.gate_drivers)), storage)
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
    storage: Option<&'static mut storage::StorageTask>,
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
    let constants = core::array::from_fn(|joint| {
        let motor = &leg::LEG.joints[joint].motor;
        AxisConstants::new(
            &configuration.joints[joint],
            motor.counts_per_turn,
            motor.ratio,
            drives::BANDWIDTH,
        )
    });
    let serial = crate::bus::Identity::serial(identity.unique);
    let checksum = program::checksum();
    let identity = crate::bus::Identity { checksum, ..crate::bus::Identity::scarab(serial, "ODrive v3.6") };
    let (plan, seed) = (configuration.plan, configuration.swarm_seed);
    let device = memory::device(|| bus::BoardDevice::new(NODES, identity, constants, plan, seed));
    let mut storage = memory::storage();
    let mut calibrations = [None; JOINTS];
    // Reading may repair the effects of a power loss, which erases flash. Nothing may switch yet, and the
    // watchdog still has the 4 s of the start.
    if let Some(storage) = &mut storage {
        calibrations = storage.calibrations();
        for joint in 0..JOINTS {
            let mut bytes = [0; LONGEST];
            match storage.objects(joint, &mut bytes) {
                Some(length) => device.recall(joint, bytes.get(..length).unwrap_or_default()),
                // Reports to hosts that stored parameters are lost.
                None => device.storing(Storing::Failed),
            }
        }
        let mut newest = 0;
        for key in Key::MODELS {
            match storage.model(configuration, key) {
                Some(Some(restored)) if take_model(control, key, &restored) => {
                    newest = newest.max(restored.generation);
                }
                Some(None) => {}
                _ => device.storing(Storing::Failed),
            }
        }
        device.set_generation(newest);
    }
    // A controller that does not answer stays off (`can::status`): the operator keeps the leg, and a record
    // reports the fault.
    if !can::start(device.bit_rate().unwrap_or(USUAL_KBIT)) {
        // There is space: the queue is new.
        let _ = notes.enqueue(Record::AxisFault { tick: 0, joint: 0, name: "bus_controller" });
    }
    let (frames, servo, thread, end, bus) = memory::bus().split(device);
    static BUS: StaticCell<bus::BusLoop> = StaticCell::new();
    install(&bus::BUS, BUS.init(bus));
    install(&bus::FRAMES_IN, frames);
    if let Some(storage) = &mut storage {
        storage.serve(end, calibrated);
    }
    let following = Some(Following::new(configuration));
    Joined { host: Some(servo), following, results: Some(thread), storage, stored: calibrations }
}

/// Takes a restored model into use; returns whether `control` took it. Only that of [`Key::Model`] becomes
/// the feedforward.
#[inline(never)]
fn take_model(control: &mut Control<JOINTS>, key: Key, restored: &storage::RestoredModel) -> bool {
    let &storage::RestoredModel { model, wearing, .. } = restored;
    (key != Key::Model || control.adopt(model))
        && wearing.is_none_or(|wearing| control.set_model(wearing, model))
}

/// Raises the inhibit reasons that the start found.
fn judge(board: &Board) {
    let found = [
        (board.crash.is_some(), InhibitReason::Crash),
        (board.identity.reset == Reset::Watchdog, InhibitReason::Watchdog),
        (board.gates_configured.contains(&false), InhibitReason::GateConfiguration),
        (!board.timers_in_phase, InhibitReason::Timers),
        (analog::divider(board.identity.version).is_none(), InhibitReason::BoardVersion),
    ];
    for (_, cause) in found.into_iter().filter(|(found, _)| *found) {
        SIGNALS.inhibit.raise(cause);
    }
}

/// Fills a lock. No other code holds it: the interrupts that take it are not enabled yet.
fn install<T>(home: &spin::Mutex<Option<T>>, value: T) {
    if let Some(mut home) = home.try_lock() {
        *home = Some(value);
    }
}
