//! Detections that cannot be those of the image that they are stamped with: the same pixels image after image, or several
//! images with one stamp.
//!
//! Each such frame looks right by itself. A camera or a detector that hangs repeats its last pixels while stamps go on,
//! and the pose of these is that of a tanker which has moved since.

use std::hash::{DefaultHasher, Hash, Hasher};

use crate::pipeline::{Detection, Refusal, Stamp};

/// Repetitions in a row that are no coincidence, even of a detector that reports whole pixels.
const MANY: u32 = 5;

/// The last frame, in as much as the next one is compared with it.
#[derive(Debug)]
struct Last {
    stamp_ns: i64,
    camera: u64,
    pixels: u64,
    /// Stamp of the first frame with these pixels.
    since_ns: i64,
    /// How often they were repeated with a later stamp.
    repeated: u32,
}

/// Compares each frame with the one before.
#[derive(Debug, Default)]
pub(super) struct Repetition {
    last: Option<Last>,
    max_frozen_s: f64,
}

impl Repetition {
    /// Takes for how long pixels may stay the same to the last bit, s; 0: for ever.
    pub(super) const fn allow(&mut self, max_frozen_s: f64) {
        self.max_frozen_s = max_frozen_s;
    }

    /// Forgets the last frame.
    pub(super) const fn forget(&mut self) {
        self.last = None;
    }

    /// Takes a frame; returns why its detections are not those of its stamp, if they are not.
    pub(super) fn take(
        &mut self,
        stamp: Stamp,
        frame_id: &str,
        detections: &[Detection],
    ) -> Option<Refusal> {
        if detections.is_empty() {
            // No pose follows from it, and nothing can be frozen.
            self.last = None;
            return None;
        }
        let (stamp_ns, pixels) = (stamp.nanoseconds(), fingerprint(detections));
        let camera = fingerprint_of(frame_id);
        let begin = Last {
            stamp_ns,
            camera,
            pixels,
            since_ns: stamp_ns,
            repeated: 0,
        };
        // Two cameras on one topic take turns, and each frame is judged by its frame_id already.
        let Some(last) = self.last.as_mut().filter(|last| last.camera == camera) else {
            self.last = Some(begin);
            return None;
        };
        if stamp_ns == last.stamp_ns {
            // The same message twice does no harm.
            return (pixels != last.pixels).then_some(Refusal::StampRepeated(stamp));
        }
        if pixels != last.pixels || stamp_ns < last.stamp_ns {
            self.last = Some(begin);
            return None;
        }
        last.stamp_ns = stamp_ns;
        last.repeated = last.repeated.saturating_add(1);
        let lasted_s = (i128::from(stamp_ns) - i128::from(last.since_ns)) as f64 * 1e-9;
        let is_frozen =
            self.max_frozen_s > 0.0 && last.repeated >= MANY && lasted_s > self.max_frozen_s;
        is_frozen.then_some(Refusal::Frozen {
            images: last.repeated.saturating_add(1),
            lasted_s,
        })
    }
}

/// Returns a number that differs for different text.
fn fingerprint_of(text: &str) -> u64 {
    let mut hasher = DefaultHasher::new();
    text.hash(&mut hasher);
    hasher.finish()
}

/// Returns a number that differs for different detections.
fn fingerprint(detections: &[Detection]) -> u64 {
    let mut hasher = DefaultHasher::new();
    for seen in detections {
        seen.id.hash(&mut hasher);
        for number in [seen.u_px, seen.v_px, seen.sigma_px] {
            number.to_bits().hash(&mut hasher);
        }
    }
    hasher.finish()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn stamp(ms: u32) -> Stamp {
        Stamp {
            sec: 7 + (ms / 1000).cast_signed(),
            nanosec: ms % 1000 * 1_000_000,
        }
    }

    fn seen(u_px: f64) -> [Detection; 2] {
        [1, 2].map(|id| Detection {
            id,
            u_px: u_px + f64::from(id),
            v_px: 50.0,
            sigma_px: 0.5,
        })
    }

    fn watching() -> Repetition {
        let mut repetition = Repetition::default();
        repetition.allow(0.5);
        repetition
    }

    #[test]
    fn pixels_that_stay_the_same_are_refused_after_half_a_second_until_they_change() {
        let mut repetition = watching();
        for ms in (0..=500).step_by(50) {
            assert_eq!(
                repetition.take(stamp(ms), "camera", &seen(3.0)),
                None,
                "{ms} ms"
            );
        }
        for ms in (550..2000).step_by(50) {
            let refused = repetition.take(stamp(ms), "camera", &seen(3.0));
            assert!(
                matches!(refused, Some(Refusal::Frozen { lasted_s, .. }) if (lasted_s - f64::from(ms) * 1e-3).abs() < 1e-9),
                "{ms} ms: {refused:?}"
            );
        }
        assert_eq!(
            repetition.take(stamp(2000), "camera", &seen(3.000_001)),
            None
        );
    }

    #[test]
    fn few_repetitions_of_a_slow_detector_and_any_with_the_limit_off_pass() {
        let mut repetition = watching();
        for second in 0..MANY {
            assert_eq!(
                repetition.take(stamp(1000 * second), "camera", &seen(3.0)),
                None
            );
        }
        assert!(
            repetition
                .take(stamp(1000 * MANY), "camera", &seen(3.0))
                .is_some()
        );
        repetition.allow(0.0);
        assert_eq!(repetition.take(stamp(60_000), "camera", &seen(3.0)), None);
    }

    #[test]
    fn other_pixels_with_the_stamp_of_the_last_frame_are_refused_and_the_same_message_is_not() {
        let mut repetition = watching();
        assert_eq!(repetition.take(stamp(10), "camera", &seen(3.0)), None);
        assert_eq!(repetition.take(stamp(10), "camera", &seen(3.0)), None);
        for u_px in [4.0, 5.0] {
            let refused = repetition.take(stamp(10), "camera", &seen(u_px));
            assert_eq!(refused, Some(Refusal::StampRepeated(stamp(10))));
        }
        assert_eq!(repetition.take(stamp(20), "camera", &seen(5.0)), None);
    }

    #[test]
    fn a_recording_that_restarts_and_a_reset_begin_anew() {
        let mut repetition = watching();
        for _ in 0..5 {
            for ms in (0..=500).step_by(100) {
                assert_eq!(repetition.take(stamp(ms), "camera", &seen(3.0)), None);
            }
        }
        repetition.forget();
        assert_eq!(repetition.take(stamp(5000), "camera", &seen(3.0)), None);
        assert_eq!(repetition.take(stamp(5000), "camera", &[]), None);
    }

    #[test]
    fn two_cameras_that_see_at_the_same_time_are_not_one_that_repeats_a_stamp() {
        let mut repetition = watching();
        for ms in [10, 20] {
            assert_eq!(repetition.take(stamp(ms), "left", &seen(3.0)), None);
            assert_eq!(repetition.take(stamp(ms), "right", &seen(9.0)), None);
        }
    }
}
