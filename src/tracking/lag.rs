//! Detection of a lagging track from the innovations of several frames.

use nalgebra::Vector6;

/// Weight of the newest innovation.
const WEIGHT: f64 = 0.2;
/// Effective number of frames in the mean: the variance of one innovation over that of the mean.
pub(super) const MEMORY_FRAMES: f64 = (2.0 - WEIGHT) / WEIGHT;
/// s; a manoeuvre is assumed to continue this long after the last indication.
const HOLD_S: f64 = 5.0;

/// The fading mean of the whitened innovations.
///
/// Innovations of a correct model are white, with unit variance and zero mean. If the tanker accelerates more than the
/// process noise allows, they become biased, long before a single one exceeds the gate.
///
/// # Source
/// Bar-Shalom, Li, Kirubarajan, *Estimation with Applications to Tracking and Navigation*, section 11.2 (adjustable
/// level process noise). DIFFERENCE: a mean of vectors instead of squares, because a lag has a direction and noise does
/// not.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub(super) struct Lag {
    mean: Vector6<f64>,
    hold_s: f64,
}

impl Lag {
    /// Returns whether the larger process noise is in use.
    pub(super) fn is_manoeuvring(&self) -> bool {
        self.hold_s > 0.0
    }

    /// Returns the state after one more accepted frame, `dt_s` after the last one.
    pub(super) fn with(&self, whitened: &Vector6<f64>, dt_s: f64, limit: f64) -> Self {
        let mean = self.mean * (1.0 - WEIGHT) + whitened * WEIGHT;
        let leans = mean.norm_squared() * MEMORY_FRAMES > limit;
        Self {
            mean,
            hold_s: if leans {
                HOLD_S
            } else {
                (self.hold_s - dt_s).max(0.0)
            },
        }
    }
}
