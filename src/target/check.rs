//! Requirements on the markers of a map.

use nalgebra::{Matrix3, Point3, Vector3};

use super::{Marker, MarkerMapError};
use crate::yaml::Place;

/// Number of markers that any pose needs.
const MIN_MARKERS: usize = 3;

/// Largest plausible coordinate, m: a hundred times the largest tanker.
pub const MAX_COORDINATE_M: f64 = 1.0e3;

/// Least distance between two markers, m: closer ones are probably one marker entered twice.
const MIN_DISTANCE_M: f64 = 1.0e-3;

/// Least spread of the markers across their best line, relative to the spread along it.
///
/// Second over first singular value of the centred points, so independent of scale. At one thousandth the markers along
/// a 14 m wing deviate from a line by about a centimetre, a third of a pixel if the wing fills the paper's image: the
/// rotation about that line would be noise.
const MIN_SPREAD: f64 = 1.0e-3;

/// A part of a map, for the position of an error.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Part {
    /// All markers together.
    Markers,
    /// Id of the marker with this index.
    Id(usize),
    /// Coordinate (0 to 2) of the marker with this index.
    Coordinate(usize, usize),
}

/// Checks markers in the given order; `place` returns the position of a part in the file.
///
/// # Errors
/// Any [`MarkerMapError`] except those of reading.
pub(super) fn check(
    markers: &[Marker],
    place: impl Fn(Part) -> Place,
) -> Result<(), MarkerMapError> {
    if markers.len() < MIN_MARKERS {
        let place = place(Part::Markers);
        return Err(MarkerMapError::TooFewMarkers {
            place,
            got: markers.len(),
            need: MIN_MARKERS,
        });
    }
    check_ids(markers, &place)?;
    check_coordinates(markers, &place)?;
    check_distances(markers, &place)?;
    let ratio = spread_across_line(markers);
    if ratio < MIN_SPREAD {
        let place = place(Part::Markers);
        return Err(MarkerMapError::OnOneLine {
            place,
            ratio,
            need: MIN_SPREAD,
        });
    }
    Ok(())
}

fn check_ids(markers: &[Marker], place: &impl Fn(Part) -> Place) -> Result<(), MarkerMapError> {
    let mut by_id: Vec<usize> = (0..markers.len()).collect();
    by_id.sort_by_key(|&index| markers[index].id); // stable: of equal ids, the first written comes first
    for pair in by_id.windows(2) {
        let (first, second) = (pair[0], pair[1]);
        if markers[first].id == markers[second].id {
            return Err(MarkerMapError::DuplicateId {
                place: place(Part::Id(second)),
                id: markers[second].id,
                first: place(Part::Id(first)),
            });
        }
    }
    Ok(())
}

fn check_coordinates(
    markers: &[Marker],
    place: &impl Fn(Part) -> Place,
) -> Result<(), MarkerMapError> {
    for (index, marker) in markers.iter().enumerate() {
        let id = marker.id;
        for (coordinate, (axis, &value)) in ['x', 'y', 'z']
            .into_iter()
            .zip(&marker.marker_in_tanker.coords)
            .enumerate()
        {
            let place = || place(Part::Coordinate(index, coordinate));
            if !value.is_finite() {
                return Err(MarkerMapError::NotFinite {
                    place: place(),
                    id,
                    axis,
                    value,
                });
            }
            if value.abs() > MAX_COORDINATE_M {
                let (value_m, limit_m) = (value, MAX_COORDINATE_M);
                return Err(MarkerMapError::TooFar {
                    place: place(),
                    id,
                    axis,
                    value_m,
                    limit_m,
                });
            }
        }
    }
    Ok(())
}

fn check_distances(
    markers: &[Marker],
    place: &impl Fn(Part) -> Place,
) -> Result<(), MarkerMapError> {
    for (index, marker) in markers.iter().enumerate() {
        for (other_index, other) in markers[..index].iter().enumerate() {
            let distance_m = nalgebra::distance(&marker.marker_in_tanker, &other.marker_in_tanker);
            if distance_m < MIN_DISTANCE_M {
                return Err(MarkerMapError::SamePlace {
                    place: place(Part::Id(index)),
                    id: marker.id,
                    other: other.id,
                    other_place: place(Part::Id(other_index)),
                    distance_m,
                    need_m: MIN_DISTANCE_M,
                });
            }
        }
    }
    Ok(())
}

/// Returns the second over the first singular value of the centred points; 0 if they are on one line.
fn spread_across_line(markers: &[Marker]) -> f64 {
    let sum: Vector3<f64> = markers
        .iter()
        .map(|marker| marker.marker_in_tanker.coords)
        .sum();
    let centre = Point3::from(sum / markers.len() as f64);
    let scatter: Matrix3<f64> = markers
        .iter()
        .map(|marker| marker.marker_in_tanker - centre)
        .map(|offset| offset * offset.transpose())
        .sum();
    // Squares of the singular values: their rounding (1e-16) is far below the square of the limit (1e-6).
    let mut squares = scatter.symmetric_eigenvalues();
    squares.as_mut_slice().sort_unstable_by(f64::total_cmp);
    (squares[1].max(0.0) / squares[2]).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Rounding of the eigenvalues, no unit.
    const RATIO_TOLERANCE: f64 = 1.0e-7;

    fn markers(points: &[[f64; 3]]) -> Vec<Marker> {
        (0..)
            .zip(points)
            .map(|(id, point)| Marker {
                id,
                marker_in_tanker: Point3::from(*point),
            })
            .collect()
    }

    #[test]
    fn spread_is_the_ratio_of_singular_values() {
        // Centred cross with arms 5 and 2: singular values √2·5 and √2·2.
        let cross = markers(&[
            [6.0, 0.0, 1.0],
            [-4.0, 0.0, 1.0],
            [1.0, 2.0, 1.0],
            [1.0, -2.0, 1.0],
        ]);
        assert!((spread_across_line(&cross) - 0.4).abs() < RATIO_TOLERANCE);
    }

    #[test]
    fn the_limit_lies_at_one_thousandth() {
        let bent =
            |offset: f64| markers(&[[-10.0, 0.0, 0.0], [10.0, 0.0, 0.0], [0.0, offset, 0.0]]);
        let whole = |_| Place::whole("m");
        // Singular values: 10·√2 along, offset·√(2/3) across; the ratio is offset / (10·√3).
        let limit_m = MIN_SPREAD * 10.0 * 3.0_f64.sqrt();
        assert!(check(&bent(1.01 * limit_m), whole).is_ok());
        assert!(matches!(
            check(&bent(0.99 * limit_m), whole),
            Err(MarkerMapError::OnOneLine { .. })
        ));
    }

    proptest! {
        #[test]
        fn markers_on_any_line_are_refused(
            start in prop::array::uniform3(-50.0..50.0),
            direction in prop::array::uniform3(0.1..1.0),
            steps in prop::collection::btree_set(-30_i32..30, 3..10),
        ) {
            let points: Vec<[f64; 3]> = steps
                .iter()
                .map(|&step| std::array::from_fn(|axis| start[axis] + f64::from(step) * direction[axis]))
                .collect();
            prop_assert!(spread_across_line(&markers(&points)) < 1.0e-6);
        }
    }
}
