//! The track: from poses of single frames, estimated and judged, to one motion.
//!
//! Depends on `geometry`. Time is the images' stamps in whole nanoseconds; no clock is read, and the same frames give
//! the same bits. The steps of one frame:
//!
//! ```text
//! pose + noise + lasting errors + stamp -> valid? -> inserted into the frames of the last half second (history)
//!   -> predict (model, lasting) -> chi-squared gate -> update -> the later frames are processed again
//!   -> enough consistent frames? -> a track
//! ```
//!
//! The state is the [`Motion`](crate::geometry::Motion) of the tanker in the camera: pose, velocity and rate in camera
//! axes, constant except for white noise of acceleration (`model`). If several innovations are biased in one direction,
//! the noise is raised for some time (`lag`). Errors that frames have in common are consider states (`lasting`). Before
//! [`FilterSettings::confirm_frames`] consistent frames there is a candidate but no track, and nothing is published.
//! [`FilterSettings::max_gap_s`] after the last accepted frame the track is dropped; its [`LastMotion`] can be kept.

mod belief;
mod filter;
mod follower;
mod frame;
mod history;
mod lag;
mod last_motion;
mod lasting;
mod matrix6;
mod model;
mod outcome;
mod settings;
mod state;
mod symmetric6;
mod track;

pub use filter::Filter;
pub use follower::{Follower, Matrix12x6, Step};
pub use last_motion::LastMotion;
pub use lasting::LastingError;
pub use outcome::{MeasurementError, PredictError, StartReason, TrackOutcome};
pub use settings::{CheckedFilterSettings, FilterSettings, FilterSettingsError};
pub use track::Track;

#[cfg(test)]
mod tests;
