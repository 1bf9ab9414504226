//! At the paper's pose (section 4.1) the estimate is as good as the Cramér–Rao bound allows, and its
//! covariance says so.
//!
//! Bounds follow from the number of trials: with N = 4000 the standard error of an RMSE is
//! 1/sqrt(2 N) = 1.1 % (0.96–1.04 is 3.6 of them), that of a mean NEES sqrt(12/N) = 0.055 (5.8–6.2),
//! that of a 95 % coverage 0.34 % (94–96 %).

mod support;

use nalgebra::Vector6;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use support::{distance_squared, oracle_maximum_likelihood, settings};
use tanker_pose::estimation::{Estimator, Initialisation, Refinement};
use tanker_pose::geometry::pose_error;
use tanker_pose::simulation::{cramer_rao_bound, paper_scene};

const TRIALS: usize = 4000;
/// 95 % quantile of chi-squared with six degrees of freedom.
const CHI_SQUARED_6_95: f64 = 12.591_587;

struct Statistics {
    rmse_over_bound: Vector6<f64>,
    mean_nees: f64,
    coverage_95: f64,
    trusted: f64,
}

fn monte_carlo(refinement: Refinement, sigma_px: f64, seed: u64) -> Statistics {
    let scene = paper_scene();
    let estimator = Estimator::new(settings(Initialisation::Nominal, refinement));
    let bound = cramer_rao_bound(&scene, sigma_px).expect("six points fix the pose");
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut squares = Vector6::zeros();
    let (mut nees_sum, mut covered, mut trusted) = (0.0, 0_usize, 0_usize);
    for _ in 0..TRIALS {
        let observations = scene.noisy_observations(sigma_px, &mut random);
        let solution = estimator
            .estimate(scene.camera(), &observations, None)
            .expect("a solvable frame");
        let error = pose_error(
            scene.truth_camera_from_tanker(),
            &solution.camera_from_tanker,
        );
        let nees = solution
            .covariance
            .mahalanobis_squared(&error)
            .expect("positive definite");
        squares += error.component_mul(&error);
        nees_sum += nees;
        covered += usize::from(nees < CHI_SQUARED_6_95);
        trusted += usize::from(solution.is_trusted());
    }
    let n = TRIALS as f64;
    let statistics = Statistics {
        rmse_over_bound: (squares / n)
            .zip_map(&bound.0.diagonal(), |mse, bound| (mse / bound).sqrt()),
        mean_nees: nees_sum / n,
        coverage_95: covered as f64 / n,
        trusted: trusted as f64 / n,
    };
    println!(
        "{refinement:?}, {sigma_px} px: RMSE / bound {:.3?}, NEES {:.3}, coverage {:.2} %, trusted {:.2} %",
        statistics.rmse_over_bound.as_slice(),
        statistics.mean_nees,
        100.0 * statistics.coverage_95,
        100.0 * statistics.trusted
    );
    statistics
}

fn assert_consistent(statistics: &Statistics) {
    assert!(
        (5.8..=6.2).contains(&statistics.mean_nees),
        "mean NEES {}",
        statistics.mean_nees
    );
    assert!(
        (0.94..=0.96).contains(&statistics.coverage_95),
        "coverage {}",
        statistics.coverage_95
    );
    // Four standard errors of a share of 0.999 among 4000, one-sided.
    assert!(statistics.trusted > 0.997, "trusted {}", statistics.trusted);
}

#[test]
fn maximum_likelihood_meets_the_bound_with_an_honest_covariance() {
    for (sigma_px, seed) in [(0.5, 1), (2.0, 2)] {
        let statistics = monte_carlo(Refinement::MaximumLikelihood, sigma_px, seed);
        for (axis, ratio) in statistics.rmse_over_bound.iter().enumerate() {
            assert!(
                (0.96..=1.04).contains(ratio),
                "axis {axis} at {sigma_px} px: {ratio}"
            );
        }
        assert_consistent(&statistics);
    }
}

#[test]
fn orthogonal_iteration_has_an_honest_sandwich_covariance() {
    for (sigma_px, seed) in [(0.5, 3), (2.0, 4)] {
        assert_consistent(&monte_carlo(Refinement::None, sigma_px, seed));
    }
}

#[test]
fn maximum_likelihood_agrees_with_an_independent_fit() {
    let scene = paper_scene();
    let estimator = Estimator::new(settings(
        Initialisation::Nominal,
        Refinement::MaximumLikelihood,
    ));
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut worst = 0.0_f64;
    for trial in 0..500 {
        let mut observations = scene.noisy_observations(1.0, &mut random);
        // Different sigmas, so that the weights are tested too.
        for (i, seen) in observations.iter_mut().enumerate() {
            seen.sigma_px = 0.3 + 0.4 * ((i + trial) % 4) as f64;
        }
        let solution = estimator
            .estimate(scene.camera(), &observations, None)
            .expect("solvable");
        let oracle = oracle_maximum_likelihood(
            scene.camera(),
            &observations,
            scene.truth_camera_from_tanker(),
        )
        .expect("the oracle settles");
        worst = worst.max(distance_squared(&solution, &oracle).sqrt());
    }
    println!("largest distance to the independent fit: {worst:.1e} sigma");
    assert!(
        worst < 2e-3,
        "off by {worst} sigma; convergence promises 1e-3"
    );
}
