//! What checked types promise, asserted with code that is not theirs.

use nalgebra::Matrix6;
use tanker_pose::camera::{Camera, CameraInfo, Pixel, Ray};
use tanker_pose::estimation::Solution;
use tanker_pose::geometry::PoseCovariance;
use tanker_pose::pipeline::FrameOutcome;
use tanker_pose::target::{MAX_COORDINATE_M, MarkerMap};

/// Rounding of a unit quaternion and of covariances, relative.
const ROUNDING: f64 = 1e-9;
/// Pixels that a camera may lose on the way to a ray and back, by the pixel's distance from the principal point: rays
/// are exact to 1e-12 on the plane z = 1, and a lens multiplies that by its magnification.
const RETURN_PX: f64 = 1e-6;

/// A pose that the pipeline accepts is finite, and its covariance positive definite.
pub fn outcome(outcome: &FrameOutcome) {
    assert!(!outcome.message().contains('\n'), "{}", outcome.message());
    if let Some(solution) = outcome.solution() {
        pose(solution);
    }
    if let Ok(solution) = &outcome.result {
        pose(solution);
        for id in &outcome.used_ids {
            assert!(!outcome.rejected_ids.contains(id), "{id} used and rejected");
        }
        assert!(outcome.used_ids.len() >= 3, "{:?}", outcome.used_ids);
    }
}

/// A solution's numbers can be used.
fn pose(solution: &Solution) {
    let pose = &solution.camera_from_tanker;
    assert!(
        pose.translation.vector.iter().all(|t| t.is_finite()),
        "{pose}"
    );
    let norm = pose.rotation.quaternion().norm();
    assert!((norm - 1.0).abs() < ROUNDING, "{pose} {norm}");
    covariance(&solution.covariance);
    for number in [solution.rms_px, solution.chi_squared, solution.ambiguity] {
        assert!(number.is_finite() && number >= 0.0, "{number}");
    }
}

/// A covariance is finite, symmetric and positive definite: each pivot of an elimination is above zero.
pub fn covariance(covariance: &PoseCovariance) {
    let given = &covariance.0;
    assert!(given.iter().all(|value| value.is_finite()), "{given}");
    let sigmas: [f64; 6] = std::array::from_fn(|i| given[(i, i)].sqrt());
    assert!(sigmas.iter().all(|sigma| *sigma > 0.0), "{given}");
    let mut left = Matrix6::from_fn(|i, j| given[(i, j)] / sigmas[i] / sigmas[j]);
    assert!((left - left.transpose()).amax() < ROUNDING, "{given}");
    for k in 0..6 {
        let pivot = left[(k, k)];
        assert!(pivot > 0.0, "pivot {k} is {pivot} in {given}");
        for i in k + 1..6 {
            let factor = left[(i, k)] / pivot;
            for j in k..6 {
                left[(i, j)] -= factor * left[(k, j)];
            }
        }
    }
}

/// A camera that is accepted maps pixels to rays and back, all over its image.
pub fn camera(info: &CameraInfo) {
    for rectified in [false, true] {
        let Ok(camera) = Camera::from_info(info, rectified) else {
            continue;
        };
        let (width, height) = camera.image_size_px().unwrap_or((640, 480));
        assert!(width > 0 && height > 0);
        for step in 0..25 {
            let share = |step: u32, size: u32| f64::from(step) / 4.0 * f64::from(size);
            let pixel = Pixel {
                u: share(step % 5, width),
                v: share(step / 5, height),
            };
            returns(&camera, pixel, info);
        }
    }
}

fn returns(camera: &Camera, pixel: Pixel, info: &CameraInfo) {
    let Ok(ray) = camera.ray_from_pixel(pixel) else {
        return;
    };
    let Ray { x, y } = ray;
    assert!(x.is_finite() && y.is_finite(), "{pixel:?} {ray:?} {info:?}");
    let found = camera.project(ray);
    assert!(
        found.is_some(),
        "{pixel:?} has the ray {ray:?}, which has no pixel: {info:?}"
    );
    let Some((back, derivative)) = found else {
        return;
    };
    assert!(
        derivative.iter().all(|value| value.is_finite()),
        "{derivative} {info:?}"
    );
    let error_px = (back.u - pixel.u).hypot(back.v - pixel.v);
    let size_px = 1.0 + pixel.u.abs().max(pixel.v.abs());
    assert!(
        error_px <= RETURN_PX * size_px,
        "{pixel:?} comes back as {back:?} by {ray:?}: {info:?}"
    );
}

/// A map that is accepted has at least three markers with ids of their own within the limit, and errors above zero.
pub fn map(map: &MarkerMap) {
    let markers = map.markers();
    assert!(markers.len() >= 3);
    assert!(markers.windows(2).all(|pair| pair[0].id < pair[1].id));
    for marker in markers {
        let within = |value: &f64| value.abs() <= MAX_COORDINATE_M * 1.2;
        assert!(marker.marker_in_tanker.iter().all(within), "{marker:?}");
        assert_eq!(map.get(marker.id), Some(marker.marker_in_tanker));
    }
    for (id, sigma_m) in &map.budget().survey_sigma_m {
        assert!(map.get(*id).is_some() && sigma_m.is_finite() && *sigma_m > 0.0);
    }
    for flex in &map.budget().flex {
        assert!(flex.sigma_m.is_finite() && flex.sigma_m >= 0.0);
        assert!(
            flex.time_constant_s
                .is_none_or(|time_s| time_s > 0.0 && time_s.is_finite())
        );
        for (id, shift) in &flex.shape {
            assert!(map.get(*id).is_some() && shift.iter().all(|value| value.is_finite()));
        }
    }
    for point in map.points() {
        assert!(
            point
                .point_in_tanker
                .iter()
                .all(|value| value.abs() <= MAX_COORDINATE_M)
        );
    }
}
