//! A changed calibration, and what it may still have wrong, as the files that the readers here accept.

use std::fmt::Write as _;

use nalgebra::DMatrix;

use super::budget_file::NAMES;
use super::calibration::{CALIBRATION_SIZE, CalibrationChange, FIRST_COEFFICIENT};
use super::distortion::Lens;
use super::{Camera, CameraInfo};

impl CameraInfo {
    /// Returns the calibration of the raw image with a change of the camera that was made from it: `K` and `D`, and `P` where
    /// it is `K`.
    ///
    /// # Inputs
    /// * `camera`: made from this info, not rectified.
    #[must_use]
    pub fn with_change(&self, camera: &Camera, change: &CalibrationChange) -> Self {
        let mut info = self.clone();
        let was_same = [0, 2, 4, 5].map(|k| self.k[k].to_bits() == self.p[k + k / 3].to_bits());
        info.k[0] *= change[0].exp();
        info.k[4] *= change[1].exp();
        // The image of the detections may be binned.
        info.k[2] += change[2] * self.k[0] / camera.fx;
        info.k[5] += change[3] * self.k[4] / camera.fy;
        if was_same.iter().all(|same| *same) {
            for k in [0, 2, 4, 5] {
                info.p[k + k / 3] = info.k[k];
            }
        }
        let coefficients = (0..CALIBRATION_SIZE - FIRST_COEFFICIENT)
            .map(|index| change[FIRST_COEFFICIENT + index]);
        let needed = coefficients
            .clone()
            .enumerate()
            .filter(|(_, change)| *change != 0.0)
            .map(|(index, _)| index + 1)
            .max()
            .unwrap_or(0);
        if needed > 0 {
            let least = match camera.lens {
                Some(Lens::Equidistant(_)) => 4,
                _ if needed > 5 || self.d.len() > 5 => 8,
                _ => 5,
            };
            if info.d.len() < least {
                info.d.resize(least, 0.0);
            }
            for (value, change) in info.d.iter_mut().zip(coefficients) {
                *value += change;
            }
            if !matches!(camera.lens, Some(Lens::Equidistant(_))) {
                let is_short = info.d.len() <= 5;
                let model = if is_short {
                    "plumb_bob"
                } else {
                    "rational_polynomial"
                };
                model.clone_into(&mut info.distortion_model);
            }
        }
        info
    }

    /// Returns the calibration in the format of ROS's `camera_calibration_parsers`; [`Self::from_yaml`] reads it back.
    #[must_use]
    pub fn to_yaml(&self) -> String {
        let row = |values: &[f64]| {
            let values: Vec<String> = values.iter().map(f64::to_string).collect();
            values.join(", ")
        };
        let matrix = |name: &str, rows: usize, values: &[f64]| {
            let cols = values.len() / rows.max(1);
            format!(
                "{name}:\n  rows: {rows}\n  cols: {cols}\n  data: [{}]\n",
                row(values)
            )
        };
        let mut text = format!(
            "image_width: {}\nimage_height: {}\ncamera_name: camera\n",
            self.width, self.height
        );
        text += &matrix("camera_matrix", 3, &self.k);
        let model = serde_json::Value::from(self.distortion_model.as_str());
        // Writing into a string cannot fail.
        let _ = writeln!(text, "distortion_model: {model}");
        text += &matrix("distortion_coefficients", 1, &self.d);
        text += &matrix("rectification_matrix", 3, &self.r);
        text += &matrix("projection_matrix", 3, &self.p);
        let roi = &self.roi;
        let _ = writeln!(
            text,
            "binning_x: {}\nbinning_y: {}\nroi:\n  x_offset: {}\n  y_offset: {}\n  height: {}\n  width: {}\n  do_rectify: {}",
            self.binning_x,
            self.binning_y,
            roi.x_offset,
            roi.y_offset,
            roi.height,
            roi.width,
            roi.do_rectify
        );
        text
    }

