//! Reads the `tags:` of a marker map's YAML into checked tags; every error has its line.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};
use serde::Deserialize;
use serde_saphyr::Spanned;

use super::check::MAX_COORDINATE_M;
use super::{MarkerMapError, Tag};
use crate::geometry::rotation_from_roll_pitch_yaw;
use crate::yaml::Place;

/// Plausible side lengths, m.
const MIN_SIZE_M: f64 = 0.01;
const MAX_SIZE_M: f64 = 100.0;

/// Tolerance of a quaternion's length, as in ROS.
const QUATERNION_TOLERANCE: f64 = 0.01;

/// `id` is wider than ids are, so that an id out of range is reported as such.
#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
pub(super) struct RawTag {
    pub(super) id: Spanned<i64>,
    family: Option<Spanned<String>>,
    size_m: Spanned<f64>,
    pub(super) x: Spanned<f64>,
    pub(super) y: Spanned<f64>,
    pub(super) z: Spanned<f64>,
    roll_deg: Option<Spanned<f64>>,
    pitch_deg: Option<Spanned<f64>>,
    yaw_deg: Option<Spanned<f64>>,
    qx: Option<Spanned<f64>>,
    qy: Option<Spanned<f64>>,
    qz: Option<Spanned<f64>>,
    qw: Option<Spanned<f64>>,
    pub(super) sigma: Option<Spanned<f64>>,
}

/// Returns the tags in the order of the text.
pub(super) fn tags(entries: &[RawTag], source: &str) -> Result<Vec<Tag>, MarkerMapError> {
    let mut tags: Vec<Tag> = Vec::with_capacity(entries.len());
    for entry in entries {
        let tag = entry.checked(source)?;
        if let Some(first) = tags.iter().position(|other| other.id == tag.id) {
            return Err(MarkerMapError::DuplicateTag {
                place: Place::at(source, entry.id.referenced),
                id: tag.id,
                first: Place::at(source, entries[first].id.referenced),
            });
        }
        tags.push(tag);
    }
    Ok(tags)
}

