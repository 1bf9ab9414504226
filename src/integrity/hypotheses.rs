//! What may be faulty, how likely that is, and what of it nothing monitors.

use std::fmt;

use smallvec::SmallVec;

use super::IntegritySettings;

/// Beacons up to which pairs are looked at one by one: beyond, their number would take milliseconds a frame.
const MOST_FOR_PAIRS: usize = 64;

/// What is assumed to be faulty, by any amount.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Hypothesis {
    /// One beacon: a marker's id.
    Marker(u32),
    /// All corners of one tag: the tag's id.
    Tag(u32),
    /// Two beacons.
    Pair(Beacon, Beacon),
    /// A mode of the error budget, beyond what its sigma allows: its place among flex, calibration, jitter.
    Mode(usize),
}

/// What fails as a whole.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Beacon {
    /// A marker's id.
    Marker(u32),
    /// A tag's id.
    Tag(u32),
}

impl From<Beacon> for Hypothesis {
    fn from(beacon: Beacon) -> Self {
        match beacon {
            Beacon::Marker(id) => Self::Marker(id),
            Beacon::Tag(id) => Self::Tag(id),
        }
    }
}

impl fmt::Display for Beacon {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Marker(id) => write!(f, "marker {id}"),
            Self::Tag(id) => write!(f, "tag {id}"),
        }
    }
}

/// A beacon with the rows of the frame that it has.
#[derive(Debug, Clone)]
pub(super) struct Unit {
    pub(super) beacon: Beacon,
    pub(super) rows: SmallVec<[usize; 8]>,
}

/// Returns the beacons of a frame, in the order of their first point.
pub(super) fn units(ids: &[u32], beacon_of: impl Fn(u32) -> Beacon) -> SmallVec<[Unit; 16]> {
    let mut units: SmallVec<[Unit; 16]> = SmallVec::new();
    for (index, &id) in ids.iter().enumerate() {
        let beacon = beacon_of(id);
        let rows = [2 * index, 2 * index + 1];
        // Corners of a tag mostly follow each other.
        match units.iter_mut().rev().find(|unit| unit.beacon == beacon) {
            Some(unit) => unit.rows.extend(rows),
            None => units.push(Unit {
                beacon,
                rows: rows.into_iter().collect(),
            }),
        }
    }
    units
}

/// The hypotheses of a frame by their number, and the probability of all others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Plan {
    pub(super) has_pairs: bool,
    /// Number of hypotheses.
    pub(super) count: usize,
    /// Probability of faults that are no hypothesis: of more beacons than are monitored, and of a beacon and a mode.
    pub(super) beyond: f64,
}

impl Plan {
    /// Returns the plan for a number of beacons and modes.
    pub(super) fn new(
        settings: &IntegritySettings,
        beacons: usize,
        flex: usize,
        other: usize,
    ) -> Self {
        let has_pairs = settings.pairs && beacons <= MOST_FOR_PAIRS;
        let monitored = if has_pairs { 2 } else { 1 };
        let p = settings.fault_probability;
        let of_modes = flex as f64 * settings.flex_fault_probability
            + other as f64 * settings.calibration_fault_probability;
        let modes = (if settings.flex_fault_probability > 0.0 {
            flex
        } else {
            0
        }) + (if settings.calibration_fault_probability > 0.0 {
            other
        } else {
            0
        });
        let pairs = if has_pairs {
            beacons * beacons.saturating_sub(1) / 2
        } else {
            0
        };
        // Two modes at once are less likely than half the square of their sum.
        let with_modes = of_modes * beacons as f64 * p + 0.5 * of_modes * of_modes;
        Self {
            has_pairs,
            count: beacons + pairs + modes,
            beyond: more_than(monitored, beacons, p) + with_modes,
        }
    }
}

/// Returns the probability that more than `monitored` of `count` beacons are faulty.
fn more_than(monitored: usize, count: usize, p: f64) -> f64 {
    let mut sum = 0.0;
    // C(n, k) pᵏ (1 − p)ⁿ⁻ᵏ, each from the one before.
    let mut term = (1.0 - p).powi(i32::try_from(count).unwrap_or(i32::MAX));
    for k in 1..=count {
        term *= (count + 1 - k) as f64 / k as f64 * (p / (1.0 - p));
        if k > monitored {
            sum += term;
        }
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn three_faults_of_twelve_are_as_likely_as_their_binomial_says() {
        // 1 − Σ over 0, 1, 2 in arbitrary precision.
        let found = more_than(2, 12, 1e-4);
        assert!(
            (found / 2.198_515_475_107_612e-10 - 1.0).abs() < 1e-12,
            "{found}"
        );
        assert!((more_than(0, 5, 0.5) - 31.0 / 32.0).abs() < 1e-15);
        assert!(more_than(2, 2, 0.1) < f64::MIN_POSITIVE);
    }

    #[test]
    fn corners_of_a_tag_are_one_beacon() {
        let ids = [1, 40, 41, 7, 42, 43];
        let found = units(&ids, |id| {
            if id >= 40 {
                Beacon::Tag(4)
            } else {
                Beacon::Marker(id)
            }
        });
        let beacons: Vec<_> = found.iter().map(|unit| unit.beacon).collect();
        assert_eq!(
            beacons,
            [Beacon::Marker(1), Beacon::Tag(4), Beacon::Marker(7)]
        );
        assert_eq!(found[1].rows.as_slice(), [2, 3, 4, 5, 8, 9, 10, 11]);
    }
}
