//! A seeded approach to the tanker: the true pose and the detections of each frame.

use std::f64::consts::{PI, TAU};

use nalgebra::{Isometry3, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{Scene, World, pose_in_camera};
use crate::camera::Camera;
use crate::estimation::ErrorBudget;
use crate::pipeline::Detection;
use crate::target::MarkerMap;

/// Parameters of an approach.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ApproachSettings {
    /// Distance along the receiver's x axis at the start, m.
    pub start_range_m: f64,
    /// Distance along the receiver's x axis at the end, m.
    pub end_range_m: f64,
    /// Duration, s.
    pub duration_s: f64,
    /// Image rate.
    pub rate_hz: f64,
    /// Noise of the detector in columns and rows, px.
    pub sigma_px: f64,
    /// Time constant of the noise, s (a first-order Gauss–Markov process); 0: independent in each image.
    pub noise_time_constant_s: f64,
    /// Gusts: root mean square of the relative acceleration to the left and upwards, each, m/s².
    pub gust_mps2: f64,
    /// Amplitude of the relative attitude on each axis, degrees.
    pub attitude_deg: f64,
    /// Seed of the noise and of the motion's phases.
    pub seed: u64,
}

impl Default for ApproachSettings {
    /// 60 m to 15 m in 25 s at 30 Hz, half a pixel, ±3°. At 15 m the wing tips of the paper's tanker are still in the
    /// image of the paper's camera.
    fn default() -> Self {
        Self {
            start_range_m: 60.0,
            end_range_m: 15.0,
            duration_s: 25.0,
            rate_hz: 30.0,
            sigma_px: 0.5,
            noise_time_constant_s: 0.0,
            gust_mps2: 0.0,
            attitude_deg: 3.0,
            seed: 1,
        }
    }
}

/// Height of the tanker above the receiver relative to the range: the paper's route.
const CLIMB: f64 = 0.3;
/// m; lateral sway.
const SWAY_M: f64 = 0.4;
/// s; periods of sway, roll, pitch and yaw, without a common multiple.
const PERIODS_S: [f64; 4] = [11.0, 5.3, 7.1, 8.7];

/// s; periods of gusts to the left and upwards, without a common multiple.
const GUSTS_S: [f64; 4] = [0.7, 1.1, 1.9, 3.1];

/// Stream of the generator that draws the world; the images have the streams from 1 on.
const WORLD_STREAM: u64 = u64::MAX;
/// Streams from here on are those of correlated noise.
const NOISE_STREAM: u64 = 1 << 41;
/// Number of time constants after which noise has decayed to a thousandth.
const NOISE_MEMORY: f64 = 7.0;
/// Largest number of images that contribute to a noise value.
const MAX_NOISE_IMAGES: f64 = 10_000.0;

/// A seeded approach: the same settings give the same bits.
#[derive(Debug, Clone)]
pub struct Approach {
    settings: ApproachSettings,
    camera: Camera,
    map: MarkerMap,
    phases: [f64; 4],
    /// Leftwards and upwards.
    gust_phases: [[f64; GUSTS_S.len()]; 2],
    /// The true tanker and camera, where they differ from map and calibration.
    world: Option<World>,
}

/// One image of an approach.
#[derive(Debug, Clone, PartialEq)]
pub struct SimulatedFrame {
    /// Time since the start, s.
    pub time_s: f64,
    /// The true pose.
    pub truth_camera_from_tanker: Isometry3<f64>,
    /// The detections: markers inside the image, with noise.
    pub detections: Vec<Detection>,
}

impl Approach {
    /// Returns an approach of `camera` to the tanker with `map`.
    #[must_use]
    pub fn new(settings: ApproachSettings, camera: Camera, map: MarkerMap) -> Self {
        let mut random = ChaCha8Rng::seed_from_u64(settings.seed);
        let phases = std::array::from_fn(|_| random.random_range(0.0..TAU));
        let gust_phases = [(); 2].map(|()| GUSTS_S.map(|_| random.random_range(0.0..TAU)));
        Self {
            settings,
            camera,
            map,
            phases,
            gust_phases,
            world: None,
        }
    }

    /// Returns the same approach in a world drawn from a budget: survey and calibration are drawn once, the airframe
    /// bends over time, the image shakes. Camera and map remain the assumed ones.
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

    /// Returns the number of images.
    #[must_use]
    pub fn frame_count(&self) -> u32 {
        let frames = (self.settings.duration_s * self.settings.rate_hz)
            .round()
            .max(0.0);
        // The conversion saturates, which is right for a number of frames.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let frames = frames as u32;
        frames
    }

    /// Returns image `index`; the order of the calls does not matter.
    #[must_use]
    pub fn frame(&self, index: u32) -> SimulatedFrame {
        let time_s = f64::from(index) / self.settings.rate_hz;
        let truth_camera_from_tanker = self.truth(time_s);
        let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
        random.set_stream(u64::from(index) + 1);
        let lasting = self.lasting_noise(index);
        let sigma_px = if lasting.is_empty() {
            self.settings.sigma_px
        } else {
            0.0
        };
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
            .map(|seen| {
                let of_marker = lasting.iter().find(|(id, _)| *id == seen.id);
                let [u, v] = of_marker.map_or([0.0; 2], |(_, noise)| *noise);
                Detection {
                    id: seen.id,
                    u_px: seen.pixel.u + u,
                    v_px: seen.pixel.v + v,
                    sigma_px: self.settings.sigma_px,
                }
            })
            .filter(|seen| self.is_in_image(seen))
            .collect();
        SimulatedFrame {
            time_s,
            truth_camera_from_tanker,
            detections,
        }
    }

