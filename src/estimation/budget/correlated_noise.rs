//! Noise of single detections that is correlated from frame to frame.

/// Invalid parameters of correlated noise.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[error(
    "expected a share of noise from 0 to 1 and a finite time constant above 0 s, got {share} and {time_constant_s} s"
)]
pub struct CorrelatedNoiseError {
    /// The share.
    pub share: f64,
    /// The time constant, s.
    pub time_constant_s: f64,
}

/// The part of the noise of single detections that is correlated from frame to frame, as a first-order Gauss–Markov
/// process in u and in v of each marker. Examples: a detector that filters over time, a beacon whose glare wanders.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct CorrelatedNoise {
    share: f64,
    time_constant_s: f64,
}

impl CorrelatedNoise {
    /// Returns the checked parameters.
    ///
    /// # Inputs
    /// * `share`: correlated share of a detection's variance, 0 to 1.
    /// * `time_constant_s`: its time constant.
    ///
    /// # Errors
    /// [`CorrelatedNoiseError`]: out of range.
    pub fn new(share: f64, time_constant_s: f64) -> Result<Self, CorrelatedNoiseError> {
        let is_usable =
            (0.0..=1.0).contains(&share) && time_constant_s > 0.0 && time_constant_s.is_finite();
        is_usable
            .then_some(Self {
                share,
                time_constant_s,
            })
            .ok_or(CorrelatedNoiseError {
                share,
                time_constant_s,
            })
    }

    /// Returns the correlated share of a detection's variance.
    #[must_use]
    pub fn share(&self) -> f64 {
        self.share
    }

    /// Returns the time constant, s.
    #[must_use]
    pub fn time_constant_s(&self) -> f64 {
        self.time_constant_s
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_and_times_out_of_range_are_refused() {
        for (share, time_constant_s) in [
            (-0.1, 1.0),
            (1.1, 1.0),
            (f64::NAN, 1.0),
            (0.5, 0.0),
            (0.5, f64::INFINITY),
            (0.5, f64::NAN),
        ] {
            assert!(CorrelatedNoise::new(share, time_constant_s).is_err());
        }
        let noise = CorrelatedNoise::new(0.5, 2.0).expect("in range");
        assert_eq!((noise.share(), noise.time_constant_s()), (0.5, 2.0));
    }
}
