//! The tanker's attitude in the receiver, from what both aircraft report of themselves.

use nalgebra::{Rotation3, UnitQuaternion};

use super::{AttitudeError, AttitudeHistory, frd_from_flu};

/// Why there is no attitude of the tanker in the receiver for a stamp.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum RelativeAttitudeError {
    /// That of the receiver is missing.
    #[error("the receiver's attitude: {0}")]
    Receiver(AttitudeError),
    /// That of the tanker is missing.
    #[error("the tanker's attitude: {0}")]
    Tanker(AttitudeError),
}

/// Returns `receiver_from_tanker` at a stamp, both with x forward, y left, z up.
///
/// The local axes cancel: `receiver_from_local · local_from_tanker`. They have to be the same for both, so two headings
/// have to refer to the same north.
///
/// # Inputs
/// * `receiver`, `tanker`: attitudes against one set of local axes, each of a body with x forward, y right, z down.
///
/// # Errors
/// [`RelativeAttitudeError`]: one of the two has no attitude near the stamp.
pub fn receiver_from_tanker(
    receiver: &AttitudeHistory,
    tanker: &AttitudeHistory,
    stamp_ns: i64,
) -> Result<Rotation3<f64>, RelativeAttitudeError> {
    let receiver = receiver
        .at(stamp_ns)
        .map_err(RelativeAttitudeError::Receiver)?;
    let tanker = tanker.at(stamp_ns).map_err(RelativeAttitudeError::Tanker)?;
    let frd_from_frd: UnitQuaternion<f64> =
        receiver.local_from_body.inverse() * tanker.local_from_body;
    let flu_from_frd = frd_from_flu().inverse();
    Ok(flu_from_frd * frd_from_frd.to_rotation_matrix() * frd_from_flu())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::AttitudeSample;
    use nalgebra::Vector3;

    const MS: i64 = 1_000_000;
    /// rad, of a few products near one.
    const ROUNDING: f64 = 1e-12;

    /// Heading clockwise from north, climb and right bank as a pilot reads them, deg: `NED_from_FRD`.
    fn flying(heading_deg: f64, climb_deg: f64, bank_deg: f64) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = [bank_deg, climb_deg, heading_deg].map(f64::to_radians);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    fn history(
        stamps_ms: &[i64],
        attitude: impl Fn(i64) -> UnitQuaternion<f64>,
    ) -> AttitudeHistory {
        let mut history = AttitudeHistory::new(0.2);
        for stamp in stamps_ms {
            history.push(AttitudeSample {
                stamp_ns: stamp * MS,
                local_from_body: attitude(*stamp),
                rate_in_body: None,
            });
        }
        history
    }

    fn relative(receiver: UnitQuaternion<f64>, tanker: UnitQuaternion<f64>) -> Rotation3<f64> {
        let [receiver, tanker] = [receiver, tanker].map(|q| history(&[0, 20], |_| q));
        receiver_from_tanker(&receiver, &tanker, 10 * MS).expect("both are there")
    }

    #[test]
    fn aircraft_that_fly_alike_are_not_turned_to_each_other_whatever_their_heading() {
        for heading_deg in [0.0, 77.0, 200.0] {
            let both = flying(heading_deg, 3.0, -20.0);
            assert!(relative(both, both).angle() < 1e-7);
        }
    }

    #[test]
    fn turns_have_the_signs_of_the_nominal_attitude() {
        // Of a tanker's nose and right wing tip, in the receiver's axes: x forward, y left, z up.
        let (nose, right_wing) = (Vector3::x(), -Vector3::y());
        let receiver = flying(90.0, 0.0, 0.0);
        let right_of_it = relative(receiver, flying(100.0, 0.0, 0.0)) * nose;
        assert!(
            right_of_it.y < -0.1,
            "a heading further clockwise is to the right"
        );
        let climbing = relative(receiver, flying(90.0, 10.0, 0.0)) * nose;
        assert!(climbing.z > 0.1, "a tanker that climbs points up");
        let banked = relative(receiver, flying(90.0, 0.0, 10.0)) * right_wing;
        assert!(banked.z < -0.1, "a right bank lowers the right wing");
        // The nominal attitude's angles: right side low, nose low, nose left.
        let found = relative(flying(40.0, 0.0, 0.0), flying(30.0, -2.0, 5.0));
        let (roll, pitch, yaw) = found.euler_angles();
        let angles = [roll, pitch, yaw].map(f64::to_degrees);
        for (found, expected) in angles.into_iter().zip([5.0, 2.0, 10.0]) {
            assert!((found - expected).abs() < 1e-9, "{angles:?}");
        }
    }

    #[test]
    fn a_banked_receiver_sees_a_level_tanker_banked_the_other_way() {
        let (roll, pitch, yaw) =
            relative(flying(10.0, 0.0, 30.0), flying(10.0, 0.0, 0.0)).euler_angles();
        assert!((roll.to_degrees() + 30.0).abs() < 1e-9);
        assert!(pitch.abs() < ROUNDING && yaw.abs() < ROUNDING);
    }

    #[test]
    fn each_is_interpolated_to_the_stamp_from_samples_at_its_own_times() {
        let heading = |rate_dps: f64| {
            move |stamp_ms: i64| flying(rate_dps * stamp_ms as f64 * 1e-3, 0.0, 0.0)
        };
        let receiver = history(&[0, 20, 40, 60], heading(10.0));
        let tanker = history(&[-70, 30, 130], heading(-20.0));
        let found = receiver_from_tanker(&receiver, &tanker, 47 * MS).expect("both are there");
        let (_, _, yaw) = found.euler_angles();
        // Clockwise headings are negative yaws: −20°/s − 10°/s for 47 ms, turned about.
        assert!((yaw.to_degrees() - 30.0 * 0.047).abs() < 1e-9);
    }

    #[test]
    fn which_of_the_two_is_missing_is_told() {
        let (there, gone) = (
            history(&[0, 20], |_| flying(0.0, 0.0, 0.0)),
            history(&[], |_| UnitQuaternion::identity()),
        );
        let found = receiver_from_tanker(&gone, &there, 10 * MS);
        assert!(matches!(found, Err(RelativeAttitudeError::Receiver(_))));
        let found = receiver_from_tanker(&there, &gone, 10 * MS);
        assert!(matches!(found, Err(RelativeAttitudeError::Tanker(_))));
        let stale = receiver_from_tanker(
            &history(&[230, 250], |_| flying(0.0, 0.0, 0.0)),
            &there,
            240 * MS,
        );
        assert_eq!(
            stale.expect_err("the tanker's is old").to_string(),
            "the tanker's attitude: its newest sample is 0.220 s older than the image, allowed is 0.2 s"
        );
    }
}
