//! Maps, cameras and mounts from simulated recordings, against their own predictions.
//!
//! Bounds follow from the number of trials: the mean over N trials of a normalised squared error of n components is 1 with
//! a standard error of sqrt(2 / (n N)); four of them are allowed.

mod calibration_worlds;

use calibration_worlds::{Plan, World};
use nalgebra::{Matrix6, UnitQuaternion, Vector6};
use rayon::prelude::*;
use tanker_pose::calibration::Calibration;
use tanker_pose::camera::CalibrationBudget;
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{Estimator, EstimatorSettings, Expected};
use tanker_pose::pipeline::{error_budget, modes_of_file};

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
            let turn =
                mount.camera_from_receiver * tanker_pose::geometry::optical_from_body().inverse();
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
        let (info, _) = tanker_pose::camera::CameraInfo::from_yaml(
            include_str!("../config/cameras/paper.yaml"),
            "paper.yaml",
        )
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

fn assert_poses_are_honest(what: &str, plan: Plan, count: u64) {
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
    assert!((5.5..6.5).contains(&mean), "{what}: {mean} ± {error}");
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map() {
    assert_poses_are_honest("markers", Plan::default(), 400);
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map_and_camera() {
    let plan = Plan {
        focal_length: 0.01,
        intrinsics: true,
        ..Plan::default()
    };
    assert_poses_are_honest("markers and focal length", plan, 400);
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
