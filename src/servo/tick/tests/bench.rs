//! Test bench for ticks: two joints in double precision, independent of the servo.
//!
//! Each is an inertia with viscous friction and gravity, a lagging drive and an encoder that counts.

use super::*;

pub(super) const NOWHERE: [f32; 3] = [0.0; 3];
pub(super) const BANDWIDTH: Hertz = Hertz(6.0);

const JOINT: JointConfiguration = JointConfiguration {
    scale: HIP,
    low: Radian(-1.5),
    high: Radian(1.5),
    speed: RadianPerSecond(4.5),
    torque: NewtonMetre(100.0),
    current: Ampere(80.0),
    inertia: KilogramMetreSquared(2.53),
    bandwidth: BANDWIDTH,
};
/// Two independent joints, both with the knee's inertia; the second turns against its drive.
pub(super) const JOINTS: [JointConfiguration; 2] = [JOINT, JointConfiguration { scale: KNEE, ..JOINT }];

/// One joint of the physical world, in its own (anatomical) angle and torque.
#[derive(Clone, Copy)]
pub(super) struct Plant {
    pub(super) inertia: f64,
    pub(super) viscous: f64,
    /// Torque at an angle of 90 degrees.
    pub(super) gravity: f64,
    pub(super) angle: f64,
    pub(super) velocity: f64,
    pub(super) torque: f64,
}

impl Plant {
    pub(super) const KNEE: Self =
        Self { inertia: 2.53, viscous: 3.26, gravity: 0.0, angle: 0.0, velocity: 0.0, torque: 0.0 };

    /// Advances one tick of 0.25 ms in 8 steps; the drive follows its target with 1 ms.
    pub(super) fn advance(&mut self, command: &DriveCommand<2>, joint: usize) {
        let target = if command.enabled { 1.5 * f64::from(command.currents[joint].0) } else { 0.0 };
        for _ in 0..8 {
            let dt = 1.0 / 32_000.0;
            self.torque += (target - self.torque) * dt / 0.001;
            let gravity = self.gravity * sin_cos(self.angle).0;
            self.velocity += (self.torque - gravity - self.viscous * self.velocity) / self.inertia * dt;
            self.angle += self.velocity * dt;
        }
    }

    pub(super) fn sample(&self) -> JointSample {
        let counts = (self.angle * 409_600.0 / TAU).floor() as i32;
        JointSample { encoder_counts: counts, current: Ampere((self.torque / 1.5) as f32), doubtful: false }
    }
}

pub(super) struct Bench {
    pub(super) servo: Servo<2>,
    pub(super) plants: [Plant; 2],
    pub(super) command: DriveCommand<2>,
}

impl Bench {
    pub(super) fn enabled(joints: [JointConfiguration; 2], plant: Plant) -> Self {
        let servo = Servo::new(joints).expect("a sensible configuration");
        let mut bench = Self { servo, plants: [plant; 2], command: DriveCommand::OFF };
        for power in [PowerRequest::Shutdown, PowerRequest::SwitchOn, PowerRequest::EnableOperation] {
            let here = bench.pose();
            bench.tick(MotionState::at_rest(here), None::<&NoModel>, Some(power));
        }
        assert_eq!(bench.servo.state(), DriveState::OperationEnabled);
        bench
    }

    /// Angles of the model: the second joint's have the opposite sign.
    pub(super) fn pose(&self) -> [f32; 2] {
        [self.plants[0].angle as f32, -self.plants[1].angle as f32]
    }

    pub(super) fn sample(&self) -> Sample<2> {
        Sample { joints: self.plants.map(|plant| plant.sample()) }
    }

    pub(super) fn tick<M: TorqueModel<2>>(
        &mut self,
        motion: MotionState<2>,
        feedforward: Option<&M>,
        power: Option<PowerRequest>,
    ) -> ServoOutput<2> {
        let command = ServoCommand { motion, feedforward, power };
        let output = self.servo.tick(&self.sample(), &command, None, NOWHERE);
        // The command computed from this sample acts from the next tick on.
        let acting = core::mem::replace(&mut self.command, *output.drive());
        for (joint, plant) in self.plants.iter_mut().enumerate() {
            plant.advance(&acting, joint);
        }
        output
    }
}
