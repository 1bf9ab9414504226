//! A frame's points in blocks of four, so that sums over them use vector registers.

use nalgebra::{Matrix3, Point3, Vector3};
use smallvec::SmallVec;

use super::four::{Arithmetic, Four, LANES, Lane, Number, Plain, totals};
use crate::camera::{Camera, Ray};
use crate::estimation::{EstimateError, Observation};

/// Points kept on the stack.
pub(crate) const INLINE_POINTS: usize = 64;
const INLINE_BLOCKS: usize = INLINE_POINTS / LANES;
/// Storage for a frame's blocks; six kilobytes that are filled in place and never moved.
pub(crate) type Blocks = SmallVec<[Block; INLINE_BLOCKS]>;
/// Least second moment of the markers about their line, relative to the first; corresponds to a ratio of lengths of
/// 1e-3.
const MIN_WIDTH_SHARE: f64 = 1e-6;

/// Four points. The last block is padded with points of zero weight whose marker is at the mean.
#[derive(Debug, Clone, Copy)]
#[repr(align(32))]
pub(crate) struct Block {
    /// Marker from the markers' mean, tanker frame, m.
    pub(crate) marker: [Lane; 3],
    /// Detected ray: x, y on the plane `z = 1`.
    pub(crate) ray: [Lane; 2],
    /// Inverse covariance of the detected ray: 11, 12, 22; 12 is zero for a pinhole.
    pub(crate) information: [Lane; 3],
    /// px²; zero for padding.
    pub(crate) variance: Lane,
}

/// All points of a frame.
#[derive(Debug)]
pub(crate) struct Points<'a> {
    pub(crate) blocks: &'a [Block],
    /// Information of rows relative to that of columns, for a camera without distortion: the same for all points.
    pub(crate) row_by_column_information: Option<f64>,
    /// Mean of the markers, the reference point of all fits, m, tanker frame.
    pub(crate) mean: Point3<f64>,
    /// Distance of the farthest marker from their mean, m.
    pub(crate) radius: f64,
    /// Second moments of the markers about their mean, m².
    pub(crate) scatter: Matrix3<f64>,
}

impl Block {
    const EMPTY: Self = Self {
        marker: [[0.0; LANES]; 3],
        ray: [[0.0; LANES]; 2],
        information: [[0.0; LANES]; 3],
        variance: [0.0; LANES],
    };

    #[inline(always)]
    fn put_marker(&mut self, lane: usize, marker: &Point3<f64>, mean: &Point3<f64>) {
        for axis in 0..3 {
            self.marker[axis][lane] = marker[axis] - mean[axis];
        }
    }

    fn put_measurement(&mut self, lane: usize, point: &Measurement) {
        self.ray[0][lane] = point.ray.x;
        self.ray[1][lane] = point.ray.y;
        for (entry, value) in self.information.iter_mut().zip(point.information) {
            entry[lane] = value;
        }
        self.variance[lane] = point.variance;
    }
}

struct Measurement {
    ray: Ray,
    information: [f64; 3],
    variance: f64,
}

impl<'a> Points<'a> {
    /// Returns the points with their rays, about the markers' mean.
    ///
    /// [`EstimateError::NoRay`], or [`EstimateError::Degenerate`] for collinear markers, whose rotation about their
    /// line is undetermined.
    #[inline(always)]
    pub(crate) fn new(
        arithmetic: impl Arithmetic,
        camera: &Camera,
        observations: &[Observation],
        room: &'a mut Blocks,
    ) -> Result<Self, EstimateError> {
        let mean = mean_marker(arithmetic, observations);
        room.clear();
        room.reserve(observations.len().div_ceil(LANES));
        let pinhole = camera.pinhole();
        for four in observations.chunks(LANES) {
            let mut block = Block::EMPTY;
            let is_measured = pinhole
                .is_some_and(|pinhole| measure_four(arithmetic, pinhole, &mean, four, &mut block));
            if !is_measured {
                for (lane, seen) in four.iter().enumerate() {
                    block.put_marker(lane, &seen.marker_in_tanker, &mean);
                    block.put_measurement(lane, &measure(camera, seen)?);
                }
            }
            room.push(block);
        }
        let ratio = pinhole.map(|[fx, fy, ..]| (fy / fx).powi(2));
        let points = Self::about(arithmetic, mean, ratio, room);
        check_spread(&points.scatter)?;
        Ok(points)
    }

