//! One frame's straight line: detections in, one outcome out, the same for node, tools and tests.
//!
//! ```text
//! stamp -> camera -> frame_id -> every detection -> clear of the edge -> observations -> estimate -> trusted? -> no suspect marker? -> track -> outcome
//! ```
//!
//! Knows `estimation`, `tracking`, `camera`, `target`; time enters only as the stamp of a frame. Never reads a
//! clock, a file or a topic. What is missing is never replaced by a default, and every frame has an
//! outcome: a pose, or the one reason for none.

mod bare;
mod budget;
mod checks;
mod code;
mod edge;
mod frame;
mod frame_track;
mod lasting;
mod next_image;
mod outcome;
mod predict;
mod protected;
mod refusal;
mod residuals;
mod sigma_watch;
mod stamp;
mod suspect_marker;
mod suspects;
mod track;
mod unexplained;
mod widening;
mod window;

use std::sync::Arc;

use nalgebra::Rotation3;

use crate::camera::{CalibrationBudget, Camera, CameraError, CameraInfo, OffCentre};
use crate::config::Settings;
use crate::estimation::{
    CalibrationMode, ErrorBudget, EstimateError, Estimator, Expected, Initialisation, Observation,
    ReportedAttitude,
};
use crate::integrity::{IntegrityMonitor, SolvedFrame, Unavailable};
use crate::refuelling::RefuellingSetup;
use crate::target::MarkerMap;

pub use bare::Bare;
pub use budget::{budget_in_words, error_budget, modes_of_file};
pub use checks::{MOST_INLINE_DETECTIONS, observe};
pub use code::{IntegrityState, OutcomeCode, TrackCode};
pub use edge::{ImageEdges, LeftOut};
pub use frame::{Detection, DetectionFrame};
pub use frame_track::FrameTrack;
pub use lasting::FrameErrors;
pub use next_image::NextImage;
pub use outcome::FrameOutcome;
pub use predict::PredictedPoint;
use predict::{Predictor, View};
pub use protected::integrity_monitor;
pub use refusal::Refusal;
pub use residuals::MarkerResidual;
pub use sigma_watch::SigmaFactor;
use sigma_watch::SigmaWatch;
pub use stamp::Stamp;
pub use suspect_marker::SuspectMarker;
use suspects::Suspects;
use track::Tracker;
use unexplained::Unexplained;
use widening::{Sight, Widening};

/// What the latest camera info came to.
#[derive(Debug)]
struct LatchedCamera {
    info: CameraInfo,
    frame_id: String,
    camera: Result<Camera, CameraError>,
    edges: Option<ImageEdges>,
    /// What the calibration's own file says.
    modes: Vec<CalibrationMode>,
}

impl LatchedCamera {
    fn new(
        info: CameraInfo,
        frame_id: String,
        rectified: bool,
        budget: Option<&CalibrationBudget>,
    ) -> Self {
        let mut modes = Vec::new();
        let camera = Camera::from_info(&info, rectified).and_then(|camera| {
            if let Some(budget) = budget {
                modes = modes_of_file(budget, &info, &camera)?;
            }
            Ok(camera)
        });
        let edges = camera
            .as_ref()
            .ok()
            .map(|camera| ImageEdges::new(&info, camera, rectified));
        Self {
            info,
            frame_id,
            camera,
            edges,
            modes,
        }
    }
}

/// The estimator with what it remembers between frames: the camera, the last trusted attitude, the track and its last
/// motion, and how the last fits agree with sigmas and markers.
#[derive(Debug)]
pub struct Pipeline {
    settings: Settings,
    estimator: Estimator,
    map: Arc<MarkerMap>,
    calibration: Option<CalibrationBudget>,
    camera: Option<LatchedCamera>,
    /// Rotation of the last trusted pose, with its time.
    previous: Option<(Rotation3<f64>, Stamp)>,
    tracker: Tracker,
    predictor: Predictor,
    suspects: Suspects,
    unexplained: Unexplained,
    sigmas: SigmaWatch,
    widening: Widening,
    setup: Option<RefuellingSetup>,
    integrity: Option<IntegrityMonitor>,
}

impl Pipeline {
    /// Returns a pipeline that has not seen a camera yet.
    #[must_use]
    pub fn new(settings: Settings, map: Arc<MarkerMap>) -> Self {
        Self {
            estimator: estimator(&settings, &map, None),
            tracker: Tracker::new(settings.track),
            predictor: Predictor::default(),
            suspects: Suspects::default(),
            unexplained: Unexplained::default(),
            sigmas: SigmaWatch::default(),
            widening: Widening::default(),
            setup: None,
            integrity: monitor(&settings, &map, None),
            settings,
            map,
            calibration: None,
            camera: None,
            previous: None,
        }
    }

