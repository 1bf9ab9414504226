//! Why the node cannot start, or go on.

use super::names::NamesError;
use super::participant::{EndpointError, MiddlewareGone, OpenError};
use super::start_values::StartParameterError;
use crate::answering::files::FilesError;
use crate::answering::start::StartError;
use crate::config::TogetherError;

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
    /// A file that a parameter names.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// Parameters that exclude each other, or one that needs another.
    #[error(transparent)]
    Together(#[from] TogetherError),
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

impl From<StartError> for NodeError {
    fn from(error: StartError) -> Self {
        match error {
            StartError::Names(error) => Self::Names(error),
            StartError::Parameters(error) => Self::Parameters(error),
        }
    }
}
