//! The error budget: causes other than the noise of single detections that make pixels differ from their prediction.
//!
//! The user states a standard deviation for every cause. Causes that affect many points together (a bent wing, a wrong
//! focal length, a shaking image) are *modes*: each is a vector of pixel shifts at one sigma. Survey errors are
//! independent for each marker. The covariance of all pixels of a frame is then
//!
//! ```text
//! Σ = diag(σᵢ²) + blockdiag(Dᵢ Sᵢ Dᵢᵀ) + Σₘ hₘ hₘᵀ,   Dᵢ = ∂pixel/∂point in the camera frame
//! ```
//!
//! with `Sᵢ = sᵢ² 1` the survey covariance of marker `i`. Weights, covariance and chi-squared are those of the whole
//! `Σ`, which is never formed: the amplitude of every mode is estimated with a prior of one sigma and eliminated, which
//! gives the same result at a cost linear in the number of points.

mod causes;
mod correlated_noise;
mod frame;
mod gram;
mod in_doubt;
mod linear;
mod residuals;

use std::collections::BTreeMap;

use nalgebra::Vector3;

use crate::camera::{CALIBRATION_SIZE, CalibrationChange};
use crate::target::MAX_FLEX_MODES;

pub(super) use causes::frame_causes;
pub use causes::{Cause, CauseKind, FrameCauses};
pub use correlated_noise::{CorrelatedNoise, CorrelatedNoiseError};
pub(super) use frame::{AttitudePrior, FrameBudget};
pub(super) use in_doubt::InDoubt;
pub use linear::LinearFrame;

/// Largest number of modes of calibration and jitter together: all parameters of a calibration, and jitter in u and in
/// v.
const MAX_IMAGE_MODES: usize = CALIBRATION_SIZE + 2;
/// Largest number of modes of all kinds.
const MAX_MODES: usize = MAX_FLEX_MODES + MAX_IMAGE_MODES;

/// A mode in which the airframe bends: the displacement of each marker at one sigma.
#[derive(Debug, Clone, PartialEq)]
pub struct FlexMode {
    /// Its name for reports.
    pub name: String,
    /// Time constant of its amplitude, s; `None`: constant for the whole flight.
    pub time_constant_s: Option<f64>,
    /// Marker id and displacement at one sigma, tanker frame, m. Markers that are not listed do not move.
    pub shape: Vec<(u32, Vector3<f64>)>,
}

/// A possible error of the calibration: its change at one sigma.
#[derive(Debug, Clone, PartialEq)]
pub struct CalibrationMode {
    /// Its name for reports.
    pub name: String,
    /// The change of the calibration at one sigma.
    pub change: CalibrationChange,
}

/// Checked standard deviations of the errors of a map, a calibration and a mount.
#[derive(Debug, Clone, PartialEq)]
pub struct ErrorBudget {
    flex: Vec<FlexMode>,
    calibration: Vec<CalibrationMode>,
    jitter_px: f64,
    correlated_noise: Option<CorrelatedNoise>,
    /// By id, ascending.
    markers: Vec<MarkerBudget>,
    image: Vec<ImageMode>,
}

/// Errors of the position of one marker.
#[derive(Debug, Clone, Copy, PartialEq)]
struct MarkerBudget {
    id: u32,
    /// Of each axis, m.
    survey_sigma_m: f64,
    /// Displacement at one sigma of each flex mode, m.
    flex: [Vector3<f64>; MAX_FLEX_MODES],
}

/// A mode of the image: a weighted sum of the columns of `Camera::pixel_by_calibration`.
#[derive(Debug, Clone, PartialEq)]
struct ImageMode {
    name: String,
    terms: Vec<(usize, f64)>,
}

/// Why standard deviations are not a valid budget.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum BudgetError {
    /// Not a standard deviation.
    #[error("expected a finite number of 0 or more for {of}, got {value}")]
    Sigma {
        /// The quantity with this sigma.
        of: String,
        /// The value.
        value: f64,
    },
    /// Too many modes.
    #[error("expected at most {most} modes of {kind}, got {got}")]
    TooManyModes {
        /// The kind of mode.
        kind: &'static str,
        /// The limit.
        most: usize,
        /// The number of modes.
        got: usize,
    },
}

