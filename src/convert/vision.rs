//! `vision_msgs/Detection2DArray` -> detections: the centre of each box is a marker's pixel.

use crate::messages::{Detection2D, Detection2DArray, Header, ObjectHypothesisWithPose, Time};
use crate::pipeline::{Detection, Refusal};
use crate::text::clip;

/// Returns the detections of a message, all without a sigma of their own.
///
/// # Errors
/// [`Refusal`] for the first detection without a clear marker id, or whose own header is that of
/// another image. Pixels are not checked here.
pub fn vision_detections(message: &Detection2DArray) -> Result<Vec<Detection>, Refusal> {
    let detection = |found: &Detection2D| {
        let id = marker_id(found)?;
        check_header(id, &message.header, &found.header)?;
        let centre = found.bbox.center.position;
        Ok(Detection {
            id,
            u_px: centre.x,
            v_px: centre.y,
            sigma_px: 0.0,
        })
    };
    message.detections.iter().map(detection).collect()
}

/// Returns the number that stands in `id`, or in the `class_id` of the best hypothesis.
///
/// Where both hold one they must agree: trackers use `id` for numbers of their own.
fn marker_id(found: &Detection2D) -> Result<u32, Refusal> {
    let class_id = best_class(&found.results)?;
    match (number(&found.id), class_id.and_then(number)) {
        (Some(id), Some(class)) if id != class => Err(Refusal::InvalidId {
            expected: "the same marker id in id and in class_id, or in one of them",
            got: format!("id {id} and class_id {class}"),
        }),
        (Some(id), _) | (None, Some(id)) => Ok(id),
        (None, None) => Err(Refusal::InvalidId {
            expected: "a whole number, 0 to 4294967295, in id or in the best hypothesis' class_id",
            got: format!(
                "id '{}' and {}",
                clip(&found.id),
                class_id.map_or("no hypothesis".to_owned(), |class| {
                    format!("class_id '{}'", clip(class))
                })
            ),
        }),
    }
}

/// Returns the `class_id` with the highest score; `None` if there is no hypothesis.
fn best_class(results: &[ObjectHypothesisWithPose]) -> Result<Option<&str>, Refusal> {
    if let [only] = results {
        return Ok(Some(&only.hypothesis.class_id)); // its score decides nothing
    }
    let mut best: Option<(&str, f64)> = None;
    let mut tied = None;
    for result in results {
        let (class, score) = (result.hypothesis.class_id.as_str(), result.hypothesis.score);
        if !score.is_finite() {
            return Err(Refusal::InvalidId {
                expected: "finite scores where there are several hypotheses",
                got: format!("score {score:?} for class_id '{}'", clip(class)),
            });
        }
        match best {
            Some((_, highest)) if score < highest => {}
            Some((other, highest)) if score <= highest => {
                if other != class {
                    tied = Some(class);
                }
            }
            _ => (best, tied) = (Some((class, score)), None),
        }
    }
    match (best, tied) {
        (Some((class, score)), Some(other)) => Err(Refusal::InvalidId {
            expected: "one best hypothesis",
            got: format!(
                "score {score} for class_id '{}' and for '{}'",
                clip(class),
                clip(other)
            ),
        }),
        _ => Ok(best.map(|(class, _)| class)),
    }
}

/// Returns the number that a text is, digits only.
fn number(text: &str) -> Option<u32> {
    let digits = text.bytes().all(|byte| byte.is_ascii_digit());
    digits.then(|| text.parse().ok()).flatten()
}

