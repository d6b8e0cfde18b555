//! Level 1: both joints at 4 kHz, pended by the current loop after the second axis' sixth tick.
//!
//! The servo begins to tick once both joints have a calibration and a zero; until then the drive is not even ready. While the
//! interlock is not clear it keeps its drive off, whatever is asked.

use core::sync::atomic::{AtomicBool, AtomicU32, Ordering};

use heapless::spsc::{Consumer, Producer};

use super::host::HostLink;
use super::leg::{JOINTS, LEG};
use super::links::{EVENTS, TOLD, Told};
use super::{interlock, statistics};
use crate::board::odrive_v3_6::settings::{analog, drives};
use crate::hal::{DriveCommand, JointSample, Sample};
use crate::leg::{
    Activity, Control, ControlOutput, ControlRequest, DriveState, Finding, LimitCodes, Permission, Plan,
    permitted,
};
use crate::motor::AxisRequest;
use crate::operation::{Gate, ServoRound};
use crate::safety::{Fault, FaultCode};
use crate::servo::SERVO_RATE_HZ;
use crate::trace::{Record, words};
use crate::units::{Ampere, Volt};

/// Current target of each axis as bits, or [`RELEASED`].
static TARGETS: [AtomicU32; JOINTS] = [const { AtomicU32::new(RELEASED) }; JOINTS];
/// A pattern no computation makes: what is not a number elsewhere is one of the others, and the axis refuses it.
const RELEASED: u32 = u32::MAX;
/// The joints' zeros are known, so samples mean something.
static READY: AtomicBool = AtomicBool::new(false);

/// What others saw and the servo has to react to, by damping: a bit each.
static REPORTED: AtomicU32 = AtomicU32::new(0);
/// In the order of their bits.
const REPORTABLE: [FaultCode; 3] = [FaultCode::CurrentTicks, FaultCode::Temperature, FaultCode::Thermistor];

/// The servo reacts from its next tick on, to the codes of its list.
pub fn report(code: FaultCode) {
    let bit = REPORTABLE.iter().position(|one| *one == code).unwrap_or(0);
    REPORTED.fetch_or(1 << bit, Ordering::Relaxed);
}

/// Of the hottest bridge, degrees Celsius; what is no number leaves no torque.
static HOTTEST_C: AtomicU32 = AtomicU32::new(0);

/// The servo gives less torque from there on.
pub fn set_temperature(degrees_c: f32) {
    HOTTEST_C.store(degrees_c.to_bits(), Ordering::Relaxed);
}

/// What an axis is asked for.
#[inline(always)]
pub fn target(axis: usize) -> AxisRequest {
    match TARGETS.get(axis).map(|target| target.load(Ordering::Relaxed)) {
        None | Some(RELEASED) => AxisRequest::RELEASED,
        Some(bits) => AxisRequest { enabled: true, current: Ampere(f32::from_bits(bits)) },
    }
}

/// What the drive may do since the last tick, as [`permission`] tells it.
static PERMISSION: AtomicU32 = AtomicU32::new(0);

/// What the drive may do; released before the servo ticks.
pub fn permission() -> Permission {
    match PERMISSION.load(Ordering::Relaxed) {
        0 => Permission::Released,
        1 => Permission::Follow,
        _ => Permission::Damp,
    }
}

fn permit(permission: Permission) {
    let number = match permission {
        Permission::Released => 0,
        Permission::Follow => 1,
        Permission::Damp => 2,
    };
    PERMISSION.store(number, Ordering::Relaxed);
}

/// From now on the joints' samples are theirs.
pub fn begin() {
    READY.store(true, Ordering::Relaxed);
}

/// The joints' samples mean nothing any more.
pub fn end() {
    READY.store(false, Ordering::Relaxed);
    release();
}

/// Whether [`begin`] was called.
pub fn has_begun() -> bool {
    READY.load(Ordering::Relaxed)
}

fn release() {
    for target in &TARGETS {
        target.store(RELEASED, Ordering::Relaxed);
    }
}

