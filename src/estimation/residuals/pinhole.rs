//! Points of a camera without distortion, four at a time.

use super::sums::{SlopeSums, Sums, Weight};
use super::{Linearised, Residuals, Slope};
use crate::estimation::centred_pose::CentredPose;
use crate::estimation::lanes::four::{Arithmetic, Four, LANES, Lane, Number, keep_in_memory};
use crate::estimation::lanes::points::{Block, Points};

/// Points of a camera without distortion, four at a time.
pub(crate) struct PinholeResiduals<'a, A> {
    pub(crate) arithmetic: A,
    pub(crate) points: &'a Points<'a>,
}

impl<A: Arithmetic> Residuals for PinholeResiduals<'_, A> {
    type Kept = ();
    const RISE: f64 = 0.0;

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
    fn slope(&self, pose: &CentredPose, (): &()) -> Option<Slope> {
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

/// Four points as seen from a pose.
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
    /// Passes each block to `add`; returns whether all points were in front of the camera.
    #[inline(always)]
    fn visit(&self, pose: &CentredPose, mut add: impl FnMut(Seen<A>)) -> bool {
        let pose = PoseInRegisters::new(self.arithmetic, pose);
        let mut nearest = [f64::INFINITY; LANES];
        // One block ahead: its division runs while the previous block is summed.
        let blocks = self.points.blocks;
        let Some(first) = blocks.first() else {
            return false;
        };
        let mut next = pose.sight(self.arithmetic, first);
        for (index, block) in blocks.iter().enumerate() {
            let sight = next;
            next = pose.sight(self.arithmetic, blocks.get(index + 1).unwrap_or(block));
            add(pose.see(self.arithmetic, block, &sight));
            let depth = sight.depth.lane();
            for i in 0..LANES {
                nearest[i] = if depth[i] < nearest[i] {
                    depth[i]
                } else {
                    nearest[i]
                };
            }
        }
        // If a depth is NaN, so are the squared residuals.
        nearest.iter().all(|depth| *depth > 0.0)
    }
}

/// The positions of four points.
#[derive(Clone, Copy)]
struct Sight<A: Arithmetic> {
    /// From the markers' mean, camera axes, m.
    arm: [Four<A>; 3],
    depth: Four<A>,
    inverse_depth: Four<A>,
}

/// Each number of a pose repeated four times.
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
    /// Returns the positions of a block's points.
    #[inline(always)]
    fn sight(&self, arithmetic: A, block: &Block) -> Sight<A> {
        let load = |lane: &Lane| Four::new(arithmetic, *lane);
        let p = [
            load(&block.marker[0]),
            load(&block.marker[1]),
            load(&block.marker[2]),
        ];
        let turned = |row: &[Four<A>; 3]| (row[0] * p[0]).plus(row[1], p[1]).plus(row[2], p[2]);
        let r = &self.rotation;
        let arm = [turned(&r[0]), turned(&r[1]), turned(&r[2])];
        let depth = arm[2] + self.centre_in_camera[2];
        Sight {
            arm,
            depth,
            inverse_depth: Four::splat(arithmetic, 1.0) / depth,
        }
    }

    /// Returns the terms of a block's residuals.
    #[inline(always)]
    fn see(&self, arithmetic: A, block: &Block, sight: &Sight<A>) -> Seen<A> {
        let load = |lane: &Lane| Four::new(arithmetic, *lane);
        let (a, inverse) = (sight.arm, sight.inverse_depth);
        let c = &self.centre_in_camera;
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
        Seen {
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
        }
    }
}

impl<A: Arithmetic> SlopeSums<Four<A>> {
    #[inline(always)]
    fn add_squares(&mut self, seen: &Seen<A>) {
        self.chi_squared = self.chi_squared + seen.squared;
        self.squared_residuals_px = self.squared_residuals_px.plus(seen.squared, seen.variance);
    }
}
