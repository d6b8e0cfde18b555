//! The board and its leg around the chip: hal-sim's motors, shunts, counters, supply and leg at the pins.
//!
//! The pins of both bridges decide each step, so switching is not averaged and nothing is assumed about the
//! firmware's period: edges, dead time and main output are those of the timers, and a shunt is read at the
//! instant at which the converter holds it.
//!
//! ```text
//! electric   from edge to edge of the pins, bus voltage constant for at most a quarter of a PWM period
//! mechanic   every 1/24 ms: leg by the mean torque; between, the rotors turn at constant speed
//! ```
//!
//! The plant begins with free rotors and a leg held by a fixture; [`Plant::couple`] mounts the gears. A hand
//! holds joints, or moves them. Known limits: gears are rigid, a hand is stronger than every motor.

use core::f64::consts::{PI, TAU};

use hal_sim::conventions::Anatomy;
use hal_sim::description::LegDescription;
use hal_sim::drive::axis::PERIOD_S;
use hal_sim::drive::counter::{Counter, steps};
use hal_sim::drive::description::{AxisDescription, CouplingDescription, SupplyDescription};
use hal_sim::drive::motor::{Direction, Motor, Terminal};
use hal_sim::drive::shunts::ShuntState;
use hal_sim::drive::supply::Supply;
use hal_sim::end_stop;
use hal_sim::leg::{Leg, LegState};
use hal_sim::wearer::description::{WearerDescription, WearerError};
use hal_sim::wearer::muscles::Intention;
use hal_sim::wearer::{Wearer, WearerTruth};
use hal_sim::world::periods::PERIODS_PER_TICK;
use rand_core::SeedableRng;
use rand_distr::{Distribution, StandardNormal};
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab_base::error::FileError;
use scarab_identify::formats::leg_file::LegFile;

use crate::peripherals::pwm::{Outputs, Pins};
use crate::peripherals::timer::Timer;
use crate::time::{NEVER, TICK_HZ, Ticks, seconds, ticks};

/// Joints of the leg, and axes of the board.
pub const JOINTS: usize = 2;
/// Length of a mechanical step, 1/24 ms.
pub const STEP: Ticks = TICK_HZ / 24_000;
const QUARTER: Ticks = STEP / 4;
/// Free rotor: inertia, kg m^2; dry friction, N m; viscous friction, N m s/rad.
const FREE: [f64; 3] = [1e-4, 0.01, 1e-4];
/// Conduction time after which an amplifier has settled completely, s.
const SETTLED: f64 = 1.0;
/// Temperature of the board's thermistors, degrees Celsius.
pub const WARM_C: f64 = 38.0;
/// Code of a thermistor at that temperature.
const WARM: u16 = 1400;
/// Number of stored edges of a bridge.
const REMEMBERED: usize = 16;
/// Standard deviation of the bus voltage's code.
const BUS_NOISE_CODES: f64 = 1.0;

/// Fault of a shunt's code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ShuntFault {
    /// Always this code.
    Stuck(u16),
    /// Added codes.
    Offset(f64),
}

/// Fault of an encoder.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct EncoderFault {
    /// Position of the frozen counter.
    pub frozen: Option<u16>,
    /// Counts added to every position.
    pub added: i32,
}

/// Main output of a bridge that was turned on or off at the pins.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Switching {
    pub at: Ticks,
    pub axis: usize,
    pub on: bool,
}

/// Both bridges, followed through their switchings.
#[derive(Clone, Copy, Debug, Default)]
pub struct Reaction {
    pub armed: [bool; JOINTS],
    /// First instant with both bridges off, and the last.
    pub released: Option<Ticks>,
    pub last: Ticks,
    /// Whether a bridge was on again after the first, and the longest such time that ended.
    pub on_again: bool,
    pub again: Ticks,
    pub on_since: Option<Ticks>,
}

