//! What became of the frames: poses and refusals, modes of the budget, integrity states.

use std::collections::BTreeMap;

use super::consistency::{root_mean_square, seconds};
use super::report::{Count, ModeReport, OutcomeReport};
use crate::messages::{EstimatorStatus, Integrity};
use crate::pipeline::{IntegrityState, OutcomeCode, Stamp};

/// Returns the name of an outcome; of a number that this version does not know, the number.
pub(super) fn outcome_name(number: u8) -> String {
    let known = OutcomeCode::ALL.iter().find(|code| code.number() == number);
    known.map_or_else(
        || format!("UNKNOWN_{number}"),
        |code| code.name().to_owned(),
    )
}

/// Returns how frames ended; `None` without statuses.
pub(super) fn outcome_report(statuses: &[EstimatorStatus]) -> Option<OutcomeReport> {
    if statuses.is_empty() {
        return None;
    }
    let mut counts: BTreeMap<u8, u64> = BTreeMap::new();
    let mut rejected: BTreeMap<u32, u64> = BTreeMap::new();
    for status in statuses {
        *counts.entry(status.outcome).or_default() += 1;
        for id in &status.rejected_ids {
            *rejected.entry(*id).or_default() += 1;
        }
    }
    let with_pose = counts
        .get(&OutcomeCode::Ok.number())
        .copied()
        .unwrap_or_default();
    let mut named: Vec<Count> = counts
        .into_iter()
        .map(|(number, count)| Count {
            name: outcome_name(number),
            count,
        })
        .collect();
    // Stable: of equal counts the lower number first.
    named.sort_by_key(|count| std::cmp::Reverse(count.count));
    Some(OutcomeReport {
        frames: statuses.len() as u64,
        with_pose,
        counts: named,
        longest_without_pose_s: longest_without(statuses),
        rejected_markers: rejected
            .into_iter()
            .map(|(id, count)| Count {
                name: id.to_string(),
                count,
            })
            .collect(),
    })
}

/// Returns the longest time between two poses in a row, or from the first and to the last status; s.
fn longest_without(statuses: &[EstimatorStatus]) -> Option<f64> {
    let mut stamps: Vec<(i64, bool)> = statuses
        .iter()
        .map(|status| {
            let stamp_ns = Stamp::from(status.header.stamp).nanoseconds();
            (stamp_ns, status.outcome == OutcomeCode::Ok.number())
        })
        .filter(|(stamp_ns, _)| *stamp_ns > 0)
        .collect();
    stamps.sort_unstable();
    let (first, last) = (stamps.first()?.0, stamps.last()?.0);
    let posed = stamps.iter().filter(|(_, posed)| *posed);
    let mut before = first;
    let mut longest = 0;
    for stamp_ns in posed.map(|(stamp_ns, _)| *stamp_ns).chain([last]) {
        longest = longest.max(stamp_ns - before);
        before = stamp_ns;
    }
    Some(seconds(longest))
}

/// Returns the modes of the budget as the statuses estimate them, in the order in which they first appear.
pub(super) fn mode_reports(statuses: &[EstimatorStatus]) -> Vec<ModeReport> {
    let mut names: Vec<&str> = Vec::new();
    let mut values: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut dominant: BTreeMap<&str, u64> = BTreeMap::new();
    for status in statuses {
        *dominant.entry(&status.dominant_cause).or_default() += 1;
        for (name, amplitude) in status.mode_names.iter().zip(&status.mode_amplitudes) {
            if !amplitude.is_finite() {
                continue;
            }
            if !values.contains_key(name.as_str()) {
                names.push(name);
            }
            values.entry(name).or_default().push(*amplitude);
        }
    }
    names
        .into_iter()
        .filter_map(|name| {
            let found = values.get(name)?;
            let count = found.len();
            Some(ModeReport {
                name: crate::text::clip(name),
                frames: count as u64,
                mean_sigmas: found.iter().sum::<f64>() / count as f64,
                rms_sigmas: root_mean_square(found.iter().copied())?,
                max_abs_sigmas: found.iter().fold(0.0, |most, value| value.abs().max(most)),
                dominant_frames: dominant.get(name).copied().unwrap_or_default(),
            })
        })
        .collect()
}

/// Returns how many frames had each integrity state, in the order of the constants.
pub(super) fn integrity_states(messages: &[Integrity]) -> Vec<Count> {
    let count = |number: u8| {
        let found = messages.iter().filter(|message| message.state == number);
        found.count() as u64
    };
    let known = IntegrityState::ALL.iter().map(|state| Count {
        name: state.name().to_owned(),
        count: count(state.number()),
    });
    let all: u64 = messages.len() as u64;
    let mut counts: Vec<Count> = known.collect();
    let unknown = all - counts.iter().map(|count| count.count).sum::<u64>();
    if unknown > 0 {
        counts.push(Count {
            name: "UNKNOWN".to_owned(),
            count: unknown,
        });
    }
    counts
}
