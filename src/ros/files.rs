//! The files that parameters name.

use std::path::PathBuf;

use super::consumers::refuelling_setup;
use super::error::NodeError;
use crate::camera::CalibrationBudget;
use crate::config::Configuration;
use crate::refuelling::RefuellingSetup;
use crate::target::MarkerMap;

/// What the files of a configuration hold.
pub(super) struct Files {
    pub(super) map: MarkerMap,
    /// None where no output needs one.
    pub(super) setup: Option<RefuellingSetup>,
    /// What the calibration may have wrong, if a file says it.
    pub(super) calibration: Option<CalibrationBudget>,
}

impl Files {
    /// Reads the files of a configuration.
    ///
    /// # Errors
    /// [`NodeError`] of a file that cannot be read or used.
    pub(super) fn read(configuration: &Configuration) -> Result<Self, NodeError> {
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
fn marker_map(name: &str) -> Result<MarkerMap, NodeError> {
    if let Some(map) = MarkerMap::shipped(name) {
        return Ok(map);
    }
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| NodeError::MapUnreadable { path, source })?;
    Ok(MarkerMap::from_yaml(&text, name)?)
}

/// Returns what the file at this path says of the calibration.
fn calibration_budget(name: &str) -> Result<CalibrationBudget, NodeError> {
    let path = PathBuf::from(name);
    let text = crate::text_file::read(&path)
        .map_err(|source| NodeError::CalibrationUnreadable { path, source })?;
    Ok(CalibrationBudget::from_yaml(&text, name)?)
}
