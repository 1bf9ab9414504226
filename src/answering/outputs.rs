//! All topics that the node publishes on.

use super::consumers::Consumers;
use super::integrity::IntegrityOutput;
use super::output::{Output, Sinks};
use super::predicted_points::PredictedPoints;
use super::topics;
use crate::config::Configuration;
use crate::messages::{
    DiagnosticArray, EstimatorStatus, MarkerArray, Odometry, PoseWithCovarianceStamped, TFMessage,
};
use crate::refuelling::RefuellingSetup;

/// Where the node's results go.
pub struct Outputs {
    /// Trusted poses.
    pub pose: Output<PoseWithCovarianceStamped>,
    /// One message for every frame.
    pub status: Output<EstimatorStatus>,
    /// Pose and twist of the track, at every frame while there is one.
    pub odometry: Output<Odometry>,
    /// Name of the child frame of odometry and transforms.
    pub tanker_frame_id: String,
    /// Trusted poses as transforms, if wanted.
    pub transform: Option<Output<TFMessage>>,
    /// What can be drawn of a frame, if wanted.
    pub markers: Option<Output<MarkerArray>>,
    /// Where markers will be, for detectors, if wanted.
    pub predicted_points: Option<PredictedPoints>,
    /// Protection levels, if wanted.
    pub integrity: Option<IntegrityOutput>,
    /// The node's health.
    pub diagnostics: Output<DiagnosticArray>,
    /// Outputs for refuelling and flight stacks, if enabled.
    pub consumers: Option<Consumers>,
}

impl Outputs {
    /// Returns the outputs of a configuration, opened.
    ///
    /// # Errors
    /// When a topic cannot be opened.
    pub fn open<S: Sinks>(
        sinks: &mut S,
        wanted: &Configuration,
        setup: Option<RefuellingSetup>,
    ) -> Result<Self, S::Error> {
        let predicted = sinks.open_if_wanted(&topics::PREDICTED_POINTS, wanted)?;
        Ok(Self {
            pose: sinks.open(&topics::POSE)?,
            odometry: sinks.open(&topics::ODOMETRY)?,
            tanker_frame_id: wanted.tanker_frame_id.clone(),
            status: sinks.open(&topics::STATUS)?,
            transform: sinks.open_if_wanted(&topics::TRANSFORM, wanted)?,
            markers: sinks.open_if_wanted(&topics::MARKERS, wanted)?,
            predicted_points: predicted.map(PredictedPoints::new),
            integrity: sinks
                .open_if_wanted(&topics::INTEGRITY, wanted)?
                .map(IntegrityOutput::new),
            diagnostics: sinks.open(&topics::HEALTH)?,
            consumers: Consumers::open(sinks, wanted, setup)?,
        })
    }

    /// Applies reloaded settings; the outputs and their names stay fixed.
    pub fn configure(&mut self, configuration: &Configuration, setup: Option<RefuellingSetup>) {
        if let Some(integrity) = &mut self.integrity {
            integrity.reset();
        }
        if let (Some(consumers), Some(setup)) = (&mut self.consumers, setup) {
            consumers.configure(&configuration.consumers, setup);
        }
    }
}
