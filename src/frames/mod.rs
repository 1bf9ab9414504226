//! Poses and motions in the frames, points and units of flight stacks, covariance included.
//!
//! Depends on `geometry` only. Everything is composed of four operations, for [`PoseEstimate`] and for
//! [`Motion`](crate::geometry::Motion):
//!
//! | operation | from | to | for example |
//! |---|---|---|---|
//! | `seen_from(c_from_b)` | `b_from_a` | `c_from_a` | optical → FLU → FRD; from the camera to the probe tip |
//! | `of(a_from_d)` | `b_from_a` | `b_from_d` | tanker's origin to its drogue; FLU → FRD of the tanker |
//! | `inverse()` | `b_from_a` | `a_from_b` | the receiver relative to the tanker |
//! | `in_local_axes(attitude)` | `b_from_a` | axes of NED or ENU | PX4, MAVROS |
//!
//! The frames of the first two are rigid to each other and known exactly; the attitude of the fourth has its own
//! covariance. Covariances are of first order, as everywhere; a change of axes is exact.
//!
//! ```
//! use nalgebra::{Isometry3, Matrix6, Vector3};
//! use tanker_pose::frames::{self, PoseEstimate};
//! use tanker_pose::geometry::PoseCovariance;
//!
//! let camera_from_tanker = PoseEstimate {
//!     b_from_a: Isometry3::new(Vector3::new(0.5, -2.0, 20.0), Vector3::zeros()),
//!     covariance: PoseCovariance(Matrix6::identity() * 1e-4),
//! };
//! // Right of the camera's axis is right of the aircraft's nose: y of FRD.
//! let frd_from_optical = frames::frd_from_flu() * frames::flu_from_optical();
//! let found = camera_from_tanker.seen_from(&frames::rotation_only(&frd_from_optical));
//! assert_eq!(found.b_from_a.translation.vector, Vector3::new(20.0, 0.5, -2.0));
//! ```

mod attitude;
mod axes;
mod motion;
mod pose;
mod relative_attitude;
mod time;
mod upright;
mod variance;

pub use attitude::{AttitudeAt, AttitudeError, AttitudeHistory, AttitudeSample};
pub use axes::{flu_from_optical, frd_from_flu, ned_from_enu, rotation_only};
pub use pose::{LocalAttitude, PoseEstimate};
pub use relative_attitude::{RelativeAttitudeError, receiver_from_tanker};
pub use time::{TimeError, px4_us_from_ros_ns, ros_ns_from_px4_us};
pub use upright::{UprightError, check_upright};
pub use variance::{VarianceError, px4_standard_deviations, px4_variances, variances_from};

#[cfg(test)]
mod tests;
