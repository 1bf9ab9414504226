//! The four operations on a motion. Jacobians are of the error (δt, δθ, δv, δω) that `Motion` defines.

use nalgebra::{Isometry3, Matrix3, SMatrix};

use super::LocalAttitude;
use super::pose::{at_origin, inverse_jacobian};
use crate::geometry::{Matrix12, Motion, congruent, set, skew};

impl Motion {
    /// Returns the motion relative to a frame `c` that is fixed to `b`: `c_from_a`.
    #[must_use]
    pub fn seen_from(&self, c_from_b: &Isometry3<f64>) -> Self {
        let q = c_from_b.rotation.to_rotation_matrix();
        let mut j = Matrix12::zeros();
        for block in [0, 3, 6, 9] {
            set(&mut j, block, block, q.matrix());
        }
        Self {
            b_from_a: c_from_b * self.b_from_a,
            velocity_in_b: q * self.velocity_in_b,
            rate_in_b: q * self.rate_in_b,
            covariance: congruent(&j, &self.covariance),
        }
    }

    /// Returns the motion of a frame `d` that is fixed to `a`: `b_from_d`. A point on a lever arm has the velocity of
    /// the origin plus that of the rotation.
    #[must_use]
    pub fn of(&self, a_from_d: &Isometry3<f64>) -> Self {
        // v' = v + ω × R l, δ(R l) = δθ × R l.
        let lever_in_b = self.b_from_a.rotation * a_from_d.translation.vector;
        let (lever, rate) = (skew(lever_in_b), skew(self.rate_in_b));
        let mut j = Matrix12::identity();
        set(&mut j, 0, 3, &-lever);
        set(&mut j, 6, 3, &-(rate * lever));
        set(&mut j, 6, 9, &-lever);
        Self {
            b_from_a: self.b_from_a * a_from_d,
            velocity_in_b: self.velocity_in_b + self.rate_in_b.cross(&lever_in_b),
            rate_in_b: self.rate_in_b,
            covariance: congruent(&j, &self.covariance),
        }
    }

    /// Returns the inverse motion: `a_from_b`, for an observer fixed to `a`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        // t' = −Rᵀ t, so v' = −Rᵀ (v − ω × t), ω' = −Rᵀ ω; and δ(Rᵀ x) = Rᵀ (δx + [x]× δθ).
        let t = self.b_from_a.translation.vector;
        let seen = self.velocity_in_b - self.rate_in_b.cross(&t);
        let r: Matrix3<f64> = -self
            .b_from_a
            .rotation
            .inverse()
            .to_rotation_matrix()
            .matrix();
        let mut j = Matrix12::zeros();
        j.fixed_view_mut::<6, 6>(0, 0)
            .copy_from(&inverse_jacobian(&self.b_from_a));
        set(&mut j, 6, 0, &-(r * skew(self.rate_in_b)));
        set(&mut j, 6, 3, &(r * skew(seen)));
        set(&mut j, 6, 6, &r);
        set(&mut j, 6, 9, &(r * skew(t)));
        set(&mut j, 9, 3, &(r * skew(self.rate_in_b)));
        set(&mut j, 9, 9, &r);
        Self {
            b_from_a: self.b_from_a.inverse(),
            velocity_in_b: r * seen,
            rate_in_b: r * self.rate_in_b,
            covariance: congruent(&j, &self.covariance),
        }
    }

    /// Returns the motion in local axes (NED or ENU) at the origin of `b`: the difference of the velocities of both
    /// origins, and the rate of `a`, relative to the local axes.
    ///
    /// An observer fixed to `b` rotates with it, so the rate of `b` is needed. Errors of motion, attitude and rate are
    /// assumed independent.
    #[must_use]
    pub fn in_local_axes(&self, attitude: &LocalAttitude) -> Self {
        let t = self.b_from_a.translation.vector;
        let rate = attitude.rate_in_b;
        let mut not_turning = *self;
        not_turning.velocity_in_b += rate.cross(&t);
        not_turning.rate_in_b += rate;
        let mut of_position = Matrix12::identity();
        set(&mut of_position, 6, 0, &skew(rate));
        let mut of_rate = SMatrix::<f64, 12, 3>::zeros();
        set(&mut of_rate, 6, 0, &-skew(t));
        set(&mut of_rate, 9, 0, &Matrix3::identity());
        not_turning.covariance = congruent(&of_position, &self.covariance)
            + congruent(&of_rate, &attitude.rate_covariance);

        let mut local = not_turning.seen_from(&at_origin(attitude));
        let mut of_attitude = SMatrix::<f64, 12, 3>::zeros();
        set(
            &mut of_attitude,
            0,
            0,
            &-skew(local.b_from_a.translation.vector),
        );
        set(&mut of_attitude, 3, 0, &Matrix3::identity());
        set(&mut of_attitude, 6, 0, &-skew(local.velocity_in_b));
        set(&mut of_attitude, 9, 0, &-skew(local.rate_in_b));
        local.covariance += congruent(&of_attitude, &attitude.covariance);
        local
    }
}
