//! Residuals weighted by the whole budget: one point at a time for a lens, four at a time for a pinhole.

use std::ops::Div;

use nalgebra::Point3;

use super::frame::{FrameBudget, MODES, NOISE, SURVEY, WEIGHT};
use super::gram::{Elimination, Gram};
use crate::camera::Camera;
use crate::estimation::Observation;
use crate::estimation::centred_pose::CentredPose;
use crate::estimation::lanes::four::{
    Arithmetic, Four, LANES, Lane, Number, keep_in_memory, totals,
};
use crate::estimation::lanes::points::{Block, Points};
use crate::estimation::residuals::{Linearised, Residuals, Slope, SlopeSums, Sums, Weight};

/// Share by which chi-squared may rise in an accepted step: the weights depend on the pose, and chi-squared changes
/// with them. A diverging step raises it more.
const REWEIGHTED: f64 = 0.2;

/// Points of a camera without distortion.
pub(crate) struct PinholeBudget<'a, A, const K: usize> {
    pub(crate) arithmetic: A,
    pub(crate) points: &'a Points<'a>,
    pub(crate) focal: [f64; 2],
    pub(crate) budget: &'a FrameBudget,
}

/// Points of a camera with any lens.
pub(crate) struct LensBudget<'a, const K: usize> {
    pub(crate) camera: &'a Camera,
    pub(crate) observations: &'a [Observation],
    pub(crate) markers_mean: Point3<f64>,
    pub(crate) budget: &'a FrameBudget,
}

/// A point as seen from a pose, px and m.
#[derive(Clone, Copy)]
struct Sight<N> {
    /// From the markers' mean, camera axes, m.
    arm: [N; 3],
    /// `D`, px/m.
    by_point: [[N; 3]; 2],
    /// Predicted minus detected, px.
    residual: [N; 2],
}

/// A point with decorrelated residuals: the correlated part of the first is subtracted from the second.
#[derive(Clone, Copy)]
struct Independent<N> {
    arm: [N; 3],
    by_point: [[N; 3]; 2],
    residual: [N; 2],
    /// Inverse variances.
    weight: [N; 2],
    /// The factor of the first residual that was subtracted from the second.
    part: N,
}

impl<N: Number + Div<Output = N>> Sight<N> {
    /// Weights the residuals by noise and survey error: `σ² 1 + s² D Dᵀ`.
    #[inline(always)]
    fn weighed(&self, noise: N, there: N, survey: N) -> Independent<N> {
        let [d1, d2] = &self.by_point;
        let product = |a: &[N; 3], b: &[N; 3]| (a[0] * b[0]).plus(a[1], b[1]).plus(a[2], b[2]);
        let c11 = noise.plus(survey, product(d1, d1));
        let c12 = survey * product(d1, d2);
        let c22 = noise.plus(survey, product(d2, d2));
        let part = c12 / c11;
        let alone = c22.minus(part, c12);
        let second = [
            d2[0].minus(part, d1[0]),
            d2[1].minus(part, d1[1]),
            d2[2].minus(part, d1[2]),
        ];
        let [r1, r2] = self.residual;
        Independent {
            arm: self.arm,
            by_point: [*d1, second],
            residual: [r1, r2.minus(part, r1)],
            weight: [there / c11, there / alone],
            part,
        }
    }
}

impl<N: Number> Independent<N> {
    /// Returns `Dᵀ W v` of a pair of pixel shifts.
    #[inline(always)]
    fn pulled(&self, q: [N; 2]) -> [N; 3] {
        let [d1, d2] = &self.by_point;
        [
            (d1[0] * q[0]).plus(d2[0], q[1]),
            (d1[1] * q[0]).plus(d2[1], q[1]),
            (d1[2] * q[0]).plus(d2[2], q[1]),
        ]
    }

    #[inline(always)]
    fn weighted(&self, h: [N; 2]) -> [N; 2] {
        [self.weight[0] * h[0], self.weight[1] * h[1]]
    }

    #[inline(always)]
    fn information(&self) -> Weight<N> {
        let [d1, d2] = &self.by_point;
        let e1 = [
            self.weight[0] * d1[0],
            self.weight[0] * d1[1],
            self.weight[0] * d1[2],
        ];
        let e2 = [
            self.weight[1] * d2[0],
            self.weight[1] * d2[1],
            self.weight[1] * d2[2],
        ];
        let entry = |i: usize, j: usize| (d1[i] * e1[j]).plus(d2[i], e2[j]);
        Weight {
            m11: entry(0, 0),
            m12: Some(entry(0, 1)),
            m13: entry(0, 2),
            m22: entry(1, 1),
            m23: entry(1, 2),
            m33: entry(2, 2),
        }
    }

