//! The box in which the swarm searches: what the prior allows, by interval arithmetic.
//!
//! ```text
//! mass            0.2 .. 5 of the prior's
//! centre of mass  the prior's +- half the segment's length, each coordinate
//! inertia         about the centre of mass: diagonal 0.2 .. 5 of the prior's, products +- half the largest
//! rotor, Coulomb, viscous   0 .. 5 of the prior's
//! offset          +- 5 (|prior| + Coulomb)
//! ```
//!
//! Interval sums and products give the ranges about the joint's origin; the base parameters' terms turn them
//! into the box of the base set. The box contains every leg that the ranges allow, and more. Two kinds of
//! range are replaced by the most that the measured torque could need: those of zero width (a prior of zero)
//! and all without a prior. That limit is ten times the torque over the size of its column, for the joint
//! that allows least: one parameter alone must not exceed any joint's torque tenfold. With the largest over
//! the joints, an inertia with little effect on one joint could change another joint's torque by 1e5 N m.

use super::constrained::ParameterBox;
use crate::ident::record::motion_record::Record;
use crate::ident::record::row_model::RowModel;
use crate::model::{self, LegParameters, PARAMETERS_PER_JOINT, Parameter, RigidBody};
use crate::real::{self, Real};

/// Prior of one link and joint, known before any measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LinkPrior<T> {
    /// Mass, centre of mass and inertia about it.
    pub body: RigidBody<T>,
    /// Rotor inertia at the joint, kg m^2.
    pub rotor_inertia: T,
    /// Coulomb friction, N m.
    pub coulomb_friction: T,
    /// Viscous friction, N m s/rad.
    pub viscous_friction: T,
    /// Torque offset, N m.
    pub offset: T,
}

/// Largest and smallest share of the prior's mass, inertia and friction.
const SHARE: (f64, f64) = (0.2, 5.0);
/// Largest torque of one base parameter alone, in units of the measured torque.
const TORQUE_SHARE: f64 = 10.0;
/// Lower limit of a segment's length, m.
const SHORTEST_SEGMENT_M: f64 = 0.05;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Interval<T>(T, T);

impl<T: Real> Interval<T> {
    fn zero() -> Self {
        Self(T::zero(), T::zero())
    }
    fn around(centre: T, reach: T) -> Self {
        Self(centre - reach, centre + reach)
    }
    fn shares(value: T, (low, high): (T, T)) -> Self {
        Self(value * low, value * high)
    }
    fn add(self, other: Self) -> Self {
        Self(self.0 + other.0, self.1 + other.1)
    }
    fn times(self, other: Self) -> Self {
        let products = [self.0 * other.0, self.0 * other.1, self.1 * other.0, self.1 * other.1];
        let (mut low, mut high) = (products[0], products[0]);
        for product in products {
            low = real::min(low, product);
            high = real::max(high, product);
        }
        Self(low, high)
    }
    fn square(self) -> Self {
        let (low, high) = (self.0 * self.0, self.1 * self.1);
        let crosses = self.0 < T::zero() && self.1 > T::zero();
        Self(if crosses { T::zero() } else { real::min(low, high) }, real::max(low, high))
    }
    fn scaled(self, factor: T) -> Self {
        self.times(Self(factor, factor))
    }
}

impl<T: Real> LinkPrior<T> {
    /// Converts to another precision.
    pub fn convert<U: Real>(&self) -> LinkPrior<U> {
        let convert = |value: T| U::from_double(value.to_double());
        LinkPrior {
            body: RigidBody {
                mass: convert(self.body.mass),
                centre_of_mass: self.body.centre_of_mass.map(convert),
                inertia: self.body.inertia.map(convert),
            },
            rotor_inertia: convert(self.rotor_inertia),
            coulomb_friction: convert(self.coulomb_friction),
            viscous_friction: convert(self.viscous_friction),
            offset: convert(self.offset),
        }
    }

