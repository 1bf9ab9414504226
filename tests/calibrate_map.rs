//! Maps, cameras and mounts from simulated recordings, against their own predictions.
//!
//! Bounds follow from the number of trials: the mean over N trials of a normalised squared error of n components is 1 with
//! a standard error of sqrt(2 / (n N)); four of them are allowed.

mod calibration_worlds;

use std::sync::LazyLock;

use calibration_worlds::poses::pose_nees;
use calibration_worlds::tags::calibrated_tags;
use calibration_worlds::{Plan, SURVEY_M, World, normal};
use nalgebra::{DMatrix, DVector, UnitQuaternion, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use tanker_pose::calibration::{Calibration, Movement, Parameter};
use tanker_pose::geometry::optical_from_body;
use tanker_pose::target::MarkerMap;

const WRONG_FOCAL_LENGTH: Plan = Plan {
    focal_length: 0.01,
    intrinsics: true,
    ..Plan::USUAL
};

/// Worlds in which the markers are off, and those in which the focal length is too, each calibrated.
static OF_MARKERS: LazyLock<Vec<(World, Calibration)>> = LazyLock::new(|| trials(400, Plan::USUAL));
static OF_FOCAL_LENGTHS: LazyLock<Vec<(World, Calibration)>> =
    LazyLock::new(|| trials(400, WRONG_FOCAL_LENGTH));

fn trials(count: u64, plan: Plan) -> Vec<(World, Calibration)> {
    (1..=count)
        .into_par_iter()
        .map(|seed| {
            let world = World::new(seed, plan);
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
            let errors = world.marker_errors(&found.map.map);
            let factor = found.map.covariance.clone().cholesky();
            errors.dot(&factor.expect("positive definite").solve(&errors))
        })
        .collect()
}

#[test]
fn markers_off_by_5_cm_are_found_within_their_predicted_covariance() {
    assert_consistent("markers", &marker_squares(&OF_MARKERS), 24);
}

/// The shape: without common shift, turn and scale, which no image shows.
#[test]
fn the_shape_of_the_markers_becomes_much_better_than_its_survey() {
    let (mut all, mut shapes) = ([0.0; 2], [0.0; 2]);
    for (world, found) in OF_MARKERS.iter() {
        let untold = untold(&world.believed);
        for (i, map) in [&world.believed, &found.map.map].into_iter().enumerate() {
            let errors = world.marker_errors(map);
            all[i] += errors.norm_squared();
            shapes[i] += (&errors - &untold * untold.tr_mul(&errors)).norm_squared();
        }
    }
    let mm = |sum: f64, count: f64| 1e3 * (sum / (OF_MARKERS.len() as f64 * count)).sqrt();
    println!(
        "rms of all {:.1} -> {:.1} mm, of the shape {:.1} -> {:.1} mm",
        mm(all[0], 24.0),
        mm(all[1], 24.0),
        mm(shapes[0], 17.0),
        mm(shapes[1], 17.0)
    );
    assert!(shapes[1] < 0.4 * shapes[0], "{shapes:?}");
    // Seven of 24 directions stay as surveyed.
    assert!(all[1] < 0.6 * all[0], "{all:?}");
}

/// Returns an orthonormal basis of what no image shows of a map.
fn untold(map: &MarkerMap) -> DMatrix<f64> {
    let markers = map.markers();
    let basis = DMatrix::from_fn(3 * markers.len(), 7, |row, mode| {
        let marker = markers[row / 3].marker_in_tanker.coords;
        let shift = match mode {
            0..=2 => Vector3::ith(mode, 1.0),
            3..=5 => Vector3::ith(mode - 3, 1.0).cross(&marker),
            _ => marker,
        };
        shift[row % 3]
    });
    basis.qr().q()
}

#[test]
fn wrong_detections_change_nothing() {
    let plan = Plan {
        wrong_every: Some(6),
        ..Plan::USUAL
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
    let mut moved = 0;
    let squares: Vec<f64> = OF_FOCAL_LENGTHS
        .iter()
        .map(|(world, found)| {
            let camera = found.camera.as_ref().expect("it has a sigma");
            let named = |p: &&Parameter| p.name == "focal_length";
            let parameter = found.parameters.iter().find(named).expect("one");
            moved += usize::from(camera.is_moved);
            let sigma = if camera.is_moved {
                parameter.sigma_after
            } else {
                parameter.sigma_before
            };
            ((world.focal_error - camera.change[0]) / (0.01 * sigma)).powi(2)
        })
        .collect();
    println!("focal length moved in {moved} of {} worlds", squares.len());
    // Where the approach tells too little of it, it stays.
    assert!(moved >= 390, "{moved}");
    assert_consistent("focal length", &squares, 1);
    assert_consistent(
        "markers, with a wrong focal length",
        &marker_squares(&OF_FOCAL_LENGTHS),
        24,
    );
}

#[test]
fn a_mount_off_by_1_degree_is_found_as_far_as_the_attitudes_allow() {
    let plan = Plan {
        mount_deg: 1.0,
        attitude_bias_deg: 0.4,
        ..Plan::USUAL
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

/// What is written dominates the covariance of what is wrong, so no mean is above 6 but by chance: with N worlds, whose
/// poses share the error of their map, by a standard error of at most sqrt(12 / N). How much more than that it claims is
/// no matter of principle; at 4 sigmas are sqrt(6 / 4) = 1.22 times too wide.
fn assert_poses_are_honest(what: &str, trials: &[(World, Calibration)]) {
    let nees: Vec<f64> = trials
        .par_iter()
        .map(|(world, found)| pose_nees(world, found))
        .collect();
    let mean = nees.iter().sum::<f64>() / nees.len() as f64;
    let most = 6.0 + 4.0 * (12.0 / nees.len() as f64).sqrt();
    println!("{what}: NEES of poses of another approach {mean:.2}, allowed 4 to {most:.2}");
    assert!((4.0..most).contains(&mean), "{what}: {mean}");
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map() {
    assert_poses_are_honest("markers", &OF_MARKERS);
}

#[test]
fn poses_of_another_approach_are_honest_with_the_written_map_and_camera() {
    assert_poses_are_honest("markers and focal length", &OF_FOCAL_LENGTHS);
}

#[test]
fn a_detectors_sigma_is_found_where_another_was_stated() {
    let plan = Plan {
        sigma_px: 0.8,
        ..Plan::USUAL
    };
    let trials = trials(100, plan);
    let squares: Vec<f64> = trials
        .iter()
        .map(|(_, found)| {
            let noise = &found.noise;
            assert!(noise.in_time.is_none(), "{noise:?}");
            ((noise.sigma_px - 0.8) / noise.sigma_error_px).powi(2)
        })
        .collect();
    let sum: f64 = trials.iter().map(|(_, found)| found.noise.sigma_px).sum();
    println!("sigma {:.4} px", sum / 100.0);
    assert_consistent("the detector's sigma", &squares, 1);
}

#[test]
fn noise_that_lasts_is_found_and_does_not_make_markers_surer_than_they_are() {
    let plan = Plan {
        noise_time_constant_s: 1.0,
        rate_hz: 4.0,
        ..Plan::USUAL
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
    let mut world = World::new(3, Plan::USUAL);
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

    let seven = World::new(3, Plan::USUAL).calibrate().gauge;
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
        ..Plan::USUAL
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
        ..Plan::USUAL
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
        ..Plan::USUAL
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
    for (world, found) in &OF_FOCAL_LENGTHS[..20] {
        let map = &found.map;
        let mut claimed = DMatrix::zeros(24, 24);
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
            let shift = DVector::from_iterator(24, shape) * mode.sigma_m;
            claimed += &shift * shift.transpose();
        }
        let least = (claimed - &map.covariance).symmetric_eigenvalues().min();
        assert!(least > 0.0, "seed {}: {least} m²", world.seed);
    }
}

#[test]
fn growth_of_the_sigma_with_range_is_found() {
    let plan = Plan {
        sigma_px: 1e-6,
        rate_hz: 8.0,
        ..Plan::USUAL
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

/// Corners have 0.4 px in common and 0.3 px of their own: 0.5 px, correlated by 0.64.
#[test]
fn correlation_between_corners_of_a_tag_is_found() {
    let noise = calibrated_tags(0.4, 0.3).noise;
    let corners = noise.between_corners.expect("there are tags");
    println!(
        "corners {:.2} ± {:.2}, sigma {:.3} ± {:.3}",
        corners.correlation, corners.error, noise.sigma_px, noise.sigma_error_px
    );
    assert!((corners.correlation - 0.64).abs() < 0.1, "{corners:?}");
    assert!(noise.sigma_to_state_px() > 1.4 * noise.sigma_px);
}
