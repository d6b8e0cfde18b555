//! `beetle_swarm`: the firmware's search on a user's own function.

use std::cell::{Cell, RefCell};

use pyo3::prelude::*;
use scarab::swarm::{Bso, BsoSettings, Objective, Search, SwarmError};

use crate::arrays::{Array, Numbers, vector};
use crate::error::argument;
use crate::recording::{named, record};

/// Beetles of the swarm, as on the board.
const BEETLES: usize = 20;
/// Largest number of coordinates.
const CAPACITY: usize = 64;

/// Function of Python over a box.
struct Callback<'py> {
    py: Python<'py>,
    function: &'py Bound<'py, PyAny>,
    bounds: Vec<(f64, f64)>,
    /// First exception of the function.
    raised: RefCell<Option<PyErr>>,
}

impl Objective<f64> for Callback<'_> {
    fn dimension(&self) -> usize {
        self.bounds.len()
    }

    fn bounds(&self, coordinate: usize) -> (f64, f64) {
        self.bounds[coordinate]
    }

    fn evaluate(&self, position: &[f64]) -> f64 {
        if self.raised.borrow().is_some() {
            return f64::NAN;
        }
        let value = self.function.call1((vector(self.py, position.to_vec()),));
        value.and_then(|value| value.extract()).unwrap_or_else(|error| {
            *self.raised.borrow_mut() = Some(error);
            f64::NAN
        })
    }
}

#[doc = include_str!(concat!(env!("OUT_DIR"), "/beetle_swarm"))]
#[pyfunction]
#[pyo3(signature = (objective, bounds, *, evaluations = 20_000, goal = None, seed = 1, rules = "adaptive"))]
pub fn beetle_swarm<'py>(
    py: Python<'py>,
    objective: Bound<'py, PyAny>,
    bounds: Numbers<'py>,
    evaluations: u32,
    goal: Option<f64>,
    seed: u64,
    rules: &str,
) -> PyResult<Bound<'py, PyAny>> {
    let bounds = pairs(&bounds)?;
    if evaluations == 0 || goal.is_some_and(f64::is_nan) {
        return Err(argument("evaluations must be at least 1, and goal a number"));
    }
    let _depth = Depth::enter()?;
    let settings = [("adaptive", BsoSettings::default()), ("paper", BsoSettings::paper())];
    let settings = named("rules", rules, &settings)?;
    let callback = Callback { py, function: &objective, bounds, raised: RefCell::new(None) };
    let mut swarm = Box::new(
        Bso::<f64, BEETLES, CAPACITY>::new(&callback, settings, seed)
            .map_err(|error| argument(words(error, &callback.bounds)))?,
    );
    while swarm.evaluations() < evaluations {
        let left = evaluations - swarm.evaluations();
        swarm.advance(&callback, left.min(BEETLES as u32));
        if let Some(error) = callback.raised.take() {
            return Err(error);
        }
        py.check_signals()?;
        if goal.is_some_and(|goal| swarm.best().is_some_and(|best| best.value <= goal)) {
            break;
        }
    }
    let Some(best) = swarm.best() else {
        let spent = swarm.evaluations();
        return Err(argument(format!("the objective was not finite at any of {spent} positions")));
    };
    let fields = (vector(py, best.position.to_vec()), best.value, swarm.evaluations(), swarm.iterations());
    record(py, "Minimum")?.call1(fields)
}

/// Bounds of each coordinate.
fn pairs(bounds: &Numbers<'_>) -> PyResult<Vec<(f64, f64)>> {
    let array = Array::new("bounds", bounds)?;
    match array.shape[..] {
        [0] | [0, _] => Ok(Vec::new()),
        [_, 2] => Ok(array.numbers.chunks_exact(2).map(|pair| (pair[0], pair[1])).collect()),
        _ => {
            let shape = array.shape_text();
            Err(argument(format!(
                "bounds has the shape {shape}; expected a pair (low, high) for each coordinate"
            )))
        }
    }
}

/// Searches inside objectives of searches: each needs stack.
struct Depth;

thread_local! {
    static DEPTH: Cell<u32> = const { Cell::new(0) };
}

/// Largest depth of nested searches.
const DEEPEST: u32 = 8;

impl Depth {
    fn enter() -> PyResult<Self> {
        if DEPTH.get() >= DEEPEST {
            return Err(argument(format!(
                "the objective searches again: at most {DEEPEST} searches may be nested"
            )));
        }
        DEPTH.set(DEPTH.get() + 1);
        Ok(Self)
    }
}

impl Drop for Depth {
    fn drop(&mut self) {
        DEPTH.set(DEPTH.get() - 1);
    }
}

fn words(error: SwarmError, bounds: &[(f64, f64)]) -> String {
    match error {
        SwarmError::NoDimension => "bounds is empty; expected a pair (low, high) for each coordinate".into(),
        SwarmError::DimensionAboveCapacity { dimension, capacity } => {
            format!("bounds has {dimension} pairs; expected at most {capacity}")
        }
        SwarmError::Bounds { coordinate } => {
            let (low, high) = bounds[coordinate];
            format!(
                "bounds[{coordinate}] is ({low:?}, {high:?}); both must be finite, the first below the second"
            )
        }
        SwarmError::Setting(name) => format!("the setting {name} is invalid"),
    }
}
