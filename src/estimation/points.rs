//! A frame's points side by side, four to a block, so that sums over them run in vector registers.

use nalgebra::{Matrix3, Point3, Vector3};
use smallvec::SmallVec;

use super::{EstimateError, Observation};
use crate::camera::{Camera, Ray};

/// Points in a block: one AVX register of doubles, or two of SSE2 or Neon.
pub(crate) const LANES: usize = 4;
/// One number of each point of a block.
pub(crate) type Lane = [f64; LANES];
/// Blocks kept without the heap: 64 points.
const INLINE_BLOCKS: usize = 16;
/// Least second moment of the markers about their line, relative to the first: a thousandth in length.
const MIN_WIDTH_SHARE: f64 = 1e-6;

/// Four points. What is missing to four at the end has no weight and lies in the markers' mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Block {
    /// Marker from the markers' mean, tanker frame, m.
    pub(crate) marker: [Lane; 3],
    /// Measured ray: x, y on the plane `z = 1`.
    pub(crate) ray: [Lane; 2],
    /// Inverse covariance of the measured ray: 11, 12, 22.
    pub(crate) information: [Lane; 3],
    /// Focal length over sigma, for columns and rows of a pinhole.
    pub(crate) whitening: [Lane; 2],
    /// px²; zero where there is no point.
    pub(crate) variance: Lane,
}

/// All points of a frame.
#[derive(Debug)]
pub(crate) struct Points {
    pub(crate) blocks: SmallVec<[Block; INLINE_BLOCKS]>,
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
        whitening: [[0.0; LANES]; 2],
        variance: [0.0; LANES],
    };

    fn put(&mut self, lane: usize, point: &MeasuredPoint) {
        for (axis, value) in self.marker.iter_mut().zip(point.marker) {
            axis[lane] = value;
        }
        self.ray[0][lane] = point.ray.x;
        self.ray[1][lane] = point.ray.y;
        for (entry, value) in self.information.iter_mut().zip(point.information) {
            entry[lane] = value;
        }
        for (entry, value) in self.whitening.iter_mut().zip(point.whitening) {
            entry[lane] = value;
        }
        self.variance[lane] = point.variance;
    }
}

struct MeasuredPoint {
    marker: [f64; 3],
    ray: Ray,
    information: [f64; 3],
    whitening: [f64; 2],
    variance: f64,
}

impl Points {
    /// Returns the points with their rays, about the markers' mean.
    ///
    /// # Errors
    /// [`EstimateError::NoRay`], or [`EstimateError::Degenerate`] for markers on one line, about
    /// which the tanker could turn freely.
    pub(crate) fn new(
        camera: &Camera,
        observations: &[Observation],
    ) -> Result<Self, EstimateError> {
        let mean = mean(observations.iter().map(|seen| &seen.marker_in_tanker));
        let (scatter, radius) =
            spread(observations.iter().map(|seen| seen.marker_in_tanker - mean));
        check_spread(&scatter)?;
        let mut blocks = SmallVec::new();
        for four in observations.chunks(LANES) {
            let mut block = Block::EMPTY;
            for (lane, seen) in four.iter().enumerate() {
                block.put(lane, &measure(camera, seen, &mean)?);
            }
            blocks.push(block);
        }
        Ok(Self {
            blocks,
            mean,
            radius,
            scatter,
        })
    }
}

impl Points {
    /// Returns points whose rays are given, all of the same weight.
    pub(crate) fn from_rays(rays: &[Ray], markers_in_tanker: &[Point3<f64>]) -> Self {
        let mean = mean(markers_in_tanker.iter());
        let mut blocks = SmallVec::new();
        for (rays, markers) in rays.chunks(LANES).zip(markers_in_tanker.chunks(LANES)) {
            let mut block = Block::EMPTY;
            for (lane, (ray, marker)) in rays.iter().zip(markers).enumerate() {
                let point = MeasuredPoint {
                    marker: (marker - mean).into(),
                    ray: *ray,
                    information: [1.0, 0.0, 1.0],
                    whitening: [1.0; 2],
                    variance: 1.0,
                };
                block.put(lane, &point);
            }
            blocks.push(block);
        }
        let (scatter, radius) = spread(markers_in_tanker.iter().map(|marker| marker - mean));
        Self {
            blocks,
            mean,
            radius,
            scatter,
        }
    }
}

#[inline]
fn measure(
    camera: &Camera,
    seen: &Observation,
    mean: &Point3<f64>,
) -> Result<MeasuredPoint, EstimateError> {
    let no_ray = |cause| EstimateError::NoRay { id: seen.id, cause };
    let ray = camera.ray_from_pixel(seen.pixel).map_err(no_ray)?;
    let inverse_sigma = 1.0 / seen.sigma_px;
    let (information, whitening) = if let Some([fx, fy, ..]) = camera.pinhole() {
        let whitening = [fx * inverse_sigma, fy * inverse_sigma];
        (
            [
                whitening[0] * whitening[0],
                0.0,
                whitening[1] * whitening[1],
            ],
            whitening,
        )
    } else {
        // A pixel that has a ray has a derivative there.
        let (_, by_ray) = camera.project(ray).ok_or(EstimateError::SINGULAR)?;
        let whitened = by_ray * inverse_sigma;
        let information = whitened.tr_mul(&whitened);
        (
            [information.m11, information.m12, information.m22],
            [0.0; 2],
        )
    };
    Ok(MeasuredPoint {
        marker: (seen.marker_in_tanker - mean).into(),
        ray,
        information,
        whitening,
        variance: seen.sigma_px * seen.sigma_px,
    })
}

/// Returns the mean of the markers, m.
#[inline]
pub(crate) fn mean<'a>(points: impl ExactSizeIterator<Item = &'a Point3<f64>>) -> Point3<f64> {
    let share = 1.0 / points.len() as f64;
    Point3::from(points.fold(Vector3::zeros(), |sum, p| sum + p.coords) * share)
}

/// Second moments of the arms, m², and the length of the longest, m.
#[inline]
fn spread(arms: impl Iterator<Item = Vector3<f64>>) -> (Matrix3<f64>, f64) {
    let (scatter, squared) = arms.fold((Matrix3::zeros(), 0.0_f64), |(sum, longest), arm| {
        (sum + arm * arm.transpose(), longest.max(arm.norm_squared()))
    });
    (scatter, squared.sqrt())
}

fn check_spread(s: &Matrix3<f64>) -> Result<(), EstimateError> {
    // The second invariant is about the product of the two largest eigenvalues.
    let second = s.m11 * s.m22 + s.m22 * s.m33 + s.m33 * s.m11
        - (s.m12 * s.m12 + s.m23 * s.m23 + s.m13 * s.m13);
    if second > MIN_WIDTH_SHARE * s.trace() * s.trace() {
        Ok(())
    } else {
        Err(EstimateError::ON_ONE_LINE)
    }
}
