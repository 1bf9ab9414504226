//! Stamps and log times: jitter, gaps, order, clocks, delays.

use std::collections::BTreeMap;

use super::consistency::seconds;
use super::gather::{Gathered, Heard, Times};
use super::report::{LatencyReport, StampReport};
use super::statistics::{Quantiles, quantile};
use super::topics::Role;

/// A distance of this many periods is a gap.
const GAP_PERIODS: f64 = 1.5;

/// Returns the delays between stamps, detections, poses and statuses.
pub(super) fn latency_report(found: &Gathered) -> LatencyReport {
    let offsets = |role| {
        let times = &found.heard.get(&role)?.times;
        let differs = times.iter().any(|time| time.stamp_ns != time.log_ns);
        let valid = times.iter().filter(|time| time.stamp_ns > 0);
        let each = valid.map(|time| seconds(time.log_ns.saturating_sub(time.stamp_ns)));
        differs.then(|| Quantiles::of(each)).flatten()
    };
    let solve = found.statuses.iter().map(|status| {
        f64::from(status.solve_time.sec) + 1e-9 * f64::from(status.solve_time.nanosec)
    });
    let is_measured = solve.clone().any(|time_s| time_s > 0.0);
    LatencyReport {
        pose_log_minus_stamp_s: offsets(Role::Pose),
        status_log_minus_stamp_s: offsets(Role::Status),
        status_minus_detections_s: answer_times(found),
        solve_time_s: is_measured.then(|| Quantiles::of(solve)).flatten(),
    }
}

/// Returns how long after the detections the statuses with their stamps were recorded.
fn answer_times(found: &Gathered) -> Option<Quantiles> {
    let detections = &found.heard.get(&Role::Detections)?.times;
    let statuses = &found.heard.get(&Role::Status)?.times;
    let asked: BTreeMap<i64, i64> = detections
        .iter()
        .rev()
        .map(|time| (time.stamp_ns, time.log_ns))
        .collect();
    let delays: Vec<i64> = statuses
        .iter()
        .filter_map(|time| Some(time.log_ns - asked.get(&time.stamp_ns)?))
        .collect();
    let is_measured = delays.iter().any(|delay| *delay != 0);
    is_measured
        .then(|| Quantiles::of(delays.into_iter().map(seconds)))
        .flatten()
}

/// Returns the stamps of every topic that has them.
pub(super) fn stamp_reports(heard: &BTreeMap<Role, Heard>) -> Vec<StampReport> {
    heard
        .iter()
        .filter(|(_, heard)| !heard.times.is_empty())
        .map(|(role, heard)| stamp_report(*role, &heard.times))
        .collect()
}

fn stamp_report(role: Role, all: &[Times]) -> StampReport {
    let times: Vec<Times> = all
        .iter()
        .copied()
        .filter(|time| time.stamp_ns > 0)
        .collect();
    let steps_ns: Vec<i64> = times
        .windows(2)
        .map(|pair| pair[1].stamp_ns - pair[0].stamp_ns)
        .collect();
    let mut ahead: Vec<f64> = (steps_ns.iter())
        .filter(|step| **step > 0)
        .map(|step| seconds(*step))
        .collect();
    ahead.sort_unstable_by(f64::total_cmp);
    let period_s = quantile(&ahead, 0.5);
    let limit_s = period_s.map_or(f64::INFINITY, |period_s| GAP_PERIODS * period_s);
    let (regular, gaps): (Vec<f64>, Vec<f64>) = ahead.iter().partition(|step| **step <= limit_s);
    let mut offsets: Vec<f64> = times.iter().map(offset_s).collect();
    offsets.sort_unstable_by(f64::total_cmp);
    StampReport {
        role: role.label().to_owned(),
        messages: all.len() as u64,
        period_s,
        jitter_s: deviation(&regular),
        gaps: gaps.len() as u64,
        longest_gap_s: gaps.last().copied(),
        out_of_order: steps_ns.iter().filter(|step| **step < 0).count() as u64,
        repeated: steps_ns.iter().filter(|step| **step == 0).count() as u64,
        invalid: (all.len() - times.len()) as u64,
        log_minus_stamp_min_s: offsets.first().copied(),
        log_minus_stamp_median_s: quantile(&offsets, 0.5),
        log_minus_stamp_max_s: offsets.last().copied(),
        clock_drift_s_per_s: drift(&times),
    }
}

/// Returns log time minus stamp, s.
pub(super) fn offset_s(time: &Times) -> f64 {
    seconds(time.log_ns.saturating_sub(time.stamp_ns))
}

fn deviation(values: &[f64]) -> Option<f64> {
    if values.len() < 2 {
        return None;
    }
    let count = values.len() as f64;
    let mean = values.iter().sum::<f64>() / count;
    let squares: f64 = values.iter().map(|value| (value - mean).powi(2)).sum();
    Some((squares / (count - 1.0)).sqrt())
}

/// Returns the slope of log time minus stamp over the stamps; `None` over less than ten seconds.
fn drift(times: &[Times]) -> Option<f64> {
    const LEAST_S: f64 = 10.0;
    let first = times.first()?.stamp_ns;
    let x = || times.iter().map(|time| seconds(time.stamp_ns - first));
    let count = times.len() as f64;
    let (low, high) = x().fold((0.0_f64, 0.0_f64), |(low, high), x| {
        (low.min(x), high.max(x))
    });
    if high - low < LEAST_S {
        return None;
    }
    let mean_x = x().sum::<f64>() / count;
    let mean_y = times.iter().map(offset_s).sum::<f64>() / count;
    let (mut xy, mut xx) = (0.0, 0.0);
    for (x, time) in x().zip(times) {
        xy += (x - mean_x) * (offset_s(time) - mean_y);
        xx += (x - mean_x) * (x - mean_x);
    }
    (xx > 0.0).then_some(xy / xx)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn times(stamps_ms: &[i64]) -> Vec<Times> {
        let at = |ms: &i64| Times {
            stamp_ns: ms * 1_000_000,
            log_ns: ms * 1_000_000 + 20_000_000,
        };
        stamps_ms.iter().map(at).collect()
    }

    #[test]
    fn gaps_order_repetitions_and_offsets_are_counted() {
        let found = stamp_report(Role::Pose, &times(&[0, 100, 200, 300, 700, 650, 650, 750]));
        assert_eq!(
            (
                found.gaps,
                found.out_of_order,
                found.repeated,
                found.invalid
            ),
            (1, 1, 1, 1)
        );
        assert!((found.period_s.expect("steps") - 0.1).abs() < 1e-9);
        assert!((found.longest_gap_s.expect("one") - 0.4).abs() < 1e-9);
        assert!(found.jitter_s.expect("steps") < 1e-9);
        assert!((found.log_minus_stamp_median_s.expect("times") - 0.02).abs() < 1e-9);
        // Less than ten seconds.
        assert_eq!(found.clock_drift_s_per_s, None);
    }

    #[test]
    fn clock_that_runs_fast_is_a_drift() {
        let at = |second: i64| Times {
            stamp_ns: second * 1_000_000_000,
            log_ns: second * 1_000_100_000,
        };
        let found = stamp_report(Role::Pose, &(1..40).map(at).collect::<Vec<_>>());
        assert!((found.clock_drift_s_per_s.expect("long enough") - 1e-4).abs() < 1e-9);
    }
}
