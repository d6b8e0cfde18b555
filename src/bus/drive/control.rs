//! Drive profile of one joint: the controlword (6040) and its effects, and the statusword (6041).
//!
//! Why a state per joint besides the leg's: a host enables its nodes one after the other and waits for each.
//! A leg is enabled as a whole or not at all (`safety`). So each joint follows its own CiA 402 state machine,
//! and [`Coupling`](super::Coupling) enables the leg when all joints have requested it. Until then bit 15 of
//! the statusword says that nothing is powered, and targets are ignored.
//!
//! ```text
//! bits 7, 3210  0 x110 shutdown        0 0111 switch on, disable operation
//!               0 1111 enable operation (from ready to switch on: switch on first)
//!               0 xx0x disable voltage  0 x01x quick stop        bit 7 rising: fault reset
//! bit 4 rising  profile position: new set-point; bit 5 immediately, bit 6 relative; homing: start
//! bit 8         halt
//! ```
//!
//! **Targets end with the session that wrote them.** When the joint is disabled, when the host is lost, or
//! while another activity has the leg, targets and offsets become void. In a mode whose target is void the
//! joint holds its pose until the host writes that target again; a void offset is 0. The objects still read
//! as written.
//!
//! **Disable voltage from a host that does not control the leg** (0 by SDO, while the operator's contacts
//! have enabled it, or are about to) turns the leg off too. The operator has to open the switch and close it
//! again. A 0 that a PDO repeats is idle.
//!
//! A controlword that asks for a step which does not exist from the present state has no effect, such as 7
//! or F at switch on disabled, or any step during a quick stop or with bit 7 set. A new word of that kind is
//! reported (FF0E). A repeated one is not: hosts repeat theirs while the other joint stops the leg.
//!
//! ```text
//! statusword
//! bits 0-3, 5, 6  state          4 voltage, 9 remote       10 target reached   11 internal limit active
//! bit 10   profile velocity: the measured velocity is in the window (606D, 606E)
//! bit 12   profile position: set-point acknowledge, set while none can be taken; profile velocity: the joint
//!          stands (606F, 6070); homing: attained; cyclic and impedance: the target is followed
//! bit 13   positions: following error; homing: error
//! bit 15   this joint is enabled, but the leg's bridges are off because another joint is not enabled
//! ```
//!
//! Source: CiA 402, controlword and statusword; bit 15 is manufacturer-specific.

use super::coupling::level;
use super::{
    ImpedanceTarget, JointCommand, JointStatus, LONGEST_PERIOD, LoopBandwidths, Mode, Reference, SetPoint,
    Target,
};
use crate::bus::abort::Abort;
use crate::bus::emergency::ErrorReport;
use crate::bus::node_id::NodeId;
use crate::bus::objects::Lost;
use crate::leg::{DriveEvent, DriveState, FaultCode, JointConfiguration, PowerRequest, RefusalReason};
use crate::units::{
    Ampere, Hertz, NewtonMetre, NewtonMetrePerAmpere, Radian, RadianPerSecond, RadianPerSecondSquared, Second,
};

const RESET: u16 = 1 << 7;
/// Bits that select the command.
const COMMAND: u16 = RESET | 0xF;
const NEW: u16 = 1 << 4;
const IMMEDIATELY: u16 = 1 << 5;
const RELATIVE: u16 = 1 << 6;
const HALT: u16 = 1 << 8;

/// Targets and offsets that a host has written and that are not void.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Targets {
    pub(crate) position: bool,
    pub(crate) velocity: bool,
    pub(crate) torque: bool,
    pub(crate) velocity_offset: bool,
    pub(crate) torque_offset: bool,
    pub(crate) impedance: [bool; 2],
}

impl Targets {
    /// Whether the target that a mode needs is there.
    const fn has(self, mode: Mode) -> bool {
        match mode {
            // A start by bit 4 names its values.
            Mode::ProfilePosition | Mode::Homing => true,
            Mode::CyclicPosition => self.position,
            Mode::Impedance => self.position && self.impedance[0] && self.impedance[1],
            Mode::ProfileVelocity | Mode::CyclicVelocity => self.velocity,
            Mode::ProfileTorque | Mode::CyclicTorque => self.torque,
        }
    }
}

