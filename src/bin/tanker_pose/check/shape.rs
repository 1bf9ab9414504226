//! The shape of a marker map alone: its size, whether it is flat, and its planes of symmetry.

use nalgebra::{Matrix3, Point3, Vector3};
use tanker_pose::target::{Marker, MarkerMap, MarkerMapError};

use super::finding::Finding;

/// Largest distance between two markers of a plausible tanker, m.
const LARGEST_M: f64 = 100.0;
/// Smallest one: below it no pose is good at any distance, m.
const SMALLEST_M: f64 = 1.0;
/// Spread across the best plane over the largest spread, below which a map counts as flat.
const FLAT: f64 = 0.03;
/// Share of the largest distance by which a marker may be off its mirror image.
const SYMMETRIC: f64 = 0.005;
/// Units that coordinates may be in by mistake: name, and metres of one.
const UNITS: [(&str, f64); 4] = [
    ("mm", 0.001),
    ("cm", 0.01),
    ("inches", 0.0254),
    ("feet", 0.3048),
];

/// Names of the axes, in their order.
const NAMES: [&str; 3] = ["x", "y", "z"];

/// The shape of a map.
#[derive(Debug, Clone)]
pub struct Shape {
    /// Largest distance between two markers, m.
    pub span_m: f64,
    /// Singular values of the centred markers over the largest: 1, across the line, across the plane.
    pub spreads: [f64; 3],
    /// For the plane across each axis: pairs of ids that it exchanges; `None`: it is no plane of symmetry.
    pub mirrors: [Option<Vec<(u32, u32)>>; 3],
}

impl Shape {
    pub fn new(markers: &[Marker]) -> Self {
        let places = || markers.iter().map(|marker| marker.marker_in_tanker);
        let span_m = places()
            .flat_map(|a| places().map(move |b| (a - b).norm()))
            .fold(0.0, f64::max);
        let mean: Vector3<f64> =
            places().map(|place| place.coords).sum::<Vector3<f64>>() / markers.len().max(1) as f64;
        let moments: Matrix3<f64> = places()
            .map(|place| {
                let from_mean = place.coords - mean;
                from_mean * from_mean.transpose()
            })
            .sum();
        let mut squares: Vec<f64> = moments.symmetric_eigenvalues().iter().copied().collect();
        squares.sort_unstable_by(|a, b| b.total_cmp(a));
        let spread = |index: usize| (squares[index].max(0.0) / squares[0]).sqrt();
        let tolerance_m = SYMMETRIC * span_m;
        Self {
            span_m,
            spreads: [0, 1, 2].map(spread),
            mirrors: [0, 1, 2].map(|axis| {
                // The plane x–z is that of the tanker; others may lie anywhere.
                let offset = if axis == 1 { 0.0 } else { mean[axis] };
                mirrored(markers, axis, offset, tolerance_m)
            }),
        }
    }

    /// Returns whether the plane x–z exchanges markers.
    pub fn is_left_right_symmetric(&self) -> bool {
        self.mirrors[1]
            .as_ref()
            .is_some_and(|pairs| !pairs.is_empty())
    }

    /// Returns the findings about the shape.
    pub fn findings(&self) -> Vec<Finding> {
        let mut findings = Vec::new();
        if !(SMALLEST_M..=LARGEST_M).contains(&self.span_m) {
            findings.push(units(self.span_m));
        }
        let flat = self.spreads[2];
        if flat < FLAT {
            findings.push(Finding::warning(
                "flat",
                format!(
                    "the markers lie nearly in one plane: they spread {:.1} % as far across it as along it",
                    100.0 * flat
                ),
                "far away a second pose fits as well; add a beacon off the plane, in depth as seen by the camera",
            ));
        }
        if !self.is_left_right_symmetric() {
            let other = [0, 2].into_iter().find(|&axis| {
                let pairs = self.mirrors[axis].as_ref();
                // A flat map is its own mirror image without any exchange.
                pairs.is_some_and(|pairs| !pairs.is_empty())
            });
            findings.push(match other {
                Some(axis) => Finding::warning(
                    "axes",
                    format!(
                        "the markers are symmetric about a plane across {}, but not about the plane x–z as a tanker is",
                        NAMES[axis]
                    ),
                    format!(
                        "check whether {} and y are exchanged: x points ahead, y left, z up",
                        NAMES[axis]
                    ),
                ),
                None => Finding::note(
                    "asymmetric",
                    "the markers are not symmetric about the plane x–z".to_owned(),
                    "if the beacons of your tanker are, look for a wrong sign or digit in y",
                ),
            });
        }
        findings
    }
}

/// Returns the finding about a map of an implausible size.
///
/// # Inputs
/// * `span_m`: largest distance between two markers, as if the numbers were metres.
pub fn units(span_m: f64) -> Finding {
    let plausible = |factor: f64| (5.0..=LARGEST_M).contains(&(span_m * factor));
    // Of smaller numbers than metres, the likeliest are kilometres: a map in metres divided by 1000 once more.
    let unit = if span_m < SMALLEST_M {
        Some(("km", 1000.0))
    } else {
        UNITS.into_iter().find(|(_, factor)| plausible(*factor))
    };
    let advice = match unit {
        Some((name, factor)) => format!(
            "coordinates in {name}? They must be in metres: multiply all of them by {factor}, which makes it {:.3} m",
            span_m * factor
        ),
        None => "coordinates must be in metres".to_owned(),
    };
    let found = format!(
        "the markers are up to {span_m:.3} m apart, which is no tanker ({SMALLEST_M} m to {LARGEST_M} m)"
    );
    Finding::error("units", found, advice)
}

/// Returns the finding about a map that cannot be read because of its coordinates, if that is the reason.
pub fn of_refusal(error: &MarkerMapError) -> Option<Finding> {
    match error {
        MarkerMapError::TooFar { value_m, .. } => {
            let mut finding = units(2.0 * value_m.abs());
            finding.found = error.to_string();
            Some(finding)
        }
        MarkerMapError::SamePlace { .. } => Some(Finding::error(
            "units",
            error.to_string(),
            "one beacon entered twice, or coordinates in km? They must be in metres",
        )),
        _ => None,
    }
}

/// Returns the pairs of ids that a mirror exchanges, if it maps the markers to themselves.
fn mirrored(
    markers: &[Marker],
    axis: usize,
    offset_m: f64,
    tolerance_m: f64,
) -> Option<Vec<(u32, u32)>> {
    let mut pairs = Vec::new();
    for marker in markers {
        let mut image: Point3<f64> = marker.marker_in_tanker;
        image[axis] = 2.0 * offset_m - image[axis];
        let partner = markers
            .iter()
            .map(|other| ((other.marker_in_tanker - image).norm(), other.id))
            .min_by(|a, b| a.0.total_cmp(&b.0))?;
        if partner.0 > tolerance_m {
            return None;
        }
        if marker.id < partner.1 {
            pairs.push((marker.id, partner.1));
        }
    }
    Some(pairs)
}

/// Returns the findings about a map's shape.
pub fn lint(map: &MarkerMap) -> (Shape, Vec<Finding>) {
    let shape = Shape::new(map.markers());
    let findings = shape.findings();
    (shape, findings)
}
