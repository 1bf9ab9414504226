//! Statistics of many trials of one method.

use nalgebra::Vector6;

use super::TrialError;

/// degrees; a larger attitude error counts as a failure. Refuelling keeps the true relative angles within ±5°, so the
/// nominal attitude itself would be a better answer.
pub const FAILURE_DEG: f64 = 5.0;

/// Errors of one method in one setting. Root mean squares are over all trials with a pose, failures included; medians
/// are of absolute errors.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Summary {
    /// Number of images.
    pub trials: usize,
    /// Number of images for which the method found a pose.
    pub solved: usize,
    /// Of each paper coordinate, degrees and metres.
    pub rms: Vector6<f64>,
    /// Of each paper coordinate, degrees and metres.
    pub median: Vector6<f64>,
    /// Of the angle between found and true attitude, degrees.
    pub rotation_rms_deg: f64,
    /// Median of the same.
    pub rotation_median_deg: f64,
    /// Of the distance between found and true position, m.
    pub position_rms_m: f64,
    /// Median of the same.
    pub position_median_m: f64,
    /// Share of the images with an attitude error above [`FAILURE_DEG`], or without a pose.
    pub failures: f64,
    /// Share of the solved images whose iteration ended in another minimum than when started at the truth; `None` if
    /// that was not evaluated: see [`TrialError::other_minimum`].
    pub other_minimum: Option<f64>,
    /// Median of the number of steps of the iteration.
    pub iterations_median: u32,
    /// 95th percentile of the same.
    pub iterations_p95: u32,
}

impl Summary {
    /// Returns the summary of one method's trials; NaN if none gave a pose.
    #[must_use]
    pub fn new(trials: &[Option<TrialError>]) -> Self {
        let errors: Vec<&TrialError> = trials.iter().flatten().collect();
        let solved = errors.len();
        let column = |i: usize| errors.iter().map(move |e| e.coordinates[i]);
        let rotations = || errors.iter().map(|e| e.rotation_deg);
        let positions = || errors.iter().map(|e| e.position_m);
        let mut iterations: Vec<u32> = errors.iter().map(|e| e.iterations).collect();
        iterations.sort_unstable();
        let step_quantile = |percent: usize| {
            let index = (solved * percent / 100).min(solved.saturating_sub(1));
            iterations.get(index).copied().unwrap_or(0)
        };
        let far = rotations().filter(|&angle| angle > FAILURE_DEG).count();
        let asked: Vec<bool> = errors.iter().filter_map(|e| e.other_minimum).collect();
        let elsewhere = asked.iter().filter(|&&is_other| is_other).count() as f64;
        Self {
            trials: trials.len(),
            solved,
            rms: Vector6::from_fn(|i, _| rms(column(i))),
            median: Vector6::from_fn(|i, _| median_of_absolutes(column(i))),
            rotation_rms_deg: rms(rotations()),
            rotation_median_deg: median_of_absolutes(rotations()),
            position_rms_m: rms(positions()),
            position_median_m: median_of_absolutes(positions()),
            failures: (trials.len() - solved + far) as f64 / trials.len() as f64,
            other_minimum: (!asked.is_empty()).then(|| elsewhere / asked.len() as f64),
            iterations_median: step_quantile(50),
            iterations_p95: step_quantile(95),
        }
    }
}

fn rms(values: impl ExactSizeIterator<Item = f64>) -> f64 {
    let n = values.len() as f64;
    (values.map(|value| value * value).sum::<f64>() / n).sqrt()
}

fn median_of_absolutes(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.map(f64::abs).collect();
    values.sort_unstable_by(f64::total_cmp);
    let n = values.len();
    match n {
        0 => f64::NAN,
        _ if n % 2 == 1 => values[n / 2],
        _ => f64::midpoint(values[n / 2 - 1], values[n / 2]),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn error(rotation_deg: f64, iterations: u32) -> TrialError {
        TrialError {
            coordinates: Vector6::repeat(-rotation_deg),
            rotation_deg,
            position_m: 2.0 * rotation_deg,
            iterations,
            other_minimum: Some(rotation_deg > 100.0),
        }
    }

    #[test]
    fn an_outlier_moves_the_rms_and_not_the_median() {
        let summary = Summary::new(&[
            Some(error(1.0, 10)),
            Some(error(2.0, 20)),
            Some(error(170.0, 30)),
            None,
        ]);
        assert_eq!((summary.trials, summary.solved), (4, 3));
        assert!((summary.rms[0] - (28_905.0_f64 / 3.0).sqrt()).abs() < 1e-9);
        assert!((summary.median - Vector6::repeat(2.0)).norm() < 1e-12);
        assert!((summary.position_median_m - 4.0).abs() < 1e-12);
        assert_eq!(
            (summary.iterations_median, summary.iterations_p95),
            (20, 30)
        );
        // One far off and one without a pose, of four; one elsewhere, of three with a pose.
        assert!((summary.failures - 0.5).abs() < 1e-12);
        assert!((summary.other_minimum.expect("asked") - 1.0 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn no_pose_at_all_is_nan_and_failure() {
        let summary = Summary::new(&[None, None]);
        assert!(summary.rotation_rms_deg.is_nan() && summary.rotation_median_deg.is_nan());
        assert!((summary.failures - 1.0).abs() < 1e-12);
    }
}
