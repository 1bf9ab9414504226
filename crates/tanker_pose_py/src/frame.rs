//! The outcome of one frame as an object.

use std::collections::BTreeMap;

use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use tanker_pose::estimation::Solution;
use tanker_pose::pipeline::FrameOutcome;

use crate::errors::RefusalError;
use crate::motion::PyMotion;
use crate::record;

/// The outcome of one frame: a trusted pose, or the reason why there is none.
#[pyclass(frozen, module = "tanker_pose_estimator")]
pub struct Frame {
    pub outcome: FrameOutcome,
}

impl Frame {
    /// Returns the exception of a frame without a pose.
    pub fn refusal(py: Python<'_>, frame: Bound<'_, Self>) -> PyResult<PyErr> {
        let error = RefusalError::new_err(frame.get().outcome.message());
        error.value(py).setattr("frame", frame)?;
        Ok(error)
    }

    fn trusted<'a>(slf: &'a Bound<'_, Self>) -> PyResult<&'a Solution> {
        match &slf.get().outcome.result {
            Ok(solution) => Ok(solution),
            Err(_) => Err(Self::refusal(slf.py(), slf.clone())?),
        }
    }

    fn number(&self, of: impl Fn(&Solution) -> f64) -> Option<f64> {
        self.outcome.solution().map(of)
    }
}

/// Returns an array of a row-major matrix.
pub fn matrix<const N: usize>(
    py: Python<'_>,
    rows: usize,
    numbers: [f64; N],
) -> Bound<'_, PyArray2<f64>> {
    let columns = N / rows;
    let array = Array2::from_shape_fn((rows, columns), |(row, column)| {
        numbers[row * columns + column]
    });
    PyArray2::from_owned_array(py, array)
}

#[pymethods]
impl Frame {
    /// The outcome's number: see Outcome. 0 is a trusted pose.
    #[getter]
    fn outcome(&self) -> u8 {
        self.outcome.code().number()
    }

    /// Why there is no pose, or which detections were left out; usually empty.
    #[getter]
    fn message(&self) -> String {
        self.outcome.message()
    }

    /// Whether there is a trusted pose.
    #[getter]
    fn is_trusted(&self) -> bool {
        self.outcome.result.is_ok()
    }

    /// Rotation (3, 3) of camera_from_tanker. RefusalError without a trusted pose, here and in the next two.
    #[getter]
    fn rotation<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        let (rotation, _) = record::pose(Self::trusted(slf)?);
        Ok(matrix(slf.py(), 3, rotation))
    }

    /// The tanker's origin (3,) in the camera's optical frame, m.
    #[getter]
    fn translation<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray1<f64>>> {
        let (_, translation) = record::pose(Self::trusted(slf)?);
        Ok(PyArray1::from_slice(slf.py(), &translation))
    }

    /// Covariance (6, 6) in ROS's order: x, y, z, rotX, rotY, rotZ about the camera's axes; m, rad.
    #[getter]
    fn covariance<'py>(slf: &Bound<'py, Self>) -> PyResult<Bound<'py, PyArray2<f64>>> {
        Ok(matrix(
            slf.py(),
            6,
            Self::trusted(slf)?.covariance.row_major(),
        ))
    }

    /// Root mean square of the used points' residuals, px; None without a fit, here and in the next five.
    #[getter]
    fn rms_px(&self) -> Option<f64> {
        self.number(|solution| solution.rms_px)
    }

    /// Sum of the squared residuals over their variances.
    #[getter]
    fn chi_squared(&self) -> Option<f64> {
        self.number(|solution| solution.chi_squared)
    }

    /// The largest chi_squared that passes the test.
    #[getter]
    fn chi_squared_limit(&self) -> Option<f64> {
        self.number(|solution| solution.chi_squared_limit)
    }

    /// Likelihood of the second-best pose relative to this one, 0 to 1.
    #[getter]
    fn ambiguity(&self) -> Option<f64> {
        self.number(|solution| solution.ambiguity)
    }

    /// Degrees of freedom of chi_squared.
    #[getter]
    fn degrees_of_freedom(&self) -> Option<u16> {
        self.outcome
            .solution()
            .map(|solution| solution.degrees_of_freedom)
    }

    /// Iterations of all solver stages.
    #[getter]
    fn iterations(&self) -> Option<u16> {
        self.outcome.solution().map(|solution| solution.iterations)
    }

    /// Whether the pose is proven the best in front of the camera: "certified", "not_certified" or "replaced"; None where
    /// no proof was asked for.
    #[getter]
    fn certificate(&self) -> Option<&'static str> {
        Some(self.outcome.solution()?.certificate?.name())
    }

    /// Ids of the markers that the pose rests on.
    #[getter]
    fn used_ids(&self) -> Vec<u32> {
        self.outcome.used_ids.clone()
    }

    /// Ids of the markers excluded as wrong, or at the edge of the image.
    #[getter]
    fn rejected_ids(&self) -> Vec<u32> {
        self.outcome.rejected_ids.clone()
    }

    /// The effect of the frame on the track: see Track. 0 for frames on their own.
    #[getter]
    fn track(&self) -> u8 {
        self.outcome.track.code().number()
    }

    /// The track's motion at the frame's stamp; None without a confirmed track, or if the frame came late.
    #[getter]
    fn motion(&self) -> Option<PyMotion> {
        self.outcome.track.motion.map(PyMotion)
    }

    /// Estimated amplitude of each mode of the error budget, in its sigmas.
    #[getter]
    fn modes(&self) -> BTreeMap<String, f64> {
        let causes = self.outcome.causes.iter().flat_map(|causes| &causes.causes);
        causes
            .filter_map(|cause| Some((cause.name.clone(), cause.amplitude_sigmas?)))
            .collect()
    }

    /// The cause with the largest share of the position's variance; None without an error budget.
    #[getter]
    fn dominant_cause(&self) -> Option<String> {
        self.outcome
            .causes
            .as_ref()?
            .dominant()
            .map(|cause| cause.name.clone())
    }

    fn __repr__(&self) -> String {
        let code = self.outcome.code().name();
        match &self.outcome.result {
            Ok(solution) => {
                let (_, [x, y, z]) = record::pose(solution);
                format!("Frame({code}, translation=[{x:.3}, {y:.3}, {z:.3}] m)")
            }
            Err(refusal) => format!("Frame({code}: {refusal})"),
        }
    }
}