/// Constants of a joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct AxisConstants {
    /// Rated torque of the joint; the torque objects are in thousandths of it.
    pub rated_torque: NewtonMetre,
    /// Rated current of the motor.
    pub rated_current: Ampere,
    /// Supported modes, bits of [`Mode::bit`].
    pub modes: u32,
    /// Joint torque per motor current.
    pub torque_per_ampere: NewtonMetrePerAmpere,
    /// Highest speed that is commanded.
    pub speed: RadianPerSecond,
    /// Encoder counts per motor revolution.
    pub counts_per_turn: u32,
    /// Motor revolutions per joint revolution.
    pub ratio: f32,
    /// Bandwidth that the position loop was designed for, the largest that a host may set.
    pub position_bandwidth: Hertz,
    /// Bandwidth that the current loop was designed for, the largest that a host may set.
    pub current_bandwidth: Hertz,
    /// Largest stiffness (N m/rad) and damping (N m s/rad) of the impedance mode.
    pub impedance: [f32; 2],
}

impl AxisConstants {
    /// Constants of a joint whose encoder has this many counts per motor revolution, behind this gear ratio.
    /// `current_bandwidth` is that of its current loop. All modes are supported.
    pub fn new(
        joint: &JointConfiguration,
        counts_per_turn: u32,
        ratio: f32,
        current_bandwidth: Hertz,
    ) -> Self {
        Self {
            rated_torque: joint.limits().torque_cap(),
            rated_current: joint.current,
            modes: Mode::ALL.into_iter().fold(0, |modes, mode| modes | mode.bit()),
            torque_per_ampere: joint.scale.torque_per_ampere,
            speed: joint.speed,
            counts_per_turn,
            ratio,
            position_bandwidth: joint.bandwidth,
            current_bandwidth,
            impedance: joint.stiffest_impedance(),
        }
    }

    /// Least and largest bandwidth of the position loop that a host may set, unit of 2021.
    pub(super) fn position_bandwidth_limits(&self) -> [u16; 2] {
        bandwidth_limits(self.position_bandwidth, POSITION_BANDWIDTH_UNIT)
    }

    /// Least and largest bandwidth of the current loop that a host may set, Hz.
    pub(super) fn current_bandwidth_limits(&self) -> [u16; 2] {
        bandwidth_limits(self.current_bandwidth, 1.0)
    }

    /// Placeholder of a joint whose constants are unknown.
    pub const UNKNOWN: Self = Self {
        rated_torque: NewtonMetre(1.0),
        rated_current: Ampere(1.0),
        modes: 0,
        torque_per_ampere: NewtonMetrePerAmpere(1.0),
        speed: RadianPerSecond::ZERO,
        counts_per_turn: 0,
        ratio: 0.0,
        position_bandwidth: Hertz(0.0),
        current_bandwidth: Hertz(0.0),
        impedance: [0.0; 2],
    };
}

/// Units of stiffness (N m/rad) and damping (N m s/rad) on the bus.
pub(super) const STIFFNESS_UNIT: f32 = 0.1;
pub(super) const DAMPING_UNIT: f32 = 0.01;

/// Unit of the position loop's bandwidth on the bus, Hz. That of the current loop is in Hz.
const POSITION_BANDWIDTH_UNIT: f32 = 0.01;

/// Least bandwidth of a loop that a host may set, as a share of the one it was designed for. With less, a
/// joint sags under gravity before it is held, and a stuck shunt shows later (C3 of docs/safety.md).
const LEAST_BANDWIDTH_SHARE: f32 = 0.5;

/// Least and largest bandwidth in this unit, Hz, of a loop that was designed for `designed`.
fn bandwidth_limits(designed: Hertz, unit: f32) -> [u16; 2] {
    // A quotient just below a whole number is that number.
    let most = (designed.0 / unit + 0.01) as u16;
    let least = (LEAST_BANDWIDTH_SHARE * f32::from(most)) as u16;
    [least, most]
}

/// No homing method was written; homing then fails.
const NO_METHOD: i8 = -1;

