//! A marker map as YAML, with markers moved and sigmas and modes of their errors.

use std::collections::BTreeMap;
use std::fmt::Write as _;

use nalgebra::Vector3;

use super::budget::CORNER_FACTOR;
use super::{Flex, MarkerMap, MarkerMapError, Tag};

/// Name of the modes in which markers are wrong together after a calibration; a number follows.
pub const MAP_ERROR: &str = "map_error_";

/// The last digit of positions and sigmas, m. Sigmas are rounded upwards.
const DIGIT_M: f64 = 1e-5;

/// What changes in a map.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapChange {
    /// Single markers by id.
    pub markers: BTreeMap<u32, BodyChange>,
    /// Tags by id.
    pub tags: BTreeMap<u32, BodyChange>,
    /// All modes of the new map.
    pub flex: Vec<Flex>,
}

/// What changes of a marker or a tag.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct BodyChange {
    /// By how much it moves, m.
    pub shift_in_tanker: Vector3<f64>,
    /// The new standard deviation of each coordinate, m.
    pub sigma_m: f64,
}

impl MarkerMap {
    /// Returns the map with these changes, as it will be read from [`Self::to_yaml`].
    ///
    /// # Errors
    /// [`MarkerMapError`] when the result breaks a rule of maps.
    pub fn changed(&self, change: &MapChange) -> Result<Self, MarkerMapError> {
        Self::from_yaml(&self.to_yaml(change), "the written map")
    }

    /// Returns the map with these changes as YAML; what does not change keeps its digits.
    #[must_use]
    pub fn to_yaml(&self, change: &MapChange) -> String {
        let mut text = format!("name: {}\n", quoted(self.name()));
        let singles = self
            .markers()
            .iter()
            .filter(|marker| self.tag_of_corner(marker.id).is_none());
        let lines: Vec<String> = singles
            .map(|marker| {
                let by = change.markers.get(&marker.id);
                let place = place(marker.marker_in_tanker.coords, by);
                let sigma = self.sigma_of(marker.id, 1.0, by);
                format!("  - {{id: {}, {place}{sigma}}}\n", marker.id)
            })
            .collect();
        if !lines.is_empty() {
            text += "markers:                      # m, tanker frame\n";
            text += &lines.concat();
        }
        if !self.tags().is_empty() {
            text += "tags:\n";
        }
        for tag in self.tags() {
            text += &self.tag_line(tag, change.tags.get(&tag.id));
        }
        if !change.flex.is_empty() {
            text += "flex:\n";
        }
        for mode in &change.flex {
            text += &flex(mode);
        }
        if !self.points().is_empty() {
            text += "points:\n";
        }
        for point in self.points() {
            let place = place(point.point_in_tanker.coords, None);
            // Writing into a string cannot fail.
            let _ = writeln!(text, "  - {{name: {}, {place}}}", quoted(&point.name));
        }
        text
    }

    fn tag_line(&self, tag: &Tag, by: Option<&BodyChange>) -> String {
        let place = place(tag.tanker_from_tag.translation.vector, by);
        let (roll, pitch, yaw) = tag.tanker_from_tag.rotation.euler_angles();
        let [roll, pitch, yaw] = [roll, pitch, yaw].map(f64::to_degrees);
        let family = tag.family.as_ref().map_or_else(String::new, |family| {
            format!("family: {}, ", quoted(family))
        });
        let first = tag.corners()[0].0;
        let sigma = self.sigma_of(first, CORNER_FACTOR, by);
        format!(
            "  - {{id: {}, {family}size_m: {}, {place}, roll_deg: {roll:.9}, pitch_deg: {pitch:.9}, yaw_deg: {yaw:.9}{sigma}}}\n",
            tag.id, tag.size_m
        )
    }

    /// Returns the sigma of a body, the new one or that of the map.
    fn sigma_of(&self, point: u32, factor: f64, by: Option<&BodyChange>) -> String {
        let of_map = || {
            let known = self.budget().survey_sigma_m.iter();
            let own = known.clone().find(|(id, _)| *id == point);
            own.map_or(0.0, |(_, sigma)| sigma / factor)
        };
        let sigma = by.map_or_else(of_map, |by| rounded_up(by.sigma_m));
        if sigma > 0.0 {
            format!(", sigma: {sigma}")
        } else {
            String::new()
        }
    }
}

