//! A recording answered as the node answers its topics: the same parameters, remaps and work, in the recording's time.
//!
//! ```text
//! answer          one recording from its first message to its last
//! flight          all frames of a recording, checked, for tools that look at them together
//! reading         those frames as they are read, with the camera and the attitudes of their time
//! routes          which of its topics are the node's inputs, and what of them can be used
//! sinks           where the answers go: a recording that holds the inputs too
//! summary         what was read, answered and left out
//! ```
//!
//! Nothing here reads a clock: the same recording gives the same bytes. What the node measures of itself is zero
//! (`solve_time`, latencies), and its time is the log time of the message in hand.

mod answer;
mod flight;
mod reading;
mod routes;
mod sinks;
mod summary;

use ros2_node::arguments::Arguments;
use ros2_node::names::{NamesError, NodeNames};

use crate::answering::files::{Files, FilesError};
use crate::answering::start::{StartError, effective_parameters};
use crate::config::{self, Configuration, TogetherError};
use crate::recording::WriteError;
use crate::target::MarkerMap;

pub use flight::FlightError;
pub use reading::Flight;
pub use summary::Summary;

/// Why a recording cannot be answered.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum ReplayError {
    /// The command line, or a parameter file.
    #[error(transparent)]
    Start(#[from] StartError),
    /// Parameters that exclude each other, or one that needs another.
    #[error(transparent)]
    Together(#[from] TogetherError),
    /// A file that a parameter names.
    #[error(transparent)]
    Files(#[from] FilesError),
    /// A remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// The answers cannot be written.
    #[error(transparent)]
    Write(#[from] WriteError),
    /// The recording is read beside the work on it.
    #[error("cannot start a thread that reads the recording: {0}")]
    Thread(std::io::Error),
}

/// A node as its arguments configure it, before its recording.
pub struct Replay {
    names: NodeNames,
    configuration: Configuration,
    files: Files,
    /// What of the arguments is allowed, but perhaps not meant.
    pub warnings: Vec<String>,
}

impl Replay {
    /// Returns the node of these arguments; the files that its parameters name are read.
    ///
    /// # Errors
    /// [`ReplayError`] of an argument, a parameter or a file.
    pub fn new(arguments: &Arguments) -> Result<Self, ReplayError> {
        let (names, start) = effective_parameters(arguments)?;
        config::check_together(&start.parameters)?;
        let configuration = Configuration::from(&start.parameters);
        Ok(Self {
            names,
            files: Files::read(&configuration)?,
            configuration,
            warnings: start.warnings,
        })
    }

    /// Returns the marker map.
    #[must_use]
    pub fn map(&self) -> &MarkerMap {
        &self.files.map
    }

    /// Returns the same with another marker map.
    #[must_use]
    pub fn with_map(mut self, map: MarkerMap) -> Self {
        self.files.map = map;
        self
    }
}
