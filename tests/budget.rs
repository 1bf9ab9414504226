//! Worlds drawn from an error budget: the covariance covers survey, flex, calibration and jitter as it covers noise.
//!
//! Bounds follow from the number of trials. With N = 2000 the standard error of a mean NEES of six axes is
//! sqrt(12/N) = 0.077 (5.7–6.3 is 3.9 of them), of three axes sqrt(6/N) = 0.055 (2.8–3.2: 3.7), that of a 95 % coverage
//! 0.49 % (93.5–96.5 %: 3.1). Among 126 lines the largest of so many deviations is about 2.9.

mod budgets;
mod drawn_worlds;
mod support;

use drawn_worlds::{Causes, EVERYTHING, SEED, SIGMA_PX, estimator, monte_carlo, worlds};
use nalgebra::{DMatrix, DVector, Matrix6, SMatrix, Vector3};
use support::tanker_markers;
use tanker_pose::camera::{CalibrationBudget, Camera, CameraInfo, Ray};
use tanker_pose::estimation::{
    CauseKind, ErrorBudget, Estimator, EstimatorSettings, Expected, Observation, Refinement,
    Solution,
};
use tanker_pose::geometry::skew;
use tanker_pose::pipeline::modes_of_file;
use tanker_pose::simulation::{World, paper_camera, pose_in_camera, trial_generator};
use tanker_pose::target::{Marker, MarkerMap};

#[test]
fn worlds_drawn_from_the_budget_are_covered() {
    for count in [6, 8, 12] {
        let markers = tanker_markers(count);
        for range_m in [15, 30, 60] {
            for (name, causes) in worlds() {
                let budget = causes.budget(&markers);
                let with_budget = estimator(budget.clone());
                let name = format!("{count:2} points, {range_m} m, {name}");
                let means =
                    monte_carlo(&markers, range_m, &budget, &with_budget, |_| {}).report(&name);
                assert!((5.7..6.3).contains(&means.nees), "{name}: {}", means.nees);
                assert!(
                    (2.8..3.2).contains(&means.nees_at_tail),
                    "{name}: {}",
                    means.nees_at_tail
                );
                for covered in [means.covered, means.covered_at_tail] {
                    assert!((93.5..96.5).contains(&covered), "{name}: {covered}");
                }
                assert!(means.trusted >= 99.5, "{name}: {}", means.trusted);
                assert!(means.beyond_30 <= 0.3, "{name}: {}", means.beyond_30);
            }
        }
    }
}

/// A longer lens with less distortion fits the same board.
const CORRELATED: &str = "covariance:
  parameters: [fx, fy, cx, cy, k1]
  data:
    - [9.0, 8.9, 0.3, 0.0, -0.054]
    - [8.9, 9.0, 0.3, 0.0, -0.054]
    - [0.3, 0.3, 4.0, 0.5, 0.0]
    - [0.0, 0.0, 0.5, 4.0, 0.0]
    - [-0.054, -0.054, 0.0, 0.0, 0.0004]
";

#[test]
fn correlated_covariance_of_a_calibration_is_covered() {
    let file = CalibrationBudget::from_yaml(CORRELATED, "c.yaml").expect("a good file");
    let paper = include_str!("../config/cameras/paper.yaml");
    let (info, _) = CameraInfo::from_yaml(paper, "paper.yaml").expect("a good file");
    let modes = modes_of_file(&file, &info, &paper_camera()).expect("the same lens");
    let budget = ErrorBudget::new(&[], vec![], modes, 0.5).expect("a budget");
    for count in [6, 12] {
        let markers = tanker_markers(count);
        for range_m in [15, 30] {
            let name = format!("{count:2} points, {range_m} m, covariance of the calibration");
            let with_budget = estimator(budget.clone());
            let means = monte_carlo(&markers, range_m, &budget, &with_budget, |_| {}).report(&name);
            assert!((5.7..6.3).contains(&means.nees), "{name}: {}", means.nees);
            assert!((93.5..96.5).contains(&means.covered), "{name}");
            assert!(means.trusted >= 99.5, "{name}: {}", means.trusted);
        }
    }
}

#[test]
fn a_bent_wing_is_covered_from_none_to_two_sigmas() {
    for count in [6, 12] {
        let markers = tanker_markers(count);
        let budget = Causes {
            flex_m: 0.3,
            ..Causes::default()
        }
        .budget(&markers);
        for flex_m in [0.0, 0.1, 0.3, 0.6] {
            let name = format!("{count:2} points, 15 m, tips up {flex_m} m");
            let set = |world: &mut World| world.set_flex(&[flex_m / 0.3]);
            let means =
                monte_carlo(&markers, 15, &budget, &estimator(budget.clone()), set).report(&name);
            assert!(means.nees <= 6.5, "{name}: {}", means.nees);
            assert!(means.trusted >= 99.5, "{name}: {}", means.trusted);
        }
    }
}

