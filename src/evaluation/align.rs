//! Estimates and the truth of the same time.

use nalgebra::{Isometry3, Vector6};

use super::gather::StampedPose;
use crate::geometry::{PoseCovariance, pose_error};

/// Truths farther apart are not interpolated between, ns: at 0.2 g the line between two of them is then off by 5 mm.
const MAX_GAP_NS: i64 = 150_000_000;
/// Largest difference of the two halves of a covariance, by the sigmas.
const ROUNDING: f64 = 1e-9;

/// An estimate with its truth.
#[derive(Debug, Clone)]
pub(super) struct Compared {
    pub(super) stamp_ns: i64,
    pub(super) estimate: Isometry3<f64>,
    pub(super) truth: Isometry3<f64>,
    /// Truth minus estimate, in the order of [`PoseCovariance`].
    pub(super) error: Vector6<f64>,
    /// `None` where it is not positive definite.
    pub(super) covariance: Option<PoseCovariance>,
    /// Error in units of the covariance's root; zero mean and unit variance on all axes if that is honest.
    pub(super) normalised: Option<Vector6<f64>>,
}

impl Compared {
    /// Returns the squared error in units of its covariance.
    pub(super) fn nees(&self) -> Option<f64> {
        self.normalised.as_ref().map(nalgebra::Matrix::norm_squared)
    }

    /// Returns the true distance of the tanker's origin, m.
    pub(super) fn range_m(&self) -> f64 {
        self.truth.translation.vector.norm()
    }

    pub(super) fn sigma(&self, axis: usize) -> Option<f64> {
        let covariance = self.covariance.as_ref()?;
        Some(covariance.0[(axis, axis)].max(0.0).sqrt())
    }
}

/// The truth, by its stamps.
#[derive(Debug, Default)]
pub(super) struct Truth {
    /// Ascending stamp, each once.
    poses: Vec<(i64, Isometry3<f64>)>,
}

/// What the truth has for some estimates.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub(super) struct Matches {
    pub(super) exact: u64,
    pub(super) interpolated: u64,
    pub(super) without: u64,
}

impl Truth {
    pub(super) fn new(found: &[StampedPose]) -> Self {
        let mut poses: Vec<_> = found
            .iter()
            .map(|truth| (truth.stamp_ns, truth.camera_from_tanker))
            .collect();
        // Stable: of the same stamp the first stays.
        poses.sort_by_key(|(stamp_ns, _)| *stamp_ns);
        poses.dedup_by_key(|(stamp_ns, _)| *stamp_ns);
        Self { poses }
    }

    pub(super) fn len(&self) -> usize {
        self.poses.len()
    }

    pub(super) fn poses(&self) -> &[(i64, Isometry3<f64>)] {
        &self.poses
    }

    /// Returns the pose at a time, and whether it is one of the truth's own; `None` where the truth has none near enough.
    pub(super) fn at(&self, stamp_ns: i64) -> Option<(Isometry3<f64>, bool)> {
        let after = match self
            .poses
            .binary_search_by_key(&stamp_ns, |(stamp, _)| *stamp)
        {
            Ok(index) => return Some((self.poses[index].1, true)),
            Err(index) => index,
        };
        let (from_ns, from) = self.poses.get(after.checked_sub(1)?)?;
        let (to_ns, to) = self.poses.get(after)?;
        let length_ns = to_ns.checked_sub(*from_ns)?;
        if length_ns > MAX_GAP_NS {
            return None;
        }
        let share = (stamp_ns - from_ns) as f64 / length_ns as f64;
        let between = from.try_lerp_slerp(to, share, 1e-9)?;
        Some((between, false))
    }

