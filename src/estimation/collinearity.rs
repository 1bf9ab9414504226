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

use nalgebra::{Matrix3, Rotation3, Vector3};

use super::lane::{accumulate, add, mul, splat, sub, total};
use super::points::{Block, LANES, Lane, Points};
use crate::camera::Ray;

/// A symmetric 3×3 matrix by its upper triangle: 11, 12, 13, 22, 23, 33.
pub(crate) type Symmetric3<T = f64> = [T; 6];

/// Where block `(a, b)` stands in [`CollinearityMoments::ppw`].
const BLOCK: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

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

/// Which error of a point is summed.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Weighting {
    /// The paper's object-space error, every point alike.
    ObjectSpace,
    /// The squared pixel residual over its variance, times the squared depth, to first order: the cost
    /// of `SQPnP` (Terzakis, Lourakis, ECCV 2020), with a weight for each point.
    Image,
}

impl Weighting {
    /// Returns the weights of a block's points; nothing where there is no point.
    #[inline(always)]
    fn of(self, block: &Block) -> Symmetric3<Lane> {
        match self {
            Self::ObjectSpace => {
                let mut weights = [[0.0; LANES]; 6];
                for lane in 0..LANES {
                    if block.variance[lane] > 0.0 {
                        let ray = Ray {
                            x: block.ray[0][lane],
                            y: block.ray[1][lane],
                        };
                        for (lanes, value) in weights.iter_mut().zip(object_space_weight(ray)) {
                            lanes[lane] = value;
                        }
                    }
                }
                weights
            }
            Self::Image => {
                let ([x, y], [b11, b12, b22]) = (block.ray, block.information);
                let h1 = add(mul(b11, x), mul(b12, y));
                let h2 = add(mul(b12, x), mul(b22, y));
                let zero = splat(0.0);
                let h3 = add(mul(h1, x), mul(h2, y));
                [b11, b12, sub(zero, h1), b22, sub(zero, h2), h3]
            }
        }
    }
}

/// The sums over points that the cost is made of.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityMoments<T = f64> {
    /// `Σ W`.
    w: Symmetric3<T>,
    /// `Σ p_a W`.
    pw: [Symmetric3<T>; 3],
    /// `Σ p_a p_b W` for ab = 11, 12, 13, 22, 23, 33.
    ppw: [Symmetric3<T>; 6],
}

impl CollinearityMoments {
    /// Returns the sums over all points.
    pub(crate) fn new(points: &Points, weighting: Weighting) -> Self {
        let mut sums = CollinearityMoments::<Lane>::ZERO;
        for block in &points.blocks {
            sums.add(block, &weighting.of(block));
        }
        Self {
            w: sums.w.map(total),
            pw: sums.pw.map(|weights| weights.map(total)),
            ppw: sums.ppw.map(|weights| weights.map(total)),
        }
    }
}

impl CollinearityMoments<Lane> {
    const ZERO: Self = Self {
        w: [[0.0; LANES]; 6],
        pw: [[[0.0; LANES]; 6]; 3],
        ppw: [[[0.0; LANES]; 6]; 6],
    };

    #[inline(always)]
    fn add(&mut self, block: &Block, weights: &Symmetric3<Lane>) {
        let [x, y, z] = block.marker;
        for k in 0..6 {
            let w = weights[k];
            let (xw, yw, zw) = (mul(x, w), mul(y, w), mul(z, w));
            self.w[k] = add(self.w[k], w);
            self.pw[0][k] = add(self.pw[0][k], xw);
            self.pw[1][k] = add(self.pw[1][k], yw);
            self.pw[2][k] = add(self.pw[2][k], zw);
            accumulate(&mut self.ppw[0][k], x, xw);
            accumulate(&mut self.ppw[1][k], x, yw);
            accumulate(&mut self.ppw[2][k], x, zw);
            accumulate(&mut self.ppw[3][k], y, yw);
            accumulate(&mut self.ppw[4][k], y, zw);
            accumulate(&mut self.ppw[5][k], z, zw);
        }
    }
}

/// Nine numbers of a rotation, column by column.
type Vector9 = [f64; 9];

/// The collinearity error as a function of the rotation alone.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityCost {
    /// Columns of `Ω`, which is symmetric.
    omega: [Vector9; 9],
    /// Columns of `T`, from the rotation to the markers' mean in the camera.
    centre_from_rotation: [[f64; 3]; 9],
}

