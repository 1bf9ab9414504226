//! Rotations: from a small vector, nearest to a matrix, and the fixed one of the camera.

use nalgebra::{Matrix3, Matrix4, Quaternion, Rotation3, UnitQuaternion, Vector3, Vector4};

/// Returns `[v]×`, the matrix with `skew(v) * w = v.cross(w)`.
#[must_use]
pub fn skew(v: Vector3<f64>) -> Matrix3<f64> {
    Matrix3::new(0.0, -v.z, v.y, v.z, 0.0, -v.x, -v.y, v.x, 0.0)
}

/// Returns the vector `a` with `skew(a) = m − mᵀ`.
#[inline(always)]
#[must_use]
pub fn axial(m: &Matrix3<f64>) -> Vector3<f64> {
    Vector3::new(m.m32 - m.m23, m.m13 - m.m31, m.m21 - m.m12)
}

/// Returns the chord between two rotations, which is the angle in rad for small ones; unlike the angle it resolves
/// values below 1e-8.
#[must_use]
pub fn chord(from: &Rotation3<f64>, to: &Rotation3<f64>) -> f64 {
    (to.matrix() - from.matrix()).norm() / std::f64::consts::SQRT_2
}

/// Returns the rotation `cay(w) = (I − [w]×/2)⁻¹ (I + [w]×/2)`, which is `Exp(w)` to second order.
///
/// Without trigonometric functions; orthogonal to machine precision for every finite `w` (radians).
#[inline(always)]
#[must_use]
pub fn cayley(w: Vector3<f64>) -> Rotation3<f64> {
    let a = w * 0.5;
    let share = 2.0 / (1.0 + a.norm_squared());
    // 1 + share ([a]× + [a]×²), entry by entry.
    let b = a * share;
    let (xx, yy, zz) = (a.x * b.x, a.y * b.y, a.z * b.z);
    let (xy, xz, yz) = (a.x * b.y, a.x * b.z, a.y * b.z);
    Rotation3::from_matrix_unchecked(Matrix3::new(
        1.0 - (yy + zz),
        xy - b.z,
        xz + b.y, //
        xy + b.z,
        1.0 - (xx + zz),
        yz - b.x, //
        xz - b.y,
        yz + b.x,
        1.0 - (xx + yy),
    ))
}

/// rad; below it the series of the Jacobians are exact to machine precision.
const SMALL_ANGLE: f64 = 1e-3;

/// Returns the left Jacobian `J` of the rotation vector `w` (radians): `Exp(w + δ) = Exp(J δ) Exp(w)`
/// to first order in `δ`.
///
/// # Source
/// Sola, Deray, Atchuthan, *A micro Lie theory for state estimation in robotics*, Eq. (145).
#[must_use]
pub fn left_jacobian(w: Vector3<f64>) -> Matrix3<f64> {
    let squared = w.norm_squared();
    let angle = squared.sqrt();
    let (a, b) = if angle < SMALL_ANGLE {
        (0.5 - squared / 24.0, 1.0 / 6.0 - squared / 120.0)
    } else {
        (
            (1.0 - angle.cos()) / squared,
            (angle - angle.sin()) / (squared * angle),
        )
    };
    let s = skew(w);
    Matrix3::identity() + s * a + s * s * b
}

/// Returns the inverse of [`left_jacobian`], for less than a full turn.
///
/// # Source
/// As [`left_jacobian`], Eq. (146).
#[must_use]
pub fn left_jacobian_inverse(w: Vector3<f64>) -> Matrix3<f64> {
    let squared = w.norm_squared();
    let angle = squared.sqrt();
    let c = if angle < SMALL_ANGLE {
        1.0 / 12.0 + squared / 720.0
    } else {
        // (1 + cos)/sin = cot(angle/2), which is finite at half a turn.
        (1.0 - 0.5 * angle / (0.5 * angle).tan()) / squared
    };
    let s = skew(w);
    Matrix3::identity() - s * 0.5 + s * s * c
}

/// Returns `Rz(yaw) Ry(pitch) Rx(roll)`, angles in radians.
#[must_use]
pub fn rotation_from_roll_pitch_yaw(roll: f64, pitch: f64, yaw: f64) -> Rotation3<f64> {
    Rotation3::from_euler_angles(roll, pitch, yaw)
}

