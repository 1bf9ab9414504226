//! The states of a managed node and the transitions between them: as in the services' answers,
//! in the numbers, words and order of `rcl_lifecycle`.

/// The state of a managed node.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
#[expect(missing_docs, reason = "the names are those of lifecycle_msgs/State")]
pub enum State {
    Unknown,
    Unconfigured,
    Inactive,
    Active,
    Finalized,
    Configuring,
    CleaningUp,
    ShuttingDown,
    Activating,
    Deactivating,
    ErrorProcessing,
}

impl State {
    /// All of them; primary states first.
    pub const ALL: [Self; 11] = [
        Self::Unknown,
        Self::Unconfigured,
        Self::Inactive,
        Self::Active,
        Self::Finalized,
        Self::Configuring,
        Self::CleaningUp,
        Self::ShuttingDown,
        Self::Activating,
        Self::Deactivating,
        Self::ErrorProcessing,
    ];

    /// Returns its number in `lifecycle_msgs/State`.
    #[must_use]
    pub const fn id(self) -> u8 {
        match self {
            Self::Unknown => 0,
            Self::Unconfigured => 1,
            Self::Inactive => 2,
            Self::Active => 3,
            Self::Finalized => 4,
            Self::Configuring => 10,
            Self::CleaningUp => 11,
            Self::ShuttingDown => 12,
            Self::Activating => 13,
            Self::Deactivating => 14,
            Self::ErrorProcessing => 15,
        }
    }

    /// Returns its name.
    #[must_use]
    pub const fn label(self) -> &'static str {
        match self {
            Self::Unknown => "unknown",
            Self::Unconfigured => "unconfigured",
            Self::Inactive => "inactive",
            Self::Active => "active",
            Self::Finalized => "finalized",
            Self::Configuring => "configuring",
            Self::CleaningUp => "cleaningup",
            Self::ShuttingDown => "shuttingdown",
            Self::Activating => "activating",
            Self::Deactivating => "deactivating",
            Self::ErrorProcessing => "errorprocessing",
        }
    }

    /// Returns the transitions from this state.
    pub fn transitions(self) -> impl Iterator<Item = &'static Transition> {
        GRAPH
            .iter()
            .filter(move |transition| transition.start == self)
    }

    /// Returns the transition that is asked for: by its label if there is one, else by its id.
    #[must_use]
    pub fn asked(self, id: u8, label: &str) -> Option<&'static Transition> {
        self.transitions().find(|transition| {
            if label.is_empty() {
                transition.id == id
            } else {
                transition.label == label
            }
        })
    }

    /// Returns where the work of this state leads to; `None` for a state that has no work.
    #[must_use]
    pub fn after(self, result: WorkResult) -> Option<&'static Transition> {
        let label = match result {
            WorkResult::Success => SUCCESS,
            WorkResult::Failure => FAILURE,
            WorkResult::Error => ERROR,
        };
        self.asked(0, label)
    }
}

/// The result of the work of a transition.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum WorkResult {
    /// It succeeded.
    Success,
    /// It failed and changed nothing.
    Failure,
    /// It failed part way; error processing follows.
    Error,
}

/// A step from one state to the next.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Transition {
    /// Its number in `lifecycle_msgs/Transition`.
    pub id: u8,
    /// Its name, the same for several of them.
    pub label: &'static str,
    /// The state before.
    pub start: State,
    /// The state after.
    pub goal: State,
}

const SUCCESS: &str = "transition_success";
const FAILURE: &str = "transition_failure";
const ERROR: &str = "transition_error";

const fn step(id: u8, label: &'static str, start: State, goal: State) -> Transition {
    Transition {
        id,
        label,
        start,
        goal,
    }
}

/// All transitions.
pub const GRAPH: [Transition; 25] = {
    use State::{
        Activating, Active, CleaningUp, Configuring, Deactivating, ErrorProcessing, Finalized,
        Inactive, ShuttingDown, Unconfigured,
    };
    [
        step(1, "configure", Unconfigured, Configuring),
        step(10, SUCCESS, Configuring, Inactive),
        step(11, FAILURE, Configuring, Unconfigured),
        step(12, ERROR, Configuring, ErrorProcessing),
        step(2, "cleanup", Inactive, CleaningUp),
        step(20, SUCCESS, CleaningUp, Unconfigured),
        step(21, FAILURE, CleaningUp, Inactive),
        step(22, ERROR, CleaningUp, ErrorProcessing),
        step(3, "activate", Inactive, Activating),
        step(30, SUCCESS, Activating, Active),
        step(31, FAILURE, Activating, Inactive),
        step(32, ERROR, Activating, ErrorProcessing),
        step(4, "deactivate", Active, Deactivating),
        step(40, SUCCESS, Deactivating, Inactive),
        step(41, FAILURE, Deactivating, Active),
        step(42, ERROR, Deactivating, ErrorProcessing),
        step(5, "shutdown", Unconfigured, ShuttingDown),
        step(6, "shutdown", Inactive, ShuttingDown),
        step(7, "shutdown", Active, ShuttingDown),
        step(50, SUCCESS, ShuttingDown, Finalized),
        step(51, FAILURE, ShuttingDown, Finalized),
        step(52, ERROR, ShuttingDown, ErrorProcessing),
        step(60, SUCCESS, ErrorProcessing, Unconfigured),
        step(61, FAILURE, ErrorProcessing, Finalized),
        step(62, ERROR, ErrorProcessing, Finalized),
    ]
};

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_work_ends_whatever_comes_of_it_and_lasting_states_have_none() {
        for state in State::ALL {
            let works = state.id() >= State::Configuring.id();
            for result in [WorkResult::Success, WorkResult::Failure, WorkResult::Error] {
                assert_eq!(state.after(result).is_some(), works, "{state:?} {result:?}");
            }
        }
    }

    #[test]
    fn label_goes_before_id() {
        let inactive = State::Inactive;
        let goal = |id, label| inactive.asked(id, label).map(|t| t.goal);
        assert_eq!(goal(3, ""), Some(State::Activating));
        assert_eq!(goal(3, "cleanup"), Some(State::CleaningUp));
        assert_eq!(goal(6, ""), Some(State::ShuttingDown));
        assert_eq!(goal(0, "shutdown"), Some(State::ShuttingDown));
        assert_eq!(goal(7, ""), None, "that is the shutdown of an active node");
        assert_eq!(goal(3, "configure"), None);
    }
}
