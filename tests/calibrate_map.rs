//! Maps, cameras and mounts from simulated recordings, against their own predictions.
//!
//! Bounds follow from the number of trials: the mean over N trials of a normalised squared error of n components is 1 with
//! a standard error of sqrt(2 / (n N)); four of them are allowed.

mod calibration_worlds;

use calibration_worlds::{Plan, SURVEY_M, World, normal, normals};
use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tanker_pose::calibration::{
    Calibration, CalibrationSettings, Movement, RecordedFrame, calibrate,
};
use tanker_pose::camera::{CalibrationBudget, CameraInfo};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{Estimator, EstimatorSettings, Expected};
use tanker_pose::geometry::optical_from_body;
use tanker_pose::pipeline::{error_budget, modes_of_file, observe};
use tanker_pose::simulation::{Approach, ApproachSettings, paper_camera};
use tanker_pose::target::MarkerMap;

fn trials(count: u64, plan: Plan) -> Vec<(World, Calibration)> {
    (0..count)
        .into_par_iter()
        .map(|seed| {
            let world = World::new(seed + 1, plan);
            let found = world.calibrate();
            (world, found)
        })
        .collect()
}

/// Asserts that squares over their variances have mean 1.
fn assert_consistent(what: &str, squares: &[f64], components: usize) {
    let count = squares.len() as f64;
    let mean = squares.iter().sum::<f64>() / (count * components as f64);
    let bound = 4.0 * (2.0 / (count * components as f64)).sqrt();
    println!("{what}: {mean:.3}, allowed 1 ± {bound:.3}");
    assert!((mean - 1.0).abs() < bound, "{what}: {mean}");
}

fn marker_squares(trials: &[(World, Calibration)]) -> Vec<f64> {
    trials
        .iter()
        .map(|(world, found)| {
            let errors = world.marker_errors(found);
            let factor = found.map.covariance.clone().cholesky();
            errors.dot(&factor.expect("positive definite").solve(&errors))
        })
        .collect()
}

#[test]
fn markers_off_by_5_cm_are_found_within_their_predicted_covariance() {
    let trials = trials(60, Plan::default());
    assert_consistent("markers", &marker_squares(&trials), 24);
    // And it is worth it: what images tell of the shape becomes much better than the survey.
    let rms = |errors: &nalgebra::DVector<f64>| errors.norm_squared() / errors.len() as f64;
    let before: f64 = trials
        .iter()
        .map(|(world, _)| {
            let pairs = world.truth.markers().iter().zip(world.believed.markers());
            pairs
                .map(|(a, b)| (a.marker_in_tanker - b.marker_in_tanker).norm_squared())
                .sum::<f64>()
                / 24.0
        })
        .sum();
    let after: f64 = trials
        .iter()
        .map(|(world, found)| rms(&world.marker_errors(found)))
        .sum();
    println!(
        "rms {:.1} -> {:.1} mm",
        1e3 * (before / 60.0).sqrt(),
        1e3 * (after / 60.0).sqrt()
    );
    assert!(after < 0.6 * before, "{before} -> {after}");
}

#[test]
fn wrong_detections_change_nothing() {
    let plan = Plan {
        wrong_every: Some(6),
        ..Plan::default()
    };
    let trials = trials(60, plan);
    assert_consistent(
        "markers, with wrong detections",
        &marker_squares(&trials),
        24,
    );
}

#[test]
fn a_focal_length_off_by_1_percent_is_found_within_its_sigma() {
    let plan = Plan {
        focal_length: 0.01,
        intrinsics: true,
        ..Plan::default()
    };
    let trials = trials(60, plan);
    let squares: Vec<f64> = trials
        .iter()
        .map(|(world, found)| {
            let camera = found.camera.as_ref().expect("it has a sigma");
            assert!(camera.is_moved);
            let parameter = found
                .parameters
                .iter()
                .find(|p| p.name == "focal_length")
                .expect("one");
            let sigma = parameter.sigma_after * 0.01;
            ((world.focal_error - camera.change[0]) / sigma).powi(2)
        })
        .collect();
    assert_consistent("focal length", &squares, 1);
    assert_consistent(
        "markers, with a wrong focal length",
        &marker_squares(&trials),
        24,
    );
}

