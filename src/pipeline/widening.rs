//! Widening of sigmas that are smaller than the scatter of the residuals.
//!
//! Each frame's residuals are compared with those of a second before. Errors that are the same in both, for example a
//! marker's position or the calibration, cancel: they are not noise, and larger sigmas would only let them pass. Pose
//! errors and flex are projected out of the differences; the rest is noise of twice the stated variance. The result
//! does not depend on the sigmas in use, so there is no feedback.

use std::collections::VecDeque;

use nalgebra::{DMatrix, DVector, Isometry3, Matrix2x6, Point3, Vector3};

use super::residuals::MarkerResidual;
use super::sigma_watch::ENOUGH;
use super::window::Window;
use crate::camera::Camera;
use crate::estimation::FlexMode;
use crate::geometry::skew;

/// s; time between the residuals that are compared. A shorter time would miss noise that is correlated over some
/// frames; over a longer one the view changes.
const LAG_S: f64 = 1.0;
/// s; accepted range of that time.
const LAG_FROM_TO_S: [f64; 2] = [0.5, 2.0];
/// s; frames in quicker succession are not all stored.
const LEAST_STEP_S: f64 = 0.02;
/// Smaller factors count as 1: they are within the accuracy of the estimate.
const LEAST: f64 = 1.05;
/// Largest factor; beyond it, the sigmas are not the cause.
const MOST: f64 = 10.0;

/// The scatter of the last seconds, and the resulting factor.
#[derive(Debug)]
pub(super) struct Widening {
    /// Residuals of the last second, with their times and stated sigmas.
    earlier: VecDeque<(f64, Vec<MarkerResidual>)>,
    window: Window,
    factor: f64,
}

impl Default for Widening {
    fn default() -> Self {
        Self {
            earlier: VecDeque::new(),
            window: Window::default(),
            factor: 1.0,
        }
    }
}

/// The data needed to evaluate a difference of residuals.
pub(super) struct Sight<'a> {
    pub(super) camera: &'a Camera,
    pub(super) camera_from_tanker: &'a Isometry3<f64>,
    /// Modes in which the airframe bends.
    pub(super) flex: &'a [FlexMode],
}

impl Widening {
    /// Returns the factor for stated sigmas, at least 1.
    pub(super) fn factor(&self) -> f64 {
        self.factor
    }

    pub(super) fn forget(&mut self) {
        *self = Self::default();
    }

    /// Adds a fit, trusted or not.
    ///
    /// # Inputs
    /// * `residuals`: with sigmas that are the stated ones times the factor.
    /// * `marker_in_tanker`: returns the position of a marker, m.
    pub(super) fn take(
        &mut self,
        now_s: f64,
        residuals: &[MarkerResidual],
        sight: &Sight,
        marker_in_tanker: impl Fn(u32) -> Option<Point3<f64>>,
    ) {
        let latest_s = self.earlier.back().map(|(time_s, _)| *time_s);
        if let Some(latest_s) = latest_s
            && now_s < latest_s
        {
            if latest_s - now_s < LAG_S {
                // A late image; those in order are sufficient.
                return;
            }
            // A recording that restarts.
            self.earlier.clear();
        }
        while (self.earlier.get(1)).is_some_and(|(time_s, _)| now_s - time_s >= LAG_S) {
            self.earlier.pop_front();
        }
        let stated: Vec<MarkerResidual> = residuals
            .iter()
            .map(|seen| MarkerResidual {
                sigma_px: seen.sigma_px / self.factor,
                ..*seen
            })
            .collect();
        if let Some((earlier_s, earlier)) = self.earlier.front()
            && (LAG_FROM_TO_S[0]..LAG_FROM_TO_S[1]).contains(&(now_s - earlier_s))
            && self.window.takes(now_s)
            && let Some((squared, degrees_of_freedom)) =
                scatter(&stated, earlier, sight, marker_in_tanker)
        {
            self.window.take(now_s, squared, degrees_of_freedom);
            if self.window.count() >= ENOUGH
                && let Some(factor) = self.window.factor()
            {
                self.factor = if factor < LEAST {
                    1.0
                } else {
                    factor.min(MOST)
                };
            }
        }
        if latest_s.is_none_or(|latest_s| (now_s - latest_s).abs() >= LEAST_STEP_S) {
            self.earlier.push_back((now_s, stated));
        }
    }
}

/// Returns the squared difference of residuals over its variance, with pose and flex projected out, and its degrees of
/// freedom; `None` if there are none.
fn scatter(
    now: &[MarkerResidual],
    earlier: &[MarkerResidual],
    sight: &Sight,
    marker_in_tanker: impl Fn(u32) -> Option<Point3<f64>>,
) -> Option<(f64, f64)> {
    let unknowns = 6 + sight.flex.len();
    let mut information = DMatrix::zeros(unknowns, unknowns);
    let mut pull = DVector::zeros(unknowns);
    let (mut squared, mut rows) = (0.0, 0_usize);
    for seen in now {
        let Some(before) = earlier.iter().find(|before| before.id == seen.id) else {
            continue;
        };
        let at = marker_in_tanker(seen.id)?;
        let variance = seen.sigma_px.powi(2) + before.sigma_px.powi(2);
        let difference = seen.residual_px - before.residual_px;
        let by = derivative(sight, seen.id, &at)?;
        information += by.tr_mul(&by) / variance;
        pull += by.tr_mul(&difference) / variance;
        squared += difference.norm_squared() / variance;
        rows += 2;
    }
    let mut explaining = unknowns;
    for mode in 6..unknowns {
        // None of the mode's markers is visible.
        if information[(mode, mode)] == 0.0 {
            information[(mode, mode)] = 1.0;
            explaining -= 1;
        }
    }
    if rows <= explaining {
        return None;
    }
    let explained = pull.dot(&information.cholesky()?.solve(&pull));
    let left = rows - explaining;
    Some(((squared - explained).max(0.0), left as f64))
}

/// Returns the derivative of a marker's pixel by the pose and by the amplitude of each flex mode.
fn derivative(sight: &Sight, id: u32, marker: &Point3<f64>) -> Option<DMatrix<f64>> {
    let pose = sight.camera_from_tanker;
    let q = pose * marker;
    let (_, by_point) = sight.camera.project_point(&q.coords)?;
    let arm = pose.rotation * marker.coords;
    let mut by_pose = Matrix2x6::zeros();
    by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
    by_pose
        .fixed_view_mut::<2, 3>(0, 3)
        .copy_from(&(-by_point * skew(arm)));
    let mut by = DMatrix::zeros(2, 6 + sight.flex.len());
    by.view_mut((0, 0), (2, 6)).copy_from(&by_pose);
    for (mode, flex) in sight.flex.iter().enumerate() {
        let shape = flex.shape.iter().find(|(of, _)| *of == id);
        let shift = shape.map_or_else(Vector3::zeros, |(_, shift)| pose.rotation * shift);
        by.column_mut(6 + mode).copy_from(&(by_point * shift));
    }
    Some(by)
}
