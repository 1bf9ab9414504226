//! The logic behind the parameter services: values, descriptions, checked changes.

use std::collections::{BTreeMap, BTreeSet};
use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::wire::{descriptor, parameter_message, plain_value, type_of, value_message};
use crate::messages::{
    ListRequest, ListResult, ParameterDescriptor, SetParametersResult, WireParameter, WireValue,
};
use crate::parameters::{ParameterValue, Parameters};
use crate::qos_overrides::{QosOverrides, QosParameter};
use crate::text::{echoed, quoted};

/// The parameters of a running node, shared with its parameter services.
#[derive(Clone)]
pub struct SharedParameters {
    parameters: Arc<Mutex<Parameters>>,
    // Fixed: the topics are open with them.
    qos: Arc<BTreeMap<String, QosParameter>>,
    check: Arc<Check>,
    changed: smol::channel::Sender<()>,
}

/// Checks that values which are allowed one by one are consistent.
type Check = dyn Fn(&Parameters) -> Result<(), String> + Send + Sync;

impl SharedParameters {
    /// Returns shared parameters, and a channel that receives something after a change.
    ///
    /// `check` returns why values are inconsistent, although each is allowed by itself: no change to such values
    /// is made.
    #[must_use]
    pub fn new(
        parameters: Parameters,
        qos: &QosOverrides,
        check: impl Fn(&Parameters) -> Result<(), String> + Send + Sync + 'static,
    ) -> (Self, smol::channel::Receiver<()>) {
        // One place is enough: the reader of the channel then reads all parameters.
        let (changed, changes) = smol::channel::bounded(1);
        let qos = qos
            .iter()
            .map(|parameter| (parameter.name.clone(), parameter));
        let shared = Self {
            parameters: Arc::new(Mutex::new(parameters)),
            qos: Arc::new(qos.collect()),
            check: Arc::new(check),
            changed,
        };
        (shared, changes)
    }

    /// Returns the values as they are now.
    #[must_use]
    pub fn snapshot(&self) -> Parameters {
        self.lock().clone()
    }

    /// Returns the names that the request asks for, in alphabetical order.
    #[must_use]
    pub fn list(&self, request: &ListRequest) -> ListResult {
        let parameters = self.lock();
        let names: BTreeSet<&str> = parameters
            .iter()
            .map(|(name, _)| name)
            .chain(self.qos.keys().map(String::as_str))
            .filter(|name| is_listed(name, request))
            .collect();
        let prefixes: BTreeSet<&str> = names
            .iter()
            .filter_map(|name| name.rsplit_once('.').map(|(prefix, _)| prefix))
            .collect();
        let owned = |set: BTreeSet<&str>| set.into_iter().map(str::to_owned).collect();
        ListResult {
            prefixes: owned(prefixes),
            names: owned(names),
        }
    }

    /// Returns the values, in the order of the names; one that is not set for an unknown name.
    #[must_use]
    pub fn get(&self, names: &[String]) -> Vec<WireValue> {
        self.each(names, |value| value.map(value_message).unwrap_or_default())
    }

    /// Returns the types, in the order of the names; that of no value for an unknown name.
    #[must_use]
    pub fn types(&self, names: &[String]) -> Vec<u8> {
        self.each(names, |value| value.map(type_of).unwrap_or_default())
    }

    fn each<T>(&self, names: &[String], answer: impl Fn(Option<&ParameterValue>) -> T) -> Vec<T> {
        let parameters = self.lock();
        let value = |name: &String| {
            let qos = || self.qos.get(name).map(|parameter| &parameter.value);
            parameters.get(name).or_else(qos)
        };
        names.iter().map(|name| answer(value(name))).collect()
    }

    /// Returns the descriptions, in the order of the names; one without a type for an unknown name.
    #[must_use]
    pub fn describe(&self, names: &[String]) -> Vec<ParameterDescriptor> {
        let parameters = self.lock();
        let describe = |name: &String| {
            if let Some(qos) = self.qos.get(name) {
                return descriptor(name, &qos.value, &qos.kind, qos.description, true);
            }
            match (parameters.spec(name), parameters.get(name)) {
                (Some(spec), Some(value)) => {
                    let words = spec.unit_and_description();
                    descriptor(name, value, &spec.kind, &words, spec.read_only)
                }
                _ => ParameterDescriptor {
                    name: echoed(name.clone()),
                    ..ParameterDescriptor::default()
                },
            }
        };
        names.iter().map(describe).collect()
    }