    /// Returns the estimates that have a truth, in the order of their stamps, each stamp once.
    pub(super) fn compare(&self, estimates: &[StampedPose]) -> (Vec<Compared>, Matches) {
        let mut matches = Matches::default();
        let mut compared = Vec::new();
        for estimate in estimates {
            let Some((truth, is_exact)) = self.at(estimate.stamp_ns) else {
                matches.without += 1;
                continue;
            };
            if is_exact {
                matches.exact += 1;
            } else {
                matches.interpolated += 1;
            }
            let error = pose_error(&truth, &estimate.camera_from_tanker);
            let stated = symmetric(&estimate.covariance);
            let root = stated
                .filter(PoseCovariance::is_valid)
                .and_then(|stated| stated.0.cholesky());
            compared.push(Compared {
                stamp_ns: estimate.stamp_ns,
                estimate: estimate.camera_from_tanker,
                truth,
                error,
                covariance: stated.filter(|_| root.is_some()),
                normalised: root
                    .and_then(|root| root.l().solve_lower_triangular(&error))
                    .filter(|normalised| normalised.norm_squared().is_finite()),
            });
        }
        compared.sort_by_key(|frame| frame.stamp_ns);
        compared.dedup_by_key(|frame| frame.stamp_ns);
        (compared, matches)
    }
}

/// Returns the symmetric part of a covariance, whose halves other estimators may have rounded differently; `None` where
/// they are further apart.
fn symmetric(stated: &PoseCovariance) -> Option<PoseCovariance> {
    let half = (stated.0 + stated.0.transpose()) * 0.5;
    let is_near = (0..6).all(|row| {
        (0..row).all(|column| {
            let scale = (half[(row, row)] * half[(column, column)]).abs().sqrt();
            (stated.0[(row, column)] - half[(row, column)]).abs() <= ROUNDING * scale
        })
    });
    is_near.then_some(PoseCovariance(half))
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix6, Vector3};

    fn pose(stamp_ns: i64, z: f64, turn: f64) -> StampedPose {
        StampedPose {
            stamp_ns,
            camera_from_tanker: Isometry3::new(
                Vector3::new(0.0, 0.0, z),
                Vector3::new(0.0, turn, 0.0),
            ),
            covariance: PoseCovariance(Matrix6::identity() * 4.0),
            twist: None,
        }
    }

    #[test]
    fn truth_is_taken_at_its_stamps_between_near_ones_and_nowhere_else() {
        let truth = Truth::new(&[
            pose(300_000_000, 9.0, 0.0),
            pose(0, 10.0, 0.0),
            pose(100_000_000, 12.0, 0.2),
        ]);
        assert_eq!(
            truth.at(0),
            Some((pose(0, 10.0, 0.0).camera_from_tanker, true))
        );
        let (between, is_exact) = truth.at(50_000_000).expect("between two");
        assert!(!is_exact && (between.translation.z - 11.0).abs() < 1e-12);
        assert!((between.rotation.angle() - 0.1).abs() < 1e-9);
        // Too far apart, before the first, after the last.
        for stamp_ns in [200_000_000, -1, 300_000_001] {
            assert_eq!(truth.at(stamp_ns), None);
        }
    }

    #[test]
    fn error_is_truth_minus_estimate_and_nees_in_units_of_the_covariance() {
        let truth = Truth::new(&[pose(0, 10.0, 0.3)]);
        let (compared, matches) = truth.compare(&[pose(0, 9.0, 0.2), pose(7, 9.0, 0.2)]);
        assert_eq!(
            (matches.exact, matches.interpolated, matches.without),
            (1, 0, 1)
        );
        let frame = &compared[0];
        assert!((frame.error[2] - 1.0).abs() < 1e-12 && (frame.error[4] - 0.1).abs() < 1e-9);
        assert!((frame.nees().expect("a covariance") - 1.01 / 4.0).abs() < 1e-9);
    }

    #[test]
    fn estimate_without_a_covariance_has_an_error_and_no_nees() {
        let truth = Truth::new(&[pose(0, 10.0, 0.0)]);
        let bare = StampedPose {
            covariance: PoseCovariance(Matrix6::zeros()),
            ..pose(0, 9.0, 0.0)
        };
        let (compared, _) = truth.compare(&[bare]);
        assert_eq!((compared[0].nees(), compared[0].sigma(0)), (None, None));
    }
}