/// Objects that a host writes and reads back, in the objects' units.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Settings {
    pub(crate) connection_option: i16,
    pub(crate) quick_stop_option: i16,
    pub(crate) mode: i8,
    pub(crate) following_window: u32,
    pub(crate) following_time_ms: u16,
    pub(crate) position_window: u32,
    pub(crate) position_time_ms: u16,
    pub(crate) velocity_window: u16,
    pub(crate) velocity_time_ms: u16,
    pub(crate) standing_speed: u16,
    pub(crate) standing_time_ms: u16,
    pub(crate) target_torque: i16,
    pub(crate) largest_torque: u16,
    pub(crate) target_position: i32,
    pub(crate) home_offset: i32,
    pub(crate) range: [i32; 2],
    pub(crate) profile_velocity: u32,
    pub(crate) profile_acceleration: u32,
    pub(crate) profile_deceleration: u32,
    pub(crate) torque_slope: u32,
    pub(crate) homing_method: i8,
    pub(crate) velocity_offset: i32,
    pub(crate) torque_offset: i16,
    pub(crate) interpolation_data: i32,
    pub(crate) positioning_option: u16,
    pub(crate) period: u8,
    pub(crate) period_index: i8,
    pub(crate) outputs: u32,
    pub(crate) target_velocity: i32,
    /// Stiffness and damping, units of 2020.
    pub impedance: [u16; 2],
    /// Bandwidths of position and current loop, units of 2021; 0: the ones they were designed for.
    pub position_bandwidth: u16,
    pub current_bandwidth: u16,
    pub(crate) feedforward: bool,
    pub(crate) returns: bool,
    pub(crate) watches: bool,
    pub(crate) node_id: u8,
    pub(crate) bit_rate: u16,
}

/// Default bit rate, kbit/s.
pub(in crate::bus) const USUAL_KBIT: u16 = 1000;

impl Settings {
    /// Settings after the start.
    pub(crate) const NEW: Self = Self {
        connection_option: 3,
        quick_stop_option: 2,
        mode: 0,
        following_window: 87_266,
        following_time_ms: 10,
        position_window: 17_453,
        position_time_ms: 10,
        velocity_window: 50_000,
        velocity_time_ms: 10,
        standing_speed: 10_000,
        standing_time_ms: 10,
        target_torque: 0,
        largest_torque: 1000,
        target_position: 0,
        home_offset: 0,
        range: [i32::MIN, i32::MAX],
        profile_velocity: 500_000,
        profile_acceleration: 2_000_000,
        profile_deceleration: 2_000_000,
        torque_slope: 1000,
        homing_method: NO_METHOD,
        velocity_offset: 0,
        torque_offset: 0,
        interpolation_data: 0,
        positioning_option: 0,
        period: 2,
        period_index: -3,
        outputs: 0,
        target_velocity: 0,
        impedance: [0; 2],
        position_bandwidth: 0,
        current_bandwidth: 0,
        feedforward: false,
        returns: true,
        watches: true,
        node_id: 0,
        bit_rate: USUAL_KBIT,
    };

    /// Period of 60C2, µs: a multiple of 10^index seconds, index from -6 to 0.
    const fn period_us(&self) -> u32 {
        (self.period as u32).saturating_mul(10_u32.saturating_pow((self.period_index + 6) as u32))
    }

    /// Changes the period (60C2:1, 2) if it stays within what is interpolated.
    pub(super) fn set_period(&mut self, period: u8, index: i8) -> Result<(), Abort> {
        let new = Self { period, period_index: index, ..*self };
        if period == 0 || !(-6..=0).contains(&index) || new.period_us() as f32 > LONGEST_PERIOD.0 * 1e6 {
            return Err(Abort::Range);
        }
        *self = new;
        Ok(())
    }

    /// What relative set-points are relative to (60F2).
    fn relative_to(&self) -> Reference {
        match self.positioning_option {
            1 => Reference::Demand,
            2 => Reference::Actual,
            _ => Reference::Target,
        }
    }
}

