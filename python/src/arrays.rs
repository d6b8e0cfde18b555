//! Arrays of numpy as rows of numbers, and rows as arrays.

use numpy::{AllowTypeChange, IntoPyArray, PyArray1, PyArrayDyn, PyArrayLikeDyn, PyArrayMethods};
use pyo3::prelude::*;

use crate::error::argument;

/// An array, or what numpy can convert to one.
pub type Numbers<'py> = PyArrayLikeDyn<'py, f64, AllowTypeChange>;

/// One number per sample.
pub fn column(name: &str, array: &Numbers<'_>) -> PyResult<Vec<f64>> {
    let array = array.as_array();
    if array.ndim() != 1 {
        return Err(argument(format!("{name} has shape {:?}; needed is (samples,)", array.shape())));
    }
    Ok(array.iter().copied().collect())
}

/// One row of numbers per sample.
pub struct Rows {
    /// Rows, one after the other.
    pub numbers: Vec<f64>,
    /// Numbers in a row.
    pub width: usize,
    /// Whether a single row was given, without the dimension of the samples.
    pub is_single: bool,
}

impl Rows {
    /// Reads an array of shape `(samples, width)`, or `(width,)` for one sample.
    pub fn of(name: &str, array: &Numbers<'_>, width: usize) -> PyResult<Self> {
        let array = array.as_array();
        let (is_single, fits) = match array.shape() {
            [only] => (true, *only == width),
            [_, last] => (false, *last == width),
            _ => (false, false),
        };
        if !fits {
            return Err(argument(format!(
                "{name} has shape {:?}; needed is (samples, {width}), or ({width},) for one sample: a column for each joint",
                array.shape()
            )));
        }
        let numbers: Vec<f64> = array.iter().copied().collect();
        if let Some(at) = numbers.iter().position(|number| !number.is_finite()) {
            let (sample, joint, value) = (at / width, at % width, numbers[at]);
            return Err(argument(format!(
                "{name}[{sample}, {joint}] is {value}; all numbers must be finite"
            )));
        }
        Ok(Self { numbers, width, is_single })
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.numbers.len() / self.width
    }
}

/// Array of this shape; a single sample loses its first dimension.
pub fn shaped<'py>(
    py: Python<'py>,
    numbers: Vec<f64>,
    shape: &[usize],
    is_single: bool,
) -> PyResult<Bound<'py, PyArrayDyn<f64>>> {
    let shape = if is_single { &shape[1..] } else { shape };
    numbers.into_pyarray(py).reshape(shape)
}

/// Array of one dimension.
pub fn vector(py: Python<'_>, numbers: Vec<f64>) -> Bound<'_, PyArray1<f64>> {
    numbers.into_pyarray(py)
}

/// Value of JSON as a Python object.
pub fn object<'py>(py: Python<'py>, json: &str) -> PyResult<Bound<'py, PyAny>> {
    py.import("json")?.call_method1("loads", (json,))
}
