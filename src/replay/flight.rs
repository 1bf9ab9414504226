//! The frames of a recording with camera, map and settings, checked as the node checks them: for tools that look at all
//! frames together.

use std::collections::VecDeque;

use ros2_node::names::NamesError;

use super::Replay;
use super::routes::{Route, Routes};
use crate::answering::input::{InputMessage, InputReader};
use crate::calibration::RecordedFrame;
use crate::camera::{Camera, CameraError, CameraInfo};
use crate::config::{AttitudeSource, Input, Settings};
use crate::convert;
use crate::estimation::{Estimator, EstimatorSettings};
use crate::frames::{AttitudeHistory, AttitudeSample, receiver_from_tanker};
use crate::messages;
use crate::pipeline::{
    DetectionFrame, ImageEdges, Pipeline, Stamp, error_budget, modes_of_file, observe,
};
use crate::recording::{DecodeError, RecordedMessage, Recording};
use crate::target::MarkerMap;
use crate::text::clip;

/// A frame waits this long for the attitudes around its time, ns: they are recorded later than the image is taken.
const PATIENCE_NS: u64 = 300_000_000;
/// Most lines about what could not be used.
const MOST: usize = 20;

/// Why a recording has no frames to look at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// A remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// No camera info before the first detections, and none was given.
    #[error("no camera info on {topic}{hint}")]
    NoCamera {
        /// The topic.
        topic: String,
        /// Which others there are.
        hint: String,
    },
    /// The camera info cannot be used.
    #[error("cannot use the camera info: {0}")]
    Camera(#[from] CameraError),
    /// No frames.
    #[error("no frame on {topic} can be used{hint}")]
    NoFrame {
        /// The topic.
        topic: String,
        /// Which others there are, or why the first one cannot.
        hint: String,
    },
}

/// All frames of a recording.
#[derive(Debug)]
pub struct Flight {
    /// The camera's calibration.
    pub info: CameraInfo,
    /// The camera.
    pub camera: Camera,
    /// The map.
    pub map: MarkerMap,
    /// The parameters.
    pub settings: Settings,
    /// The estimator with the budget of map and calibration.
    pub estimator: Estimator,
    /// By time, from the first one on.
    pub frames: Vec<RecordedFrame>,
    /// Frames with the attitudes of both aircraft.
    pub with_attitudes: usize,
    /// What could not be read or used, in words; of many the first.
    pub skipped: Vec<String>,
}

/// What is read so far.
struct Reading<'a> {
    pipeline: Pipeline,
    reader: &'a InputReader,
    receiver: AttitudeHistory,
    tanker: AttitudeHistory,
    px4_minus_ros_us: i64,
    info: Option<CameraInfo>,
    is_given: bool,
    /// Frames with their log time, that wait for attitudes.
    waiting: VecDeque<(u64, DetectionFrame)>,
    read: Vec<(Stamp, RecordedFrame)>,
    settings: Settings,
    map: MarkerMap,
    /// Whether the last camera info has another calibration than the first.
    is_other: bool,
    skipped: Vec<String>,
    skipped_count: u64,
}

