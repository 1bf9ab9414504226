//! `lifecycle_msgs`: managed nodes on the wire.

use serde::{Deserialize, Serialize};

/// A request without fields, which on the wire has one.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct EmptyRequest {
    /// Nothing.
    pub structure_needs_at_least_one_member: u8,
}

/// `lifecycle_msgs/State`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LifecycleState {
    /// Its number.
    pub id: u8,
    /// Its name.
    pub label: String,
}

/// `lifecycle_msgs/Transition`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct LifecycleTransition {
    /// Its number.
    pub id: u8,
    /// Its name.
    pub label: String,
}

/// `lifecycle_msgs/TransitionDescription`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TransitionDescription {
    /// The transition.
    pub transition: LifecycleTransition,
    /// The state before.
    pub start_state: LifecycleState,
    /// The state after.
    pub goal_state: LifecycleState,
}

/// `lifecycle_msgs/TransitionEvent`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct TransitionEvent {
    /// When, ns.
    pub timestamp: u64,
    /// The transition.
    pub transition: LifecycleTransition,
    /// Where it began.
    pub start_state: LifecycleState,
    /// Where it ended.
    pub goal_state: LifecycleState,
}

/// Request of `ChangeState`.
#[derive(Debug, Clone, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ChangeStateRequest {
    /// The transition, by label if there is one, else by id.
    pub transition: LifecycleTransition,
}

/// Response of `ChangeState`.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
pub struct ChangeStateResponse {
    /// Whether it was made.
    pub success: bool,
}