    /// Returns points with given rays and equal weights.
    pub(crate) fn from_rays(
        rays: &[Ray],
        markers_in_tanker: &[Point3<f64>],
        room: &'a mut Blocks,
    ) -> Self {
        let mean = mean(markers_in_tanker, |marker| marker);
        room.clear();
        for (rays, markers) in rays.chunks(LANES).zip(markers_in_tanker.chunks(LANES)) {
            let mut block = Block::EMPTY;
            for (lane, (ray, marker)) in rays.iter().zip(markers).enumerate() {
                block.put_marker(lane, marker, &mean);
                let measurement = Measurement {
                    ray: *ray,
                    information: [1.0, 0.0, 1.0],
                    variance: 1.0,
                };
                block.put_measurement(lane, &measurement);
            }
            room.push(block);
        }
        Self::about(Plain, mean, Some(1.0), room)
    }

    #[inline(always)]
    fn about(
        arithmetic: impl Arithmetic,
        mean: Point3<f64>,
        row_by_column_information: Option<f64>,
        blocks: &'a [Block],
    ) -> Self {
        let mut moments = [Four::splat(arithmetic, 0.0); 6];
        let mut longest = [0.0_f64; LANES];
        for block in blocks {
            let [x, y, z] = [
                Four::new(arithmetic, block.marker[0]),
                Four::new(arithmetic, block.marker[1]),
                Four::new(arithmetic, block.marker[2]),
            ];
            let length = (x * x).plus(y, y).plus(z, z).lane();
            for i in 0..LANES {
                longest[i] = if length[i] > longest[i] {
                    length[i]
                } else {
                    longest[i]
                };
            }
            let pairs = [(x, x), (x, y), (x, z), (y, y), (y, z), (z, z)];
            for (moment, (a, b)) in moments.iter_mut().zip(pairs) {
                *moment = moment.plus(a, b);
            }
        }
        let [xx, xy, xz, yy, yz, zz] = totals(&moments);
        Self {
            blocks,
            row_by_column_information,
            mean,
            radius: longest.into_iter().fold(0.0, f64::max).sqrt(),
            scatter: Matrix3::new(xx, xy, xz, xy, yy, yz, xz, yz, zz),
        }
    }
}

