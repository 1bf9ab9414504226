//! The geometry of a frame in space: points, rays, ellipsoid and frustum in the camera frame, for display.
//!
//! Depends on `pipeline` and the layers below, and not on messages, colours or topics. For a refused frame only the
//! camera is shown: a doubtful pose would look like a good one.

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, SymmetricEigen, UnitQuaternion, Vector3};

use crate::camera::{Camera, Pixel};
use crate::pipeline::{Detection, FrameOutcome};
use crate::target::MarkerMap;

/// Half axes of the ellipsoid in standard deviations: the position is inside with a probability of 97 %.
pub const ELLIPSOID_SIGMAS: f64 = 3.0;

/// Depth of the camera's frustum, m.
pub const FRUSTUM_DEPTH_M: f64 = 2.0;

/// One detection of a trusted frame.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Seen {
    /// Marker id.
    pub id: u32,
    /// Position of the marker according to the pose, camera frame, m.
    pub marker_in_camera: Point3<f64>,
    /// Point of the detection's ray at that depth, camera frame, m.
    pub detected_in_camera: Point3<f64>,
}

/// The uncertainty of the tanker's position.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ellipsoid {
    /// The estimated position, camera frame, m.
    pub centre_in_camera: Point3<f64>,
    /// Attitude of its axes.
    pub camera_from_axes: UnitQuaternion<f64>,
    /// Half of its extent along each axis, [`ELLIPSOID_SIGMAS`] standard deviations, m.
    pub half_axes_m: Vector3<f64>,
}

/// Everything that can be displayed of a frame.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Picture {
    /// Detections used for the pose.
    pub used: Vec<Seen>,
    /// Detections that were excluded as wrong.
    pub rejected: Vec<Seen>,
    /// Positions, according to the pose, of the markers that were not detected, camera frame, m.
    pub unseen_in_camera: Vec<Point3<f64>>,
    /// The uncertainty of the position; `None` without a trusted pose.
    pub ellipsoid: Option<Ellipsoid>,
    /// Corners of the image at [`FRUSTUM_DEPTH_M`]: top left, top right, bottom right, bottom left; `None` if the size
    /// of the image is unknown or the lens model does not reach its corners.
    pub frustum: Option<[Point3<f64>; 4]>,
}

impl Picture {
    /// Returns the picture of a frame.
    ///
    /// # Inputs
    /// * `camera`: the camera of the frame.
    /// * `detections`: of the frame, as passed to the pipeline.
    /// * `outcome`: of the frame.
    #[must_use]
    pub fn new(
        camera: &Camera,
        map: &MarkerMap,
        detections: &[Detection],
        outcome: &FrameOutcome,
    ) -> Self {
        let frustum = frustum(camera);
        let Ok(solution) = &outcome.result else {
            return Self {
                frustum,
                ..Self::default()
            };
        };
        let camera_from_tanker = &solution.camera_from_tanker;
        let seen = |ids: &[u32]| {
            detections
                .iter()
                .filter(|detection| ids.contains(&detection.id))
                .filter_map(|detection| seen(camera, map, camera_from_tanker, detection))
                .collect()
        };
        let is_unseen = |id: u32| !detections.iter().any(|detection| detection.id == id);
        Self {
            used: seen(&outcome.used_ids),
            rejected: seen(&outcome.rejected_ids),
            unseen_in_camera: map
                .markers()
                .iter()
                .filter(|marker| is_unseen(marker.id))
                .map(|marker| camera_from_tanker * marker.marker_in_tanker)
                .collect(),
            ellipsoid: Some(ellipsoid(
                camera_from_tanker,
                &solution.covariance.0.fixed_view::<3, 3>(0, 0).into_owned(),
            )),
            frustum,
        }
    }
}

