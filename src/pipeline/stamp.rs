//! The time of an image.

/// The time at which an image was taken, as ROS carries it: never converted, so never rounded.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Default, Hash)]
pub struct Stamp {
    /// Whole seconds.
    pub sec: i32,
    /// Nanoseconds on top, below 1e9.
    pub nanosec: u32,
}

/// 2 s, in ns: a pose older than this says little about the next one.
const MAX_PREVIOUS_AGE_NS: i64 = 2_000_000_000;

impl Stamp {
    /// Returns the whole time in nanoseconds, of which 64 bits hold every stamp there can be.
    #[must_use]
    pub const fn nanoseconds(self) -> i64 {
        self.sec as i64 * 1_000_000_000 + self.nanosec as i64
    }

    /// Returns the time in seconds, to a microsecond.
    pub(super) fn seconds(self) -> f64 {
        f64::from(self.sec) + 1e-9 * f64::from(self.nanosec)
    }

    /// Returns the stamp of a whole time in nanoseconds; `None` where no stamp holds it.
    pub(super) fn from_nanoseconds(nanoseconds: i64) -> Option<Self> {
        Some(Self {
            sec: i32::try_from(nanoseconds.div_euclid(1_000_000_000)).ok()?,
            nanosec: u32::try_from(nanoseconds.rem_euclid(1_000_000_000)).ok()?,
        })
    }

    /// Returns whether this is at or after `earlier`, by [`MAX_PREVIOUS_AGE_NS`] at the most.
    pub(super) fn follows_closely(self, earlier: Self) -> bool {
        (0..=MAX_PREVIOUS_AGE_NS).contains(&(self.nanoseconds() - earlier.nanoseconds()))
    }
}
