//! The budget of one frame: the errors of each point, in blocks of four that correspond to those of the points.

use nalgebra::{Rotation3, UnitQuaternion, Vector2, Vector3};
use smallvec::SmallVec;

use super::{ErrorBudget, ImageMode, MAX_IMAGE_MODES};
use crate::camera::Camera;
use crate::estimation::Observation;
use crate::estimation::lanes::four::{Arithmetic, Four, Kernel, LANES, Lane, Number, vectorised};
use crate::estimation::lanes::points::{Block, Points};
use crate::target::MAX_FLEX_MODES;

/// Lanes kept on the stack: 64 points with one flex mode and six modes of the image, or fewer points with more modes.
const INLINE_LANES: usize = 512;

/// Lanes of a block: noise, weight, survey, then three for each flex mode and two for each mode of the image.
pub(super) const NOISE: usize = 0;
pub(super) const WEIGHT: usize = 1;
pub(super) const SURVEY: usize = 2;
pub(super) const MODES: usize = 3;

/// A normal distribution of the attitude, the same about every axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct AttitudePrior {
    pub(crate) camera_from_tanker: Rotation3<f64>,
    /// 1/rad².
    pub(crate) information: f64,
}

impl AttitudePrior {
    /// Returns the turn from the prior to a rotation, rad, camera axes.
    pub(crate) fn turn_to(&self, camera_from_tanker: &Rotation3<f64>) -> Vector3<f64> {
        let turn = camera_from_tanker * self.camera_from_tanker.inverse();
        // By its quaternion: of hardly any turn the matrix's trace gives half the digits, or NaN.
        UnitQuaternion::from_rotation_matrix(&turn).scaled_axis()
    }
}

/// The error budget of each point of a frame.
#[derive(Debug)]
pub(crate) struct FrameBudget {
    lanes: SmallVec<[Lane; INLINE_LANES]>,
    pub(super) flex_modes: usize,
    pub(super) image_modes: usize,
    pub(super) attitude: Option<AttitudePrior>,
}

/// The error budget of one point.
pub(crate) struct PointBudget {
    /// Variance of each coordinate, m².
    pub(crate) survey_variance_m2: f64,
    /// Its displacement by each flex mode at one sigma, tanker frame, m.
    pub(crate) flex: SmallVec<[Vector3<f64>; MAX_FLEX_MODES]>,
    /// Its shift by each mode of the image at one sigma, px.
    pub(crate) image: SmallVec<[Vector2<f64>; MAX_IMAGE_MODES]>,
}

impl FrameBudget {
    /// Returns empty storage for a frame.
    #[inline(always)]
    pub(crate) fn new(attitude: Option<AttitudePrior>) -> Self {
        Self {
            lanes: SmallVec::new(),
            flex_modes: 0,
            image_modes: 0,
            attitude,
        }
    }

    /// Returns the prior of the attitude, if there is one.
    #[inline(always)]
    pub(crate) const fn attitude(&self) -> Option<&AttitudePrior> {
        self.attitude.as_ref()
    }

    /// Returns the degrees of freedom that the prior adds to the test of the residuals.
    pub(crate) fn degrees_of_freedom(&self) -> usize {
        if self.attitude.is_some() { 3 } else { 0 }
    }

    /// Fills in the budget of these points. Modes of the image are evaluated at the detected pixels: an offset of a
    /// pixel or two changes them by a fraction of a percent.
    pub(crate) fn fill(
        &mut self,
        budget: Option<&ErrorBudget>,
        camera: &Camera,
        observations: &[Observation],
        points: &Points,
    ) {
        self.flex_modes = budget.map_or(0, |budget| budget.flex.len());
        self.image_modes = budget.map_or(0, |budget| budget.image.len());
        let stride = self.stride();
        self.lanes.clear();
        self.lanes
            .resize(points.blocks.len() * stride, [0.0; LANES]);
        let mut place = 0;
        for (lanes, four) in self
            .lanes
            .chunks_exact_mut(stride)
            .zip(observations.chunks(LANES))
        {
            lanes[NOISE] = [1.0; LANES];
            for (lane, seen) in four.iter().enumerate() {
                lanes[NOISE][lane] = seen.sigma_px * seen.sigma_px;
                lanes[WEIGHT][lane] = 1.0;
                let marker = budget.and_then(|budget| budget.marker(seen.id, &mut place));
                if let Some(marker) = marker {
                    lanes[SURVEY][lane] = marker.survey_sigma_m * marker.survey_sigma_m;
                    let shapes = lanes[MODES..].as_chunks_mut::<3>().0;
                    for (shape, shift) in shapes.iter_mut().zip(&marker.flex[..self.flex_modes]) {
                        for axis in 0..3 {
                            shape[axis][lane] = shift[axis];
                        }
                    }
                }
            }
        }
        let Some(budget) = budget else { return };
        let first = MODES + 3 * self.flex_modes;
        if let Some([fx, fy, ..]) = camera.pinhole() {
            vectorised(PinholeModes {
                focal: [fx, fy],
                modes: &budget.image,
                points,
                lanes: &mut self.lanes,
                stride,
                first,
            });
        } else {
            let lanes = self.lanes.chunks_exact_mut(stride);
            for (lanes, four) in lanes.zip(observations.chunks(LANES)) {
                for (lane, seen) in four.iter().enumerate() {
                    let by = camera
                        .ray_from_pixel(seen.pixel)
                        .ok()
                        .and_then(|ray| camera.pixel_by_calibration(ray));
                    // The points have been prepared, so each has a ray.
                    let Some(by) = by else { continue };
                    let shifts = lanes[first..].as_chunks_mut::<2>().0;
                    for (shift, mode) in shifts.iter_mut().zip(&budget.image) {
                        for &(index, sigma) in &mode.terms {
                            shift[0][lane] += sigma * by[(0, index)];
                            shift[1][lane] += sigma * by[(1, index)];
                        }
                    }
                }
            }
        }
    }

