//! An operator at the board: contacts, gears and hands, guided by the records that the image sends.
//!
//! The steps are those of docs/board.md. After `mount` the motors are calibrated with gear and leg on.
//! Without it they are free, and the gears are mounted before the reference. Then the leg is moved by hand
//! into its range.

use std::rc::Rc;
use std::time::Duration;

use scarab::bus::Frame;
use scarab::bus::commissioning::BoardState;
use scarab::hal::Contacts;
use scarab::safety::NoticeCode;
use scarab_base::error::ToolError;
use scarab_client::bus::{self, Object, Patience, RequestError};
use scarab_client::master::Client;
use scarab_identify::formats::leg_file::LegFile;
use scarab_rig::pair::start_position;

use crate::chip::{Chip, ENABLING, START, STATUS_LIGHT};
use crate::image::Image;
use crate::load::{CURRENT_INTERRUPT, SERVO};
use crate::machine::{End, Machine};
use crate::peripherals::rcc::ResetReason;
use crate::plant::{Axis, JOINTS, Plant, WARM_C};
use crate::rtt::{Probe, field};
use crate::store_cuts::{Request, SAVE};
use crate::time::{Ticks, microseconds, seconds, ticks};

/// Interval in which the probe reads, s.
const POLL_S: f64 = 1e-3;
/// Longest calibration of one motor, s.
const CALIBRATION_S: f64 = 60.0;
/// Longest identification, s.
const IDENTIFICATION_S: f64 = 180.0;

/// Step of a session.
#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum Step {
    /// Mount gears and leg, which hangs free.
    Mount,
    /// Calibrate both motors; without `mount` before, the motors are free of their gears.
    Calibrate,
    /// Mount the gears, take the reference, move the leg into its range.
    Reference,
    /// Enable the drive; the leg holds its pose.
    Enable,
    /// Identify the leg.
    Identify,
    /// Store the calibrations, by a host ("save" to 1010:1); the drive is off.
    Save,
    /// Reset the chip by its pin: memory stays, and with it the temperatures of the windings.
    Reset,
    /// Cut the power and switch it on again; the leg is held by hand.
    PowerCycle,
    /// Turn each joint by hand over its motor's index, twice.
    Turn,
    /// Wait until absolute encoders at the joints have set the zeros.
    Zeros,
    /// Compare position, torque, voltage, currents and temperatures that the bus shows with the plant's own,
    /// while the leg holds its pose.
    Telemetry,
    /// Compare the status light with the state of the board that the bus shows.
    StatusLight,
    /// Heat the thermistor of the first motor, then break the wire of the second's.
    Thermistors,
}

/// Image, board, leg and operator.
pub struct Session {
    pub machine: Machine,
    pub probe: Probe,
    pub leg: LegFile,
    pub resets: Vec<ResetReason>,
    /// Whether records of the timeline are printed when they arrive.
    pub prints: bool,
    /// The joints were turned over their indexes since the start, or absolute encoders replace that: stored
    /// calibrations need no motion.
    is_known: bool,
    /// Records before the last start.
    started: usize,
    /// Frames of `can.sent` that a client has received.
    received: usize,
    /// Longest wait for an answer.
    pub patience: Duration,
}

/// Records that are printed when they arrive.
const TIMELINE: [&str; 11] = [
    "boot",
    "crash",
    "refused",
    "request",
    "gate_driver",
    "state",
    "activity",
    "not_enabled",
    "fault",
    "axis_fault",
    "calibration",
];

/// Telemetry: name, object, unit, tolerance (`None`: an upper bound), and the plant's own value.
type Telemetry<'a> = (&'a str, u16, u8, f64, Option<f64>, &'a dyn Fn(&Session) -> f64);

/// Samples of a cycle of the status light, and its length, s.
const LIGHT_SAMPLES: u32 = 400;
const LIGHT_CYCLE_S: f64 = 2.0;

/// Longest wait for an answer.
const ANSWER: Duration = Duration::from_millis(500);
/// Readings of which the mean is compared.
const READINGS: u32 = 20;
/// Relative error of the current measurement: amplifiers and shunts.
const GAIN_ERROR: f64 = 0.03;

/// Longest write of the flash, s.
const STORE_S: f64 = 5.0;
/// Angle that passes an index twice at a ratio of 50: 15 degrees.
const TURNED_RAD: f64 = 0.262;

