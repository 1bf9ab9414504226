//! A seeded approach to the tanker: the true pose, and what a detector would see, frame by frame.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::{Scene, World, pose_in_camera};
use crate::camera::Camera;
use crate::estimation::ErrorBudget;
use crate::pipeline::Detection;
use crate::target::MarkerMap;

/// What an approach looks like.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachSettings {
    /// Distance along the receiver's x axis at the start, m.
    pub start_range_m: f64,
    /// The same at the end, m.
    pub end_range_m: f64,
    /// How long it takes, s.
    pub duration_s: f64,
    /// Images a second.
    pub rate_hz: f64,
    /// Noise of the detector on columns and rows, px.
    pub sigma_px: f64,
    /// Amplitude of the relative attitude on each axis, degrees.
    pub attitude_deg: f64,
    /// Seed of the noise and of the motion's phases.
    pub seed: u64,
}

impl Default for ApproachSettings {
    /// 60 m to 15 m in 25 s at 30 Hz, half a pixel, ±3°: the last range at which the paper's camera
    /// still sees the paper's wing tips.
    fn default() -> Self {
        Self {
            start_range_m: 60.0,
            end_range_m: 15.0,
            duration_s: 25.0,
            rate_hz: 30.0,
            sigma_px: 0.5,
            attitude_deg: 3.0,
            seed: 1,
        }
    }
}

/// Height of the tanker above the receiver, as a share of the range: the paper's route.
const CLIMB: f64 = 0.3;
/// m; sway to the left and right.
const SWAY_M: f64 = 0.4;
/// s; periods of sway, roll, pitch and yaw: air behind a tanker, without a common multiple.
const PERIODS_S: [f64; 4] = [11.0, 5.3, 7.1, 8.7];

/// Stream of the generator that draws the world; images have those from 1 on.
const WORLD_STREAM: u64 = u64::MAX;

/// A seeded approach: the same settings give the same bits.
#[derive(Debug, Clone)]
pub struct Approach {
    settings: ApproachSettings,
    camera: Camera,
    map: MarkerMap,
    phases: [f64; 4],
    /// Where tanker and camera are not as map and calibration have them.
    world: Option<World>,
}

/// One image of an approach.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFrame {
    /// Time since the start, s.
    pub time_s: f64,
    /// The true pose.
    pub truth_camera_from_tanker: Isometry3<f64>,
    /// What the detector reports: markers inside the image, with noise.
    pub detections: Vec<Detection>,
}

