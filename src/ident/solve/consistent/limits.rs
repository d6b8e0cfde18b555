//! Allowed set of a leg's parameters, convex; completion and search stay inside.
//!
//! ```text
//! pseudo-inertia of every link positive definite
//! mass              0.2 .. 5 of the prior's
//! centre of mass    the prior's +- half the segment's length, each coordinate
//! extent            second moment about the prior's centre <= mass rho^2,  rho^2 = 15 k^2 + 3 reach^2
//! rotor, Coulomb, viscous    0 .. 5 of the prior's;    offset +- 5 (|prior| + Coulomb)
//! ```
//!
//! Every line but the first is linear in the 14 parameters. `reach` is half the segment's length. `k` is
//! the prior's radius of gyration about the centre of mass, at least a tenth of the length. Twice its
//! square is the trace of the inertia over mass.
//!
//! Without a prior the limits come from geometry and torque, and are so wide that only what a body can be
//! limits it. The centre of mass is within four segments' lengths of the joint. The last segment counts as
//! long as the longest known one, 1 m where none is known. Masses reach up to a hundred times what the
//! measured torque could need at a segment's length: a short body needs more mass for the same moment.
//! Rotor, friction and offset are limited to a quarter of the box of the base set
//! ([`crate::ident::solve::bounds`]). A neutral leg replaces the prior, small beside these limits, with its
//! centres of mass at the joints. Its standard deviations equal its own size
//! ([`Limits::deviations`]), so a zero in it carries no information.

use crate::ident::record::motion_record::Record;
use crate::ident::record::motion_record::Selection;
use crate::ident::record::row_model::RowModel;
use crate::ident::solve::bounds::{LinkPrior, measured_box, segment_length};
use crate::ident::solve::completion::prior_deviations;
use crate::model::{
    INERTIAL_PARAMETERS, JointParameters, LegParameters, LogCholesky, PARAMETERS_PER_JOINT, Parameter,
    RigidBody, Standing, is_physically_consistent,
};
use crate::real::{self, Real};

/// Smallest and largest share of the prior's mass and drive parameters.
const SHARE: (f64, f64) = (0.2, 5.0);
/// Smallest credible radius of gyration of a prior, over length.
const SMALLEST_SHAPE: f64 = 0.1;
/// Length of a segment where the geometry gives none, m.
const UNKNOWN_LENGTH_M: f64 = 1.0;
/// Farthest centre of mass of a leg without a prior, segments' lengths.
const UNKNOWN_REACH: f64 = 4.0;
/// Largest mass of a leg without a prior, over what ten times the measured torque could need.
const UNKNOWN_MASS: f64 = 10.0;
/// Parameters of a neutral leg over the most that the torque could need.
const NEUTRAL_SHARE: f64 = 0.05;
/// Extent of a ball over its radius of gyration, 1 / sqrt(3).
const ROUND: f64 = 0.577_350_269_189_626;
/// Linear conditions of one joint.
pub(super) const CONDITIONS: usize = 17;

/// Allowed values of one link and its drive.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct LinkLimits<T> {
    pub(crate) mass: (T, T),
    pub(crate) centre: [T; 3],
    /// Largest distance of the centre of mass from `centre`, each coordinate.
    pub(crate) reach: T,
    /// Radius of gyration about the centre of mass.
    pub(crate) gyration: T,
    /// Ranges of IA, FC, FV, OFF.
    pub(crate) drive: [(T, T); 4],
    /// Drive parameters that are estimated, in the order of `drive`.
    pub(crate) estimated: [bool; 4],
}

/// Limits of all links, and the leg assumed before any measurement.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits<T: Real, const N: usize> {
    pub(super) links: [LinkLimits<T>; N],
    origin: LegParameters<T, N>,
    deviations: LegParameters<T, N>,
}

