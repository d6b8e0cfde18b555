//! Warnings about a designed motion.

use scarab::servo::SERVO_RATE_HZ;
use scarab_base::number::number;
use scarab_identify::formats::leg_file::{DEFAULT_RANGE_DEG, JointFile, LegFile};
use scarab_identify::report::excite::{ComparedBase, ExpectedBase, ExpectedParameter, JointReport};

use crate::excite::bench::NoiseOrigin;
use crate::excite::demand::Demand;

/// Systematic error above which a warning is printed, sigma.
const SYSTEMATIC_SIGMAS: f64 = 1.0;
/// Angle through which a joint moves, above which a warning is printed, degrees.
const WIDE_DEG: f64 = 200.0;
/// Share of lost rows above which a warning is printed.
const LOST_SHARE: f64 = 0.4;

/// Warnings to be read before the motion is run.
pub fn warnings(
    leg: &LegFile,
    noise: NoiseOrigin,
    demand: &[Demand],
    joints: &[JointReport],
    base: &[ComparedBase],
    parameters: &[ExpectedParameter],
) -> Vec<String> {
    let mut warnings: Vec<_> = base.iter().filter_map(|base| bias_warning(&base.expected)).collect();
    for parameter in parameters.iter().filter(|parameter| parameter.status == "weak") {
        let sigma = number(parameter.sigma);
        warnings.push(format!(
            "{}: weak, hardly distinguishable from others in this range (sigma {sigma} {})",
            parameter.name, parameter.unit
        ));
    }
    for joint in joints {
        if joint.lost_share > LOST_SHARE {
            let percent = 100.0 * joint.lost_share;
            warnings.push(format!("{}: {percent:.0} % of its rows are excluded at standstill", joint.name));
        }
        if joint.torque_with_margin_nm > joint.torque_limit_nm {
            warnings.push(format!(
                "{}: {:.1} N m with the margin, limit {:.1} N m",
                joint.name, joint.torque_with_margin_nm, joint.torque_limit_nm
            ));
        }
        if joint.simulated.limited_ticks > 0 {
            let seconds = f64::from(joint.simulated.limited_ticks) / f64::from(SERVO_RATE_HZ);
            warnings.push(format!(
                "{}: the monitor reduces its torque for {seconds:.3} s: the motion differs from the design",
                joint.name
            ));
        }
    }
    for (joint, demand) in joints.iter().zip(demand).filter(|(_, demand)| demand.unheld_nm > 0.0) {
        warnings.push(format!(
            "{}: holding its weight somewhere in `range_deg` needs {:.1} N m with the margin, limit {:.1} N m: do not begin there",
            joint.name, demand.unheld_nm, joint.torque_limit_nm
        ));
    }
    warnings.extend(leg.joints.iter().zip(joints).filter_map(|(file, joint)| range_warning(file, joint)));
    if noise.of == "prior" && noise.percent > 0.0 {
        warnings.push(
            "the noise is a share of the assumed leg's torque and as wrong as that torque: measure it at rest (--torque-noise-nm)"
                .into(),
        );
    }
    if leg.pushes.is_some() {
        warnings.push("these figures do not include pushes of the wearer".into());
    }
    warnings
}

/// Warning about a base parameter that is not determined, or whose error is not noise.
fn bias_warning(expected: &ExpectedBase) -> Option<String> {
    let (Some(sigma), Some(systematic)) = (expected.sigma, expected.systematic) else {
        return Some(format!("{}: not determined by this motion", expected.name));
    };
    (systematic.abs() > SYSTEMATIC_SIGMAS * sigma).then(|| {
        format!(
            "{}: wrong by {:.1} sigma without any noise (encoder steps, friction at reversals): its sigma is too small",
            expected.name,
            systematic.abs() / sigma
        )
    })
}

/// Warning about a joint without a stated range, or one that moves far.
fn range_warning(file: &JointFile, joint: &JointReport) -> Option<String> {
    let ([low, high], [least, most]) = (joint.angle_deg, DEFAULT_RANGE_DEG);
    if file.range_deg == DEFAULT_RANGE_DEG {
        return Some(format!(
            "{}: `range_deg` is the default {least} to {most}: state the range in which it may move",
            joint.name
        ));
    }
    (high - low > WIDE_DEG).then(|| {
        format!(
            "{}: moves through {:.0} degrees: narrow `range_deg` if cables or other links are in the way",
            joint.name,
            high - low
        )
    })
}
