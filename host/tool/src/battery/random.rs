//! Random legs that move: clean recordings with known truth, and one fault in each.
//!
//! One to three joints with parallel and abduction axes, with and without a prior; 50 to 1,000 Hz, 1 to 15 %
//! torque noise, 10 to 300 s. All numbers follow from the seed.

use std::f64::consts::{FRAC_PI_2, TAU};

use scarab_base::error::ToolError;
use scarab_base::random::Random;
use scarab_identify::{JointSeries, LegFile, Recording};

use crate::battery::damage::{delay, interpolated};
use crate::battery::dynamics::{Chain, State, Values, truth};
use crate::battery::outcome::{Base, Task};

/// Harmonics of a joint's motion.
const HARMONICS: usize = 5;
/// Angle of one count of the default encoder, rad.
const COUNT_RAD: f64 = TAU / (8192.0 * 50.0);
/// States at which a model's torque is compared with the true one.
const COMPARED: usize = 1500;

/// A leg, its motion, and what a logger records of it.
#[derive(Clone, Debug)]
pub(super) struct Sample {
    /// True values of the parameters.
    pub(super) truth: Values,
    /// Size of the leg, noise and fault in words.
    pub(super) fault: String,
    /// Faulted joint, from 1.
    pub(super) joint: Option<usize>,
    /// Size of the fault, SI units or share.
    pub(super) size: f64,
    /// Leg as recorded, and as the leg file states it.
    leg: LegFile,
    stated: LegFile,
    states: Vec<State>,
    torques: Vec<Vec<f64>>,
    recorded: Recording,
}

impl Sample {
    /// Clean sample of a seed with this number of joints at least; with parallel axes only if asked.
    pub(super) fn new(seed: u64, least_joints: usize, is_parallel: bool) -> Result<Self, ToolError> {
        let random = &mut Random::new("random", seed);
        let joints = (1 + random.below(3) as usize).max(least_joints);
        let mut leg = leg(random, joints, is_parallel)?;
        let rate_hz = [50.0, 100.0, 200.0, 250.0, 500.0, 1000.0][random.below(6) as usize];
        let is_long = random.below(8) == 0;
        let duration_s =
            if is_long { random.logarithmic(60.0, 300.0) } else { random.logarithmic(10.0, 60.0) };
        let rate_hz = if is_long { f64::min(rate_hz, 250.0) } else { rate_hz };
        let noise = random.logarithmic(0.01, 0.15);
        let is_exact = random.coin();
        let time_s: Vec<f64> = (0..(rate_hz * duration_s) as usize).map(|k| k as f64 / rate_hz).collect();
        let motions: Vec<_> = (0..joints).map(|_| motion(random, &time_s)).collect();
        let of_order = |sample: usize, order: usize| motions.iter().map(|m| m[order][sample]).collect();
        let states: Vec<State> = (0..time_s.len())
            .map(|sample| [of_order(sample, 0), of_order(sample, 1), of_order(sample, 2)])
            .collect();
        let truth = truth(&leg);
        let chain = Chain::new(&leg, &truth);
        let torques: Vec<Vec<f64>> = states.iter().map(|state| chain.torque(state, [0.0; 3])).collect();
        let series = (0..joints).map(|joint| {
            let mean = torques.iter().map(|torque| torque[joint].abs()).sum::<f64>() / torques.len() as f64;
            let peak = torques.iter().fold(0.0_f64, |peak, torque| peak.max(torque[joint].abs()));
            leg.joints[joint].torque_limit_nm = (1.5 * peak).clamp(0.1, 1000.0);
            let counted = |angle: f64| if is_exact { angle } else { (angle / COUNT_RAD).round() * COUNT_RAD };
            JointSeries {
                position_rad: states.iter().map(|state| counted(state[0][joint])).collect(),
                torque_nm: torques
                    .iter()
                    .map(|torque| torque[joint] + noise * mean * random.normal())
                    .collect(),
            }
        });
        let recorded =
            Recording { file: "random.csv".into(), joints: series.collect(), joints_in_file: joints, time_s };
        let prior = if leg.joints[0].prior.is_some() { "prior" } else { "no prior" };
        let axes = if leg.joints.iter().any(|joint| joint.dh.alpha != 0.0) { ", abduction" } else { "" };
        let percent = 100.0 * noise;
        let fault =
            format!("{joints} joints{axes}, {prior}, {rate_hz} Hz, {duration_s:.0} s, noise {percent:.1} %");
        Ok(Self { truth, fault, joint: None, size: 0.0, stated: leg.clone(), leg, states, torques, recorded })
    }