impl Session {
    /// Powers a board with this image and leg; `factor` is the number of cycles per instruction.
    ///
    /// # Errors
    /// The leg cannot be simulated, or the image sends no records.
    pub fn new(image: &Rc<Image>, leg: &LegFile, factor: f64, seed: u64) -> Result<Self, ToolError> {
        let machine = Machine::new(image, Chip::new(Plant::new(leg, seed)?, seed), factor)?;
        let probe = Probe::new(&machine)?;
        Ok(Self {
            machine,
            probe,
            leg: leg.clone(),
            resets: Vec::new(),
            prints: false,
            is_known: false,
            started: 0,
            received: 0,
            patience: ANSWER,
        })
    }

    pub fn now(&self) -> Ticks {
        self.chip().now
    }

    /// Runs for a time, s.
    pub fn run(&mut self, duration: f64) -> Result<(), ToolError> {
        self.run_until(self.now() + ticks(duration))
    }

    /// Runs until an instant.
    pub fn run_until(&mut self, end: Ticks) -> Result<(), ToolError> {
        while self.now() < end {
            let next = end.min(self.now() + ticks(POLL_S));
            match self.machine.run(next)? {
                End::Reset(reason) => self.resets.push(reason),
                End::Time => {}
                // Nothing runs before the power returns.
                End::PowerCut => return Ok(()),
            }
            let from = self.probe.lines.len();
            self.probe.poll(&mut self.machine);
            if self.prints {
                self.print(from);
            }
        }
        Ok(())
    }

    fn print(&self, from: usize) {
        for (at, line) in &self.probe.lines[from..] {
            if line.split(' ').next().is_some_and(|kind| TIMELINE.contains(&kind)) {
                println!("{:9.3} s  {line}", seconds(*at));
            }
        }
    }

    /// Runs until a record of this kind with these words arrives.
    ///
    /// # Errors
    /// No such record arrives in time.
    pub fn wait(&mut self, kind: &str, words: &[&str], longest: f64) -> Result<String, ToolError> {
        let (from, end) = (self.probe.lines.len(), self.now() + ticks(longest));
        while self.now() < end {
            self.run(POLL_S)?;
            if let Some(line) = self.probe.find(from, kind, words) {
                return Ok(line.to_owned());
            }
        }
        let last: Vec<&str> = self.probe.lines.iter().rev().take(6).map(|(_, line)| line.as_str()).collect();
        let wanted = words.join(" ");
        Err(ToolError::input(format!(
            "no record `{kind} {wanted}` within {longest} s at {:.3} s; the last ones: {last:#?}",
            seconds(self.now())
        )))
    }

    /// Sets the operator's contacts.
    pub fn hold(&mut self, contacts: Contacts) {
        self.set(ENABLING, contacts.enabling);
        self.set(START, contacts.start);
    }

    fn set(&mut self, pin: (char, u32), level: bool) {
        self.chip_mut().set_pin(pin, level);
    }

    /// Holds or releases the enabling switch.
    pub fn hold_switch(&mut self, held: bool) {
        self.set(ENABLING, held);
    }

    /// Presses the start button for 0.1 s.
    pub fn press_start(&mut self) -> Result<(), ToolError> {
        self.set(START, true);
        self.run(0.1)?;
        self.set(START, false);
        Ok(())
    }

    /// Resets a fault: the start button is held for more than two seconds, with the switch open.
    ///
    /// # Errors
    /// The model does not support an action of the processor, or no reset is recorded.
    pub fn reset_fault(&mut self) -> Result<(), ToolError> {
        self.set(START, true);
        self.wait("request", &["name=reset", "accepted=true"], 2.5)?;
        self.set(START, false);
        // Both contacts must be open once.
        self.run(0.1)
    }

    /// Starts the board and waits until it has read its contacts as open.
    ///
    /// # Errors
    /// The image sends no record of its start.
    pub fn boot(&mut self) -> Result<(), ToolError> {
        self.started = self.probe.lines.len();
        self.wait("boot", &[], 1.0)?;
        self.run(0.2)
    }

    /// Counts load and lost conversions from now on.
    pub fn begin_measurement(&mut self) {
        let now = self.now();
        let chip = self.chip_mut();
        chip.load.clear(now);
        chip.adcs.iter_mut().for_each(|adc| adc.lost = [0; 2]);
    }

