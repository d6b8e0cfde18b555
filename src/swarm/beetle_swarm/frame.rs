//! Shared frame of whiskers: orthonormal directions in metric coordinates, and the readings along them.
//!
//! Why: one beetle with two whiskers locates the minimum along one line. If the best beetles' whiskers point
//! in orthonormal directions, each parabola gives one coordinate of the minimum, and together they give it to
//! every beetle. The adaptive mode depends on this sharing.
//!
//! Along direction j, with f_0 at beetle j and f_r, f_l at its whiskers l away (l in metric coordinates):
//!   g = (f_r - f_l) / (2 l),   h = (f_r - 2 f_0 + f_l) / l^2
//!   s = -g / h where h > 0, else -sgn(g) times the usual whisker;   |s| <= step limit / |A z_j|
//! For beetle i at x_i the minimum is q_ij = s_j - w_j.(x_i - x_j) away along z_j.
//! Symbols: z_j unit vector in metric coordinates y = A^-1 x; d_j = A z_j its image in box coordinates;
//! w_j = A^-T z_j, so that w_j.x = z_j.y without y: one product with the metric per direction, none per
//! beetle.
//!
//! Source: own experiments; one parabola per direction is Newton's step in the subspace of the frame.
//! Cost: per direction two or three products with the metric (2 D^2 each) and 4 D j operations of
//! Gram-Schmidt, repeated per draw, at most 8 draws; memory N (3 D + 7) scalars.

use crate::real::{Real, abs, clamp, dot, is_finite, max, min, sign, sqrt};

use super::super::random::Random;
use super::super::rows::{add_scaled, live, live_mut, scale};
use super::super::search::is_usable;
use super::metric::Metric;

/// Most draws per direction before a coordinate axis is used.
const DRAWS: u32 = 8;
/// Least share of a direction outside the frame; with less it is drawn again.
const LEAST_REMAINDER: f64 = 1e-2;
/// Curvature above minus so many roundings of f over l^2 counts as convex.
const CURVATURE_ROUNDINGS: f64 = 8.0;

/// Limits of whiskers and steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reach<T> {
    /// Usual whisker length, metric coordinates.
    pub(crate) whisker: T,
    /// Longest whisker and step, box coordinates.
    pub(crate) limit: T,
    /// True if a step is the parabola's, where that has a minimum.
    pub(crate) parabola: bool,
    /// Length of a whisker along a metric axis, in place of the usual one; others are longer.
    pub(crate) long: Option<T>,
}

/// One direction of the frame and its beetle's readings.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Whisker<T> {
    /// Length |d_j| in the box of a metric step of 1.
    pub(crate) box_length: T,
    /// Length l, metric coordinates.
    pub(crate) length: T,
    /// Coordinate w_j . x_j.
    pub(crate) coordinate: T,
    /// Distance of the two personal bests that the direction joins, metric coordinates; negative for
    /// others.
    pub(crate) distance: T,
    /// `None` until both whiskers were read, and where a value was not finite.
    pub(crate) reading: Option<Reading<T>>,
}

impl<T: Real> Whisker<T> {
    fn unaimed() -> Self {
        Self {
            box_length: T::one(),
            length: T::one(),
            coordinate: T::zero(),
            distance: -T::one(),
            reading: None,
        }
    }
}

/// The parabola through a beetle and its two whiskers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Reading<T> {
    /// Slope g.
    pub(crate) slope: T,
    /// Curvature h.
    pub(crate) curvature: T,
    /// Step s from the beetle to the minimum.
    pub(crate) step: T,
    /// True if curved upwards, or flat within rounding.
    pub(crate) convex: bool,
}

/// Directions of up to N beetles.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Frame<T, const N: usize, const D: usize> {
    dimension: usize,
    /// Directions z_j, orthonormal, metric coordinates.
    pub(crate) direction: [[T; D]; N],
    /// Images d_j = A z_j, box coordinates.
    pub(crate) displacement: [[T; D]; N],
    /// Covectors w_j = A^-T z_j: w_j.x is the metric coordinate along z_j of a point x in box coordinates.
    pub(crate) covector: [[T; D]; N],
    pub(crate) whisker: [Whisker<T>; N],
}

