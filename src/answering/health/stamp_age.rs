//! Images from the future, or from long ago: two clocks that do not agree.

use std::time::{Duration, Instant};

/// How long all images must be so.
const LASTING: Duration = Duration::from_secs(2);
/// How many of them at least.
const MANY: u32 = 5;
/// s; clocks that are synchronised agree better.
const MOST_AHEAD_S: f64 = 0.1;
/// s; simulated time comes in steps, which grow with the pace of a replay.
const MOST_AHEAD_SIMULATED_S: f64 = 1.0;
/// s; no detector that serves a flight takes longer.
const MOST_OLD_S: f64 = 5.0;
/// s since 1970; an earlier stamp was never that of a set clock: September 2001.
const FIRST_SET_S: i32 = 1_000_000_000;

/// Which way the stamps are off.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Side {
    Future,
    Past,
}

/// Compares the stamps of images with the node's time.
#[derive(Debug, Default)]
pub struct StampAge {
    run: Option<Run>,
}

/// Consecutive images that are off to the same side.
#[derive(Debug)]
struct Run {
    side: Side,
    since: Instant,
    images: u32,
}

/// An image's stamp against the node's time.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ImageAge {
    /// The node's time minus the stamp, s.
    pub age_s: f64,
    /// Whole seconds of the stamp.
    pub stamp_s: i32,
    /// Whether the node's time is that of `/clock`.
    pub is_simulated: bool,
}

impl StampAge {
    /// Takes an image; returns what is wrong when all were so for long. Some(None): this one is fine.
    pub fn take(&mut self, image: ImageAge, now: Instant) -> Option<Option<String>> {
        let most_ahead_s = if image.is_simulated {
            MOST_AHEAD_SIMULATED_S
        } else {
            MOST_AHEAD_S
        };
        let side = if image.age_s < -most_ahead_s {
            Side::Future
        } else if image.age_s > MOST_OLD_S {
            Side::Past
        } else {
            self.run = None;
            return Some(None);
        };
        let run = match &mut self.run {
            Some(run) if run.side == side => run,
            run => run.insert(Run {
                side,
                since: now,
                images: 0,
            }),
        };
        run.images = run.images.saturating_add(1);
        let lasts = run.images >= MANY && now.saturating_duration_since(run.since) >= LASTING;
        lasts.then(|| Some(in_words(side, image)))
    }
}

fn in_words(side: Side, image: ImageAge) -> String {
    const UNSYNCHRONISED: &str = "the clock of the machine that stamps the images (camera or detector) is not synchronised \
         with this one's (chrony or PTP)";
    let by_s = image.age_s.abs();
    let clock = if image.is_simulated {
        "by /clock"
    } else {
        "by this machine's clock"
    };
    match side {
        Side::Future if image.is_simulated => format!(
            "are {by_s:.1} s in the future {clock}: another node plays /clock, or the detector does not have use_sim_time"
        ),
        Side::Future => format!("are {by_s:.1} s in the future {clock}: {UNSYNCHRONISED}"),
        Side::Past if image.stamp_s < FIRST_SET_S => format!(
            "are {} s since 1970: they are counted from a start-up (of a machine, or a simulation without use_sim_time here), \
             not taken from a clock that is set",
            image.stamp_s
        ),
        Side::Past if image.is_simulated => format!(
            "are {by_s:.1} s old {clock}: they belong to another recording, or the detector lags that far behind"
        ),
        Side::Past => format!(
            "are {by_s:.1} s old {clock}: {UNSYNCHRONISED}, a recording is played without use_sim_time, or the detector \
             lags that far behind"
        ),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const FRAME: Duration = Duration::from_millis(100);

    fn image(age_s: f64) -> ImageAge {
        ImageAge {
            age_s,
            stamp_s: 1_700_000_000,
            is_simulated: false,
        }
    }

    /// The message about images over some seconds.
    fn said(images: impl Fn(u32) -> ImageAge, frames: u32) -> Option<String> {
        let (mut ages, start) = (StampAge::default(), Instant::now());
        (0..frames)
            .filter_map(|frame| ages.take(images(frame), start + frame * FRAME))
            .last()
            .flatten()
    }

    #[test]
    fn images_from_the_future_or_long_ago_are_told_with_the_cause_after_two_seconds() {
        assert_eq!(said(|_| image(-23.0), 20), None);
        let words = said(|_| image(-23.0), 21).expect("2 s");
        assert!(
            words.starts_with("are 23.0 s in the future by this machine's clock"),
            "{words}"
        );
        assert!(words.contains("not synchronised"), "{words}");
        let words = said(|_| image(86_400.0), 30).expect("a recording");
        assert!(words.contains("without use_sim_time"), "{words}");
        let booted = ImageAge {
            stamp_s: 512,
            ..image(1.7e9)
        };
        let words = said(|_| booted, 30).expect("a count from a start");
        assert!(words.starts_with("are 512 s since 1970"), "{words}");
    }

    #[test]
    fn ages_of_a_healthy_system_are_no_fault() {
        for age_s in [0.0, -0.05, 0.02, 4.9] {
            assert_eq!(said(|_| image(age_s), 100), None, "{age_s}");
        }
        let simulated = ImageAge {
            is_simulated: true,
            ..image(-0.9)
        };
        assert_eq!(said(|_| simulated, 100), None);
        // One late image among others, and images on both sides.
        assert_eq!(
            said(|i| image(if i % 15 == 0 { 0.1 } else { 7.0 }), 100),
            None
        );
        assert_eq!(
            said(|i| image(if i % 2 == 0 { -7.0 } else { 7.0 }), 100),
            None
        );
    }
}
