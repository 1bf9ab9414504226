//! Proof that a minimum of the quadratic cost is the best of all attitudes with the markers in front of the camera.
//!
//! A rotation `R = R̂ R(q)` from the minimum `R̂`, with `q = (q₀, u)` a quaternion, makes the cost `E` a polynomial of
//! degree four in `q`, and the depth of the markers' mean, `depth(q)`, one of degree two. If
//!
//! ```text
//! E(q) − E(R̂) |q|⁴  =  zᵀ X z  +  depth(q) · uᵀ S u,    X and S positive definite,
//! ```
//!
//! `z` the nine products of two components of `q` other than `q₀²`, then no attitude with the mean in front of the camera
//! has a lower cost than `R̂`. If every marker is in front, so is the mean. Without the second term the statement would
//! be about all attitudes, and far away it is often false: the lowest cost of all is then behind the camera.
//!
//! Many `X` give the same polynomial: fourteen numbers are free, and the six of `S` ([`family`]). One suitable choice is
//! the proof ([`search`]). It is checked by Cholesky factorisation with a margin for rounding ([`family::is_proof`]), so
//! that an error of the search can miss a proof, but not fake one. Without a proof nothing is known: the minimum may be
//! wrong, or right and not proven.
//!
//! The proof is about a minimum of this cost. Maximum likelihood starts there but minimises another cost (pixels instead
//! of distances from rays, a lens, an error budget, a prior), which agrees with this one to first order in the noise.
//!
//! # Source
//! Sums of squares: Parrilo, *Mathematical Programming* 96, 2003. For the rotation of a pose: Briales,
//! Gonzalez-Jimenez, *Convex Global 3D Registration with Lagrangian Duality*, CVPR 2017. Omitting `q₀²`, so
//! that `X` can be positive definite although the polynomial is zero at the minimum, and the multiplier of the depth are
//! ours.

mod dense;
mod family;
mod form;
mod search;
#[cfg(test)]
mod statistics;
#[cfg(test)]
mod tests;

use nalgebra::Rotation3;

use super::collinearity::CollinearityCost;
use super::lanes::four::{Arithmetic, Kernel, vectorised};
use form::Form;

/// Returns whether it is proven that no attitude with the markers' mean in front of the camera has a cost lower than that
/// of a minimum by more than `tolerance`.
///
/// # Inputs
/// * `minimum`: exact but for rounding: a remaining gradient counts against the tolerance.
pub(crate) fn is_best_in_front(
    cost: &CollinearityCost,
    minimum: &Rotation3<f64>,
    tolerance: f64,
) -> bool {
    vectorised(Proof {
        cost,
        minimum,
        tolerance,
    })
}

struct Proof<'a> {
    cost: &'a CollinearityCost,
    minimum: &'a Rotation3<f64>,
    tolerance: f64,
}

impl Kernel for Proof<'_> {
    type Output = bool;

    #[inline(always)]
    fn run<A: Arithmetic>(self, _: A) -> bool {
        let form = Form::new(
            &self.cost.omega(),
            &self.cost.depth_from_rotation(),
            self.minimum.matrix(),
        );
        form.rest <= self.tolerance && search::find(&form)
    }
}