fn seen(
    camera: &Camera,
    map: &MarkerMap,
    camera_from_tanker: &Isometry3<f64>,
    detection: &Detection,
) -> Option<Seen> {
    let marker_in_camera = camera_from_tanker * map.get(detection.id)?;
    let pixel = Pixel {
        u: detection.u_px,
        v: detection.v_px,
    };
    Some(Seen {
        id: detection.id,
        marker_in_camera,
        detected_in_camera: point_of_pixel(camera, pixel, marker_in_camera.z)?,
    })
}

/// Returns the point of a pixel's ray at a depth, camera frame; `None` for a pixel without a ray.
fn point_of_pixel(camera: &Camera, pixel: Pixel, depth_m: f64) -> Option<Point3<f64>> {
    let ray = camera.ray_from_pixel(pixel).ok()?;
    Some(Point3::new(ray.x * depth_m, ray.y * depth_m, depth_m))
}

/// Returns the ellipsoid of a position's covariance, m².
fn ellipsoid(camera_from_tanker: &Isometry3<f64>, covariance: &Matrix3<f64>) -> Ellipsoid {
    let eigen = SymmetricEigen::new(*covariance);
    let mut axes = eigen.eigenvectors;
    if axes.determinant() < 0.0 {
        axes.column_mut(2).neg_mut(); // mirroring does not change an ellipsoid
    }
    Ellipsoid {
        centre_in_camera: camera_from_tanker.translation.vector.into(),
        camera_from_axes: UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(
            axes,
        )),
        half_axes_m: eigen
            .eigenvalues
            .map(|variance| ELLIPSOID_SIGMAS * variance.max(0.0).sqrt()),
    }
}

