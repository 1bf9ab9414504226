//! No wrong minimum: every start that the documentation allows ends where maximum likelihood, started
//! at the truth, ends.

mod support;

use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use support::{
    distance_squared, oracle_maximum_likelihood, random_attitude_scene, random_refuelling_scene,
    settings,
};
use tanker_pose::estimation::{Estimator, Initialisation, Refinement};

/// Squared Mahalanobis distance under which two poses are one minimum.
const SAME_MINIMUM: f64 = 1e-4;

#[test]
fn nominal_start_finds_the_minimum_of_the_truth_in_10000_frames() {
    let likelihood = Estimator::new(settings(
        Initialisation::Nominal,
        Refinement::MaximumLikelihood,
    ));
    let iteration = Estimator::new(settings(Initialisation::Nominal, Refinement::None));
    let mut random = ChaCha8Rng::seed_from_u64(30);
    let (mut wrong_likelihood, mut wrong_iteration) = (0, 0);
    for frame in 0..10_000 {
        let scene = random_refuelling_scene(&mut random, 10.0, 80.0);
        let sigma_px = random.random_range(0.1..5.0);
        let observations = scene.noisy_observations(sigma_px, &mut random);
        let truth = oracle_maximum_likelihood(
            scene.camera(),
            &observations,
            scene.truth_camera_from_tanker(),
        )
        .expect("the oracle settles");
        match likelihood.estimate(scene.camera(), &observations, None) {
            Ok(solution) if distance_squared(&solution, &truth) < SAME_MINIMUM => {}
            other => {
                println!(
                    "likelihood, frame {frame}, {sigma_px:.2} px: {other:?}\n{}",
                    scene.truth_camera_from_tanker()
                );
                wrong_likelihood += 1;
            }
        }
        // The iteration minimises another error; polished, it must be the same minimum.
        let polished = iteration
            .estimate(scene.camera(), &observations, None)
            .ok()
            .and_then(|found| {
                oracle_maximum_likelihood(scene.camera(), &observations, &found.camera_from_tanker)
            });
        let same = polished.is_some_and(|pose| {
            (pose.rotation.angle_to(&truth.rotation) < 1e-4)
                && (pose.translation.vector - truth.translation.vector).norm() < 1e-2
        });
        if !same {
            println!(
                "iteration, frame {frame}, {sigma_px:.2} px\n{}",
                scene.truth_camera_from_tanker()
            );
            wrong_iteration += 1;
        }
    }
    println!(
        "wrong minima among 10,000: maximum likelihood {wrong_likelihood}, orthogonal iteration {wrong_iteration}"
    );
    assert_eq!((wrong_likelihood, wrong_iteration), (0, 0));
}

#[test]
fn global_start_finds_the_minimum_of_the_truth_in_4000_random_attitudes() {
    let estimator = Estimator::new(settings(
        Initialisation::Global,
        Refinement::MaximumLikelihood,
    ));
    let mut random = ChaCha8Rng::seed_from_u64(31);
    let mut wrong = 0;
    for frame in 0..4000 {
        let scene = random_attitude_scene(&mut random, 6);
        let observations = scene.noisy_observations(0.5, &mut random);
        let truth = oracle_maximum_likelihood(
            scene.camera(),
            &observations,
            scene.truth_camera_from_tanker(),
        )
        .expect("the oracle settles");
        match estimator.estimate(scene.camera(), &observations, None) {
            Ok(solution) if distance_squared(&solution, &truth) < SAME_MINIMUM => {}
            other => {
                println!("frame {frame}: {other:?}");
                wrong += 1;
            }
        }
    }
    println!("wrong minima among 4000 random attitudes: {wrong}");
    assert_eq!(wrong, 0);
}