/// CiA 402 state machine and settings of one joint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    pub(super) constants: AxisConstants,
    pub(super) settings: Settings,
    pub(super) status: JointStatus,
    pub(super) controlword: u16,
    /// State of this joint's own state machine.
    pub(super) own: DriveState,
    /// A fault reset was requested and not passed on yet.
    pub(super) resets: bool,
    set_point: SetPoint,
    /// Targets that apply.
    pub(super) targets: Targets,
    /// [`Self::is_powered`] at the last update.
    was_powered: bool,
    /// A host that does not control the leg has commanded to disable voltage; not processed yet.
    stops: bool,
    /// Bit 4 of the last controlword; survives a lost host, so that a bit that stays set is no new request.
    held: bool,
    /// The leg must leave its mode, because the set-points that it holds are void.
    leaves_mode: bool,
    /// Bit 4 has risen and is not accepted yet.
    asks: bool,
    /// Bit 4 of the present controlword was accepted: set-point acknowledge or start of homing.
    taken: bool,
    /// Counts accepted set-points and starts of homing.
    request_count: u8,
    /// Fault that the leg must react to.
    fault: Option<FaultCode>,
    /// A host has sent a controlword other than 0.
    pub(super) commanded: bool,
    /// Whether a host has commanded this node since the leg is its; a node reset does not end that.
    pub(in crate::bus) hosted: bool,
    /// A step towards enabled was requested and not processed yet.
    rises: bool,
    /// The present controlword requested a step that does not exist.
    is_out_of_order: bool,
    /// Reason why such a step is refused, while it lasts.
    pub(in crate::bus) refused: Option<ErrorReport>,
}

/// Fault code of a lost host.
const fn code(why: Lost) -> Option<FaultCode> {
    match why {
        Lost::Heartbeat => Some(FaultCode::Heartbeat),
        Lost::ReceivedPdo => Some(FaultCode::LatePdo),
        Lost::Silent => Some(FaultCode::HostSilent),
        Lost::Bus(true) => Some(FaultCode::BusOff),
        Lost::Bus(false) => Some(FaultCode::BusPassive),
        Lost::Stopped | Lost::Reset => None,
    }
}

const fn radian(micro: i32) -> Radian {
    Radian(micro as f32 * 1e-6)
}

fn milliseconds(time: u16) -> Second {
    Second(f32::from(time) * 1e-3)
}

const fn radian_per_second(micro: i32) -> RadianPerSecond {
    RadianPerSecond(micro as f32 * 1e-6)
}

impl Axis {
    /// Creates the state after the start.
    pub const fn new(constants: AxisConstants) -> Self {
        Self {
            constants,
            settings: Settings::NEW,
            status: JointStatus::NONE,
            controlword: 0,
            own: DriveState::NotReadyToSwitchOn,
            resets: false,
            set_point: SetPoint { position: Radian::ZERO, relative_to: None, immediately: false },
            targets: Targets {
                position: false,
                velocity: false,
                torque: false,
                velocity_offset: false,
                torque_offset: false,
                impedance: [false; 2],
            },
            was_powered: false,
            stops: false,
            held: false,
            leaves_mode: false,
            asks: false,
            taken: false,
            request_count: 0,
            fault: None,
            commanded: false,
            hosted: false,
            rises: false,
            is_out_of_order: false,
            refused: None,
        }
    }

    /// Takes over the leg's status. Call [`Coupling::power`](super::Coupling::power) afterwards. Returns
    /// whether the joint has just been disabled.
    pub(crate) fn update(&mut self, status: &JointStatus) -> bool {
        self.status = *status;
        self.leaves_mode &= status.mode != 0 || status.requests_seen != self.request_count;
        let is_powered = self.is_powered();
        let is_disabled = core::mem::replace(&mut self.was_powered, is_powered) && !is_powered;
        if is_disabled {
            self.void_targets();
        }
        self.take_request();
        is_disabled
    }

    /// Makes all targets void until they are written again, and a start by bit 4 that was not taken yet.
    pub(crate) fn void_targets(&mut self) {
        (self.targets, self.asks) = (Targets::default(), false);
    }

    /// Takes the command to disable voltage of a host that does not control the leg.
    pub(in crate::bus) fn take_stop(&mut self) -> bool {
        core::mem::take(&mut self.stops)
    }

    /// Returns object 2001; `None` if it is 0, the board's own.
    pub(crate) const fn node_id(&self) -> Option<NodeId> {
        NodeId::new(self.settings.node_id)
    }

    /// Returns object 2002.
    pub(crate) const fn bit_rate(&self) -> u16 {
        self.settings.bit_rate
    }

