//! How far the data tell a common shift, rotation and scale of the tanker's frame: mostly not at all.
//!
//! No image shows where the origin of the tanker's frame is: markers that are all shifted, turned or scaled together give
//! the same pixels with another pose. Such a displacement stays as the survey has it, with the sigma that the survey
//! gives it.

use nalgebra::{DMatrix, Vector3};
use serde::Serialize;

use super::unknowns::Unknowns;

/// A displacement of all markers together.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct GaugeMode {
    /// `shift_x` to `shift_z`, `turn_x` to `turn_z` about the markers' centre, `scale`.
    pub name: &'static str,
    /// `m`, `deg`, or `share`.
    pub unit: &'static str,
    /// Its sigma by the survey.
    pub sigma_before: f64,
    /// Its sigma after the calibration.
    pub sigma_after: f64,
    /// By how much the adjustment moved it.
    pub moved: f64,
    /// Whether the data tell it: the sigma fell by more than a hundredth.
    pub told: bool,
}

const NAMES: [(&str, &str); 7] = [
    ("shift_x", "m"),
    ("shift_y", "m"),
    ("shift_z", "m"),
    ("turn_x", "deg"),
    ("turn_y", "deg"),
    ("turn_z", "deg"),
    ("scale", "share"),
];
/// Share of the prior's sigma above which nothing was told.
const UNTOLD: f64 = 0.99;

/// Returns the seven modes; empty if the bodies do not determine them.
pub(super) fn gauge_modes(
    unknowns: &Unknowns,
    covariance: &DMatrix<f64>,
    values: &[f64],
) -> Vec<GaugeMode> {
    let bodies = &unknowns.bodies;
    if bodies.len() < 3 {
        return Vec::new();
    }
    let size = 3 * bodies.len();
    let sum: Vector3<f64> = bodies.iter().map(|body| body.centre_in_tanker).sum();
    let centre = sum / bodies.len() as f64;
    let basis = DMatrix::from_fn(size, 7, |row, mode| {
        let arm = bodies[row / 3].centre_in_tanker - centre;
        let axis = |i: usize| Vector3::ith(i, 1.0);
        let shift = match mode {
            0..=2 => axis(mode),
            3..=5 => axis(mode - 3).cross(&arm),
            _ => arm,
        };
        shift[row % 3]
    });
    let prior = unknowns.prior.view((0, 0), (size, size)).into_owned();
    let Some(weights) = prior.cholesky().map(|factor| factor.inverse()) else {
        return Vec::new();
    };
    let weighted = basis.transpose() * weights;
    let Some(before) = (&weighted * &basis)
        .cholesky()
        .map(|factor| factor.inverse())
    else {
        return Vec::new();
    };
    let by_positions = &before * weighted;
    let of_bodies = covariance.view((0, 0), (size, size));
    let after = &by_positions * of_bodies * by_positions.transpose();
    let moved = &by_positions * nalgebra::DVector::from_column_slice(&values[..size]);
    let modes = NAMES.iter().enumerate().map(|(mode, (name, unit))| {
        let scale = if *unit == "deg" {
            1.0_f64.to_degrees()
        } else {
            1.0
        };
        let [sigma_before, sigma_after] =
            [&before, &after].map(|of| of[(mode, mode)].max(0.0).sqrt() * scale);
        GaugeMode {
            name,
            unit,
            sigma_before,
            sigma_after,
            moved: moved[mode] * scale,
            told: sigma_after < UNTOLD * sigma_before,
        }
    });
    modes.collect()
}
