//! Pixel -> ray -> pixel, to rounding, over whole images, and what is refused.

use proptest::prelude::*;

use super::super::{Camera, CameraInfo, Pixel, Ray, UndistortError};
use super::info;

/// Round trip of a ray, on the plane `z = 1` (or as an angle, rad, for a fisheye).
const RAY_TOLERANCE: f64 = 1.0e-12;
/// Round trip of a pixel, px.
const PIXEL_TOLERANCE_PX: f64 = 1.0e-9;

fn camera(width: u32, height: u32, focal_px: f64, model: &str, d: &[f64]) -> Camera {
    let (cx, cy) = (f64::from(width) / 2.0 - 3.3, f64::from(height) / 2.0 + 2.1);
    let k = [focal_px, 0.0, cx, 0.0, focal_px * 1.002, cy, 0.0, 0.0, 1.0];
    Camera::from_info(
        &CameraInfo {
            height,
            width,
            k,
            ..info(model, d)
        },
        false,
    )
    .expect("a good camera")
}

/// Clearly barrel-shaped; its polynomial turns over just outside the corners.
fn wide_angle() -> Camera {
    camera(
        1280,
        960,
        860.0,
        "plumb_bob",
        &[-0.3108, 0.1072, 0.0008, -0.0005, -0.0173],
    )
}

/// After the calibration of an Azure Kinect's colour camera.
fn rational() -> Camera {
    let d = [
        0.506, -2.706, 0.00072, -0.00031, 1.606, 0.381, -2.523, 1.528,
    ];
    camera(1280, 720, 606.0, "rational_polynomial", &d)
}

/// After the calibration of a `RealSense` T265: 170° across, its corners beyond the plane `z = 1`.
fn fisheye() -> Camera {
    camera(
        848,
        800,
        286.0,
        "equidistant",
        &[-0.0085, 0.0454, -0.0426, 0.0076],
    )
}

fn pixels(camera: &Camera) -> impl Iterator<Item = Pixel> {
    let (width, height) = camera.image_size_px().expect("given");
    (0..height).step_by(3).flat_map(move |v| {
        (0..width).step_by(3).map(move |u| Pixel {
            u: u.into(),
            v: v.into(),
        })
    })
}

/// Angle between two rays, rad.
fn angle(a: Ray, b: Ray) -> f64 {
    let (a, b) = (
        nalgebra::Vector3::new(a.x, a.y, 1.0),
        nalgebra::Vector3::new(b.x, b.y, 1.0),
    );
    a.cross(&b).norm().atan2(a.dot(&b))
}

#[test]
fn every_pixel_of_a_wide_angle_and_of_a_rational_image_makes_the_round_trip() {
    for camera in [wide_angle(), rational()] {
        for pixel in pixels(&camera) {
            let ray = camera
                .ray_from_pixel(pixel)
                .expect("calibrated over the whole image");
            let (back, _) = camera.project(ray).expect("the same region both ways");
            assert!(
                (back.u - pixel.u).hypot(back.v - pixel.v) < PIXEL_TOLERANCE_PX,
                "{pixel:?} came back as {back:?}"
            );
            let again = camera
                .ray_from_pixel(back)
                .expect("the same region both ways");
            assert!(
                (again.x - ray.x).hypot(again.y - ray.y) < RAY_TOLERANCE,
                "{ray:?} came back as {again:?}"
            );
        }
    }
}

#[test]
fn every_pixel_of_a_fisheye_image_makes_the_round_trip_or_lies_beyond_89_degrees() {
    let camera = fisheye();
    let (rim, _) = camera
        .project(Ray {
            x: 88.999_999_f64.to_radians().tan(),
            y: 0.0,
        })
        .expect("below 89°");
    let rim = (rim.u - camera.cx) / camera.fx;
    let (mut good, mut refused) = (0, 0);
    for pixel in pixels(&camera) {
        let radius = ((pixel.u - camera.cx) / camera.fx).hypot((pixel.v - camera.cy) / camera.fy);
        match camera.ray_from_pixel(pixel) {
            Ok(ray) => {
                good += 1;
                assert!(radius < rim + 1.0e-6, "{pixel:?}");
                let (back, _) = camera.project(ray).expect("the same region both ways");
                assert!(
                    (back.u - pixel.u).hypot(back.v - pixel.v) < PIXEL_TOLERANCE_PX,
                    "{pixel:?}: {back:?}"
                );
                let again = camera
                    .ray_from_pixel(back)
                    .expect("the same region both ways");
                assert!(
                    angle(again, ray) < RAY_TOLERANCE,
                    "{ray:?} came back as {again:?}"
                );
            }
            Err(error) => {
                refused += 1;
                assert!(radius > rim - 1.0e-6, "{error}");
            }
        }
    }
    assert!(
        good > 50_000 && refused > 5_000,
        "{good} good, {refused} refused"
    );
}

