//! The checked marker map, and the shipped maps.

use nalgebra::Point3;

use super::check;
use super::{MapBudget, Marker, MarkerMapError, Tag};
use crate::yaml::Place;

/// A checked marker map: at least three markers, unique ids, not collinear.
#[derive(Debug, Clone, PartialEq)]
pub struct MarkerMap {
    name: String,
    /// Ascending id; includes the corners of tags.
    markers: Vec<Marker>,
    /// Ascending id.
    tags: Vec<Tag>,
    budget: MapBudget,
    points: Vec<NamedPoint>,
}

/// A point of the tanker that is no marker.
#[derive(Debug, Clone, PartialEq)]
pub struct NamedPoint {
    /// Its name.
    pub name: String,
    /// Its position, tanker frame, m.
    pub point_in_tanker: Point3<f64>,
}

/// Name and text of each shipped map.
const SHIPPED: [(&str, &str); 2] = [
    ("paper", include_str!("../../config/tankers/paper.yaml")),
    ("fin6", include_str!("../../config/tankers/fin6.yaml")),
];

impl MarkerMap {
    /// Returns the checked map from markers in any order.
    ///
    /// # Errors
    /// Every variant of [`MarkerMapError`] except those of reading; positions name the map, without a line.
    pub fn new(name: &str, markers: &[Marker]) -> Result<Self, MarkerMapError> {
        let whole = Place::whole(&format!("marker map `{name}`"));
        check::check(markers, |_| whole.clone())?;
        Ok(Self::sorted(
            name,
            markers.to_vec(),
            Vec::new(),
            MapBudget::default(),
            Vec::new(),
        ))
    }

    /// Returns a shipped map; `None` if there is none of that name.
    #[must_use]
    pub fn shipped(name: &str) -> Option<Self> {
        let (name, text) = SHIPPED.iter().find(|(shipped, _)| *shipped == name)?;
        // A test checks that each of them is valid.
        Self::from_yaml(text, &format!("config/tankers/{name}.yaml")).ok()
    }

    /// Returns the names of the shipped maps.
    pub fn shipped_names() -> impl Iterator<Item = &'static str> {
        SHIPPED.iter().map(|(name, _)| *name)
    }

    /// Returns the map's name.
    #[must_use]
    pub fn name(&self) -> &str {
        &self.name
    }

    /// Returns all markers, ascending id, including the corners of tags.
    #[must_use]
    pub fn markers(&self) -> &[Marker] {
        &self.markers
    }

    /// Returns the error budget of the map and the airframe.
    #[must_use]
    pub fn budget(&self) -> &MapBudget {
        &self.budget
    }

    /// Returns the position of a marker, tanker frame, m; `None` for an id that is not on the map.
    #[must_use]
    pub fn get(&self, id: u32) -> Option<Point3<f64>> {
        let index = self
            .markers
            .binary_search_by_key(&id, |marker| marker.id)
            .ok()?;
        Some(self.markers[index].marker_in_tanker)
    }

    /// Returns the points whose position is to be protected, in the order of the file.
    #[must_use]
    pub fn points(&self) -> &[NamedPoint] {
        &self.points
    }

    /// Returns the tags, ascending id.
    #[must_use]
    pub fn tags(&self) -> &[Tag] {
        &self.tags
    }

    /// Returns the tag with this id; `None` if it is not on the map.
    #[must_use]
    pub fn tag(&self, id: u32) -> Option<&Tag> {
        let index = self.tags.binary_search_by_key(&id, |tag| tag.id).ok()?;
        Some(&self.tags[index])
    }

    /// Returns the tag that a point is a corner of; `None` for other points.
    #[must_use]
    pub fn tag_of_corner(&self, id: u32) -> Option<&Tag> {
        self.tag(Tag::id_of_corner(id)?)
    }

    /// Returns the position of a marker that is not the corner of a tag, tanker frame, m.
    #[must_use]
    pub fn single(&self, id: u32) -> Option<Point3<f64>> {
        if self.tag_of_corner(id).is_some() {
            return None;
        }
        self.get(id)
    }

    pub(super) fn sorted(
        name: &str,
        mut markers: Vec<Marker>,
        mut tags: Vec<Tag>,
        budget: MapBudget,
        points: Vec<NamedPoint>,
    ) -> Self {
        markers.sort_unstable_by_key(|marker| marker.id);
        tags.sort_unstable_by_key(|tag| tag.id);
        Self {
            name: name.to_owned(),
            markers,
            tags,
            budget,
            points,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn marker(id: u32, x: f64, y: f64, z: f64) -> Marker {
        Marker {
            id,
            marker_in_tanker: Point3::new(x, y, z),
        }
    }

    #[test]
    fn every_shipped_map_passes_its_checks_under_its_own_name() {
        assert_eq!(
            MarkerMap::shipped_names().collect::<Vec<_>>(),
            ["paper", "fin6"]
        );
        for name in MarkerMap::shipped_names() {
            let map = MarkerMap::shipped(name).expect("a shipped map is sound");
            assert_eq!(map.name(), name);
            assert_eq!(map.markers().len(), 6);
        }
        assert_eq!(MarkerMap::shipped("747"), None);
    }

    #[test]
    fn shipped_maps_hold_table_1_and_differ_in_marker_6_only() {
        let paper = MarkerMap::shipped("paper").expect("shipped");
        let fin6 = MarkerMap::shipped("fin6").expect("shipped");
        let table_1 = [
            marker(1, 3.7, -7.13, 0.7),
            marker(2, 3.7, 7.13, 0.7),
            marker(3, 7.79, -2.689, 0.7),
            marker(4, 7.79, 2.689, 0.7),
            marker(5, 7.96, 0.0, 3.189),
            marker(6, 0.0, 0.0, 0.0),
        ];
        assert_eq!(paper.markers(), table_1);
        assert_eq!(fin6.markers()[..5], table_1[..5]);
        assert_eq!(fin6.get(6), Some(Point3::new(7.96, 0.0, 1.9)));
    }

    #[test]
    fn markers_come_in_ascending_id_and_are_found_by_it() {
        let given = [
            marker(4_000_000_000, 1.0, 0.0, 0.0),
            marker(0, 0.0, 1.0, 0.0),
            marker(7, 0.0, 0.0, 1.0),
        ];
        let map = MarkerMap::new("kite", &given).expect("three markers off a line");
        assert_eq!(
            map.markers().iter().map(|m| m.id).collect::<Vec<_>>(),
            [0, 7, 4_000_000_000]
        );
        for m in given {
            assert_eq!(map.get(m.id), Some(m.marker_in_tanker));
        }
        assert_eq!(map.get(1), None);
        assert_eq!(map.get(u32::MAX), None);
    }

    #[test]
    fn a_map_made_from_markers_is_checked_like_one_from_a_file() {
        let error = MarkerMap::new(
            "stick",
            &[marker(1, 0.0, 0.0, 0.0), marker(1, 1.0, 0.0, 0.0)],
        )
        .expect_err("two markers are too few");
        assert_eq!(
            error.to_string(),
            "marker map `stick`: need at least 3 markers for a pose, got 2"
        );
    }
}
