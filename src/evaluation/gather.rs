//! What of a recording is evaluated, in memory: one entry for every message of the topics that matter.

use std::collections::BTreeMap;
use std::fmt::Display;
use std::sync::Arc;

use nalgebra::{Isometry3, Matrix6, Vector6};

use super::settings::Settings;
use super::topics::Role;
use crate::answering::input::{InputMessage, InputReader};
use crate::camera::Camera;
use crate::config::Input;
use crate::convert::{self, isometry};
use crate::geometry::PoseCovariance;
use crate::messages::{
    CameraInfo, EstimatorStatus, Header, Integrity, Odometry, PoseStamped,
    PoseWithCovarianceStamped, TFMessage,
};
use crate::pipeline::{Detection, Stamp};
use crate::recording::{DecodeError, RecordedMessage, RecordedTopic, Recording, definitions};
use crate::text::clip;

/// Most lines about damage that are kept: a recording may be damaged everywhere.
const MOST_LINES: usize = 20;

/// One estimate or truth.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct StampedPose {
    pub(super) stamp_ns: i64,
    pub(super) camera_from_tanker: Isometry3<f64>,
    /// Zero where the message has none.
    pub(super) covariance: PoseCovariance,
    /// In the tanker's axes, of an odometry.
    pub(super) twist: Option<Vector6<f64>>,
}

/// The detections of an image, and the camera that was known then.
#[derive(Debug, Clone)]
pub(super) struct SeenFrame {
    pub(super) detections: Vec<Detection>,
    pub(super) camera: Option<Arc<Camera>>,
}

/// When a message was stamped and recorded.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Times {
    pub(super) stamp_ns: i64,
    pub(super) log_ns: i64,
}

/// What was read on one topic.
#[derive(Debug, Clone, Default)]
pub(super) struct Heard {
    pub(super) name: String,
    pub(super) type_name: String,
    pub(super) times: Vec<Times>,
}

/// All of a recording that is evaluated. Series are in the order of the recording.
#[derive(Debug, Default)]
pub(super) struct Gathered {
    pub(super) messages: u64,
    pub(super) heard: BTreeMap<Role, Heard>,
    pub(super) poses: Vec<StampedPose>,
    pub(super) odometry: Vec<StampedPose>,
    pub(super) truths: Vec<StampedPose>,
    pub(super) statuses: Vec<EstimatorStatus>,
    pub(super) integrity: Vec<Integrity>,
    pub(super) seen: BTreeMap<i64, SeenFrame>,
    /// Frames by the role of the messages that name them.
    pub(super) frames: BTreeMap<Role, BTreeMap<String, u64>>,
    /// Child frames, of truth and odometry.
    pub(super) child_frames: BTreeMap<Role, BTreeMap<String, u64>>,
    /// What could not be read or used, in words.
    pub(super) skipped: Vec<String>,
    skipped_count: u64,
    undecodable: BTreeMap<String, (u64, String)>,
    not_poses: BTreeMap<Role, u64>,
    camera: Option<Arc<Camera>>,
    camera_reasons: BTreeMap<String, u64>,
}

impl Gathered {
    /// Reads a recording to its end.
    pub(super) fn read(recording: Recording, settings: &Settings) -> Self {
        let mut found = Self::default();
        let reader = InputReader {
            input: settings.input,
            map: Arc::clone(&settings.map),
            max_hamming: settings.max_hamming,
        };
        let mut roles: BTreeMap<*const RecordedTopic, (Arc<RecordedTopic>, Option<Role>)> =
            BTreeMap::new();
        for item in recording {
            let message = match item {
                Ok(message) => message,
                Err(damage) => {
                    found.skip(damage.to_string());
                    continue;
                }
            };
            found.messages += 1;
            let key = Arc::as_ptr(&message.topic);
            let role = if let Some((_, role)) = roles.get(&key) {
                *role
            } else {
                let role = found.role_of(&message.topic, settings);
                roles.insert(key, (Arc::clone(&message.topic), role));
                role
            };
            let Some(role) = role else { continue };
            if let Err(error) = found.take(role, &message, &reader, settings) {
                found.undecodable(&message.topic.name, &error);
            }
        }
        found.close();
        found
    }

