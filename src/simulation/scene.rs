//! A camera, a tanker and the pose between them; its image with and without noise.

use nalgebra::{Isometry3, Point3, Rotation3, Translation3, UnitQuaternion, Vector3};
use rand::Rng;
use rand_distr::{Distribution, StandardNormal};

use crate::camera::{Camera, Ray};
use crate::estimation::Observation;
use crate::geometry::{optical_from_body, rotation_from_roll_pitch_yaw};
use crate::target::{Marker, MarkerMap};

/// A camera, markers, and the true pose between them.
#[derive(Debug, Clone)]
pub struct Scene {
    camera: Camera,
    markers: Vec<Marker>,
    truth_camera_from_tanker: Isometry3<f64>,
}

/// Returns `camera_from_tanker` for a tanker at `tanker_in_receiver` (m, x forward, y left, z up)
/// with relative attitude `Rz(yaw) Ry(pitch) Rx(roll)` (degrees), the camera looking straight ahead.
#[must_use]
pub fn pose_in_camera(
    tanker_in_receiver: Vector3<f64>,
    roll_deg: f64,
    pitch_deg: f64,
    yaw_deg: f64,
) -> Isometry3<f64> {
    let receiver_from_tanker = rotation_from_roll_pitch_yaw(
        roll_deg.to_radians(),
        pitch_deg.to_radians(),
        yaw_deg.to_radians(),
    );
    let optical = optical_from_body();
    Isometry3::from_parts(
        Translation3::from(optical * tanker_in_receiver),
        UnitQuaternion::from_rotation_matrix(&(optical * receiver_from_tanker)),
    )
}

/// Returns the paper's camera: 508 × 412 px, focal length 571 px, principal point (254, 206).
///
/// # Panics
/// Never: the intrinsics are constants.
#[must_use]
pub fn paper_camera() -> Camera {
    Camera::from_intrinsics(571.0, 571.0, 254.0, 206.0, Some((508, 412)))
        .expect("the paper's intrinsics are those of a camera")
}

/// Returns the scene of the paper's section 4.1: six points, yaw 3°, pitch 2°, roll 3°, t = (15, 0, 4.5) m.
///
/// # Panics
/// Never: the map is shipped.
#[must_use]
pub fn paper_scene() -> Scene {
    let map = MarkerMap::shipped("paper").expect("the paper's map is shipped");
    Scene::new(
        paper_camera(),
        &map,
        pose_in_camera(Vector3::new(15.0, 0.0, 4.5), 3.0, 2.0, 3.0),
    )
}

impl Scene {
    /// Returns a scene with every marker of a map.
    #[must_use]
    pub fn new(camera: Camera, map: &MarkerMap, truth_camera_from_tanker: Isometry3<f64>) -> Self {
        Self {
            camera,
            markers: map.markers().to_vec(),
            truth_camera_from_tanker,
        }
    }

    /// Returns a scene with these markers.
    #[must_use]
    pub fn with_markers(
        camera: Camera,
        markers: Vec<Marker>,
        truth_camera_from_tanker: Isometry3<f64>,
    ) -> Self {
        Self {
            camera,
            markers,
            truth_camera_from_tanker,
        }
    }

    /// Returns the camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the true pose.
    #[must_use]
    pub fn truth_camera_from_tanker(&self) -> &Isometry3<f64> {
        &self.truth_camera_from_tanker
    }

    /// Returns the true rotation of `camera_from_tanker`.
    #[must_use]
    pub fn truth_rotation(&self) -> Rotation3<f64> {
        self.truth_camera_from_tanker.rotation.to_rotation_matrix()
    }

    /// Returns the markers.
    #[must_use]
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns the exact image with sigma 1 px; markers behind the camera or outside the lens model are missing.
    #[must_use]
    pub fn exact_observations(&self) -> Vec<Observation> {
        self.markers
            .iter()
            .filter_map(|marker| {
                let q: Point3<f64> = self.truth_camera_from_tanker * marker.marker_in_tanker;
                if q.z <= 0.0 {
                    return None;
                }
                let (pixel, _) = self.camera.project(Ray::through(&q.coords))?;
                Some(Observation {
                    id: marker.id,
                    marker_in_tanker: marker.marker_in_tanker,
                    pixel,
                    sigma_px: 1.0,
                })
            })
            .collect()
    }

    /// Returns the image with Gaussian noise of `sigma_px` on every column and row.
    pub fn noisy_observations(&self, sigma_px: f64, random: &mut impl Rng) -> Vec<Observation> {
        let mut observations = self.exact_observations();
        for observation in &mut observations {
            let (du, dv): (f64, f64) =
                (StandardNormal.sample(random), StandardNormal.sample(random));
            observation.pixel.u += sigma_px * du;
            observation.pixel.v += sigma_px * dv;
            observation.sigma_px = sigma_px;
        }
        observations
    }
}