    /// Ranges of the fourteen parameters for a segment of this length.
    fn ranges(&self, length: T) -> [Interval<T>; PARAMETERS_PER_JOINT] {
        let share = (T::from_double(SHARE.0), T::from_double(SHARE.1));
        let most = share.1;
        let mass = Interval::shares(self.body.mass, share);
        let reach = T::from_double(0.5) * length;
        let centre: [_; 3] =
            core::array::from_fn(|axis| Interval::around(self.body.centre_of_mass[axis], reach));
        let inertia = &self.body.inertia;
        let largest = real::max(inertia.m11, real::max(inertia.m22, inertia.m33));
        let product_reach = T::from_double(0.5) * most * largest;
        let diagonal = |value: T, one: usize, other: usize| {
            Interval::shares(value, share).add(mass.times(centre[one].square().add(centre[other].square())))
        };
        let product = |value: T, one: usize, other: usize| {
            Interval::around(value, product_reach)
                .add(mass.times(centre[one]).times(centre[other]).scaled(-T::one()))
        };
        let mut ranges = [Interval::zero(); PARAMETERS_PER_JOINT];
        let friction_share = |value: T| Interval(T::zero(), value * most);
        let values = [
            (Parameter::XX, diagonal(inertia.m11, 1, 2)),
            (Parameter::XY, product(inertia.m12, 0, 1)),
            (Parameter::XZ, product(inertia.m13, 0, 2)),
            (Parameter::YY, diagonal(inertia.m22, 0, 2)),
            (Parameter::YZ, product(inertia.m23, 1, 2)),
            (Parameter::ZZ, diagonal(inertia.m33, 0, 1)),
            (Parameter::HX, mass.times(centre[0])),
            (Parameter::HY, mass.times(centre[1])),
            (Parameter::HZ, mass.times(centre[2])),
            (Parameter::M, mass),
            (Parameter::IA, friction_share(self.rotor_inertia)),
            (Parameter::FC, friction_share(self.coulomb_friction)),
            (Parameter::FV, friction_share(self.viscous_friction)),
            (
                Parameter::OFF,
                Interval::around(T::zero(), most * (real::abs(self.offset) + self.coulomb_friction)),
            ),
        ];
        for (parameter, range) in values {
            ranges[parameter.index()] = range;
        }
        ranges
    }
}

/// Search box of the base parameters.
pub(crate) fn search_box<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &Record<T, N, B>,
    prior: Option<&[LinkPrior<T>; N]>,
) -> ParameterBox<T, B> {
    let mut bounds = measured_box(model, record);
    let Some(prior) = prior else { return bounds };
    let ranges = ranges(model, prior);
    for base in 0..model.base.rank() {
        let mut total = Interval::zero();
        for (terms, ranges) in model.base.terms(base).iter().zip(&ranges) {
            for (&factor, &range) in terms.iter().zip(ranges) {
                if factor != T::zero() {
                    total = total.add(range.scaled(factor));
                }
            }
        }
        if total.1 > total.0 && real::is_finite(total.0) && real::is_finite(total.1) {
            (bounds.low[base], bounds.high[base]) = (total.0, total.1);
        }
    }
    bounds
}

fn ranges<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    prior: &[LinkPrior<T>; N],
) -> [[Interval<T>; PARAMETERS_PER_JOINT]; N] {
    core::array::from_fn(|joint| prior[joint].ranges(segment_length(model, prior, joint)))
}

/// Smallest and largest values that a prior allows for the single parameters. The box of the base parameters
/// is made from these ranges.
pub fn parameter_box<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    prior: &[LinkPrior<T>; N],
) -> (LegParameters<T, N>, LegParameters<T, N>) {
    let ranges = ranges(model, prior);
    (ranges.map(|joint| joint.map(|range| range.0)), ranges.map(|joint| joint.map(|range| range.1)))
}

/// Distance to the next joint; for the last segment, twice the distance of its centre of mass.
pub(super) fn segment_length<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    prior: &[LinkPrior<T>; N],
    joint: usize,
) -> T {
    let suggested = T::from_double(2.0)
        * real::sqrt(prior[joint].body.centre_of_mass.dot(&prior[joint].body.centre_of_mass));
    let to_next = model.chain.distance_to(joint + 1).unwrap_or(T::zero());
    real::max(to_next, real::max(suggested, T::from_double(SHORTEST_SEGMENT_M)))
}

/// Box from the measured torque: each bound is the torque's size over the column's, least of all joints.
pub(super) fn measured_box<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &Record<T, N, B>,
) -> ParameterBox<T, B> {
    let mut bounds = ParameterBox { low: [T::zero(); B], high: [T::zero(); B] };
    for base in 0..model.base.rank() {
        let mut reach = None;
        for ((factor, size), &rows) in record.factors.iter().zip(&record.torque).zip(&record.rows) {
            let rows = real::sqrt(T::from_double(f64::from(rows)));
            let length = factor.column_length(base);
            if length > T::zero() {
                let here = size.root_mean_square * rows / length;
                reach = Some(reach.map_or(here, |least| real::min(least, here)));
            }
        }
        bounds.high[base] = T::from_double(TORQUE_SHARE) * reach.unwrap_or(T::zero());
        let never_negative =
            model.base.independent(base).is_some_and(|(_, parameter)| parameter.is_never_negative());
        bounds.low[base] = if never_negative { T::zero() } else { -bounds.high[base] };
    }
    bounds
}

/// All fourteen parameters of every joint, at the prior's values.
pub fn prior_parameters<T: Real, const N: usize>(prior: &[LinkPrior<T>; N]) -> LegParameters<T, N> {
    core::array::from_fn(|joint| {
        let link = &prior[joint];
        let drive = [link.rotor_inertia, link.coulomb_friction, link.viscous_friction, link.offset];
        model::inertia::joint(&link.body.to_parameters(), &drive)
    })
}
