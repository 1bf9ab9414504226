//! The inverse: messages that tools send to the node and receive from it.

use nalgebra::{Isometry3, Quaternion, Translation3, UnitQuaternion};

use crate::camera;
use crate::messages::{self, Header};
use crate::pipeline::Detection;

/// Returns the message of a camera info.
#[must_use]
pub fn camera_info_message(header: Header, info: &camera::CameraInfo) -> messages::CameraInfo {
    messages::CameraInfo {
        header,
        height: info.height,
        width: info.width,
        distortion_model: info.distortion_model.clone(),
        d: info.d.clone(),
        k: info.k,
        r: info.r,
        p: info.p,
        binning_x: info.binning_x,
        binning_y: info.binning_y,
        roi: messages::RegionOfInterest {
            x_offset: info.roi.x_offset,
            y_offset: info.roi.y_offset,
            height: info.roi.height,
            width: info.roi.width,
            do_rectify: info.roi.do_rectify,
        },
    }
}

/// Returns the message of an image's detections.
#[must_use]
pub fn feature_points_message(
    header: Header,
    detections: &[Detection],
) -> messages::FeaturePointArray {
    let point = |detection: &Detection| messages::FeaturePoint {
        id: detection.id,
        u: detection.u_px,
        v: detection.v_px,
        sigma: detection.sigma_px,
    };
    messages::FeaturePointArray {
        header,
        points: detections.iter().map(point).collect(),
    }
}

/// Returns the message of a pose without a covariance.
#[must_use]
pub fn pose_message(header: Header, pose: &Isometry3<f64>) -> messages::PoseStamped {
    let (t, q) = (&pose.translation, pose.rotation.quaternion());
    messages::PoseStamped {
        header,
        pose: messages::Pose {
            position: messages::Point {
                x: t.x,
                y: t.y,
                z: t.z,
            },
            orientation: messages::Quaternion {
                x: q.i,
                y: q.j,
                z: q.k,
                w: q.w,
            },
        },
    }
}

/// Returns the pose that a message holds; `None` when its numbers are not those of a pose.
#[must_use]
pub fn isometry(pose: &messages::Pose) -> Option<Isometry3<f64>> {
    let (p, q) = (&pose.position, &pose.orientation);
    let rotation = Quaternion::new(q.w, q.x, q.y, q.z);
    // ROS's own tolerance for a quaternion that should have length 1.
    let is_unit = (rotation.norm() - 1.0).abs() < 0.01;
    let is_finite = [p.x, p.y, p.z].iter().all(|value| value.is_finite());
    (is_unit && is_finite).then(|| {
        Isometry3::from_parts(
            Translation3::new(p.x, p.y, p.z),
            UnitQuaternion::from_quaternion(rotation),
        )
    })
}

#[cfg(test)]
mod tests {
    use super::super::{self as convert, camera_info};
    use super::*;
    use crate::simulation::paper_scene;

    #[test]
    fn what_is_sent_is_what_is_read() {
        let info = camera::CameraInfo {
            height: 412,
            width: 508,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.1; 5],
            k: [1.0; 9],
            r: [2.0; 9],
            p: [3.0; 12],
            binning_x: 2,
            binning_y: 4,
            roi: camera::RegionOfInterest {
                x_offset: 1,
                y_offset: 2,
                height: 3,
                width: 4,
                do_rectify: true,
            },
        };
        let sent = camera_info_message(Header::default(), &info);
        assert_eq!(camera_info(&sent), info);

        let detections = [Detection {
            id: 7,
            u_px: 1.0,
            v_px: 2.0,
            sigma_px: 0.5,
        }];
        let sent = feature_points_message(Header::default(), &detections);
        assert_eq!(convert::detections(&sent), detections);

        let scene = paper_scene();
        let truth = scene.truth_camera_from_tanker();
        let sent = pose_message(Header::default(), truth);
        let read = isometry(&sent.pose).expect("the scene's truth is a pose");
        assert_eq!(read.translation, truth.translation);
        assert!(read.rotation.angle_to(&truth.rotation) < 1e-7); // acos near 1 loses half the digits
    }

    #[test]
    fn numbers_that_are_no_pose_are_none() {
        let mut pose = messages::Pose::default();
        assert!(isometry(&pose).is_some());
        pose.position.y = f64::NAN;
        assert_eq!(isometry(&pose), None);
        pose = messages::Pose::default();
        pose.orientation.w = 0.0;
        assert_eq!(isometry(&pose), None);
    }
}
