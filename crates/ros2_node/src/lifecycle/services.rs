//! The five services of a managed node.

use futures::future::{join_all, ready};
use futures::{FutureExt, TryFutureExt};

use super::shared::{Request, SharedState};
use super::states::{GRAPH, State, Transition};
use crate::messages::{
    ChangeStateRequest, ChangeStateResponse, EmptyRequest, LifecycleState, LifecycleTransition,
    TransitionDescription, TransitionEvent,
};
use crate::participant::{EndpointError, RosNode};
use crate::service::Service;

const PACKAGE: &str = "lifecycle_msgs";

/// Opens the services; requests for changes go to `requests`.
pub(super) fn open(
    ros: &mut RosNode,
    state: &SharedState,
    requests: smol::channel::Sender<Request>,
) -> Result<smol::Task<()>, EndpointError> {
    let shared = || state.clone();
    let (current, available) = (shared(), shared());
    let services = [
        Service::of_node(
            ros,
            "get_state",
            (PACKAGE, "GetState"),
            move |_: EmptyRequest| ready(state_message(current.get())),
        )?,
        Service::of_node(
            ros,
            "get_available_states",
            (PACKAGE, "GetAvailableStates"),
            |_: EmptyRequest| ready(State::ALL.map(state_message).to_vec()),
        )?,
        Service::of_node(
            ros,
            "get_available_transitions",
            (PACKAGE, "GetAvailableTransitions"),
            move |_: EmptyRequest| ready(descriptions(available.get().transitions())),
        )?,
        Service::of_node(
            ros,
            "get_transition_graph",
            (PACKAGE, "GetAvailableTransitions"),
            |_: EmptyRequest| ready(descriptions(GRAPH.iter())),
        )?,
        Service::of_node(
            ros,
            "change_state",
            (PACKAGE, "ChangeState"),
            move |request: ChangeStateRequest| ask(requests.clone(), request.transition),
        )?,
    ];
    Ok(smol::spawn(join_all(services).map(drop)))
}

/// Requests a transition from the node, and returns its result.
async fn ask(
    requests: smol::channel::Sender<Request>,
    transition: LifecycleTransition,
) -> ChangeStateResponse {
    let (answer, answers) = smol::channel::bounded(1);
    let request = Request {
        id: transition.id,
        label: transition.label,
        answer,
    };
    let success = requests
        .send(request)
        .map_err(drop)
        .and_then(|()| answers.recv().map_err(drop))
        .await
        // A node that is leaving makes no more transitions.
        .unwrap_or(false);
    ChangeStateResponse { success }
}

fn state_message(state: State) -> LifecycleState {
    LifecycleState {
        id: state.id(),
        label: state.label().to_owned(),
    }
}

fn descriptions<'a>(
    transitions: impl Iterator<Item = &'a Transition>,
) -> Vec<TransitionDescription> {
    transitions
        .map(|transition| TransitionDescription {
            transition: transition_message(transition),
            start_state: state_message(transition.start),
            goal_state: state_message(transition.goal),
        })
        .collect()
}

fn transition_message(transition: &Transition) -> LifecycleTransition {
    LifecycleTransition {
        id: transition.id,
        label: transition.label.to_owned(),
    }
}

/// Returns the event about a transition, without its time.
pub(super) fn event(transition: &Transition) -> TransitionEvent {
    TransitionEvent {
        timestamp: 0,
        transition: transition_message(transition),
        start_state: state_message(transition.start),
        goal_state: state_message(transition.goal),
    }
}
