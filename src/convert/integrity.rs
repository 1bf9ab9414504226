//! Protection levels as a message.

use super::vector;
use crate::integrity::{FrameIntegrity, Hypothesis, IntegrityMonitor, PointIntegrity, Unavailable};
use crate::messages::{Header, Integrity, IntegrityPoint};
use crate::pipeline::IntegrityState;

/// Returns the message of a frame's protection levels, or of the reason for none.
///
/// # Inputs
/// * `mode`: names a mode of the error budget by its place.
#[must_use]
pub fn integrity(
    header: Header,
    monitor: &IntegrityMonitor,
    levels: &Result<FrameIntegrity, Unavailable>,
    mode: impl Fn(usize) -> String,
) -> Integrity {
    let message = match levels {
        Ok(found) => found.above_limit.as_ref().map(|above| {
            let point = &monitor.points()[above.point].name;
            above.in_words(point, &mode)
        }),
        Err(reason) => Some(reason.in_words(&mode)),
    };
    let vector = |numbers: [f64; 3]| vector(&numbers.into());
    let points = monitor
        .points()
        .iter()
        .enumerate()
        .map(|(index, declared)| {
            let found = levels
                .as_ref()
                .ok()
                .and_then(|found| found.points.get(index));
            let numbers = |of: fn(&PointIntegrity) -> [f64; 3]| found.map_or([f64::NAN; 3], of);
            let name = |fault: Option<Hypothesis>| {
                fault.map_or_else(String::new, |fault| fault.in_words(&mode))
            };
            IntegrityPoint {
                name: declared.name.clone(),
                protection_level: vector(numbers(|found| found.level_m)),
                sigma: vector(numbers(|found| found.sigma_m)),
                alert_limit: vector(declared.alert_limit_m.unwrap_or([f64::NAN; 3])),
                weakest: found.map_or_else(Default::default, |found| found.weakest.map(name)),
            }
        });
    Integrity {
        header,
        state: IntegrityState::from(levels).number(),
        message: message.unwrap_or_default(),
        hmi_probability: monitor.settings().hmi_probability,
        unmonitored_probability: levels
            .as_ref()
            .map_or(f64::NAN, |found| found.unmonitored_probability),
        points: points.collect(),
    }
}
