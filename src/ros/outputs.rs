//! All topics that the node publishes on.

use super::consumers::Consumers;
use super::integrity::IntegrityOutput;
use super::messages::{
    DiagnosticArray, EstimatorStatus, MarkerArray, Odometry, PoseWithCovarianceStamped, TFMessage,
};
use super::output::Output;
use super::participant::{EndpointError, RosNode};
use super::predicted_points::PredictedPoints;
use super::topics;
use crate::config::Configuration;
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
    /// [`EndpointError`] when a name is malformed or the middleware refuses.
    pub fn open(
        ros: &mut RosNode,
        wanted: &Configuration,
        setup: Option<RefuellingSetup>,
    ) -> Result<Self, EndpointError> {
        let predicted = Output::open_if_wanted(ros, &topics::PREDICTED_POINTS, wanted)?;
        Ok(Self {
            pose: Output::open(ros, &topics::POSE)?,
            odometry: Output::open(ros, &topics::ODOMETRY)?,
            tanker_frame_id: wanted.tanker_frame_id.clone(),
            status: Output::open(ros, &topics::STATUS)?,
            transform: Output::open_if_wanted(ros, &topics::TRANSFORM, wanted)?,
            markers: Output::open_if_wanted(ros, &topics::MARKERS, wanted)?,
            predicted_points: predicted.map(PredictedPoints::new),
            integrity: Output::open_if_wanted(ros, &topics::INTEGRITY, wanted)?
                .map(IntegrityOutput::new),
            diagnostics: Output::open(ros, &topics::HEALTH)?,
            consumers: Consumers::open(ros, wanted, setup)?,
        })
    }

    /// Applies reloaded settings; the outputs and their names stay fixed.
    pub(super) fn configure(
        &mut self,
        configuration: &Configuration,
        setup: Option<RefuellingSetup>,
    ) {
        if let Some(integrity) = &mut self.integrity {
            integrity.reset();
        }
        if let (Some(consumers), Some(setup)) = (&mut self.consumers, setup) {
            consumers.configure(&configuration.consumers, setup);
        }
    }
}
