//! The `sigma` and `flex` of a marker map's YAML: errors of a map and an airframe.

use std::collections::BTreeMap;

use nalgebra::Vector3;
use serde::Deserialize;
use serde_saphyr::Spanned;

use super::{Marker, MarkerMapError, Tag};
use crate::yaml::Place;

/// Largest number of flex modes.
pub const MAX_FLEX_MODES: usize = 12;
/// Largest plausible standard deviation of a survey, m.
const MAX_SURVEY_M: f64 = 1.0;
/// Largest plausible standard deviation of a bent airframe, m.
const MAX_FLEX_M: f64 = 10.0;
/// Largest component of a shape; a shape is 1 where the airframe moves by its sigma.
const MAX_SHAPE: f64 = 10.0;
/// Longest time constant, s; anything longer is constant for the flight.
const MAX_TIME_CONSTANT_S: f64 = 1.0e5;
const MIN_TIME_CONSTANT_S: f64 = 0.01;
/// Factor from the error of a tag to those of its corners. The corners move together; four independent errors of twice
/// the size move their mean by the same amount.
pub(crate) const CORNER_FACTOR: f64 = 2.0;

/// Errors of a map and the airframe, standard deviations.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct MapBudget {
    /// Marker id and standard deviation of each of its coordinates, m; ascending id, only those above 0.
    pub survey_sigma_m: Vec<(u32, f64)>,
    /// Modes in which the airframe bends.
    pub flex: Vec<Flex>,
}

/// A mode in which the airframe bends.
#[derive(Debug, Clone, PartialEq)]
pub struct Flex {
    /// Its name.
    pub name: String,
    /// Standard deviation of its amplitude, m.
    pub sigma_m: f64,
    /// Time constant of its amplitude, s; `None`: constant for the whole flight.
    pub time_constant_s: Option<f64>,
    /// Marker id and displacement for an amplitude of 1, tanker frame; ascending id.
    pub shape: Vec<(u32, Vector3<f64>)>,
}

impl MapBudget {
    /// Returns whether the map is taken as exact.
    #[must_use]
    pub fn is_exact(&self) -> bool {
        self.survey_sigma_m.is_empty() && self.flex.iter().all(|flex| flex.sigma_m == 0.0)
    }
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawFlex {
    name: Spanned<String>,
    sigma: Spanned<f64>,
    time_constant_s: Option<Spanned<f64>>,
    shape: Vec<RawShape>,
}

/// The displacement of one marker, or of all corners of one tag.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawShape {
    id: Option<Spanned<i64>>,
    tag: Option<Spanned<i64>>,
    #[serde(default)]
    x: f64,
    #[serde(default)]
    y: f64,
    #[serde(default)]
    z: f64,
}

/// Returns the budget. `of_map` is for markers without a sigma of their own; markers are in the order of the text.
pub(super) fn budget(
    of_map: Option<&Spanned<f64>>,
    of_markers: &[(u32, Option<&Spanned<f64>>)],
    of_tags: &[(&Tag, Option<&Spanned<f64>>)],
    flex: &[RawFlex],
    markers: &[Marker],
    source: &str,
) -> Result<MapBudget, MarkerMapError> {
    let sigma = |of: &dyn Fn() -> String, own: Option<&Spanned<f64>>| {
        own.or(of_map)
            .map_or(Ok(0.0), |sigma| checked(of, sigma, MAX_SURVEY_M, source))
    };
    let mut survey = BTreeMap::new();
    for (id, own) in of_markers {
        survey.insert(*id, sigma(&|| format!("sigma of marker {id}"), *own)?);
    }
    for (tag, own) in of_tags {
        let of_tag = sigma(&|| format!("sigma of tag {}", tag.id), *own)?;
        for (corner, _) in tag.corners() {
            survey.insert(corner, CORNER_FACTOR * of_tag);
        }
    }
    let mut modes: Vec<Flex> = Vec::with_capacity(flex.len());
    for raw in flex {
        if modes.iter().any(|mode| mode.name == raw.name.value) {
            return Err(MarkerMapError::DuplicateFlex {
                place: Place::at(source, raw.name.referenced),
                name: raw.name.value.clone(),
            });
        }
        modes.push(raw.checked(markers, of_tags, source)?);
    }
    if modes.len() > MAX_FLEX_MODES {
        return Err(MarkerMapError::TooManyFlexModes {
            place: Place::at(source, flex[0].name.referenced),
            got: modes.len(),
            most: MAX_FLEX_MODES,
        });
    }
    survey.retain(|_, sigma| *sigma > 0.0);
    Ok(MapBudget {
        survey_sigma_m: survey.into_iter().collect(),
        flex: modes,
    })
}