    /// Returns the pipeline with what the calibrations of its cameras, from now on, may have wrong.
    #[must_use]
    pub fn with_calibration_budget(self, calibration: Option<CalibrationBudget>) -> Self {
        Self {
            calibration,
            ..self
        }
    }

    /// Returns the pipeline with the receptacle of a refuelling setup as a point that protection levels are for, and the
    /// mount's errors in them.
    #[must_use]
    pub fn with_refuelling(self, setup: Option<RefuellingSetup>) -> Self {
        Self {
            integrity: monitor(&self.settings, &self.map, setup.as_ref()),
            setup,
            ..self
        }
    }

    /// Returns what computes protection levels; `None` where none are wanted.
    #[must_use]
    pub fn integrity(&self) -> Option<&IntegrityMonitor> {
        self.integrity.as_ref()
    }

    /// Returns the name of a mode of the error budget by its place.
    #[must_use]
    pub fn mode_name(&self, index: usize) -> String {
        let budget = self.estimator.budget();
        let name = budget.and_then(|budget| budget.mode_name(index));
        name.map_or_else(|| format!("mode {index}"), str::to_owned)
    }

    /// Replaces the settings from the next frame on; camera, last attitude and track stay. With another error budget
    /// the track begins anew: it has carried errors of the old one.
    pub fn set_settings(&mut self, settings: Settings) {
        let is_other = settings.estimator != self.settings.estimator
            || settings.calibration != self.settings.calibration
            || settings.correlated_noise != self.settings.correlated_noise
            || settings.rectified != self.settings.rectified;
        if settings.rectified != self.settings.rectified {
            // The rectified camera looks elsewhere.
            self.reset();
            let budget = self.calibration.as_ref();
            self.camera = self
                .camera
                .take()
                .map(|LatchedCamera { info, frame_id, .. }| {
                    LatchedCamera::new(info, frame_id, settings.rectified, budget)
                });
        }
        if !settings.widen_by_sigma_factor {
            self.widening.forget();
        }
        if settings.reported_attitude != self.settings.reported_attitude {
            // The mount is part of the reported attitude's error.
            self.tracker.reset();
        }
        if settings.integrity.map(|of| of.kinds_of_faults())
            != self.settings.integrity.map(|of| of.kinds_of_faults())
        {
            // The track has not followed other ones.
            self.tracker.reset();
        }
        self.tracker.set_settings(settings.track);
        self.settings = settings;
        self.integrity = monitor(&self.settings, &self.map, self.setup.as_ref());
        if is_other {
            self.renew_estimator();
        }
    }

    /// Makes the estimator of settings and camera. With other lasting errors the track begins anew: it carries the old
    /// ones.
    fn renew_estimator(&mut self) {
        let renewed = estimator(&self.settings, &self.map, self.camera.as_ref());
        if !renewed.has_the_causes_of(&self.estimator) {
            self.tracker.reset();
        }
        self.estimator = renewed;
    }

    /// Forgets the last attitude, the track, and what was wrong with markers and sigmas: the next frame is the first.
    pub fn reset(&mut self) {
        self.previous = None;
        self.suspects.forget();
        self.unexplained.forget();
        self.sigmas.forget();
        self.widening.forget();
        self.tracker.reset();
        self.predictor.forget();
    }

    /// Latches a camera info; returns whether it differs from the one before.
    ///
    /// # Errors
    /// [`CameraError`] when it cannot be used. It then replaces a good one all the same, so that
    /// frames are refused rather than solved with a calibration that no longer holds.
    pub fn set_camera(&mut self, info: &CameraInfo, frame_id: &str) -> Result<bool, CameraError> {
        if let Some(latched) = &self.camera
            && latched.info == *info
            && latched.frame_id == frame_id
        {
            return latched.camera.as_ref().map(|_| false).map_err(Clone::clone);
        }
        if self
            .camera
            .as_ref()
            .is_some_and(|latched| latched.frame_id != frame_id)
        {
            // Observations of another camera do not apply to this one.
            self.reset();
        }
        let latched = LatchedCamera::new(
            info.clone(),
            frame_id.to_owned(),
            self.settings.rectified,
            self.calibration.as_ref(),
        );
        let result = latched.camera.as_ref().map(|_| true).map_err(Clone::clone);
        if self.camera.replace(latched).is_some() {
            self.unexplained.doubt();
        }
        if self.calibration.is_some() {
            self.renew_estimator();
        }
        let budget = self.estimator.budget();
        if budget.is_some_and(|budget| !budget.calibration().is_empty()) {
            // The errors of another calibration are other ones.
            self.tracker.reset();
        }
        result
    }

    /// Returns what the latest camera info came to, with its frame; `None` before the first one.
    #[must_use]
    pub fn camera(&self) -> Option<(&str, Result<&Camera, &CameraError>)> {
        let latched = self.camera.as_ref()?;
        Some((&latched.frame_id, latched.camera.as_ref()))
    }

