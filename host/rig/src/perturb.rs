//! Deliberate errors in a simulated identification, which the verdict must detect.
//!
//! Why: correct runs alone do not test a verdict. Every perturbation acts through the whole firmware; none
//! needs an interface that a board would not have.
//!
//! | `--perturb` | error | acts on |
//! | --- | --- | --- |
//! | `inertia=0.7` | factor on base parameters carried by an inertia, rotors included | result, see below |
//! | `com=0.8` | factor on base parameters carried by a first moment | result, see below |
//! | `length=1.1` | factor on all link lengths assumed by the firmware | firmware |
//! | `sign=JOINT` | the firmware assumes the other direction of one joint | firmware |
//! | `zero=5`, `zero=5@JOINT` | the firmware assumes an encoder zero off by these degrees | firmware |
//! | `swap` | connectors of the first two joints exchanged, motor and encoder together | wiring |
//! | `torque-constant=1.2` | factor of all motors' true torque per ampere over the assumed one | plant |
//! | `added-mass=2` | kg at the last link's centre of mass, added after the excitation | plant |
//! | `contact=2` | the foot stands on the floor for these seconds in mid-excitation | plant |
//! | `stuck=JOINT` | a joint is blocked at its initial position | plant |
//! | `small-motion`, `small-motion=0.05` | excitation with this share of its amplitude | firmware |
//! | `trigger=-40` | converter trigger, timer clocks after mid zero vector (board: 20) | complete drives |
//! | `quarter-shift` | the bridges switch a quarter of a period apart (board: half) | complete drives |
//! | `coupling=0.5` | A of disturbance per edge of the other bridge, see below | complete drives |
//!
//! `inertia` and `com` change the result before its validation. `zero` applies to the first joint
//! unless one is named. `added-mass` is in place before the validation. `coupling` disturbs a
//! sample for each edge of the other bridge in the 1.2 us before the hold.

use core::str::FromStr;

use hal_sim::drive::description::{CompleteDescription, ShuntDescription};
use scarab::model::Parameter;
use scarab::motion::{MotionError, Periodic};
use scarab::servo::SERVO_RATE_HZ;
use scarab::units::{Radian, Second};
use scarab_base::error::ToolError;
use scarab_identify::formats::leg_file::LegFile;

use crate::options::{DriveModel, SimulationOptions};
use crate::pair::{Context, Pair};

/// One deliberate error; see the module's table.
#[derive(Clone, Debug, PartialEq)]
pub enum Perturbation {
    /// Factor on base parameters carried by an inertia.
    Inertia(f64),
    /// Factor on base parameters carried by a first moment.
    CentreOfMass(f64),
    /// Factor on the assumed link lengths.
    Length(f64),
    /// First two joints exchanged.
    Swap,
    /// Joint whose assumed direction is wrong.
    Sign(String),
    /// Error of the encoder zero in degrees, and its joint.
    Zero(f64, Option<String>),
    /// Mass, kg.
    AddedMass(f64),
    /// Duration, s.
    Contact(f64),
    /// Blocked joint.
    Stuck(String),
    /// True over assumed torque per ampere.
    TorqueConstant(f64),
    /// Share of the excitation's amplitude.
    SmallMotion(f64),
    /// Timer clocks from the middle of the lower zero vector to the converters' trigger.
    Trigger(f64),
    /// Bridges a quarter of a period apart.
    QuarterShift,
    /// Disturbance in A per edge of the other bridge.
    Coupling(f64),
}

/// Parses a number within a plausible range.
fn number(name: &str, text: Option<&str>, default: f64, low: f64, high: f64) -> Result<f64, String> {
    let Some(text) = text else { return Ok(default) };
    match text.parse::<f64>() {
        Ok(value) if (low..=high).contains(&value) => Ok(value),
        _ => Err(format!("{name}={text}: a number from {low} to {high} is needed")),
    }
}

