//! Parameters of the running node: `store` answers what its services are asked, `services` are the services
//! themselves, `wire` turns values and descriptions into messages.

mod services;
mod store;
mod wire;

pub use services::ParameterServices;
pub use store::SharedParameters;
