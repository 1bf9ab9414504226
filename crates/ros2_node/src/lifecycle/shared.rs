//! State shared by the services and the loop.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};

use super::states::State;

/// A request for a transition that waits for its answer.
#[derive(Debug)]
pub struct Request {
    pub(super) id: u8,
    pub(super) label: String,
    pub(super) answer: smol::channel::Sender<bool>,
}

/// The state, shared with the services.
#[derive(Debug, Clone)]
pub(super) struct SharedState(Arc<Mutex<State>>);

impl Default for SharedState {
    fn default() -> Self {
        Self(Arc::new(Mutex::new(State::Unconfigured)))
    }
}

impl SharedState {
    pub(super) fn get(&self) -> State {
        *self.lock()
    }

    pub(super) fn set(&self, state: State) {
        *self.lock() = state;
    }

    fn lock(&self) -> MutexGuard<'_, State> {
        // A state is replaced as a whole: a panic elsewhere cannot leave half of one behind.
        self.0.lock().unwrap_or_else(PoisonError::into_inner)
    }
}