/// Column of the principal point's u in a calibration; v follows.
const PRINCIPAL_POINT: usize = 2;

impl ErrorBudget {
    /// Returns the checked budget; all values may be zero.
    ///
    /// # Inputs
    /// * `survey`: marker id and standard deviation of each of its coordinates, m.
    /// * `jitter_px`: standard deviation of a shift of the whole image, independent in each frame, px.
    ///
    /// # Errors
    /// [`BudgetError`]: a value that is negative or not finite, too many modes.
    pub fn new(
        survey: &[(u32, f64)],
        flex: Vec<FlexMode>,
        calibration: Vec<CalibrationMode>,
        jitter_px: f64,
    ) -> Result<Self, BudgetError> {
        check(survey, &flex, &calibration, jitter_px)?;
        let budget = Self::of_checked(survey, flex, calibration, jitter_px);
        for (kind, most, got) in [
            ("flex", MAX_FLEX_MODES, budget.flex.len()),
            (
                "calibration and jitter",
                MAX_IMAGE_MODES,
                budget.image.len(),
            ),
        ] {
            if got > most {
                return Err(BudgetError::TooManyModes { kind, most, got });
            }
        }
        Ok(budget)
    }

    /// Returns the budget from values that have already been checked: a map's, and parameters'.
    pub(crate) fn of_checked(
        survey: &[(u32, f64)],
        flex: Vec<FlexMode>,
        calibration: Vec<CalibrationMode>,
        jitter_px: f64,
    ) -> Self {
        let markers = markers(survey, &flex);
        let image = image_modes(&calibration, jitter_px);
        Self {
            flex,
            calibration,
            jitter_px,
            correlated_noise: None,
            markers,
            image,
        }
    }

    /// Returns the budget with correlated noise. Single frames are estimated as without it; the track counts less of
    /// their information as new.
    #[must_use]
    pub fn with_correlated_noise(self, correlated_noise: Option<CorrelatedNoise>) -> Self {
        Self {
            correlated_noise,
            ..self
        }
    }

    /// Returns the correlated noise, if any.
    #[must_use]
    pub fn correlated_noise(&self) -> Option<CorrelatedNoise> {
        self.correlated_noise
    }

    /// Returns whether the budget is empty; the estimate is then that without a budget.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        let is_exact = |marker: &MarkerBudget| {
            marker.survey_sigma_m == 0.0
                && marker.flex.iter().all(|shift| *shift == Vector3::zeros())
        };
        self.image.is_empty() && self.markers.iter().all(is_exact)
    }

    /// Returns the name of a mode by its place: flex first, then calibration and jitter.
    #[must_use]
    pub fn mode_name(&self, index: usize) -> Option<&str> {
        let flex = self.flex.iter().map(|mode| mode.name.as_str());
        flex.chain(self.image.iter().map(|mode| mode.name.as_str()))
            .nth(index)
    }

    /// Returns the share of a mode's sigma that lasts, and for how long, s; `None`: for the whole flight. Jitter is new in
    /// each frame.
    ///
    /// # Inputs
    /// * `index`: its place, as in [`Self::mode_name`].
    #[must_use]
    pub fn mode_lasts(&self, index: usize) -> (f64, Option<f64>) {
        if let Some(flex) = self.flex.get(index) {
            return (1.0, flex.time_constant_s);
        }
        let Some(mode) = self.image.get(index - self.flex.len()) else {
            return (0.0, None);
        };
        let of_calibration = self.calibration.iter().find(|of| of.name == mode.name);
        let share = match (of_calibration, mode.terms.as_slice()) {
            // The jitter of the image may be in it.
            (Some(of), [(term, sigma)]) => of.change[*term].abs() / sigma.abs(),
            (Some(_), _) => 1.0,
            (None, _) => 0.0,
        };
        (share, None)
    }

    /// Returns the flex modes.
    #[must_use]
    pub fn flex(&self) -> &[FlexMode] {
        &self.flex
    }

    /// Returns the calibration's modes.
    #[must_use]
    pub fn calibration(&self) -> &[CalibrationMode] {
        &self.calibration
    }

    /// Returns the standard deviation of the shift of the whole image, px.
    #[must_use]
    pub fn jitter_px(&self) -> f64 {
        self.jitter_px
    }

    /// Returns the standard deviation of each coordinate of a marker, m.
    #[must_use]
    pub fn survey_sigma_m(&self, id: u32) -> f64 {
        self.marker(id, &mut 0)
            .map_or(0.0, |marker| marker.survey_sigma_m)
    }

    /// Returns a marker's part. Markers usually come in the map's order: `place` is the index at which the search
    /// begins.
    #[inline(always)]
    fn marker(&self, id: u32, place: &mut usize) -> Option<&MarkerBudget> {
        if self
            .markers
            .get(*place)
            .is_none_or(|marker| marker.id != id)
        {
            *place = self
                .markers
                .binary_search_by_key(&id, |marker| marker.id)
                .ok()?;
        }
        let found = self.markers.get(*place);
        *place += 1;
        found
    }
}

