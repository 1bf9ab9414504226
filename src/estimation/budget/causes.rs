//! The effect of each cause of the budget in one frame: estimated amplitude, and share of the covariance.

use nalgebra::{
    DMatrix, DVector, Matrix2, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Vector2, Vector6,
};

use super::ErrorBudget;
use crate::camera::{CALIBRATION_SIZE, Camera};
use crate::estimation::{Observation, Solution};
use crate::geometry::{PoseCovariance, skew};

/// The kind of cause; it determines for how long a track takes it as constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum CauseKind {
    /// Noise of single detections.
    Noise,
    /// The part of it that is correlated from frame to frame.
    CorrelatedNoise {
        /// Its time constant, s.
        time_constant_s: f64,
    },
    /// The surveyed positions of markers on the tanker: constant.
    Survey,
    /// A mode in which the airframe bends.
    Flex {
        /// Time constant of its amplitude, s; `None`: constant for the whole flight.
        time_constant_s: Option<f64>,
    },
    /// The calibration: constant.
    Calibration,
    /// A shift of the whole image, independent in each frame.
    Jitter,
    /// The prior about the nominal attitude.
    Attitude,
    /// The prior about the attitude that both aircraft report.
    ReportedAttitude,
}

/// One cause in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct Cause {
    /// Its name: that of a mode, or `noise`, `correlated_noise`, `survey`, `jitter_u`, `jitter_v`, `attitude`, `reported_attitude`.
    pub name: String,
    /// What kind of cause it is.
    pub kind: CauseKind,
    /// Its estimated amplitude in its sigmas; `None` for causes that are not a single number.
    pub amplitude_sigmas: Option<f64>,
    /// Error of the pose that one sigma of it causes, in the order of [`PoseCovariance`]; `None` as above.
    pub shift: Option<Vector6<f64>>,
    /// Its share of the covariance; the shares add up to the whole.
    pub covariance: PoseCovariance,
}

/// All causes in one frame.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameCauses {
    /// Noise first, then its correlated part, survey, flex, calibration, jitter, attitude, as far as the budget has
    /// them.
    pub causes: Vec<Cause>,
    /// For each used marker with a survey error: its id and the error of the pose that one sigma of it causes along
    /// each of the tanker's axes.
    pub survey_shifts: Vec<(u32, [Vector6<f64>; 3])>,
    /// With correlated noise: for each used marker its id and the error of the pose that one sigma of it causes in u
    /// and in v.
    pub noise_shifts: Vec<(u32, [Vector6<f64>; 2])>,
    /// With a prior of the attitude: the error of the pose that one sigma of it causes about each of the camera's axes.
    pub attitude_shifts: Option<[Vector6<f64>; 3]>,
}

impl FrameCauses {
    /// Returns the cause with the largest share of the position's variance.
    #[must_use]
    pub fn dominant(&self) -> Option<&Cause> {
        let share = |cause: &Cause| cause.covariance.0.fixed_view::<3, 3>(0, 0).trace();
        self.causes
            .iter()
            .max_by(|a, b| share(a).total_cmp(&share(b)))
    }
}

/// A used point: derivative by the pose, its own covariance, and its residual.
struct Row {
    id: u32,
    by_pose: Matrix2x6<f64>,
    /// Derivative by the marker's position on the tanker, px/m.
    by_marker: Matrix2x3<f64>,
    weight: Matrix2<f64>,
    noise_px: f64,
    survey_m: f64,
    residual: Vector2<f64>,
    by_calibration: nalgebra::SMatrix<f64, 2, CALIBRATION_SIZE>,
}

