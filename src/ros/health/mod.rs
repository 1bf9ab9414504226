//! Detects what is wrong around the node, logs when it begins and ends, and shows it in `/diagnostics` in between.
//!
//! `watch` notices, `faults` remembers and says. `jump` and `stamp_age` judge stamps, `suspects` markers, `residuals`
//! frames that are not trusted, `attitude` mount and nominal attitude, `system_clock` the system's time; `latency` keeps
//! quantiles. Time is an argument, so that tests need no clock.

mod attitude;
mod faults;
mod jump;
mod latency;
mod refusals;
mod residuals;
mod stamp_age;
mod suspects;
mod system_clock;
mod watch;

pub use attitude::{Attitude, Unexpected};
pub use faults::{Fault, Faults};
pub use jump::{Jumps, seconds_between};
pub use latency::{Latency, WINDOW_S};
pub use refusals::fault_of;
pub use residuals::{Doubtful, Residuals};
pub use stamp_age::{ImageAge, StampAge};
pub use suspects::Suspects;
pub use system_clock::{SystemClock, both_clocks};
pub use watch::{ClockSilence, Second, Watch};