impl Replay {
    /// Returns the checked frames of a recording.
    ///
    /// # Inputs
    /// * `given`: a calibration in place of the recorded camera infos.
    ///
    /// # Errors
    /// [`FlightError`] when there is no usable frame. What cannot be read is in [`Flight::skipped`].
    pub fn flight(
        self,
        recording: Recording,
        given: Option<CameraInfo>,
        mut progress: impl FnMut(u64, u64),
    ) -> Result<Flight, FlightError> {
        let routes = Routes::new(&self.configuration, &self.names)?;
        let configuration = &self.configuration;
        let map = self.files.map.clone();
        let reader = InputReader {
            input: configuration.input,
            map: map.clone().into(),
            max_hamming: configuration.max_hamming,
        };
        let mut reading = Reading {
            pipeline: Pipeline::new(configuration.settings.clone(), map.clone().into()),
            reader: &reader,
            receiver: AttitudeHistory::new(configuration.consumers.attitude_max_age_s),
            tanker: AttitudeHistory::new(configuration.tanker_attitude_max_age_s),
            px4_minus_ros_us: configuration.consumers.px4_minus_ros_us,
            is_given: given.is_some(),
            info: given,
            waiting: VecDeque::new(),
            read: Vec::new(),
            settings: configuration.settings.clone(),
            map,
            is_other: false,
            skipped: Vec::new(),
            skipped_count: 0,
        };
        let topics = recording.topics().to_vec();
        for topic in &topics {
            if let Err(words) = routes.of(topic) {
                reading.skip(format!("{}: {words}", clip(&topic.name)));
            }
        }
        let mut recording = recording;
        while let Some(item) = recording.next() {
            match item {
                Ok(message) => {
                    reading.settle(message.log_time_ns.saturating_sub(PATIENCE_NS));
                    if let Ok(Some(route)) = routes.of(&message.topic)
                        && let Err(error) = reading.take(route, &message)
                    {
                        reading.skip(format!("{}: {error}", clip(&message.topic.name)));
                    }
                }
                Err(damage) => reading.skip(damage.to_string()),
            }
            let (size, passed) = recording.size_and_passed();
            progress(size, passed);
        }
        reading.settle(u64::MAX);
        let hint = |route: Route| {
            let kind = route.type_name();
            let others: Vec<&str> = topics
                .iter()
                .filter(|topic| topic.type_name == kind)
                .map(|topic| topic.name.as_str())
                .collect();
            match others.first() {
                None => format!("; the recording has no topic of {kind}"),
                Some(other) => format!("; of {kind} the recording has {}: use -r", clip(other)),
            }
        };
        let named = |wanted: fn(Route) -> bool| {
            let found = routes.iter().find(|(_, route)| wanted(*route));
            found.map_or_else(
                || (String::new(), Route::CameraInfo),
                |(name, route)| (name.to_owned(), route),
            )
        };
        let Some(info) = reading.info.take() else {
            let (topic, route) = named(|route| route == Route::CameraInfo);
            let hint = hint(route);
            return Err(FlightError::NoCamera { topic, hint });
        };
        let camera = Camera::from_info(&info, reading.settings.rectified)?;
        if reading.read.is_empty() {
            let (topic, route) = named(|route| matches!(route, Route::Detections(_)));
            let hint = reading.skipped.first().map_or_else(
                || hint(route),
                |first| format!("; the first problem: {first}"),
            );
            return Err(FlightError::NoFrame { topic, hint });
        }
        let modes = match &self.files.calibration {
            Some(file) => modes_of_file(file, &info, &camera)?,
            None => Vec::new(),
        };
        let budget = error_budget(reading.map.budget(), &reading.settings.calibration, &modes);
        let estimator = Estimator::new(EstimatorSettings::clone(&reading.settings.estimator))
            .with_budget(budget);
        Ok(reading.finish(info, camera, estimator))
    }
}

