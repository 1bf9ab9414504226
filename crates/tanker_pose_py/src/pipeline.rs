//! Frame by frame, as the node processes them.

use std::sync::Arc;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::pipeline::{DetectionFrame, Pipeline, Refusal, Stamp};

use crate::arrays::ids as read_ids;
use crate::budget::PyBudget;
use crate::camera::PyCamera;
use crate::errors::value_error;
use crate::estimator::rotation;
use crate::frame::Frame;
use crate::inputs::{Frames, Sigmas, pixels_of_frame};
use crate::markers::PyMarkerMap;
use crate::parameters::{Use, configuration};

/// The estimator with what it remembers between frames: the last attitude, the track, suspect markers.
#[pyclass(name = "Pipeline", module = "tanker_pose_estimator")]
pub struct PyPipeline {
    pipeline: Pipeline,
    /// Ids of the map's markers, ascending.
    ids: Vec<u32>,
    rectified: bool,
    frame_id: String,
}

#[pymethods]
impl PyPipeline {
    /// frame_id: the camera's optical frame; a frame of another one is refused. parameters: those of the node that a pose
    /// or the track depends on (docs/parameters.md).
    #[new]
    #[pyo3(signature = (camera, marker_map, *, frame_id="camera", budget=None, **parameters))]
    fn new(
        camera: &PyCamera,
        marker_map: &PyMarkerMap,
        frame_id: &str,
        budget: Option<&PyBudget>,
        parameters: Option<&Bound<'_, PyDict>>,
    ) -> PyResult<Self> {
        let mut settings = configuration(parameters, Use::Sequences, budget.is_some())?.settings;
        settings.rectified = camera.rectified;
        let ids = marker_map
            .map
            .markers()
            .iter()
            .map(|marker| marker.id)
            .collect();
        let pipeline = Pipeline::new(settings, Arc::clone(&marker_map.map))
            .with_calibration_budget(budget.map(|budget| budget.budget.clone()));
        let mut found = Self {
            pipeline,
            ids,
            rectified: camera.rectified,
            frame_id: frame_id.to_owned(),
        };
        found.set_camera(camera)?;
        Ok(found)
    }

    /// Replaces the camera from the next frame on; returns whether it differs.
    fn set_camera(&mut self, camera: &PyCamera) -> PyResult<bool> {
        if camera.rectified != self.rectified {
            let of = |rectified| if rectified { "rectified" } else { "raw" };
            return Err(value_error(format!(
                "expected a camera for the {} image, got one for the {} image",
                of(self.rectified),
                of(camera.rectified)
            )));
        }
        self.pipeline
            .set_camera(&camera.info, &self.frame_id)
            .map_err(value_error)
    }

    /// The outcome of the frame with this stamp, ns since 1970. Never raises for what a detector may send: outcome and
    /// message say why there is no pose. pixels (N, 2) belong to ids, or else to all markers of the map by ascending id.
    /// receiver_from_tanker (3, 3): the attitude that both aircraft report for the stamp, axes x forward, y left, z up; it
    /// needs the parameters reported_attitude_sigma_deg and attitude.
    #[pyo3(signature = (stamp_ns, pixels, sigma_px=None, *, ids=None, frame_id=None, receiver_from_tanker=None))]
    #[expect(clippy::too_many_arguments, reason = "named in Python")]
    fn process<'py>(
        &mut self,
        py: Python<'py>,
        stamp_ns: i64,
        pixels: &Bound<'py, PyAny>,
        sigma_px: Option<&Bound<'py, PyAny>>,
        ids: Option<&Bound<'py, PyAny>>,
        frame_id: Option<String>,
        receiver_from_tanker: Option<&Bound<'py, PyAny>>,
    ) -> PyResult<Bound<'py, Frame>> {
        let own = ids.map(read_ids).transpose()?;
        let ids = own.as_deref().unwrap_or(&self.ids);
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
        let frame = DetectionFrame {
            stamp: stamp(stamp_ns)?,
            frame_id: frame_id.unwrap_or_else(|| self.frame_id.clone()),
            detections: Ok::<_, Refusal>(detections),
            receiver_from_tanker: receiver_from_tanker.map(rotation).transpose()?,
        };
        Bound::new(
            py,
            Frame {
                outcome: self.pipeline.process(&frame),
            },
        )
    }

    /// Forgets the last attitude, the track and what was wrong with markers: the next frame is the first.
    fn reset(&mut self) {
        self.pipeline.reset();
    }
}

/// Returns the stamp of a time in nanoseconds.
fn stamp(nanoseconds: i64) -> PyResult<Stamp> {
    let sec = i32::try_from(nanoseconds.div_euclid(1_000_000_000));
    let nanosec = u32::try_from(nanoseconds.rem_euclid(1_000_000_000));
    match (sec, nanosec) {
        (Ok(sec), Ok(nanosec)) => Ok(Stamp { sec, nanosec }),
        _ => Err(value_error(format!(
            "stamp_ns: expected nanoseconds that ROS's stamps can hold, got {nanoseconds}"
        ))),
    }
}