impl FromStr for Perturbation {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let (name, value) =
            text.split_once('=').map_or((text, None), |(name, value)| (name, Some(value.trim())));
        let joint = || match value {
            Some(joint) if !joint.is_empty() => Ok(joint.to_owned()),
            _ => Err(format!("{name} needs a joint: {name}=JOINT, name or number from 1")),
        };
        Ok(match name {
            "inertia" => Self::Inertia(number(name, value, 0.7, 0.01, 100.0)?),
            "com" => Self::CentreOfMass(number(name, value, 0.8, 0.01, 100.0)?),
            "length" => Self::Length(number(name, value, 1.1, 0.1, 10.0)?),
            "swap" if value.is_none() => Self::Swap,
            "swap" => return Err("swap takes no value".into()),
            "sign" => Self::Sign(joint()?),
            "zero" => {
                let (degrees, joint) = value.map_or((None, None), |value| match value.split_once('@') {
                    Some((degrees, joint)) => (Some(degrees), Some(joint.to_owned())),
                    None => (Some(value), None),
                });
                Self::Zero(number(name, degrees, 5.0, -90.0, 90.0)?, joint)
            }
            "added-mass" => Self::AddedMass(number(name, value, 2.0, 0.0, 100.0)?),
            "contact" => Self::Contact(number(name, value, 2.0, 0.0, 60.0)?),
            "stuck" => Self::Stuck(joint()?),
            "torque-constant" => Self::TorqueConstant(number(name, value, 1.2, 0.1, 10.0)?),
            "small-motion" => Self::SmallMotion(number(name, value, 0.05, 1e-4, 1.0)?),
            "trigger" => Self::Trigger(number(name, value, -40.0, -200.0, 200.0)?),
            "quarter-shift" if value.is_none() => Self::QuarterShift,
            "quarter-shift" => return Err("quarter-shift takes no value".into()),
            "coupling" => Self::Coupling(number(name, value, 0.5, -60.0, 60.0)?),
            _ => {
                return Err(format!(
                    "`{name}` is none of inertia, com, length, swap, sign, zero, added-mass, contact, stuck, \
                     torque-constant, small-motion, trigger, quarter-shift, coupling"
                ));
            }
        })
    }
}

impl Perturbation {
    /// Whether the perturbation changes the identified values before their validation.
    pub fn tampers(&self) -> bool {
        matches!(self, Self::Inertia(_) | Self::CentreOfMass(_))
    }

    /// Whether the perturbation needs complete drives.
    fn needs_complete_drives(&self) -> bool {
        matches!(self, Self::Trigger(_) | Self::QuarterShift | Self::Coupling(_))
    }
}

/// Rejects perturbations that the simulated drives cannot have.
pub(crate) fn check_drives(options: &SimulationOptions) -> Result<(), ToolError> {
    let ideal = options.drive == DriveModel::Ideal;
    if ideal && options.perturbations.iter().any(Perturbation::needs_complete_drives) {
        return Err(ToolError::input(
            "--perturb trigger, quarter-shift, coupling: ideal drives have no bridge and no converter; add --drive full",
        ));
    }
    Ok(())
}

/// Applies the perturbations to complete drives.
pub fn drives<const N: usize>(drives: &mut CompleteDescription<N>, perturbations: &[Perturbation]) {
    for perturbation in perturbations {
        match perturbation {
            Perturbation::Trigger(clocks) => {
                drives
                    .axes
                    .iter_mut()
                    .for_each(|axis| axis.shunts.delay = ShuntDescription::delay_of(*clocks));
            }
            Perturbation::QuarterShift => drives.shift_quarters = 1,
            Perturbation::Coupling(ampere) => drives.coupling.ampere_per_edge = *ampere,
            _ => {}
        }
    }
}

/// Index of a joint from its name or its number from 1.
fn joint_index(leg: &LegFile, joint: &str) -> Result<usize, ToolError> {
    leg.joint_index(joint).map_err(|reason| ToolError::input(format!("--perturb: {reason}")))
}

/// Leg assumed by the firmware.
pub fn believed(leg: &LegFile, perturbations: &[Perturbation]) -> Result<LegFile, ToolError> {
    let mut believed = leg.clone();
    for perturbation in perturbations {
        match perturbation {
            Perturbation::Length(factor) => believed.joints.iter_mut().for_each(|joint| joint.dh.a *= factor),
            Perturbation::Sign(joint) => {
                let joint = &mut believed.joints[joint_index(leg, joint)?];
                joint.direction = -joint.direction;
            }
            Perturbation::Zero(degrees, joint) => {
                let index = joint.as_ref().map_or(Ok(0), |joint| joint_index(leg, joint))?;
                believed.joints[index].zero_offset_deg += degrees;
            }
            _ => {}
        }
    }
    Ok(believed)
}

/// Simulated leg.
pub fn simulated(leg: &LegFile, perturbations: &[Perturbation]) -> Result<LegFile, ToolError> {
    let mut simulated = leg.clone();
    for perturbation in perturbations {
        match perturbation {
            Perturbation::TorqueConstant(factor) => {
                for joint in &mut simulated.joints {
                    // The limit of the drive is a current limit.
                    joint.current_limit_a = Some(joint.current_limit());
                    joint.torque_per_ampere *= factor;
                }
            }
            Perturbation::Swap if leg.joints.len() < 2 => {
                return Err(ToolError::input("--perturb swap: needs two joints"));
            }
            _ => {}
        }
    }
    Ok(simulated)
}