impl Reading<'_> {
    fn skip(&mut self, words: String) {
        self.skipped_count += 1;
        if self.skipped.len() < MOST {
            self.skipped.push(words);
        }
    }

    fn take(&mut self, route: Route, message: &RecordedMessage) -> Result<(), DecodeError> {
        match route {
            Route::CameraInfo => {
                let info: messages::CameraInfo = message.decode()?;
                self.camera_info(&info);
            }
            Route::Detections(input) => {
                let detections = match input {
                    Input::FeaturePoints => InputMessage::FeaturePoints(message.decode()?),
                    Input::Detections => InputMessage::Detections(message.decode()?),
                    Input::AprilTags => InputMessage::AprilTags(message.decode()?),
                };
                let sighting = self.reader.read(detections);
                let frame = DetectionFrame {
                    stamp: Stamp::from(sighting.header.stamp),
                    frame_id: sighting.header.frame_id,
                    detections: sighting.detections,
                    receiver_from_tanker: None,
                };
                self.waiting.push_back((message.log_time_ns, frame));
            }
            Route::Attitude(AttitudeSource::Px4) => {
                let sample = convert::px4_attitude(&message.decode()?, self.px4_minus_ros_us);
                self.attitude(sample.map_err(|error| error.to_string()), false);
            }
            Route::Attitude(AttitudeSource::Imu) | Route::TankerAttitude => {
                let sample = convert::imu_attitude(&message.decode()?);
                let is_tanker = route == Route::TankerAttitude;
                self.attitude(sample.map_err(|error| error.to_string()), is_tanker);
            }
        }
        Ok(())
    }

    fn attitude(&mut self, sample: Result<AttitudeSample, String>, is_tanker: bool) {
        match sample {
            Ok(sample) if is_tanker => self.tanker.push(sample),
            Ok(sample) => self.receiver.push(sample),
            Err(words) => self.skip(words),
        }
    }

    fn camera_info(&mut self, message: &messages::CameraInfo) {
        let info = convert::camera_info(message);
        let is_first = self.info.is_none();
        let used = self.info.get_or_insert(info.clone());
        self.is_other = *used != info && !self.is_given;
        if self.is_other {
            return;
        }
        let used = used.clone();
        let result = self.pipeline.set_camera(&used, &message.header.frame_id);
        if let (true, Err(error)) = (is_first, result) {
            self.skip(format!("the camera info cannot be used: {error}"));
        }
    }

    /// Checks the frames that were recorded until a time.
    fn settle(&mut self, until_ns: u64) {
        while let Some((log_time_ns, _)) = self.waiting.front()
            && *log_time_ns <= until_ns
        {
            let Some((_, frame)) = self.waiting.pop_front() else {
                return;
            };
            if let Err(words) = self.check(&frame) {
                self.skip(words);
            }
        }
    }

    fn check(&mut self, frame: &DetectionFrame) -> Result<(), String> {
        if self.is_other {
            return Err(
                "a frame whose camera info has another calibration than the first".to_owned(),
            );
        }
        if self.is_given
            && self.pipeline.camera().is_none()
            && let Some(info) = &self.info
        {
            // Without a recorded camera info the frame of the detections is that of the given calibration.
            let info = info.clone();
            let result = self.pipeline.set_camera(&info, &frame.frame_id);
            result.map_err(|error| error.to_string())?;
        }
        let words = |refusal: crate::pipeline::Refusal| refusal.to_string();
        let camera = self
            .pipeline
            .camera_for(frame.stamp, &frame.frame_id)
            .map_err(words)?;
        let detections = frame
            .detections
            .as_ref()
            .map_err(|refusal| refusal.to_string())?;
        let sigma_px = self.settings.pixel_sigma_px;
        let observations =
            observe(camera, detections, sigma_px, |id| self.map.get(id)).map_err(words)?;
        let info = self.info.as_ref().ok_or("no camera info")?;
        let edges = ImageEdges::new(info, camera, self.settings.rectified);
        let (observations, _) = edges.leave_out(observations, self.settings.edge_margin_px);
        let stamp_ns = frame.stamp.nanoseconds();
        let reported = receiver_from_tanker(&self.receiver, &self.tanker, stamp_ns).ok();
        let frame_read = RecordedFrame {
            time_s: 0.0,
            observations,
            receiver_from_tanker: reported,
        };
        self.read.push((frame.stamp, frame_read));
        Ok(())
    }

    fn finish(mut self, info: CameraInfo, camera: Camera, estimator: Estimator) -> Flight {
        self.read.sort_by_key(|(stamp, _)| *stamp);
        let count = self.read.len();
        self.read.dedup_by_key(|(stamp, _)| *stamp);
        let repeated = count - self.read.len();
        if repeated > 0 {
            self.skip(format!("{repeated} frames with the stamp of another one"));
        }
        let left = self.skipped_count - self.skipped.len() as u64;
        if left > 0 {
            self.skipped.push(format!("and {left} more"));
        }
        let first_ns = self
            .read
            .first()
            .map_or(0, |(stamp, _)| stamp.nanoseconds());
        let frames: Vec<RecordedFrame> = self
            .read
            .into_iter()
            .map(|(stamp, frame)| RecordedFrame {
                time_s: 1e-9 * (stamp.nanoseconds() - first_ns) as f64,
                ..frame
            })
            .collect();
        let with_attitudes = frames
            .iter()
            .filter(|frame| frame.receiver_from_tanker.is_some())
            .count();
        Flight {
            info,
            camera,
            map: self.map,
            settings: self.settings,
            estimator,
            frames,
            with_attitudes,
            skipped: self.skipped,
        }
    }
}
