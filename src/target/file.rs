//! Reads a marker map's YAML into a checked map; every error has its line.

use nalgebra::Point3;
use serde::Deserialize;
use serde_saphyr::{Location, Spanned};

use super::budget::{self, RawFlex};
use super::check::{MAX_COORDINATE_M, Part, check};
use super::tag_file::{self, RawTag};
use super::{Marker, MarkerMap, MarkerMapError, NamedPoint, Tag};
use crate::yaml::{self, Place};

/// Most points: each costs as much as all others.
const MOST_POINTS: usize = 8;
const MOST_NAME_BYTES: usize = 64;

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMap {
    name: String,
    #[serde(default = "nothing")]
    markers: Spanned<Vec<RawMarker>>,
    #[serde(default)]
    tags: Vec<RawTag>,
    /// For all markers and tags without their own, m.
    sigma: Option<Spanned<f64>>,
    #[serde(default)]
    flex: Vec<RawFlex>,
    /// Whose position is to be protected.
    #[serde(default)]
    points: Vec<RawPoint>,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawPoint {
    name: Spanned<String>,
    x: Spanned<f64>,
    y: Spanned<f64>,
    z: Spanned<f64>,
}

fn nothing() -> Spanned<Vec<RawMarker>> {
    Spanned::new(Vec::new(), Location::UNKNOWN, Location::UNKNOWN)
}

/// `id` is wider than ids are, so that an id out of range is reported as such.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMarker {
    id: Spanned<i64>,
    x: Spanned<f64>,
    y: Spanned<f64>,
    z: Spanned<f64>,
    sigma: Option<Spanned<f64>>,
}

impl MarkerMap {
    /// Returns the checked map from YAML text.
    ///
    /// ```
    /// use tanker_pose::target::MarkerMap;
    ///
    /// let text = "
    /// name: kite
    /// markers:                 # tanker frame, metres: x forward, y left, z up
    ///   - {id: 1, x: 0, y: -1, z: 0}
    ///   - {id: 2, x: 0, y: 1, z: 0}
    ///   - {id: 2, x: 3, y: 0, z: 0}
    /// ";
    /// let error = MarkerMap::from_yaml(text, "kite.yaml").unwrap_err();
    /// assert_eq!(error.to_string(), "kite.yaml:6:10: marker id 2 is already taken at kite.yaml:5:10");
    /// ```
    ///
    /// # Inputs
    /// * `text`: the YAML, in the format shown above; an unknown key is an error.
    /// * `source`: the name of the text in errors, usually its path.
    ///
    /// # Errors
    /// Any [`MarkerMapError`], with line and column of the invalid value.
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, MarkerMapError> {
        read(text, source)
    }
}

fn read(text: &str, source: &str) -> Result<MarkerMap, MarkerMapError> {
    let raw: RawMap = yaml::read(text, source)?;
    let entries = &raw.markers.value;
    let mut markers = entries
        .iter()
        .map(|entry| entry.marker(source))
        .collect::<Result<Vec<_>, MarkerMapError>>()?;
    let tags = tag_file::tags(&raw.tags, source)?;
    check_corner_ids(&markers, &tags, |marker, tag| {
        let at = |id: &Spanned<i64>| Place::at(source, id.referenced);
        (at(&entries[marker].id), at(&raw.tags[tag].id))
    })?;
    markers.extend(tags.iter().flat_map(Tag::corners).map(Marker::from));
    check(&markers, |part| {
        let (id, x, y, z) = match part {
            Part::Markers => return Place::at(source, raw.markers.referenced),
            // Corners follow the single markers, four for each tag.
            Part::Id(index) | Part::Coordinate(index, _) => {
                match index.checked_sub(entries.len()) {
                    None => {
                        let entry = &entries[index];
                        (&entry.id, &entry.x, &entry.y, &entry.z)
                    }
                    Some(corner) => {
                        let entry = &raw.tags[corner / 4];
                        (&entry.id, &entry.x, &entry.y, &entry.z)
                    }
                }
            }
        };
        let location = match part {
            Part::Markers | Part::Id(_) => id.referenced,
            Part::Coordinate(_, 0) => x.referenced,
            Part::Coordinate(_, 1) => y.referenced,
            Part::Coordinate(..) => z.referenced,
        };
        Place::at(source, location)
    })?;
    let of_markers: Vec<_> = markers
        .iter()
        .zip(entries)
        .map(|(marker, entry)| (marker.id, entry.sigma.as_ref()))
        .collect();
    let of_tags: Vec<_> = tags
        .iter()
        .zip(&raw.tags)
        .map(|(tag, entry)| (tag, entry.sigma.as_ref()))
        .collect();
    let budget = budget::budget(
        raw.sigma.as_ref(),
        &of_markers,
        &of_tags,
        &raw.flex,
        &markers,
        source,
    )?;
    let points = points(&raw.points, source)?;
    Ok(MarkerMap::sorted(&raw.name, markers, tags, budget, points))
}

