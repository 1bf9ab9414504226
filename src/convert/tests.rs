use nalgebra::{Isometry3, Matrix6, Quaternion, Translation3, UnitQuaternion};

use super::*;
use crate::estimation::Excluded;
use crate::geometry::PoseCovariance;
use crate::pipeline::{FrameTrack, LeftOut, OutcomeCode, Refusal};

fn header() -> Header {
    // Neither a valid time nor a likely frame: nothing may depend on that.
    Header {
        stamp: Time {
            sec: -7,
            nanosec: u32::MAX,
        },
        frame_id: "käse/ ".to_owned(),
    }
}

fn solution() -> Solution {
    let rotation = UnitQuaternion::new_normalize(Quaternion::new(-0.1, 0.2, 0.3, 0.4));
    Solution {
        camera_from_tanker: Isometry3::from_parts(Translation3::new(1.0, 2.0, 30.0), rotation),
        covariance: PoseCovariance(Matrix6::from_fn(|row, column| (10 * row + column) as f64)),
        rms_px: 0.5,
        chi_squared: 3.0,
        degrees_of_freedom: 8,
        iterations: 5,
        ambiguity: 0.25,
        certificate: None,
        chi_squared_of_all: 0.0,
        chi_squared_limit: 26.1,
        initialisation: Initialisation::Dlt,
        excluded: Excluded::default(),
        prior: None,
        unclear: Excluded::default(),
    }
}

fn frame(result: Result<Solution, Refusal>, doubtful: Option<Solution>) -> FrameOutcome {
    FrameOutcome {
        result,
        doubtful,
        residuals: Vec::new(),
        used_ids: vec![1, 2],
        rejected_ids: vec![3],
        left_out: LeftOut::default(),
        initialisation: Some(Initialisation::Dlt),
        track: FrameTrack::default(),
        causes: None,
        integrity: None,
        track_integrity: None,
        separations: None,
        widened_by: 1.0,
    }
}

#[test]
fn stamp_and_pixels_pass_bit_for_bit() {
    let message = messages::FeaturePointArray {
        header: header(),
        points: vec![messages::FeaturePoint {
            id: 9,
            u: f64::NAN,
            v: -0.0,
            sigma: 0.1,
        }],
    };
    let seen = detections(&message)[0];
    assert_eq!(
        Time::from(Stamp::from(message.header.stamp)),
        message.header.stamp
    );
    assert_eq!(seen.id, 9);
    assert_eq!(seen.u_px.to_bits(), f64::NAN.to_bits());
    assert_eq!(seen.v_px.to_bits(), (-0.0f64).to_bits());
}

#[test]
fn covariance_is_row_major_and_quaternion_has_its_scalar_last_and_not_negative() {
    let message = pose(header(), &solution());
    assert_eq!(message.header, header());
    assert!(
        (message.pose.covariance[1] - 1.0).abs() < f64::EPSILON,
        "row 0, column 1"
    );
    assert!(
        (message.pose.covariance[6] - 10.0).abs() < f64::EPSILON,
        "row 1, column 0"
    );
    let q = message.pose.pose.orientation;
    assert!(q.w > 0.0 && q.x < 0.0 && q.z < q.y, "{q:?}");
    assert!((message.pose.pose.position.z - 30.0).abs() < f64::EPSILON);
}

#[test]
fn transform_and_pose_say_the_same() {
    let (pose, transform) = (
        pose(header(), &solution()),
        transform(header(), "t", &solution()),
    );
    let found = &transform.transforms[0];
    assert_eq!(found.child_frame_id, "t");
    assert_eq!(found.header, pose.header);
    assert_eq!(found.transform.rotation, pose.pose.pose.orientation);
    let position = pose.pose.pose.position;
    assert_eq!(
        found.transform.translation,
        messages::Vector3 {
            x: position.x,
            y: position.y,
            z: position.z
        }
    );
}

#[test]
fn estimate_gives_ok_without_a_message() {
    let frame = frame(Ok(solution()), None);
    let status = status(header(), &frame, &[], Duration::new(1, 500));
    assert_eq!(
        (status.outcome, status.message.as_str()),
        (OutcomeCode::Ok.number(), "")
    );
    assert_eq!(status.header, header());
    assert_eq!(
        (status.used_ids, status.rejected_ids),
        (vec![1, 2], vec![3])
    );
    assert_eq!((status.degrees_of_freedom, status.iterations), (8, 5));
    assert_eq!(status.initialisation, EstimatorStatus::INITIALISATION_DLT);
    assert_eq!(
        status.solve_time,
        messages::Duration {
            sec: 1,
            nanosec: 500
        }
    );
}

#[test]
fn certificate_of_a_solution_is_told_whether_or_not_it_is_refused() {
    let told = |certificate, is_refused: bool| {
        let solution = Solution {
            certificate,
            ..solution()
        };
        let frame = if is_refused {
            frame(Err(Refusal::NotCertified), Some(solution))
        } else {
            frame(Ok(solution), None)
        };
        status(header(), &frame, &[], Duration::ZERO).certificate
    };
    for is_refused in [false, true] {
        for (certificate, number) in [
            (None, EstimatorStatus::CERTIFICATE_NONE),
            (
                Some(Certificate::Certified),
                EstimatorStatus::CERTIFICATE_CERTIFIED,
            ),
            (
                Some(Certificate::NotCertified),
                EstimatorStatus::CERTIFICATE_NOT_CERTIFIED,
            ),
            (
                Some(Certificate::Replaced),
                EstimatorStatus::CERTIFICATE_REPLACED,
            ),
        ] {
            assert_eq!(told(certificate, is_refused), number);
        }
    }
}

#[test]
fn refusal_without_a_solution_has_nan_and_a_message() {
    let status = status(
        header(),
        &frame(Err(Refusal::NoCameraInfo), None),
        &[9],
        Duration::ZERO,
    );
    assert_eq!(status.outcome, OutcomeCode::NoCameraInfo.number());
    assert_eq!(status.rejected_ids, [3, 9]);
    assert!(!status.message.is_empty());
    assert!(status.rms_residual.is_nan() && status.chi_squared.is_nan());
    assert!(status.ambiguity.is_nan());
    assert_eq!(status.degrees_of_freedom, 0);
}

#[test]
fn refusal_judged_on_numbers_shows_them() {
    let doubtful = frame(Err(Refusal::NoCameraInfo), Some(solution()));
    let status = status(header(), &doubtful, &[], Duration::ZERO);
    assert!((status.chi_squared - 3.0).abs() < f64::EPSILON);
}
