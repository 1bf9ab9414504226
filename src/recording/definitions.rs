//! Definitions of the message types that are written, as `ros2msg` text: what lets others read a recording without them.
//!
//! Those of this package are its `.msg` files. Of the others the fields are repeated here, in the order of the structs in
//! `messages`; constants and comments are not, which no reader needs.

use super::message::Definition;

/// Between the definition of a type and those of its dependencies.
const SEPARATOR: &str =
    "================================================================================\n";

macro_rules! ours {
    ($($name:literal),+ $(,)?) => {
        [$((
            concat!("tanker_pose/msg/", $name),
            include_str!(concat!("../../msg/", $name, ".msg")),
        )),+]
    };
}

const OURS: [(&str, &str); 6] = ours![
    "EstimatorStatus",
    "FeaturePoint",
    "FeaturePointArray",
    "Integrity",
    "IntegrityPoint",
    "ReceptacleState",
];

#[rustfmt::skip]
const OTHERS: &[(&str, &str)] = &[
    ("builtin_interfaces/msg/Time", "int32 sec\nuint32 nanosec\n"),
    ("builtin_interfaces/msg/Duration", "int32 sec\nuint32 nanosec\n"),
    ("std_msgs/msg/Header", "builtin_interfaces/Time stamp\nstring frame_id\n"),
    ("std_msgs/msg/ColorRGBA", "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n"),
    ("geometry_msgs/msg/Point", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"),
    ("geometry_msgs/msg/Quaternion", "float64 x 0\nfloat64 y 0\nfloat64 z 0\nfloat64 w 1\n"),
    ("geometry_msgs/msg/Pose", "Point position\nQuaternion orientation\n"),
    ("geometry_msgs/msg/PoseStamped", "std_msgs/Header header\nPose pose\n"),
    ("geometry_msgs/msg/PoseWithCovariance", "Pose pose\nfloat64[36] covariance\n"),
    ("geometry_msgs/msg/PoseWithCovarianceStamped", "std_msgs/Header header\nPoseWithCovariance pose\n"),
    ("geometry_msgs/msg/Twist", "Vector3 linear\nVector3 angular\n"),
    ("geometry_msgs/msg/TwistWithCovariance", "Twist twist\nfloat64[36] covariance\n"),
    ("geometry_msgs/msg/Transform", "Vector3 translation\nQuaternion rotation\n"),
    ("geometry_msgs/msg/TransformStamped", "std_msgs/Header header\nstring child_frame_id\nTransform transform\n"),
    ("tf2_msgs/msg/TFMessage", "geometry_msgs/TransformStamped[] transforms\n"),
    ("nav_msgs/msg/Odometry",
     "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
      geometry_msgs/TwistWithCovariance twist\n"),
    ("sensor_msgs/msg/RegionOfInterest",
     "uint32 x_offset\nuint32 y_offset\nuint32 height\nuint32 width\nbool do_rectify\n"),
    ("sensor_msgs/msg/CameraInfo",
     "std_msgs/Header header\nuint32 height\nuint32 width\nstring distortion_model\nfloat64[] d\nfloat64[9] k\n\
      float64[9] r\nfloat64[12] p\nuint32 binning_x\nuint32 binning_y\nRegionOfInterest roi\n"),
    ("sensor_msgs/msg/CompressedImage", "std_msgs/Header header\nstring format\nuint8[] data\n"),
    ("sensor_msgs/msg/Imu",
     "std_msgs/Header header\ngeometry_msgs/Quaternion orientation\nfloat64[9] orientation_covariance\n\
      geometry_msgs/Vector3 angular_velocity\nfloat64[9] angular_velocity_covariance\n\
      geometry_msgs/Vector3 linear_acceleration\nfloat64[9] linear_acceleration_covariance\n"),
    ("diagnostic_msgs/msg/KeyValue", "string key\nstring value\n"),
    ("diagnostic_msgs/msg/DiagnosticStatus",
     "byte level\nstring name\nstring message\nstring hardware_id\nKeyValue[] values\n"),
    ("diagnostic_msgs/msg/DiagnosticArray", "std_msgs/Header header\nDiagnosticStatus[] status\n"),
    ("visualization_msgs/msg/UVCoordinate", "float32 u\nfloat32 v\n"),
    ("visualization_msgs/msg/MeshFile", "string filename\nuint8[] data\n"),
    ("visualization_msgs/msg/Marker",
     "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
      geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\nbool frame_locked\n\
      geometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\nstring texture_resource\n\
      sensor_msgs/CompressedImage texture\nUVCoordinate[] uv_coordinates\nstring text\nstring mesh_resource\n\
      MeshFile mesh_file\nbool mesh_use_embedded_materials\n"),
    ("visualization_msgs/msg/MarkerArray", "Marker[] markers\n"),
    ("vision_msgs/msg/Point2D", "float64 x\nfloat64 y\n"),
    ("vision_msgs/msg/Pose2D", "Point2D position\nfloat64 theta\n"),
    ("vision_msgs/msg/BoundingBox2D", "Pose2D center\nfloat64 size_x\nfloat64 size_y\n"),
    ("vision_msgs/msg/ObjectHypothesis", "string class_id\nfloat64 score\n"),
    ("vision_msgs/msg/ObjectHypothesisWithPose",
     "ObjectHypothesis hypothesis\ngeometry_msgs/PoseWithCovariance pose\n"),
    ("vision_msgs/msg/Detection2D",
     "std_msgs/Header header\nObjectHypothesisWithPose[] results\nBoundingBox2D bbox\nstring id\n"),
    ("vision_msgs/msg/Detection2DArray", "std_msgs/Header header\nDetection2D[] detections\n"),
    ("apriltag_msgs/msg/Point", "float64 x\nfloat64 y\n"),
    ("apriltag_msgs/msg/AprilTagDetection",
     "string family\nint32 id\nint32 hamming\nfloat32 goodness\nfloat32 decision_margin\nPoint centre\n\
      Point[4] corners\nfloat64[9] homography\n"),
    ("apriltag_msgs/msg/AprilTagDetectionArray", "std_msgs/Header header\nAprilTagDetection[] detections\n"),
    ("px4_msgs/msg/LandingTargetPose",
     "uint64 timestamp\nbool is_static\nbool rel_pos_valid\nbool rel_vel_valid\nbool rel_vel_ekf2_valid\nfloat32 x_rel\n\
      float32 y_rel\nfloat32 z_rel\nfloat32 vx_rel\nfloat32 vy_rel\nfloat32 vz_rel\nfloat32 cov_x_rel\n\
      float32 cov_y_rel\nfloat32 cov_z_rel\nfloat32 cov_vx_rel\nfloat32 cov_vy_rel\nfloat32 cov_vz_rel\n\
      bool abs_pos_valid\nfloat32 x_abs\nfloat32 y_abs\nfloat32 z_abs\n"),
    ("px4_msgs/msg/FiducialMarkerPosReport",
     "uint64 timestamp\nuint64 timestamp_sample\nfloat32[3] rel_pos\nfloat32[3] cov_rel_pos\nfloat32[4] q\n"),
    ("px4_msgs/msg/VehicleAttitude",
     "uint64 timestamp\nuint64 timestamp_sample\nfloat32[4] q\nfloat32[4] delta_q_reset\nuint8 quat_reset_counter\n"),
    ("mavros_msgs/msg/LandingTarget",
     "std_msgs/Header header\nuint8 target_num\nuint8 frame\nfloat32[2] angle\nfloat32 distance\nfloat32[2] size\n\
      geometry_msgs/Pose pose\nuint8 type\n"),
];

/// Returns the text of one type, without its dependencies.
fn own_text(type_name: &str) -> Option<&'static str> {
    let all = OURS.iter().chain(OTHERS);
    all.clone()
        .find(|(name, _)| *name == type_name)
        .map(|(_, text)| *text)
}

/// Returns the definition of a type with those of its dependencies, by its full name (`package/msg/Name`); `None` of a
/// type that nothing here reads or writes.
#[must_use]
pub fn definition(type_name: &str) -> Option<Definition> {
    let mut text = own_text(type_name)?.to_owned();
    let mut seen = vec![type_name.to_owned()];
    let mut at = 0;
    while at < seen.len() {
        let name = seen[at].clone();
        at += 1;
        let Some(own) = own_text(&name) else {
            continue;
        };
        if at > 1 {
            let short = name.replacen("/msg/", "/", 1);
            text.push_str(SEPARATOR);
            text.extend(["MSG: ", &short, "\n", own]);
        }
        for (kind, _) in fields(own) {
            let full = full_name(&kind, &name);
            if own_text(&full).is_some() && !seen.contains(&full) {
                seen.push(full);
            }
        }
        if !text.ends_with('\n') {
            text.push('\n');
        }
    }
    Some(Definition {
        encoding: "ros2msg".to_owned(),
        text: text.into_bytes(),
    })
}

/// Returns the fields of a definition as (type, name), without constants.
fn fields(text: &str) -> impl Iterator<Item = (String, String)> {
    text.lines().filter_map(|line| {
        let line = line.split('#').next().unwrap_or_default();
        let mut words = line.split_whitespace();
        let (kind, name) = (words.next()?, words.next()?);
        // `=` stands with or without spaces around it.
        let is_constant = name.contains('=') || words.next().is_some_and(|w| w.starts_with('='));
        (!is_constant).then(|| (kind.to_owned(), name.to_owned()))
    })
}

/// Returns the full name of a field's type, its array left out, in the type `within`.
fn full_name(kind: &str, within: &str) -> String {
    let element = kind.split('[').next().unwrap_or_default();
    match element.split('/').collect::<Vec<_>>()[..] {
        [package, name] | [package, "msg", name] => format!("{package}/msg/{name}"),
        _ if element == "Header" => "std_msgs/msg/Header".to_owned(),
        _ => {
            let package = within.split('/').next().unwrap_or_default();
            format!("{package}/msg/{element}")
        }
    }
}

/// Returns how a recording's definition of a type differs from the fields that are decoded here; `None` where it does not,
/// or is in another language.
#[must_use]
pub fn difference(type_name: &str, recorded: &Definition) -> Option<String> {
    let own = definition(type_name)?;
    if recorded.encoding != own.encoding {
        return None;
    }
    let recorded_text = String::from_utf8_lossy(&recorded.text);
    let own_text = String::from_utf8_lossy(&own.text).into_owned();
    let (recorded, own) = (
        sections(&recorded_text, type_name),
        sections(&own_text, type_name),
    );
    own.iter().find_map(|(name, own)| {
        let found = recorded.iter().find(|(other, _)| other == name);
        let Some((_, found)) = found else {
            return Some(format!("it does not define {name}"));
        };
        let pairs = own.iter().zip(found);
        if let Some((expected, got)) = pairs.into_iter().find(|(a, b)| a != b) {
            return Some(format!(
                "in {name} it has {:?} where {expected:?} is expected",
                crate::text::clip(got)
            ));
        }
        (own.len() != found.len()).then(|| {
            format!(
                "{name} has {} fields, expected are {}",
                found.len(),
                own.len()
            )
        })
    })
}

/// Returns the types of a definition, each with its fields in one form.
fn sections(text: &str, type_name: &str) -> Vec<(String, Vec<String>)> {
    let mut name = type_name.to_owned();
    let mut found: Vec<(String, Vec<String>)> = vec![(name.clone(), Vec::new())];
    for line in text.lines() {
        if let Some(next) = line.strip_prefix("MSG:") {
            name = full_name(next.trim(), "");
            found.push((name.clone(), Vec::new()));
            continue;
        }
        for (kind, field) in fields(line) {
            let element = kind.split('[').next().unwrap_or_default();
            let is_primitive =
                element.chars().next().is_some_and(char::is_lowercase) && !element.contains('/');
            let array = &kind[element.len()..];
            let kind = if is_primitive {
                element.to_owned()
            } else {
                full_name(element, &name)
            };
            if let Some((_, fields)) = found.last_mut() {
                fields.push(format!("{kind}{array} {field}"));
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_definition_brings_all_of_its_dependencies() {
        for (name, _) in OURS.iter().chain(OTHERS) {
            let found = definition(name).expect("it is in the table");
            let text = String::from_utf8(found.text.clone()).expect("text");
            for (_, fields) in sections(&text, name) {
                for field in fields {
                    let kind = field.split(['[', ' ']).next().expect("a type");
                    let is_defined = !kind.contains('/')
                        || kind == *name
                        || text.contains(&format!("MSG: {}\n", kind.replacen("/msg/", "/", 1)));
                    assert!(is_defined, "{name}: {field}");
                }
            }
            assert_eq!(difference(name, &found), None);
        }
    }

    #[test]
    fn another_definition_is_told_by_its_field() {
        let name = "tanker_pose/msg/FeaturePointArray";
        let mut other = definition(name).expect("it is ours");
        let text = String::from_utf8(other.text).expect("text");
        other.text = text.replace("float64 u ", "float32 u ").into_bytes();
        let words = difference(name, &other).expect("it differs");
        assert!(words.contains("float32 u"), "{words}");
    }

    #[test]
    fn full_and_short_names_of_types_are_the_same() {
        let name = "geometry_msgs/msg/PoseStamped";
        let mut other = definition(name).expect("it is in the table");
        let text = String::from_utf8(other.text).expect("text");
        let text = text
            .replace(
                "std_msgs/Header header",
                "std_msgs/msg/Header header # as it was",
            )
            .replace("Pose pose", "geometry_msgs/Pose pose");
        other.text = text.into_bytes();
        assert_eq!(difference(name, &other), None);
    }
}