    /// Sets object 2002, when it was written at another node of the board.
    pub(crate) const fn set_bit_rate(&mut self, kbit_per_s: u16) {
        self.settings.bit_rate = kbit_per_s;
    }

    /// Returns the bandwidths that a host has set (2021).
    pub(crate) fn bandwidths(&self) -> LoopBandwidths {
        let set = |value: u16, unit: f32| (value > 0).then(|| Hertz(unit * f32::from(value)));
        LoopBandwidths {
            position: set(self.settings.position_bandwidth, POSITION_BANDWIDTH_UNIT),
            current: set(self.settings.current_bandwidth, 1.0),
        }
    }

    /// Returns object 2012.
    pub(crate) const fn may_return(&self) -> bool {
        self.settings.returns
    }

    /// Whether a step towards enabled was requested since the last call.
    pub(in crate::bus) fn take_rises(&mut self) -> bool {
        core::mem::take(&mut self.rises)
    }

    /// Whether the present controlword requested a step that does not exist in CiA 402. A fault says
    /// itself why there is no step.
    pub(in crate::bus) const fn is_out_of_order(&self) -> bool {
        self.is_out_of_order
            && matches!(self.own, DriveState::SwitchOnDisabled | DriveState::QuickStopActive { .. })
    }

    /// Error to be reported: a fault, or else why a step towards enabled is refused.
    pub(in crate::bus) fn error(&self) -> Option<ErrorReport> {
        let Some(fault) = self.own.fault() else { return self.refused };
        Some(ErrorReport { code: fault.code.number(), information: [fault.joint + 1, 0, 0, 0, 0] })
    }

    /// Returns the state of the leg's drive.
    pub const fn drive(&self) -> DriveState {
        self.status.drive
    }

    /// Whether a host has sent a controlword other than 0 since the start or the last node reset.
    pub(crate) const fn is_commanded(&self) -> bool {
        self.commanded
    }

    /// Whether an inhibit reason is active.
    pub(in crate::bus) const fn is_blocked(&self) -> bool {
        self.status.inputs & RefusalReason::Blocked.bit() != 0
    }

    /// Whether both this joint and the leg are enabled.
    pub(super) fn is_powered(&self) -> bool {
        self.own.is_enabled() && self.status.drive.is_enabled()
    }

    /// Whether the joint follows targets, if its mode has them.
    fn follows(&self) -> bool {
        self.is_powered() && !self.leaves_mode
    }

    /// Handles a controlword.
    pub(super) fn control(&mut self, word: u16) {
        let rising = word & !self.controlword;
        let is_new = (word ^ self.controlword) & COMMAND != 0;
        self.controlword = word;
        self.stops |= word == 0 && !self.commanded;
        self.commanded |= word != 0;
        if rising & RESET != 0 {
            self.resets = self.own.fault().is_some();
        }
        let wanted = match word & 0xF {
            0b0110 | 0b1110 => 1,
            0b0111 => 2,
            0b1111 => 3,
            _ => 0,
        };
        if word & RESET == 0 {
            self.rises |= wanted > level(self.own);
            self.request(word);
        }
        self.is_out_of_order = (is_new || self.is_out_of_order) && wanted > level(self.own);
        let holds = word & NEW != 0;
        let rises = !core::mem::replace(&mut self.held, holds) && holds;
        self.taken &= holds;
        self.asks = holds && (self.asks || rises && self.is_powered());
        self.take_request();
    }

    /// Sets the mode (6060). An edge of bit 4 that came in another mode starts nothing in this one.
    pub(super) fn set_mode(&mut self, mode: i8) {
        self.asks &= mode == self.settings.mode;
        self.settings.mode = mode;
    }

    /// Takes a set-point or a start of homing, once the leg is in that mode and can take it.
    fn take_request(&mut self) {
        let mode = self.settings.mode;
        if !self.asks || !self.follows() || self.status.mode != mode {
            return;
        }
        match Mode::from_number(mode) {
            Some(Mode::ProfilePosition) => {
                let immediately = self.controlword & IMMEDIATELY != 0;
                if self.is_full() && !immediately {
                    return;
                }
                let relative_to = (self.controlword & RELATIVE != 0).then(|| self.settings.relative_to());
                let position = radian(self.settings.target_position);
                self.set_point = SetPoint { position, relative_to, immediately };
            }
            Some(Mode::Homing) => {}
            _ => {
                self.asks = false;
                return;
            }
        }
        if mode == Mode::Homing as i8 {
            // Targets would name other positions.
            self.void_targets();
        }
        self.request_count = self.request_count.wrapping_add(1);
        (self.asks, self.taken) = (false, true);
    }

