//! Two files for one covariance: what map and camera claim apart is no less than what is wrong with both together.

use nalgebra::{DMatrix, SymmetricEigen};

/// Returns two matrices that dominate a joint covariance as its diagonal blocks: `[[A, B], [Bᵀ, C]] ≤ diag(A', C')`.
///
/// With `K = A^(−1/2) B C^(−1/2) = U r Vᵀ` the excess is `A^(1/2) U r Uᵀ A^(1/2)` and likewise for `C`: each pair of
/// canonical variables is widened by its own correlation.
pub(super) fn separate(joint: &DMatrix<f64>, first: usize) -> (DMatrix<f64>, DMatrix<f64>) {
    let second = joint.nrows() - first;
    let a = joint.view((0, 0), (first, first)).into_owned();
    let c = joint.view((first, first), (second, second)).into_owned();
    if first == 0 || second == 0 {
        return (a, c);
    }
    let b = joint.view((0, first), (first, second)).into_owned();
    let (root_a, inverse_a) = roots(&a);
    let (root_c, inverse_c) = roots(&c);
    let svd = (inverse_a * b * inverse_c).svd(true, true);
    let (Some(u), Some(v_t)) = (svd.u, svd.v_t) else {
        // Asked for above, so always there; twice each block dominates in any case.
        return (a * 2.0, c * 2.0);
    };
    let r = DMatrix::from_diagonal(&svd.singular_values);
    let (left, right) = (root_a * u, root_c * v_t.transpose());
    (
        a + &left * &r * left.transpose(),
        c + &right * &r * right.transpose(),
    )
}

/// Returns the symmetric root of a positive semidefinite matrix and the pseudo-inverse of that root.
fn roots(matrix: &DMatrix<f64>) -> (DMatrix<f64>, DMatrix<f64>) {
    let eigen = SymmetricEigen::new(matrix.clone());
    let floor = 1e-12 * eigen.eigenvalues.amax();
    let of = |power: fn(f64) -> f64| {
        let values = eigen.eigenvalues.map(|value| {
            if value > floor {
                power(value.sqrt())
            } else {
                0.0
            }
        });
        &eigen.eigenvectors * DMatrix::from_diagonal(&values) * eigen.eigenvectors.transpose()
    };
    (of(|root| root), of(f64::recip))
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::SeedableRng;
    use rand_chacha::ChaCha8Rng;
    use rand_distr::{Distribution, StandardNormal};

    fn least_eigenvalue(matrix: DMatrix<f64>) -> f64 {
        matrix.symmetric_eigenvalues().min()
    }

    fn drawn(size: usize, rank: usize, seed: u64) -> DMatrix<f64> {
        let mut random = ChaCha8Rng::seed_from_u64(seed);
        let factor = DMatrix::from_fn(size, rank, |_, _| {
            let normal: f64 = StandardNormal.sample(&mut random);
            0.01 * normal
        });
        &factor * factor.transpose()
    }

    #[test]
    fn separated_blocks_dominate_the_joint_covariance() {
        for seed in 0..20 {
            let joint = drawn(12, 12, seed);
            let (a, c) = separate(&joint, 9);
            let mut blocks = DMatrix::zeros(12, 12);
            blocks.view_mut((0, 0), (9, 9)).copy_from(&a);
            blocks.view_mut((9, 9), (3, 3)).copy_from(&c);
            let least = least_eigenvalue(blocks - &joint);
            assert!(least > -1e-10, "seed {seed}: {least}");
        }
    }
}
