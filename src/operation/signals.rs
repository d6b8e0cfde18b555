//! Words that all levels share: the inhibit word, current targets, permission, counters.
//!
//! Each is one atomic word, so no level waits for another. The board has one [`Signals`] in a static. A
//! simulation owns one as a plain value that it clones and compares.

use core::sync::atomic::{AtomicU32, Ordering};

use crate::bus::commissioning::{BoardState, BoardStatus, CommissioningStep, StepReport, StepResult};
use crate::bus::drive::LoopBandwidths;
use crate::bus::program::{ProgramCommand, ProgramStatus};
use crate::hal::DriveCommand;
use crate::leg::Permission;
use crate::motor::{AxisRequest, ElectricalAngle, Phases, Rotating};
use crate::safety::{BoardFault, FaultCode, InhibitReason, Winding};
use crate::servo::SERVO_RATE_HZ;
use crate::units::{Ampere, Hertz};

/// A word that is read and written atomically.
#[derive(Debug)]
pub struct Word(AtomicU32);

impl Word {
    /// Creates a word with this value.
    pub const fn new(value: u32) -> Self {
        Self(AtomicU32::new(value))
    }

    /// Returns the value.
    #[inline(always)]
    pub fn get(&self) -> u32 {
        self.0.load(Ordering::Relaxed)
    }

    /// Sets the value.
    #[inline(always)]
    pub fn set(&self, value: u32) {
        self.0.store(value, Ordering::Relaxed);
    }

    /// Adds one, wrapping.
    #[inline(always)]
    pub fn add(&self) {
        self.0.fetch_add(1, Ordering::Relaxed);
    }

    /// Adds one, wrapping; for words that one level writes.
    #[inline(always)]
    pub(crate) fn count(&self) {
        self.set(self.get().wrapping_add(1));
    }

    /// Sets the value if it is larger; for words that one level writes.
    #[inline(always)]
    pub(crate) fn raise(&self, value: u32) {
        if value > self.get() {
            self.set(value);
        }
    }

    /// Sets the value if it is smaller; for words that one level writes.
    #[inline(always)]
    pub(crate) fn lower(&self, value: u32) {
        if value < self.get() {
            self.set(value);
        }
    }

    /// Sets the value and returns the previous one.
    pub(crate) fn swap(&self, value: u32) -> u32 {
        self.0.swap(value, Ordering::Relaxed)
    }

    fn set_bits(&self, bits: u32) {
        self.0.fetch_or(bits, Ordering::Relaxed);
    }

    fn keep_bits(&self, bits: u32) {
        self.0.fetch_and(bits, Ordering::Relaxed);
    }
}

impl Clone for Word {
    fn clone(&self) -> Self {
        Self::new(self.get())
    }
}

impl PartialEq for Word {
    fn eq(&self, other: &Self) -> bool {
        self.get() == other.get()
    }
}

/// Inhibit word: one bit per [`InhibitReason`] for which the drive must not be enabled.
///
/// While any bit is set the current loops turn both bridges off or brake, in every tick, and the servo keeps
/// its drive off. A bit stays set until the operator's reset; one that still holds is set again in the next
/// tick.
#[derive(Clone, Debug, PartialEq)]
pub struct Inhibit {
    causes: Word,
    /// Reasons that a fault campaign disables, to prove that it detects their absence.
    #[cfg(not(target_os = "none"))]
    hidden: u32,
}

impl Inhibit {
    /// No inhibit reason is set.
    pub const fn new() -> Self {
        Self {
            causes: Word::new(0),
            #[cfg(not(target_os = "none"))]
            hidden: 0,
        }
    }

    /// Ignores these reasons from now on; host only.
    #[cfg(not(target_os = "none"))]
    pub fn hide(&mut self, bits: u32) {
        self.hidden = bits;
    }

    /// Sets one reason.
    pub(crate) fn raise(&self, cause: InhibitReason) {
        self.raise_bits(cause.bit());
    }

    /// Sets all reasons with these bits.
    #[inline(always)]
    pub fn raise_bits(&self, bits: u32) {
        #[cfg(not(target_os = "none"))]
        let bits = bits & !self.hidden;
        if bits != 0 {
            self.causes.set_bits(bits);
        }
    }