#[test]
fn beyond_the_turning_point_of_a_barrel_nothing_is_returned() {
    // The radius r (1 - 0.3 r²) turns at r = 1.054, where it is 0.703: 401 px from the centre.
    let camera = camera(1280, 960, 571.0, "plumb_bob", &[-0.3, 0.0, 0.0, 0.0, 0.0]);
    let right = |px: f64| {
        camera.ray_from_pixel(Pixel {
            u: camera.cx + px,
            v: camera.cy,
        })
    };
    assert!(right(401.0).is_ok_and(|ray| ray.x < 1.054));
    let error = right(402.0).expect_err("no ray falls there");
    assert_eq!(
        error.to_string(),
        "pixel (1038.7, 482.1) lies outside the valid region of the lens model: its distorted radius is \
         0.704028 on the plane z = 1, the model reaches 0.702728 in this direction"
    );
    // The ray at 1.6 would come back to 0.37, where another ray already is.
    assert_eq!(camera.project(Ray { x: 1.6, y: 0.0 }), None);
    assert_eq!(camera.project(Ray { x: 1.06, y: 0.0 }), None);
    assert!(camera.project(Ray { x: 1.05, y: 0.0 }).is_some());
}

#[test]
fn a_pole_of_a_rational_lens_is_never_reached() {
    // The denominator 1 - 4 r² is 0 at r = 0.5.
    let camera = camera(
        1280,
        960,
        571.0,
        "rational_polynomial",
        &[0.0, 0.0, 0.0, 0.0, 0.0, -4.0, 0.0, 0.0],
    );
    assert!(camera.project(Ray { x: 0.3, y: 0.0 }).is_some());
    assert_eq!(camera.project(Ray { x: 0.5, y: 0.0 }), None);
    assert_eq!(camera.project(Ray { x: 0.51, y: 0.0 }), None);
    assert!(camera.ray_from_pixel(Pixel { u: 1.0e9, v: 0.0 }).is_err());
}

#[test]
fn what_is_not_finite_is_an_error_in_every_model() {
    let pinhole = Camera::from_intrinsics(571.0, 571.0, 254.0, 206.0, None).expect("a good camera");
    for camera in [pinhole, wide_angle(), rational(), fisheye()] {
        for bad in [f64::NAN, f64::INFINITY, f64::NEG_INFINITY] {
            for (a, b) in [(bad, 1.0), (1.0, bad), (bad, bad)] {
                let error = camera.ray_from_pixel(Pixel { u: a, v: b });
                assert!(
                    matches!(error, Err(UndistortError::NotFinite { .. })),
                    "{error:?}"
                );
                assert_eq!(camera.project(Ray { x: a, y: b }), None);
            }
        }
    }
}

#[test]
fn the_centre_is_the_centre() {
    for camera in [wide_angle(), rational(), fisheye()] {
        let centre = Pixel {
            u: camera.cx,
            v: camera.cy,
        };
        assert_eq!(camera.ray_from_pixel(centre), Ok(Ray { x: 0.0, y: 0.0 }));
        let (pixel, by_ray) = camera.project(Ray { x: 0.0, y: 0.0 }).expect("the centre");
        assert_eq!(pixel, centre);
        assert_eq!(
            by_ray,
            nalgebra::Matrix2::new(camera.fx, 0.0, 0.0, camera.fy)
        );
    }
}

