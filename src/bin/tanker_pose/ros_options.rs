//! ROS arguments of tools that are nodes.

use clap::Args;
use tanker_pose::ros::arguments::{ArgumentError, Arguments};

/// `--ros-args`, as every ROS program takes them.
#[derive(Debug, Clone, Args)]
pub struct RosOptions {
    /// ROS arguments up to `--` or the end: -r from:=to, -r __node:=name, -r __ns:=/ns, --log-level x
    #[arg(
        long,
        value_name = "ARGUMENTS",
        num_args = 0..,
        allow_hyphen_values = true,
        value_terminator = "--"
    )]
    ros_args: Vec<String>,
}

impl RosOptions {
    /// Returns the ROS arguments.
    ///
    /// # Errors
    /// [`ArgumentError`] when one is malformed or not supported.
    pub fn read(&self) -> Result<Arguments, ArgumentError> {
        let mut all = vec!["--ros-args".to_owned()];
        all.extend(self.ros_args.iter().cloned());
        Ok(Arguments::split(&all)?.0)
    }
}
