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

use super::four::{Arithmetic, Four, LANES, Lane, Number, keep_in_memory};
use super::points::{Block, Points};
use super::symmetric3::{Symmetric3, inverse};
use crate::camera::Ray;

/// Where entry `(a, b)` of a symmetric matrix stands in [`Symmetric3`].
const ENTRY: [[usize; 3]; 3] = [[0, 1, 2], [1, 3, 4], [2, 4, 5]];

/// Returns `I − v vᵀ / (vᵀ v)`, the weight of the paper's object-space error.
///
/// # Source
/// Ding, Wei, Wang 2011, Eqs. (11)–(12).
#[inline(always)]
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
    fn of<A: Arithmetic>(self, arithmetic: A, block: &Block) -> Symmetric3<Four<A>> {
        let load = |lane| Four::new(arithmetic, lane);
        match self {
            Self::ObjectSpace => {
                let (x, y) = (load(block.ray[0]), load(block.ray[1]));
                let (one, zero) = (Four::splat(arithmetic, 1.0), Four::splat(arithmetic, 0.0));
                let there = load(block.variance.map(|px2| if px2 > 0.0 { 1.0 } else { 0.0 }));
                let share = one / one.plus(x, x).plus(y, y);
                let (xs, ys) = (x * share, y * share);
                [
                    one.minus(x, xs),
                    zero.minus(x, ys),
                    zero - xs,
                    one.minus(y, ys),
                    zero - ys,
                    one - share,
                ]
                .map(|weight| weight * there)
            }
            Self::Image => {
                let (x, y) = (load(block.ray[0]), load(block.ray[1]));
                let [b11, b12, b22] = block.information;
                let (b11, b12, b22) = (load(b11), load(b12), load(b22));
                let zero = Four::splat(arithmetic, 0.0);
                let h1 = zero.minus(b11, x).minus(b12, y);
                let h2 = zero.minus(b12, x).minus(b22, y);
                let h3 = zero.minus(h1, x).minus(h2, y);
                [b11, b12, h1, b22, h2, h3]
            }
        }
    }
}

/// Three registers; nine or ten numbers count, the rest is padding.
const PADDED: usize = 3 * LANES;
/// 1, x, y, z, xx, xy, xz, yy, yz, zz of a marker.
const MONOMIALS: usize = 10;
type Monomials = [f64; MONOMIALS];

/// Twelve numbers in registers.
#[derive(Clone, Copy)]
struct Twelve<A: Arithmetic>([Four<A>; 3]);

impl<A: Arithmetic> Twelve<A> {
    #[inline(always)]
    fn zero(arithmetic: A) -> Self {
        Self([Four::splat(arithmetic, 0.0); 3])
    }

    #[inline(always)]
    fn new(arithmetic: A, v: &[f64; PADDED]) -> Self {
        Self([
            Four::new(arithmetic, [v[0], v[1], v[2], v[3]]),
            Four::new(arithmetic, [v[4], v[5], v[6], v[7]]),
            Four::new(arithmetic, [v[8], v[9], v[10], v[11]]),
        ])
    }

    /// Returns `self + factor * v`.
    #[inline(always)]
    fn plus(self, v: Self, factor: Four<A>) -> Self {
        Self([
            self.0[0].plus(v.0[0], factor),
            self.0[1].plus(v.0[1], factor),
            self.0[2].plus(v.0[2], factor),
        ])
    }

    /// Returns `self - factor * v`.
    #[inline(always)]
    fn minus(self, v: Self, factor: Four<A>) -> Self {
        Self([
            self.0[0].minus(v.0[0], factor),
            self.0[1].minus(v.0[1], factor),
            self.0[2].minus(v.0[2], factor),
        ])
    }

    #[inline(always)]
    fn store(self) -> [f64; PADDED] {
        let [a, b, c] = [self.0[0].lane(), self.0[1].lane(), self.0[2].lane()];
        [
            a[0], a[1], a[2], a[3], b[0], b[1], b[2], b[3], c[0], c[1], c[2], c[3],
        ]
    }
}

