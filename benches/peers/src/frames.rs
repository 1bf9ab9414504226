//! Seeded frames of the refuelling envelope, the same for every peer.

use std::io::{self, Write};
use std::path::Path;

use nalgebra::{Isometry3, Matrix3, Point3, Rotation3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use tanker_pose::camera::{Camera, Ray};
use tanker_pose::estimation::Observation;
use tanker_pose::geometry::optical_from_body;
use tanker_pose::simulation::{Scene, paper_camera, pose_in_camera};
use tanker_pose::target::{Marker, MarkerMap};

/// Points of a frame, and how many such frames.
const SIZES: [(u32, usize); 5] = [(6, 128), (12, 128), (64, 128), (100, 128), (1000, 32)];
/// px.
const SIGMA_PX: f64 = 0.5;
const SEED: u64 = 1;

/// One image and what is known about it.
pub struct Frame {
    pub truth_camera_from_tanker: Isometry3<f64>,
    pub observations: Vec<Observation>,
    pub rays: Vec<Ray>,
    pub markers_in_tanker: Vec<Point3<f64>>,
    /// Nominal attitude, and the position that suits it best: for peers that start from a whole pose.
    pub prior_camera_from_tanker: Isometry3<f64>,
}

/// Returns the frames of every size, in the order of `SIZES`.
pub fn all() -> Vec<Vec<Frame>> {
    let mut random = ChaCha8Rng::seed_from_u64(SEED);
    SIZES
        .iter()
        .map(|&(size, count)| (0..count).map(|_| frame(size, &mut random)).collect())
        .collect()
}

/// The paper's six markers, or `size` random ones in the tanker's volume; 12 to 40 m ahead, ±5° on each axis.
fn frame(size: u32, random: &mut ChaCha8Rng) -> Frame {
    let range_m = random.random_range(12.0..40.0);
    let mut angle_deg = || random.random_range(-5.0..5.0);
    let truth = pose_in_camera(
        Vector3::new(range_m, 0.0, 0.3 * range_m),
        angle_deg(),
        angle_deg(),
        angle_deg(),
    );
    let markers = if size == 6 {
        let paper = MarkerMap::shipped("paper").expect("shipped");
        paper.markers().to_vec()
    } else {
        (1..=size)
            .map(|id| Marker {
                id,
                marker_in_tanker: Point3::new(
                    random.random_range(0.0..8.0),
                    random.random_range(-7.13..7.13),
                    random.random_range(0.0..3.2),
                ),
            })
            .collect()
    };
    let camera = paper_camera();
    let scene = Scene::with_markers(camera, markers, truth);
    let observations = scene.noisy_observations(SIGMA_PX, random);
    assert_eq!(
        observations.len(),
        size as usize,
        "every marker is in front"
    );
    let markers_in_tanker: Vec<_> = observations.iter().map(|o| o.marker_in_tanker).collect();
    let rays = rays(scene.camera(), &observations);
    Frame {
        truth_camera_from_tanker: truth,
        prior_camera_from_tanker: prior(&rays, &markers_in_tanker),
        observations,
        rays,
        markers_in_tanker,
    }
}

/// Returns the rays of the pixels.
pub fn rays(camera: &Camera, observations: &[Observation]) -> Vec<Ray> {
    observations
        .iter()
        .map(|o| {
            camera
                .ray_from_pixel(o.pixel)
                .expect("a pinhole has every ray")
        })
        .collect()
}

/// Nominal attitude with the position of the least distances between points and their rays.
fn prior(rays: &[Ray], markers_in_tanker: &[Point3<f64>]) -> Isometry3<f64> {
    let rotation: Rotation3<f64> = optical_from_body();
    let (mut a, mut b) = (Matrix3::zeros(), Vector3::zeros());
    for (ray, marker) in rays.iter().zip(markers_in_tanker) {
        let v = Vector3::new(ray.x, ray.y, 1.0).normalize();
        let w = Matrix3::identity() - v * v.transpose();
        a += w;
        b -= w * (rotation * marker.coords);
    }
    let translation = a.cholesky().expect("rays differ").solve(&b);
    Isometry3::from_parts(translation.into(), rotation.into())
}

/// Writes the frames as little-endian f64: camera (fx, fy, cx, cy), number of sizes; for each size n and the
/// number of frames; for each frame truth and prior (R row by row, t) and n rows X, Y, Z, u, v, x, y.
pub fn write(all: &[Vec<Frame>], path: &Path) -> io::Result<()> {
    let mut values = vec![571.0, 571.0, 254.0, 206.0, all.len() as f64];
    for frames in all {
        values.extend([frames[0].observations.len() as f64, frames.len() as f64]);
        for frame in frames {
            values.extend(numbers(&frame.truth_camera_from_tanker));
            values.extend(numbers(&frame.prior_camera_from_tanker));
            for (o, ray) in frame.observations.iter().zip(&frame.rays) {
                values.extend(o.marker_in_tanker.iter());
                values.extend([o.pixel.u, o.pixel.v, ray.x, ray.y]);
            }
        }
    }
    let mut file = io::BufWriter::new(std::fs::File::create(path)?);
    for value in values {
        file.write_all(&f64::to_le_bytes(value))?;
    }
    file.flush()
}

/// Returns the rotation row by row, then the translation.
pub fn numbers(pose: &Isometry3<f64>) -> [f64; 12] {
    let r = pose.rotation.to_rotation_matrix().into_inner().transpose();
    let t = pose.translation.vector;
    std::array::from_fn(|i| if i < 9 { r[i] } else { t[i - 9] })
}
