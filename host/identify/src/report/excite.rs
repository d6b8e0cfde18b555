//! Properties of a motion before it moves, as plain data: written as JSON, printed as tables.
//!
//! The names of the fields are an interface. An unknown number is `null`, never NaN.

use serde::{Deserialize, Serialize};

use scarab_base::number::Number;

/// Version of the JSON.
pub const SCHEMA: u32 = 1;

/// One base parameter in a motion's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedBase {
    /// Carrying parameter, with an `R` if others are regrouped into it.
    pub name: String,
    /// SI unit.
    pub unit: String,
    /// Value of the assumed leg.
    pub assumed: f64,
    /// Standard deviation that an identification reports; absent if the motion does not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Error without noise: encoder, friction at reversals, lag.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub systematic: Option<f64>,
}

/// Base parameter, compared with a random motion.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedBase {
    /// Entry of the file.
    #[serde(flatten)]
    pub expected: ExpectedBase,
    /// Ratio to the sigma of the best of 300 random motions: two cycles, equal duration and noise in N m.
    pub ratio_to_random: Number,
}

/// Expected result of one of a joint's fourteen parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExpectedParameter {
    /// `XX1`, `IA2`: symbol and joint.
    pub name: String,
    /// Joint, from 1.
    pub joint: usize,
    /// SI unit.
    pub unit: &'static str,
    /// Value of the assumed leg.
    pub assumed: Number,
    /// `identified`, `grouped`, `weak` or `prior`.
    pub status: &'static str,
    /// Standard deviation; unknown unless the parameter is identified alone.
    pub sigma: Number,
    /// Other parameters of its base parameters.
    pub grouped_with: Vec<String>,
}

/// Anatomical motion of one joint, and its limits.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReport {
    /// Name in the leg file.
    pub name: String,
    /// Proved range of the angle, degrees.
    pub angle_deg: [f64; 2],
    /// Allowed range of the angle, degrees.
    pub range_deg: [f64; 2],
    /// Proved speed, degrees per second.
    pub speed_deg_s: f64,
    /// Allowed speed, degrees per second.
    pub speed_limit_deg_s: f64,
    /// Proved acceleration, degrees per second squared.
    pub acceleration_deg_s2: f64,
    /// Allowed acceleration, degrees per second squared.
    pub acceleration_limit_deg_s2: f64,
    /// Smallest and largest torque of the assumed leg, N m.
    pub torque_nm: [f64; 2],
    /// Largest magnitude with the margin, approach included, N m.
    pub torque_with_margin_nm: f64,
    /// Torque allowed by torque limit and current limit, N m.
    pub torque_limit_nm: f64,
    /// Standard deviation of the logged torque, N m.
    pub torque_noise_nm: f64,
    /// Share of the joint's rows excluded at standstill, 0..1.
    pub lost_share: f64,
    /// Extremes of the simulated assumed leg, approach included.
    pub simulated: Seen,
}

/// Extremes of a simulated joint, anatomical.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// Range of the angle, degrees.
    pub(crate) angle_deg: [f64; 2],
    /// Largest speed, degrees per second.
    pub(crate) speed_deg_s: f64,
    /// Largest torque, N m, including friction at a reversal and the position loop.
    pub(crate) torque_nm: f64,
    /// Ticks at which the monitor reduced the torque.
    pub limited_ticks: u32,
}

impl Default for Seen {
    fn default() -> Self {
        Self {
            angle_deg: [f64::INFINITY, f64::NEG_INFINITY],
            speed_deg_s: 0.0,
            torque_nm: 0.0,
            limited_ticks: 0,
        }
    }
}

impl Seen {
    /// Adds one instant: rad, rad/s, N m, and whether the monitor reduced the torque.
    pub fn add(&mut self, position: f64, velocity: f64, torque: f64, limited: bool) {
        self.limited_ticks += u32::from(limited);
        let angle = position.to_degrees();
        self.angle_deg = [self.angle_deg[0].min(angle), self.angle_deg[1].max(angle)];
        self.speed_deg_s = self.speed_deg_s.max(velocity.abs().to_degrees());
        self.torque_nm = self.torque_nm.max(torque.abs());
    }
}

/// Reference of a design.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RandomMotion {
    /// ln det of the information, at the noise of the reference motion.
    pub log_determinant: Number,
    /// Whether the motion keeps the torque limits, margin included, without reduction by the
    /// monitor; random motions need not.
    pub keeps_torque_limits: bool,
}

/// Report of a motion before it moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExciteReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// Fingerprint of the geometry, as in the file.
    pub geometry: String,
    /// `prior` or `truth`: the leg assumed for torque, noise and sigma.
    pub assumed: &'static str,
    /// Seed of the swarm; unknown for a motion from a file.
    pub seed: Option<u64>,
    /// Torque noise in percent of the mean absolute torque on the default motion; zero if only N m
    /// are stated.
    pub torque_noise_percent: f64,
    /// Leg to which the percentage refers: `truth` (simulated leg) or `prior`.
    pub torque_noise_of: &'static str,
    /// Assumed error of each base parameter in the torque bound, percent.
    pub margin_percent: f64,
    /// Duration with blends, s.
    pub duration_s: f64,
    /// Duration of one cycle, s.
    pub period_s: f64,
    /// Cycles.
    pub cycles: u32,
    /// Duration of one blend, s.
    pub blend_s: f64,
    /// ln det of the information of the base parameters, at the noise of the reference motion.
    pub log_determinant: Number,
    /// Best of 300 random motions; two cycles in the same duration, as in the default motion.
    pub random: RandomMotion,
    /// Best of 300 random motions with as many cycles as the design.
    pub random_same_pace: RandomMotion,
    /// Condition number of the scaled, weighted problem.
    pub condition: Number,
    /// Joints, proximal first.
    pub joints: Vec<JointReport>,
    /// Base parameters.
    pub base_parameters: Vec<ComparedBase>,
    /// Fourteen parameters of every joint.
    pub parameters: Vec<ExpectedParameter>,
    /// Warnings to be read before the motion is run.
    pub warnings: Vec<String>,
}
