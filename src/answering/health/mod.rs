//! Detects what is wrong around the node, logs when it begins and ends, and shows it in `/diagnostics` in between.
//!
//! `watch` detects faults, `arrivals` silent topics, `faults` keeps and logs them. `stamp_age` checks stamps, `residuals` frames that disagree and
//! sigmas, `attitude` mount and nominal attitude; `latency` keeps quantiles. Time is an argument, so that tests need no
//! clock.

mod arrivals;
mod attitude;
mod faults;
mod latency;
mod refusals;
mod residuals;
mod stamp_age;
mod watch;

pub use attitude::{Attitude, Unexpected};
pub use faults::{Fault, Faults};
pub use latency::{Latency, WINDOW_S};
pub use refusals::fault_of;
pub use residuals::Residuals;
pub use stamp_age::{ImageAge, StampAge};
pub use watch::{Second, Watch};

pub use ros2_node::clock::ClockSilence;
pub use ros2_node::jump::{Jumps, seconds_between};
pub use ros2_node::system_clock::{SystemClock, both_clocks};
