//! Definition of the pose error and of the order of its covariance.

use nalgebra::{Isometry3, Matrix3, Matrix6, Rotation3, SMatrix, Vector6};

use super::rotation::skew;

/// Covariance of a pose `b_from_a`, in ROS's convention (`geometry_msgs/PoseWithCovariance`).
///
/// Order (x, y, z, rotX, rotY, rotZ), in m and rad, along and about the fixed axes of frame `b`, the message's
/// `header.frame_id`. The error is on the left, with position and attitude separate: `t = t̂ + δt`, `R = Exp(δθ) R̂`,
/// see [`pose_error`]. It is therefore not the covariance of an se(3) twist, and converting it to other axes is
/// `blockdiag(Q, Q) Σ blockdiag(Q, Q)ᵀ`, as in tf2 and MAVROS.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseCovariance(pub Matrix6<f64>);

impl PoseCovariance {
    /// Returns the 36 numbers row by row, as in ROS messages.
    #[must_use]
    pub fn row_major(&self) -> [f64; 36] {
        std::array::from_fn(|i| self.0[(i / 6, i % 6)])
    }

    /// Returns the covariance of the same pose error with its vectors expressed in axes rotated by `rotation`.
    #[must_use]
    pub fn rotated(&self, rotation: &Rotation3<f64>) -> Self {
        let mut q = Matrix6::zeros();
        q.fixed_view_mut::<3, 3>(0, 0).copy_from(rotation.matrix());
        q.fixed_view_mut::<3, 3>(3, 3).copy_from(rotation.matrix());
        Self(congruent(&q, &self.0))
    }

    /// Returns `eᵀ Σ⁻¹ e`, the squared Mahalanobis distance of a pose error (NEES if the error is against the truth);
    /// `None` if the covariance is not positive definite.
    #[must_use]
    pub fn mahalanobis_squared(&self, error: &Vector6<f64>) -> Option<f64> {
        self.0
            .cholesky()
            .map(|factor| error.dot(&factor.solve(error)))
    }

    /// Returns the largest standard deviation of the attitude in any direction, rad.
    #[must_use]
    pub fn largest_attitude_sigma(&self) -> f64 {
        let attitude = self.0.fixed_view::<3, 3>(3, 3).into_owned();
        attitude.symmetric_eigenvalues().max().max(0.0).sqrt()
    }

    /// Returns what [`Self::largest_attitude_sigma`] cannot exceed, rad: the root of the sum of the eigenvalues.
    #[must_use]
    pub(crate) fn attitude_sigma_bound(&self) -> f64 {
        (self.0[(3, 3)] + self.0[(4, 4)] + self.0[(5, 5)]).sqrt()
    }

    /// Returns whether the matrix is finite, symmetric and positive definite.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        self.0.iter().all(|value| value.is_finite())
            && is_symmetric(&self.0)
            && self.0.cholesky().is_some()
    }

    /// Returns the covariance of `(δt, δθ)` from that of `(δθ, δc)`, where `c = t + lever` is the position in frame `b`
    /// of a point fixed to `a`, and `lever` goes from `a`'s origin to it.
    pub(crate) fn from_point(
        rotation_then_point: &Matrix6<f64>,
        lever: &nalgebra::Vector3<f64>,
    ) -> Self {
        // t = c − R l, and δ(R l) = δθ × lever, so δt = δc + lever × δθ.
        let m = rotation_then_point;
        let block = |row, column| {
            Matrix3::new(
                m[(row, column)],
                m[(row, column + 1)],
                m[(row, column + 2)], //
                m[(row + 1, column)],
                m[(row + 1, column + 1)],
                m[(row + 1, column + 2)], //
                m[(row + 2, column)],
                m[(row + 2, column + 1)],
                m[(row + 2, column + 2)],
            )
        };
        let lever = skew(*lever);
        let (turn, point_by_turn) = (block(0, 0), block(3, 0));
        let mixed = point_by_turn + lever * turn;
        let moved = lever * point_by_turn.transpose();
        let position = block(3, 3) + (moved + moved.transpose()) + lever * turn * lever.transpose();
        let mut covariance = Matrix6::zeros();
        for row in 0..3 {
            for column in 0..3 {
                covariance[(row, column)] = position[(row.min(column), row.max(column))];
                // One triangle is used for both, because the input may be symmetric only up to rounding.
                covariance[(3 + row, 3 + column)] = turn[(row.min(column), row.max(column))];
                covariance[(row, 3 + column)] = mixed[(row, column)];
                covariance[(3 + column, row)] = mixed[(row, column)];
            }
        }
        Self(covariance)
    }
}

