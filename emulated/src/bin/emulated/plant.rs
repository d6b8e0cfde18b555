//! Level 0: both axes' current ticks, and once per servo tick the plant's 250 us, which cost no firmware
//! time.
//!
//! The order is that of the simulation on the host. The servo's command of this tick acts until the next;
//! then the sensors are read and the servo is pended. The operator's actions are simulated here, on the same
//! ticks as there: enable, then identify.

use heapless::spsc::{Consumer, Producer};
use scarab::hal::{AxisSample, CURRENT_RATE_HZ, DriveCommand, JointSample, LegDrives, Sample};
use scarab::leg::{ControlRequest, DriveState, PowerRequest};
use scarab::servo::SERVO_RATE_HZ;
use scarab::task::SIGNALS;
use scarab::task::leg::JOINTS;
use scarab::units::Ampere;

use super::axes::Axes;
use super::rehearsal::Start;
use super::{clock, end, refuse, vectors};
use hal_sim::world::World;

/// Leg description that `cargo emulate` writes from a leg file.
mod described {
    include!(env!("SCARAB_PLANT_SOURCE"));
}

const TICKS_PER_SERVO: u32 = CURRENT_RATE_HZ / SERVO_RATE_HZ;
/// Limit of a run; no identification takes longer.
const LONGEST_TICKS: u32 = 300 * SERVO_RATE_HZ;
/// Ticks after a fault, for its records.
const LAST_TICKS: u32 = SERVO_RATE_HZ / 2;
/// Operator's requests, one per servo tick; the first tick has none.
const REQUESTS: [ControlRequest; 4] = [
    ControlRequest::Power(PowerRequest::Shutdown),
    ControlRequest::Power(PowerRequest::SwitchOn),
    ControlRequest::Power(PowerRequest::EnableOperation),
    ControlRequest::Identify,
];

/// State of level 0.
pub struct Plant {
    world: World<JOINTS>,
    axes: Axes,
    samples: [Producer<'static, JointSample>; JOINTS],
    requests: Producer<'static, ControlRequest>,
    drive: Consumer<'static, DriveState>,
    /// Present sensor values.
    seen: Sample<JOINTS>,
    /// Values of converters and counters in the six PWM periods until the next servo tick.
    ahead: [[AxisSample; JOINTS]; TICKS_PER_SERVO as usize],
    servo_ticks: u32,
    answered: u32,
    /// Servo tick after which the run ends.
    last: u32,
    /// Kind of start, which decides the operator's actions.
    start: Start,
    /// Servo tick at which the operator began.
    began: u32,
}

/// State of level 0, after it is built.
pub static PLANT: spin::Mutex<Option<Plant>> = spin::Mutex::new(None);

impl Plant {
    /// The described leg in its start position; `None` if the axes cannot be calibrated.
    pub fn new(
        samples: [Producer<'static, JointSample>; JOINTS],
        requests: Producer<'static, ControlRequest>,
        drive: Consumer<'static, DriveState>,
        start: Start,
    ) -> Option<Self> {
        let mut world = World::new(&described::PLANT, described::SEED);
        world.set_current_noise(&described::CURRENT_NOISE_A);
        world.place(&described::START_RAD);
        let sample = world.sample();
        let axes = Axes::calibrated(sample.joints.map(|joint| joint.encoder_counts))?;
        let mut plant = Self {
            world,
            axes,
            samples,
            requests,
            drive,
            seen: sample,
            ahead: [[AxisSample::default(); JOINTS]; TICKS_PER_SERVO as usize],
            servo_ticks: 0,
            answered: 0,
            last: LONGEST_TICKS,
            start,
            began: 0,
        };
        plant.look_ahead(&sample);
        Some(plant)
    }

    fn tick(&mut self) {
        let place = clock::tick() % TICKS_PER_SERVO;
        if place == 0 {
            clock::stopped(|| self.advance());
            self.call_servo();
        }
        if let Some(samples) = self.ahead.get(place as usize) {
            let begun = clock::instructions();
            self.axes.tick(samples, [SIGNALS.target(0), SIGNALS.target(1)]);
            let statistics = &SIGNALS.statistics;
            statistics.current_ticks.iter().for_each(|ticks| ticks.add());
            statistics.current_worst.raise(clock::instructions().wrapping_sub(begun));
        }
    }

    /// Prepares the next periods; between two servo ticks the rotors turn evenly.
    fn look_ahead(&mut self, before: &Sample<JOINTS>) {
        // The leg file's noise belongs to the log, not to the shunts.
        let currents = core::array::from_fn(|joint| SIGNALS.target(joint).current.0);
        for (samples, way) in self.ahead.iter_mut().zip(1..) {
            let counts = core::array::from_fn(|joint| {
                let (from, to) =
                    (before.joints[joint].encoder_counts, self.seen.joints[joint].encoder_counts);
                from + (to - from) * way / TICKS_PER_SERVO as i32
            });
            *samples = self.axes.look(counts, currents);
        }
    }

    /// Advances to the next servo tick.
    fn advance(&mut self) {
        if self.servo_ticks > 0 {
            let requests = [SIGNALS.target(0), SIGNALS.target(1)];
            let enabled = requests.iter().all(|request| request.enabled);
            let currents =
                requests.map(|request| if request.enabled { request.current } else { Ampere::ZERO });
            let sample = self.world.tick(&DriveCommand { enabled, currents });
            let before = core::mem::replace(&mut self.seen, sample);
            self.look_ahead(&before);
        }
        for (queue, sample) in self.samples.iter_mut().zip(self.seen.joints) {
            // A servo that does not fetch its sample counts as missed.
            let _ = queue.enqueue(sample);
        }
        self.operate();
        while let Some(state) = self.drive.dequeue() {
            if matches!(state, DriveState::Fault { .. }) {
                self.last = self.last.min(self.servo_ticks + LAST_TICKS);
            }
        }
        self.servo_ticks += 1;
        if self.axes.has_fault() {
            refuse("an axis turned its bridge off");
        }
        if self.servo_ticks > self.last {
            end(false);
        }
    }

    /// Performs the operator's actions of this tick.
    fn operate(&mut self) {
        if self.start.resets(self.servo_ticks) {
            SIGNALS.inhibit.reset();
            let _ = self.requests.enqueue(ControlRequest::Power(PowerRequest::ResetFault));
            self.began = self.servo_ticks;
        } else if let Some(index) = (self.servo_ticks - self.began).checked_sub(1)
            && let Some(request) = REQUESTS.get(index as usize)
        {
            let _ = self.requests.enqueue(*request);
        }
        self.start.act(self.servo_ticks);
    }

    fn call_servo(&mut self) {
        let answered = SIGNALS.statistics.servo_ticks.get();
        if answered == self.answered && self.servo_ticks > 1 {
            SIGNALS.statistics.servo_missed.add();
        }
        self.answered = answered;
        vectors::pend_servo();
    }
}

/// Builds the plant in its place.
#[inline(never)]
pub fn prepare(
    samples: [Producer<'static, JointSample>; JOINTS],
    requests: Producer<'static, ControlRequest>,
    drive: Consumer<'static, DriveState>,
    start: Start,
) {
    let Some(plant) = Plant::new(samples, requests, drive, start) else {
        refuse("the axes cannot be calibrated")
    };
    if let Some(mut home) = PLANT.try_lock() {
        *home = Some(plant);
    }
}

/// Interrupt of SysTick.
#[inline(always)]
pub fn interrupt() {
    if let Some(mut plant) = PLANT.try_lock()
        && let Some(plant) = plant.as_mut()
    {
        plant.tick();
    }
}