fn points(raw: &[RawPoint], source: &str) -> Result<Vec<NamedPoint>, MarkerMapError> {
    if let Some(extra) = raw.get(MOST_POINTS) {
        return Err(MarkerMapError::TooManyPoints {
            place: Place::at(source, extra.name.referenced),
            got: raw.len(),
            most: MOST_POINTS,
        });
    }
    let mut points: Vec<NamedPoint> = Vec::with_capacity(raw.len());
    for point in raw {
        let name = &point.name.value;
        // The names of points that no file declares.
        let is_taken = ["receptacle", "markers_mean"].contains(&name.as_str());
        let is_named = !is_taken && !name.is_empty() && name.len() <= MOST_NAME_BYTES;
        if !is_named || points.iter().any(|other| other.name == *name) {
            return Err(MarkerMapError::PointName {
                place: Place::at(source, point.name.referenced),
                name: name.clone(),
                most: MOST_NAME_BYTES,
            });
        }
        for (axis, value) in [('x', &point.x), ('y', &point.y), ('z', &point.z)] {
            if !(-MAX_COORDINATE_M..=MAX_COORDINATE_M).contains(&value.value) {
                return Err(MarkerMapError::PointNumber {
                    place: Place::at(source, value.referenced),
                    axis,
                    name: name.clone(),
                    value: value.value,
                    limit_m: MAX_COORDINATE_M,
                });
            }
        }
        points.push(NamedPoint {
            name: name.clone(),
            point_in_tanker: Point3::new(point.x.value, point.y.value, point.z.value),
        });
    }
    Ok(points)
}

impl RawMarker {
    fn marker(&self, source: &str) -> Result<Marker, MarkerMapError> {
        let id = u32::try_from(self.id.value).map_err(|_| MarkerMapError::IdOutOfRange {
            place: Place::at(source, self.id.referenced),
            id: self.id.value,
        })?;
        Ok(Marker {
            id,
            marker_in_tanker: Point3::new(self.x.value, self.y.value, self.z.value),
        })
    }
}