impl CollinearityCost {
    /// Returns the cost; none when the rays do not fix a position (all of them one and the same).
    pub(crate) fn new(moments: &CollinearityMoments) -> Option<Self> {
        let w_inverse = full(&moments.w).try_inverse()?;
        let mut omega = [[0.0; 9]; 9];
        let mut centre_from_rotation = [[0.0; 3]; 9];
        for b in 0..3 {
            let wa = full(&moments.pw[b]);
            let t: Matrix3<f64> = -(w_inverse * wa);
            for column in 0..3 {
                centre_from_rotation[3 * b + column] = t.column(column).into();
            }
            for a in 0..=b {
                // Ω = Σ AᵀWA − (ΣWA)ᵀ (ΣW)⁻¹ (ΣWA), block by block.
                let block = full(&moments.ppw[BLOCK[a][b]]) + full(&moments.pw[a]) * t;
                for column in 0..3 {
                    for row in 0..3 {
                        omega[3 * b + column][3 * a + row] = block[(row, column)];
                        omega[3 * a + row][3 * b + column] = block[(row, column)];
                    }
                }
            }
        }
        let is_finite = omega.iter().flatten().all(|value| value.is_finite());
        is_finite.then_some(Self {
            omega,
            centre_from_rotation,
        })
    }

    /// Returns `mat(Ω vec(R))`, half the gradient of the cost over the nine entries of `R`.
    #[inline]
    pub(crate) fn half_gradient(&self, rotation: &Rotation3<f64>) -> Matrix3<f64> {
        let mut y = [0.0; 9];
        for (column, r) in self.omega.iter().zip(rotation.matrix().as_slice()) {
            for (y, entry) in y.iter_mut().zip(column) {
                *y += entry * r;
            }
        }
        Matrix3::from_column_slice(&y)
    }

    /// Returns `E(R) = rᵀ Ω r`.
    #[inline]
    pub(crate) fn value(&self, rotation: &Rotation3<f64>) -> f64 {
        rotation.matrix().dot(&self.half_gradient(rotation))
    }

    /// Returns `Jᵀ Ω J` for the three turns `R [e_k]×`, `J` their columns as vectors.
    ///
    /// Turn `k` has two columns that are not zero: with `(i, j, k)` in cyclic order, column `i` is
    /// `r_j` and column `j` is `−r_i`.
    #[inline]
    pub(crate) fn curvature(&self, rotation: &Rotation3<f64>) -> Matrix3<f64> {
        let r: &[f64; 9] = &std::array::from_fn(|i| rotation.matrix().as_slice()[i]);
        let omega_j: [Vector9; 3] = std::array::from_fn(|k| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let mut product = [0.0; 9];
            for row in 0..3 {
                let (plus, minus) = (r[3 * j + row], r[3 * i + row]);
                let (of_i, of_j) = (&self.omega[3 * i + row], &self.omega[3 * j + row]);
                for (value, (a, b)) in product.iter_mut().zip(of_i.iter().zip(of_j)) {
                    *value += a * plus - b * minus;
                }
            }
            product
        });
        Matrix3::from_fn(|k, l| {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let v = &omega_j[l];
            (0..3)
                .map(|row| r[3 * j + row] * v[3 * i + row] - r[3 * i + row] * v[3 * j + row])
                .sum()
        })
    }

    /// Returns where the markers' mean lies in the camera frame for a given rotation, m.
    ///
    /// # Source
    /// Ding, Wei, Wang 2011, Eq. (13), for centred points.
    #[inline]
    pub(crate) fn centre_in_camera(&self, rotation: &Rotation3<f64>) -> Vector3<f64> {
        let mut centre = Vector3::zeros();
        for (column, r) in self
            .centre_from_rotation
            .iter()
            .zip(rotation.matrix().as_slice())
        {
            centre += Vector3::from(*column) * *r;
        }
        centre
    }
}