    /// Returns the correlated noise of each marker, px: the sum of the decayed contributions of this image and those
    /// before, so that it does not depend on the order of the calls.
    fn lasting_noise(&self, index: u32) -> Vec<(u32, [f64; 2])> {
        let images = self.settings.noise_time_constant_s * self.settings.rate_hz;
        // An invalid time constant counts as none.
        let lasts = images > 0.0;
        if !lasts {
            return Vec::new();
        }
        let kept = (-1.0 / images).exp();
        let mut noise: Vec<(u32, [f64; 2])> = (self.map.markers().iter())
            .map(|marker| (marker.id, [0.0; 2]))
            .collect();
        let mut weight_px = self.settings.sigma_px * (1.0 - kept * kept).sqrt();
        // Limited to ten thousand above.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let reach = (NOISE_MEMORY * images).clamp(1.0, MAX_NOISE_IMAGES) as u64;
        for back in 0..=reach {
            let mut random = ChaCha8Rng::seed_from_u64(self.settings.seed);
            random.set_stream(NOISE_STREAM + u64::from(index) - back);
            for (_, noise) in &mut noise {
                for axis in noise {
                    let new: f64 = StandardNormal.sample(&mut random);
                    *axis += weight_px * new;
                }
            }
            weight_px *= kept;
        }
        noise
    }

    /// Returns the displacement of the tanker by gusts, leftwards and upwards, m.
    fn gust(&self, time_s: f64) -> [f64; 2] {
        self.gust_phases.map(|phases| {
            let waves = GUSTS_S.iter().zip(phases).map(|(period_s, phase)| {
                let rate = TAU / period_s;
                (rate * time_s + phase).sin() / (rate * rate)
            });
            let amplitude = self.settings.gust_mps2 * (2.0 / GUSTS_S.len() as f64).sqrt();
            amplitude * waves.sum::<f64>()
        })
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
        // The speed is zero at both ends, as in a commanded move between two stations.
        let range_m =
            end_range_m + (start_range_m - end_range_m) * 0.5 * (1.0 + (PI * progress).cos());
        let wave = |k: usize| (TAU * time_s / PERIODS_S[k] + self.phases[k]).sin();
        let [left, up] = self.gust(time_s);
        pose_in_camera(
            Vector3::new(range_m, SWAY_M * wave(0) + left, CLIMB * range_m + up),
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

    /// Twelve numbers a frame, 1500 frames of which every thirtieth is new: 5 % of the variance, 1 % of the correlation.
    #[test]
    fn lasting_noise_has_its_sigma_and_its_time_constant_in_any_order() {
        let lasting = |noise_time_constant_s| {
            let settings = ApproachSettings {
                noise_time_constant_s,
                ..ApproachSettings::default()
            };
            let map = MarkerMap::shipped("paper").expect("shipped");
            Approach::new(settings, paper_camera(), map)
        };
        let [still, exact] = [0.5, 0.0].map(lasting);
        assert!(exact.lasting_noise(3).is_empty());
        assert_eq!(still.frame(20), lasting(0.5).frame(20));
        let noise: Vec<_> = (0..1500).map(|index| still.lasting_noise(index)).collect();
        let product = |lag: usize| {
            let pairs = noise.iter().zip(&noise[lag..]);
            let sum: f64 = pairs
                .flat_map(|(a, b)| a.iter().zip(b))
                .map(|((_, a), (_, b))| a[0] * b[0] + a[1] * b[1])
                .sum();
            sum / (12 * (noise.len() - lag)) as f64
        };
        assert!((product(0) / 0.25 - 1.0).abs() < 0.15, "{}", product(0));
        // A time constant is fifteen images.
        let kept = product(15) / product(0);
        assert!((kept - (-1.0_f64).exp()).abs() < 0.1, "{kept}");
    }

    #[test]
    fn gusts_have_their_acceleration() {
        const STEP_S: f64 = 0.01;
        let settings = ApproachSettings {
            gust_mps2: 0.8,
            ..ApproachSettings::default()
        };
        let map = MarkerMap::shipped("paper").expect("shipped");
        let approach = Approach::new(settings, paper_camera(), map);
        let mut squares = 0.0;
        for k in 0..6000_u32 {
            let at = |step: f64| approach.gust(STEP_S * (f64::from(k) + step))[0];
            let acceleration = (at(1.0) - 2.0 * at(0.0) + at(-1.0)) / (STEP_S * STEP_S);
            squares += acceleration * acceleration / 6000.0;
        }
        assert!((squares.sqrt() / 0.8 - 1.0).abs() < 0.05, "{squares}");
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
