//! Permanent-magnet motor by the flux linkages of its windings, in the stator's frame.
//!
//! Why another formulation than the firmware's: the simulator does not share the rotating frame. States are
//! the flux linkages themselves, and inductances depend on the rotor's position. The back-EMF has no term of
//! its own: it is the magnets' part in the change of flux. Fluxes, currents and voltages of the three phases
//! less their mean are two numbers, one along phase 0 and one across:
//!
//! ```text
//! x_a = (2 x_0 - x_1 - x_2) / 3,   x_b = (x_1 - x_2) / sqrt 3;    x_0 = x_a,  x_1,2 = -x_a/2 +- sqrt 3/2 x_b
//! d psi / dt = v - R i
//! i_a = (m + s cos 2 angle) f_a + s sin 2 angle f_b          f = psi - flux (cos angle, sin angle)
//! i_b = s sin 2 angle f_a + (m - s cos 2 angle) f_b          m, s = (1/Ld +- 1/Lq) / 2
//! torque = 3/2 pole pairs (psi_a i_b - psi_b i_a)
//! ```
//!
//! `v` terminal voltages (V), `R` of winding and switch (ohm), angle electrical (rad), `Ld`, `Lq` along and
//! across the magnets' axis (H). With i_k = -i sin(angle - 120 k) the torque is 1.5 pole pairs flux i.
//! Source: Park 1929 in quantities of the stator, as in Krause, Wasynczuk and Sudhoff, Analysis of Electric
//! Machinery, chapter 1.
//!
//! A step is the midpoint rule with constant terminal voltages and speed. For an output with both switches
//! off, the diode that its current keeps open sets the voltage. Where the current could end within the step,
//! the voltage is the one that ends the step at zero current, clamped to the diodes' limits. That is a
//! complementarity problem, solved by implicit Euler, for several such outputs by Gauss-Seidel.
//! Cost: two evaluations of the currents, some 60 operations.
//! Known limits: sinusoidal flux, no saturation, no iron losses, magnets at constant temperature.

use super::description::{MotorDescription, ThermistorDescription};
use crate::maths::{exp, sin_cos};

/// Temperature coefficient of copper, 1/K.
const RESISTANCE_PER_KELVIN: f64 = 0.003_93;
/// Temperature of the surroundings and of the stated resistance, degrees Celsius.
const AMBIENT: f64 = 20.0;
/// Half the square root of 3.
const SIN_60: f64 = 0.866_025_403_784_438_6;
/// Sweeps over outputs that are off; each reduces the remaining error by a factor of four.
const SWEEPS: usize = 6;
/// Change of a voltage after which no further sweep is made, V.
const SETTLED: f64 = 1e-9;
/// Currents below this count as zero, A.
const NO_CURRENT: f64 = 1e-6;

/// Electrical angle as a direction, advanced in small steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    cosine: f64,
    sine: f64,
}

impl Direction {
    /// Direction of an angle in rad.
    pub fn from_angle(angle: f64) -> Self {
        let (sine, cosine) = sin_cos(angle);
        Self { cosine, sine }
    }

    /// Direction of a small angle (rad): exact to 1e-9 for 0.1 rad.
    pub(crate) fn small(angle: f64) -> Self {
        let square = angle * angle;
        Self {
            cosine: 1.0 - square / 2.0 * (1.0 - square / 12.0),
            sine: angle * (1.0 - square / 6.0 * (1.0 - square / 20.0)),
        }
    }

    /// This direction turned by another one's angle.
    pub(crate) fn turned(&self, by: &Self) -> Self {
        Self {
            cosine: self.cosine * by.cosine - self.sine * by.sine,
            sine: self.sine * by.cosine + self.cosine * by.sine,
        }
    }

    /// Cosine and sine of twice the angle.
    fn doubled(&self) -> [f64; 2] {
        [self.cosine * self.cosine - self.sine * self.sine, 2.0 * self.sine * self.cosine]
    }
}

/// Quantity of the three phases less their mean: along phase 0 and across.
type Pair = [f64; 2];

fn pair(phases: &[f64; 3]) -> Pair {
    [(2.0 * phases[0] - phases[1] - phases[2]) / 3.0, (phases[1] - phases[2]) / (2.0 * SIN_60)]
}

fn phases(pair: &Pair) -> [f64; 3] {
    let (along, across) = (-0.5 * pair[0], SIN_60 * pair[1]);
    [pair[0], along + across, along - across]
}

/// Connection of a terminal during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Terminal {
    /// Connected to a voltage, V.
    Held(f64),
    /// Connected to diodes only: lowest and highest voltage, V.
    Off(f64, f64),
}

/// Transfers during a step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Torque integrated over time, N m s.
    pub impulse: f64,
    /// Charge into each phase, C.
    pub charge: [f64; 3],
    /// Heat of the resistances, J.
    pub heat: f64,
}