impl<T: Real, const N: usize> Limits<T, N> {
    /// Limits from `prior`, or from geometry and measured torque without one.
    pub fn new<const B: usize>(
        model: &RowModel<T, N, B>,
        record: &Record<T, N, B>,
        prior: Option<&[LinkPrior<T>; N]>,
    ) -> Self {
        let measured = measured_box(model, record);
        let neutral = neutral(model, record, &measured.high);
        let believed = prior.unwrap_or(&neutral);
        let links = core::array::from_fn(|joint| {
            let link = &believed[joint];
            let (low, high) = (T::from_double(SHARE.0), T::from_double(SHARE.1));
            let reach = if prior.is_some() { 0.5 } else { 0.5 * UNKNOWN_REACH };
            let length = match prior {
                Some(prior) => segment_length(model, prior, joint),
                None => T::from_double(2.0) * known_length(model, joint),
            };
            let inertia = link.body.inertia.trace();
            let shape = real::sqrt(real::max(inertia, T::zero()) / (T::from_double(2.0) * link.body.mass));
            let most = |parameter, value: T| {
                let share = high * value;
                if share > T::zero() {
                    share
                } else {
                    widest(model, record, &measured.high, joint, parameter)
                }
            };
            let positive = |parameter, value| (T::zero(), most(parameter, value));
            let offset = most(Parameter::OFF, real::abs(link.offset) + link.coulomb_friction);
            LinkLimits {
                mass: if prior.is_some() {
                    (low * link.body.mass, high * link.body.mass)
                } else {
                    (T::zero(), T::from_double(UNKNOWN_MASS / NEUTRAL_SHARE) * link.body.mass)
                },
                centre: core::array::from_fn(|axis| link.body.centre_of_mass[axis]),
                reach: T::from_double(reach) * length,
                gyration: real::max(shape, T::from_double(SMALLEST_SHAPE) * length),
                drive: [
                    positive(Parameter::IA, link.rotor_inertia),
                    positive(Parameter::FC, link.coulomb_friction),
                    positive(Parameter::FV, link.viscous_friction),
                    (-offset, offset),
                ],
                estimated: core::array::from_fn(|index| {
                    let parameter = Parameter::ALL[INERTIAL_PARAMETERS + index];
                    model.base.standing(joint, parameter) != Standing::Off
                        && !record.selection.drops(model, joint, parameter)
                }),
            }
        });
        let mut origin = crate::ident::solve::bounds::prior_parameters(believed);
        hold_at_zero(&links, &mut origin);
        let deviations = match prior {
            Some(_) => prior_deviations(&origin),
            None => core::array::from_fn(|joint| sizes(&neutral[joint], known_length(model, joint))),
        };
        Self { links, origin, deviations }
    }

    /// Holds at zero what `selection` drops.
    pub(super) fn hold<const B: usize>(&mut self, model: &RowModel<T, N, B>, selection: &Selection<T, N, B>) {
        for (joint, link) in self.links.iter_mut().enumerate() {
            for (index, estimated) in link.estimated.iter_mut().enumerate() {
                *estimated &= !selection.drops(model, joint, Parameter::ALL[INERTIAL_PARAMETERS + index]);
            }
        }
        hold_at_zero(&self.links, &mut self.origin);
    }

    /// Prior, or a neutral leg without one; zero for parameters that are not estimated.
    pub(crate) fn origin(&self) -> &LegParameters<T, N> {
        &self.origin
    }

    /// Standard deviations of [`Self::origin`].
    pub(crate) fn deviations(&self) -> &LegParameters<T, N> {
        &self.deviations
    }

