//! Errors of a logging chain along which a recording can be wrong ("directions"), each fitted beside the
//! parameters.
//!
//! ```text
//! delay j           torque_j(t + d) = Y_j p                           torque of joint j is d late
//! encoder_scale j   Y(q_j / (1 + d)) p, about the joint's zero        angle of joint j is logged too large
//! torque_scale j    torque_j = (1 + d) Y_j p                          torque of joint j against the others
//! gravity           Y with gravity turned back by d about axis 1      gravity of the leg file is turned by d
//! spring j          torque_j = Y_j p + d q_j                          a spring beside the drive of joint j
//! offset_drift j    torque_j = Y_j p + d s                            s from -0.5 to 0.5 over each recording
//! torque_drift j    torque_j = (1 + d s) Y_j p                        gain of joint j changes by d
//! friction_drift j  torque_j = Y_j p + d s (friction of joint j)      its friction changes by d
//! ```
//!
//! Each is a nonlinear least-squares problem in d and p, solved by Gauss-Newton with p eliminated (Golub and
//! Pereyra 1973). A delay starts from the best of a scan, because its cost is not convex beyond a quarter of
//! a period; gravity starts from the best of 24 directions. Both are solved from zero too, and the solution
//! near zero holds unless the far one costs less by what chance never gives: gravity turned by 180 degrees
//! fits a leg with weak coupling almost as well as none. The column of a delay is the slope of the
//! *predicted* torque. The slope of the measured torque contains noise, which would count as information.
//!
//! A direction refuses when all of these hold:
//!
//! ```text
//! |d| > 5.2 sigma                     sigma: the larger of noise and scatter over segments; and the cost
//!                                     falls by what a linear column of this significance earns
//! some parameter moves by > 2 sigma   when d is fitted
//! gain > 0.1 x misfit                 x = 1 - noise^2 / misfit^2, at least 0.02
//! ```
//!
//! A drift leaves the parameters near their mean. Instead of the second condition its torque at the ends of
//! the recording, half of d, must exceed the accepted share of the rms torque.
//!
//! The third condition accepts a real machine, whose misfit has mostly other causes. A value at the end of
//! its search is no estimate: it may refuse, but is reported as not determined and never named as the cause.
//! A torque scale common to all joints is invisible without a known mass. In the plane gravity's direction
//! and the zero of joint 1 are the same direction.

use std::borrow::Cow;

use nalgebra::{Rotation3, Unit, Vector3};
use rayon::prelude::*;
use scarab::model::Parameter;
use scarab::real::dot;

use crate::run::logging_errors::fit::{Fit, Score};
use crate::run::logging_errors::regressor::Instant;
use crate::run::logging_errors::rows::{Equations, RowSource};
use crate::run::logging_errors::table::Table;

/// Standard deviations that chance exceeds once in ten million tests.
pub(crate) const CHANCE: f64 = 5.2;
/// Shift of a parameter that is tolerated, in its sigma.
pub(crate) const TOLERATED_SHIFT: f64 = 2.0;
/// Share of the misfit that a direction must explain where none of it is noise.
pub(crate) const EXPLAINED_SHARE: f64 = 0.1;
/// Part of the misfit that is never noise, however well the model fits: over hours of motion any small error
/// becomes significant.
pub(crate) const SMALLEST_SYSTEMATIC: f64 = 0.02;
/// Correlation of two columns from which they count as indistinguishable.
const ALIKE: f64 = 0.95;
/// Share of a column that the parameters must leave. Rounding leaves 1e-12 of an absorbed column; gravity of
/// a slow leg leaves 6e-6.
const SEEN_SHARE: f64 = 1e-8;
/// Range and step of a delay's scan, s.
const SCAN_S: (f64, f64, f64) = (-0.040, 0.080, 0.004);
/// Angles of gravity's scan.
const GRAVITY_SCAN: usize = 24;
/// Scale error at which a joint's search ends: nothing of the angle or torque is left below.
const LEAST_SCALE: f64 = -0.95;
/// Steps of Gauss-Newton.
const STEPS: usize = 8;

