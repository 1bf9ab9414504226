//! The node's time: the system's, or a simulation's.

use std::sync::{Arc, Mutex, MutexGuard, PoisonError};
use std::time::{Instant, SystemTime, UNIX_EPOCH};

use super::jump::Jumps;
use super::messages::Time;

/// Time as all of the node sees it.
#[derive(Debug, Clone, Default)]
pub struct NodeClock {
    /// The simulated time while `use_sim_time` is set.
    simulated: Arc<Mutex<Option<Simulated>>>,
}

/// A silence of simulated time.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct ClockSilence {
    /// When the last one arrived, or since when it is enabled.
    pub since: Instant,
    /// Whether one ever arrived.
    pub ever: bool,
}

#[derive(Debug)]
struct Simulated {
    /// None until the first one.
    time: Option<Time>,
    /// When it arrived, or since when it is enabled.
    since: Instant,
    jumps: Jumps,
    /// The last jump that was not yet taken.
    jump: Option<String>,
}

impl NodeClock {
    /// Returns the node's time; while it is simulated, zero until the first `/clock`, as in all of ROS.
    #[must_use]
    pub fn now(&self) -> Time {
        match &*self.lock() {
            Some(simulated) => simulated.time.unwrap_or_default(),
            None => system_time(),
        }
    }

    /// Starts or ends simulated time; false when that changes nothing.
    #[must_use]
    pub fn simulate(&self, on: bool, now: Instant) -> bool {
        let mut simulated = self.lock();
        let changes = on != simulated.is_some();
        if changes {
            *simulated = on.then(|| Simulated {
                time: None,
                since: now,
                jumps: Jumps::default(),
                jump: None,
            });
        }
        changes
    }

    /// Takes a simulated time, if that is wanted.
    pub fn set(&self, time: Time, now: Instant) {
        if let Some(simulated) = self.lock().as_mut() {
            simulated.time = Some(time);
            simulated.since = now;
            let jump = simulated.jumps.take(time, now);
            simulated.jump = jump.or(simulated.jump.take());
        }
    }

    /// Returns how the simulated time has jumped since this was asked last, if it has.
    #[must_use]
    pub fn take_jump(&self) -> Option<String> {
        self.lock().as_mut().and_then(|s| s.jump.take())
    }

    /// Returns since when simulated time is enabled and has not arrived; `None` while time is the system's.
    #[must_use]
    pub fn silence(&self) -> Option<ClockSilence> {
        self.lock().as_ref().map(|simulated| ClockSilence {
            since: simulated.since,
            ever: simulated.time.is_some(),
        })
    }

    fn lock(&self) -> MutexGuard<'_, Option<Simulated>> {
        // Nothing in here can panic between two fields.
        self.simulated
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
    }
}

fn system_time() -> Time {
    let since_epoch = SystemTime::now()
        .duration_since(UNIX_EPOCH)
        .unwrap_or_default();
    Time {
        sec: i32::try_from(since_epoch.as_secs()).unwrap_or(i32::MAX),
        nanosec: since_epoch.subsec_nanos(),
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::*;

    #[test]
    fn simulated_time_is_zero_until_it_comes_and_holds_only_while_it_is_wanted() {
        let clock = NodeClock::default();
        let (time, now) = (Time { sec: 7, nanosec: 8 }, Instant::now());
        clock.set(time, now);
        assert!(clock.now().sec > 1_000_000_000, "the system's");

        assert!(clock.simulate(true, now));
        assert_eq!(clock.now(), Time::default());
        assert_eq!(
            clock.silence(),
            Some(ClockSilence {
                since: now,
                ever: false
            })
        );
        let later = now + Duration::from_secs(1);
        clock.set(time, later);
        assert!(!clock.simulate(true, now));
        assert_eq!(clock.now(), time, "wanted twice is wanted once");
        assert_eq!(clock.take_jump(), None);
        assert_eq!(
            clock.silence(),
            Some(ClockSilence {
                since: later,
                ever: true
            })
        );
        clock.set(Time { sec: 6, nanosec: 8 }, later);
        assert_eq!(clock.take_jump().as_deref(), Some("back by 1.000 s"));
        assert_eq!(clock.take_jump(), None, "it is told once");

        assert!(clock.simulate(false, now));
        assert!(clock.now().sec > 1_000_000_000);
        assert_eq!(clock.silence(), None);
    }
}
