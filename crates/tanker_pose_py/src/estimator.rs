//! One frame, or many on all cores.

use nalgebra::{Matrix3, Rotation3};
use std::sync::{Mutex, PoisonError};

use numpy::{PyArray1, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::estimation::{Estimator, Initialisation};
use tanker_pose::geometry::nearest_rotation;
use tanker_pose::pipeline::{
    self, Bare, Detection, FrameOutcome, error_budget, modes_of_file, observe,
};

use crate::arrays::{doubles, ids as read_ids};
use crate::budget::PyBudget;
use crate::camera::PyCamera;
use crate::errors::value_error;
use crate::frame::Frame;
use crate::inputs::{Frames, Sigmas, pixels_of_frame, pixels_of_frames, visible_points};
use crate::markers::Markers;
use crate::parameters::{Use, configuration};
use crate::record;

/// Frames that one thread takes at a time.
const CHUNK: usize = 256;
/// Largest deviation of a matrix from a rotation.
const ROTATION_TOLERANCE: f64 = 1e-6;

/// The estimator for frames of one camera and one set of markers.
#[pyclass(frozen, name = "Estimator", module = "tanker_pose_estimator")]
pub struct PyEstimator {
    camera: Py<PyCamera>,
    markers: Markers,
    estimator: Estimator,
    pixel_sigma_px: f64,
    edge_margin_px: f64,
}

impl PyEstimator {
    /// Returns the outcome of one frame, as `tanker_pose solve` has it.
    fn outcome(&self, detections: &[Detection], previous: Option<&Rotation3<f64>>) -> FrameOutcome {
        let sight = self.camera.get();
        let lookup = |id| self.markers.get(id);
        let observations = match observe(&sight.camera, detections, self.pixel_sigma_px, lookup) {
            Ok(observations) => observations,
            Err(refusal) => return FrameOutcome::refused(refusal),
        };
        let (observations, left_out) = sight.edges.leave_out(observations, self.edge_margin_px);
        pipeline::solve(&self.estimator, &sight.camera, &observations, previous).without(left_out)
    }

    /// Writes the records of all frames on all cores.
    ///
    /// The threads are this call's own: those of a pool would be missing in a process that Python has forked.
    fn fill_all(&self, rows: &mut [u8], size: usize, frames: &Frames) {
        let count = rows.len() / size;
        let cores = std::thread::available_parallelism().map_or(1, usize::from);
        let threads = cores.min(count.div_ceil(CHUNK));
        if threads < 2 {
            return self.fill(rows, size, 0, frames);
        }
        let chunks = Mutex::new(rows.chunks_mut(size * CHUNK).enumerate());
        let next = || chunks.lock().unwrap_or_else(PoisonError::into_inner).next();
        std::thread::scope(|scope| {
            for _ in 0..threads {
                scope.spawn(|| {
                    while let Some((chunk, rows)) = next() {
                        self.fill(rows, size, chunk * CHUNK, frames);
                    }
                });
            }
        });
    }

    /// Writes the records of frames from `first` on: the same verdicts as of [`Self::outcome`], without words.
    fn fill(&self, rows: &mut [u8], size: usize, first: usize, frames: &Frames) {
        let sight = self.camera.get();
        let bare = Bare {
            estimator: &self.estimator,
            camera: &sight.camera,
            edges: &sight.edges,
            edge_margin_px: self.edge_margin_px,
            pixel_sigma_px: self.pixel_sigma_px,
        };
        let mut detections = Vec::with_capacity(frames.ids.len());
        let mut observed = Vec::with_capacity(frames.ids.len());
        for (index, row) in rows.chunks_exact_mut(size).enumerate() {
            frames.detections(first + index, &mut detections);
            let find = |id| self.markers.get(id);
            let (code, solution) = bare.solve(&detections, find, None, &mut observed);
            record::write(row, code, solution.as_ref(), &observed, frames.ids);
        }
    }
}

#[pymethods]
impl PyEstimator {
    /// markers: a MarkerMap, or an array (N, 3) of points on the tanker (x forward, y left, z up; m). ids: what the N
    /// columns of pixels are, in their order; without them the markers of the map by ascending id, or 0 to N - 1 for the
    /// rows of an array. parameters: those of the node that an estimate depends on (docs/parameters.md).
    #[new]
    #[pyo3(signature = (camera, markers, *, ids=None, budget=None, **parameters))]
    fn new(
        camera: Py<PyCamera>,
        markers: &Bound<'_, PyAny>,
        ids: Option<&Bound<'_, PyAny>>,
        budget: Option<&PyBudget>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let settings = configuration(parameters, Use::Frames, budget.is_some())?.settings;
        let markers = Markers::new(markers, ids)?;
        let sight = camera.get();
        let modes = match budget {
            Some(given) => {
                modes_of_file(&given.budget, &sight.info, &sight.camera).map_err(value_error)?
            }
            None => Vec::new(),
        };
        let budget = error_budget(&markers.budget, &settings.calibration, &modes);
        Ok(Self {
            camera,
            markers,
            estimator: Estimator::new(settings.estimator).with_budget(budget),
            pixel_sigma_px: settings.pixel_sigma_px,
            edge_margin_px: settings.edge_margin_px,
        })
    }

    /// The outcome of one frame; RefusalError without a trusted pose.
    ///
    /// pixels: (N, 2), of the markers with these ids, or else of the estimator's. sigma_px: a number or (N,), px.
    /// previous: the last trusted rotation (3, 3), where initialisation is previous.
    #[pyo3(signature = (pixels, sigma_px=None, *, ids=None, previous=None))]
    fn estimate<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
        sigma_px: Option<&Bound<'py, PyAny>>,
        ids: Option<&Bound<'py, PyAny>>,
        previous: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Frame>> {
        let own = ids.map(read_ids).transpose()?;
        let ids = own.as_deref().unwrap_or(&self.markers.ids);
        let pixels = pixels_of_frame(pixels, ids.len())?;
        let sigmas = Sigmas::read(sigma_px, ids.len(), None)?;
        let frames = Frames {
            ids,
            pixels: pixels.as_slice()?,
            sigmas: sigmas.slices()?,
            visible: None,
        };
        let mut detections = Vec::with_capacity(ids.len());
        frames.detections(0, &mut detections);
        let previous = previous.map(rotation).transpose()?;
        let frame = Frame {
            outcome: self.outcome(&detections, previous.as_ref()),
        };
        let is_trusted = frame.outcome.result.is_ok();
        let frame = Bound::new(py, frame)?;
        if is_trusted {
            Ok(frame)
        } else {
            Err(Frame::refusal(py, frame)?)
        }
    }

    /// The outcomes of many frames, each on its own, as a structured array (F,); the work is on all cores, without the
    /// GIL, so that no other thread may write to the arrays meanwhile.
    ///
    /// pixels: (F, N, 2). sigma_px: a number, (N,) or (F, N), px; 0 or None: the parameter pixel_sigma_px. visible: (F, N)
    /// of bool, the detections that there are; all, without it. A pixel of NaN is a wrong detection, not a missing one.
    ///
    /// Fields: rotation (3, 3) and translation (3,) of camera_from_tanker, covariance (6, 6) in ROS's order, all NaN without
    /// a trusted pose; rms_px, chi_squared, chi_squared_limit, ambiguity, NaN without a fit; degrees_of_freedom,
    /// iterations; outcome, see Outcome; certificate as in EstimatorStatus; used (N,), the points that the pose rests on.
    #[pyo3(signature = (pixels, sigma_px=None, *, visible=None))]
    fn estimate_many<'py>(
        &self,
        py: Python<'py>,
        pixels: &Bound<'py, PyAny>,
        sigma_px: Option<&Bound<'py, PyAny>>,
        visible: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, PyAny>> {
        if self.estimator.settings().initialisation == Initialisation::Previous {
            return Err(value_error(
                "initialisation previous needs the frame before: use Pipeline, or estimate with previous",
            ));
        }
        let ids = &self.markers.ids;
        let (pixels, count) = pixels_of_frames(pixels, ids.len())?;
        let sigmas = Sigmas::read(sigma_px, ids.len(), Some(count))?;
        let mask = visible_points(visible, ids.len(), count)?;
        let frames = Frames {
            ids,
            pixels: pixels.as_slice()?,
            sigmas: sigmas.slices()?,
            visible: mask.as_ref().map(|mask| mask.as_slice()).transpose()?,
        };
        let dtype = record::dtype(py, ids.len())?;
        let records = numpy::get_array_module(py)?.call_method1("zeros", (count, dtype))?;
        let bytes = records.call_method1("view", ("uint8",))?;
        let mut bytes = bytes.cast::<PyArray1<u8>>()?.readwrite();
        let rows = bytes.as_slice_mut()?;
        py.detach(|| self.fill_all(rows, record::size(ids.len()), &frames));
        Ok(records)
    }
}

/// Reads a rotation (3, 3).
pub fn rotation(value: &Bound<'_, PyAny>) -> PyResult<Rotation3<f64>> {
    let array = doubles(value)?;
    if array.shape() != [3, 3] {
        let got = array.shape();
        return Err(value_error(format!(
            "expected a rotation of shape (3, 3), got shape {got:?}"
        )));
    }
    let matrix = Matrix3::from_row_slice(array.as_slice()?);
    let deviation = (matrix * matrix.transpose() - Matrix3::identity()).amax();
    // A comparison with NaN is false.
    let is_rotation = deviation <= ROTATION_TOLERANCE && matrix.determinant() > 0.0;
    if !is_rotation {
        return Err(value_error(format!(
            "expected a rotation, got a matrix that differs from one by {deviation:.1e}"
        )));
    }
    Ok(nearest_rotation(&matrix))
}
