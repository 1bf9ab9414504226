//! A frame's picture -> `visualization_msgs/MarkerArray`.

use nalgebra::{Point3, UnitQuaternion};

use crate::messages::{
    ColorRGBA, Duration, Header, Marker, MarkerArray, Point, Pose, Quaternion, Vector3,
};
use crate::picture::{Ellipsoid, Picture, Seen};

/// Diameter of a point, m.
const POINT_M: f64 = 0.2;
/// Width of a line, m.
const LINE_M: f64 = 0.02;
/// When detections stop, no message comes that could remove what is shown.
const LIFETIME: Duration = Duration { sec: 1, nanosec: 0 };

const GREEN: ColorRGBA = colour(0.1, 0.8, 0.2, 1.0);
const RED: ColorRGBA = colour(0.9, 0.1, 0.1, 1.0);
const GREY: ColorRGBA = colour(0.6, 0.6, 0.6, 0.6);
const YELLOW: ColorRGBA = colour(0.9, 0.8, 0.1, 1.0);
const BLUE: ColorRGBA = colour(0.2, 0.4, 0.9, 0.4);

/// Returns the markers of a frame, in the frame and at the time of its header.
///
/// The first one removes all that was shown before: nothing of an older frame can stay, whatever it had.
#[must_use]
pub fn markers(header: &Header, picture: &Picture) -> MarkerArray {
    let marker = |ns: &str, shape: i32, width_m: f64, color: ColorRGBA| Marker {
        header: header.clone(),
        ns: ns.to_owned(),
        r#type: shape,
        scale: Vector3 {
            x: width_m,
            y: width_m,
            z: width_m,
        },
        color,
        lifetime: LIFETIME,
        ..Marker::default()
    };
    let list = |ns: &str, shape: i32, color: ColorRGBA, points: Vec<Point>| {
        let width_m = if shape == Marker::LINE_LIST {
            LINE_M
        } else {
            POINT_M
        };
        // RViz complains of lists without members.
        (!points.is_empty()).then(|| Marker {
            points,
            ..marker(ns, shape, width_m, color)
        })
    };
    let (spheres, lines) = (Marker::SPHERE_LIST, Marker::LINE_LIST);
    let clear = Marker {
        header: header.clone(),
        action: Marker::DELETEALL,
        ..Marker::default()
    };
    let lists = [
        list("used", spheres, GREEN, estimated(&picture.used)),
        list("used_rays", lines, GREEN, rays(&picture.used)),
        list("rejected", spheres, RED, detected(&picture.rejected)),
        list("rejected_rays", lines, RED, rays(&picture.rejected)),
        list(
            "unseen",
            spheres,
            GREY,
            picture.unseen_in_camera.iter().map(point).collect(),
        ),
        list(
            "camera",
            lines,
            YELLOW,
            picture.frustum.iter().flat_map(edges).collect(),
        ),
    ];
    let covariance = picture.ellipsoid.as_ref().map(|ellipsoid| Marker {
        pose: pose(ellipsoid),
        scale: Vector3 {
            x: 2.0 * ellipsoid.half_axes_m.x,
            y: 2.0 * ellipsoid.half_axes_m.y,
            z: 2.0 * ellipsoid.half_axes_m.z,
        },
        ..marker("covariance", Marker::SPHERE, 0.0, BLUE)
    });
    let shown = lists.into_iter().chain([covariance]).flatten();
    MarkerArray {
        markers: std::iter::once(clear).chain(shown).collect(),
    }
}

const fn colour(r: f32, g: f32, b: f32, a: f32) -> ColorRGBA {
    ColorRGBA { r, g, b, a }
}

fn point(point: &Point3<f64>) -> Point {
    Point {
        x: point.x,
        y: point.y,
        z: point.z,
    }
}

fn estimated(seen: &[Seen]) -> Vec<Point> {
    seen.iter()
        .map(|seen| point(&seen.marker_in_camera))
        .collect()
}

fn detected(seen: &[Seen]) -> Vec<Point> {
    seen.iter()
        .map(|seen| point(&seen.detected_in_camera))
        .collect()
}

/// Lines from the camera to where the detections are.
fn rays(seen: &[Seen]) -> Vec<Point> {
    seen.iter()
        .flat_map(|seen| [Point::default(), point(&seen.detected_in_camera)])
        .collect()
}

/// Lines from the camera to the corners of its image, and around it.
fn edges(corners: &[Point3<f64>; 4]) -> Vec<Point> {
    (0..4)
        .flat_map(|i| {
            let (corner, next) = (point(&corners[i]), point(&corners[(i + 1) % 4]));
            [Point::default(), corner, corner, next]
        })
        .collect()
}

fn pose(ellipsoid: &Ellipsoid) -> Pose {
    Pose {
        position: point(&ellipsoid.centre_in_camera),
        orientation: quaternion(&ellipsoid.camera_from_axes),
    }
}

fn quaternion(rotation: &UnitQuaternion<f64>) -> Quaternion {
    let q = rotation.quaternion();
    Quaternion {
        x: q.i,
        y: q.j,
        z: q.k,
        w: q.w,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn header() -> Header {
        Header {
            frame_id: "camera".to_owned(),
            ..Header::default()
        }
    }

    fn seen(x: f64) -> Seen {
        Seen {
            id: 1,
            marker_in_camera: Point3::new(x, 0.0, 20.0),
            detected_in_camera: Point3::new(x, 1.0, 20.0),
        }
    }

    #[test]
    fn everything_shown_before_is_removed_first_and_nothing_is_shown_for_nothing() {
        let found = markers(&header(), &Picture::default()).markers;
        assert_eq!(found.len(), 1, "there is nothing to show");
        assert_eq!(found[0].action, Marker::DELETEALL);
        assert_eq!(found[0].header, header());
    }

    #[test]
    fn shown_markers_have_names_of_their_own_the_frame_and_an_end() {
        let picture = Picture {
            used: vec![seen(1.0), seen(2.0)],
            rejected: vec![seen(3.0)],
            unseen_in_camera: vec![Point3::origin()],
            ellipsoid: Some(Ellipsoid {
                centre_in_camera: Point3::new(0.0, 0.0, 20.0),
                camera_from_axes: UnitQuaternion::identity(),
                half_axes_m: nalgebra::Vector3::new(0.1, 0.2, 0.3),
            }),
            frustum: Some([Point3::origin(); 4]),
        };

        let found = markers(&header(), &picture).markers;

        assert_eq!(found[0].action, Marker::DELETEALL);
        let shown: Vec<(&str, usize)> = found[1..]
            .iter()
            .map(|marker| (marker.ns.as_str(), marker.points.len()))
            .collect();
        let expected = [
            ("used", 2),
            ("used_rays", 4),
            ("rejected", 1),
            ("rejected_rays", 2),
            ("unseen", 1),
            ("camera", 16),
            ("covariance", 0),
        ];
        assert_eq!(shown, expected);
        for marker in &found[1..] {
            assert_eq!((marker.action, marker.lifetime), (Marker::ADD, LIFETIME));
            assert_eq!(marker.header, header());
            assert!(marker.color.a > 0.0 && marker.scale.x > 0.0);
        }
        assert_eq!(found[3].color, RED);
        assert!(
            (found[3].points[0].y - 1.0).abs() < f64::EPSILON,
            "as detected"
        );
        assert!((found[7].scale.y - 0.4).abs() < f64::EPSILON, "a diameter");
    }
}
