//! One axis: motor, bridge, shunts and counter, moved a quarter of a PWM period at a time.
//!
//! Switching is not averaged. Within a quarter the step goes from edge to edge of the bridge, each with
//! constant terminal voltages. The bus voltage is constant within the quarter, the rotor's speed between
//! calls of [`Axis::set_rotor`]. Compared with steps a hundred times finer, currents differ by 4 mA and the
//! torque by 4e-5 of its size. Conditions: 50 A, 250 Hz electrical and 48 V. Test:
//! `cargo test -p hal-sim --test hardware edges_alone`. The difference is a tenth of a converter's step.
//!
//! ```text
//! sample, command acts                                  sample, next command acts
//! |         quarter |         quarter |         quarter |         quarter |
//! ```
//!
//! Cost: some 16 steps per period.

use super::bridge::Bridge;
use super::counter::Counter;
use super::description::AxisDescription;
use super::motor::{Direction, Motor, Terminal};
use super::shunts::ShuntState;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, AxisSample, CURRENT_RATE_HZ};

/// PWM period, s.
pub const PERIOD_S: f64 = 1.0 / CURRENT_RATE_HZ as f64;
/// Quarters per period.
pub(crate) const QUARTERS: u32 = 4;
/// Length of a quarter, s.
pub(crate) const QUARTER_S: f64 = PERIOD_S / QUARTERS as f64;
/// Conduction time after which an amplifier has settled completely, s.
const SETTLED: f64 = 1.0;

/// Transfers during a time step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct AxisFlow {
    /// Torque on the rotor integrated over time, N m s.
    pub impulse: f64,
    /// Charge drawn from the bus, C.
    pub charge: f64,
    /// Heat of windings and switches, J.
    pub heat: f64,
}

/// One axis of a board with its motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    description: AxisDescription,
    /// Bridge output connected to each of the motor's phases.
    output_of: [usize; 3],
    motor: Motor,
    bridge: Bridge,
    counter: Counter,
    /// Elapsed quarters of the axis' own period.
    quarter: u32,
    /// Present angle of the rotor, rad, and its speed, rad/s.
    angle: f64,
    speed: f64,
    cogging: f64,
    /// Slopes of the phase currents in the last step of a period, A/s.
    slopes: [f64; 3],
    /// Error of both shunts at the next sample, A.
    disturbance: f64,
    /// Heat since the period began, J.
    heat: f64,
}

impl Axis {
    /// An axis without current, outputs off, with the rotor at `angle` (rad). Its own period began `quarter`
    /// quarters ago.
    pub fn new(description: &AxisDescription, angle: f64, quarter: u32) -> Self {
        let electrical = electrical_angle(description, angle);
        let mut output_of = [0; 3];
        for (output, phase) in description.wiring.phases.iter().enumerate() {
            if let Some(slot) = output_of.get_mut(*phase) {
                *slot = output;
            }
        }
        Self {
            description: *description,
            output_of,
            motor: Motor::new(&description.motor, description.bridge.on_resistance, electrical),
            bridge: Bridge::new(&description.bridge, PERIOD_S),
            counter: Counter::new(&description.counter, description.wiring.encoder, angle),
            quarter: quarter % QUARTERS,
            angle,
            speed: 0.0,
            cogging: 0.0,
            slopes: [0.0; 3],
            disturbance: 0.0,
            heat: 0.0,
        }
    }

    /// Sets the rotor's angle (rad), and its speed (rad/s) until the next call.
    pub fn set_rotor(&mut self, angle: f64, speed: f64) {
        (self.angle, self.speed) = (angle, speed);
        self.motor.set_angle(electrical_angle(&self.description, angle));
        self.cogging = self.motor.cogging(angle + 0.5 * speed * PERIOD_S);
    }

    /// Moves the rotor to an angle, at rest and without current.
    pub fn move_to(&mut self, angle: f64) {
        self.set_rotor(angle, 0.0);
        self.motor.move_to(electrical_angle(&self.description, angle));
        self.slopes = [0.0; 3];
    }

    /// Breaks the wire of an output.
    pub(crate) fn break_wire(&mut self, output: usize) {
        self.description.wiring.open = Some(output);
    }

    /// Reading of the absolute encoder at the rotor, 14 bits; `None` without one.
    pub fn rotor_steps(&self) -> Option<u16> {
        self.description.counter.absolute.then(|| self.counter.steps(self.angle))
    }

    /// Electrical angle of the rotor, rad.
    pub fn electrical_angle(&self) -> f64 {
        f64::from(self.description.motor.pole_pairs) * self.angle + self.description.motor.electrical_zero
    }