impl Approach {
    /// Returns an approach of `camera` to the tanker with `map`.
    #[must_use]
    pub fn new(settings: ApproachSettings, camera: Camera, map: MarkerMap) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        let phases = std::array::from_fn(|_| random.random_range(0.0..TAU));
        Self {
            settings,
            camera,
            map,
            phases,
            world: None,
        }
    }

    /// Returns the same approach in a world that a budget allows: survey and calibration are drawn once, the airframe
    /// moves, the image shakes. Camera and map stay what is believed.
    #[must_use]
    pub fn in_a_world_of(self, budget: &ErrorBudget) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
        random.set_stream(WORLD_STREAM);
        let world = World::draw(&self.camera, self.map.markers(), budget, &mut random);
        Self {
            world: Some(world),
            ..self
        }
    }

    /// Returns how many images it has.
    #[must_use]
    pub fn frame_count(&self) -> u32 {
        let frames = (self.settings.duration_s * self.settings.rate_hz)
            .round()
            .max(0.0);
        // Saturates, which is what a count of frames should do.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let frames = frames as u32;
        frames
    }

    /// Returns image `index`; any order gives the same images.
    #[must_use]
    pub fn frame(&self, index: u32) -> SimulatedFrame {
        let time_s = f64::from(index) / self.settings.rate_hz;
        let truth_camera_from_tanker = self.truth(time_s);
        let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
        random.set_stream(u64::from(index) + 1);
        let sigma_px = self.settings.sigma_px;
        let seen = match &self.world {
            None => Scene::new(self.camera.clone(), &self.map, truth_camera_from_tanker)
                .noisy_observations(sigma_px, &mut random),
            Some(world) => {
                world
                    .at(time_s)
                    .observe(&truth_camera_from_tanker, sigma_px, &mut random)
            }
        };
        let detections = seen
            .into_iter()
            .map(|seen| Detection {
                id: seen.id,
                u_px: seen.pixel.u,
                v_px: seen.pixel.v,
                sigma_px: self.settings.sigma_px,
            })
            .filter(|seen| self.is_in_image(seen))
            .collect();
        SimulatedFrame {
            time_s,
            truth_camera_from_tanker,
            detections,
        }
    }

    fn truth(&self, time_s: f64) -> Isometry3<f64> {
        let ApproachSettings {
            start_range_m,
            end_range_m,
            duration_s,
            attitude_deg,
            ..
        } = self.settings;
        let progress = if duration_s > 0.0 {
            (time_s / duration_s).clamp(0.0, 1.0)
        } else {
            1.0
        };
        // Speed is zero at both ends, as in a commanded move between two stations.
        let range_m =
            end_range_m + (start_range_m - end_range_m) * 0.5 * (1.0 + (PI * progress).cos());
        let wave = |k: usize| (TAU * time_s / PERIODS_S[k] + self.phases[k]).sin();
        pose_in_camera(
            Vector3::new(range_m, SWAY_M * wave(0), CLIMB * range_m),
            attitude_deg * wave(1),
            attitude_deg * wave(2),
            attitude_deg * wave(3),
        )
    }

    fn is_in_image(&self, seen: &Detection) -> bool {
        self.camera.image_size_px().is_none_or(|(width, height)| {
            (-0.5..f64::from(width) - 0.5).contains(&seen.u_px)
                && (-0.5..f64::from(height) - 0.5).contains(&seen.v_px)
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::estimation::FlexMode;
    use crate::simulation::{paper_camera, paper_scene};

    fn approach(seed: u64) -> Approach {
        let map = MarkerMap::shipped("paper").expect("shipped");
        Approach::new(
            ApproachSettings {
                seed,
                ..Default::default()
            },
            paper_camera(),
            map,
        )
    }

    #[test]
    fn same_seed_gives_the_same_bits_in_any_order() {
        let (a, b) = (approach(7), approach(7));
        let forward: Vec<_> = (0..20).map(|k| a.frame(k)).collect();
        let backward: Vec<_> = (0..20).rev().map(|k| b.frame(k)).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
        assert_ne!(approach(8).frame(3), forward[3]);
    }

    #[test]
    fn a_world_is_the_same_in_any_order_and_its_airframe_moves() {
        let markers = paper_scene().markers().to_vec();
        let bend = |marker: &crate::target::Marker| (marker.id, Vector3::new(0.0, 0.0, 0.3));
        let flex = FlexMode {
            name: "wing".to_owned(),
            time_constant_s: Some(2.0),
            shape: markers.iter().map(bend).collect(),
        };
        let budget = ErrorBudget::new(&[(1, 0.1)], vec![flex], vec![], 0.0).expect("a budget");
        let [a, b] = [(); 2].map(|()| approach(7).in_a_world_of(&budget));
        let forward: Vec<_> = (0..20).map(|k| a.frame(k)).collect();
        let backward: Vec<_> = (0..20).rev().map(|k| b.frame(k)).collect();
        assert!(forward.iter().eq(backward.iter().rev()));
        let mut squares = 0.0;
        for k in 0..2000_u32 {
            let amplitude = a
                .world
                .as_ref()
                .expect("a world")
                .at(f64::from(k))
                .flex_sigmas()[0];
            squares += amplitude * amplitude / 2000.0;
        }
        assert!((squares - 1.0).abs() < 0.1, "{squares}");
    }

    #[test]
    fn all_markers_stay_in_the_papers_image_on_the_default_route() {
        for seed in 0..5 {
            let approach = approach(seed);
            for index in 0..approach.frame_count() {
                assert_eq!(
                    approach.frame(index).detections.len(),
                    6,
                    "seed {seed}, frame {index}"
                );
            }
        }
    }
}
