//! The error budget of a calibration, read from a file: standard deviations, or a full covariance.

use nalgebra::DMatrix;
use serde::Deserialize;
use serde_saphyr::Spanned;

use super::calibration::{CalibrationChange, FIRST_COEFFICIENT};
use super::distortion::Lens;
use super::{Camera, CameraError, CameraInfo};
use crate::text::quoted;
use crate::yaml::{self, Place, YamlError};

/// The parameters that a file may name, in `OpenCV`'s order of the coefficients.
pub(super) const NAMES: [&str; 12] = [
    "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6",
];
/// How many of them are in pixels; they come first.
const PIXELS: usize = 4;
/// Largest plausible standard deviation of a focal length or principal point, px.
const MAX_PX: f64 = 100.0;
/// Largest accepted standard deviation of a coefficient. High-order coefficients that the images hardly constrain have
/// large ones.
const MAX_COEFFICIENT: f64 = 1000.0;
/// Eigenvalues and pivots below this, relative to the variances, are rounding errors.
const ROUNDING: f64 = 1e-9;

/// Smallest sigma above 0: the square of a much smaller one is 0, and what is divided by it no number.
const LEAST: f64 = 1e-12;

/// Checked error budget of a calibration.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationBudget {
    /// Indices into [`NAMES`].
    parameters: Vec<usize>,
    /// A factor of the covariance, in the file's units: each column is the effect of one independent cause at one
    /// sigma.
    columns: Vec<Vec<f64>>,
    /// The name of each column: the first parameter that it changes.
    names: Vec<String>,
}

/// Why a calibration budget cannot be read; each message begins with the position in the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum CalibrationBudgetError {
    /// Not YAML, or not in the file's format.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// Neither `sigmas` nor `covariance`, or both.
    #[error("{place}: expected either sigmas or covariance")]
    NotOne { place: Place },
    /// An unknown parameter name.
    #[error("{place}: expected one of {}, got {}", NAMES.join(", "), quoted(name))]
    UnknownName { place: Place, name: String },
    /// A parameter that is listed twice.
    #[error("{place}: {name} is listed twice")]
    Twice { place: Place, name: &'static str },
    /// The rows do not form a square matrix of the right size.
    #[error(
        "{place}: data must be {need} rows of {need} numbers, one for each parameter, got {got}"
    )]
    Size {
        place: Place,
        need: usize,
        got: String,
    },
    /// Not a plausible standard deviation.
    #[error("{place}: the sigma of {name} must be 0, or {LEAST:e} to {most}, got {value}")]
    Sigma {
        place: Place,
        name: &'static str,
        most: f64,
        value: f64,
    },
    /// The matrix differs from its transpose.
    #[error(
        "{place}: data must be symmetric, but has {above} for {row} with {column} and {below} for {column} with {row}"
    )]
    NotSymmetric {
        place: Place,
        row: &'static str,
        column: &'static str,
        above: f64,
        below: f64,
    },
    /// The matrix is symmetric but not positive semidefinite.
    #[error(
        "{place}: data must be positive semidefinite, but has the eigenvalue {least:.3} (of the correlations)"
    )]
    Indefinite { place: Place, least: f64 },
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct Raw {
    sigmas: Option<RawSigmas>,
    covariance: Option<RawCovariance>,
}

#[derive(Deserialize, Default)]
#[serde(deny_unknown_fields, default)]
struct RawSigmas {
    fx: Option<Spanned<f64>>,
    fy: Option<Spanned<f64>>,
    cx: Option<Spanned<f64>>,
    cy: Option<Spanned<f64>>,
    k1: Option<Spanned<f64>>,
    k2: Option<Spanned<f64>>,
    p1: Option<Spanned<f64>>,
    p2: Option<Spanned<f64>>,
    k3: Option<Spanned<f64>>,
    k4: Option<Spanned<f64>>,
    k5: Option<Spanned<f64>>,
    k6: Option<Spanned<f64>>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawCovariance {
    parameters: Vec<Spanned<String>>,
    data: Spanned<Vec<Spanned<Vec<f64>>>>,
}

impl CalibrationBudget {
    /// Returns the budget in a file: `sigmas` by name, or `covariance` with `parameters` and the rows of a matrix
    /// (`data`). fx, fy, cx and cy are in px of the raw image.
    ///
    /// # Errors
    /// [`CalibrationBudgetError`] with the position of the invalid value.
    ///
    /// ```
    /// use tanker_pose::camera::CalibrationBudget;
    ///
    /// let text = include_str!("../../config/cameras/budget_example.yaml");
    /// let budget = CalibrationBudget::from_yaml(text, "budget_example.yaml")?;
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, CalibrationBudgetError> {
        let raw: Raw = yaml::read(text, source)?;
        match (raw.sigmas, raw.covariance) {
            (Some(sigmas), None) => sigmas.checked(source),
            (None, Some(covariance)) => covariance.checked(source),
            _ => Err(CalibrationBudgetError::NotOne {
                place: Place::whole(source),
            }),
        }
    }