    /// Calibrates, takes the reference and enables the drive, which then holds the leg's pose.
    ///
    /// # Errors
    /// The image refuses a step, or does not answer.
    pub fn enable_drive(&mut self) -> Result<(), ToolError> {
        [Step::Calibrate, Step::Reference, Step::Enable].into_iter().try_for_each(|step| self.step(step))
    }

    /// Runs a step.
    ///
    /// # Errors
    /// The image refuses the step, or does not answer.
    pub fn step(&mut self, step: Step) -> Result<(), ToolError> {
        match step {
            Step::Mount => self.mount(),
            Step::Calibrate => self.calibrate(),
            Step::Reference => self.reference(),
            Step::Enable => self.enable(),
            Step::Identify => self.identify(),
            Step::Save => self.store(SAVE, STORE_S),
            Step::Reset => self.reset(),
            Step::PowerCycle => self.power_cycle(),
            Step::Turn => self.turn(),
            Step::Zeros => self.zeros(),
            Step::Telemetry => self.telemetry(),
            Step::StatusLight => self.status_light(),
            Step::Thermistors => self.thermistors(),
        }
    }

    fn mount(&mut self) -> Result<(), ToolError> {
        let now = self.now();
        let plant = &mut self.chip_mut().plant;
        plant.couple(now);
        plant.let_go();
        self.run(0.5)
    }

    fn calibrate(&mut self) -> Result<(), ToolError> {
        self.hold_switch(true);
        self.run(0.2)?;
        self.press_start()?;
        for _ in 0..JOINTS {
            let line = self.wait("calibration", &[], CALIBRATION_S)?;
            let expected = if self.is_known { "confirmed" } else { "done" };
            if field(&line, "result") != Some(expected) {
                return Err(ToolError::Refused(format!("the calibration is not `{expected}`: {line}")));
            }
        }
        self.run(0.1)?;
        self.hold_switch(false);
        self.run(0.2)
    }

    fn reference(&mut self) -> Result<(), ToolError> {
        let now = self.now();
        self.chip_mut().plant.couple(now);
        self.move_by_hand([0.0; JOINTS], 1.0)?;
        let from = self.probe.lines.len();
        self.press_start()?;
        self.run(1.0)?;
        if self.probe.find(from, "request", &["name=reference", "accepted=true"]).is_none() {
            return Err(ToolError::Refused("the reference was refused".into()));
        }
        // By hand into the range.
        self.move_by_hand(start_position(&self.leg), 1.0)
    }

    /// Moves both joints to these angles (rad, anatomical) within a duration, s, and holds them there.
    fn move_by_hand(&mut self, to: [f64; JOINTS], duration: f64) -> Result<(), ToolError> {
        let now = self.now();
        self.chip_mut().plant.move_by_hand(to, now, duration);
        self.run(duration + 0.3)
    }

    /// Lets go of the switch and holds the leg by hand.
    fn rest(&mut self) -> Result<(), ToolError> {
        self.hold_switch(false);
        self.run(1.0)?;
        let position = self.chip().plant.position();
        self.move_by_hand(position, 0.1)
    }

    /// Temperatures of the windings in the next record, degrees Celsius.
    fn windings(&mut self) -> Result<Vec<f64>, ToolError> {
        let line = self.wait("supply", &[], 2.5)?;
        let list = line.split_once("winding_c=[").and_then(|(_, rest)| rest.split_once(']'));
        let values = list.map(|(list, _)| list.split(", ").map(str::parse).collect());
        values.and_then(Result::ok).ok_or_else(|| ToolError::input(format!("no `winding_c` in `{line}`")))
    }

    fn reset(&mut self) -> Result<(), ToolError> {
        self.rest()?;
        let before = self.windings()?;
        self.machine.reset(ResetReason::Pin);
        self.is_known = self.has_absolute_encoders();
        self.boot()?;
        let after = self.windings()?;
        // Without memory they are assumed at 80 degrees.
        let survive =
            before.iter().zip(&after).all(|(before, after)| *before < 78.0 && (before - after).abs() < 1.0);
        if survive {
            return Ok(());
        }
        Err(ToolError::Refused(format!(
            "temperatures of the windings: {before:?} before the reset, {after:?} after"
        )))
    }

