//! The simulated camera and detector: their topics and stamps.

use std::time::{Instant, SystemTime, UNIX_EPOCH};

use nalgebra::Isometry3;
use ros2_client::WriteError;
use tanker_pose::camera;
use tanker_pose::pipeline::{Detection, Stamp};
use tanker_pose::ros::convert::{camera_info_message, feature_points_message, pose_message};
use tanker_pose::ros::messages::{CameraInfo, FeaturePointArray, Header, Message, PoseStamped};
use tanker_pose::ros::participant::{
    EndpointError, Publisher, QosProfile, RosNode, asked_anew, reliable,
};
use tanker_pose::ros::topics::{CAMERA_INFO, FEATURE_POINTS};

/// The true pose, `geometry_msgs/PoseStamped` in the camera frame.
pub const TRUTH: &str = "truth";
/// One second of a 50 Hz camera, for subscribers that acknowledge late.
const OUTPUT: QosProfile = reliable(50);

/// The middleware's fault, or a stamp that ROS cannot carry.
#[derive(Debug, thiserror::Error)]
pub enum SourceError {
    #[error("cannot publish {topic}: {reason}")]
    Publish { topic: &'static str, reason: String },
    #[error("the system clock is outside the years 1970 to 2038, which ROS stamps cover")]
    Clock,
}

/// The simulated sensor's publishers.
pub struct Source {
    feature_points: Publisher<FeaturePointArray>,
    camera_info: Publisher<CameraInfo>,
    truth: Publisher<PoseStamped>,
    info: camera::CameraInfo,
    frame_id: String,
    latest: Stamp,
}

/// One frame as it went out.
#[derive(Debug, Clone, Copy)]
pub struct Sent {
    /// Stamp of all its messages.
    pub stamp: Stamp,
    /// When the detections were handed to the middleware.
    pub at: Instant,
    /// Messages that a slow reliable subscriber left no room for.
    pub dropped: u32,
}

impl Source {
    /// Opens the topics.
    pub fn open(
        ros: &mut RosNode,
        info: &camera::CameraInfo,
        frame_id: &str,
    ) -> Result<Self, EndpointError> {
        // Announced in this order: a peer that receives detections has already discovered the others.
        let truth = ros.publisher(TRUTH, &OUTPUT)?;
        let camera_info = ros.publisher(CAMERA_INFO.name, &OUTPUT)?;
        let feature_points = ros.publisher(FEATURE_POINTS.name, &OUTPUT)?;
        Ok(Self {
            feature_points,
            camera_info,
            truth,
            info: info.clone(),
            frame_id: frame_id.to_owned(),
            latest: Stamp::default(),
        })
    }

    /// Waits until both topics have a subscriber, possibly forever.
    pub async fn wait_for_subscribers(&self, ros: &RosNode) {
        asked_anew(|| self.feature_points.wait_for_subscription(ros.node())).await;
        asked_anew(|| self.camera_info.wait_for_subscription(ros.node())).await;
    }

    /// Publishes the camera info, the detections and the truth, in this order, stamped with the time it is.
    pub fn publish(
        &mut self,
        truth_camera_from_tanker: &Isometry3<f64>,
        detections: &[Detection],
    ) -> Result<Sent, SourceError> {
        let stamp = self.next_stamp()?;
        let header = Header {
            stamp: stamp.into(),
            frame_id: self.frame_id.clone(),
        };
        let camera_info = camera_info_message(header.clone(), &self.info);
        let feature_points = feature_points_message(header.clone(), detections);
        let truth = pose_message(header, truth_camera_from_tanker);
        let mut dropped = publish(&self.camera_info, camera_info, CAMERA_INFO.name)?;
        let at = Instant::now();
        dropped += publish(&self.feature_points, feature_points, FEATURE_POINTS.name)?;
        dropped += publish(&self.truth, truth, TRUTH)?;
        Ok(Sent { stamp, at, dropped })
    }

    /// The time it is, and later than the stamp before.
    fn next_stamp(&mut self) -> Result<Stamp, SourceError> {
        let now = SystemTime::now()
            .duration_since(UNIX_EPOCH)
            .map_err(|_| SourceError::Clock)?;
        let now = Stamp {
            sec: i32::try_from(now.as_secs()).map_err(|_| SourceError::Clock)?,
            nanosec: now.subsec_nanos(),
        };
        self.latest = now.max(after(self.latest));
        Ok(self.latest)
    }
}

/// The next stamp there is.
const fn after(stamp: Stamp) -> Stamp {
    if stamp.nanosec < 999_999_999 {
        Stamp {
            sec: stamp.sec,
            nanosec: stamp.nanosec + 1,
        }
    } else {
        Stamp {
            sec: stamp.sec.saturating_add(1),
            nanosec: 0,
        }
    }
}

/// Returns how many messages were dropped: none or one.
fn publish<M: Message>(
    publisher: &Publisher<M>,
    message: M,
    topic: &'static str,
) -> Result<u32, SourceError> {
    match publisher.publish(message) {
        Ok(()) => Ok(0),
        Err(WriteError::WouldBlock { .. }) => Ok(1),
        Err(error) => Err(SourceError::Publish {
            topic,
            reason: error.to_string(),
        }),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn next_stamp_is_later_across_the_full_second() {
        let last = Stamp {
            sec: 4,
            nanosec: 999_999_999,
        };
        let next = after(last);
        assert!(next > last);
        assert_eq!((next.sec, next.nanosec), (5, 0));
        assert!(after(next) > next);
    }
}
