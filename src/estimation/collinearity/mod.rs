//! The object-space error of all points as one quadratic form in the rotation alone.
//!
//! With `q = R p + c` the camera coordinates of a marker, `p` relative to the markers' mean, and one weight matrix `W`
//! per point whose null space is the point's ray, the error is `Σ qᵀ W q`. Its minimum over `c` is in closed form,
//! `c = T r` with `r = vec(R)` (column-major), which leaves `E(R) = rᵀ Ω r`: a 9×9 matrix, computed once per frame. The
//! iterations then do not access the points.
//!
//! | paper           | here                                     |
//! |-----------------|------------------------------------------|
//! | `E(R, t)` (12)  | [`CollinearityCost::value`], `W = I − V` |
//! | `t(R)` (13)     | [`CollinearityCost::centre_in_camera`]   |
//! | `Vᵢ` (11)       | `I − W` of [`object_space_weight`]       |
//!
//! The entries of one column of the rotation are kept in one register, with its fourth number zero, so that sums,
//! columns of `Ω` and of `T` are used as they are loaded.

mod cost;
mod moments;
#[cfg(test)]
mod tests;

pub(crate) use cost::{CollinearityCost, PRODUCTS, combined, products};
pub(crate) use moments::{CollinearityMoments, Weighting, object_space_weight};

/// Index of entry `(a, b)` of a symmetric matrix in [`super::symmetric3::Symmetric3`].
const ENTRY: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];