    /// All inhibit bits.
    #[inline(always)]
    pub fn causes(&self) -> u32 {
        self.causes.get()
    }

    /// No inhibit reason is set.
    #[inline(always)]
    pub(crate) fn is_clear(&self) -> bool {
        self.causes() == 0
    }

    /// Returns whether the flash is being written, which may stall the processor for seconds.
    #[inline(always)]
    pub(crate) fn is_storing(&self) -> bool {
        self.causes() & InhibitReason::Storing.bit() != 0
    }

    /// Clears the reasons that the operator's reset may clear: neither permanent ones nor a flash write in
    /// progress.
    pub(crate) fn reset(&self) {
        self.causes.keep_bits(InhibitReason::for_ever() | InhibitReason::Storing.bit());
    }

    /// Clears [`InhibitReason::Storing`].
    pub fn end_storing(&self) {
        self.causes.keep_bits(!InhibitReason::Storing.bit());
    }
}

/// Counters of the levels, reported from the lowest priority.
#[derive(Clone, Debug, PartialEq)]
pub struct Statistics<const N: usize> {
    /// Longest current tick, processor cycles.
    pub(crate) current_worst: Word,
    /// Current ticks that came late.
    pub(crate) current_missed: Word,
    /// Current ticks of each axis.
    pub(crate) current_ticks: [Word; N],
    /// Longest servo tick, processor cycles, including current ticks in it.
    pub(crate) servo_worst: Word,
    /// Longest run of the assistance, processor cycles, including the levels above it.
    pub(crate) assist_worst: Word,
    /// Servo ticks that came late.
    pub(crate) servo_missed: Word,
    /// Servo ticks.
    pub servo_ticks: Word,
    /// Rounds of the housekeeping.
    pub(crate) rounds: Word,
    /// Longest current interrupt and servo tick, ns, in the time of the last report.
    pub(crate) longest_ns: [Word; 2],
    /// Samples lost because the queue to the identification was full.
    pub(crate) samples_lost: Word,
    /// Records lost because the queue to the trace was full.
    pub(crate) records_lost: Word,
    /// Code of the bus voltage: newest, lowest, highest.
    pub(crate) bus: [Word; 3],
    /// Encoder counts of each joint at the servo's last tick.
    pub counts: [Word; N],
    /// Iterations and evaluations of the search under way.
    pub(crate) search: [Word; 2],
}

impl<const N: usize> Statistics<N> {
    const fn new() -> Self {
        Self {
            current_worst: Word::new(0),
            current_missed: Word::new(0),
            current_ticks: [const { Word::new(0) }; N],
            servo_worst: Word::new(0),
            assist_worst: Word::new(0),
            servo_missed: Word::new(0),
            servo_ticks: Word::new(0),
            rounds: Word::new(0),
            longest_ns: [const { Word::new(0) }; 2],
            samples_lost: Word::new(0),
            records_lost: Word::new(0),
            bus: [Word::new(0), Word::new(u32::MAX), Word::new(0)],
            counts: [const { Word::new(0) }; N],
            search: [const { Word::new(0) }; 2],
        }
    }

    /// Updates the newest, lowest and highest code of the bus voltage.
    #[inline(always)]
    pub fn see_bus(&self, code: u16) {
        let [newest, lowest, highest] = &self.bus;
        newest.set(code.into());
        lowest.lower(code.into());
        highest.raise(code.into());
    }
}

/// Unit of the integrals of squared currents, A^2 s: a sixteenth of A^2 over one servo period.
pub(crate) const I2T_UNIT: f32 = 1.0 / (UNITS_PER_A2 * SERVO_RATE_HZ as f32);
const UNITS_PER_A2: f32 = 16.0;
/// Share before the first round: the whole cap.
const FULL_SHARE: u32 = 1.0_f32.to_bits();

/// Target bits that turn an axis off: a NaN pattern that no computation produces.
const OFF: u32 = u32::MAX;

/// Bandwidth in a word; `None` for zero.
fn bandwidth(word: &Word) -> Option<Hertz> {
    let bits = word.get();
    (bits != 0).then(|| Hertz(f32::from_bits(bits)))
}