/// A detection's own header may be empty, or repeat that of its array.
fn check_header(id: u32, array: &Header, own: &Header) -> Result<(), Refusal> {
    let same_frame = own.frame_id.is_empty() || own.frame_id == array.frame_id;
    let same_stamp = own.stamp == Time::default() || own.stamp == array.stamp;
    if same_frame && same_stamp {
        return Ok(());
    }
    Err(Refusal::OtherImage {
        id,
        stamp: own.stamp.into(),
        frame_id: own.frame_id.clone(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::messages::{
        BoundingBox2D, ObjectHypothesis, Point2D, Pose, Pose2D, PoseWithCovariance,
    };
    use crate::pipeline::OutcomeCode;

    fn hypothesis(class_id: &str, score: f64) -> ObjectHypothesisWithPose {
        ObjectHypothesisWithPose {
            hypothesis: ObjectHypothesis {
                class_id: class_id.to_owned(),
                score,
            },
            pose: PoseWithCovariance {
                pose: Pose::default(),
                covariance: [0.0; 36],
            },
        }
    }

    fn found(id: &str, hypotheses: &[(&str, f64)]) -> Detection2D {
        Detection2D {
            results: hypotheses
                .iter()
                .map(|(class_id, score)| hypothesis(class_id, *score))
                .collect(),
            bbox: BoundingBox2D {
                center: Pose2D {
                    position: Point2D {
                        x: 12.5,
                        y: f64::NAN,
                    },
                    theta: f64::NAN,
                },
                size_x: f64::NAN,
                size_y: -1.0,
            },
            id: id.to_owned(),
            ..Detection2D::default()
        }
    }

    fn read(detection: Detection2D) -> Result<Vec<Detection>, Refusal> {
        vision_detections(&Detection2DArray {
            header: Header {
                stamp: Time { sec: 5, nanosec: 6 },
                frame_id: "camera".to_owned(),
            },
            detections: vec![detection],
        })
    }

    fn id_of(detection: Detection2D) -> Result<u32, Refusal> {
        Ok(read(detection)?[0].id)
    }

    #[test]
    fn pixel_is_the_centre_of_the_box_and_passes_unchecked() {
        let seen = read(found("3", &[])).expect("an id")[0];
        assert!((seen.u_px - 12.5).abs() < f64::EPSILON && seen.v_px.is_nan());
        assert_eq!(seen.sigma_px.to_bits(), 0.0_f64.to_bits());
    }

    #[test]
    fn marker_id_stands_in_the_id_or_in_the_best_class() {
        assert_eq!(id_of(found("7", &[])), Ok(7));
        assert_eq!(id_of(found("7", &[("beacon", 0.9)])), Ok(7));
        assert_eq!(id_of(found("7", &[("7", 0.9)])), Ok(7));
        assert_eq!(id_of(found("", &[("007", 0.9)])), Ok(7));
        assert_eq!(id_of(found("track-3", &[("7", 0.9)])), Ok(7));
        assert_eq!(
            id_of(found("", &[("1", 0.2), ("7", 0.9), ("2", 0.3)])),
            Ok(7)
        );
        assert_eq!(
            id_of(found("", &[("7", 0.9), ("7", 0.9), ("1", 0.1)])),
            Ok(7)
        );
        assert_eq!(
            id_of(found("", &[("1", 0.2), ("2", 0.2), ("7", 0.9)])),
            Ok(7)
        );
        assert_eq!(
            id_of(found("", &[("7", f64::NAN)])),
            Ok(7),
            "the only one is the best"
        );
    }

    #[test]
    fn what_names_no_single_marker_is_refused_as_an_unknown_id() {
        for (detection, word) in [
            (found("", &[]), "no hypothesis"),
            (found("beacon", &[("left", 0.9)]), "'beacon'"),
            (found("", &[("-1", 0.9)]), "'-1'"),
            (found("", &[("+1", 0.9)]), "'+1'"),
            (found("", &[("1.0", 0.9)]), "'1.0'"),
            (found(" 1", &[]), "' 1'"),
            (found("1\n\0", &[]), "'1\\n\\0'"),
            (found("4294967296", &[]), "4294967296"),
            (found("17", &[("3", 0.9)]), "id 17 and class_id 3"),
            (found("", &[("3", 0.5), ("4", 0.5)]), "'3' and for '4'"),
            (found("", &[("3", 0.5), ("4", f64::NAN)]), "NaN"),
            (found("3", &[("3", f64::INFINITY), ("4", 0.1)]), "inf"),
        ] {
            let refusal = id_of(detection).expect_err(word);
            assert_eq!(refusal.code(), OutcomeCode::UnknownId);
            assert!(refusal.to_string().contains(word), "{refusal}");
        }
        let long = id_of(found(&"x".repeat(1_000_000), &[])).expect_err("no number");
        assert!(long.to_string().len() < 300);
    }

    #[test]
    fn detection_of_another_image_is_refused() {
        let with_header = |sec, frame_id: &str| Detection2D {
            header: Header {
                stamp: Time {
                    sec,
                    nanosec: 6 * u32::from(sec != 0),
                },
                frame_id: frame_id.to_owned(),
            },
            ..found("3", &[])
        };
        for (sec, frame_id) in [(0, ""), (5, ""), (0, "camera"), (5, "camera")] {
            assert!(read(with_header(sec, frame_id)).is_ok(), "{sec} {frame_id}");
        }
        for (sec, frame_id) in [(4, "camera"), (5, "other"), (0, "other")] {
            let refusal = read(with_header(sec, frame_id)).expect_err("another image");
            assert_eq!(refusal.code(), OutcomeCode::FrameMismatch);
        }
    }

    #[test]
    fn nothing_gives_nothing() {
        assert_eq!(
            vision_detections(&Detection2DArray::default()),
            Ok(Vec::new())
        );
    }
}
