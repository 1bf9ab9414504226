//! A frame linearised at its solution, in sigmas: what protection levels are computed from.

use nalgebra::{Matrix2, Vector2, Vector3};
use smallvec::SmallVec;

use super::{ErrorBudget, MAX_MODES};
use crate::camera::Camera;
use crate::estimation::Observation;
use crate::geometry::skew;
use nalgebra::Isometry3;

/// Points kept without the heap.
const INLINE: usize = 16;

/// Residuals and derivatives of the used points, each point's divided by its own noise and survey error: `L⁻¹ ·`, where
/// `L Lᵀ = σ² 1 + s² D Dᵀ`. What points share stands beside them.
#[derive(Debug, Clone)]
pub struct LinearFrame {
    /// Marker ids; the point at index `i` has rows `2 i` and `2 i + 1`.
    pub ids: SmallVec<[u32; INLINE]>,
    /// By position (m) and turn (rad), in the order of [`crate::geometry::PoseCovariance`].
    pub by_pose: SmallVec<[[f64; 6]; 2 * INLINE]>,
    /// Predicted minus seen, sigmas.
    pub residuals: SmallVec<[f64; 2 * INLINE]>,
    /// By one sigma of the detection's own noise in u and in v.
    pub by_noise: SmallVec<[[f64; 2]; 2 * INLINE]>,
    /// By each mode of the budget at one sigma: rows of [`Self::modes`] numbers.
    pub by_mode: SmallVec<[f64; 4 * INLINE]>,
    /// How many modes the budget has: first flex, then calibration and jitter.
    pub modes: usize,
    /// How many of them are flex.
    pub flex_modes: usize,
    /// Information of the attitude's prior about each axis, 1/rad²; 0 without one.
    pub attitude_information: f64,
}

impl LinearFrame {
    /// Returns the frame; `None` where a point has no pixel at the pose.
    pub(in crate::estimation) fn new<'a>(
        budget: Option<&ErrorBudget>,
        attitude_information: f64,
        camera: &Camera,
        used: impl Iterator<Item = &'a Observation>,
        pose: &Isometry3<f64>,
    ) -> Option<Self> {
        let flex_modes = budget.map_or(0, |budget| budget.flex.len());
        let modes = flex_modes + budget.map_or(0, |budget| budget.image.len());
        let mut frame = Self {
            ids: SmallVec::new(),
            by_pose: SmallVec::new(),
            residuals: SmallVec::new(),
            by_noise: SmallVec::new(),
            by_mode: SmallVec::new(),
            modes,
            flex_modes,
            attitude_information,
        };
        let rotation = pose.rotation.to_rotation_matrix();
        let mut place = 0;
        for seen in used {
            let arm = rotation * seen.marker_in_tanker.coords;
            let q = arm + pose.translation.vector;
            let (pixel, by_point) = camera.project_point(&q)?;
            let marker = budget.and_then(|budget| budget.marker(seen.id, &mut place));
            let survey_m = marker.map_or(0.0, |marker| marker.survey_sigma_m);
            let own = Matrix2::from_diagonal_element(seen.sigma_px.powi(2))
                + by_point * by_point.transpose() * survey_m.powi(2);
            let scale = own.cholesky()?.l().try_inverse()?;
            let by_point = scale * by_point;
            let by_turn = by_point * -skew(arm);
            let residual = scale * Vector2::new(pixel.u - seen.pixel.u, pixel.v - seen.pixel.v);
            frame.ids.push(seen.id);
            for row in 0..2 {
                frame.by_pose.push([
                    by_point[(row, 0)],
                    by_point[(row, 1)],
                    by_point[(row, 2)],
                    by_turn[(row, 0)],
                    by_turn[(row, 1)],
                    by_turn[(row, 2)],
                ]);
                frame.residuals.push(residual[row]);
                frame
                    .by_noise
                    .push([0, 1].map(|axis| scale[(row, axis)] * seen.sigma_px));
            }
            let Some(budget) = budget.filter(|_| modes > 0) else {
                continue;
            };
            let mut shifts: SmallVec<[Vector2<f64>; MAX_MODES]> = SmallVec::new();
            for mode in 0..flex_modes {
                let moved = marker.map_or_else(Vector3::zeros, |marker| marker.flex[mode]);
                shifts.push(by_point * (rotation * moved));
            }
            if !budget.image.is_empty() {
                let by = camera.pixel_by_calibration(camera.ray_from_pixel(seen.pixel).ok()?)?;
                for mode in &budget.image {
                    let mut shift = Vector2::zeros();
                    for &(index, sigma) in &mode.terms {
                        shift += by.column(index) * sigma;
                    }
                    shifts.push(scale * shift);
                }
            }
            for row in 0..2 {
                frame.by_mode.extend(shifts.iter().map(|shift| shift[row]));
            }
        }
        Some(frame)
    }
}