/// Returns the error of `found` against `truth` in the coordinates of [`PoseCovariance`]:
/// `(t − t̂, Log(R R̂ᵀ))`, m and rad.
#[must_use]
pub fn pose_error(truth: &Isometry3<f64>, found: &Isometry3<f64>) -> Vector6<f64> {
    let position = truth.translation.vector - found.translation.vector;
    let rotation = (truth.rotation * found.rotation.inverse()).scaled_axis();
    Vector6::new(
        position.x, position.y, position.z, rotation.x, rotation.y, rotation.z,
    )
}

/// Returns `J Σ Jᵀ`, exactly symmetric.
#[must_use]
pub fn congruent<const M: usize, const N: usize>(
    jacobian: &SMatrix<f64, M, N>,
    covariance: &SMatrix<f64, N, N>,
) -> SMatrix<f64, M, M> {
    let full = jacobian * covariance * jacobian.transpose();
    (full + full.transpose()) * 0.5
}

/// Returns the symmetric `S` such that `S S` is a covariance, which may be singular; eigenvalues that are negative by
/// rounding count as zero. Unlike a triangular root it is continuous, so its columns keep their meaning from frame to
/// frame.
pub(crate) fn principal_root(covariance: &Matrix6<f64>) -> Matrix6<f64> {
    let eigen = covariance.symmetric_eigen();
    let roots = eigen.eigenvalues.map(|value| value.max(0.0).sqrt());
    eigen.eigenvectors * Matrix6::from_diagonal(&roots) * eigen.eigenvectors.transpose()
}

/// Whether a matrix of finite numbers equals its transpose.
fn is_symmetric(matrix: &Matrix6<f64>) -> bool {
    let is_same = |row, column| (matrix[(row, column)] - matrix[(column, row)]).abs() <= 0.0;
    (0..6).all(|row| (0..row).all(|column| is_same(row, column)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion, Vector3};

    #[test]
    fn pose_error_recovers_a_left_increment() {
        let found = Isometry3::new(Vector3::new(1.0, 2.0, 15.0), Vector3::new(0.1, -0.4, 0.7));
        let (dt, dtheta) = (
            Vector3::new(0.01, -0.02, 0.03),
            Vector3::new(1e-3, 2e-3, -3e-3),
        );
        let truth = Isometry3::from_parts(
            Translation3::from(found.translation.vector + dt),
            UnitQuaternion::from_scaled_axis(dtheta) * found.rotation,
        );
        let error = pose_error(&truth, &found);
        let expected = Vector6::new(dt.x, dt.y, dt.z, dtheta.x, dtheta.y, dtheta.z);
        assert!((error - expected).norm() < 1e-14);
    }

    #[test]
    fn moving_the_reference_point_matches_finite_motion() {
        let lever = Vector3::new(0.5, -1.0, 2.0);
        // A pure rotation error about the point moves the origin by lever × δθ.
        let mut about_point = Matrix6::zeros();
        about_point[(2, 2)] = 1.0;
        let covariance = PoseCovariance::from_point(&about_point, &lever).0;
        let moved = lever.cross(&Vector3::z());
        for i in 0..3 {
            for j in 0..3 {
                assert!((covariance[(i, j)] - moved[i] * moved[j]).abs() < 1e-15);
            }
        }
        assert!((covariance[(5, 5)] - 1.0).abs() < 1e-15);
        assert!((covariance[(0, 5)] - moved.x).abs() < 1e-15);
    }

    #[test]
    fn rotating_axes_keeps_the_mahalanobis_distance() {
        let mut covariance = Matrix6::identity() * 0.5;
        covariance[(0, 4)] = 0.1;
        covariance[(4, 0)] = 0.1;
        let covariance = PoseCovariance(covariance);
        let turn = Rotation3::new(Vector3::new(0.3, 0.2, -0.5));
        let error = Vector6::new(1.0, 2.0, 3.0, 0.1, 0.2, 0.3);
        let mut turned = Vector6::zeros();
        turned
            .fixed_rows_mut::<3>(0)
            .copy_from(&(turn * error.fixed_rows::<3>(0)));
        turned
            .fixed_rows_mut::<3>(3)
            .copy_from(&(turn * error.fixed_rows::<3>(3)));
        let before = covariance
            .mahalanobis_squared(&error)
            .expect("positive definite");
        let after = covariance
            .rotated(&turn)
            .mahalanobis_squared(&turned)
            .expect("positive definite");
        assert!((before - after).abs() < 1e-10);
    }
}
