//! Residuals of a frame, and their derivatives by its pose, the shake of its image and the shared unknowns.

use nalgebra::{Isometry3, Matrix3, Rotation3, SMatrix, SVector, UnitQuaternion, Vector2, Vector3};

use super::unknowns::Unknowns;
use crate::camera::{Camera, Ray};
use crate::estimation::Observation;
use crate::geometry::skew;

/// Unknowns of a frame: position, left rotation increment, shake of the image in u and v (in its sigma).
pub(super) const OWN: usize = 8;
pub(super) type Own = SVector<f64, OWN>;
pub(super) type OwnMatrix = SMatrix<f64, OWN, OWN>;

/// A frame that is used.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) time_s: f64,
    pub(super) camera_from_tanker: Isometry3<f64>,
    /// In the sigma of the shake.
    pub(super) shake: Vector2<f64>,
    pub(super) points: Vec<Observation>,
    /// By both attitudes and the mount as configured.
    pub(super) reported: Option<Rotation3<f64>>,
}

/// What all frames have in common.
#[derive(Debug)]
pub(super) struct Model<'a> {
    pub(super) camera: &'a Camera,
    pub(super) unknowns: &'a Unknowns,
    /// Of a shift of the whole image, px.
    pub(super) jitter_px: f64,
    /// Factor on the sigmas of detections, for what of their noise lasts: fewer frames are independent.
    pub(super) lasting: f64,
    /// Standard deviation of a reported attitude about its constant error, rad.
    pub(super) attitude_noise_rad: f64,
}

/// One point as seen from a pose.
#[derive(Debug)]
pub(super) struct Sight {
    /// Predicted minus detected, px.
    pub(super) residual: Vector2<f64>,
    pub(super) by_own: SMatrix<f64, 2, OWN>,
    /// Column of a shared unknown, and the derivative by it.
    pub(super) by_shared: Vec<(usize, Vector2<f64>)>,
    /// px, as the model takes it.
    pub(super) sigma_px: f64,
}

impl Model<'_> {
    /// Returns a point of a frame; `None` if it has no pixel there.
    ///
    /// # Inputs
    /// * `camera`: with the changes in `values`.
    pub(super) fn sight(
        &self,
        camera: &Camera,
        values: &[f64],
        frame: &Frame,
        seen: &Observation,
    ) -> Option<Sight> {
        let unknowns = self.unknowns;
        let mut marker = seen.marker_in_tanker.coords;
        let body = unknowns.body_of(seen.id);
        if let Some(body) = body {
            marker += Vector3::from_column_slice(&values[3 * body..3 * body + 3]);
        }
        for (column, shift) in unknowns.flex_of(seen.id, frame.time_s) {
            marker += shift * values[column];
        }
        let rotation: Matrix3<f64> = *frame
            .camera_from_tanker
            .rotation
            .to_rotation_matrix()
            .matrix();
        let arm = rotation * marker;
        let q = arm + frame.camera_from_tanker.translation.vector;
        let (pixel, by_point) = camera.project_point(&q)?;
        let mut by_own = SMatrix::<f64, 2, OWN>::zeros();
        by_own.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
        by_own
            .fixed_view_mut::<2, 3>(0, 3)
            .copy_from(&(-by_point * skew(arm)));
        by_own[(0, 6)] = self.jitter_px;
        by_own[(1, 7)] = self.jitter_px;
        let by_marker = by_point * rotation;
        let mut by_shared = Vec::with_capacity(8);
        if let Some(body) = body {
            by_shared.extend((0..3).map(|axis| (3 * body + axis, by_marker.column(axis).into())));
        }
        for (column, shift) in unknowns.flex_of(seen.id, frame.time_s) {
            by_shared.push((column, by_marker * shift));
        }
        if !unknowns.camera.is_empty() {
            let by_calibration = camera.pixel_by_calibration(Ray::through(&q))?;
            for (index, mode) in unknowns.camera.iter().enumerate() {
                by_shared.push((
                    unknowns.first_of_camera + index,
                    by_calibration * mode.change,
                ));
            }
        }
        let residual = Vector2::new(pixel.u - seen.pixel.u, pixel.v - seen.pixel.v)
            + frame.shake * self.jitter_px;
        Some(Sight {
            residual,
            by_own,
            by_shared,
            sigma_px: seen.sigma_px * self.lasting,
        })
    }

    /// Returns how far a frame is turned from what both attitudes report, rad, camera axes, less mount and constant error;
    /// `None` without reported attitudes.
    pub(super) fn turn(&self, values: &[f64], frame: &Frame) -> Option<Vector3<f64>> {
        let (at, reported) = (self.unknowns.mount?, frame.reported?);
        let wrong = Vector3::from_fn(|axis, _| values[at + axis] + values[at + 3 + axis]);
        let reported = Rotation3::new(wrong) * reported;
        let found = frame.camera_from_tanker.rotation.to_rotation_matrix();
        let turn = UnitQuaternion::from_rotation_matrix(&(found * reported.inverse()));
        Some(turn.scaled_axis())
    }
}