/// The sums over points that the cost is made of.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityMoments {
    /// `Σ w (1, p, p pᵀ)` for each entry `w` of `W`.
    sums: Symmetric3<Monomials>,
}

impl CollinearityMoments {
    /// Returns the sums over all points.
    #[inline(always)]
    pub(crate) fn new<A: Arithmetic>(arithmetic: A, points: &Points, weighting: Weighting) -> Self {
        let mut moments = Self {
            sums: [[0.0; MONOMIALS]; 6],
        };
        // Without distortion, columns and rows do not mix and differ by a factor only.
        match (weighting, points.row_by_column_information) {
            (Weighting::Image, Some(ratio)) => {
                moments.sum(arithmetic, points, [0, 2, 4, 5], |block| {
                    let [w11, _, w13, _, w23, w33] = weighting.of(arithmetic, block);
                    [w11, w13, w23, w33]
                });
                for m in 0..MONOMIALS {
                    moments.sums[3][m] = moments.sums[0][m] * ratio;
                }
            }
            _ => moments.sum(arithmetic, points, [0, 1, 2, 3, 4, 5], |block| {
                weighting.of(arithmetic, block)
            }),
        }
        moments
    }

    /// Puts `Σ w (1, p, p pᵀ)` over all points in these places, one for each weight.
    #[inline(always)]
    fn sum<A: Arithmetic, const N: usize>(
        &mut self,
        arithmetic: A,
        points: &Points,
        places: [usize; N],
        weights_of: impl Fn(&Block) -> [Four<A>; N],
    ) {
        let mut sums = [[Four::splat(arithmetic, 0.0); MONOMIALS]; N];
        for block in points.blocks {
            let weights = weights_of(block);
            let x = Four::new(arithmetic, block.marker[0]);
            let y = Four::new(arithmetic, block.marker[1]);
            let z = Four::new(arithmetic, block.marker[2]);
            for k in 0..N {
                let (w, sums) = (weights[k], &mut sums[k]);
                let (xw, yw, zw) = (x * w, y * w, z * w);
                sums[0] = sums[0] + w;
                sums[1] = sums[1] + xw;
                sums[2] = sums[2] + yw;
                sums[3] = sums[3] + zw;
                sums[4] = sums[4].plus(x, xw);
                sums[5] = sums[5].plus(x, yw);
                sums[6] = sums[6].plus(x, zw);
                sums[7] = sums[7].plus(y, yw);
                sums[8] = sums[8].plus(y, zw);
                sums[9] = sums[9].plus(z, zw);
            }
            keep_in_memory(&mut sums);
        }
        for k in 0..N {
            for m in 0..MONOMIALS {
                self.sums[places[k]][m] = sums[k][m].total();
            }
        }
    }

    /// Returns a row of the matrix that monomial `index` of all entries makes.
    #[inline(always)]
    fn row(&self, index: usize, row: usize) -> [f64; 3] {
        let [a, b, c] = ENTRY[row];
        [
            self.sums[a][index],
            self.sums[b][index],
            self.sums[c][index],
        ]
    }

    /// Returns the first four of the three matrices' rows, side by side.
    #[inline(always)]
    fn rows(&self, indices: [usize; 3], row: usize) -> [f64; PADDED] {
        let [a, b, c] = [
            self.row(indices[0], row),
            self.row(indices[1], row),
            self.row(indices[2], row),
        ];
        [
            a[0], a[1], a[2], b[0], b[1], b[2], c[0], c[1], c[2], 0.0, 0.0, 0.0,
        ]
    }
}

/// The collinearity error as a function of the rotation alone.
#[derive(Debug, Clone)]
pub(crate) struct CollinearityCost {
    /// Columns of `Ω`, which is symmetric.
    omega: [[f64; PADDED]; 9],
    /// Columns of `T`, from the rotation to the markers' mean in the camera.
    centre_from_rotation: [Lane; 9],
}

impl CollinearityCost {
    /// A place for a cost.
    pub(crate) const EMPTY: Self = Self {
        omega: [[0.0; PADDED]; 9],
        centre_from_rotation: [[0.0; LANES]; 9],
    };

