//! Parameters: what a node declares, and what it does while it runs.
//!
//! [`ParameterSpec`] declares one, with its default, its range and a description; [`Parameters`] holds a checked value
//! for each of a table of them. While the node runs, [`SharedParameters`] answers what its services are asked, and
//! [`ParameterServices`] are the services themselves.
//!
//! ```
//! use ros2_node::parameters::{ParameterSpec, ParameterValue, Parameters};
//!
//! const TABLE: &[ParameterSpec] = &[
//!     ParameterSpec::double("rate_hz", 10.0, [0.1, 100.0], "Hz, how often it measures"),
//!     ParameterSpec::text("device", "/dev/ttyS0", "where it is connected").read_only(),
//! ];
//!
//! let mut parameters = Parameters::new(TABLE);
//! parameters.set("rate_hz", ParameterValue::Integer(20)).expect("20 is allowed");
//! assert_eq!(parameters.double("rate_hz"), 20.0);
//!
//! let refused = parameters.set("rate_hz", ParameterValue::Double(0.0)).unwrap_err();
//! assert_eq!(refused.to_string(), r#"parameter "rate_hz" must be from 0.1 to 100.0, got 0.0"#);
//! ```

mod check;
#[cfg(test)]
pub(crate) mod sample;
#[cfg(feature = "client")]
mod services;
mod spec;
#[cfg(feature = "client")]
mod store;
mod value;
mod values;
#[cfg(feature = "client")]
mod wire;

#[cfg(feature = "client")]
pub use services::ParameterServices;
pub use spec::{Kind, ParameterSpec, USE_SIM_TIME};
#[cfg(feature = "client")]
pub use store::SharedParameters;
pub use value::{ParameterError, ParameterValue};
pub use values::Parameters;
