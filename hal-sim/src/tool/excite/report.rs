//! What is known of a motion before it moves, as plain data: written as JSON, printed as tables.
//!
//! The names of the fields are an interface. A number that is not known is `null`, never NaN.

use serde::{Deserialize, Serialize};

use crate::tool::report::Number;

/// Version of the JSON.
pub const SCHEMA: u32 = 1;

/// One combination of parameters that torque determines, in a motion's file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ExpectedBase {
    /// The carrying parameter; with an `R` where others are regrouped into it.
    pub name: String,
    /// SI.
    pub unit: String,
    /// Value of the assumed leg.
    pub assumed: f64,
    /// Standard deviation that an identification reports; left out where the motion does not determine it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub sigma: Option<f64>,
    /// Error without any noise: encoder, friction at reversals, lag.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub systematic: Option<f64>,
}

/// The same beside what a random motion gives.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ComparedBase {
    /// As in the file.
    #[serde(flatten)]
    pub expected: ExpectedBase,
    /// Sigma over that from the best of 300 random motions of two cycles in the same duration, at the same noise in N m.
    pub ratio_to_random: Number,
}

/// One of a joint's fourteen parameters.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExpectedParameter {
    /// `XX1`, `IA2`: symbol and joint.
    pub name: String,
    /// Counted from 1.
    pub joint: usize,
    /// SI.
    pub unit: &'static str,
    /// Value of the assumed leg.
    pub assumed: Number,
    /// `identified`, `grouped`, `weak` or `prior`.
    pub status: &'static str,
    /// Standard deviation; unknown unless it will be measured alone.
    pub sigma: Number,
    /// The others of its base parameters.
    pub grouped_with: Vec<String>,
}

/// What one joint does, anatomical.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct JointReport {
    /// Name in the leg file.
    pub name: String,
    /// Proved smallest and largest angle, degrees.
    pub angle_deg: [f64; 2],
    /// Allowed.
    pub range_deg: [f64; 2],
    /// Proved, degrees per second.
    pub speed_deg_s: f64,
    /// Allowed.
    pub speed_limit_deg_s: f64,
    /// Proved, degrees per second squared.
    pub acceleration_deg_s2: f64,
    /// Allowed.
    pub acceleration_limit_deg_s2: f64,
    /// Smallest and largest torque of the assumed leg, N m.
    pub torque_nm: [f64; 2],
    /// Largest magnitude with the margin, the way there included, N m.
    pub torque_with_margin_nm: f64,
    /// Allowed by torque limit and current limit, N m.
    pub torque_limit_nm: f64,
    /// Standard deviation of the logged torque, N m.
    pub torque_noise_nm: f64,
    /// Share of its rows that are left out because it stands still, 0..1.
    pub lost_share: f64,
    /// What the simulated assumed leg did, the way there included.
    pub simulated: Seen,
}

/// Extremes of a simulated joint, anatomical.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Seen {
    /// Degrees.
    pub angle_deg: [f64; 2],
    /// Degrees per second.
    pub speed_deg_s: f64,
    /// N m, what friction at a reversal and the position loop add included.
    pub torque_nm: f64,
    /// Ticks of which the monitor took torque.
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
    /// Takes one instant: rad, rad/s, N m, whether the monitor took torque.
    pub fn add(&mut self, position: f64, velocity: f64, torque: f64, limited: bool) {
        self.limited_ticks += u32::from(limited);
        let angle = position.to_degrees();
        self.angle_deg = [self.angle_deg[0].min(angle), self.angle_deg[1].max(angle)];
        self.speed_deg_s = self.speed_deg_s.max(velocity.abs().to_degrees());
        self.torque_nm = self.torque_nm.max(torque.abs());
    }
}

/// What a design is compared with.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RandomMotion {
    /// ln det of the information, at the noise of the reference motion.
    pub log_determinant: Number,
    /// Whether it keeps the limits of torque, margin included, and is left alone by the monitor; random motions are not
    /// asked to.
    pub keeps_torque_limits: bool,
}

/// Everything that is known of a motion before it moves.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ExciteReport {
    /// [`SCHEMA`].
    pub schema: u32,
    /// Name in the leg file.
    pub leg: String,
    /// Of its geometry, as in the file.
    pub geometry: String,
    /// `prior` or `truth`: what torque, noise and sigma were reckoned for.
    pub assumed: &'static str,
    /// Of the swarm; unknown for a motion from a file.
    pub seed: Option<u64>,
    /// Torque noise in percent of the mean absolute torque on the default motion; zero where only N m are stated.
    pub torque_noise_percent: f64,
    /// Whose torque that is: `truth` (of the simulated leg) or `prior`.
    pub torque_noise_of: &'static str,
    /// How far off each base parameter may be in the torque's bound, percent.
    pub margin_percent: f64,
    /// Blends included, s.
    pub duration_s: f64,
    /// One cycle, s.
    pub period_s: f64,
    /// Cycles.
    pub cycles: u32,
    /// One blend, s.
    pub blend_s: f64,
    /// ln det of the information of the base parameters, at the noise of the reference motion.
    pub log_determinant: Number,
    /// The best of 300 random motions, two cycles in the same duration as the default one.
    pub random: RandomMotion,
    /// The best of 300 with as many cycles as the design has.
    pub random_same_pace: RandomMotion,
    /// Of the scaled, weighted problem.
    pub condition: Number,
    /// Proximal first.
    pub joints: Vec<JointReport>,
    /// Every sum that torque tells.
    pub base_parameters: Vec<ComparedBase>,
    /// All fourteen of every joint.
    pub parameters: Vec<ExpectedParameter>,
    /// What to know before it moves.
    pub warnings: Vec<String>,
}