/// Any lens of moderate coefficients, many of which turn over inside the image.
fn any_camera() -> impl Strategy<Value = Camera> {
    let plumb_bob = (
        -0.5_f64..0.3,
        -0.3_f64..0.3,
        -0.01_f64..0.01,
        -0.01_f64..0.01,
        -0.1_f64..0.1,
    )
        .prop_map(|(k1, k2, p1, p2, k3)| {
            camera(1280, 960, 571.0, "plumb_bob", &[k1, k2, p1, p2, k3])
        });
    let rational = (
        prop::array::uniform6(-1.0_f64..1.0),
        -0.01_f64..0.01,
        -0.01_f64..0.01,
    )
        .prop_map(|([k1, k2, k3, k4, k5, k6], p1, p2)| {
            camera(
                1280,
                960,
                571.0,
                "rational_polynomial",
                &[k1, k2, p1, p2, k3, k4, k5, k6],
            )
        });
    let fisheye = prop::array::uniform4(-0.2_f64..0.2)
        .prop_map(|k| camera(1280, 960, 300.0, "equidistant", &k));
    prop_oneof![plumb_bob, rational, fisheye]
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(2000))]

    #[test]
    fn every_ray_that_has_a_pixel_comes_back(camera in any_camera(), x in -1.0_f64..1.0, y in -1.0_f64..1.0) {
        let ray = Ray { x, y };
        if let Some((pixel, _)) = camera.project(ray) {
            let back = camera.ray_from_pixel(pixel);
            prop_assert!(back.is_ok(), "{:?}", back);
            let back = back.expect("just seen");
            prop_assert!((back.x - x).hypot(back.y - y) < RAY_TOLERANCE, "{:?} for {:?}", back, ray);
        }
    }

    #[test]
    fn every_pixel_that_has_a_ray_comes_back(camera in any_camera(), u in -1.0e4_f64..1.0e4, v in -1.0e4_f64..1.0e4) {
        if let Ok(ray) = camera.ray_from_pixel(Pixel { u, v }) {
            let back = camera.project(ray);
            prop_assert!(back.is_some());
            let (back, _) = back.expect("just seen");
            prop_assert!((back.u - u).hypot(back.v - v) < PIXEL_TOLERANCE_PX * (1.0 + u.hypot(v) / 1000.0));
        }
    }

    #[test]
    fn the_derivative_agrees_with_central_differences(camera in any_camera(), x in -0.9_f64..0.9, y in -0.9_f64..0.9) {
        /// Half the width of the wider of two differences, on the plane `z = 1`.
        const STEP: f64 = 2.0e-5;
        /// Relative: the error left by two differences is of fourth order, and steepest near a pole.
        const TOLERANCE: f64 = 1.0e-7;
        let slope = |dx: f64, dy: f64| {
            let ((far, _), (near, _)) = camera.project(Ray { x: x + dx, y: y + dy }).zip(camera.project(Ray { x: x - dx, y: y - dy }))?;
            Some(nalgebra::Vector2::new(far.u - near.u, far.v - near.v) / (2.0 * dx.hypot(dy)))
        };
        let refined = |dx: f64, dy: f64| Some((slope(dx / 2.0, dy / 2.0)? * 4.0 - slope(dx, dy)?) / 3.0);
        if let (Some((_, by_ray)), Some(by_x), Some(by_y)) = (camera.project(Ray { x, y }), refined(STEP, 0.0), refined(0.0, STEP)) {
            let numeric = nalgebra::Matrix2::from_columns(&[by_x, by_y]);
            let scale = by_ray.norm().max(camera.fx);
            prop_assert!((numeric - by_ray).norm() < TOLERANCE * scale, "{} against {}", by_ray, numeric);
        }
    }

    #[test]
    fn any_bits_for_a_pixel_end_in_an_answer(camera in any_camera(), u in any::<f64>(), v in any::<f64>()) {
        if let Ok(ray) = camera.ray_from_pixel(Pixel { u, v }) {
            prop_assert!(ray.x.is_finite() && ray.y.is_finite());
        }
    }

    #[test]
    fn any_bits_for_a_camera_info_end_in_an_answer(
        k in prop::array::uniform9(any::<f64>()),
        d in prop::collection::vec(any::<f64>(), 0..14),
        model in prop::sample::select(vec!["plumb_bob", "rational_polynomial", "equidistant", "other"]),
        modest in prop::array::uniform8(-1.0e9_f64..1.0e9),
    ) {
        let _ = Camera::from_info(&CameraInfo { k, ..info(model, &d) }, false);
        if let Ok(camera) = Camera::from_info(&info(model, &modest), false) {
            let _ = camera.ray_from_pixel(Pixel { u: 300.0, v: 200.0 });
        }
    }
}
