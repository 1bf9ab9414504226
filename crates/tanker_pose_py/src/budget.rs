//! What a calibration may have wrong, from a file or a dict.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::camera::CalibrationBudget;
use tanker_pose::text_file;

use crate::arrays::json;
use crate::errors::value_error;

/// What a calibration may have wrong: standard deviations, or a covariance.
#[pyclass(frozen, name = "Budget", module = "tanker_pose_estimator")]
pub struct PyBudget {
    pub budget: CalibrationBudget,
}

#[pymethods]
impl PyBudget {
    /// A budget from a YAML file such as config/cameras/budget_example.yaml.
    #[staticmethod]
    fn from_file(path: PathBuf) -> PyResult<Self> {
        let text = text_file::read(&path)?;
        Self::from_text(&text, &path.display().to_string())
    }

    /// A budget from a dict with the keys of such a file: {"sigmas": {"fx": 1.5, "k1": 0.01}}, or {"covariance":
    /// {"parameters": [...], "data": [[...]]}}.
    #[staticmethod]
    fn from_dict(fields: &Bound<'_, PyDict>) -> PyResult<Self> {
        Self::from_text(&json(fields)?, "budget")
    }

    fn __repr__(&self) -> String {
        format!("Budget({})", self.budget.in_words())
    }
}

impl PyBudget {
    fn from_text(text: &str, source: &str) -> PyResult<Self> {
        let budget = CalibrationBudget::from_yaml(text, source).map_err(value_error)?;
        Ok(Self { budget })
    }
}