    /// Whether each rotor has an absolute encoder.
    fn has_absolute_encoders(&self) -> bool {
        self.leg.joints.iter().all(|joint| joint.motor.is_some_and(|motor| motor.absolute_encoder))
    }

    fn power_cycle(&mut self) -> Result<(), ToolError> {
        self.rest()?;
        self.machine.power_cycle();
        self.is_known = self.has_absolute_encoders();
        self.boot()
    }

    fn zeros(&mut self) -> Result<(), ToolError> {
        // A switch that closes before the leg has its zeros enables nothing.
        let records = [
            ("request", ["name=reference", "accepted=true"]),
            ("state", ["drive=switch_on_disabled", "activity=idle"]),
        ];
        for (kind, words) in records {
            if self.probe.find(self.started, kind, &words).is_none() {
                self.wait(kind, &words, 2.0)?;
            }
        }
        Ok(())
    }

    fn telemetry(&mut self) -> Result<(), ToolError> {
        let mut wrong = Vec::new();
        for joint in 0..JOINTS {
            let node = 1 + joint as u16;
            let [rated_a, rated_nm] = [0x6075, 0x6076].map(|index| self.read_object(node, index, 0));
            let (rated_a, rated_nm) = (f64::from(rated_a?) * 1e-6, f64::from(rated_nm?) * 1e-6);
            let phase = |number: usize| move |session: &Self| session.axis(joint).motor.currents()[number];
            // The plant's torque contains the motor's cogging, which its current does not show.
            let rows: [Telemetry<'_>; 9] = [
                ("bus voltage, V", 0x6079, 0, 1e-3, Some(0.5), &|session| session.plant().supply.voltage()),
                ("position, rad", 0x6064, 0, 1e-6, Some(1e-3), &|session| session.plant().position()[joint]),
                ("torque, N m", 0x6077, 0, rated_nm, Some(1.5), &|session| session.plant().torque()[joint]),
                ("current of the motor, A", 0x6078, 0, rated_a, Some(0.1), &|session| {
                    session.axis(joint).motor.rotor_currents()[1]
                }),
                ("current of phase A, A", 0x2170, 4, 0.01, Some(0.1), &phase(0)),
                ("current of phase B, A", 0x2170, 5, 0.01, Some(0.1), &phase(1)),
                ("current of phase C, A", 0x2170, 6, 0.01, Some(0.1), &phase(2)),
                ("bridge, degrees Celsius", 0x2170, 2, 0.1, Some(1.0), &|_| WARM_C),
                ("winding, degrees Celsius", 0x2170, 3, 0.1, None, &|session| {
                    session.axis(joint).motor.temperature()
                }),
            ];
            for (name, index, sub, unit, tolerance, truth) in rows {
                let is_by_current = matches!((index, sub), (0x6077 | 0x6078, _) | (0x2170, 4..=6));
                let is_short = is_by_current || index == 0x2170;
                let (mut shown, mut own) = (0.0, 0.0);
                for _ in 0..READINGS {
                    let value = self.read_object(node, index, sub)?;
                    let value = if is_short { f64::from(value as i16) } else { f64::from(value as i32) };
                    shown += unit * value / f64::from(READINGS);
                    own += truth(self) / f64::from(READINGS);
                }
                let by_gain = if is_by_current { GAIN_ERROR * own.abs() } else { 0.0 };
                // A winding may be taken for hotter than it is: after the start it is assumed warm.
                let is_close = match tolerance {
                    Some(tolerance) => (shown - own).abs() <= tolerance + by_gain,
                    None => shown >= own - 1.0,
                };
                println!("            node {node}: {name}: {shown:.3}, plant {own:.3}");
                if !is_close {
                    wrong.push(format!("node {node}: {name}: {shown:.3}, plant {own:.3}"));
                }
            }
        }
        wrong.extend(self.wrong_times()?);
        if wrong.is_empty() { Ok(()) } else { Err(ToolError::Refused(wrong.join("; "))) }
    }

