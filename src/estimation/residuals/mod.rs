//! Residuals at a pose, and the normal equations of one Gauss-Newton step, in whitened pixels.
//!
//! With `a = R p`, `M = DᵀD` and `s = Dᵀ r` of a point (`D` its whitened derivative, `r` its whitened
//! residual), the blocks of `JᵀJ` are `M`, `[a]× M` and `[a]× M [a]×ᵀ`, and the gradient is `s` and
//! `a × s`: less work than the products of the rows of `J`.

mod lens;
mod pinhole;
mod sums;
#[cfg(test)]
mod tests;

use super::centred_pose::CentredPose;
use super::lanes::information::{Information, Vector};

pub(crate) use lens::LensResiduals;
pub(crate) use pinhole::PinholeResiduals;

/// Squared residuals and their first derivatives at a pose; rotation before position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearised {
    /// `JᵀJ`.
    pub(crate) information: Information,
    pub(crate) slope: Slope,
}

/// Squared residuals and half their gradient at a pose; rotation before position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Slope {
    pub(crate) gradient: Vector,
    pub(crate) chi_squared: f64,
    /// px², over columns and rows.
    pub(crate) squared_residuals_px: f64,
}

/// What is minimised.
pub(crate) trait Residuals {
    /// Returns the residuals' sums at a pose; none when a point has no pixel there.
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised>;

    /// Returns the same without second derivatives, where that is less work.
    #[inline(always)]
    fn slope(&self, pose: &CentredPose) -> Option<Slope> {
        self.linearise(pose).map(|here| here.slope)
    }
}
