//! Common contract of all searches, tested on each: slices, seeds, box, costs that are not finite, errors.

use core::cell::{Cell, RefCell};

use super::*;
use crate::real::Real;

const BEETLES: usize = 8;
const CAPACITY: usize = 6;

type TestBso<T> = Bso<T, BEETLES, CAPACITY>;
type TestPso<T> = Pso<T, BEETLES, CAPACITY>;
type TestBas<T> = Bas<T, CAPACITY>;

/// Runs a generic check, `check(seed -> search)`, on every search of one precision.
macro_rules! on_every_search {
    ($scalar:ty, $problem:expr, $check:expr) => {{
        let problem = $problem;
        $check(&|seed| TestBso::<$scalar>::new(problem, BsoSettings::default(), seed).unwrap());
        $check(&|seed| TestBso::<$scalar>::new(problem, BsoSettings::paper(), seed).unwrap());
        $check(&|seed| TestPso::<$scalar>::new(problem, PsoSettings::default(), seed).unwrap());
        $check(&|seed| TestBas::<$scalar>::new(problem, BasSettings::default(), seed).unwrap());
    }};
}

/// Function with ripples everywhere: the adaptive swarm leaps several times within a few thousand
/// evaluations, and without leaps is scattered.
const RIPPLES: TestProblem = TestProblem::new(TestFunction::Rastrigin, 5);

fn slices_leave_equal_searches<T: Real, S: Search<T> + Clone + PartialEq>(new: &impl Fn(u64) -> S) {
    const TOTAL: u32 = 4_200;
    let mut whole = new(21);
    assert_eq!(whole.advance(&RIPPLES, TOTAL), TOTAL);
    for slice in [1, 7, 60] {
        let mut sliced = new(21);
        for _ in 0..TOTAL / slice {
            assert_eq!(sliced.advance(&RIPPLES, slice), slice);
            assert_eq!(sliced.advance(&RIPPLES, 0), 0);
        }
        assert!(sliced == whole, "slices of {slice}");
        assert_eq!(sliced.evaluations(), TOTAL);
    }
}

#[test]
fn slices_do_not_change_a_search() {
    on_every_search!(f64, &RIPPLES, slices_leave_equal_searches);
    on_every_search!(f32, &RIPPLES, slices_leave_equal_searches);
}

#[test]
fn the_ripples_make_the_adaptive_swarm_scatter_anew_and_keep_its_best() {
    let settings = BsoSettings::Adaptive(AdaptiveSettings { leaps: 0, ..AdaptiveSettings::default() });
    let mut swarm = TestBso::<f64>::new(&RIPPLES, settings, 21).unwrap();
    let mut best = f64::INFINITY;
    for _ in 0..4_200 {
        swarm.advance(&RIPPLES, 1);
        let now = swarm.best().expect("the cost is finite everywhere").value;
        assert!(now <= best);
        best = now;
    }
    let per_iteration = (BEETLES + 2 * 5) as u32;
    // Each scatter costs N evaluations more than whole iterations; an open one costs less than one.
    let restarts = (swarm.evaluations() - (swarm.iterations() + 1) * per_iteration) / BEETLES as u32;
    assert!(restarts >= 2, "{restarts} scatters in {} iterations", swarm.iterations());
}

fn seeds_decide<T: Real, S: Search<T> + Clone + PartialEq>(new: &impl Fn(u64) -> S) {
    let (mut one, mut same, mut other) = (new(5), new(5), new(6));
    for search in [&mut one, &mut same, &mut other] {
        search.advance(&RIPPLES, 500);
    }
    assert!(one == same);
    assert!(one.best() != other.best());
}

#[test]
fn the_same_seed_gives_the_same_bits_and_another_seed_others() {
    on_every_search!(f64, &RIPPLES, seeds_decide);
    on_every_search!(f32, &RIPPLES, seeds_decide);
}

/// Cost in a box with sides of very different length, least in its corner. Stores all values.
struct Watched {
    values: RefCell<Vec<f64>>,
}

impl<T: Real> Objective<T> for Watched {
    fn dimension(&self) -> usize {
        4
    }
    fn bounds(&self, coordinate: usize) -> (T, T) {
        let (low, high) = [(-3.0, 0.1), (1e3, 1e6), (-1e-3, 1e-3), (-7.7, -7.3)][coordinate];
        (T::from_double(low), T::from_double(high))
    }
    fn evaluate(&self, position: &[T]) -> T {
        assert_eq!(position.len(), 4);
        let mut cost = T::zero();
        for (coordinate, &entry) in position.iter().enumerate() {
            let (low, high): (T, T) = self.bounds(coordinate);
            assert!(low <= entry && entry <= high, "coordinate {coordinate}: {entry}");
            cost += (entry - low) / (high - low);
        }
        self.values.borrow_mut().push(cost.to_double());
        cost
    }
}

fn stays_inside<T: Real, S: Search<T>>(new: &impl Fn(u64) -> S) {
    for seed in 0..10 {
        let watched = Watched { values: RefCell::default() };
        let mut search = new(seed);
        search.advance(&watched, 1_000);
        assert_eq!(watched.values.borrow().len(), 1_000);
    }
}