    /// Compares the longest times of two interrupts, and returns the wrong ones. The firmware counts from its
    /// first instruction, and reports the longest of the last second.
    fn wrong_times(&mut self) -> Result<Vec<String>, ToolError> {
        let mut wrong = Vec::new();
        for (name, sub, exception) in [("current interrupt", 7, CURRENT_INTERRUPT), ("servo tick", 8, SERVO)]
        {
            let shown = f64::from(self.read_object(1, 0x2170, sub)?) * 1e-3;
            let used = self.chip().load.usage(exception);
            let mean = microseconds(used.ticks) / used.entries.max(1) as f64;
            let row = format!(
                "longest {name}: {shown:.2} us, the model's mean {mean:.2} us, longest {:.2} us",
                microseconds(used.longest)
            );
            println!("            {row}");
            if !(mean..=microseconds(used.longest)).contains(&shown) {
                wrong.push(row);
            }
        }
        Ok(wrong)
    }

    fn status_light(&mut self) -> Result<(), ToolError> {
        let state = self.read_object(1, 0x2160, 2)? as u8;
        let is_on = self.read_object(1, 0x6041, 0)? & 0x6F == 0x27;
        let sample = |session: &mut Self| {
            session.run(LIGHT_CYCLE_S / f64::from(LIGHT_SAMPLES))?;
            Ok::<_, ToolError>(session.chip().gpio.is_driven_high(STATUS_LIGHT))
        };
        // A cycle from the end of a flash on.
        for wanted in [true, false] {
            let mut left = 2 * LIGHT_SAMPLES;
            while left > 0 && sample(self)? != wanted {
                left -= 1;
            }
        }
        let (mut flashes, mut lit, mut before) = (0, 0, false);
        for _ in 0..LIGHT_SAMPLES {
            let now = sample(self)?;
            flashes += u32::from(now && !before);
            lit += u32::from(now);
            before = now;
        }
        let expected = match (state & BoardState::CALIBRATED != 0, state & BoardState::REFERENCED != 0) {
            _ if is_on => 1,
            (false, _) => 3,
            (true, false) => 2,
            (true, true) => 1,
        };
        let is_long = 2 * lit > LIGHT_SAMPLES;
        println!(
            "            status light: {flashes} flashes in 2 s, lit for {} %",
            100 * lit / LIGHT_SAMPLES
        );
        if flashes == expected && is_long == is_on {
            return Ok(());
        }
        Err(ToolError::Refused(format!(
            "status light: {flashes} flashes, {lit} of {LIGHT_SAMPLES} samples lit; 2160:2 is {state:02x}, so {expected} were expected"
        )))
    }

    fn plant(&self) -> &Plant {
        &self.chip().plant
    }

    fn axis(&self, axis: usize) -> &Axis {
        &self.plant().axes[axis]
    }

    fn thermistors(&mut self) -> Result<(), ToolError> {
        let cold = self.windings()?;
        // From 20 to 90.7 degrees: 12.1 and 1.25 kOhm of 10 kOhm at 25 degrees, beta 3435 K, with 3.3 kOhm.
        for code in (1125..=3215).rev().step_by(50) {
            self.chip_mut().plant.motor_thermistors[0] = Some(code);
            self.run(0.1)?;
        }
        self.chip_mut().plant.motor_thermistors[0] = Some(1125);
        // A mean of eight readings.
        self.run(3.0)?;
        let hot = self.windings()?;
        let [first, second] = hot[..] else {
            return Err(ToolError::input(format!("{} windings", hot.len())));
        };
        if !((89.0..92.0).contains(&first) && second < 81.0 && cold.iter().all(|before| *before < 81.0)) {
            let why = format!(
                "the first thermistor is at 90.7 degrees, but windings went from {cold:?} to {hot:?}"
            );
            return Err(ToolError::Refused(why));
        }
        self.chip_mut().plant.motor_thermistors[1] = Some(4095);
        self.wait("fault", &["name=motor_thermistor", "joint=2"], 0.5).map(drop)
    }

    fn turn(&mut self) -> Result<(), ToolError> {
        let from = self.chip().plant.position();
        self.move_by_hand(from.map(|angle| angle + TURNED_RAD), 2.0)?;
        self.is_known = true;
        self.move_by_hand(from, 2.0)
    }

    fn enable(&mut self) -> Result<(), ToolError> {
        self.hold_switch(true);
        self.wait("state", &["drive=operation_enabled"], 2.0)?;
        self.chip_mut().plant.let_go();
        self.run(0.3)
    }

    fn identify(&mut self) -> Result<(), ToolError> {
        self.press_start()?;
        self.wait("verdict", &[], IDENTIFICATION_S)?;
        self.wait("end", &[], 10.0)?;
        self.run(0.1)
    }