    /// Makes this the cost of some points; none when their rays do not fix a position (all of them one
    /// and the same).
    #[inline(always)]
    pub(crate) fn fill<A: Arithmetic>(
        &mut self,
        arithmetic: A,
        moments: &CollinearityMoments,
    ) -> Option<()> {
        let s = &moments.sums;
        let w = [s[0][0], s[1][0], s[2][0], s[3][0], s[4][0], s[5][0]];
        let w_inverse = inverse(&w)?;
        // Rows of ΣWA: entry 3 a + c belongs to column a, entry c, of the rotation.
        let rows = [0, 1, 2].map(
            #[inline(always)]
            |k| moments.rows([1, 2, 3], k),
        );
        let wa = [
            Twelve::new(arithmetic, &rows[0]),
            Twelve::new(arithmetic, &rows[1]),
            Twelve::new(arithmetic, &rows[2]),
        ];
        let factor = |value| Four::splat(arithmetic, value);
        let mut t = [[0.0; PADDED]; 3];
        for k in 0..3 {
            let mut row = Twelve::zero(arithmetic);
            for m in 0..3 {
                row = row.minus(wa[m], factor(w_inverse[ENTRY[k][m]]));
            }
            t[k] = row.store();
        }
        let mut trace = 0.0;
        for j in 0..9 {
            let (b, c) = (j / 3, j % 3);
            let indices = [4 + ENTRY[0][b], 4 + ENTRY[1][b], 4 + ENTRY[2][b]];
            let mut column = Twelve::new(arithmetic, &moments.rows(indices, c));
            // Ω = Σ AᵀWA − (ΣWA)ᵀ (ΣW)⁻¹ (ΣWA).
            for k in 0..3 {
                column = column.plus(wa[k], factor(t[k][j]));
                self.centre_from_rotation[j][k] = t[k][j];
            }
            self.omega[j] = column.store();
            trace += self.omega[j][j];
        }
        // The diagonal bounds all the rest, which is a sum of squares in effect.
        trace.is_finite().then_some(())
    }

    /// Returns `mat(Ω vec(R))`, half the gradient of the cost over the nine entries of `R`.
    #[inline(always)]
    pub(crate) fn half_gradient<A: Arithmetic>(
        &self,
        arithmetic: A,
        rotation: &Rotation3<f64>,
    ) -> Matrix3<f64> {
        let r = entries(rotation);
        let mut y = Twelve::zero(arithmetic);
        for j in 0..9 {
            let column = Twelve::new(arithmetic, &self.omega[j]);
            y = y.plus(column, Four::splat(arithmetic, r[j]));
        }
        let y = y.store();
        Matrix3::new(y[0], y[3], y[6], y[1], y[4], y[7], y[2], y[5], y[8])
    }

    /// Returns `E(R) = rᵀ Ω r`.
    #[inline(always)]
    pub(crate) fn value<A: Arithmetic>(&self, arithmetic: A, rotation: &Rotation3<f64>) -> f64 {
        rotation
            .matrix()
            .dot(&self.half_gradient(arithmetic, rotation))
    }

