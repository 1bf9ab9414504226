//! A tool's node, from its ROS arguments until it leaves the graph.

use async_signal::{Signal, Signals};
use tanker_pose::ros::arguments::ArgumentError;
use tanker_pose::ros::environment::{Environment, EnvironmentError};
use tanker_pose::ros::names::{NamesError, NodeNames};
use tanker_pose::ros::participant::{NodeOptions, OpenError, RosNode};
use tanker_pose::ros::{LOG_TARGET, logging};

use crate::ros_options::{NoParametersError, RosOptions, check_no_parameters};

/// Why a tool's node cannot join the graph.
#[derive(Debug, thiserror::Error)]
pub enum JoinError {
    #[error(transparent)]
    Argument(#[from] ArgumentError),
    #[error(transparent)]
    Parameter(#[from] NoParametersError),
    #[error(transparent)]
    Environment(#[from] EnvironmentError),
    #[error(transparent)]
    Names(#[from] NamesError),
    #[error("cannot listen for SIGINT and SIGTERM: {0}")]
    Signals(std::io::Error),
    #[error(transparent)]
    Open(#[from] OpenError),
}

/// A tool's node in the graph.
pub struct ToolNode {
    pub ros: RosNode,
    pub environment: Environment,
    /// SIGINT and SIGTERM, kept from the start on until they are read.
    pub signals: Signals,
}

impl ToolNode {
    /// Joins the graph as `name` unless the arguments remap it, in `domain_id` or that of the environment; starts
    /// logging.
    ///
    /// # Errors
    /// [`JoinError`] of an argument, the environment or the network.
    pub fn join(
        name: &'static str,
        ros_options: &RosOptions,
        domain_id: Option<u16>,
        node_options: NodeOptions,
    ) -> Result<Self, JoinError> {
        let arguments = ros_options.read()?;
        let mut environment = Environment::from_process()?;
        environment.domain_id = domain_id.unwrap_or(environment.domain_id);
        let names = NodeNames::new(name, &arguments.remaps)?;
        let warnings = check_no_parameters(&arguments, &names)?;
        let signals = Signals::new([Signal::Int, Signal::Term]).map_err(JoinError::Signals)?;
        let ros = RosNode::open(name, &arguments, &environment, node_options)?;
        logging::start(&arguments, ros.names(), LOG_TARGET);
        for warning in environment.warnings.iter().chain(&warnings) {
            log::warn!("{warning}");
        }
        Ok(Self {
            ros,
            environment,
            signals,
        })
    }

    /// Leaves the graph; endpoints must be dropped before.
    pub fn leave(self) {
        logging::stop_rosout();
        self.ros.close();
    }
}
