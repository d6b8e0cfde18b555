//! Simulated registers below the firmware's levels.

use core::sync::atomic::{AtomicU64, Ordering};

use hal_sim::faults::{Channel, Injector};
use hal_sim::world::World;
use scarab::board::odrive_v3_6::settings::analog::temperature_c;
use scarab::hal::{AbsoluteEncoderSide, AxisCommand, Contacts, Controller, Frame, Hardware};

use scarab_client::wire::Mailbox;

/// Thermistor code of a bridge at 41 degrees Celsius.
pub(crate) const WARM_CODE: u16 = 1500;
/// Time for the most expensive common frame of the bus: 2,403 instructions, interrupted by the levels above.
/// Each reading of the clock within a round of the bus is later by this time.
const FRAME_US: u64 = 20;
/// Factor on the watchdog's time during a flash write: 4 s instead of 16 ms.
pub(crate) const STRETCHED: u64 = 250;

/// Readings of the clock in a round of the bus.
#[derive(Debug, Default)]
struct Readings(AtomicU64);

impl Clone for Readings {
    fn clone(&self) -> Self {
        Self(AtomicU64::new(self.0.load(Ordering::Relaxed)))
    }
}

impl PartialEq for Readings {
    fn eq(&self, other: &Self) -> bool {
        self.0.load(Ordering::Relaxed) == other.0.load(Ordering::Relaxed)
    }
}

/// State of the bus controller, and the frames in its three mailboxes.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct CanController {
    /// Transmit mailboxes.
    pub(crate) mailbox: Mailbox,
    /// State that the firmware reads.
    pub(crate) state: Controller,
    /// Whether a frame was lost and the firmware has not yet read this.
    pub(crate) overrun: bool,
    /// Time, nanoseconds.
    pub(crate) now_ns: u64,
}

/// Registers, contacts and pins of a board of `N` axes.
#[derive(Clone, Debug, PartialEq)]
pub struct Registers<const N: usize> {
    /// The operator's contacts.
    pub(crate) contacts: Contacts,
    /// Command of each bridge for its next period.
    pub(crate) commands: [AxisCommand; N],
    /// Duty cycle of the brake resistor.
    pub(crate) brake: f32,
    /// Output of the holding brake: high releases it.
    pub holding_brake: bool,
    /// Encoder counters.
    pub(crate) encoders: [u16; N],
    /// Frames of the absolute encoders at rotor and joint.
    pub(crate) encoder_frames: [[u16; 2]; N],
    /// Whether the gate drivers hold their configuration.
    pub(crate) gates: [bool; N],
    /// Whether the gate drivers are powered.
    pub(crate) gates_on: bool,
    /// Whether the gate drivers were configured since this was cleared: a reset has ended.
    pub(crate) configured: bool,
    /// Codes of the thermistors at the bridges.
    pub(crate) thermistors: [u16; N],
    /// Codes of the thermistors in the motors; `None` while the converter is silent.
    pub(crate) motor_thermistors: [Option<u16>; N],
    /// Code of the conversion of a motor's thermistor that was started last.
    converted: Option<u16>,
    /// Whether the servo was requested.
    pub(crate) servo_due: bool,
    /// Whether a round of the bus was requested.
    pub(crate) bus_due: bool,
    /// The assistance was requested.
    pub(crate) assist_due: bool,
    /// The bus controller.
    pub(crate) can: CanController,
    /// Whether the watchdog was fed since this was cleared.
    pub(crate) fed: bool,
    /// Factor on the watchdog's usual time, if it changed.
    pub(crate) stretched: Option<u64>,
    /// Readings of the clock in this round of the bus.
    readings: Readings,
}

impl<const N: usize> Registers<N> {
    /// State after power-up: bridges off, contacts open.
    pub fn new() -> Self {
        Self {
            contacts: Contacts::default(),
            commands: [AxisCommand::OFF; N],
            brake: 0.0,
            holding_brake: false,
            encoders: [0; N],
            encoder_frames: [[u16::MAX; 2]; N],
            gates: [true; N],
            gates_on: true,
            configured: false,
            thermistors: [WARM_CODE; N],
            motor_thermistors: [None; N],
            converted: None,
            servo_due: false,
            bus_due: false,
            assist_due: false,
            can: CanController {
                mailbox: Mailbox::default(),
                state: Controller::Active,
                overrun: false,
                now_ns: 0,
            },
            fed: false,
            stretched: None,
            readings: Readings::default(),
        }
    }