impl<T: Real, const N: usize, const D: usize> Frame<T, N, D> {
    pub fn new(dimension: usize) -> Self {
        Self {
            dimension,
            direction: [[T::zero(); D]; N],
            displacement: [[T::zero(); D]; N],
            covector: [[T::zero(); D]; N],
            whisker: [Whisker::unaimed(); N],
        }
    }

    /// Number of directions in use: one per beetle, at most as many as an orthonormal frame can have.
    pub(crate) fn count(&self) -> usize {
        self.dimension.min(N)
    }

    /// Points direction `index` along `proposal` (metric coordinates), as far as that is orthogonal to the
    /// earlier ones. Otherwise it points along a random vector, in the last resort along a coordinate axis.
    ///
    /// The whisker has its usual length where that stays within the limit.
    pub(crate) fn aim(
        &mut self,
        index: usize,
        proposal: Option<[T; D]>,
        beetle: &[T; D],
        metric: &Metric<T, D>,
        reach: Reach<T>,
        random: &mut Random,
    ) {
        let index = index.min(N - 1);
        let direction = self.new_direction(index, proposal, random);
        let displacement = metric.to_box(&direction);
        let box_length = sqrt(dot(live(&displacement, self.dimension), live(&displacement, self.dimension)));
        let covector = metric.gradient_to_box(&direction);
        let largest = live(&direction, self.dimension).iter().fold(T::zero(), |most, &z| max(most, abs(z)));
        let coordinate = dot(live(&covector, self.dimension), live(beetle, self.dimension));
        self.direction[index] = direction;
        self.displacement[index] = displacement;
        self.covector[index] = covector;
        self.whisker[index] = Whisker {
            box_length,
            length: reach.long.map_or(min(reach.whisker, reach.limit / box_length), |long| long / largest),
            coordinate,
            distance: -T::one(),
            reading: None,
        };
    }

    fn new_direction(&self, index: usize, proposal: Option<[T; D]>, random: &mut Random) -> [T; D] {
        let mut proposal = proposal;
        for _ in 0..DRAWS {
            let candidate = proposal.take().unwrap_or_else(|| self.draw(random));
            if let Some(direction) = self.complement(index, candidate) {
                return direction;
            }
        }
        // Fewer than D directions leave at least one of the D axes with a remainder of 1 / sqrt(D).
        for axis in 0..self.dimension.min(D) {
            let mut candidate = [T::zero(); D];
            candidate[axis] = T::one();
            if let Some(direction) = self.complement(index, candidate) {
                return direction;
            }
        }
        [T::zero(); D]
    }

    fn draw(&self, random: &mut Random) -> [T; D] {
        let mut candidate = [T::zero(); D];
        for entry in live_mut(&mut candidate, self.dimension) {
            *entry = random.bell();
        }
        candidate
    }

    /// Unit vector along the part of a candidate that is orthogonal to the first `index` directions; `None`
    /// where too little remains.
    fn complement(&self, index: usize, mut candidate: [T; D]) -> Option<[T; D]> {
        let rest = live_mut(&mut candidate, self.dimension);
        // The unit of the cost, which a gradient contains, must not let its square underflow or overflow.
        let largest = rest.iter().fold(T::zero(), |most, &entry| max(most, abs(entry)));
        scale(rest, T::one() / largest);
        if !normalise(rest, T::one()) {
            return None;
        }
        for earlier in self.direction.iter().take(index) {
            let earlier = live(earlier, self.dimension);
            let along = dot(rest, earlier);
            add_scaled(rest, -along, earlier);
        }
        normalise(rest, T::from_double(LEAST_REMAINDER)).then_some(candidate)
    }

    /// Fits the parabola of direction `index` through the values at the beetle and at its whiskers.
    ///
    /// A value that is not finite leaves no reading: the direction then has no effect on moves or learning.
    pub(crate) fn read(&mut self, index: usize, centre: T, right: T, left: T, reach: Reach<T>) {
        let whisker = &mut self.whisker[index.min(N - 1)];
        whisker.reading = None;
        if !(is_usable(centre) && is_usable(right) && is_usable(left)) {
            return;
        }
        let square = whisker.length * whisker.length;
        let slope = (right - left) / (whisker.length + whisker.length);
        let curvature = ((right - centre) - (centre - left)) / square;
        if !(is_finite(slope) && is_finite(curvature)) {
            return;
        }
        let step = if reach.parabola && curvature > T::zero() {
            -slope / curvature
        } else {
            -sign(slope) * reach.whisker
        };
        let longest = reach.limit / whisker.box_length;
        whisker.reading = Some(Reading {
            slope,
            curvature,
            step: clamp(step, -longest, longest),
            convex: curvature > -T::from_double(CURVATURE_ROUNDINGS) * T::EPSILON * abs(centre) / square
                || curvature > T::zero(),
        });
    }
}

