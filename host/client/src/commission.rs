//! Guided commissioning of a board over its bus: from an unknown board to a stored, accepted identification.
//!
//! ```text
//! find        nodes, firmware, serial number            wiring    supply, temperatures, inhibit reasons
//! calibrate   2160:1 = 1, switch held                   reference 2160:1 = 2, switch open, joints at zero
//! direction   6064 of both flexed joints is positive    enable    controlwords 6, 7, F, switch held
//! identify    2100:1 = 1                                store     controlword 0, 1010:1 = "save"
//! ```
//!
//! Nothing is remembered here: each step reads from the board whether it is done already. So an interrupted
//! procedure is resumed by starting it again. The operator's part is asked for in words, and the board itself
//! says when it is done: a step that it refuses because of the switch is asked again until the switch is
//! right. What the board answers (FF0E, 2160:3) is shown.
//!
//! Another host ends the procedure (`OtherHosts`): it would be taken for the operator's hand.

use std::time::Duration;

use scarab::bus::commissioning::{BoardState, CommissioningStep, StepResult};
use scarab::bus::{Abort, Identity};
use scarab::leg::{CalibrationRefusal, JOINTS, Parameter, Reason, RefusalReason};
use scarab::model::planar::BASE;
use scarab::safety::{InhibitReason, NoticeCode};
use scarab::trace::words;
use scarab_base::error::ToolError;
use scarab_base::names::parameter_name;
use scarab_base::number::Number;

use crate::alarms;
use crate::bus::{HOST, Object, RequestError};
use crate::master::Client;
use crate::other_hosts::{MayBeOn, OtherHosts};
use crate::report::{CommissionReport, JointCommissioned, ParameterRead, StepTaken};
use crate::words::JointState;

/// A step of the procedure, in its order.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, clap::ValueEnum)]
pub enum Step {
    /// Find the nodes of the leg.
    Find,
    /// Check supply, temperatures and inhibit reasons.
    Wiring,
    /// Calibrate both motors.
    Calibrate,
    /// Take the joints' zero.
    Reference,
    /// Check by hand that flexed joints have positive angles.
    Direction,
    /// Enable the drive.
    Enable,
    /// Identify the leg.
    Identify,
    /// Store calibration and model.
    Store,
}

/// What the procedure should do.
#[derive(Clone, Copy, Debug)]
pub struct CommissionOptions {
    /// Node-IDs of hip and knee.
    pub nodes: [u8; JOINTS],
    /// Last step.
    pub until: Step,
    /// Longest wait for the operator, s.
    pub patience_s: f64,
    /// Identify although the board has an accepted result since its start.
    pub again: bool,
}

/// Interval between two looks at the board.
const LOOK: Duration = Duration::from_millis(100);
/// Interval between two requests that the operator's switch still refuses.
const AGAIN: Duration = Duration::from_millis(400);
/// Time to read what is asked for, before anything acts.
const READ_TIME: Duration = Duration::from_secs(2);
/// Longest wait for a check that an earlier run asked for, s.
const CHECKED_BEFORE_S: f64 = 10.0;
/// Longest calibration and reference, s.
const LONGEST_STEP_S: f64 = 600.0;
/// Longest identification, s.
const LONGEST_IDENTIFICATION_S: f64 = 600.0;
/// Longest return into the range before an identification, s.
const LONGEST_RETURN_S: f64 = 30.0;
/// Longest write of the flash, s.
const LONGEST_STORE_S: f64 = 30.0;
/// Plausible supply of either board, V, and temperatures, degrees Celsius.
const SUPPLY_V: [f64; 2] = [12.0, 58.0];
const TEMPERATURE_C: [f64; 2] = [-20.0, 90.0];

/// Angle from which a joint counts as flexed, rad.
const FLEXED_RAD: f64 = 5.0 * core::f64::consts::PI / 180.0;

