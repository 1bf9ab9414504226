//! The sums over points from which the cost is computed.

use crate::camera::Ray;
use crate::estimation::lanes::four::{Arithmetic, Four, LANES, Lane, Number};
use crate::estimation::lanes::points::{Block, Points};
use crate::estimation::lanes::symmetric3::Symmetric3;

/// Returns `I − v vᵀ / (vᵀ v)`, the weight of the paper's object-space error.
///
/// # Source
/// Ding, Wei, Wang 2011, Eqs. (11)–(12).
#[inline(always)]
#[must_use]
pub(crate) fn object_space_weight(ray: Ray) -> Symmetric3 {
    let Ray { x, y } = ray;
    let s = 1.0 / (x * x + y * y + 1.0);
    [
        1.0 - x * x * s,
        -x * y * s,
        -x * s,
        1.0 - y * y * s,
        -y * s,
        1.0 - s,
    ]
}

/// The error of a point that is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weighting {
    /// The paper's object-space error, with equal weights.
    ObjectSpace,
    /// The squared pixel residual over its variance, times the squared depth, to first order: the cost
    /// of `SQPnP` (Terzakis, Lourakis, ECCV 2020), with a weight for each point.
    Image,
}

impl Weighting {
    /// Returns the weights of a block's points; zero for padding.
    #[inline(always)]
    pub(super) fn of<A: Arithmetic>(self, arithmetic: A, block: &Block) -> Symmetric3<Four<A>> {
        let load = |lane| Four::new(arithmetic, lane);
        match self {
            Self::ObjectSpace => {
                let (x, y) = (load(block.ray[0]), load(block.ray[1]));
                let (one, zero) = (Four::splat(arithmetic, 1.0), Four::splat(arithmetic, 0.0));
                let there = load(block.variance.map(|px2| if px2 > 0.0 { 1.0 } else { 0.0 }));
                let share = one / one.plus(x, x).plus(y, y);
                let (xs, ys) = (x * share, y * share);
                [
                    one.minus(x, xs),
                    zero.minus(x, ys),
                    zero - xs,
                    one.minus(y, ys),
                    zero - ys,
                    one - share,
                ]
                .map(|weight| weight * there)
            }
            Self::Image => {
                let (x, y) = (load(block.ray[0]), load(block.ray[1]));
                let [b11, b12, b22] = block.information;
                let (b11, b12, b22) = (load(b11), load(b12), load(b22));
                let zero = Four::splat(arithmetic, 0.0);
                let h1 = zero.minus(b11, x).minus(b12, y);
                let h2 = zero.minus(b12, x).minus(b22, y);
                let h3 = zero.minus(h1, x).minus(h2, y);
                [b11, b12, h1, b22, h2, h3]
            }
        }
    }
}

/// 1, x, y, z, xx, xy, xz, yy, yz, zz of a marker.
pub(super) const MONOMIALS: usize = 10;

/// `Σ W m` for each monomial `m` of a marker.
#[derive(Debug, Clone)]
#[repr(align(32))]
pub(crate) struct CollinearityMoments {
    /// The columns of each of these symmetric matrices.
    pub(super) columns: [[Lane; 3]; MONOMIALS],
}

impl CollinearityMoments {
    /// Returns the sums over all points.
    #[inline(always)]
    pub(crate) fn new<A: Arithmetic>(arithmetic: A, points: &Points, weighting: Weighting) -> Self {
        let mut columns = [[[0.0; LANES]; 3]; MONOMIALS];
        let none = Four::splat(arithmetic, 0.0);
        // Without distortion, columns and rows are uncorrelated and differ by a factor only.
        if let (Weighting::Image, Some(ratio)) = (weighting, points.row_by_column_information) {
            let w11 = sums_of(arithmetic, points, weighting, 0);
            let w13 = sums_of(arithmetic, points, weighting, 2);
            let w23 = sums_of(arithmetic, points, weighting, 4);
            let w33 = sums_of(arithmetic, points, weighting, 5);
            let ratio = Four::splat(arithmetic, ratio);
            for m in 0..MONOMIALS {
                columns[m] = [
                    Four::totals([w11[m], none, w13[m], none]).lane(),
                    Four::totals([none, w11[m] * ratio, w23[m], none]).lane(),
                    Four::totals([w13[m], w23[m], w33[m], none]).lane(),
                ];
            }
        } else {
            let w11 = sums_of(arithmetic, points, weighting, 0);
            let w12 = sums_of(arithmetic, points, weighting, 1);
            let w13 = sums_of(arithmetic, points, weighting, 2);
            let w22 = sums_of(arithmetic, points, weighting, 3);
            let w23 = sums_of(arithmetic, points, weighting, 4);
            let w33 = sums_of(arithmetic, points, weighting, 5);
            for m in 0..MONOMIALS {
                columns[m] = [
                    Four::totals([w11[m], w12[m], w13[m], none]).lane(),
                    Four::totals([w12[m], w22[m], w23[m], none]).lane(),
                    Four::totals([w13[m], w23[m], w33[m], none]).lane(),
                ];
            }
        }
        Self { columns }
    }
}

/// Returns `Σ w m` over all points for entry `w` of the weights and each monomial `m`.
///
/// Entry by entry, because the ten sums of one entry and their terms fill the sixteen registers.
#[inline(always)]
fn sums_of<A: Arithmetic>(
    arithmetic: A,
    points: &Points,
    weighting: Weighting,
    entry: usize,
) -> [Four<A>; MONOMIALS] {
    let mut sums = [Four::splat(arithmetic, 0.0); MONOMIALS];
    for block in points.blocks {
        let w = weighting.of(arithmetic, block)[entry];
        let x = Four::new(arithmetic, block.marker[0]);
        let y = Four::new(arithmetic, block.marker[1]);
        let z = Four::new(arithmetic, block.marker[2]);
        let (xw, yw, zw) = (x * w, y * w, z * w);
        sums[0] = sums[0] + w;
        sums[1] = sums[1] + xw;
        sums[2] = sums[2] + yw;
        sums[3] = sums[3] + zw;
        sums[4] = sums[4].plus(x, xw);
        sums[5] = sums[5].plus(x, yw);
        sums[6] = sums[6].plus(x, zw);
        sums[7] = sums[7].plus(y, yw);
        sums[8] = sums[8].plus(y, zw);
        sums[9] = sums[9].plus(z, zw);
    }
    sums
}