    /// Returns each cause by its name, with the change of calibration that it makes at one sigma. `camera` is the
    /// camera made from `info`.
    ///
    /// # Errors
    /// [`CameraError::BudgetOfOtherLens`] if the lens does not have a coefficient that the file names.
    pub fn changes(
        &self,
        info: &CameraInfo,
        camera: &Camera,
    ) -> Result<Vec<(String, CalibrationChange)>, CameraError> {
        let is_equidistant = matches!(camera.lens, Some(Lens::Equidistant(_)));
        // The file's unit is px of the raw image. A camera info for rectified images may lack K.
        let of_raw = |k: f64, used: f64| if k > 0.0 { k } else { used };
        let (fx, fy) = (of_raw(info.k[0], camera.fx), of_raw(info.k[4], camera.fy));
        let places: Vec<(usize, f64)> = self
            .parameters
            .iter()
            .map(|&parameter| {
                Ok(match parameter {
                    0 => (0, 1.0 / fx),
                    1 => (1, 1.0 / fy),
                    // In pixels of the image that detections come in, which may be binned or rectified.
                    2 => (2, camera.fx / fx),
                    3 => (3, camera.fy / fy),
                    _ => (
                        FIRST_COEFFICIENT + coefficient(parameter, is_equidistant)?,
                        1.0,
                    ),
                })
            })
            .collect::<Result<_, CameraError>>()?;
        let changes = self.names.iter().zip(&self.columns).map(|(name, column)| {
            let mut change = CalibrationChange::zeros();
            for ((place, unit), value) in places.iter().zip(column) {
                change[*place] += unit * value;
            }
            (name.clone(), change)
        });
        Ok(changes.collect())
    }

    /// Returns the standard deviation of each parameter, formatted for log lines.
    #[must_use]
    pub fn in_words(&self) -> String {
        let parts: Vec<String> = self
            .parameters
            .iter()
            .enumerate()
            .map(|(row, &parameter)| {
                let squares = self.columns.iter().map(|column| column[row].powi(2));
                let unit = if parameter < PIXELS { " px" } else { "" };
                let sigma = crate::text::digits(squares.sum::<f64>().sqrt());
                format!("{} {sigma}{unit}", NAMES[parameter])
            })
            .collect();
        parts.join(", ")
    }

