//! The files that parameters name.

use std::path::PathBuf;

use super::consumers::{ConsumersError, refuelling_setup};
use crate::camera::{CalibrationBudget, CalibrationBudgetError};
use crate::config::Configuration;
use crate::refuelling::RefuellingSetup;
use crate::target::{MarkerMap, MarkerMapError};
use crate::text;

/// Why a file that a parameter names cannot be used.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum FilesError {
    /// The marker map's file is missing, or not readable, or not text.
    #[error(
        "parameter \"marker_map\": cannot read {}: {source} (a path, or one of the shipped maps: paper, fin6)",
        text::path(path)
    )]
    MapUnreadable {
        /// The file.
        path: PathBuf,
        /// The system's error.
        source: std::io::Error,
    },
    /// The marker map cannot be used.
    #[error("parameter \"marker_map\": {0}")]
    Map(#[from] MarkerMapError),
    /// The file of what the calibration may have wrong is missing, or not readable, or not text.
    #[error(
        "parameter \"calibration_budget_file\": cannot read {}: {source}",
        text::path(path)
    )]
    CalibrationUnreadable {
        /// The file.
        path: PathBuf,
        /// What the system says.
        source: std::io::Error,
    },
    /// The file of what the calibration may have wrong cannot be used.
    #[error("parameter \"calibration_budget_file\": {0}")]
    Calibration(#[from] CalibrationBudgetError),
    /// An output for refuelling or a flight stack lacks what it needs.
    #[error(transparent)]
    Consumers(#[from] ConsumersError),
}

/// What the files of a configuration hold.
pub struct Files {
    /// The markers.
    pub map: MarkerMap,
    /// Receptacle, probe and mount; `None` where no output needs them.
    pub setup: Option<RefuellingSetup>,
    /// What the calibration may have wrong, if a file says it.
    pub calibration: Option<CalibrationBudget>,
}

impl Files {
    /// Reads the files of a configuration.
    ///
    /// # Errors
    /// [`FilesError`] of a file that cannot be read or used.
    pub fn read(configuration: &Configuration) -> Result<Self, FilesError> {
        Ok(Self {
            map: marker_map(&configuration.marker_map)?,
            setup: refuelling_setup(&configuration.consumers)?,
            calibration: configuration
                .calibration_budget_file
                .as_deref()
                .map(calibration_budget)
                .transpose()?,
        })
    }
}

/// Returns the shipped map of this name, or the one in the file at this path.
fn marker_map(name: &str) -> Result<MarkerMap, FilesError> {
    if let Some(map) = MarkerMap::shipped(name) {
        return Ok(map);
    }
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| FilesError::MapUnreadable { path, source })?;
    Ok(MarkerMap::from_yaml(&text, name)?)
}

/// Returns what the file at this path says of the calibration.
fn calibration_budget(name: &str) -> Result<CalibrationBudget, FilesError> {
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| FilesError::CalibrationUnreadable { path, source })?;
    Ok(CalibrationBudget::from_yaml(&text, name)?)
}
