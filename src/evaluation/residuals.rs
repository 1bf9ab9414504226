//! Residuals by marker, and which marker is not where the map has it.
//!
//! With `r` the residuals of a frame at the published pose, `J` their derivative by the pose and `W` the inverse variances
//! of the detections, `M = W − W J (JᵀWJ)⁻¹ JᵀW` takes away what another pose explains. `M r` therefore does not depend on
//! how the node has weighted the points. If one marker alone is off by `d`, its part of `M r` has the mean `M_ii B d`, with
//! `B` the derivative of its pixel by its place: `d` follows from all frames by least squares.

use std::collections::{BTreeMap, BTreeSet};

use nalgebra::{
    Isometry3, Matrix2, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Vector2, Vector3, Vector6,
};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::gather::Gathered;
use super::report::{MarkerReport, ResidualReport, SuspectReport};
use super::settings::Settings;
use super::statistics::{MeanOf, independent_count};
use crate::camera::{Camera, Ray};
use crate::geometry::skew;
use crate::pipeline::{Detection, Stamp};
use crate::target::MarkerMap;

/// Probability of a displacement, times the number of markers, below which it is named.
const SUSPICIOUS: f64 = 1e-3;
/// Standard deviations that the node takes, px.
const SIGMAS_PX: std::ops::RangeInclusive<f64> = 1e-3..=1e3;
/// Farther from its marker's projection, px, a detection is of no image that the pose is of.
const MOST_PX: f64 = 1e5;
/// Least number of frames for a displacement.
const LEAST_FRAMES: usize = 10;

/// One detection against the projection of its marker.
struct Row {
    id: u32,
    is_used: bool,
    sigma_px: f64,
    residual_px: Vector2<f64>,
    by_pose: Matrix2x6<f64>,
    by_place: Matrix2x3<f64>,
}

/// What one frame says of one marker.
struct Sample {
    residual_px: Vector2<f64>,
    sigma_px: f64,
    /// `M_ii`, 1/px².
    information: Matrix2<f64>,
    /// `(M r)_i`, 1/px.
    score: Vector2<f64>,
    by_place: Matrix2x3<f64>,
}

impl Sample {
    /// Returns the score that a displacement leaves, of zero mean and unit variance.
    fn left_by(&self, displacement_m: &Vector3<f64>) -> Option<Vector2<f64>> {
        let left = self.score - self.information * self.by_place * displacement_m;
        self.information
            .cholesky()?
            .l()
            .solve_lower_triangular(&left)
    }
}

#[derive(Default)]
struct Marker {
    samples: Vec<Sample>,
    used: u64,
    rejected: u64,
}

/// Returns the residuals by marker; `None` without frames that have a pose, detections and a camera.
pub(super) fn residual_report(found: &Gathered, settings: &Settings) -> Option<ResidualReport> {
    let mut used: BTreeMap<i64, (BTreeSet<u32>, BTreeSet<u32>)> = BTreeMap::new();
    for status in &found.statuses {
        let ids = |ids: &[u32]| ids.iter().copied().collect();
        let stamp_ns = Stamp::from(status.header.stamp).nanoseconds();
        used.insert(stamp_ns, (ids(&status.used_ids), ids(&status.rejected_ids)));
    }
    let mut markers: BTreeMap<u32, Marker> = BTreeMap::new();
    let mut frames = 0;
    let mut poses: Vec<_> = found.poses.iter().collect();
    poses.sort_by_key(|pose| pose.stamp_ns);
    poses.dedup_by_key(|pose| pose.stamp_ns);
    for pose in poses {
        let Some(seen) = found.seen.get(&pose.stamp_ns) else {
            continue;
        };
        let Some(camera) = &seen.camera else { continue };
        let of_status = used.get(&pose.stamp_ns);
        let is_used = |id: u32| of_status.is_none_or(|(used, _)| used.contains(&id));
        let rows: Vec<Row> = seen
            .detections
            .iter()
            .filter_map(|seen| {
                let row = row(
                    seen,
                    &pose.camera_from_tanker,
                    camera,
                    &settings.map,
                    settings.pixel_sigma_px,
                )?;
                Some(Row {
                    is_used: is_used(row.id),
                    ..row
                })
            })
            .collect();
        let Some(samples) = samples(&rows) else {
            continue;
        };
        frames += 1;
        for (row, sample) in rows.iter().zip(samples) {
            let marker = markers.entry(row.id).or_default();
            marker.used += u64::from(row.is_used);
            let is_rejected = of_status.is_some_and(|(_, rejected)| rejected.contains(&row.id));
            marker.rejected += u64::from(is_rejected);
            marker.samples.extend(sample);
        }
    }
    let markers: Vec<MarkerReport> = markers
        .iter()
        .filter_map(|(id, marker)| marker.report(*id, &settings.map))
        .collect();
    (frames > 0).then(|| ResidualReport {
        frames,
        suspect: suspect(&markers),
        markers,
    })
}

