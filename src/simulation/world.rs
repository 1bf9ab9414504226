//! A world that differs from the estimator's assumptions, drawn from an error budget.

use std::f64::consts::TAU;

use nalgebra::{Isometry3, Point3, Vector3};
use rand::{Rng, RngExt};
use rand_distr::{Distribution, StandardNormal};

use crate::camera::{CalibrationChange, Camera, Ray};
use crate::estimation::{ErrorBudget, Observation};
use crate::target::Marker;

/// The true camera and tanker, and the assumed ones.
#[derive(Debug, Clone)]
pub struct World {
    /// The true camera.
    camera: Camera,
    /// Markers as on the map.
    believed: Vec<Marker>,
    /// True positions of the markers on the unbent tanker.
    surveyed: Vec<Point3<f64>>,
    budget: ErrorBudget,
    /// Amplitude of each flex mode in its sigmas.
    flex_sigmas: Vec<f64>,
    /// Phases of the waves that move each flex mode, rad.
    phases: Vec<[f64; WAVES_PER_CONSTANT.len()]>,
    /// The correlated noise of each marker in u and v, in its sigmas; empty without correlated noise.
    lasting_noise: Vec<[f64; 2]>,
}

/// Periods of the waves that move one amplitude, in time constants; without a common multiple.
const WAVES_PER_CONSTANT: [f64; 4] = [3.1, 4.7, 7.3, 11.9];

impl World {
    /// Returns a world drawn from a budget: survey, calibration and flex are drawn once.
    pub fn draw(
        camera: &Camera,
        markers: &[Marker],
        budget: &ErrorBudget,
        random: &mut impl Rng,
    ) -> Self {
        let surveyed = markers
            .iter()
            .map(|marker| {
                let error = Vector3::from_fn(|_, _| normal(random));
                marker.marker_in_tanker + error * budget.survey_sigma_m(marker.id)
            })
            .collect();
        let change = budget
            .calibration()
            .iter()
            .fold(CalibrationChange::zeros(), |change, mode| {
                change + mode.change * normal(random)
            });
        let flex_sigmas = budget.flex().iter().map(|_| normal(random)).collect();
        let phases = budget
            .flex()
            .iter()
            .map(|_| WAVES_PER_CONSTANT.map(|_| random.random_range(0.0..TAU)))
            .collect();
        let noisy = budget.correlated_noise().map_or(0, |_| markers.len());
        let lasting_noise = (0..noisy)
            .map(|_| [normal(random), normal(random)])
            .collect();
        Self {
            camera: camera.with_change(&change),
            believed: markers.to_vec(),
            surveyed,
            budget: budget.clone(),
            flex_sigmas,
            phases,
            lasting_noise,
        }
    }

    /// Returns the world at a time: flex modes with a time constant move as a sum of waves with a total of one sigma,
    /// independently of earlier calls. Correlated noise is unchanged: an [`Approach`](super::Approach) has its own.
    #[must_use]
    pub fn at(&self, time_s: f64) -> Self {
        let mut world = self.clone();
        let modes = self.budget.flex().iter().zip(&self.phases);
        for ((mode, phases), amplitude) in modes.zip(&mut world.flex_sigmas) {
            if let Some(time_constant_s) = mode.time_constant_s {
                *amplitude = waves(time_s / time_constant_s, phases);
            }
        }
        world
    }

    /// Returns the true camera.
    #[must_use]
    pub fn camera(&self) -> &Camera {
        &self.camera
    }

    /// Returns the amplitude of each flex mode in its sigmas.
    #[must_use]
    pub fn flex_sigmas(&self) -> &[f64] {
        &self.flex_sigmas
    }

    /// Sets the amplitudes of the flex modes, in their sigmas; modes that are not listed are unchanged.
    pub fn set_flex(&mut self, sigmas: &[f64]) {
        for (amplitude, sigma) in self.flex_sigmas.iter_mut().zip(sigmas) {
            *amplitude = *sigma;
        }
    }

    /// Advances the time: flex modes with a time constant, and correlated noise, change as first-order Gauss–Markov
    /// processes with that constant and one sigma.
    pub fn advance(&mut self, seconds: f64, random: &mut impl Rng) {
        let mut wander = |amplitude: &mut f64, time_constant_s: f64| {
            let kept = (-seconds / time_constant_s).exp();
            *amplitude = kept * *amplitude + (1.0 - kept * kept).sqrt() * normal(random);
        };
        for (amplitude, mode) in self.flex_sigmas.iter_mut().zip(self.budget.flex()) {
            if let Some(time_constant_s) = mode.time_constant_s {
                wander(amplitude, time_constant_s);
            }
        }
        if let Some(noise) = self.budget.correlated_noise() {
            for amplitude in self.lasting_noise.iter_mut().flatten() {
                wander(amplitude, noise.time_constant_s());
            }
        }
    }

    /// Returns a frame of this world: the true pixels with jitter and noise, with the marker positions of the map.
    /// Markers behind the camera or outside its lens model are missing.
    pub fn observe(
        &self,
        camera_from_tanker: &Isometry3<f64>,
        sigma_px: f64,
        random: &mut impl Rng,
    ) -> Vec<Observation> {
        let jitter = [(); 2].map(|()| self.budget.jitter_px() * normal(random));
        let share = self
            .budget
            .correlated_noise()
            .map_or(0.0, |noise| noise.share());
        self.believed
            .iter()
            .zip(&self.surveyed)
            .enumerate()
            .filter_map(|(index, (marker, surveyed))| {
                let lasting = self.lasting_noise.get(index);
                let noise = [0, 1].map(|axis| {
                    let lasting = lasting.map_or(0.0, |noise| share.sqrt() * noise[axis]);
                    sigma_px * (lasting + (1.0 - share).sqrt() * normal(random))
                });
                let q = camera_from_tanker * (surveyed + self.flex_of(marker.id));
                if q.z <= 0.0 {
                    return None;
                }
                let ray = Ray::through(&q.coords);
                let (mut pixel, _) = self.camera.project(ray)?;
                pixel.u += jitter[0] + noise[0];
                pixel.v += jitter[1] + noise[1];
                Some(Observation {
                    id: marker.id,
                    marker_in_tanker: marker.marker_in_tanker,
                    pixel,
                    sigma_px,
                })
            })
            .collect()
    }

    /// Returns the displacement of a marker by the bent airframe, m.
    fn flex_of(&self, id: u32) -> Vector3<f64> {
        let modes = self.budget.flex().iter().zip(&self.flex_sigmas);
        modes
            .filter_map(|(mode, amplitude)| {
                let (_, shift) = mode.shape.iter().find(|(marker, _)| *marker == id)?;
                Some(shift * *amplitude)
            })
            .sum()
    }
}

/// Returns a sum of waves of unit variance at a time in time constants.
fn waves(time: f64, phases: &[f64; WAVES_PER_CONSTANT.len()]) -> f64 {
    let waves = WAVES_PER_CONSTANT.iter().zip(phases);
    let sum: f64 = waves
        .map(|(period, phase)| (TAU * time / period + phase).sin())
        .sum();
    sum * (2.0 / WAVES_PER_CONSTANT.len() as f64).sqrt()
}

fn normal(random: &mut impl Rng) -> f64 {
    StandardNormal.sample(random)
}
