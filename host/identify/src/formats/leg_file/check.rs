//! Checks a leg beyond its types.
//!
//! Bounds are wide: they reject impossible values (a slipped decimal point, a wrong unit), not unusual
//! ones. A body is physically consistent if its mass is positive and its inertia about the centre of mass
//! positive definite. In addition, no principal moment may reach the sum of the two others.

use std::collections::HashSet;

use nalgebra::Matrix3;

use scarab::assist::shares::{LARGEST_INERTIA, LARGEST_PERIODIC};
use scarab_base::toml_file::{Fault, Step};

use crate::formats::leg_file::{JointFile, LegFile, LinkParameters, Switch};

/// Components of gravity, m/s^2.
pub const GRAVITY: [f64; 2] = [-30.0, 30.0];
/// D-H twist, rad.
pub const TWIST: [f64; 2] = [-7.0, 7.0];
/// D-H lengths, m.
pub const LENGTH: [f64; 2] = [-5.0, 5.0];
/// Zero offset, degrees.
pub const ZERO_OFFSET: [f64; 2] = [-360.0, 360.0];
/// Ends of a range, degrees.
pub(crate) const RANGE_END: [f64; 2] = [-3600.0, 3600.0];
/// Smallest range that the firmware's limits accept.
pub(crate) const SMALLEST_RANGE_DEG: f64 = 2.0;
/// Largest speed limit, degrees per second.
pub(crate) const LARGEST_SPEED: f64 = 2800.0;
/// Largest torque limit, N m.
pub(crate) const LARGEST_TORQUE: f64 = 1000.0;
/// Smallest sigma of an offset about zero, N m: no torque sensor resolves less.
const SMALLEST_WITHIN: f64 = 1e-6;
/// Largest simulated noise of the torque, percent; leg files state at most 100.
pub const LARGEST_NOISE_PERCENT: f64 = 1000.0;
/// Largest current limit, A.
pub(crate) const LARGEST_CURRENT_A: f64 = 300.0;
/// Longest time of a holding brake, ms.
const LONGEST_BRAKE_MS: f64 = 500.0;

/// Position of a value; creates faults.
pub(super) struct KeyLocation<'a> {
    pub(crate) joint: Option<(usize, &'a str)>,
    pub(crate) table: Option<&'static str>,
}

impl KeyLocation<'_> {
    pub(super) fn fault(&self, key: &'static str, complaint: &str) -> Fault {
        let keys: Vec<&'static str> = self.table.into_iter().chain([key]).collect();
        let path = keys.join(".");
        let (mut steps, reason) = match self.joint {
            Some((number, name)) => (joint_steps(number), format!("joint `{name}`: `{path}` {complaint}")),
            None => (Vec::new(), format!("`{path}` {complaint}")),
        };
        steps.extend(keys.into_iter().map(Step::Key));
        Fault { steps, reason }
    }

    /// Accepts `low..=high`; rejects NaN.
    pub(super) fn within(&self, key: &'static str, value: f64, low: f64, high: f64) -> Result<(), Fault> {
        if (low..=high).contains(&value) {
            Ok(())
        } else {
            Err(self.fault(key, &format!("is {value}, outside {low}..{high}")))
        }
    }

    fn inside(&self, key: &'static str, value: f64, [low, high]: [f64; 2]) -> Result<(), Fault> {
        self.within(key, value, low, high)
    }

    /// Accepts values above 0 and up to `high`.
    fn positive(&self, key: &'static str, value: f64, high: f64) -> Result<(), Fault> {
        if value > 0.0 && value <= high {
            Ok(())
        } else {
            Err(self.fault(key, &format!("is {value}; it must be above 0 and at most {high}")))
        }
    }

    fn named(&self, key: &'static str, name: &str) -> Result<(), Fault> {
        if name.trim().is_empty() || name.chars().any(char::is_control) {
            return Err(self.fault(key, "must be one line that is not empty"));
        }
        Ok(())
    }
}

/// Path to a joint, from 0.
pub(super) fn joint_steps(number: usize) -> Vec<Step> {
    vec![Step::Key("joint"), Step::Entry(number)]
}

/// Errors that can be accepted, percent of the rms torque: at 70 a model explains half of the torque's power.
pub(crate) const ACCEPTED_PERCENT: std::ops::RangeInclusive<f64> = 0.0..=70.0;

