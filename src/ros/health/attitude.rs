//! A tanker that stands off its nominal attitude for long: no manoeuvre, but a wrong mount or a wrong nominal attitude.

use std::time::{Duration, Instant};

use nalgebra::UnitQuaternion;

use crate::refuelling::ExpectedAttitude;

/// How long all poses must be off, or not be off again.
const LASTING: Duration = Duration::from_secs(3);
/// How many of them at least.
const MANY: u32 = 10;
/// s; over this time poses are averaged: one far away may be off by many degrees, and so may its neighbour by others.
const SMOOTHED_S: f64 = 1.0;

/// How a tanker stands off its nominal attitude, and the limit, deg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexpected {
    /// Smoothed angle to the nominal attitude.
    pub off_deg: f64,
    /// The largest to expect.
    pub limit_deg: f64,
}

/// Compares poses with the nominal attitude.
#[derive(Debug)]
pub struct Attitude {
    expected: ExpectedAttitude,
    /// Turn from the nominal attitude, and when it was updated.
    smoothed: Option<(UnitQuaternion<f64>, Instant)>,
    run: Option<Run>,
    lasts: bool,
}

/// Poses in a row that all are off, or all are not.
#[derive(Debug)]
struct Run {
    is_off: bool,
    since: Instant,
    poses: u32,
}

impl Attitude {
    /// Returns a judge that has seen no pose.
    #[must_use]
    pub const fn new(expected: ExpectedAttitude) -> Self {
        Self {
            expected,
            smoothed: None,
            run: None,
            lasts: false,
        }
    }

    /// Takes what is expected from now on; begins anew if that differs. Returns whether it does.
    pub fn expect(&mut self, expected: &ExpectedAttitude) -> bool {
        let differs = self.expected != *expected;
        if differs {
            *self = Self::new(*expected);
        }
        differs
    }

    /// Forgets all poses: another camera looks elsewhere.
    pub fn begin_anew(&mut self) {
        *self = Self::new(self.expected);
    }

    /// Takes the attitude of a trusted pose.
    pub fn take(&mut self, camera_from_tanker: &UnitQuaternion<f64>, now: Instant) {
        let turn = self.expected.deviation(camera_from_tanker);
        let smoothed = match self.smoothed {
            Some((before, then)) if now.saturating_duration_since(then) < LASTING => {
                let passed_s = now.saturating_duration_since(then).as_secs_f64();
                let share = 1.0 - (-passed_s / SMOOTHED_S).exp();
                let step = (before.inverse() * turn).scaled_axis();
                before * UnitQuaternion::from_scaled_axis(step * share)
            }
            // Nothing, or too long ago to say anything about now.
            _ => {
                self.run = None;
                turn
            }
        };
        self.smoothed = Some((smoothed, now));
        let is_off = self.is_off();
        let run = match &mut self.run {
            Some(run) if run.is_off == is_off => run,
            run => run.insert(Run {
                is_off,
                since: now,
                poses: 0,
            }),
        };
        run.poses = run.poses.saturating_add(1);
        if run.poses >= MANY && now.saturating_duration_since(run.since) >= LASTING {
            self.lasts = is_off;
        }
    }

    /// Returns how the tanker is off, if it is, or was for long and not yet for long is no more: what is told of the
    /// receptacle is then most likely wrong.
    #[must_use]
    pub fn unexpected(&self) -> Option<Unexpected> {
        let (turn, _) = self.smoothed?;
        (self.lasts || self.is_off()).then(|| Unexpected {
            off_deg: turn.angle().to_degrees(),
            limit_deg: self.expected.limit_deg,
        })
    }

