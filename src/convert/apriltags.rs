//! `apriltag_msgs/AprilTagDetectionArray` -> detections: the corners of tags that stand in the marker map.

use std::collections::BTreeSet;

use crate::messages::{AprilTagDetection, AprilTagDetectionArray, Point2D};
use crate::pipeline::{Detection, Refusal};
use crate::target::{MarkerMap, Tag};

/// px; the library of `AprilTag` counts from the corner of the top-left pixel, this program from its centre.
const PIXEL_CENTRE_PX: f64 = 0.5;

/// The usable points of a message.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct TagDetections {
    /// Four for each tag of the map, or its centre where the map has it as a single marker.
    pub detections: Vec<Detection>,
    /// Points of tags that were left out for their hamming distance, ascending.
    pub ignored_ids: Vec<u32>,
}

/// Returns the points of a message, all without a sigma of their own.
///
/// The centre of a tag with known corners is not used: it is the intersection of their diagonals, so it adds nothing.
///
/// # Errors
/// [`Refusal`] for a tag that the map does not hold, or not in this family. Pixels are not checked here.
pub fn tag_detections(
    message: &AprilTagDetectionArray,
    map: &MarkerMap,
    max_hamming: i32,
) -> Result<TagDetections, Refusal> {
    let mut points = TagDetections::default();
    let mut unknown_ids = Vec::new();
    let mut ignored_ids = BTreeSet::new();
    for seen in &message.detections {
        let known = u32::try_from(seen.id).ok().and_then(|id| known(id, map));
        if seen.hamming > max_hamming {
            let ids = known.iter().flat_map(|known| known.points(seen));
            ignored_ids.extend(ids.map(|point| point.id));
            continue;
        }
        let Some(known) = known else {
            unknown_ids.push(seen.id);
            continue;
        };
        if let Known::Tag(tag) = known
            && !tag.is_of_family(&seen.family)
        {
            return Err(Refusal::WrongFamily {
                id: tag.id,
                expected: tag.family.clone().unwrap_or_default(),
                got: seen.family.clone(),
            });
        }
        points.detections.extend(known.points(seen));
    }
    if !unknown_ids.is_empty() {
        return Err(Refusal::UnknownTag { ids: unknown_ids });
    }
    // Seen twice, once well: it was not left out.
    let used_ids = points.detections.iter().map(|point| point.id).collect();
    points.ignored_ids = ignored_ids.difference(&used_ids).copied().collect();
    Ok(points)
}

/// What a marker map can say of a tag's id.
enum Known<'a> {
    Tag(&'a Tag),
    Single(u32),
}

fn known(id: u32, map: &MarkerMap) -> Option<Known<'_>> {
    let single = || map.single(id).map(|_| Known::Single(id));
    map.tag(id).map(Known::Tag).or_else(single)
}

impl Known<'_> {
    fn points(&self, seen: &AprilTagDetection) -> Vec<Detection> {
        match self {
            Self::Tag(tag) => std::iter::zip(tag.corners(), seen.corners)
                .map(|((id, _), corner)| detection(id, corner))
                .collect(),
            Self::Single(id) => vec![detection(*id, seen.centre)],
        }
    }
}