/// Motion with its amplitude about its centre multiplied by `share`.
fn shrunk<const N: usize>(motion: &Periodic<N>, share: f32) -> Result<Periodic<N>, MotionError> {
    let centre = motion.curve().centre_rad();
    let curve = motion.curve().mapped([share; N], centre.map(|angle| Radian((1.0 - share) * angle)))?;
    let blend = Second(motion.blend_ticks() as f32 / SERVO_RATE_HZ as f32);
    let cycles = (motion.duration_ticks() - 2 * motion.blend_ticks()) / motion.period_ticks();
    Periodic::new(curve, blend, cycles, SERVO_RATE_HZ)
}

/// Applies the perturbations of the configuration before the firmware is built.
pub fn configure<const N: usize, const B: usize>(
    context: &mut Context<N, B>,
    perturbations: &[Perturbation],
) -> Result<(), ToolError> {
    for perturbation in perturbations {
        if let Perturbation::SmallMotion(share) = perturbation {
            let motion = shrunk(&context.motions.excitation, *share as f32)
                .map_err(|error| ToolError::input(format!("--perturb small-motion: {error:?}")))?;
            context.motions.excitation = motion;
            context.configuration.excitation = motion;
        }
    }
    Ok(())
}

/// Applies the perturbations present from the start of the run.
pub fn at_start<const N: usize, const B: usize>(
    leg: &LegFile,
    pair: &mut Pair<N, B>,
    perturbations: &[Perturbation],
) -> Result<(), ToolError> {
    for perturbation in perturbations {
        match perturbation {
            Perturbation::Swap => pair.exchange(0, 1),
            Perturbation::Stuck(joint) => pair.world.block(joint_index(leg, joint)?),
            _ => {}
        }
    }
    Ok(())
}

/// Applies the perturbations that begin with the exciting motion.
pub fn at_excitation<const N: usize, const B: usize>(
    leg: &LegFile,
    context: &Context<N, B>,
    pair: &mut Pair<N, B>,
    perturbations: &[Perturbation],
) {
    for perturbation in perturbations {
        if let (Perturbation::Contact(seconds), Some(last)) = (perturbation, leg.joints.last()) {
            let motion = f64::from(context.motions.excitation.duration_ticks()) / f64::from(SERVO_RATE_HZ);
            let com = last.truth.as_ref().map_or([0.0; 3], |truth| truth.com);
            // The foot is about twice as far from the knee as the centre of mass of shank and foot.
            pair.world.touch(com.map(|element| 2.0 * element), 0.5 * (motion - seconds).max(0.0), *seconds);
        }
    }
}

/// Applies the perturbations between the exciting motion and the search.
pub fn after_excitation<const N: usize, const B: usize>(
    leg: &LegFile,
    pair: &mut Pair<N, B>,
    perturbations: &[Perturbation],
) {
    for perturbation in perturbations {
        if let (Perturbation::AddedMass(mass), Some(last)) = (perturbation, leg.joints.last()) {
            pair.world.attach(N - 1, *mass, last.truth.as_ref().map_or([0.0; 3], |truth| truth.com));
        }
    }
}

/// Applies the perturbations of the result before its validation.
pub(crate) fn before_validation<const N: usize, const B: usize>(
    context: &Context<N, B>,
    pair: &mut Pair<N, B>,
    perturbations: &[Perturbation],
) {
    use Parameter as P;
    let Some(mut values) = pair.leg.identification().solver().map(|solver| solver.estimate().values) else {
        return;
    };
    let mut tampered = false;
    for perturbation in perturbations {
        let (factor, carriers): (f64, &[P]) = match perturbation {
            Perturbation::Inertia(factor) => (*factor, &[P::XX, P::XY, P::XZ, P::YY, P::YZ, P::ZZ, P::IA]),
            Perturbation::CentreOfMass(factor) => (*factor, &[P::HX, P::HY, P::HZ]),
            _ => continue,
        };
        tampered = true;
        for (base, value) in values.iter_mut().enumerate() {
            let carrier = context.background.model.base.independent(base);
            if carrier.is_some_and(|(_, parameter)| carriers.contains(&parameter)) {
                *value *= factor as f32;
            }
        }
    }
    if tampered {
        pair.leg.examine(&values);
    }
}
