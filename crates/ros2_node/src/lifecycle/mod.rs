//! A managed node: its state, the services that read and change it, and the events about changes.
//!
//! The services only forward requests; the node's own loop carries them out between two messages, and the answer
//! of `~/change_state` waits for that.

mod services;
mod shared;
mod states;

use ros2_client::Publisher;

use super::clock::NodeClock;
use super::messages::TransitionEvent;
use super::participant::{EndpointError, QosProfile, RosNode, reliable};
use crate::text::quoted;
pub use shared::Request;
use shared::SharedState;
pub use states::{GRAPH, State, Transition, WorkResult};

/// As rcl has it: its default for publishers.
const EVENTS: QosProfile = reliable(10);

/// The state of a managed node, with its services open until they are closed.
pub struct Lifecycle {
    state: SharedState,
    events: Publisher<TransitionEvent>,
    clock: NodeClock,
    services: smol::Task<()>,
}

impl Lifecycle {
    /// Opens the services of an unconfigured node; the requests come out of the channel.
    ///
    /// # Errors
    /// [`EndpointError`] when the middleware refuses.
    pub fn open(
        ros: &mut RosNode,
        clock: &NodeClock,
    ) -> Result<(Self, smol::channel::Receiver<Request>), EndpointError> {
        let state = SharedState::default();
        // One place is enough: the service waits for each answer.
        let (sender, requests) = smol::channel::bounded(1);
        let lifecycle = Self {
            events: ros.publisher("~/transition_event", &EVENTS)?,
            clock: clock.clone(),
            services: services::open(ros, &state, sender)?,
            state,
        };
        Ok((lifecycle, requests))
    }

    /// Returns the node's state.
    #[must_use]
    pub fn state(&self) -> State {
        self.state.get()
    }

    /// Makes the transition that is asked for and answers whether it was made. `work` does what the state that it is
    /// given is there for.
    pub fn carry_out(&self, request: &Request, mut work: impl FnMut(State) -> WorkResult) {
        let before = self.state.get();
        let success = self
            .state
            .get()
            .asked(request.id, &request.label)
            .is_some_and(|transition| self.make(transition, &mut work));
        let after = self.state.get();
        if success {
            log::info!("{} after {}", after.label(), before.label());
        } else {
            log::error!(
                "transition {} {} was asked for and not made: the node was {} and is {}",
                request.id,
                quoted(&request.label),
                before.label(),
                after.label()
            );
        }
        // Without a receiver once the services are closed.
        let _ = request.answer.try_send(success);
    }

    /// Steps until a state lasts; returns whether the first work was done.
    fn make(
        &self,
        transition: &'static Transition,
        work: &mut impl FnMut(State) -> WorkResult,
    ) -> bool {
        self.step(transition);
        let result = work(transition.goal);
        let mut next = transition.goal.after(result);
        while let Some(transition) = next {
            self.step(transition);
            next = match transition.goal {
                State::ErrorProcessing => transition.goal.after(work(transition.goal)),
                _ => None,
            };
        }
        result == WorkResult::Success
    }

    fn step(&self, transition: &Transition) {
        self.state.set(transition.goal);
        let now = self.clock.now();
        let seconds = u64::try_from(now.sec).unwrap_or(0);
        let event = TransitionEvent {
            timestamp: seconds * 1_000_000_000 + u64::from(now.nanosec),
            ..services::event(transition)
        };
        if let Err(error) = self.events.publish(event) {
            log::warn!("cannot publish a transition on ~/transition_event: {error}");
        }
    }

    /// Ends the services, which have to be gone before the node is.
    pub fn close(self) {
        smol::block_on(self.services.cancel());
    }
}
