//! The effect of calibration errors: derivatives of pixels by the calibration, and a camera with changed calibration.

use nalgebra::{Point2, SMatrix, SVector};

use super::distortion::{BrownConrady, Equidistant, Lens};
use super::{Camera, Ray};

/// The parameters of a calibration: `ln fx, ln fy, cx, cy`, then D in the order of `sensor_msgs/CameraInfo`.
///
/// Focal lengths enter by their logarithm: a change of 0.01 is 1 %.
pub const CALIBRATION_SIZE: usize = 12;
/// Index of the first coefficient of D.
pub const FIRST_COEFFICIENT: usize = 4;

/// A change of a calibration: see [`CALIBRATION_SIZE`] for its order; px for cx and cy.
pub type CalibrationChange = SVector<f64, CALIBRATION_SIZE>;

impl Camera {
    /// Returns the derivative of the pixel (u, v) of a ray by the calibration, px; `None` where the ray has no pixel.
    ///
    /// Without a lens model, D stands for the coefficients of `rational_polynomial` at zero. With `equidistant` it has
    /// four coefficients; the remaining columns are zero.
    #[must_use]
    pub fn pixel_by_calibration(&self, ray: Ray) -> Option<SMatrix<f64, 2, CALIBRATION_SIZE>> {
        let ideal = Point2::new(ray.x, ray.y);
        let (distorted, by_coefficients) = match &self.lens {
            None => (
                ideal,
                BrownConrady::new([0.0; 6], [0.0; 2]).by_coefficients(ideal),
            ),
            Some(Lens::BrownConrady(lens)) => (lens.distort(ideal)?.0, lens.by_coefficients(ideal)),
            Some(Lens::Equidistant(lens)) => {
                (lens.distort(ideal)?.0, Equidistant::by_coefficients(ideal))
            }
        };
        let mut by = SMatrix::zeros();
        by[(0, 0)] = self.fx * distorted.x;
        by[(1, 1)] = self.fy * distorted.y;
        by[(0, 2)] = 1.0;
        by[(1, 3)] = 1.0;
        for (index, column) in by_coefficients.iter().enumerate() {
            by[(0, FIRST_COEFFICIENT + index)] = self.fx * column.x;
            by[(1, FIRST_COEFFICIENT + index)] = self.fy * column.y;
        }
        Some(by)
    }

    /// Returns the camera with its calibration changed. A camera without a lens model gets a `rational_polynomial` one
    /// if a coefficient changes.
    #[must_use]
    pub fn with_change(&self, change: &CalibrationChange) -> Self {
        let d = |index: usize| change[FIRST_COEFFICIENT + index];
        let by = std::array::from_fn(d);
        let is_bent = by.iter().any(|value| *value != 0.0);
        let lens = match &self.lens {
            lens if !is_bent => *lens,
            None => Some(Lens::BrownConrady(
                BrownConrady::new([0.0; 6], [0.0; 2]).with_change(by),
            )),
            Some(Lens::BrownConrady(lens)) => Some(Lens::BrownConrady(lens.with_change(by))),
            Some(Lens::Equidistant(lens)) => Some(Lens::Equidistant(lens.with_change(by))),
        };
        Self {
            fx: self.fx * change[0].exp(),
            fy: self.fy * change[1].exp(),
            cx: self.cx + change[2],
            cy: self.cy + change[3],
            lens,
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CameraInfo;

    fn cameras() -> Vec<Camera> {
        let info = |model: &str, d: &[f64]| CameraInfo {
            width: 640,
            height: 480,
            distortion_model: model.to_owned(),
            d: d.to_vec(),
            k: [571.0, 0.0, 300.0, 0.0, 580.0, 250.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        [
            info("", &[]),
            info("plumb_bob", &[-0.28, 0.09, 0.0008, -0.0005, -0.012]),
            info(
                "rational_polynomial",
                &[0.3, 0.02, 1e-3, -1e-3, 0.01, 0.5, 0.03, 0.02],
            ),
            info("equidistant", &[-0.02, 0.01, 0.002, -0.001]),
        ]
        .iter()
        .map(|info| Camera::from_info(info, false).expect("a usual lens"))
        .collect()
    }

    #[test]
    fn derivatives_are_the_differences_of_changed_cameras() {
        const STEP: f64 = 1e-6;
        let ray = Ray { x: 0.31, y: -0.22 };
        for camera in cameras() {
            let by = camera.pixel_by_calibration(ray).expect("in the image");
            let coefficients = match camera.lens {
                Some(Lens::Equidistant(_)) => 4,
                _ => CALIBRATION_SIZE - FIRST_COEFFICIENT,
            };
            for index in 0..FIRST_COEFFICIENT + coefficients {
                let moved = |step: f64| {
                    let mut change = CalibrationChange::zeros();
                    change[index] = step;
                    let (pixel, _) = camera.with_change(&change).project(ray).expect("seen");
                    nalgebra::Vector2::new(pixel.u, pixel.v)
                };
                let difference = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
                let off = (difference - by.column(index)).norm();
                assert!(off < 1e-5, "{index}: {off} of {difference}");
            }
        }
    }

    #[test]
    fn no_change_is_the_same_camera() {
        for camera in cameras() {
            assert_eq!(camera.with_change(&CalibrationChange::zeros()), camera);
        }
    }
}