/// NMT command: start of a node.
const START: u8 = 1;
/// Node-ID in an entry of 1016: bits 16 to 22; its time: bits 0 to 15.
const WATCHED_NODE: u32 = 0x7F << 16;
const WATCHED_TIME: u32 = 0xFFFF;
const COMMAND: Object = Object(0x2160, 1);
const STATE: Object = Object(0x2160, 2);
const RESULT: Object = Object(0x2160, 3);
const REASONS: Object = Object(0x2170, 1);
const STATUSWORD: Object = Object(0x6041, 0);
const CONTROLWORD: Object = Object(0x6040, 0);
const INPUTS: Object = Object(0x60FD, 0);
const IDENTIFY: Object = Object(0x2100, 1);
const ACTIVITY: Object = Object(0x2100, 2);
const VERDICT: Object = Object(0x2100, 8);
/// Heartbeat that the nodes watch while the drive is on: this host's, within half a second.
const OURS: u32 = (HOST as u32) << 16 | 500;
/// Entries of 1016; one that another host uses stays.
const WATCHES: [Object; 2] = [Object(0x1016, 1), Object(0x1016, 2)];
const LOST_HOST: Object = Object(0x6007, 0);
const MODE: Object = Object(0x6060, 0);
const SAVE: u32 = u32::from_le_bytes(*b"save");

/// What [`Commission::take_control`] has replaced at a node: entry of 1016, its value, and the mode.
#[derive(Clone, Copy, Debug)]
struct Replaced {
    node: u8,
    entry: Object,
    watched: u32,
    mode: u32,
}

/// A step's work; returns its result in words.
type Perform<C> = fn(&mut C) -> Result<String, ToolError>;

/// The procedure.
pub struct Commission<'a> {
    client: Client,
    options: CommissionOptions,
    say: &'a mut dyn FnMut(&str),
    /// This run took the joints' reference.
    has_referenced: bool,
    /// State of each node before this host.
    before: Vec<Replaced>,
    others: Option<OtherHosts>,
    /// Last words of the board about a step that it refuses, and all that were shown during this wait.
    said: Option<String>,
    shown: Vec<String>,
    report: CommissionReport,
}

fn refused(words: impl Into<String>) -> ToolError {
    ToolError::Refused(words.into())
}

/// Words of the inhibit reasons in a bit mask.
fn inhibits(causes: u32) -> String {
    let names = InhibitReason::ALL.into_iter().filter(|cause| causes & cause.bit() != 0);
    let words: Vec<String> = names
        .map(|cause| match cause.code() {
            Some(code) => format!("{} ({})", cause.name(), code.words()),
            None => cause.name().to_owned(),
        })
        .collect();
    words.join(", ")
}

fn are_enabled(states: &[Option<JointState>]) -> bool {
    states.iter().all(|state| state.is_some_and(JointState::is_enabled))
}

/// Whether both joints are bent, and count in their direction.
fn are_bent(angles: [f64; JOINTS]) -> bool {
    angles.into_iter().all(|angle| angle >= FLEXED_RAD)
}

/// Joints that are bent and count in the other direction.
fn bent_against(angles: [f64; JOINTS]) -> Vec<&'static str> {
    let joints = ["hip", "knee"].into_iter().zip(angles);
    joints.filter(|(_, angle)| *angle <= -FLEXED_RAD).map(|(name, _)| name).collect()
}

/// Words of a refused calibration.
fn calibration(axis: u32, reason: u32, detail: u32) -> String {
    let known = CalibrationRefusal::ALL.into_iter().find(|refusal| u32::from(refusal.number()) == reason);
    let word = known.map_or("an unknown reason", words::calibration);
    let detail = if detail == 0 { String::new() } else { format!(" {detail}") };
    format!("the calibration refused axis {axis}: {word}{detail} (docs/commission.md says what to do)")
}

impl<'a> Commission<'a> {
    /// Prepares the procedure; `say` shows a line to the operator.
    pub fn new(client: Client, options: CommissionOptions, say: &'a mut dyn FnMut(&str)) -> Self {
        let joints = options.nodes.map(|node| JointCommissioned { node, ..JointCommissioned::default() });
        let report = CommissionReport { joints: joints.into(), ..CommissionReport::default() };
        Self {
            client,
            options,
            say,
            has_referenced: false,
            before: Vec::new(),
            others: None,
            said: None,
            shown: Vec::new(),
            report,
        }
    }

