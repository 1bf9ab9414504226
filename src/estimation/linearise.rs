//! Residuals at a pose, and the normal equations of one Gauss-Newton step, in whitened pixels.
//!
//! With `a = R p`, `M = DᵀD` and `s = Dᵀ r` of a point (`D` its whitened derivative, `r` its whitened
//! residual), the blocks of `JᵀJ` are `M`, `[a]× M` and `[a]× M [a]×ᵀ`, and the gradient is `s` and
//! `a × s`: less work than the products of the rows of `J`.

use nalgebra::{Matrix2x3, Point3, Vector2};

use super::Observation;
use super::lane::{accumulate, add, div, mul, splat, sub, total};
use super::points::{Block, LANES, Lane, Points};
use super::refine::CentredPose;
use super::symmetric6::Vector;
use crate::camera::{Camera, Ray};

/// Squared residuals and their first derivatives at a pose; rotation before position.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Linearised {
    /// `JᵀJ`, lower triangle.
    information: [[f64; 6]; 6],
    pub(crate) gradient: Vector,
    pub(crate) chi_squared: f64,
    /// px², over columns and rows.
    pub(crate) squared_residuals_px: f64,
}

impl Linearised {
    /// Returns the information with its diagonal raised by a share.
    #[inline]
    pub(crate) fn damped(&self, share: f64) -> [[f64; 6]; 6] {
        let mut damped = self.information;
        for (i, row) in damped.iter_mut().enumerate() {
            row[i] *= 1.0 + share;
        }
        damped
    }
}

/// What is minimised.
pub(crate) trait Residuals {
    /// Returns the residuals' sums at a pose; none when a point has no pixel there.
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised>;
}

/// Sums over points of `M`, `[a]× M`, `[a]× M [a]×ᵀ`, `s`, `a × s` and the squared residuals.
struct Sums<T> {
    /// 11, 12, 13, 22, 23, 33.
    point: [T; 6],
    mixed: [[T; 3]; 3],
    /// 11, 12, 13, 22, 23, 33.
    turn: [T; 6],
    gradient: [T; 6],
    chi_squared: T,
    squared_residuals_px: T,
}

impl Sums<Lane> {
    const ZERO: Self = Self {
        point: [[0.0; LANES]; 6],
        mixed: [[[0.0; LANES]; 3]; 3],
        turn: [[0.0; LANES]; 6],
        gradient: [[0.0; LANES]; 6],
        chi_squared: [0.0; LANES],
        squared_residuals_px: [0.0; LANES],
    };

    /// Adds points: `a` their arms, `m` their `M` (11, 12, 13, 22, 23, 33), `s` their `Dᵀ r`.
    #[inline(always)]
    fn add(&mut self, a: [Lane; 3], m: [Lane; 6], s: [Lane; 3]) {
        let [a1, a2, a3] = a;
        let rows = [[m[0], m[1], m[2]], [m[1], m[3], m[4]], [m[2], m[4], m[5]]];
        let cross = |p: Lane, q: Lane, x: Lane, y: Lane| sub(mul(p, x), mul(q, y));
        let b: [[Lane; 3]; 3] = [
            [0, 1, 2].map(|c| cross(a2, a3, rows[2][c], rows[1][c])),
            [0, 1, 2].map(|c| cross(a3, a1, rows[0][c], rows[2][c])),
            [0, 1, 2].map(|c| cross(a1, a2, rows[1][c], rows[0][c])),
        ];
        for (sum, value) in self.point.iter_mut().zip(m) {
            *sum = add(*sum, value);
        }
        for (sums, values) in self.mixed.iter_mut().zip(b) {
            for (sum, value) in sums.iter_mut().zip(values) {
                *sum = add(*sum, value);
            }
        }
        let turn = [
            cross(a2, a3, b[0][2], b[0][1]),
            cross(a3, a1, b[0][0], b[0][2]),
            cross(a1, a2, b[0][1], b[0][0]),
            cross(a3, a1, b[1][0], b[1][2]),
            cross(a1, a2, b[1][1], b[1][0]),
            cross(a1, a2, b[2][1], b[2][0]),
        ];
        for (sum, value) in self.turn.iter_mut().zip(turn) {
            *sum = add(*sum, value);
        }
        let gradient = [
            cross(a2, a3, s[2], s[1]),
            cross(a3, a1, s[0], s[2]),
            cross(a1, a2, s[1], s[0]),
            s[0],
            s[1],
            s[2],
        ];
        for (sum, value) in self.gradient.iter_mut().zip(gradient) {
            *sum = add(*sum, value);
        }
    }

    #[inline(always)]
    fn finish(&self) -> Option<Linearised> {
        let t = self.turn.map(total);
        let m = self.mixed.map(|row| row.map(total));
        let p = self.point.map(total);
        let chi_squared = total(self.chi_squared);
        chi_squared.is_finite().then_some(Linearised {
            information: [
                [t[0], 0.0, 0.0, 0.0, 0.0, 0.0],
                [t[1], t[3], 0.0, 0.0, 0.0, 0.0],
                [t[2], t[4], t[5], 0.0, 0.0, 0.0],
                [m[0][0], m[1][0], m[2][0], p[0], 0.0, 0.0],
                [m[0][1], m[1][1], m[2][1], p[1], p[3], 0.0],
                [m[0][2], m[1][2], m[2][2], p[2], p[4], p[5]],
            ],
            gradient: self.gradient.map(total),
            chi_squared,
            squared_residuals_px: total(self.squared_residuals_px),
        })
    }
}