    /// Sets all of the parameters, or none. Returns what those that can change are now, for `/parameter_events`.
    ///
    /// # Errors
    /// The result that names the first parameter that cannot have its value, and why, or those that do not go
    /// together.
    pub fn set(
        &self,
        assignments: &[WireParameter],
    ) -> Result<Vec<WireParameter>, SetParametersResult> {
        let refuse = |reason| SetParametersResult {
            successful: false,
            reason,
        };
        let mut parameters = self.lock();
        let mut changed = parameters.clone();
        for WireParameter { name, value } in assignments {
            self.set_one(&mut changed, name, value).map_err(refuse)?;
        }
        (self.check)(&changed).map_err(refuse)?;
        for (name, value) in changed.iter() {
            if parameters.get(name) != Some(value) {
                log::info!("parameter {name} set to {value}");
            }
        }
        let accepted = assignments
            .iter()
            .filter_map(|assignment| {
                // Reloading an unchanged read-only value raises no event.
                let is_fixed = changed.spec(&assignment.name)?.read_only;
                let value = changed.get(&assignment.name).filter(|_| !is_fixed)?;
                Some(parameter_message(&assignment.name, value))
            })
            .collect();
        *parameters = changed;
        drop(parameters);
        // A full channel already holds the notification.
        let _ = self.changed.try_send(());
        Ok(accepted)
    }

    fn set_one(
        &self,
        parameters: &mut Parameters,
        name: &str,
        value: &WireValue,
    ) -> Result<(), String> {
        let value = plain_value(value).ok_or_else(|| {
            let name = quoted(name);
            format!("parameter {name} needs a bool, a number or text, and cannot be unset")
        })?;
        if let Some(qos) = self.qos.get(name) {
            // A file with all of the values as they are may be loaded.
            return if qos.value == value {
                Ok(())
            } else {
                Err(format!(
                    "parameter {} is read-only: the topic is open with {}, restart the node to change it",
                    quoted(name),
                    qos.value
                ))
            };
        }
        parameters
            .check_change(name, value.clone())
            .and_then(|()| parameters.set(name, value))
            .map_err(|error| error.to_string())
    }