    /// Returns what a topic is for, if its messages can be used.
    fn role_of(&mut self, topic: &RecordedTopic, settings: &Settings) -> Option<Role> {
        let role = settings.topics.role_of(&topic.name)?;
        let name = clip(&topic.name);
        let types = role.type_names(settings.input);
        if !types.contains(&topic.type_name) {
            self.skip(format!(
                "{name} is not read: expected messages of {}, got {}",
                types.join(" or "),
                clip(&topic.type_name)
            ));
            return None;
        }
        let recorded = topic.definition.as_ref();
        let difference =
            recorded.and_then(|recorded| definitions::difference(&topic.type_name, recorded));
        if let Some(words) = difference {
            self.skip(format!(
                "{name} is not read: its type {} is defined otherwise in this recording: {words}",
                topic.type_name
            ));
            return None;
        }
        Some(role)
    }

    fn take(
        &mut self,
        role: Role,
        message: &RecordedMessage,
        reader: &InputReader,
        settings: &Settings,
    ) -> Result<(), DecodeError> {
        let header = match role {
            Role::CameraInfo => {
                let info: CameraInfo = message.decode()?;
                self.on_camera(&info, settings.rectified);
                info.header
            }
            Role::Detections => self.on_detections(message, reader)?,
            Role::Pose => {
                let pose: PoseWithCovarianceStamped = message.decode()?;
                let found = stamped(&pose.header, &pose.pose.pose, &pose.pose.covariance);
                self.push_pose(role, found);
                pose.header
            }
            Role::Odometry => {
                let (header, child, found) = odometry(&message.decode()?);
                self.push_pose(role, found);
                self.child(role, child);
                header
            }
            Role::Truth => self.on_truth(message)?,
            Role::Status => {
                let status: EstimatorStatus = message.decode()?;
                let header = status.header.clone();
                self.statuses.push(status);
                header
            }
            Role::Integrity => {
                let integrity: Integrity = message.decode()?;
                let header = integrity.header.clone();
                self.integrity.push(integrity);
                header
            }
            Role::Transform => {
                let transforms: TFMessage = message.decode()?;
                let own = |child: &str| child == settings.tanker_frame_id;
                let found = transforms.transforms.into_iter();
                let Some(found) = found.into_iter().find(|found| own(&found.child_frame_id)) else {
                    return Ok(());
                };
                found.header
            }
        };
        let frames = self.frames.entry(role).or_default();
        if frames.len() < MOST_LINES {
            *frames.entry(header.frame_id).or_default() += 1;
        }
        let heard = self.heard.entry(role).or_default();
        if heard.name.is_empty() {
            heard.name.clone_from(&message.topic.name);
            heard.type_name.clone_from(&message.topic.type_name);
        }
        heard.times.push(Times {
            stamp_ns: Stamp::from(header.stamp).nanoseconds(),
            log_ns: i64::try_from(message.log_time_ns).unwrap_or(i64::MAX),
        });
        Ok(())
    }

    fn on_camera(&mut self, info: &CameraInfo, rectified: bool) {
        match Camera::from_info(&convert::camera_info(info), rectified) {
            Ok(camera) if self.camera.as_deref() == Some(&camera) => {}
            Ok(camera) => self.camera = Some(Arc::new(camera)),
            Err(reason) => {
                self.camera = None;
                if self.camera_reasons.len() < MOST_LINES {
                    *self.camera_reasons.entry(reason.to_string()).or_default() += 1;
                }
            }
        }
    }

    fn on_detections(
        &mut self,
        message: &RecordedMessage,
        reader: &InputReader,
    ) -> Result<Header, DecodeError> {
        let read = reader.read(match reader.input {
            Input::FeaturePoints => InputMessage::FeaturePoints(message.decode()?),
            Input::Detections => InputMessage::Detections(message.decode()?),
            Input::AprilTags => InputMessage::AprilTags(message.decode()?),
        });
        let stamp_ns = Stamp::from(read.header.stamp).nanoseconds();
        if let Ok(detections) = read.detections {
            let camera = self.camera.clone();
            // Of a stamp that comes twice the first: the node answers both alike.
            self.seen
                .entry(stamp_ns)
                .or_insert(SeenFrame { detections, camera });
        }
        Ok(read.header)
    }

