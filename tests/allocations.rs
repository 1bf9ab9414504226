//! The solver leaves the heap alone: its time depends on the frame, not on an allocator.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{CalibrationChange, Camera, CameraInfo};
use tanker_pose::estimation::{
    CalibrationMode, ErrorBudget, Estimator, EstimatorSettings, FlexMode, Initialisation,
    Observation, Refinement,
};
use tanker_pose::simulation::{Scene, paper_camera, paper_scene, pose_in_camera};
use tanker_pose::target::Marker;

/// Points that fit without the heap.
const MOST: u32 = 64;
const SIGMA_PX: f64 = 0.5;

fn wide_angle() -> Camera {
    let info = CameraInfo {
        width: 508,
        height: 412,
        distortion_model: "plumb_bob".to_owned(),
        d: vec![-0.28, 0.09, 0.0008, -0.0005, -0.012],
        k: [571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0],
        ..CameraInfo::default()
    };
    Camera::from_info(&info, false).expect("a usual lens")
}

fn frame(camera: Camera, count: u32) -> (Camera, Vec<Observation>) {
    let mut random = ChaCha8Rng::seed_from_u64(11);
    let pose = pose_in_camera(Vector3::new(22.0, 0.0, 6.6), 3.0, 2.0, -3.0);
    let markers = if count == 6 {
        paper_scene().markers().to_vec()
    } else {
        (1..=count)
            .map(|id| Marker {
                id,
                marker_in_tanker: Point3::new(
                    random.random_range(0.0..8.0),
                    random.random_range(-7.0..7.0),
                    random.random_range(0.0..3.2),
                ),
            })
            .collect()
    };
    let scene = Scene::with_markers(camera, markers, pose);
    let seen = scene.noisy_observations(SIGMA_PX, &mut random);
    assert_eq!(seen.len(), count as usize, "every marker is in front");
    (scene.camera().clone(), seen)
}

fn allocations(settings: EstimatorSettings, camera: &Camera, seen: &[Observation]) -> u64 {
    let estimator = Estimator::new(settings);
    let solve = || estimator.estimate(camera, seen, None);
    // What is made once a process (a table of rotations, what the processor can do) is not the frame's.
    let once = solve().expect("a pose");
    assert!(once.is_trusted());
    let mut again = None;
    let counted = allocation_counter::measure(|| again = Some(solve()));
    assert_eq!(again.expect("it ran"), Ok(once));
    counted.count_total
}

#[test]
fn no_solve_of_64_points_or_fewer_allocates() {
    for camera in [paper_camera(), wide_angle()] {
        for count in [6, 7, 12, MOST] {
            let (camera, clean) = frame(camera.clone(), count);
            let mut wrong = clean.clone();
            wrong[2].pixel.u += 60.0;
            let mut exchanged = clean.clone();
            (exchanged[1].pixel, exchanged[4].pixel) = (clean[4].pixel, clean[1].pixel);
            for initialisation in [
                Initialisation::Nominal,
                Initialisation::Previous,
                Initialisation::Dlt,
                Initialisation::Global,
            ] {
                for refinement in [Refinement::MaximumLikelihood, Refinement::None] {
                    let mut settings = EstimatorSettings {
                        initialisation,
                        refinement,
                        // Two of six can be left out.
                        min_points: 4,
                        ..EstimatorSettings::default()
                    };
                    let case = format!("{count} points, {initialisation:?}, {refinement:?}");
                    assert_eq!(allocations(settings.clone(), &camera, &clean), 0, "{case}");
                    // The linear start needs six points; of six none can be left out.
                    if initialisation == Initialisation::Dlt && count < 8 {
                        continue;
                    }
                    settings.max_outliers = 2;
                    let found = allocations(settings.clone(), &camera, &wrong);
                    assert_eq!(found, 0, "{case}, one gross error");
                    if initialisation == Initialisation::Nominal {
                        let found = allocations(settings, &camera, &exchanged);
                        assert_eq!(found, 0, "{case}, two ids exchanged");
                    }
                }
            }
        }
    }
}

#[test]
fn no_solve_with_a_full_budget_allocates() {
    let mode = |name: &str, places: &[usize], sigma: f64| {
        let mut change = CalibrationChange::zeros();
        for &place in places {
            change[place] = sigma;
        }
        CalibrationMode {
            name: name.to_owned(),
            change,
        }
    };
    for camera in [paper_camera(), wide_angle()] {
        for count in [6, 12, MOST] {
            let (camera, clean) = frame(camera.clone(), count);
            let survey: Vec<(u32, f64)> = clean.iter().map(|seen| (seen.id, 0.02)).collect();
            let bend = |seen: &Observation| {
                let up = 0.3 * (seen.marker_in_tanker.y / 7.0).powi(2);
                (seen.id, Vector3::new(0.0, 0.0, up))
            };
            let flex = vec![FlexMode {
                name: "wing_bending".to_owned(),
                time_constant_s: Some(5.0),
                shape: clean.iter().map(bend).collect(),
            }];
            let calibration = vec![
                mode("focal_length", &[0, 1], 0.003),
                mode("principal_point_u", &[2], 3.0),
                mode("principal_point_v", &[3], 3.0),
                mode("k1", &[4], 0.02),
            ];
            let budget = ErrorBudget::new(&survey, flex, calibration, 0.5).expect("a budget");
            let estimator = Estimator::new(EstimatorSettings::default()).with_budget(budget);
            let solve = || estimator.estimate(&camera, &clean, None);
            assert!(solve().expect("a pose").is_trusted());
            let counted = allocation_counter::measure(|| drop(solve()));
            assert_eq!(counted.count_total, 0, "{count} points");
        }
    }
}

/// Without this the tests above would pass with a counter that does not count.
#[test]
fn more_than_64_points_do_allocate() {
    let (camera, seen) = frame(paper_camera(), MOST + 1);
    assert!(allocations(EstimatorSettings::default(), &camera, &seen) > 0);
}
