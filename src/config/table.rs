//! The declaration of each parameter: name, type, default, range, unit, whether it is fixed, and description.
//!
//! `tanker_pose parameters --yaml` and `--markdown` print it; tests compare the output with `config/tanker_pose.yaml`
//! and `docs/parameters.md`, and detect a parameter that is not used.

use ros2_node::parameters::{
    Key, count, double, frame_id, integer, one_of, optional_text, switch, text,
};

use super::words::{Attitude, Input};
use crate::estimation::{Initialisation, Refinement};

const fn angle() -> Key<f64> {
    double(0.0, [-180.0, 180.0]).unit("deg")
}

/// An output that is off by default.
const fn output() -> Key<bool> {
    switch(false).fixed()
}

ros2_node::declare_parameters! {
    "The tanker, and the node itself" {
        /// where the beacons are on the tanker: a shipped map (paper, fin6) or the path of a YAML file
        marker_map: String = text("paper").fixed();
        /// child frame of the pose in odometry and /tf; axes x forward, y left, z up
        tanker_frame_id: String = frame_id("tanker").fixed();
        /// also publish trusted poses to /tf, parent: the camera's optical frame
        publish_tf: bool = output();
        /// run as a managed (lifecycle) node: it reads its files (marker map, refuelling, calibration budget) and opens
        /// its topics when configured, and processes detections while active
        lifecycle: bool = switch(false).fixed();
        /// use /clock as the time of diagnostics and parameter events; poses always have the stamps of their
        /// detections, never the time of a clock
        use_sim_time: bool = switch(false);
        /// also publish markers, for RViz and Foxglove
        publish_markers: bool = output();
        /// also publish predicted_points: where the markers will be in the next image, with sigmas, for detectors
        publish_predicted_points: bool = output();
    }

    "Detections" {
        /// where detections come from: topic feature_points (tanker_pose/FeaturePointArray), or topic detections
        /// with vision_msgs/Detection2DArray (detections) or apriltag_msgs/AprilTagDetectionArray (apriltags)
        input: Input = one_of().fixed();
        /// tags with more corrected bits than this are left out
        max_hamming: i32 = count(0, [0, 10]).fixed();
        /// standard deviation of a detection's column and row if it does not state one
        pixel_sigma_px: f64 = double(0.5, [0.001, 100.0]).unit("px");
        /// detections closer than this to the edge of the image are left out, because the edge may cut their beacons
        /// and shift their centroids; use the radius of the largest beacon in the image; 0: none is left out
        edge_margin_px: f64 = double(3.0, [0.0, 1000.0]).unit("px");
        /// how long the detections may be the same to the last bit in image after image, by their stamps, before camera or
        /// detector counts as stuck and frames are refused; 0: for ever (a detector of whole pixels on a test bench)
        max_frozen_s: f64 = double(0.5, [0.0, 60.0]).unit("s");
        /// the detections are pixels of the rectified image: use P of the camera info instead of K and D
        rectified: bool = switch(false);
        /// fewest detections of similar sigma for a pose; with 4, small errors in one detection go unnoticed; with 3,
        /// all do
        min_points: usize = count(5, [3, 1000]);
        /// how many detections may be excluded from a frame as wrong; with two of six excluded, the rest has little
        /// redundancy
        max_outliers: usize = count(1, [0, 2]);
    }

    "Where the iteration starts" {
        /// where the iteration starts: the nominal attitude (In_M2), a linear camera matrix (In_M1),
        /// the last trusted pose, or a search over all attitudes
        initialisation: Initialisation = one_of();
        /// expected roll of the tanker relative to the receiver; both with x forward, y left, z up, and the attitude
        /// is Rz(yaw) Ry(pitch) Rx(roll)
        nominal_roll_deg: f64 = angle();
        /// expected pitch of the tanker relative to the receiver
        nominal_pitch_deg: f64 = angle();
        /// expected yaw of the tanker relative to the receiver
        nominal_yaw_deg: f64 = angle();
        /// roll of the camera in the receiver; all zero: it looks along the receiver's x axis, upright
        camera_mount_roll_deg: f64 = angle();
        /// pitch of the camera in the receiver; positive: it looks down
        camera_mount_pitch_deg: f64 = angle();
        /// yaw of the camera in the receiver; positive: it looks left
        camera_mount_yaw_deg: f64 = angle();
        /// largest rotation of the tanker from its nominal attitude; beyond it the mount may be wrong: receptacle and
        /// flight-stack outputs are withheld, and unexpected_attitude is a fault after 3 s; 180: any attitude is
        /// accepted
        max_attitude_deviation_deg: f64 = double(15.0, [1.0, 180.0]).unit("deg");
    }

    "The estimate and its judgement" {
        /// maximum_likelihood: least weighted pixel error; none: the orthogonal iteration's result as in the paper
        refinement: Refinement = one_of();
        /// probability that a correct frame passes the chi-squared test of its residuals
        trust_probability: f64 = double(0.999, [0.5, 0.999_999]);
        /// refuse a pose when the second-best one is at least this likely relative to it; 1: never refuse
        max_ambiguity: f64 = double(0.1, [0.0, 1.0]);
        /// prove for each pose that no other one in front of the camera has a lower cost, and search for a better one where
        /// that cannot be proven: certificate in status, see docs/outcomes.md
        certify: bool = switch(false);
        /// refuse poses for which there is no such proof; turns certify on
        require_certificate: bool = switch(false);
        /// multiply the sigmas of detections by the factor by which the scatter of residuals over the last ten seconds
        /// exceeds them, if that is above 1; reported in the fault sigma and in the message of status; see
        /// docs/budget.md
        widen_by_sigma_factor: bool = switch(false);
    }

    "The error budget: docs/budget.md; survey and flex are in the marker map" {
        /// standard deviation of the tanker's attitude about the nominal one, each axis; it distinguishes a flat target
        /// from its mirror image; 0: no prior
        nominal_attitude_sigma_deg: f64 = double(0.0, [0.0, 45.0]).unit("deg");
        /// standard deviation of the tanker's attitude in the receiver as both aircraft report it (attitude, and topic
        /// tanker_attitude with sensor_msgs/Imu, ENU), each axis: both attitudes and the camera's mount together; where
        /// both have an attitude for an image, it is the frame's prior in place of the nominal one; 0: not used
        reported_attitude_sigma_deg: f64 = double(0.0, [0.0, 45.0]).unit("deg").fixed();
        /// farthest that an attitude of the tanker may be from the image, and two of them from each other
        tanker_attitude_max_age_s: f64 = double(0.2, [0.001, 1.0]).unit("s").fixed();
        /// relative standard deviation of the focal length: 0.003 is 0.3 %; 0: the calibration is exact
        focal_length_sigma: f64 = double(0.0, [0.0, 0.1]);
        /// standard deviation of each coordinate of the principal point
        principal_point_sigma_px: f64 = double(0.0, [0.0, 100.0]).unit("px");
        /// standard deviation of the first coefficient of D
        k1_sigma: f64 = double(0.0, [0.0, 1.0]);
        /// standard deviation of the second coefficient of D
        k2_sigma: f64 = double(0.0, [0.0, 1.0]);
        /// none, or the path of a YAML file such as config/cameras/budget_example.yaml with the calibration's standard
        /// deviations or covariance, in place of the four above
        calibration_budget_file: Option<String> = optional_text().fixed();
        /// standard deviation of a shift of the whole image, in u and in v, independent in each frame: vibration
        jitter_px: f64 = double(0.0, [0.0, 100.0]).unit("px");
        /// share of the variance of each detection's noise that is correlated from frame to frame; the track then
        /// averages less; 0: the noise of frames is independent
        correlated_noise_share: f64 = double(0.0, [0.0, 1.0]);
        /// time constant of the correlated noise
        correlated_noise_time_s: f64 = double(1.0, [1e-3, 1e4]).unit("s");
    }

    "The track: odometry, and the start of `previous`" {
        /// turn poses over time into odometry; initialisation previous starts from its prediction;
        /// receptacle and /fmu/in/landing_target_pose need it
        track: bool = switch(true);
        /// growth of the uncertainty of the velocity relative to the tanker: this many m/s in one second, twice as many
        /// in four; an acceleration a (1 sigma) that lasts t seconds corresponds to a √(2 t); too small a value makes
        /// the track lag, too large a value makes it noisy
        acceleration_density_mps2: f64 = double(0.15, [1e-4, 1e3]).unit("m/s²/√Hz");
        /// the same for the relative rate of turn, in deg/s
        angular_acceleration_density_dps2: f64 = double(4.0, [1e-3, 1e4]).unit("deg/s²/√Hz");
        /// both densities are multiplied by this while the innovations show that the track lags; 1: never
        manoeuvre_factor: f64 = double(5.0, [1.0, 100.0]);
        /// standard deviation of the relative velocity on each axis when a track begins
        initial_speed_sigma_mps: f64 = double(3.0, [1e-3, 1e3]).unit("m/s");
        /// standard deviation of the relative rate of turn on each axis when a track begins
        initial_rate_sigma_dps: f64 = double(10.0, [1e-2, 1e3]).unit("deg/s");
        /// probability that a correct pose passes the gate of the track; a pose that does not pass leaves the track
        /// unchanged
        gate_probability: f64 = double(0.9999, [0.5, 0.999_999_9]);
        /// the track is dropped this long after the last accepted pose; until then odometry is predicted
        max_gap_s: f64 = double(1.0, [1e-3, 60.0]).unit("s");
        /// consistent poses needed to confirm a track; there is no odometry before that
        confirm_frames: u32 = count(5, [2, 1000]);
    }

    "Protection levels: docs/integrity.md" {
        /// publish integrity: how far the tanker may be from where the pose has it, with a probability of error that is
        /// stated, undetected faults of beacons included; needs refinement maximum_likelihood
        publish_integrity: bool = output();
        /// receptacle and flight-stack outputs are held back unless every alert limit of the refuelling file is kept, by the
        /// track too where they carry it; needs publish_integrity
        require_integrity: bool = switch(false).fixed();
        /// probability with which an error may exceed its protection level in one of integrity_frames frames
        hmi_probability: f64 = double(1e-7, [1e-12, 0.01]);
        /// probability with which one of so many frames without a fault is declared faulty
        false_alert_probability: f64 = double(1e-5, [1e-9, 0.1]);
        /// probability that a beacon is faulty (a reflection, a wrong id, a displaced centre) during so many frames, each
        beacon_fault_probability: f64 = double(1e-4, [1e-9, 0.1]);
        /// whether two beacons at once are monitored; if not, their probability counts as unmonitored
        monitor_pairs: bool = switch(true);
        /// probability that a flex mode of the marker map is beyond its sigma by any amount, each; 0: never
        flex_fault_probability: f64 = double(0.0, [0.0, 0.1]);
        /// the same for each sigma of the calibration and for jitter
        calibration_fault_probability: f64 = double(0.0, [0.0, 0.1]);
        /// frames over which these probabilities hold: 1, or those of an approach
        integrity_frames: u32 = count(1, [1, 60_000]);
    }

    "Refuelling and flight stacks: docs/from_camera_to_autopilot.md" {
        /// none, or the path of a YAML file such as config/refuelling/example.yaml with camera, probe tip, receptacle and
        /// envelope; all outputs of this section need one
        refuelling: Option<String> = optional_text().fixed();
        /// frame of receptacle; axes x forward, y left, z up, fixed to the receiver
        receiver_frame_id: String = frame_id("receiver").fixed();
        /// publish receptacle: position of the receptacle relative to the probe tip, closing speed, envelope
        publish_receptacle: bool = output();
        /// publish /fmu/in/landing_target_pose from the track, NED; needs attitude, excludes publish_px4_fiducial_marker
        publish_px4_landing_target: bool = output();
        /// publish /fmu/in/fiducial_marker_pos_report from single frames, FRD; needs attitude, excludes
        /// publish_px4_landing_target
        publish_px4_fiducial_marker: bool = output();
        /// publish /mavros/landing_target/raw from single frames, which MAVROS converts to BODY_FRD
        publish_mavros_landing_target: bool = output();
        /// publish /mavros/landing_target/pose from single frames, ENU, for your own consumers: not for PX4; needs
        /// attitude
        publish_mavros_pose: bool = output();
        /// source of the receiver's attitude: none, /fmu/out/vehicle_attitude (px4_msgs/VehicleAttitude) or
        /// /mavros/imu/data (sensor_msgs/Imu, ENU)
        attitude: Attitude = one_of().fixed();
        /// largest time difference between an attitude of the receiver and the image, and between two attitudes
        attitude_max_age_s: f64 = double(0.05, [0.001, 1.0]).unit("s").fixed();
        /// standard deviation of the receiver's attitude on each axis; the covariances in the messages are not used
        attitude_sigma_deg: f64 = double(1.0, [0.001, 30.0]).unit("deg").fixed();
        /// standard deviation of the receiver's rate on each axis
        attitude_rate_sigma_dps: f64 = double(1.0, [0.001, 100.0]).unit("deg/s").fixed();
        /// PX4's clock minus ROS's; 0 if the bridge converts the times
        px4_minus_ros_us: i64 = integer(0, [-9_000_000_000_000_000, 9_000_000_000_000_000]).unit("us").fixed();
    }
}