impl Reaction {
    /// Begins with the bridges as they are.
    pub fn new(plant: &Plant) -> Self {
        Self { armed: plant.axes.each_ref().map(|axis| axis.is_armed), ..Self::default() }
    }

    pub fn follow<'a>(&mut self, switchings: impl IntoIterator<Item = &'a Switching>) {
        for switching in switchings {
            self.armed[switching.axis] = switching.on;
            if self.armed == [false; JOINTS] {
                self.released = self.released.or(Some(switching.at));
                self.last = switching.at;
                if let Some(since) = self.on_since.take() {
                    self.again = self.again.max(switching.at - since);
                }
            } else if self.released.is_some() {
                self.on_again |= switching.on;
                self.on_since = self.on_since.or(Some(switching.at));
            }
        }
    }
}

/// Change of a bridge's pins: its time, and the edges of its references.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Edges {
    pub at: Ticks,
    /// Number of references that changed.
    pub count: u32,
    /// Rising ones less falling ones.
    pub rising: i32,
}

/// One axis with its motor.
#[derive(Clone, Debug)]
pub struct Axis {
    description: AxisDescription,
    output_of: [usize; 3],
    pub motor: Motor,
    counter: Counter,
    /// Rotor's angle at the last mechanical step, rad, and its speed since then, rad/s.
    angle: f64,
    speed: f64,
    /// Rotor's angle less that of the gear; `None` while the rotor is free.
    mounting: Option<f64>,
    cogging: f64,
    /// Mean torque in the last step, N m.
    torque: f64,
    impulse: f64,
    heat: f64,
    slopes: [f64; 3],
    pins: [Pins; 3],
    /// Instants from which the low sides conduct.
    low_since: [Option<Ticks>; 3],
    edges: [Edges; REMEMBERED],
    /// Whether the main output is on and the gate drivers follow.
    pub is_armed: bool,
    /// Last instant at which a high side was on.
    pub last_high: Ticks,
    /// Pin changes, if recorded.
    pub pin_changes: Option<Vec<(Ticks, [Pins; 3])>>,
    /// Faults of shunts B and C.
    pub shunt_faults: [Option<ShuntFault>; 2],
    pub encoder_fault: EncoderFault,
    /// Outputs with a broken wire.
    pub open: [bool; 3],
    /// Wraps of the encoder's 16 bits between two readings.
    pub wraps: u32,
    last_position: Option<u16>,
}

impl Axis {
    fn new(description: &AxisDescription, angle: f64) -> Self {
        let mut output_of = [0; 3];
        for (output, phase) in description.wiring.phases.iter().enumerate() {
            output_of[*phase] = output;
        }
        let electrical = electrical(description, angle);
        Self {
            description: *description,
            output_of,
            motor: Motor::new(&description.motor, description.bridge.on_resistance, electrical),
            counter: Counter::new(&description.counter, description.wiring.encoder, angle),
            angle,
            speed: 0.0,
            mounting: None,
            cogging: 0.0,
            torque: 0.0,
            impulse: 0.0,
            heat: 0.0,
            slopes: [0.0; 3],
            pins: [[false; 2]; 3],
            low_since: [None; 3],
            edges: [Edges { at: 0, count: 0, rising: 0 }; REMEMBERED],
            is_armed: false,
            last_high: 0,
            pin_changes: None,
            shunt_faults: [None; 2],
            encoder_fault: EncoderFault::default(),
            open: core::array::from_fn(|output| description.wiring.open == Some(output)),
            wraps: 0,
            last_position: None,
        }
    }

    /// Edges of the bridge that lie within a window before an instant, the dead time included.
    pub fn edges_within(&self, window: Ticks, before: Ticks) -> (u32, i32) {
        let dead = ticks(self.description.bridge.dead_time);
        let within =
            |edges: &&Edges| edges.count > 0 && edges.at <= before && edges.at + dead + window >= before;
        let inside = self.edges.iter().filter(within);
        inside.fold((0, 0), |(count, rising), edges| (count + edges.count, rising + edges.rising))
    }