    /// Forgets the frames that the board has sent so far.
    pub fn forget_frames(&mut self) {
        self.chip_mut().can.sent.clear();
        self.received = 0;
    }

    /// Emergency codes of a node among the frames that the board has sent.
    pub fn emergencies(&self, node: u16) -> Vec<u16> {
        let own = |(_, frame): &(Ticks, Frame)| match *frame.data() {
            [low, high, _, _, _, _, _, _] if frame.id() == 0x80 + node => {
                Some(u16::from_le_bytes([low, high]))
            }
            _ => None,
        };
        self.chip().can.sent.iter().filter_map(own).collect()
    }

    /// Client of the board's nodes.
    pub fn client(&mut self) -> Client<&mut Self> {
        Client::over(self)
    }

    /// Writes a value of four bytes to an object.
    ///
    /// # Errors
    /// The node refuses the value or does not answer.
    pub fn write_object(&mut self, node: u16, index: u16, sub: u8, value: u32) -> Result<(), ToolError> {
        self.write_sized(node, index, sub, value, 4)
    }

    /// Writes a value of 1, 2 or 4 bytes to an object.
    ///
    /// # Errors
    /// The node refuses the value or does not answer.
    pub fn write_sized(
        &mut self,
        node: u16,
        index: u16,
        sub: u8,
        value: u32,
        bytes: u8,
    ) -> Result<(), ToolError> {
        let (node, object) = (node as u8, Object(index, sub));
        self.client().try_write(node, object, value, bytes).map_err(|error| error.refused(node, object))
    }

    /// Writes a request that changes the flash ("save", "load") and waits for its emergency messages: FF0D
    /// during the write, 0000 at its end. Also returns at a power cut.
    ///
    /// # Errors
    /// The node refuses the request, fails, or does not finish in time.
    pub fn store(&mut self, (index, word): Request, longest: f64) -> Result<(), ToolError> {
        self.write_object(1, index, 1, u32::from_le_bytes(word))?;
        let end = self.now() + ticks(longest);
        while self.now() < end && !self.chip().flash.is_cut {
            let codes = self.emergencies(1);
            if codes.contains(&NoticeCode::StoreFailed.number()) {
                return Err(ToolError::Refused("the board reports that it could not store (5530)".into()));
            }
            if codes.iter().skip_while(|code| **code != NoticeCode::Storing.number()).any(|code| *code == 0) {
                return Ok(());
            }
            self.run(POLL_S)?;
        }
        if self.chip().flash.is_cut {
            return Ok(());
        }
        Err(ToolError::input(format!("{index:04x} did not finish within {longest} s")))
    }

    /// Reads a value of up to four bytes from an object.
    ///
    /// # Errors
    /// The node refuses the request or does not answer.
    pub fn read_object(&mut self, node: u16, index: u16, sub: u8) -> Result<u32, ToolError> {
        let (node, object) = (node as u8, Object(index, sub));
        self.client().try_read(node, object).map_err(|error| error.refused(node, object))
    }

    pub fn chip(&self) -> &Chip {
        self.machine.chip()
    }

    pub fn chip_mut(&mut self) -> &mut Chip {
        self.machine.chip_mut()
    }
}

impl bus::Bus for Session {
    /// Sends a frame, and forgets all that the board sent before.
    fn send(&mut self, frame: &Frame) -> Result<(), RequestError> {
        self.forget_frames();
        self.chip_mut().send_frame(*frame);
        Ok(())
    }

    fn receive(&mut self, until: Duration) -> Result<Option<Frame>, RequestError> {
        loop {
            let chip = self.machine.chip();
            if let Some((_, frame)) = chip.can.sent.get(self.received) {
                self.received += 1;
                return Ok(Some(*frame));
            }
            if chip.flash.is_cut {
                return Err(RequestError::Failed("the power was cut".into()));
            }
            if bus::Bus::now(self) >= until {
                return Ok(None);
            }
            self.run(POLL_S).map_err(|error| RequestError::Failed(error.to_string()))?;
        }
    }

    fn now(&self) -> Duration {
        Duration::from_secs_f64(seconds(Self::now(self)))
    }

    fn patience(&self) -> Patience {
        Patience::once(self.patience)
    }
}