    /// Returns a calibration budget with a covariance of the calibration, as
    /// [`CalibrationBudget`](super::CalibrationBudget) reads it.
    ///
    /// # Inputs
    /// * `camera`: made from this info.
    /// * `covariance`: in the order and units of a [`CalibrationChange`].
    #[must_use]
    pub fn budget_to_yaml(&self, camera: &Camera, covariance: &DMatrix<f64>) -> String {
        let of_raw = |k: f64, used: f64| if k > 0.0 { k } else { used };
        let (fx, fy) = (of_raw(self.k[0], camera.fx), of_raw(self.k[4], camera.fy));
        let unit = |index: usize| match index {
            0 => fx,
            1 => fy,
            2 => fx / camera.fx,
            3 => fy / camera.fy,
            _ => 1.0,
        };
        let is_equidistant = matches!(camera.lens, Some(Lens::Equidistant(_)));
        let name = |index: usize| match index.checked_sub(FIRST_COEFFICIENT) {
            Some(coefficient) if is_equidistant => {
                ["k1", "k2", "k3", "k4"].get(coefficient).copied()
            }
            _ => NAMES.get(index).copied(),
        };
        let used: Vec<(usize, &str)> = (0..CALIBRATION_SIZE)
            .filter(|&index| covariance[(index, index)] > 0.0)
            .filter_map(|index| Some((index, name(index)?)))
            .collect();
        let names: Vec<&str> = used.iter().map(|(_, name)| *name).collect();
        let mut text = format!(
            "covariance:\n  parameters: [{}]\n  data:\n",
            names.join(", ")
        );
        for (i, _) in &used {
            let row: Vec<String> = used
                .iter()
                .map(|(j, _)| format!("{:e}", covariance[(*i, *j)] * unit(*i) * unit(*j)))
                .collect();
            // Writing into a string cannot fail.
            let _ = writeln!(text, "    - [{}]", row.join(", "));
        }
        text
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::CalibrationBudget;

    fn info(model: &str, d: &[f64]) -> CameraInfo {
        let k = [571.0, 0.0, 300.0, 0.0, 580.0, 250.0, 0.0, 0.0, 1.0];
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: model.to_owned(),
            d: d.to_vec(),
            k,
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [
                571.0, 0.0, 300.0, 0.0, 0.0, 580.0, 250.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            binning_x: 2,
            binning_y: 2,
            ..CameraInfo::default()
        }
    }

    fn change(coefficients: usize) -> CalibrationChange {
        let mut change = CalibrationChange::zeros();
        change
            .as_mut_slice()
            .iter_mut()
            .take(FIRST_COEFFICIENT + coefficients)
            .enumerate()
            .for_each(|(index, value)| *value = 0.002 * (index as f64 + 1.0));
        change
    }

    #[test]
    fn a_changed_info_is_the_changed_camera_and_its_file_is_read_back() {
        for (model, d, coefficients) in [
            ("", &[][..], 0),
            ("plumb_bob", &[], 2),
            ("plumb_bob", &[-0.28, 0.09, 0.0008, -0.0005, -0.012], 5),
            ("plumb_bob", &[-0.28, 0.09, 0.0008, -0.0005], 8),
            ("equidistant", &[-0.02, 0.01, 0.002, -0.001], 4),
        ] {
            let info = info(model, d);
            let camera = Camera::from_info(&info, false).expect("a usual lens");
            let by = change(coefficients);
            let changed = info.with_change(&camera, &by);
            let found = Camera::from_info(&changed, false).expect("a usual lens");
            let expected = camera.with_change(&by);
            for (u, v) in [(20.0, 30.0), (150.0, 125.0), (300.0, 220.0)] {
                let pixel = crate::camera::Pixel { u, v };
                let ray = found.ray_from_pixel(pixel).expect("inside");
                let (there, _) = expected.project(ray).expect("inside");
                let off = (there.u - u).hypot(there.v - v);
                assert!(off < 1e-6, "{model} {coefficients}: {off} px");
            }
            let (read, warnings) = CameraInfo::from_yaml(&changed.to_yaml(), "c").expect("read");
            assert_eq!(read, changed);
            assert!(warnings.is_empty(), "{warnings:?}");
            assert!((changed.p[0] - changed.k[0]).abs() < 1e-12, "P was K");
        }
    }

    #[test]
    fn a_covariance_is_read_back_from_its_file() {
        let info = info("plumb_bob", &[-0.28, 0.09, 0.0, 0.0, 0.0]);
        let camera = Camera::from_info(&info, false).expect("a usual lens");
        // Both focal lengths together, and a coefficient that goes with them.
        let mut one = DMatrix::zeros(CALIBRATION_SIZE, 2);
        (one[(0, 0)], one[(1, 0)], one[(4, 0)]) = (0.003, 0.003, -0.002);
        (one[(2, 1)], one[(4, 1)]) = (0.8, 0.004);
        let covariance = &one * one.transpose();
        let text = info.budget_to_yaml(&camera, &covariance);
        let budget =
            CalibrationBudget::from_yaml(&text, "b.yaml").expect("what is written is read");
        let mut sum = DMatrix::zeros(CALIBRATION_SIZE, CALIBRATION_SIZE);
        for (_, change) in budget.changes(&info, &camera).expect("the same lens") {
            sum += change * change.transpose();
        }
        let off = (&sum - &covariance).amax();
        assert!(off < 1e-9, "{off}");
    }
}
