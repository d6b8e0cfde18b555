//! Samples of a motion for other controllers: CSV, and a ROS 2 trajectory as YAML.
//!
//! Each sample is the state that the servo follows at one of its ticks ([`Periodic::state_at`]), turned into
//! anatomical angles. Nothing is interpolated, so only divisors of the servo's rate are possible. The first
//! and the last sample are at rest; the last step may be shorter than the others.
//!
//! | format | content |
//! | --- | --- |
//! | CSV | `t_s`, per joint `q1_rad`, `qd1_radps`, `qdd1_radps2`: the columns of [`crate::leg::states`] |
//! | YAML | `trajectory_msgs/JointTrajectory`: `joint_names`, `points[]`; rad and s |

use std::fmt::Write;

use scarab::model::AnatomicalJoint;
use scarab::motion::{MotionState, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab_base::error::ToolError;

use crate::formats::excitation::Excitation;
use crate::formats::leg_file::LegFile;
use crate::formats::leg_file::geometry::anatomy;

/// Nanoseconds of a second.
const SECOND_NS: u32 = 1_000_000_000;

/// Rate of samples, a divisor of the servo's rate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SampleRate {
    /// Ticks of the servo between two samples.
    ticks: u32,
}

impl std::str::FromStr for SampleRate {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let divisors = || (1..=SERVO_RATE_HZ).filter(|rate| SERVO_RATE_HZ.is_multiple_of(*rate));
        let Ok(rate) = text.parse::<u32>() else {
            return Err(format!("is not a whole number from 1 to {SERVO_RATE_HZ} Hz"));
        };
        if rate > 0 && SERVO_RATE_HZ.is_multiple_of(rate) {
            return Ok(Self { ticks: SERVO_RATE_HZ / rate });
        }
        let below = divisors().rfind(|divisor| *divisor < rate);
        let above = divisors().find(|divisor| *divisor > rate);
        let near: Vec<_> = below.into_iter().chain(above).map(|rate| format!("{rate} Hz")).collect();
        Err(format!(
            "does not divide the servo's {SERVO_RATE_HZ} Hz, and samples are not interpolated; nearest: {}",
            near.join(", ")
        ))
    }
}

/// State at one tick, anatomical.
struct Sample {
    tick: u32,
    q: Vec<f64>,
    qd: Vec<f64>,
    qdd: Vec<f64>,
}

/// Samples of a motion at a rate.
pub struct MotionSamples {
    joints: Vec<String>,
    samples: Vec<Sample>,
}

impl MotionSamples {
    /// Samples of a leg's motion, from rest to rest.
    ///
    /// # Errors
    /// The motion is invalid, or has another number of joints than the leg.
    pub fn new(leg: &LegFile, motion: &Excitation, rate: SampleRate) -> Result<Self, ToolError> {
        let samples = match leg.joints.len() {
            1 => samples::<1>(leg, &motion.motion()?, rate),
            2 => samples::<2>(leg, &motion.motion()?, rate),
            _ => samples::<3>(leg, &motion.motion()?, rate),
        }?;
        Ok(Self { joints: leg.joints.iter().map(|joint| joint.name.clone()).collect(), samples })
    }

    /// Time of each sample, s.
    pub fn time_s(&self) -> impl Iterator<Item = f64> {
        self.samples.iter().map(|sample| f64::from(sample.tick) / f64::from(SERVO_RATE_HZ))
    }

    /// Angles, speeds and accelerations of all joints at each sample; rad, rad/s, rad/s2.
    pub fn states(&self) -> impl Iterator<Item = [&[f64]; 3]> {
        self.samples.iter().map(|sample| [&sample.q[..], &sample.qd, &sample.qdd])
    }

    /// CSV text.
    pub fn to_csv(&self) -> String {
        let mut text = String::from("t_s");
        (1..=self.joints.len()).for_each(|joint| {
            // Formatting into a String cannot fail.
            let _ = write!(text, ",q{joint}_rad,qd{joint}_radps,qdd{joint}_radps2");
        });
        text.push('\n');
        for (time_s, [q, qd, qdd]) in self.time_s().zip(self.states()) {
            let _ = write!(text, "{time_s}");
            for ((q, qd), qdd) in q.iter().zip(qd).zip(qdd) {
                let _ = write!(text, ",{q},{qd},{qdd}");
            }
            text.push('\n');
        }
        text
    }

    /// YAML text of the message.
    pub fn to_trajectory(&self) -> String {
        // JSON is YAML, so any name is quoted correctly.
        let names: Vec<_> =
            self.joints.iter().map(|name| serde_json::Value::from(name.as_str()).to_string()).collect();
        let mut text = format!("{HEADER}joint_names: [{}]\npoints:\n", names.join(", "));
        for Sample { tick, q, qd, qdd } in &self.samples {
            let (seconds, rest) = (tick / SERVO_RATE_HZ, tick % SERVO_RATE_HZ);
            let _ = writeln!(
                text,
                "- {{positions: {}, velocities: {}, accelerations: {}, time_from_start: {{sec: {seconds}, nanosec: {}}}}}",
                list(q),
                list(qd),
                list(qdd),
                rest * (SECOND_NS / SERVO_RATE_HZ)
            );
        }
        text
    }
}

const HEADER: &str = "\
# trajectory_msgs/JointTrajectory, written by `scarab excite`: anatomical angles in rad. The motion begins and ends
# at rest. Bring the joints to the positions of the first point before this trajectory is sent.
header: {stamp: {sec: 0, nanosec: 0}, frame_id: \"\"}
";

/// Numbers that YAML 1.1 reads as such: with a point, without an exponent.
fn list(numbers: &[f64]) -> String {
    let numbers: Vec<_> = numbers
        .iter()
        .map(|number| {
            let text = number.to_string();
            if text.contains('.') { text } else { text + ".0" }
        })
        .collect();
    format!("[{}]", numbers.join(", "))
}

fn samples<const N: usize>(
    leg: &LegFile,
    motion: &Periodic<N>,
    rate: SampleRate,
) -> Result<Vec<Sample>, ToolError> {
    let anatomy = anatomy::<N>(leg)?;
    let end = motion.duration_ticks();
    let ticks = (0..end).step_by(rate.ticks as usize).chain([end]);
    let sample = |tick: u32| {
        let MotionState { position_rad, velocity_rad_per_s, acceleration_rad_per_s2 } = motion.state_at(tick);
        let turned = |values: [f32; N]| -> Vec<f64> {
            // Adding 0 turns -0 into 0.
            anatomy
                .iter()
                .zip(values)
                .map(|(joint, value)| joint.from_chain(f64::from(value)) + 0.0)
                .collect()
        };
        let angle =
            |(joint, value): (&AnatomicalJoint<f64>, f32)| joint.angle_from_chain(f64::from(value)) + 0.0;
        Sample {
            tick,
            q: anatomy.iter().zip(position_rad).map(angle).collect(),
            qd: turned(velocity_rad_per_s),
            qdd: turned(acceleration_rad_per_s2),
        }
    };
    Ok(ticks.map(sample).collect())
}
