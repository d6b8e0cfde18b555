//! A simulated leg that its drives cannot hold: too much weight for the torque limit, or shaking.
//!
//! Why: a file without rotor inertia and friction describes joints that no drive moves. The position loop of
//! such a leg shakes, and the tests of the verdict name contact or errors of the torque instead.
//!
//! ```text
//! weight_i     largest |torque| that holds the commanded posture of joint i
//! deviation_i  rms over a second of (qd_i - command_i), the largest of the run
//! limit_i      half of rms(command_i) over the run, at least 0.05 rad/s
//! ```

use hal_sim::world::{TICK_S, World};
use scarab::ident::Reason;
use scarab::model::AnatomicalJoint;
use scarab::motion::MotionState;
use scarab::real::sqrt;
use scarab_base::number::Number;
use scarab_identify::formats::leg_file::LegFile;
use scarab_identify::report::RunReport;
use scarab_identify::report::findings::FindingReport;

/// Share of the command's speed that a leg may deviate.
const LARGEST_SHARE: f64 = 0.5;
/// Deviation that is harmless whatever the command, rad/s.
const HARMLESS_RAD_S: f64 = 0.05;
/// Ticks of a second, and between two postures whose weight is computed.
const WINDOW: u64 = (1.0 / TICK_S) as u64;
const STRIDE: u64 = 40;

/// Speed of each joint beside its command, and the weight of the commanded postures.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Shaking<const N: usize> {
    anatomy: [AnatomicalJoint<f64>; N],
    before: Option<[f64; N]>,
    ticks: u64,
    /// Sums of squares of the present second.
    window: [f64; N],
    largest: [f64; N],
    command: [f64; N],
    weight_nm: [f64; N],
}

impl<const N: usize> Shaking<N> {
    /// Begins without ticks.
    pub fn new(anatomy: [AnatomicalJoint<f64>; N]) -> Self {
        let none = [0.0; N];
        let (window, largest, command, weight_nm) = (none, none, none, none);
        Self { anatomy, before: None, ticks: 0, window, largest, command, weight_nm }
    }

    /// Takes the plant after a tick, and the motion commanded in it.
    pub(crate) fn take(&mut self, world: &World<N>, motion: &MotionState<N>) {
        let now = world.anatomical_position();
        if let Some(before) = self.before.replace(now) {
            for joint in 0..N {
                let command = self.anatomy[joint].from_chain(f64::from(motion.velocity_rad_per_s[joint]));
                let speed = (now[joint] - before[joint]) / TICK_S;
                self.window[joint] += (speed - command) * (speed - command);
                self.command[joint] += command * command;
            }
        }
        if self.ticks.is_multiple_of(STRIDE) {
            let posture = core::array::from_fn(|joint| {
                self.anatomy[joint].angle_from_chain(f64::from(motion.position_rad[joint]))
            });
            let needed = world.inverse_dynamics(&posture, &[0.0; N], &[0.0; N]);
            self.weight_nm = core::array::from_fn(|joint| self.weight_nm[joint].max(needed[joint].abs()));
        }
        self.ticks += 1;
        if self.ticks.is_multiple_of(WINDOW) {
            self.close();
        }
    }

    /// Ends a second.
    fn close(&mut self) {
        let ticks = (self.ticks - 1) % WINDOW + 1;
        for (largest, sum) in self.largest.iter_mut().zip(&mut self.window) {
            *largest = largest.max(sqrt(core::mem::take(sum) / ticks as f64));
        }
    }

    /// Joint that shakes most beyond its limit, from 0, with deviation and limit, rad/s.
    fn worst(&self) -> Option<(usize, f64, f64)> {
        let limit = |joint: usize| {
            let command: f64 = sqrt(self.command[joint] / self.ticks.max(1) as f64);
            (LARGEST_SHARE * command).max(HARMLESS_RAD_S)
        };
        let all = (0..N).map(|joint| (joint, self.largest[joint], limit(joint)));
        let beyond = all.filter(|(_, deviation, limit)| deviation > limit);
        beyond.max_by(|one, other| (one.1 / one.2).total_cmp(&(other.1 / other.2)))
    }

    /// Adds the cause to a refused run: a weight above the torque limit, or shaking where the file lacks what
    /// damps it.
    pub fn explain(mut self, simulated: &LegFile, run: &mut RunReport) {
        if run.accepted() {
            return;
        }
        if self.ticks > 0 {
            self.close();
        }
        let heavy = simulated
            .joints
            .iter()
            .zip(self.weight_nm)
            .position(|(joint, weight)| weight > joint.torque_cap());
        let lacks = lacking(simulated);
        let (test, joint, value, limit, words) = if let Some(joint) = heavy {
            let (weight, limit) = (self.weight_nm[joint], simulated.joints[joint].torque_cap());
            let words = format!(
                "joint {} needs up to {weight:.1} N m to hold its weight on these motions, limit {limit:.1} N m \
                 (`torque_limit_nm`): raise it, narrow `range_deg`, or correct `truth`",
                joint + 1
            );
            ("weight", joint, weight, limit, words)
        } else if let (Some((joint, deviation, limit)), false) = (self.worst(), lacks.is_empty()) {
            let words = format!(
                "the simulated leg shakes: for a second the speed of joint {} is {:.0} degrees/s beside its command (rms), \
                 limit {:.0}; {}. No drive is without both, and the position loop needs them: state those of the drive in \
                 `truth`",
                joint + 1,
                deviation.to_degrees(),
                limit.to_degrees(),
                lacks.join(", ")
            );
            ("shaking", joint, deviation, limit, words)
        } else {
            return;
        };
        for finding in &mut run.findings {
            finding.words =
                finding.words.replacen("something held the leg", "the leg did not follow its command", 1);
        }
        let values = [value, limit].map(Number::from);
        let finding = FindingReport::judged(Reason::Input.name(), test, Some(joint + 1), values, Some(words));
        run.findings.insert(0, finding);
        let before = core::mem::take(&mut run.reasons);
        let is_named = |name: &&'static str| *name == Reason::Input.name() || before.contains(name);
        run.reasons = Reason::ALL.map(Reason::name).into_iter().filter(is_named).collect();
    }
}

/// Joints whose `truth` has no rotor inertia, or no friction.
fn lacking(leg: &LegFile) -> Vec<String> {
    let lacks = leg.joints.iter().filter_map(|joint| {
        let truth = joint.truth?;
        let no_rotor = truth.rotor_inertia == 0.0;
        let no_friction = truth.coulomb == 0.0 && truth.viscous == 0.0;
        let words = match (no_rotor, no_friction) {
            (true, true) => "`rotor_inertia`, `coulomb` and `viscous` are 0",
            (true, false) => "`rotor_inertia` is 0",
            (false, true) => "`coulomb` and `viscous` are 0",
            (false, false) => return None,
        };
        Some(format!("joint `{}`: {words}", joint.name))
    });
    lacks.collect()
}