/// Possible error of the logging chain.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// Torque of a joint against its angle.
    Delay(usize),
    /// Scale of a joint's angle.
    EncoderScale(usize),
    /// Scale of a joint's torque against those of the others.
    TorqueScale(usize),
    /// Direction of gravity.
    Gravity,
    /// Spring beside a joint's drive.
    Spring(usize),
    /// Change over each recording.
    Drift(Drifting, usize),
}

/// What changes over a recording.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Drifting {
    /// Offset of a joint's torque.
    Offset,
    /// Gain of a joint's torque.
    Torque,
    /// Coulomb and viscous friction of a joint.
    Friction,
}

impl Kind {
    /// All directions of a leg.
    pub(crate) fn all(joints: usize) -> Vec<Self> {
        let delays = (0..joints).map(Self::Delay);
        let scales = (0..joints).map(Self::EncoderScale);
        let springs = (0..joints).map(Self::Spring);
        let drifts = [Drifting::Offset, Drifting::Torque, Drifting::Friction];
        let drifts =
            drifts.into_iter().flat_map(|what| (0..joints).map(move |joint| Self::Drift(what, joint)));
        // The scale of one of two joints is the inverse of the other's.
        let first = if joints > 2 { 0 } else { 1 };
        let plain = delays.chain(scales).chain((first..joints).map(Self::TorqueScale)).chain([Self::Gravity]);
        plain.chain(springs).chain(drifts).collect()
    }

    /// Name in reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::Delay(_) => "delay",
            Self::EncoderScale(_) => "encoder_scale",
            Self::TorqueScale(_) => "torque_scale",
            Self::Gravity => "gravity",
            Self::Spring(_) => "spring",
            Self::Drift(Drifting::Offset, _) => "offset_drift",
            Self::Drift(Drifting::Torque, _) => "torque_drift",
            Self::Drift(Drifting::Friction, _) => "friction_drift",
        }
    }

    /// Joint, from 0.
    pub fn joint(self) -> Option<usize> {
        match self {
            Self::Delay(joint)
            | Self::EncoderScale(joint)
            | Self::TorqueScale(joint)
            | Self::Spring(joint)
            | Self::Drift(_, joint) => Some(joint),
            Self::Gravity => None,
        }
    }

    /// Whether the same error of several joints is tried at once: it changes the equations of its joint only.
    /// A delay of all joints is one error with one value; a scale of all torques is none.
    pub(crate) fn is_combined(self) -> bool {
        !matches!(self, Self::EncoderScale(_) | Self::Gravity | Self::Delay(_) | Self::TorqueScale(0))
    }

    /// Unit of reports and the factor to it.
    pub fn unit(self) -> (&'static str, f64) {
        match self {
            Self::Delay(_) => ("ms", 1e3),
            Self::Spring(_) => ("N m/rad", 1.0),
            Self::Drift(Drifting::Offset, _) => ("N m", 1.0),
            Self::EncoderScale(_) | Self::TorqueScale(_) | Self::Drift(..) => ("%", 100.0),
            Self::Gravity => ("deg", 180.0 / std::f64::consts::PI),
        }
    }

    /// Step of the difference quotient.
    fn step(self) -> f64 {
        match self {
            Self::Gravity => 1e-3,
            _ => 1e-4,
        }
    }

    /// Largest plausible magnitude, and the largest step. A gain that falls by twice its mean ends at zero.
    fn range(self) -> (f64, f64) {
        match self {
            Self::Spring(_) | Self::Drift(Drifting::Offset, _) => (f64::MAX, f64::MAX),
            Self::Drift(..) => (1.9, 0.5),
            Self::Delay(_) => (0.2, 0.02),
            Self::EncoderScale(_) => (0.5, 0.1),
            Self::TorqueScale(_) => (20.0, 1.0),
            Self::Gravity => (10.0, 0.5),
        }
    }
}