    /// Returns the lanes of each block of four points.
    #[inline(always)]
    pub(super) fn blocks(&self) -> std::slice::ChunksExact<'_, Lane> {
        self.lanes.chunks_exact(self.stride())
    }

    /// Returns the budget of one point.
    pub(crate) fn point(&self, index: usize) -> PointBudget {
        let (block, lane) = (index / LANES, index % LANES);
        let lanes = &self.lanes[block * self.stride()..][..self.stride()];
        let (flex, image) = lanes[MODES..].split_at(3 * self.flex_modes);
        let vector = |[x, y, z]: &[Lane; 3]| Vector3::new(x[lane], y[lane], z[lane]);
        let shift = |[u, v]: &[Lane; 2]| Vector2::new(u[lane], v[lane]);
        PointBudget {
            survey_variance_m2: lanes[SURVEY][lane],
            flex: flex.as_chunks().0.iter().map(vector).collect(),
            image: image.as_chunks().0.iter().map(shift).collect(),
        }
    }

    /// Returns the number of modes.
    #[inline(always)]
    pub(super) fn modes(&self) -> usize {
        self.flex_modes + self.image_modes
    }

    fn stride(&self) -> usize {
        MODES + 3 * self.flex_modes + 2 * self.image_modes
    }
}

/// The modes of the image of a camera without distortion, four points at a time.
struct PinholeModes<'a> {
    focal: [f64; 2],
    modes: &'a [ImageMode],
    points: &'a Points<'a>,
    lanes: &'a mut [Lane],
    stride: usize,
    first: usize,
}

impl Kernel for PinholeModes<'_> {
    type Output = ();

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) {
        let blocks = self.lanes.chunks_exact_mut(self.stride);
        for (lanes, block) in blocks.zip(self.points.blocks) {
            let columns = PinholeColumns::new(arithmetic, self.focal, block);
            let shifts = lanes[self.first..].as_chunks_mut::<2>().0;
            for (shift, mode) in shifts.iter_mut().zip(self.modes) {
                let mut sums = [columns.zero; 2];
                for &(index, sigma) in &mode.terms {
                    let column = columns.column(index);
                    let sigma = Four::splat(arithmetic, sigma);
                    sums[0] = sums[0].plus(sigma, column[0]);
                    sums[1] = sums[1].plus(sigma, column[1]);
                }
                *shift = [sums[0].lane(), sums[1].lane()];
            }
        }
    }
}

/// Terms of the columns of `Camera::pixel_by_calibration` for a camera without distortion.
struct PinholeColumns<A: Arithmetic> {
    zero: Four<A>,
    one: Four<A>,
    two: Four<A>,
    x: Four<A>,
    y: Four<A>,
    fx: Four<A>,
    fy: Four<A>,
    /// x² + y².
    s: Four<A>,
}

impl<A: Arithmetic> PinholeColumns<A> {
    #[inline(always)]
    fn new(arithmetic: A, [fx, fy]: [f64; 2], block: &Block) -> Self {
        let splat = |value| Four::splat(arithmetic, value);
        let x = Four::new(arithmetic, block.ray[0]);
        let y = Four::new(arithmetic, block.ray[1]);
        Self {
            zero: splat(0.0),
            one: splat(1.0),
            two: splat(2.0),
            x,
            y,
            fx: splat(fx),
            fy: splat(fy),
            s: (x * x).plus(y, y),
        }
    }

    #[inline(always)]
    fn column(&self, index: usize) -> [Four<A>; 2] {
        let (zero, x, y, s) = (self.zero, self.x, self.y, self.s);
        let pixels = |by_x: Four<A>, by_y: Four<A>| [self.fx * by_x, self.fy * by_y];
        let cross = self.two * x * y;
        match index {
            0 => pixels(x, zero),
            1 => pixels(zero, y),
            2 => [self.one, zero],
            3 => [zero, self.one],
            4 => pixels(x * s, y * s),
            5 => pixels(x * s * s, y * s * s),
            6 => pixels(cross, s.plus(self.two * y, y)),
            7 => pixels(s.plus(self.two * x, x), cross),
            8 => pixels(x * s * s * s, y * s * s * s),
            9 => pixels(zero.minus(x, s), zero.minus(y, s)),
            10 => pixels(zero.minus(x * s, s), zero.minus(y * s, s)),
            _ => pixels(zero.minus(x * s * s, s), zero.minus(y * s * s, s)),
        }
    }
}
