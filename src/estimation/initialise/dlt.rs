//! `In_M1`: the camera matrix by linear least squares, its rotation part projected onto SO(3).

use nalgebra::{Matrix3, Matrix4, Point3, Rotation3, SMatrix, SVector, Vector3, Vector4};

use crate::camera::Ray;
use crate::estimation::EstimateError;
use crate::estimation::lanes::points::mean;
use crate::geometry::nearest_rotation_by_svd;

type Matrix12 = SMatrix<f64, 12, 12>;
type Vector12 = SVector<f64, 12>;

/// Points needed for the eleven unknowns of a camera matrix.
pub(crate) const MIN_POINTS: usize = 6;
/// Below this ratio to the largest eigenvalue, a second solution exists: the points are coplanar, or on a twisted cubic
/// through the camera.
const MIN_EIGENVALUE_SHARE: f64 = 1e-12;

/// Returns the rotation part of `camera_from_tanker` from a normalised direct linear transform.
///
/// Rays are shifted to their mean and scaled to unit spread (Hartley); markers are shifted to a reference point and
/// scaled to unit spread. The smallest right singular vector of the `2n × 12` matrix is the camera matrix. Its sign is
/// chosen so that the markers are in front of the camera, and its left 3×3 part is projected onto the rotations.
///
/// # Inputs
/// * `rays`: `n ≥ 6` undistorted points on the `z = 1` plane.
/// * `markers_in_tanker`: the same `n` markers in the same order, m, not all in one plane.
/// * `reference_in_tanker`: m; the tanker's origin as in the paper, or the markers' mean as in Hartley. It
///   changes how the solution's normalisation weights the entries: with noise the rotation differs, and a reference
///   some hundred spreads away makes the points appear degenerate.
///
/// # Errors
/// [`EstimateError::TooFewPoints`]; [`EstimateError::Degenerate`] if the points permit more than one camera matrix.
///
/// # Source
/// Ding, Wei, Wang 2011, Eqs. (14)–(16), steps 1–3. DIFFERENCE: normalised coordinates, because the
/// smallest singular vector of the raw matrix is dominated by scale.
pub fn linear_rotation(
    rays: &[Ray],
    markers_in_tanker: &[Point3<f64>],
    reference_in_tanker: &Point3<f64>,
) -> Result<Rotation3<f64>, EstimateError> {
    let n = rays.len().min(markers_in_tanker.len());
    if n < MIN_POINTS || rays.len() != markers_in_tanker.len() {
        return Err(EstimateError::TooFewPoints {
            got: n,
            need: MIN_POINTS,
        });
    }
    let image = image_normaliser(rays);
    let object = object_normaliser(markers_in_tanker, reference_in_tanker);
    let mut normal = Matrix12::zeros();
    for (ray, marker) in rays.iter().zip(markers_in_tanker) {
        let u = image * Vector3::new(ray.x, ray.y, 1.0);
        let x = object * marker.to_homogeneous();
        let mut rows = SMatrix::<f64, 2, 12>::zeros(); // Eq. (16)
        for i in 0..4 {
            rows[(0, 4 + i)] = -x[i];
            rows[(0, 8 + i)] = u.y * x[i];
            rows[(1, i)] = x[i];
            rows[(1, 8 + i)] = -u.x * x[i];
        }
        normal += rows.transpose() * rows;
    }
    let p = smallest_eigenvector(&normal)?;
    let normalised = SMatrix::<f64, 3, 4>::from_row_slice(p.as_slice());
    let image_inverse = image.try_inverse().ok_or(EstimateError::SAME_RAYS)?;
    let camera_matrix = image_inverse * normalised * object;
    let depth_sum: f64 = markers_in_tanker
        .iter()
        .map(|marker| (camera_matrix.row(2) * marker.to_homogeneous())[0])
        .sum();
    let m: Matrix3<f64> = camera_matrix.fixed_view::<3, 3>(0, 0).into_owned();
    Ok(nearest_rotation_by_svd(&(m * depth_sum.signum())))
}

fn smallest_eigenvector(normal: &Matrix12) -> Result<Vector12, EstimateError> {
    let eigen = normal.symmetric_eigen();
    let mut order: [usize; 12] = std::array::from_fn(|i| i);
    order.sort_by(|&a, &b| eigen.eigenvalues[a].total_cmp(&eigen.eigenvalues[b]));
    let (second, largest) = (eigen.eigenvalues[order[1]], eigen.eigenvalues[order[11]]);
    if second > MIN_EIGENVALUE_SHARE * largest {
        Ok(eigen.eigenvectors.column(order[0]).into_owned())
    } else {
        Err(EstimateError::Degenerate {
            reason: "the points lie in one plane, or leave more than one camera matrix for another \
                     reason: the linear initialisation needs points in general position",
        })
    }
}

fn image_normaliser(rays: &[Ray]) -> Matrix3<f64> {
    let n = rays.len() as f64;
    let (x, y) = rays
        .iter()
        .fold((0.0, 0.0), |(x, y), r| (x + r.x / n, y + r.y / n));
    let spread = rays.iter().map(|r| (r.x - x).hypot(r.y - y)).sum::<f64>() / n;
    let s = std::f64::consts::SQRT_2 / spread.max(f64::MIN_POSITIVE);
    Matrix3::new(s, 0.0, -s * x, 0.0, s, -s * y, 0.0, 0.0, 1.0)
}

fn object_normaliser(markers: &[Point3<f64>], reference: &Point3<f64>) -> Matrix4<f64> {
    let centre = mean(markers, |marker| marker);
    let spread = markers.iter().map(|p| (p - centre).norm()).sum::<f64>() / markers.len() as f64;
    let s = 3.0_f64.sqrt() / spread.max(f64::MIN_POSITIVE);
    let mut normaliser = Matrix4::from_diagonal(&Vector4::new(s, s, s, 1.0));
    normaliser.set_column(3, &(reference.coords * -s).push(1.0));
    normaliser
}
