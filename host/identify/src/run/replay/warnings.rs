//! Doubts about a recording or its leg that do not change the result.

use crate::formats::leg_file::{DEFAULT_RANGE_DEG, LegFile};
use crate::formats::recording::Recording;

/// Excess over the leg's range from which a warning is given.
const RANGE_MARGIN_DEG: f64 = 5.0;

/// Joints of the file that the leg does not have.
pub fn of_more_joints(recording: &Recording, leg: &LegFile) -> Option<String> {
    let (in_file, in_leg) = (recording.joints_in_file, leg.joints.len());
    (in_file > in_leg).then(|| {
        format!(
            "{}: holds {in_file} joints, the leg `{}` has {in_leg}: the other columns are ignored, as if those joints were at rest",
            recording.file.display(),
            leg.name
        )
    })
}

/// Signs that the recording is from another machine.
pub(super) fn of_another_leg(recording: &Recording, leg: &LegFile) -> impl Iterator<Item = String> {
    let file = recording.file.display();
    let more_joints = of_more_joints(recording, leg);
    let outside = recording.joints.iter().zip(&leg.joints).enumerate().filter_map(move |(number, (series, joint))| {
        let angles = series.position_rad.iter().map(|angle| angle.to_degrees());
        let (low, high) =
            angles.fold((f64::MAX, f64::MIN), |(low, high), angle| (low.min(angle), high.max(angle)));
        let [lower, upper] = joint.range_deg;
        let is_stated = joint.range_deg != DEFAULT_RANGE_DEG;
        let is_outside = low < lower - RANGE_MARGIN_DEG || high > upper + RANGE_MARGIN_DEG;
        (is_stated && is_outside).then(|| {
            format!(
                "{file}: q{}_rad goes from {low:.0} to {high:.0} deg, the range of `{}` is {lower:.0} to {upper:.0} deg: are \
                 column, unit, direction and zero right?",
                number + 1,
                joint.name
            )
        })
    });
    more_joints.into_iter().chain(outside)
}

/// Denavit-Hartenberg numbers and gravity that suggest another convention.
pub(super) fn of_geometry(leg: &LegFile) -> impl Iterator<Item = String> {
    let first = leg.joints.first();
    let ineffective = first.filter(|first| first.dh.a != 0.0).map(|first| {
        format!(
            "{}: `dh.a` of joint `{}` is {} m and has no effect: it is the distance from the joint before. Is it the \
             length of this joint's link? Then it belongs to the next joint (docs/model.md)",
            leg.name, first.name, first.dh.a
        )
    });
    let [x, y, z] = leg.gravity;
    let (sine, cosine) = first.map_or((0.0, 1.0), |first| first.dh.twist().sin_cos());
    let along = z * cosine - y * sine;
    let across = (x * x + y * y + z * z - along * along).max(0.0).sqrt();
    let is_parallel = leg.joints.iter().skip(1).all(|joint| joint.dh.alpha == 0.0);
    let weightless = (is_parallel && across < 1e-3 * along.abs()).then(|| {
        format!(
            "{}: gravity is along the joints' axes, so no torque holds weight. In a vertical plane gravity lies in x \
             and y of the base frame, because z is the first joint's axis",
            leg.name
        )
    });
    ineffective.into_iter().chain(weightless).chain(rounded_twists(leg))
}

/// Twists that are taken as right angles.
pub fn rounded_twists(leg: &LegFile) -> impl Iterator<Item = String> {
    leg.joints.iter().filter(|joint| (joint.dh.twist() - joint.dh.alpha).abs() > 1e-9).map(|joint| {
        format!(
            "{}: `dh.alpha` of joint `{}` is {} rad and is taken as {:.0} degrees",
            leg.name,
            joint.name,
            joint.dh.alpha,
            joint.dh.twist().to_degrees()
        )
    })
}