/// Points seen by a camera without distortion, four at a time.
pub(crate) struct PinholeResiduals<'a>(pub(crate) &'a Points);

impl Residuals for PinholeResiduals<'_> {
    #[inline]
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised> {
        let mut sums = Sums::ZERO;
        let mut nearest = f64::INFINITY;
        for block in &self.0.blocks {
            let depth = sums.add_pinhole(block, pose);
            nearest = depth.into_iter().fold(nearest, f64::min);
        }
        // A depth that is not a number makes the squared residuals so too.
        if nearest > 0.0 { sums.finish() } else { None }
    }
}

impl Sums<Lane> {
    /// Adds a block; returns its depths.
    #[inline(always)]
    fn add_pinhole(&mut self, block: &Block, pose: &CentredPose) -> Lane {
        let r = pose.rotation.matrix();
        let c = &pose.centre_in_camera;
        let [px, py, pz] = block.marker;
        let turned = |row: usize| {
            let mut sum = mul(splat(r[(row, 0)]), px);
            accumulate(&mut sum, splat(r[(row, 1)]), py);
            accumulate(&mut sum, splat(r[(row, 2)]), pz);
            sum
        };
        let a = [turned(0), turned(1), turned(2)];
        let depth = add(a[2], splat(c.z));
        let inverse = div(splat(1.0), depth);
        let x = mul(add(a[0], splat(c.x)), inverse);
        let y = mul(add(a[1], splat(c.y)), inverse);
        let [wu, wv] = block.whitening;
        let (ru, rv) = (mul(wu, sub(x, block.ray[0])), mul(wv, sub(y, block.ray[1])));
        let (du, dv) = (mul(wu, inverse), mul(wv, inverse));
        let (m11, m22) = (mul(du, du), mul(dv, dv));
        let (xm, ym) = (mul(x, m11), mul(y, m22));
        let zero = splat(0.0);
        let m33 = add(mul(x, xm), mul(y, ym));
        let (s1, s2) = (mul(du, ru), mul(dv, rv));
        let s3 = sub(zero, add(mul(x, s1), mul(y, s2)));
        self.add(
            a,
            [m11, zero, sub(zero, xm), m22, sub(zero, ym), m33],
            [s1, s2, s3],
        );
        let squared = add(mul(ru, ru), mul(rv, rv));
        self.chi_squared = add(self.chi_squared, squared);
        accumulate(&mut self.squared_residuals_px, squared, block.variance);
        depth
    }
}

/// Points seen through any lens, one at a time: the lens model is evaluated at the prediction.
pub(crate) struct LensResiduals<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) observations: &'a [Observation],
    pub(crate) markers_mean: Point3<f64>,
}

impl Residuals for LensResiduals<'_> {
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised> {
        let mut sums = Sums::ZERO;
        for seen in self.observations {
            sums.add_seen(self.camera, seen, &self.markers_mean, pose)?;
        }
        sums.finish()
    }
}

