//! Points seen by a camera without distortion, four at a time.

use super::sums::{SlopeSums, Sums, Weight};
use super::{Linearised, Residuals, Slope};
use crate::estimation::four::{Arithmetic, Four, LANES, Lane, Number, keep_in_memory};
use crate::estimation::points::{Block, Points};
use crate::estimation::refine::CentredPose;

/// Points seen by a camera without distortion, four at a time.
pub(crate) struct PinholeResiduals<'a, A> {
    pub(crate) arithmetic: A,
    pub(crate) points: &'a Points<'a>,
}

impl<A: Arithmetic> Residuals for PinholeResiduals<'_, A> {
    #[inline(always)]
    fn linearise(&self, pose: &CentredPose) -> Option<Linearised> {
        let mut sums = Sums::new(Four::splat(self.arithmetic, 0.0));
        let is_in_front = self.visit(
            pose,
            #[inline(always)]
            |seen| {
                sums.add(seen.arm, seen.weight, seen.slope);
                sums.slope.add_squares(&seen);
                keep_in_memory(&mut sums);
            },
        );
        if is_in_front {
            sums.total().finish()
        } else {
            None
        }
    }

    #[inline(always)]
    fn slope(&self, pose: &CentredPose) -> Option<Slope> {
        let mut sums = SlopeSums::new(Four::splat(self.arithmetic, 0.0));
        let is_in_front = self.visit(
            pose,
            #[inline(always)]
            |seen| {
                sums.add(seen.arm, seen.slope);
                sums.add_squares(&seen);
            },
        );
        if is_in_front {
            sums.total().finish()
        } else {
            None
        }
    }
}

/// Four points, seen from a pose.
struct Seen<A: Arithmetic> {
    arm: [Four<A>; 3],
    weight: Weight<Four<A>>,
    /// `Dᵀ r`.
    slope: [Four<A>; 3],
    /// Squared whitened residual.
    squared: Four<A>,
    variance: Four<A>,
}

impl<A: Arithmetic> PinholeResiduals<'_, A> {
    /// Gives each block to `add`; returns whether all points were in front of the camera.
    #[inline(always)]
    fn visit(&self, pose: &CentredPose, mut add: impl FnMut(Seen<A>)) -> bool {
        let pose = PoseInRegisters::new(self.arithmetic, pose);
        let mut nearest = [f64::INFINITY; LANES];
        for block in self.points.blocks {
            let (seen, depth) = pose.see(self.arithmetic, block);
            add(seen);
            let depth = depth.lane();
            for i in 0..LANES {
                nearest[i] = if depth[i] < nearest[i] {
                    depth[i]
                } else {
                    nearest[i]
                };
            }
        }
        // A depth that is not a number makes the squared residuals so too.
        nearest.iter().all(|depth| *depth > 0.0)
    }
}

/// Each number of a pose four times.
struct PoseInRegisters<A: Arithmetic> {
    rotation: [[Four<A>; 3]; 3],
    centre_in_camera: [Four<A>; 3],
}

impl<A: Arithmetic> PoseInRegisters<A> {
    #[inline(always)]
    fn new(arithmetic: A, pose: &CentredPose) -> Self {
        let r = pose.rotation.matrix();
        let c = &pose.centre_in_camera;
        let splat = |value| Four::splat(arithmetic, value);
        Self {
            rotation: [
                [splat(r.m11), splat(r.m12), splat(r.m13)],
                [splat(r.m21), splat(r.m22), splat(r.m23)],
                [splat(r.m31), splat(r.m32), splat(r.m33)],
            ],
            centre_in_camera: [splat(c.x), splat(c.y), splat(c.z)],
        }
    }
}

impl<A: Arithmetic> PoseInRegisters<A> {
    /// Returns what the residuals of a block are made of, and its depths.
    #[inline(always)]
    fn see(&self, arithmetic: A, block: &Block) -> (Seen<A>, Four<A>) {
        let load = |lane: &Lane| Four::new(arithmetic, *lane);
        let p = [
            load(&block.marker[0]),
            load(&block.marker[1]),
            load(&block.marker[2]),
        ];
        let turned = |row: &[Four<A>; 3]| (row[0] * p[0]).plus(row[1], p[1]).plus(row[2], p[2]);
        let r = &self.rotation;
        let a = [turned(&r[0]), turned(&r[1]), turned(&r[2])];
        let c = &self.centre_in_camera;
        let depth = a[2] + c[2];
        let inverse = Four::splat(arithmetic, 1.0) / depth;
        let (x, y) = ((a[0] + c[0]) * inverse, (a[1] + c[1]) * inverse);
        let [b11, _, b22] = &block.information;
        let (b11, b22) = (load(b11), load(b22));
        // Residuals on the plane z = 1, which a pinhole only scales.
        let (rx, ry) = (x - load(&block.ray[0]), y - load(&block.ray[1]));
        let (e1, e2) = (b11 * inverse, b22 * inverse);
        let (m11, m22) = (e1 * inverse, e2 * inverse);
        let zero = Four::splat(arithmetic, 0.0);
        let (m13, m23) = (zero.minus(x, m11), zero.minus(y, m22));
        let m33 = zero.minus(x, m13).minus(y, m23);
        let (s1, s2) = (e1 * rx, e2 * ry);
        let s3 = zero.minus(x, s1).minus(y, s2);
        let seen = Seen {
            arm: a,
            weight: Weight {
                m11,
                m12: None,
                m13,
                m22,
                m23,
                m33,
            },
            slope: [s1, s2, s3],
            squared: (b11 * rx * rx).plus(b22 * ry, ry),
            variance: load(&block.variance),
        };
        (seen, depth)
    }
}

impl<A: Arithmetic> SlopeSums<Four<A>> {
    #[inline(always)]
    fn add_squares(&mut self, seen: &Seen<A>) {
        self.chi_squared = self.chi_squared + seen.squared;
        self.squared_residuals_px = self.squared_residuals_px.plus(seen.squared, seen.variance);
    }
}
