//! The time of an image.

/// The time at which an image was taken, in ROS's representation; never converted, so never rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash)]
pub struct Stamp {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds, below 1e9.
    pub nanosec: u32,
}

/// 2 s, in ns: an older pose is not used to initialise the next one.
const MAX_PREVIOUS_AGE_NS: i64 = 2_000_000_000;

impl Stamp {
    /// Returns the time in nanoseconds; 64 bits hold every stamp.
    #[must_use]
    pub const fn nanoseconds(self) -> i64 {
        self.sec as i64 * 1_000_000_000 + self.nanosec as i64
    }

    /// Returns the time in seconds, to a microsecond.
    pub(super) fn seconds(self) -> f64 {
        f64::from(self.sec) + 1e-9 * f64::from(self.nanosec)
    }

    /// Returns the stamp of a time in nanoseconds; `None` if it is out of range.
    pub(super) fn from_nanoseconds(nanoseconds: i64) -> Option<Self> {
        Some(Self {
            sec: i32::try_from(nanoseconds.div_euclid(1_000_000_000)).ok()?,
            nanosec: u32::try_from(nanoseconds.rem_euclid(1_000_000_000)).ok()?,
        })
    }

    /// Returns whether this is at or after `earlier`, by at most [`MAX_PREVIOUS_AGE_NS`].
    pub(super) fn follows_closely(self, earlier: Self) -> bool {
        (0..=MAX_PREVIOUS_AGE_NS).contains(&(self.nanoseconds() - earlier.nanoseconds()))
    }
}
