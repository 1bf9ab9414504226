//! The four operations on a pose. Jacobians are of the error (δt, δθ) that `PoseCovariance` defines.

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3};

use crate::geometry::{PoseCovariance, congruent, set, skew};

/// The pose of a frame `a` in a frame `b` with its covariance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct PoseEstimate {
    /// Pose of `a`.
    pub b_from_a: Isometry3<f64>,
    /// In the axes of `b`.
    pub covariance: PoseCovariance,
}

/// Attitude and rate of the frame `b` relative to local axes (NED or ENU), from an autopilot, at the time of the image.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct LocalAttitude {
    /// Rotation from the axes of `b` to local ones: PX4's `VehicleAttitude.q` for `b` in FRD and NED, the orientation
    /// of `sensor_msgs/Imu` for `b` in FLU and ENU.
    pub local_from_b: UnitQuaternion<f64>,
    /// Covariance of its error in local axes, `R = Exp(δα) R̂`, rad².
    pub covariance: Matrix3<f64>,
    /// Rate of `b` relative to the local axes, in the axes of `b` as gyroscopes measure it, rad/s. Poses do not use it.
    pub rate_in_b: Vector3<f64>,
    /// Covariance of that rate, (rad/s)².
    pub rate_covariance: Matrix3<f64>,
}

impl PoseEstimate {
    /// Returns the pose in a frame `c` that is fixed to `b`: `c_from_a`.
    #[must_use]
    pub fn seen_from(&self, c_from_b: &Isometry3<f64>) -> Self {
        Self {
            b_from_a: c_from_b * self.b_from_a,
            covariance: self
                .covariance
                .rotated(&c_from_b.rotation.to_rotation_matrix()),
        }
    }

    /// Returns the pose of a frame `d` that is fixed to `a`: `b_from_d`.
    ///
    /// With a lever arm between the two origins, an error of attitude causes an error of position as well.
    #[must_use]
    pub fn of(&self, a_from_d: &Isometry3<f64>) -> Self {
        // t' = t + R l, and δ(R l) = δθ × R l.
        let lever_in_b = self.b_from_a.rotation * a_from_d.translation.vector;
        let mut j = Matrix6::identity();
        set(&mut j, 0, 3, &-skew(lever_in_b));
        Self {
            b_from_a: self.b_from_a * a_from_d,
            covariance: PoseCovariance(congruent(&j, &self.covariance.0)),
        }
    }

    /// Returns the inverse pose: `a_from_b`, its covariance in the axes of `a`.
    #[must_use]
    pub fn inverse(&self) -> Self {
        Self {
            b_from_a: self.b_from_a.inverse(),
            covariance: PoseCovariance(congruent(
                &inverse_jacobian(&self.b_from_a),
                &self.covariance.0,
            )),
        }
    }

    /// Returns the pose in local axes at the origin of `b`: relative position and attitude in NED or ENU.
    ///
    /// The errors of pose and attitude are assumed independent.
    #[must_use]
    pub fn in_local_axes(&self, attitude: &LocalAttitude) -> Self {
        let turned = self.seen_from(&at_origin(attitude));
        let of_attitude = attitude_jacobian(&turned.b_from_a.translation.vector);
        let covariance = turned.covariance.0 + congruent(&of_attitude, &attitude.covariance);
        Self {
            b_from_a: turned.b_from_a,
            covariance: PoseCovariance(covariance),
        }
    }
}

/// Returns the local attitude as a transform that keeps the origin.
pub(super) fn at_origin(attitude: &LocalAttitude) -> Isometry3<f64> {
    Isometry3::from_parts(Translation3::identity(), attitude.local_from_b)
}

/// Derivative of `(−Rᵀ t, Rᵀ)`: `δt' = −R̂ᵀ (δt + [t]× δθ)`, `δθ' = −R̂ᵀ δθ`.
pub(super) fn inverse_jacobian(b_from_a: &Isometry3<f64>) -> Matrix6<f64> {
    let a_from_b = -b_from_a.rotation.inverse().to_rotation_matrix().matrix();
    let mut j = Matrix6::zeros();
    set(&mut j, 0, 0, &a_from_b);
    set(
        &mut j,
        0,
        3,
        &(a_from_b * skew(b_from_a.translation.vector)),
    );
    set(&mut j, 3, 3, &a_from_b);
    j
}

/// Effect of an error `δα` of the axes: `δt' = δα × t'`, `δθ' = δα`.
fn attitude_jacobian(position_in_local: &Vector3<f64>) -> nalgebra::Matrix6x3<f64> {
    let mut j = nalgebra::Matrix6x3::zeros();
    set(&mut j, 0, 0, &-skew(*position_in_local));
    set(&mut j, 3, 0, &Matrix3::identity());
    j
}
