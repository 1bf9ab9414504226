//! Frames that come late are taken at their own time.

use nalgebra::{Matrix6, Vector6};
use rand::seq::SliceRandom;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::{Filter, LastingError, TrackOutcome};
use super::{EPOCH_NS, FRAME_NS, covariance, filter, pose, tracking};
use crate::geometry::PoseCovariance;

/// What may come of one image.
#[derive(Debug, Clone)]
struct Given {
    stamp_ns: i64,
    /// `None`: no pose.
    x_m: Option<f64>,
    noise: PoseCovariance,
    lasting: Vec<LastingError>,
}

impl Given {
    fn to(&self, filter: &mut Filter) -> TrackOutcome {
        match self.x_m {
            Some(x_m) => {
                filter.update_with_lasting(self.stamp_ns, &pose(x_m), &self.noise, &self.lasting)
            }
            None => filter.miss(self.stamp_ns),
        }
    }
}

/// Frames with noise, some lost, some far off for a while, so that gates, challengers and new candidates occur.
fn flight(seed: u64, count: i64) -> Vec<Given> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    (0..count)
        .map(|k| {
            let mut lasting: Vec<LastingError> = (0..7)
                .map(|cause| LastingError {
                    cause,
                    shift: Vector6::from_fn(|_, _| random.random_range(-0.01..0.01)),
                    time_constant_s: (cause == 3).then_some(2.0),
                })
                .collect();
            // A marker that is not seen in every frame.
            if k % 3 == 0 {
                lasting.remove(2);
            }
            let jump_m = if (40..43).contains(&(k % 60)) || k > 150 {
                6.0
            } else {
                0.0
            };
            Given {
                stamp_ns: EPOCH_NS + k * FRAME_NS,
                x_m: (random.random_range(0.0..1.0) > 0.1)
                    .then(|| jump_m + random.random_range(-0.02..0.02)),
                noise: PoseCovariance(Matrix6::identity() * random.random_range(1e-4..4e-4)),
                lasting,
            }
        })
        .collect()
}

/// Delays frames by up to `most_ns` and returns them in the order of arrival.
fn delayed(mut frames: Vec<Given>, most_ns: i64, seed: u64) -> Vec<Given> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    frames.sort_by_cached_key(|frame| {
        let is_late = random.random_range(0.0..1.0) < 0.1;
        frame.stamp_ns
            + if is_late {
                random.random_range(0..most_ns)
            } else {
                0
            }
    });
    frames
}

#[test]
fn a_shuffled_flight_ends_in_the_track_of_the_sorted_one() {
    let mut inserted = 0;
    for seed in 0..20 {
        let frames = flight(seed, 200);
        let mut in_order = filter();
        for frame in &frames {
            frame.to(&mut in_order);
        }
        let mut shuffled = filter();
        for frame in &delayed(frames, 400_000_000, seed) {
            let outcome = frame.to(&mut shuffled);
            assert!(
                !matches!(
                    outcome,
                    TrackOutcome::Late { .. } | TrackOutcome::Duplicate { .. }
                ),
                "{outcome:?}"
            );
            inserted += usize::from(matches!(
                outcome,
                TrackOutcome::Inserted { was_used: true, .. }
            ));
        }
        assert!(in_order.track().is_some());
        assert_eq!(shuffled.track(), in_order.track());
        // And both go on alike.
        let next = &flight(seed + 100, 201)[200];
        assert_eq!(next.to(&mut shuffled), next.to(&mut in_order));
        assert_eq!(shuffled.track(), in_order.track());
    }
    assert!(inserted > 200, "{inserted} of 4000");
}

#[test]
fn any_order_within_half_a_second_gives_the_same_track() {
    let frames = flight(7, 14);
    let mut in_order = filter();
    for frame in &frames {
        frame.to(&mut in_order);
    }
    let mut random = ChaCha8Rng::seed_from_u64(3);
    for _ in 0..200 {
        let mut shuffled = frames.clone();
        shuffled.shuffle(&mut random);
        let mut filter = filter();
        for frame in &shuffled {
            frame.to(&mut filter);
        }
        assert_eq!(filter.track(), in_order.track());
    }
}