#[test]
fn no_evaluation_is_ever_outside_the_box() {
    let watched = &Watched { values: RefCell::default() };
    on_every_search!(f64, watched, stays_inside);
    on_every_search!(f32, watched, stays_inside);
}

fn knows_its_best<T: Real, S: Search<T> + Clone>(new: &impl Fn(u64) -> S) {
    let watched = Watched { values: RefCell::default() };
    let mut search = new(3);
    assert!(search.best().is_none() && search.evaluations() == 0);
    for _ in 0..300 {
        search.advance(&watched, 1);
        let least = watched.values.borrow().iter().fold(f64::INFINITY, |a, &b| a.min(b));
        let best = search.best().expect("the cost is finite everywhere");
        assert_eq!(best.value.to_double(), least);
        let again = Watched { values: RefCell::default() };
        assert!(again.evaluate(best.position) == best.value, "the position belongs to the value");
    }
}

#[test]
fn a_run_cancelled_anywhere_has_the_best_of_all_its_evaluations() {
    let watched = &Watched { values: RefCell::default() };
    on_every_search!(f64, watched, knows_its_best);
    on_every_search!(f32, watched, knows_its_best);
}

/// Badly scaled bowl with four slabs of NaN, infinity, minus infinity and the largest number;
/// the minimum is between them.
struct Holes;

impl<T: Real> Objective<T> for Holes {
    fn dimension(&self) -> usize {
        5
    }
    fn bounds(&self, _coordinate: usize) -> (T, T) {
        (T::from_double(-10.0), T::from_double(10.0))
    }
    fn evaluate(&self, position: &[T]) -> T {
        let hole = |coordinate: usize| position[coordinate].to_double();
        if hole(0) > 2.0 {
            return T::from_double(f64::NAN);
        } else if hole(1) < -3.0 {
            return T::from_double(f64::INFINITY);
        } else if hole(2) > 4.0 {
            return T::from_double(f64::NEG_INFINITY);
        } else if hole(3) > 5.0 {
            return T::LARGEST;
        }
        position.iter().enumerate().fold(T::zero(), |sum, (i, &x)| {
            sum + T::from_double([1.0, 10.0, 100.0, 1e3, 1e4][i]) * (x - T::one()) * (x - T::one())
        })
    }
}

#[test]
fn costs_that_are_not_finite_do_not_poison_the_adaptive_search() {
    fn run<T: Real>() {
        for seed in 0..100 {
            let mut swarm = Bso::<T, 20, CAPACITY>::new(&Holes, BsoSettings::default(), seed).unwrap();
            // The slowest of 1,000 seeds needs 123. A corrupted metric never gets there.
            assert!(swarm.reach(&Holes, T::from_double(1e-3), 150), "seed {seed}: {:?}", swarm.best());
            assert!(swarm.best().is_some_and(|best| best.value >= T::zero()), "minus infinity is no best");
        }
    }
    run::<f64>();
    run::<f32>();
}

/// Rosenbrock's function; a fifth of its values, at random, are NaN.
struct Lossy(TestProblem);

impl Objective<f64> for Lossy {
    fn dimension(&self) -> usize {
        Objective::<f64>::dimension(&self.0)
    }
    fn bounds(&self, coordinate: usize) -> (f64, f64) {
        self.0.bounds(coordinate)
    }
    fn evaluate(&self, position: &[f64]) -> f64 {
        let seed = position.iter().fold(0_u64, |bits, x| bits.rotate_left(7) ^ x.to_bits());
        if Random::new(seed).below(5) == 0 { f64::NAN } else { self.0.evaluate(position) }
    }
}

#[test]
fn a_lost_fifth_of_all_values_only_slows_the_adaptive_search() {
    let cost = Lossy(TestProblem::new(TestFunction::Rosenbrock, 5));
    for seed in 0..40 {
        let mut swarm = Bso::<f64, 20, CAPACITY>::new(&cost, BsoSettings::default(), seed).unwrap();
        assert!(swarm.reach(&cost, 1e-3, 800), "seed {seed}: {:?}", swarm.best());
    }
}

/// Cost that is NaN everywhere until `forbidden` is cleared.
struct Nowhere {
    forbidden: Cell<bool>,
}

impl<T: Real> Objective<T> for Nowhere {
    fn dimension(&self) -> usize {
        3
    }
    fn bounds(&self, _coordinate: usize) -> (T, T) {
        (T::zero(), T::one())
    }
    fn evaluate(&self, position: &[T]) -> T {
        if self.forbidden.get() { T::from_double(f64::NAN) } else { position[0] }
    }
}

fn finds_nothing_where_nothing_is<T: Real, S: Search<T>>(new: &impl Fn(u64) -> S) {
    let nowhere = Nowhere { forbidden: Cell::new(true) };
    let mut search = new(1);
    search.advance(&nowhere, 2_000);
    assert!(search.best().is_none());
    nowhere.forbidden.set(false);
    search.advance(&nowhere, 2_000);
    assert!(search.best().is_some_and(|best| best.value < T::from_double(0.5)), "{:?}", search.best());
}

