//! Predicted positions of the markers in an image, for detectors, with sigmas, for as long as the prediction is useful.
//!
//! ```text
//! last motion of the track -> propagated to the stamp -> combined with the nominal attitude -> projected
//! ```
//!
//! Odometry ends `max_gap_s` after the last frame, because it is no longer safe to fly by. A detector needs less: where
//! to search for beacons, and in how large a window. So the last motion is kept beyond the end of its track. The
//! attitude becomes uncertain first; it is then replaced by the nominal one, at the last range.

use nalgebra::{Isometry3, Matrix2, Matrix2x6, Matrix3, Rotation3};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::track::Tracker;
use super::{Detection, FrameOutcome, Stamp};
use crate::camera::{Camera, Pixel};
use crate::estimation::{PRIOR_SIGMA, Solution};
use crate::geometry::{Motion, PoseCovariance, congruent, left_jacobian_inverse, pose_error, skew};
use crate::target::Marker;
use crate::tracking::{Filter, FilterSettings, LastMotion};

/// Relative to the shorter side of the image: with a larger sigma, a window of four sigmas to each side covers the
/// image.
const MAX_SIGMA_SHARE: f64 = 1.0 / 8.0;
/// px; the same limit if the size of the image is unknown.
const MAX_SIGMA_PX: f64 = 64.0;
/// Windows of this many sigmas must reach into the image.
const WINDOW_SIGMAS: f64 = 4.0;
/// A marker closer than this many sigmas of its depth has no pixel that a linearisation describes.
const LEAST_DEPTH_SIGMAS: f64 = 4.0;

/// The predicted position of one marker in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedPoint {
    /// Marker id.
    pub id: u32,
    /// Predicted pixel, in the image that detections come from; it may be outside.
    pub pixel: Pixel,
    /// Covariance of a detection's column and row about it, px²: that of the motion plus the detection's noise.
    pub covariance: Matrix2<f64>,
}

impl PredictedPoint {
    /// Returns the largest standard deviation in any direction, px.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.covariance
            .symmetric_eigenvalues()
            .max()
            .max(0.0)
            .sqrt()
    }

    /// Returns the point as a detection, with the largest sigma for both axes.
    #[must_use]
    pub fn detection(&self) -> Detection {
        Detection {
            id: self.id,
            u_px: self.pixel.u,
            v_px: self.pixel.v,
            sigma_px: self.sigma_px(),
        }
    }
}

/// The motions kept beyond the end of a track.
#[derive(Debug, Clone, Default)]
pub(super) struct Predictor {
    /// Of the latest track or candidate.
    latest: Option<LastMotion>,
    /// Of the latest track; the velocity of a candidate is unknown, so its prediction degrades sooner.
    confirmed: Option<LastMotion>,
}

impl Predictor {
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Updates the motions after a frame.
    pub(super) fn follow(&mut self, stamp: Stamp, outcome: &FrameOutcome, tracker: &Tracker) {
        let Ok(solution) = &outcome.result else {
            return;
        };
        self.latest = tracker
            .last_motion()
            .or_else(|| of_pose_alone(stamp, solution));
        if self.latest.is_some_and(|latest| latest.is_confirmed()) {
            self.confirmed = self.latest;
        }
    }

    /// Returns the predicted points for the image of a stamp; empty without a usable prediction.
    pub(super) fn points(
        &self,
        stamp: Stamp,
        nominal: &Rotation3<f64>,
        view: &View,
    ) -> Vec<PredictedPoint> {
        self.poses(stamp, nominal)
            .map(|(pose, covariance)| view.points(&pose, &covariance))
            .find(|points| !points.is_empty())
            .unwrap_or_default()
    }

    /// Returns the possible poses at a stamp, the most accurate first.
    fn poses(
        &self,
        stamp: Stamp,
        nominal: &Rotation3<f64>,
    ) -> impl Iterator<Item = (Isometry3<f64>, PoseCovariance)> {
        let kept = [self.latest, self.confirmed].into_iter().flatten();
        kept.filter_map(move |last| {
            let motion = last.at(stamp.nanoseconds())?;
            Some(with_nominal_attitude(&motion, last.motion(), nominal))
        })
    }
}

/// The camera and markers for a prediction.
pub(super) struct View<'a> {
    pub(super) camera: &'a Camera,
    pub(super) markers: &'a [Marker],
    /// Standard deviation of detections, px.
    pub(super) sigma_px: f64,
}

impl View<'_> {
    /// Returns the predicted points for a pose, without those outside the image or too uncertain.
    fn points(
        &self,
        camera_from_tanker: &Isometry3<f64>,
        covariance: &PoseCovariance,
    ) -> Vec<PredictedPoint> {
        let point = |marker: &Marker| {
            let at = &marker.marker_in_tanker.coords;
            let (pixel, covariance) = project(
                self.camera,
                camera_from_tanker,
                covariance,
                at,
                self.sigma_px,
            )?;
            let point = PredictedPoint {
                id: marker.id,
                pixel,
                covariance,
            };
            is_worth_a_look(self.camera, &point).then_some(point)
        };
        self.markers.iter().filter_map(point).collect()
    }
}