/// All words that the levels of a board of `N` axes share.
#[derive(Clone, Debug, PartialEq)]
pub struct Signals<const N: usize> {
    /// Inhibit word.
    pub inhibit: Inhibit,
    /// Counters of the levels.
    pub statistics: Statistics<N>,
    /// Current target of each axis as bits, or [`OFF`].
    targets: [Word; N],
    /// Each joint has a calibration and a zero.
    begun: Word,
    /// Faults of each joint that the servo has not read yet, one bit per [`BoardFault`].
    reported: [Word; N],
    /// Fault of each axis that the servo has not read yet: its number, or 0.
    axis_faults: [Word; N],
    /// Temperature of each bridge, degrees Celsius, as bits.
    bridges_c: [Word; N],
    /// Currents of each motor along and across the flux, A, as bits, and the rotor's electrical angle.
    rotor_currents: [[Word; 3]; N],
    /// Integral of each motor's squared current, in [`I2T_UNIT`], wrapping.
    i2t: [Word; N],
    /// Temperature of each winding, degrees Celsius, and its share of the torque cap, as bits.
    windings: [[Word; 2]; N],
    /// Share of each axis' current limit that is permitted now, as bits. The axis itself enforces it; the
    /// servo limits its torque likewise and reports it.
    current_shares: [Word; N],
    /// Electrical power of each axis, W, as bits.
    powers: [Word; N],
    /// Duty of the brake resistor that the servo wants, and the one that it was given, as bits.
    brake: [Word; 2],
    permission: Word,
    /// Whether a host has the drive, and whether one had or stopped it since the housekeeper's last round.
    hosted: [Word; 2],
    permits: Word,
    board_state: Word,
    /// Bandwidths of position and current loop of each joint that a host has set, Hz, as bits; 0.0 for none.
    bandwidths: [[Word; 2]; N],
    /// Step of commissioning that the bus asked for, and the report of the last one.
    asked: Word,
    report: Word,
    /// Command for the program that the bus passed on, plus one, and the status of a new image.
    program: [Word; 2],
    forgotten: Word,
}

impl<const N: usize> Signals<N> {
    /// State after the start: all axes off, the servo not begun.
    pub const fn new() -> Self {
        Self {
            inhibit: Inhibit::new(),
            statistics: Statistics::new(),
            targets: [const { Word::new(OFF) }; N],
            begun: Word::new(0),
            reported: [const { Word::new(0) }; N],
            axis_faults: [const { Word::new(0) }; N],
            bridges_c: [const { Word::new(0) }; N],
            rotor_currents: [const { [const { Word::new(0) }; 3] }; N],
            i2t: [const { Word::new(0) }; N],
            windings: [const { [Word::new(0), Word::new(FULL_SHARE)] }; N],
            current_shares: [const { Word::new(FULL_SHARE) }; N],
            powers: [const { Word::new(0) }; N],
            brake: [const { Word::new(0) }; 2],
            permission: Word::new(0),
            hosted: [const { Word::new(0) }; 2],
            permits: Word::new(0),
            board_state: Word::new(0),
            bandwidths: [const { [const { Word::new(0) }; 2] }; N],
            asked: Word::new(0),
            report: Word::new(0),
            program: [const { Word::new(0) }; 2],
            forgotten: Word::new(0),
        }
    }

    /// Current target of an axis.
    #[inline(always)]
    pub fn target(&self, axis: usize) -> AxisRequest {
        match self.targets.get(axis).map(Word::get) {
            None | Some(OFF) => AxisRequest::OFF,
            Some(bits) => AxisRequest { enabled: true, current: Ampere(f32::from_bits(bits)) },
        }
    }

    /// Sets the current targets of all axes.
    pub fn set_targets(&self, command: &DriveCommand<N>) {
        for (target, current) in self.targets.iter().zip(command.currents) {
            target.set(if command.enabled { current.0.to_bits() } else { OFF });
        }
    }

    /// Turns all axes off.
    pub(crate) fn disable(&self) {
        self.set_targets(&DriveCommand::OFF);
    }

    /// Marks the joints' samples as valid.
    pub fn begin_servo(&self) {
        self.begun.set(1);
    }

    /// Marks the joints' samples as invalid and turns all axes off.
    pub(crate) fn end_servo(&self) {
        self.begun.set(0);
        self.disable();
    }