    /// Returns the shift of this point by a mode, decorrelated as the residuals are.
    #[inline(always)]
    fn mode(
        &self,
        mode: usize,
        flex_modes: usize,
        rotation: &[[N; 3]; 3],
        load: impl Fn(usize) -> N,
    ) -> [N; 2] {
        if mode < flex_modes {
            let at = MODES + 3 * mode;
            let shape = [load(at), load(at + 1), load(at + 2)];
            let turned = |row: &[N; 3]| {
                (row[0] * shape[0])
                    .plus(row[1], shape[1])
                    .plus(row[2], shape[2])
            };
            let moved = [
                turned(&rotation[0]),
                turned(&rotation[1]),
                turned(&rotation[2]),
            ];
            let shift = |d: &[N; 3]| (d[0] * moved[0]).plus(d[1], moved[1]).plus(d[2], moved[2]);
            [shift(&self.by_point[0]), shift(&self.by_point[1])]
        } else {
            let at = MODES + 3 * flex_modes + 2 * (mode - flex_modes);
            let (u, v) = (load(at), load(at + 1));
            [u, v.minus(self.part, u)]
        }
    }
}

/// All sums of one linearisation.
struct Everything<N, const K: usize> {
    points: Sums<N>,
    gram: Gram<N, K>,
}

impl<N: Number, const K: usize> Everything<N, K> {
    #[inline(always)]
    fn add(
        &mut self,
        seen: &Independent<N>,
        budget: &FrameBudget,
        rotation: &[[N; 3]; 3],
        load: impl Fn(usize) -> N + Copy,
    ) {
        let q = seen.weighted(seen.residual);
        self.points
            .add(seen.arm, seen.information(), seen.pulled(q));
        let chi = &mut self.points.slope.chi_squared;
        *chi = chi
            .plus(q[0], seen.residual[0])
            .plus(q[1], seen.residual[1]);
        let mut shifts = [[self.points.zero; 2]; K];
        for mode in 0..budget.modes().min(K) {
            let h = seen.mode(mode, budget.flex_modes, rotation, load);
            shifts[mode] = h;
            let weighted = seen.weighted(h);
            self.gram.add_cross(mode, seen.arm, seen.pulled(weighted));
            let residual = &mut self.gram.residual_mut()[mode];
            *residual = residual.plus(h[0], q[0]).plus(h[1], q[1]);
            for other in 0..=mode {
                self.gram.add_pair(mode, other, weighted, shifts[other]);
            }
        }
    }
}

/// The sums for a slope.
struct SlopeOnly<N, const K: usize> {
    points: SlopeSums<N>,
    residual: [N; K],
}

impl<N: Number, const K: usize> SlopeOnly<N, K> {
    #[inline(always)]
    fn add(
        &mut self,
        seen: &Independent<N>,
        budget: &FrameBudget,
        rotation: &[[N; 3]; 3],
        load: impl Fn(usize) -> N + Copy,
    ) {
        let q = seen.weighted(seen.residual);
        self.points.add(seen.arm, seen.pulled(q));
        let chi = &mut self.points.chi_squared;
        *chi = chi
            .plus(q[0], seen.residual[0])
            .plus(q[1], seen.residual[1]);
        for mode in 0..budget.modes().min(K) {
            let h = seen.mode(mode, budget.flex_modes, rotation, load);
            let residual = &mut self.residual[mode];
            *residual = residual.plus(h[0], q[0]).plus(h[1], q[1]);
        }
    }
}

impl FrameBudget {
    #[inline(always)]
    fn finish<const K: usize>(
        &self,
        pose: &CentredPose,
        sums: Option<Linearised>,
        gram: &Gram<f64, K>,
        residual: &[f64; K],
    ) -> Option<Linearised<Elimination<K>>> {
        let mut sums = sums?;
        let kept = Elimination::new(gram, self.modes())?;
        kept.reduce(&mut sums.information);
        if let Some(prior) = &self.attitude {
            for entry in [0, 3, 5] {
                sums.information.turn[entry] += prior.information;
            }
        }
        Some(Linearised {
            information: sums.information,
            slope: self.finish_slope(pose, sums.slope, &kept, residual),
            kept,
        })
    }

