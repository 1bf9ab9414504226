//! The expected attitude of the tanker in the camera, the deviation of an observed one, and which wrong angle would
//! explain it.
//!
//! With one camera, a wrong mount and a tanker that is not aligned look the same. The distinction: a tanker is nearly
//! aligned with the receiver for as long as the receiver follows it.

use nalgebra::{Rotation3, UnitQuaternion};

use crate::geometry::{optical_from_body, rotation_from_roll_pitch_yaw};

/// A cause explains a deviation if the remaining deviation is at most this share of it.
const EXPLAINED: f64 = 1.0 / 3.0;
/// deg; causes whose remaining deviations differ by less cannot be distinguished.
const AS_GOOD_DEG: f64 = 2.0;
/// Largest number of causes in the message.
const MOST_CAUSES: usize = 3;
/// deg; the sign of a smaller angle does not matter.
const NO_ANGLE_DEG: f64 = 0.5;

/// An attitude as given by parameters: Rz(yaw) Ry(pitch) Rx(roll) about x forward, y left, z up, deg.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Angles {
    /// Positive: the right side is low.
    pub roll_deg: f64,
    /// Positive: the nose is low.
    pub pitch_deg: f64,
    /// Positive: the nose is to the left.
    pub yaw_deg: f64,
}

impl Angles {
    const NAMES: [&'static str; 3] = ["roll", "pitch", "yaw"];

    /// Returns the rotation from the rotated body's coordinates to those of the reference.
    #[must_use]
    pub fn rotation(&self) -> Rotation3<f64> {
        let [roll, pitch, yaw] = self.all().map(f64::to_radians);
        rotation_from_roll_pitch_yaw(roll, pitch, yaw)
    }

    /// Returns the angles of a rotation.
    #[must_use]
    pub fn of(rotation: &Rotation3<f64>) -> Self {
        let (roll, pitch, yaw) = rotation.euler_angles();
        Self::from_all([roll, pitch, yaw].map(f64::to_degrees))
    }

    const fn all(&self) -> [f64; 3] {
        [self.roll_deg, self.pitch_deg, self.yaw_deg]
    }

    const fn from_all([roll_deg, pitch_deg, yaw_deg]: [f64; 3]) -> Self {
        Self {
            roll_deg,
            pitch_deg,
            yaw_deg,
        }
    }

    fn with(&self, axis: usize, angle_deg: f64) -> Self {
        let mut all = self.all();
        all[axis] = angle_deg;
        Self::from_all(all)
    }

    fn with_exchanged(&self, first: usize, second: usize) -> Self {
        let mut all = self.all();
        all.swap(first, second);
        Self::from_all(all)
    }
}

impl std::fmt::Display for Angles {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [roll, pitch, yaw] = self.all().map(shown);
        write!(f, "roll {roll}°, pitch {pitch}°, yaw {yaw}°")
    }
}

/// The mount of the camera and the expected attitude of the tanker.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ExpectedAttitude {
    /// Attitude of the camera's body axes in the receiver; all zero: it looks ahead, upright.
    pub mount: Angles,
    /// Attitude of the tanker relative to the receiver.
    pub nominal: Angles,
    /// Largest accepted deviation from it, deg.
    pub limit_deg: f64,
}

/// A change that would make the observed attitude the nominal one.
#[derive(Debug, Clone, PartialEq)]
struct Cause {
    words: String,
    mount: Angles,
    nominal: Angles,
}

impl ExpectedAttitude {
    /// Returns the camera's attitude in the receiver: optical axes to x forward, y left, z up.
    #[must_use]
    pub fn receiver_from_camera(&self) -> Rotation3<f64> {
        self.mount.rotation() * optical_from_body().inverse()
    }

    /// Returns the rotation from the nominal to the observed attitude, in the receiver's axes.
    #[must_use]
    pub fn deviation(&self, camera_from_tanker: &UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        UnitQuaternion::from_rotation_matrix(&self.receiver_from_camera())
            * camera_from_tanker
            * UnitQuaternion::from_rotation_matrix(&self.nominal.rotation()).inverse()
    }

    /// Returns the message about a lasting deviation: its size, the observed attitude, and what would explain it.
    ///
    /// The verb distinguishes a present deviation ("stands") from the largest of a time ("stood up to").
    #[must_use]
    pub fn in_words(&self, verb: &str, deviation: &UnitQuaternion<f64>) -> String {
        let off_deg = deviation.angle().to_degrees();
        let found = deviation.to_rotation_matrix() * self.nominal.rotation();
        format!(
            "the tanker {verb} {off_deg:.1}° off its nominal attitude (found {}; nominal {}; limit {}°): {}",
            Angles::of(&found),
            self.nominal,
            shown(self.limit_deg),
            self.explanation(deviation)
        )
    }