    /// Runs all steps up to the last one. The report holds what was reached, also after an error.
    pub fn run(mut self) -> (CommissionReport, Result<(), ToolError>) {
        // With their names in the report.
        let steps: [(Step, &'static str, Perform<Self>); 8] = [
            (Step::Find, "find", Self::find),
            (Step::Wiring, "wiring", Self::check_wiring),
            (Step::Calibrate, "calibrate", Self::calibrate),
            (Step::Reference, "reference", Self::reference),
            (Step::Direction, "direction", Self::check_direction),
            (Step::Enable, "enable", Self::enable),
            (Step::Identify, "identify", Self::identify),
            (Step::Store, "store", Self::store),
        ];
        let mut result = Ok(());
        let until = self.options.until;
        for (_, name, perform) in steps.into_iter().filter(|(step, ..)| *step <= until) {
            let begun = self.client.now();
            let found = perform(&mut self);
            let words = match &found {
                Ok(words) => words.clone(),
                Err(error) => format!("failed: {error}"),
            };
            self.line(&format!("{name:<10} {words}"));
            let seconds = self.seconds_since(begun);
            self.report.steps.push(StepTaken { step: name, result: words, seconds });
            if let Err(error) = found {
                result = Err(error);
                break;
            }
        }
        // Whatever happened, the leg is not left enabled.
        let restored = self.restore_settings();
        (self.report, result.and(restored))
    }

    fn line(&mut self, words: &str) {
        (self.say)(words);
    }

    /// Node whose objects are equal at both.
    fn first(&self) -> u8 {
        self.options.nodes[0]
    }

    fn read(&mut self, object: Object) -> Result<u32, ToolError> {
        self.client.read(self.first(), object)
    }

    fn wait(&mut self, time: Duration) -> Result<(), ToolError> {
        self.client.wait(time).map_err(RequestError::for_bus)
    }

    /// Refuses if another host was heard.
    fn check_alone(&self) -> Result<(), ToolError> {
        self.others.as_ref().map_or(Ok(()), |others| others.check(&self.client))
    }

    /// Shows what the board says about a refused step, once per wait: both joints may repeat theirs in turn.
    fn show(&mut self, words: String) {
        if !self.shown.contains(&words) {
            self.line(&format!("           the board says: {words}"));
            self.shown.push(words.clone());
        }
        self.said = Some(words);
    }

    /// Shows the reasons in the emergency messages since the last call; one that ended is forgotten.
    fn show_emergencies(&mut self) {
        for emergency in self.client.take_emergencies() {
            if !self.options.nodes.contains(&emergency.node) {
                continue;
            }
            if emergency.code == 0 {
                self.said = None;
            } else {
                let words = alarms::words(emergency.code, emergency.information);
                self.show(format!("{words} ({:04X})", emergency.code));
            }
        }
    }

    fn has(&mut self, state: u8) -> Result<bool, ToolError> {
        Ok(self.read(STATE)? & u32::from(state) != 0)
    }

    /// Asks the operator for something, then tries it until `is_done`, at most for the operator's time.
    fn ask(
        &mut self,
        words: &str,
        is_done: impl FnMut(&mut Self) -> Result<bool, ToolError>,
    ) -> Result<(), ToolError> {
        self.ask_for(self.options.patience_s, words, is_done)
    }

    /// [`Self::ask`], at most for this time.
    fn ask_for(
        &mut self,
        patience_s: f64,
        words: &str,
        mut is_done: impl FnMut(&mut Self) -> Result<bool, ToolError>,
    ) -> Result<(), ToolError> {
        self.line(&format!("           please: {words}"));
        self.wait(READ_TIME)?;
        let begun = self.client.now();
        (self.said, self.shown) = (None, Vec::new());
        loop {
            self.check_alone()?;
            if is_done(self)? {
                return Ok(());
            }
            self.show_emergencies();
            if self.seconds_since(begun) > patience_s {
                let why = match &self.said {
                    Some(said) => format!("the board says: {said}; asked for: {words}"),
                    None => format!("for the operator: {words}"),
                };
                return Err(refused(format!(
                    "waited {patience_s} s, {why}; start the command again to resume"
                )));
            }
            self.wait(AGAIN)?;
        }
    }

    fn find(&mut self) -> Result<String, ToolError> {
        // The operator may hold the switch of a leg that is ready.
        self.others = Some(OtherHosts::listen(&mut self.client, &self.options.nodes, MayBeOn::ByContacts)?);
        for node in self.options.nodes {
            self.client.manage(node, START).map_err(RequestError::for_bus)?;
        }
        let mut serials = Vec::new();
        for (joint, node) in self.options.nodes.into_iter().enumerate() {
            let kind = self.client.read(node, Object(0x1000, 0))?;
            if kind & 0xFFFF != 402 {
                return Err(refused(format!("node {node} is no drive of CiA 402: device type {kind:08X}")));
            }
            let product = self.client.read(node, Object(0x1018, 2))?;
            if product != Identity::scarab(0, "").for_joint(joint).product {
                return Err(refused(format!(
                    "node {node} is not the {}: its product code (1018:2) is {product}; hip has 1, knee 2; --nodes takes hip, then knee",
                    ["hip", "knee"][joint]
                )));
            }
            serials.push(self.client.read(node, Object(0x1018, 4))?);
            if let Err(error) = self.client.bytes(node, COMMAND) {
                return Err(if error.is(Abort::NoObject) {
                    refused(format!(
                        "node {node} has no object 2160: other firmware, or too old; flash this one"
                    ))
                } else {
                    error.for_object(node, COMMAND)
                });
            }
        }
        let first = self.first();
        self.report.device = self.client.text(first, Object(0x1008, 0))?;
        self.report.firmware = self.client.text(first, Object(0x100A, 0))?;
        self.report.image = self.client.read(first, Object(0x1F56, 1))?;
        self.report.serial = serials[0];
        if serials.iter().any(|serial| *serial != serials[0]) {
            return Err(refused(format!(
                "nodes {} and {} are on different boards: serial numbers {:08X} and {:08X}",
                self.options.nodes[0], self.options.nodes[1], serials[0], serials[1]
            )));
        }
        let CommissionReport { device, firmware, serial, .. } = &self.report;
        let [hip, knee] = self.options.nodes;
        Ok(format!(
            "{device}, firmware {firmware}, serial number {serial:08X}, hip node {hip}, knee node {knee}"
        ))
    }

    /// Reads a temperature of 2170, degrees Celsius.
    fn temperature(&mut self, node: u8, sub: u8) -> Result<f64, ToolError> {
        let tenths = self.client.read(node, Object(0x2170, sub))? as i16;
        Ok(if tenths == i16::MIN { f64::NAN } else { f64::from(tenths) / 10.0 })
    }

    fn check_wiring(&mut self) -> Result<String, ToolError> {
        let volt = f64::from(self.read(Object(0x6079, 0))?) / 1e3;
        self.report.supply_v = volt.into();
        if !(SUPPLY_V[0]..=SUPPLY_V[1]).contains(&volt) {
            return Err(refused(format!(
                "the supply has {volt:.1} V, limits {} to {} V: check the supply and its fuse",
                SUPPLY_V[0], SUPPLY_V[1]
            )));
        }
        for (joint, node) in self.options.nodes.into_iter().enumerate() {
            let [bridge_c, winding_c] = [self.temperature(node, 2)?, self.temperature(node, 3)?];
            let found = &mut self.report.joints[joint];
            (found.bridge_c, found.winding_c) = (bridge_c.into(), winding_c.into());
            if !(TEMPERATURE_C[0]..=TEMPERATURE_C[1]).contains(&bridge_c) {
                return Err(refused(format!(
                    "the bridge of node {node} reads {bridge_c:.0} degrees Celsius, limits {} to {}: its thermistor or the board is defective, or hot",
                    TEMPERATURE_C[0], TEMPERATURE_C[1]
                )));
            }
        }
        let causes = self.read(REASONS)?;
        if causes != 0 {
            self.line(&format!("           inhibited: {}", inhibits(causes)));
            self.reset(causes)?;
        }
        Ok(format!("supply {volt:.1} V, temperatures plausible, nothing inhibits"))
    }

    /// Resets the inhibit reasons, once the operator has removed their causes.
    fn reset(&mut self, causes: u32) -> Result<(), ToolError> {
        if causes & InhibitReason::for_ever() != 0 {
            return Err(refused(format!(
                "no reset clears {}: this needs another image, configuration or board",
                inhibits(causes & InhibitReason::for_ever())
            )));
        }
        self.ask("remove the cause (close the emergency stop), and keep the enabling switch open", |this| {
            let result = this.perform_step(CommissioningStep::Reset, LONGEST_STEP_S)?;
            if result != StepResult::Done && result != StepResult::Inhibited {
                return Ok(false);
            }
            // A reason that still holds comes back within a millisecond.
            this.wait(LOOK)?;
            Ok(this.read(REASONS)? == 0)
        })
    }

    fn seconds_since(&self, begun: Duration) -> f64 {
        (self.client.now() - begun).as_secs_f64()
    }

    /// Asks the board for a step; returns its result once it has ended.
    fn perform_step(&mut self, step: CommissioningStep, longest_s: f64) -> Result<StepResult, ToolError> {
        let node = self.first();
        self.client.write(node, COMMAND, step as u32, 1)?;
        let begun = self.client.now();
        while self.seconds_since(begun) < longest_s {
            let number = self.read(RESULT)?;
            let result = StepResult::ALL.into_iter().find(|result| *result as u32 == number);
            match result {
                Some(StepResult::UnderWay) => self.wait(LOOK)?,
                Some(result) => return Ok(result),
                None => return Err(refused(format!("node {node} has an unknown result {number} in 2160:3"))),
            }
        }
        Err(refused(format!("{step:?} has not ended after {longest_s} s")))
    }

    /// Performs a step, and asks the operator to set the switch as the step requires.
    fn guide(&mut self, step: CommissioningStep, words: &str) -> Result<(), ToolError> {
        self.ask(words, |this| match this.perform_step(step, LONGEST_STEP_S)? {
            StepResult::Done | StepResult::AlreadyDone => Ok(true),
            // An interrupted procedure has begun a calibration that is under way.
            why @ (StepResult::SwitchOpen
            | StepResult::SwitchClosed
            | StepResult::ContactsNotOpened
            | StepResult::Calibrating) => {
                this.show(why.words().to_owned());
                Ok(false)
            }
            StepResult::CalibrationRefused => {
                let [axis, reason, detail] = [4, 5, 6].map(|sub| this.read(Object(0x2160, sub)));
                Err(refused(calibration(axis?, reason?, detail?)))
            }
            StepResult::Inhibited => {
                let causes = this.read(REASONS)?;
                Err(refused(format!("inhibited: {}", inhibits(causes))))
            }
            StepResult::Interrupted => Err(refused(
                "the calibration was interrupted: the enabling switch was let go, or a fault; start the command again",
            )),
            StepResult::DriveOn => {
                this.turn_off()?;
                Ok(false)
            }
            why => Err(refused(format!("the board refuses {step:?}: {}", why.words()))),
        })
    }

    fn calibrate(&mut self) -> Result<String, ToolError> {
        if self.has(BoardState::CALIBRATED)? {
            return Ok("both axes are calibrated".into());
        }
        self.guide(
            CommissioningStep::Calibrate,
            "support both joints, clear of their stops; open the enabling switch, then hold it until both motors are calibrated; they turn, and a lifted joint can fall",
        )?;
        Ok("both axes calibrated".into())
    }

    fn reference(&mut self) -> Result<String, ToolError> {
        if self.has(BoardState::REFERENCED)? {
            return Ok("the joints have their zeros".into());
        }
        // Without zeros the switch enables nothing; letting it go states the pose, as the button would.
        let mut was_closed = false;
        self.ask(
            "hold the enabling switch while you bring both joints to their anatomical zero; let it go there and keep them still",
            |this| {
                let is_closed = this.has(BoardState::SWITCH_CLOSED)?;
                was_closed |= is_closed;
                if is_closed || !was_closed {
                    return Ok(false);
                }
                match this.perform_step(CommissioningStep::Reference, LONGEST_STEP_S)? {
                    StepResult::Done | StepResult::AlreadyDone => Ok(true),
                    why => {
                        this.line(&format!("           not taken: {}; hold the switch again", why.words()));
                        was_closed = false;
                        Ok(false)
                    }
                }
            },
        )?;
        self.has_referenced = true;
        Ok("zeros taken".into())
    }

    /// Checks by hand what nothing else detects: a joint that counts in the other direction.
    fn check_direction(&mut self) -> Result<String, ToolError> {
        if self.is_identified()? {
            return Ok("not needed: the leg is identified".into());
        }
        let words = "bend hip and knee by at least 10 degrees each, as for sitting down";
        let patience_s = if self.has_referenced { self.options.patience_s } else { CHECKED_BEFORE_S };
        let mut angles = [0.0; JOINTS];
        let asked = self.ask_for(patience_s, words, |this| {
            angles = this.positions()?;
            Ok(are_bent(angles))
        });
        let against = bent_against(angles);
        let [hip, knee] = angles.map(f64::to_degrees);
        match asked {
            Ok(()) => Ok(format!("bent joints have positive angles: hip {hip:.0}, knee {knee:.0} degrees")),
            Err(error) if !against.is_empty() => Err(refused(format!(
                "{error}; the angle of the {} is negative: if it is bent as asked, correct its `direction` in the leg file",
                against.join(" and the ")
            ))),
            // A run before this one took the reference and asked for the check.
            Err(_) if !self.has_referenced => {
                Ok(format!("not checked in this run: hip {hip:.0}, knee {knee:.0} degrees"))
            }
            Err(error) => Err(error),
        }
    }

    /// Angles of the joints, rad.
    fn positions(&mut self) -> Result<[f64; JOINTS], ToolError> {
        let mut angles = [0.0; JOINTS];
        for (angle, node) in angles.iter_mut().zip(self.options.nodes) {
            *angle = 1e-6 * f64::from(self.client.read(node, Object(0x6064, 0))?.cast_signed());
        }
        Ok(angles)
    }

    fn states(&mut self) -> Result<[Option<JointState>; JOINTS], ToolError> {
        let mut states = [None; JOINTS];
        for (state, node) in states.iter_mut().zip(self.options.nodes) {
            *state = JointState::from_statusword(self.client.read(node, STATUSWORD)? as u16);
        }
        Ok(states)
    }

    fn command(&mut self, word: u32) -> Result<(), ToolError> {
        for node in self.options.nodes {
            self.client.write(node, CONTROLWORD, word, 2)?;
        }
        self.wait(LOOK)
    }

    /// Turns the drive off.
    fn turn_off(&mut self) -> Result<(), ToolError> {
        self.command(0)?;
        self.wait(Duration::from_millis(500))
    }

    /// Whether the board has an accepted result since its start, and no new one is wanted.
    fn is_identified(&mut self) -> Result<bool, ToolError> {
        Ok(!self.options.again && self.read(VERDICT)? == 1)
    }

    fn enable(&mut self) -> Result<String, ToolError> {
        if self.is_identified()? {
            return Ok("not needed: the leg is identified".into());
        }
        self.take_control()?;
        let mut may_reset = true;
        self.ask(
            "support the leg within its range of motion, open the enabling switch, then hold it; support the leg until it holds its pose: only a quarter of the current is there until the motors have moved",
            |this| {
                let states = this.states()?;
                if are_enabled(&states) {
                    // The contacts may have enabled it: from here on this host controls the leg.
                    this.command(15)?;
                    return Ok(true);
                }
                // Once: a fault that returns must not be reset again and again.
                if states.iter().flatten().any(|state| state.has_fault()) && core::mem::take(&mut may_reset) {
                    let code = this.read(Object(0x603F, 0))?;
                    this.line(&format!("           fault {code:04X}; resetting"));
                    this.command(0x80)?;
                }
                for word in [6, 7, 15] {
                    this.command(word)?;
                }
                let is_enabled = are_enabled(&this.states()?);
                if !is_enabled {
                    // Its requests would otherwise be repeated as soon as the reason ends.
                    this.command(0)?;
                }
                Ok(is_enabled)
            },
        )
        .map_err(|error| match self.why_not_enabled() {
            Ok(why) if !why.is_empty() => refused(format!("{error}; present reasons (60FD): {why}")),
            _ => error,
        })?;
        for (joint, angle) in self.positions()?.into_iter().enumerate() {
            self.report.joints[joint].position_rad = angle.into();
        }
        Ok("enabled; the leg holds its pose".into())
    }

    /// Prepares both nodes for this host: they watch its heartbeat, and hold their pose once enabled.
    fn take_control(&mut self) -> Result<(), ToolError> {
        self.client.begin_heartbeats();
        for node in self.options.nodes {
            if self.client.read(node, LOST_HOST)? == 0 {
                return Err(refused(format!(
                    "node {node} would not stop when its host is lost: 6007 is 0; write 3 to it"
                )));
            }
            let (entry, watched) = self.free_watch(node)?;
            let mode = self.client.read(node, MODE)?;
            self.before.push(Replaced { node, entry, watched, mode });
            self.client.write(node, entry, OURS, 4)?;
            self.client.write(node, MODE, 0, 1)?;
        }
        Ok(())
    }

    /// Entry of 1016 that no other host uses, and the value to be restored. One that a killed procedure has
    /// left is taken and freed: it must not be stored.
    fn free_watch(&mut self, node: u8) -> Result<(Object, u32), ToolError> {
        let mut watches = Vec::new();
        for entry in WATCHES {
            watches.push((entry, self.client.read(node, entry)?));
        }
        if let Some((entry, _)) = watches.iter().find(|(_, watched)| *watched == OURS) {
            return Ok((*entry, 0));
        }
        let is_free = |watched: u32| watched & WATCHED_NODE == 0 || watched & WATCHED_TIME == 0;
        watches.iter().find(|(_, watched)| is_free(*watched)).copied().ok_or_else(|| {
            let hosts: Vec<_> = watches.iter().map(|(_, watched)| (watched >> 16 & 0x7F).to_string()).collect();
            refused(format!(
                "node {node} watches the heartbeats of nodes {}, so no entry of 1016 is free for this host: write 0 to \
                 1016:1 or 1016:2",
                hosts.join(" and ")
            ))
        })
    }

    /// Turns the drive off, and restores what [`Self::take_control`] has replaced.
    fn restore_settings(&mut self) -> Result<(), ToolError> {
        if self.before.is_empty() {
            return Ok(());
        }
        self.turn_off()?;
        for Replaced { node, entry, watched, mode } in core::mem::take(&mut self.before) {
            self.client.write(node, entry, watched, 4)?;
            self.client.write(node, MODE, mode, 1)?;
        }
        Ok(())
    }

    /// Reasons in 60FD against enabling.
    fn why_not_enabled(&mut self) -> Result<String, ToolError> {
        let mut reasons = Vec::new();
        for node in self.options.nodes {
            let inputs = self.client.read(node, INPUTS)?;
            // The bit of the enabling switch is set while it is held.
            let inputs = inputs ^ RefusalReason::SwitchOpen.bit();
            let set = RefusalReason::ALL.into_iter().filter(|reason| {
                !matches!(reason, RefusalReason::NoTransition | RefusalReason::NoAssistance)
                    && inputs & reason.bit() != 0
            });
            reasons.extend(set.map(|reason| format!("node {node}: {}", reason.name())));
        }
        Ok(reasons.join(", "))
    }

    fn identify(&mut self) -> Result<String, ToolError> {
        if self.is_identified()? {
            self.read_results()?;
            return Ok("accepted since the start of the board (--again identifies once more)".into());
        }
        let before = self.read(Object(0x2100, 7))?;
        // An identification under way is that of an interrupted procedure.
        if !(1..=7).contains(&self.read(ACTIVITY)?) {
            self.begin_identification()?;
        }
        self.line("           the leg moves for about a minute: keep clear, and hold the switch");
        let begun = self.client.now();
        let mut last = 0;
        loop {
            self.check_alone()?;
            let (activity, motion) = (self.read(ACTIVITY)?, self.read(Object(0x2100, 3))?);
            if activity != last {
                let words = crate::words::doing(Some(activity), Some(motion), &[]);
                self.line(&format!("           {words}"));
                last = activity;
            }
            if !are_enabled(&self.states()?) {
                let (code, causes) = (self.read(Object(0x603F, 0))?, self.read(REASONS)?);
                return Err(refused(format!(
                    "the drive is off: error code {code:04X}; inhibit reasons: {}; start the command again",
                    if causes == 0 { "none".into() } else { inhibits(causes) }
                )));
            }
            if !(1..=7).contains(&activity) {
                break;
            }
            if self.seconds_since(begun) > LONGEST_IDENTIFICATION_S {
                return Err(refused(format!("no verdict after {LONGEST_IDENTIFICATION_S} s")));
            }
            self.wait(LOOK)?;
        }
        self.wait(LOOK)?;
        self.read_results()?;
        match self.report.verdict {
            Some("accepted") => {
                Ok(format!("accepted; number of models stored on this board before: {before}"))
            }
            Some(_) => {
                Err(refused(format!("the identification is refused: {}", self.report.reasons.join(", "))))
            }
            None => Err(refused("the identification was cancelled")),
        }
    }

    /// Starts the identification; a leg that still returns into its range refuses it.
    fn begin_identification(&mut self) -> Result<(), ToolError> {
        let node = self.first();
        let begun = self.client.now();
        while self.seconds_since(begun) < LONGEST_RETURN_S {
            self.check_alone()?;
            self.client.write(node, IDENTIFY, 1, 1)?;
            self.wait(AGAIN)?;
            self.show_emergencies();
            if (1..=7).contains(&self.read(ACTIVITY)?) {
                return Ok(());
            }
        }
        let why = self
            .said
            .take()
            .map_or("it does not come to rest".into(), |said| format!("the board says: {said}"));
        Err(refused(format!("the leg has not begun within {LONGEST_RETURN_S} s: {why}")))
    }

    /// Reads verdict, parameters and fit.
    fn read_results(&mut self) -> Result<(), ToolError> {
        self.report.verdict = match self.read(VERDICT)? {
            1 => Some("accepted"),
            2 => Some("refused"),
            _ => None,
        };
        let bits = self.read(Object(0x2100, 9))?;
        let set = Reason::ALL.into_iter().enumerate().filter(|(index, _)| bits & 1 << index != 0);
        self.report.reasons = set.map(|(_, reason)| reason.name()).collect();
        let first = self.first();
        self.report.base.clear();
        for sub in 1..=BASE as u8 {
            let carrier = self.client.read(first, Object(0x2122, sub))?;
            let flags = self.client.read(first, Object(0x2123, sub))?;
            let parameter = Parameter::ALL.get((carrier as usize & 0xFF).wrapping_sub(1));
            let grouped = if flags & 2 != 0 { "grouped" } else { "single" };
            self.report.base.push(ParameterRead {
                name: parameter.map_or("-".into(), |parameter| {
                    parameter_name((carrier as usize >> 8).saturating_sub(1), *parameter)
                }),
                value: self.client.real(first, Object(0x2120, sub))?.into(),
                sigma: self.client.real(first, Object(0x2121, sub))?.into(),
                status: if flags & 4 != 0 { "dropped" } else { grouped },
            });
        }
        for (joint, node) in self.options.nodes.into_iter().enumerate() {
            let mut parameters = Vec::new();
            for (sub, parameter) in (1..).zip(Parameter::ALL) {
                parameters.push(ParameterRead {
                    name: parameter_name(joint, parameter),
                    value: self.client.real(node, Object(0x2110, sub))?.into(),
                    sigma: self.client.real(node, Object(0x2111, sub))?.into(),
                    status: match self.client.read(node, Object(0x2112, sub))? {
                        1 => "identified",
                        2 => "grouped",
                        3 => "weak",
                        4 => "prior",
                        _ => "-",
                    },
                });
            }
            let mut predicted: Vec<Number> = Vec::new();
            for sub in 2..=4 {
                predicted.push(self.client.real(node, Object(0x2130, sub))?.into());
            }
            let found = &mut self.report.joints[joint];
            (found.parameters, found.predicted_rms_nm) = (parameters, predicted);
        }
        Ok(())
    }

    fn store(&mut self) -> Result<String, ToolError> {
        // Before anything is stored.
        self.restore_settings()?;
        let node = self.first();
        self.client.take_emergencies();
        self.ask("let the leg come to rest", |this| {
            match this.client.try_write(node, Object(0x1010, 1), SAVE, 4) {
                Ok(()) => Ok(true),
                Err(error) if error.is(Abort::State) => Ok(false),
                Err(error) => Err(error.for_object(node, Object(0x1010, 1))),
            }
        })?;
        let begun = self.client.now();
        let mut writes = false;
        while self.seconds_since(begun) < LONGEST_STORE_S {
            self.wait(LOOK)?;
            for emergency in self.client.take_emergencies().into_iter().filter(|found| found.node == node) {
                writes |= emergency.code == NoticeCode::Storing.number();
                if emergency.code == NoticeCode::StoreFailed.number() {
                    return Err(refused("the board could not store its parameters"));
                }
                if emergency.code == 0 && writes {
                    self.report.stored = true;
                    self.report.generation = self.read(Object(0x2100, 7))?;
                    return Ok(format!(
                        "stored; number of models stored on this board: {}",
                        self.report.generation
                    ));
                }
            }
        }
        Err(refused(format!("the board has not confirmed its store within {LONGEST_STORE_S} s")))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_bent_joint_with_a_negative_angle_is_named() {
        let none: [&str; 0] = [];
        assert!(are_bent([0.12, 0.27]) && bent_against([0.12, 0.27]) == none);
        assert!(!are_bent([0.12, 0.0]) && bent_against([0.12, 0.0]) == none);
        assert!(!are_bent([0.12, -0.27]));
        assert_eq!(bent_against([0.12, -0.27]), ["knee"]);
        assert_eq!(bent_against([-0.12, -0.27]), ["hip", "knee"]);
        assert!(!are_bent([f64::NAN, 0.27]) && bent_against([f64::NAN, 0.27]) == none);
    }
}