    fn read_pins(&mut self, (timer, outputs): &mut Bridge<'_>, now: Ticks, gates: bool) {
        let (rising, count) = outputs.follow(timer, now);
        if count > 0 {
            self.edges.rotate_right(1);
            self.edges[0] = Edges { at: now, count, rising };
        }
        self.set_pins(if gates { outputs.pins(timer, now) } else { [[false; 2]; 3] }, now);
    }

    /// Advances the motor from edge to edge of the pins; returns the charge drawn from the bus.
    fn advance(&mut self, bridge: &mut Bridge<'_>, from: Ticks, end: Ticks, bus: f64, gates: bool) -> f64 {
        let (mut now, mut charge) = (from, 0.0);
        while now < end {
            let next = bridge.1.next_change(bridge.0, now).min(end);
            charge += self.step(bus, seconds(next - now));
            now = next;
            if now < end {
                self.read_pins(bridge, now, gates);
            }
        }
        charge
    }

    fn set_pins(&mut self, pins: [Pins; 3], now: Ticks) {
        let high = |pins: &[Pins; 3]| pins.iter().any(|pins| pins[0]);
        if high(&self.pins) || high(&pins) {
            self.last_high = now;
        }
        for (output, pins) in pins.iter().enumerate() {
            let low = pins[1] && !pins[0];
            self.low_since[output] = if low { self.low_since[output].or(Some(now)) } else { None };
        }
        if let Some(changes) = &mut self.pin_changes
            && pins != self.pins
        {
            changes.push((now, pins));
        }
        self.pins = pins;
    }

    fn terminal(&self, output: usize, bus: f64) -> Terminal {
        if self.open[output] {
            return Terminal::Off(f64::NEG_INFINITY, f64::INFINITY);
        }
        match self.pins[output] {
            [true, false] => Terminal::Held(bus),
            [false, true] => Terminal::Held(0.0),
            // The driver turns both switches off where both are requested.
            _ => {
                let drop = self.description.bridge.diode_drop;
                Terminal::Off(-drop, bus + drop)
            }
        }
    }

    /// Advances the motor with constant pins; returns the charge drawn from the bus.
    fn step(&mut self, bus: f64, duration: f64) -> f64 {
        let terminals = self.output_of.map(|output| self.terminal(output, bus));
        let before = self.motor.currents();
        let speed = f64::from(self.description.motor.pole_pairs) * self.speed;
        let moved = self.motor.advance(&terminals, speed, duration);
        let after = self.motor.currents();
        let mut charge = 0.0;
        for phase in 0..3 {
            charge += match terminals[phase] {
                Terminal::Held(voltage) if voltage > 0.0 => moved.charge[phase],
                Terminal::Held(_) => 0.0,
                // The upper diode leads back into the bus.
                Terminal::Off(..) => moved.charge[phase].min(0.0),
            };
            self.slopes[phase] = (after[phase] - before[phase]) / duration;
        }
        self.impulse += moved.impulse + self.cogging * duration;
        self.heat += moved.heat;
        charge
    }

    fn set_rotor(&mut self, angle: f64, speed: f64) {
        (self.angle, self.speed) = (angle, speed);
        self.motor.set_angle(electrical(&self.description, angle));
        self.cogging = self.motor.cogging(angle + 0.5 * speed * PERIOD_S);
    }

    fn shunt_state(&self, channel: usize, disturbance: f64, now: Ticks) -> ShuntState {
        let output = channel + 1;
        let phase = self.description.wiring.phases[output];
        let current = self.motor.currents()[phase];
        // With the low switch off, a shunt carries the low diode's current, which flows into the motor.
        let by_diode = if current > 0.0 { SETTLED } else { 0.0 };
        let sign = if self.description.wiring.shunts_inverted[channel] { -1.0 } else { 1.0 };
        ShuntState {
            current: sign * current,
            slope: sign * self.slopes[phase],
            conducting: self.low_since[output].map_or(by_diode, |since| seconds(now - since)),
            disturbance,
        }
    }

