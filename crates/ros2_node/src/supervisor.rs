//! What systemd is told of a node that it runs as a service of `Type=notify`: ready, alive, ending.
//!
//! Nothing happens without the variables that systemd sets (`NOTIFY_SOCKET`, `WATCHDOG_USEC`).

use std::time::{Duration, Instant};

use sd_notify::NotifyState;

/// The service manager, if there is one.
#[derive(Debug)]
pub struct Supervisor {
    /// Signs of life are this far apart; `None`: nobody waits for them.
    pace: Option<Duration>,
    last: Option<Instant>,
}

impl Supervisor {
    /// Returns the one that the environment names.
    #[must_use]
    pub fn from_process() -> Self {
        Self::with_watchdog(sd_notify::watchdog_enabled())
    }

    /// Returns one that ends a process which is silent for `patience`.
    fn with_watchdog(patience: Option<Duration>) -> Self {
        Self {
            // Half of it, as sd_watchdog_enabled(3) recommends.
            pace: patience.map(|patience| patience / 2),
            last: None,
        }
    }

    /// Says that the node answers.
    pub fn ready(&self) {
        tell(NotifyState::Ready);
    }

    /// Gives a sign of life if one is due. Called by the loop that does the node's work, so that one that hangs is noticed.
    pub fn alive(&mut self, now: Instant) {
        if self.is_due(now) {
            self.last = Some(now);
            tell(NotifyState::Watchdog);
        }
    }

    /// Says that the node ends.
    pub fn stopping(&self) {
        tell(NotifyState::Stopping);
    }

    fn is_due(&self, now: Instant) -> bool {
        self.pace.is_some_and(|pace| {
            self.last
                .is_none_or(|last| now.saturating_duration_since(last) >= pace)
        })
    }
}

fn tell(state: NotifyState<'_>) {
    if let Err(error) = sd_notify::notify(&[state]) {
        // A watchdog that hears nothing ends the node: the log should say why.
        log::warn!(
            "the service manager (NOTIFY_SOCKET) cannot be told of this node's state: {error}"
        );
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn without_a_watchdog_no_sign_of_life_is_due() {
        assert!(!Supervisor::with_watchdog(None).is_due(Instant::now()));
    }

    #[test]
    fn signs_of_life_are_half_of_the_watchdogs_patience_apart() {
        let mut supervisor = Supervisor::with_watchdog(Some(Duration::from_secs(3)));
        let start = Instant::now();
        assert!(supervisor.is_due(start));
        supervisor.last = Some(start);
        assert!(!supervisor.is_due(start + Duration::from_millis(1499)));
        assert!(supervisor.is_due(start + Duration::from_millis(1500)));
    }
}