fn frustum(camera: &Camera) -> Option<[Point3<f64>; 4]> {
    let (width, height) = camera.image_size_px()?;
    // The outer edges of the border pixels, whose centres are integers.
    let (right, bottom) = (f64::from(width) - 0.5, f64::from(height) - 0.5);
    let corner = |u, v| point_of_pixel(camera, Pixel { u, v }, FRUSTUM_DEPTH_M);
    Some([
        corner(-0.5, -0.5)?,
        corner(right, -0.5)?,
        corner(right, bottom)?,
        corner(-0.5, bottom)?,
    ])
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::{Excluded, Initialisation, Solution};
    use crate::geometry::PoseCovariance;
    use crate::pipeline::{FrameTrack, LeftOut, Refusal};
    use nalgebra::{Matrix6, Translation3};

    /// Rounding of a few products, m.
    const ROUNDING_M: f64 = 1e-12;

    fn camera() -> Camera {
        Camera::from_intrinsics(100.0, 200.0, 40.0, 36.0, Some((101, 61))).expect("a pinhole")
    }

    fn map() -> MarkerMap {
        MarkerMap::shipped("paper").expect("shipped")
    }

    /// The tanker's axes are the camera's, 20 m ahead.
    fn solution(covariance: &Matrix6<f64>) -> Solution {
        Solution {
            camera_from_tanker: Isometry3::from_parts(
                Translation3::new(0.0, 0.0, 20.0),
                UnitQuaternion::identity(),
            ),
            covariance: PoseCovariance(*covariance),
            rms_px: 0.5,
            chi_squared: 3.0,
            degrees_of_freedom: 6,
            iterations: 5,
            ambiguity: 0.0,
            certificate: None,
            chi_squared_of_all: 0.0,
            chi_squared_limit: 26.1,
            initialisation: Initialisation::Nominal,
            excluded: Excluded::default(),
            prior: None,
            unclear: Excluded::default(),
        }
    }

    fn picture(result: Result<Solution, Refusal>) -> Picture {
        let detection = |id, u_px, v_px| Detection {
            id,
            u_px,
            v_px,
            sigma_px: 0.0,
        };
        let outcome = FrameOutcome {
            result,
            doubtful: None,
            residuals: Vec::new(),
            used_ids: vec![1, 2],
            rejected_ids: vec![6],
            left_out: LeftOut::default(),
            initialisation: None,
            track: FrameTrack::default(),
            causes: None,
            integrity: None,
            track_integrity: None,
            separations: None,
            widened_by: 1.0,
        };
        let detections = [
            detection(1, 58.5, -51.3),
            detection(6, 50.0, 36.0),
            detection(2, 58.5, 88.9),
        ];
        Picture::new(&camera(), &map(), &detections, &outcome)
    }

    #[test]
    fn detections_are_on_their_rays_at_the_depth_of_their_markers() {
        let picture = picture(Ok(solution(&Matrix6::identity())));
        let ids: Vec<u32> = picture.used.iter().map(|seen| seen.id).collect();
        assert_eq!(ids, [1, 2]);
        assert_eq!(picture.rejected.len(), 1);
        let wrong = picture.rejected[0];
        // Marker 6 is the origin; 10 px to the right at a focal length of 100 px is 2 m at 20 m.
        assert!((wrong.marker_in_camera - Point3::new(0.0, 0.0, 20.0)).norm() < ROUNDING_M);
        assert!((wrong.detected_in_camera - Point3::new(2.0, 0.0, 20.0)).norm() < ROUNDING_M);
        assert_eq!(picture.unseen_in_camera.len(), 3);
        assert!(
            (picture.unseen_in_camera[0] - Point3::new(7.79, -2.689, 20.7)).norm() < ROUNDING_M
        );
    }

    #[test]
    fn ellipsoid_has_the_eigenvalues_and_axes_of_the_position_covariance() {
        // 0.3 and 0.1 m along two axes turned by half a radian about z, 0.2 m along z; the attitude's part is not its business.
        let turn = Rotation3::from_euler_angles(0.0, 0.0, 0.5);
        let squares = Matrix3::from_diagonal(&Vector3::new(0.09, 0.01, 0.04));
        let position = turn * squares * turn.inverse();
        let mut covariance = Matrix6::identity() * 7.0;
        covariance.fixed_view_mut::<3, 3>(0, 0).copy_from(&position);

        let found = picture(Ok(solution(&covariance)))
            .ellipsoid
            .expect("a trusted pose");

        assert_eq!(found.centre_in_camera, Point3::new(0.0, 0.0, 20.0));
        let axes = found.camera_from_axes.to_rotation_matrix();
        let halves = Matrix3::from_diagonal(&found.half_axes_m.map(|half| half * half));
        let rebuilt = axes * halves * axes.inverse() / (ELLIPSOID_SIGMAS * ELLIPSOID_SIGMAS);
        assert!((rebuilt - position).norm() < ROUNDING_M, "{rebuilt}");
        let mut lengths: Vec<f64> = found.half_axes_m.iter().copied().collect();
        lengths.sort_by(f64::total_cmp);
        for (length, expected) in lengths.iter().zip([0.3, 0.6, 0.9]) {
            assert!((length - expected).abs() < ROUNDING_M);
        }
    }

    #[test]
    fn frustum_goes_through_the_corners_of_the_image() {
        let [top_left, _, bottom_right, _] = picture(Ok(solution(&Matrix6::identity())))
            .frustum
            .expect("the size is known");
        let expected = |u: f64, v: f64| Point3::new((u - 40.0) / 50.0, (v - 36.0) / 100.0, 2.0);
        assert!((top_left - expected(-0.5, -0.5)).norm() < ROUNDING_M);
        assert!((bottom_right - expected(100.5, 60.5)).norm() < ROUNDING_M);
        let unsized_camera = Camera::from_intrinsics(100.0, 100.0, 0.0, 0.0, None).expect("fine");
        assert_eq!(frustum(&unsized_camera), None);
    }

    #[test]
    fn of_a_refused_frame_only_the_camera_is_left() {
        let refused = picture(Err(Refusal::NoCameraInfo));
        assert!(refused.frustum.is_some());
        let rest = Picture {
            frustum: None,
            ..refused
        };
        assert_eq!(rest, Picture::default());
    }
}