    /// Returns the causes that explain a deviation, or the mount that would.
    fn explanation(&self, deviation: &UnitQuaternion<f64>) -> String {
        let turn = deviation.to_rotation_matrix();
        // The observation, independent of the assumed mount.
        let camera_body_from_tanker =
            self.mount.rotation().inverse() * turn * self.nominal.rotation();
        let left_deg = |cause: &Cause| {
            let found = cause.mount.rotation() * camera_body_from_tanker;
            angle_deg(&(cause.nominal.rotation().inverse() * found))
        };
        let mut causes: Vec<(f64, Cause)> = self
            .causes()
            .into_iter()
            .map(|cause| (left_deg(&cause), cause))
            .filter(|(left, _)| *left < EXPLAINED * deviation.angle().to_degrees())
            .collect();
        causes.sort_by(|(a, _), (b, _)| a.total_cmp(b));
        let best = causes.first().map_or(0.0, |(left, _)| *left);
        let named: Vec<String> = causes
            .iter()
            .take_while(|(left, _)| *left <= best + AS_GOOD_DEG)
            .take(MOST_CAUSES)
            .map(|(left, cause)| format!("{} (then {left:.1}° off)", cause.words))
            .collect();
        if named.is_empty() {
            let mount = Angles::of(&(turn.inverse() * self.mount.rotation()));
            return format!(
                "no single sign or axis explains it; if the tanker flies at its nominal attitude, camera_mount is \
                 {mount} rather than {}",
                self.mount
            );
        }
        format!("likely {}", named.join(", or "))
    }

    fn causes(&self) -> Vec<Cause> {
        let mut causes = Vec::new();
        let of_mount = |words: String, mount: Angles| Cause {
            words,
            mount,
            nominal: self.nominal,
        };
        for (axis, angle) in self.mount.all().into_iter().enumerate() {
            if has_sign(angle) {
                let words = sign("camera_mount", axis, angle);
                causes.push(of_mount(words, self.mount.with(axis, -angle)));
            }
        }
        for (axis, angle) in self.nominal.all().into_iter().enumerate() {
            if has_sign(angle) {
                causes.push(Cause {
                    words: sign("nominal", axis, angle),
                    mount: self.mount,
                    nominal: self.nominal.with(axis, -angle),
                });
            }
        }
        for (first, second) in [(0, 1), (0, 2), (1, 2)] {
            let (one, other) = (Angles::NAMES[first], Angles::NAMES[second]);
            let exchanged = |angles: &Angles| {
                let all = angles.all();
                let differ = (all[first] - all[second]).abs() > NO_ANGLE_DEG;
                differ.then(|| angles.with_exchanged(first, second))
            };
            if let Some(mount) = exchanged(&self.mount) {
                let words = format!("{one} and {other} of camera_mount exchanged");
                causes.push(of_mount(words, mount));
            }
            if let Some(nominal) = exchanged(&self.nominal) {
                causes.push(Cause {
                    words: format!("{one} and {other} of the nominal attitude exchanged"),
                    mount: self.mount,
                    nominal,
                });
            }
        }
        if self
            .mount
            .all()
            .into_iter()
            .filter(|a| has_sign(*a))
            .count()
            > 1
        {
            let inverse = Angles::of(&self.mount.rotation().inverse());
            let words = "camera_mount given as the inverse (the receiver in the camera)";
            causes.push(of_mount(words.to_owned(), inverse));
        }
        for turn_deg in [180.0, 90.0, -90.0] {
            let roll_deg = wrapped(self.mount.roll_deg + turn_deg);
            let words = format!(
                "the camera or its image rolled by {}°: camera_mount_roll_deg {} instead of {}",
                shown(turn_deg),
                shown(roll_deg),
                shown(self.mount.roll_deg)
            );
            causes.push(of_mount(words, self.mount.with(0, roll_deg)));
        }
        causes
    }
}

/// Returns the angle of a rotation. Computed from the quaternion, because the trace of a matrix may give NaN near the
/// identity.
pub(super) fn angle_deg(rotation: &Rotation3<f64>) -> f64 {
    UnitQuaternion::from_rotation_matrix(rotation)
        .angle()
        .to_degrees()
}

fn has_sign(angle_deg: f64) -> bool {
    angle_deg.abs() > NO_ANGLE_DEG && angle_deg.abs() < 180.0 - NO_ANGLE_DEG
}

fn sign(prefix: &str, axis: usize, angle_deg: f64) -> String {
    let name = Angles::NAMES[axis];
    format!(
        "the sign of {prefix}_{name}_deg: {} instead of {}",
        shown(-angle_deg),
        shown(angle_deg)
    )
}

/// Returns the same angle between −180° and 180°.
fn wrapped(angle_deg: f64) -> f64 {
    let turns = ((angle_deg + 180.0) / 360.0).floor();
    angle_deg - 360.0 * turns
}