    /// Returns the budget of a checked covariance: its lower triangular factor, without zero columns.
    fn of_covariance(
        parameters: Vec<usize>,
        sigmas: &[f64],
        covariance: &DMatrix<f64>,
        place: Place,
    ) -> Result<Self, CalibrationBudgetError> {
        let count = parameters.len();
        let of = |sigma: f64| if sigma > 0.0 { 1.0 / sigma } else { 0.0 };
        let mut correlations = DMatrix::from_fn(count, count, |i, j| {
            covariance[(i, j)] * of(sigmas[i]) * of(sigmas[j])
        });
        // A parameter without variance must have no covariance with others.
        let is_stray = |i: usize| sigmas[i] == 0.0 && covariance.row(i).amax() > 0.0;
        let least = if (0..count).any(is_stray) {
            covariance.symmetric_eigenvalues().min()
        } else if count > 0 {
            correlations.symmetric_eigenvalues().min()
        } else {
            0.0
        };
        if least < -ROUNDING * count as f64 {
            return Err(CalibrationBudgetError::Indefinite { place, least });
        }
        let (mut columns, mut names) = (Vec::new(), Vec::new());
        for pivot in 0..count {
            let square = correlations[(pivot, pivot)];
            if square <= ROUNDING {
                continue;
            }
            let column = correlations.column(pivot) / square.sqrt();
            correlations -= &column * column.transpose();
            let own = column.iter().zip(sigmas).enumerate();
            let own =
                own.map(|(row, (value, sigma))| if row < pivot { 0.0 } else { value * sigma });
            columns.push(own.collect());
            names.push(NAMES[parameters[pivot]].to_owned());
        }
        Ok(Self {
            parameters,
            columns,
            names,
        })
    }
}

impl RawSigmas {
    fn checked(self, source: &str) -> Result<CalibrationBudget, CalibrationBudgetError> {
        let all = [
            self.fx, self.fy, self.cx, self.cy, self.k1, self.k2, self.p1, self.p2, self.k3,
            self.k4, self.k5, self.k6,
        ];
        let (mut parameters, mut sigmas) = (Vec::new(), Vec::new());
        for (parameter, sigma) in all.iter().enumerate() {
            if let Some(sigma) = sigma {
                let place = Place::at(source, sigma.referenced);
                parameters.push(parameter);
                sigmas.push(checked_sigma(parameter, sigma.value, place)?);
            }
        }
        let squares = sigmas.iter().map(|sigma| sigma * sigma);
        let covariance =
            DMatrix::from_diagonal(&nalgebra::DVector::from_iterator(sigmas.len(), squares));
        CalibrationBudget::of_covariance(parameters, &sigmas, &covariance, Place::whole(source))
    }
}

impl RawCovariance {
    fn checked(self, source: &str) -> Result<CalibrationBudget, CalibrationBudgetError> {
        let mut parameters = Vec::with_capacity(self.parameters.len().min(NAMES.len()));
        for name in self.parameters {
            let place = Place::at(source, name.referenced);
            let Some(parameter) = NAMES.iter().position(|known| *known == name.value) else {
                let name = name.value;
                return Err(CalibrationBudgetError::UnknownName { place, name });
            };
            if parameters.contains(&parameter) {
                let name = NAMES[parameter];
                return Err(CalibrationBudgetError::Twice { place, name });
            }
            parameters.push(parameter);
        }
        let need = parameters.len();
        let place = Place::at(source, self.data.referenced);
        let rows = self.data.value;
        let size = |place: Place, got: String| CalibrationBudgetError::Size { place, need, got };
        if rows.len() != need {
            return Err(size(place, format!("{} rows", rows.len())));
        }
        if let Some(row) = rows.iter().find(|row| row.value.len() != need) {
            let got = format!("a row of {}", row.value.len());
            return Err(size(Place::at(source, row.referenced), got));
        }
        let covariance = DMatrix::from_fn(need, need, |i, j| rows[i].value[j]);
        let mut sigmas = Vec::with_capacity(need);
        for (i, row) in rows.iter().enumerate() {
            let place = Place::at(source, row.referenced);
            let variance = covariance[(i, i)];
            // The root of a negative variance is NaN, which the check of the sigma refuses.
            sigmas.push(checked_sigma(parameters[i], variance.sqrt(), place)?);
        }
        for (i, row) in rows.iter().enumerate() {
            for j in 0..i {
                let (below, above) = (covariance[(i, j)], covariance[(j, i)]);
                let is_symmetric = (below - above).abs() <= 1e-6 * sigmas[i] * sigmas[j];
                if !is_symmetric {
                    return Err(CalibrationBudgetError::NotSymmetric {
                        place: Place::at(source, row.referenced),
                        row: NAMES[parameters[j]],
                        column: NAMES[parameters[i]],
                        above,
                        below,
                    });
                }
            }
        }
        let covariance = (&covariance + covariance.transpose()) * 0.5;
        CalibrationBudget::of_covariance(parameters, &sigmas, &covariance, place)
    }
}

fn checked_sigma(
    parameter: usize,
    value: f64,
    place: Place,
) -> Result<f64, CalibrationBudgetError> {
    let most = if parameter < PIXELS {
        MAX_PX
    } else {
        MAX_COEFFICIENT
    };
    if value == 0.0 || (LEAST..=most).contains(&value) {
        return Ok(value);
    }
    Err(CalibrationBudgetError::Sigma {
        place,
        name: NAMES[parameter],
        most,
        value,
    })
}

/// Returns the index of a coefficient in D.
fn coefficient(parameter: usize, is_equidistant: bool) -> Result<usize, CameraError> {
    let index = parameter - PIXELS;
    if !is_equidistant {
        return Ok(index);
    }
    // k1, k2, k3 and k4, without tangential ones.
    match NAMES[parameter] {
        "k1" => Ok(0),
        "k2" => Ok(1),
        "k3" => Ok(2),
        "k4" => Ok(3),
        name => Err(CameraError::BudgetOfOtherLens { name }),
    }
}

#[cfg(test)]
mod tests;
