//! Fault injection into the ports of one board.

use super::form::{Form, Memory, Timing, code, wrapped};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisSample, JointSample};
use scarab::units::Ampere;

/// Largest number of simultaneous injections.
pub(crate) const MOST: usize = 4;

/// Faulted signal.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Channel {
    /// Counter of the motor's encoder, 16 bits.
    Counter,
    /// Index pulse: `Off` hides it, `Offset` moves the captured count, any other form makes pulses.
    Index,
    /// Absolute encoder at the rotor: `Off`, `Rail` and `Garbage` replace its frame, any other form changes
    /// the angle in it.
    RotorEncoder,
    /// Absolute encoder at the joint, with the forms of [`Self::RotorEncoder`].
    JointEncoder,
    /// Shunt code of phase B.
    ShuntB,
    /// Shunt code of phase C.
    ShuntC,
    /// Code of the bus voltage.
    Bus,
    /// Counts between axis and servo.
    JointCounts,
    /// Current between axis and servo, A.
    JointCurrent,
    /// Target between servo and axis, A.
    Target,
    /// Duty of the brake resistor.
    Brake,
    /// The emergency stop's contact is open.
    EmergencyStop,
    /// A gate driver reports a fault.
    GateFault,
    /// A gate driver's registers differ from their written values.
    GateRegisters,
    /// Code of a bridge's thermistor.
    Thermistor,
    /// Code of the thermistor in a motor; with `Off` its conversion does not end.
    MotorThermistor,
    /// A shunt's conversion does not end.
    Conversion,
    /// The conversions of bus voltage and thermistors do not end, and their codes stay.
    SupplyConversion,
    /// An axis' tick is missing.
    Tick,
    /// The servo misses its tick.
    Servo,
    /// The housekeeping misses its round.
    Housekeeping,
}

/// One fault of one channel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Injection {
    /// Faulted signal.
    pub channel: Channel,
    /// Joint of the signal; ignored for signals that the board has only once.
    pub joint: usize,
    /// Form of the fault; for contacts and timing every form means that the event occurs.
    pub form: Form,
    /// Timing, in PWM periods.
    pub timing: Timing,
}

/// All injections into one board.
#[derive(Clone, Debug, PartialEq)]
pub struct Injector {
    slots: [Option<(Injection, Memory)>; MOST],
    generator: Xoshiro256PlusPlus,
}

const CODES: [f64; 2] = [0.0, 4095.0];
const COUNTER: [f64; 2] = [0.0, 65_535.0];
const COUNTS: [f64; 2] = [-2_147_483_648.0, 2_147_483_647.0];
const AMPERES: [f64; 2] = [-100.0, 100.0];
const DUTY: [f64; 2] = [0.0, 1.0];

impl Injector {
    /// An injector without faults.
    pub fn new(seed: u64) -> Self {
        Self { slots: [None; MOST], generator: Xoshiro256PlusPlus::seed_from_u64(seed) }
    }

    /// Adds a fault; returns `false` where there is no room.
    pub fn add(&mut self, injection: Injection) -> bool {
        let free = self.slots.iter_mut().find(|slot| slot.is_none());
        free.map(|slot| *slot = Some((injection, Memory::EMPTY))).is_some()
    }

    fn pass(&mut self, channel: Channel, joint: usize, tick: u64, mut value: f64, range: [f64; 2]) -> f64 {
        for (injection, memory) in self.slots.iter_mut().flatten() {
            if injection.channel == channel && injection.joint == joint {
                let acts = injection.timing.holds(tick);
                value = memory.pass(injection.form, acts, value, range, &mut self.generator);
            }
        }
        value
    }

    /// Whether an event (contact or timing) is injected at this tick.
    pub fn happens(&self, channel: Channel, joint: usize, tick: u64) -> bool {
        self.acts(channel, joint, tick, |_| true)
    }

    /// Whether a fault in one of these forms acts on a signal at this tick.
    fn acts(&self, channel: Channel, joint: usize, tick: u64, is_meant: impl Fn(Form) -> bool) -> bool {
        self.slots.iter().flatten().any(|(injection, _)| {
            let Injection { timing, form, .. } = injection;
            injection.channel == channel && injection.joint == joint && timing.holds(tick) && is_meant(*form)
        })
    }

    /// Frame of an absolute encoder with this reading: bit 15 makes the parity even.
    pub fn frame(&mut self, channel: Channel, joint: usize, tick: u64, steps: u16) -> u16 {
        let value = wrapped(self.pass(channel, joint, tick, f64::from(steps), COUNTER));
        let replaces = |form| matches!(form, Form::Off | Form::Rail(_) | Form::Garbage);
        let is_frame = self.acts(channel, joint, tick, replaces);
        let angle = value & 0x3FFF;
        if is_frame { value } else { angle | ((angle.count_ones() as u16 & 1) << 15) }
    }