    #[inline(always)]
    fn finish_slope<const K: usize>(
        &self,
        pose: &CentredPose,
        mut slope: Slope,
        kept: &Elimination<K>,
        residual: &[f64; K],
    ) -> Slope {
        kept.reduce_slope(residual, &mut slope);
        if let Some(prior) = &self.attitude {
            // The rotation vector is invariant under the derivative of the logarithm.
            let turn = prior.turn_to(&pose.rotation);
            for axis in 0..3 {
                slope.gradient[axis] += prior.information * turn[axis];
            }
            slope.chi_squared += prior.information * turn.norm_squared();
        }
        slope
    }
}

impl<A: Arithmetic, const K: usize> PinholeBudget<'_, A, K> {
    /// Passes each block to `add`; returns whether all points were in front of the camera.
    #[inline(always)]
    fn visit(
        &self,
        pose: &CentredPose,
        mut add: impl FnMut(&Independent<Four<A>>, &[[Four<A>; 3]; 3], &[Lane], &Sight<Four<A>>),
    ) -> bool {
        let splat = |value| Four::splat(self.arithmetic, value);
        let r = pose.rotation.matrix();
        let rotation = [
            [splat(r.m11), splat(r.m12), splat(r.m13)],
            [splat(r.m21), splat(r.m22), splat(r.m23)],
            [splat(r.m31), splat(r.m32), splat(r.m33)],
        ];
        let c = &pose.centre_in_camera;
        let centre = [splat(c.x), splat(c.y), splat(c.z)];
        let mut nearest = [f64::INFINITY; LANES];
        for (block, lanes) in self.points.blocks.iter().zip(self.budget.blocks()) {
            let (sight, depth) = self.sight(block, &rotation, &centre);
            let depth = depth.lane();
            for i in 0..LANES {
                nearest[i] = if depth[i] < nearest[i] {
                    depth[i]
                } else {
                    nearest[i]
                };
            }
            let load = |lane: usize| Four::new(self.arithmetic, lanes[lane]);
            let seen = sight.weighed(load(NOISE), load(WEIGHT), load(SURVEY));
            add(&seen, &rotation, lanes, &sight);
        }
        // If a depth is NaN, so are the squared residuals.
        nearest.iter().all(|depth| *depth > 0.0)
    }

    #[inline(always)]
    fn sight(
        &self,
        block: &Block,
        rotation: &[[Four<A>; 3]; 3],
        centre: &[Four<A>; 3],
    ) -> (Sight<Four<A>>, Four<A>) {
        let load = |lane: Lane| Four::new(self.arithmetic, lane);
        let splat = |value| Four::splat(self.arithmetic, value);
        let p = [
            load(block.marker[0]),
            load(block.marker[1]),
            load(block.marker[2]),
        ];
        let turned = |row: &[Four<A>; 3]| (row[0] * p[0]).plus(row[1], p[1]).plus(row[2], p[2]);
        let arm = [
            turned(&rotation[0]),
            turned(&rotation[1]),
            turned(&rotation[2]),
        ];
        let depth = arm[2] + centre[2];
        let inverse = splat(1.0) / depth;
        let (x, y) = (
            (arm[0] + centre[0]) * inverse,
            (arm[1] + centre[1]) * inverse,
        );
        let [fx, fy] = [splat(self.focal[0]), splat(self.focal[1])];
        let zero = splat(0.0);
        let (gx, gy) = (fx * inverse, fy * inverse);
        let sight = Sight {
            arm,
            by_point: [[gx, zero, zero.minus(gx, x)], [zero, gy, zero.minus(gy, y)]],
            residual: [fx * (x - load(block.ray[0])), fy * (y - load(block.ray[1]))],
        };
        (sight, depth)
    }
}

impl<A: Arithmetic, const K: usize> Residuals for PinholeBudget<'_, A, K> {
    type Kept = Elimination<K>;
    const RISE: f64 = REWEIGHTED;

    #[inline(always)]
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised<Elimination<K>>> {
        let zero = Four::splat(self.arithmetic, 0.0);
        let mut sums = Everything {
            points: Sums::new(zero),
            gram: Gram::<_, K>::new(zero),
        };
        let is_in_front = self.visit(
            pose,
            #[inline(always)]
            |seen, rotation, lanes, sight| {
                let load = |lane: usize| Four::new(self.arithmetic, lanes[lane]);
                sums.add(seen, self.budget, rotation, load);
                add_squares(&mut sums.points.slope, sight, load(WEIGHT));
                keep_in_memory(&mut sums);
            },
        );
        if !is_in_front {
            return None;
        }
        let gram = sums.gram.total(self.budget.modes());
        let residual = residual_totals(sums.gram.residual_mut(), self.budget.modes());
        self.budget
            .finish(pose, sums.points.total().finish(), &gram, &residual)
    }

    #[inline(always)]
    fn slope(&self, pose: &CentredPose, kept: &Elimination<K>) -> Option<Slope> {
        let zero = Four::splat(self.arithmetic, 0.0);
        let mut sums = SlopeOnly {
            points: SlopeSums::new(zero),
            residual: [zero; K],
        };
        let is_in_front = self.visit(
            pose,
            #[inline(always)]
            |seen, rotation, lanes, sight| {
                let load = |lane: usize| Four::new(self.arithmetic, lanes[lane]);
                sums.add(seen, self.budget, rotation, load);
                add_squares(&mut sums.points, sight, load(WEIGHT));
            },
        );
        if !is_in_front {
            return None;
        }
        let residual = residual_totals(&sums.residual, self.budget.modes());
        let slope = sums.points.total().finish()?;
        Some(self.budget.finish_slope(pose, slope, kept, &residual))
    }
}