pub(super) fn leg(leg: &LegFile) -> Result<(), Fault> {
    let top = KeyLocation { joint: None, table: None };
    top.named("name", &leg.name)?;
    for component in leg.gravity {
        top.inside("gravity", component, GRAVITY)?;
    }
    top.within("torque_noise_percent", leg.torque_noise_percent, 0.0, 100.0)?;
    // Above 25 Hz the rows at 50 Hz would be independent, and noise would alias into them.
    top.within("bandwidth_hz", leg.bandwidth_hz, 1.0, 25.0)?;
    top.within(
        "accept_error_percent",
        leg.accept_error_percent,
        *ACCEPTED_PERCENT.start(),
        *ACCEPTED_PERCENT.end(),
    )?;
    if let Some(celsius) = leg.temperature_c {
        let (low, high) = crate::formats::temperature::RANGE_C;
        top.within("temperature_c", celsius, low, high)?;
    }
    if let Some(pushes) = &leg.pushes {
        let location = KeyLocation { joint: None, table: Some("pushes") };
        location.positive("per_minute", pushes.per_minute, 600.0)?;
        location.positive("torque_nm", pushes.torque_nm, 1000.0)?;
        location.positive("duration_s", pushes.duration_s, 60.0)?;
    }
    if let Some(segments) = &leg.segments {
        let location = KeyLocation { joint: None, table: Some("segments") };
        location.within("shank_m", segments.shank_m, 0.1, 1.0)?;
        location.within("foot_m", segments.foot_m, 0.05, 0.6)?;
        location.within("wearer_kg", segments.wearer_kg, 10.0, 300.0)?;
        location.within("prior_wearer_kg", segments.prior_wearer_kg, 10.0, 300.0)?;
        if leg.joints.len() < 2 {
            return Err(top.fault("segments", "needs two joints, a hip and a knee"));
        }
    }
    leg.supply.check()?;
    // Below, noise and offsets of the estimate count.
    for (key, limit) in
        [("supply_current_a", leg.supply_current_a), ("charge_current_a", leg.charge_current_a)]
    {
        if let Some(limit) = limit {
            top.within(key, limit, 0.5, 500.0)?;
        }
    }
    if let Some(assist) = &leg.assist {
        let location = KeyLocation { joint: None, table: Some("assist") };
        let (inertia, periodic) = (f64::from(LARGEST_INERTIA), f64::from(LARGEST_PERIODIC));
        location.within("friction", assist.friction, 0.0, 1.0)?;
        location.within("inertia", assist.inertia, 0.0, inertia)?;
        location.within("weight", assist.weight, 0.0, 1.0)?;
        location.within("periodic", assist.periodic, -periodic, periodic)?;
    }
    if let Some(brake) = &leg.brake {
        let location = KeyLocation { joint: None, table: Some("brake") };
        location.within("release_ms", brake.release_ms, 0.0, LONGEST_BRAKE_MS)?;
        location.within("engage_ms", brake.engage_ms, 0.0, LONGEST_BRAKE_MS)?;
    }
    joints(&top, &leg.joints)
}

fn joints(top: &KeyLocation<'_>, joints: &[JointFile]) -> Result<(), Fault> {
    if !(1..=3).contains(&joints.len()) {
        return Err(top.fault("joint", &format!("occurs {} times; a leg has 1 to 3", joints.len())));
    }
    let mut names = HashSet::new();
    for (number, description) in joints.iter().enumerate() {
        joint(number, description)?;
        if !names.insert(description.name.as_str()) {
            let location = KeyLocation { joint: Some((number, &description.name)), table: None };
            return Err(location.fault("name", "is the name of an earlier joint"));
        }
    }
    Ok(())
}

