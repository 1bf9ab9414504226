//! What a filter believes: a track or a candidate for one, and a rival of it.

use super::follower::Follower;
use super::state::State;

/// Everything that the next frame is held against.
#[derive(Debug, PartialEq, Default)]
pub(super) struct Belief<F: Follower> {
    pub(super) state: Option<State<F>>,
    /// What the frames say that the gate refuses, one after the other: a track of their own, if they agree.
    pub(super) challenger: Option<State<F>>,
}

impl<F: Follower> Clone for Belief<F> {
    fn clone(&self) -> Self {
        Self {
            state: self.state.clone(),
            challenger: self.challenger.clone(),
        }
    }

    fn clone_from(&mut self, source: &Self) {
        self.state.clone_from(&source.state);
        self.challenger.clone_from(&source.challenger);
    }
}