    /// Instants within the next step at which the index line rises and falls, if it does.
    fn index_pulse(&self, now: Ticks) -> Vec<(Ticks, bool)> {
        // An absolute encoder has no index.
        if self.speed == 0.0 || self.description.counter.absolute {
            return Vec::new();
        }
        let width = TAU / self.description.counter.counts;
        let travel = self.speed * PERIOD_S;
        let from = (self.angle - self.description.counter.index).rem_euclid(TAU);
        let mut events = Vec::new();
        // Both ends of the pulse, also one turn away.
        for (end, inside) in [(0.0, self.speed > 0.0), (width, self.speed < 0.0)] {
            for turn in [-TAU, 0.0, TAU] {
                let distance = end + turn - from;
                let share = distance / travel;
                if share > 0.0 && share <= 1.0 {
                    events.push((now + (share * STEP as f64) as Ticks, inside));
                }
            }
        }
        events.sort_unstable();
        events
    }
}

fn electrical(description: &AxisDescription, angle: f64) -> Direction {
    Direction::from_angle(f64::from(description.motor.pole_pairs) * angle + description.motor.electrical_zero)
}

/// Motion of the hand: joints to an angle (rad, anatomical) by a half cosine, then held.
#[derive(Clone, Copy, Debug, PartialEq)]
struct Hand {
    from: [f64; JOINTS],
    to: [f64; JOINTS],
    begun: Ticks,
    duration: Ticks,
}

/// Timer and outputs of one bridge.
pub type Bridge<'a> = (&'a Timer, &'a mut Outputs);

/// Board and leg around the chip.
#[derive(Clone, Debug)]
pub struct Plant {
    pub axes: [Axis; JOINTS],
    /// Bus of the bridges.
    pub supply: Supply,
    /// Duty of the brake resistor; 0 without one.
    pub brake: f64,
    source: SupplyDescription,
    coupling: CouplingDescription,
    leg: Leg<JOINTS>,
    description: LegDescription<JOINTS>,
    state: LegState<JOINTS>,
    anatomy: [Anatomy; JOINTS],
    mirrored: f64,
    hand: Option<Hand>,
    wearer: Option<Wearer>,
    /// Mechanical steps with a wearer.
    worn_steps: u64,
    noise: Xoshiro256PlusPlus,
    /// Instant up to which the motors were advanced, and of the last mechanical step.
    electric: Ticks,
    mechanic: Ticks,
    /// Edges of the index lines within the present step: instant, axis, level.
    index_edges: Vec<(Ticks, usize, bool)>,
    /// Codes of the thermistors: bridge 0, bridge 1, chopper.
    pub thermistors: [u16; 3],
    /// Codes of the thermistors in the motors, instead of those of the motors' temperatures.
    pub motor_thermistors: [Option<u16>; JOINTS],
    /// Whether the gates follow their inputs, or are held low.
    pub gates: bool,
    /// Main outputs turned on or off, since this was cleared.
    pub switchings: Vec<Switching>,
}

