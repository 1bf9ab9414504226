//! The one list of parameters: names, types, defaults, ranges, descriptions.

use super::{Kind, ParameterSpec};

const fn angle(name: &'static str, description: &'static str) -> ParameterSpec {
    let kind = Kind::Double {
        default: 0.0,
        min: -180.0,
        max: 180.0,
    };
    ParameterSpec {
        name,
        kind,
        read_only: false,
        description,
    }
}

/// An output that is off unless asked for.
const fn output(name: &'static str, description: &'static str) -> ParameterSpec {
    ParameterSpec {
        name,
        kind: Kind::Bool { default: false },
        read_only: true,
        description,
    }
}

/// All parameters. `config/tanker_pose.yaml` shows them to people; a test holds the two together.
pub const TABLE: &[ParameterSpec] = &[
    ParameterSpec {
        name: "marker_map",
        kind: Kind::Text { default: "paper" },
        read_only: true,
        description: "where the beacons sit on the tanker: a shipped map (paper, fin6) or the path of a YAML file",
    },
    ParameterSpec {
        name: "tanker_frame_id",
        kind: Kind::FrameId { default: "tanker" },
        read_only: true,
        description: "child frame of the pose in odometry and /tf; axes x forward, y left, z up",
    },
    ParameterSpec {
        name: "publish_tf",
        kind: Kind::Bool { default: false },
        read_only: true,
        description: "also publish trusted poses to /tf, parent: the camera's optical frame",
    },
    ParameterSpec {
        name: "publish_markers",
        kind: Kind::Bool { default: false },
        read_only: true,
        description: "also publish markers, which RViz and Foxglove draw",
    },
    output(
        "publish_predicted_points",
        "also publish predicted_points: where the markers will be in the next image, with sigmas, for detectors",
    ),
    ParameterSpec {
        name: "input",
        kind: Kind::Choice {
            default: "feature_points",
            allowed: &["feature_points", "detections", "apriltags"],
        },
        read_only: true,
        description: "where detections come from: topic feature_points (tanker_pose/FeaturePointArray), or topic detections \
                      with vision_msgs/Detection2DArray (detections) or apriltag_msgs/AprilTagDetectionArray (apriltags)",
    },
    ParameterSpec {
        name: "max_hamming",
        kind: Kind::Integer {
            default: 0,
            min: 0,
            max: 10,
        },
        read_only: true,
        description: "tags with more corrected bits than this are left out",
    },
    ParameterSpec {
        name: "pixel_sigma_px",
        kind: Kind::Double {
            default: 0.5,
            min: 0.001,
            max: 100.0,
        },
        read_only: false,
        description: "px, standard deviation of a detection's column and row where it brings no sigma of its own",
    },
    ParameterSpec {
        name: "edge_margin_px",
        kind: Kind::Double {
            default: 3.0,
            min: 0.0,
            max: 1000.0,
        },
        read_only: false,
        description: "px, detections nearer than this to the edge of the image are left out, since the edge may cut their beacons \
                      and move their centroids; the radius of the largest beacon in the image; 0: none is left out",
    },
    ParameterSpec {
        name: "rectified",
        kind: Kind::Bool { default: false },
        read_only: false,
        description: "the detections are pixels of the rectified image: use P of the camera info instead of K and D",
    },
    ParameterSpec {
        name: "initialisation",
        kind: Kind::Choice {
            default: "nominal",
            allowed: &["nominal", "dlt", "previous", "global"],
        },
        read_only: false,
        description: "where the iteration starts: the nominal attitude (In_M2), a linear camera matrix (In_M1), \
                      the last trusted pose, or a search over all attitudes",
    },
    angle(
        "nominal_roll_deg",
        "deg, expected roll of the tanker relative to the receiver",
    ),
    angle(
        "nominal_pitch_deg",
        "deg, expected pitch of the tanker relative to the receiver",
    ),
    angle(
        "nominal_yaw_deg",
        "deg, expected yaw of the tanker relative to the receiver",
    ),
    angle(
        "camera_mount_roll_deg",
        "deg, roll of the camera in the receiver; all zero: it looks along the receiver's x axis, upright",
    ),
    angle(
        "camera_mount_pitch_deg",
        "deg, pitch of the camera in the receiver; positive: it looks down",
    ),
    angle(
        "camera_mount_yaw_deg",
        "deg, yaw of the camera in the receiver; positive: it looks left",
    ),
    ParameterSpec {
        name: "max_attitude_deviation_deg",
        kind: Kind::Double {
            default: 15.0,
            min: 1.0,
            max: 180.0,
        },
        read_only: false,
        description: "deg, farthest that the tanker may stand off its nominal attitude: beyond it receptacle and flight-stack \
                      outputs are held back, and unexpected_attitude is a fault after 3 s; 180: any attitude is allowed",
    },
    ParameterSpec {
        name: "refuelling",
        kind: Kind::Text { default: "none" },
        read_only: true,
        description: "none, or the path of a YAML file with camera, probe tip, receptacle and envelope; \
                      the outputs after it need one",
    },
    ParameterSpec {
        name: "receiver_frame_id",
        kind: Kind::FrameId {
            default: "receiver",
        },
        read_only: true,
        description: "frame of receptacle; axes x forward, y left, z up, fixed to the receiver",
    },
    output(
        "publish_receptacle",
        "publish receptacle: where the receptacle is before the probe tip, closing speed, envelope",
    ),
    output(
        "publish_px4_landing_target",
        "publish /fmu/in/landing_target_pose from the track, NED; needs attitude, excludes publish_px4_fiducial_marker",
    ),
    output(
        "publish_px4_fiducial_marker",
        "publish /fmu/in/fiducial_marker_pos_report from single frames, FRD; needs attitude, excludes publish_px4_landing_target",
    ),
    output(
        "publish_mavros_landing_target",
        "publish /mavros/landing_target/raw from single frames, which MAVROS turns into BODY_FRD",
    ),
    output(
        "publish_mavros_pose",
        "publish /mavros/landing_target/pose from single frames, ENU, for consumers of your own: never for PX4; needs attitude",
    ),
    ParameterSpec {
        name: "attitude",
        kind: Kind::Choice {
            default: "none",
            allowed: &["none", "px4", "imu"],
        },
        read_only: true,
        description: "where the receiver's attitude comes from: none, /fmu/out/vehicle_attitude \
                      (px4_msgs/VehicleAttitude) or /mavros/imu/data (sensor_msgs/Imu, ENU)",
    },
    ParameterSpec {
        name: "attitude_max_age_s",
        kind: Kind::Double {
            default: 0.05,
            min: 0.001,
            max: 1.0,
        },
        read_only: true,
        description: "s, farthest that an attitude may be from the image, and two attitudes from each other",
    },
    ParameterSpec {
        name: "attitude_sigma_deg",
        kind: Kind::Double {
            default: 1.0,
            min: 0.001,
            max: 30.0,
        },
        read_only: true,
        description: "deg, standard deviation of the receiver's attitude on each axis",
    },
    ParameterSpec {
        name: "attitude_rate_sigma_dps",
        kind: Kind::Double {
            default: 1.0,
            min: 0.001,
            max: 100.0,
        },
        read_only: true,
        description: "deg/s, standard deviation of the receiver's rate on each axis",
    },
    ParameterSpec {
        name: "px4_minus_ros_us",
        kind: Kind::Integer {
            default: 0,
            min: -9_000_000_000_000_000,
            max: 9_000_000_000_000_000,
        },
        read_only: true,
        description: "us, what PX4's clock shows more than ROS's; 0 where the bridge translates the times",
    },
    ParameterSpec {
        name: "refinement",
        kind: Kind::Choice {
            default: "maximum_likelihood",
            allowed: &["maximum_likelihood", "none"],
        },
        read_only: false,
        description: "maximum_likelihood: least weighted pixel error; none: the orthogonal iteration's result as in the paper",
    },
    ParameterSpec {
        name: "max_outliers",
        kind: Kind::Integer {
            default: 1,
            min: 0,
            max: 2,
        },
        read_only: false,
        description: "how many detections may be excluded from a frame as wrong; two of six leave little to judge the rest by",
    },
    ParameterSpec {
        name: "min_points",
        kind: Kind::Integer {
            default: 5,
            min: 3,
            max: 1000,
        },
        read_only: false,
        description: "fewest detections of similar sigma for a pose; with 4, small errors in one detection go unnoticed; with 3, all do",
    },
    ParameterSpec {
        name: "trust_probability",
        kind: Kind::Double {
            default: 0.999,
            min: 0.5,
            max: 0.999_999,
        },
        read_only: false,
        description: "probability with which a correct frame passes the chi-squared test of its residuals",
    },
    ParameterSpec {
        name: "max_ambiguity",
        kind: Kind::Double {
            default: 0.1,
            min: 0.0,
            max: 1.0,
        },
        read_only: false,
        description: "refuse a pose when the second-best one is at least this likely relative to it; 1: never refuse",
    },
    ParameterSpec {
        name: "track",
        kind: Kind::Bool { default: true },
        read_only: false,
        description: "turn poses over time into odometry; initialisation previous starts from its prediction; \
                      receptacle and /fmu/in/landing_target_pose need it",
    },
    ParameterSpec {
        name: "acceleration_density_mps2",
        kind: Kind::Double {
            default: 0.15,
            min: 1e-4,
            max: 1e3,
        },
        read_only: false,
        description: "m/s²/√Hz, how fast the velocity relative to the tanker becomes unknown: by this many m/s in one second, \
                      twice as many in four; an acceleration a that lasts t seconds is a √(2 t)",
    },
    ParameterSpec {
        name: "angular_acceleration_density_dps2",
        kind: Kind::Double {
            default: 4.0,
            min: 1e-3,
            max: 1e4,
        },
        read_only: false,
        description: "deg/s²/√Hz, the same for the relative rate of turn, in deg/s",
    },
    ParameterSpec {
        name: "manoeuvre_factor",
        kind: Kind::Double {
            default: 5.0,
            min: 1.0,
            max: 100.0,
        },
        read_only: false,
        description: "both densities are multiplied by this while the frames show that the track lags; 1: never",
    },
    ParameterSpec {
        name: "initial_speed_sigma_mps",
        kind: Kind::Double {
            default: 3.0,
            min: 1e-3,
            max: 1e3,
        },
        read_only: false,
        description: "m/s, standard deviation of the relative velocity on each axis when a track begins",
    },
    ParameterSpec {
        name: "initial_rate_sigma_dps",
        kind: Kind::Double {
            default: 10.0,
            min: 1e-2,
            max: 1e3,
        },
        read_only: false,
        description: "deg/s, standard deviation of the relative rate of turn on each axis when a track begins",
    },
    ParameterSpec {
        name: "gate_probability",
        kind: Kind::Double {
            default: 0.9999,
            min: 0.5,
            max: 0.999_999_9,
        },
        read_only: false,
        description: "probability with which a correct pose is let into the track; one that contradicts the track does not touch it",
    },
    ParameterSpec {
        name: "max_gap_s",
        kind: Kind::Double {
            default: 1.0,
            min: 1e-3,
            max: 60.0,
        },
        read_only: false,
        description: "s after the last pose that fitted, the track is dropped; until then odometry is predicted",
    },
    ParameterSpec {
        name: "confirm_frames",
        kind: Kind::Integer {
            default: 5,
            min: 2,
            max: 1000,
        },
        read_only: false,
        description: "consistent poses that make a track; before that there is no odometry",
    },
    ParameterSpec {
        name: "lifecycle",
        kind: Kind::Bool { default: false },
        read_only: true,
        description: "be a managed node: it loads marker map and refuelling file and opens its topics when it is configured, \
                      and answers detections while it is active",
    },
    ParameterSpec {
        name: "use_sim_time",
        kind: Kind::Bool { default: false },
        read_only: false,
        description: "take the time of diagnostics and parameter events from /clock; \
                      stamps of poses are those of the detections either way, never read from a clock",
    },
];
