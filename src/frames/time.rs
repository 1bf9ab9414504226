//! Conversion between ROS stamps (whole nanoseconds) and PX4 timestamps (unsigned microseconds).

/// Why a time cannot be converted.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum TimeError {
    /// At or before the start of PX4's clock; PX4 interprets 0 as "not set".
    #[error("expected a stamp after the start of PX4's clock, got {px4_us} us on it")]
    BeforePx4Clock {
        /// The converted time, µs.
        px4_us: i128,
    },
    /// Outside the range of 64 bits of nanoseconds.
    #[error("expected a time within 292 years of the epoch, got {ros_us} us")]
    BeyondRosTime {
        /// µs since the epoch of ROS time.
        ros_us: i128,
    },
    /// A PX4 timestamp of zero.
    #[error("expected a PX4 timestamp, got 0, which means not set")]
    NotSet,
}

/// Returns PX4's time of a ROS stamp, whole microseconds, rounded towards the past.
///
/// `px4_minus_ros_us` is PX4's clock minus ROS's: 0 if the bridge converts the times (uXRCE-DDS with its time
/// synchronisation), otherwise a large negative number, since PX4 counts from its start.
///
/// # Errors
/// [`TimeError::BeforePx4Clock`] for a result of zero or below.
pub fn px4_us_from_ros_ns(stamp_ns: i64, px4_minus_ros_us: i64) -> Result<u64, TimeError> {
    // Euclidean division rounds towards the past on both sides of the epoch, so order is preserved.
    let px4_us = i128::from(stamp_ns.div_euclid(1000)) + i128::from(px4_minus_ros_us);
    match u64::try_from(px4_us) {
        Ok(us) if us > 0 => Ok(us),
        _ => Err(TimeError::BeforePx4Clock { px4_us }),
    }
}

/// Returns the ROS stamp of a PX4 time, ns.
///
/// # Errors
/// [`TimeError::NotSet`] for zero, [`TimeError::BeyondRosTime`] for times outside the range of nanoseconds.
pub fn ros_ns_from_px4_us(px4_us: u64, px4_minus_ros_us: i64) -> Result<i64, TimeError> {
    if px4_us == 0 {
        return Err(TimeError::NotSet);
    }
    let ros_us = i128::from(px4_us) - i128::from(px4_minus_ros_us);
    i64::try_from(ros_us * 1000).map_err(|_| TimeError::BeyondRosTime { ros_us })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn whole_microseconds_go_there_and_back() {
        for (stamp_ns, offset_us) in [
            (1_700_000_000_123_456_000, 0),
            (1_700_000_000_123_456_000, -1_699_999_000_000_000),
            (1_000, 0),
            (-5_000, 6),
        ] {
            let px4_us = px4_us_from_ros_ns(stamp_ns, offset_us).expect("after the start");
            assert_eq!(ros_ns_from_px4_us(px4_us, offset_us), Ok(stamp_ns));
        }
        assert_eq!(px4_us_from_ros_ns(1_999, 0), Ok(1));
        assert_eq!(px4_us_from_ros_ns(-1, 2), Ok(1));
    }

    #[test]
    fn times_without_a_counterpart_are_errors() {
        assert_eq!(
            px4_us_from_ros_ns(999, 0),
            Err(TimeError::BeforePx4Clock { px4_us: 0 })
        );
        assert_eq!(
            px4_us_from_ros_ns(i64::MIN, i64::MIN),
            Err(TimeError::BeforePx4Clock {
                px4_us: -9_223_372_036_854_776 - 9_223_372_036_854_775_808
            })
        );
        assert!(px4_us_from_ros_ns(i64::MAX, i64::MAX).is_ok());
        assert_eq!(ros_ns_from_px4_us(0, 0), Err(TimeError::NotSet));
        assert_eq!(
            ros_ns_from_px4_us(u64::MAX, 0),
            Err(TimeError::BeyondRosTime {
                ros_us: i128::from(u64::MAX)
            })
        );
    }
}