    /// Returns the markers that are left out too often for wrong detections; a frame that shows one has no trusted pose.
    pub fn suspect_markers(&self) -> impl Iterator<Item = SuspectMarker> {
        self.suspects.iter()
    }

    /// Returns by what factor the sigmas were too small or too large over the last ten seconds; `None` before a fit.
    #[must_use]
    pub fn sigma_factor(&self) -> Option<SigmaFactor> {
        self.sigmas.factor()
    }

    /// Returns what stated sigmas are multiplied by, as the scatter of the last seconds' residuals shows; 1 unless
    /// [`Settings::widen_by_sigma_factor`] is set and they are too small.
    #[must_use]
    pub fn widened_by(&self) -> f64 {
        self.widening.factor()
    }

    /// Returns a warning about the principal point of the latest camera info, if it passes and is far from the centre.
    #[must_use]
    pub fn off_centre(&self) -> Option<OffCentre> {
        let latched = self
            .camera
            .as_ref()
            .filter(|latched| latched.camera.is_ok())?;
        latched.info.off_centre(self.settings.rectified)
    }

    /// Returns the outcome of one frame.
    pub fn process(&mut self, frame: &DetectionFrame) -> FrameOutcome {
        let outcome = self.estimate(frame).unwrap_or_else(FrameOutcome::refused);
        if let Some(solution) = outcome.solution() {
            self.sigmas.take(frame.stamp, solution, outcome.widened_by);
            self.suspects.take(frame.stamp, &outcome, solution);
        }
        if self.settings.widen_by_sigma_factor {
            self.watch_scatter(frame.stamp, &outcome);
        }
        let outcome = self.unexplained.judge(outcome);
        let mut outcome = self.suspects.judge(outcome);
        if self.integrity.is_some() && outcome.result.is_err() {
            outcome.integrity = Some(Err(Unavailable::NoPose));
        }
        let has_causes = self.estimator.has_causes() || self.reported_attitude(frame).is_some();
        self.tracker.follow(frame.stamp, &mut outcome, has_causes);
        if let Some(monitor) = &self.integrity {
            let levels = self.tracker.protection(frame.stamp, &outcome, monitor);
            outcome.track_integrity = Some(levels);
        }
        self.predictor.follow(frame.stamp, &outcome, &self.tracker);
        if let Ok(solution) = &outcome.result {
            let rotation = solution.camera_from_tanker.rotation.to_rotation_matrix();
            self.previous = Some((rotation, frame.stamp));
        }
        outcome
    }

    /// Returns what is estimated of a frame that passes its checks: first the header's, then those of its detections.
    fn estimate(&self, frame: &DetectionFrame) -> Result<FrameOutcome, Refusal> {
        let camera = self.camera_for(frame.stamp, &frame.frame_id)?;
        let detections = frame.detections.as_ref().map_err(Clone::clone)?;
        let sigma_px = self.settings.pixel_sigma_px;
        let mut observations = observe(camera, detections, sigma_px, |id| self.map.get(id))?;
        let widened_by = self.widened_by();
        for seen in &mut observations {
            seen.sigma_px *= widened_by;
        }
        let edges = self
            .camera
            .as_ref()
            .and_then(|latched| latched.edges.as_ref());
        let (observations, left_out) = match edges {
            Some(edges) => edges.leave_out(observations, self.settings.edge_margin_px),
            None => (observations, LeftOut::default()),
        };
        let previous = self.expected_rotation(frame.stamp);
        let expected = Expected {
            previous: previous.as_ref(),
            reported: self.reported_attitude(frame),
        };
        let mut outcome = solve_expecting(&self.estimator, camera, &observations, &expected);
        outcome.widened_by = widened_by;
        if let (Some(monitor), Ok(solution)) = (&self.integrity, &outcome.result) {
            let (levels, separations) = monitor.judge_for_track(&SolvedFrame {
                estimator: &self.estimator,
                map: Some(&self.map),
                camera,
                observations: &observations,
                solution,
            });
            outcome.integrity = Some(levels);
            outcome.separations = separations.map(Box::new);
        }
        Ok(outcome.without(left_out))
    }

    /// Returns the prior of a frame whose attitude both aircraft report, if that is used.
    fn reported_attitude(&self, frame: &DetectionFrame) -> Option<ReportedAttitude> {
        let settings = self.settings.reported_attitude?;
        Some(ReportedAttitude {
            camera_from_tanker: settings.camera_from_receiver * frame.receiver_from_tanker?,
            sigma_rad: settings.sigma_rad,
        })
    }