impl Frame {
    /// Returns the frame with its own unknowns changed.
    pub(super) fn moved(&self, step: &Own) -> Self {
        let turn = UnitQuaternion::from_scaled_axis(step.fixed_rows::<3>(3).into_owned());
        let mut camera_from_tanker = self.camera_from_tanker;
        camera_from_tanker.rotation = turn * camera_from_tanker.rotation;
        camera_from_tanker.translation.vector += step.fixed_rows::<3>(0);
        Self {
            camera_from_tanker,
            shake: self.shake + step.fixed_rows::<2>(6),
            ..self.clone()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calibration::MountPrior;
    use crate::camera::{CalibrationChange, CameraInfo, Pixel};
    use crate::estimation::{CalibrationMode, ErrorBudget, FlexMode};
    use crate::geometry::optical_from_body;
    use crate::simulation::pose_in_camera;
    use crate::target::MarkerMap;

    const MAP: &str = "name: kite
sigma: 0.05
markers:
  - {id: 1, x: 0, y: -1.5, z: 0}
  - {id: 2, x: 0, y: 1.5, z: 0}
  - {id: 3, x: 3, y: 0, z: 0.25}
";

    #[test]
    fn derivatives_are_the_differences_of_residuals() {
        const STEP: f64 = 1e-6;
        let map = MarkerMap::from_yaml(MAP, "kite.yaml").expect("a good map");
        let flex = FlexMode {
            name: "wing".to_owned(),
            time_constant_s: Some(4.0),
            shape: vec![
                (1, Vector3::new(0.0, 0.1, 0.3)),
                (2, Vector3::new(0.0, 0.0, 0.3)),
            ],
        };
        let mode = |index: usize, sigma: f64| {
            let mut change = CalibrationChange::zeros();
            change[index] = sigma;
            CalibrationMode {
                name: format!("{index}"),
                change,
            }
        };
        let calibration = vec![mode(0, 0.01), mode(3, 2.0), mode(4, 0.02)];
        let survey: Vec<_> = map.budget().survey_sigma_m.clone();
        let budget = ErrorBudget::new(&survey, vec![flex], calibration, 0.5).expect("a budget");
        let mount = MountPrior {
            camera_from_receiver: optical_from_body(),
            sigma_rad: 0.02,
            attitude_bias_rad: 0.01,
            attitude_noise_rad: 0.005,
        };
        let unknowns = Unknowns::new(&map, &budget, Some(&mount), [0.0, 10.0]).expect("unknowns");
        let info = CameraInfo {
            width: 640,
            height: 480,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.2, 0.05, 0.001, -0.001, 0.0],
            k: [571.0, 0.0, 300.0, 0.0, 580.0, 250.0, 0.0, 0.0, 1.0],
            ..CameraInfo::default()
        };
        let camera = Camera::from_info(&info, false).expect("a usual lens");
        let model = Model {
            camera: &camera,
            unknowns: &unknowns,
            jitter_px: budget.jitter_px(),
            lasting: 1.0,
            attitude_noise_rad: 0.005,
        };
        let frame = Frame {
            time_s: 3.3,
            camera_from_tanker: pose_in_camera(Vector3::new(15.0, 0.5, 2.0), 3.0, -2.0, 4.0),
            shake: Vector2::new(0.3, -0.2),
            points: Vec::new(),
            reported: None,
        };
        let seen = Observation {
            id: 1,
            marker_in_tanker: map.get(1).expect("a marker"),
            pixel: Pixel { u: 310.0, v: 240.0 },
            sigma_px: 0.5,
        };
        let values: Vec<f64> = (0..unknowns.size)
            .map(|i| 0.01 * (i as f64).sin())
            .collect();
        let at = |values: &[f64], frame: &Frame| {
            let changed = unknowns.camera(&camera, values);
            model.sight(&changed, values, frame, &seen).expect("seen")
        };
        let here = at(&values, &frame);
        let check = |what: String, ahead: &Sight, behind: &Sight, by: Vector2<f64>| {
            let difference = (ahead.residual - behind.residual) / (2.0 * STEP);
            let off = (difference - by).norm();
            assert!(off < 1e-4 * (1.0 + by.norm()), "{what}: {difference} {by}");
        };
        for index in 0..OWN {
            let moved = |step: f64| {
                let mut by = Own::zeros();
                by[index] = step;
                at(&values, &frame.moved(&by))
            };
            let by = here.by_own.column(index).into();
            check(format!("own {index}"), &moved(STEP), &moved(-STEP), by);
        }
        let mut columns: Vec<usize> = here.by_shared.iter().map(|(column, _)| *column).collect();
        columns.dedup();
        assert_eq!(
            columns.len(),
            3 + 2 + 3,
            "a body, two amplitudes, three modes"
        );
        for (column, by) in &here.by_shared {
            let moved = |step: f64| {
                let mut values = values.clone();
                values[*column] += step;
                at(&values, &frame)
            };
            check(format!("shared {column}"), &moved(STEP), &moved(-STEP), *by);
        }
    }
}
