//! A tanker that stands off its nominal attitude for long: no manoeuvre, but a wrong mount or a wrong nominal attitude.

use std::fmt;
use std::time::{Duration, Instant};

use nalgebra::UnitQuaternion;

use crate::refuelling::ExpectedAttitude;

/// How long poses must be off in all, without a clearly good one in between.
const LASTING: Duration = Duration::from_secs(3);
/// How many of them at least, and of good ones for the end.
const MANY: u32 = 10;
/// Of the limit: below it a pose is clearly good. A brief excursion past the limit and back changes nothing.
const CLEARLY_GOOD: f64 = 0.5;
/// How long all poses must be clearly good before a fault ends without a change of parameters.
const GOOD_AGAIN: Duration = Duration::from_secs(10);
/// s; over this time poses are averaged: one far away may be off by many degrees, and so may its neighbour by others.
const SMOOTHED_S: f64 = 1.0;

/// How a tanker stands off its nominal attitude, and the limit, deg.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unexpected {
    /// Smoothed angle to the nominal attitude; below the limit if the fault lasts on.
    pub off_deg: f64,
    /// The largest to expect.
    pub limit_deg: f64,
}

impl fmt::Display for Unexpected {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { off_deg, limit_deg } = self;
        if off_deg > limit_deg {
            write!(
                f,
                "the tanker stands {off_deg:.1}° off its nominal attitude, expected are {limit_deg}° at most"
            )
        } else {
            write!(
                f,
                "the tanker stood more than {limit_deg}° off its nominal attitude for a while, and although it is {off_deg:.1}° \
                 off now, {}",
                not_over(*limit_deg)
            )
        }
    }
}

/// Returns what it would take for a fault to end by itself.
fn not_over(limit_deg: f64) -> String {
    format!(
        "it has not been within {}° for {} s yet",
        CLEARLY_GOOD * limit_deg,
        GOOD_AGAIN.as_secs()
    )
}

/// Compares poses with the nominal attitude.
#[derive(Debug)]
pub struct Attitude {
    expected: ExpectedAttitude,
    /// Turn from the nominal attitude, and when it was updated.
    smoothed: Option<(UnitQuaternion<f64>, Instant)>,
    off: Off,
    good: Option<Good>,
    /// The largest turn since the fault began, while it lasts.
    fault: Option<UnitQuaternion<f64>>,
}

/// Poses beyond the limit since the last one that was clearly good.
#[derive(Debug, Default)]
struct Off {
    lasted: Duration,
    poses: u32,
}

