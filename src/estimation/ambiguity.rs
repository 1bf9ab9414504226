//! The second pose that might fit: the target mirrored in depth.
//!
//! Far away, or with all markers near one plane, a camera cannot tell a target from its mirror image
//! across the plane through its centre, perpendicular to the line of sight. That mirror image of a
//! plane is a rotation of it, and a second minimum of the error lies close by.

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::problem::Problem;
use super::refine::{CentredPose, Fit};

/// Chord (about rad) under which two poses are the same minimum.
pub(crate) const SAME_MINIMUM: f64 = 0.02;

/// Returns the likelihood of a rival pose over that of the chosen one, at most 1.
pub(crate) fn likelihood_ratio(rival_chi_squared: f64, chosen_chi_squared: f64) -> f64 {
    (0.5 * (chosen_chi_squared - rival_chi_squared))
        .exp()
        .min(1.0)
}

/// Chi-squared above that of the chosen pose at which a rival no longer counts: its likelihood is
/// under 1e-13 of the chosen one's.
pub(crate) const NEGLIGIBLE: f64 = 60.0;

/// Returns the minimum in front of the camera that the mirrored target leads to; none when there is
/// none that counts, or it is the chosen pose itself.
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

/// Returns the attitude of the mirrored target; none when the markers have no plane to mirror in.
#[inline]
pub(crate) fn mirror_image(problem: &Problem, pose: &CentredPose) -> Option<Rotation3<f64>> {
    let normal = smallest_axis(&problem.points.scatter)?;
    Some(mirrored(&pose.rotation, &pose.centre_in_camera, &normal))
}

/// Returns the direction in which the markers spread least, by the closed form of the least
/// eigenvalue; none when two directions share it: there is then no plane to mirror in.
fn smallest_axis(scatter: &Matrix3<f64>) -> Option<Vector3<f64>> {
    let mean = scatter.trace() / 3.0;
    let deviation = scatter - Matrix3::identity() * mean;
    let size = (deviation.norm_squared() / 6.0).sqrt();
    let cosine = (deviation.determinant() / (2.0 * size * size * size)).clamp(-1.0, 1.0);
    // The three eigenvalues stand at cosines a third of a turn apart; this one is the least.
    let angle = (cosine.acos() + std::f64::consts::TAU) / 3.0;
    let m = deviation - Matrix3::identity() * (2.0 * size * angle.cos());
    let rows = [
        m.row(0).transpose(),
        m.row(1).transpose(),
        m.row(2).transpose(),
    ];
    let mut best = Vector3::zeros();
    for normal in [
        rows[0].cross(&rows[1]),
        rows[1].cross(&rows[2]),
        rows[2].cross(&rows[0]),
    ] {
        if normal.norm_squared() > best.norm_squared() {
            best = normal;
        }
    }
    (best.norm_squared() > 1e-20 * size.powi(4)).then_some(best)
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
    let reflection =
        |v: &Vector3<f64>| Matrix3::identity() - v * v.transpose() * (2.0 / v.norm_squared());
    Rotation3::from_matrix_unchecked(
        reflection(centre_in_camera) * rotation.matrix() * reflection(plane_normal),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use rand::{RngExt, SeedableRng};
    use rand_chacha::ChaCha8Rng;

    #[test]
    fn least_axis_agrees_with_a_library() {
        let mut random = ChaCha8Rng::seed_from_u64(8);
        for _ in 0..1000 {
            let half = Matrix3::from_fn(|_, _| random.random_range(-1.0..1.0_f64));
            let scatter = half * half.transpose();
            let eigen = scatter.symmetric_eigen();
            let expected = eigen
                .eigenvectors
                .column(eigen.eigenvalues.imin())
                .into_owned();
            let found = smallest_axis(&scatter)
                .expect("different eigenvalues")
                .normalize();
            assert!(found.cross(&expected).norm() < 1e-6, "{found} {expected}");
        }
        assert!(smallest_axis(&Matrix3::identity()).is_none());
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
