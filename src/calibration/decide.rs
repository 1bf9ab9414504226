//! Which unknowns the data support moving, and the covariance of what is then still wrong.

use std::collections::BTreeSet;

use nalgebra::DMatrix;

use super::CalibrationSettings;
use super::outcome::{Movement, Parameter};
use super::unknowns::Unknowns;

/// Moved by more than this many of the sigmas that the movement should have, the prior is wrong, or the data.
const IMPLAUSIBLE: f64 = 4.5;

/// Returns every unknown but amplitudes of flex and the attitudes' error, with what becomes of it.
///
/// # Inputs
/// * `suspects`: bodies of which many detections were left out as wrong.
/// * `mount_frames`: frames with reported attitudes.
pub(super) fn decide(
    unknowns: &Unknowns,
    covariance: &DMatrix<f64>,
    values: &[f64],
    suspects: &BTreeSet<usize>,
    mount_frames: usize,
    settings: &CalibrationSettings,
) -> Vec<Parameter> {
    let parameter =
        |column: usize, name: String, unit: &'static str, forbidden: Option<Movement>| {
            let sigma_before = unknowns.prior[(column, column)].sqrt();
            let sigma_after = covariance[(column, column)].max(0.0).sqrt();
            // What the data move the unknown by has the variance by which they reduced its own.
            let told = (sigma_before.powi(2) - sigma_after.powi(2)).max(0.0).sqrt();
            let moved_by = values[column];
            let sigmas = if told > 1e-9 * sigma_before {
                moved_by / told
            } else {
                0.0
            };
            let ratio = sigma_after / sigma_before;
            let movement = match forbidden {
                Some(forbidden) => forbidden,
                // NaN moves nothing.
                None if ratio <= settings.least_gain => Movement::Moved,
                None => Movement::NotSupported,
            };
            Parameter {
                column,
                name,
                unit,
                estimate: moved_by,
                sigma_before,
                sigma_after,
                sigmas,
                is_plausible: sigmas.abs() <= IMPLAUSIBLE,
                movement,
            }
        };
    let mut parameters = Vec::new();
    for (index, body) in unknowns.bodies.iter().enumerate() {
        let forbidden = suspects
            .contains(&index)
            .then_some(Movement::DetectionsLeftOut);
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            let name = format!("{} {letter}", body.id.name());
            parameters.push(parameter(3 * index + axis, name, "m", forbidden));
        }
    }
    for (index, mode) in unknowns.camera.iter().enumerate() {
        let forbidden = (!settings.intrinsics).then_some(Movement::NotAsked);
        let column = unknowns.first_of_camera + index;
        parameters.push(parameter(column, mode.name.clone(), "sigma", forbidden));
    }
    if let Some(at) = unknowns.mount {
        let forbidden = (mount_frames == 0).then_some(Movement::NoAttitudes);
        for (axis, letter) in ["x", "y", "z"].iter().enumerate() {
            let name = format!("mount about the camera's {letter}");
            parameters.push(parameter(at + axis, name, "rad", forbidden));
        }
    }
    parameters
}

/// Returns the covariance of bodies and camera as they are written.
///
/// What is moved to its estimate `x̂` is wrong by `x − x̂`, with the posterior covariance. What stays at its prior is wrong
/// by its whole error, with the prior's; and because `x − x̂` is independent of the estimates, both together have the
/// posterior's covariance.
pub(super) fn written_covariance(
    unknowns: &Unknowns,
    covariance: &DMatrix<f64>,
    parameters: &[Parameter],
) -> DMatrix<f64> {
    let bodies = 3 * unknowns.bodies.len();
    let size = bodies + unknowns.camera.len();
    let column = |index: usize| {
        if index < bodies {
            index
        } else {
            unknowns.first_of_camera + index - bodies
        }
    };
    let stays: BTreeSet<usize> = parameters
        .iter()
        .filter(|parameter| parameter.movement != Movement::Moved)
        .map(|parameter| parameter.column)
        .collect();
    DMatrix::from_fn(size, size, |i, j| {
        let (i, j) = (column(i), column(j));
        if stays.contains(&i) && stays.contains(&j) {
            unknowns.prior[(i, j)]
        } else {
            covariance[(i, j)]
        }
    })
}