fn checked(
    of: &dyn Fn() -> String,
    raw: &Spanned<f64>,
    most_m: f64,
    source: &str,
) -> Result<f64, MarkerMapError> {
    if (0.0..=most_m).contains(&raw.value) {
        return Ok(raw.value);
    }
    Err(MarkerMapError::Sigma {
        place: Place::at(source, raw.referenced),
        of: of(),
        value_m: raw.value,
        most_m,
    })
}

impl RawFlex {
    fn checked(
        &self,
        markers: &[Marker],
        tags: &[(&Tag, Option<&Spanned<f64>>)],
        source: &str,
    ) -> Result<Flex, MarkerMapError> {
        let name = &self.name.value;
        let of = || format!("sigma of flex mode `{name}`");
        let sigma_m = checked(&of, &self.sigma, MAX_FLEX_M, source)?;
        let time_constant_s = match &self.time_constant_s {
            None => None,
            Some(time) if (MIN_TIME_CONSTANT_S..=MAX_TIME_CONSTANT_S).contains(&time.value) => {
                Some(time.value)
            }
            Some(time) => {
                return Err(MarkerMapError::TimeConstant {
                    place: Place::at(source, time.referenced),
                    name: name.clone(),
                    value_s: time.value,
                    least_s: MIN_TIME_CONSTANT_S,
                    most_s: MAX_TIME_CONSTANT_S,
                });
            }
        };
        let mut shape = BTreeMap::new();
        for part in &self.shape {
            let shift = Vector3::new(part.x, part.y, part.z);
            let place = || {
                let at = part.id.as_ref().or(part.tag.as_ref());
                Place::at(source, at.map_or(self.name.referenced, |id| id.referenced))
            };
            let ids = part
                .ids(markers, tags)
                .ok_or_else(|| MarkerMapError::FlexMarker {
                    place: place(),
                    name: name.clone(),
                })?;
            // A comparison with NaN is false.
            let is_within = shift.norm() <= MAX_SHAPE;
            if !is_within {
                return Err(MarkerMapError::FlexShape {
                    place: place(),
                    name: name.clone(),
                    length: shift.norm(),
                    most: MAX_SHAPE,
                });
            }
            for id in ids {
                if shape.insert(id, shift).is_some() {
                    return Err(MarkerMapError::FlexMarkerTwice {
                        place: place(),
                        name: name.clone(),
                        id,
                    });
                }
            }
        }
        Ok(Flex {
            name: name.clone(),
            sigma_m,
            time_constant_s,
            shape: shape.into_iter().collect(),
        })
    }
}