fn check(
    survey: &[(u32, f64)],
    flex: &[FlexMode],
    calibration: &[CalibrationMode],
    jitter_px: f64,
) -> Result<(), BudgetError> {
    let of_markers = survey
        .iter()
        .map(|(id, sigma)| (format!("the survey of marker {id}"), *sigma));
    let of_flex = flex.iter().flat_map(|mode| {
        let time = mode.time_constant_s.map(|time| {
            (
                format!("the time constant of flex mode `{}`", mode.name),
                time,
            )
        });
        let shape = mode.shape.iter().map(|(id, shift)| {
            let of = format!("the shift of marker {id} in flex mode `{}`", mode.name);
            (of, shift.norm())
        });
        time.into_iter().chain(shape)
    });
    let of_calibration = calibration.iter().map(|mode| {
        let of = format!("the change of calibration mode `{}`", mode.name);
        (of, mode.change.norm())
    });
    let jitter = std::iter::once(("the jitter of the image".to_owned(), jitter_px));
    for (of, value) in of_markers
        .chain(of_flex)
        .chain(of_calibration)
        .chain(jitter)
    {
        if !(value.is_finite() && value >= 0.0) {
            return Err(BudgetError::Sigma { of, value });
        }
    }
    Ok(())
}

fn markers(survey: &[(u32, f64)], flex: &[FlexMode]) -> Vec<MarkerBudget> {
    let mut markers = BTreeMap::new();
    for &(id, survey_sigma_m) in survey {
        entry(&mut markers, id).survey_sigma_m = survey_sigma_m;
    }
    for (index, mode) in flex.iter().enumerate().take(MAX_FLEX_MODES) {
        for &(id, shift) in &mode.shape {
            entry(&mut markers, id).flex[index] = shift;
        }
    }
    markers.into_values().collect()
}

fn entry(markers: &mut BTreeMap<u32, MarkerBudget>, id: u32) -> &mut MarkerBudget {
    markers.entry(id).or_insert(MarkerBudget {
        id,
        survey_sigma_m: 0.0,
        flex: [Vector3::zeros(); MAX_FLEX_MODES],
    })
}

/// Returns the modes of the image. Jitter and a wrong principal point are indistinguishable in one frame, so the jitter
/// is added to the modes of the principal point if there are any.
fn image_modes(calibration: &[CalibrationMode], jitter_px: f64) -> Vec<ImageMode> {
    let mut jitter = [jitter_px; 2];
    let mut modes = Vec::new();
    for mode in calibration {
        let mut terms: Vec<(usize, f64)> = (0..CALIBRATION_SIZE)
            .filter(|&index| mode.change[index] != 0.0)
            .map(|index| (index, mode.change[index]))
            .collect();
        if let [(index, sigma)] = terms.as_mut_slice()
            && let Some(jitter) = index
                .checked_sub(PRINCIPAL_POINT)
                .and_then(|axis| jitter.get_mut(axis))
        {
            *sigma = sigma.hypot(*jitter);
            *jitter = 0.0;
        }
        if !terms.is_empty() {
            modes.push(ImageMode {
                name: mode.name.clone(),
                terms,
            });
        }
    }
    for (axis, sigma) in jitter.into_iter().enumerate() {
        if sigma > 0.0 {
            let terms = vec![(PRINCIPAL_POINT + axis, sigma)];
            let name = ["jitter_u", "jitter_v"][axis].to_owned();
            modes.push(ImageMode { name, terms });
        }
    }
    modes
}