/// Returns a detection against its marker; `None` where that has no pixel, or the detection no use.
fn row(
    seen: &Detection,
    camera_from_tanker: &Isometry3<f64>,
    camera: &Camera,
    map: &MarkerMap,
    default_sigma_px: f64,
) -> Option<Row> {
    let marker_in_tanker = map.get(seen.id)?;
    let sigma_px = if seen.sigma_px == 0.0 {
        default_sigma_px
    } else {
        seen.sigma_px
    };
    let turned = camera_from_tanker.rotation * marker_in_tanker.coords;
    let point = turned + camera_from_tanker.translation.vector;
    let is_usable = SIGMAS_PX.contains(&sigma_px) && point.z > 0.0;
    if !is_usable {
        return None;
    }
    let (x, y) = (point.x / point.z, point.y / point.z);
    let (pixel, by_ray) = camera.project(Ray { x, y })?;
    let residual_px = Vector2::new(seen.u_px - pixel.u, seen.v_px - pixel.v);
    // NaN is not.
    let is_near = residual_px.norm() < MOST_PX;
    if !is_near {
        return None;
    }
    let by_point = by_ray * Matrix2x3::new(1.0, 0.0, -x, 0.0, 1.0, -y) / point.z;
    let mut by_pose = Matrix2x6::zeros();
    by_pose.fixed_view_mut::<2, 3>(0, 0).copy_from(&by_point);
    // δ(R p) = δθ × R p.
    let by_turn = by_point * -skew(turned);
    by_pose.fixed_view_mut::<2, 3>(0, 3).copy_from(&by_turn);
    Some(Row {
        id: seen.id,
        is_used: true,
        sigma_px,
        residual_px,
        by_pose,
        by_place: by_point * camera_from_tanker.rotation.to_rotation_matrix().matrix(),
    })
}

/// Returns what a frame says of each of its rows; `None` if the rows in use do not determine a pose.
fn samples(rows: &[Row]) -> Option<Vec<Option<Sample>>> {
    let mut normal = Matrix6::zeros();
    let mut gradient = Vector6::zeros();
    for row in rows.iter().filter(|row| row.is_used) {
        let weight = row.sigma_px.powi(-2);
        normal += row.by_pose.transpose() * row.by_pose * weight;
        gradient += row.by_pose.transpose() * row.residual_px * weight;
    }
    let covariance = normal.cholesky()?.inverse();
    let step = covariance * gradient;
    let sample = |row: &Row| {
        let variance = row.sigma_px * row.sigma_px;
        let of_pose = row.by_pose * covariance * row.by_pose.transpose();
        let left = row.residual_px - row.by_pose * step;
        let (information, score) = if row.is_used {
            let information = (Matrix2::identity() - of_pose / variance) / variance;
            (information, left / variance)
        } else {
            let information = (Matrix2::identity() * variance + of_pose).try_inverse()?;
            (information, information * left)
        };
        // A point that the pose rests on alone says nothing of itself.
        let redundancy = information.symmetric_eigenvalues().min() * variance;
        (redundancy > 1e-6).then_some(Sample {
            residual_px: row.residual_px,
            sigma_px: row.sigma_px,
            information,
            score,
            by_place: row.by_place,
        })
    };
    Some(rows.iter().map(sample).collect())
}

/// How far a marker is from its place.
struct Displacement {
    place_m: Vector3<f64>,
    sigma_m: Vector3<f64>,
    chi_squared: f64,
    independent: f64,
}