    /// Records how the residuals of a fit differ from earlier ones.
    fn watch_scatter(&mut self, stamp: Stamp, outcome: &FrameOutcome) {
        let camera = self.camera.as_ref().map(|latched| &latched.camera);
        if let (Some(solution), Some(Ok(camera))) = (outcome.solution(), camera) {
            let sight = Sight {
                camera,
                camera_from_tanker: &solution.camera_from_tanker,
                flex: self.estimator.budget().map_or(&[], ErrorBudget::flex),
            };
            let (residuals, map) = (&outcome.residuals, &self.map);
            self.widening
                .take(stamp.seconds(), residuals, &sight, |id| map.get(id));
        }
    }

    /// Returns where [`Initialisation::Previous`] starts: what the track expects, or else the last attitude.
    fn expected_rotation(&self, stamp: Stamp) -> Option<Rotation3<f64>> {
        if self.estimator.settings().initialisation != Initialisation::Previous {
            return None;
        }
        let last = || {
            self.previous
                .filter(|(_, earlier)| stamp.follows_closely(*earlier))
                .map(|(rotation, _)| rotation)
        };
        self.tracker.expected_rotation(stamp).or_else(last)
    }

    /// Returns the camera of a frame with this header.
    ///
    /// # Errors
    /// [`Refusal`] if the stamp is invalid, no usable camera is known, or `frame_id` is not its own: what
    /// [`Self::process`] checks first.
    pub fn camera_for(&self, stamp: Stamp, frame_id: &str) -> Result<&Camera, Refusal> {
        checks::check_stamp(stamp)?;
        checks::check_frame_id_length(frame_id)?;
        let latched = self.camera.as_ref().ok_or(Refusal::NoCameraInfo)?;
        let camera = latched
            .camera
            .as_ref()
            .map_err(|cause| Refusal::InvalidCameraInfo(cause.clone()))?;
        checks::check_frame_id(&latched.frame_id, frame_id)?;
        Ok(camera)
    }

    /// Returns where the markers are expected in the image of a stamp; empty where that is unknown.
    ///
    /// Markers are missing whose sigma exceeds an eighth of the image's shorter side, and such as are out of the
    /// image by more than four sigmas. None are expected before the last motion's own stamp.
    ///
    /// # Errors
    /// As [`Self::camera_for`].
    pub fn predict(&self, stamp: Stamp, frame_id: &str) -> Result<Vec<PredictedPoint>, Refusal> {
        let view = View {
            camera: self.camera_for(stamp, frame_id)?,
            markers: self.map.markers(),
            sigma_px: self.settings.pixel_sigma_px * self.widened_by(),
        };
        let nominal = &self.settings.estimator.nominal_camera_from_tanker;
        Ok(self.predictor.points(stamp, nominal, &view))
    }
}

fn monitor(
    settings: &Settings,
    map: &MarkerMap,
    setup: Option<&RefuellingSetup>,
) -> Option<IntegrityMonitor> {
    let turned = &settings.receiver_from_camera;
    let integrity = settings.integrity?;
    Some(integrity_monitor(integrity, turned, Some(map), setup))
}

fn estimator(settings: &Settings, map: &MarkerMap, camera: Option<&LatchedCamera>) -> Estimator {
    let of_file = camera.map_or(&[][..], |latched| &latched.modes);
    let budget = error_budget(map.budget(), &settings.calibration, of_file)
        .with_correlated_noise(settings.correlated_noise);
    Estimator::new(settings.estimator.clone()).with_budget(budget)
}

/// Returns the outcome of checked observations: the estimate, judged.
#[must_use]
pub fn solve(
    estimator: &Estimator,
    camera: &Camera,
    observations: &[Observation],
    previous: Option<&Rotation3<f64>>,
) -> FrameOutcome {
    let expected = Expected {
        previous,
        reported: None,
    };
    solve_expecting(estimator, camera, observations, &expected)
}

/// The same as [`solve`] with all that may be known of the frame's attitude.
#[must_use]
pub fn solve_expecting(
    estimator: &Estimator,
    camera: &Camera,
    observations: &[Observation],
    expected: &Expected,
) -> FrameOutcome {
    let asked = estimator.settings().initialisation;
    match estimator.estimate_expecting(camera, observations, expected) {
        Ok(solution) => {
            let has_causes = estimator.has_causes() || expected.reported.is_some();
            let causes = has_causes
                .then(|| estimator.causes(camera, observations, &solution, expected))
                .flatten();
            let settings = estimator.settings();
            let mut outcome = FrameOutcome::judged(
                solution,
                camera,
                observations,
                settings,
                expected.reported.is_some(),
            );
            outcome.causes = causes;
            outcome
        }
        Err(error) => {
            let attempted = !matches!(
                error,
                EstimateError::TooFewPoints { .. }
                    | EstimateError::TooFewPrecisePoints { .. }
                    | EstimateError::NoRay { .. }
            );
            let mut outcome = FrameOutcome::refused(Refusal::from(error));
            outcome.initialisation = attempted.then_some(asked);
            outcome
        }
    }
}