fn joint(number: usize, joint: &JointFile) -> Result<(), Fault> {
    let location = KeyLocation { joint: Some((number, &joint.name)), table: None };
    let inside = |table| KeyLocation { joint: Some((number, joint.name.as_str())), table: Some(table) };
    location.named("name", &joint.name)?;
    let frame = inside("dh");
    frame.inside("alpha", joint.dh.alpha, TWIST)?;
    frame.inside("a", joint.dh.a, LENGTH)?;
    frame.inside("d", joint.dh.d, LENGTH)?;
    if !matches!(joint.direction, 1 | -1) {
        return Err(location.fault("direction", &format!("is {}; it must be 1 or -1", joint.direction)));
    }
    location.inside("zero_offset_deg", joint.zero_offset_deg, ZERO_OFFSET)?;
    range(&location, joint.range_deg)?;
    location.positive("speed_limit_deg_s", joint.speed_limit_deg_s, LARGEST_SPEED)?;
    location.positive("acceleration_limit_deg_s2", joint.acceleration_limit_deg_s2, 1e5)?;
    location.positive("torque_limit_nm", joint.torque_limit_nm, LARGEST_TORQUE)?;
    location.within("torque_per_ampere", joint.torque_per_ampere, 0.001, 100.0)?;
    if let Some(limit) = joint.current_limit_a {
        location.positive("current_limit_a", limit, LARGEST_CURRENT_A)?;
    }
    location.within("drive_lag_s", joint.drive_lag_s, 0.0, 0.1)?;
    let encoder = inside("encoder");
    encoder.positive("counts", f64::from(joint.encoder.counts), f64::from(1 << 24))?;
    encoder.positive("ratio", joint.encoder.ratio, 1000.0)?;
    let step = joint.encoder.step_rad();
    if !(1e-7..=0.1).contains(&step) {
        let words = format!("times `ratio` make {step:.3e} rad of the joint per count, outside 1e-7..0.1");
        return Err(encoder.fault("counts", &words));
    }
    location.within("current_noise_a", joint.current_noise_a, 0.0, 1000.0)?;
    location.within("current_offset_a", joint.current_offset_a, -1000.0, 1000.0)?;
    location.within("current_step_a", joint.current_step_a, 0.0, 100.0)?;
    if let Some(outliers) = &joint.outliers {
        let location = inside("outliers");
        location.within("percent", outliers.percent, 0.0, 100.0)?;
        location.positive("torque_nm", outliers.torque_nm, 1000.0)?;
    }
    if let Switch::Within(within) = joint.offset {
        inside("offset").within("within_nm", within, SMALLEST_WITHIN, LARGEST_TORQUE)?;
    }
    let has_offset = joint.offset != Switch::Off && joint.asymmetric_coulomb != Switch::On;
    if joint.spring == Switch::On && !has_offset {
        let complaint = "is on, and its torque at rest is measured in a sum with the offset: `offset` must not be off, nor \
                         `asymmetric_coulomb` on";
        return Err(location.fault("spring", complaint));
    }
    let words = [
        ("rotor", joint.rotor),
        ("stribeck_model", joint.stribeck_model),
        ("asymmetric_coulomb", joint.asymmetric_coulomb),
        ("spring", joint.spring),
        ("load_friction", joint.load_friction),
    ];
    if let Some((key, _)) = words.into_iter().find(|(_, switch)| matches!(switch, Switch::Within(_))) {
        return Err(location.fault(key, "is `auto`, `on` or `off`; `within_nm` belongs to `offset`"));
    }
    let is_fixed = matches!(joint.offset, Switch::On | Switch::Within(_));
    if is_fixed && joint.asymmetric_coulomb == Switch::On {
        let complaint = "is on and so is `offset`: while the joint moves a torque offset and a difference of Coulomb \
                         friction between the directions are the same column; one of them must be off";
        return Err(location.fault("asymmetric_coulomb", complaint));
    }
    if let Some(motor) = &joint.motor {
        motor.check(number, joint)?;
    }
    for (table, parameters) in [("truth", &joint.truth), ("prior", &joint.prior)] {
        if let Some(parameters) = parameters {
            link(&inside(table), parameters)?;
        }
    }
    if let Some(stribeck) = &joint.stribeck {
        let location = inside("stribeck");
        let coulomb = joint.truth.map_or(0.0, |truth| truth.coulomb);
        location.within("static_nm", stribeck.static_nm, coulomb, 1000.0)?;
        location.positive("speed_rad_s", stribeck.speed_rad_s, 100.0)?;
    }
    Ok(())
}

fn range(location: &KeyLocation<'_>, [lower, upper]: [f64; 2]) -> Result<(), Fault> {
    location.inside("range_deg", lower, RANGE_END)?;
    location.inside("range_deg", upper, RANGE_END)?;
    if lower >= upper {
        return Err(location.fault("range_deg", &format!("is inverted or empty: {lower} to {upper}")));
    }
    if upper - lower < SMALLEST_RANGE_DEG {
        let words = format!("is {} degrees wide; at least {SMALLEST_RANGE_DEG} are needed", upper - lower);
        return Err(location.fault("range_deg", &words));
    }
    Ok(())
}

fn link(location: &KeyLocation<'_>, link: &LinkParameters) -> Result<(), Fault> {
    location.positive("mass", link.mass, 500.0)?;
    for component in link.com {
        location.within("com", component, -5.0, 5.0)?;
    }
    for element in link.inertia_com {
        location.within("inertia_com", element, -500.0, 500.0)?;
    }
    let [xx, xy, xz, yy, yz, zz] = link.inertia_com;
    let mut moments: [f64; 3] =
        Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz).symmetric_eigenvalues().into();
    moments.sort_by(f64::total_cmp);
    let [least, middle, largest] = moments;
    if least <= 0.0 {
        return Err(location
            .fault("inertia_com", &format!("is not positive definite: a principal moment is {least:.6}")));
    }
    if largest >= least + middle {
        let complaint = format!(
            "is impossible: a principal moment of {largest:.6} is not below the sum {:.6} of the two others",
            least + middle
        );
        return Err(location.fault("inertia_com", &complaint));
    }
    location.within("rotor_inertia", link.rotor_inertia, 0.0, 100.0)?;
    location.within("coulomb", link.coulomb, 0.0, 1000.0)?;
    location.within("viscous", link.viscous, 0.0, 1000.0)?;
    location.within("offset", link.offset, -1000.0, 1000.0)?;
    // Friction must dissipate energy in both directions.
    location.within("asymmetry", link.asymmetry, -link.coulomb, link.coulomb)
}
