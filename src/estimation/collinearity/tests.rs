use nalgebra::{Matrix3, Point3, Rotation3, Vector3};

use super::*;
use crate::camera::{Camera, Pixel};
use crate::estimation::Observation;
use crate::estimation::lanes::columns::Columns;
use crate::estimation::lanes::four::{LANES, Lane, Plain};
use crate::estimation::lanes::points::{Blocks, Points};
use crate::estimation::lanes::symmetric3::Symmetric3;
use crate::geometry::skew;

/// Relative; sums of a handful of products.
const ROUNDING: f64 = 1e-12;

fn observation(id: u32, marker: [f64; 3], pixel: [f64; 2]) -> Observation {
    Observation {
        id,
        marker_in_tanker: Point3::from(marker),
        pixel: Pixel {
            u: pixel[0],
            v: pixel[1],
        },
        sigma_px: 0.7,
    }
}

/// Five points, so that the second block is not full.
fn example() -> (Camera, Vec<Observation>, Rotation3<f64>) {
    let camera = Camera::from_intrinsics(500.0, 500.0, 300.0, 200.0, None).expect("a camera");
    let observations = vec![
        observation(1, [1.0, 0.2, -0.5], [350.0, 300.0]),
        observation(2, [-1.0, 0.7, 0.4], [200.0, 250.0]),
        observation(3, [0.3, -1.2, 0.9], [450.0, 100.0]),
        observation(4, [-0.3, 0.3, -0.8], [250.0, 50.0]),
        observation(5, [0.6, 0.9, 0.3], [310.0, 180.0]),
    ];
    (
        camera,
        observations,
        Rotation3::new(Vector3::new(0.3, -0.2, 0.5)),
    )
}

fn cost_of(points: &Points, weighting: Weighting) -> Option<CollinearityCost> {
    let moments = CollinearityMoments::new(Plain, points, weighting);
    let mut cost = CollinearityCost::EMPTY;
    cost.fill(Plain, &moments).map(|()| cost)
}

fn literal_error(
    rays: &[(Vector3<f64>, Vector3<f64>)],
    r: &Rotation3<f64>,
    c: &Vector3<f64>,
) -> f64 {
    rays.iter()
        .map(|(p, v)| {
            let projector = v * v.transpose() / v.norm_squared();
            ((projector - Matrix3::identity()) * (r * p + c)).norm_squared()
        })
        .sum()
}

#[test]
fn quadratic_form_equals_the_papers_sum_at_its_best_translation() {
    let (camera, observations, r) = example();
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, &camera, &observations, &mut room).expect("points in general position");
    let cost = cost_of(&points, Weighting::ObjectSpace).expect("five different rays");
    let rays: Vec<_> = observations
        .iter()
        .map(|seen| {
            let ray = camera.ray_from_pixel(seen.pixel).expect("a pinhole");
            (
                seen.marker_in_tanker - points.mean,
                Vector3::new(ray.x, ray.y, 1.0),
            )
        })
        .collect();
    let c = cost.centre_in_camera(&r);
    let literal = literal_error(&rays, &r, &c);
    assert!((cost.value(Plain, &r) - literal).abs() < ROUNDING * literal);
    // No neighbouring translation does better.
    for axis in 0..3 {
        for step in [-1e-4, 1e-4] {
            let mut moved = c;
            moved[axis] += step;
            assert!(literal_error(&rays, &r, &moved) > literal);
        }
    }
}

#[test]
fn curvature_is_that_of_the_quadratic_form() {
    let (camera, observations, r) = example();
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, &camera, &observations, &mut room).expect("points in general position");
    let cost = cost_of(&points, Weighting::Image).expect("five different rays");
    let form = |m: &Matrix3<f64>| {
        let unchecked = Rotation3::from_matrix_unchecked(*m);
        cost.value(Plain, &unchecked)
    };
    let columns = Columns::new(Plain, r.matrix());
    let curvature = cost.curvature(Plain, columns, &columns.splats(Plain));
    for k in 0..3 {
        let turn = r.matrix() * skew(Vector3::ith(k, 1.0));
        let expected = form(&turn);
        assert!((curvature[(k, k)] - expected).abs() < ROUNDING * expected);
        for l in 0..k {
            let other = r.matrix() * skew(Vector3::ith(l, 1.0));
            let mixed = (form(&(turn + other)) - form(&turn) - form(&other)) / 2.0;
            assert!((curvature[(k, l)] - mixed).abs() < ROUNDING * expected);
            assert!((curvature[(l, k)] - mixed).abs() < ROUNDING * expected);
        }
    }
}

#[test]
fn every_weight_has_its_ray_as_null_space() {
    let (camera, observations, _) = example();
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, &camera, &observations, &mut room).expect("points in general position");
    for block in points.blocks {
        for weighting in [Weighting::ObjectSpace, Weighting::Image] {
            let weights = weighting.of(Plain, block);
            for lane in 0..LANES {
                let v = Vector3::new(block.ray[0][lane], block.ray[1][lane], 1.0);
                let w = full(&weights.map(|entry| entry.lane()[lane]));
                assert!((w * v).norm() <= ROUNDING * w.norm());
            }
        }
    }
}

#[test]
fn identical_rays_are_refused() {
    let (camera, mut observations, _) = example();
    for seen in &mut observations {
        seen.pixel = Pixel { u: 300.0, v: 200.0 };
    }
    let mut room = Blocks::new();
    let points = Points::new(Plain, &camera, &observations, &mut room).expect("the markers differ");
    assert!(cost_of(&points, Weighting::Image).is_none());
}

#[test]
fn four_at_once_have_the_costs_and_depths_of_one_by_one() {
    let (camera, observations, r) = example();
    let mut room = Blocks::new();
    let points =
        Points::new(Plain, &camera, &observations, &mut room).expect("points in general position");
    let cost = cost_of(&points, Weighting::Image).expect("five different rays");
    let four: [Rotation3<f64>; LANES] =
        std::array::from_fn(|k| r * Rotation3::new(Vector3::new(0.3, -0.5, 0.4) * k as f64));
    let entries: [Lane; 9] = std::array::from_fn(|i| four.map(|rotation| rotation.matrix()[i]));
    let of_four: [Lane; PRODUCTS] =
        std::array::from_fn(|i| four.map(|rotation| products(&rotation)[i]));
    let values = combined(Plain, &cost.coefficients(), &of_four);
    let depths = cost.depths(Plain, &entries);
    for (k, rotation) in four.iter().enumerate() {
        let value = cost.value(Plain, rotation);
        assert!((values[k] - value).abs() < ROUNDING * value);
        let depth = cost.centre_in_camera(rotation).z;
        assert!((depths[k] - depth).abs() < ROUNDING * depth.abs());
    }
}

fn full(s: &Symmetric3) -> Matrix3<f64> {
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}
