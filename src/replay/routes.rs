//! Which topics of a recording are the node's inputs.

use std::collections::BTreeMap;

use ros2_node::graph::{Graph, Misfit};
use ros2_node::names::{NamesError, NodeNames};

use crate::answering::attitudes::AttitudeMessage;
use crate::answering::handler::Handler;
use crate::answering::input::InputMessage;
use crate::answering::topics::{ATTITUDE, CAMERA_INFO, TANKER_ATTITUDE};
use crate::config::{AttitudeSource, Configuration, Input};
use crate::messages::{CameraInfo, Header};
use crate::recording::{DecodeError, RecordedMessage, RecordedTopic, definitions, type_name};

/// What the node does with a topic, in the order in which messages of the same time are taken: a frame is answered with
/// everything that came before it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Route {
    CameraInfo,
    Attitude(AttitudeSource),
    TankerAttitude,
    Detections(Input),
}

impl Route {
    /// Returns the topic's name before remaps, as the node's messages have it.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::CameraInfo => CAMERA_INFO.name,
            Self::Attitude(_) => ATTITUDE,
            Self::TankerAttitude => TANKER_ATTITUDE.name,
            Self::Detections(input) => input.topic().name,
        }
    }

    pub(super) fn type_name(self) -> String {
        use crate::messages as m;
        match self {
            Self::CameraInfo => type_name::<CameraInfo>(),
            Self::Attitude(AttitudeSource::Px4) => type_name::<m::VehicleAttitude>(),
            Self::Attitude(AttitudeSource::Imu) | Self::TankerAttitude => type_name::<m::Imu>(),
            Self::Detections(Input::FeaturePoints) => type_name::<m::FeaturePointArray>(),
            Self::Detections(Input::Detections) => type_name::<m::Detection2DArray>(),
            Self::Detections(Input::AprilTags) => type_name::<m::AprilTagDetectionArray>(),
        }
    }

    /// Gives a message to the handler, decoded; returns the frame that it names, of camera infos and detections.
    pub(super) fn give(
        self,
        message: &RecordedMessage,
        handler: &mut Handler,
    ) -> Result<Option<String>, DecodeError> {
        let named = |header: &Header| Some(header.frame_id.clone());
        let attitude = match self {
            Self::CameraInfo => {
                let info: CameraInfo = message.decode()?;
                handler.on_camera_info(&info);
                return Ok(named(&info.header));
            }
            Self::Detections(input) => {
                let detections = match input {
                    Input::FeaturePoints => InputMessage::FeaturePoints(message.decode()?),
                    Input::Detections => InputMessage::Detections(message.decode()?),
                    Input::AprilTags => InputMessage::AprilTags(message.decode()?),
                };
                let frame = named(detections.header());
                handler.on_detections(detections);
                return Ok(frame);
            }
            Self::Attitude(AttitudeSource::Px4) => AttitudeMessage::Px4(message.decode()?),
            Self::Attitude(AttitudeSource::Imu) | Self::TankerAttitude => {
                AttitudeMessage::Imu(Box::new(message.decode()?))
            }
        };
        if self == Self::TankerAttitude {
            handler.on_tanker_attitude(&attitude);
        } else {
            handler.on_attitude(&attitude);
        }
        Ok(None)
    }
}

/// The node's inputs by their absolute names.
pub(super) struct Routes {
    by_topic: BTreeMap<String, Route>,
}

impl Routes {
    pub(super) fn new(
        configuration: &Configuration,
        names: &NodeNames,
    ) -> Result<Self, NamesError> {
        let mut by_topic = BTreeMap::new();
        by_topic.insert(names.topic(CAMERA_INFO.name)?, Route::CameraInfo);
        if let Some(source) = configuration.consumers.attitude {
            let name = names.topic(source.topic().name)?;
            by_topic.insert(name, Route::Attitude(source));
        }
        if TANKER_ATTITUDE.is_open(configuration) {
            let name = names.topic(TANKER_ATTITUDE.name)?;
            by_topic.insert(name, Route::TankerAttitude);
        }
        let input = configuration.input;
        let name = names.topic(input.topic().name)?;
        by_topic.insert(name, Route::Detections(input));
        Ok(Self { by_topic })
    }

    /// Returns what the node does with a topic's messages.
    ///
    /// # Errors
    /// Why an input's messages cannot be used: another type, encoding or definition.
    pub(super) fn of(&self, topic: &RecordedTopic) -> Result<Option<Route>, String> {
        let Some(route) = self.by_topic.get(&topic.name) else {
            return Ok(None);
        };
        let (expected, got) = (route.type_name(), &topic.type_name);
        if *got != expected {
            let got = crate::text::clip(got);
            return Err(format!("expected messages of {expected}, got {got}"));
        }
        if topic.encoding != "cdr" {
            let got = crate::text::quoted(&topic.encoding);
            return Err(format!("expected messages encoded as \"cdr\", got {got}"));
        }
        let recorded = topic.definition.as_ref();
        match recorded.and_then(|recorded| definitions::difference(got, recorded)) {
            Some(words) => Err(format!(
                "its type {expected} is defined otherwise in this recording: {words}"
            )),
            None => Ok(Some(*route)),
        }
    }

    /// Returns the inputs with their absolute names.
    pub(super) fn iter(&self) -> impl Iterator<Item = (&str, Route)> {
        self.by_topic
            .iter()
            .map(|(name, route)| (name.as_str(), *route))
    }

    /// Returns the graph that the recording stands for: a publisher of each of its topics.
    pub(super) fn graph(&self, topics: &[std::sync::Arc<RecordedTopic>]) -> Graph {
        let mut graph = Graph::default();
        for topic in topics {
            match self.of(topic) {
                Ok(Some(_)) => *graph.heard.entry(topic.name.clone()).or_default() += 1,
                Ok(None) => {}
                Err(words) => {
                    let words = format!("{}: {words}", crate::text::clip(&topic.name));
                    graph.misfits.insert(Misfit::Type(words));
                }
            }
        }
        graph
    }
}