/// Fills in the rays of a camera without distortion; false if a pixel has no ray.
#[inline(always)]
fn measure_four(
    arithmetic: impl Arithmetic,
    [fx, fy, cx, cy]: [f64; 4],
    mean: &Point3<f64>,
    four: &[Observation],
    block: &mut Block,
) -> bool {
    // Padding repeats the last point with zero weight.
    let seen = match four {
        [a, b, c, d] => [a, b, c, d],
        [a, b, c] => [a, b, c, c],
        [a, b] => [a, b, b, b],
        [a] => [a, a, a, a],
        _ => return true,
    };
    let count = four.len();
    let there = [0, 1, 2, 3].map(
        #[inline(always)]
        |lane| if lane < count { 1.0 } else { 0.0 },
    );
    let splat = |value| Four::splat(arithmetic, value);
    let load = |lane| Four::new(arithmetic, lane);
    let there = load(there);
    let [x, y, z, u] = Four::transposed([
        marker_and_column(arithmetic, seen[0]),
        marker_and_column(arithmetic, seen[1]),
        marker_and_column(arithmetic, seen[2]),
        marker_and_column(arithmetic, seen[3]),
    ]);
    block.marker = [
        ((x - splat(mean.x)) * there).lane(),
        ((y - splat(mean.y)) * there).lane(),
        ((z - splat(mean.z)) * there).lane(),
    ];
    let v = load([
        seen[0].pixel.v,
        seen[1].pixel.v,
        seen[2].pixel.v,
        seen[3].pixel.v,
    ]);
    let sigma = load([
        seen[0].sigma_px,
        seen[1].sigma_px,
        seen[2].sigma_px,
        seen[3].sigma_px,
    ]);
    let x = (u - splat(cx)) * splat(1.0 / fx);
    let y = (v - splat(cy)) * splat(1.0 / fy);
    let inverse_sigma = there / sigma;
    let (wu, wv) = (splat(fx) * inverse_sigma, splat(fy) * inverse_sigma);
    block.ray = [x.lane(), y.lane()];
    block.information = [(wu * wu).lane(), [0.0; LANES], (wv * wv).lane()];
    block.variance = (sigma * sigma * there).lane();
    // A sum is finite only if its terms are. If a term is too large, the caller checks point by point.
    (x + y).total().is_finite()
}

fn measure(camera: &Camera, seen: &Observation) -> Result<Measurement, EstimateError> {
    let no_ray = |cause| EstimateError::NoRay { id: seen.id, cause };
    let ray = camera.ray_from_pixel(seen.pixel).map_err(no_ray)?;
    // A pixel with a ray has a derivative there.
    let (_, by_ray) = camera.project(ray).ok_or(EstimateError::SINGULAR)?;
    let whitened = by_ray / seen.sigma_px;
    let information = whitened.tr_mul(&whitened);
    Ok(Measurement {
        ray,
        information: [information.m11, information.m12, information.m22],
        variance: seen.sigma_px * seen.sigma_px,
    })
}

/// Returns four numbers of an observation that are adjacent in memory: marker and column.
#[inline(always)]
fn marker_and_column<A: Arithmetic>(arithmetic: A, seen: &Observation) -> Four<A> {
    let marker = &seen.marker_in_tanker;
    Four::new(arithmetic, [marker.x, marker.y, marker.z, seen.pixel.u])
}

/// Returns the mean of the markers, m.
#[inline(always)]
fn mean_marker(arithmetic: impl Arithmetic, observations: &[Observation]) -> Point3<f64> {
    // Four sums in turn, so that additions need not wait for each other.
    let mut sums = [Four::splat(arithmetic, 0.0); 4];
    let (fours, rest) = observations.as_chunks::<4>();
    for four in fours {
        for k in 0..4 {
            sums[k] = sums[k] + marker_and_column(arithmetic, &four[k]);
        }
    }
    for seen in rest {
        sums[0] = sums[0] + marker_and_column(arithmetic, seen);
    }
    let [x, y, z, _] = ((sums[0] + sums[1]) + (sums[2] + sums[3])).lane();
    Point3::new(x, y, z) / observations.len() as f64
}

/// Returns the mean of some markers, m.
pub(crate) fn mean<T>(items: &[T], marker: impl Fn(&T) -> &Point3<f64>) -> Point3<f64> {
    let sum: Vector3<f64> = items.iter().map(|item| marker(item).coords).sum();
    Point3::from(sum / items.len() as f64)
}

#[inline(always)]
fn check_spread(s: &Matrix3<f64>) -> Result<(), EstimateError> {
    // The second invariant is approximately the product of the two largest eigenvalues.
    let second = s.m11 * s.m22 + s.m22 * s.m33 + s.m33 * s.m11
        - (s.m12 * s.m12 + s.m23 * s.m23 + s.m13 * s.m13);
    if second > MIN_WIDTH_SHARE * s.trace() * s.trace() {
        Ok(())
    } else {
        Err(EstimateError::ON_ONE_LINE)
    }
}