impl Plant {
    /// Free rotors at rest; the leg held at its anatomical zero.
    ///
    /// # Errors
    /// The leg has not two joints with motors.
    pub fn new(leg: &LegFile, seed: u64) -> Result<Self, FileError> {
        let (leg, drives) = (leg.description::<JOINTS>()?, leg.complete_description::<JOINTS>()?);
        let anatomy = leg.joints.map(|joint| Anatomy::from_joint(&joint));
        let state = LegState {
            angles: core::array::from_fn(|joint| anatomy[joint].to_joint_angle(0.0)),
            rates: [0.0; JOINTS],
        };
        // Rotors at arbitrary angles.
        let axes = core::array::from_fn(|axis| Axis::new(&drives.axes[axis], 0.4 + 0.7 * axis as f64));
        Ok(Self {
            axes,
            supply: Supply::new(&drives.supply),
            brake: 0.0,
            source: drives.supply,
            coupling: drives.coupling,
            leg: Leg::new(&leg),
            description: leg,
            state,
            anatomy,
            mirrored: if leg.mirrored { -1.0 } else { 1.0 },
            hand: None,
            wearer: None,
            worn_steps: 0,
            noise: Xoshiro256PlusPlus::seed_from_u64(seed),
            electric: 0,
            mechanic: 0,
            index_edges: Vec::new(),
            thermistors: [WARM; 3],
            motor_thermistors: [None; JOINTS],
            gates: false,
            switchings: Vec::new(),
        })
    }

    /// Connects a motor or its sensors differently, at rest and before the bridges were on.
    pub fn reconnect(&mut self, axis: usize, change: impl FnOnce(&mut AxisDescription)) {
        let mut description = self.axes[axis].description;
        change(&mut description);
        self.axes[axis] = Axis::new(&description, self.axes[axis].angle);
    }

    /// Mounts the gears: from now on the rotors turn the leg, which a hand holds where it is.
    pub fn couple(&mut self, now: Ticks) {
        let position = self.position();
        for (joint, axis) in self.axes.iter_mut().enumerate() {
            axis.mounting = Some(axis.angle - axis.description.ratio * self.mirrored * position[joint]);
            axis.speed = 0.0;
        }
        self.hand = Some(Hand { from: position, to: position, begun: now, duration: 0 });
    }

    /// Moves the joints to these angles (rad, anatomical) within a duration, and holds them there.
    pub fn move_by_hand(&mut self, to: [f64; JOINTS], now: Ticks, duration: f64) {
        let duration = ticks(duration);
        self.hand = Some(Hand { from: self.position(), to, begun: now, duration });
    }

    /// Releases the leg from the hand.
    pub fn let_go(&mut self) {
        self.hand = None;
    }

    /// Puts the exoskeleton on a wearer, who is limp and in its posture, and releases it from the hand.
    ///
    /// # Errors
    /// The wearer does not fit.
    pub fn wear(&mut self, wearer: &WearerDescription) -> Result<(), WearerError> {
        self.wearer = Some(Wearer::new(wearer, &self.description, &self.state)?);
        (self.worn_steps, self.hand) = (0, None);
        Ok(())
    }

    /// Lets the wearer intend something from now on.
    ///
    /// # Errors
    /// The leg is not worn, or the motion is not permitted.
    pub fn intend(&mut self, intention: Intention) -> Result<(), WearerError> {
        let now = self.worn_steps as f64 * PERIOD_S;
        self.wearer.as_mut().ok_or(WearerError::NotWorn)?.intend(intention, now)
    }

    /// True state of the wearer, if any.
    pub fn wearer_truth(&self) -> Option<WearerTruth> {
        self.wearer.as_ref().map(|wearer| wearer.truth(&self.state))
    }

    /// Whether a hand holds the leg.
    pub const fn is_held(&self) -> bool {
        self.hand.is_some()
    }

    /// Joint angles, rad, anatomical.
    pub fn position(&self) -> [f64; JOINTS] {
        core::array::from_fn(|joint| self.anatomy[joint].to_anatomical_angle(self.state.angles[joint]))
    }

    /// Joint rates, rad/s, anatomical.
    pub fn velocity(&self) -> [f64; JOINTS] {
        core::array::from_fn(|joint| self.anatomy[joint].flip(self.state.rates[joint]))
    }

    /// Torques of the motors at the joints, mean over the last mechanical step, N m, anatomical.
    pub fn torque(&self) -> [f64; JOINTS] {
        core::array::from_fn(|joint| {
            let axis = &self.axes[joint];
            self.mirrored * axis.description.ratio * axis.torque
        })
    }

