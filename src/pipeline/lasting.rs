//! Divides the error of a frame's pose for the track: independent noise, and errors shared with other frames.

use nalgebra::{Matrix6, Vector6};

use crate::estimation::{Cause, CauseKind, FrameCauses, Solution};
use crate::geometry::{PoseCovariance, principal_root};
use crate::tracking::LastingError;

/// The error of one frame's pose, divided into parts.
#[derive(Debug, Clone, PartialEq)]
pub struct FrameErrors {
    /// Covariance of the part that is independent from frame to frame: noise and jitter.
    pub noise: PoseCovariance,
    /// The shared errors: first the causes that change with time, then the constant ones, the largest in position
    /// first.
    pub lasting: Vec<LastingError>,
}

/// Kinds of causes, in the upper half of a cause's number.
const SURVEY: u64 = 1 << 40;
const MODE: u64 = 2 << 40;
const ATTITUDE: u64 = 3 << 40;
const NOISE: u64 = 4 << 40;
const UNDIVIDED: u64 = 5 << 40;
const WIDENING: u64 = 6 << 40;
const REPORTED_ATTITUDE: u64 = 7 << 40;
/// Least widening that is taken into account, relative to the variance in any direction. The causes are linearised at
/// another point than the covariance, so their sum differs from it by about a percent.
const LEAST_WIDENING: f64 = 0.05;

impl FrameErrors {
    /// Returns the parts of the error of a frame's pose. A cause has the same number in all frames with one budget.
    ///
    /// # Inputs
    /// * `causes`: the effect of each cause in the frame, if known.
    /// * `has_causes`: whether a budget is stated; if not, the whole error is noise.
    #[must_use]
    pub fn new(solution: &Solution, causes: Option<&FrameCauses>, has_causes: bool) -> Self {
        match causes {
            Some(causes) => Self::of(causes, &solution.covariance),
            None if has_causes => Self::undivided(&solution.covariance),
            None => Self {
                noise: solution.covariance,
                lasting: Vec::new(),
            },
        }
    }

    /// Returns a conservative division: all of the error may be shared, and all of it may be independent.
    fn undivided(covariance: &PoseCovariance) -> Self {
        let root = principal_root(&covariance.0);
        Self {
            noise: *covariance,
            lasting: columns(UNDIVIDED, &root).collect(),
        }
    }

    fn of(causes: &FrameCauses, whole: &PoseCovariance) -> Self {
        let mut noise = Matrix6::zeros();
        let mut lasting = Vec::new();
        let noise_time_constant_s = causes.causes.iter().find_map(|cause| match cause.kind {
            CauseKind::CorrelatedNoise { time_constant_s } => Some(time_constant_s),
            _ => None,
        });
        for (marker_id, shifts) in &causes.survey_shifts {
            for (axis, shift) in (0..).zip(shifts) {
                lasting.push(constant(SURVEY + 4 * u64::from(*marker_id) + axis, shift));
            }
        }
        for (marker_id, shifts) in &causes.noise_shifts {
            for (axis, shift) in (0..).zip(shifts) {
                lasting.push(LastingError {
                    cause: NOISE + 2 * u64::from(*marker_id) + axis,
                    shift: *shift,
                    time_constant_s: noise_time_constant_s,
                });
            }
        }
        // What the aircraft report is wrong in another way than the nominal attitude is.
        let is_reported = |cause: &Cause| cause.kind == CauseKind::ReportedAttitude;
        let prior = if causes.causes.iter().any(is_reported) {
            REPORTED_ATTITUDE
        } else {
            ATTITUDE
        };
        for (axis, shift) in (0..).zip(causes.attitude_shifts.iter().flatten()) {
            lasting.push(constant(prior + axis, shift));
        }
        // All frames have the same modes in the same order, but a frame may lack markers with a survey error.
        let mut mode = MODE;
        for cause in &causes.causes {
            if let CauseKind::Noise | CauseKind::Jitter = cause.kind {
                noise += cause.covariance.0;
            }
            // Survey, prior and correlated noise are already included by their shifts.
            let Some(shift) = &cause.shift else {
                continue;
            };
            mode += 1;
            match cause.kind {
                CauseKind::Flex { time_constant_s } => lasting.push(LastingError {
                    cause: mode,
                    shift: *shift,
                    time_constant_s,
                }),
                CauseKind::Calibration => lasting.push(constant(mode, shift)),
                _ => {}
            }
        }
        // If the covariance is widened beyond what the causes explain, the time constant of that part is unknown.
        let explained: Matrix6<f64> = causes.causes.iter().map(|cause| cause.covariance.0).sum();
        if let Some(root) = widening(&whole.0, &explained) {
            let beyond = root * root.transpose();
            noise += (beyond + beyond.transpose()) * 0.5;
            lasting.extend(columns(WIDENING, &root));
        }
        // If there is not enough room, constant causes can be combined.
        let rank = |error: &LastingError| {
            let size_m = error.shift.fixed_rows::<3>(0).norm();
            (error.time_constant_s.is_none(), -size_m)
        };
        lasting.sort_by(|a, b| {
            let ((a_lasts, a_size), (b_lasts, b_size)) = (rank(a), rank(b));
            a_lasts.cmp(&b_lasts).then(a_size.total_cmp(&b_size))
        });
        Self {
            noise: PoseCovariance(noise),
            lasting,
        }
    }
}