    /// Returns whether the joints' samples are valid.
    pub fn has_begun(&self) -> bool {
        self.begun.get() != 0
    }

    /// Reports a fault to the servo's next tick.
    pub(crate) fn report(&self, fault: BoardFault, joint: usize) {
        if let Some(reported) = self.reported.get(joint) {
            reported.set_bits(fault.bit());
        }
    }

    /// Takes the faults reported for a joint since the last call.
    pub(crate) fn take_reported(&self, joint: usize) -> impl Iterator<Item = BoardFault> + use<N> {
        let bits = self
            .reported
            .get(joint)
            .map_or(0, |reported| if reported.get() == 0 { 0 } else { reported.swap(0) });
        BoardFault::ALL.into_iter().filter(move |fault| bits & fault.bit() != 0)
    }

    /// Reports the fault of an axis to the servo's next tick.
    pub(crate) fn report_axis(&self, code: FaultCode, axis: usize) {
        if let Some(fault) = self.axis_faults.get(axis) {
            fault.set(code.number().into());
        }
    }

    /// Takes the fault of an axis that was reported since the last call.
    pub(crate) fn take_axis_fault(&self, axis: usize) -> Option<FaultCode> {
        let fault = self.axis_faults.get(axis).filter(|fault| fault.get() != 0)?.swap(0);
        FaultCode::ALL.into_iter().find(|code| u32::from(code.number()) == fault)
    }

    /// Temperature of the hottest bridge, degrees Celsius; NaN, which leaves no torque, if one is unknown.
    pub(crate) fn hottest_c(&self) -> f32 {
        let hottest = |hottest: f32, bridge: &Word| {
            let celsius = f32::from_bits(bridge.get());
            if celsius > hottest || celsius.is_nan() { celsius } else { hottest }
        };
        self.bridges_c.iter().fold(f32::MIN, hottest)
    }

    /// Sets the temperature of a bridge, degrees Celsius; NaN if it is unknown.
    pub(crate) fn set_bridge_c(&self, axis: usize, degrees_c: f32) {
        if let Some(bridge) = self.bridges_c.get(axis) {
            bridge.set(degrees_c.to_bits());
        }
    }

    /// Sets the currents of a motor and its rotor's angle.
    #[inline(always)]
    pub(crate) fn set_rotor_currents(&self, axis: usize, current: Rotating<Ampere>, angle: ElectricalAngle) {
        if let Some([direct, quadrature, rotor]) = self.rotor_currents.get(axis) {
            direct.set(current.d.0.to_bits());
            quadrature.set(current.q.0.to_bits());
            rotor.set(angle.units().cast_unsigned());
        }
    }

    /// Currents in the phases B and C of an axis, A.
    fn phase_currents_a([direct, quadrature, rotor]: &[Word; 3]) -> [f32; 2] {
        let [d, q] = [direct, quadrature].map(|word| Ampere(f32::from_bits(word.get())));
        let angle = ElectricalAngle::from_units(rotor.get().cast_signed());
        let Phases { b, c, .. } = Rotating { d, q }.to_stationary(angle.rotation()).to_phases();
        [b.0, c.0]
    }

    /// Sets the bandwidths that a host has set.
    pub(crate) fn set_bandwidths(&self, bandwidths: &[LoopBandwidths; N]) {
        for (words, LoopBandwidths { position, current }) in self.bandwidths.iter().zip(bandwidths) {
            for (word, bandwidth) in words.iter().zip([position, current]) {
                word.set(bandwidth.map_or(0, |bandwidth| bandwidth.0.to_bits()));
            }
        }
    }

    /// Bandwidths of the position loops that a host has set.
    pub(crate) fn position_bandwidths(&self) -> [Option<Hertz>; N] {
        self.bandwidths.each_ref().map(|[position, _]| bandwidth(position))
    }

    /// Bandwidths of the current loops that a host has set.
    pub(crate) fn current_bandwidths(&self) -> [Option<Hertz>; N] {
        self.bandwidths.each_ref().map(|[_, current]| bandwidth(current))
    }

    /// Asks for a step of commissioning, from the bus.
    pub(crate) fn ask(&self, step: CommissioningStep) {
        self.asked.set(step as u32);
    }

