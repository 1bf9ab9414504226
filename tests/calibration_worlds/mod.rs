//! Recorded approaches to tankers whose markers are not where the map has them, seen by cameras that are not as
//! calibrated.

pub mod poses;
pub mod tags;

use nalgebra::{DVector, Rotation3, Vector3};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use tanker_pose::calibration::{
    Calibration, CalibrationSettings, MountPrior, RecordedFrame, calibrate,
};
use tanker_pose::camera::{CalibrationChange, Camera};
use tanker_pose::config::CalibrationSigmas;
use tanker_pose::estimation::{Estimator, EstimatorSettings, Observation};
use tanker_pose::geometry::optical_from_body;
use tanker_pose::pipeline::{Detection, error_budget, observe};
use tanker_pose::simulation::{Approach, ApproachSettings, paper_camera};
use tanker_pose::target::{Marker, MarkerMap};

/// Survey of every marker, m.
pub const SURVEY_M: f64 = 0.05;
/// What the detector states, whatever its noise is, px.
const STATED_PX: f64 = 0.5;

/// What is wrong in a world, 1 sigma, and how it is recorded.
#[derive(Clone, Copy)]
pub struct Plan {
    pub focal_length: f64,
    pub mount_deg: f64,
    pub attitude_bias_deg: f64,
    pub sigma_px: f64,
    pub noise_time_constant_s: f64,
    /// One detection of every such frame is off by 30 px.
    pub wrong_every: Option<u32>,
    pub rate_hz: f64,
    pub intrinsics: bool,
}

impl Plan {
    /// Only the markers are off.
    pub const USUAL: Self = Self {
        focal_length: 0.0,
        mount_deg: 0.0,
        attitude_bias_deg: 0.0,
        sigma_px: 0.5,
        noise_time_constant_s: 0.0,
        wrong_every: None,
        rate_hz: 2.0,
        intrinsics: false,
    };
}

/// One world with its recording.
pub struct World {
    pub believed: MarkerMap,
    pub truth: MarkerMap,
    pub believed_camera: Camera,
    pub true_camera: Camera,
    pub focal_error: f64,
    /// The mount's error, camera axes, rad.
    pub mount_error: Vector3<f64>,
    pub estimator: Estimator,
    pub frames: Vec<RecordedFrame>,
    pub settings: CalibrationSettings,
    pub seed: u64,
    pub plan: Plan,
}

pub fn normal(random: &mut ChaCha8Rng) -> f64 {
    StandardNormal.sample(random)
}

pub fn normals(random: &mut ChaCha8Rng) -> Vector3<f64> {
    Vector3::from_fn(|_, _| normal(random))
}

/// Eight beacons on fuselage, wings and tail.
pub const MAP: &str = "name: tanker
sigma: 0.05
markers:
  - {id: 1, x: 3.7,  y: -7.13,  z: 0.7}
  - {id: 2, x: 3.7,  y: 7.13,   z: 0.7}
  - {id: 3, x: 7.79, y: -2.689, z: 0.7}
  - {id: 4, x: 7.79, y: 2.689,  z: 0.7}
  - {id: 5, x: 7.96, y: 0.0,    z: 3.189}
  - {id: 6, x: 0.0,  y: 0.0,    z: 0.0}
  - {id: 7, x: 2.0,  y: -3.5,   z: 0.3}
  - {id: 8, x: 2.0,  y: 3.5,    z: 0.3}
";