/// Clearly good poses in a row.
#[derive(Debug)]
struct Good {
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
            off: Off {
                lasted: Duration::ZERO,
                poses: 0,
            },
            good: None,
            fault: None,
        }
    }

    /// Takes what is expected from now on; restarts if that differs. Returns whether it does.
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
        let mut passed = Duration::ZERO;
        let smoothed = match self.smoothed {
            Some((before, then)) if now.saturating_duration_since(then) < LASTING => {
                passed = now.saturating_duration_since(then);
                let share = 1.0 - (-passed.as_secs_f64() / SMOOTHED_S).exp();
                let step = (before.inverse() * turn).scaled_axis();
                before * UnitQuaternion::from_scaled_axis(step * share)
            }
            // Nothing, or stale.
            _ => {
                self.off = Off::default();
                self.good = None;
                turn
            }
        };
        self.smoothed = Some((smoothed, now));
        let (off_deg, limit_deg) = (deg(&smoothed), self.expected.limit_deg);
        if off_deg > limit_deg {
            self.on_off(smoothed, passed);
        } else if off_deg < CLEARLY_GOOD * limit_deg {
            self.on_good(now);
        } else {
            self.good = None;
        }
    }

    fn on_off(&mut self, turn: UnitQuaternion<f64>, passed: Duration) {
        self.good = None;
        self.off.lasted += passed;
        self.off.poses = self.off.poses.saturating_add(1);
        let is_larger = |largest: &UnitQuaternion<f64>| deg(&turn) > deg(largest);
        let begins = self.off.poses >= MANY && self.off.lasted >= LASTING;
        if self.fault.as_ref().map_or(begins, is_larger) {
            self.fault = Some(turn);
        }
    }

    fn on_good(&mut self, now: Instant) {
        self.off = Off::default();
        let good = self.good.get_or_insert(Good {
            since: now,
            poses: 0,
        });
        good.poses = good.poses.saturating_add(1);
        if good.poses >= MANY && now.saturating_duration_since(good.since) >= GOOD_AGAIN {
            self.fault = None;
        }
    }

    /// Returns how the tanker is off, if it is, or was for long and is not clearly good yet: what is published of the
    /// receptacle is then most likely wrong.
    #[must_use]
    pub fn unexpected(&self) -> Option<Unexpected> {
        let (turn, _) = self.smoothed?;
        let (off_deg, limit_deg) = (deg(&turn), self.expected.limit_deg);
        (self.fault.is_some() || off_deg > limit_deg).then_some(Unexpected { off_deg, limit_deg })
    }

    /// Returns what is wrong and why, while it lasts.
    #[must_use]
    pub fn in_words(&self) -> Option<String> {
        let largest = self.fault?;
        let (turn, _) = self.smoothed?;
        let (off_deg, limit_deg) = (deg(&turn), self.expected.limit_deg);
        Some(if off_deg > limit_deg {
            self.expected.in_words("stands", &turn)
        } else {
            format!(
                "{}; {off_deg:.1}° off now, and {}",
                self.expected.in_words("stood up to", &largest),
                not_over(limit_deg)
            )
        })
    }
}

fn deg(turn: &UnitQuaternion<f64>) -> f64 {
    turn.angle().to_degrees()
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
    fn fault_stays_without_poses_and_ends_after_ten_seconds_of_clearly_good_ones() {
        let mount = pitched(14.0);
        let mut attitude = Attitude::new(expected(mount));
        let off = seen(mount, turned(Vector3::z(), 20.0));
        let now = pass(&mut attitude, Instant::now(), 40, |_| off);
        assert!(attitude.in_words().is_some());
        let good = seen(mount, UnitQuaternion::identity());
        let now = pass(&mut attitude, now + 100 * LASTING, 95, |_| good);
        assert!(attitude.in_words().is_some() && attitude.unexpected().is_some());
        pass(&mut attitude, now, 10, |_| good);
        assert_eq!((attitude.unexpected(), attitude.in_words()), (None, None));
    }

    /// Mount 18° off; the tanker nods ±5° about that with this period, in frames.
    fn nodding(period: u32) -> impl FnMut(u32) -> UnitQuaternion<f64> {
        move |frame| {
            let phase = std::f64::consts::TAU * f64::from(frame % period) / f64::from(period);
            seen(pitched(0.0), turned(Vector3::y(), 18.0 + 5.0 * phase.sin()))
        }
    }

    #[test]
    fn tanker_that_nods_does_not_mend_a_wrong_mount() {
        for period in [60, 200, 600] {
            let mut attitude = Attitude::new(expected(pitched(0.0)));
            let now = pass(&mut attitude, Instant::now(), 300, nodding(period));
            assert!(attitude.in_words().is_some(), "{period}");
            // Five minutes, frame by frame.
            let mut nod = nodding(period);
            let (mut below, mut words) = (0, String::new());
            for frame in 0..6000 {
                attitude.take(&nod(frame), now + frame * FRAME);
                let held = attitude.unexpected().expect("held back all the time");
                if held.off_deg < held.limit_deg {
                    below += 1;
                    words = attitude.in_words().expect("a fault all the time");
                }
            }
            assert!(below > 500 || period == 60, "{period}: {below}");
            if below > 0 {
                assert!(words.contains("the tanker stood up to 2"), "{words}");
                assert!(
                    words.ends_with("° off now, and it has not been within 7.5° for 10 s yet"),
                    "{words}"
                );
            }
            assert!(attitude.expect(&expected(pitched(18.0))));
            assert_eq!(attitude.unexpected(), None);
        }
    }
}
