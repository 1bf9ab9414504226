//! Relative motion of two frames: pose, velocity and rate, and the covariance of all three.

use nalgebra::{Isometry3, Matrix3, Matrix6, SMatrix, SVector, Vector3};

use super::covariance::congruent;
use super::{PoseCovariance, pose_error, skew};

/// 12×12, in the order of [`Motion::covariance`].
pub type Matrix12 = SMatrix<f64, 12, 12>;
/// 12 numbers, in the order of [`Motion::covariance`].
pub type Vector12 = SVector<f64, 12>;

/// The moving pose of a frame `a` in a frame `b`, all vectors in the axes of `b`.
///
/// Both rates are those that an observer fixed to `b` measures: `velocity_in_b` is the derivative of the coordinates
/// `t` of `a`'s origin, and `Ṙ = [rate_in_b]× R`. If `b` itself rotates, this is not the difference of two inertial
/// velocities.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Motion {
    /// Pose of `a`.
    pub b_from_a: Isometry3<f64>,
    /// Velocity of `a`'s origin, m/s.
    pub velocity_in_b: Vector3<f64>,
    /// Angular rate of `a`, rad/s.
    pub rate_in_b: Vector3<f64>,
    /// Covariance of the error (δt, δθ, δv, δω), SI and radians, in the axes of `b`. The first six are
    /// those of [`PoseCovariance`]; `v = v̂ + δv` and `ω = ω̂ + δω`.
    pub covariance: Matrix12,
}

/// Velocity and rate with their covariance, in the axes of one frame: the order of
/// `geometry_msgs/TwistWithCovariance`.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Twist {
    /// m/s.
    pub linear: Vector3<f64>,
    /// rad/s.
    pub angular: Vector3<f64>,
    /// Of (linear, angular).
    pub covariance: Matrix6<f64>,
}

impl Motion {
    /// Returns the covariance of the pose alone.
    #[must_use]
    pub fn pose_covariance(&self) -> PoseCovariance {
        PoseCovariance(self.covariance.fixed_view::<6, 6>(0, 0).into_owned())
    }

    /// Returns velocity and rate (of `a` relative to `b`) in the axes of `a`, as `nav_msgs/Odometry` requires, whose
    /// twist is in `child_frame_id`.
    ///
    /// Since these axes are uncertain, the attitude's error adds to the covariance.
    #[must_use]
    pub fn twist_in_a(&self) -> Twist {
        // u = Rᵀ v with R = Exp(δθ) R̂ gives δu = R̂ᵀ (δv + [v]× δθ), and the same for the rate.
        let a_from_b = self
            .b_from_a
            .rotation
            .to_rotation_matrix()
            .matrix()
            .transpose();
        let mut j = SMatrix::<f64, 6, 12>::zeros();
        set(&mut j, 0, 3, &(a_from_b * skew(self.velocity_in_b)));
        set(&mut j, 0, 6, &a_from_b);
        set(&mut j, 3, 3, &(a_from_b * skew(self.rate_in_b)));
        set(&mut j, 3, 9, &a_from_b);
        Twist {
            linear: a_from_b * self.velocity_in_b,
            angular: a_from_b * self.rate_in_b,
            covariance: congruent(&j, &self.covariance),
        }
    }

    /// Returns `eᵀ Σ⁻¹ e` for an error by [`motion_error`]; `None` if the covariance is not positive definite.
    #[must_use]
    pub fn mahalanobis_squared(&self, error: &Vector12) -> Option<f64> {
        self.covariance
            .cholesky()
            .map(|factor| error.dot(&factor.solve(error)))
    }

    /// Returns whether all numbers are finite and the covariance is symmetric and positive definite.
    #[must_use]
    pub fn is_valid(&self) -> bool {
        let mean = self
            .b_from_a
            .translation
            .vector
            .iter()
            .chain(self.b_from_a.rotation.coords.iter())
            .chain(self.velocity_in_b.iter())
            .chain(self.rate_in_b.iter());
        mean.chain(self.covariance.iter())
            .all(|value| value.is_finite())
            && self.covariance == self.covariance.transpose()
            && self.covariance.cholesky().is_some()
    }
}

/// Returns the error of `found` against `truth` in the coordinates of [`Motion::covariance`].
#[must_use]
pub fn motion_error(truth: &Motion, found: &Motion) -> Vector12 {
    let mut error = Vector12::zeros();
    error
        .fixed_rows_mut::<6>(0)
        .copy_from(&pose_error(&truth.b_from_a, &found.b_from_a));
    error
        .fixed_rows_mut::<3>(6)
        .copy_from(&(truth.velocity_in_b - found.velocity_in_b));
    error
        .fixed_rows_mut::<3>(9)
        .copy_from(&(truth.rate_in_b - found.rate_in_b));
    error
}

/// Copies a 3×3 block into a Jacobian.
pub(crate) fn set<const M: usize, const N: usize>(
    matrix: &mut SMatrix<f64, M, N>,
    row: usize,
    column: usize,
    block: &Matrix3<f64>,
) {
    matrix.fixed_view_mut::<3, 3>(row, column).copy_from(block);
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Translation3, UnitQuaternion};

    fn motion() -> Motion {
        Motion {
            b_from_a: Isometry3::new(Vector3::new(1.0, -2.0, 15.0), Vector3::new(0.3, -0.5, 0.9)),
            velocity_in_b: Vector3::new(0.4, -0.7, -1.1),
            rate_in_b: Vector3::new(0.05, 0.1, -0.2),
            covariance: Matrix12::identity(),
        }
    }

    fn moved(motion: &Motion, error: &Vector12) -> Motion {
        Motion {
            b_from_a: Isometry3::from_parts(
                Translation3::from(motion.b_from_a.translation.vector + error.fixed_rows::<3>(0)),
                UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(3).into_owned())
                    * motion.b_from_a.rotation,
            ),
            velocity_in_b: motion.velocity_in_b + error.fixed_rows::<3>(6),
            rate_in_b: motion.rate_in_b + error.fixed_rows::<3>(9),
            covariance: motion.covariance,
        }
    }

    #[test]
    fn motion_error_recovers_an_increment() {
        let found = motion();
        let error = Vector12::from_fn(|i, _| 1e-3 * (i as f64 - 5.5));
        assert!((motion_error(&moved(&found, &error), &found) - error).norm() < 1e-14);
    }

    #[test]
    fn twist_in_child_axes_follows_every_error_of_the_state() {
        // Central differences; the step's square times the curvature is below the tolerance.
        const STEP: f64 = 1e-5;
        let found = motion();
        for axis in 0..12 {
            let mut one = found;
            one.covariance = Matrix12::zeros();
            one.covariance[(axis, axis)] = 1.0;
            let mut step = Vector12::zeros();
            step[axis] = STEP;
            let (ahead, back) = (
                moved(&found, &step).twist_in_a(),
                moved(&found, &-step).twist_in_a(),
            );
            let linear = (ahead.linear - back.linear) / (2.0 * STEP);
            let angular = (ahead.angular - back.angular) / (2.0 * STEP);
            let covariance = one.twist_in_a().covariance;
            for i in 0..3 {
                for k in 0..3 {
                    assert!((covariance[(i, k)] - linear[i] * linear[k]).abs() < 1e-8);
                    assert!((covariance[(3 + i, k)] - angular[i] * linear[k]).abs() < 1e-8);
                    assert!((covariance[(3 + i, 3 + k)] - angular[i] * angular[k]).abs() < 1e-8);
                }
            }
        }
    }
}
