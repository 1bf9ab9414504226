//! Which topics of a recording are evaluated.

use std::collections::BTreeMap;

use ros2_node::names::{NamesError, NodeNames};

use crate::answering::topics as node;
use crate::config::Input;
use crate::messages as m;
use crate::recording::type_name;

/// Where the truth is unless it is named, as `simulate` writes it.
const TRUTH: &str = "truth";

/// What a topic is for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum Role {
    CameraInfo,
    Detections,
    Pose,
    Status,
    Odometry,
    Integrity,
    Transform,
    Truth,
}

impl Role {
    /// Returns what its messages are called in reports.
    pub(super) const fn label(self) -> &'static str {
        match self {
            Self::CameraInfo => "camera_info",
            Self::Detections => "detections",
            Self::Pose => "pose",
            Self::Status => "status",
            Self::Odometry => "odometry",
            Self::Integrity => "integrity",
            Self::Transform => "tf",
            Self::Truth => "truth",
        }
    }

    /// Returns the types that its messages may have.
    pub(super) fn type_names(self, input: Input) -> Vec<String> {
        match self {
            Self::CameraInfo => vec![type_name::<m::CameraInfo>()],
            Self::Detections => vec![match input {
                Input::FeaturePoints => type_name::<m::FeaturePointArray>(),
                Input::Detections => type_name::<m::Detection2DArray>(),
                Input::AprilTags => type_name::<m::AprilTagDetectionArray>(),
            }],
            Self::Pose => vec![type_name::<m::PoseWithCovarianceStamped>()],
            Self::Status => vec![type_name::<m::EstimatorStatus>()],
            Self::Odometry => vec![type_name::<m::Odometry>()],
            Self::Integrity => vec![type_name::<m::Integrity>()],
            Self::Transform => vec![type_name::<m::TFMessage>()],
            Self::Truth => vec![
                type_name::<m::PoseStamped>(),
                type_name::<m::PoseWithCovarianceStamped>(),
                type_name::<m::Odometry>(),
            ],
        }
    }
}

/// The topics by their absolute names.
#[derive(Debug, Clone)]
pub(super) struct Topics {
    by_name: BTreeMap<String, Role>,
    /// Absolute name of the truth.
    pub(super) truth: String,
    /// Whether the truth was named: then it must be there.
    pub(super) truth_is_named: bool,
}

impl Topics {
    /// Returns the node's topics under these names, and the truth.
    ///
    /// # Errors
    /// [`NamesError`] of a remap or of the name of the truth.
    pub(super) fn new(
        names: &NodeNames,
        input: Input,
        truth: Option<&str>,
    ) -> Result<Self, NamesError> {
        let mut by_name = BTreeMap::new();
        for (topic, role) in [
            (node::CAMERA_INFO, Role::CameraInfo),
            (input.topic(), Role::Detections),
            (node::POSE, Role::Pose),
            (node::STATUS, Role::Status),
            (node::ODOMETRY, Role::Odometry),
            (node::INTEGRITY, Role::Integrity),
            (node::TRANSFORM, Role::Transform),
        ] {
            by_name.insert(names.topic(topic.name)?, role);
        }
        let truth_is_named = truth.is_some();
        let truth = names.topic(truth.unwrap_or(TRUTH))?;
        by_name.insert(truth.clone(), Role::Truth);
        Ok(Self {
            by_name,
            truth,
            truth_is_named,
        })
    }

    /// Returns what a topic is for; `None`: it is not evaluated.
    pub(super) fn role_of(&self, name: &str) -> Option<Role> {
        self.by_name.get(name).copied()
    }

    /// Returns the absolute name of the topic with this role.
    pub(super) fn name_of(&self, role: Role) -> &str {
        let found = self.by_name.iter().find(|(_, of)| **of == role);
        found.map_or("", |(name, _)| name.as_str())
    }
}
