//! The object-space error of all points as one quadratic form in the rotation alone.
//!
//! With `q = R p + c` the camera coordinates of a marker, `p` taken from the markers' mean, and one
//! weight matrix `W` a point whose null space is the point's ray, the error is `Σ qᵀ W q`. Its
//! minimum over `c` is in closed form, `c = T r` with `r = vec(R)` (column-major), which leaves
//! `E(R) = rᵀ Ω r`: a 9×9 matrix, once a frame, after which no iteration looks at a point again.
//!
//! | paper           | here                                     |
//! |-----------------|------------------------------------------|
//! | `E(R, t)` (12)  | [`CollinearityCost::value`], `W = I − V` |
//! | `t(R)` (13)     | [`CollinearityCost::centre_in_camera`]   |
//! | `Vᵢ` (11)       | `I − W` of [`object_space_weight`]       |

use nalgebra::{Matrix3, Point3, Rotation3, SMatrix, SVector, Vector3};

use crate::camera::Ray;

pub(crate) type Matrix9 = SMatrix<f64, 9, 9>;
type Matrix3x9 = SMatrix<f64, 3, 9>;
type Vector9 = SVector<f64, 9>;

/// A symmetric 3×3 matrix by its upper triangle: 11, 12, 13, 22, 23, 33.
pub(crate) type Symmetric3 = [f64; 6];

/// Returns `I − v vᵀ / (vᵀ v)`, the weight of the paper's object-space error.
///
/// # Source
/// Ding, Wei, Wang 2011, Eqs. (11)–(12).
#[inline]
#[must_use]
pub(crate) fn object_space_weight(ray: Ray) -> Symmetric3 {
    let Ray { x, y } = ray;
    let s = 1.0 / (x * x + y * y + 1.0);
    [
        1.0 - x * x * s,
        -x * y * s,
        -x * s,
        1.0 - y * y * s,
        -y * s,
        1.0 - s,
    ]
}

/// Returns the weight that makes `qᵀ W q` the squared pixel residual times the squared depth, to first order.
///
/// `information` is the inverse covariance of the measured ray's two coordinates: 11, 12, 22.
///
/// # Source
/// The cost of `SQPnP` (Terzakis, Lourakis, ECCV 2020), with a weight for each point.
#[inline]
#[must_use]
pub(crate) fn image_weight(ray: Ray, information: [f64; 3]) -> Symmetric3 {
    let Ray { x, y } = ray;
    let [b11, b12, b22] = information;
    let (h1, h2) = (b11 * x + b12 * y, b12 * x + b22 * y);
    [b11, b12, -h1, b22, -h2, h1 * x + h2 * y]
}

/// Where block `(a, b)` stands in [`CollinearityMoments::ppw`].
const BLOCK: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// The sums over points that the cost is made of.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityMoments {
    /// `Σ W`.
    w: Symmetric3,
    /// `Σ p_a W`.
    pw: [Symmetric3; 3],
    /// `Σ p_a p_b W` for ab = 11, 12, 13, 22, 23, 33.
    ppw: [Symmetric3; 6],
}

impl CollinearityMoments {
    pub(crate) const ZERO: Self = Self {
        w: [0.0; 6],
        pw: [[0.0; 6]; 3],
        ppw: [[0.0; 6]; 6],
    };

    /// Adds one point, `p` from the markers' mean; a negative weight takes it away again.
    #[inline]
    pub(crate) fn add(&mut self, p: &Vector3<f64>, weight: &Symmetric3) {
        let pp = [
            p.x * p.x,
            p.x * p.y,
            p.x * p.z,
            p.y * p.y,
            p.y * p.z,
            p.z * p.z,
        ];
        for (sum, w) in self.w.iter_mut().zip(weight) {
            *sum += w;
        }
        for (sums, factor) in self.pw.iter_mut().zip([p.x, p.y, p.z]) {
            for (sum, w) in sums.iter_mut().zip(weight) {
                *sum += factor * w;
            }
        }
        for (sums, factor) in self.ppw.iter_mut().zip(pp) {
            for (sum, w) in sums.iter_mut().zip(weight) {
                *sum += factor * w;
            }
        }
    }
}

/// The collinearity error as a function of the rotation alone.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityCost {
    omega: Matrix9,
    centre_from_rotation: Matrix3x9,
}

impl CollinearityCost {
    /// Returns the cost; none when the rays do not fix a position (all of them one and the same).
    pub(crate) fn new(moments: &CollinearityMoments) -> Option<Self> {
        let w_inverse = full(&moments.w).try_inverse()?;
        let mut wa = Matrix3x9::zeros();
        for (a, block) in moments.pw.iter().enumerate() {
            wa.fixed_view_mut::<3, 3>(0, 3 * a).copy_from(&full(block));
        }
        let centre_from_rotation = -(w_inverse * wa);
        let mut omega = wa.transpose() * centre_from_rotation;
        for (a, row) in BLOCK.iter().enumerate() {
            for (b, &block) in row.iter().enumerate() {
                let mut view = omega.fixed_view_mut::<3, 3>(3 * a, 3 * b);
                view += full(&moments.ppw[block]);
            }
        }
        omega.iter().all(|value| value.is_finite()).then_some(Self {
            omega,
            centre_from_rotation,
        })
    }

