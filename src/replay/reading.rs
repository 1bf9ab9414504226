//! Frames of a recording as they are read, with the camera and the attitudes of their time.

use std::collections::VecDeque;

use super::routes::Route;
use crate::answering::input::{InputMessage, InputReader};
use crate::calibration::RecordedFrame;
use crate::camera::{Camera, CameraInfo};
use crate::config::{AttitudeSource, Configuration, Input, Settings};
use crate::convert;
use crate::estimation::Estimator;
use crate::frames::{AttitudeHistory, AttitudeSample, receiver_from_tanker};
use crate::messages;
use crate::pipeline::{DetectionFrame, ImageEdges, Pipeline, Refusal, Stamp, observe};
use crate::recording::{DecodeError, RecordedMessage};
use crate::target::MarkerMap;

/// Most lines about what could not be used.
const MOST: usize = 20;

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
    /// What could not be read or used, in words; of many the first.
    pub skipped: Vec<String>,
}

/// What is read so far.
pub(super) struct Reading<'a> {
    pipeline: Pipeline,
    reader: &'a InputReader,
    receiver: AttitudeHistory,
    tanker: AttitudeHistory,
    px4_minus_ros_us: i64,
    pub(super) info: Option<CameraInfo>,
    is_given: bool,
    /// Frames with their log time, that wait for attitudes.
    waiting: VecDeque<(u64, DetectionFrame)>,
    pub(super) read: Vec<(Stamp, RecordedFrame)>,
    pub(super) settings: Settings,
    pub(super) map: MarkerMap,
    /// Log times from which on the camera info had another calibration than the first, or the same again.
    others: Vec<(u64, bool)>,
    pub(super) skipped: Vec<String>,
    skipped_count: u64,
}

impl<'a> Reading<'a> {
    /// Returns a reading that has read nothing; `given` is a calibration in place of the recorded ones.
    pub(super) fn new(
        configuration: &Configuration,
        reader: &'a InputReader,
        map: MarkerMap,
        given: Option<CameraInfo>,
    ) -> Self {
        Self {
            pipeline: Pipeline::new(configuration.settings.clone(), map.clone().into()),
            reader,
            receiver: AttitudeHistory::new(configuration.consumers.attitude_max_age_s),
            tanker: AttitudeHistory::new(configuration.tanker_attitude_max_age_s),
            px4_minus_ros_us: configuration.consumers.px4_minus_ros_us,
            is_given: given.is_some(),
            info: given,
            waiting: VecDeque::new(),
            read: Vec::new(),
            settings: configuration.settings.clone(),
            map,
            others: Vec::new(),
            skipped: Vec::new(),
            skipped_count: 0,
        }
    }

    pub(super) fn skip(&mut self, words: String) {
        self.skipped_count += 1;
        if self.skipped.len() < MOST {
            self.skipped.push(words);
        }
    }

    pub(super) fn take(
        &mut self,
        route: Route,
        message: &RecordedMessage,
    ) -> Result<(), DecodeError> {
        match route {
            Route::CameraInfo => {
                let info: messages::CameraInfo = message.decode()?;
                self.camera_info(&info, message.log_time_ns);
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

    fn camera_info(&mut self, message: &messages::CameraInfo, log_time_ns: u64) {
        let info = convert::camera_info(message);
        let is_first = self.info.is_none();
        let used = self.info.get_or_insert(info.clone());
        let is_other = *used != info && !self.is_given;
        if self.others.last().is_some_and(|(_, last)| *last) != is_other {
            self.others.push((log_time_ns, is_other));
        }
        if is_other {
            return;
        }
        let used = used.clone();
        let result = self.pipeline.set_camera(&used, &message.header.frame_id);
        if let (true, Err(error)) = (is_first, result) {
            self.skip(format!("the camera info cannot be used: {error}"));
        }
    }

    /// Checks the frames that were recorded until a time.
    pub(super) fn settle(&mut self, until_ns: u64) {
        while let Some((log_time_ns, _)) = self.waiting.front()
            && *log_time_ns <= until_ns
        {
            let Some((log_time_ns, frame)) = self.waiting.pop_front() else {
                return;
            };
            if let Err(words) = self.check(&frame, log_time_ns) {
                self.skip(words);
            }
        }
    }

    fn check(&mut self, frame: &DetectionFrame, log_time_ns: u64) -> Result<(), String> {
        let mut before = self.others.iter().rev();
        let of_then = before.find(|(since_ns, _)| *since_ns <= log_time_ns);
        if of_then.is_some_and(|(_, is_other)| *is_other) {
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
        let words = |refusal: Refusal| refusal.to_string();
        let camera = self
            .pipeline
            .camera_for(frame.stamp, &frame.frame_id)
            .map_err(words)?;
        let detections = frame.detections.as_ref().map_err(ToString::to_string)?;
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

    pub(super) fn finish(
        mut self,
        info: CameraInfo,
        camera: Camera,
        estimator: Estimator,
    ) -> Flight {
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
        Flight {
            info,
            camera,
            map: self.map,
            settings: self.settings,
            estimator,
            frames,
            skipped: self.skipped,
        }
    }
}