/// State of one motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    description: MotorDescription,
    /// Inverse inductances, mean and swing: m and s, 1/H.
    mean: f64,
    swing: f64,
    /// Resistance of winding at its temperature and switch, ohm.
    resistance: f64,
    on_resistance: f64,
    torque_factor: f64,
    /// Temperatures of the winding and of its thermistor, degrees Celsius.
    temperature: f64,
    sensed: f64,
    /// Flux linkage, V s.
    flux: Pair,
    /// Present electrical angle.
    angle: Direction,
    /// Currents that follow from flux and angle, A.
    currents: Pair,
}

impl Motor {
    /// A cold motor without current, rotor at `angle` (electrical); `on_resistance` of a switch is added to
    /// the winding's.
    pub fn new(description: &MotorDescription, on_resistance: f64, angle: Direction) -> Self {
        let (along, across) = (1.0 / description.inductance_d, 1.0 / description.inductance_q);
        Self {
            description: *description,
            mean: 0.5 * (along + across),
            swing: 0.5 * (along - across),
            resistance: description.resistance + on_resistance,
            on_resistance,
            torque_factor: 1.5 * f64::from(description.pole_pairs),
            temperature: AMBIENT,
            sensed: AMBIENT,
            flux: [description.flux * angle.cosine, description.flux * angle.sine],
            angle,
            currents: [0.0; 2],
        }
    }

    /// Moves the rotor to an angle, without current.
    pub fn move_to(&mut self, angle: Direction) {
        (self.angle, self.flux, self.currents) = (angle, self.of_magnets(&angle), [0.0; 2]);
    }

    /// Replaces the angle accumulated by small turns with the exact one; fluxes stay.
    pub fn set_angle(&mut self, angle: Direction) {
        (self.angle, self.currents) = (angle, self.currents_of(&self.flux, &angle));
    }

    /// Temperature of the winding, degrees Celsius.
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Code that a converter of 12 bits reads at the thermistor; `None` without one.
    pub fn thermistor_code(&self) -> Option<u16> {
        let ThermistorDescription { pull_up, at_25_c, beta, .. } = self.description.thermistor?;
        let resistance = at_25_c * exp(beta * (1.0 / (self.sensed + 273.15) - 1.0 / 298.15));
        Some((4096.0 * resistance / (resistance + pull_up)).min(4095.0) as u16)
    }

    /// Resistance of a phase with its switch at the present temperature, ohm.
    pub fn resistance(&self) -> f64 {
        self.resistance
    }

    /// Currents into the phases, A.
    pub fn currents(&self) -> [f64; 3] {
        phases(&self.currents)
    }

    /// Amplitudes of the currents along and across the magnets' axis, A.
    pub fn rotor_currents(&self) -> [f64; 2] {
        let ([along, across], Direction { cosine, sine }) = (self.currents, self.angle);
        [cosine * along + sine * across, cosine * across - sine * along]
    }

    /// Energy of the field that the currents produce, J.
    pub fn field_energy(&self) -> f64 {
        let magnets = self.of_magnets(&self.angle);
        (0..2).map(|part| 0.75 * self.currents[part] * (self.flux[part] - magnets[part])).sum()
    }

    /// Warms the winding by `heat` (J) within `duration` s.
    pub fn warm(&mut self, heat: f64, duration: f64) {
        let (resistance, time) = (self.description.thermal_resistance, self.description.thermal_time);
        let copper = heat * (1.0 - self.on_resistance / self.resistance);
        self.temperature += (copper * resistance - (self.temperature - AMBIENT) * duration) / time;
        if let Some(thermistor) = &self.description.thermistor {
            self.sensed += (self.temperature - self.sensed) * duration / thermistor.lag;
        }
        self.resistance = self.description.resistance
            * (1.0 + RESISTANCE_PER_KELVIN * (self.temperature - AMBIENT))
            + self.on_resistance;
    }

    /// Advances by `duration` s with the rotor turning at `speed` (electrical, rad/s).
    pub fn advance(&mut self, terminals: &[Terminal; 3], speed: f64, duration: f64) -> Flow {
        let mut voltages = [0.0; 3];
        let currents = phases(&self.currents);
        for ((voltage, terminal), current) in voltages.iter_mut().zip(terminals).zip(currents) {
            *voltage = match *terminal {
                Terminal::Held(held) => held,
                // A current into the motor comes through the lower diode.
                Terminal::Off(low, high) if current.abs() > self.largest_change(high - low, duration) => {
                    if current > 0.0 {
                        low
                    } else {
                        high
                    }
                }
                Terminal::Off(..) => return self.partly_off(terminals, speed, duration),
            };
        }
        self.driven(&voltages, speed, duration)
    }

    /// Upper bound on the change of a current within a step, A: twice what the bus produces in the smaller
    /// inductance. Infinite where the wire is broken.
    fn largest_change(&self, bus: f64, duration: f64) -> f64 {
        2.0 * bus * duration * (self.mean + self.swing.abs())
    }

