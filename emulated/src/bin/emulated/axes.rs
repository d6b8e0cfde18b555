//! Current loops of both axes, ticked with sensor values of a drive that follows its target.
//!
//! Their commands are discarded: the cost of the loops is real, and their effect on a motor is tested
//! elsewhere. Their calibration is real as well, on a small motor in single precision.

use scarab::hal::{AxisSample, CURRENT_RATE_HZ};
use scarab::motor::{Axis, AxisRequest, CalibrationSettings, CalibrationStep, Calibrator};
use scarab::task::leg::JOINTS;
use scarab::units::{Ampere, KilogramMetreSquared, Volt};

use super::motor::{CONFIGURATION, Motor};

const SETTINGS: CalibrationSettings = CalibrationSettings {
    current: Ampere(10.0),
    voltage: Volt(2.0),
    turns_per_s: 10.0,
    travel_turns: 1.25,
    inertia: KilogramMetreSquared(2e-4),
};
/// Limit in PWM periods; a calibration takes some 20 s.
const LONGEST: u32 = 40 * CURRENT_RATE_HZ;

/// Both axes with their simulated sensors.
pub struct Axes {
    axes: [(Axis, Motor); JOINTS],
    /// Counter after the calibration, and the leg's counts at that time.
    counter: u16,
    begin: [i32; JOINTS],
}

impl Axes {
    /// Calibrates one motor and uses the result for both axes.
    pub fn calibrated(begin: [i32; JOINTS]) -> Option<Self> {
        let mut motor = Motor::at_rest();
        let mut calibrator = Calibrator::new(&CONFIGURATION, SETTINGS).ok()?;
        let mut sample = motor.sample(None);
        for _ in 0..LONGEST {
            match calibrator.tick(&sample) {
                CalibrationStep::Running(command) => sample = motor.period(command),
                CalibrationStep::Refused(_) => return None,
                CalibrationStep::Done(calibration) => {
                    let axis = Axis::new(&CONFIGURATION, &calibration, &sample).ok()?;
                    return Some(Self {
                        axes: [(axis, motor), (axis, motor)],
                        counter: sample.encoder_count,
                        begin,
                    });
                }
            }
        }
        None
    }

    /// Sensor values of the next tick, from counts since the beginning and current of each joint's drive.
    pub fn look(&mut self, counts: [i32; JOINTS], currents: [f32; JOINTS]) -> [AxisSample; JOINTS] {
        let mut samples = [AxisSample::default(); JOINTS];
        for (joint, ((_, motor), sample)) in self.axes.iter_mut().zip(&mut samples).enumerate() {
            let moved = counts[joint].wrapping_sub(self.begin[joint]);
            *sample = motor.seen(self.counter.wrapping_add(moved as u16), currents[joint]);
        }
        samples
    }

    /// Runs one tick of both axes.
    #[inline(always)]
    pub fn tick(&mut self, samples: &[AxisSample; JOINTS], requests: [AxisRequest; JOINTS]) {
        for (((axis, _), sample), request) in self.axes.iter_mut().zip(samples).zip(requests) {
            let _ = core::hint::black_box(axis.tick(sample, request));
        }
    }

    /// Whether an axis has faulted, which these samples never cause.
    pub fn has_fault(&self) -> bool {
        self.axes.iter().any(|(axis, _)| axis.fault().is_some())
    }
}
