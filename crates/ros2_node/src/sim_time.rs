//! Simulated time, from the topic that simulators and players of recordings publish it on.

use std::time::Instant;

use futures::{StreamExt, pin_mut};
use ros2_client::Subscription;

use super::clock::NodeClock;
use super::messages::Clock;
use super::once::SaidOnce;
use super::participant::{EndpointError, QosProfile, RosNode, sensor_data};

/// Where simulators publish their time.
const CLOCK: &str = "/clock";
/// As rclcpp has it: only the latest time counts.
const LATEST: QosProfile = sensor_data(1);

/// Listens to `/clock` from when `use_sim_time` is set for the first time.
///
/// ros2-client has a subscription of its own to that topic, with a type that is never published.
pub struct SimTime {
    clock: NodeClock,
    // Kept once it is there: peers on Fast DDS do not notice that a single subscription has ended.
    listener: Option<smol::Task<()>>,
}

impl SimTime {
    /// Returns the switch of this clock; off.
    #[must_use]
    pub const fn new(clock: NodeClock) -> Self {
        Self {
            clock,
            listener: None,
        }
    }

    /// Takes the time from `/clock` from now on, or no longer.
    ///
    /// # Errors
    /// [`EndpointError`] when the middleware refuses the subscription.
    pub fn follow(&mut self, ros: &mut RosNode, on: bool) -> Result<(), EndpointError> {
        if on && self.listener.is_none() {
            let subscription = ros.subscription(CLOCK, &LATEST)?;
            self.listener = Some(smol::spawn(listen(subscription, self.clock.clone())));
        }
        if self.clock.simulate(on, Instant::now()) {
            let source = if on { CLOCK } else { "the system" };
            log::info!("time comes from {source}");
        }
        Ok(())
    }

    /// Ends the subscription, which has to be gone before the node is.
    pub fn close(self) {
        if let Some(listener) = self.listener {
            smol::block_on(listener.cancel());
        }
    }
}

async fn listen(subscription: Subscription<Clock>, clock: NodeClock) {
    let mut bad_samples = SaidOnce::default();
    let samples = subscription.async_stream();
    pin_mut!(samples);
    loop {
        let fault = match samples.select_next_some().await {
            Ok((Clock { clock: time }, _)) if time.nanosec < 1_000_000_000 => {
                clock.set(time, Instant::now());
                continue;
            }
            Ok((Clock { clock: time }, _)) => {
                format!("nanosec must be below 1000000000, got {}", time.nanosec)
            }
            Err(error) => error.to_string(),
        };
        if bad_samples.fault((), Instant::now()) {
            log::warn!("ignoring a message on {CLOCK}: {fault}");
        }
    }
}