    /// A leg well inside: round bodies with the prior's masses, centres of mass and sizes.
    pub(crate) fn inside(&self) -> LegParameters<T, N> {
        core::array::from_fn(|joint| {
            let link = &self.links[joint];
            let extent = real::ln(T::from_double(ROUND) * link.gyration);
            let mass = T::from_double(0.5) * real::ln(self.origin[joint][Parameter::M.index()]);
            let [x, y, z] = link.centre;
            let zero = T::zero();
            let body = LogCholesky([mass, extent, extent, extent, zero, zero, zero, x, y, z]).parameters();
            let drive: [T; 4] = core::array::from_fn(|index| {
                let (low, high) = link.drive[index];
                if link.estimated[index] {
                    low + T::from_double(SHARE.0) * (high - low)
                } else {
                    self.origin[joint][INERTIAL_PARAMETERS + index]
                }
            });
            crate::model::inertia::joint(&body, &drive)
        })
    }

    /// True if physically consistent: every link a possible body, no negative rotor inertia or friction.
    pub fn consistent(parameters: &LegParameters<T, N>) -> bool {
        parameters.iter().all(|joint| {
            let never_negative = [Parameter::IA, Parameter::FC, Parameter::FV];
            is_physically_consistent(&crate::model::inertia::inertial(joint))
                && never_negative.iter().all(|parameter| joint[parameter.index()] >= T::zero())
        })
    }

    /// True if physically consistent and within the limits.
    pub(crate) fn allow(&self, parameters: &LegParameters<T, N>) -> bool {
        Self::consistent(parameters)
            && self.links.iter().zip(parameters).all(|(link, joint)| {
                (0..CONDITIONS).all(|index| {
                    link.condition(index).is_none_or(|condition| condition.slack(joint) >= T::zero())
                })
            })
    }
}

/// Zeroes what is not estimated: the torque model has zero there, whatever the prior says.
fn hold_at_zero<T: Real, const N: usize>(links: &[LinkLimits<T>; N], origin: &mut LegParameters<T, N>) {
    for (link, joint) in links.iter().zip(origin) {
        for (slot, estimated) in joint.iter_mut().skip(INERTIAL_PARAMETERS).zip(link.estimated) {
            if !estimated {
                *slot = T::zero();
            }
        }
    }
}

/// A linear condition: gradient . parameters + constant > 0.
pub(super) struct Condition<T> {
    pub(crate) gradient: JointParameters<T>,
    pub(crate) constant: T,
}

impl<T: Real> Condition<T> {
    pub(crate) fn slack(&self, parameters: &JointParameters<T>) -> T {
        self.gradient.iter().zip(parameters).fold(self.constant, |sum, (&slope, &value)| sum + slope * value)
    }
}

impl<T: Real> LinkLimits<T> {
    /// One of the [`CONDITIONS`]; `None` for a drive parameter that is not estimated.
    pub(crate) fn condition(&self, index: usize) -> Option<Condition<T>> {
        let mut gradient = [T::zero(); PARAMETERS_PER_JOINT];
        let mut constant = T::zero();
        let mass = Parameter::M.index();
        match index {
            0 => (gradient[mass], constant) = (T::one(), -self.mass.0),
            1 => (gradient[mass], constant) = (-T::one(), self.mass.1),
            2..=7 => {
                let axis = (index - 2) / 2;
                let sign = if index.is_multiple_of(2) { T::one() } else { -T::one() };
                gradient[mass] = self.reach - sign * self.centre[axis];
                gradient[Parameter::HX.index() + axis] = sign;
            }
            8 => {
                let squared = self.centre.iter().fold(T::zero(), |sum, &c| sum + c * c);
                gradient[mass] = self.largest_extent_squared() - squared;
                for axis in 0..3 {
                    gradient[Parameter::HX.index() + axis] = T::from_double(2.0) * self.centre[axis];
                }
                for parameter in [Parameter::XX, Parameter::YY, Parameter::ZZ] {
                    gradient[parameter.index()] = T::from_double(-0.5);
                }
            }
            9..CONDITIONS => {
                let drive = (index - 9) / 2;
                if !self.estimated[drive] {
                    return None;
                }
                let (low, high) = self.drive[drive];
                let lower = index % 2 == 1;
                gradient[INERTIAL_PARAMETERS + drive] = if lower { T::one() } else { -T::one() };
                constant = if lower { -low } else { high };
            }
            _ => return None,
        }
        Some(Condition { gradient, constant })
    }

