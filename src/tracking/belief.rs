//! What a filter believes: a track or a candidate for one, and a rival of it.

use super::lag::Lag;
use super::lasting::Lasting;
use super::track::Track;
use crate::geometry::Motion;

/// A track, or a candidate for one.
#[derive(Debug, PartialEq)]
pub(super) struct State {
    pub(super) motion: StateMotion,
    pub(super) lasting: Lasting,
}

/// The part of a state that has one size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct StateMotion {
    pub(super) stamp_ns: i64,
    /// Its covariance is that given the lasting causes.
    pub(super) given_causes: Motion,
    pub(super) consistent_frames: u32,
    pub(super) lag: Lag,
}

impl State {
    /// Returns the motion with its whole covariance.
    pub(super) fn track(&self) -> Track {
        let mut motion = self.motion.given_causes;
        self.lasting.add_to(&mut motion.covariance);
        Track {
            stamp_ns: self.motion.stamp_ns,
            motion,
        }
    }
}

impl Clone for State {
    fn clone(&self) -> Self {
        Self {
            motion: self.motion,
            lasting: self.lasting.clone(),
        }
    }

    // Beliefs are copied for every frame: the memory is used again.
    fn clone_from(&mut self, source: &Self) {
        self.motion = source.motion;
        self.lasting.clone_from(&source.lasting);
    }
}

/// Everything that the next frame is held against.
#[derive(Debug, PartialEq, Default)]
pub(super) struct Belief {
    pub(super) state: Option<State>,
    /// What the frames say that the gate refuses, one after the other: a track of their own, if they agree.
    pub(super) challenger: Option<State>,
}

impl Clone for Belief {
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