    /// Sets the bus and its source to a voltage at once.
    pub fn set_bus(&mut self, voltage: f64) {
        self.supply = Supply::new(&SupplyDescription { voltage, ..self.source });
    }

    /// Position of an encoder at an instant, quadrature counts.
    pub fn encoder(&mut self, axis: usize, now: Ticks) -> u16 {
        let since = seconds(now.saturating_sub(self.mechanic));
        let axis = &mut self.axes[axis];
        let fault = axis.encoder_fault;
        let position = axis.counter.read(axis.angle + axis.speed * since).0;
        let position = fault.frozen.unwrap_or(position).wrapping_add(fault.added as u16);
        let last = axis.last_position.replace(position).unwrap_or(position);
        axis.wraps += u32::from(position.abs_diff(last) > u16::MAX / 2);
        position
    }

    /// Absolute encoder on an axis' select line: at the rotor (0) or at the joint (1). The first line is the
    /// rotor's, or the joint's where the rotor has none.
    pub fn encoder_at(&self, axis: usize, line: usize) -> Option<usize> {
        let description = &self.axes[axis].description;
        let present = [description.counter.absolute, description.joint_encoder.is_some()];
        (0..2).filter(|side| present[*side]).nth(line)
    }

    /// Reading of that encoder at an instant, 14 bits.
    pub fn encoder_steps(&self, axis: usize, line: usize, now: Ticks) -> Option<u16> {
        let side = self.encoder_at(axis, line)?;
        let since = seconds(now.saturating_sub(self.mechanic));
        let (axis, joint) = (&self.axes[axis], axis);
        if side == 0 {
            return Some(axis.counter.steps(axis.angle + axis.speed * since));
        }
        let encoder = axis.description.joint_encoder?;
        let angle = self.mirrored * (self.position()[joint] + self.velocity()[joint] * since);
        Some(steps(encoder.direction * (angle + encoder.error * angle.sin()) + encoder.zero))
    }