impl Sums<Lane> {
    fn add_seen(
        &mut self,
        camera: &Camera,
        seen: &Observation,
        markers_mean: &Point3<f64>,
        pose: &CentredPose,
    ) -> Option<()> {
        let first = |value: f64| [value, 0.0, 0.0, 0.0];
        let arm = pose.rotation * (seen.marker_in_tanker - markers_mean);
        let q = arm + pose.centre_in_camera;
        if q.z <= 0.0 {
            return None;
        }
        let ray = Ray {
            x: q.x / q.z,
            y: q.y / q.z,
        };
        let (pixel, by_ray) = camera.project(ray)?;
        let whitening = 1.0 / seen.sigma_px;
        let by_point = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y);
        let d = by_ray * by_point * (whitening / q.z);
        let residual = Vector2::new(pixel.u - seen.pixel.u, pixel.v - seen.pixel.v);
        let whitened = residual * whitening;
        let m = d.tr_mul(&d);
        let s = d.tr_mul(&whitened);
        self.add(
            [arm.x, arm.y, arm.z].map(first),
            [m.m11, m.m12, m.m13, m.m22, m.m23, m.m33].map(first),
            [s.x, s.y, s.z].map(first),
        );
        self.chi_squared[0] += whitened.norm_squared();
        self.squared_residuals_px[0] += residual.norm_squared();
        Some(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraInfo;
    use crate::simulation::{Scene, paper_scene};

    struct Example {
        scene: Scene,
        observations: Vec<Observation>,
        pose: CentredPose,
    }

    fn example(camera: Camera) -> Example {
        let paper = paper_scene();
        let scene = Scene::with_markers(
            camera,
            paper.markers().to_vec(),
            *paper.truth_camera_from_tanker(),
        );
        let observations = scene.exact_observations();
        let mean = Points::new(scene.camera(), &observations)
            .expect("in general position")
            .mean;
        let pose = CentredPose {
            rotation: scene.truth_rotation(),
            centre_in_camera: (scene.truth_camera_from_tanker() * mean).coords,
        };
        Example {
            scene,
            observations,
            pose,
        }
    }

    fn wide_angle() -> Camera {
        let info = CameraInfo {
            width: 508,
            height: 412,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.2, 0.05, 1e-3, -1e-3, 0.0],
            k: [571.0, 0.0, 254.0, 0.0, 560.0, 206.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        Camera::from_info(&info, false).expect("a camera")
    }

    fn disturb(observations: &mut [Observation]) {
        for (i, seen) in observations.iter_mut().enumerate() {
            seen.pixel.u += 0.3 * i as f64 - 1.0;
            seen.pixel.v -= 0.2 * i as f64;
            seen.sigma_px = 0.5 + 0.1 * i as f64;
        }
    }

    fn assert_derivative_of_cost(residuals: &impl Residuals, pose: &CentredPose) {
        let here = residuals.linearise(pose).expect("in view");
        let scale = here.gradient.iter().map(|g| g * g).sum::<f64>().sqrt();
        let h = 1e-6;
        for axis in 0..6 {
            let mut step = [0.0; 6];
            step[axis] = h;
            let plus = residuals.linearise(&pose.moved(&step)).expect("in view");
            let minus = residuals
                .linearise(&pose.moved(&step.map(|s| -s)))
                .expect("in view");
            let difference = (plus.chi_squared - minus.chi_squared) / (4.0 * h);
            let relative = (difference - here.gradient[axis]).abs() / scale;
            assert!(
                relative < 1e-6,
                "axis {axis}: {difference} against {}",
                here.gradient[axis]
            );
            // The gradient's own change is the information, where residuals are small.
            for other in 0..=axis {
                let change = (plus.gradient[other] - minus.gradient[other]) / (2.0 * h);
                let entry = here.information[axis][other];
                let size = (here.information[axis][axis] * here.information[other][other]).sqrt();
                assert!(
                    (change - entry).abs() < 0.02 * size,
                    "{axis}, {other}: {change}, {entry}"
                );
            }
        }
    }

    #[test]
    fn gradient_is_zero_at_the_truth_without_noise() {
        let Example {
            scene,
            observations,
            pose,
        } = example(crate::simulation::paper_camera());
        let points = Points::new(scene.camera(), &observations).expect("in general position");
        let here = PinholeResiduals(&points)
            .linearise(&pose)
            .expect("every marker is in view");
        assert!(
            here.gradient.iter().all(|g| g.abs() < 1e-6),
            "{:?}",
            here.gradient
        );
        assert!(here.chi_squared < 1e-18);
    }

    #[test]
    fn derivatives_agree_with_central_differences() {
        for camera in [crate::simulation::paper_camera(), wide_angle()] {
            let Example {
                scene,
                mut observations,
                pose,
            } = example(camera);
            disturb(&mut observations);
            let points = Points::new(scene.camera(), &observations).expect("in general position");
            let lens = LensResiduals {
                camera: scene.camera(),
                observations: &observations,
                markers_mean: points.mean,
            };
            assert_derivative_of_cost(&lens, &pose);
            if scene.camera().is_pinhole() {
                assert_derivative_of_cost(&PinholeResiduals(&points), &pose);
            }
        }
    }

    #[test]
    fn blocks_and_single_points_give_the_same_sums() {
        let Example {
            scene,
            mut observations,
            pose,
        } = example(crate::simulation::paper_camera());
        disturb(&mut observations);
        let points = Points::new(scene.camera(), &observations).expect("in general position");
        let lens = LensResiduals {
            camera: scene.camera(),
            observations: &observations,
            markers_mean: points.mean,
        };
        let (a, b) = (
            PinholeResiduals(&points).linearise(&pose),
            lens.linearise(&pose),
        );
        let (a, b) = (a.expect("in view"), b.expect("in view"));
        let close = |a: f64, b: f64| (a - b).abs() < 1e-9 * (1.0 + b.abs());
        assert!(close(a.chi_squared, b.chi_squared));
        assert!(close(a.squared_residuals_px, b.squared_residuals_px));
        assert!(a.gradient.iter().zip(b.gradient).all(|(a, b)| close(*a, b)));
        let flat = |l: &Linearised| l.information.concat();
        assert!(flat(&a).iter().zip(flat(&b)).all(|(a, b)| close(*a, b)));
    }

    #[test]
    fn points_behind_the_camera_have_no_residuals() {
        let Example {
            scene,
            observations,
            mut pose,
        } = example(crate::simulation::paper_camera());
        let points = Points::new(scene.camera(), &observations).expect("in general position");
        pose.centre_in_camera.z = 1.0; // the wings are then behind
        assert!(PinholeResiduals(&points).linearise(&pose).is_none());
    }
}
