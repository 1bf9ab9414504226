//! Whether an attitude can be that of an aircraft in refuelling: it flies the right way up.
//!
//! The axes of an attitude are nowhere in its message. An attitude to other axes is a rotation like any other, so it would
//! turn whatever is rotated by it. What tells it apart is gravity: neither receiver nor tanker flies on its back.

use nalgebra::{UnitQuaternion, Vector3};

/// deg; of the body's down axis from down. No aircraft reaches it in refuelling. Axes that are x forward, y left, z up on
/// one side of the rotation only turn a level flight by 180°, so up to a tilt of 90° they are told apart.
const LARGEST_TILT_DEG: f64 = 90.0;
/// m/s²; half of what holds an aircraft up.
const HALF_G_MPS2: f64 = 4.9;

/// Why an attitude is not that of an aircraft that flies the right way up.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum UprightError {
    /// It would fly on its back.
    #[error("it is tilted by {tilt_deg:.0}° from level, allowed is {limit_deg}°")]
    Tilted {
        /// deg.
        tilt_deg: f64,
        /// deg.
        limit_deg: f64,
    },
    /// Its accelerometer says that up is where the attitude has down.
    #[error(
        "by it the accelerometer measures {down_mps2:.1} m/s² downwards, where an aircraft is held up by 9.8"
    )]
    PushedDown {
        /// m/s².
        down_mps2: f64,
    },
}

/// Returns nothing for an attitude of an aircraft that flies the right way up.
///
/// # Inputs
/// * `ned_from_frd`: the attitude.
/// * `force_in_frd`: what an accelerometer measures (at rest 9.8 m/s² upwards), if it was measured.
///
/// # Errors
/// [`UprightError`]. Axes that are wrong on both sides of the rotation leave a level flight level, so without an
/// accelerometer they are not noticed here.
pub fn check_upright(
    ned_from_frd: &UnitQuaternion<f64>,
    force_in_frd: Option<&Vector3<f64>>,
) -> Result<(), UprightError> {
    let tilt_deg = (ned_from_frd * Vector3::z())
        .z
        .clamp(-1.0, 1.0)
        .acos()
        .to_degrees();
    if tilt_deg > LARGEST_TILT_DEG {
        let limit_deg = LARGEST_TILT_DEG;
        return Err(UprightError::Tilted {
            tilt_deg,
            limit_deg,
        });
    }
    let down_mps2 = force_in_frd.map_or(0.0, |force| (ned_from_frd * force).z);
    if down_mps2 > HALF_G_MPS2 {
        return Err(UprightError::PushedDown { down_mps2 });
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::frames::{frd_from_flu, ned_from_enu};

    /// Heading, climb and right bank, deg.
    fn flying(heading_deg: f64, climb_deg: f64, bank_deg: f64) -> UnitQuaternion<f64> {
        let [roll, pitch, yaw] = [bank_deg, climb_deg, heading_deg].map(f64::to_radians);
        UnitQuaternion::from_euler_angles(roll, pitch, yaw)
    }

    /// All attitudes of refuelling, and steeper ones.
    fn attitudes() -> impl Iterator<Item = UnitQuaternion<f64>> {
        let of = |heading: u16| {
            [-25.0, 0.0, 4.0, 25.0].into_iter().flat_map(move |climb| {
                [-60.0, -9.0, 0.0, 60.0]
                    .into_iter()
                    .map(move |bank| flying(f64::from(heading), climb, bank))
            })
        };
        (0..360).step_by(15).flat_map(of)
    }

    fn axes(rotation: nalgebra::Rotation3<f64>) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&rotation)
    }

    #[test]
    fn flight_in_any_heading_climb_and_bank_is_upright() {
        for attitude in attitudes() {
            let in_ned = Vector3::new(0.0, 0.0, -9.8);
            let force = attitude.inverse() * in_ned;
            assert_eq!(check_upright(&attitude, Some(&force)), Ok(()));
            assert_eq!(check_upright(&attitude, None), Ok(()));
        }
    }

    #[test]
    fn other_axes_on_one_side_are_noticed_in_every_attitude() {
        for attitude in attitudes() {
            for wrong in [
                axes(ned_from_enu()) * attitude,
                attitude * axes(frd_from_flu()),
            ] {
                assert!(
                    matches!(check_upright(&wrong, None), Err(UprightError::Tilted { tilt_deg, .. }) if tilt_deg > 100.0),
                    "{attitude}"
                );
            }
        }
    }

    #[test]
    fn other_axes_on_both_sides_are_noticed_by_the_accelerometer_only() {
        for attitude in attitudes() {
            let force = frd_from_flu() * (attitude.inverse() * Vector3::new(0.0, 0.0, -9.8));
            let wrong = axes(ned_from_enu()) * attitude * axes(frd_from_flu());
            assert_eq!(check_upright(&wrong, None), Ok(()));
            assert!(
                matches!(check_upright(&wrong, Some(&force)), Err(UprightError::PushedDown { down_mps2 }) if (down_mps2 - 9.8).abs() < 1e-9),
                "{attitude}"
            );
        }
    }

    #[test]
    fn a_push_over_and_an_accelerometer_without_gravity_are_no_fault() {
        let level = flying(70.0, 0.0, 0.0);
        for down_mps2 in [-25.0, 0.0, 3.0] {
            let force = Vector3::new(1.0, -0.5, down_mps2);
            assert_eq!(check_upright(&level, Some(&force)), Ok(()));
        }
    }
}
