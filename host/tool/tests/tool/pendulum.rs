//! Pendulum with an analytic recording: torque in closed form, any stamps, a little noise.

use crate::command::base;
use scarab::real::sin_cos;
use scarab_base::random::Random;
use serde_json::Value;
use std::f64::consts::TAU;
use std::fmt::Write as _;

/// Base parameters of the pendulum as reports name them, SI.
pub const TRUTH: [(&str, f64); 6] =
    [("ZZ1R", 0.8), ("HX1", 1.5), ("HY1", 0.1), ("FC1", 0.6), ("FV1", 0.3), ("OFF1", 0.2)];

/// Leg file without truth and prior; `more` holds further keys of its joint.
pub fn leg(more: &str) -> String {
    format!(
        "name = \"pendulum\"\ngravity = [9.81, 0.0, 0.0]\n[[joint]]\nname = \"only\"\n\
         dh = {{ alpha = 0.0, a = 0.0, d = 0.0 }}\nrange_deg = [-200.0, 200.0]\n{more}"
    )
}

/// Fails unless every base parameter is right; returns the largest error in sigma.
///
/// Tolerance: noise of one recording, 3.5 sigma in the worst of six parameters. The effects of the
/// filter's passband (flat to 1.6e-4) and of resampling are added.
pub fn finds_the_truth(report: &Value) -> f64 {
    let errors = TRUTH.map(|(name, truth)| {
        let (error, sigma) = (base(report, name, "value") - truth, base(report, name, "sigma"));
        assert!(error.abs() < 3.5 * sigma + 3e-4 * truth, "{name}: error {error}, sigma {sigma}");
        // Noise of 0.2 N m on 15 N m; at 137 Hz the scatter over segments is up to twice as large.
        assert!(sigma < 0.1 * truth, "{name}: sigma {sigma}");
        error.abs() / sigma
    });
    errors.into_iter().fold(0.0, f64::max)
}

/// Motion and recording of the pendulum.
#[derive(Clone, Copy)]
pub struct Motion {
    /// Centre of the swing, rad. The reversal has at least 20 rad/s2, so hardly any time is spent
    /// near standstill.
    pub centre: f64,
    /// Nominal rate, Hz.
    pub rate_hz: f64,
    /// Largest error of a stamp, s.
    pub jitter_s: f64,
    /// Half the range of the torque's noise, N m.
    pub noise_nm: f64,
    /// Sign of anatomical angle and torque relative to the joint's, after subtraction of the zero
    /// offset (rad).
    pub direction: f64,
    pub zero_offset: f64,
    pub seed: u64,
}

impl Default for Motion {
    fn default() -> Self {
        Self {
            centre: 0.4,
            rate_hz: 500.0,
            jitter_s: 0.0,
            noise_nm: 0.2,
            direction: 1.0,
            zero_offset: 0.0,
            seed: 1,
        }
    }
}

impl Motion {
    /// Rows `t,q,tau` of ten seconds.
    pub fn samples(&self) -> Vec<[f64; 3]> {
        let mut random = Random::new("pendulum", self.seed);
        let [inertia, hx, hy, coulomb, viscous, offset] = TRUTH.map(|(_, value)| value);
        (0..(10.0 * self.rate_hz) as u32)
            .map(|sample| {
                let time = f64::from(sample) / self.rate_hz + self.jitter_s * random.uniform(-1.0, 1.0);
                let (mut q, mut qd, mut qdd) = (self.centre, 0.0, 0.0);
                for (amplitude, frequency, phase) in [(1.2, 0.9, 0.0), (0.15, 1.7, 1.0)] {
                    let speed = TAU * frequency;
                    let (sine, cosine) = sin_cos(speed * time + phase);
                    q += amplitude * sine;
                    qd += amplitude * speed * cosine;
                    qdd -= amplitude * speed * speed * sine;
                }
                let (sine, cosine) = sin_cos(q);
                let torque = inertia * qdd
                    + 9.81 * (hx * sine + hy * cosine)
                    + coulomb * qd.signum()
                    + viscous * qd
                    + offset
                    + self.noise_nm * random.uniform(-1.0, 1.0);
                [time, self.direction * (q - self.zero_offset), self.direction * torque]
            })
            .collect()
    }

    /// CSV text of the recording.
    pub fn csv(&self) -> String {
        csv(&self.samples())
    }
}

pub fn csv(samples: &[[f64; 3]]) -> String {
    let mut text = String::from("t_s,q1_rad,tau1_Nm\n");
    for [time, angle, torque] in samples {
        writeln!(text, "{time:.7},{angle:.9},{torque:.7}").expect("memory");
    }
    text
}
