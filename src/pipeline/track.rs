//! The track in the pipeline: how frames update it, and how it supports the estimate of a frame.
//!
//! The track never changes a single frame's pose. With `initialisation: previous` the iteration starts from its
//! prediction, and the search for wrong detections uses the same prediction as its prior. With an error budget, the
//! track takes only noise and jitter as independent from frame to frame.

use nalgebra::Rotation3;

use super::{FrameErrors, FrameOutcome, Refusal, Stamp};
use crate::integrity::{FrameIntegrity, IntegrityMonitor, TrackSeparations, Unavailable};
use crate::tracking::{CheckedFilterSettings, Filter, LastMotion, TrackOutcome};

/// The filter, if tracking is enabled.
#[derive(Debug)]
pub(super) struct Tracker(Option<Filter<TrackSeparations>>);

impl Tracker {
    pub(super) fn new(settings: Option<CheckedFilterSettings>) -> Self {
        Self(settings.map(Filter::from))
    }

    /// Changes the settings from the next frame on; the track is kept.
    pub(super) fn set_settings(&mut self, settings: Option<CheckedFilterSettings>) {
        match (&mut self.0, settings) {
            (Some(filter), Some(settings)) => {
                if filter.settings() != settings.settings() {
                    filter.set_settings(settings);
                }
            }
            _ => *self = Self::new(settings),
        }
    }

    pub(super) fn reset(&mut self) {
        if let Some(filter) = &mut self.0 {
            filter.reset();
        }
    }

    /// Returns the predicted attitude; `None` without a confirmed track that reaches the stamp.
    pub(super) fn expected_rotation(&self, stamp: Stamp) -> Option<Rotation3<f64>> {
        let motion = self.0.as_ref()?.predict(stamp.nanoseconds()).ok()?;
        Some(motion.b_from_a.rotation.to_rotation_matrix())
    }

    /// Returns the last motion of track or candidate; `None` without either.
    pub(super) fn last_motion(&self) -> Option<LastMotion> {
        self.0.as_ref()?.last_motion()
    }

    /// Updates the filter with a frame, and stores the result in the outcome.
    pub(super) fn follow(&mut self, stamp: Stamp, frame: &mut FrameOutcome, has_causes: bool) {
        let Some(filter) = &mut self.0 else {
            return;
        };
        // The header of such a frame is not reliable.
        if !frame.header_fits() || matches!(frame.result, Err(Refusal::OtherImage { .. })) {
            return;
        }
        let stamp_ns = stamp.nanoseconds();
        let separations = frame.separations.take();
        let outcome = match &frame.result {
            Ok(solution) => {
                let errors = FrameErrors::new(solution, frame.causes.as_ref(), has_causes);
                filter.update_followed(
                    stamp_ns,
                    &solution.camera_from_tanker,
                    &errors.noise,
                    &errors.lasting,
                    separations.map(|separations| *separations),
                )
            }
            Err(_) => filter.miss(stamp_ns),
        };
        frame.track.outcome = Some(outcome);
        frame.track.motion = match outcome {
            TrackOutcome::Duplicate { .. }
            | TrackOutcome::Inserted { .. }
            | TrackOutcome::Late { .. } => None,
            _ => filter.predict(stamp_ns).ok(),
        };
    }

    /// Returns the protection levels of the track at a frame's stamp.
    pub(super) fn protection(
        &self,
        stamp: Stamp,
        frame: &FrameOutcome,
        monitor: &IntegrityMonitor,
    ) -> Result<FrameIntegrity, Unavailable> {
        let motion = frame.track.motion.as_ref().ok_or(Unavailable::NoTrack)?;
        let filter = self.0.as_ref().ok_or(Unavailable::NoTrack)?;
        let (followed, transition) = filter
            .follower(stamp.nanoseconds())
            .ok_or(Unavailable::NoTrack)?;
        monitor.judge_track(followed, &transition, motion)
    }
}
