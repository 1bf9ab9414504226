//! Fiducial tags: one id, four corners.

use nalgebra::{Isometry3, Point3};

/// Ids of points reserved for one tag: ten, so that tag and corner can be read from a point's id.
const IDS_PER_TAG: u32 = 10;

/// Corners of a tag, in the order of detectors.
const CORNERS: [(f64, f64); 4] = [(-0.5, -0.5), (0.5, -0.5), (0.5, 0.5), (-0.5, 0.5)];

/// A square tag on the tanker.
///
/// Its frame is that of `apriltag_ros`: the origin in the tag's centre; seen from in front of the upright tag, x to the
/// right, y up, z out of its face. The corners go anticlockwise from the bottom left one, as those of
/// `apriltag_msgs/AprilTagDetection`.
#[derive(Debug, Clone, PartialEq)]
pub struct Tag {
    /// Its id in its family.
    pub id: u32,
    /// Its family; `None` accepts any.
    pub family: Option<String>,
    /// Length of a side between the detected corners, m.
    pub size_m: f64,
    /// Its pose on the tanker.
    pub tanker_from_tag: Isometry3<f64>,
}

impl Tag {
    /// Largest id whose corners have valid ids.
    pub const MAX_ID: u32 = (u32::MAX - 3) / IDS_PER_TAG;

    /// Returns ids and positions (tanker frame, m) of the corners: bottom left, bottom right, top right, top left.
    #[must_use]
    pub fn corners(&self) -> [(u32, Point3<f64>); 4] {
        let mut id = self.id * IDS_PER_TAG;
        CORNERS.map(|(x, y)| {
            let corner_in_tag = Point3::new(x * self.size_m, y * self.size_m, 0.0);
            let corner = (id, self.tanker_from_tag * corner_in_tag);
            id += 1;
            corner
        })
    }

    /// Returns whether a detector's family name is this tag's family: `tag36h11` and `36h11` are the same.
    #[must_use]
    pub fn is_of_family(&self, name: &str) -> bool {
        let bare = |name: &str| name.strip_prefix("tag").unwrap_or(name).to_owned();
        self.family
            .as_deref()
            .is_none_or(|family| bare(family) == bare(name))
    }

    /// Returns the id of the tag to which a point belongs as a corner; `None` if the id is not that of a corner.
    pub(super) const fn id_of_corner(point: u32) -> Option<u32> {
        if point % IDS_PER_TAG < 4 {
            Some(point / IDS_PER_TAG)
        } else {
            None
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geometry::rotation_from_roll_pitch_yaw;
    use nalgebra::{Translation3, UnitQuaternion};

    /// Rounding of a few products, m.
    const ROUNDING_M: f64 = 1e-12;

    /// Upright on a face that looks aft, towards the receiver: as docs/inputs.md has it.
    fn facing_aft() -> Tag {
        let right_angle = std::f64::consts::FRAC_PI_2;
        let rotation = rotation_from_roll_pitch_yaw(right_angle, 0.0, -right_angle);
        Tag {
            id: 7,
            family: Some("tag36h11".to_owned()),
            size_m: 0.5,
            tanker_from_tag: Isometry3::from_parts(
                Translation3::new(3.0, 1.0, 2.0),
                UnitQuaternion::from_rotation_matrix(&rotation),
            ),
        }
    }

    #[test]
    fn corners_of_a_tag_that_faces_the_receiver_go_round_against_the_clock_from_bottom_left() {
        // Seen from behind the tanker: right is -y, up is +z.
        let expected = [
            (70, [3.0, 1.25, 1.75]),
            (71, [3.0, 0.75, 1.75]),
            (72, [3.0, 0.75, 2.25]),
            (73, [3.0, 1.25, 2.25]),
        ];
        for ((id, found), (expected_id, expected)) in
            facing_aft().corners().into_iter().zip(expected)
        {
            assert_eq!(id, expected_id);
            assert!(
                (found - Point3::from(expected)).norm() < ROUNDING_M,
                "{found}"
            );
        }
    }

    #[test]
    fn families_are_compared_without_their_prefix() {
        let tag = facing_aft();
        assert!(tag.is_of_family("tag36h11") && tag.is_of_family("36h11"));
        assert!(!tag.is_of_family("tag16h5") && !tag.is_of_family(""));
        let any = Tag {
            family: None,
            ..tag
        };
        assert!(any.is_of_family("tag16h5"));
    }

    #[test]
    fn corner_ids_lead_back_to_their_tag_and_the_largest_one_fits() {
        let last = Tag {
            id: Tag::MAX_ID,
            ..facing_aft()
        };
        for (id, _) in last.corners() {
            assert_eq!(Tag::id_of_corner(id), Some(last.id));
        }
        assert_eq!(Tag::id_of_corner(74), None);
    }
}
