//! Permanent-magnet motor by the flux linkages of its three phases.
//!
//! Why another formulation than the firmware's: its rotating frame appears nowhere here. States are the flux linkages of the
//! phases themselves, inductances depend on the rotor's position, and the back-EMF is nothing apart: it is the part of the
//! flux's change that the magnets make.
//!
//! ```text
//! d psi_k / dt = v_k - v_star - R i_k                      v_star so that the fluxes keep their sum, 0
//! i_k = sum_m G_km (psi_m - flux cos(angle - 120 m))       G_kk = g0 + g2 cos(2 angle - 240 k)
//!                                                          G_km = -g0/2 + g2 cos(2 angle - 120 (k + m))
//! g0 = (1/Ld + 1/Lq) / 3,   g2 = (1/Ld - 1/Lq) / 3
//! torque = pole pairs sqrt(3)/2 (psi_0 (i_1 - i_2) - (psi_1 - psi_2) i_0)
//! ```
//!
//! `v_k` terminal voltages (V), `R` of winding and switch (ohm), angle electrical (degrees in the text, rad in the code),
//! `Ld`, `Lq` along and across the magnets' axis (H). With i_k = -i sin(angle - 120 k) the torque is 1.5 pole pairs flux i.
//! Source: Park 1929 in phase quantities, as in Krause, Wasynczuk and Sudhoff, Analysis of Electric Machinery, chapter 1;
//! G is the inverse of the phases' inductance matrix on currents of sum 0.
//!
//! A step is the midpoint rule with terminal voltages and speed held. An output with both switches off carries what its
//! diodes allow: its voltage is that which ends the step without current, kept between the diodes' limits
//! (complementarity, implicit Euler; several such outputs by Gauss-Seidel). Cost: two evaluations of the currents, some 70
//! operations. Known limits: sinusoidal flux, no saturation, no iron losses, magnets that do not warm.

use super::description::MotorDescription;
use crate::maths::sin_cos;

/// Copper, 1/K.
const RESISTANCE_PER_KELVIN: f64 = 0.003_93;
/// Surroundings, and where resistance is stated, degrees Celsius.
const AMBIENT: f64 = 20.0;
/// Half the square root of 3.
const SIN_60: f64 = 0.866_025_403_784_438_6;
/// Sweeps over outputs that are off; each reduces what is left by four.
const SWEEPS: usize = 6;
/// Below this a current is none, A.
const NO_CURRENT: f64 = 1e-6;

/// The electrical angle as a direction, turned in small steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Direction {
    cosine: f64,
    sine: f64,
}

impl Direction {
    /// Of an angle in rad.
    #[must_use]
    pub fn of(angle: f64) -> Self {
        let (sine, cosine) = sin_cos(angle);
        Self { cosine, sine }
    }

    /// Turned by a small angle (rad): exact to 1e-9 for 0.1 rad.
    #[must_use]
    pub fn turned(&self, angle: f64) -> Self {
        let square = angle * angle;
        let sine = angle * (1.0 - square / 6.0 * (1.0 - square / 20.0));
        let cosine = 1.0 - square / 2.0 * (1.0 - square / 12.0);
        Self {
            cosine: self.cosine * cosine - self.sine * sine,
            sine: self.sine * cosine + self.cosine * sine,
        }
    }

    /// Cosines of the angle, of 120 degrees less and of 240 degrees less.
    fn phases(&self) -> [f64; 3] {
        let (along, across) = (-0.5 * self.cosine, SIN_60 * self.sine);
        [self.cosine, along + across, along - across]
    }

    fn doubled(&self) -> Self {
        Self {
            cosine: self.cosine * self.cosine - self.sine * self.sine,
            sine: 2.0 * self.sine * self.cosine,
        }
    }
}

/// What a terminal is connected to during a step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Terminal {
    /// To a voltage, V.
    Held(f64),
    /// To nothing but diodes: lowest and highest voltage, V.
    Off(f64, f64),
}

/// What a step moved.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Flow {
    /// Torque integrated over time, N m s.
    pub impulse: f64,
    /// Charge into each phase, C.
    pub charge: [f64; 3],
    /// Heat of the resistances, J.
    pub heat: f64,
}