    /// Returns what is wrong and why, while it lasts.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        let (turn, _) = self.smoothed.filter(|_| self.lasts)?;
        Some(self.expected.in_words(&turn))
    }

    fn is_off(&self) -> bool {
        self.smoothed
            .is_some_and(|(turn, _)| turn.angle().to_degrees() > self.expected.limit_deg)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::refuelling::Angles;
    use nalgebra::Vector3;

    const FRAME: Duration = Duration::from_millis(50);

    fn pitched(pitch_deg: f64) -> Angles {
        Angles {
            pitch_deg,
            ..Angles::default()
        }
    }

    fn expected(mount: Angles) -> ExpectedAttitude {
        ExpectedAttitude {
            mount,
            nominal: Angles::default(),
            limit_deg: 15.0,
        }
    }

    /// What a camera with this mount sees of a tanker turned like this.
    fn seen(mount: Angles, tanker: UnitQuaternion<f64>) -> UnitQuaternion<f64> {
        let receiver_from_camera = expected(mount).receiver_from_camera();
        UnitQuaternion::from_rotation_matrix(&receiver_from_camera).inverse() * tanker
    }

    fn turned(axis: Vector3<f64>, deg: f64) -> UnitQuaternion<f64> {
        UnitQuaternion::from_scaled_axis(axis * deg.to_radians())
    }

    /// Takes poses for some tenths of a second; returns the time after them.
    fn pass(
        attitude: &mut Attitude,
        start: Instant,
        tenths: u32,
        mut pose: impl FnMut(u32) -> UnitQuaternion<f64>,
    ) -> Instant {
        let frames = 2 * tenths;
        for frame in 0..frames {
            attitude.take(&pose(frame), start + frame * FRAME);
        }
        start + frames * FRAME
    }

    #[test]
    fn wrong_sign_of_the_mount_holds_at_once_is_said_after_three_seconds_and_ends_when_it_is_mended()
     {
        let truth = pitched(14.0);
        let mut attitude = Attitude::new(expected(pitched(-14.0)));
        let level = seen(truth, UnitQuaternion::identity());
        let start = Instant::now();
        let now = pass(&mut attitude, start, 29, |_| level);
        let held = attitude.unexpected().expect("held from the first on");
        assert!((held.off_deg - 28.0).abs() < 1e-6);
        assert_eq!(attitude.in_words(), None);
        let now = pass(&mut attitude, now, 2, |_| level);
        let words = attitude.in_words().expect("3 s");
        assert!(
            words.contains("camera_mount_pitch_deg: 14 instead of -14"),
            "{words}"
        );

        assert!(!attitude.expect(&expected(pitched(-14.0))));
        assert!(attitude.in_words().is_some());
        assert!(attitude.expect(&expected(truth)));
        pass(&mut attitude, now, 1, |_| level);
        assert_eq!((attitude.unexpected(), attitude.in_words()), (None, None));
    }

    #[test]
    fn manoeuvre_that_passes_and_noise_about_a_good_attitude_are_no_fault() {
        let mount = pitched(14.0);
        let mut attitude = Attitude::new(expected(mount));
        let now = pass(&mut attitude, Instant::now(), 25, |_| {
            seen(mount, turned(Vector3::x(), 25.0))
        });
        assert!(attitude.unexpected().is_some() && attitude.in_words().is_none());
        let now = pass(&mut attitude, now, 20, |_| {
            seen(mount, UnitQuaternion::identity())
        });
        assert_eq!(attitude.unexpected(), None);
        // Far away: 20° to either side, frame by frame.
        pass(&mut attitude, now, 200, |frame| {
            let deg = if frame % 2 == 0 { 20.0 } else { -20.0 };
            seen(mount, turned(Vector3::y(), deg))
        });
        assert_eq!((attitude.unexpected(), attitude.in_words()), (None, None));
    }

    #[test]
    fn camera_upside_down_is_noticed_though_its_turn_has_two_axes() {
        let mount = Angles {
            roll_deg: 180.0,
            ..Angles::default()
        };
        let mut attitude = Attitude::new(expected(Angles::default()));
        // A little more and a little less than half a turn: its axis changes sides.
        pass(&mut attitude, Instant::now(), 40, |frame| {
            let deg = if frame % 2 == 0 { 0.5 } else { -0.5 };
            seen(mount, turned(Vector3::x(), deg))
        });
        let words = attitude.in_words().expect("4 s");
        assert!(words.contains("instead of 0"), "{words}");
    }

    #[test]
    fn fault_stays_without_poses_and_ends_after_three_seconds_of_good_ones() {
        let mount = pitched(14.0);
        let mut attitude = Attitude::new(expected(mount));
        let off = seen(mount, turned(Vector3::z(), 20.0));
        let now = pass(&mut attitude, Instant::now(), 40, |_| off);
        assert!(attitude.in_words().is_some());
        let good = seen(mount, UnitQuaternion::identity());
        let now = pass(&mut attitude, now + 100 * LASTING, 25, |_| good);
        assert!(attitude.in_words().is_some() && attitude.unexpected().is_some());
        pass(&mut attitude, now, 10, |_| good);
        assert_eq!((attitude.unexpected(), attitude.in_words()), (None, None));
    }
}
