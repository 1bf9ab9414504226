//! An aircraft's attitude at the time of an image, interpolated between samples of its autopilot.

use std::collections::VecDeque;

use nalgebra::{UnitQuaternion, Vector3};

/// Number of samples kept: four seconds at 250 Hz, far more than the delay of any image.
const KEPT: usize = 1000;
/// rad/s; faster than any aircraft turns, but an estimator that resets its heading exceeds it.
const FASTEST_RADPS: f64 = 10.0;

/// s; images are processed a few tenths of a second late at most, so the newest attitude is little later than they are.
/// A sample further ahead has the stamp of another clock, and an attitude between older samples would be wrong.
const FARTHEST_AHEAD_S: f64 = 1.0;

/// A sample of an autopilot.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeSample {
    /// Its time, ns.
    pub stamp_ns: i64,
    /// Rotation from the body's axes to local ones.
    pub local_from_body: UnitQuaternion<f64>,
    /// In the body's axes, rad/s, if it was measured: a gyro is more precise than the difference of two attitudes.
    pub rate_in_body: Option<Vector3<f64>>,
}

/// Attitude and rate of a body relative to local axes at one time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct AttitudeAt {
    /// Rotation from the body's axes to local ones.
    pub local_from_body: UnitQuaternion<f64>,
    /// Relative to the local axes, in the body's axes, rad/s: interpolated between the rates of the two nearest
    /// samples, or, if one of them has none, the mean rate between their attitudes.
    pub rate_in_body: Vector3<f64>,
}

/// Why there is no attitude for a stamp.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum AttitudeError {
    /// Too few samples for a rate.
    #[error("need 2 samples of the attitude, got {got}")]
    TooFew {
        /// Samples since the start or the last restart.
        got: usize,
    },
    /// The newest sample is too old for the image.
    #[error("its newest sample is {age_s:.3} s older than the image, allowed is {limit_s} s")]
    Stale {
        /// s.
        age_s: f64,
        /// s.
        limit_s: f64,
    },
    /// The newest sample is so much later than the image that their clocks do not agree.
    #[error(
        "its newest sample is {by_s:.3} s later than the image, allowed is {limit_s} s: the clocks do not agree, or the image comes late"
    )]
    Ahead {
        /// s.
        by_s: f64,
        /// s.
        limit_s: f64,
    },
    /// All samples are later than the image.
    #[error("its first sample is {by_s:.3} s later than the image")]
    BeforeFirst {
        /// s.
        by_s: f64,
    },
    /// The two samples around the image are too far apart.
    #[error("{gap_s:.3} s between two samples, allowed is {limit_s} s")]
    Gap {
        /// s.
        gap_s: f64,
        /// s.
        limit_s: f64,
    },
    /// The two samples around the image imply a rate that no aircraft has.
    #[error("it turns at {rate_radps:.1} rad/s, allowed is {limit_radps} rad/s")]
    Jump {
        /// rad/s.
        rate_radps: f64,
        /// rad/s.
        limit_radps: f64,
    },
}

/// The latest samples of an attitude, in the order of their stamps.
#[derive(Debug, Clone, PartialEq)]
pub struct AttitudeHistory {
    samples: VecDeque<AttitudeSample>,
    limit_s: f64,
}

impl AttitudeHistory {
    /// Returns an empty history. Two samples that are used together may be `limit_s` apart, and so may the newest
    /// sample and the image.
    #[must_use]
    pub fn new(limit_s: f64) -> Self {
        Self {
            samples: VecDeque::with_capacity(KEPT),
            limit_s,
        }
    }