    fn largest_extent_squared(&self) -> T {
        T::from_double(15.0) * self.gyration * self.gyration + T::from_double(3.0) * self.reach * self.reach
    }
}

/// Length of a segment as far as the geometry gives it.
fn known_length<T: Real, const N: usize, const B: usize>(model: &RowModel<T, N, B>, joint: usize) -> T {
    let own = model.chain.distance_to(joint + 1).unwrap_or(T::zero());
    let longest = longest(model);
    if own > T::zero() {
        own
    } else if longest > T::zero() {
        longest
    } else {
        T::from_double(UNKNOWN_LENGTH_M)
    }
}

/// Longest segment that the geometry gives; zero where it gives none.
fn longest<T: Real, const N: usize, const B: usize>(model: &RowModel<T, N, B>) -> T {
    let lengths = (1..N).filter_map(|index| model.chain.distance_to(index));
    lengths.fold(T::zero(), real::max)
}

/// Priors of links known only by geometry and torque.
fn neutral<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &Record<T, N, B>,
    high: &[T; B],
) -> [LinkPrior<T>; N] {
    let mut most = T::zero();
    for (base, &value) in high.iter().enumerate().take(model.base.rank()) {
        let Some((joint, parameter)) = model.base.independent(base) else { continue };
        let length = known_length(model, joint);
        let mass = match parameter {
            Parameter::HX | Parameter::HY | Parameter::HZ => value / length,
            Parameter::XX | Parameter::XY | Parameter::XZ | Parameter::YY | Parameter::YZ | Parameter::ZZ => {
                value / (length * length)
            }
            Parameter::M => value,
            _ => T::zero(),
        };
        most = real::max(most, mass);
    }
    let mass = T::from_double(NEUTRAL_SHARE) * real::max(most, T::from_double(1e-3));
    core::array::from_fn(|joint| {
        let length = known_length(model, joint);
        let share = |parameter| T::from_double(NEUTRAL_SHARE) * widest(model, record, high, joint, parameter);
        LinkPrior {
            body: RigidBody {
                mass,
                centre_of_mass: nalgebra::Vector3::zeros(),
                inertia: nalgebra::Matrix3::from_diagonal_element(
                    T::from_double(0.05) * mass * length * length,
                ),
            },
            rotor_inertia: share(Parameter::IA),
            coulomb_friction: share(Parameter::FC),
            viscous_friction: share(Parameter::FV),
            offset: T::zero(),
        }
    })
}

/// Size of a neutral link's parameters, for those that are zero too: first moments and inertias of its mass
/// at a segment's length, an offset as large as its Coulomb friction.
fn sizes<T: Real>(link: &LinkPrior<T>, length: T) -> JointParameters<T> {
    let moment = link.body.mass * length;
    let mut body = [moment * length; INERTIAL_PARAMETERS];
    for parameter in [Parameter::HX, Parameter::HY, Parameter::HZ] {
        body[parameter.index()] = moment;
    }
    body[Parameter::M.index()] = link.body.mass;
    let friction = link.coulomb_friction;
    crate::model::inertia::joint(&body, &[link.rotor_inertia, friction, link.viscous_friction, friction])
}

/// Largest value of a drive parameter that the measured torque could need.
fn widest<T: Real, const N: usize, const B: usize>(
    model: &RowModel<T, N, B>,
    record: &Record<T, N, B>,
    high: &[T; B],
    joint: usize,
    parameter: Parameter,
) -> T {
    let carrier = model.base.carriers(joint, parameter).next();
    let measured = carrier.and_then(|base| high.get(base)).copied().unwrap_or(T::zero());
    let torque = record.torque.get(joint).map_or(T::zero(), |size| size.root_mean_square);
    real::max(measured, real::max(torque, T::from_double(1e-3)))
}
