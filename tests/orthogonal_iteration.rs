//! The three forms of orthogonal iteration agree, and exact images give exact poses.

mod support;

use nalgebra::Point3;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{random_refuelling_scene, settings};
use tanker_pose::camera::Ray;
use tanker_pose::estimation::{
    Estimator, Initialisation, Refinement, fixed_point, iterate_accelerated, iterate_literally,
    linear_rotation,
};
use tanker_pose::geometry::{optical_from_body, pose_error};
use tanker_pose::simulation::Scene;

/// rad, between rotations that took the same steps in different arithmetic.
const SAME_STEPS: f64 = 1e-12;
/// rad; both forms stop when a step is below 1e-13, at a linear rate of about 0.7.
const SAME_FIXED_POINT: f64 = 1e-11;

fn rays_and_markers(
    scene: &Scene,
    sigma_px: f64,
    random: &mut ChaCha8Rng,
) -> (Vec<Ray>, Vec<Point3<f64>>) {
    scene
        .noisy_observations(sigma_px, random)
        .iter()
        .map(|seen| {
            (
                scene
                    .camera()
                    .ray_from_pixel(seen.pixel)
                    .expect("a pinhole has a ray everywhere"),
                seen.marker_in_tanker,
            )
        })
        .unzip()
}

fn turn(a: &tanker_pose::estimation::Iterated, b: &tanker_pose::estimation::Iterated) -> f64 {
    let matrix =
        |x: &tanker_pose::estimation::Iterated| x.camera_from_tanker.rotation.to_rotation_matrix();
    (matrix(a).matrix() - matrix(b).matrix()).norm() / std::f64::consts::SQRT_2
}

#[test]
fn accelerated_iteration_equals_the_papers_over_1000_frames() {
    let mut random = ChaCha8Rng::seed_from_u64(20);
    let mut worst = 0.0_f64;
    let mut worst_translation_m = 0.0_f64;
    for _ in 0..1000 {
        let scene = random_refuelling_scene(&mut random, 10.0, 80.0);
        let sigma_px = random.random_range(0.0..2.0);
        let (rays, markers) = rays_and_markers(&scene, sigma_px, &mut random);
        let seed = optical_from_body();
        for steps in [1, 10, 40] {
            let literal =
                iterate_literally(&rays, &markers, &seed, 0.0, steps).expect("six points");
            let accelerated =
                iterate_accelerated(&rays, &markers, &seed, 0.0, steps).expect("six points");
            assert_eq!((literal.iterations, accelerated.iterations), (steps, steps));
            worst = worst.max(turn(&literal, &accelerated));
            worst_translation_m = worst_translation_m.max(
                (literal.camera_from_tanker.translation.vector
                    - accelerated.camera_from_tanker.translation.vector)
                    .norm(),
            );
        }
    }
    println!("largest difference after equal steps: {worst:.1e} rad, {worst_translation_m:.1e} m");
    assert!(worst < SAME_STEPS, "rotations differ by {worst:e} rad");
    assert!(
        worst_translation_m < 1e-9,
        "translations differ by {worst_translation_m:e} m"
    );
}

#[test]
fn newton_ends_at_the_fixed_point_of_the_iteration() {
    let mut random = ChaCha8Rng::seed_from_u64(21);
    let mut worst = 0.0_f64;
    let (mut newton_steps, mut plain_steps) = (0, 0);
    for _ in 0..200 {
        let scene = random_refuelling_scene(&mut random, 10.0, 40.0);
        let (rays, markers) = rays_and_markers(&scene, 0.5, &mut random);
        let seed = optical_from_body();
        let iterated =
            iterate_accelerated(&rays, &markers, &seed, 1e-13, 5000).expect("six points");
        let newton = fixed_point(&rays, &markers, &seed).expect("six points");
        assert!(iterated.converged && newton.converged);
        worst = worst.max(turn(&iterated, &newton));
        newton_steps += newton.iterations;
        plain_steps += iterated.iterations;
    }
    println!(
        "largest difference {worst:.1e} rad; {} steps against {} a frame",
        newton_steps / 200,
        plain_steps / 200
    );
    assert!(
        worst < SAME_FIXED_POINT,
        "fixed points differ by {worst:e} rad"
    );
}

#[test]
fn exact_images_give_exact_poses_from_every_start() {
    let mut random = ChaCha8Rng::seed_from_u64(22);
    for _ in 0..100 {
        let scene = random_refuelling_scene(&mut random, 10.0, 40.0);
        let observations = scene.exact_observations();
        for refinement in [Refinement::MaximumLikelihood, Refinement::None] {
            for start in [
                Initialisation::Nominal,
                Initialisation::Dlt,
                Initialisation::Global,
                Initialisation::Previous,
            ] {
                let solution = Estimator::new(settings(start, refinement))
                    .estimate(scene.camera(), &observations, Some(&scene.truth_rotation()))
                    .expect("an exact image");
                let error = pose_error(
                    scene.truth_camera_from_tanker(),
                    &solution.camera_from_tanker,
                );
                assert!(
                    error.norm() < 1e-6,
                    "{start:?} {refinement:?}: error {error}"
                );
                assert!(solution.is_trusted() && solution.rms_px < 1e-6);
            }
        }
    }
}

#[test]
fn linear_start_is_exact_for_an_exact_image() {
    let mut random = ChaCha8Rng::seed_from_u64(23);
    let scene = random_refuelling_scene(&mut random, 12.0, 20.0);
    let (rays, markers) = rays_and_markers(&scene, 0.0, &mut random);
    for reference in [[0.0; 3], [5.0, 0.0, 1.0], [-30.0, 8.0, 2.0]] {
        let rotation = linear_rotation(&rays, &markers, &Point3::from(reference))
            .expect("six points in general position");
        // The chord: of a turn below 1e-8 the angle is rounding, or NaN.
        let error_rad = (rotation.matrix() - scene.truth_rotation().matrix()).norm();
        assert!(error_rad < 1e-7, "{error_rad}");
    }
}
