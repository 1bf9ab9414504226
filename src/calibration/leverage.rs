//! What of each residual the fit has taken away: only with it do residuals tell a sigma.
//!
//! The residual of a point has the covariance `σ² 1 − J C Jᵀ`, `C` the covariance of all that was fitted. The trace of
//! that over `σ²` is the point's degrees of freedom; they add up to those of the whole adjustment.

use nalgebra::{DMatrix, Matrix2, SMatrix, Vector2};

use super::adjust::State;
use super::adjust::{FrameSums, own_covariance};
use super::model::{Model, OWN, OwnMatrix, Sight};

/// Below this share of freedom a residual says nothing of its own detection.
const LEAST_FREEDOM: f64 = 1e-3;

/// The residual of one point.
#[derive(Debug, Clone, Copy)]
pub(super) struct Residual {
    pub(super) id: u32,
    /// px.
    pub(super) px: Vector2<f64>,
    /// As stated, times the factor in use; without what noise that lasts adds.
    pub(super) sigma_px: f64,
    /// Degrees of freedom of column and row, 0 to 1 each.
    pub(super) freedom: Vector2<f64>,
    /// The square of the residual over its covariance: a chi-squared variable of two degrees of freedom; `None` where it
    /// has hardly any.
    pub(super) chi_squared: Option<f64>,
}

/// Sums over pairs of corners of one tag in one frame: residuals, and what they are without correlation.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct CornerSums {
    /// `eᵀe` and `eᵀKe`, `K` the pairs.
    pub(super) own: f64,
    pub(super) pairs: f64,
    /// `tr M`, `tr MK` and `tr MKMK`, `M` what the fit leaves of the noise.
    pub(super) m: f64,
    pub(super) mk: f64,
    pub(super) mkmk: f64,
}

/// The residuals of one frame.
#[derive(Debug, Clone)]
pub(super) struct FrameResiduals {
    pub(super) time_s: f64,
    pub(super) range_m: f64,
    pub(super) points: Vec<Residual>,
    pub(super) corners: CornerSums,
}

/// Returns the residuals of all frames.
///
/// # Inputs
/// * `covariance`: of the shared unknowns.
/// * `tag_of`: returns the tag of which a point is a corner.
pub(super) fn residuals(
    model: &Model,
    state: &State,
    sums: &[FrameSums],
    covariance: &DMatrix<f64>,
    tag_of: &dyn Fn(u32) -> Option<u32>,
) -> Option<Vec<FrameResiduals>> {
    let camera = model.unknowns.camera(model.camera, &state.values);
    let frames = state.frames.iter().zip(sums).map(|(frame, sums)| {
        let own = own_covariance(sums)?;
        let explained = own * &sums.coupling;
        let shared = covariance
            .select_rows(&sums.columns)
            .select_columns(&sums.columns);
        let sights = frame
            .points
            .iter()
            .map(|seen| model.sight(&camera, &state.values, frame, seen))
            .collect::<Option<Vec<Sight>>>()?;
        let points = frame.points.iter().zip(&sights).map(|(seen, sight)| {
            let mut by_shared = -(sight.by_own * &explained);
            for (column, by) in &sight.by_shared {
                if let Ok(at) = sums.columns.binary_search(column) {
                    let mut of_column = by_shared.column_mut(at);
                    of_column += by;
                }
            }
            let fitted: Matrix2<f64> = sight.by_own * own * sight.by_own.transpose()
                + &by_shared * &shared * by_shared.transpose();
            let left = Matrix2::identity() - fitted * sight.sigma_px.powi(-2);
            let freedom = left.diagonal().map(|value| value.clamp(0.0, 1.0));
            let whitened = sight.residual / seen.sigma_px;
            let is_telling = left.symmetric_eigenvalues().min() > LEAST_FREEDOM;
            let chi_squared = if is_telling {
                left.try_inverse()
                    .map(|inverse| whitened.dot(&(inverse * whitened)))
            } else {
                None
            };
            Residual {
                id: seen.id,
                px: sight.residual,
                sigma_px: seen.sigma_px,
                freedom,
                chi_squared,
            }
        });
        let points: Vec<Residual> = points.collect();
        Some(FrameResiduals {
            time_s: frame.time_s,
            range_m: frame.camera_from_tanker.translation.vector.norm(),
            corners: corner_sums(&points, &sights, &own, tag_of),
            points,
        })
    });
    frames.collect()
}

/// Returns the sums over pairs of corners; only the frame's own unknowns are counted as fitted, since the shared ones
/// have all frames.
fn corner_sums(
    points: &[Residual],
    sights: &[Sight],
    own: &OwnMatrix,
    tag_of: &dyn Fn(u32) -> Option<u32>,
) -> CornerSums {
    let tags: Vec<Option<u32>> = points.iter().map(|point| tag_of(point.id)).collect();
    let mut sums = CornerSums::default();
    let mut squares = OwnMatrix::zeros();
    let (mut pairs, mut pairs_twice) = (OwnMatrix::zeros(), OwnMatrix::zeros());
    for (i, sight) in sights.iter().enumerate() {
        // K times residuals and derivatives: the sum over the other corners.
        let (mut others, mut by_others) = (Vector2::zeros(), SMatrix::<f64, 2, OWN>::zeros());
        for (j, other) in sights.iter().enumerate() {
            if i != j && tags[i].is_some() && tags[i] == tags[j] {
                others += points[j].px / points[j].sigma_px;
                by_others += other.by_own / other.sigma_px;
                sums.mkmk += 2.0;
            }
        }
        let (residual, by) = (
            points[i].px / points[i].sigma_px,
            sight.by_own / sight.sigma_px,
        );
        sums.own += residual.norm_squared();
        sums.pairs += residual.dot(&others);
        sums.m += 2.0;
        squares += by.transpose() * by;
        pairs += by.transpose() * by_others;
        pairs_twice += by_others.transpose() * by_others;
    }
    if sums.mkmk == 0.0 {
        return CornerSums::default();
    }
    // With M = 1 − J C Jᵀ; K has no trace, and KK was counted above.
    sums.m -= (own * squares).trace();
    sums.mk -= (own * pairs).trace();
    let twice = own * pairs;
    sums.mkmk += (twice * twice).trace() - 2.0 * (own * pairs_twice).trace();
    sums
}