    /// Takes the step that was asked for. The report says that it is under way before it is taken, so that no
    /// host reads the result of the step before.
    pub(crate) fn take_step(&self) -> Option<CommissioningStep> {
        if self.asked.get() == 0 {
            return None;
        }
        self.set_report(StepReport::new(StepResult::UnderWay));
        CommissioningStep::from_number(self.asked.swap(0))
    }

    /// Passes a command for the program on, from the bus.
    pub(crate) fn command_program(&self, command: ProgramCommand) {
        self.program[0].set(command as u32 + 1);
    }

    /// Takes the command for the program.
    pub fn take_program_command(&self) -> Option<ProgramCommand> {
        if self.program[0].get() == 0 {
            return None;
        }
        // Shown as under way until its outcome is set.
        self.program[1].set_bits(ProgramStatus::UNDER_WAY);
        ProgramCommand::from_number(self.program[0].swap(0).wrapping_sub(1))
    }

    /// Status of a new image; under way while a command waits.
    pub(crate) fn program_status(&self) -> ProgramStatus {
        ProgramStatus(self.program[1].get()).with(ProgramStatus::UNDER_WAY, self.program[0].get() != 0)
    }

    /// Whether the flash is or will be changed for a new image.
    pub(crate) fn program_pauses(&self) -> bool {
        self.program[1].get() & (ProgramStatus::UNDER_WAY | ProgramStatus::STOPPED) != 0
    }

    /// Sets the status of a new image.
    pub fn set_program_status(&self, status: ProgramStatus) {
        self.program[1].set(status.0);
    }

    /// Sets the report of the step that was taken last.
    pub(crate) fn set_report(&self, report: StepReport) {
        self.report.set(u32::from_le_bytes([report.result, report.axis, report.reason, report.detail]));
    }

    /// State and telemetry for the bus.
    pub(crate) fn board_status(&self) -> BoardStatus<N> {
        let real = |word: &Word| f32::from_bits(word.get());
        let is_asked = self.asked.get() != 0;
        let [result, axis, reason, detail] = self.report.get().to_le_bytes();
        let report = if is_asked {
            StepReport::new(StepResult::UnderWay)
        } else {
            StepReport { result, axis, reason, detail }
        };
        BoardStatus {
            state: BoardState(self.board_state.get() as u8),
            report,
            causes: self.inhibit.causes(),
            bridge_c: self.bridges_c.each_ref().map(real),
            winding_c: self.windings.each_ref().map(|[celsius, _]| real(celsius)),
            currents_a: self.rotor_currents.each_ref().map(Self::phase_currents_a),
            longest_ns: self.statistics.longest_ns.each_ref().map(Word::get),
        }
    }

    /// Adds a motor's squared current (A^2) over one servo period.
    #[inline(always)]
    pub(crate) fn add_i2t(&self, axis: usize, square_a2: f32) {
        if let Some(sum) = self.i2t.get(axis) {
            sum.set(sum.get().wrapping_add((square_a2 * UNITS_PER_A2) as u32));
        }
    }

    /// Wrapping integral of a motor's squared current, unit: a sixteenth of A^2 over a servo period.
    pub(crate) fn i2t(&self, axis: usize) -> u32 {
        self.i2t.get(axis).map_or(0, Word::get)
    }

    /// Sets the permitted share of an axis' current limit ([`crate::motor::Axis::current_share`]).
    #[inline(always)]
    pub(crate) fn set_current_share(&self, axis: usize, share: f32) {
        if let Some(current_share) = self.current_shares.get(axis) {
            current_share.set(share.to_bits());
        }
    }

    /// Permitted share of an axis' current limit; NaN leaves no torque.
    pub(crate) fn current_share(&self, axis: usize) -> f32 {
        self.current_shares.get(axis).map_or(f32::NAN, |share| f32::from_bits(share.get()))
    }

    /// Sets an axis' electrical power, W ([`crate::motor::Axis::power_w`]).
    #[inline(always)]
    pub(crate) fn set_power(&self, axis: usize, watt: f32) {
        if let Some(power) = self.powers.get(axis) {
            power.set(watt.to_bits());
        }
    }

