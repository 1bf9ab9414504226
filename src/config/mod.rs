//! Raw parameters -> checked settings.
//!
//! `table` declares each parameter once; [`Parameters`] keeps values that were held against it; `configuration` makes of
//! them what the floors below work with. Knows `estimation` and `tracking`; never a file, a topic or where a value came
//! from.

mod attitude;
mod configuration;
mod consumers;
mod people;
mod settings;
mod table;
#[cfg(test)]
mod tests;
mod words;

pub use configuration::{Configuration, nominal_camera_from_tanker};
pub use consumers::{ConsumerConfiguration, OutputError};
pub use people::{parameter_file, parameter_tables};
pub use ros2_node::parameters::{
    Key, Kind, ParameterError, ParameterSpec, ParameterValue, Parameters, Words,
};
pub use settings::{CalibrationSigmas, Settings};
pub use table::{KEYS, Keys, SECTIONS, TABLE};
pub use words::{Attitude, AttitudeSource, Input};

use table::Values;

/// Checks values that are allowed one by one, but perhaps not together: what one output needs, another parameter may
/// take away.
///
/// # Errors
/// [`OutputError`] names the output.
pub fn check_together(parameters: &Parameters) -> Result<(), OutputError> {
    ConsumerConfiguration::from(&Values::from(parameters)).check()
}
