//! The figures of several recordings together: summary.json.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use super::consistency::{DEGREES_OF_FREEDOM, verdict};
use super::report::{AXES, Count, EstimateReport, FORMAT, Report, StanfordReport, WorstFrame};
use super::statistics::{chi_squared_mean_bounds, proportion_interval};

/// Frames with the largest NEES that are named.
const WORST: usize = 20;

/// Figures of several recordings.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct FleetReport {
    /// [`FORMAT`].
    pub format: u32,
    /// Recordings with a report, in the order given.
    pub bags: Vec<BagLine>,
    /// Recordings without one, and why.
    pub failed: Vec<FailedBag>,
    /// Statuses of all.
    pub frames: u64,
    /// Of these, with a pose.
    pub with_pose: u64,
    /// By outcome, the most frequent first.
    pub outcomes: Vec<Count>,
    /// By integrity state.
    pub integrity_states: Vec<Count>,
    /// Consistency of the single-frame poses.
    pub nees: Option<FleetNees>,
    /// Coverage of each axis.
    pub coverage: Vec<FleetCoverage>,
    /// Protection levels, by point and axis.
    pub stanford: Vec<StanfordReport>,
    /// The frames with the largest NEES.
    pub worst_frames: Vec<FleetWorstFrame>,
    /// Markers that are displaced, by how many recordings name them.
    pub suspects: Vec<Count>,
}

/// One recording in a few figures.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct BagLine {
    /// Its name, which is that of its folder too.
    pub bag: String,
    /// Statuses.
    pub frames: u64,
    /// Of these, with a pose.
    pub with_pose: u64,
    /// Mean NEES.
    pub nees_mean: Option<f64>,
    /// `within`, `too_high` or `too_low`, by the bounds of this recording alone.
    pub nees_verdict: Option<String>,
    /// Root mean square distance of estimated and true position.
    pub position_rms_m: Option<f64>,
    /// Share of the frames with levels within their limits.
    pub availability: Option<f64>,
    /// Errors beyond their protection level.
    pub beyond_level: u64,
    /// The marker that is displaced.
    pub suspect_marker: Option<u32>,
    /// How much could not be read or used.
    pub skipped: u64,
}

/// A recording without a report.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct FailedBag {
    /// Its name or path.
    pub bag: String,
    /// Why.
    pub reason: String,
}

/// NEES over recordings, which are independent of each other.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FleetNees {
    /// Recordings with a NEES.
    pub bags: u64,
    /// Their frames.
    pub frames: u64,
    /// Mean over all frames.
    pub mean: f64,
    /// 95 % bounds of the mean, if frames were independent.
    pub bounds_if_independent: Option<[f64; 2]>,
    /// How many independent frames give a mean as certain, from those of each recording.
    pub independent_frames: f64,
    /// The same bounds for that many.
    pub bounds: Option<[f64; 2]>,
    /// `within`, `too_high` or `too_low`, by `bounds`.
    pub verdict: String,
    /// Recordings whose own mean is outside their own bounds; 5 % are by chance.
    pub bags_outside: u64,
}

/// Coverage of one axis over recordings.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FleetCoverage {
    /// One of [`AXES`].
    pub axis: String,
    /// Frames with a stated sigma.
    pub frames: u64,
    /// Of these, within three sigmas.
    pub within_3_sigma: u64,
    /// Their share.
    pub coverage_3_sigma: f64,
    /// 95 % interval for as many frames as are independent.
    pub coverage_interval: Option<[f64; 2]>,
}

/// A frame to look at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct FleetWorstFrame {
    /// Its recording.
    pub bag: String,
    /// The frame.
    #[serde(flatten)]
    pub frame: WorstFrame,
}

impl FleetReport {
    /// Returns the figures of these reports together.
    #[must_use]
    pub fn of(reports: &[Report], failed: Vec<FailedBag>) -> Self {
        let poses = || reports.iter().filter_map(|report| report.pose.as_ref());
        let statuses = || reports.iter().filter_map(|report| report.outcomes.as_ref());
        let mut outcomes = Tally::default();
        for found in statuses() {
            outcomes.add(&found.counts);
        }
        let mut states = Tally::default();
        for found in reports
            .iter()
            .filter_map(|report| report.integrity.as_ref())
        {
            states.add(&found.states);
        }
        let mut suspects = Tally::default();
        for found in reports
            .iter()
            .filter_map(|report| report.residuals.as_ref())
        {
            if let Some(suspect) = &found.suspect {
                suspects.add(&[Count {
                    name: suspect.id.to_string(),
                    count: 1,
                }]);
            }
        }
        Self {
            format: FORMAT,
            bags: reports.iter().map(BagLine::of).collect(),
            failed,
            frames: statuses().map(|found| found.frames).sum(),
            with_pose: statuses().map(|found| found.with_pose).sum(),
            outcomes: outcomes.by_count(),
            integrity_states: states.in_order(),
            nees: nees(reports),
            coverage: (0..AXES.len())
                .filter_map(|axis| coverage(&poses().collect::<Vec<_>>(), axis))
                .collect(),
            stanford: stanford(reports),
            worst_frames: worst(reports),
            suspects: suspects.by_count(),
        }
    }

