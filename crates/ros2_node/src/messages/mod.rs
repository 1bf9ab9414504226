//! Messages that every ROS node speaks, as serde structs in the order of their `.msg` files.
//!
//! CDR carries no field names: the order of the fields here **is** the wire format. Nothing is checked here: a decoded
//! message may hold any values.
//!
//! A message of your own is a struct with the fields of its `.msg` file, in their order:
//!
//! ```
//! use ros2_node::messages::Header;
//! use serde::{Deserialize, Serialize};
//!
//! /// `sensor_msgs/Temperature`.
//! #[derive(Debug, Clone, Serialize, Deserialize)]
//! struct Temperature {
//!     header: Header,
//!     temperature: f64,
//!     variance: f64,
//! }
//!
//! ros2_node::ros_message!("sensor_msgs" / Temperature);
//! ```

use serde::{Deserialize, Serialize};

mod lifecycle;
mod parameters;
mod standard;

pub use lifecycle::*;
pub use parameters::*;
pub use standard::*;

/// A message type's place in the ROS type system: `package/msg/name`.
pub trait Message: Serialize + for<'de> Deserialize<'de> + 'static {
    /// ROS package that defines the message.
    const PACKAGE: &'static str;
    /// Name of the message in its package.
    const NAME: &'static str;
}

/// Implements [`Message`] for structs that are called as their ROS messages: `ros_message!("sensor_msgs" / Imu, …)`.
#[macro_export]
macro_rules! ros_message {
    ($($package:literal / $name:ident),+ $(,)?) => {$(
        impl $crate::messages::Message for $name {
            const PACKAGE: &'static str = $package;
            const NAME: &'static str = stringify!($name);
        }
    )+};
}

crate::ros_message!(
    "lifecycle_msgs" / TransitionEvent,
    "rcl_interfaces" / ParameterEvent,
    "rosgraph_msgs" / Clock,
    "std_msgs" / Header,
);
