//! Which frames and detections are used: those that the estimator trusts, without what it leaves out as wrong.

use std::collections::BTreeMap;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector2};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::model::Frame;
use super::{MountPrior, RecordedFrame};
use crate::camera::Camera;
use crate::estimation::{Estimator, Expected, Observation, Solution};

/// Factors on stated sigmas below this are not worth another selection.
const NOTABLE_FACTOR: f64 = 1.2;

/// The square of a turn over its covariance, three degrees of freedom, that a correct attitude exceeds once in 100,000.
const FAR_ATTITUDE: f64 = 25.9;

/// What was selected.
#[derive(Debug, Clone, Default)]
pub(super) struct Selected {
    pub(super) frames: Vec<Frame>,
    /// Why the first frame that is not used was refused.
    pub(super) first_reason: Option<String>,
    /// Frames whose reported attitude is too far from the image's to be an error of mount and attitudes as stated.
    pub(super) far_attitudes: usize,
    /// By point: detections of trusted frames, and how many of them the estimator left out.
    pub(super) left_out: BTreeMap<u32, (usize, usize)>,
}

/// Returns by what factor the stated sigmas are too small for most frames to be trusted, at least 1.
///
/// The median of all frames' fits: half of them may contain wrong detections.
pub(super) fn needed_factor(
    camera: &Camera,
    estimator: &Estimator,
    frames: &[RecordedFrame],
) -> f64 {
    let mut factors: Vec<f64> = frames
        .iter()
        .filter_map(|frame| {
            let found =
                estimator.estimate_expecting(camera, &frame.observations, &Expected::default());
            let (chi_squared, freedom) = found.ok()?.of_all_points();
            let usual = ChiSquared::new(f64::from(freedom)).ok()?.inverse_cdf(0.5);
            let factor = (chi_squared / usual).sqrt();
            factor.is_finite().then_some(factor)
        })
        .collect();
    factors.sort_unstable_by(f64::total_cmp);
    match factors.get(factors.len() / 2) {
        Some(median) if *median > NOTABLE_FACTOR => *median,
        _ => 1.0,
    }
}

/// Returns the frames that are used, their sigmas multiplied by a factor.
pub(super) fn select(
    camera: &Camera,
    estimator: &Estimator,
    recorded: &[RecordedFrame],
    factor: f64,
    mount: Option<&MountPrior>,
) -> Selected {
    let mut selected = Selected::default();
    for frame in recorded {
        let observations: Vec<Observation> = frame
            .observations
            .iter()
            .map(|seen| Observation {
                sigma_px: seen.sigma_px * factor,
                ..*seen
            })
            .collect();
        match trusted(camera, estimator, &observations) {
            Ok(solution) => {
                for seen in &observations {
                    let (count, out) = selected.left_out.entry(seen.id).or_default();
                    *count += 1;
                    *out += usize::from(solution.excluded.contains(seen.id));
                }
                let is_used = |seen: &Observation| !solution.excluded.contains(seen.id);
                let reported = mount.and_then(|mount| {
                    Some(mount.camera_from_receiver * frame.receiver_from_tanker?)
                });
                let near = reported.filter(|reported| {
                    mount.is_some_and(|mount| is_near(&solution, reported, mount))
                });
                selected.far_attitudes += usize::from(reported.is_some() && near.is_none());
                selected.frames.push(Frame {
                    time_s: frame.time_s,
                    camera_from_tanker: solution.camera_from_tanker,
                    shake: Vector2::zeros(),
                    points: observations.into_iter().filter(is_used).collect(),
                    reported: near,
                });
            }
            Err(reason) => {
                selected.first_reason.get_or_insert(reason);
            }
        }
    }
    selected
}

/// Returns whether a reported attitude is within what mount and attitudes may be wrong by.
fn is_near(solution: &Solution, reported: &Rotation3<f64>, mount: &MountPrior) -> bool {
    let found = solution.camera_from_tanker.rotation.to_rotation_matrix();
    let turn = UnitQuaternion::from_rotation_matrix(&(found * reported.inverse())).scaled_axis();
    let of_mount = mount.sigma_rad.powi(2)
        + mount.attitude_bias_rad.powi(2)
        + mount.attitude_noise_rad.powi(2);
    let covariance =
        solution.covariance.0.fixed_view::<3, 3>(3, 3) + Matrix3::identity() * of_mount;
    let factor = covariance.cholesky();
    factor.is_some_and(|factor| turn.dot(&factor.solve(&turn)) <= FAR_ATTITUDE)
}

fn trusted(
    camera: &Camera,
    estimator: &Estimator,
    observations: &[Observation],
) -> Result<Solution, String> {
    let solution = estimator
        .estimate_expecting(camera, observations, &Expected::default())
        .map_err(|error| error.to_string())?;
    if !solution.is_trusted() {
        return Err(format!(
            "chi-squared {:.1}, allowed is {:.1}",
            solution.chi_squared, solution.chi_squared_limit
        ));
    }
    if solution.ambiguity > estimator.settings().max_ambiguity {
        return Err(format!(
            "a second pose is likely too (ambiguity {:.2})",
            solution.ambiguity
        ));
    }
    Ok(solution)
}