#[inline]
fn full(s: &Symmetric3) -> Matrix3<f64> {
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::camera::{Camera, Pixel};
    use crate::estimation::Observation;
    use crate::geometry::skew;

    /// Relative; sums of a handful of products.
    const ROUNDING: f64 = 1e-12;

    fn observation(id: u32, marker: [f64; 3], pixel: [f64; 2]) -> Observation {
        Observation {
            id,
            marker_in_tanker: Point3::from(marker),
            pixel: Pixel {
                u: pixel[0],
                v: pixel[1],
            },
            sigma_px: 0.7,
        }
    }

    /// Five points, so that the second block is not full.
    fn example() -> (Camera, Vec<Observation>, Rotation3<f64>) {
        let camera = Camera::from_intrinsics(500.0, 500.0, 300.0, 200.0, None).expect("a camera");
        let observations = vec![
            observation(1, [1.0, 0.2, -0.5], [350.0, 300.0]),
            observation(2, [-1.0, 0.7, 0.4], [200.0, 250.0]),
            observation(3, [0.3, -1.2, 0.9], [450.0, 100.0]),
            observation(4, [-0.3, 0.3, -0.8], [250.0, 50.0]),
            observation(5, [0.6, 0.9, 0.3], [310.0, 180.0]),
        ];
        (
            camera,
            observations,
            Rotation3::new(Vector3::new(0.3, -0.2, 0.5)),
        )
    }

    fn literal_error(
        rays: &[(Vector3<f64>, Vector3<f64>)],
        r: &Rotation3<f64>,
        c: &Vector3<f64>,
    ) -> f64 {
        rays.iter()
            .map(|(p, v)| {
                let projector = v * v.transpose() / v.norm_squared();
                ((projector - Matrix3::identity()) * (r * p + c)).norm_squared()
            })
            .sum()
    }

    #[test]
    fn quadratic_form_equals_the_papers_sum_at_its_best_translation() {
        let (camera, observations, r) = example();
        let points = Points::new(&camera, &observations).expect("points in general position");
        let moments = CollinearityMoments::new(&points, Weighting::ObjectSpace);
        let cost = CollinearityCost::new(&moments).expect("five different rays");
        let rays: Vec<_> = observations
            .iter()
            .map(|seen| {
                let ray = camera.ray_from_pixel(seen.pixel).expect("a pinhole");
                (
                    seen.marker_in_tanker - points.mean,
                    Vector3::new(ray.x, ray.y, 1.0),
                )
            })
            .collect();
        let c = cost.centre_in_camera(&r);
        let literal = literal_error(&rays, &r, &c);
        assert!((cost.value(&r) - literal).abs() < ROUNDING * literal);
        // No neighbouring translation does better.
        for axis in 0..3 {
            for step in [-1e-4, 1e-4] {
                let mut moved = c;
                moved[axis] += step;
                assert!(literal_error(&rays, &r, &moved) > literal);
            }
        }
    }

    #[test]
    fn curvature_is_that_of_the_quadratic_form() {
        let (camera, observations, r) = example();
        let points = Points::new(&camera, &observations).expect("points in general position");
        let moments = CollinearityMoments::new(&points, Weighting::Image);
        let cost = CollinearityCost::new(&moments).expect("five different rays");
        let form = |m: &Matrix3<f64>| {
            let unchecked = Rotation3::from_matrix_unchecked(*m);
            cost.value(&unchecked)
        };
        let curvature = cost.curvature(&r);
        for k in 0..3 {
            let turn = r.matrix() * skew(Vector3::ith(k, 1.0));
            let expected = form(&turn);
            assert!((curvature[(k, k)] - expected).abs() < ROUNDING * expected);
            for l in 0..k {
                let other = r.matrix() * skew(Vector3::ith(l, 1.0));
                let mixed = (form(&(turn + other)) - form(&turn) - form(&other)) / 2.0;
                assert!((curvature[(k, l)] - mixed).abs() < ROUNDING * expected);
                assert!((curvature[(l, k)] - mixed).abs() < ROUNDING * expected);
            }
        }
    }

    #[test]
    fn every_weight_has_its_ray_as_null_space() {
        let (camera, observations, _) = example();
        let points = Points::new(&camera, &observations).expect("points in general position");
        for block in &points.blocks {
            for weighting in [Weighting::ObjectSpace, Weighting::Image] {
                let weights = weighting.of(block);
                for lane in 0..LANES {
                    let v = Vector3::new(block.ray[0][lane], block.ray[1][lane], 1.0);
                    let w = full(&weights.map(|entry| entry[lane]));
                    assert!((w * v).norm() <= ROUNDING * w.norm());
                }
            }
        }
    }

    #[test]
    fn identical_rays_are_refused() {
        let (camera, mut observations, _) = example();
        for seen in &mut observations {
            seen.pixel = Pixel { u: 300.0, v: 200.0 };
        }
        let points = Points::new(&camera, &observations).expect("the markers differ");
        let moments = CollinearityMoments::new(&points, Weighting::Image);
        assert!(CollinearityCost::new(&moments).is_none());
    }
}
