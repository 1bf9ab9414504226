//! Parameters of the running node: shared with its parameter services, which check every change.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use ros2_client::{NodeOptions, ParameterValue as RosValue};

use crate::config::{ParameterValue, Parameters};

/// The parameters of a running node, shared with its parameter services.
#[derive(Debug, Clone)]
pub struct SharedParameters {
    parameters: Arc<Mutex<Parameters>>,
    changed: smol::channel::Sender<()>,
}

impl SharedParameters {
    /// Returns shared parameters, and a channel that receives something after a change.
    #[must_use]
    pub fn new(parameters: Parameters) -> (Self, smol::channel::Receiver<()>) {
        // One place is enough: who reads the channel then reads all the parameters.
        let (changed, changes) = smol::channel::bounded(1);
        (
            Self {
                parameters: Arc::new(Mutex::new(parameters)),
                changed,
            },
            changes,
        )
    }

    /// Returns the values as they are now.
    #[must_use]
    pub fn snapshot(&self) -> Parameters {
        self.lock().clone()
    }

    /// Returns node options under which the parameters are declared, and every change of one through
    /// the services is checked first and takes effect then.
    pub fn declare(&self, options: NodeOptions) -> NodeOptions {
        let declared = self.lock().iter().fold(options, |options, (name, value)| {
            options.declare_parameter(name, to_ros(value))
        });
        let (checker, setter) = (self.clone(), self.clone());
        declared
            .parameter_validator(Box::new(move |name, value| checker.check(name, value)))
            .parameter_set_action(Box::new(move |name, value| setter.set(name, value)))
    }

    fn check(&self, name: &str, value: &RosValue) -> Result<(), String> {
        let value = from_ros(value).ok_or_else(|| no_scalar(name))?;
        self.lock()
            .check_change(name, value)
            .map_err(|error| error.to_string())
    }

    fn set(&self, name: &str, value: &RosValue) -> Result<(), String> {
        let value = from_ros(value).ok_or_else(|| no_scalar(name))?;
        let mut parameters = self.lock();
        if parameters.get(name) == Some(&value) {
            return Ok(()); // as when they are declared
        }
        log::info!("parameter {name} set to {value}");
        parameters
            .set(name, value)
            .map_err(|error| error.to_string())?;
        drop(parameters);
        // A full channel already tells what there is to tell.
        let _ = self.changed.try_send(());
        Ok(())
    }

    fn lock(&self) -> MutexGuard<'_, Parameters> {
        // Values are replaced one at a time: a panic elsewhere cannot leave half of one behind.
        self.parameters
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

fn no_scalar(name: &str) -> String {
    format!("parameter {name:?} needs a bool, a number or text, and cannot be unset")
}

fn to_ros(value: &ParameterValue) -> RosValue {
    match value {
        ParameterValue::Bool(value) => RosValue::Boolean(*value),
        ParameterValue::Integer(value) => RosValue::Integer(*value),
        ParameterValue::Double(value) => RosValue::Double(*value),
        ParameterValue::String(value) => RosValue::String(value.clone()),
    }
}

fn from_ros(value: &RosValue) -> Option<ParameterValue> {
    match value {
        RosValue::Boolean(value) => Some(ParameterValue::Bool(*value)),
        RosValue::Integer(value) => Some(ParameterValue::Integer(*value)),
        RosValue::Double(value) => Some(ParameterValue::Double(*value)),
        RosValue::String(value) => Some(ParameterValue::String(value.clone())),
        _ => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn change_through_a_service_is_checked_and_told() {
        let (shared, changes) = SharedParameters::new(Parameters::default());
        assert!(shared.check("max_outliers", &RosValue::Integer(7)).is_err());
        assert!(
            shared
                .check("marker_map", &RosValue::String("fin6".into()))
                .is_err()
        );
        assert!(shared.check("rectified", &RosValue::NotSet).is_err());
        assert!(changes.try_recv().is_err(), "nothing has changed yet");

        assert_eq!(shared.check("max_outliers", &RosValue::Integer(0)), Ok(()));
        assert_eq!(shared.set("max_outliers", &RosValue::Integer(0)), Ok(()));
        assert!(changes.try_recv().is_ok());
        assert_eq!(
            shared.snapshot().get("max_outliers"),
            Some(&ParameterValue::Integer(0))
        );
    }
}