#[test]
fn a_late_frame_says_how_late_it_is_and_what_came_of_it() {
    let mut filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    let sigma = |filter: &Filter| filter.track().expect("a track").motion.covariance[(0, 0)];
    let before = sigma(&filter);
    let outcome = filter.update(last - FRAME_NS / 2, &pose(0.0), &covariance());
    let TrackOutcome::Inserted {
        late_by_s,
        was_used: true,
    } = outcome
    else {
        unreachable!("{outcome:?}");
    };
    assert!((late_by_s - 0.016_666_666).abs() < 1e-12);
    assert!(sigma(&filter) < before);
    // One that contradicts the track of its time touches nothing.
    let track = filter.track();
    let outcome = filter.update(last - FRAME_NS / 3, &pose(3.0), &covariance());
    assert!(matches!(
        outcome,
        TrackOutcome::Inserted {
            was_used: false,
            ..
        }
    ));
    assert_eq!(filter.track(), track);
    // And one from long before finds no belief of its time.
    for k in 5..60 {
        filter.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
    }
    let track = filter.track();
    let outcome = filter.update(EPOCH_NS + 40 * FRAME_NS + 1, &pose(0.0), &covariance());
    assert!(
        matches!(outcome, TrackOutcome::Late { late_by_s } if (late_by_s - 0.633).abs() < 1e-3),
        "{outcome:?}"
    );
    assert_eq!(filter.track(), track);
}

#[test]
fn frames_from_before_other_settings_are_too_late() {
    let mut filter = tracking();
    let settings = *filter.settings();
    filter.set_settings(settings.checked().expect("the same"));
    let outcome = filter.update(EPOCH_NS + 4 * FRAME_NS - 1, &pose(0.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Late { .. }), "{outcome:?}");
    let outcome = filter.update(EPOCH_NS + 5 * FRAME_NS, &pose(0.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Updated { .. }));
}

#[test]
fn more_frames_than_are_remembered_are_late_and_no_error() {
    let mut filter = filter();
    for k in 0..200_i64 {
        filter.update(EPOCH_NS + 2 * k * 1_000_000, &pose(0.0), &covariance());
    }
    let at = |k: i64| EPOCH_NS + (2 * k - 1) * 1_000_000;
    let outcome = filter.update(at(150), &pose(0.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Inserted { .. }));
    let outcome = filter.update(at(100), &pose(0.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Late { .. }));
}

#[test]
fn one_frame_from_the_future_does_not_make_the_others_too_late() {
    let mut filter = tracking();
    let future = EPOCH_NS + 4 * FRAME_NS + 900_000_000;
    let outcome = filter.update(future, &pose(30.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Gated { .. }), "{outcome:?}");
    for k in 5..20 {
        let outcome = filter.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
        assert!(
            matches!(outcome, TrackOutcome::Inserted { was_used: true, .. }),
            "{outcome:?}"
        );
    }
    let track = filter.track().expect("a track");
    assert_eq!(track.stamp_ns, EPOCH_NS + 19 * FRAME_NS);
}

#[test]
fn a_lost_frame_from_the_future_does_not_keep_a_track_from_beginning() {
    let mut filter = filter();
    filter.miss(EPOCH_NS + 900_000_000);
    for k in 0..5 {
        filter.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
    }
    assert!(filter.track().is_some());
    // Nor do other settings end it then.
    filter.miss(EPOCH_NS + 900_000_000);
    let settings = *filter.settings();
    filter.set_settings(settings.checked().expect("the same"));
    let outcome = filter.update(EPOCH_NS + 5 * FRAME_NS, &pose(0.0), &covariance());
    assert!(
        matches!(outcome, TrackOutcome::Inserted { was_used: true, .. }),
        "{outcome:?}"
    );
}