/// What level 1 works on.
pub struct ServoLoop {
    /// The half of the leg that moves.
    control: Control<JOINTS>,
    /// From each axis.
    samples: [Consumer<'static, JointSample>; JOINTS],
    /// From the housekeeping.
    requests: Consumer<'static, ControlRequest<JOINTS>>,
    /// From the identification.
    findings: Consumer<'static, Finding<JOINTS>>,
    /// To the housekeeping.
    drive: Producer<'static, DriveState>,
    /// To the identification.
    told: Producer<'static, Told>,
    /// The newest of each joint.
    sample: [JointSample; JOINTS],
    /// What was told of last.
    state: Option<DriveState>,
    /// The same.
    activity: Activity,
    /// Told of in this second.
    limits: [LimitCodes; JOINTS],
    round: ServoRound,
    volt_per_code: Volt,
    /// Processor cycles; wraps.
    clock: fn() -> u32,
    /// The bus, where there is one.
    link: Option<HostLink>,
    /// With what a host's identification begins.
    prepared: Option<(Plan, u64)>,
}

/// What level 1 works on, once it is there.
pub static SERVO: spin::Mutex<Option<&'static mut ServoLoop>> = spin::Mutex::new(None);

impl ServoLoop {
    /// Nothing heard or told yet.
    #[must_use]
    pub fn new(
        control: Control<JOINTS>,
        samples: [Consumer<'static, JointSample>; JOINTS],
        requests: Consumer<'static, ControlRequest<JOINTS>>,
        findings: Consumer<'static, Finding<JOINTS>>,
        drive: Producer<'static, DriveState>,
        told: Producer<'static, Told>,
        divider: f32,
        clock: fn() -> u32,
        link: Option<HostLink>,
    ) -> Self {
        Self {
            round: ServoRound::new(control.checksum(), drives::derating(divider)),
            control,
            samples,
            requests,
            findings,
            drive,
            told,
            sample: [JointSample::default(); JOINTS],
            state: None,
            activity: Activity::Idle,
            limits: Default::default(),
            volt_per_code: analog::sense(divider).volt_per_code,
            clock,
            link,
            prepared: None,
        }
    }

    fn run(&mut self) {
        for (slot, samples) in self.sample.iter_mut().zip(&mut self.samples) {
            while let Some(sample) = samples.dequeue() {
                *slot = sample;
            }
        }
        for (count, sample) in statistics::COUNTS.iter().zip(&self.sample) {
            count.set(sample.encoder_counts.cast_unsigned());
        }
        match self.round.gate(has_begun()) {
            Gate::Closed => {
                release();
                permit(Permission::Released);
                // What is asked meanwhile is asked of a leg that has no zeros.
                let _ = self.requests.dequeue();
                if let Some(link) = &mut self.link {
                    link.side.rest();
                }
                return;
            }
            Gate::Anew => {
                self.control.restart();
                self.state = None;
                if let Some(link) = &mut self.link {
                    link.begin();
                }
            }
            Gate::Open => {}
        }
        if let Some(finding) = self.findings.dequeue() {
            self.control.receive(finding);
        }
        self.look_around();
        let request = self.next_request();
        let request = match &self.link {
            Some(link) => link.side.held(request, self.control.state()),
            None => request,
        };
        let asked = permitted(request, interlock::is_clear(), self.control.state());
        let sample = Sample { joints: self.sample };
        let host = self.link.as_mut().and_then(HostLink::host);
        let output = self.control.tick_with(&sample, asked, LEG.gravity, host);
        command(output.servo.drive());
        permit(output.servo.decision.state.permission());
        if let Some(link) = &mut self.link {
            link.told(&self.control, &sample, &output);
        }
        self.tell_limits(&output);
        self.tell(request.as_ref(), asked.as_ref(), &output);
    }

    /// The operator's hand before the host.
    fn next_request(&mut self) -> Option<ControlRequest<JOINTS>> {
        let by_hand = self.requests.dequeue();
        let (request, prepared) = match &mut self.link {
            Some(link) => {
                link.side.hear(|fault| self.control.report(fault));
                link.side.request(by_hand)?
            }
            None => (by_hand?, None),
        };
        self.prepared = prepared;
        Some(request)
    }

    /// What the rest of the board saw: faults, bus voltage, temperature.
    fn look_around(&mut self) {
        let reported = REPORTED.swap(0, Ordering::Relaxed);
        for (bit, code) in REPORTABLE.into_iter().enumerate() {
            if reported & 1 << bit != 0 {
                self.control.report(Fault { code, joint: 0 });
            }
        }
        let bus = self.volt_per_code * statistics::BUS[0].get() as f32;
        let hottest_c = f32::from_bits(HOTTEST_C.load(Ordering::Relaxed));
        let found = self.round.look(|| self.control.checksum(), bus, hottest_c);
        for code in [found.parameters, found.supply].into_iter().flatten() {
            self.control.report(Fault { code, joint: 0 });
        }
        self.control.derate(&found.derating);
    }

    /// Limits that act and were not told of in this second.
    fn tell_limits(&mut self, output: &ControlOutput<JOINTS>) {
        if self.round.tick().is_multiple_of(SERVO_RATE_HZ) {
            self.limits = Default::default();
        }
        let codes = self.control.limit_codes(output);
        // One in a tick is enough: the others follow.
        let new =
            codes.iter().zip(&self.limits).position(|(codes, told)| codes.without(*told).first().is_some());
        if let Some(joint) = new
            && let (Some(codes), Some(told)) = (codes.get(joint), self.limits.get_mut(joint))
            && let Some(code) = codes.without(*told).first()
        {
            *told = told.with(true, code);
            let (tick, joint) = (self.round.tick(), joint as u8 + 1);
            self.say(Record::Limit { tick, code: code as u8, name: code.name(), joint });
        }
    }

    /// What changed, and the sample of the log.
    fn tell(
        &mut self,
        request: Option<&ControlRequest<JOINTS>>,
        asked: Option<&ControlRequest<JOINTS>>,
        output: &ControlOutput<JOINTS>,
    ) {
        let tick = self.round.tick();
        let accepted = asked.is_some() && !output.refused;
        if let Some(request) = request {
            let name = match request {
                ControlRequest::Power(_) => None,
                ControlRequest::Identify => Some("identify"),
                ControlRequest::Track { .. } => Some("track"),
                ControlRequest::TakeUpdate => Some("take_update"),
            };
            if let Some(name) = name {
                self.say(Record::Request { tick, name, accepted });
            }
        }
        if accepted && asked == Some(&ControlRequest::Identify) {
            self.event(Told::Begun(self.prepared));
        }
        let decision = &output.servo.decision;
        let activity = self.control.activity();
        let changed = self.state.is_none_or(|before| words::drive(before) != words::drive(decision.state));
        if changed {
            // A fault before the state that follows from it.
            if let Some(fault) = decision.fault {
                let (code, name) = (fault.code.number(), words::fault(fault.code));
                self.say(Record::Fault { tick, code, name, joint: fault.joint.saturating_add(1) });
            }
            let _ = self.drive.enqueue(decision.state);
        }
        if let Some(refused) = decision.refused {
            let why = words::refusal(refused.reason);
            self.say(Record::NotEnabled { tick, joint: refused.joint.saturating_add(1), why });
        }
        if changed || activity != self.activity {
            let (name, phase, motion) = words::activity(activity);
            let drive = words::drive(decision.state);
            self.say(Record::State { tick, drive, activity: name, phase, motion });
        }
        self.state = Some(decision.state);
        if output.took_update {
            self.event(Told::TookUpdate);
        }
        // A sample belongs to what was done in its ticks, so it goes before what begins.
        if let Some(logged) = output.logged {
            let room = self.told.len() + EVENTS < TOLD;
            if !room || self.told.enqueue(Told::Sample(logged)).is_err() {
                statistics::SAMPLES_LOST.add();
            }
        }
        if activity != self.activity {
            self.activity = activity;
            self.event(Told::Activity(activity));
        }
    }

    fn say(&mut self, record: Record<JOINTS>) {
        self.event(Told::Say(record));
    }

    /// Events have room kept free for them; one that still finds none is counted.
    fn event(&mut self, event: Told) {
        if self.told.enqueue(event).is_err() {
            statistics::RECORDS_LOST.add();
        }
    }
}

fn command(command: &DriveCommand<JOINTS>) {
    for (target, current) in TARGETS.iter().zip(command.currents) {
        let bits = if command.enabled { current.0.to_bits() } else { RELEASED };
        target.store(bits, Ordering::Relaxed);
    }
}

/// The servo's vector.
#[inline(always)]
pub fn interrupt() {
    if let Some(mut servo) = SERVO.try_lock()
        && let Some(servo) = servo.as_mut()
    {
        let begun = (servo.clock)();
        servo.run();
        statistics::SERVO_WORST.raise((servo.clock)().wrapping_sub(begun));
    }
    statistics::SERVO_TICKS.add();
}
