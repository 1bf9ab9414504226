//! Protection levels: bounds that the error of a pose exceeds with a stated probability at most, faults that nothing
//! has detected included.
//!
//! The covariance of a pose says how large errors are while all beacons are what they seem to be. A protection level
//! adds what happens when one or two of them are not, and the test of the residuals does not show it. For every
//! hypothesis about a fault (each beacon, each pair, each mode of the budget that is declared to fail) the estimate
//! without the suspects is compared with the one in use; *solution separation*, as in advanced receiver autonomous
//! integrity monitoring (ARAIM) for satellite navigation:
//!
//! ```text
//! separation   dₖ = aᵀ P Jᵀ W Eₖ Sₖ⁻¹ Eₖᵀ W r,   Sₖ = Eₖᵀ M Eₖ        variance  σ²ss = aᵀ P Jᵀ W Eₖ Sₖ⁻¹ Eₖᵀ W J P a
//! threshold    Tₖ = Q⁻¹(P_FA / (2 N)) σss                             variance  σ²ₖ = σ²₀ + σ²ss
//! level        2 Q(L/σ₀) + Σₖ pₖ Q((L − Tₖ)/σₖ) = (P_HMI − P_unmonitored) / 3
//! ```
//!
//! `Eₖ` selects the pixels of the suspects, or is the shift of a mode; `a` is an axis of the receiver at a declared
//! point of the tanker; `N` counts hypotheses, axes and points. A separation beyond its threshold, or faults that
//! nothing monitors and that are more likely than the risk allows, give no level but a reason.
//!
//! Knows `estimation`, `target`, `camera` and `geometry`; never a clock, a file or a topic.
//!
//! # Source
//! Blanch et al., "Baseline advanced RAIM user algorithm and possible improvements", *IEEE Trans. Aerospace and
//! Electronic Systems* 51(1), 2015; here with pixels for ranges, beacons for satellites, and an error budget in place
//! of the bias bounds.

mod alone;
mod declared;
mod frame;
mod gaussian;
mod hypotheses;
mod level;
mod monitor;
mod projection;
mod search;
mod separation;
mod track;

pub use declared::{IntegrityPoint, Mount};
pub use frame::{AboveLimit, FrameIntegrity, PointIntegrity, SolvedFrame, Unavailable};
pub use hypotheses::{Beacon, Hypothesis};
pub use monitor::IntegrityMonitor;
pub use track::{FrameSeparations, TrackSeparation, TrackSeparations};

/// Probabilities that protection levels are computed from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct IntegritySettings {
    /// With this probability at most, an error exceeds its level in one of [`Self::frames`] frames without an alert.
    pub hmi_probability: f64,
    /// With this probability at most, one of so many frames without any fault raises an alert.
    pub false_alert_probability: f64,
    /// Probability that a given beacon is faulty at some time during so many frames.
    pub fault_probability: f64,
    /// Whether two beacons may be faulty at once; if not, that counts as unmonitored.
    pub pairs: bool,
    /// Probability that a flex mode is beyond what its sigma allows, each; 0: that never happens.
    pub flex_fault_probability: f64,
    /// The same for each mode of calibration and jitter.
    pub calibration_fault_probability: f64,
    /// Frames over which the probabilities hold: 1, or those of an approach. By the union bound, so it does not matter
    /// how much of their errors they share.
    pub frames: u32,
}

impl IntegritySettings {
    /// Returns whether there are pairs, faulty flex modes, and faulty calibrations among the hypotheses.
    #[must_use]
    pub fn kinds_of_faults(&self) -> [bool; 3] {
        [
            self.pairs,
            self.flex_fault_probability > 0.0,
            self.calibration_fault_probability > 0.0,
        ]
    }
}

impl IntegritySettings {
    /// Returns the probability that a mode of the budget is beyond what its sigma allows; flex modes come first.
    pub(crate) const fn mode_fault_probability(&self, mode: usize, flex_modes: usize) -> f64 {
        if mode < flex_modes {
            self.flex_fault_probability
        } else {
            self.calibration_fault_probability
        }
    }
}

impl Default for IntegritySettings {
    /// The node's: a risk of 1e-7 and a false alert of 1e-5 a frame, faults of 1e-4 a beacon, pairs included.
    fn default() -> Self {
        Self {
            hmi_probability: 1e-7,
            false_alert_probability: 1e-5,
            fault_probability: 1e-4,
            pairs: true,
            flex_fault_probability: 0.0,
            calibration_fault_probability: 0.0,
            frames: 1,
        }
    }
}