impl RawShape {
    /// Returns the markers that it moves; `None` unless it names one marker or one tag of the map.
    fn ids(&self, markers: &[Marker], tags: &[(&Tag, Option<&Spanned<f64>>)]) -> Option<Vec<u32>> {
        match (&self.id, &self.tag) {
            (Some(id), None) => {
                let marker = markers
                    .iter()
                    .find(|marker| i64::from(marker.id) == id.value)?;
                Some(vec![marker.id])
            }
            (None, Some(id)) => {
                let (tag, _) = tags.iter().find(|(tag, _)| i64::from(tag.id) == id.value)?;
                Some(tag.corners().map(|(corner, _)| corner).to_vec())
            }
            _ => None,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::MarkerMap;
    use super::*;

    /// Lines 1 to 5; what is appended begins on line 6.
    const GOOD: &str = "name: kite
markers:
  - {id: 1, x: 0, y: -1.5, z: 0}
  - {id: 2, x: 0, y: 1.5, z: 0, sigma: 0.005}
  - {id: 3, x: 3, y: 0, z: 0.25}
";
    const TAG: &str = "tags:\n  - {id: 7, size_m: 0.5, x: 3, y: 1, z: 2, roll_deg: 90, pitch_deg: 0, yaw_deg: 0, sigma: 0.01}\n";

    fn read(more: &str) -> Result<MarkerMap, MarkerMapError> {
        MarkerMap::from_yaml(&format!("{GOOD}{more}"), "m.yaml")
    }

    fn refusal(more: &str) -> String {
        read(more).expect_err("this map is wrong").to_string()
    }

    #[test]
    fn a_map_without_sigmas_is_exact_but_for_those_it_names() {
        let text = GOOD.replace(", sigma: 0.005", "");
        let map = MarkerMap::from_yaml(&text, "m.yaml").expect("a good map");
        assert!(map.budget().is_exact());
        let map = read("").expect("a good map");
        assert_eq!(map.budget().survey_sigma_m, [(2, 0.005)]);
        assert!(!map.budget().is_exact());
    }

    #[test]
    fn the_maps_sigma_holds_for_markers_without_their_own_and_a_tags_for_its_corners() {
        let map = read(&format!("sigma: 0.02\n{TAG}")).expect("a good map");
        let corners = [70, 71, 72, 73].map(|id| (id, 0.02));
        let mut expected = vec![(1, 0.02), (2, 0.005), (3, 0.02)];
        expected.extend(corners);
        assert_eq!(map.budget().survey_sigma_m, expected);
    }

    #[test]
    fn flex_moves_markers_and_all_corners_of_tags() {
        let more = format!(
            "{TAG}flex:\n  - name: wing\n    sigma: 0.3\n    time_constant_s: 4\n    shape:\n      - {{id: 1, z: 1}}\n      - {{tag: 7, y: 0.1, z: 0.5}}\n"
        );
        let map = read(&more).expect("a good map");
        let flex = map.budget().flex.first().expect("one mode");
        assert_eq!(flex.name, "wing");
        assert!((flex.sigma_m - 0.3).abs() < f64::EPSILON);
        assert_eq!(flex.time_constant_s, Some(4.0));
        let mut expected = vec![(1, Vector3::new(0.0, 0.0, 1.0))];
        expected.extend([70, 71, 72, 73].map(|id| (id, Vector3::new(0.0, 0.1, 0.5))));
        assert_eq!(flex.shape, expected);
    }

    #[test]
    fn the_example_that_comes_with_the_program_has_a_budget() {
        let text = include_str!("../../config/tankers/budget_example.yaml");
        let map = MarkerMap::from_yaml(text, "budget_example.yaml").expect("a sound example");
        let budget = map.budget();
        assert_eq!(budget.survey_sigma_m.len(), 8);
        assert_eq!(budget.survey_sigma_m[4], (5, 0.02));
        assert_eq!(budget.flex.len(), 1);
        assert_eq!(budget.flex[0].shape.len(), 6);
    }

    #[test]
    fn every_slip_is_refused_at_its_line() {
        let flex =
            |sigma: &str, rest: &str| format!("flex:\n  - name: wing\n    sigma: {sigma}\n{rest}");
        let shape = |parts: &str| flex("0.1", &format!("    shape: [{parts}]\n"));
        let slips = [
            (
                "sigma: 2\n".to_owned(),
                "m.yaml:6:8: sigma of marker 1 must be 0 to 1 m, got 2",
            ),
            (
                "sigma: -0.1\n".to_owned(),
                "m.yaml:6:8: sigma of marker 1 must be 0 to 1 m, got -0.1",
            ),
            (
                flex("11", "    shape: []\n"),
                "m.yaml:8:12: sigma of flex mode `wing` must be 0 to 10 m, got 11",
            ),
            (
                flex("0.1", "    time_constant_s: 0\n    shape: []\n"),
                "m.yaml:9:22: time_constant_s of flex mode `wing` must be 0.01 to 100000 s, got 0; leave it out for a \
                 shape that lasts for the whole flight",
            ),
            (
                shape("{id: 9, z: 1}"),
                "m.yaml:9:18: the shape of flex mode `wing` must name a marker (`id`) or a tag (`tag`) of the map",
            ),
            (
                shape("{z: 1}"),
                "m.yaml:7:11: the shape of flex mode `wing` must name a marker (`id`) or a tag (`tag`) of the map",
            ),
            (
                shape("{id: 1, z: 1}, {id: 1, z: 2}"),
                "m.yaml:9:33: flex mode `wing` moves marker 1 twice",
            ),
            (
                shape("{id: 1, z: .nan}"),
                "m.yaml:9:18: a displacement of flex mode `wing` must be at most 10 times its amplitude, got NaN",
            ),
            (
                format!("{}  - {{name: wing, sigma: 0.1, shape: []}}\n", shape("")),
                "m.yaml:10:12: flex mode `wing` is defined twice",
            ),
        ];
        for (more, expected) in slips {
            assert_eq!(refusal(&more), expected, "{more}");
        }
        let many: [_; 13] =
            std::array::from_fn(|i| format!("  - {{name: f{i}, sigma: 0.1, shape: []}}\n"));
        let many = many.concat();
        assert_eq!(
            refusal(&format!("flex:\n{many}")),
            "m.yaml:7:12: a map may have at most 12 flex modes, got 13"
        );
    }
}