    /// Returns `mat(Ω vec(R))`, half the gradient of the cost over the nine entries of `R`.
    #[inline]
    pub(crate) fn half_gradient(&self, rotation: &Rotation3<f64>) -> Matrix3<f64> {
        unvec(&(self.omega * vec(rotation.matrix())))
    }

    /// Returns `E(R) = rᵀ Ω r`.
    #[inline]
    pub(crate) fn value(&self, rotation: &Rotation3<f64>) -> f64 {
        rotation.matrix().dot(&self.half_gradient(rotation))
    }

    /// Returns `Jᵀ Ω J` for three directions of `R`, the columns of `J` given as matrices.
    #[inline]
    pub(crate) fn curvature(&self, directions: &[Matrix3<f64>; 3]) -> Matrix3<f64> {
        let j = SMatrix::<f64, 9, 3>::from_columns(&directions.map(|d| vec(&d)));
        j.transpose() * (self.omega * j)
    }

    /// Returns where the markers' mean lies in the camera frame for a given rotation, m.
    ///
    /// # Source
    /// Ding, Wei, Wang 2011, Eq. (13), for centred points.
    #[inline]
    pub(crate) fn centre_in_camera(&self, rotation: &Rotation3<f64>) -> Vector3<f64> {
        self.centre_from_rotation * vec(rotation.matrix())
    }
}

/// Returns the mean of the markers, m.
#[inline]
pub(crate) fn mean<'a>(points: impl ExactSizeIterator<Item = &'a Point3<f64>>) -> Point3<f64> {
    let n = points.len() as f64;
    Point3::from(points.fold(Vector3::zeros(), |sum, p| sum + p.coords) / n)
}

#[inline]
fn full(s: &Symmetric3) -> Matrix3<f64> {
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}

#[inline]
fn vec(m: &Matrix3<f64>) -> Vector9 {
    Vector9::from_column_slice(m.as_slice())
}

#[inline]
fn unvec(v: &Vector9) -> Matrix3<f64> {
    Matrix3::from_column_slice(v.as_slice())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Relative; sums of a handful of products.
    const ROUNDING: f64 = 1e-12;

    fn example() -> (Vec<Vector3<f64>>, Vec<Ray>, Rotation3<f64>) {
        let points = vec![
            Vector3::new(1.0, 0.2, -0.5),
            Vector3::new(-1.0, 0.7, 0.4),
            Vector3::new(0.3, -1.2, 0.9),
            Vector3::new(-0.3, 0.3, -0.8),
        ];
        let rays = vec![
            Ray { x: 0.1, y: 0.2 },
            Ray { x: -0.2, y: 0.1 },
            Ray { x: 0.3, y: -0.2 },
            Ray { x: -0.1, y: -0.3 },
        ];
        (points, rays, Rotation3::new(Vector3::new(0.3, -0.2, 0.5)))
    }

    fn literal_error(
        points: &[Vector3<f64>],
        rays: &[Ray],
        r: &Rotation3<f64>,
        c: &Vector3<f64>,
    ) -> f64 {
        points
            .iter()
            .zip(rays)
            .map(|(p, ray)| {
                let v = Vector3::new(ray.x, ray.y, 1.0);
                let projector = v * v.transpose() / v.norm_squared();
                let q = r * p + c;
                ((projector - Matrix3::identity()) * q).norm_squared()
            })
            .sum()
    }

    #[test]
    fn quadratic_form_equals_the_papers_sum_at_its_best_translation() {
        let (points, rays, r) = example();
        let mut moments = CollinearityMoments::ZERO;
        for (p, ray) in points.iter().zip(&rays) {
            moments.add(p, &object_space_weight(*ray));
        }
        let cost = CollinearityCost::new(&moments).expect("four different rays");
        let c = cost.centre_in_camera(&r);
        let literal = literal_error(&points, &rays, &r, &c);
        assert!((cost.value(&r) - literal).abs() < ROUNDING * literal);
        // No neighbouring translation does better.
        for axis in 0..3 {
            for step in [-1e-4, 1e-4] {
                let mut moved = c;
                moved[axis] += step;
                assert!(literal_error(&points, &rays, &r, &moved) > literal);
            }
        }
    }

    #[test]
    fn every_weight_has_its_ray_as_null_space() {
        let ray = Ray { x: 0.3, y: -0.4 };
        let v = Vector3::new(ray.x, ray.y, 1.0);
        for weight in [object_space_weight(ray), image_weight(ray, [4.0, 0.5, 2.0])] {
            assert!((full(&weight) * v).norm() < ROUNDING);
        }
    }

    #[test]
    fn identical_rays_are_refused() {
        let (points, _, _) = example();
        let mut moments = CollinearityMoments::ZERO;
        for p in &points {
            moments.add(p, &image_weight(Ray { x: 0.0, y: 0.0 }, [1.0, 0.0, 1.0]));
        }
        assert!(CollinearityCost::new(&moments).is_none());
    }
}