/// Returns the rotation from a body frame (x forward, y left, z up) to the optical frame of a camera
/// that looks along its x axis (x right, y down, z ahead).
///
/// # Source
/// REP-103; it is the paper's "identity" start (`In_M2`), whose camera frame is body-like.
#[must_use]
pub fn optical_from_body() -> Rotation3<f64> {
    Rotation3::from_matrix_unchecked(Matrix3::new(
        0.0, -1.0, 0.0, //
        0.0, 0.0, -1.0, //
        1.0, 0.0, 0.0,
    ))
}

/// Returns the rotation `R` that maximises `tr(Rᵀ m)`, by singular value decomposition.
///
/// # Source
/// Ding, Wei, Wang 2011, Lemma 1, Eqs. (7)–(8).
#[must_use]
pub fn nearest_rotation_by_svd(m: &Matrix3<f64>) -> Rotation3<f64> {
    let svd = m.svd_unordered(true, true);
    let u = svd.u.unwrap_or_else(Matrix3::identity);
    let v_t = svd.v_t.unwrap_or_else(Matrix3::identity);
    let mut s = Matrix3::identity();
    if (u * v_t).determinant() < 0.0 {
        let least = svd.singular_values.imin();
        s[(least, least)] = -1.0;
    }
    Rotation3::from_matrix_unchecked(u * s * v_t)
}

/// Limit of Newton steps for the eigenvalue; five are usual.
const MAX_EIGENVALUE_STEPS: usize = 30;
/// Below this share of the largest possible adjugate the eigenvector is poorly determined, and the SVD is used.
const MIN_ADJUGATE_SHARE: f64 = 1e-6;

/// Returns the rotation `R` that maximises `tr(Rᵀ m)`, without an SVD.
///
/// The quaternion of `R` is the eigenvector of Horn's symmetric 4×4 matrix for the largest eigenvalue. Newton's method
/// on the characteristic polynomial finds that eigenvalue from above, and the adjugate gives the vector. If the
/// eigenvalue is nearly double, the SVD is used.
///
/// # Source
/// Horn, *JOSA A* 4(4), 1987; the Newton step as in Theobald, *Acta Cryst.* A61, 2005.
#[must_use]
pub fn nearest_rotation(m: &Matrix3<f64>) -> Rotation3<f64> {
    let scale = m.norm();
    if !(scale > 0.0 && scale.is_finite()) {
        return nearest_rotation_by_svd(m);
    }
    let horn = horn_matrix(&(m / scale));
    let lambda = largest_eigenvalue(&horn);
    let q = null_vector(&(horn - Matrix4::identity() * lambda));
    let norm = q.norm();
    // Cofactors are products of three numbers of order one here, so the norm needs no scaling.
    if norm < MIN_ADJUGATE_SHARE {
        return nearest_rotation_by_svd(m);
    }
    UnitQuaternion::from_quaternion(Quaternion::new(q[0], q[1], q[2], q[3])).to_rotation_matrix()
}

/// Horn's matrix for `tr(Rᵀ m)`, quaternion order (w, x, y, z).
fn horn_matrix(m: &Matrix3<f64>) -> Matrix4<f64> {
    let a = axial(m);
    let t = m.trace();
    let mut n = Matrix4::zeros();
    n[(0, 0)] = t;
    for i in 0..3 {
        n[(0, i + 1)] = a[i];
        n[(i + 1, 0)] = a[i];
        for j in 0..3 {
            n[(i + 1, j + 1)] = m[(i, j)] + m[(j, i)] - if i == j { t } else { 0.0 };
        }
    }
    n
}

fn largest_eigenvalue(n: &Matrix4<f64>) -> f64 {
    // λ⁴ + c2 λ² + c1 λ + c0, by Newton's identities (the trace is zero).
    let n2 = n * n;
    let p2 = n2.trace();
    let p3 = n2.dot(n);
    let c2 = -0.5 * p2;
    let c1 = -p3 / 3.0;
    let c0 = 0.125 * p2 * p2 - 0.25 * n2.dot(&n2);
    // No root of a traceless symmetric 4×4 matrix exceeds this, so Newton's method descends to the largest.
    let mut lambda = (0.75 * p2).sqrt();
    for _ in 0..MAX_EIGENVALUE_STEPS {
        let value = ((lambda * lambda + c2) * lambda + c1) * lambda + c0;
        let slope = (4.0 * lambda * lambda + 2.0 * c2) * lambda + c1;
        if slope <= 0.0 {
            break;
        }
        let step = value / slope;
        lambda -= step;
        if step.abs() <= 1e-15 * lambda.abs() {
            break;
        }
    }
    lambda
}

