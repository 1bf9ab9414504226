//! What users get from `certify`: certified poses are those of the truth, the rest is said and can be refused.
//!
//! Thousands of wrong and right minima, and false starts, are in `src/estimation/certificate/statistics.rs` and
//! `src/estimation/certify.rs`, since no start of the estimator leads to many of them.

#[expect(dead_code, reason = "other tests use the rest")]
mod solver_support;
mod support;

use nalgebra::{Point3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use solver_support::{full_budget, plumb_bob_camera};
use support::{distance_squared, oracle_maximum_likelihood, settings, tanker_markers};
use tanker_pose::camera::Camera;
use tanker_pose::estimation::{
    Certificate, Estimator, EstimatorSettings, Initialisation, Observation, Refinement, Solution,
};
use tanker_pose::geometry::rotation_from_roll_pitch_yaw;
use tanker_pose::pipeline::{Refusal, solve};
use tanker_pose::simulation::{Scene, paper_camera, pose_in_camera};
use tanker_pose::target::Marker;

/// Squared Mahalanobis distance under which two poses are one minimum.
const SAME_MINIMUM: f64 = 1e-4;

fn certifying(settings: &EstimatorSettings) -> Estimator {
    Estimator::new(EstimatorSettings {
        certify: true,
        ..settings.clone()
    })
}

/// Five to twelve markers of a tanker, 10 to 80 m away, its attitude within 5° of the nominal one.
fn refuelling_scene(camera: &Camera, random: &mut ChaCha8Rng) -> Scene {
    let markers = tanker_markers(random.random_range(5..=12));
    let range_m = random.random_range(10.0..80.0);
    let mut turn = || random.random_range(-5.0..5.0);
    let (roll, pitch, yaw) = (turn(), turn(), turn());
    let position = Vector3::new(range_m, 0.0, 0.3 * range_m);
    let pose = pose_in_camera(position, roll, pitch, yaw);
    Scene::with_markers(camera.clone(), markers, pose)
}

fn is_that_of_the_truth(scene: &Scene, seen: &[Observation], solution: &Solution) -> bool {
    let truth = scene.truth_camera_from_tanker();
    oracle_maximum_likelihood(scene.camera(), seen, truth)
        .is_some_and(|best| distance_squared(solution, &best) < SAME_MINIMUM)
}

#[test]
fn certified_poses_of_4000_frames_are_those_of_the_truth_and_nothing_else_changes() {
    const FRAMES: usize = 4000;
    for refinement in [Refinement::MaximumLikelihood, Refinement::None] {
        let settings = settings(Initialisation::Nominal, refinement);
        let (plain, certifying) = (Estimator::new(settings.clone()), certifying(&settings));
        let mut random = ChaCha8Rng::seed_from_u64(40);
        let mut certified = 0;
        for _ in 0..FRAMES {
            let scene = refuelling_scene(&paper_camera(), &mut random);
            let sigma_px = random.random_range(0.1..5.0);
            let seen = scene.noisy_observations(sigma_px, &mut random);
            let without = plain.estimate(scene.camera(), &seen, None);
            let found = certifying.estimate(scene.camera(), &seen, None);
            let (without, found) = (without.expect("a pose"), found.expect("a pose"));
            assert_eq!(without.certificate, None);
            if found.certificate != Some(Certificate::Certified) {
                println!("{refinement:?}, {sigma_px:.2} px: {:?}", found.certificate);
                continue;
            }
            certified += 1;
            let expected = Solution {
                certificate: Some(Certificate::Certified),
                ..without
            };
            assert_eq!(found, expected);
            if refinement == Refinement::MaximumLikelihood {
                assert!(is_that_of_the_truth(&scene, &seen, &found), "{sigma_px} px");
            }
        }
        println!("{refinement:?}: {certified} of {FRAMES} certified");
        assert!(certified * 1000 >= FRAMES * 999);
    }
}

#[test]
fn a_lens_and_a_budget_lose_no_certificate() {
    const FRAMES: usize = 1000;
    for camera in [paper_camera(), plumb_bob_camera()] {
        let mut random = ChaCha8Rng::seed_from_u64(42);
        let mut certified = 0;
        for _ in 0..FRAMES {
            let scene = refuelling_scene(&camera, &mut random);
            let seen = scene.noisy_observations(0.5, &mut random);
            let estimator = certifying(&settings(
                Initialisation::Nominal,
                Refinement::MaximumLikelihood,
            ))
            .with_budget(full_budget(&seen));
            let found = estimator
                .estimate(&camera, &seen, None)
                .expect("a pose in front");
            certified += usize::from(found.certificate == Some(Certificate::Certified));
        }
        println!("{certified} of {FRAMES} certified");
        assert!(certified * 1000 >= FRAMES * 999);
    }
}

/// A flat target that is tilted away from its nominal attitude, which its mirror image is nearer to: the nominal attitude
/// may decide against the lower cost, and then there is no proof.
#[test]
fn a_pose_that_the_prior_chose_against_the_image_is_not_certified_and_can_be_refused() {
    let places = [
        (-3.0, -1.0),
        (-1.0, 1.2),
        (1.0, -0.8),
        (3.0, 1.0),
        (-2.0, 0.2),
        (2.0, -0.3),
    ];
    let marker = |(id, (y, z)): (u32, (f64, f64))| Marker {
        id,
        marker_in_tanker: Point3::new(0.0, y, z),
    };
    let markers: Vec<Marker> = (1..).zip(places).map(marker).collect();
    let towards_the_mirror: Rotation3<f64> =
        rotation_from_roll_pitch_yaw(0.0, (-8.0_f64).to_radians(), 0.0);
    let usual = settings(Initialisation::Nominal, Refinement::MaximumLikelihood);
    let telling = EstimatorSettings {
        nominal_camera_from_tanker: usual.nominal_camera_from_tanker * towards_the_mirror,
        certify: true,
        ..usual
    };
    let requiring = EstimatorSettings {
        require_certificate: true,
        ..telling.clone()
    };
    let (telling, requiring) = (Estimator::new(telling), Estimator::new(requiring));
    let pose = pose_in_camera(Vector3::new(30.0, 0.0, 0.0), 0.0, 12.0, 0.0);
    let scene = Scene::with_markers(paper_camera(), markers, pose);
    let mut random = ChaCha8Rng::seed_from_u64(43);
    let mut not_certified = 0;
    for _ in 0..300 {
        let seen = scene.noisy_observations(0.5, &mut random);
        let Ok(found) = telling.estimate(scene.camera(), &seen, None) else {
            continue;
        };
        let told = solve(&telling, scene.camera(), &seen, None);
        let required = solve(&requiring, scene.camera(), &seen, None);
        match found.certificate {
            Some(Certificate::NotCertified) => {
                not_certified += 1;
                // The other pose is known.
                assert!(found.ambiguity > 0.0);
                if told.result.is_ok() {
                    assert_eq!(required.result, Err(Refusal::NotCertified));
                    assert!(required.doubtful.is_some());
                }
            }
            _ => assert_eq!(told.result, required.result),
        }
    }
    println!("{not_certified} of 300 not certified");
    assert!(not_certified > 30);
}
