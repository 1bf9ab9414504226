//! Agreement with `OpenCV`, whose formulas ROS's model names refer to.

#![allow(
    clippy::unreadable_literal,
    reason = "golden numbers stand as they were printed"
)]

use super::super::{Camera, Pixel, Ray};
use super::info;

/// Difference from `OpenCV`, px: rounding in another order.
const PIXEL_TOLERANCE_PX: f64 = 1.0e-10;
/// The same on the plane `z = 1`, for rays of moderate angle.
const RAY_TOLERANCE: f64 = 1.0e-12;
/// And beyond 60° off the axis, where a pixel moves the ray far along the plane.
const WIDE_RAY_TOLERANCE: f64 = 1.0e-11;

// Rows are x, y of the ray, then u, v of its pixel: OpenCV 5.0.0, made 2026-11-22 by
//   pip install opencv-python-headless==5.0.0.* numpy && python golden.py
// where golden.py is, with d1, d2, d3 the coefficients below:
//   import numpy as np, cv2
//   K = np.array([[571., 0, 254], [0, 569., 206], [0, 0, 1]]); z = np.zeros(3)
//   rays = [[0, 0], [0.1, -0.05], [-0.4, 0.3], [0.44, -0.36], [0.3, 0.62]]
//   pts = lambda r: np.array([[x, y, 1.] for x, y in r]).reshape(-1, 1, 3)
//   show = lambda r, p: [print((*a, *b)) for a, b in zip(r, p.reshape(-1, 2).tolist())]
//   show(rays, cv2.projectPoints(pts(rays), z, z, K, np.array(d1))[0])
//   show(rays, cv2.projectPoints(pts(rays), z, z, K, np.array(d2))[0])
//   rays += [[2, -1.5], [-6, 4]]
//   show(rays, cv2.fisheye.projectPoints(pts(rays), z, z, K, np.array(d3))[0])

const PLUMB_BOB: [f64; 5] = [-0.31, 0.12, 0.0013, -0.0007, -0.02];
const PLUMB_BOB_PIXELS: [[f64; 4]; 5] = [
    [0.0, 0.0, 254.0, 206.0],
    [0.1, -0.05, 310.8593926445312, 177.67663917382814],
    [-0.4, 0.3, 41.25339400000004, 365.11131924999995],
    [0.44, -0.36, 482.52830319987345, 19.81095656230667],
    [0.3, 0.62, 404.382965483862, 516.4442930643971],
];

/// After the calibration of an Azure Kinect's colour camera.
const RATIONAL: [f64; 8] = [
    0.506, -2.706, 0.00072, -0.00031, 1.606, 0.381, -2.523, 1.528,
];
const RATIONAL_PIXELS: [[f64; 4]; 5] = [
    [0.0, 0.0, 254.0, 206.0],
    [0.1, -0.05, 311.17734948727485, 177.5154792820627],
    [-0.4, 0.3, 20.4042318986219, 380.65252382292135],
    [0.44, -0.36, 511.57880488044077, -3.9223645999607015],
    [0.3, 0.62, 431.1737145659971, 571.2437813306151],
];

const EQUIDISTANT: [f64; 4] = [0.0213, -0.0049, 0.0031, -0.0011];
const EQUIDISTANT_PIXELS: [[f64; 4]; 7] = [
    [0.0, 0.0, 254.0, 206.0],
    [0.1, -0.05, 310.87882447421157, 177.6602004152133],
    [-0.4, 0.3, 41.27793322374305, 364.9827355460029],
    [0.44, -0.36, 483.6840746115596, 18.734891564114548],
    [0.3, 0.62, 405.09046584953694, 517.1599214384102],
    [2.0, -1.5, 811.168509375066, -210.4127169453755],
    [-6.0, 4.0, -447.489525652869, 672.0216463473234],
];

fn assert_agrees(model: &str, d: &[f64], rows: &[[f64; 4]]) {
    let camera = Camera::from_info(&info(model, d), false).expect("a good camera");
    for &[x, y, u, v] in rows {
        let (pixel, _) = camera
            .project(Ray { x, y })
            .expect("within the valid region");
        let error_px = (pixel.u - u).hypot(pixel.v - v);
        assert!(
            error_px < PIXEL_TOLERANCE_PX,
            "({x}, {y}) is {error_px:e} px off"
        );
        let ray = camera
            .ray_from_pixel(Pixel { u, v })
            .expect("within the valid region");
        let error = (ray.x - x).hypot(ray.y - y);
        let tolerance = if x.hypot(y) < 3.0_f64.sqrt() {
            RAY_TOLERANCE
        } else {
            WIDE_RAY_TOLERANCE
        };
        assert!(error < tolerance, "({u}, {v}) is {error:e} off");
    }
}

#[test]
fn plumb_bob_agrees_with_opencv() {
    assert_agrees("plumb_bob", &PLUMB_BOB, &PLUMB_BOB_PIXELS);
}

#[test]
fn rational_polynomial_agrees_with_opencv() {
    assert_agrees("rational_polynomial", &RATIONAL, &RATIONAL_PIXELS);
}

#[test]
fn equidistant_agrees_with_opencv() {
    assert_agrees("equidistant", &EQUIDISTANT, &EQUIDISTANT_PIXELS);
}

#[test]
fn a_rational_lens_without_denominator_is_a_plumb_bob() {
    let [k1, k2, p1, p2, k3] = PLUMB_BOB;
    assert_agrees(
        "rational_polynomial",
        &[k1, k2, p1, p2, k3, 0.0, 0.0, 0.0],
        &PLUMB_BOB_PIXELS,
    );
}
