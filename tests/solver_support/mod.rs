//! Frames and an error budget of any size, for what counts allocations and for what takes times of the solver.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{Camera, CameraInfo};
use tanker_pose::estimation::{ErrorBudget, Observation};
use tanker_pose::simulation::{Scene, paper_scene, pose_in_camera};
use tanker_pose::target::Marker;

use budgets::{calibration_mode, calibration_modes, wing_bending};

#[path = "../budgets/mod.rs"]
mod budgets;

/// Noise of the detections, px.
pub const SIGMA_PX: f64 = 0.5;

/// Returns the paper's camera with a wide-angle lens.
pub fn plumb_bob_camera() -> Camera {
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

/// Returns a noisy frame 22 m ahead: of six markers the paper's, else random ones in the tanker's volume.
pub fn frame(camera: &Camera, count: u32) -> Vec<Observation> {
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
    let scene = Scene::with_markers(camera.clone(), markers, pose);
    let seen = scene.noisy_observations(SIGMA_PX, &mut random);
    assert_eq!(seen.len(), count as usize, "every marker is in front");
    seen
}

/// Returns the survey of a frame's markers: 2 cm each.
pub fn survey(seen: &[Observation]) -> Vec<(u32, f64)> {
    seen.iter().map(|seen| (seen.id, 0.02)).collect()
}

/// Returns a budget with every cause: survey, flex, calibration and jitter.
pub fn full_budget(seen: &[Observation]) -> ErrorBudget {
    let places = seen.iter().map(|seen| (seen.id, seen.marker_in_tanker.y));
    let flex = wing_bending(places, 0.3, 7.0, Some(5.0));
    let mut calibration = calibration_modes(0.003, 3.0);
    calibration.push(calibration_mode("k1", &[4], 0.02));
    ErrorBudget::new(&survey(seen), vec![flex], calibration, 0.5).expect("a budget")
}