fn place(at: Vector3<f64>, by: Option<&BodyChange>) -> String {
    let coordinate = |axis: usize| {
        let shift = by.map_or(0.0, |by| by.shift_in_tanker[axis]);
        if shift == 0.0 {
            format!("{}", at[axis])
        } else {
            format!("{:.5}", at[axis] + shift)
        }
    };
    format!(
        "x: {}, y: {}, z: {}",
        coordinate(0),
        coordinate(1),
        coordinate(2)
    )
}

/// Rounding must not make a sigma smaller.
fn rounded_up(sigma_m: f64) -> f64 {
    let digits = (sigma_m / DIGIT_M).ceil();
    // Not digits · DIGIT_M, whose decimal digits would not end.
    digits / DIGIT_M.recip().round()
}

fn flex(mode: &Flex) -> String {
    let mut text = format!(
        "  - name: {}\n    sigma: {}\n",
        quoted(&mode.name),
        mode.sigma_m
    );
    if let Some(time_constant_s) = mode.time_constant_s {
        // Writing into a string cannot fail.
        let _ = writeln!(text, "    time_constant_s: {time_constant_s}");
    }
    text += "    shape:\n";
    for (id, shift) in &mode.shape {
        let _ = writeln!(
            text,
            "      - {{id: {id}, x: {}, y: {}, z: {}}}",
            shift.x, shift.y, shift.z
        );
    }
    text
}

/// A name as YAML reads it back: JSON's strings are YAML's.
fn quoted(name: &str) -> String {
    serde_json::Value::from(name).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MAP: &str = "name: 'kite: 2'
sigma: 0.02
markers:
  - {id: 1, x: 0.1, y: -1.5, z: 0}
  - {id: 2, x: 0, y: 1.5, z: 0, sigma: 0.005}
  - {id: 3, x: 3, y: 0, z: 0.25, sigma: 0}
tags:
  - {id: 7, size_m: 0.5, family: tag36h11, x: 3, y: 1, z: 2, roll_deg: 90, pitch_deg: 1, yaw_deg: -80, sigma: 0.01}
flex:
  - {name: wing, sigma: 0.2, time_constant_s: 3, shape: [{id: 1, z: 1}, {tag: 7, z: 0.5}]}
points:
  - {name: tail, x: 7.8, y: 0, z: 1}
";

    fn map() -> MarkerMap {
        MarkerMap::from_yaml(MAP, "m.yaml").expect("a good map")
    }

    #[test]
    fn a_map_that_does_not_change_is_read_back_as_it_was() {
        let map = map();
        let same = MapChange {
            flex: map.budget().flex.clone(),
            ..MapChange::default()
        };
        let read = map.changed(&same).expect("what is written is read");
        assert_eq!(read.name(), map.name());
        assert_eq!(read.budget(), map.budget());
        assert_eq!(read.points(), map.points());
        assert_eq!(read.tags()[0].family, map.tags()[0].family);
        for (read, was) in read.markers().iter().zip(map.markers()) {
            assert_eq!(read.id, was.id);
            let off = (read.marker_in_tanker - was.marker_in_tanker).norm();
            assert!(off < 1e-9, "{}: {off}", was.id);
        }
    }

    #[test]
    fn what_moves_moves_with_its_sigma_and_corners_with_their_tag() {
        let map = map();
        let shift_in_tanker = Vector3::new(0.01, 0.0, -0.02);
        let body = BodyChange {
            shift_in_tanker,
            sigma_m: 0.001_230_1,
        };
        let change = MapChange {
            markers: BTreeMap::from([(1, body)]),
            tags: BTreeMap::from([(7, body)]),
            flex: Vec::new(),
        };
        let moved = map.changed(&change).expect("a good map");
        for id in [1, 70, 73] {
            let by = moved.get(id).expect("there") - map.get(id).expect("there");
            assert!((by - shift_in_tanker).norm() < 1e-5, "{id}: {by}");
        }
        assert_eq!(moved.get(2), map.get(2));
        // Rounded upwards; a corner has twice its tag's.
        let sigmas = &moved.budget().survey_sigma_m;
        assert_eq!(sigmas[..3], [(1, 0.001_24), (2, 0.005), (70, 0.002_48)]);
        assert!(moved.budget().flex.is_empty());
    }
}