    /// Returns the main figures in words.
    #[must_use]
    pub fn in_words(&self) -> String {
        let mut words = format!(
            "{} recordings, {} of {} frames have a pose",
            self.bags.len(),
            self.with_pose,
            self.frames
        );
        if let Some(nees) = &self.nees {
            let verdict = nees.verdict.replace('_', " ");
            let nees = format!(", mean NEES {:.2} ({verdict})", nees.mean);
            words.push_str(&nees);
        }
        if !self.failed.is_empty() {
            let failed = format!(", {} recordings without a report", self.failed.len());
            words.push_str(&failed);
        }
        words
    }
}

/// Counts by name, in the order in which names first appear.
#[derive(Default)]
struct Tally(Vec<Count>);

impl Tally {
    fn add(&mut self, counts: &[Count]) {
        for count in counts {
            match self.0.iter_mut().find(|known| known.name == count.name) {
                Some(known) => known.count += count.count,
                None => self.0.push(count.clone()),
            }
        }
    }

    fn in_order(self) -> Vec<Count> {
        self.0
    }

    fn by_count(mut self) -> Vec<Count> {
        self.0
            .sort_by(|a, b| b.count.cmp(&a.count).then(a.name.cmp(&b.name)));
        self.0
    }
}

impl BagLine {
    fn of(report: &Report) -> Self {
        let nees = report.pose.as_ref().and_then(|pose| pose.nees.as_ref());
        let position = |pose: &EstimateReport| {
            let squares = pose.axes.iter().take(3).map(|axis| axis.rms * axis.rms);
            squares.sum::<f64>().sqrt()
        };
        let integrity = report.integrity.as_ref();
        let residuals = report.residuals.as_ref();
        Self {
            bag: report.bag.clone(),
            frames: report.outcomes.as_ref().map_or(0, |found| found.frames),
            with_pose: report.outcomes.as_ref().map_or(0, |found| found.with_pose),
            nees_mean: nees.map(|nees| nees.mean),
            nees_verdict: nees.map(|nees| nees.verdict.clone()),
            position_rms_m: report.pose.as_ref().map(position),
            availability: integrity.map(|found| found.availability),
            beyond_level: integrity.map_or(0, |found| {
                found
                    .stanford
                    .iter()
                    .map(StanfordReport::beyond_level)
                    .sum()
            }),
            suspect_marker: residuals
                .and_then(|found| found.suspect.as_ref())
                .map(|suspect| suspect.id),
            skipped: report.skipped.len() as u64,
        }
    }
}

fn nees(reports: &[Report]) -> Option<FleetNees> {
    let found: Vec<_> = reports
        .iter()
        .filter_map(|report| report.pose.as_ref()?.nees.as_ref())
        .collect();
    let frames: u64 = found.iter().map(|nees| nees.frames).sum();
    if frames == 0 {
        return None;
    }
    let all = frames as f64;
    let mean = found
        .iter()
        .map(|nees| nees.mean * nees.frames as f64)
        .sum::<f64>()
        / all;
    // Variances of sums of independent recordings add up.
    let variance: f64 = found
        .iter()
        .map(|nees| (nees.frames as f64).powi(2) / nees.independent_frames.max(1.0))
        .sum();
    let independent = all * all / variance;
    let degrees = f64::from(DEGREES_OF_FREEDOM);
    let bounds = chi_squared_mean_bounds(degrees, independent);
    Some(FleetNees {
        bags: found.len() as u64,
        frames,
        mean,
        bounds_if_independent: chi_squared_mean_bounds(degrees, all),
        independent_frames: independent,
        bounds,
        verdict: verdict(mean, bounds).to_owned(),
        bags_outside: found.iter().filter(|nees| nees.verdict != "within").count() as u64,
    })
}

