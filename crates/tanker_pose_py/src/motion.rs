//! The track's motion as an object.

use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tanker_pose::geometry::Motion;

use crate::frame::matrix;

/// The motion of the tanker in the camera at a frame's stamp, filtered over the frames before it.
#[pyclass(frozen, name = "Motion", module = "tanker_pose_estimator")]
pub struct PyMotion(pub Motion);

#[pymethods]
impl PyMotion {
    /// Rotation (3, 3) of camera_from_tanker.
    #[getter]
    fn rotation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let rotation = self.0.b_from_a.rotation.to_rotation_matrix();
        matrix::<9>(py, 3, std::array::from_fn(|i| rotation[(i / 3, i % 3)]))
    }

    /// The tanker's origin (3,) in the camera's optical frame, m.
    #[getter]
    fn translation<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.b_from_a.translation.vector.as_slice())
    }

    /// Velocity (3,) of the tanker's origin as an observer fixed to the camera measures it, m/s.
    #[getter]
    fn velocity<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.velocity_in_b.as_slice())
    }

    /// Angular rate (3,) of the tanker relative to the camera, in the camera's axes, rad/s.
    #[getter]
    fn rate<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray1<f64>> {
        PyArray1::from_slice(py, self.0.rate_in_b.as_slice())
    }

    /// Covariance (12, 12) of position, rotation, velocity and rate; m, rad, m/s, rad/s; the camera's axes.
    #[getter]
    fn covariance<'py>(&self, py: Python<'py>) -> Bound<'py, PyArray2<f64>> {
        let covariance = &self.0.covariance;
        matrix::<144>(
            py,
            12,
            std::array::from_fn(|i| covariance[(i / 12, i % 12)]),
        )
    }

    fn __repr__(&self) -> String {
        let (position, velocity) = (&self.0.b_from_a.translation.vector, &self.0.velocity_in_b);
        format!(
            "Motion(translation=[{:.3}, {:.3}, {:.3}] m, velocity=[{:.3}, {:.3}, {:.3}] m/s)",
            position.x, position.y, position.z, velocity.x, velocity.y, velocity.z
        )
    }
}