/// One direction with the parameters fitted beside it.
#[derive(Clone, Debug)]
pub(crate) struct Found {
    /// Kind of error.
    pub(crate) kind: Kind,
    /// Value, SI.
    pub(crate) value: f64,
    /// Standard deviation by the noise of the rows.
    pub(crate) noise_sigma: f64,
    /// Standard deviation by the scatter of the segments.
    pub(crate) segment_sigma: f64,
    /// Whether the motion determines it at all.
    pub(crate) seen: bool,
    /// Whether the search ended at its limit.
    pub(crate) at_limit: bool,
    /// Cost without and with the direction.
    pub(crate) cost: (f64, f64),
    /// Parameters of the training motion, with the direction minus without it.
    pub(crate) shift: Vec<f64>,
    /// All parameters with the direction.
    pub(crate) values: Vec<f64>,
    /// Directions that cannot be distinguished from this one.
    pub(crate) alike: Vec<String>,
    column: Vec<f64>,
    /// Root mean square of the torque of a spring that the parameters leave, or of a drift at the ends of the
    /// recording, over that of its joint; zero for other kinds.
    pub(crate) torque_share: f64,
}

impl Found {
    /// The larger standard deviation.
    pub(crate) fn sigma(&self) -> f64 {
        self.noise_sigma.max(self.segment_sigma)
    }

    /// Standard deviations by which it differs from zero: the smaller of value over sigma and what the cost
    /// gains. Both are equal for a linear column.
    pub(crate) fn significance(&self) -> f64 {
        if !self.seen {
            return 0.0;
        }
        let (plain, with) = self.cost;
        (self.value.abs() / self.sigma()).min(gain(plain, plain, with) * self.noise_sigma / self.sigma())
    }

    /// Share of the misfit that the direction explains.
    pub(crate) fn explained(&self) -> f64 {
        if self.seen { ((self.cost.0 - self.cost.1) / self.cost.0).max(0.0) } else { 0.0 }
    }

    /// Variance that a possible error adds to each parameter: the shift, reduced by the part that chance
    /// explains.
    pub(crate) fn variance(&self) -> impl Iterator<Item = f64> + '_ {
        let certain = certain(self.significance());
        self.shift.iter().map(move |shift| shift * shift * certain)
    }
}

/// Part of an error of this significance that chance does not explain, 0..1.
pub(crate) fn certain(significance: f64) -> f64 {
    (1.0 - (2.0 / significance.max(1e-9)).powi(2)).max(0.0)
}

/// Standard deviations that a fall of the cost from `without` to `with` is worth. The weights are those of
/// the `plain` misfit, whose cost is the number of rows; the fall counts in the misfit that remains.
fn gain(plain: f64, without: f64, with: f64) -> f64 {
    (plain * (without - with).max(0.0) / with.max(1e-300)).sqrt()
}

/// Joint's zero in chain angles, and its torques.
pub(crate) struct Directions<'a> {
    /// Filtered rows.
    pub(crate) equations: &'a Equations,
    /// Chain angle of each joint's zero, rad.
    pub(crate) zero: Vec<f64>,
    /// Axis of the first joint in the base frame.
    pub(crate) axis: Vector3<f64>,
}

/// A solution beside the parameters.
struct Solved<'a> {
    value: f64,
    at_limit: bool,
    system: System<'a>,
    fit: Fit,
    score: Score,
}

impl Solved<'_> {
    /// Whether a further step would be lost in the noise, or the motion does not show the direction.
    fn is_settled(&self) -> bool {
        self.score.seen < SEEN_SHARE || self.score.delta.abs() < 0.05 * self.score.noise_sigma
    }
}

type System<'a> = (Cow<'a, Table>, Cow<'a, [f64]>);

impl<'a> Directions<'a> {
    /// Fits every direction and lists those that cannot be distinguished from it.
    pub(crate) fn all(&self) -> Vec<Found> {
        let plain = self.equations.fit(&self.equations.columns, &self.equations.torque, false);
        let training = self.equations.fit(&self.equations.columns, &self.equations.torque, true);
        let mut found: Vec<Found> = Kind::all(self.equations.joints())
            .into_par_iter()
            .map(|kind| self.one(kind, &plain, &training))
            .collect();
        for one in 0..found.len() {
            let names: Vec<String> = (0..found.len())
                .filter(|&other| other != one && found[one].seen && found[other].seen)
                .filter(|&other| correlation(&found[one].column, &found[other].column).abs() > ALIKE)
                .map(|other| label(found[other].kind))
                .collect();
            found[one].alike.extend(names);
            if !found[one].seen {
                found[one].alike.push("the parameters".into());
            }
            if found[one].kind == Kind::Gravity {
                found[one].alike.push("zero of joint 1".into());
            }
        }
        found
    }