/// The paper's own estimate is not weighted by the budget, but its covariance knows it. Its residuals are not the least
/// ones, so that with a strong cause few frames pass the test; those have smaller errors than the others.
#[test]
fn orthogonal_iteration_is_covered_too() {
    let markers = tanker_markers(8);
    for (name, causes) in worlds() {
        let budget = causes.budget(&markers);
        let settings = EstimatorSettings {
            refinement: Refinement::None,
            ..EstimatorSettings::default()
        };
        let unrefined = Estimator::new(settings).with_budget(budget.clone());
        let name = format!(" 8 points, 15 m, {name}, OI");
        let means = monte_carlo(&markers, 15, &budget, &unrefined, |_| {}).report(&name);
        assert!(means.nees < 6.4, "{name}: {}", means.nees);
        assert!(means.trusted > 20.0, "{name}: {}", means.trusted);
    }
}

/// What it is for: the same worlds, taken as exact.
#[test]
fn without_the_budget_the_same_worlds_are_not_covered() {
    for (name, causes) in worlds() {
        for count in [6, 12] {
            let markers = tanker_markers(count);
            let budget = causes.budget(&markers);
            let unaware = Estimator::new(EstimatorSettings::default());
            let name = format!("{count:2} points, 15 m, {name}, taken as exact");
            let means = monte_carlo(&markers, 15, &budget, &unaware, |_| {}).report(&name);
            assert!(means.nees > 9.0, "{name}: {}", means.nees);
        }
    }
}

fn frame(
    camera: &Camera,
    budget: &ErrorBudget,
    markers: &[Marker],
    trial: u32,
) -> Vec<Observation> {
    let mut random = trial_generator(SEED, 100, 0, trial);
    let pose = pose_in_camera(Vector3::new(18.0, 0.5, 5.0), 2.0, -1.0, 3.0);
    World::draw(camera, markers, budget, &mut random).observe(&pose, SIGMA_PX, &mut random)
}

#[test]
fn an_empty_budget_changes_no_bit() {
    let markers = tanker_markers(12);
    let nothing = Causes::default().budget(&markers);
    let plain = Estimator::new(EstimatorSettings::default());
    let with_empty = plain.clone().with_budget(nothing);
    assert!(with_empty.budget().is_none());
    for trial in 0..100 {
        let seen = frame(
            &paper_camera(),
            &EVERYTHING.budget(&markers),
            &markers,
            trial,
        );
        let both = [&plain, &with_empty].map(|e| e.estimate(&paper_camera(), &seen, None));
        assert_eq!(both[0], both[1]);
    }
}