/// Returns the effects of all causes; `None` if a point has no pixel at the pose or the pose is not determined.
///
/// # Inputs
/// * `prior`: which prior of the attitude there is, and its information about each axis, 1/rad².
pub(in crate::estimation) fn frame_causes(
    budget: Option<&ErrorBudget>,
    prior: Option<(CauseKind, f64)>,
    camera: &Camera,
    observations: &[Observation],
    solution: &Solution,
) -> Option<FrameCauses> {
    let used = observations
        .iter()
        .filter(|seen| !solution.excluded.contains(seen.id));
    let rows: Vec<Row> = used
        .map(|seen| row(budget, camera, seen, solution))
        .collect::<Option<_>>()?;
    let modes = budget.map_or_else(Vec::new, |budget| modes(budget, &rows));

    let mut information = Matrix6::zeros();
    let mut cross = DMatrix::zeros(6, modes.len());
    let mut amplitudes = DMatrix::identity(modes.len(), modes.len());
    let mut explained = DVector::zeros(modes.len());
    for (at, row) in rows.iter().enumerate() {
        let weighted = row.by_pose.tr_mul(&row.weight);
        information += weighted * row.by_pose;
        for (m, mode) in modes.iter().enumerate() {
            let pull = weighted * mode.shifts[at];
            let mut column = cross.column_mut(m);
            column += pull;
            explained[m] += mode.shifts[at].dot(&(row.weight * row.residual));
            for (other, shifts) in modes.iter().enumerate() {
                amplitudes[(m, other)] += mode.shifts[at].dot(&(row.weight * shifts.shifts[at]));
            }
        }
    }
    let amplitudes = amplitudes.cholesky()?.inverse();
    let through = &cross * &amplitudes; // C A⁻¹
    information -= &through * cross.transpose();
    for axis in 3..6 {
        information[(axis, axis)] += prior.map_or(0.0, |(_, of_axis)| of_axis);
    }
    let covariance = information.cholesky()?.inverse();
    let shifts = covariance * &through;
    let estimates = -&amplitudes * explained;

    let lasting_noise = budget.and_then(ErrorBudget::correlated_noise);
    let lasting_share = lasting_noise.map_or(0.0, |lasting| lasting.share());
    let Own {
        noise,
        noise_shifts,
        survey,
        survey_shifts,
    } = own_errors(&rows, &modes, &through, &covariance, lasting_share);
    let share = |matrix: Matrix6<f64>| PoseCovariance((matrix + matrix.transpose()) * 0.5);
    let many = |name: &str, kind: CauseKind, covariance: Matrix6<f64>| Cause {
        name: name.to_owned(),
        kind,
        amplitude_sigmas: None,
        shift: None,
        covariance: share(covariance),
    };
    let mut causes = vec![many(
        "noise",
        CauseKind::Noise,
        noise * (1.0 - lasting_share),
    )];
    if let Some(lasting) = lasting_noise {
        let kind = CauseKind::CorrelatedNoise {
            time_constant_s: lasting.time_constant_s(),
        };
        causes.push(many("correlated_noise", kind, noise * lasting_share));
    }
    if !survey_shifts.is_empty() {
        causes.push(many("survey", CauseKind::Survey, survey));
    }
    for (m, mode) in modes.into_iter().enumerate() {
        let shift: Vector6<f64> = shifts.column(m).into_owned();
        causes.push(Cause {
            name: mode.name,
            kind: mode.kind,
            amplitude_sigmas: Some(estimates[m]),
            shift: Some(shift),
            covariance: share(shift * shift.transpose()),
        });
    }
    let mut attitude_shifts = None;
    if let Some((kind, of_axis)) = prior {
        let gain = covariance.fixed_view::<6, 3>(0, 3) * of_axis.sqrt();
        let by_prior = gain * gain.transpose();
        let name = match kind {
            CauseKind::ReportedAttitude => "reported_attitude",
            _ => "attitude",
        };
        causes.push(many(name, kind, by_prior));
        attitude_shifts = Some([0, 1, 2].map(|axis| gain.column(axis).into_owned()));
    }
    Some(FrameCauses {
        causes,
        survey_shifts,
        noise_shifts,
        attitude_shifts,
    })
}

/// The effect of the errors of single points on the pose.
struct Own {
    noise: Matrix6<f64>,
    noise_shifts: Vec<(u32, [Vector6<f64>; 2])>,
    survey: Matrix6<f64>,
    survey_shifts: Vec<(u32, [Vector6<f64>; 3])>,
}

