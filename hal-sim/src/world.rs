//! World: a leg with drives, sensors and disturbances as one seeded value.
//!
//! Why one value: a test runs the firmware against a world, clones both at any time, lets the copies continue
//! differently, and compares copies bit for bit. A world contains no clock, no file and no shared state. The
//! same seed and commands give the same bits.
//!
//! One exchange per servo tick of 250 us: read [`LegDrives::sample`] (sensors now), set
//! [`LegDrives::command`] (effective now), then [`World::advance`] to the next tick. [`World::tick`] does the
//! last two and reads. With complete drives there is one exchange per PWM period instead, [`World::period`].
//! All public angles and torques are anatomical.

pub mod periods;
mod worn;

use crate::conventions::{Anatomy, links_at_reference};
use crate::description::{LegDescription, PushDescription};
use crate::drive::Drive;
use crate::end_stop;
use crate::floor::Floor;
use crate::grip::Grip;
use crate::leg::{Leg, LegState};
use crate::pushes::Pushes;
use crate::sensors::{CurrentSensor, Encoder};
use crate::wearer::Wearer;
use periods::{Electric, PERIODS_PER_TICK};
use rand_core::SeedableRng;
use rand_xoshiro::Xoshiro256PlusPlus;
use scarab::hal::{AxisCommand, DriveCommand, JointSample, LegDrives, SERVO_RATE_HZ, Sample};
use scarab::units::Ampere;

/// Servo rate, Hz.
pub(crate) const TICK_RATE_HZ: f64 = SERVO_RATE_HZ as f64;
/// Duration of a servo tick, s.
pub const TICK_S: f64 = 1.0 / TICK_RATE_HZ;

/// Servo ticks per logged sample.
const TICKS_PER_LOGGED: u64 = 8;

/// True state of a world at the present instant, without noise; anatomical, proximal joint first.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Truth<const N: usize> {
    /// Time since the start, s.
    pub time_s: f64,
    /// Joint angles, rad.
    pub position: [f64; N],
    /// Joint rates, rad/s; exactly 0 while a joint sticks.
    pub velocity: [f64; N],
    /// Joint accelerations, rad/s^2, under the present torque of motors and of a wearer's cuffs; without
    /// pushes and floor.
    pub acceleration: [f64; N],
    /// Torque of the motors at the joints, N m.
    pub motor_torque: [f64; N],
    /// Joints held by friction.
    pub sticking: [bool; N],
}

/// The physical world of one leg of `N` joints.
#[derive(Clone, Debug, PartialEq)]
pub struct World<const N: usize> {
    description: LegDescription<N>,
    leg: Leg<N>,
    state: LegState<N>,
    anatomy: [Anatomy; N],
    drives: [Drive; N],
    /// Complete drives, which replace the ideal ones.
    electric: Option<Electric<N>>,
    encoders: [Encoder; N],
    current_sensors: [CurrentSensor; N],
    /// Direction of motors and encoders relative to the anatomical one, 1 or -1.
    mounting: f64,
    pushes: Pushes,
    /// Wearer with a body of their own, if any.
    wearer: Option<Wearer>,
    blocked: [bool; N],
    floor: Option<Floor>,
    grip: Option<Grip>,
    sensor_noise: Xoshiro256PlusPlus,
    sensor_faults: Xoshiro256PlusPlus,
    tick: u64,
    newest: Sample<N>,
}

impl<const N: usize> World<N> {
    /// A leg at rest at its anatomical zero, bridges off.
    pub fn new(description: &LegDescription<N>, seed: u64) -> Self {
        let joints = &description.joints;
        let sensor_noise = Xoshiro256PlusPlus::seed_from_u64(seed);
        let mut push_instants = sensor_noise.clone();
        push_instants.jump();
        let mut sensor_faults = push_instants.clone();
        sensor_faults.jump();
        let mut world = Self {
            description: *description,
            leg: Leg::new(description),
            state: LegState { angles: joints.map(|joint| joint.zero_offset), rates: [0.0; N] },
            anatomy: joints.map(|joint| Anatomy::from_joint(&joint)),
            drives: joints.map(|joint| Drive::new(&joint.drive, TICK_S)),
            electric: None,
            encoders: joints.map(|joint| Encoder::new(&joint.encoder)),
            current_sensors: joints.map(|joint| CurrentSensor::new(&joint.current_sensor)),
            mounting: if description.mirrored { -1.0 } else { 1.0 },
            pushes: Pushes::new(description.pushes, N, push_instants),
            wearer: None,
            blocked: [false; N],
            floor: None,
            grip: None,
            sensor_noise,
            sensor_faults,
            tick: 0,
            newest: Sample { joints: [JointSample::default(); N] },
        };
        world.read_sensors();
        world
    }