    /// Columns and torques with a direction at `value`.
    pub(crate) fn system(&self, kind: Kind, value: f64) -> System<'a> {
        let all = self.equations;
        let plain = Cow::Borrowed(all.torque.as_slice());
        match kind {
            Kind::Delay(joint) => {
                let late = |source: &RowSource| (source.joint == joint).then_some(value);
                (Cow::Borrowed(&all.columns), Cow::Owned(all.delayed(late)))
            }
            Kind::EncoderScale(joint) => (Cow::Owned(self.scaled(joint, 1.0 / (1.0 + value))), plain),
            Kind::TorqueScale(joint) => {
                let mut columns = all.columns.clone();
                for (row, _) in columns.rows_mut().zip(&all.sources).filter(|(_, of)| of.joint == joint) {
                    row.iter_mut().for_each(|element| *element *= 1.0 + value);
                }
                (Cow::Owned(columns), plain)
            }
            Kind::Gravity => {
                let turn = Rotation3::from_axis_angle(&Unit::new_normalize(self.axis), -value);
                let turned = all.regressor.with_gravity(&|gravity| turn * gravity);
                (Cow::Owned(all.columns_of(&*turned, &|_| {})), plain)
            }
            Kind::Spring(_) | Kind::Drift(Drifting::Offset, _) => {
                let beside = self.beside(kind, &[]);
                let rest = all.torque.iter().zip(&beside).map(|(torque, beside)| torque - value * beside);
                (Cow::Borrowed(&all.columns), Cow::Owned(rest.collect()))
            }
            Kind::Drift(what, joint) => {
                let drifts = self.drifting(what, joint);
                let mut columns = all.columns.clone();
                for (row, of) in columns.rows_mut().zip(&all.sources).filter(|(_, of)| of.joint == joint) {
                    let elements = row.iter_mut().zip(&drifts).filter(|(_, drifts)| **drifts);
                    elements.for_each(|(element, _)| *element *= 1.0 + value * of.drift());
                }
                (Cow::Owned(columns), plain)
            }
        }
    }

    /// Base parameters whose torque drifts.
    fn drifting(&self, what: Drifting, joint: usize) -> Vec<bool> {
        let regressor = &self.equations.regressor;
        let is_friction = |base: usize| {
            let carrier = regressor.carrier(base);
            carrier.is_some_and(|(of, kind)| of == joint && matches!(kind, Parameter::FC | Parameter::FV))
        };
        let drifts = |base: usize| match what {
            Drifting::Offset => false,
            Drifting::Torque => true,
            Drifting::Friction => is_friction(base),
        };
        (0..regressor.rank()).map(drifts).collect()
    }

    /// Torque that a spring or a drift of value one adds to each equation, by these parameters.
    fn beside(&self, kind: Kind, parameters: &[f64]) -> Vec<f64> {
        let all = self.equations;
        match kind {
            Kind::Spring(joint) => all.angles(joint),
            Kind::Drift(what, joint) => {
                let drifts = self.drifting(what, joint);
                let of = |row: &[f64]| -> f64 {
                    let each = row.iter().zip(parameters).zip(&drifts).filter(|(_, drifts)| **drifts);
                    each.map(|((element, value), _)| element * value).sum()
                };
                let rows = all.columns.rows().zip(&all.sources);
                rows.map(|(row, source)| match what {
                    _ if source.joint != joint => 0.0,
                    Drifting::Offset => source.drift(),
                    _ => source.drift() * of(row),
                })
                .collect()
            }
            _ => Vec::new(),
        }
    }

    /// Columns with the angle of a joint multiplied about its zero.
    pub(crate) fn scaled(&self, joint: usize, factor: f64) -> Table {
        let zero = self.zero[joint];
        let change = |instant: &mut Instant| {
            instant.position[joint] = zero + factor * (instant.position[joint] - zero);
            instant.velocity[joint] *= factor;
            instant.acceleration[joint] *= factor;
        };
        self.equations.columns_of(&*self.equations.regressor, &change)
    }

    /// Change of the prediction with the direction.
    fn column(&self, kind: Kind, value: f64, columns: &Table, fit: &Fit) -> Vec<f64> {
        let all = self.equations;
        let predicted = fit.predictions(columns);
        match kind {
            Kind::Delay(joint) => {
                let rates = all.rate_of(&predicted);
                let pairs = rates.iter().zip(&all.sources);
                pairs.map(|(rate, source)| if source.joint == joint { -rate } else { 0.0 }).collect()
            }
            Kind::TorqueScale(joint) => {
                let pairs = predicted.iter().zip(&all.sources);
                let factor = 1.0 / (1.0 + value);
                pairs
                    .map(|(torque, source)| if source.joint == joint { factor * torque } else { 0.0 })
                    .collect()
            }
            Kind::Spring(_) | Kind::Drift(..) => self.beside(kind, &fit.values),
            Kind::EncoderScale(_) | Kind::Gravity => {
                let step = kind.step();
                let beside = fit.predictions(&self.system(kind, value + step).0);
                beside.iter().zip(&predicted).map(|(beside, here)| (beside - here) / step).collect()
            }
        }
    }

    fn score(&self, kind: Kind, value: f64, system: &System<'_>, fit: &Fit) -> Score {
        let z = self.column(kind, value, &system.0, fit);
        self.equations.score(fit, &system.0, &system.1, &z)
    }

    /// Best point of the scan, if it costs less than zero does.
    fn scanned(&self, kind: Kind, plain: &Fit) -> Option<f64> {
        let cost = |system: System<'_>| self.equations.fit(&system.0, &system.1, false).cost;
        let scanned: Vec<(f64, f64)> = match kind {
            Kind::Delay(_) => {
                let largest = self.equations.largest_delay_s();
                let (low, high, step) = SCAN_S;
                let count = ((high - low) / step).round() as usize;
                (0..=count)
                    .map(|index| low + step * index as f64)
                    .filter(|value| value.abs() < largest && value.abs() > 0.1 * step)
                    .map(|value| (value, cost(self.system(kind, value))))
                    .collect()
            }
            Kind::Gravity => {
                let turned = self.turned_gravity();
                (1..GRAVITY_SCAN)
                    .map(|index| std::f64::consts::TAU * index as f64 / GRAVITY_SCAN as f64)
                    .map(|value| {
                        (value, cost((Cow::Owned(turned(value)), Cow::Borrowed(&self.equations.torque))))
                    })
                    .collect()
            }
            _ => Vec::new(),
        };
        let best = scanned.into_iter().min_by(|one, other| one.1.total_cmp(&other.1));
        best.filter(|best| best.1 < plain.cost).map(|best| best.0)
    }

    /// Columns with gravity turned by any angle, from those of three angles: the regressor is linear in
    /// gravity.
    fn turned_gravity(&self) -> impl Fn(f64) -> Table {
        let quarter = 0.5 * std::f64::consts::PI;
        let [ahead, across, back] =
            [0.0, quarter, 2.0 * quarter].map(|angle| self.system(Kind::Gravity, angle).0.into_owned());
        move |angle| {
            let (sine, cosine) = angle.sin_cos();
            let mut turned = ahead.clone();
            let rows = turned.elements_mut().zip(across.elements().zip(back.elements()));
            for (element, (across, back)) in rows {
                let without = 0.5 * (*element + back);
                *element = without + cosine * 0.5 * (*element - back) + sine * (across - without);
            }
            turned
        }
    }

    /// Gauss-Newton from a start. A step that costs more is halved.
    fn solved(&self, kind: Kind, start: f64) -> Solved<'a> {
        let (largest, step) = kind.range();
        let largest = match kind {
            Kind::Delay(_) => self.equations.largest_delay_s(),
            _ => largest,
        };
        let mut here = self.at(kind, start);
        let mut share = 1.0;
        for _ in 0..STEPS {
            if here.is_settled() {
                return here;
            }
            let least = match kind {
                Kind::EncoderScale(_) | Kind::TorqueScale(_) => LEAST_SCALE.max(-largest),
                _ => -largest,
            };
            let wanted = (here.value + share * here.score.delta.clamp(-step, step)).clamp(least, largest);
            let next = self.at(kind, wanted);
            if next.fit.cost <= here.fit.cost {
                let at_limit = wanted == least || wanted == largest;
                here = Solved { at_limit, ..next };
                share = 1.0;
            } else {
                share *= 0.25;
            }
        }
        // A search that is still far from its end found nothing.
        here.at_limit |= here.score.delta.abs() > here.score.sigma();
        here
    }

    fn at(&self, kind: Kind, value: f64) -> Solved<'a> {
        let system = self.system(kind, value);
        let fit = self.equations.fit(&system.0, &system.1, false);
        let score = self.score(kind, value, &system, &fit);
        Solved { value, at_limit: false, system, fit, score }
    }

    fn one(&self, kind: Kind, plain: &Fit, training: &Fit) -> Found {
        let near = self.solved(kind, 0.0);
        let far = self.scanned(kind, plain).map(|start| self.solved(kind, start));
        let earned = |far: &Solved<'_>| {
            gain(plain.cost, near.fit.cost, far.fit.cost) > CHANCE
                && far.fit.cost < (1.0 - EXPLAINED_SHARE) * near.fit.cost
        };
        let Solved { mut value, at_limit, system, fit, score } = match far {
            Some(far) if earned(&far) => far,
            _ => near,
        };
        if kind == Kind::Gravity {
            value = (value + std::f64::consts::PI).rem_euclid(std::f64::consts::TAU) - std::f64::consts::PI;
        }
        let seen = score.seen >= SEEN_SHARE && score.sigma().is_finite();
        // The weights are those of the misfit without the direction.
        let remaining = if plain.cost > 0.0 { (fit.cost / plain.cost).min(1.0).sqrt() } else { 1.0 };
        let with = self.equations.fit(&system.0, &system.1, true);
        Found {
            kind,
            value,
            noise_sigma: remaining * score.noise_sigma,
            segment_sigma: score.segment_sigma,
            seen,
            at_limit,
            cost: (plain.cost, fit.cost),
            shift: with
                .values
                .iter()
                .zip(&training.values)
                .map(|(with, without)| if seen { with - without } else { 0.0 })
                .collect(),
            torque_share: value.abs() * self.torque_share(kind, &fit.values, &score),
            values: fit.values,
            alike: Vec::new(),
            column: score.column,
        }
    }

    /// Torque of a spring or a drift of value one over that of its joint, root mean squares.
    fn torque_share(&self, kind: Kind, parameters: &[f64], score: &Score) -> f64 {
        let all = self.equations;
        let (beside, joint): (Vec<f64>, usize) = match kind {
            Kind::Spring(joint) => {
                let left = score.column.iter().zip(&all.weight);
                (left.map(|(column, weight)| column / weight.max(1e-300)).collect(), joint)
            }
            // At the ends s is a half; its root mean square over the recording is 1 / sqrt 12.
            Kind::Drift(_, joint) => {
                let drifting = self.beside(kind, parameters);
                (drifting.into_iter().map(|torque| 0.5 * 12_f64.sqrt() * torque).collect(), joint)
            }
            _ => return 0.0,
        };
        let (mut own, mut torque) = (0.0, 0.0);
        for ((beside, measured), source) in beside.iter().zip(&all.torque).zip(&all.sources) {
            if source.joint == joint {
                own += beside * beside;
                torque += measured * measured;
            }
        }
        (own / torque.max(1e-300)).sqrt()
    }
}

/// Name and joint in words.
pub fn label(kind: Kind) -> String {
    match kind.joint() {
        Some(joint) => format!("{} of joint {}", kind.name(), joint + 1),
        None => kind.name().into(),
    }
}

fn correlation(one: &[f64], other: &[f64]) -> f64 {
    let size = (dot(one, one) * dot(other, other)).sqrt();
    if size > 0.0 { dot(one, other) / size } else { 0.0 }
}
