//! Arrays of Python as slices of numbers.

use numpy::{
    PyArrayDyn, PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use pyo3::types::{IntoPyDict, PyDict};

use crate::errors::value_error;

/// Returns an array of doubles without gaps: the caller's own where it is one, or else a copy.
///
/// # Errors
/// As numpy, where the value has no array of doubles, and a `ValueError` for masked arrays.
pub fn doubles<'py>(value: &Bound<'py, PyAny>) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    converted(value, "float64")
}

/// The same for truth values.
///
/// # Errors
/// As [`doubles`], and a `ValueError` for numbers: as indices they would mean something else.
pub fn switches<'py>(
    name: &str,
    value: &Bound<'py, PyAny>,
) -> PyResult<PyReadonlyArrayDyn<'py, bool>> {
    let array = numpy::get_array_module(value.py())?.call_method1("asarray", (value,))?;
    if array.cast::<PyArrayDyn<bool>>().is_err() {
        let dtype = array.getattr("dtype")?.str()?;
        return Err(value_error(format!(
            "{name}: expected an array of bool, got {dtype}"
        )));
    }
    converted(&array, "bool")
}

/// Returns marker ids.
///
/// # Errors
/// A `ValueError` for what is no list of whole numbers from 0 to 4294967295.
pub fn ids(value: &Bound<'_, PyAny>) -> PyResult<Vec<u32>> {
    value.extract::<Vec<u32>>().map_err(|_| {
        let got = value
            .str()
            .map_or_else(|_| String::new(), |words| words.to_string());
        let got: String = got.chars().take(100).collect();
        value_error(format!(
            "ids: expected a sequence of whole numbers from 0 to {}, got {got}",
            u32::MAX
        ))
    })
}

fn converted<'py, T: numpy::Element>(
    value: &Bound<'py, PyAny>,
    dtype: &str,
) -> PyResult<PyReadonlyArrayDyn<'py, T>> {
    let py = value.py();
    // Of a subclass: numpy's masked arrays hold any number where the mask is set.
    if value.is_instance_of::<PyUntypedArray>()
        && !value.is_exact_instance_of::<PyUntypedArray>()
        && value.hasattr("mask")?
    {
        return Err(value_error(
            "expected an array without a mask; what is missing is told by visible, or left out",
        ));
    }
    if let Ok(array) = value.cast::<PyArrayDyn<T>>()
        && array.is_c_contiguous()
        && array.is_aligned()
    {
        return Ok(array.try_readonly()?);
    }
    let wanted = ["C_CONTIGUOUS", "ALIGNED"];
    let numpy = py.import("numpy")?;
    let array = numpy.call_method1("require", (value, dtype, wanted))?;
    Ok(array.cast_into::<PyArrayDyn<T>>()?.try_readonly()?)
}

/// Returns a dict as JSON, which is YAML too; arrays and numbers of numpy become plain ones.
///
/// # Errors
/// As Python's json, for values that it does not know.
pub fn json(fields: &Bound<'_, PyDict>) -> PyResult<String> {
    let py = fields.py();
    let to_list = py
        .import("operator")?
        .call_method1("methodcaller", ("tolist",))?;
    let options = [("default", to_list)].into_py_dict(py)?;
    py.import("json")?
        .call_method("dumps", (fields,), Some(&options))?
        .extract()
}
