//! Settings of the filter, and their check.

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::model::Noise;

/// Probability per frame that a track that does not lag is not reported as lagging. A false alarm costs little: a
/// noisier velocity for some seconds.
const LAG_PROBABILITY: f64 = 0.9999;

/// Assumed motion of the tanker relative to the camera, and criteria for a track.
///
/// The two densities are the growth of the uncertainty of velocity and rate: without detections a standard deviation
/// grows as `density · √t`, so 0.2 m/s²/√Hz adds 0.2 m/s in one second, 0.4 m/s in four. An acceleration of standard
/// deviation `a` that lasts for a time `τ` before it changes has the density `a √(2 τ)`. With too small a density the
/// track lags in a manoeuvre and is overconfident; with too large a one it is only noisier, so choose the larger if in
/// doubt.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FilterSettings {
    /// Spectral density of the relative acceleration on each axis, m/s²/√Hz.
    pub acceleration_density_mps2: f64,
    /// Spectral density of the relative angular acceleration on each axis, deg/s²/√Hz.
    pub angular_acceleration_density_dps2: f64,
    /// Both densities are multiplied by this while the innovations show that the track lags; 1: never.
    pub manoeuvre_factor: f64,
    /// Standard deviation of the relative velocity on each axis when a track begins, m/s.
    pub initial_speed_sigma_mps: f64,
    /// Standard deviation of the relative rate on each axis when a track begins, deg/s.
    pub initial_rate_sigma_dps: f64,
    /// Added to the variance of each measured position axis, for unmodelled errors of calibration and map, m.
    pub position_floor_m: f64,
    /// Added to the variance of each measured attitude axis, degrees.
    pub attitude_floor_deg: f64,
    /// Probability that a correct frame passes the gate.
    pub gate_probability: f64,
    /// The track is dropped this long after the last accepted frame, s.
    pub max_gap_s: f64,
    /// Consistent frames that confirm a candidate, including the first.
    pub confirm_frames: u32,
}

impl Default for FilterSettings {
    /// For a receiver that keeps station or closes slowly behind a tanker.
    fn default() -> Self {
        Self {
            acceleration_density_mps2: 0.15,
            angular_acceleration_density_dps2: 4.0,
            manoeuvre_factor: 5.0,
            initial_speed_sigma_mps: 3.0,
            initial_rate_sigma_dps: 10.0,
            position_floor_m: 1e-3,
            attitude_floor_deg: 0.01,
            gate_probability: 0.9999,
            max_gap_s: 1.0,
            confirm_frames: 5,
        }
    }
}

/// A setting outside its range.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error("{name}: expected {least} to {most}, got {got}")]
pub struct FilterSettingsError {
    /// Name of the setting.
    pub name: &'static str,
    /// Smallest value allowed.
    pub least: f64,
    /// Largest value allowed.
    pub most: f64,
    /// The value.
    pub got: f64,
}

/// Settings that passed their check, from which a [`Filter`](super::Filter) is made.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CheckedFilterSettings {
    settings: FilterSettings,
    pub(super) checked: Checked,
}

impl CheckedFilterSettings {
    /// Returns the original settings.
    #[must_use]
    pub const fn settings(&self) -> &FilterSettings {
        &self.settings
    }
}

/// Settings that passed their check, in SI and radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Checked {
    pub(super) noise: Noise,
    pub(super) manoeuvre_noise: Noise,
    /// Limit of the squared fading mean of the innovations.
    pub(super) lag_limit: f64,
    /// (m/s)².
    pub(super) initial_speed_variance: f64,
    /// (rad/s)².
    pub(super) initial_rate_variance: f64,
    /// m².
    pub(super) position_floor_variance: f64,
    /// rad².
    pub(super) attitude_floor_variance: f64,
    /// Limit of the squared innovation.
    pub(super) gate: f64,
    pub(super) max_gap_s: f64,
    pub(super) confirm_frames: u32,
}

impl FilterSettings {
    /// Returns the settings, checked.
    ///
    /// # Errors
    /// [`FilterSettingsError`] names the first setting out of range.
    pub fn checked(self) -> Result<CheckedFilterSettings, FilterSettingsError> {
        Ok(CheckedFilterSettings {
            checked: self.check()?,
            settings: self,
        })
    }

    /// Returns the settings in the units of the filter.
    ///
    /// The ranges keep the ratio of the largest to the smallest variance well within the resolution of doubles.
    fn check(&self) -> Result<Checked, FilterSettingsError> {
        let within = |name, got: f64, least: f64, most: f64| {
            if (least..=most).contains(&got) {
                Ok(got)
            } else {
                Err(FilterSettingsError {
                    name,
                    least,
                    most,
                    got,
                })
            }
        };
        let square = |value: f64| value * value;
        let limit = |probability| {
            // Six degrees of freedom are always allowed.
            ChiSquared::new(6.0).map_or(0.0, |law| law.inverse_cdf(probability))
        };
        let gate_probability = within("gate_probability", self.gate_probability, 0.5, 0.999_999_9)?;
        let confirm_frames = f64::from(self.confirm_frames);
        within("confirm_frames", confirm_frames, 2.0, 1000.0)?;
        let noise = Noise {
            acceleration: square(within(
                "acceleration_density_mps2",
                self.acceleration_density_mps2,
                1e-4,
                1e3,
            )?),
            angular_acceleration: square(
                within(
                    "angular_acceleration_density_dps2",
                    self.angular_acceleration_density_dps2,
                    1e-3,
                    1e4,
                )?
                .to_radians(),
            ),
        };
        let factor = within("manoeuvre_factor", self.manoeuvre_factor, 1.0, 100.0)?;
        Ok(Checked {
            noise,
            manoeuvre_noise: noise.times(factor),
            lag_limit: if factor > 1.0 {
                limit(LAG_PROBABILITY)
            } else {
                f64::INFINITY
            },
            initial_speed_variance: square(within(
                "initial_speed_sigma_mps",
                self.initial_speed_sigma_mps,
                1e-3,
                1e3,
            )?),
            initial_rate_variance: square(
                within(
                    "initial_rate_sigma_dps",
                    self.initial_rate_sigma_dps,
                    1e-2,
                    1e3,
                )?
                .to_radians(),
            ),
            position_floor_variance: square(within(
                "position_floor_m",
                self.position_floor_m,
                1e-6,
                1e2,
            )?),
            attitude_floor_variance: square(
                within("attitude_floor_deg", self.attitude_floor_deg, 1e-5, 1e1)?.to_radians(),
            ),
            gate: limit(gate_probability),
            max_gap_s: within("max_gap_s", self.max_gap_s, 1e-3, 60.0)?,
            confirm_frames: self.confirm_frames,
        })
    }
}
