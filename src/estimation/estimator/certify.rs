//! The certificate of a solution, and the search for a better pose where there is no proof.

use nalgebra::Rotation3;
use smallvec::SmallVec;

use super::leave_out::MAX_TURN_FROM_PRIOR;
use super::{Estimator, Judged, PRIOR_SIGMA, squared_turn};
use crate::camera::Camera;
use crate::estimation::ambiguity::{is_same, likelihood_ratio};
use crate::estimation::budget::{ErrorBudget, FrameBudget};
use crate::estimation::initialise;
use crate::estimation::lanes::points::INLINE_POINTS;
use crate::estimation::problem::{NEGLIGIBLE, Problem, Room};
use crate::estimation::refine::Fit;
use crate::estimation::{Certificate, Expected, Initialisation, Observation, Solution};

impl Estimator {
    /// Sets the certificate of a solution, and replaces the solution if a better pose is found.
    ///
    /// # Inputs
    /// * `observations`: all that were given to the estimator, including those that the solution excludes.
    /// * `expected`: as it was given to the estimator.
    pub(super) fn certify(
        &self,
        camera: &Camera,
        observations: &[Observation],
        expected: &Expected,
        solution: &mut Solution,
    ) {
        let mut used: SmallVec<[Observation; INLINE_POINTS]> = SmallVec::new();
        let observations = if solution.excluded.ids().next().is_none() {
            observations
        } else {
            let is_used = |seen: &&Observation| !solution.excluded.contains(seen.id);
            used.extend(observations.iter().filter(is_used).copied());
            &used
        };
        let mut room = Room::new();
        let prior = self.attitude_prior(expected);
        let is_exact = prior.is_none() && self.budget.as_ref().is_none_or(ErrorBudget::is_empty);
        let refinement = self.settings().refinement;
        // Cannot fail: the solution was computed from the same problem.
        let Ok(problem) = Problem::new(camera, refinement, observations, &mut room) else {
            solution.certificate = Some(Certificate::NotCertified);
            return;
        };
        if problem.is_best_in_front(&rotation_of(solution)) {
            solution.certificate = Some(Certificate::Certified);
            return;
        }
        let likely = self.likely_rotation(expected);
        if is_exact {
            self.search_for_better(&problem, likely, solution);
        } else {
            let mut doubts = FrameBudget::new(prior);
            doubts.fill(self.budget.as_ref(), camera, observations, &problem.points);
            self.search_for_better(&problem.in_doubt(&doubts), likely, solution);
        }
    }

    /// Searches all attitudes, and replaces the solution by the best pose found if [`merit`] prefers it.
    #[cold]
    fn search_for_better(
        &self,
        problem: &Problem,
        likely: &Rotation3<f64>,
        solution: &mut Solution,
    ) {
        solution.certificate = Some(Certificate::NotCertified);
        let Ok(own) = problem.fit(&rotation_of(solution)) else {
            return;
        };
        let merit = |fit: &Fit| merit(fit, likely, solution.initialisation);
        let minima = initialise::search(problem);
        let mut better: Option<Fit> = None;
        for minimum in minima.in_front.iter().flatten() {
            let least = problem.least_chi_squared(minimum);
            if least.is_some_and(|least| least > own.chi_squared + NEGLIGIBLE) {
                continue;
            }
            let Ok(fit) = problem.fit(&minimum.rotation) else {
                continue;
            };
            if is_same(&fit.pose.rotation, &own.pose.rotation) {
                continue;
            }
            let ratio = likelihood_ratio(fit.chi_squared, own.chi_squared);
            solution.ambiguity = solution.ambiguity.max(ratio);
            let least = better.as_ref().map_or_else(|| merit(&own), merit);
            if merit(&fit) < least {
                better = Some(fit);
            }
        }
        let Some(better) = better else {
            return;
        };
        let judged = Judged {
            fit: &better,
            ambiguity: likelihood_ratio(own.chi_squared, better.chi_squared),
            iterations: solution.iterations.saturating_add(better.iterations),
            initialisation: Initialisation::Global,
        };
        if let Ok(replacement) = self.judge(problem, &judged) {
            let is_proven = problem.is_best_in_front(&better.pose.rotation);
            *solution = Solution {
                certificate: Some(if is_proven {
                    Certificate::Replaced
                } else {
                    Certificate::NotCertified
                }),
                excluded: solution.excluded,
                unclear: solution.unclear,
                // Of all points, where this is a fit of all.
                chi_squared_of_all: if solution.excluded.ids().next().is_none() {
                    replacement.chi_squared
                } else {
                    solution.chi_squared_of_all
                },
                ..replacement
            };
        }
    }
}

/// Returns what decides between two poses, less is better: chi-squared, and for starts that have a prior the rotation
/// from the likely attitude, the nominal one or that which both aircraft report.
///
/// As between the two poses of a flat target, that attitude counts, the last one does not: it may have been wrong. Beyond
/// the angle that is allowed to hypotheses about wrong points the value is infinite: a search over all attitudes also
/// finds some that fit wrong detections.
fn merit(fit: &Fit, likely: &Rotation3<f64>, start: Initialisation) -> f64 {
    let turn = squared_turn(&fit.pose.rotation, Some(likely));
    match start {
        Initialisation::Dlt | Initialisation::Global => fit.chi_squared,
        _ if turn > (MAX_TURN_FROM_PRIOR / PRIOR_SIGMA).powi(2) => f64::INFINITY,
        Initialisation::Nominal => fit.chi_squared + turn,
        Initialisation::Previous => fit.chi_squared,
    }
}