/// One motor.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motor {
    description: MotorDescription,
    /// Of the inverse inductances, mean and swing: g0 and g2, 1/H.
    mean: f64,
    swing: f64,
    /// Of winding at its temperature and switch, ohm.
    resistance: f64,
    on_resistance: f64,
    torque_factor: f64,
    /// Winding, degrees Celsius.
    temperature: f64,
    /// Of the phases, V s; sum 0.
    flux: [f64; 3],
    /// Electrical angle now.
    angle: Direction,
    /// What follows from both, A.
    currents: [f64; 3],
}

impl Motor {
    /// Cold and without current, rotor at `angle` (electrical); `on_resistance` of a switch comes on top of the winding's.
    #[must_use]
    pub fn new(description: &MotorDescription, on_resistance: f64, angle: Direction) -> Self {
        let (along, across) = (1.0 / description.inductance_d, 1.0 / description.inductance_q);
        Self {
            description: *description,
            mean: (along + across) / 3.0,
            swing: (along - across) / 3.0,
            resistance: description.resistance + on_resistance,
            on_resistance,
            torque_factor: f64::from(description.pole_pairs) * SIN_60,
            temperature: AMBIENT,
            flux: angle.phases().map(|share| description.flux * share),
            angle,
            currents: [0.0; 3],
        }
    }

    /// Puts the rotor elsewhere, without current.
    pub fn place(&mut self, angle: Direction) {
        (self.angle, self.flux, self.currents) = (angle, self.of_magnets(&angle), [0.0; 3]);
    }

    /// Puts right what small turns have added up; fluxes stay.
    pub fn set_angle(&mut self, angle: Direction) {
        (self.angle, self.currents) = (angle, self.currents_of(&self.flux, &angle));
    }

    /// Winding, degrees Celsius.
    #[must_use]
    pub fn temperature(&self) -> f64 {
        self.temperature
    }

    /// Of a phase with its switch, warm, ohm.
    #[must_use]
    pub fn resistance(&self) -> f64 {
        self.resistance
    }

    /// Currents into the phases, A.
    #[must_use]
    pub fn currents(&self) -> [f64; 3] {
        self.currents
    }

    /// Amplitudes of the currents along and across the magnets' axis, A.
    #[must_use]
    pub fn rotor_currents(&self) -> [f64; 2] {
        let [first, second, third] = self.angle.phases();
        let [one, two, three] = self.currents;
        // Of a sum of 0 the shares along and a quarter turn ahead: -sin is the difference of the other cosines over sqrt 3.
        let along = 2.0 / 3.0 * (first * one + second * two + third * three);
        let across =
            (one * (third - second) + two * (first - third) + three * (second - first)) / (3.0 * SIN_60);
        [along, across]
    }

    /// Energy of the currents' field, J.
    #[must_use]
    pub fn field_energy(&self) -> f64 {
        let magnets = self.of_magnets(&self.angle);
        (0..3).map(|phase| 0.5 * self.currents[phase] * (self.flux[phase] - magnets[phase])).sum()
    }

    /// Warms the winding by `heat` (J) within `duration` s.
    pub fn warm(&mut self, heat: f64, duration: f64) {
        let (resistance, time) = (self.description.thermal_resistance, self.description.thermal_time);
        let copper = heat * (1.0 - self.on_resistance / self.resistance);
        self.temperature += (copper * resistance - (self.temperature - AMBIENT) * duration) / time;
        self.resistance = self.description.resistance
            * (1.0 + RESISTANCE_PER_KELVIN * (self.temperature - AMBIENT))
            + self.on_resistance;
    }

    /// One step of `duration` s with the rotor turning at `speed` (electrical, rad/s).
    pub fn advance(&mut self, terminals: &[Terminal; 3], speed: f64, duration: f64) -> Flow {
        match terminals {
            [Terminal::Held(one), Terminal::Held(two), Terminal::Held(three)] => {
                self.driven([*one, *two, *three], speed, duration)
            }
            _ => self.partly_off(terminals, speed, duration),
        }
    }

    /// All terminals held: midpoint rule.
    fn driven(&mut self, voltages: [f64; 3], speed: f64, duration: f64) -> Flow {
        let star = (voltages[0] + voltages[1] + voltages[2]) / 3.0;
        let middle = self.angle.turned(0.5 * speed * duration);
        let start = self.currents;
        let half: [f64; 3] = core::array::from_fn(|phase| {
            self.flux[phase] + 0.5 * duration * (voltages[phase] - star - self.resistance * start[phase])
        });
        let currents = self.currents_of(&half, &middle);
        for phase in 0..3 {
            self.flux[phase] += duration * (voltages[phase] - star - self.resistance * currents[phase]);
        }
        self.set_angle(middle.turned(0.5 * speed * duration));
        self.flow(&half, &currents, duration)
    }