#[test]
fn a_cost_that_is_nowhere_finite_has_no_best_and_the_search_survives_it() {
    let nowhere = &Nowhere { forbidden: Cell::new(true) };
    on_every_search!(f64, nowhere, finds_nothing_where_nothing_is);
    on_every_search!(f32, nowhere, finds_nothing_where_nothing_is);
}

/// Cost with any dimension and any bounds for the last coordinate.
struct Shaped {
    dimension: usize,
    last: (f64, f64),
}

impl<T: Real> Objective<T> for Shaped {
    fn dimension(&self) -> usize {
        self.dimension
    }
    fn bounds(&self, coordinate: usize) -> (T, T) {
        let (low, high) = if coordinate + 1 == self.dimension { self.last } else { (0.0, 1.0) };
        (T::from_double(low), T::from_double(high))
    }
    fn evaluate(&self, position: &[T]) -> T {
        position[0]
    }
}

fn error_of(dimension: usize, last: (f64, f64)) -> Option<SwarmError> {
    let shaped = Shaped { dimension, last };
    let bso = TestBso::<f32>::new(&shaped, BsoSettings::default(), 1).err();
    assert_eq!(bso, TestPso::<f32>::new(&shaped, PsoSettings::default(), 1).err());
    assert_eq!(bso, TestBas::<f32>::new(&shaped, BasSettings::default(), 1).err());
    bso
}

#[test]
fn a_box_that_is_none_is_refused_by_name() {
    let unit = (0.0, 1.0);
    assert_eq!(error_of(CAPACITY, unit), None);
    assert_eq!(error_of(0, unit), Some(SwarmError::NoDimension));
    let above = SwarmError::DimensionAboveCapacity { dimension: CAPACITY + 1, capacity: CAPACITY };
    assert_eq!(error_of(CAPACITY + 1, unit), Some(above));
    for last in [
        (1.0, 0.0),
        (1.0, 1.0),
        (f64::NAN, 1.0),
        (0.0, f64::NAN),
        (f64::NEG_INFINITY, 0.0),
        (0.0, f64::INFINITY),
        (-3e38, 3e38),
    ] {
        assert_eq!(error_of(4, last), Some(SwarmError::Bounds { coordinate: 3 }), "{last:?}");
    }
}

#[test]
fn an_objective_of_another_dimension_is_not_evaluated() {
    let shaped = |dimension| Shaped { dimension, last: (0.0, 1.0) };
    let mut swarm = TestBso::<f32>::new(&shaped(3), BsoSettings::default(), 1).unwrap();
    assert_eq!(swarm.advance(&shaped(4), 10), 0);
    assert_eq!(swarm.evaluations(), 0);
    assert_eq!(swarm.advance(&shaped(3), 10), 10);
}

#[test]
fn settings_that_make_no_sense_are_refused_by_name() {
    let adaptive = |change: fn(&mut AdaptiveSettings<f64>)| {
        let mut settings = AdaptiveSettings::default();
        change(&mut settings);
        TestBso::new(&RIPPLES, BsoSettings::Adaptive(settings), 1).err()
    };
    assert_eq!(adaptive(|_| ()), None);
    assert_eq!(adaptive(|s| s.step_limit = 0.0), Some(SwarmError::Setting("step_limit")));
    assert_eq!(adaptive(|s| s.velocity_share = f64::NAN), Some(SwarmError::Setting("velocity_share")));
    assert_eq!(adaptive(|s| s.patience = 0), Some(SwarmError::Setting("patience")));
    let pso = PsoSettings { velocity_limit: f64::INFINITY, ..PsoSettings::default() };
    let error = TestPso::new(&RIPPLES, pso, 1).err();
    assert_eq!(error, Some(SwarmError::Setting("velocity_limit")));
    let bas = BasSettings { step_per_whisker: 0.0, ..BasSettings::default() };
    let error = TestBas::<f64>::new(&RIPPLES, bas, 1).err();
    assert_eq!(error, Some(SwarmError::Setting("step_per_whisker")));
    let paper = PaperSettings { step_per_whisker: 0.0, ..PaperSettings::default() };
    let error = TestBso::<f64>::new(&RIPPLES, BsoSettings::Paper(paper), 1).err();
    assert_eq!(error, Some(SwarmError::Setting("step_per_whisker")));
}

#[test]
fn one_dimension_and_two_beetles_are_enough() {
    let line = Shaped { dimension: 1, last: (0.5, 1.5) };
    let mut swarm = Bso::<f32, 2, 1>::new(&line, BsoSettings::default(), 9).unwrap();
    swarm.advance(&line, 400);
    assert_eq!(swarm.best().map(|best| best.value), Some(0.5));
}

#[test]
fn memory_is_what_the_documentation_says() {
    assert_eq!(size_of::<Bso<f32, 20, 13>>(), 9_016);
    assert_eq!(size_of::<Bso<f32, 20, 28>>(), 21_560);
}
