//! The approach as a recording instead of on topics: the same options give the same bytes.

use std::path::Path;

use tanker_pose::camera;
use tanker_pose::convert::{camera_info_message, feature_points_message, pose_message};
use tanker_pose::messages::{CameraInfo, FeaturePointArray, Header, Message, PoseStamped, Time};
use tanker_pose::recording::{Channel, RecordedTopic, WriteError, Writer, cdr, type_name};
use tanker_pose::ros::topics::{CAMERA_INFO, FEATURE_POINTS};
use tanker_pose::simulation::SimulatedFrame;

use super::source::TRUTH;

/// Time of the first frame, s since 1970: some time that is valid and never changes.
const START_S: u64 = 1_700_000_000;

/// Why the approach cannot be recorded.
#[derive(Debug, thiserror::Error)]
pub enum BagError {
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("cannot encode a message: {0}")]
    Encode(#[from] cdr::CdrError),
}

/// A recording of an approach.
pub struct Bag {
    writer: Writer,
    camera_info: Channel,
    feature_points: Channel,
    truth: Channel,
    info: camera::CameraInfo,
    frame_id: String,
}

impl Bag {
    /// Creates the file; one that exists is overwritten.
    pub fn create(
        path: &Path,
        info: &camera::CameraInfo,
        frame_id: &str,
    ) -> Result<Self, BagError> {
        let mut writer = Writer::create(path)?;
        Ok(Self {
            camera_info: channel::<CameraInfo>(&mut writer, CAMERA_INFO.name)?,
            feature_points: channel::<FeaturePointArray>(&mut writer, FEATURE_POINTS.name)?,
            truth: channel::<PoseStamped>(&mut writer, TRUTH)?,
            writer,
            info: info.clone(),
            frame_id: frame_id.to_owned(),
        })
    }

    /// Writes camera info, detections and truth of a frame, in this order, at the frame's time.
    pub fn write(&mut self, frame: &SimulatedFrame) -> Result<(), BagError> {
        let since_start = std::time::Duration::from_secs_f64(frame.time_s.max(0.0));
        let (seconds, nanosec) = (START_S + since_start.as_secs(), since_start.subsec_nanos());
        let time_ns = seconds * 1_000_000_000 + u64::from(nanosec);
        let header = Header {
            stamp: Time {
                sec: i32::try_from(seconds).unwrap_or(i32::MAX),
                nanosec,
            },
            frame_id: self.frame_id.clone(),
        };
        let info = camera_info_message(header.clone(), &self.info);
        let points = feature_points_message(header.clone(), &frame.detections);
        let truth = pose_message(header, &frame.truth_camera_from_tanker);
        self.put(self.camera_info, time_ns, &info)?;
        self.put(self.feature_points, time_ns, &points)?;
        self.put(self.truth, time_ns, &truth)
    }

    /// Completes the file.
    pub fn finish(self) -> Result<(), BagError> {
        Ok(self.writer.finish()?)
    }

    fn put<M: Message>(
        &mut self,
        channel: Channel,
        time_ns: u64,
        message: &M,
    ) -> Result<(), BagError> {
        let bytes = cdr::encode(message)?;
        Ok(self.writer.write(channel, time_ns, time_ns, &bytes)?)
    }
}

fn channel<M: Message>(writer: &mut Writer, topic: &str) -> Result<Channel, WriteError> {
    writer.channel(&RecordedTopic {
        name: format!("/{topic}"),
        type_name: type_name::<M>(),
        encoding: "cdr".to_owned(),
        ..RecordedTopic::default()
    })
}