fn detection(id: u32, point: Point2D) -> Detection {
    Detection {
        id,
        u_px: point.x - PIXEL_CENTRE_PX,
        v_px: point.y - PIXEL_CENTRE_PX,
        sigma_px: 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::pipeline::OutcomeCode;
    use proptest::prelude::*;

    const MAP: &str = "name: tagged
markers:
  - {id: 3, x: 0, y: 0, z: 0}
tags:
  - {id: 7, family: tag36h11, size_m: 0.5, x: 3, y: 1, z: 2, roll_deg: 90, pitch_deg: 0, yaw_deg: -90}
";

    fn read(detections: &[AprilTagDetection]) -> Result<TagDetections, Refusal> {
        let map = MarkerMap::from_yaml(MAP, "tagged.yaml").expect("five points");
        let message = AprilTagDetectionArray {
            detections: detections.to_vec(),
            ..AprilTagDetectionArray::default()
        };
        tag_detections(&message, &map, 1)
    }

    fn seen(id: i32) -> AprilTagDetection {
        AprilTagDetection {
            family: "tag36h11".to_owned(),
            id,
            goodness: f32::NAN,
            decision_margin: f32::NAN,
            centre: Point2D { x: 100.5, y: 50.5 },
            corners: [(90.5, 60.5), (110.5, 60.5), (110.5, 40.5), (90.5, 40.5)]
                .map(|(x, y)| Point2D { x, y }),
            homography: [f64::NAN; 9],
            ..AprilTagDetection::default()
        }
    }

    fn point(id: u32, u_px: f64, v_px: f64) -> Detection {
        Detection {
            id,
            u_px,
            v_px,
            sigma_px: 0.0,
        }
    }

    #[test]
    fn tag_gives_its_corners_and_single_marker_its_centre_counted_from_the_pixels_centre() {
        let found = read(&[seen(7), seen(3)]).expect("both are in the map");
        let expected = [
            point(70, 90.0, 60.0),
            point(71, 110.0, 60.0),
            point(72, 110.0, 40.0),
            point(73, 90.0, 40.0),
            point(3, 100.0, 50.0),
        ];
        assert_eq!(found.detections, expected);
        assert_eq!(found.ignored_ids, Vec::<u32>::new());
    }

    #[test]
    fn unknown_tags_are_refused_by_their_own_ids() {
        // 70 is a corner's id in the map, not a tag's.
        let refusal = read(&[seen(7), seen(70), seen(-2), seen(i32::MIN)]).expect_err("unknown");
        assert_eq!(refusal.code(), OutcomeCode::UnknownId);
        assert!(
            refusal.to_string().contains("70, -2, -2147483648"),
            "{refusal}"
        );
    }

    #[test]
    fn another_family_is_refused_by_name() {
        let other = AprilTagDetection {
            family: "tag16h5".to_owned(),
            ..seen(7)
        };
        let refusal = read(&[other]).expect_err("another family");
        assert_eq!(refusal.code(), OutcomeCode::UnknownId);
        assert!(refusal.to_string().contains("tag16h5"), "{refusal}");
        assert!(refusal.to_string().contains("tag36h11"), "{refusal}");
    }

    #[test]
    fn tags_with_many_corrected_bits_are_left_out_whoever_they_are() {
        let corrected = |id, hamming| AprilTagDetection {
            hamming,
            ..seen(id)
        };
        let found = read(&[
            corrected(7, 2),
            corrected(3, 1),
            corrected(99, 2),
            corrected(-1, 9),
        ])
        .expect("the strangers are left out");
        assert_eq!(found.detections, [point(3, 100.0, 50.0)]);
        assert_eq!(found.ignored_ids, [70, 71, 72, 73]);
    }

    #[test]
    fn tag_seen_well_and_badly_is_not_left_out() {
        let bad = AprilTagDetection {
            hamming: 2,
            ..seen(7)
        };
        let found = read(&[bad.clone(), seen(7)]).expect("known");
        assert_eq!((found.detections.len(), found.ignored_ids.len()), (4, 0));
        let found = read(&[bad.clone(), bad]).expect("known");
        assert_eq!(found.ignored_ids, [70, 71, 72, 73], "each point once");
    }

    #[test]
    fn nothing_gives_nothing_and_bad_pixels_pass_to_their_check() {
        assert_eq!(read(&[]), Ok(TagDetections::default()));
        let mut bad = seen(7);
        bad.corners[2].x = f64::NAN;
        assert!(read(&[bad]).expect("known").detections[2].u_px.is_nan());
    }

    proptest! {
        #[test]
        fn every_message_is_read_or_refused_and_used_points_are_of_the_map(
            seen in prop::collection::vec(
                ("(tag)?(36h11|16h5|.{0,3})", -5..100, any::<i32>(), any::<f64>()),
                0..8,
            ),
        ) {
            let detections: Vec<_> = seen
                .into_iter()
                .map(|(family, id, hamming, x)| AprilTagDetection {
                    family,
                    id,
                    hamming,
                    centre: Point2D { x, y: x },
                    corners: [Point2D { x, y: x }; 4],
                    ..AprilTagDetection::default()
                })
                .collect();
            let of_the_map = |id: &u32| [3, 70, 71, 72, 73].contains(id);
            match read(&detections) {
                Ok(points) => {
                    prop_assert!(points.detections.iter().all(|point| of_the_map(&point.id)));
                    prop_assert!(points.ignored_ids.iter().all(of_the_map));
                }
                Err(refusal) => prop_assert_eq!(refusal.code(), OutcomeCode::UnknownId),
            }
        }
    }
}