    fn lock(&self) -> MutexGuard<'_, Parameters> {
        // Values are replaced all at once: a panic elsewhere cannot leave half of them behind.
        self.parameters
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

/// Whether the request asks for this name, as rclcpp reads it: the depth counts the parts of the name after
/// the prefix.
fn is_listed(name: &str, request: &ListRequest) -> bool {
    let shallow = |rest: &str| {
        let dots = rest.bytes().filter(|byte| *byte == b'.').count();
        request.depth == 0 || u64::try_from(dots).is_ok_and(|dots| dots < request.depth)
    };
    if request.prefixes.is_empty() {
        return shallow(name);
    }
    request.prefixes.iter().any(|prefix| {
        name == prefix
            || name
                .strip_prefix(prefix.as_str())
                .and_then(|rest| rest.strip_prefix('.'))
                .is_some_and(shallow)
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::parameters::Kind;
    use crate::parameters::sample::SAMPLE;
    use crate::participant::reliable;
    use crate::qos_overrides::{Endpoint, Role};

    const DEPTH: &str = "qos_overrides./scan.publisher.depth";

    fn shared() -> (SharedParameters, smol::channel::Receiver<()>) {
        let scan = Endpoint::new("/scan".into(), Role::Publisher, &reliable(50));
        let parameters = Parameters::new(SAMPLE);
        SharedParameters::new(parameters, &QosOverrides::new(vec![scan]), |changed| {
            if changed.bool("filtered") && changed.text("mode") == "careful" {
                return Err("filtered and careful exclude each other".to_owned());
            }
            Ok(())
        })
    }

    fn names(names: &[&str]) -> Vec<String> {
        names.iter().map(|&name| name.to_owned()).collect()
    }

    fn integer(name: &str, value: i64) -> WireParameter {
        parameter_message(name, &ParameterValue::Integer(value))
    }

    #[test]
    fn change_is_checked_kept_and_told() {
        let (shared, changes) = shared();
        let device = parameter_message("device", &ParameterValue::String("/dev/ttyS1".into()));
        let unset = WireParameter {
            name: "filtered".into(),
            ..WireParameter::default()
        };
        for refused in [integer("retries", 7), device, unset, integer(DEPTH, 1)] {
            let refusal = shared
                .set(std::slice::from_ref(&refused))
                .expect_err(&refused.name);
            assert!(refusal.reason.contains(&refused.name), "{}", refusal.reason);
        }
        assert!(changes.try_recv().is_err(), "nothing has changed yet");

        let same = parameter_message("device", &ParameterValue::String("/dev/ttyS0".into()));
        let change = [integer("retries", 0), integer(DEPTH, 50), same];
        assert_eq!(
            shared.set(&change).expect("all are allowed"),
            [change[0].clone()]
        );
        assert!(changes.try_recv().is_ok());
        let held = shared.snapshot();
        assert_eq!(held.get("retries"), Some(&ParameterValue::Integer(0)));
    }

    #[test]
    fn one_refusal_refuses_all() {
        let (shared, changes) = shared();
        let refusal = shared
            .set(&[integer("retries", 0), integer("min_samples", 1)])
            .expect_err("min_samples has a bound");
        assert!(refusal.reason.contains("min_samples"), "{}", refusal.reason);
        assert_eq!(shared.snapshot(), Parameters::new(SAMPLE));
        assert!(changes.try_recv().is_err());
    }

    #[test]
    fn values_that_do_not_go_together_are_refused() {
        let (shared, changes) = shared();
        let careful = parameter_message("mode", &ParameterValue::String("careful".into()));
        let filtered = parameter_message("filtered", &ParameterValue::Bool(true));
        let refusal = shared
            .set(&[integer("retries", 0), careful.clone(), filtered.clone()])
            .expect_err("they exclude each other");
        assert_eq!(refusal.reason, "filtered and careful exclude each other");
        assert!(changes.try_recv().is_err());
        assert_eq!(shared.snapshot(), Parameters::new(SAMPLE));

        assert!(shared.set(&[careful]).is_ok(), "alone it is allowed");
        assert!(shared.set(&[filtered]).is_err(), "to what was set before");
    }

    #[test]
    fn number_is_told_in_the_type_of_its_parameter() {
        let (shared, _changes) = shared();
        let told = shared.set(&[integer("rate_hz", 2)]).expect("2 is 2.0");
        let expected = parameter_message("rate_hz", &ParameterValue::Double(2.0));
        assert_eq!(told, [expected]);
    }

    #[test]
    fn prefix_and_depth_choose_the_names() {
        let (shared, _changes) = shared();
        let list = |prefixes: &[&str], depth| {
            let prefixes = names(prefixes);
            shared.list(&ListRequest { prefixes, depth })
        };
        let all = list(&[], 0);
        assert_eq!(all.names.len(), SAMPLE.len() + 5);
        assert_eq!(all.prefixes, ["qos_overrides./scan.publisher"]);
        assert_eq!(
            list(&[], 1).names.len(),
            SAMPLE.len(),
            "names without a dot"
        );
        assert_eq!(list(&["min_samples"], 1).names, ["min_samples"]);
        assert_eq!(list(&["qos_overrides"], 0).names.len(), 5);
        assert!(list(&["qos_overrides"], 2).names.is_empty());
        assert_eq!(list(&["qos_overrides"], 3).names.len(), 5);
        assert!(list(&["min"], 0).names.is_empty(), "a prefix ends at a dot");
    }

    #[test]
    fn every_parameter_is_described_with_its_range_or_its_words() {
        let (shared, _changes) = shared();
        let all = shared.list(&ListRequest::default()).names;
        let descriptors = shared.describe(&all);
        assert_eq!(shared.types(&all).len(), all.len());
        for (name, descriptor) in all.iter().zip(&descriptors) {
            assert_eq!(*name, descriptor.name);
            assert_ne!(descriptor.kind, 0, "{name}");
            assert!(!descriptor.description.is_empty(), "{name}");
            let Some(spec) = shared.snapshot().spec(name) else {
                assert!(descriptor.read_only, "{name}");
                continue;
            };
            let ranges = (
                descriptor.floating_point_range.len(),
                descriptor.integer_range.len(),
            );
            let (expected, words) = match spec.kind {
                Kind::Double { .. } => ((1, 0), false),
                Kind::Integer { .. } => ((0, 1), false),
                Kind::Bool { .. } => ((0, 0), false),
                _ => ((0, 0), true),
            };
            assert_eq!(ranges, expected, "{name}");
            assert_eq!(
                !descriptor.additional_constraints.is_empty(),
                words,
                "{name}"
            );
            assert_eq!(descriptor.read_only, spec.read_only, "{name}");
        }
    }

    #[test]
    fn unknown_names_are_answered_in_their_place() {
        let (shared, _changes) = shared();
        let asked = names(&["no_such", "min_samples", DEPTH]);
        assert_eq!(shared.types(&asked), [0, 2, 2]);
        let values = shared.get(&asked);
        assert_eq!((values[0].kind, values[1].integer_value), (0, 5));
        assert_eq!(values[2].integer_value, 50);
        let descriptors = shared.describe(&asked);
        assert_eq!(
            (descriptors[0].name.as_str(), descriptors[0].kind),
            ("no_such", 0)
        );
    }
}