#[test]
fn a_mount_off_by_1_degree_is_found_as_far_as_the_attitudes_allow() {
    let plan = Plan {
        mount_deg: 1.0,
        attitude_bias_deg: 0.4,
        ..Plan::default()
    };
    let squares: Vec<f64> = trials(60, plan)
        .iter()
        .map(|(world, found)| {
            let mount = found.mount.as_ref().expect("asked for");
            assert!(mount.is_moved);
            let turn = mount.camera_from_receiver * optical_from_body().inverse();
            let turn = UnitQuaternion::from_rotation_matrix(&turn).scaled_axis();
            let off = world.mount_error - turn;
            (0..3)
                .map(|axis| (off[axis] / mount.sigma_rad[axis]).powi(2))
                .sum()
        })
        .collect();
    assert_consistent("mount", &squares, 3);
}

/// Mean NEES of poses of another approach, of a map and camera as written.
fn pose_nees(world: &World, found: &Calibration) -> f64 {
    let mut camera = world.believed_camera.clone();
    let mut modes = Vec::new();
    if let Some(of_camera) = &found.camera {
        camera = camera.with_change(&of_camera.change);
        let (info, _) =
            CameraInfo::from_yaml(include_str!("../config/cameras/paper.yaml"), "paper.yaml")
                .expect("shipped");
        let info = info.with_change(&world.believed_camera, &of_camera.change);
        let text = info.budget_to_yaml(&camera, &of_camera.covariance);
        let file = CalibrationBudget::from_yaml(&text, "written").expect("what is written is read");
        modes = modes_of_file(&file, &info, &camera).expect("the same lens");
    }
    let map = &found.map.map;
    let budget = error_budget(map.budget(), &CalibrationSigmas::default(), &modes);
    let estimator = Estimator::new(EstimatorSettings::default()).with_budget(budget);
    let approach = world.approach(world.seed + 1_000_000);
    let count = approach.frame_count();
    let mut nees = Vec::new();
    for index in [0, count / 2, count - 1] {
        let frame = approach.frame(index);
        let seen = world.observations(&camera, map, &frame.detections);
        let solution = estimator
            .estimate_expecting(&camera, &seen, &Expected::default())
            .expect("a pose");
        let truth = &frame.truth_camera_from_tanker;
        let pose = &solution.camera_from_tanker;
        let turn = truth.rotation * pose.rotation.inverse();
        let mut error = Vector6::zeros();
        let shift = truth.translation.vector - pose.translation.vector;
        error.fixed_rows_mut::<3>(0).copy_from(&shift);
        error.fixed_rows_mut::<3>(3).copy_from(&turn.scaled_axis());
        let covariance: Matrix6<f64> = solution.covariance.0;
        let factor = covariance.cholesky().expect("positive definite");
        nees.push(error.dot(&factor.solve(&error)));
    }
    nees.iter().sum::<f64>() / nees.len() as f64
}

