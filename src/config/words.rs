//! The parameters with a fixed set of values: each an enum with its names, the default first.

use crate::estimation::{Initialisation, Refinement};

/// Source of the receiver's attitude.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum AttitudeSource {
    /// `px4_msgs/VehicleAttitude`.
    Px4,
    /// `sensor_msgs/Imu`.
    Imu,
}

/// Message type of the detections.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub enum Input {
    /// `tanker_pose/FeaturePointArray`.
    FeaturePoints,
    /// `vision_msgs/Detection2DArray`.
    Detections,
    /// `apriltag_msgs/AprilTagDetectionArray`.
    AprilTags,
}

ros2_node::words! { Input:
    "feature_points" => Input::FeaturePoints,
    "detections" => Input::Detections,
    "apriltags" => Input::AprilTags,
}

ros2_node::words! { Initialisation:
    "nominal" => Initialisation::Nominal,
    "dlt" => Initialisation::Dlt,
    "previous" => Initialisation::Previous,
    "global" => Initialisation::Global,
}

ros2_node::words! { Refinement:
    "maximum_likelihood" => Refinement::MaximumLikelihood,
    "none" => Refinement::None,
}

/// Source of the receiver's attitude; may be none.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Attitude(pub Option<AttitudeSource>);

ros2_node::words! { Attitude:
    "none" => Attitude(None),
    "px4" => Attitude(Some(AttitudeSource::Px4)),
    "imu" => Attitude(Some(AttitudeSource::Imu)),
}

#[cfg(test)]
mod tests {
    use super::*;
    use ros2_node::parameters::Words;

    fn meanings<T: Words>() -> Vec<(&'static str, Option<T>)> {
        let meaning = |word: &&'static str| (*word, T::from_word(word));
        T::WORDS.iter().map(meaning).collect()
    }

    #[test]
    fn every_word_has_its_own_meaning() {
        let input = [
            ("feature_points", Some(Input::FeaturePoints)),
            ("detections", Some(Input::Detections)),
            ("apriltags", Some(Input::AprilTags)),
        ];
        assert_eq!(meanings::<Input>(), input);
        let initialisation = [
            ("nominal", Some(Initialisation::Nominal)),
            ("dlt", Some(Initialisation::Dlt)),
            ("previous", Some(Initialisation::Previous)),
            ("global", Some(Initialisation::Global)),
        ];
        assert_eq!(meanings::<Initialisation>(), initialisation);
        let refinement = [
            ("maximum_likelihood", Some(Refinement::MaximumLikelihood)),
            ("none", Some(Refinement::None)),
        ];
        assert_eq!(meanings::<Refinement>(), refinement);
        let attitude = [
            ("none", Some(Attitude(None))),
            ("px4", Some(Attitude(Some(AttitudeSource::Px4)))),
            ("imu", Some(Attitude(Some(AttitudeSource::Imu)))),
        ];
        assert_eq!(meanings::<Attitude>(), attitude);
    }
}
