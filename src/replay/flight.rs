//! The frames of a recording with camera, map and settings, checked as the node checks them: for tools that look at all
//! frames together.

use ros2_node::names::NamesError;

use super::Replay;
use super::reading::{Flight, Reading};
use super::routes::{Route, Routes};
use crate::answering::input::InputReader;
use crate::camera::{Camera, CameraError, CameraInfo};
use crate::estimation::{Estimator, EstimatorSettings};
use crate::pipeline::{error_budget, modes_of_file};
use crate::recording::Recording;
use crate::text::clip;

/// A frame waits this long for the attitudes around its time, ns: they are recorded later than the image is taken.
const PATIENCE_NS: u64 = 300_000_000;

/// Why a recording has no frames to look at.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FlightError {
    /// A remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// No camera info, and none was given.
    #[error("no camera info on {topic}, and no calibration file given{hint}")]
    NoCamera {
        /// The topic.
        topic: String,
        /// Which others there are, or what is wrong with the recording.
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
        mut recording: Recording,
        given: Option<CameraInfo>,
    ) -> Result<Flight, FlightError> {
        let routes = Routes::new(&self.configuration, &self.names)?;
        let configuration = &self.configuration;
        let map = self.files.map.clone();
        let reader = InputReader {
            input: configuration.input,
            map: map.clone().into(),
            max_hamming: configuration.max_hamming,
        };
        let mut reading = Reading::new(configuration, &reader, map, given);
        let topics = recording.topics().to_vec();
        // What could not be read, which may be why there is no camera info. Frames are refused for lack of one.
        let mut unread = None;
        let mut skip = |reading: &mut Reading, words: String| {
            unread.get_or_insert_with(|| words.clone());
            reading.skip(words);
        };
        for topic in &topics {
            if let Err(words) = routes.of(topic) {
                skip(&mut reading, format!("{}: {words}", clip(&topic.name)));
            }
        }
        for item in &mut recording {
            match item {
                Ok(message) => {
                    reading.settle(message.log_time_ns.saturating_sub(PATIENCE_NS));
                    if let Ok(Some(route)) = routes.of(&message.topic)
                        && let Err(error) = reading.take(route, &message)
                    {
                        let words = format!("{}: {error}", clip(&message.topic.name));
                        skip(&mut reading, words);
                    }
                }
                Err(damage) => skip(&mut reading, damage.to_string()),
            }
        }
        reading.settle(u64::MAX);
        let hint = |route: Route, name: &str| {
            let kind = route.type_name();
            let mut others = topics.iter().filter(|topic| topic.type_name == kind);
            match others.clone().find(|topic| topic.name == *name) {
                Some(_) => "; the topic has no messages".to_owned(),
                None => others.next().map_or_else(
                    || format!("; the recording has no topic of {kind}"),
                    |other| {
                        let other = clip(&other.name);
                        format!("; of {kind} the recording has {other}: use -r")
                    },
                ),
            }
        };
        let problem = |words: &String| format!("; the first problem: {words}");
        let named = |wanted: fn(Route) -> bool| {
            let found = routes.iter().find(|(_, route)| wanted(*route));
            found.map_or_else(
                || (String::new(), Route::CameraInfo),
                |(name, route)| (name.to_owned(), route),
            )
        };
        let Some(info) = reading.info.take() else {
            let (topic, route) = named(|route| route == Route::CameraInfo);
            let hint = unread.as_ref().map_or_else(|| hint(route, &topic), problem);
            return Err(FlightError::NoCamera { topic, hint });
        };
        let camera = Camera::from_info(&info, reading.settings.rectified)?;
        if reading.read.is_empty() {
            let (topic, route) = named(|route| matches!(route, Route::Detections(_)));
            let first = reading.skipped.first();
            let hint = first.map_or_else(|| hint(route, &topic), problem);
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
