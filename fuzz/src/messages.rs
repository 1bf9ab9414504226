//! CDR of every message type: the first byte of the input chooses the type.

use std::cell::LazyCell;
use std::sync::Arc;

use tanker_pose::answering::input::{InputMessage, InputReader};
use tanker_pose::camera::{CameraInfo, Pixel, Ray};
use tanker_pose::config::{Configuration, Input, Parameters, Settings, TABLE};
use tanker_pose::convert;
use tanker_pose::messages::{self, Header, Message, Time};
use tanker_pose::pipeline::{Detection, DetectionFrame, Pipeline, Stamp};
use tanker_pose::recording::cdr;
use tanker_pose::target::MarkerMap;

use super::promises;

/// The frame of the images.
const FRAME: &str = "camera";

/// Returns the message, if there is one. What is decoded and written again is decoded as the same message, by its bytes:
/// numbers may be NaN.
pub fn decoded<M: Message>(bytes: &[u8]) -> Option<M> {
    let message: M = cdr::decode(bytes).ok()?;
    let written = cdr::encode(&message).expect("what was decoded can be written");
    let again: M = cdr::decode(&written).expect("what was written can be read");
    let twice = cdr::encode(&again).expect("what was decoded can be written");
    assert_eq!(written, twice, "{}", M::NAME);
    Some(message)
}

macro_rules! checked {
    ($choice:expr, $bytes:expr; $($name:ident)+) => {{
        let all: &[fn(&[u8])] = &[$(|bytes| { let _ = decoded::<messages::$name>(bytes); }),+];
        if let Some(check) = all.get(usize::from($choice)) {
            check($bytes);
        }
    }};
}

/// Any message.
pub fn cdr(bytes: &[u8]) {
    let Some((choice, bytes)) = bytes.split_first() else {
        return;
    };
    match choice {
        b'a' => {
            if let Some(message) = decoded(bytes) {
                frame(Input::FeaturePoints, InputMessage::FeaturePoints(message));
            }
        }
        b'b' => {
            if let Some(message) = decoded(bytes) {
                frame(Input::Detections, InputMessage::Detections(message));
            }
        }
        b'c' => {
            if let Some(message) = decoded(bytes) {
                frame(Input::AprilTags, InputMessage::AprilTags(message));
            }
        }
        b'd' => {
            if let Some(message) = decoded::<messages::CameraInfo>(bytes) {
                let info = convert::camera_info(&message);
                promises::camera(&info);
                seen_by(&info, default_settings());
                let back = convert::camera_info_message(message.header.clone(), &info);
                let same = cdr::encode(&back).ok() == cdr::encode(&message).ok();
                assert!(same, "{message:?}");
            }
        }
        b'e' => {
            if let Some(message) = decoded::<messages::Imu>(bytes)
                && let Ok(sample) = convert::imu_attitude(&message)
            {
                let norm = sample.local_from_body.quaternion().norm();
                assert!((norm - 1.0).abs() < 1e-9, "{message:?}");
            }
        }
        b'f' => {
            if let Some(message) = decoded::<messages::VehicleAttitude>(bytes)
                && let Ok(sample) = convert::px4_attitude(&message, 0)
            {
                let norm = sample.local_from_body.quaternion().norm();
                assert!((norm - 1.0).abs() < 1e-9, "{message:?}");
            }
        }
        other => checked!(other.wrapping_sub(b'g'), bytes;
            PoseStamped PoseWithCovarianceStamped Odometry TFMessage DiagnosticArray MarkerArray EstimatorStatus
            Integrity ReceptacleState LandingTargetPose FiducialMarkerPosReport LandingTarget ParameterEvent
            TransitionEvent Clock Header),
    }
}

/// The settings of a node without arguments.
pub fn default_settings() -> Settings {
    Configuration::from(&Parameters::new(TABLE)).settings
}

/// The camera of the paper, without distortion.
pub fn paper_camera() -> CameraInfo {
    let text = include_str!("../../config/cameras/paper.yaml");
    let (info, _) = CameraInfo::from_yaml(text, "paper.yaml").expect("a shipped camera");
    info
}

/// Returns the map that is used for this input.
fn map_of(input: Input) -> MarkerMap {
    let text = match input {
        Input::AprilTags => include_str!("../../config/tankers/tags_example.yaml"),
        _ => include_str!("../../config/tankers/budget_example.yaml"),
    };
    MarkerMap::from_yaml(text, "shipped.yaml").expect("a shipped map")
}

/// Answers a message that a detector might send, twice: the second frame meets a track.
fn frame(input: Input, message: InputMessage) {
    thread_local! {
        static MAPS: LazyCell<[Arc<MarkerMap>; 2]> = const {
            LazyCell::new(|| [Input::FeaturePoints, Input::AprilTags].map(|input| Arc::new(map_of(input))))
        };
        static CAMERA: LazyCell<CameraInfo> = const { LazyCell::new(paper_camera) };
    }
    let map = MAPS.with(|maps| Arc::clone(&maps[usize::from(input == Input::AprilTags)]));
    let reader = InputReader {
        input,
        map: Arc::clone(&map),
        max_hamming: 0,
    };
    let read = reader.read(message);
    let mut pipeline = Pipeline::new(default_settings(), map);
    let known = CAMERA.with(|info| pipeline.set_camera(info, &read.header.frame_id));
    let stamp = Stamp::from(read.header.stamp);
    let mut frame = DetectionFrame {
        stamp,
        frame_id: read.header.frame_id,
        detections: read.detections,
        receiver_from_tanker: None,
    };
    for _ in 0..2 {
        let outcome = pipeline.process(&frame);
        promises::outcome(&outcome);
        assert!(known.is_ok() || outcome.result.is_err());
        let header = Header {
            stamp: Time::from(frame.stamp),
            frame_id: frame.frame_id.clone(),
        };
        let status = convert::status(header, &outcome, &[], std::time::Duration::ZERO);
        cdr::encode(&status).expect("a status can be written");
        frame.stamp.sec = frame.stamp.sec.saturating_add(1);
    }
}

/// The beacons as an accepted camera sees them are answered with a pose that can be used, or with a reason.
pub fn seen_by(info: &CameraInfo, settings: Settings) {
    let turned = settings.estimator.nominal_camera_from_tanker;
    let map = Arc::new(map_of(Input::FeaturePoints));
    let mut pipeline = Pipeline::new(settings, Arc::clone(&map));
    if pipeline.set_camera(info, FRAME).is_err() {
        return;
    }
    let Some((_, Ok(camera))) = pipeline.camera() else {
        return;
    };
    let detections = map.markers().iter().filter_map(|marker| {
        let p = turned * marker.marker_in_tanker.coords + nalgebra::Vector3::new(0.5, 1.0, 30.0);
        let ray = Ray {
            x: p.x / p.z,
            y: p.y / p.z,
        };
        let (Pixel { u, v }, _) = camera.project(ray)?;
        Some(Detection {
            id: marker.id,
            u_px: u,
            v_px: v,
            sigma_px: 0.5,
        })
    });
    let frame = DetectionFrame {
        stamp: Stamp { sec: 1, nanosec: 0 },
        frame_id: FRAME.to_owned(),
        detections: Ok(detections.collect()),
        receiver_from_tanker: None,
    };
    promises::outcome(&pipeline.process(&frame));
}
