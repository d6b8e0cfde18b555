//! Arrays of numpy as numbers, and numbers as arrays.

use numpy::{IntoPyArray, PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;

use crate::error::argument;

/// An array, or what numpy can convert to one.
pub type Numbers<'py> = Bound<'py, PyAny>;

/// Kinds of numpy's types that are numbers, and Python objects that may be numbers.
const KINDS: &str = "biufO";
/// Largest number of dimensions of any argument.
const DIMENSIONS: usize = 2;

/// Copied array.
pub struct Array {
    pub shape: Vec<usize>,
    /// Numbers, row by row.
    pub numbers: Vec<f64>,
}

impl Array {
    /// Copies an array of at most two dimensions.
    pub fn new(name: &str, given: &Numbers<'_>) -> PyResult<Self> {
        let numpy = given.py().import("numpy")?;
        if numpy.getattr("ma")?.call_method1("is_masked", (given,))?.is_truthy()? {
            return Err(argument(format!(
                "{name} is a masked array: drop the masked samples, or fill them with `filled`"
            )));
        }
        let array = numpy
            .call_method1("asarray", (given,))
            .map_err(|error| argument(format!("{name} is not an array of numbers: {error}")))?;
        let dimensions: usize = array.getattr("ndim")?.extract()?;
        if dimensions > DIMENSIONS {
            return Err(argument(format!(
                "{name} has {dimensions} dimensions; expected at most {DIMENSIONS}"
            )));
        }
        let kind: char = array.getattr("dtype")?.getattr("kind")?.extract()?;
        if !KINDS.contains(kind) {
            let found = array.getattr("dtype")?;
            return Err(argument(format!("{name} has the type {found}; expected real numbers")));
        }
        // Records of a logger are neither contiguous nor aligned, which the views of Rust need.
        let array = numpy
            .call_method1("require", (array, "float64", ["C", "A"]))
            .map_err(|error| argument(format!("{name} is not an array of numbers: {error}")))?;
        let array: Bound<'_, PyArrayDyn<f64>> = array.cast_into()?;
        Ok(Self { shape: array.shape().to_vec(), numbers: array.to_vec()? })
    }

    /// Shape as Python writes it.
    pub fn shape_text(&self) -> String {
        tuple(&self.shape)
    }
}

/// Shape as Python writes it.
fn tuple(shape: &[usize]) -> String {
    match shape {
        [one] => format!("({one},)"),
        _ => format!("({})", shape.iter().map(usize::to_string).collect::<Vec<_>>().join(", ")),
    }
}

/// One number per sample: a vector, or a matrix of one row or column, as files of MATLAB hold it.
pub fn column(name: &str, given: &Numbers<'_>, length: &str) -> PyResult<Vec<f64>> {
    let array = Array::new(name, given)?;
    match array.shape[..] {
        [_] | [1, _] | [_, 1] => Ok(array.numbers),
        _ => Err(argument(format!("{name} has the shape {}; expected ({length},)", array.shape_text()))),
    }
}

/// One row of finite numbers per sample.
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
    pub fn new(name: &str, given: &Numbers<'_>, width: usize) -> PyResult<Self> {
        let array = Array::new(name, given)?;
        let (is_single, fits) = match array.shape[..] {
            [only] => (true, only == width),
            [_, last] => (false, last == width),
            _ => (false, false),
        };
        if !fits {
            return Err(argument(format!(
                "{name} has the shape {}; expected (samples, {width}), or ({width},) for one sample: a column for each joint",
                array.shape_text()
            )));
        }
        let rows = Self { numbers: array.numbers, width, is_single };
        if let Some(at) = rows.numbers.iter().position(|number| !number.is_finite()) {
            let (index, value) = (rows.index_of(at), rows.numbers[at]);
            return Err(argument(format!("{name}[{index}] is {value}; all numbers must be finite")));
        }
        Ok(rows)
    }

    /// Number of rows.
    pub fn count(&self) -> usize {
        self.numbers.len() / self.width
    }

    /// Shape as Python writes it.
    pub fn shape_text(&self) -> String {
        if self.is_single { tuple(&[self.width]) } else { tuple(&[self.count(), self.width]) }
    }

    /// Index of a number as Python writes it.
    fn index_of(&self, at: usize) -> String {
        let (sample, joint) = (at / self.width, at % self.width);
        if self.is_single { joint.to_string() } else { format!("{sample}, {joint}") }
    }
}

/// Refuses results beyond the range of double precision; each sample has `width` numbers.
pub fn finite(name: &str, numbers: &[f64], width: usize) -> PyResult<()> {
    match numbers.iter().position(|number| !number.is_finite()) {
        Some(at) => {
            let sample = at / width;
            Err(argument(format!("the {name} of sample {sample} exceeds the range of double precision")))
        }
        None => Ok(()),
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
