//! The figures of one recording, as `evaluation.json` holds them: names are stable, and carry the unit.
//!
//! What could not be computed is `null` or an empty list, never a zero.

use serde::{Deserialize, Serialize};

use super::statistics::Quantiles;

/// Version of the fields below: raised when one changes its meaning or goes.
pub const FORMAT: u32 = 1;

/// The six axes of a pose error, each with its unit.
pub const AXES: [&str; 6] = ["x_m", "y_m", "z_m", "rot_x_rad", "rot_y_rad", "rot_z_rad"];
/// The axes of a protection level, in the receiver.
pub const LEVEL_AXES: [&str; 3] = ["ahead_m", "lateral_m", "vertical_m"];

/// All figures of one recording.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct Report {
    /// [`FORMAT`].
    pub format: u32,
    /// Name of the recording.
    pub bag: String,
    /// Messages that were read.
    pub messages: u64,
    /// What could not be read or used, in words.
    pub skipped: Vec<String>,
    /// What was read and used, but may surprise.
    pub notes: Vec<String>,
    /// First stamp of a status, a pose or detections, s since 1970.
    pub start_s: Option<f64>,
    /// From the first of these stamps to the last.
    pub duration_s: Option<f64>,
    /// What was read on each topic.
    pub topics: Vec<TopicReport>,
    /// The truth, if there is one.
    pub truth: Option<TruthReport>,
    /// Single-frame poses against the truth.
    pub pose: Option<EstimateReport>,
    /// The track's poses against the truth.
    pub odometry: Option<EstimateReport>,
    /// Frames by their outcome.
    pub outcomes: Option<OutcomeReport>,
    /// Protection levels.
    pub integrity: Option<IntegrityReport>,
    /// Residuals of each marker.
    pub residuals: Option<ResidualReport>,
    /// Modes of the error budget.
    pub modes: Vec<ModeReport>,
    /// Delays.
    pub latency: LatencyReport,
    /// Stamps of each topic that has them.
    pub stamps: Vec<StampReport>,
}

/// One topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TopicReport {
    /// What it is for.
    pub role: String,
    /// Absolute name.
    pub name: String,
    /// `package/msg/Name`.
    #[serde(rename = "type")]
    pub type_name: String,
    /// Messages that were used.
    pub messages: u64,
}

/// The truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct TruthReport {
    /// Absolute name.
    pub topic: String,
    /// How many there are.
    pub messages: u64,
    /// Poses whose stamp the truth has.
    pub poses_at_its_stamps: u64,
    /// Poses between two truths that are near enough.
    pub poses_interpolated: u64,
    /// Poses without a truth.
    pub poses_without: u64,
}

/// Poses against the truth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct EstimateReport {
    /// Poses that have a truth.
    pub frames: u64,
    /// Of these, poses without a covariance that is positive definite.
    pub frames_without_covariance: u64,
    /// One for each of [`AXES`].
    pub axes: Vec<AxisReport>,
    /// By distance of the tanker's origin.
    pub by_range: Vec<RangeReport>,
    /// Of the whole pose.
    pub nees: Option<NeesReport>,
    /// The frames with the largest NEES.
    pub worst_frames: Vec<WorstFrame>,
}

/// Errors along one axis; truth minus estimate.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct AxisReport {
    /// One of [`AXES`]; `mean` to `max_abs` have its unit.
    pub axis: String,
    /// Mean error.
    pub mean: f64,
    /// Root mean square of the error.
    pub rms: f64,
    /// Largest error without its sign.
    pub max_abs: f64,
    /// Root mean square of the stated standard deviation.
    pub sigma: Option<f64>,
    /// Frames within three stated standard deviations.
    pub within_3_sigma: u64,
    /// Their share.
    pub coverage_3_sigma: Option<f64>,
    /// 95 % interval of the probability behind that share, if frames were independent.
    pub coverage_interval_if_independent: Option<[f64; 2]>,
    /// The same for as many frames as are independent.
    pub coverage_interval: Option<[f64; 2]>,
    /// How many frames are independent, from the correlations of error over sigma.
    pub independent_frames: f64,
}