/// Returns a root of the part of a covariance that is not explained; `None` if all of it is.
fn widening(whole: &Matrix6<f64>, explained: &Matrix6<f64>) -> Option<Matrix6<f64>> {
    let l = whole.cholesky()?.l();
    let inverse = l.try_inverse()?;
    let beyond = inverse * (whole - explained) * inverse.transpose();
    let eigen = ((beyond + beyond.transpose()) * 0.5).symmetric_eigen();
    let roots = eigen.eigenvalues.map(|share| {
        if share > LEAST_WIDENING {
            share.sqrt()
        } else {
            0.0
        }
    });
    let root =
        l * eigen.eigenvectors * Matrix6::from_diagonal(&roots) * eigen.eigenvectors.transpose();
    (roots.max() > 0.0).then_some(root)
}

fn columns(first: u64, root: &Matrix6<f64>) -> impl Iterator<Item = LastingError> {
    (first..)
        .zip(root.column_iter())
        .map(|(cause, column)| constant(cause, &column.into_owned()))
}

fn constant(cause: u64, shift: &Vector6<f64>) -> LastingError {
    LastingError {
        cause,
        shift: *shift,
        time_constant_s: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn cause(kind: CauseKind, shift: Option<f64>) -> Cause {
        Cause {
            name: String::new(),
            kind,
            amplitude_sigmas: None,
            shift: shift.map(Vector6::from_element),
            covariance: PoseCovariance(Matrix6::identity()),
        }
    }

    #[test]
    fn a_mode_has_one_number_whether_or_not_a_frame_has_surveyed_markers() {
        let flex = CauseKind::Flex {
            time_constant_s: Some(3.0),
        };
        let modes = || {
            [
                cause(flex, Some(0.1)),
                cause(CauseKind::Calibration, Some(0.2)),
                cause(CauseKind::Jitter, Some(0.3)),
            ]
        };
        let number = |survey: Option<Cause>| {
            let noise = cause(CauseKind::Noise, None);
            let causes = [noise].into_iter().chain(survey).chain(modes()).collect();
            let causes = FrameCauses {
                causes,
                survey_shifts: Vec::new(),
                noise_shifts: Vec::new(),
                attitude_shifts: None,
            };
            let explained = causes.causes.iter().map(|cause| cause.covariance.0).sum();
            let errors = FrameErrors::of(&causes, &PoseCovariance(explained));
            let is_noise_and_jitter = errors.noise.0 == Matrix6::identity() * 2.0;
            assert!(is_noise_and_jitter);
            errors
                .lasting
                .iter()
                .map(|error| (error.cause, error.time_constant_s))
                .collect::<Vec<_>>()
        };
        let with = number(Some(cause(CauseKind::Survey, None)));
        assert_eq!(with.len(), 2);
        assert_ne!(with[0].0, with[1].0);
        assert_eq!(with, number(None));
    }

    #[test]
    fn errors_of_the_nominal_and_of_the_reported_attitude_are_different_ones() {
        let numbers = [CauseKind::Attitude, CauseKind::ReportedAttitude].map(|kind| {
            let causes = FrameCauses {
                causes: vec![cause(CauseKind::Noise, None), cause(kind, None)],
                survey_shifts: Vec::new(),
                noise_shifts: Vec::new(),
                attitude_shifts: Some([0.1, 0.2, 0.3].map(Vector6::from_element)),
            };
            let whole = PoseCovariance(Matrix6::identity() * 2.0);
            let lasting = FrameErrors::of(&causes, &whole).lasting;
            lasting.iter().map(|error| error.cause).collect::<Vec<_>>()
        });
        let [nominal, reported] = &numbers;
        assert_eq!((nominal.len(), reported.len()), (3, 3));
        assert!(nominal.iter().all(|number| !reported.contains(number)));
    }

    #[test]
    fn what_the_causes_do_not_explain_is_noise_and_lasts() {
        let w = Vector6::new(0.1, -0.2, 0.4, 0.02, 0.0, 0.05);
        let explained = Matrix6::from_diagonal(&Vector6::new(1e-4, 1e-4, 1e-3, 1e-6, 1e-6, 1e-6));
        let whole = explained + w * w.transpose();
        let root = widening(&whole, &explained).expect("it is widened");
        // Shares below a twentieth are left out, so it is not exact.
        let found = root * root.transpose();
        assert!((found - w * w.transpose()).norm() < 0.02 * w.norm_squared());
        assert_eq!(widening(&(explained * 1.03), &explained), None);
        let causes = FrameCauses {
            causes: vec![Cause {
                covariance: PoseCovariance(explained),
                ..cause(CauseKind::Noise, None)
            }],
            survey_shifts: Vec::new(),
            noise_shifts: Vec::new(),
            attitude_shifts: None,
        };
        let errors = FrameErrors::of(&causes, &PoseCovariance(whole));
        let lasting: Matrix6<f64> = errors
            .lasting
            .iter()
            .map(|error| error.shift * error.shift.transpose())
            .sum();
        assert!((errors.noise.0 - explained - found).norm() < 1e-9);
        assert!((lasting - found).norm() < 1e-9);
    }
}