    /// Applies faults to an axis' sample.
    pub fn sample(&mut self, joint: usize, tick: u64, sample: &mut AxisSample) {
        let counter = self.pass(Channel::Counter, joint, tick, f64::from(sample.encoder_count), COUNTER);
        // A counter that lost counts captures the index with the same loss: both get the same addition.
        let moved = wrapped(counter).wrapping_sub(sample.encoder_count);
        sample.encoder_count = wrapped(counter);
        sample.index_count = sample.index_count.map(|at| at.wrapping_add(moved));
        for (slot, injection) in self.slots.iter().flatten().map(|(injection, _)| injection).enumerate() {
            let injected = injection.channel == Channel::Index
                && injection.joint == joint
                && injection.timing.holds(tick);
            sample.index_count = match (injected, injection.form) {
                (false, _) => sample.index_count,
                (true, Form::Off) => None,
                (true, Form::Offset(offset)) => sample.index_count.map(|at| wrapped(f64::from(at) + offset)),
                // A spurious pulse at the present count.
                (true, _) => Some(sample.encoder_count.wrapping_sub(slot as u16)),
            };
        }
        for (channel, shunt) in [Channel::ShuntB, Channel::ShuntC].into_iter().zip(&mut sample.shunt_codes) {
            *shunt = code(self.pass(channel, joint, tick, f64::from(*shunt), CODES));
        }
        sample.bus_code = code(self.pass(Channel::Bus, 0, tick, f64::from(sample.bus_code), CODES));
    }

    /// Applies faults to a joint's sample on its way to the servo.
    pub fn joint(&mut self, joint: usize, tick: u64, sample: &mut JointSample) {
        let counts = self.pass(Channel::JointCounts, joint, tick, f64::from(sample.encoder_counts), COUNTS);
        sample.encoder_counts = counts as i32;
        let current = self.pass(Channel::JointCurrent, joint, tick, f64::from(sample.current.0), AMPERES);
        sample.current = Ampere(current as f32);
    }

    /// Applies faults to a target on its way to its axis.
    pub fn target(&mut self, joint: usize, tick: u64, target: Ampere) -> Ampere {
        Ampere(self.pass(Channel::Target, joint, tick, f64::from(target.0), AMPERES) as f32)
    }

    /// Applies faults to a thermistor's code.
    pub fn thermistor(&mut self, joint: usize, tick: u64, value: u16) -> u16 {
        code(self.pass(Channel::Thermistor, joint, tick, f64::from(value), CODES))
    }

    /// Applies faults to the code of a motor's thermistor; `None` where its conversion does not end.
    pub fn motor_thermistor(&mut self, joint: usize, tick: u64, value: u16) -> Option<u16> {
        let passed = code(self.pass(Channel::MotorThermistor, joint, tick, f64::from(value), CODES));
        let is_silent = self.acts(Channel::MotorThermistor, joint, tick, |form| form == Form::Off);
        (!is_silent).then_some(passed)
    }

    /// Applies faults to the brake resistor's duty.
    pub fn brake(&mut self, tick: u64, duty: f32) -> f64 {
        self.pass(Channel::Brake, 0, tick, f64::from(duty), DUTY)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SAMPLE: AxisSample =
        AxisSample { shunt_codes: [2048, 2048], bus_code: 3136, encoder_count: 10, index_count: Some(8) };

    fn injected(channel: Channel, form: Form) -> [AxisSample; 2] {
        let mut injector = Injector::new(1);
        assert!(injector.add(Injection { channel, joint: 1, form, timing: Timing::from(5) }));
        let mut samples = [SAMPLE; 2];
        for (joint, sample) in samples.iter_mut().enumerate() {
            injector.sample(joint, 4, sample);
            assert_eq!(*sample, SAMPLE);
            injector.sample(joint, 5, sample);
        }
        samples
    }

    #[test]
    fn only_the_named_channel_and_joint_are_faulted() {
        let lost = injected(Channel::Counter, Form::Offset(-12.0));
        let moved = AxisSample { encoder_count: 65_534, index_count: Some(65_532), ..SAMPLE };
        assert_eq!(lost, [SAMPLE, moved]);
        let railed = injected(Channel::ShuntC, Form::Rail(4095.0));
        assert_eq!(railed, [SAMPLE, AxisSample { shunt_codes: [2048, 4095], ..SAMPLE }]);
        let unseen = injected(Channel::Index, Form::Off);
        assert_eq!(unseen, [SAMPLE, AxisSample { index_count: None, ..SAMPLE }]);
    }

    #[test]
    fn a_frame_has_even_parity_and_faults_replace_frame_or_angle() {
        let framed = |form: Option<Form>| {
            let mut injector = Injector::new(1);
            if let Some(form) = form {
                let channel = Channel::JointEncoder;
                assert!(injector.add(Injection { channel, joint: 1, form, timing: Timing::from(5) }));
            }
            [4, 5].map(|tick| injector.frame(Channel::JointEncoder, 1, tick, 0x2001))
        };
        assert_eq!(framed(None), [0x2001; 2]);
        assert_eq!(framed(Some(Form::Offset(1.0))), [0x2001, 0x2002]);
        assert_eq!(framed(Some(Form::Offset(-1.0))), [0x2001, 0xA000]);
        assert_eq!(framed(Some(Form::Rail(65_535.0))), [0x2001, 0xFFFF]);
        assert_eq!(framed(Some(Form::Off)), [0x2001, 0]);
    }

    #[test]
    fn the_number_of_injections_is_limited() {
        let mut injector = Injector::new(1);
        let open = |tick| Injection {
            channel: Channel::EmergencyStop,
            joint: 0,
            form: Form::Off,
            timing: Timing::from(tick),
        };
        assert!((0..MOST).all(|tick| injector.add(open(tick as u64))));
        assert!(!injector.add(open(9)));
        assert!(injector.happens(Channel::EmergencyStop, 0, 0));
    }
}