    /// Whether the leg has not taken the last set-point, or can take none after it.
    const fn is_full(&self) -> bool {
        self.status.is_full || self.status.requests_seen != self.request_count
    }

    fn request(&mut self, word: u16) {
        use PowerRequest::{DisableOperation, DisableVoltage, EnableOperation, Shutdown, SwitchOn};
        let mut go = |request| self.own = self.own.after(DriveEvent::Requested(request), 1);
        match word & 0xF {
            low if low & 0b0010 == 0 => go(DisableVoltage),
            low if low & 0b0100 == 0 => self.stop(),
            low if low & 0b0001 == 0 => go(Shutdown),
            0b0111 => {
                go(DisableOperation);
                go(SwitchOn);
            }
            _ => {
                go(SwitchOn);
                go(EnableOperation);
            }
        }
    }

    /// Quick stop by option code 605A.
    fn stop(&mut self) {
        use PowerRequest::{DisableVoltage, QuickStop};
        let request = if self.settings.quick_stop_option == 0 { DisableVoltage } else { QuickStop };
        self.own = self.own.after(DriveEvent::Requested(request), 1);
    }

    /// Reacts to a lost host by option code 6007.
    pub(super) fn lose(&mut self, why: Lost) {
        match self.settings.connection_option {
            // A stop or reset command is not a lost host; the leg stops as by quick stop.
            1 => match code(why).filter(|_| self.is_powered()) {
                Some(code) => self.fault = Some(code),
                None => self.stop(),
            },
            2 => self.own = self.own.after(DriveEvent::Requested(PowerRequest::DisableVoltage), 1),
            3 => self.stop(),
            // A request of the lost host to enable must not wait for the other joint. A quick stop goes on.
            _ if !self.is_powered() && !matches!(self.own, DriveState::QuickStopActive { .. }) => {
                self.own = self.own.after(DriveEvent::Requested(PowerRequest::DisableVoltage), 1);
            }
            _ => self.leaves_mode = true,
        }
        // Bits held down are cleared, so that the next controlword has rising edges. A halt
        // of an enabled joint goes on.
        let halt = if self.own.is_enabled() { HALT } else { 0 };
        (self.controlword, self.is_out_of_order) = (self.controlword & halt, false);
        (self.asks, self.taken) = (false, false);
        self.void_targets();
    }

    /// Takes the fault of a lost host if 6007 is 1; returned once.
    pub(crate) fn take_fault(&mut self) -> Option<FaultCode> {
        self.fault.take()
    }

    /// Object 6061: the leg's mode once it follows, before that the requested one.
    pub(super) fn mode(&self) -> i8 {
        if self.is_powered() && self.status.mode != 0 { self.status.mode } else { self.settings.mode }
    }

    /// Returns object 6041.
    pub(crate) fn statusword(&self) -> u16 {
        let status = &self.status;
        let bit = |is_set: bool, shift: u16| u16::from(is_set) << shift;
        let is_ready = self.own != DriveState::NotReadyToSwitchOn;
        let (twelve, thirteen) = match Mode::from_number(self.mode()) {
            Some(Mode::ProfilePosition) => {
                (self.taken || self.is_powered() && self.is_full(), status.deviates)
            }
            Some(Mode::ProfileVelocity) => (status.stands, false),
            Some(Mode::Homing) => (status.homed, status.deviates),
            Some(Mode::CyclicPosition) => (status.follows, status.deviates),
            Some(Mode::CyclicVelocity | Mode::CyclicTorque | Mode::Impedance) => (status.follows, false),
            Some(Mode::ProfileTorque) | None => (false, false),
        };
        let waits = self.own.is_enabled() && !self.is_powered();
        state_bits(self.own)
            | bit(is_ready, 4)
            | bit(is_ready, 9)
            | bit(status.reached, 10)
            | bit(status.limited, 11)
            | bit(twelve, 12)
            | bit(thirteen, 13)
            | bit(waits, 15)
    }