fn coverage(poses: &[&EstimateReport], axis: usize) -> Option<FleetCoverage> {
    let (mut frames, mut within, mut variance) = (0_u64, 0_u64, 0.0);
    for pose in poses {
        let stated = pose.frames - pose.frames_without_covariance.min(pose.frames);
        let Some(found) = pose.axes.get(axis).filter(|_| stated > 0) else {
            continue;
        };
        frames += stated;
        within += found.within_3_sigma;
        variance += (stated as f64).powi(2) / found.independent_frames.max(1.0);
    }
    let share = within as f64 / frames as f64;
    let independent = (frames as f64).powi(2) / variance;
    (frames > 0).then(|| FleetCoverage {
        axis: AXES[axis].to_owned(),
        frames,
        within_3_sigma: within,
        coverage_3_sigma: share,
        coverage_interval: proportion_interval(share * independent, independent),
    })
}

fn stanford(reports: &[Report]) -> Vec<StanfordReport> {
    let mut pooled: BTreeMap<(String, String), StanfordReport> = BTreeMap::new();
    let found = reports
        .iter()
        .filter_map(|report| report.integrity.as_ref());
    for one in found.flat_map(|found| &found.stanford) {
        let key = (one.point.clone(), one.axis.clone());
        pooled
            .entry(key)
            .and_modify(|sum| {
                sum.frames += one.frames;
                sum.nominal += one.nominal;
                sum.unavailable += one.unavailable;
                sum.misleading += one.misleading;
                sum.hazardous += one.hazardous;
                sum.unavailable_and_misleading += one.unavailable_and_misleading;
                sum.largest_ratio = sum.largest_ratio.max(one.largest_ratio);
            })
            .or_insert_with(|| one.clone());
    }
    let with_bound = |mut sum: StanfordReport| {
        sum.exceeding_at_most_if_independent =
            proportion_interval(sum.beyond_level() as f64, sum.frames as f64).map(|[_, high]| high);
        sum
    };
    pooled.into_values().map(with_bound).collect()
}

fn worst(reports: &[Report]) -> Vec<FleetWorstFrame> {
    let mut frames: Vec<FleetWorstFrame> = reports
        .iter()
        .filter_map(|report| Some((&report.bag, report.pose.as_ref()?)))
        .flat_map(|(bag, pose)| {
            pose.worst_frames.iter().map(move |frame| FleetWorstFrame {
                bag: bag.clone(),
                frame: frame.clone(),
            })
        })
        .collect();
    frames.sort_by(|a, b| b.frame.nees.total_cmp(&a.frame.nees));
    frames.truncate(WORST);
    frames
}

#[cfg(test)]
mod tests {
    use super::super::report::NeesReport;
    use super::*;

    fn report(bag: &str, mean: f64, frames: u64, independent_frames: f64) -> Report {
        let frame = WorstFrame {
            stamp_ns: 1,
            time_s: 0.0,
            range_m: 20.0,
            nees: 3.0 * mean,
            position_error_m: 0.1,
            attitude_error_rad: 0.001,
        };
        Report {
            bag: bag.to_owned(),
            pose: Some(EstimateReport {
                frames,
                frames_without_covariance: 0,
                axes: Vec::new(),
                by_range: Vec::new(),
                nees: Some(NeesReport {
                    frames,
                    degrees_of_freedom: 6,
                    mean,
                    p50: mean,
                    p99: mean,
                    max: mean,
                    bounds_if_independent: None,
                    independent_frames,
                    bounds: None,
                    verdict: "within".to_owned(),
                }),
                worst_frames: vec![frame],
            }),
            ..Report::default()
        }
    }

    #[test]
    fn recordings_are_independent_and_weigh_by_their_frames() {
        let fleet = FleetReport::of(
            &[report("a", 5.0, 300, 3.0), report("b", 7.0, 100, 100.0)],
            Vec::new(),
        );
        let nees = fleet.nees.expect("two recordings");
        assert!((nees.mean - 5.5).abs() < 1e-12);
        // 400² over 300² / 3 + 100² / 100.
        assert!((nees.independent_frames - 160_000.0 / 30_100.0).abs() < 1e-9);
        assert_eq!((nees.bags, nees.frames), (2, 400));
        let worst: Vec<&str> = fleet
            .worst_frames
            .iter()
            .map(|frame| frame.bag.as_str())
            .collect();
        assert_eq!(worst, ["b", "a"]);
    }

    #[test]
    fn no_recording_gives_no_figure() {
        let fleet = FleetReport::of(&[], Vec::new());
        assert_eq!(
            (fleet.nees, fleet.coverage.len(), fleet.frames),
            (None, 0, 0)
        );
    }
}