    /// Step with all terminals at known voltages: midpoint rule.
    fn driven(&mut self, voltages: &[f64; 3], speed: f64, duration: f64) -> Flow {
        let driving = pair(voltages);
        let half_turn = Direction::small(0.5 * speed * duration);
        let middle = self.angle.turned(&half_turn);
        let start = self.currents;
        let half: Pair = core::array::from_fn(|part| {
            self.flux[part] + 0.5 * duration * (driving[part] - self.resistance * start[part])
        });
        let currents = self.currents_of(&half, &middle);
        for part in 0..2 {
            self.flux[part] += duration * (driving[part] - self.resistance * currents[part]);
        }
        self.set_angle(middle.turned(&half_turn));
        self.flow(&half, &currents, duration)
    }

    /// Step with a terminal off whose current may end: implicit in its voltage.
    #[inline(never)]
    fn partly_off(&mut self, terminals: &[Terminal; 3], speed: f64, duration: f64) -> Flow {
        let start = self.currents;
        let end = self.angle.turned(&Direction::small(speed * duration));
        let all_off = terminals.iter().all(|terminal| matches!(terminal, Terminal::Off(..)));
        if all_off
            && phases(&start).iter().all(|current| current.abs() < NO_CURRENT)
            && self.stays_dark(terminals, speed)
        {
            self.move_to(end);
            return Flow::default();
        }
        let mut voltages = terminals.map(|terminal| match terminal {
            Terminal::Held(voltage) => voltage,
            Terminal::Off(low, high) if low.is_finite() && high.is_finite() => 0.5 * (low + high),
            Terminal::Off(..) => 0.0,
        });
        let flux_at = |voltages: &[f64; 3]| -> Pair {
            let driving = pair(voltages);
            core::array::from_fn(|part| {
                self.flux[part] + duration * (driving[part] - self.resistance * start[part])
            })
        };
        // Change of the currents by the voltages. Between two phases the third one's direction counts.
        let [cosine, sine] = end.doubled();
        let [first, third, second] = phases(&[cosine, sine]);
        let changes = [first, second, third].map(|direction| self.swing * direction);
        let factor = 2.0 / 3.0 * duration;
        let own = changes.map(|change| factor * (self.mean + change));
        let own_inverse = own.map(|change| 1.0 / change);
        let mutual = changes.map(|change| factor * (change - 0.5 * self.mean));
        let mut currents = phases(&self.currents_of(&flux_at(&voltages), &end));
        for _ in 0..SWEEPS {
            let mut largest = 0.0_f64;
            for phase in 0..3 {
                let Terminal::Off(low, high) = terminals[phase] else { continue };
                let voltage = (voltages[phase] - currents[phase] * own_inverse[phase]).clamp(low, high);
                let change = voltage - core::mem::replace(&mut voltages[phase], voltage);
                let (next, last) = ((phase + 1) % 3, (phase + 2) % 3);
                currents[phase] += own[phase] * change;
                currents[next] += mutual[last] * change;
                currents[last] += mutual[next] * change;
                largest = largest.max(change.abs());
            }
            if largest < SETTLED {
                break;
            }
        }
        let before = self.flux;
        self.flux = flux_at(&voltages);
        self.set_angle(end);
        let half = core::array::from_fn(|part| 0.5 * (before[part] + self.flux[part]));
        let currents = core::array::from_fn(|part| 0.5 * (start[part] + self.currents[part]));
        self.flow(&half, &currents, duration)
    }

    /// Whether the magnets' voltage alone conducts through no diode.
    fn stays_dark(&self, terminals: &[Terminal; 3], speed: f64) -> bool {
        let between = 2.0 * SIN_60 * self.description.flux * speed.abs();
        terminals.iter().all(|terminal| match terminal {
            Terminal::Off(low, high) => high - low > between,
            Terminal::Held(_) => false,
        })
    }

    fn flow(&self, flux: &Pair, currents: &Pair, duration: f64) -> Flow {
        let torque = self.torque_factor * (flux[0] * currents[1] - flux[1] * currents[0]);
        let squares = 1.5 * (currents[0] * currents[0] + currents[1] * currents[1]);
        Flow {
            impulse: torque * duration,
            charge: phases(currents).map(|current| current * duration),
            heat: self.resistance * squares * duration,
        }
    }

    fn of_magnets(&self, angle: &Direction) -> Pair {
        [self.description.flux * angle.cosine, self.description.flux * angle.sine]
    }

    #[inline]
    fn currents_of(&self, flux: &Pair, angle: &Direction) -> Pair {
        let magnets = self.of_magnets(angle);
        let [along, across] = [flux[0] - magnets[0], flux[1] - magnets[1]];
        let [cosine, sine] = angle.doubled();
        let (swing, coupling) = (self.swing * cosine, self.swing * sine);
        [(self.mean + swing) * along + coupling * across, coupling * along + (self.mean - swing) * across]
    }

    /// Cogging torque at a rotor angle (rad), N m: the negative slope of a potential, so it does no work over
    /// a turn.
    pub fn cogging(&self, rotor: f64) -> f64 {
        if self.description.cogging == 0.0 {
            return 0.0;
        }
        -self.description.cogging * sin_cos(f64::from(self.description.cogging_periods) * rotor).0
    }
}