impl Marker {
    fn report(&self, id: u32, map: &MarkerMap) -> Option<MarkerReport> {
        if self.samples.is_empty() {
            return None;
        }
        let count = self.samples.len() as f64;
        let sum: Vector2<f64> = self.samples.iter().map(|sample| sample.residual_px).sum();
        let mean = sum / count;
        let squares: Vector2<f64> = (self.samples.iter())
            .map(|sample| (sample.residual_px - mean).map(|value| value * value))
            .sum();
        let sigma = squares.map(|sum| (sum / (count - 1.0).max(1.0)).sqrt());
        let chi = self
            .samples
            .iter()
            .filter_map(|sample| sample.left_by(&Vector3::zeros()))
            .map(|left| left.norm_squared());
        let displacement = self.displacement();
        let survey = map.budget().survey_sigma_m.iter();
        let array = |vector: Vector3<f64>| [vector.x, vector.y, vector.z];
        let chi_squared = displacement.as_ref().map(|found| found.chi_squared);
        Some(MarkerReport {
            id,
            frames: self.samples.len() as u64,
            used: self.used,
            rejected: self.rejected,
            mean_px: [mean.x, mean.y],
            sigma_px: [sigma.x, sigma.y],
            stated_sigma_px: self.samples.iter().map(|s| s.sigma_px).sum::<f64>() / count,
            chi_squared_mean: chi.sum::<f64>() / count,
            displacement_m: displacement.as_ref().map(|found| array(found.place_m)),
            displacement_sigma_m: displacement.as_ref().map(|found| array(found.sigma_m)),
            displacement_chi_squared: chi_squared,
            displacement_p_value: chi_squared
                .and_then(|value| Some(ChiSquared::new(3.0).ok()?.sf(value))),
            independent_frames: displacement.map_or(count, |found| found.independent),
            survey_sigma_m: survey
                .filter(|(of, sigma_m)| *of == id && *sigma_m > 0.0)
                .map(|(_, sigma_m)| *sigma_m)
                .next(),
        })
    }

    /// Returns the displacement that explains the scores of all frames best; `None` if they do not determine it.
    fn displacement(&self) -> Option<Displacement> {
        if self.samples.len() < LEAST_FRAMES {
            return None;
        }
        let mut normal = Matrix3::zeros();
        let mut gradient = Vector3::zeros();
        for sample in &self.samples {
            normal += sample.by_place.transpose() * sample.information * sample.by_place;
            gradient += sample.by_place.transpose() * sample.score;
        }
        let covariance = normal.cholesky()?.inverse();
        let place_m = covariance * gradient;
        let left: Vec<Vector2<f64>> = self
            .samples
            .iter()
            .filter_map(|sample| sample.left_by(&place_m))
            .collect();
        let independent = independent_count(&left, MeanOf::Values);
        let count = left.len() as f64;
        let squares: f64 = left.iter().map(nalgebra::Matrix::norm_squared).sum();
        // Noise beyond what the detections state makes the displacement less certain; less noise is not believed.
        let inflated = (squares / (2.0 * count)).max(1.0) * count / independent;
        let variances = covariance.diagonal() * inflated;
        Some(Displacement {
            place_m,
            sigma_m: variances.map(f64::sqrt),
            chi_squared: gradient.dot(&place_m) / inflated,
            independent,
        })
    }
}

fn suspect(markers: &[MarkerReport]) -> Option<SuspectReport> {
    let chi = |marker: &MarkerReport| marker.displacement_chi_squared;
    let mut by_chi: Vec<&MarkerReport> = markers.iter().filter(|m| chi(m).is_some()).collect();
    by_chi.sort_by(|a, b| chi(b).unwrap_or(0.0).total_cmp(&chi(a).unwrap_or(0.0)));
    let first = by_chi.first()?;
    // Of several markers one is the worst by chance.
    let p_value = (first.displacement_p_value? * by_chi.len() as f64).min(1.0);
    let next = by_chi.get(1).and_then(|next| chi(next));
    (p_value < SUSPICIOUS).then(|| SuspectReport {
        id: first.id,
        p_value,
        lead: next
            .zip(chi(first))
            .map(|(next, first)| first / next.max(1e-9)),
    })
}
