//! Residuals at a pose, and the normal equations of one Gauss-Newton step, in whitened pixels.
//!
//! With `a = R p`, `M = DᵀD` and `s = Dᵀ r` of a point (`D` its whitened derivative, `r` its whitened residual), the
//! blocks of `JᵀJ` are `M`, `[a]× M` and `[a]× M [a]×ᵀ`, and the gradient is `s` and `a × s`. This takes fewer
//! operations than the products of the rows of `J`.

mod lens;
mod pinhole;
mod sums;
#[cfg(test)]
mod tests;

use super::centred_pose::CentredPose;
use super::lanes::information::{Information, Vector};

pub(crate) use lens::LensResiduals;
pub(crate) use pinhole::PinholeResiduals;
pub(crate) use sums::{SlopeSums, Sums, Weight};

/// Squared residuals and their first derivatives at a pose; rotation before position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearised<Kept = ()> {
    /// `JᵀJ`.
    pub(crate) information: Information,
    pub(crate) slope: Slope,
    pub(crate) kept: Kept,
}

/// Squared residuals and half their gradient at a pose; rotation before position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slope {
    pub(crate) gradient: Vector,
    pub(crate) chi_squared: f64,
    /// px², over columns and rows.
    pub(crate) squared_residuals_px: f64,
}

/// A sum of squared residuals to be minimised.
pub(crate) trait Residuals {
    /// What a linearisation passes on to slopes nearby.
    type Kept: Copy;
    /// Share by which the sum may rise in an accepted step; 0 if the weights do not depend on the pose.
    const RISE: f64;

    /// Returns the sums at a pose; `None` if a point has no pixel there.
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised<Self::Kept>>;

    /// As [`Self::linearise`] without second derivatives, where that saves time; `kept` is from a pose nearby.
    fn slope(&self, pose: &CentredPose, kept: &Self::Kept) -> Option<Slope>;
}
