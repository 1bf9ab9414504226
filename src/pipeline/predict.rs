//! Where the markers will be in an image, for detectors: as long as the prediction is worth anything, and with a
//! sigma that says how much.
//!
//! ```text
//! last motion of the track -> carried on to the stamp -> held against the nominal attitude -> projected
//! ```
//!
//! A track gives no odometry beyond `max_gap_s`, because it is not safe to fly by. A detector that looks for beacons
//! where they are expected needs less: where to look, and how far around. So the last motion is kept beyond the end
//! of its track. What first becomes unknown is the attitude; then the nominal one takes its place, at the last range.

use nalgebra::{Isometry3, Matrix2, Matrix2x3, Matrix2x6, Matrix3, Rotation3};
use nalgebra::{Translation3, UnitQuaternion, Vector3};

use super::track::Tracker;
use super::{Detection, FrameOutcome, Stamp};
use crate::camera::{Camera, Pixel, Ray};
use crate::estimation::{PRIOR_SIGMA, Solution};
use crate::geometry::{Motion, PoseCovariance, congruent, left_jacobian_inverse, pose_error, skew};
use crate::target::Marker;
use crate::tracking::{Filter, FilterSettings, LastMotion};

/// Of the shorter side of the image: a marker whose sigma is larger may be anywhere in it, since a window of four
/// sigmas to each side is then as large as the image.
const MAX_SIGMA_SHARE: f64 = 1.0 / 8.0;
/// px; the same where the size of the image is not known.
const MAX_SIGMA_PX: f64 = 64.0;
/// Windows of this many sigmas that do not reach into the image are not worth a look.
const WINDOW_SIGMAS: f64 = 4.0;
/// A marker nearer than this many sigmas of its depth has no pixel that a linear law describes.
const LEAST_DEPTH_SIGMAS: f64 = 4.0;

/// Where one marker is expected in an image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PredictedPoint {
    /// Marker id.
    pub id: u32,
    /// Expected pixel, in the image that detections come from; it may lie outside.
    pub pixel: Pixel,
    /// Covariance of a detection's column and row about it, px²: that of the motion and the detection's own.
    pub covariance: Matrix2<f64>,
}

impl PredictedPoint {
    /// Returns the standard deviation in the direction in which it is largest, px.
    #[must_use]
    pub fn sigma_px(&self) -> f64 {
        self.covariance
            .symmetric_eigenvalues()
            .max()
            .max(0.0)
            .sqrt()
    }

    /// Returns it in the form of a detection, with the largest sigma for both axes.
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

/// What is remembered beyond the end of a track.
#[derive(Debug, Clone, Default)]
pub(super) struct Predictor {
    /// Of the latest track or candidate.
    latest: Option<LastMotion>,
    /// Of the latest track: a candidate knows no velocity, so it is soon worth less.
    confirmed: Option<LastMotion>,
}

impl Predictor {
    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Takes what a frame has taught the tracker.
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

    /// Returns where the markers are expected in the image of a stamp; empty where that is unknown.
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

    /// Returns the poses that may be expected at a stamp, the likely best first.
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

/// What is looked at, with what.
pub(super) struct View<'a> {
    pub(super) camera: &'a Camera,
    pub(super) markers: &'a [Marker],
    /// Standard deviation of detections, px.
    pub(super) sigma_px: f64,
}

impl View<'_> {
    /// Returns where the markers are expected from a pose, without those that are not worth a look.
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

/// Without a track, the pose of a frame with the velocity and the noise that a track would begin with.
fn of_pose_alone(stamp: Stamp, solution: &Solution) -> Option<LastMotion> {
    let mut filter = Filter::new(FilterSettings::default()).ok()?;
    filter.update(
        stamp.nanoseconds(),
        &solution.camera_from_tanker,
        &solution.covariance,
    );
    filter.last_motion()
}

/// Returns a predicted pose held against the nominal attitude, and its covariance.
///
/// The nominal attitude counts as a measurement of 5° on each axis, and of as much more as the attitude was off when
/// it was last seen: a tanker that flies off its nominal attitude, or a wrong mount, stays so. While the track
/// knows the attitude better, this changes next to nothing.
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
    // The nominal attitude's own error turns with the attitude between the two.
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

/// Returns the pixel of a marker and the covariance of a detection about it; `None` where it has none, or may be
/// behind the camera.
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
    let ray = Ray {
        x: q.x / q.z,
        y: q.y / q.z,
    };
    let (pixel, pixel_by_ray) = camera.project(ray)?;
    let ray_by_point = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y) / q.z;
    let by_pose: Matrix2x6<f64> = pixel_by_ray * ray_by_point * point_by_pose;
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
