//! Errors of the host's tool as exceptions, in the same words.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use scarab_host::base::error::ToolError;

create_exception!(
    scarab_ident,
    InputError,
    PyValueError,
    "An argument or a file cannot be used; the message says what is wrong, where, and what to do."
);
create_exception!(
    scarab_ident,
    RefusedError,
    PyRuntimeError,
    "A model that was refused cannot be used; the message holds the reasons of the verdict."
);

/// Exception for an error of the tool.
pub fn raised(error: impl Into<ToolError>) -> PyErr {
    match error.into() {
        ToolError::Refused(reason) => RefusedError::new_err(reason),
        ToolError::Input(reason) => InputError::new_err(reason),
    }
}

/// Exception for an argument.
pub fn argument(reason: impl Into<String>) -> PyErr {
    InputError::new_err(reason.into())
}