    fn torque(&self, thousandths: i32) -> NewtonMetre {
        self.constants.rated_torque * (thousandths as f32 * 1e-3)
    }

    /// Returns the command for the leg.
    pub fn command(&self) -> JointCommand {
        let settings = &self.settings;
        let targets = self.targets;
        let torque = |is_valid: bool, value: i16| self.torque(if is_valid { i32::from(value) } else { 0 });
        let torque_offset = torque(targets.torque_offset, settings.torque_offset);
        let target_torque = torque(targets.torque, settings.target_torque);
        let speed = |is_valid: bool, value: i32| radian_per_second(if is_valid { value } else { 0 });
        let velocity_offset = speed(targets.velocity_offset, settings.velocity_offset);
        let velocity = speed(targets.velocity, settings.target_velocity);
        let may_home = settings.homing_method != NO_METHOD
            && (settings.range[0]..=settings.range[1]).contains(&settings.home_offset);
        let target =
            match Mode::from_number(settings.mode).filter(|mode| self.follows() && targets.has(*mode)) {
                None => Target::Hold,
                Some(Mode::ProfilePosition) => Target::ProfilePosition(self.set_point),
                Some(Mode::ProfileVelocity) => Target::ProfileVelocity(velocity),
                Some(Mode::ProfileTorque) => Target::ProfileTorque(target_torque),
                // An infinite offset is out of range: homing error.
                Some(Mode::Homing) if !may_home => Target::Homing { offset: Radian(f32::INFINITY) },
                Some(Mode::Homing) => Target::Homing { offset: radian(settings.home_offset) },
                Some(Mode::CyclicPosition) => Target::CyclicPosition {
                    position: radian(settings.target_position),
                    velocity_offset,
                    torque_offset,
                },
                Some(Mode::CyclicVelocity) => {
                    Target::CyclicVelocity { velocity: velocity + velocity_offset, torque_offset }
                }
                Some(Mode::CyclicTorque) => Target::CyclicTorque(target_torque + torque_offset),
                Some(Mode::Impedance) => Target::Impedance(ImpedanceTarget {
                    position: radian(settings.target_position),
                    velocity,
                    stiffness: f32::from(settings.impedance[0]) * STIFFNESS_UNIT,
                    damping: f32::from(settings.impedance[1]) * DAMPING_UNIT,
                    torque: target_torque,
                }),
            };
        let acceleration = |micro: u32| RadianPerSecondSquared(micro as f32 * 1e-6);
        JointCommand {
            target,
            request_count: self.request_count,
            feedforward: settings.feedforward,
            halt: self.controlword & HALT != 0,
            velocity: RadianPerSecond(settings.profile_velocity as f32 * 1e-6),
            acceleration: acceleration(settings.profile_acceleration),
            deceleration: acceleration(settings.profile_deceleration),
            torque_slope_nm_per_s: self.constants.rated_torque.0 * (settings.torque_slope as f32 * 1e-3),
            velocity_window: radian_per_second(i32::from(settings.velocity_window)),
            velocity_time: milliseconds(settings.velocity_time_ms),
            standing_speed: radian_per_second(i32::from(settings.standing_speed)),
            standing_time: milliseconds(settings.standing_time_ms),
            range: settings.range.map(radian),
            largest_torque: self.torque(i32::from(settings.largest_torque)),
            following_window: Radian(settings.following_window as f32 * 1e-6),
            following_time: milliseconds(settings.following_time_ms),
            position_window: Radian(settings.position_window as f32 * 1e-6),
            position_time: milliseconds(settings.position_time_ms),
            period: Second(settings.period_us() as f32 * 1e-6),
        }
    }
}

/// Statusword bits of a state.
const fn state_bits(state: DriveState) -> u16 {
    match state {
        DriveState::NotReadyToSwitchOn => 0x00,
        DriveState::SwitchOnDisabled => 0x40,
        DriveState::ReadyToSwitchOn => 0x21,
        DriveState::SwitchedOn => 0x23,
        DriveState::OperationEnabled => 0x27,
        DriveState::QuickStopActive { .. } => 0x07,
        DriveState::FaultReactionActive { .. } => 0x0F,
        DriveState::Fault { .. } => 0x08,
    }
}
