//! The six parameter services of a ROS node, and the events about changes.
//!
//! ros2-client has such services too, but without descriptions, and their long replies do not arrive: a
//! node that opens these switches those off in its [`super::super::participant::NodeOptions`].

use std::sync::Arc;

use futures::FutureExt;
use futures::future::{join_all, ready};
use ros2_client::Publisher;

use super::SharedParameters;
use crate::clock::NodeClock;
use crate::messages::{
    Assignments, ListRequest, Names, ParameterEvent, SetParametersResult, WireParameter,
};
use crate::participant::{EndpointError, QosProfile, RosNode, reliable};
use crate::service::Service;

const PACKAGE: &str = "rcl_interfaces";
/// As `rmw_qos_profile_parameter_events` has it.
const EVENTS: QosProfile = reliable(1000);

/// The services, open and answering until they are closed.
pub struct ParameterServices(smol::Task<()>);

impl ParameterServices {
    /// Opens the services of these parameters.
    ///
    /// # Errors
    /// [`EndpointError`] when the middleware refuses.
    pub fn open(
        ros: &mut RosNode,
        parameters: &SharedParameters,
        clock: &NodeClock,
    ) -> Result<Self, EndpointError> {
        let events = Arc::new(Events {
            publisher: ros.publisher("/parameter_events", &EVENTS)?,
            clock: clock.clone(),
            node: ros.names().fully_qualified(),
        });
        let shared = || parameters.clone();
        let (list, get, types, describe) = (shared(), shared(), shared(), shared());
        let (set, set_all, set_events, set_all_events) =
            (shared(), shared(), Arc::clone(&events), events);
        let services = [
            Service::of_node(
                ros,
                "list_parameters",
                (PACKAGE, "ListParameters"),
                move |request: ListRequest| ready(list.list(&request)),
            )?,
            Service::of_node(
                ros,
                "get_parameters",
                (PACKAGE, "GetParameters"),
                move |Names { names }| ready(get.get(&names)),
            )?,
            Service::of_node(
                ros,
                "get_parameter_types",
                (PACKAGE, "GetParameterTypes"),
                move |Names { names }| ready(types.types(&names)),
            )?,
            Service::of_node(
                ros,
                "describe_parameters",
                (PACKAGE, "DescribeParameters"),
                move |Names { names }| ready(describe.describe(&names)),
            )?,
            Service::of_node(
                ros,
                "set_parameters",
                (PACKAGE, "SetParameters"),
                move |request: Assignments| {
                    let set_one = |one| set_events.after(set.set(std::slice::from_ref(one)));
                    ready(request.parameters.iter().map(set_one).collect::<Vec<_>>())
                },
            )?,
            Service::of_node(
                ros,
                "set_parameters_atomically",
                (PACKAGE, "SetParametersAtomically"),
                move |request: Assignments| {
                    ready(set_all_events.after(set_all.set(&request.parameters)))
                },
            )?,
        ];
        Ok(Self(smol::spawn(join_all(services).map(drop))))
    }

    /// Ends the services, which have to be gone before the node is.
    pub fn close(self) {
        smol::block_on(self.0.cancel());
    }
}

/// The publisher of changes.
struct Events {
    publisher: Publisher<ParameterEvent>,
    clock: NodeClock,
    node: String,
}

impl Events {
    /// Returns the result to answer with, after publishing the event.
    fn after(
        &self,
        outcome: Result<Vec<WireParameter>, SetParametersResult>,
    ) -> SetParametersResult {
        let changed_parameters = match outcome {
            Ok(changed) => changed,
            Err(refusal) => return refusal,
        };
        if !changed_parameters.is_empty() {
            let event = ParameterEvent {
                stamp: self.clock.now(),
                node: self.node.clone(),
                changed_parameters,
                ..ParameterEvent::default()
            };
            if let Err(error) = self.publisher.publish(event) {
                log::warn!("cannot publish a change of parameters on /parameter_events: {error}");
            }
        }
        SetParametersResult {
            successful: true,
            reason: String::new(),
        }
    }
}