/// Scales a row to length 1. Returns false and leaves the row unchanged if it is
/// shorter than `least` or not finite.
fn normalise<T: Real>(row: &mut [T], least: T) -> bool {
    let length = sqrt(dot(row, row));
    let long_enough = length >= least && is_finite(length);
    if long_enough {
        scale(row, T::one() / length);
    }
    long_enough
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 6;
    const D: usize = 9;
    const REACH: Reach<f64> = Reach { whisker: 0.1, limit: 0.5, parabola: true, long: None };

    fn frame_of(dimension: usize, proposal: Option<[f64; D]>) -> (Frame<f64, N, D>, Metric<f64, D>) {
        let mut random = Random::new(4);
        let mut metric = Metric::identity(dimension);
        let mut frame = Frame::new(dimension);
        frame.aim(0, None, &[0.5; D], &metric, REACH, &mut random);
        metric.stretch(&frame.direction[0], &frame.displacement[0], &frame.covector[0], 4.0);
        for index in 0..frame.count() {
            frame.aim(index, proposal, &[0.5; D], &metric, REACH, &mut random);
        }
        (frame, metric)
    }

    #[test]
    fn directions_are_orthonormal_whatever_is_wished() {
        for dimension in [1, 2, 5, D] {
            for proposal in [None, Some([1.0; D]), Some([0.0; D]), Some([f64::NAN; D]), Some([1e200; D])] {
                let proposal = proposal.map(|mut proposal| {
                    proposal[dimension..].fill(0.0);
                    proposal
                });
                let (frame, metric) = frame_of(dimension, proposal);
                for one in 0..frame.count() {
                    for other in 0..=one {
                        let product = dot(&frame.direction[one], &frame.direction[other]);
                        let expected = if one == other { 1.0 } else { 0.0 };
                        // One pass of Gram-Schmidt with a remainder of at least 1e-2: 1e2 roundings.
                        assert!(abs(product - expected) < 1e-12, "{dimension} {proposal:?}: {product}");
                    }
                    assert_eq!(frame.displacement[one], metric.to_box(&frame.direction[one]));
                    assert!(frame.whisker[one].length * frame.whisker[one].box_length <= 0.5 + 1e-15);
                }
            }
        }
    }

    #[test]
    fn a_parabola_gives_its_own_minimum() {
        let (mut frame, _) = frame_of(4, None);
        let length = frame.whisker[1].length;
        let cost = |x: f64| 3.0 * (x - 0.02) * (x - 0.02) + 7.0;
        frame.read(1, cost(0.0), cost(length), cost(-length), REACH);
        let reading = frame.whisker[1].reading.expect("all values are finite");
        // Values around 7 leave 1e-15 of rounding, divided by l^2 h = 0.06.
        assert!(abs(reading.step - 0.02) < 1e-13 && abs(reading.curvature - 6.0) < 1e-11);
        assert!(reading.convex);
    }

    #[test]
    fn downhill_by_a_usual_whisker_where_the_cost_is_concave() {
        let (mut frame, _) = frame_of(4, None);
        frame.read(2, 1.0, 0.2, 0.4, REACH);
        let reading = frame.whisker[2].reading.expect("all values are finite");
        assert_eq!(reading.step, 0.1);
        assert!(!reading.convex);
    }

    #[test]
    fn what_is_not_finite_leaves_no_reading() {
        let (mut frame, _) = frame_of(4, None);
        let most = f64::MAX;
        for (centre, right, left) in
            [(most, 1.0, 1.0), (1.0, most, 2.0), (most, most, most), (1e308, -1e308, 1e308)]
        {
            frame.read(0, 1.0, 2.0, 2.0, REACH);
            frame.read(0, centre, right, left, REACH);
            assert_eq!(frame.whisker[0].reading, None);
        }
    }
}