    fn on_truth(&mut self, message: &RecordedMessage) -> Result<Header, DecodeError> {
        let zero = [0.0; 36];
        let (header, child, found) = match message.topic.type_name.as_str() {
            "nav_msgs/msg/Odometry" => odometry(&message.decode()?),
            "geometry_msgs/msg/PoseWithCovarianceStamped" => {
                let truth: PoseWithCovarianceStamped = message.decode()?;
                let found = stamped(&truth.header, &truth.pose.pose, &zero);
                (truth.header, String::new(), found)
            }
            _ => {
                let truth: PoseStamped = message.decode()?;
                let found = stamped(&truth.header, &truth.pose, &zero);
                (truth.header, String::new(), found)
            }
        };
        self.push_pose(Role::Truth, found);
        self.child(Role::Truth, child);
        Ok(header)
    }

    fn push_pose(&mut self, role: Role, found: Option<StampedPose>) {
        match (role, found) {
            (_, None) => *self.not_poses.entry(role).or_default() += 1,
            (Role::Odometry, Some(found)) => self.odometry.push(found),
            (Role::Truth, Some(found)) => self.truths.push(found),
            (_, Some(found)) => self.poses.push(found),
        }
    }

    fn child(&mut self, role: Role, child: String) {
        let children = self.child_frames.entry(role).or_default();
        if !child.is_empty() && children.len() < MOST_LINES {
            *children.entry(child).or_default() += 1;
        }
    }

    /// Records a part that could not be read or used.
    pub(super) fn skip(&mut self, words: String) {
        self.skipped_count += 1;
        if self.skipped.len() < MOST_LINES {
            self.skipped.push(words);
        }
    }

    fn undecodable(&mut self, topic: &str, reason: &dyn Display) {
        if let Some((count, _)) = self.undecodable.get_mut(topic) {
            *count += 1;
        } else if self.undecodable.len() < MOST_LINES {
            let reason = reason.to_string();
            self.undecodable.insert(topic.to_owned(), (1, reason));
        }
    }

    /// Puts into words what was counted.
    fn close(&mut self) {
        for (topic, (count, reason)) in std::mem::take(&mut self.undecodable) {
            let topic = clip(&topic);
            self.skip(format!(
                "{count} message(s) on {topic} cannot be decoded: {reason}"
            ));
        }
        for (role, count) in std::mem::take(&mut self.not_poses) {
            let name = role.label();
            self.skip(format!(
                "{count} message(s) of {name} hold no pose: a number that is not finite, or no unit quaternion"
            ));
        }
        for (reason, count) in std::mem::take(&mut self.camera_reasons) {
            self.skip(format!(
                "{count} camera info(s) cannot be used, so their frames give no residuals: {reason}"
            ));
        }
        if self.messages == 0 {
            self.skip("the recording has no messages".to_owned());
        }
    }

    /// Ends the list of what could not be read.
    pub(super) fn finish_skipped(&mut self) -> Vec<String> {
        let mut skipped = std::mem::take(&mut self.skipped);
        let left = self.skipped_count.saturating_sub(skipped.len() as u64);
        if left > 0 {
            skipped.push(format!("and {left} more"));
        }
        skipped
    }
}

fn stamped(
    header: &Header,
    pose: &crate::messages::Pose,
    covariance: &[f64; 36],
) -> Option<StampedPose> {
    Some(StampedPose {
        stamp_ns: Stamp::from(header.stamp).nanoseconds(),
        camera_from_tanker: isometry(pose)?,
        covariance: PoseCovariance(Matrix6::from_row_slice(covariance)),
        twist: None,
    })
}

fn odometry(message: &Odometry) -> (Header, String, Option<StampedPose>) {
    let twist = &message.twist.twist;
    let (v, w) = (&twist.linear, &twist.angular);
    let found = stamped(
        &message.header,
        &message.pose.pose,
        &message.pose.covariance,
    );
    let found = found.map(|found| StampedPose {
        twist: Some(Vector6::new(v.x, v.y, v.z, w.x, w.y, w.z)),
        ..found
    });
    (
        message.header.clone(),
        message.child_frame_id.clone(),
        found,
    )
}