    /// Sets the leg, and its wearer if any, at rest at anatomical angles, rad. The encoders' reference does
    /// not change.
    pub fn move_to(&mut self, position: &[f64; N]) {
        let anatomy = &self.anatomy;
        self.state = LegState {
            angles: core::array::from_fn(|joint| anatomy[joint].to_joint_angle(position[joint])),
            rates: [0.0; N],
        };
        let now = self.time();
        if let Some(wearer) = &mut self.wearer {
            wearer.move_to(&self.state, now);
        }
        if let Some(electric) = &mut self.electric {
            electric.move_to(&position.map(|angle| self.mounting * angle));
        }
        self.read_sensors();
    }

    /// Attaches a point mass (kg) to a link, at a position (m) in its joint's D-H frame, from now on. The
    /// motion continues at the same speed. An unknown joint is ignored.
    pub fn attach(&mut self, joint: usize, mass: f64, at: [f64; 3]) {
        if let Some(joint) = self.description.joints.get_mut(joint) {
            joint.body = joint.body.with_point_mass(mass, at);
            self.leg = Leg::new(&self.description).with_blocked(self.blocked);
        }
    }

    /// Blocks a joint at its present angle from now on. An unknown joint is ignored.
    pub fn block(&mut self, joint: usize) {
        if let (Some(blocked), Some(rate)) = (self.blocked.get_mut(joint), self.state.rates.get_mut(joint)) {
            (*blocked, *rate) = (true, 0.0);
            self.leg = self.leg.with_blocked(self.blocked);
        }
    }

    /// Lets the foot stand on the floor (`Floor`) from `delay` s after now, for `duration` s. `foot` is its
    /// position (m) on the last link, in that link's D-H frame.
    pub fn touch(&mut self, foot: [f64; 3], delay: f64, duration: f64) {
        let mut joints = self.description.joints;
        if let Some(last) = joints.last_mut() {
            last.body.com = foot;
        }
        let foot = links_at_reference(&joints).last().map(|link| link.to_centre);
        self.floor = foot.map(|foot| Floor::new(foot, self.time() + delay, duration));
    }

    /// Multiplies every joint's Coulomb level, also at rest, and viscous coefficient from now on.
    pub fn scale_friction(&mut self, factor: f64) {
        for joint in &mut self.description.joints {
            joint.friction.coulomb *= factor;
            joint.friction.viscous *= factor;
            if let Some(stribeck) = &mut joint.friction.stribeck {
                stribeck.static_level *= factor;
            }
        }
        self.leg = Leg::new(&self.description).with_blocked(self.blocked);
    }

    /// Changes the wearer's pushes from now on; `None` stops them.
    pub fn set_pushes(&mut self, pushes: Option<PushDescription>) {
        self.description.pushes = pushes;
        self.pushes.change_habits(pushes, self.time(), N);
    }

    /// Lets the wearer push or kick once from now on: half a sine on one joint, peak in N m, anatomical.
    pub fn push(&mut self, joint: usize, peak: f64, duration: f64) {
        self.pushes.push(joint, peak, self.time(), duration);
    }

    /// Lets a hand hold a joint at its present angle (`Grip`) for `duration` s, with at most `strength` N
    /// m.
    pub fn hold(&mut self, joint: usize, strength: f64, duration: f64) {
        self.grip = Some(Grip::new(joint, strength, self.time(), duration));
    }

    /// Torque of the hand at `time`, N m, anatomical.
    fn gripped(&mut self, time: f64) -> [f64; N] {
        let (position, velocity) = (self.anatomical_position(), self.velocity());
        self.grip.as_mut().map_or([0.0; N], |grip| grip.torque(&position, &velocity, time))
    }

    /// Sets each joint's current noise: standard deviation per logged 500 Hz sample, A.
    pub fn set_current_noise(&mut self, noise: &[f64; N]) {
        for (sensor, noise) in self.current_sensors.iter_mut().zip(noise) {
            sensor.set_noise(*noise);
        }
    }

    /// Runs one servo tick: sets commands, advances, reads sensors.
    pub fn tick(&mut self, command: &DriveCommand<N>) -> Sample<N> {
        self.command(command);
        self.advance();
        self.newest
    }

    /// Advances to the next servo tick; complete drives coast.
    pub fn advance(&mut self) {
        if self.electric.is_some() {
            for _ in 0..PERIODS_PER_TICK {
                self.period(&[AxisCommand::OFF; N], 0.0);
            }
            return self.read_sensors();
        }
        self.decide_muscles();
        let now = self.time();
        let gripped = self.gripped(now);
        let pulse: [f64; N] = self.pushes.torque((self.tick as f64 + 0.5) * TICK_S);
        let pushed: [f64; N] = core::array::from_fn(|joint| pulse[joint] + gripped[joint]);
        let stood: [f64; N] = match &mut self.floor {
            Some(floor) => floor.torque(self.leg.mechanism(), &self.state, now),
            None => [0.0; N],
        };
        let stopped = self.stopped();
        let with_floor = |torque: [f64; N]| -> [f64; N] {
            core::array::from_fn(|joint| torque[joint] + stood[joint] + stopped[joint])
        };
        let from = with_floor(self.joint_torque(&pushed));
        for drive in &mut self.drives {
            drive.advance();
        }
        let to = with_floor(self.joint_torque(&pushed));
        worn::advance(&self.leg, &mut self.wearer, &mut self.state, [&from, &to], TICK_S);
        self.tick += 1;
        self.read_sensors();
    }

