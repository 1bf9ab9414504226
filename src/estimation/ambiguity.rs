//! Search for a second pose that fits the image: the target mirrored in depth.
//!
//! At long range, or with all markers near one plane, a camera cannot distinguish a target from its mirror image in the
//! plane through its centre, perpendicular to the line of sight. For a planar target this mirror image is a rotated
//! target, and a second minimum of the error is close to it.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::centred_pose::CentredPose;
use super::problem::{NEGLIGIBLE, Problem};
use super::refine::Fit;

/// Distance of two rotation matrices in the Frobenius norm (√2 times the angle between them, rad) below which they
/// count as the same minimum.
pub(crate) const SAME_MINIMUM: f64 = 0.02;

/// Returns the likelihood of a rival pose relative to that of the chosen one, at most 1.
pub(crate) fn likelihood_ratio(rival_chi_squared: f64, chosen_chi_squared: f64) -> f64 {
    (0.5 * (chosen_chi_squared - rival_chi_squared))
        .exp()
        .min(1.0)
}

/// Returns the minimum in front of the camera that descent from the mirrored target reaches; `None` if its likelihood
/// is negligible or it is the chosen pose itself.
pub(crate) fn rival(problem: &Problem, chosen: &Fit) -> Option<Fit> {
    let pose = &chosen.pose;
    let start = mirror_image(problem, pose)?;
    let minimum = problem.descend_below(&start, chosen.chi_squared + NEGLIGIBLE)?;
    let is_negligible = problem
        .least_chi_squared(&minimum)
        .is_some_and(|least| least > chosen.chi_squared + NEGLIGIBLE);
    if is_negligible || is_same(&minimum.rotation, &pose.rotation) {
        return None;
    }
    let fit = problem.fit(&minimum.rotation).ok()?;
    (!is_same(&fit.pose.rotation, &pose.rotation)).then_some(fit)
}

/// Returns the attitude of the mirrored target; `None` if the markers are collinear.
#[inline]
pub(crate) fn mirror_image(problem: &Problem, pose: &CentredPose) -> Option<Rotation3<f64>> {
    let normal = smallest_axis(&problem.points.scatter)?;
    Some(mirrored(&pose.rotation, &pose.centre_in_camera, &normal))
}

/// Returns the direction of least marker spread, not normalised; `None` if the markers are collinear.
///
/// It is a column of a high power of the adjugate, whose largest eigenvalue belongs to the smallest of the scatter.
/// With `q` the ratio of the two smallest spreads, the direction is off by about `q^16` rad, which is sufficient to
/// start a descent: with `q` near one there is no plane to mirror in.
fn smallest_axis(scatter: &Matrix3<f64>) -> Option<Vector3<f64>> {
    const SQUARINGS: usize = 4;
    let s = scatter;
    let mut power = [
        s.m22 * s.m33 - s.m23 * s.m23,
        s.m13 * s.m23 - s.m12 * s.m33,
        s.m12 * s.m23 - s.m13 * s.m22,
        s.m11 * s.m33 - s.m13 * s.m13,
        s.m12 * s.m13 - s.m11 * s.m23,
        s.m11 * s.m22 - s.m12 * s.m12,
    ];
    let share = 1.0 / (power[0] + power[3] + power[5]);
    if !(share.is_finite() && share > 0.0) {
        return None;
    }
    power = power.map(|entry| entry * share);
    for _ in 0..SQUARINGS {
        let [xx, xy, xz, yy, yz, zz] = power;
        power = [
            xx * xx + xy * xy + xz * xz,
            xx * xy + xy * yy + xz * yz,
            xx * xz + xy * yz + xz * zz,
            xy * xy + yy * yy + yz * yz,
            xy * xz + yy * yz + yz * zz,
            xz * xz + yz * yz + zz * zz,
        ];
    }
    let [xx, xy, xz, yy, yz, zz] = power;
    Some(if xx >= yy && xx >= zz {
        Vector3::new(xx, xy, xz)
    } else if yy >= zz {
        Vector3::new(xy, yy, yz)
    } else {
        Vector3::new(xz, yz, zz)
    })
}

pub(crate) fn is_same(a: &Rotation3<f64>, b: &Rotation3<f64>) -> bool {
    (a.matrix() - b.matrix()).norm() < SAME_MINIMUM
}

/// `(I − 2 l lᵀ) R (I − 2 n nᵀ)`: two reflections make a rotation.
fn mirrored(
    rotation: &Rotation3<f64>,
    centre_in_camera: &Vector3<f64>,
    plane_normal: &Vector3<f64>,
) -> Rotation3<f64> {
    let (r, n, l) = (rotation.matrix(), plane_normal, centre_in_camera);
    // The two reflections in turn, each as a sum: R − (R n) 2 nᵀ / nᵀn, then the same from the left.
    let turned = r - (r * n) * (n * (2.0 / n.norm_squared())).transpose();
    let mirrored = turned - l * (turned.tr_mul(l) * (2.0 / l.norm_squared())).transpose();
    Rotation3::from_matrix_unchecked(mirrored)
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    /// rad; the adjugate of a nearly flat scatter loses digits.
    const ROUNDING: f64 = 1e-9;

    #[test]
    fn least_axis_agrees_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        for _ in 0..1000 {
            let half = Matrix3::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let scatter = half * half.transpose();
            let eigen = scatter.symmetric_eigen();
            let least = eigen.eigenvalues.imin();
            let expected = eigen.eigenvectors.column(least).into_owned();
            let mut others = eigen.eigenvalues;
            let least = std::mem::replace(&mut others[least], f64::INFINITY);
            let ratio = least / others.min();
            let found = smallest_axis(&scatter)
                .expect("not on one line")
                .normalize();
            let off = found.cross(&expected).norm();
            assert!(off < 2.0 * ratio.powi(16) + ROUNDING, "{off} at {ratio}");
        }
        let line = Vector3::new(1.0, 2.0, -1.0);
        assert!(smallest_axis(&(line * line.transpose())).is_none());
    }

    #[test]
    fn mirrored_rotation_of_a_plane_mirrors_it_in_depth() {
        let rotation = Rotation3::new(Vector3::new(0.2, -0.4, 0.1));
        let (sight, normal) = (Vector3::new(0.1, 0.2, 5.0), Vector3::x());
        let turned = mirrored(&rotation, &sight, &normal);
        for in_plane in [Vector3::y(), Vector3::z()] {
            let (a, b) = (rotation * in_plane, turned * in_plane);
            let ahead = sight.normalize();
            assert!(
                (a.dot(&ahead) + b.dot(&ahead)).abs() < 1e-14,
                "depths are opposite"
            );
            assert!(
                (a - b).cross(&ahead).norm() < 1e-14,
                "the image plane sees the same"
            );
        }
    }
}