/// Errors in an interval of range.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct RangeReport {
    /// From this range on, m.
    pub from_m: f64,
    /// Up to this one, m.
    pub to_m: f64,
    /// Frames in it.
    pub frames: u64,
    /// Of the error, in the order and units of [`AXES`].
    pub rms: [f64; 6],
    /// Root mean square of the stated standard deviations, alike.
    pub sigma: Option<[f64; 6]>,
    /// Mean NEES.
    pub nees_mean: Option<f64>,
}

/// Normalised estimation error squared of the whole pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct NeesReport {
    /// Frames that have one.
    pub frames: u64,
    /// What the mean is for an honest covariance.
    pub degrees_of_freedom: u32,
    /// Mean.
    pub mean: f64,
    /// Median; 5.35 for an honest covariance.
    pub p50: f64,
    /// 99th percentile; 16.81 for an honest covariance.
    pub p99: f64,
    /// Largest.
    pub max: f64,
    /// 95 % bounds of the mean for an honest covariance, if frames were independent.
    pub bounds_if_independent: Option<[f64; 2]>,
    /// How many frames are independent, from the correlations of the normalised error.
    pub independent_frames: f64,
    /// The same bounds for that many.
    pub bounds: Option<[f64; 2]>,
    /// `within`, `too_high` or `too_low`, by `bounds`.
    pub verdict: String,
}

/// A frame to look at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct WorstFrame {
    /// Its stamp.
    pub stamp_ns: i64,
    /// Since the report's start.
    pub time_s: f64,
    /// Distance of the tanker's origin.
    pub range_m: f64,
    /// Normalised estimation error squared.
    pub nees: f64,
    /// Distance of estimated and true position.
    pub position_error_m: f64,
    /// Angle between estimated and true attitude.
    pub attitude_error_rad: f64,
}

/// Outcomes of frames.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct OutcomeReport {
    /// Statuses.
    pub frames: u64,
    /// Of these, with a pose.
    pub with_pose: u64,
    /// By name, the most frequent first, OK included.
    pub counts: Vec<Count>,
    /// The longest time between two frames with a pose.
    pub longest_without_pose_s: Option<f64>,
    /// Frames in which detections were excluded as wrong, by marker.
    pub rejected_markers: Vec<Count>,
}

/// How often something occurred.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub struct Count {
    /// What.
    pub name: String,
    /// How often.
    pub count: u64,
}

/// Protection levels.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct IntegrityReport {
    /// Messages.
    pub frames: u64,
    /// By state, in the order of the message's constants.
    pub states: Vec<Count>,
    /// Share of the frames with state `AVAILABLE`.
    pub availability: f64,
    /// Levels against errors, for each point and axis.
    pub stanford: Vec<StanfordReport>,
}

/// Levels against errors of one point along one axis: the counts of a Stanford diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StanfordReport {
    /// Name of the point.
    pub point: String,
    /// One of [`LEVEL_AXES`].
    pub axis: String,
    /// Frames with a level, an estimate and a truth.
    pub frames: u64,
    /// Limit of the last of them, if one is stated.
    pub alert_limit_m: Option<f64>,
    /// Error below the level, level within the limit.
    pub nominal: u64,
    /// Level beyond the limit: not available.
    pub unavailable: u64,
    /// Error beyond the level, though within the limit.
    pub misleading: u64,
    /// Level within the limit, error beyond it.
    pub hazardous: u64,
    /// Error beyond the level while the level is beyond the limit.
    pub unavailable_and_misleading: u64,
    /// Largest error over its level.
    pub largest_ratio: f64,
    /// Upper end of the 95 % interval for the probability that an error exceeds its level, if frames were independent.
    pub exceeding_at_most_if_independent: Option<f64>,
}

impl StanfordReport {
    /// Returns the frames whose error is beyond the level.
    #[must_use]
    pub const fn beyond_level(&self) -> u64 {
        self.misleading + self.hazardous + self.unavailable_and_misleading
    }
}

/// Residuals.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ResidualReport {
    /// Frames with a pose, its detections and a camera.
    pub frames: u64,
    /// By marker, ascending id.
    pub markers: Vec<MarkerReport>,
    /// The marker that is most probably not where the map has it, if any is significantly off.
    pub suspect: Option<SuspectReport>,
}

