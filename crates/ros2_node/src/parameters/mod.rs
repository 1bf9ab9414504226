//! Parameters: their declaration, and changes while the node runs.
//!
//! [`declare_parameters!`](crate::declare_parameters) declares them, each once: with a type, a default, a range, a unit and
//! words. [`Parameters`] holds a checked value for each, to be read by a typed [`Key`]. While the node runs,
//! [`SharedParameters`] answers the requests of the services, and [`ParameterServices`] are the services themselves.
//! [`parameter_file`] and [`markdown_tables`] present the declarations.

mod check;
mod key;
mod listing;
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

pub use key::{Key, Words, count, double, frame_id, integer, one_of, optional_text, switch, text};
pub use listing::{Section, markdown_tables, parameter_file};
#[cfg(feature = "client")]
pub use services::ParameterServices;
pub use spec::{Kind, ParameterSpec, USE_SIM_TIME};
#[cfg(feature = "client")]
pub use store::SharedParameters;
pub use value::{ParameterError, ParameterValue};
pub use values::Parameters;
