//! Exceptions: the words are those of the Rust errors.

use std::fmt::Display;

use pyo3::PyErr;
use pyo3::exceptions::PyValueError;

pyo3::create_exception!(
    tanker_pose_estimator,
    RefusalError,
    PyValueError,
    "A frame has no trusted pose. `frame` holds its outcome and numbers, the message says why."
);

/// Returns a `ValueError` with the words of an error.
pub fn value_error(error: impl Display) -> PyErr {
    PyValueError::new_err(error.to_string())
}