/// Checks that no single marker has the id of a corner; `places` returns the positions of a marker and a tag, by index.
fn check_corner_ids(
    markers: &[Marker],
    tags: &[Tag],
    places: impl Fn(usize, usize) -> (Place, Place),
) -> Result<(), MarkerMapError> {
    for (index, &Marker { id, .. }) in markers.iter().enumerate() {
        let of = Tag::id_of_corner(id);
        if let Some(taken) = tags.iter().position(|tag| Some(tag.id) == of) {
            let (place, tag) = places(index, taken);
            return Err(MarkerMapError::CornerId { place, id, tag });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Three good markers on lines 3 to 5; what is appended begins on line 6.
    const GOOD: &str = "name: kite
markers:
  - {id: 1, x: 0, y: -1.5, z: 0}
  - {id: 2, x: 0, y: 1.5, z: 0}
  - {id: 3, x: 3, y: 0, z: 0.25}
";

    fn refusal_of_sixth_line(line: &str) -> String {
        refusal(&format!("{GOOD}{line}\n")).to_string()
    }

    fn refusal(text: &str) -> MarkerMapError {
        read(text, "m.yaml").expect_err("this map is wrong")
    }

    #[test]
    fn good_text_gives_its_markers() {
        let map = read(GOOD, "m.yaml").expect("a good map");
        assert_eq!(map.name(), "kite");
        assert_eq!(map.get(1), Some(Point3::new(0.0, -1.5, 0.0)));
        assert_eq!(map.get(3), Some(Point3::new(3.0, 0.0, 0.25)));
    }

    #[test]
    fn points_are_read_and_checked() {
        let with = |points: &str| read(&format!("{GOOD}points:\n{points}"), "m.yaml");
        let map = with("  - {name: tail, x: 7.8, y: 0, z: 1}\n").expect("a good map");
        assert_eq!(map.points()[0].name, "tail");
        assert_eq!(map.points()[0].point_in_tanker, Point3::new(7.8, 0.0, 1.0));
        for (text, end) in [
            (
                "  - {name: tail, x: 7.8, y: .nan, z: 1}\n",
                "m.yaml:7:29: y of point \"tail\" must be within 1000 m of the origin, got NaN",
            ),
            (
                "  - {name: a, x: 1, y: 0, z: 1}\n  - {name: a, x: 2, y: 0, z: 1}\n",
                "m.yaml:8:12: a point needs a name of its own of at most 64 bytes, got \"a\"",
            ),
            (
                "  - {name: '', x: 1, y: 0, z: 1}\n",
                "m.yaml:7:12: a point needs a name of its own of at most 64 bytes, got \"\"",
            ),
        ] {
            assert_eq!(with(text).expect_err("a bad point").to_string(), end);
        }
        let many = (0..9).map(|n| format!("  - {{name: p{n}, x: 1, y: 0, z: 1}}\n"));
        let error = with(&many.collect::<Vec<_>>().concat())
            .expect_err("too many")
            .to_string();
        assert!(
            error.ends_with("a map may have at most 8 points, got 9"),
            "{error}"
        );
    }

    #[test]
    fn a_repeated_id_is_refused_with_both_lines() {
        assert_eq!(
            refusal_of_sixth_line("  - {id: 2, x: 1, y: 1, z: 1}"),
            "m.yaml:6:10: marker id 2 is already taken at m.yaml:4:10"
        );
    }

    #[test]
    fn ids_that_detections_cannot_carry_are_refused_at_their_line() {
        assert_eq!(
            refusal_of_sixth_line("  - {id: -1, x: 1, y: 1, z: 1}"),
            "m.yaml:6:10: marker id must be 0 to 4294967295, got -1"
        );
        assert_eq!(
            refusal_of_sixth_line("  - {id: 4294967296, x: 1, y: 1, z: 1}"),
            "m.yaml:6:10: marker id must be 0 to 4294967295, got 4294967296"
        );
        for id in ["1.5", "one", "99999999999999999999", ""] {
            let error = refusal_of_sixth_line(&format!("  - {{id: {id}, x: 1, y: 1, z: 1}}"));
            assert!(error.starts_with("m.yaml:6:"), "{error}");
        }
    }

    #[test]
    fn coordinates_that_are_no_finite_number_are_refused_at_their_line() {
        assert_eq!(
            refusal_of_sixth_line("  - {id: 4, x: 1, y: .nan, z: 1}"),
            "m.yaml:6:22: y of marker 4 must be a finite number of metres, got NaN"
        );
        assert_eq!(
            refusal_of_sixth_line("  - {id: 4, x: 1, y: 1, z: -.inf}"),
            "m.yaml:6:28: z of marker 4 must be a finite number of metres, got -inf"
        );
        for x in ["", "~", "null", "1,5", "1m", "true", "1e999", "[1]"] {
            let error = refusal_of_sixth_line(&format!("  - {{id: 4, x: {x}, y: 1, z: 1}}"));
            assert!(error.starts_with("m.yaml:6:"), "{x}: {error}");
        }
    }

    #[test]
    fn coordinates_no_aircraft_reaches_are_refused_at_their_line() {
        assert_eq!(
            refusal_of_sixth_line("  - {id: 4, x: 10000.5, y: 1, z: 1}"),
            "m.yaml:6:16: x of marker 4 must be within 1000 m of the origin, got 10000.5 m"
        );
        let at_the_limit = format!(
            "{GOOD}  - {{id: 4, x: -1.0e3, y: 1, z: 1}}\n  - {{id: 5, x: 1, y: 1.0e3, z: 1}}\n"
        );
        assert!(read(&at_the_limit, "m.yaml").is_ok());
    }

    #[test]
    fn two_markers_at_one_place_are_refused_with_both_lines() {
        assert_eq!(
            refusal_of_sixth_line("  - {id: 4, x: 3, y: 0, z: 0.25}"),
            "m.yaml:6:10: marker 4 is 0 m from marker 3 at m.yaml:5:10, must be at least 0.001 m"
        );
    }

    #[test]
    fn fewer_than_three_markers_are_refused() {
        let two =
            "name: few\nmarkers:\n  - {id: 1, x: 0, y: 0, z: 0}\n  - {id: 2, x: 1, y: 0, z: 0}\n";
        assert_eq!(
            refusal(two).to_string(),
            "m.yaml:3:3: need at least 3 markers for a pose, got 2"
        );
        assert_eq!(
            refusal("name: none\nmarkers: []\n").to_string(),
            "m.yaml:2:10: need at least 3 markers for a pose, got 0"
        );
    }

    #[test]
    fn markers_on_one_line_are_refused() {
        let text = "name: stick\nmarkers:\n  - {id: 1, x: 0, y: 0, z: 0}\n  - {id: 2, x: 1, y: 1, z: 1}\n  - {id: 3, x: 3, y: 3, z: 3}\n";
        let error = refusal(text);
        assert!(matches!(error, MarkerMapError::OnOneLine { .. }), "{error}");
        assert!(
            error
                .to_string()
                .starts_with("m.yaml:3:3: all markers lie on one line"),
            "{error}"
        );
    }

    #[test]
    fn another_shape_is_refused_at_its_line() {
        let slips = [
            ("name: kite\nmarkers:\n  - {id: 1, x: 0, y: 0}\n", 3),
            (
                "name: kite\nmarkers:\n  - {id: 1, x: 0, y: 0, z: 0, w: 1}\n",
                3,
            ),
            (
                "name: kite\nmarkers:\n  - {id: 1, x: 0, x: 1, y: 0, z: 0}\n",
                3,
            ),
            ("name: kite\nmarkers: 3\n", 2),
            ("name: kite\nmarkers:\n", 2),
            ("name: kite\nbeacons: []\n", 2),
            ("markers: []\n", 1),
            ("name: kite\nmarkers:\n  - {id: 1, x: 0\n", 3),
        ];
        for (text, line) in slips {
            let error = refusal(text);
            assert!(
                matches!(&error, MarkerMapError::Yaml(inner) if inner.place.line() == Some(line)),
                "{text:?} gave {error:?}"
            );
        }
    }
}