#[inline(always)]
fn residual_totals<A: Arithmetic, const K: usize>(sums: &[Four<A>; K], modes: usize) -> [f64; K] {
    if modes == 0 {
        return [0.0; K];
    }
    totals(sums)
}

#[inline(always)]
fn add_squares<N: Number>(slope: &mut SlopeSums<N>, sight: &Sight<N>, there: N) {
    let [u, v] = sight.residual;
    slope.squared_residuals_px = slope.squared_residuals_px.plus(there, (u * u).plus(v, v));
}

impl<const K: usize> LensBudget<'_, K> {
    /// Passes each point to `add`; `None` if one has no pixel.
    fn visit(
        &self,
        pose: &CentredPose,
        mut add: impl FnMut(&Independent<f64>, &[[f64; 3]; 3], &[Lane], usize, &Sight<f64>),
    ) -> Option<()> {
        let r = pose.rotation.matrix();
        let rotation = [
            [r.m11, r.m12, r.m13],
            [r.m21, r.m22, r.m23],
            [r.m31, r.m32, r.m33],
        ];
        for (four, lanes) in self.observations.chunks(LANES).zip(self.budget.blocks()) {
            for (lane, seen) in four.iter().enumerate() {
                let sight = sight_through(self.camera, seen, &self.markers_mean, pose)?;
                let load = |index: usize| lanes[index][lane];
                let weighed = sight.weighed(load(NOISE), load(WEIGHT), load(SURVEY));
                add(&weighed, &rotation, lanes, lane, &sight);
            }
        }
        Some(())
    }
}

/// Returns a point as seen from a pose; `None` if it has no pixel.
fn sight_through(
    camera: &Camera,
    seen: &Observation,
    markers_mean: &Point3<f64>,
    pose: &CentredPose,
) -> Option<Sight<f64>> {
    let arm = pose.rotation * (seen.marker_in_tanker - markers_mean);
    let q = arm + pose.centre_in_camera;
    let (pixel, d) = camera.project_point(&q)?;
    Some(Sight {
        arm: [arm.x, arm.y, arm.z],
        by_point: [[d.m11, d.m12, d.m13], [d.m21, d.m22, d.m23]],
        residual: [pixel.u - seen.pixel.u, pixel.v - seen.pixel.v],
    })
}

impl<const K: usize> Residuals for LensBudget<'_, K> {
    type Kept = Elimination<K>;
    const RISE: f64 = REWEIGHTED;

    fn linearise(&self, pose: &CentredPose) -> Option<Linearised<Elimination<K>>> {
        let mut sums = Everything {
            points: Sums::new(0.0),
            gram: Gram::<_, K>::new(0.0),
        };
        self.visit(pose, |seen, rotation, lanes, lane, sight| {
            sums.add(seen, self.budget, rotation, |index| lanes[index][lane]);
            add_squares(&mut sums.points.slope, sight, 1.0);
        })?;
        let residual = *sums.gram.residual_mut();
        self.budget
            .finish(pose, sums.points.finish(), &sums.gram, &residual)
    }

    fn slope(&self, pose: &CentredPose, kept: &Elimination<K>) -> Option<Slope> {
        let mut sums = SlopeOnly {
            points: SlopeSums::new(0.0),
            residual: [0.0; K],
        };
        self.visit(pose, |seen, rotation, lanes, lane, sight| {
            sums.add(seen, self.budget, rotation, |index| lanes[index][lane]);
            add_squares(&mut sums.points, sight, 1.0);
        })?;
        let slope = sums.points.finish()?;
        Some(self.budget.finish_slope(pose, slope, kept, &sums.residual))
    }
}