/// Returns the longest row of the adjugate of a singular symmetric matrix, which spans its null space.
fn null_vector(m: &Matrix4<f64>) -> Vector4<f64> {
    let mut best = Vector4::zeros();
    for row in 0..4 {
        let minor = m.remove_row(row);
        let candidate = Vector4::from_fn(|column, _| {
            let sign = if (row + column) % 2 == 0 { 1.0 } else { -1.0 };
            sign * minor.remove_column(column).determinant()
        });
        if candidate.norm_squared() > best.norm_squared() {
            best = candidate;
        }
    }
    best
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// Radians; both methods are exact up to rounding on matrices of moderate condition.
    const ROUNDING: f64 = 1e-12;

    fn random_matrix(rng: &mut ChaCha8Rng) -> Matrix3<f64> {
        Matrix3::from_fn(|_, _| rng.random_range(-1.0..1.0))
    }

    #[test]
    fn cayley_agrees_with_exp_to_second_order() {
        let w = Vector3::new(1e-3, -2e-3, 3e-3);
        assert!((cayley(w).matrix() - Rotation3::new(w).matrix()).norm() < w.norm().powi(3));
    }

    #[test]
    fn left_jacobian_is_the_derivative_of_exp() {
        const STEP: f64 = 1e-6;
        for w in [
            Vector3::zeros(),
            Vector3::new(4e-4, -5e-4, 7e-4),
            Vector3::new(0.3, -0.2, 0.9),
            Vector3::new(-1.9, 1.4, 1.6),
        ] {
            let jacobian = left_jacobian(w);
            for axis in 0..3 {
                let step = Vector3::ith(axis, STEP);
                // Quaternions, because the arc cosine of a matrix resolves nothing below 1e-8.
                let moved = UnitQuaternion::new(w + step) * UnitQuaternion::new(w - step).inverse();
                let difference = moved.scaled_axis() / (2.0 * STEP) - jacobian.column(axis);
                assert!(difference.norm() < 1e-8, "{w}: {difference}");
            }
            let product = jacobian * left_jacobian_inverse(w);
            assert!((product - Matrix3::identity()).norm() < ROUNDING, "{w}");
        }
    }

    #[test]
    fn axial_undoes_skew() {
        let v = Vector3::new(1.0, -2.0, 3.0);
        assert_eq!(axial(&skew(v)), v * 2.0);
    }

    #[test]
    fn nearest_rotation_agrees_with_svd() {
        let mut rng = ChaCha8Rng::seed_from_u64(1);
        for _ in 0..1000 {
            // A rotation with a perturbation, as the orthogonal iteration meets it.
            let rotation = nearest_rotation_by_svd(&random_matrix(&mut rng));
            let m = rotation.matrix() * Matrix3::from_diagonal(&Vector3::new(3.0, 1.0, 0.2))
                + random_matrix(&mut rng) * 0.05;
            // The chord, because the arc cosine resolves nothing below 1e-8.
            let difference =
                (nearest_rotation(&m).matrix() - nearest_rotation_by_svd(&m).matrix()).norm();
            assert!(difference < ROUNDING, "differ by {difference:e}");
        }
    }

    #[test]
    fn nearest_rotation_is_a_rotation_even_for_reflections() {
        let m = Matrix3::from_diagonal(&Vector3::new(1.0, 0.5, -0.2));
        for rotation in [nearest_rotation(&m), nearest_rotation_by_svd(&m)] {
            assert!((rotation.matrix().determinant() - 1.0).abs() < ROUNDING);
            assert!(
                (rotation.matrix() - Matrix3::identity()).norm() < ROUNDING,
                "the identity maximises the trace"
            );
        }
    }

    #[test]
    fn planar_moments_of_rank_two_still_fix_the_rotation() {
        let truth = Rotation3::new(Vector3::new(0.3, -0.2, 0.9));
        let m = truth.matrix() * Matrix3::from_diagonal(&Vector3::new(2.0, 1.0, 0.0));
        assert!((nearest_rotation(&m).matrix() - truth.matrix()).norm() < ROUNDING);
    }

    #[test]
    fn optical_frame_looks_along_body_x() {
        let m = optical_from_body();
        assert_eq!(m * Vector3::x(), Vector3::z());
        assert_eq!(m * Vector3::y(), -Vector3::x());
        assert_eq!(m * Vector3::z(), -Vector3::y());
    }
}
