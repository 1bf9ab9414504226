//! What the command line says of the node: its names, and the values of its parameters.

use ros2_node::arguments::Arguments;
use ros2_node::names::{NamesError, NodeNames};
use ros2_node::qos_overrides::QosOverrides;
use ros2_node::start_values::{StartParameterError, StartValues, start_values};

use super::topics;
use crate::config::{Parameters, TABLE};

/// What the node is called unless it is remapped.
pub const NODE_NAME: &str = "tanker_pose";

/// Why a command line cannot be used.
#[derive(Debug, thiserror::Error)]
pub enum StartError {
    /// The node's name or a remap.
    #[error(transparent)]
    Names(#[from] NamesError),
    /// A parameter or a parameter file.
    #[error(transparent)]
    Parameters(#[from] StartParameterError),
}

/// Returns the node's names, and the parameters that it starts with under these arguments.
///
/// # Errors
/// [`StartError`] of a name, a file or a value.
pub fn effective_parameters(arguments: &Arguments) -> Result<(NodeNames, StartValues), StartError> {
    let names = NodeNames::new(NODE_NAME, &arguments.remaps)?;
    let qos = QosOverrides::new(topics::endpoints(&names)?);
    let start = start_values(
        arguments,
        &names.fully_qualified(),
        Parameters::new(TABLE),
        qos,
    )?;
    Ok((names, start))
}
