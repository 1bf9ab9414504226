//! Why the node cannot start, or go on.

use std::path::PathBuf;

use super::consumers::ConsumersError;
use super::names::NamesError;
use super::participant::{EndpointError, MiddlewareGone, OpenError};
use super::start_values::StartParameterError;
use crate::camera::CalibrationBudgetError;
use crate::config::TogetherError;
use crate::target::MarkerMapError;
use crate::text;

/// Why the node could not start.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum NodeError {
    /// The node's name or a remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// A parameter or a parameter file.
    #[error(transparent)]
    Parameters(#[from] StartParameterError),
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
    /// Parameters that exclude each other, or one that needs another.
    #[error(transparent)]
    Together(#[from] TogetherError),
    /// An output for refuelling or a flight stack lacks what it needs.
    #[error(transparent)]
    Consumers(#[from] ConsumersError),
    /// Signals cannot be caught.
    #[error("cannot listen for SIGINT and SIGTERM: {0}")]
    Signals(std::io::Error),
    /// The graph cannot be joined.
    #[error(transparent)]
    Open(#[from] OpenError),
    /// A topic cannot be opened.
    #[error(transparent)]
    Endpoint(#[from] EndpointError),
    /// The middleware has stopped.
    #[error(transparent)]
    MiddlewareGone(#[from] MiddlewareGone),
}
