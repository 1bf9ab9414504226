//! Protection levels as a message.

use super::vector;
use crate::integrity::{FrameIntegrity, Hypothesis, IntegrityMonitor, PointIntegrity, Unavailable};
use crate::messages::{Header, Integrity, IntegrityPoint};
use crate::pipeline::IntegrityState;

/// Returns the message of the protection levels of a frame and of the track, or of the reasons for none.
///
/// # Inputs
/// * `track`: at the stamp of the frame.
/// * `mode`: names a mode of the error budget by its place.
#[must_use]
pub fn integrity(
    header: Header,
    monitor: &IntegrityMonitor,
    frame: &Result<FrameIntegrity, Unavailable>,
    track: &Result<FrameIntegrity, Unavailable>,
    mode: impl Fn(usize) -> String,
) -> Integrity {
    Integrity {
        header,
        state: IntegrityState::from(frame).number(),
        message: message(monitor, frame, &mode),
        hmi_probability: monitor.settings().hmi_probability,
        unmonitored_probability: unmonitored(frame),
        points: points(monitor, frame, &mode),
        track_state: IntegrityState::from(track).number(),
        track_message: message(monitor, track, &mode),
        track_unmonitored_probability: unmonitored(track),
        track_points: points(monitor, track, &mode),
    }
}

fn message(
    monitor: &IntegrityMonitor,
    levels: &Result<FrameIntegrity, Unavailable>,
    mode: impl Fn(usize) -> String,
) -> String {
    match levels {
        Ok(found) => found
            .above_limit
            .as_ref()
            .map_or_else(String::new, |above| {
                let point = &monitor.points()[above.point].name;
                above.in_words(point, &mode)
            }),
        Err(reason) => reason.in_words(&mode),
    }
}

fn unmonitored(levels: &Result<FrameIntegrity, Unavailable>) -> f64 {
    let levels = levels.as_ref();
    levels.map_or(f64::NAN, |found| found.unmonitored_probability)
}

fn points(
    monitor: &IntegrityMonitor,
    levels: &Result<FrameIntegrity, Unavailable>,
    mode: impl Fn(usize) -> String,
) -> Vec<IntegrityPoint> {
    let vector = |numbers: [f64; 3]| vector(&numbers.into());
    let points = monitor.points().iter().enumerate();
    let points = points.map(|(index, declared)| {
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
    points.collect()
}