    /// What the leg file states, and what is recorded.
    #[cfg(test)]
    pub(super) fn files(&self) -> (&LegFile, &Recording) {
        (&self.stated, &self.recorded)
    }

    /// Files and options of the replay.
    pub(super) fn task(&self) -> Task {
        let stated = LegFile {
            joints: self
                .stated
                .joints
                .iter()
                .cloned()
                .map(|joint| scarab_identify::JointFile { truth: None, ..joint })
                .collect(),
            ..self.stated.clone()
        };
        let leg = stated.to_toml();
        let empty = Task { leg, options: "--split 0.67".into(), ..Task::default() };
        Task { training: vec![Default::default()], ..empty }.with(std::slice::from_ref(&self.recorded))
    }

    /// Largest error of a joint's torque by these parameters, share of the rms of the true one.
    pub(super) fn torque_error(&self, bases: &[Base]) -> f64 {
        let carried = |base: &Base| Some((base.name.trim_end_matches('R').to_owned(), base.value?));
        let model = Chain::new(&self.stated, &bases.iter().filter_map(carried).collect());
        let joints = self.leg.joints.len();
        let mut sums = vec![[0.0_f64; 2]; joints];
        let every = (self.states.len() / COMPARED).max(1);
        for (state, torque) in self.states.iter().zip(&self.torques).step_by(every) {
            let predicted = model.torque(state, [0.0; 3]);
            for joint in 0..joints {
                sums[joint][0] += (predicted[joint] - torque[joint]).powi(2);
                sums[joint][1] += torque[joint].powi(2);
            }
        }
        sums.iter().map(|[error, power]| (error / power).sqrt()).fold(0.0, f64::max)
    }