fn rotation_of(solution: &Solution) -> Rotation3<f64> {
    solution.camera_from_tanker.rotation.to_rotation_matrix()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::{EstimatorSettings, Refinement};
    use crate::simulation::{Scene, paper_camera};
    use crate::target::Marker;
    use nalgebra::{Isometry3, Point3, Quaternion, Translation3, UnitQuaternion, Vector3, Vector4};
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn estimator(refinement: Refinement, nominal: Rotation3<f64>) -> Estimator {
        Estimator::new(EstimatorSettings {
            initialisation: Initialisation::Global,
            refinement,
            nominal_camera_from_tanker: nominal,
            min_points: 4,
            max_outliers: 0,
            certify: true,
            ..EstimatorSettings::default()
        })
    }

    /// Four or five points in a cube, at any attitude: of their minima in front not all are each other's mirror image.
    fn scene(random: &mut ChaCha8Rng) -> Scene {
        let count = random.random_range(4..=5);
        let marker = |id| Marker {
            id,
            marker_in_tanker: Point3::from(Vector3::from_fn(|_, _| random.random_range(-4.0..4.0))),
        };
        let markers = (1..=count).map(marker).collect();
        let pose = Isometry3::from_parts(
            Translation3::new(0.0, 0.0, random.random_range(8.0..40.0)),
            UnitQuaternion::from_rotation_matrix(&random_rotation(random)),
        );
        Scene::with_markers(paper_camera(), markers, pose)
    }

    fn random_rotation(random: &mut ChaCha8Rng) -> Rotation3<f64> {
        let q = Vector4::from_fn(|_, _| StandardNormal.sample(random));
        UnitQuaternion::from_quaternion(Quaternion::from(q)).to_rotation_matrix()
    }

    #[derive(Debug, Default)]
    struct Count {
        certified: usize,
        not_certified: usize,
        replaced: usize,
        kept_though_worse: usize,
    }

    /// Certifies poses that descents from random attitudes lead to. They skip the comparison with the mirror image that
    /// every start of the estimator makes and that already avoids nearly all false starts.
    fn starts_from_anywhere(
        start: Initialisation,
        refinement: Refinement,
        nominal_from_truth: Rotation3<f64>,
        seed: u64,
    ) -> Count {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let mut count = Count::default();
        for _ in 0..1200 {
            let scene = scene(&mut random);
            let seen = scene.noisy_observations(0.5, &mut random);
            let truth = scene.truth_camera_from_tanker().rotation;
            let nominal = truth.to_rotation_matrix() * nominal_from_truth;
            let estimator = estimator(refinement, nominal);
            let camera = scene.camera();
            let mut room = Room::new();
            let problem = Problem::new(camera, refinement, &seen, &mut room).expect("a frame");
            let seed = random_rotation(&mut random);
            let there = problem.descend(&seed);
            let Ok(fit) = there.and_then(|minimum| problem.fit(&minimum.rotation)) else {
                continue;
            };
            let judged = Judged {
                fit: &fit,
                ambiguity: 0.0,
                iterations: fit.iterations,
                initialisation: start,
            };
            let Ok(first) = estimator.judge(&problem, &judged) else {
                continue;
            };
            let best = estimator.estimate(camera, &seen, None).expect("a pose");
            let is_best =
                |solution: &Solution| is_same(&rotation_of(solution), &rotation_of(&best));
            let mut solution = first.clone();
            let expected = Expected {
                previous: Some(&seed),
                reported: None,
            };
            estimator.certify(camera, &seen, &expected, &mut solution);
            match solution.certificate.expect("it was asked for") {
                Certificate::Certified => {
                    count.certified += 1;
                    assert!(is_best(&solution));
                    let certificate = solution.certificate;
                    assert_eq!(
                        solution,
                        Solution {
                            certificate,
                            ..first
                        }
                    );
                }
                Certificate::NotCertified => {
                    count.not_certified += 1;
                    count.kept_though_worse += usize::from(!is_best(&solution));
                }
                Certificate::Replaced => {
                    count.replaced += 1;
                    assert!(!is_best(&first) && is_best(&solution));
                    assert_eq!(solution.initialisation, Initialisation::Global);
                    let (of_all, _) = solution.of_all_points();
                    assert_eq!(of_all.to_bits(), solution.chi_squared.to_bits());
                }
            }
        }
        println!("{start:?}, {refinement:?}: {count:?}");
        count
    }

    #[test]
    fn false_starts_are_replaced_by_what_a_search_finds() {
        for refinement in [Refinement::MaximumLikelihood, Refinement::None] {
            let nominal = Rotation3::identity();
            let count = starts_from_anywhere(Initialisation::Dlt, refinement, nominal, 50);
            assert!(count.replaced > 50 && count.certified > 300, "{count:?}");
            assert!(count.kept_though_worse < 3, "{count:?}");
        }
    }

    #[test]
    fn no_pose_far_from_the_nominal_attitude_replaces_one_of_a_start_with_a_prior() {
        let away = Rotation3::new(Vector3::new(0.0, 0.0, 1.0));
        for start in [Initialisation::Nominal, Initialisation::Previous] {
            let refinement = Refinement::MaximumLikelihood;
            let count = starts_from_anywhere(start, refinement, away, 51);
            assert_eq!(count.replaced, 0);
            assert!(count.kept_though_worse > 50, "{count:?}");
            let count = starts_from_anywhere(start, refinement, Rotation3::identity(), 51);
            assert!(count.replaced > 50, "{count:?}");
        }
    }
}
