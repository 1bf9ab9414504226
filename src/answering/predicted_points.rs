//! Output `predicted_points`: where detectors may look. When is `pipeline::NextImage`'s, where `Pipeline::predict`'s.

use super::diagnostics::Tally;
use super::output::Output;
use crate::convert::feature_points_message;
use crate::messages::{FeaturePointArray, Header};
use crate::pipeline::{Detection, NextImage, Pipeline, PredictedPoint, Stamp};

/// The output with the stamps that it has seen.
pub struct PredictedPoints {
    output: Output<FeaturePointArray>,
    next: NextImage,
}

impl PredictedPoints {
    /// Returns the output that has seen no image yet.
    #[must_use]
    pub fn new(output: Output<FeaturePointArray>) -> Self {
        Self {
            output,
            next: NextImage::default(),
        }
    }

    /// Answers a camera info, whose image the detector is processing.
    pub(super) fn on_camera_info(
        &mut self,
        header: &Header,
        pipeline: &Pipeline,
        tally: &mut Tally,
    ) {
        if let Some(stamp) = self.next.on_camera_info(header.stamp.into()) {
            self.publish(stamp, &header.frame_id, pipeline, tally);
        }
    }

    /// Answers detections after they have been processed, where camera infos don't come with the images.
    pub(super) fn on_detections(
        &mut self,
        header: &Header,
        pipeline: &Pipeline,
        tally: &mut Tally,
    ) {
        if let Some(stamp) = self.next.on_detections(header.stamp.into()) {
            self.publish(stamp, &header.frame_id, pipeline, tally);
        }
    }

    /// Publishes the prediction, even if it is empty, so that a detector need not wait.
    fn publish(&mut self, stamp: Stamp, frame_id: &str, pipeline: &Pipeline, tally: &mut Tally) {
        // The status of a frame of another camera states that.
        let Ok(points) = pipeline.predict(stamp, frame_id) else {
            return;
        };
        let points: Vec<Detection> = points.iter().map(PredictedPoint::detection).collect();
        let header = Header {
            stamp: stamp.into(),
            frame_id: frame_id.to_owned(),
        };
        self.output
            .publish(feature_points_message(header, &points), tally);
    }
}