    /// Injects one fault with a size from this range, of either sign.
    pub(super) fn inject(&mut self, kind: &str, range: &[f64], seed: u64) {
        let random = &mut Random::new(kind, seed);
        let (joints, count) = (self.leg.joints.len(), self.states.len());
        let joint = (random.below(joints as u64) as usize)
            .max(usize::from(["length", "coupled_drive"].contains(&kind)));
        let other = (joint + 1) % joints;
        let sign = random.sign();
        let size =
            sign * range.iter().copied().reduce(|low, high| random.logarithmic(low, high)).unwrap_or(1.0);
        let (at, rate_hz) = (random.uniform(0.3, 0.7), random.logarithmic(0.1, 1.0));
        let (states, torques) = (&self.states, &self.torques);
        let rms = (torques.iter().map(|torque| torque[joint].powi(2)).sum::<f64>() / count as f64).sqrt();
        let fastest = states.iter().fold(0.0_f64, |most, state| most.max(state[1][joint].abs()));
        let [coulomb, viscous] = ["FC", "FV"].map(|name| self.truth[&format!("{name}{}", joint + 1)]);
        let rigid: Values =
            self.truth.clone().into_iter().filter(|(name, _)| !"FIO".contains(&name[..1])).collect();
        let [swaying, weight] = [&self.truth, &rigid].map(|values| Chain::new(&self.leg, values));
        let rest = vec![0.0; joints];
        let (all, time_s) = (&mut self.recorded.joints, &mut self.recorded.time_s);
        for k in 0..count {
            let (torque, share, rate) = (torques[k][joint], k as f64 / count as f64, states[k][1][joint]);
            all[joint].torque_nm[k] += match kind {
                "gain" => size * all[joint].torque_nm[k],
                "crosstalk" => size * torques[k][other],
                "load_friction" => {
                    let friction = coulomb * rate.signum() + viscous * rate;
                    size.abs() * rate.signum() * (torque - friction).abs()
                }
                "spring" => size.abs() * rms * states[k][0][joint],
                "offset_drift" => size * rms * share,
                "gain_drift" => size * share * torque,
                "friction_drift" => size * share * (coulomb * rate.signum() + viscous * rate),
                "offset_step" if share > at => size * rms,
                "speed_loss" => size.abs() * (rate / fastest).powi(2) * torque,
                "magnitude" => all[joint].torque_nm[k].abs() - all[joint].torque_nm[k],
                _ => 0.0,
            };
            all[joint].position_rad[k] *= if kind == "encoder_scale" { 1.0 + size } else { 1.0 };
            let (sine, cosine) = (TAU * rate_hz * time_s[k]).sin_cos();
            let lean =
                [sine, TAU * rate_hz * cosine, -(TAU * rate_hz).powi(2) * sine].map(|part| size * part);
            let mut add = |more: Vec<f64>, sign: f64| {
                (0..joints).for_each(|joint| all[joint].torque_nm[k] += sign * more[joint])
            };
            match kind {
                "no_gravity" => {
                    add(weight.torque(&[states[k][0].clone(), rest.clone(), rest.clone()], [0.0; 3]), -1.0)
                }
                "sway" => {
                    add(swaying.torque(&states[k], lean), 1.0);
                    add(torques[k].clone(), -1.0);
                }
                "absolute_angle" => {
                    (1..joints).for_each(|joint| all[joint].position_rad[k] += all[joint - 1].position_rad[k])
                }
                "coupled_drive" => all[joint - 1].torque_nm[k] += size.signum() * all[joint].torque_nm[k],
                _ => {}
            }
        }
        let each = |all: &mut [JointSeries], change: &dyn Fn(&mut Vec<f64>)| {
            all.iter_mut().flat_map(|joint| [&mut joint.position_rad, &mut joint.torque_nm]).for_each(change);
        };
        match kind {
            "delay" => delay(time_s, &mut all[joint].torque_nm, size),
            "two_clocks" => all.iter_mut().for_each(|joint| {
                joint.torque_nm = interpolated(time_s, &joint.torque_nm, |time| time * (1.0 + size));
            }),
            "length" => self.stated.joints[joint].dh.a *= 1.0 + size,
            "clock" => {
                let factor = [0.5, 0.8, 1.25, 2.0, 1.0 + size][random.below(5) as usize];
                time_s.iter_mut().for_each(|time| *time *= factor);
            }
            "dropped_rows" => {
                let kept: Vec<bool> = (0..count).map(|_| random.uniform(0.0, 1.0) > size.abs()).collect();
                each(all, &|values| {
                    let mut kept = kept.iter();
                    values.retain(|_| kept.next() == Some(&true));
                });
                time_s.truncate(kept.iter().filter(|kept| **kept).count());
            }
            "zero_rows" => each(all, &|values| {
                values.iter_mut().step_by(size.abs() as usize).for_each(|value| *value = 0.0);
            }),
            "per_mille" => all.iter_mut().zip(&self.leg.joints).for_each(|(joint, stated)| {
                let per_mille = 1000.0 / (size.abs() * stated.torque_limit_nm);
                joint.torque_nm.iter_mut().for_each(|torque| *torque *= per_mille);
            }),
            _ => {}
        }
        self.joint = Some(joint + 1);
        self.size = if ["spring", "offset_drift"].contains(&kind) { size * rms } else { size };
        self.fault += &format!("; {kind} {size:.4}, joint {}", joint + 1);
    }
}

