//! Targets that are nearly flat have a second pose, far away nearly as likely: a prior of the attitude tells them apart.

use nalgebra::{Point3, Vector3};
use rand::RngExt;
use rand_distr::{Distribution, Normal};
use rayon::prelude::*;
use tanker_pose::estimation::{Estimator, EstimatorSettings};
use tanker_pose::geometry::pose_error;
use tanker_pose::pipeline;
use tanker_pose::simulation::{Scene, paper_camera, pose_in_camera, trial_generator};
use tanker_pose::target::Marker;

const TRIALS: u32 = 2000;
const SIGMA_PX: f64 = 0.5;
const PRIOR_DEG: f64 = 5.0;

/// Markers in a plane across the line of sight, but for 30 cm: the hardest view.
const MARKERS: [[f64; 3]; 8] = [
    [3.7, -7.13, 0.7],
    [3.7, 7.13, 0.7],
    [3.6, -2.689, 0.7],
    [3.8, 2.689, 0.7],
    [3.7, -4.5, 1.9],
    [3.7, 4.5, 1.9],
    [3.85, 0.0, -1.0],
    [3.55, 0.0, 3.189],
];

#[derive(Default)]
struct Tally {
    answered: u32,
    wrong: u32,
    nees: f64,
}

/// Relative attitudes of the tanker.
#[derive(Clone, Copy)]
enum Attitudes {
    /// Within ±5° about each axis, as refuelling keeps them.
    Held,
    /// As the prior says: one in three beyond 5°, one in three hundred beyond 15°.
    Drawn,
}

fn tally(range_m: u16, attitudes: Attitudes, attitude_sigma_rad: Option<f64>) -> Tally {
    let estimator = Estimator::new(EstimatorSettings {
        attitude_sigma_rad,
        ..EstimatorSettings::default()
    });
    let markers: Vec<Marker> = (1..)
        .zip(MARKERS)
        .map(|(id, [x, y, z])| Marker {
            id,
            marker_in_tanker: Point3::new(x, y, z),
        })
        .collect();
    (0..TRIALS)
        .into_par_iter()
        .map(|trial| {
            let mut random = trial_generator(31, range_m, 0, trial);
            let angle = Normal::new(0.0, PRIOR_DEG).expect("a sigma");
            let [roll, pitch, yaw] = [(); 3].map(|()| match attitudes {
                Attitudes::Held => random.random_range(-PRIOR_DEG..PRIOR_DEG),
                Attitudes::Drawn => angle.sample(&mut random),
            });
            let place = Vector3::new(f64::from(range_m), 0.0, 0.3 * f64::from(range_m));
            let truth = pose_in_camera(place, roll, pitch, yaw);
            let scene = Scene::with_markers(paper_camera(), markers.clone(), truth);
            let seen = scene.noisy_observations(SIGMA_PX, &mut random);
            let outcome = pipeline::solve(&estimator, scene.camera(), &seen, None);
            let Ok(found) = outcome.result else {
                return Tally::default();
            };
            let error = pose_error(&found.camera_from_tanker, &truth);
            let squared = found.covariance.mahalanobis_squared(&error);
            let nees = squared.expect("positive definite");
            Tally {
                answered: 1,
                wrong: u32::from(nees > 30.0),
                nees,
            }
        })
        .reduce(Tally::default, |a, b| Tally {
            answered: a.answered + b.answered,
            wrong: a.wrong + b.wrong,
            nees: a.nees + b.nees,
        })
}

#[test]
fn a_prior_of_the_attitude_answers_frames_of_flat_targets_and_is_not_wrong() {
    for attitudes in [Attitudes::Held, Attitudes::Drawn] {
        for range_m in [40, 50, 60, 70] {
            let sigmas = [None, Some(PRIOR_DEG.to_radians())];
            let [without, with] = sigmas.map(|sigma| tally(range_m, attitudes, sigma));
            let kind = match attitudes {
                Attitudes::Held => "within 5°",
                Attitudes::Drawn => "drawn from the prior",
            };
            for (name, tally) in [("without", &without), ("with", &with)] {
                println!(
                    "flat target at {range_m} m, attitudes {kind}, {name} a prior: answered {:.2} %, wrong {}, NEES {:.2}",
                    100.0 * f64::from(tally.answered) / f64::from(TRIALS),
                    tally.wrong,
                    tally.nees / f64::from(tally.answered)
                );
            }
            assert!(100 * with.answered >= 99 * TRIALS, "{}", with.answered);
            assert!(without.answered < with.answered);
            // Attitudes far out in the prior's tails are taken for others, one in a thousand.
            let most_wrong = match attitudes {
                Attitudes::Held => 0,
                Attitudes::Drawn => 4,
            };
            assert!(with.wrong <= most_wrong, "{}", with.wrong);
        }
    }
}