    /// Sets the time, nanoseconds, at the start of a round of the bus.
    pub(crate) fn set_time(&mut self, now_ns: u64) {
        self.can.now_ns = now_ns;
        self.readings = Readings::default();
    }
}

impl<const N: usize> Default for Registers<N> {
    fn default() -> Self {
        Self::new()
    }
}

impl<const N: usize> Registers<N> {
    /// Reads the absolute encoders of the plant and the thermistors in its motors, with the faults of this
    /// period. A board without an encoder reads all ones.
    pub fn sense(&mut self, world: &World<N>, injector: &mut Injector, period: u64) {
        for joint in 0..N {
            let axis = world.complete_drives().and_then(|drives| drives.axes().get(joint));
            let rotor = axis.and_then(|axis| axis.rotor_steps());
            let readings =
                [(Channel::RotorEncoder, rotor), (Channel::JointEncoder, world.joint_steps(joint))];
            self.encoder_frames[joint] = readings.map(|(channel, steps)| {
                steps.map_or(u16::MAX, |steps| injector.frame(channel, joint, period, steps))
            });
            let code = axis.and_then(|axis| axis.motor().thermistor_code());
            self.motor_thermistors[joint] =
                code.and_then(|code| injector.motor_thermistor(joint, period, code));
        }
    }
}

impl<const N: usize> Hardware<N> for Registers<N> {
    fn masked(&mut self, step: impl FnOnce(&mut Self)) {
        step(self);
    }

    fn disable_all(&mut self) {
        self.commands = [AxisCommand::OFF; N];
        self.holding_brake = false;
    }

    fn disable(&mut self, axis: usize) {
        self.commands[axis] = AxisCommand::OFF;
    }

    fn set_duty(&mut self, axis: usize, duty: &[f32; 3]) {
        self.commands[axis].duty = *duty;
    }

    fn enable(&mut self, axis: usize) {
        self.commands[axis].enabled = true;
    }

    fn set_brake(&mut self, duty: f32) {
        self.brake = duty;
    }

    fn set_holding_brake(&mut self, released: bool) {
        self.holding_brake = released;
    }

    fn set_status_light(&mut self, _: bool) {}

    fn pend_servo(&mut self) {
        self.servo_due = true;
    }

    fn pend_bus(&mut self) {
        self.bus_due = true;
    }

    fn pend_assist(&mut self) {
        self.assist_due = true;
    }

    fn contacts(&self) -> Contacts {
        self.contacts
    }

    fn encoder_count(&self, axis: usize) -> u16 {
        self.encoders[axis]
    }

    fn encoder_frame(&mut self, axis: usize, side: AbsoluteEncoderSide) -> u16 {
        self.encoder_frames[axis][side as usize]
    }

    fn temperature(&self, axis: usize) -> Option<f32> {
        temperature_c(self.thermistors[axis])
    }

    fn convert_thermistor(&mut self, axis: usize) {
        self.converted = self.motor_thermistors[axis];
    }

    fn thermistor_code(&mut self) -> Option<u16> {
        self.converted
    }

    fn gate_holds(&mut self, axis: usize) -> bool {
        self.gates[axis]
    }

    fn gate_status(&mut self, _: usize) -> u32 {
        0
    }

    fn switch_gates(&mut self, on: bool) {
        self.gates_on = on;
    }

    fn configure_gates(&mut self) -> bool {
        self.configured = true;
        self.gates.iter().all(|holds| *holds)
    }

    fn now_us(&self) -> u64 {
        self.can.now_ns / 1000 + self.readings.0.fetch_add(1, Ordering::Relaxed) * FRAME_US
    }

    fn controller(&mut self) -> Controller {
        if core::mem::take(&mut self.can.overrun) { Controller::Overrun } else { self.can.state }
    }

    fn mailboxes_waiting(&self) -> u32 {
        self.can.mailbox.slots()
    }

    fn send(&mut self, mailbox: u32, frame: &Frame) {
        self.can.mailbox.put(mailbox, *frame, self.can.now_ns);
    }

    fn abort_transmission(&mut self) {
        self.can.mailbox.clear();
    }

    fn processor_supply_is_low(&self) -> bool {
        false
    }

    fn feed_watchdog(&mut self) {
        self.fed = true;
    }

    fn stretch_watchdog(&mut self) -> bool {
        self.stretched = Some(STRETCHED);
        true
    }

    fn tighten_watchdog(&mut self) -> bool {
        self.stretched = Some(1);
        true
    }
}
