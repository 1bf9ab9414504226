//! Each message against the scene that it tells of: a receiver that flies north-east in a climb.

use nalgebra::{Matrix3, Matrix6, Quaternion, Translation3, UnitQuaternion};

use super::*;
use crate::geometry::{Matrix12, PoseCovariance};
use crate::messages::{Imu, Time, Vector3 as Vector3Message, VehicleAttitude};

/// Of single precision at twenty metres, m.
const SINGLE_M: f64 = 4e-6;
const STAMP_NS: i64 = 1_700_000_000_123_456_789;

fn attitude(sigma: f64) -> LocalAttitude {
    LocalAttitude {
        // Yaw 45°, pitch up 10°, in NED.
        local_from_b: UnitQuaternion::from_euler_angles(
            0.0,
            10.0_f64.to_radians(),
            45.0_f64.to_radians(),
        ),
        covariance: Matrix3::identity() * (sigma * sigma),
        rate_in_b: Vector3::new(0.0, 0.0, 0.1),
        rate_covariance: Matrix3::identity() * 1e-6,
    }
}

/// 20 m ahead, 3 m left, 4 m above, closing at 1 m/s.
fn motion() -> Motion {
    Motion {
        b_from_a: Isometry3::from_parts(
            Translation3::new(20.0, 3.0, 4.0),
            UnitQuaternion::identity(),
        ),
        velocity_in_b: Vector3::new(-1.0, 0.0, 0.0),
        rate_in_b: Vector3::zeros(),
        covariance: Matrix12::identity() * 1e-4,
    }
}

fn pose() -> PoseEstimate {
    PoseEstimate {
        b_from_a: motion().b_from_a,
        covariance: PoseCovariance(Matrix6::identity() * 1e-4),
    }
}

fn header() -> Header {
    Header {
        stamp: Time {
            sec: 1_700_000_000,
            nanosec: 123_456_789,
        },
        frame_id: "receiver".to_owned(),
    }
}

fn wide(values: [f32; 3]) -> Vector3<f64> {
    Vector3::from(values.map(f64::from))
}

/// FRD of the scene, by hand.
fn in_frd() -> Vector3<f64> {
    Vector3::new(20.0, -3.0, -4.0)
}

#[test]
fn px4_has_the_target_in_ned_moving_as_seen_from_axes_that_do_not_turn() {
    let told = px4_landing_target(STAMP_NS, &motion(), &attitude(0.01), -1_600_000_000_000_000)
        .expect("a good target");
    assert_eq!(told.timestamp, 100_000_000_123_456);
    let ned_from_frd = attitude(0.01).local_from_b;
    let position = wide([told.x_rel, told.y_rel, told.z_rel]);
    assert!((position - ned_from_frd * in_frd()).norm() < SINGLE_M);
    let frd_velocity = Vector3::new(-1.0, 0.0, 0.0) + Vector3::new(0.0, 0.0, 0.1).cross(&in_frd());
    let velocity = wide([told.vx_rel, told.vy_rel, told.vz_rel]);
    assert!((velocity - ned_from_frd * frd_velocity).norm() < SINGLE_M);
    assert!(told.rel_pos_valid && told.rel_vel_valid);
    // EKF2 would take the tanker for the ground.
    assert!(!told.is_static && !told.rel_vel_ekf2_valid && !told.abs_pos_valid);
}

#[test]
fn variances_hold_the_error_of_the_attitude() {
    let sure = px4_fiducial_marker(STAMP_NS, &pose(), &attitude(1e-9), 0).expect("good");
    let unsure = px4_fiducial_marker(STAMP_NS, &pose(), &attitude(0.02), 0).expect("good");
    assert!((wide(sure.cov_rel_pos) - Vector3::repeat(1e-4)).norm() < 1e-9);
    // σ² (|p|² − pᵢ²) on each axis: an error about an axis does not move what lies on it.
    let p = in_frd();
    for i in 0..3 {
        let expected = 1e-4 + 4e-4 * (p.norm_squared() - p[i] * p[i]);
        assert!((f64::from(unsure.cov_rel_pos[i]) - expected).abs() < 1e-6 * expected.max(1.0));
    }
    assert!((wide(sure.rel_pos) - p).norm() < SINGLE_M);
    let [w, x, y, z] = sure.q.map(f64::from);
    let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    assert!(q.angle_to(&attitude(0.0).local_from_b) < 1e-6);
    assert_eq!(sure.timestamp_sample, 1_700_000_000_123_456);
}