/// Residuals of one marker: detection minus projection of the marker at the estimated pose.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct MarkerReport {
    /// Its id.
    pub id: u32,
    /// Frames in which it was detected.
    pub frames: u64,
    /// Of these, frames whose pose rests on it.
    pub used: u64,
    /// Of these, frames in which it was excluded as wrong, or left out at the edge.
    pub rejected: u64,
    /// Mean residual of column and row.
    pub mean_px: [f64; 2],
    /// Standard deviation of the residuals about their mean.
    pub sigma_px: [f64; 2],
    /// Mean standard deviation that the detections state.
    pub stated_sigma_px: f64,
    /// Mean of the squared residual over its variance, two degrees of freedom: 2 if noise and map are as stated.
    pub chi_squared_mean: f64,
    /// How far the marker is from its place on the map if every other one is right, tanker frame.
    pub displacement_m: Option<[f64; 3]>,
    /// Standard deviation of it, for as many frames as are independent.
    pub displacement_sigma_m: Option<[f64; 3]>,
    /// Squared displacement over its covariance, three degrees of freedom, for as many frames as are independent.
    pub displacement_chi_squared: Option<f64>,
    /// Probability of so large a value if the marker is where the map has it.
    pub displacement_p_value: Option<f64>,
    /// How many frames are independent, from the correlations of what the displacement leaves.
    pub independent_frames: f64,
    /// Standard deviation of its place by the map's budget; `null`: exact.
    pub survey_sigma_m: Option<f64>,
}

/// The marker that is most probably not where the map has it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct SuspectReport {
    /// Its id.
    pub id: u32,
    /// Its [`MarkerReport::displacement_p_value`], times the number of markers.
    pub p_value: f64,
    /// Its squared displacement over that of the next marker: near 1, either may be the one.
    pub lead: Option<f64>,
}

/// One mode of the error budget, as the statuses estimate it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModeReport {
    /// Its name.
    pub name: String,
    /// Frames that estimate it.
    pub frames: u64,
    /// Mean amplitude, in its sigmas.
    pub mean_sigmas: f64,
    /// Root mean square, in its sigmas: 1 at most if the budget states it right.
    pub rms_sigmas: f64,
    /// Largest without its sign, in its sigmas.
    pub max_abs_sigmas: f64,
    /// Frames in which it has the largest share of the position's variance.
    pub dominant_frames: u64,
}

/// Delays, s.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub struct LatencyReport {
    /// From the stamp to the log time of the poses; `null` where all log times are the stamps, as in a simulated recording.
    pub pose_log_minus_stamp_s: Option<Quantiles>,
    /// The same of the statuses.
    pub status_log_minus_stamp_s: Option<Quantiles>,
    /// From the log time of the detections to that of the status with their stamp; `null` where there is none, as in a
    /// replay.
    pub status_minus_detections_s: Option<Quantiles>,
    /// What the statuses state; `null` where all are zero, as in a replay.
    pub solve_time_s: Option<Quantiles>,
}

/// The stamps of one topic.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct StampReport {
    /// What the topic is for.
    pub role: String,
    /// Messages.
    pub messages: u64,
    /// Median distance of a stamp from the one before.
    pub period_s: Option<f64>,
    /// Standard deviation of that distance, gaps left out.
    pub jitter_s: Option<f64>,
    /// Distances of more than one and a half periods.
    pub gaps: u64,
    /// The longest.
    pub longest_gap_s: Option<f64>,
    /// Stamps before the one before.
    pub out_of_order: u64,
    /// Stamps equal to the one before.
    pub repeated: u64,
    /// Stamps of zero, negative or malformed.
    pub invalid: u64,
    /// Log time minus stamp: smallest.
    pub log_minus_stamp_min_s: Option<f64>,
    /// Median.
    pub log_minus_stamp_median_s: Option<f64>,
    /// Largest.
    pub log_minus_stamp_max_s: Option<f64>,
    /// Change of log time minus stamp per second of stamps, least squares.
    pub clock_drift_s_per_s: Option<f64>,
}