    /// Sum of the axes' electrical powers, W; zero while an inhibit reason holds, because shorted motors take
    /// nothing from the bus.
    pub(crate) fn power_w(&self) -> f32 {
        if self.inhibit.is_clear() {
            self.powers.iter().fold(0.0, |sum, power| sum + f32::from_bits(power.get()))
        } else {
            0.0
        }
    }

    /// Least duty of the brake resistor, 0..=0.95, by the servo.
    #[inline(always)]
    pub(crate) fn wanted_brake(&self) -> f32 {
        f32::from_bits(self.brake[0].get())
    }

    /// Whether the servo wants the brake resistor.
    #[inline(always)]
    pub(crate) fn wants_brake(&self) -> bool {
        self.brake[0].get() != 0
    }

    /// Sets the least duty of the brake resistor, which its energy budget still limits.
    pub(crate) fn set_wanted_brake(&self, duty: f32) {
        self.brake[0].set(duty.to_bits());
    }

    /// Duty that the brake resistor was given in the last tick; zero without a resistor.
    pub fn given_brake(&self) -> f32 {
        f32::from_bits(self.brake[1].get())
    }

    /// Sets the duty that the brake resistor was given.
    #[inline(always)]
    pub(crate) fn set_given_brake(&self, duty: f32) {
        self.brake[1].set(duty.to_bits());
    }

    /// Temperature of a winding, degrees Celsius, by its model.
    pub fn winding_c(&self, joint: usize) -> f32 {
        self.windings.get(joint).map_or(f32::NAN, |[celsius, _]| f32::from_bits(celsius.get()))
    }

    /// Share of a joint's torque cap that its winding leaves; NaN leaves no torque.
    pub fn winding_share(&self, joint: usize) -> f32 {
        self.windings.get(joint).map_or(f32::NAN, |[_, share]| f32::from_bits(share.get()))
    }

    /// Sets temperature and share of a winding.
    pub(crate) fn set_winding(&self, joint: usize, winding: &Winding) {
        if let Some([celsius, share]) = self.windings.get(joint) {
            celsius.set(winding.temperature_c().to_bits());
            share.set(winding.share().to_bits());
        }
    }

    /// Permission of the drive since the servo's last tick; off before its first.
    pub fn permission(&self) -> Permission {
        match self.permission.get() {
            0 => Permission::Off,
            1 => Permission::Follow,
            _ => Permission::Damp,
        }
    }

    /// Sets the permission of the drive.
    pub(crate) fn set_permission(&self, permission: Permission) {
        self.permission.set(permission as u32);
    }

    /// Returns whether a host has the drive; then closing the enabling switch permits but requests nothing.
    pub(crate) fn is_hosted(&self) -> bool {
        self.hosted[0].get() != 0
    }

    /// Sets whether a host has the drive. `stopped`: one that does not have it has stopped it.
    pub(crate) fn set_host(&self, hosted: bool, stopped: bool) {
        let [now, acted] = &self.hosted;
        now.set(hosted.into());
        if hosted || stopped {
            acted.set(1);
        }
    }

    /// Returns whether a host has the drive, or had or stopped it since the last call.
    pub(crate) fn take_host_action(&self) -> bool {
        self.hosted[1].swap(0) != 0 || self.is_hosted()
    }

    /// Returns the operator's permission: the debounced enabling switch, false during a reset.
    pub(crate) fn permits(&self) -> bool {
        self.permits.get() != 0
    }

    /// Sets the operator's permission.
    pub(crate) fn set_permits(&self, permits: bool) {
        self.permits.set(permits.into());
    }

    /// Returns whether every axis has a calibration.
    pub(crate) fn is_calibrated(&self) -> bool {
        self.board_state.get() & u32::from(BoardState::CALIBRATED) != 0
    }

    /// Sets the state of the board.
    pub(crate) fn set_board_state(&self, state: BoardState) {
        self.board_state.set(state.0.into());
    }

    /// Marks all stored parameters as erased.
    pub fn forget_stored(&self) {
        self.forgotten.set(1);
    }

    /// Returns whether all stored parameters were erased since the last call.
    #[must_use]
    pub(crate) fn take_forgotten(&self) -> bool {
        self.forgotten.get() != 0 && self.forgotten.swap(0) != 0
    }
}

#[cfg(test)]
mod tests;
