//! A track from poses: single frames have been estimated and judged, here they become one motion.
//!
//! Knows `geometry`. Time enters as the images' stamps, whole nanoseconds; nothing here reads a
//! clock, and the same frames give the same bits. One frame's way:
//!
//! ```text
//! pose + noise + lasting errors + stamp -> valid? -> its place among the last half second's frames (history)
//!   -> predict (model, lasting) -> chi-squared gate -> update -> the later frames again
//!   -> enough consistent frames? -> a track
//! ```
//!
//! The state is [`Motion`](crate::geometry::Motion) of the tanker in the camera: pose, velocity and
//! rate in camera axes, which go on unchanged except for white noise of acceleration (`model`); when
//! several innovations lean to one side the noise is raised for a while (`lag`). Errors that frames have in common are
//! consider states (`lasting`). Before
//! [`FilterSettings::confirm_frames`] consistent frames there is a candidate and no track, and nothing
//! is given out. [`FilterSettings::max_gap_s`] after the last accepted frame the track is dropped; its [`LastMotion`] can be kept.

mod belief;
mod filter;
mod history;
mod lag;
mod last_motion;
mod lasting;
mod model;
mod outcome;
mod settings;
mod symmetric6;
mod track;

pub use filter::Filter;
pub use last_motion::LastMotion;
pub use lasting::LastingError;
pub use outcome::{MeasurementError, PredictError, StartReason, TrackOutcome};
pub use settings::{CheckedFilterSettings, FilterSettings, FilterSettingsError};
pub use track::Track;

#[cfg(test)]
mod tests;
