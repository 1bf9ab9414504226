//! Poses of another approach, by a map and a camera as they were written.

use nalgebra::{Matrix6, Vector6};
use tanker_pose::calibration::Calibration;
use tanker_pose::camera::{CalibrationBudget, CameraInfo};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{Estimator, EstimatorSettings, Expected};
use tanker_pose::pipeline::{error_budget, modes_of_file};

use super::{World, observations};

/// Returns the mean NEES of three poses.
pub fn pose_nees(world: &World, found: &Calibration) -> f64 {
    let mut camera = world.believed_camera.clone();
    let mut modes = Vec::new();
    if let Some(of_camera) = &found.camera {
        camera = camera.with_change(&of_camera.change);
        let (info, _) = CameraInfo::from_yaml(
            include_str!("../../config/cameras/paper.yaml"),
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
        let seen = observations(&camera, map, &frame.detections);
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