    /// Currents into the motor's phases, A.
    pub fn currents(&self) -> [f64; 3] {
        self.motor.currents()
    }

    /// The motor.
    pub fn motor(&self) -> &Motor {
        &self.motor
    }

    /// Description of this axis.
    pub fn description(&self) -> &AxisDescription {
        &self.description
    }

    /// Rising less falling edges of the bridge between two instants of its period, s from now.
    pub fn edges(&self, from: f64, to: f64) -> i32 {
        let now = f64::from(self.quarter) * QUARTER_S;
        self.bridge.edges(now + from, now + to)
    }

    /// Adds an error, A, to both shunts at the next sample.
    pub(crate) fn disturb(&mut self, ampere: f64) {
        self.disturbance = ampere;
    }

    /// Starts the axis' own period: reads its sensors and applies a command.
    pub fn begin(
        &mut self,
        command: &AxisCommand,
        bus_code: u16,
        generator: &mut Xoshiro256PlusPlus,
    ) -> AxisSample {
        let shunts = &self.description.shunts;
        let wiring = &self.description.wiring;
        let (currents, end) = (self.currents(), f64::from(self.quarter) * QUARTER_S);
        let mut codes = [0; 2];
        for (channel, code) in codes.iter_mut().enumerate() {
            let output = channel + 1;
            let phase = wiring.phases[output];
            // With the low switch off, a shunt carries the low diode's current, which flows into the motor.
            let by_diode = if currents[phase] > 0.0 { SETTLED } else { 0.0 };
            let sign = if wiring.shunts_inverted[channel] { -1.0 } else { 1.0 };
            let state = ShuntState {
                current: sign * currents[phase],
                slope: sign * self.slopes[phase],
                conducting: self.bridge.low_side_time(output, end).unwrap_or(by_diode),
                disturbance: self.disturbance,
            };
            *code = shunts.code(channel, &state, generator);
        }
        if wiring.shunts_exchanged {
            codes.swap(0, 1);
        }
        let (encoder_count, index_count) = self.counter.read(self.angle);
        self.motor.warm(self.heat, PERIOD_S);
        (self.heat, self.quarter, self.disturbance) = (0.0, 0, 0.0);
        self.bridge.begin(command);
        AxisSample { shunt_codes: codes, bus_code, encoder_count, index_count }
    }

    /// Advances by a quarter of a period at this bus voltage.
    pub fn advance(&mut self, bus: f64) -> AxisFlow {
        let mut now = f64::from(self.quarter) * QUARTER_S;
        self.quarter += 1;
        let end = f64::from(self.quarter) * QUARTER_S;
        let mut flow = AxisFlow { impulse: self.cogging * QUARTER_S, ..AxisFlow::default() };
        while now < end {
            self.bridge.pass(now);
            let next = self.bridge.next_edge(end);
            let step = self.step(bus, next - now, self.quarter == QUARTERS && next >= end);
            flow.impulse += step.impulse;
            flow.charge += step.charge;
            flow.heat += step.heat;
            now = next;
        }
        self.angle += self.speed * QUARTER_S;
        self.heat += flow.heat;
        flow
    }

    /// Advances from one edge to the next. Only the last step of the axis' period stores the slopes.
    fn step(&mut self, bus: f64, duration: f64, last: bool) -> AxisFlow {
        let terminals = self.output_of.map(|output| {
            if self.description.wiring.open == Some(output) {
                return Terminal::Off(f64::NEG_INFINITY, f64::INFINITY);
            }
            self.bridge.output(output, bus)
        });
        let speed = f64::from(self.description.motor.pole_pairs) * self.speed;
        let before = self.currents();
        let moved = self.motor.advance(&terminals, speed, duration);
        if last {
            let after = self.currents();
            self.slopes = core::array::from_fn(|phase| (after[phase] - before[phase]) / duration);
        }
        let mut charge = 0.0;
        for phase in 0..3 {
            charge += match terminals[phase] {
                Terminal::Held(voltage) if voltage > 0.0 => moved.charge[phase],
                Terminal::Held(_) => 0.0,
                // The upper diode leads back into the bus.
                Terminal::Off(..) => moved.charge[phase].min(0.0),
            };
        }
        AxisFlow { impulse: moved.impulse, charge, heat: moved.heat }
    }
}

fn electrical_angle(description: &AxisDescription, angle: f64) -> Direction {
    Direction::from_angle(f64::from(description.motor.pole_pairs) * angle + description.motor.electrical_zero)
}