    /// Some terminal is off: implicit in its voltage.
    fn partly_off(&mut self, terminals: &[Terminal; 3], speed: f64, duration: f64) -> Flow {
        let start = self.currents;
        let end = self.angle.turned(speed * duration);
        let all_off = terminals.iter().all(|terminal| matches!(terminal, Terminal::Off(..)));
        if all_off
            && start.iter().all(|current| current.abs() < NO_CURRENT)
            && self.stays_dark(terminals, speed)
        {
            self.place(end);
            return Flow::default();
        }
        let mut voltages = terminals.map(|terminal| match terminal {
            Terminal::Held(voltage) => voltage,
            Terminal::Off(low, high) if low.is_finite() && high.is_finite() => 0.5 * (low + high),
            Terminal::Off(..) => 0.0,
        });
        let doubled = end.doubled().phases();
        let flux_at = |voltages: &[f64; 3]| -> [f64; 3] {
            let star = (voltages[0] + voltages[1] + voltages[2]) / 3.0;
            core::array::from_fn(|phase| {
                self.flux[phase] + duration * (voltages[phase] - star - self.resistance * start[phase])
            })
        };
        let off = terminals.iter().filter(|terminal| matches!(terminal, Terminal::Off(..))).count();
        for _ in 0..if off == 1 { 1 } else { SWEEPS } {
            for phase in 0..3 {
                let Terminal::Off(low, high) = terminals[phase] else { continue };
                let current = self.currents_of(&flux_at(&voltages), &end)[phase];
                let slope = (self.mean + self.swing * doubled[2 * phase % 3]) * duration;
                voltages[phase] = (voltages[phase] - current / slope).clamp(low, high);
            }
        }
        let before = self.flux;
        self.flux = flux_at(&voltages);
        self.set_angle(end);
        let half = core::array::from_fn(|phase| 0.5 * (before[phase] + self.flux[phase]));
        let currents = core::array::from_fn(|phase| 0.5 * (start[phase] + self.currents[phase]));
        self.flow(&half, &currents, duration)
    }

    /// No diode begins to conduct by the magnets' voltage alone.
    fn stays_dark(&self, terminals: &[Terminal; 3], speed: f64) -> bool {
        let between = 2.0 * SIN_60 * self.description.flux * speed.abs();
        terminals.iter().all(|terminal| match terminal {
            Terminal::Off(low, high) => high - low > between,
            Terminal::Held(_) => false,
        })
    }

    fn flow(&self, flux: &[f64; 3], currents: &[f64; 3], duration: f64) -> Flow {
        let torque =
            self.torque_factor * (flux[0] * (currents[1] - currents[2]) - (flux[1] - flux[2]) * currents[0]);
        let squares = currents[0] * currents[0] + currents[1] * currents[1] + currents[2] * currents[2];
        Flow {
            impulse: torque * duration,
            charge: currents.map(|current| current * duration),
            heat: self.resistance * squares * duration,
        }
    }

    fn of_magnets(&self, angle: &Direction) -> [f64; 3] {
        angle.phases().map(|share| self.description.flux * share)
    }

    #[inline]
    fn currents_of(&self, flux: &[f64; 3], angle: &Direction) -> [f64; 3] {
        let magnets = self.of_magnets(angle);
        let [one, two, three] = [flux[0] - magnets[0], flux[1] - magnets[1], flux[2] - magnets[2]];
        let [first, second, third] = angle.doubled().phases();
        let mean = 1.5 * self.mean;
        [
            mean * one + self.swing * (first * one + second * two + third * three),
            mean * two + self.swing * (second * one + third * two + first * three),
            mean * three + self.swing * (third * one + first * two + second * three),
        ]
    }

    /// Cogging torque at a rotor angle (rad), N m: the negative slope of a potential, so it does no work over a turn.
    #[must_use]
    pub fn cogging(&self, rotor: f64) -> f64 {
        if self.description.cogging == 0.0 {
            return 0.0;
        }
        -self.description.cogging * sin_cos(f64::from(self.description.cogging_periods) * rotor).0
    }
}
