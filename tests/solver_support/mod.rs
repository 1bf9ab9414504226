//! Frames and an error budget of any size, for what counts allocations and for what takes times of the solver.

use nalgebra::{Point3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{CalibrationChange, Camera, CameraInfo};
use tanker_pose::estimation::{CalibrationMode, ErrorBudget, FlexMode, Observation};
use tanker_pose::simulation::{Scene, paper_scene, pose_in_camera};
use tanker_pose::target::Marker;

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
    let calibration = |name: &str, places: &[usize], sigma: f64| {
        let mut change = CalibrationChange::zeros();
        for &place in places {
            change[place] = sigma;
        }
        CalibrationMode {
            name: name.to_owned(),
            change,
        }
    };
    let bend = |seen: &Observation| {
        let up = 0.3 * (seen.marker_in_tanker.y / 7.0).powi(2);
        (seen.id, Vector3::new(0.0, 0.0, up))
    };
    let flex = FlexMode {
        name: "wing_bending".to_owned(),
        time_constant_s: Some(5.0),
        shape: seen.iter().map(bend).collect(),
    };
    let calibration = vec![
        calibration("focal_length", &[0, 1], 0.003),
        calibration("principal_point_u", &[2], 3.0),
        calibration("principal_point_v", &[3], 3.0),
        calibration("k1", &[4], 0.02),
    ];
    ErrorBudget::new(&survey(seen), vec![flex], calibration, 0.5).expect("a budget")
}
