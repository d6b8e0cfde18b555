//! Level 6 on the board: contacts, gate drivers, thermistors and queues beneath `operation::Housekeeper`, and the watchdog.
//!
//! The watchdog is fed by a task of its own, which also sees current ticks that no longer come, and only if since the last time both axes' current loops, the servo and the
//! housekeeping have run: one of them hanging is a reset, after which the drive stays refused.

use core::sync::atomic::{AtomicBool, Ordering};

use embassy_time::{Duration, Ticker};
use heapless::spsc::{Consumer, Producer};

use super::interlock::{self, Cause};
use super::leg::JOINTS;
use super::statistics::{self, Count};
use super::{bus, keep, servo};
use crate::board::odrive_v3_6::gate_driver::GateDrivers;
use crate::board::odrive_v3_6::settings::analog::{HOTTEST_C, temperature_c};
use crate::board::odrive_v3_6::settings::drives::CALIBRATION;
use crate::board::odrive_v3_6::{bridge, contacts, converter, encoder, watchdog};
use crate::leg::{Calibration, ControlRequest, DriveState, StoredCalibration};
use crate::motor::AxisConfiguration;
use crate::operation::{Housekeeper, HousekeepingBoard, HousekeepingSettings, Order, Outcome, RATE_HZ};
use crate::safety::{CheckIns, FaultCode, GUARD_RATE_HZ, TickGuard};
use crate::trace::Record;

/// Rounds of the housekeeping, for the watchdog.
static ROUNDS: Count = Count::zero();

/// The operator's hand, without bounce, and not while a reset is under way.
static PERMITS: AtomicBool = AtomicBool::new(false);

/// Whether whoever commands the leg may have it enabled; an open switch counts at once.
pub fn permits() -> bool {
    contacts::enabling() && PERMITS.load(Ordering::Relaxed)
}

/// What level 6 works on.
pub struct Housekeeping {
    /// Both.
    pub gate_drivers: GateDrivers,
    /// As commissioned.
    pub axes: [AxisConfiguration; JOINTS],
    /// To each axis.
    pub orders: [Producer<'static, Order>; JOINTS],
    /// From each axis.
    pub outcomes: [Consumer<'static, Outcome>; JOINTS],
    /// Calibrations that were kept.
    pub stored: [Option<StoredCalibration>; JOINTS],
    /// To whoever keeps them.
    pub calibrated: Producer<'static, keep::Calibrated>,
    /// To the servo.
    pub requests: Producer<'static, ControlRequest<JOINTS>>,
    /// From the servo.
    pub drive: Consumer<'static, DriveState>,
    /// To whoever tells.
    pub notes: Producer<'static, Record<JOINTS>>,
}

/// Looks for one at who has checked in.
const LOOKS: u32 = GUARD_RATE_HZ / 250;

/// Releases both bridges where no current ticks come, and feeds the watchdog as long as everything else runs.
#[embassy_executor::task]
pub async fn watch() -> ! {
    let mut ticker = Ticker::every(Duration::from_hz(u64::from(GUARD_RATE_HZ)));
    let ticks = || statistics::CURRENT_TICKS.each_ref().map(Count::get);
    let seen = || {
        let [first, second] = ticks();
        [first, second, statistics::SERVO_TICKS.get(), ROUNDS.get()]
    };
    let (mut guard, mut check_ins, mut looks) = (TickGuard::new(), CheckIns::new(seen()), 0_u32);
    loop {
        ticker.next().await;
        // A look that came late is not made up for: two in a row would see the same count.
        ticker.reset();
        if guard.look(ticks()) {
            bridge::release_all();
            // While the flash is written they stand.
            if !interlock::is_storing() {
                interlock::raise(Cause::CurrentTicks);
            }
        }
        looks = (looks + 1) % LOOKS;
        if looks == 0 && check_ins.all(seen()) {
            watchdog::feed();
        }
    }
}

/// Everything else at this level.
#[embassy_executor::task]
pub async fn run(mut keeping: Housekeeping) -> ! {
    let settings =
        HousekeepingSettings { axes: keeping.axes, calibration: [CALIBRATION; JOINTS], hottest_c: HOTTEST_C };
    let mut keeper = Housekeeper::new(settings).with_stored(keeping.stored);
    let mut ticker = Ticker::every(Duration::from_hz(u64::from(RATE_HZ)));
    loop {
        ticker.next().await;
        ROUNDS.add();
        keeper.round(&mut keeping);
        PERMITS.store(keeper.permits(), Ordering::Relaxed);
    }
}

impl HousekeepingBoard<JOINTS> for Housekeeping {
    fn contacts(&self) -> (bool, bool) {
        (contacts::enabling(), contacts::start())
    }

    fn causes(&self) -> u32 {
        interlock::causes()
    }

    fn raise(&mut self, cause: Cause) {
        interlock::raise(cause);
    }

    fn reset_interlock(&mut self) {
        interlock::reset();
    }

    fn gate_holds(&mut self, axis: usize) -> bool {
        self.gate_drivers.holds(axis)
    }

    fn gate_status(&mut self) -> u32 {
        self.gate_drivers.status(0)
    }

    fn switch_gates(&mut self, on: bool) {
        if on { self.gate_drivers.on() } else { self.gate_drivers.off() }
    }

    fn configure_gates(&mut self) -> bool {
        !self.gate_drivers.configure().contains(&false)
    }

    fn temperature(&self, axis: usize) -> Option<f32> {
        converter::thermistors().get(axis).copied().and_then(temperature_c)
    }

    fn set_temperature(&mut self, degrees_c: f32) {
        servo::set_temperature(degrees_c);
    }

    fn report(&mut self, code: FaultCode, _: usize) {
        servo::report(code);
    }

    fn encoder_count(&self, axis: usize) -> u16 {
        encoder::count(axis)
    }

    fn joint_counts(&self, joint: usize) -> i32 {
        statistics::COUNTS.get(joint).map_or(0, |count| count.get().cast_signed())
    }

    fn begin_servo(&mut self) {
        servo::begin();
    }

    fn end_servo(&mut self) {
        servo::end();
    }

    fn has_begun(&self) -> bool {
        servo::has_begun()
    }

    fn order(&mut self, axis: usize, order: Order) {
        if let Some(orders) = self.orders.get_mut(axis) {
            let _ = orders.enqueue(order);
        }
    }

    fn outcome(&mut self, axis: usize) -> Option<Outcome> {
        self.outcomes.get_mut(axis)?.dequeue()
    }

    fn calibrated(&mut self, axis: usize, calibration: &Calibration) {
        let _ = self.calibrated.enqueue((axis, calibration.stored()));
    }

    fn take_forgotten(&mut self) -> bool {
        keep::take_forgotten()
    }

    fn request(&mut self, request: ControlRequest<JOINTS>) -> bool {
        // The host has the drive: the switch permits, and no longer asks.
        let is_hosts = matches!(request, ControlRequest::Power(power) if power.enables()) && bus::is_hosted();
        !is_hosts && self.requests.enqueue(request).is_ok()
    }

    fn drive_state(&mut self) -> Option<DriveState> {
        self.drive.dequeue()
    }

    fn say(&mut self, record: Record<JOINTS>) {
        if self.notes.enqueue(record).is_err() {
            statistics::RECORDS_LOST.add();
        }
    }
}
