//! The times that the node's work reads.

use std::cell::Cell;
use std::rc::Rc;
use std::time::{Duration, Instant};

use crate::messages::Time;
use ros2_node::clock::NodeClock;

/// The node's time, and one that only ever advances: of this process, or of a recording.
#[derive(Debug, Clone)]
pub struct Clock {
    node: NodeClock,
    recorded: Option<Recorded>,
}

/// The time of a recording. All clones of a clock share it.
#[derive(Debug, Clone)]
struct Recorded {
    /// Stands for the first time; only differences to it are ever used.
    start: Instant,
    first_ns: Rc<Cell<Option<u64>>>,
    now: Rc<Cell<Instant>>,
}

impl Clock {
    /// Returns the clock of a node that runs.
    #[must_use]
    pub const fn live(node: NodeClock) -> Self {
        Self {
            node,
            recorded: None,
        }
    }

    /// Returns a clock that stands still except for [`Self::advance`].
    #[must_use]
    pub fn recorded() -> Self {
        let (node, start) = (NodeClock::default(), Instant::now());
        let _ = node.simulate(true, start);
        Self {
            node,
            recorded: Some(Recorded {
                start,
                first_ns: Rc::default(),
                now: Rc::new(Cell::new(start)),
            }),
        }
    }

    /// Advances the time of a recording to this one, ns since 1970; one that lies back changes nothing.
    pub fn advance(&self, to_ns: u64) {
        let Some(recorded) = &self.recorded else {
            return;
        };
        let first_ns = recorded.first_ns.get().unwrap_or(to_ns);
        recorded.first_ns.set(Some(first_ns));
        let elapsed = Duration::from_nanos(to_ns.saturating_sub(first_ns));
        let before = recorded.now.get();
        let now = recorded.start.checked_add(elapsed).unwrap_or(before);
        if now > before || self.node.now() == Time::default() {
            recorded.now.set(now.max(before));
            self.node.set(time(to_ns), now.max(before));
        }
    }

    /// Returns a time to measure intervals with.
    #[must_use]
    pub fn now(&self) -> Instant {
        let recorded = self.recorded.as_ref();
        recorded.map_or_else(Instant::now, |recorded| recorded.now.get())
    }

    /// The node's time, which stamps are compared with.
    #[must_use]
    pub const fn node(&self) -> &NodeClock {
        &self.node
    }

    /// Returns whether it is that of a process: then the system's clock matters too.
    #[must_use]
    pub const fn is_live(&self) -> bool {
        self.recorded.is_none()
    }
}

/// Returns a time as messages have it.
#[must_use]
pub fn time(ns: u64) -> Time {
    const SECOND_NS: u64 = 1_000_000_000;
    Time {
        sec: i32::try_from(ns / SECOND_NS).unwrap_or(i32::MAX),
        nanosec: u32::try_from(ns % SECOND_NS).unwrap_or(0),
    }
}
