//! The emergency stop's interrupt may come between any two accesses of a current tick; no bridge is on
//! afterwards.

use std::rc::Rc;

use super::super::super::testing::Stop;
use super::*;
use crate::hal::{CURRENT_RATE_HZ, DriveCommand};
use crate::motor::Calibrator;
use crate::motor::calibration::tests::SETTINGS;
use crate::operation::Order;
use crate::units::Ampere;

/// Ticks of both axes after the stop: 10 ms.
const AFTERWARDS: u32 = 240;

/// A board in operation.
struct Scene {
    loops: CurrentLoops<2>,
    motors: [TestMotor; 2],
    queues: Box<Queues<2>>,
    signals: Rc<Signals<2>>,
    hardware: TestHardware<2>,
    now: u32,
}

impl Scene {
    /// Two calibrated axes at rest, the servo begun.
    fn released() -> Self {
        let bench = Bench::new(&CONFIGURATION);
        Self {
            loops: bench.loops,
            motors: bench.motors,
            queues: Box::new(Queues::new()),
            signals: Rc::new(bench.signals),
            hardware: bench.hardware,
            now: bench.now,
        }
    }

    /// Both axes follow a current.
    fn following() -> Self {
        let mut scene = Self::released();
        scene.signals.set_targets(&DriveCommand { enabled: true, currents: [Ampere(1.0), Ampere(-1.0)] });
        scene.run(60);
        assert_eq!(scene.hardware.bridges.map(|bridge| bridge.enabled), [true; 2]);
        scene
    }

    /// Both axes brake because one counter froze.
    fn braking() -> Self {
        let mut scene = Self::following();
        scene.signals.inhibit.raise(InhibitReason::EncoderFrozen);
        scene.run(60);
        assert_eq!(scene.hardware.bridges, [AxisCommand::BRAKE; 2]);
        scene
    }

    /// One axis is being calibrated with its bridge on; the other is off.
    fn calibrating(axis: usize) -> Self {
        let mut scene = Self::released();
        scene.motors[axis] = TestMotor::default();
        for other in 0..2 {
            *scene.loops.axis_state_mut(other).expect("two axes") = AxisState::OFF;
        }
        let calibrator = Calibrator::new(&CONFIGURATION, SETTINGS).expect("usual");
        let stage = scene.loops.axis_state_mut(axis).expect("two axes");
        assert_eq!(stage.apply_order(Order::Calibrate(calibrator)), None);
        for _ in 0..CURRENT_RATE_HZ {
            scene.run(1);
            if scene.hardware.bridges[axis].enabled {
                return scene;
            }
        }
        panic!("the calibration does not enable its bridge")
    }

    /// An axis' counts jumped: its next tick detects the lost position, and both axes brake.
    fn losing_its_position(axis: usize) -> Self {
        let mut scene = Self::following();
        scene.motors[axis].encoder_zero += 0.25;
        scene.run(1);
        scene
    }

    /// Copies the board and sets the stop `after` accesses from now.
    fn with_stop(&self, after: u32) -> Self {
        let signals = Rc::new(Signals::clone(&self.signals));
        let mut hardware = TestHardware::new();
        hardware.bridges = self.hardware.bridges;
        hardware.stop = Some(Stop::new(&signals, after));
        let (motors, queues) = (self.motors.clone(), self.queues.clone());
        Self { loops: self.loops, motors, queues, signals, hardware, now: self.now }
    }

    fn tick(&mut self, axis: usize) {
        if axis == 0 {
            self.now = self.now.wrapping_add(PERIOD.get());
        }
        let sample = self.motors[axis].period(self.hardware.bridges[axis]);
        let requested = self.hardware.servo_pended;
        let tick = tick_at(self.now, sample);
        self.loops.tick(axis, &tick, &mut self.queues.current(), &self.signals, &mut self.hardware);
        if self.hardware.servo_pended != requested {
            self.signals.statistics.servo_ticks.add();
        }
    }

    fn run(&mut self, periods: u32) {
        (0..periods).for_each(|_| (0..2).for_each(|axis| self.tick(axis)));
    }

    /// Repeats the next tick of `axis` with the stop before each of its accesses.
    fn stop_everywhere(mut self, name: &str, axis: usize) {
        (0..axis).for_each(|before| self.tick(before));
        let mut undisturbed = self.with_stop(u32::MAX);
        undisturbed.tick(axis);
        assert!(undisturbed.hardware.bridges[axis].enabled, "{name}: no bridge is on");
        let accesses = undisturbed.hardware.accesses;
        assert!(accesses >= 3, "{name}: {accesses} accesses");
        for after in 0..accesses {
            let mut scene = self.with_stop(after);
            scene.tick(axis);
            scene.assert_off(name, after, 0);
            (axis + 1..2).for_each(|axis| scene.tick(axis));
            scene.assert_off(name, after, 1);
            for period in 0..AFTERWARDS {
                scene.run(1);
                scene.assert_off(name, after, period + 2);
            }
        }
    }

    fn assert_off(&self, name: &str, after: u32, ticks: u32) {
        let stop = self.hardware.stop.as_ref().expect("placed");
        let state = (stop.handled, stop.enabled_since, self.hardware.is_enabled());
        assert_eq!(state, (true, false, false), "{name}: stop before access {after}, {ticks} ticks later");
    }
}

#[test]
fn a_stop_during_a_tick_leaves_no_bridge_on() {
    for axis in 0..2 {
        for (name, scene) in [
            ("following", Scene::following()),
            ("calibrating", Scene::calibrating(axis)),
            ("braking", Scene::braking()),
        ] {
            scene.stop_everywhere(name, axis);
        }
    }
}

#[test]
fn a_stop_while_an_axis_loses_its_position_leaves_no_bridge_on() {
    for axis in 0..2 {
        let scene = Scene::losing_its_position(axis);
        // That tick makes both axes brake.
        let mut undisturbed = scene.with_stop(u32::MAX);
        (0..=axis).for_each(|axis| undisturbed.tick(axis));
        assert_eq!(undisturbed.signals.inhibit.causes(), InhibitReason::EncoderPosition.bit());
        assert_eq!(undisturbed.hardware.bridges, [AxisCommand::BRAKE; 2]);
        scene.stop_everywhere("losing its position", axis);
    }
}