/// Returns the shares of noise and survey, and their shifts.
///
/// # Inputs
/// * `through`: information that pose and modes share, times the covariance of the modes given the pose.
/// * `covariance`: of the pose.
/// * `lasting_share`: the share of the noise's variance that is correlated in time.
fn own_errors(
    rows: &[Row],
    modes: &[Mode],
    through: &DMatrix<f64>,
    covariance: &Matrix6<f64>,
    lasting_share: f64,
) -> Own {
    let mut own = Own {
        noise: Matrix6::zeros(),
        noise_shifts: Vec::new(),
        survey: Matrix6::zeros(),
        survey_shifts: Vec::new(),
    };
    for (at, row) in rows.iter().enumerate() {
        let mut pull = row.by_pose.tr_mul(&row.weight);
        for (m, mode) in modes.iter().enumerate() {
            pull -= through.column(m) * (row.weight * mode.shifts[at]).transpose();
        }
        let gain = covariance * pull;
        own.noise += gain * gain.transpose() * row.noise_px.powi(2);
        if lasting_share > 0.0 {
            let by_noise = gain * (row.noise_px * lasting_share.sqrt());
            let axis = |axis: usize| by_noise.column(axis).into_owned();
            own.noise_shifts.push((row.id, [axis(0), axis(1)]));
        }
        if row.survey_m > 0.0 {
            let by_marker = gain * row.by_marker * row.survey_m;
            own.survey += by_marker * by_marker.transpose();
            let axis = |axis: usize| by_marker.column(axis).into_owned();
            own.survey_shifts
                .push((row.id, [axis(0), axis(1), axis(2)]));
        }
    }
    own
}

fn row(
    budget: Option<&ErrorBudget>,
    camera: &Camera,
    seen: &Observation,
    solution: &Solution,
) -> Option<Row> {
    let pose = &solution.camera_from_tanker;
    let q = pose * seen.marker_in_tanker;
    let residual = seen.residual_px(camera, pose)?;
    let (_, by_point) = camera.project_point(&q.coords)?;
    let arm = pose.rotation * seen.marker_in_tanker.coords;
    let mut by_pose = Matrix2x6::zeros();
    by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
    by_pose
        .fixed_view_mut::<2, 3>(0, 3)
        .copy_from(&(-by_point * skew(arm)));
    let survey_m = budget.map_or(0.0, |budget| budget.survey_sigma_m(seen.id));
    let own = Matrix2::from_diagonal_element(seen.sigma_px.powi(2))
        + by_point * by_point.transpose() * survey_m.powi(2);
    let rotation: Matrix3<f64> = *pose.rotation.to_rotation_matrix().matrix();
    Some(Row {
        id: seen.id,
        by_pose,
        by_marker: by_point * rotation,
        weight: own.try_inverse()?,
        noise_px: seen.sigma_px,
        survey_m,
        residual,
        by_calibration: camera.pixel_by_calibration(camera.ray_from_pixel(seen.pixel).ok()?)?,
    })
}

/// A mode with its shift of each row, px.
struct Mode {
    name: String,
    kind: CauseKind,
    shifts: Vec<Vector2<f64>>,
}

fn modes(budget: &ErrorBudget, rows: &[Row]) -> Vec<Mode> {
    let flex = budget.flex.iter().map(|mode| Mode {
        name: mode.name.clone(),
        kind: CauseKind::Flex {
            time_constant_s: mode.time_constant_s,
        },
        shifts: rows
            .iter()
            .map(|row| {
                let shape = mode.shape.iter().find(|(id, _)| *id == row.id);
                shape.map_or_else(Vector2::zeros, |(_, shift)| row.by_marker * shift)
            })
            .collect(),
    });
    let calibration = budget.calibration.iter().map(|mode| Mode {
        name: mode.name.clone(),
        kind: CauseKind::Calibration,
        shifts: rows
            .iter()
            .map(|row| row.by_calibration * mode.change)
            .collect(),
    });
    let jitter = [("jitter_u", Vector2::x()), ("jitter_v", Vector2::y())];
    let jitter = jitter
        .into_iter()
        .filter(|_| budget.jitter_px > 0.0)
        .map(|(name, axis)| Mode {
            name: name.to_owned(),
            kind: CauseKind::Jitter,
            shifts: vec![axis * budget.jitter_px; rows.len()],
        });
    flex.chain(calibration).chain(jitter).collect()
}