    /// Adds a sample. A sample that is not later than the last one is ignored; one that is more than a second earlier
    /// restarts the history, because the source of the stamps has restarted.
    pub fn push(&mut self, sample: AttitudeSample) {
        if let Some(last) = self.samples.back() {
            if seconds(last.stamp_ns, sample.stamp_ns) > 1.0 {
                self.samples.clear();
            } else if sample.stamp_ns <= last.stamp_ns {
                return;
            }
        }
        if self.samples.len() == KEPT {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// Removes all samples, because the attitude was corrected by a jump.
    pub fn clear(&mut self) {
        self.samples.clear();
    }

    /// Returns the attitude at a stamp: interpolated between two samples, or extrapolated shortly after the last one
    /// with the rate of the last two.
    ///
    /// Errors of the stamps below the limits cannot be detected here: they rotate the attitude by as much as the body
    /// rotates in that time.
    ///
    /// # Errors
    /// [`AttitudeError`] gives the reason; no sample beyond the limits is ever used.
    pub fn at(&self, stamp_ns: i64) -> Result<AttitudeAt, AttitudeError> {
        let (got, limit_s) = (self.samples.len(), self.limit_s);
        let later = self
            .samples
            .partition_point(|sample| sample.stamp_ns < stamp_ns);
        let (Some(first), Some(last)) = (self.samples.front(), self.samples.back()) else {
            return Err(AttitudeError::TooFew { got });
        };
        let by_s = seconds(last.stamp_ns, stamp_ns);
        if by_s > FARTHEST_AHEAD_S {
            let limit_s = FARTHEST_AHEAD_S;
            return Err(AttitudeError::Ahead { by_s, limit_s });
        }
        if later == 0 && first.stamp_ns != stamp_ns {
            return Err(AttitudeError::BeforeFirst {
                by_s: seconds(first.stamp_ns, stamp_ns),
            });
        }
        let age_s = seconds(stamp_ns, last.stamp_ns);
        if age_s > limit_s {
            return Err(AttitudeError::Stale { age_s, limit_s });
        }
        let second = later.clamp(1, got.saturating_sub(1).max(1));
        let (Some(from), Some(to)) = (self.samples.get(second - 1), self.samples.get(second))
        else {
            return Err(AttitudeError::TooFew { got });
        };
        let gap_s = seconds(to.stamp_ns, from.stamp_ns);
        if gap_s > limit_s {
            return Err(AttitudeError::Gap { gap_s, limit_s });
        }
        let since_s = seconds(stamp_ns, from.stamp_ns);
        let mean = (from.local_from_body.inverse() * to.local_from_body).scaled_axis() / gap_s;
        let rate_in_body = match (from.rate_in_body, to.rate_in_body) {
            // After the last sample its own rate is used: extrapolating two noisy rates is unreliable.
            (Some(first), Some(then)) => first.lerp(&then, (since_s / gap_s).min(1.0)),
            _ => mean,
        };
        let rate_radps = mean.norm().max(rate_in_body.norm());
        if rate_radps > FASTEST_RADPS {
            return Err(AttitudeError::Jump {
                rate_radps,
                limit_radps: FASTEST_RADPS,
            });
        }
        Ok(AttitudeAt {
            local_from_body: from.local_from_body
                * UnitQuaternion::from_scaled_axis(mean * since_s),
            rate_in_body,
        })
    }
}

/// Returns `later − earlier`; no two stamps overflow it.
fn seconds(later_ns: i64, earlier_ns: i64) -> f64 {
    // Whole nanoseconds first: the difference of two doubles would lose them.
    (i128::from(later_ns) - i128::from(earlier_ns)) as f64 * 1e-9
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const LIMIT_S: f64 = 0.05;
    /// rad and rad/s, of a few products near one.
    const ROUNDING: f64 = 1e-12;

    fn turning(at_ns: i64) -> UnitQuaternion<f64> {
        let start = UnitQuaternion::from_euler_angles(0.1, -0.3, 2.0);
        start * UnitQuaternion::from_scaled_axis(rate() * (at_ns as f64 * 1e-9))
    }

    fn rate() -> Vector3<f64> {
        Vector3::new(0.2, -0.1, 0.4)
    }

    fn sample(stamp_ns: i64, local_from_body: UnitQuaternion<f64>) -> AttitudeSample {
        AttitudeSample {
            stamp_ns,
            local_from_body,
            rate_in_body: None,
        }
    }

    fn history(stamps_ms: &[i64]) -> AttitudeHistory {
        let mut history = AttitudeHistory::new(LIMIT_S);
        for stamp in stamps_ms {
            history.push(sample(stamp * MS, turning(stamp * MS)));
        }
        history
    }

    #[test]
    fn a_steady_turn_is_followed_between_and_a_little_after_the_samples() {
        let history = history(&[100, 120, 140, 160]);
        for stamp_ms in [100, 101, 120, 133, 160, 175, 210] {
            let found = history.at(stamp_ms * MS).expect("near the samples");
            let error = found.local_from_body.inverse() * turning(stamp_ms * MS);
            assert!(error.scaled_axis().norm() < ROUNDING, "{stamp_ms} ms");
            assert!((found.rate_in_body - rate()).norm() < 1e-9, "{stamp_ms} ms");
        }
    }

    #[test]
    fn measured_rates_are_taken_as_they_are_between_and_after_the_samples() {
        let measured = |share: f64| Vector3::new(0.5, 0.0, 0.0) + Vector3::y() * share;
        let with_rates = |rates: [Option<Vector3<f64>>; 2]| {
            let mut history = AttitudeHistory::new(LIMIT_S);
            for (stamp, rate_in_body) in [100, 120].into_iter().zip(rates) {
                history.push(AttitudeSample {
                    rate_in_body,
                    ..sample(stamp * MS, turning(stamp * MS))
                });
            }
            history
        };
        let both = with_rates([Some(measured(0.0)), Some(measured(1.0))]);
        for (stamp_ms, share) in [(100, 0.0), (105, 0.25), (120, 1.0), (150, 1.0)] {
            let found = both.at(stamp_ms * MS).expect("near the samples");
            assert!((found.rate_in_body - measured(share)).norm() < ROUNDING);
            let error = found.local_from_body.inverse() * turning(stamp_ms * MS);
            assert!(error.scaled_axis().norm() < ROUNDING, "{stamp_ms} ms");
        }
        for rates in [[Some(measured(0.0)), None], [None, Some(measured(1.0))]] {
            let found = with_rates(rates).at(105 * MS).expect("near the samples");
            assert!((found.rate_in_body - rate()).norm() < 1e-9);
        }
        let spinning = Vector3::new(0.0, 0.0, 11.0);
        assert!(matches!(
            with_rates([Some(spinning); 2]).at(105 * MS),
            Err(AttitudeError::Jump { .. })
        ));
    }

    #[test]
    fn what_is_not_near_the_image_in_time_is_not_used() {
        let few = history(&[100]);
        assert_eq!(few.at(100 * MS), Err(AttitudeError::TooFew { got: 1 }));
        assert_eq!(history(&[]).at(0), Err(AttitudeError::TooFew { got: 0 }));
        let sparse = history(&[100, 200, 220]);
        assert!(matches!(
            sparse.at(99 * MS),
            Err(AttitudeError::BeforeFirst { .. })
        ));
        assert!(matches!(
            sparse.at(150 * MS),
            Err(AttitudeError::Gap { .. })
        ));
        assert!(sparse.at(210 * MS).is_ok());
        assert!(sparse.at(270 * MS).is_ok());
        assert!(matches!(
            sparse.at(271 * MS),
            Err(AttitudeError::Stale { .. })
        ));
    }

    /// The attitude for an image of a tenth of a second ago, from samples at 50 Hz with the stamps of a clock that
    /// shows `offset_ms` more than that of the images.
    fn with_a_clock_ahead_by(offset_ms: i64) -> Result<AttitudeAt, AttitudeError> {
        let mut history = AttitudeHistory::new(LIMIT_S);
        for stamp in (0..=2000).step_by(20) {
            history.push(sample((stamp + offset_ms) * MS, turning(stamp * MS)));
        }
        history.at(1900 * MS)
    }

    #[test]
    fn a_clock_that_is_far_off_gives_nothing_in_either_direction() {
        assert!(with_a_clock_ahead_by(0).is_ok());
        for offset_ms in [901, 1500, 100_000] {
            let found = with_a_clock_ahead_by(offset_ms);
            let true_s = offset_ms as f64 * 1e-3 + 0.1;
            assert!(
                matches!(found, Err(AttitudeError::Ahead { by_s, .. }) if (by_s - true_s).abs() < ROUNDING),
                "{offset_ms} ms: {found:?}"
            );
        }
        for offset_ms in [-151, -1500, -100_000] {
            let found = with_a_clock_ahead_by(offset_ms);
            assert!(
                matches!(found, Err(AttitudeError::Stale { .. })),
                "{offset_ms} ms: {found:?}"
            );
        }
    }

    #[test]
    fn a_clock_that_is_a_little_off_turns_the_attitude_by_rate_times_offset() {
        for offset_ms in [-150, 900] {
            let found = with_a_clock_ahead_by(offset_ms).expect("within the limits");
            let error = found.local_from_body.inverse() * turning(1900 * MS);
            let expected = rate() * (offset_ms as f64 * 1e-3);
            assert!((error.scaled_axis() - expected).norm() < ROUNDING);
        }
    }

    #[test]
    fn a_jump_of_the_attitude_gives_nothing_until_it_is_past() {
        let mut history = history(&[100, 120]);
        let turn = UnitQuaternion::from_scaled_axis(Vector3::new(0.0, 0.0, 1.0));
        for stamp in [140, 160] {
            history.push(sample(stamp * MS, turn * turning(stamp * MS)));
        }
        assert!(matches!(
            history.at(130 * MS),
            Err(AttitudeError::Jump { .. })
        ));
        assert!(history.at(150 * MS).is_ok());
        history.clear();
        assert_eq!(history.at(150 * MS), Err(AttitudeError::TooFew { got: 0 }));
    }

    #[test]
    fn stamps_that_repeat_are_left_out_and_a_restart_begins_anew() {
        let mut history = history(&[5000, 5020]);
        history.push(sample(5020 * MS, UnitQuaternion::identity()));
        history.push(sample(5010 * MS, UnitQuaternion::identity()));
        let found = history.at(5015 * MS).expect("two samples");
        assert!((found.rate_in_body - rate()).norm() < 1e-9);
        history.push(sample(1000 * MS, turning(1000 * MS)));
        assert_eq!(history.at(1000 * MS), Err(AttitudeError::TooFew { got: 1 }));
    }

    #[test]
    fn any_stamps_are_answered() {
        let mut history = AttitudeHistory::new(LIMIT_S);
        for stamp in [i64::MIN, 0, i64::MAX] {
            history.push(sample(stamp, UnitQuaternion::identity()));
            for asked in [i64::MIN, -1, 0, i64::MAX] {
                let _ = history.at(asked);
            }
        }
        assert!(history.at(0).is_err());
    }

    #[test]
    fn memory_is_bounded() {
        let mut history = AttitudeHistory::new(LIMIT_S);
        for stamp in 0..5000 {
            history.push(sample(stamp * MS, UnitQuaternion::identity()));
        }
        assert_eq!(history.samples.len(), KEPT);
        assert!(history.at(4999 * MS).is_ok());
    }
}
