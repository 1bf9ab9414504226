//! A track from poses: single frames have been estimated and judged, here they become one motion.
//!
//! Knows `geometry`. Time enters as the images' stamps, whole nanoseconds; nothing here reads a
//! clock, and the same frames give the same bits. One frame's way:
//!
//! ```text
//! pose + covariance + stamp -> valid? -> in time? -> predict -> chi-squared gate -> update
//!                           -> enough consistent frames? -> a track
//! ```
//!
//! The state is [`Motion`](crate::geometry::Motion) of the tanker in the camera: pose, velocity and
//! rate in camera axes, which go on unchanged except for white noise of acceleration (`model`); when
//! several innovations lean to one side the noise is raised for a while (`lag`). Before
//! [`FilterSettings::confirm_frames`] consistent frames there is a candidate and no track, and nothing
//! is given out. [`FilterSettings::max_gap_s`] after the last accepted frame the track is dropped; its [`LastMotion`] can be kept.

mod filter;
mod lag;
mod last_motion;
mod model;
mod outcome;
mod settings;
mod symmetric6;

pub use filter::{Filter, Track};
pub use last_motion::LastMotion;
pub use outcome::{MeasurementError, PredictError, StartReason, TrackOutcome};
pub use settings::{CheckedFilterSettings, FilterSettings, FilterSettingsError};

#[cfg(test)]
mod tests;