    /// Advances the motors to an instant.
    pub fn advance(&mut self, now: Ticks, bridges: &mut [Bridge<'_>; JOINTS]) {
        while self.electric < now {
            let end = now.min(self.electric + QUARTER);
            let (bus, mut charge) = (self.supply.voltage(), 0.0);
            for (axis, bridge) in self.axes.iter_mut().zip(bridges.iter_mut()) {
                charge += axis.advance(bridge, self.electric, end, bus, self.gates);
            }
            self.supply.advance(charge, self.brake, seconds(end - self.electric));
            self.electric = end;
            // Pins that change at this very instant would otherwise change with the next edge.
            if end < now {
                self.refresh(end, bridges);
            }
        }
        self.refresh(now, bridges);
    }

    /// Reads the pins again after registers changed at this instant.
    pub fn refresh(&mut self, now: Ticks, bridges: &mut [Bridge<'_>; JOINTS]) {
        for (index, (axis, bridge)) in self.axes.iter_mut().zip(bridges.iter_mut()).enumerate() {
            axis.read_pins(bridge, now, self.gates);
            let armed = bridge.1.is_on() && self.gates;
            if armed != axis.is_armed {
                axis.is_armed = armed;
                self.switchings.push(Switching { at: now, axis: index, on: armed });
            }
        }
    }

    /// Instant of the next mechanical step or edge of an index line.
    pub fn due(&self) -> Ticks {
        let edge = self.index_edges.first().map_or(NEVER, |(at, ..)| *at);
        edge.min(self.mechanic + STEP)
    }

    /// Processes the due event: an edge of an index line (axis, level), or a mechanical step.
    pub fn pass(&mut self, now: Ticks, bridges: &mut [Bridge<'_>; JOINTS]) -> Option<(usize, bool)> {
        if let Some(&(at, axis, level)) = self.index_edges.first()
            && at <= now
        {
            self.index_edges.remove(0);
            return Some((axis, level));
        }
        self.advance(now, bridges);
        self.step(now);
        None
    }

    /// Moves leg and rotors by the mean torque since the last step.
    fn step(&mut self, now: Ticks) {
        let torque: [f64; JOINTS] = core::array::from_fn(|axis| self.axes[axis].impulse / PERIOD_S);
        self.mechanic = now;
        self.move_leg(&torque, now);
        let (position, velocity) = (self.position(), self.velocity());
        self.index_edges.clear();
        for (joint, axis) in self.axes.iter_mut().enumerate() {
            let (angle, speed) = match axis.mounting {
                Some(offset) => {
                    let turns = axis.description.ratio * self.mirrored;
                    (offset + turns * position[joint], turns * velocity[joint])
                }
                None => turn_freely(axis, torque[joint]),
            };
            axis.motor.warm(axis.heat, PERIOD_S);
            (axis.torque, axis.impulse, axis.heat) = (torque[joint], 0.0, 0.0);
            axis.set_rotor(angle, speed);
            let edges = axis.index_pulse(now);
            self.index_edges.extend(edges.into_iter().map(|(at, level)| (at, joint, level)));
        }
        self.index_edges.sort_unstable();
    }

    fn move_leg(&mut self, torque: &[f64; JOINTS], now: Ticks) {
        if let Some(hand) = &self.hand {
            let share = match hand.duration {
                0 => 1.0,
                duration => ((now - hand.begun) as f64 / duration as f64).clamp(0.0, 1.0),
            };
            // Position and speed of a half cosine.
            let ((sine, cosine), moving) = ((PI * share).sin_cos(), share < 1.0);
            for joint in 0..JOINTS {
                let way = hand.to[joint] - hand.from[joint];
                let position = hand.from[joint] + 0.5 * (1.0 - cosine) * way;
                let rate = if moving { 0.5 * PI * sine * way / seconds(hand.duration) } else { 0.0 };
                self.state.angles[joint] = self.anatomy[joint].to_joint_angle(position);
                self.state.rates[joint] = self.anatomy[joint].flip(rate);
            }
            return;
        }
        if self.axes.iter().any(|axis| axis.mounting.is_none()) {
            return;
        }
        let (position, velocity) = (self.position(), self.velocity());
        let acting = core::array::from_fn(|joint| {
            let motor = self.mirrored * self.axes[joint].description.ratio * torque[joint];
            let stops = self.description.joints[joint].stops;
            let stopped = end_stop::torque(stops, position[joint], velocity[joint]);
            self.anatomy[joint].flip(motor + stopped)
        });
        let Some(wearer) = &mut self.wearer else {
            return self.leg.advance(&mut self.state, &acting, &acting, PERIOD_S);
        };
        let steps = u64::from(PERIODS_PER_TICK);
        if self.worn_steps.is_multiple_of(steps) {
            // Muscles hold their torque for a servo tick, as in the simulated world.
            wearer.decide(self.worn_steps / steps, self.worn_steps as f64 * PERIOD_S);
        }
        self.worn_steps += 1;
        wearer.advance(&self.leg, &mut self.state, [&acting, &acting], PERIOD_S);
    }

    /// Code of a converter's channel at an instant up to which the motors were advanced; `gains` are those of
    /// both axes' amplifiers.
    pub fn code(&mut self, channel: u32, now: Ticks, gains: [f64; JOINTS]) -> u16 {
        match channel {
            10 => self.shunt(0, 0, now, gains),
            11 => self.shunt(0, 1, now, gains),
            13 => self.shunt(1, 0, now, gains),
            12 => self.shunt(1, 1, now, gains),
            6 => {
                let noise: f64 = StandardNormal.sample(&mut self.noise);
                self.supply.code(BUS_NOISE_CODES * noise)
            }
            15 => self.thermistors[0],
            4 => self.thermistors[1],
            5 => self.thermistors[2],
            0 | 1 => {
                let axis = channel as usize;
                self.motor_thermistors[axis].or(self.axes[axis].motor.thermistor_code()).unwrap_or(0)
            }
            _ => 0,
        }
    }

    fn shunt(&mut self, axis: usize, channel: usize, now: Ticks, gains: [f64; JOINTS]) -> u16 {
        let disturbance = self.disturbance(axis, now);
        let this = &self.axes[axis];
        let channel = if this.description.wiring.shunts_exchanged { 1 - channel } else { channel };
        let mut shunts = this.description.shunts;
        // The state is that at the hold.
        (shunts.delay, shunts.gain) = (0.0, gains[axis]);
        let fault = this.shunt_faults[channel];
        if let Some(ShuntFault::Offset(codes)) = fault {
            shunts.offset_codes[channel] += codes;
        }
        let state = this.shunt_state(channel, disturbance, now);
        let code = shunts.code(channel, &state, &mut self.noise);
        if let Some(ShuntFault::Stuck(stuck)) = fault { stuck } else { code }
    }

    /// Error of an axis' shunts by edges of the other bridge in the window before the hold, A.
    fn disturbance(&self, axis: usize, now: Ticks) -> f64 {
        if self.coupling.ampere_per_edge == 0.0 {
            return 0.0;
        }
        let (_, rising) = self.axes[1 - axis].edges_within(ticks(self.coupling.window), now);
        self.coupling.ampere_per_edge * f64::from(rising)
    }
}

/// Angle and speed of a free rotor after a step under this torque, N m.
fn turn_freely(axis: &Axis, torque: f64) -> (f64, f64) {
    let [inertia, dry, viscous] = FREE;
    let angle = axis.angle + axis.speed * PERIOD_S;
    let driven = axis.speed + PERIOD_S / inertia * (torque - viscous * axis.speed);
    let dry = PERIOD_S / inertia * dry;
    (angle, driven - driven.clamp(-dry, dry))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::peripherals::pwm::tests::bridge;
    use scarab_identify::formats::leg_file::DEFAULT_LEG;

    #[test]
    fn a_bridge_that_is_on_again_is_detected_with_its_time() {
        let switching = |at, axis, on| Switching { at, axis, on };
        let log = [
            switching(100, 0, false),
            switching(110, 1, false),
            switching(200, 0, true),
            switching(230, 0, false),
        ];
        let armed = Reaction { armed: [true; 2], ..Reaction::default() };
        let mut reaction = armed;
        reaction.follow(&log);
        let Reaction { released, last, again, armed: at_end, .. } = reaction;
        assert_eq!((released, last, again, at_end), (Some(110), 230, 30, [false; 2]));
        let mut reaction = armed;
        reaction.follow(&log[..1]);
        assert_eq!(reaction.released, None);
    }

    #[test]
    fn an_edge_at_the_end_of_a_slice_is_not_late() {
        let plant = Plant::new(&LegFile::load(DEFAULT_LEG).expect("shipped"), 1).expect("motors");
        // A slice of the motors' integration has 1,750 counts.
        for compare in [1700, 1749, 1750, 1751] {
            let (mut plant, mut bridges) = (plant.clone(), [bridge(compare), bridge(compare)]);
            plant.gates = true;
            plant.axes[0].pin_changes = Some(Vec::new());
            let [first, second] = &mut bridges;
            let mut bridges = [(&first.0, &mut first.1), (&second.0, &mut second.1)];
            plant.refresh(0, &mut bridges);
            plant.advance(3 * QUARTER, &mut bridges);
            let changes = plant.axes[0].pin_changes.take().unwrap_or_default();
            let off = changes.iter().filter(|(at, _)| *at > 100).map(|(at, _)| *at).next();
            assert_eq!(off, Some(2 * Ticks::from(compare)), "{changes:?}");
        }
    }
}