/// Leg with truth, and with a prior for every second one.
fn leg(random: &mut Random, joints: usize, is_parallel: bool) -> Result<LegFile, ToolError> {
    let scale = random.logarithmic(0.05, 1.5);
    let has_prior = random.coin();
    let has_abduction = !is_parallel && random.below(3) == 0;
    let mut text = format!("name = \"random\"\ngravity = [9.81, {:?}, 0.0]\n", random.uniform(-1.0, 1.0));
    let mut weight_nm = 0.0;
    for joint in (0..joints).rev() {
        let is_across = has_abduction && joint == 1;
        let alpha = if is_across { random.sign() * FRAC_PI_2 } else { 0.0 };
        let a = match joint {
            0 => 0.0,
            1 if is_across => random.uniform(0.0, 0.1),
            _ => random.uniform(0.2, 0.5),
        };
        let mass = scale * random.uniform(2.0, 8.0);
        let com = [random.uniform(0.1, 0.3), random.uniform(-0.04, 0.04), random.uniform(-0.04, 0.04)];
        weight_nm += 9.81 * mass * (com[0] + a);
        let [x, y, z] = [(0.1, 0.5), (0.05, 0.15), (0.05, 0.15)].map(|(low, high)| random.uniform(low, high));
        let inertia =
            [y * y + z * z, 0.0, 0.0, x * x + z * z, 0.0, x * x + y * y].map(|square| mass * square / 12.0);
        let rotor = mass * random.uniform(0.0, 0.08);
        let friction = [0.02, 0.02].map(|low| weight_nm * random.logarithmic(low, 0.2));
        let offset = weight_nm * random.uniform(-0.03, 0.03);
        let body = |name: &str, random: &mut Random, spread: f64, offset: f64| {
            let mut vary = |value: f64| value * random.uniform(1.0 - spread, 1.0 + spread);
            let share = vary(1.0);
            format!(
                "{name} = {{ mass = {:?}, com = {:?}, inertia_com = {:?}, rotor_inertia = {:?}, coulomb = {:?}, \
                 viscous = {:?}, offset = {offset:?} }}\n",
                mass * share,
                com.map(&mut vary),
                inertia.map(|element| share * element),
                vary(rotor),
                vary(friction[0]),
                vary(friction[1]),
            )
        };
        let true_body = body("truth", random, 0.0, offset);
        let prior = if has_prior { body("prior", random, 0.2, 0.0) } else { String::new() };
        let block = format!(
            "[[joint]]\nname = \"j{}\"\ndh = {{ alpha = {alpha:?}, a = {a:?}, d = 0.0 }}\n{true_body}{prior}",
            joint + 1
        );
        let head = text.find("[[joint]]").unwrap_or(text.len());
        text.insert_str(head, &block);
    }
    Ok(LegFile::parse(&text, "random leg")?)
}

/// Angle, rate and acceleration of one joint: a Fourier series of random period, amplitudes and phases.
fn motion(random: &mut Random, time_s: &[f64]) -> [Vec<f64>; 3] {
    let base = TAU / random.uniform(4.0, 10.0);
    let (centre, reach) = (random.uniform(-0.6, 0.6), random.uniform(0.4, 1.2));
    let waves: Vec<[f64; 3]> = (1..=HARMONICS)
        .map(|k| [random.uniform(0.3, 1.0) / k as f64, base * k as f64, random.uniform(0.0, TAU)])
        .collect();
    let sum: f64 = waves.iter().map(|wave| wave[0]).sum();
    let of_order = |order: i32| {
        let value = |time: &f64| {
            let wave = |[size, rate, phase]: &[f64; 3]| {
                size * rate.powi(order) * (rate * time + phase + FRAC_PI_2 * f64::from(order)).sin()
            };
            reach / sum * waves.iter().map(wave).sum::<f64>() + if order == 0 { centre } else { 0.0 }
        };
        time_s.iter().map(value).collect()
    };
    [of_order(0), of_order(1), of_order(2)]
}