impl World {
    pub fn new(seed: u64, plan: Plan) -> Self {
        let believed = MarkerMap::from_yaml(MAP, "map").expect("a good map");
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        random.set_stream(1 << 50);
        let markers: Vec<Marker> = believed
            .markers()
            .iter()
            .map(|marker| Marker {
                marker_in_tanker: marker.marker_in_tanker + normals(&mut random) * SURVEY_M,
                ..*marker
            })
            .collect();
        let truth = MarkerMap::new("truth", &markers).expect("a good map");
        let believed_camera = paper_camera();
        let focal_error = plan.focal_length * normal(&mut random);
        let mut change = CalibrationChange::zeros();
        (change[0], change[1]) = (focal_error, focal_error);
        let true_camera = believed_camera.with_change(&change);
        let sigmas = CalibrationSigmas {
            focal_length: plan.focal_length,
            ..CalibrationSigmas::default()
        };
        let budget = error_budget(believed.budget(), &sigmas, &[]);
        let estimator = Estimator::new(EstimatorSettings::default()).with_budget(budget);
        let mount_error = normals(&mut random) * plan.mount_deg.to_radians();
        let bias = normals(&mut random) * plan.attitude_bias_deg.to_radians();
        let mount = (plan.mount_deg > 0.0).then(|| MountPrior {
            camera_from_receiver: optical_from_body(),
            sigma_rad: plan.mount_deg.to_radians(),
            attitude_bias_rad: plan.attitude_bias_deg.to_radians(),
            attitude_noise_rad: 0.3_f64.to_radians(),
        });
        let mut world = Self {
            believed,
            truth,
            believed_camera,
            true_camera,
            focal_error,
            mount_error,
            estimator,
            frames: Vec::new(),
            settings: CalibrationSettings {
                intrinsics: plan.intrinsics,
                mount,
                ..CalibrationSettings::default()
            },
            seed,
            plan,
        };
        let approach = world.approach(seed);
        for index in 0..approach.frame_count() {
            let mut frame = approach.frame(index);
            if plan.wrong_every.is_some_and(|every| index % every == 0) {
                let which = index as usize % frame.detections.len();
                frame.detections[which].u_px += 30.0;
            }
            let off = Rotation3::new(bias) * Rotation3::new(mount_error);
            let rotation = frame.truth_camera_from_tanker.rotation.to_rotation_matrix();
            let noise = Rotation3::new(normals(&mut random) * 0.3_f64.to_radians());
            let reported = (off * optical_from_body()).inverse() * noise * rotation;
            world.frames.push(RecordedFrame {
                time_s: frame.time_s,
                observations: observations(
                    &world.believed_camera,
                    &world.believed,
                    &frame.detections,
                ),
                receiver_from_tanker: mount.map(|_| reported),
            });
        }
        world
    }

    /// Returns an approach in this world.
    pub fn approach(&self, seed: u64) -> Approach {
        let settings = ApproachSettings {
            rate_hz: self.plan.rate_hz,
            sigma_px: self.plan.sigma_px,
            noise_time_constant_s: self.plan.noise_time_constant_s,
            start_range_m: 40.0,
            seed,
            ..ApproachSettings::default()
        };
        Approach::new(settings, self.true_camera.clone(), self.truth.clone())
    }

    pub fn calibrate(&self) -> Calibration {
        calibrate(
            &self.believed_camera,
            &self.believed,
            &self.estimator,
            &self.frames,
            &self.settings,
        )
        .expect("the recording is good")
    }

    /// Returns the errors of a map's markers, three rows each.
    pub fn marker_errors(&self, map: &MarkerMap) -> DVector<f64> {
        let truth = self.truth.markers();
        DVector::from_fn(3 * truth.len(), |row, _| {
            let marker = truth[row / 3];
            let there = map.get(marker.id).expect("the same markers");
            (marker.marker_in_tanker - there)[row % 3]
        })
    }
}

/// Returns detections as the estimator takes them.
pub fn observations(
    camera: &Camera,
    map: &MarkerMap,
    detections: &[Detection],
) -> Vec<Observation> {
    let stated: Vec<Detection> = detections
        .iter()
        .map(|seen| Detection {
            sigma_px: STATED_PX,
            ..*seen
        })
        .collect();
    observe(camera, &stated, STATED_PX, |id| map.get(id)).expect("good detections")
}