/// Returns an angle with one decimal, or without if that is zero.
fn shown(angle_deg: f64) -> String {
    let rounded = (angle_deg * 10.0).round() / 10.0;
    // Adding zero removes the sign of a negative zero.
    format!("{}", rounded + 0.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn angles(roll_deg: f64, pitch_deg: f64, yaw_deg: f64) -> Angles {
        Angles {
            roll_deg,
            pitch_deg,
            yaw_deg,
        }
    }

    fn expected(mount: Angles, nominal: Angles) -> ExpectedAttitude {
        ExpectedAttitude {
            mount,
            nominal,
            limit_deg: 15.0,
        }
    }

    /// What is found by parameters when this is true, and the words for it.
    fn found(told: &ExpectedAttitude, truth: &ExpectedAttitude, flown: Angles) -> (f64, String) {
        let camera_from_tanker = truth.receiver_from_camera().inverse() * flown.rotation();
        let deviation = told.deviation(&UnitQuaternion::from_rotation_matrix(&camera_from_tanker));
        (
            deviation.angle().to_degrees(),
            told.in_words("stands", &deviation),
        )
    }

    #[test]
    fn a_tanker_that_flies_as_expected_does_not_deviate() {
        let truth = expected(angles(10.0, 14.0, -7.0), angles(2.0, -3.0, 4.0));
        let (off_deg, _) = found(&truth, &truth, truth.nominal);
        assert!(off_deg < 1e-6, "{off_deg}");
        let (off_deg, _) = found(&truth, &truth, angles(2.0, -3.0, 9.0));
        assert!((off_deg - 5.0).abs() < 1e-6, "{off_deg}");
    }

    #[test]
    fn every_wrong_sign_of_mount_and_nominal_attitude_is_named() {
        let truth = expected(angles(9.0, 14.0, -12.0), angles(-8.0, 10.0, 11.0));
        // Not quite as expected, as tankers fly.
        let flown = angles(-7.0, 10.5, 12.0);
        for axis in 0..3 {
            let name = Angles::NAMES[axis];
            let angle = truth.mount.all()[axis];
            let told = expected(truth.mount.with(axis, -angle), truth.nominal);
            let (off_deg, words) = found(&told, &truth, flown);
            assert!((off_deg - 2.0 * angle.abs()).abs() < 3.0, "{off_deg}");
            let cause = format!(
                "the sign of camera_mount_{name}_deg: {angle} instead of {}",
                -angle
            );
            assert!(words.contains(&cause), "{words}");

            let angle = truth.nominal.all()[axis];
            let told = expected(truth.mount, truth.nominal.with(axis, -angle));
            let (_, words) = found(&told, &truth, flown);
            assert!(
                words.contains(&format!("the sign of nominal_{name}_deg")),
                "{words}"
            );
        }
    }

    #[test]
    fn exchanged_axes_an_inverse_mount_and_a_camera_upside_down_are_named() {
        let truth = expected(angles(0.0, 20.0, 0.0), Angles::default());
        let told = expected(angles(20.0, 0.0, 0.0), Angles::default());
        let (_, words) = found(&told, &truth, truth.nominal);
        assert!(
            words.contains("likely roll and pitch of camera_mount exchanged (then 0.0° off)"),
            "{words}"
        );

        let truth = expected(angles(30.0, 25.0, 40.0), Angles::default());
        let told = expected(
            Angles::of(&truth.mount.rotation().inverse()),
            Angles::default(),
        );
        let (_, words) = found(&told, &truth, truth.nominal);
        assert!(words.contains("given as the inverse"), "{words}");

        for (mount, nominal) in [
            (angles(0.0, 5.0, 0.0), Angles::default()),
            // What is left comes to nothing here, and its cosine to more than one.
            (Angles::default(), angles(-8.5, 9.5, 9.0)),
        ] {
            let truth = expected(mount.with(0, 180.0), nominal);
            let told = expected(mount, nominal);
            let (off_deg, words) = found(&told, &truth, truth.nominal);
            assert!((off_deg - 180.0).abs() < 1e-4, "{off_deg}");
            assert!(
                words.contains("camera_mount_roll_deg -180 instead of 0"),
                "{words}"
            );
        }
    }

    #[test]
    fn what_no_single_slip_explains_is_told_as_the_mount_that_would() {
        let truth = expected(angles(3.0, 33.0, -21.0), Angles::default());
        let told = expected(Angles::default(), Angles::default());
        let (_, words) = found(&told, &truth, truth.nominal);
        assert!(
            words.ends_with(
                "camera_mount is roll 3°, pitch 33°, yaw -21° rather than roll 0°, pitch 0°, yaw 0°"
            ),
            "{words}"
        );
    }
}
