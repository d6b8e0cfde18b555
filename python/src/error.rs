//! Errors of the host's tool as exceptions, in the same words. Options of the command line become arguments.

use pyo3::exceptions::{PyRuntimeError, PyValueError};
use pyo3::{PyErr, create_exception};
use scarab_base::error::ToolError;

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

/// Options whose argument has another name; `--even-stamps` becomes `even_stamps` without an entry.
const ARGUMENTS: [(&str, &str); 9] = [
    ("--torque-delay", "torque_delay_ms"),
    ("--bandwidth", "bandwidth_hz"),
    ("--rate", "rate_hz"),
    ("--accept-error", "accept_error_percent"),
    ("--duration", "duration_s"),
    ("--torque-margin", "torque_margin_percent"),
    ("--torque-noise-nm", "torque_noise_percent"),
    ("--lock", "locked"),
    ("--parallel", "parallel_rad"),
];

/// Exception for an error of the host crates.
pub fn raised(error: impl Into<ToolError>) -> PyErr {
    match error.into() {
        ToolError::Refused(reason) => RefusedError::new_err(in_python(&reason)),
        ToolError::Input(reason) => InputError::new_err(in_python(&reason)),
    }
}

/// Exception for an argument.
pub fn argument(reason: impl Into<String>) -> PyErr {
    InputError::new_err(reason.into())
}

/// Text with arguments in place of options.
fn in_python(text: &str) -> String {
    let mut words: Vec<String> = Vec::new();
    for word in text.split(' ') {
        let named = ARGUMENTS.iter().find_map(|(option, argument)| {
            let rest = word.strip_prefix(option)?;
            (!rest.starts_with(|next: char| next.is_alphanumeric() || next == '-'))
                .then(|| format!("{argument}{rest}"))
        });
        words.push(match (named, word.strip_prefix("--")) {
            (Some(named), _) => named,
            (None, Some(option)) => option.replace('-', "_"),
            (None, None) => word.to_owned(),
        });
    }
    words.join(" ")
}