impl RawTag {
    fn checked(&self, source: &str) -> Result<Tag, MarkerMapError> {
        let id = u32::try_from(self.id.value)
            .ok()
            .filter(|&id| id <= Tag::MAX_ID)
            .ok_or_else(|| MarkerMapError::TagIdOutOfRange {
                place: Place::at(source, self.id.referenced),
                id: self.id.value,
            })?;
        let number = |field: &'static str, limit: f64, raw: &Spanned<f64>| {
            let value = raw.value;
            if value.abs() <= limit {
                return Ok(value); // NaN is not within any limit
            }
            let place = Place::at(source, raw.referenced);
            Err(MarkerMapError::TagNumber {
                place,
                id,
                field,
                value,
                limit,
            })
        };
        let size_m = self.size_m.value;
        if !(MIN_SIZE_M..=MAX_SIZE_M).contains(&size_m) {
            return Err(MarkerMapError::TagSize {
                place: Place::at(source, self.size_m.referenced),
                id,
                size_m,
                least_m: MIN_SIZE_M,
                most_m: MAX_SIZE_M,
            });
        }
        let position = Translation3::new(
            number("x", MAX_COORDINATE_M, &self.x)?,
            number("y", MAX_COORDINATE_M, &self.y)?,
            number("z", MAX_COORDINATE_M, &self.z)?,
        );
        Ok(Tag {
            id,
            family: self.checked_family(id, source)?,
            size_m,
            tanker_from_tag: Isometry3::from_parts(position, self.attitude(id, source, number)?),
        })
    }

    fn checked_family(&self, id: u32, source: &str) -> Result<Option<String>, MarkerMapError> {
        let Some(family) = &self.family else {
            return Ok(None);
        };
        let name = family.value.as_str();
        if name.is_empty() || name.contains(char::is_whitespace) {
            return Err(MarkerMapError::TagFamily {
                place: Place::at(source, family.referenced),
                id,
                family: name.to_owned(),
            });
        }
        Ok(Some(name.to_owned()))
    }

    /// Returns the rotation `tanker_from_tag`; exactly one of its two forms must be given, complete.
    fn attitude(
        &self,
        id: u32,
        source: &str,
        number: impl Fn(&'static str, f64, &Spanned<f64>) -> Result<f64, MarkerMapError>,
    ) -> Result<UnitQuaternion<f64>, MarkerMapError> {
        let angles = [&self.roll_deg, &self.pitch_deg, &self.yaw_deg];
        let quaternion = [&self.qx, &self.qy, &self.qz, &self.qw];
        let place = || Place::at(source, self.id.referenced);
        match (angles, quaternion) {
            ([Some(roll), Some(pitch), Some(yaw)], [None, None, None, None]) => {
                let rotation = rotation_from_roll_pitch_yaw(
                    number("roll_deg", 360.0, roll)?.to_radians(),
                    number("pitch_deg", 360.0, pitch)?.to_radians(),
                    number("yaw_deg", 360.0, yaw)?.to_radians(),
                );
                Ok(UnitQuaternion::from_rotation_matrix(&rotation))
            }
            ([None, None, None], [Some(x), Some(y), Some(z), Some(w)]) => {
                let quaternion = Quaternion::new(
                    number("qw", 2.0, w)?,
                    number("qx", 2.0, x)?,
                    number("qy", 2.0, y)?,
                    number("qz", 2.0, z)?,
                );
                let norm = quaternion.norm();
                if (norm - 1.0).abs() > QUATERNION_TOLERANCE {
                    let place = place();
                    return Err(MarkerMapError::TagQuaternion { place, id, norm });
                }
                Ok(UnitQuaternion::from_quaternion(quaternion))
            }
            _ => Err(MarkerMapError::TagAttitude { place: place(), id }),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::MarkerMap;
    use nalgebra::Point3;

    /// A tag on line 3; what is appended begins on line 4.
    const GOOD: &str = "name: kite
tags:
  - {id: 7, family: tag36h11, size_m: 0.5, x: 3, y: 1, z: 2, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
";

    fn refusal_of_fourth_line(line: &str) -> String {
        let text = format!("{GOOD}{line}\n");
        let error = MarkerMap::from_yaml(&text, "m.yaml").expect_err("this map is wrong");
        error.to_string()
    }

    #[test]
    fn a_map_may_have_tags_alone_and_holds_their_corners_as_points() {
        let map = MarkerMap::from_yaml(GOOD, "m.yaml").expect("a tag has four corners");
        let ids: Vec<u32> = map.markers().iter().map(|marker| marker.id).collect();
        assert_eq!(ids, [70, 71, 72, 73]);
        let corner = map.get(72).expect("the top right corner");
        assert!(
            (corner - Point3::new(3.0, 0.75, 2.25)).norm() < 1e-12,
            "{corner}"
        );
        assert_eq!(map.tag(7).map(|tag| tag.id), Some(7));
        assert_eq!(map.tag(70), None);
        assert_eq!(map.single(70), None, "a corner is no single point");
    }

    #[test]
    fn the_example_that_comes_with_the_program_is_a_map() {
        let text = include_str!("../../config/tankers/tags_example.yaml");
        let map = MarkerMap::from_yaml(text, "tags_example.yaml").expect("a sound example");
        assert_eq!((map.name(), map.markers().len()), ("tags_example", 13));
        // Upright and facing aft: the first corner is at the bottom left as seen from behind.
        let corner = map.get(0).expect("the first corner of tag 0");
        assert!(
            (corner - Point3::new(3.6, -6.2, 0.3)).norm() < 1e-12,
            "{corner}"
        );
    }

    #[test]
    fn tags_and_single_markers_go_together() {
        let text = format!("{GOOD}markers:\n  - {{id: 8, x: 0, y: 0, z: 0}}\n");
        let map = MarkerMap::from_yaml(&text, "m.yaml").expect("five points");
        assert_eq!(map.markers().len(), 5);
        assert_eq!(map.single(8), Some(Point3::origin()));
        assert_eq!(map.single(9), None);
    }

    #[test]
    fn quaternion_and_angles_say_the_same() {
        let line =
            "  - {id: 8, size_m: 0.5, x: 3, y: 1, z: 3, qx: 0.5, qy: -0.5, qz: -0.5, qw: 0.5}";
        let map = MarkerMap::from_yaml(&format!("{GOOD}{line}\n"), "m.yaml").expect("two tags");
        let attitude = |id| map.tag(id).expect("it was read").tanker_from_tag.rotation;
        assert!(attitude(7).angle_to(&attitude(8)) < 1e-7); // acos near 1 loses half the digits
    }

    #[test]
    fn every_slip_is_told_with_its_line() {
        let tag = |changes: &str| format!("  - {{id: 8, size_m: 1, x: 0, y: 0, z: 0, {changes}}}");
        let upright = "roll_deg: 90, pitch_deg: 0, yaw_deg: -90";
        let cases = [
            (
                format!("  - {{id: 7, size_m: 1, x: 0, y: 0, z: 0, {upright}}}"),
                "m.yaml:4:10: tag id 7 is already taken at m.yaml:3:10",
            ),
            (
                format!("  - {{id: -1, size_m: 1, x: 0, y: 0, z: 0, {upright}}}"),
                "m.yaml:4:10: tag id must be 0 to 429496729, got -1",
            ),
            (
                format!("  - {{id: 8, size_m: 0, x: 0, y: 0, z: 0, {upright}}}"),
                "m.yaml:4:21: size_m of tag 8 must be 0.01 to 100 m, got 0.0",
            ),
            (
                format!("  - {{id: 8, size_m: .nan, x: 0, y: 0, z: 0, {upright}}}"),
                "m.yaml:4:21: size_m of tag 8 must be 0.01 to 100 m, got NaN",
            ),
            (
                format!("  - {{id: 8, size_m: 1, x: 0, y: .inf, z: 0, {upright}}}"),
                "m.yaml:4:33: y of tag 8 must be from -1000 to 1000, got inf",
            ),
            (
                tag("roll_deg: 90, pitch_deg: 0, yaw_deg: .nan"),
                "m.yaml:4:79: yaw_deg of tag 8 must be from -360 to 360, got NaN",
            ),
            (
                tag("roll_deg: 90, pitch_deg: 0"),
                "m.yaml:4:10: tag 8 needs its attitude, as roll_deg, pitch_deg and yaw_deg or as qx, qy, qz and qw",
            ),
            (
                tag(&format!("{upright}, qw: 1")),
                "m.yaml:4:10: tag 8 needs its attitude, as roll_deg, pitch_deg and yaw_deg or as qx, qy, qz and qw",
            ),
            (
                tag("qx: 0, qy: 0, qz: 0, qw: 0.5"),
                "m.yaml:4:10: the quaternion of tag 8 must have length 1, got 0.5",
            ),
            (
                tag(&format!("{upright}, family: ''")),
                "m.yaml:4:92: family of tag 8 must be one word such as tag36h11, got \"\"",
            ),
            (
                format!(
                    "{}\nmarkers:\n  - {{id: 71, x: 0, y: 0, z: 0}}",
                    tag(upright)
                ),
                "m.yaml:6:10: marker id 71 is that of a corner of the tag at m.yaml:3:10 (10 x tag id + corner)",
            ),
        ];
        for (line, expected) in cases {
            assert_eq!(refusal_of_fourth_line(&line), expected);
        }
    }

    #[test]
    fn one_tag_twice_at_one_place_is_refused() {
        let line =
            "  - {id: 8, size_m: 0.5, x: 3, y: 1, z: 2, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}";
        let error = refusal_of_fourth_line(line);
        assert!(
            error.starts_with("m.yaml:4:10: marker 80 is 0 m from marker 70"),
            "{error}"
        );
    }
}