fn lens() -> Camera {
    let info = CameraInfo {
        width: 508,
        height: 412,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.28, 0.09, 0.0008, -0.0005, -0.012],
        k: [571.0, 0.0, 254.0, 0.0, 560.0, 206.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    Camera::from_info(&info, false).expect("a usual lens")
}

/// The whole covariance of a frame's pixels, formed as the definition says, and the estimate's own numbers from it.
/// They differ by what the estimator takes from nearby: the weights from up to a step before the end.
#[test]
fn estimate_agrees_with_the_whole_covariance_of_the_pixels() {
    for camera in [paper_camera(), lens()] {
        for count in [6, 9, 12] {
            let markers = tanker_markers(count);
            let budget = EVERYTHING.budget(&markers);
            let estimator = estimator(budget.clone());
            for trial in 0..20 {
                let seen = frame(&camera, &budget, &markers, trial);
                let found = estimator.estimate(&camera, &seen, None).expect("a pose");
                let (chi_squared, covariance, gradient) = dense(&camera, &budget, &seen, &found);
                let off = (found.chi_squared - chi_squared).abs();
                assert!(off < 0.01 * (1.0 + chi_squared), "{off} of {chi_squared}");
                let off = (found.covariance.0 - covariance).norm() / covariance.norm();
                assert!(off < 0.01, "{off}");
                // Half the gradient in units of sigma: what one more step would still do.
                let rest = gradient.dot(&(covariance * gradient)).sqrt();
                assert!(rest < 0.02, "{rest}");
            }
        }
    }
}

/// Chi-squared, covariance of the pose and half the gradient with `Σ` as one matrix.
fn dense(
    camera: &Camera,
    budget: &ErrorBudget,
    seen: &[Observation],
    found: &Solution,
) -> (f64, Matrix6<f64>, nalgebra::Vector6<f64>) {
    let n = seen.len();
    let pose = &found.camera_from_tanker;
    let mut residual = DVector::zeros(2 * n);
    let mut by_pose = DMatrix::zeros(2 * n, 6);
    let mut sigma = DMatrix::zeros(2 * n, 2 * n);
    let mut modes = DMatrix::zeros(2 * n, budget.flex().len() + budget.calibration().len() + 2);
    for (i, point) in seen.iter().enumerate() {
        let q = pose * point.marker_in_tanker;
        let ray = |q: nalgebra::Point3<f64>| Ray {
            x: q.x / q.z,
            y: q.y / q.z,
        };
        let (pixel, by_ray) = camera.project(ray(q)).expect("seen");
        residual[2 * i] = pixel.u - point.pixel.u;
        residual[2 * i + 1] = pixel.v - point.pixel.v;
        let r = ray(q);
        let d = by_ray * SMatrix::<f64, 2, 3>::new(1.0, 0.0, -r.x, 0.0, 1.0, -r.y) / q.z;
        let arm = pose.rotation * point.marker_in_tanker.coords;
        by_pose.view_mut((2 * i, 0), (2, 3)).copy_from(&d);
        by_pose
            .view_mut((2 * i, 3), (2, 3))
            .copy_from(&(-d * skew(arm)));
        let survey = d * d.transpose() * budget.survey_sigma_m(point.id).powi(2);
        let own = survey + nalgebra::Matrix2::identity() * point.sigma_px.powi(2);
        sigma.view_mut((2 * i, 2 * i), (2, 2)).copy_from(&own);
        let mut column = 0;
        for mode in budget.flex() {
            let (_, shift) = mode
                .shape
                .iter()
                .find(|(id, _)| *id == point.id)
                .expect("all");
            let shift = d * (pose.rotation * shift);
            modes.view_mut((2 * i, column), (2, 1)).copy_from(&shift);
            column += 1;
        }
        for mode in budget.calibration() {
            // By differences, where the point was seen.
            let step = 1e-5;
            let ray = camera.ray_from_pixel(point.pixel).expect("a ray");
            let moved = camera.with_change(&(mode.change * step));
            let (there, _) = moved.project(ray).expect("seen");
            modes[(2 * i, column)] = (there.u - point.pixel.u) / step;
            modes[(2 * i + 1, column)] = (there.v - point.pixel.v) / step;
            column += 1;
        }
        modes[(2 * i, column)] = budget.jitter_px();
        modes[(2 * i + 1, column + 1)] = budget.jitter_px();
    }
    sigma += &modes * modes.transpose();
    let factor = sigma.cholesky().expect("positive definite");
    let chi_squared = residual.dot(&factor.solve(&residual));
    let information = by_pose.transpose() * factor.solve(&by_pose);
    let gradient = by_pose.transpose() * factor.solve(&residual);
    let information = Matrix6::from_iterator(information.iter().copied());
    let covariance = information.try_inverse().expect("a fixed pose");
    (
        chi_squared,
        covariance,
        nalgebra::Vector6::from_iterator(gradient.iter().copied()),
    )
}

#[test]
fn shares_of_the_causes_add_up_and_a_large_flex_is_found() {
    let markers = tanker_markers(12);
    let budget = EVERYTHING.budget(&markers);
    let estimator = estimator(budget.clone());
    let mut random = trial_generator(SEED, 101, 0, 0);
    let pose = pose_in_camera(Vector3::new(15.0, 0.0, 4.5), 2.0, -1.0, 3.0);
    let mut world = World::draw(&paper_camera(), &markers, &budget, &mut random);
    world.set_flex(&[2.0]);
    let seen = world.observe(&pose, SIGMA_PX, &mut random);
    let found = estimator
        .estimate(&paper_camera(), &seen, None)
        .expect("a pose");
    let causes = estimator
        .causes(&paper_camera(), &seen, &found, &Expected::default())
        .expect("causes");
    let names: Vec<&str> = causes
        .causes
        .iter()
        .map(|cause| cause.name.as_str())
        .collect();
    let expected = [
        "noise",
        "survey",
        "wing_bending",
        "focal_length",
        "principal_point_u",
        "principal_point_v",
        "k1",
        "jitter_u",
        "jitter_v",
    ];
    assert_eq!(names, expected);
    let sum: Matrix6<f64> = causes.causes.iter().map(|cause| cause.covariance.0).sum();
    assert!((sum - found.covariance.0).norm() < 0.01 * found.covariance.0.norm());
    let flex = &causes.causes[2];
    assert_eq!(
        flex.kind,
        CauseKind::Flex {
            time_constant_s: None
        }
    );
    let amplitude = flex.amplitude_sigmas.expect("one number");
    assert!((1.0..3.0).contains(&amplitude), "{amplitude}");
    assert_eq!(causes.survey_shifts.len(), 12);
    // A principal point off by 3 px at 15 m is 8 cm aside: nothing else comes near.
    assert!(
        causes
            .dominant()
            .is_some_and(|cause| cause.name.starts_with("principal_point"))
    );
}

/// `fin6` tells its range to the flex hardly: documented, not promised.
#[test]
fn fin6_with_flex_says_that_it_knows_little() {
    let map = MarkerMap::shipped("fin6").expect("shipped");
    let markers = map.markers().to_vec();
    let budget = Causes {
        flex_m: 0.3,
        ..Causes::default()
    }
    .budget(&markers);
    for (flex_m, most) in [(0.0, 6.5), (0.1, 6.5), (0.3, 7.5), (0.6, 11.0)] {
        let name = format!("fin6, 15 m, tips up {flex_m} m");
        let set = |world: &mut World| world.set_flex(&[flex_m / 0.3]);
        let means =
            monte_carlo(&markers, 15, &budget, &estimator(budget.clone()), set).report(&name);
        assert!(means.nees < most, "{name}: {}", means.nees);
    }
}
