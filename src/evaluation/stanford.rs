//! Protection levels against errors: what a Stanford diagram shows.

use std::collections::BTreeMap;

use nalgebra::Vector3;

use super::align::Compared;
use super::gather::Gathered;
use super::outcomes::integrity_states;
use super::report::{IntegrityReport, LEVEL_AXES, StanfordReport};
use super::settings::{ProtectedPoint, Settings};
use super::statistics::proportion_interval;
use crate::messages::Integrity;
use crate::pipeline::{IntegrityState, Stamp};

/// A level with the error that it bounds, along one axis of one point.
#[derive(Debug, Clone, Copy, PartialEq)]
#[expect(clippy::struct_field_names, reason = "the unit belongs to each name")]
pub(super) struct Bounded {
    pub(super) error_m: f64,
    pub(super) level_m: f64,
    /// `None`: not stated.
    pub(super) limit_m: Option<f64>,
}

/// The levels of one point along one axis.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Diagram {
    pub(super) point: String,
    pub(super) axis: usize,
    pub(super) frames: Vec<Bounded>,
}

/// Returns the levels that have a pose and a truth of the same stamp.
pub(super) fn diagrams(
    found: &Gathered,
    compared: &[Compared],
    settings: &Settings,
) -> Vec<Diagram> {
    let by_stamp: BTreeMap<i64, &Compared> = compared
        .iter()
        .map(|frame| (frame.stamp_ns, frame))
        .collect();
    let mut diagrams: Vec<Diagram> = Vec::new();
    for message in &found.integrity {
        let stamp_ns = Stamp::from(message.header.stamp).nanoseconds();
        let Some(frame) = by_stamp.get(&stamp_ns) else {
            continue;
        };
        for levels in &message.points {
            let place = settings
                .points
                .iter()
                .find(|point| point.name == levels.name);
            let Some(place) = place else { continue };
            let error = point_error(frame, place, settings);
            let vector = |v: &crate::messages::Vector3| [v.x, v.y, v.z];
            let (level, limit) = (
                vector(&levels.protection_level),
                vector(&levels.alert_limit),
            );
            for axis in 0..LEVEL_AXES.len() {
                if !(level[axis].is_finite() && level[axis] > 0.0) {
                    continue;
                }
                let bounded = Bounded {
                    error_m: error[axis].abs(),
                    level_m: level[axis],
                    limit_m: Some(limit[axis]).filter(|limit| limit.is_finite()),
                };
                let known =
                    |diagram: &&mut Diagram| diagram.point == levels.name && diagram.axis == axis;
                match diagrams.iter_mut().find(known) {
                    Some(diagram) => diagram.frames.push(bounded),
                    None => diagrams.push(Diagram {
                        point: levels.name.clone(),
                        axis,
                        frames: vec![bounded],
                    }),
                }
            }
        }
    }
    diagrams
}

/// Returns how far a point is from where the pose has it: ahead, left, up in the receiver, m.
fn point_error(frame: &Compared, place: &ProtectedPoint, settings: &Settings) -> Vector3<f64> {
    let true_point = frame.truth * place.point_in_tanker;
    let found_point = frame.estimate * place.point_in_tanker;
    settings.receiver_from_camera * (true_point - found_point)
}

/// Returns the names of points that have levels, but no place in the map or the refuelling file given.
pub(super) fn unknown_points(messages: &[Integrity], settings: &Settings) -> Vec<String> {
    let mut unknown: Vec<String> = messages
        .iter()
        .flat_map(|message| &message.points)
        .map(|point| &point.name)
        .filter(|name| settings.points.iter().all(|point| point.name != **name))
        .cloned()
        .collect();
    unknown.sort_unstable();
    unknown.dedup();
    unknown
}

/// Returns the counts of states and of each diagram; `None` without messages.
pub(super) fn integrity_report(
    messages: &[Integrity],
    diagrams: &[Diagram],
) -> Option<IntegrityReport> {
    if messages.is_empty() {
        return None;
    }
    let available = |message: &&Integrity| message.state == IntegrityState::Available.number();
    let available = messages.iter().filter(available).count();
    Some(IntegrityReport {
        frames: messages.len() as u64,
        states: integrity_states(messages),
        availability: available as f64 / messages.len() as f64,
        stanford: diagrams.iter().map(Diagram::report).collect(),
    })
}

impl Diagram {
    fn report(&self) -> StanfordReport {
        let mut report = StanfordReport {
            point: crate::text::clip(&self.point),
            axis: LEVEL_AXES[self.axis].to_owned(),
            frames: self.frames.len() as u64,
            alert_limit_m: self.frames.last().and_then(|frame| frame.limit_m),
            nominal: 0,
            unavailable: 0,
            misleading: 0,
            hazardous: 0,
            unavailable_and_misleading: 0,
            largest_ratio: 0.0,
            exceeding_at_most_if_independent: None,
        };
        for frame in &self.frames {
            let exceeds = frame.error_m > frame.level_m;
            let is_beyond = |value: f64| frame.limit_m.is_some_and(|limit| value > limit);
            let count = match (is_beyond(frame.level_m), exceeds) {
                (true, true) => &mut report.unavailable_and_misleading,
                (true, false) => &mut report.unavailable,
                (false, true) if is_beyond(frame.error_m) => &mut report.hazardous,
                (false, true) => &mut report.misleading,
                (false, false) => &mut report.nominal,
            };
            *count += 1;
            report.largest_ratio = report.largest_ratio.max(frame.error_m / frame.level_m);
        }
        let exceeding = report.beyond_level();
        report.exceeding_at_most_if_independent =
            proportion_interval(exceeding as f64, self.frames.len() as f64).map(|[_, high]| high);
        report
    }
}