/// What MAVROS makes of a position and an attitude, whatever the frame: ENU to NED, FLU to FRD.
fn through_mavros(pose: &crate::messages::Pose) -> Isometry3<f64> {
    let pose = crate::convert::isometry(pose).expect("a pose");
    rotation_only(&ned_from_enu()) * pose * rotation_only(&frd_from_flu())
}

#[test]
fn mavros_makes_body_frd_of_the_landing_target() {
    let told = mavros_landing_target(header(), &pose()).expect("good");
    let sent = through_mavros(&told.pose);
    assert!((sent.translation.vector - in_frd()).norm() < 1e-12);
    // Aligned airframes: FRD of the tanker is that of the receiver.
    assert!(sent.rotation.angle() < 1e-7);
    assert_eq!((told.frame, told.r#type), (12, 3));
    assert!((f64::from(told.distance) - in_frd().norm()).abs() < SINGLE_M);
    assert!(told.angle[0] < 0.0 && told.angle[1] < 0.0, "left and above");
}

#[test]
fn mavros_makes_ned_of_the_pose() {
    let told = mavros_pose(header(), &pose(), &attitude(0.01)).expect("good");
    let sent = through_mavros(&told.pose);
    let ned_from_frd = attitude(0.01).local_from_b;
    assert!((sent.translation.vector - ned_from_frd * in_frd()).norm() < 1e-12);
    assert!(sent.rotation.angle_to(&ned_from_frd) < 1e-7);
}

#[test]
fn both_attitudes_of_one_flight_are_the_same() {
    // Level, nose to the east: yaw 90° in NED, 0 in ENU.
    let half = std::f32::consts::FRAC_1_SQRT_2;
    let px4 = VehicleAttitude {
        timestamp: 1,
        timestamp_sample: 5_000_000,
        q: [half, 0.0, 0.0, half],
        ..VehicleAttitude::default()
    };
    let imu = Imu {
        header: Header {
            stamp: Time { sec: 5, nanosec: 0 },
            ..Header::default()
        },
        ..Imu::default()
    };
    let px4 = px4_attitude(&px4, 0).expect("good");
    let imu = imu_attitude(&imu).expect("good");
    assert_eq!((px4.stamp_ns, imu.stamp_ns), (5_000_000_000, 5_000_000_000));
    let (from_px4, from_imu) = (px4.local_from_body, imu.local_from_body);
    assert!(from_px4.angle_to(&from_imu) < 1e-6);
    assert!((from_imu * Vector3::x() - Vector3::y()).norm() < 1e-12);
}

#[test]
fn the_gyros_rate_is_turned_to_frd_and_none_is_made_up() {
    let mut imu = Imu {
        angular_velocity: Vector3Message {
            x: 0.1,
            y: 0.2,
            z: 0.3,
        },
        ..Imu::default()
    };
    let rate = |imu: &Imu| imu_attitude(imu).expect("good").rate_in_body;
    let found = rate(&imu).expect("it was measured");
    assert!((found - Vector3::new(0.1, -0.2, -0.3)).norm() < 1e-15);
    imu.angular_velocity_covariance[0] = -1.0;
    assert_eq!(rate(&imu), None, "the message says so");
    assert_eq!(rate(&Imu::default()), None, "never filled in");
    imu.angular_velocity_covariance[0] = 0.0;
    imu.angular_velocity.y = f64::NAN;
    assert!(matches!(
        imu_attitude(&imu),
        Err(FlightStackError::Rate { .. })
    ));
}

/// Level, nose to the east, in PX4's message.
fn level() -> VehicleAttitude {
    let half = std::f32::consts::FRAC_1_SQRT_2;
    VehicleAttitude {
        timestamp: 1,
        timestamp_sample: 5_000_000,
        q: [half, 0.0, 0.0, half],
        ..VehicleAttitude::default()
    }
}

#[test]
fn px4s_attitude_in_other_axes_on_one_side_is_an_error_that_names_the_right_ones() {
    let [w, x, y, z] = level().q;
    let q = UnitQuaternion::from_quaternion(Quaternion::new(w, x, y, z));
    let half_turn = UnitQuaternion::from_axis_angle(&Vector3::x_axis(), std::f32::consts::PI);
    let to_ned = UnitQuaternion::from_rotation_matrix(&ned_from_enu().cast::<f32>());
    // NED from FLU, and ENU from FRD.
    for other in [q * half_turn, to_ned * q] {
        let told = VehicleAttitude {
            q: [other.w, other.i, other.j, other.k],
            ..level()
        };
        let error = px4_attitude(&told, 0).expect_err("on its back").to_string();
        assert!(
            error.contains("from FRD (x forward, y right, z down) to NED")
                && error.contains("tilted by 180° from level"),
            "{error}"
        );
    }
    assert!(px4_attitude(&level(), 0).is_ok());
}

#[test]
fn an_imu_in_other_axes_is_an_error_on_one_side_always_and_on_both_by_its_accelerometer() {
    // East of a level nose in FLU and ENU; a half turn about x exchanges FLU and FRD.
    let imu = Imu {
        orientation: crate::messages::Quaternion {
            x: 1.0,
            y: 0.0,
            z: 0.0,
            w: 0.0,
        },
        ..Imu::default()
    };
    let error = imu_attitude(&imu).expect_err("on its back").to_string();
    assert!(
        error.contains("from FLU (x forward, y left, z up) to ENU"),
        "{error}"
    );
    let mut imu = Imu::default();
    imu.linear_acceleration.z = 9.8;
    assert!(imu_attitude(&imu).is_ok());
    imu.linear_acceleration.z = -9.8;
    assert!(matches!(
        imu_attitude(&imu),
        Err(FlightStackError::Axes { .. })
    ));
    imu.linear_acceleration_covariance[0] = -1.0;
    assert!(
        imu_attitude(&imu).is_ok(),
        "the message says that it has none"
    );
    imu.linear_acceleration_covariance[0] = 0.0;
    imu.linear_acceleration.z = f64::NAN;
    assert!(imu_attitude(&imu).is_ok(), "nothing is made of it");
}

#[test]
fn attitudes_that_are_none_are_errors() {
    let mut px4 = VehicleAttitude {
        q: [1.0, 0.0, 0.0, 0.0],
        ..VehicleAttitude::default()
    };
    assert!(matches!(
        px4_attitude(&px4, 0),
        Err(FlightStackError::Time(_))
    ));
    px4.timestamp_sample = 1;
    for q in [
        [0.0; 4],
        [f32::NAN; 4],
        [2.0, 0.0, 0.0, 0.0],
        [f32::INFINITY; 4],
    ] {
        px4.q = q;
        let error = px4_attitude(&px4, 0).expect_err("no attitude");
        assert!(
            matches!(error, FlightStackError::Orientation { .. }),
            "{error}"
        );
    }
    let mut imu = Imu::default();
    imu.orientation_covariance[0] = -1.0;
    assert_eq!(imu_attitude(&imu), Err(FlightStackError::NoOrientation));
}

#[test]
fn what_flight_stacks_reject_is_not_sent() {
    let attitude = attitude(0.01);
    let mut nothing = motion();
    nothing.covariance = Matrix12::zeros();
    let mut exact = attitude;
    exact.covariance = Matrix3::zeros();
    assert!(matches!(
        px4_landing_target(STAMP_NS, &nothing, &exact, 0),
        Err(FlightStackError::Variance(_))
    ));
    assert!(matches!(
        px4_landing_target(0, &motion(), &attitude, 0),
        Err(FlightStackError::Time(_))
    ));
    let mut far = pose();
    far.b_from_a.translation.vector.x = f64::NAN;
    assert!(px4_fiducial_marker(STAMP_NS, &far, &attitude, 0).is_err());
    assert!(mavros_landing_target(header(), &far).is_err());
    assert!(mavros_pose(header(), &far, &attitude).is_err());
    let mut here = pose();
    here.b_from_a.translation.vector = Vector3::zeros();
    assert!(matches!(
        mavros_landing_target(header(), &here),
        Err(FlightStackError::Position { .. })
    ));
}
