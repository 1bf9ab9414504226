//! The node's topics, in one table: name, direction, quality of service, and the configurations that open them.
//!
//! What opens a topic, overrides its quality of service, names it at the start or checks its remap looks here.

use crate::config::{AttitudeSource, Configuration, Input};
use ros2_node::names::{NamesError, NodeNames};
use ros2_node::qos_overrides::{Endpoint, Policies, Role};

/// One topic of the node.
#[derive(Debug, Clone)]
pub struct Topic {
    /// Its name before remaps.
    pub name: &'static str,
    /// Which end of it the node is.
    pub role: Role,
    /// Samples that may wait, unless it is overridden.
    pub depth: usize,
    is_open: fn(&Configuration) -> bool,
}

impl Topic {
    /// Returns whether this configuration opens it.
    #[must_use]
    pub fn is_open(&self, configuration: &Configuration) -> bool {
        (self.is_open)(configuration)
    }
}

const fn input(name: &'static str, depth: usize, is_open: fn(&Configuration) -> bool) -> Topic {
    Topic {
        name,
        role: Role::Subscription,
        depth,
        is_open,
    }
}

const fn output(name: &'static str, depth: usize, is_open: fn(&Configuration) -> bool) -> Topic {
    Topic {
        name,
        role: Role::Publisher,
        depth,
        is_open,
    }
}

/// Samples that wait for the node: enough for a hiccup, too few to lag behind.
const INPUT: usize = 10;
/// Half a second of a flight controller: samples before and after an image's stamp serve it too.
const ATTITUDE_INPUT: usize = 100;
/// One second of a 50 Hz camera, for subscribers that acknowledge late.
const OUTPUT: usize = 50;
/// As tf2 has it.
const TRANSFORMS: usize = 100;
/// One message a second.
const DIAGNOSTICS: usize = 10;
/// Reliable, so that MAVROS hears it; PX4's bridge, which asks for best effort, does too.
const FLIGHT_STACK: usize = 10;