    /// Returns `Jᵀ Ω J` for the three turns `R [e_k]×`, `J` their columns as vectors.
    ///
    /// Turn `k` has two columns that are not zero: with `(i, j, k)` in cyclic order, column `i` is
    /// `r_j` and column `j` is `−r_i`.
    #[inline(always)]
    pub(crate) fn curvature<A: Arithmetic>(
        &self,
        arithmetic: A,
        rotation: &Rotation3<f64>,
    ) -> Matrix3<f64> {
        let r = entries(rotation);
        let mut omega_j = [[0.0; PADDED]; 3];
        for k in 0..3 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let mut product = Twelve::zero(arithmetic);
            for row in 0..3 {
                let of_i = Twelve::new(arithmetic, &self.omega[3 * i + row]);
                let of_j = Twelve::new(arithmetic, &self.omega[3 * j + row]);
                product = product.plus(of_i, Four::splat(arithmetic, r[3 * j + row]));
                product = product.minus(of_j, Four::splat(arithmetic, r[3 * i + row]));
            }
            omega_j[k] = product.store();
        }
        let entry = |k: usize, l: usize| -> f64 {
            let (i, j) = ((k + 1) % 3, (k + 2) % 3);
            let v = &omega_j[l];
            let mut sum = 0.0;
            for row in 0..3 {
                sum += r[3 * j + row] * v[3 * i + row] - r[3 * i + row] * v[3 * j + row];
            }
            sum
        };
        let (m21, m31, m32) = (entry(1, 0), entry(2, 0), entry(2, 1));
        Matrix3::new(
            entry(0, 0),
            m21,
            m31, //
            m21,
            entry(1, 1),
            m32, //
            m31,
            m32,
            entry(2, 2),
        )
    }

    /// Returns where the markers' mean lies in the camera frame for a given rotation, m.
    ///
    /// # Source
    /// Ding, Wei, Wang 2011, Eq. (13), for centred points.
    #[inline(always)]
    pub(crate) fn centre_in_camera(&self, rotation: &Rotation3<f64>) -> Vector3<f64> {
        let r = entries(rotation);
        let mut centre = [0.0; LANES];
        for j in 0..9 {
            for k in 0..LANES {
                centre[k] += self.centre_from_rotation[j][k] * r[j];
            }
        }
        Vector3::new(centre[0], centre[1], centre[2])
    }
}

/// Nine numbers of a rotation, column by column.
#[inline(always)]
fn entries(rotation: &Rotation3<f64>) -> [f64; 9] {
    let m = rotation.matrix();
    [
        m.m11, m.m21, m.m31, m.m12, m.m22, m.m32, m.m13, m.m23, m.m33,
    ]
}

#[cfg(test)]
fn full(s: &Symmetric3) -> Matrix3<f64> {
    Matrix3::new(s[0], s[1], s[2], s[1], s[3], s[4], s[2], s[4], s[5])
}

#[cfg(test)]
mod tests {
    use nalgebra::Point3;

    use super::*;
    use crate::camera::{Camera, Pixel};
    use crate::estimation::Observation;
    use crate::estimation::four::Plain;
    use crate::estimation::points::Blocks;
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
        let mut room = Blocks::new();
        let points = Points::new(Plain, &camera, &observations, &mut room)
            .expect("points in general position");
        let moments = CollinearityMoments::new(Plain, &points, Weighting::ObjectSpace);
        let mut cost = CollinearityCost::EMPTY;
        cost.fill(Plain, &moments).expect("five different rays");
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
        assert!((cost.value(Plain, &r) - literal).abs() < ROUNDING * literal);
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
        let mut room = Blocks::new();
        let points = Points::new(Plain, &camera, &observations, &mut room)
            .expect("points in general position");
        let moments = CollinearityMoments::new(Plain, &points, Weighting::Image);
        let mut cost = CollinearityCost::EMPTY;
        cost.fill(Plain, &moments).expect("five different rays");
        let form = |m: &Matrix3<f64>| {
            let unchecked = Rotation3::from_matrix_unchecked(*m);
            cost.value(Plain, &unchecked)
        };
        let curvature = cost.curvature(Plain, &r);
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
        let mut room = Blocks::new();
        let points = Points::new(Plain, &camera, &observations, &mut room)
            .expect("points in general position");
        for block in points.blocks {
            for weighting in [Weighting::ObjectSpace, Weighting::Image] {
                let weights = weighting.of(Plain, block);
                for lane in 0..LANES {
                    let v = Vector3::new(block.ray[0][lane], block.ray[1][lane], 1.0);
                    let w = full(&weights.map(|entry| entry.lane()[lane]));
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
        let mut room = Blocks::new();
        let points =
            Points::new(Plain, &camera, &observations, &mut room).expect("the markers differ");
        let moments = CollinearityMoments::new(Plain, &points, Weighting::Image);
        let mut cost = CollinearityCost::EMPTY;
        assert!(cost.fill(Plain, &moments).is_none());
    }
}