    /// Torque of the mechanical end stops now, N m, joint sign.
    fn stopped(&self) -> [f64; N] {
        let (position, velocity) = (self.anatomical_position(), self.velocity());
        core::array::from_fn(|joint| {
            let stops = self.description.joints[joint].stops;
            self.anatomy[joint].flip(end_stop::torque(stops, position[joint], velocity[joint]))
        })
    }

    /// Torque of motors and pushes on the joints, N m, joint sign.
    fn joint_torque(&self, pushed: &[f64; N]) -> [f64; N] {
        let motor = self.motor_torque();
        core::array::from_fn(|joint| self.anatomy[joint].flip(motor[joint] + pushed[joint]))
    }

    fn begin_reading(&mut self) {
        if self.tick.is_multiple_of(TICKS_PER_LOGGED) {
            for sensor in &mut self.current_sensors {
                sensor.begin_logged(&mut self.sensor_faults);
            }
        }
    }

    fn read_sensors(&mut self) {
        self.begin_reading();
        for joint in 0..N {
            let angle = self.anatomy[joint].to_anatomical_angle(self.state.angles[joint]);
            let current =
                self.current_sensors[joint].read(self.drives[joint].current(), &mut self.sensor_noise);
            self.newest.joints[joint] = JointSample {
                encoder_counts: self.encoders[joint].read(self.mounting * angle),
                current: Ampere(current as f32),
                doubtful: false,
            };
        }
    }

    /// True state now. Costs about as much as a tick.
    pub fn truth(&self) -> Truth<N> {
        let state = &self.state;
        let mut torque = self.joint_torque(&[0.0; N]);
        if let Some(wearer) = &self.wearer {
            let interaction: [f64; N] = wearer.interaction(state);
            torque = core::array::from_fn(|joint| torque[joint] + interaction[joint]);
        }
        let acceleration = self.leg.forward_dynamics(state, &torque);
        Truth {
            time_s: self.time(),
            position: self.anatomical_position(),
            velocity: self.velocity(),
            acceleration: core::array::from_fn(|joint| self.anatomy[joint].flip(acceleration[joint])),
            motor_torque: self.motor_torque(),
            sticking: self.sticking(),
        }
    }

    /// Torque of the motors at the joints now, N m, without noise; as in [`Truth`], at no cost. For complete
    /// drives the mean over the last servo tick.
    pub fn motor_torque(&self) -> [f64; N] {
        core::array::from_fn(|joint| {
            let ideal = || self.drives[joint].torque();
            self.mounting * self.electric.as_ref().map_or_else(ideal, |electric| electric.torque()[joint])
        })
    }

    /// Joint angles now, rad, anatomical; as in [`Truth`], at no cost.
    pub fn anatomical_position(&self) -> [f64; N] {
        core::array::from_fn(|joint| self.anatomy[joint].to_anatomical_angle(self.state.angles[joint]))
    }

    /// Joint rates now, rad/s, anatomical; as in [`Truth`], at no cost.
    pub fn velocity(&self) -> [f64; N] {
        core::array::from_fn(|joint| self.anatomy[joint].flip(self.state.rates[joint]))
    }

    /// Joints held by friction now; as in [`Truth`], at no cost.
    pub fn sticking(&self) -> [bool; N] {
        self.state.rates.map(|rate| rate == 0.0)
    }

    /// Motor torque, N m, for a motion (rad, rad/s, rad/s^2), with friction and offset. Dry friction of a
    /// joint at rest is undetermined and omitted.
    pub fn inverse_dynamics(
        &self,
        position: &[f64; N],
        velocity: &[f64; N],
        acceleration: &[f64; N],
    ) -> [f64; N] {
        let anatomy = &self.anatomy;
        let angles = core::array::from_fn(|joint| anatomy[joint].to_joint_angle(position[joint]));
        let rates = core::array::from_fn(|joint| anatomy[joint].flip(velocity[joint]));
        let accelerations = core::array::from_fn(|joint| anatomy[joint].flip(acceleration[joint]));
        let torque = self.leg.inverse_dynamics(&angles, &rates, &accelerations);
        core::array::from_fn(|joint| anatomy[joint].flip(torque[joint]))
    }
}

impl<const N: usize> LegDrives<N> for World<N> {
    /// Sample of the last tick; reading again changes nothing.
    fn sample(&mut self) -> Sample<N> {
        self.newest
    }

    fn command(&mut self, command: &DriveCommand<N>) {
        for (drive, current) in self.drives.iter_mut().zip(command.currents) {
            drive.command(command.enabled, f64::from(current.0));
        }
    }
}