macro_rules! topics {
    ($($(#[$doc:meta])* $topic:ident = $declaration:expr;)+) => {
        $($(#[$doc])* pub const $topic: Topic = $declaration;)+

        /// All topics that the node may have.
        pub const TOPICS: &[Topic] = &[$($topic),+];
    };
}

topics! {
    /// Input: the detections of an image, in our own message.
    FEATURE_POINTS = input("feature_points", INPUT, |node| node.input == Input::FeaturePoints);
    /// Input: the detections of an image, in those of others.
    DETECTIONS = input("detections", INPUT, |node| node.input != Input::FeaturePoints);
    /// Input: the camera that took the images.
    CAMERA_INFO = input("camera_info", INPUT, |_| true);
    /// Input: the receiver's attitude, from PX4.
    VEHICLE_ATTITUDE = input("/fmu/out/vehicle_attitude", ATTITUDE_INPUT, |node| {
        matches!(node.consumers.attitude, Some(AttitudeSource::Px4))
    });
    /// Input: the receiver's attitude, from MAVROS.
    IMU = input("/mavros/imu/data", ATTITUDE_INPUT, |node| {
        matches!(node.consumers.attitude, Some(AttitudeSource::Imu))
    });
    /// Input: the tanker's attitude, as its own autopilot knows it.
    TANKER_ATTITUDE = input("tanker_attitude", ATTITUDE_INPUT, |node| {
        node.settings.reported_attitude.is_some()
    });
    /// Output: trusted poses.
    POSE = output("pose", OUTPUT, |_| true);
    /// Output: the track, pose and twist.
    ODOMETRY = output("odometry", OUTPUT, |_| true);
    /// Output: what became of every image.
    STATUS = output("status", OUTPUT, |_| true);
    /// Output: protection levels of every image.
    INTEGRITY = output("integrity", OUTPUT, |node| node.publish_integrity);
    /// Output: the node's health.
    HEALTH = output("/diagnostics", DIAGNOSTICS, |_| true);
    /// Output: trusted poses as transforms.
    TRANSFORM = output("/tf", TRANSFORMS, |node| node.publish_tf);
    /// Output: what can be drawn of a frame.
    MARKERS = output("markers", OUTPUT, |node| node.publish_markers);
    /// Output: where markers will be, for detectors.
    PREDICTED_POINTS = output("predicted_points", OUTPUT, |node| node.publish_predicted_points);
    /// Output: where the receptacle is before the probe tip.
    RECEPTACLE = output("receptacle", FLIGHT_STACK, |node| node.consumers.receptacle);
    /// Output: PX4's landing target.
    PX4_LANDING_TARGET = output("/fmu/in/landing_target_pose", FLIGHT_STACK, |node| {
        node.consumers.px4_landing_target
    });
    /// Output: PX4's marker report.
    PX4_FIDUCIAL_MARKER = output("/fmu/in/fiducial_marker_pos_report", FLIGHT_STACK, |node| {
        node.consumers.px4_fiducial_marker
    });
    /// Output: MAVROS's landing target (its parameter `listen_lt`).
    MAVROS_LANDING_TARGET = output("/mavros/landing_target/raw", FLIGHT_STACK, |node| {
        node.consumers.mavros_landing_target
    });
    /// Output: the receptacle as a pose in ENU, under MAVROS's name for a landing target: for consumers of ENU. What
    /// MAVROS makes of it, no autopilot may have: PX4 takes it as an absolute place.
    MAVROS_POSE = output("/mavros/landing_target/pose", FLIGHT_STACK, |node| {
        node.consumers.mavros_pose
    });
}

/// What the receiver's attitude is called in log lines, whichever topic brings it.
pub(crate) const ATTITUDE: &str = "attitude";

impl Input {
    /// Returns its topic.
    #[must_use]
    pub const fn topic(self) -> Topic {
        match self {
            Self::FeaturePoints => FEATURE_POINTS,
            Self::Detections | Self::AprilTags => DETECTIONS,
        }
    }
}

impl AttitudeSource {
    /// Returns its topic.
    #[must_use]
    pub const fn topic(self) -> Topic {
        match self {
            Self::Px4 => VEHICLE_ATTITUDE,
            Self::Imu => IMU,
        }
    }
}

/// Returns all topics that the node may have, for `qos_overrides`.
///
/// # Errors
/// [`NamesError`] of a remap.
pub fn endpoints(names: &NodeNames) -> Result<Vec<Endpoint>, NamesError> {
    let endpoint = |topic: &Topic| {
        let name = names.topic(topic.name)?;
        let policies = match topic.role {
            Role::Subscription => Policies::sensor_data(topic.depth),
            Role::Publisher => Policies::reliable(topic.depth),
        };
        Ok(Endpoint::new(name, topic.role, policies))
    };
    TOPICS.iter().map(endpoint).collect()
}

/// Returns the absolute names of the topics that this configuration opens.
///
/// # Errors
/// [`NamesError`] of a remap.
pub fn opened(names: &NodeNames, configuration: &Configuration) -> Result<Vec<String>, NamesError> {
    open(configuration)
        .map(|topic| names.topic(topic.name))
        .collect()
}

/// Returns what the node says of its topics at the start.
#[must_use]
pub fn introduction(names: &NodeNames, configuration: &Configuration) -> String {
    let named = |role| {
        open(configuration)
            .filter(|topic| topic.role == role)
            .map(|topic| names.topic(topic.name).unwrap_or_default())
            .collect::<Vec<_>>()
    };
    format!(
        "listening to {}, publishing {}",
        named(Role::Subscription).join(" and "),
        named(Role::Publisher).join(", ")
    )
}

fn open(configuration: &Configuration) -> impl Iterator<Item = &'static Topic> {
    TOPICS.iter().filter(|topic| topic.is_open(configuration))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::{ParameterValue, Parameters, TABLE};

    fn configuration(changes: &[(&str, ParameterValue)]) -> Configuration {
        let mut parameters = Parameters::new(TABLE);
        for (name, value) in changes {
            let set = parameters.set(name, value.clone());
            set.expect("the test's values are valid");
        }
        Configuration::from(&parameters)
    }

    #[test]
    fn no_topic_is_listed_twice() {
        for (index, topic) in TOPICS.iter().enumerate() {
            assert!(TOPICS[..index].iter().all(|other| other.name != topic.name));
        }
    }

    #[test]
    fn defaults_open_what_is_not_asked_for_by_a_parameter() {
        let names = NodeNames::new("tanker_pose", &[]).expect("a valid name");
        assert_eq!(
            introduction(&names, &configuration(&[])),
            "listening to /feature_points and /camera_info, publishing /pose, /odometry, /status, /diagnostics"
        );
    }

    #[test]
    fn every_input_and_every_attitude_opens_its_own_topic_only() {
        let listens = |configuration: &Configuration| {
            let inputs = open(configuration).filter(|topic| topic.role == Role::Subscription);
            inputs.map(|topic| topic.name).collect::<Vec<_>>()
        };
        for word in ["feature_points", "detections", "apriltags"] {
            let found = configuration(&[("input", ParameterValue::String(word.to_owned()))]);
            assert_eq!(
                listens(&found),
                [found.input.topic().name, CAMERA_INFO.name]
            );
        }
        let sigma = ("reported_attitude_sigma_deg", ParameterValue::Double(2.0));
        assert_eq!(
            listens(&configuration(&[sigma]))[2..],
            [TANKER_ATTITUDE.name]
        );
        let mut found = configuration(&[]);
        for source in [AttitudeSource::Px4, AttitudeSource::Imu] {
            found.consumers.attitude = Some(source);
            assert_eq!(listens(&found)[2..], [source.topic().name]);
        }
    }
}