/// Not better than the written files claim; they claim less than is known, as docs/calibrate-map.md says.
fn assert_poses_are_honest(what: &str, plan: Plan, count: u64, allowed: std::ops::Range<f64>) {
    let nees: Vec<f64> = (0..count)
        .into_par_iter()
        .map(|seed| {
            let world = World::new(seed + 5000, plan);
            pose_nees(&world, &world.calibrate())
        })
        .collect();
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    let variance = nees.iter().map(|n| (n - mean).powi(2)).sum::<f64>() / nees.len() as f64;
    let error = (variance / nees.len() as f64).sqrt();
    println!("{what}: NEES of poses of another approach {mean:.2} ± {error:.2}");
    assert!(allowed.contains(&mean), "{what}: {mean} ± {error}");
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map() {
    assert_poses_are_honest("markers", Plan::default(), 400, 4.4..6.3);
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map_and_camera() {
    let plan = Plan {
        focal_length: 0.01,
        intrinsics: true,
        ..Plan::default()
    };
    assert_poses_are_honest("markers and focal length", plan, 400, 4.0..6.3);
}

#[test]
fn the_detectors_sigma_is_found() {
    let plan = Plan {
        sigma_px: 0.8,
        rate_hz: 8.0,
        ..Plan::default()
    };
    let (_, found) = &trials(1, plan)[0];
    let noise = &found.noise;
    println!(
        "sigma {:.3} ± {:.3}, factor {:.3}",
        noise.sigma_px, noise.sigma_error_px, noise.factor_of_stated
    );
    assert!(
        (noise.sigma_px - 0.8).abs() < 4.0 * noise.sigma_error_px,
        "{noise:?}"
    );
    assert!(noise.in_time.is_none(), "{noise:?}");
}

#[test]
fn noise_that_lasts_is_found_and_does_not_make_markers_surer_than_they_are() {
    let plan = Plan {
        noise_time_constant_s: 1.0,
        rate_hz: 4.0,
        ..Plan::default()
    };
    let trials = trials(40, plan);
    let (mut shares, mut times) = (0.0, 0.0);
    for (_, found) in &trials {
        let lasting = found.noise.in_time.expect("it lasts");
        shares += lasting.share / 40.0;
        times += lasting.time_constant_s / 40.0;
    }
    println!("share {shares:.2}, time constant {times:.2} s");
    assert_consistent(
        "markers, with noise that lasts",
        &marker_squares(&trials),
        24,
    );
}

#[test]
fn what_the_data_cannot_tell_is_not_moved() {
    let mut world = World::new(3, Plan::default());
    for frame in &mut world.frames {
        frame.observations.retain(|seen| seen.id != 8);
    }
    let found = world.calibrate();
    let of_unseen: Vec<_> = found
        .parameters
        .iter()
        .filter(|p| p.name.starts_with("marker 8 "))
        .collect();
    assert_eq!(of_unseen.len(), 3);
    for parameter in of_unseen {
        assert_eq!(parameter.movement, Movement::NotSupported, "{parameter:?}");
    }
    assert_eq!(found.map.map.get(8), world.believed.get(8));
    let (_, sigma_m) = found.map.map.budget().survey_sigma_m[7];
    assert!(sigma_m >= SURVEY_M, "{sigma_m}");

    let seven = World::new(3, Plan::default()).calibrate().gauge;
    assert_eq!(seven.len(), 7);
    for mode in seven {
        assert!(!mode.told, "{mode:?}");
    }
}

#[test]
fn a_focal_length_that_is_known_better_than_the_data_tell_it_stays() {
    let plan = Plan {
        focal_length: 0.0001,
        intrinsics: true,
        ..Plan::default()
    };
    let found = World::new(4, plan).calibrate();
    let camera = found.camera.expect("it has a sigma");
    assert!(!camera.is_moved);
    assert!(camera.change.norm() == 0.0);
}

#[test]
fn without_being_asked_for_a_camera_is_estimated_but_stays() {
    let plan = Plan {
        focal_length: 0.01,
        ..Plan::default()
    };
    let trials = trials(60, plan);
    for (_, found) in &trials {
        assert!(!found.camera.as_ref().expect("it has a sigma").is_moved);
    }
    assert_consistent(
        "markers, focal length not asked for",
        &marker_squares(&trials),
        24,
    );
}

#[test]
fn a_mount_stays_without_attitudes_and_where_they_are_worse_than_what_is_known_of_it() {
    let plan = Plan {
        mount_deg: 1.0,
        attitude_bias_deg: 3.0,
        ..Plan::default()
    };
    let mut world = World::new(5, plan);
    let reason = |found: &Calibration| {
        let mount = found.mount.as_ref().expect("asked for");
        assert!(!mount.is_moved);
        let turn = mount.camera_from_receiver * optical_from_body().inverse();
        assert!(turn.angle() < 1e-12);
        let of_mount = found
            .parameters
            .iter()
            .find(|p| p.name.starts_with("mount"));
        of_mount.map(|parameter| parameter.movement)
    };
    assert_eq!(reason(&world.calibrate()), Some(Movement::NotSupported));
    for frame in &mut world.frames {
        frame.receiver_from_tanker = None;
    }
    assert_eq!(reason(&world.calibrate()), Some(Movement::NoAttitudes));
}

#[test]
fn a_written_map_claims_no_less_than_its_covariance_in_any_direction() {
    let plan = Plan {
        focal_length: 0.01,
        intrinsics: true,
        ..Plan::default()
    };
    for (world, found) in trials(10, plan) {
        let map = &found.map;
        let mut claimed = nalgebra::DMatrix::zeros(24, 24);
        let budget = map.map.budget();
        for (row, (_, sigma_m)) in budget.survey_sigma_m.iter().enumerate() {
            for axis in 0..3 {
                claimed[(3 * row + axis, 3 * row + axis)] = sigma_m.powi(2);
            }
        }
        for mode in &budget.flex {
            let shape = mode
                .shape
                .iter()
                .flat_map(|(_, shift)| shift.iter().copied());
            let shift = nalgebra::DVector::from_iterator(24, shape) * mode.sigma_m;
            claimed += &shift * shift.transpose();
        }
        let least = (claimed - &map.covariance).symmetric_eigenvalues().min();
        assert!(least > -1e-12, "seed {}: {least} m²", world.seed);
    }
}

#[test]
fn growth_of_the_sigma_with_range_is_found() {
    let plan = Plan {
        sigma_px: 1e-6,
        rate_hz: 8.0,
        ..Plan::default()
    };
    let mut world = World::new(6, plan);
    let approach = world.approach(6);
    let mut random = ChaCha8Rng::seed_from_u64(66);
    for (index, frame) in (0..).zip(&mut world.frames) {
        let truth = approach.frame(index).truth_camera_from_tanker;
        let sigma_px = 0.02 * truth.translation.vector.norm();
        for seen in &mut frame.observations {
            seen.pixel.u += sigma_px * normal(&mut random);
            seen.pixel.v += sigma_px * normal(&mut random);
        }
    }
    let noise = world.calibrate().noise;
    let (exponent, error) = noise.growth_exponent.expect("several ranges");
    println!("exponent {exponent:.2} ± {error:.2}");
    // Bins are half an octave wide: the sigma within one is that of its own frames, not that of its middle.
    assert!((exponent - 1.0).abs() < 4.0 * error.max(0.05), "{noise:?}");
    assert!(noise.sigma_to_state_px() > noise.sigma_px);
}

/// Four tags; the corners of each have most of their noise in common.
#[test]
fn correlation_between_corners_of_a_tag_is_found() {
    const TAGS: &str = "name: tagged
sigma: 0.02
tags:
  - {id: 1, size_m: 1.0, x: 3.7, y: -5, z: 0.7, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 2, size_m: 1.0, x: 3.7, y: 5, z: 0.7, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 3, size_m: 1.0, x: 7.8, y: 0, z: 3.2, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
  - {id: 4, size_m: 1.0, x: 0, y: 0, z: 0, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
";
    let map = MarkerMap::from_yaml(TAGS, "tags").expect("a good map");
    let settings = ApproachSettings {
        rate_hz: 8.0,
        start_range_m: 40.0,
        sigma_px: 0.0,
        ..ApproachSettings::default()
    };
    let camera = paper_camera();
    let approach = Approach::new(settings, camera.clone(), map.clone());
    let mut random = ChaCha8Rng::seed_from_u64(9);
    // 0.4 px in common and 0.3 px of their own: 0.5 px, correlated by 0.64.
    let frames: Vec<RecordedFrame> = (0..approach.frame_count())
        .map(|index| {
            let frame = approach.frame(index);
            let mut seen =
                observe(&camera, &frame.detections, 0.5, |id| map.get(id)).expect("good");
            for tag in 1..=4 {
                let common = normals(&mut random) * 0.4;
                for corner in seen.iter_mut().filter(|seen| seen.id / 10 == tag) {
                    corner.pixel.u += common.x + 0.3 * normal(&mut random);
                    corner.pixel.v += common.y + 0.3 * normal(&mut random);
                }
            }
            RecordedFrame {
                time_s: frame.time_s,
                observations: seen,
                receiver_from_tanker: None,
            }
        })
        .collect();
    let budget = error_budget(map.budget(), &CalibrationSigmas::default(), &[]);
    let estimator = Estimator::new(EstimatorSettings::default()).with_budget(budget);
    let found = calibrate(
        &camera,
        &map,
        &estimator,
        &frames,
        &CalibrationSettings::default(),
    );
    let noise = found.expect("calibrated").noise;
    let corners = noise.between_corners.expect("there are tags");
    println!(
        "corners {:.2} ± {:.2}, sigma {:.2}",
        corners.correlation, corners.error, noise.sigma_px
    );
    assert!((corners.correlation - 0.64).abs() < 0.1, "{corners:?}");
    assert!(noise.sigma_to_state_px() > 1.4 * noise.sigma_px);
}