/// Without a track: the pose of a frame, with the initial velocity and noise of a track.
fn of_pose_alone(stamp: Stamp, solution: &Solution) -> Option<LastMotion> {
    let mut filter = Filter::new(FilterSettings::default()).ok()?;
    filter.update(
        stamp.nanoseconds(),
        &solution.camera_from_tanker,
        &solution.covariance,
    );
    filter.last_motion()
}

/// Returns a predicted pose combined with the nominal attitude, and its covariance.
///
/// The nominal attitude is used as a measurement with 5° on each axis, plus the deviation when the attitude was last
/// observed: a tanker that is not aligned, or a wrong mount, remains so. While the track's attitude is more precise,
/// this has almost no effect.
fn with_nominal_attitude(
    predicted: &Motion,
    last: &Motion,
    nominal: &Rotation3<f64>,
) -> (Isometry3<f64>, PoseCovariance) {
    let turn_to_nominal = |from: &Motion| {
        let turned = Isometry3::from_parts(
            from.b_from_a.translation,
            UnitQuaternion::from_rotation_matrix(nominal),
        );
        pose_error(&turned, &from.b_from_a)
            .fixed_rows::<3>(3)
            .into_owned()
    };
    let covariance = predicted.pose_covariance();
    let variance = PRIOR_SIGMA.powi(2) + turn_to_nominal(last).norm_squared();
    let turn = turn_to_nominal(predicted);
    // The error of the nominal attitude is rotated by the attitude between the two.
    let seen = left_jacobian_inverse(turn);
    let noise = seen * seen.transpose() * variance;
    let by_attitude = covariance.0.fixed_columns::<3>(3).into_owned();
    let attitude = covariance.0.fixed_view::<3, 3>(3, 3).into_owned();
    let Some(inverse) = (attitude + noise).try_inverse() else {
        return (predicted.b_from_a, covariance);
    };
    let gain = by_attitude * inverse;
    let step = gain * turn;
    let left = covariance.0 - gain * by_attitude.transpose();
    let rotation = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned())
        * predicted.b_from_a.rotation;
    let pose = Isometry3::from_parts(
        Translation3::from(predicted.b_from_a.translation.vector + step.fixed_rows::<3>(0)),
        rotation,
    );
    (pose, PoseCovariance((left + left.transpose()) * 0.5))
}

/// Returns the pixel of a marker and the covariance of a detection about it; `None` if it has no pixel or may be behind
/// the camera.
fn project(
    camera: &Camera,
    camera_from_tanker: &Isometry3<f64>,
    covariance: &PoseCovariance,
    marker_in_tanker: &Vector3<f64>,
    sigma_px: f64,
) -> Option<(Pixel, Matrix2<f64>)> {
    let arm = camera_from_tanker.rotation * marker_in_tanker;
    let q = camera_from_tanker.translation.vector + arm;
    // R m becomes Exp(δθ) R m: δq = δt + δθ × arm.
    let mut point_by_pose = nalgebra::Matrix3x6::zeros();
    point_by_pose
        .fixed_columns_mut::<3>(0)
        .copy_from(&Matrix3::identity());
    point_by_pose
        .fixed_columns_mut::<3>(3)
        .copy_from(&-skew(arm));
    let point_covariance = congruent(&point_by_pose, &covariance.0);
    if q.z <= LEAST_DEPTH_SIGMAS * point_covariance[(2, 2)].max(0.0).sqrt() {
        return None;
    }
    let (pixel, by_point) = camera.project_point(&q)?;
    let by_pose: Matrix2x6<f64> = by_point * point_by_pose;
    let detected = congruent(&by_pose, &covariance.0) + Matrix2::identity() * sigma_px.powi(2);
    detected
        .iter()
        .all(|value| value.is_finite())
        .then_some((pixel, detected))
}

fn is_worth_a_look(camera: &Camera, point: &PredictedPoint) -> bool {
    let sigma_px = point.sigma_px();
    let Some((width, height)) = camera.image_size_px() else {
        return sigma_px <= MAX_SIGMA_PX;
    };
    let reaches = |value: f64, length: u32| {
        let reach = WINDOW_SIGMAS * sigma_px + 0.5;
        (-reach..=f64::from(length) - 1.0 + reach).contains(&value)
    };
    sigma_px <= MAX_SIGMA_SHARE * f64::from(width.min(height))
        && reaches(point.pixel.u, width)
        && reaches(point.pixel.v, height)
}
