//! When a track begins, what it takes, when it ends.

mod lasting;
mod late;
mod model;

use nalgebra::{Isometry3, Matrix6, Vector3};

use super::{Filter, FilterSettings, MeasurementError, PredictError, StartReason, TrackOutcome};
use crate::geometry::PoseCovariance;

const FRAME_NS: i64 = 33_333_333;
/// A stamp of these days: it must not cost precision.
const EPOCH_NS: i64 = 1_700_000_000_000_000_000;

fn pose(x_m: f64) -> Isometry3<f64> {
    Isometry3::new(Vector3::new(x_m, 1.0, 20.0), Vector3::new(0.1, -0.2, 0.3))
}

fn covariance() -> PoseCovariance {
    PoseCovariance(Matrix6::identity() * 1e-4)
}

fn filter() -> Filter {
    Filter::new(FilterSettings::default()).expect("the defaults are in range")
}

/// A track of five frames, the last of stamp `EPOCH_NS + 4 FRAME_NS`.
fn tracking() -> Filter {
    let mut filter = filter();
    for k in 0..5 {
        filter.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
    }
    assert!(filter.track().is_some());
    filter
}

#[test]
fn a_track_begins_with_the_stated_number_of_consistent_frames() {
    let mut filter = filter();
    let mut outcomes = Vec::new();
    for k in 0..6 {
        outcomes.push(filter.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance()));
        assert_eq!(filter.track().is_some(), k >= 4);
    }
    assert_eq!(outcomes[0], TrackOutcome::Started(StartReason::First));
    let third = TrackOutcome::Confirming {
        consistent_frames: 3,
        needed: 5,
    };
    assert_eq!(outcomes[2], third);
    assert_eq!(outcomes[4], TrackOutcome::Acquired);
    assert!(matches!(outcomes[5], TrackOutcome::Updated { .. }));
}

#[test]
fn a_frame_that_contradicts_the_candidate_begins_another() {
    let mut filter = filter();
    filter.update(EPOCH_NS, &pose(0.0), &covariance());
    let outcome = filter.update(EPOCH_NS + FRAME_NS, &pose(3.0), &covariance());
    let TrackOutcome::Started(StartReason::Inconsistent {
        innovation_squared,
        limit,
    }) = outcome
    else {
        unreachable!("{outcome:?}");
    };
    assert!(innovation_squared > limit);
    for k in 2..=5 {
        assert!(filter.track().is_none());
        filter.update(EPOCH_NS + k * FRAME_NS, &pose(3.0), &covariance());
    }
    let track = filter.track().expect("five frames that agree");
    assert!((track.motion.b_from_a.translation.x - 3.0).abs() < 0.1);
}

#[test]
fn stamps_that_have_been_seen_are_not_used() {
    let mut filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    let before = filter.clone();
    for stamp_ns in [last, last - FRAME_NS] {
        let outcome = filter.update(stamp_ns, &pose(0.0), &covariance());
        assert_eq!(outcome, TrackOutcome::Duplicate { stamp_ns });
    }
    assert_eq!(filter, before);
    // A frame that the gate refused has been seen as well.
    let next = last + FRAME_NS;
    let outcome = filter.update(next, &pose(3.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Gated { .. }));
    let outcome = filter.update(next, &pose(0.0), &covariance());
    assert_eq!(outcome, TrackOutcome::Duplicate { stamp_ns: next });
    // And another image from between the two is taken at its own time.
    let outcome = filter.update(next - 1, &pose(0.0), &covariance());
    assert!(matches!(
        outcome,
        TrackOutcome::Inserted { was_used: true, .. }
    ));
    assert_eq!(filter.track().map(|track| track.stamp_ns), Some(next - 1));
}

#[test]
fn a_track_is_dropped_after_the_gap_and_needs_confirmation_again() {
    let mut filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    let outcome = filter.miss(last + 900_000_000);
    assert_eq!(outcome, TrackOutcome::Coasting { gap_s: 0.9 });
    assert!(filter.track().is_some());
    let mut told = filter.clone();
    let outcome = told.miss(last + 1_100_000_000);
    assert_eq!(outcome, TrackOutcome::Dropped { gap_s: 1.1 });
    assert_eq!(told.predict(last), Err(PredictError::NoTrack));
    assert_eq!(told.miss(last + 1_200_000_000), TrackOutcome::Idle);
    // Also when nobody told it of the lost frames.
    let outcome = filter.update(last + 1_100_000_000, &pose(0.0), &covariance());
    assert_eq!(
        outcome,
        TrackOutcome::Started(StartReason::Gap { gap_s: 1.1 })
    );
    assert!(filter.track().is_none());
}

#[test]
fn poses_that_contradict_the_track_but_not_each_other_are_the_next_one() {
    let mut filter = tracking();
    for k in 5..9 {
        let outcome = filter.update(EPOCH_NS + k * FRAME_NS, &pose(6.0), &covariance());
        assert!(matches!(outcome, TrackOutcome::Gated { .. }), "{outcome:?}");
        let x = filter
            .track()
            .expect("the old one")
            .motion
            .b_from_a
            .translation
            .x;
        assert!(x.abs() < 0.1);
    }
    let outcome = filter.update(EPOCH_NS + 9 * FRAME_NS, &pose(6.0), &covariance());
    assert_eq!(outcome, TrackOutcome::Acquired);
    let x = filter
        .track()
        .expect("the new one")
        .motion
        .b_from_a
        .translation
        .x;
    assert!((x - 6.0).abs() < 0.1);
}

#[test]
fn poses_that_contradict_the_track_and_each_other_end_it_after_the_gap() {
    let mut filter = tracking();
    let mut restarted = None;
    for k in 5..60 {
        let wrong = if k % 2 == 0 { 6.0 } else { -6.0 };
        let outcome = filter.update(EPOCH_NS + k * FRAME_NS, &pose(wrong), &covariance());
        if let TrackOutcome::Started(StartReason::Gap { gap_s }) = outcome {
            restarted = Some(gap_s);
        }
        assert!(outcome != TrackOutcome::Acquired);
    }
    assert!(restarted.is_some_and(|gap_s| gap_s > 1.0 && gap_s < 1.1));
    assert!(filter.track().is_none());
}

#[test]
fn wrong_poses_between_right_ones_never_become_a_track() {
    let mut filter = tracking();
    for k in 5..100 {
        let is_right = k % 5 == 0;
        let shown = pose(if is_right { 0.0 } else { 6.0 });
        let outcome = filter.update(EPOCH_NS + k * FRAME_NS, &shown, &covariance());
        assert_eq!(
            matches!(outcome, TrackOutcome::Updated { .. }),
            is_right,
            "{outcome:?}"
        );
    }
}

#[test]
fn lost_frames_whose_stamps_went_back_end_the_track_too() {
    let mut filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    let outcome = filter.miss(last - 2_000_000_000);
    assert_eq!(outcome, TrackOutcome::Dropped { gap_s: -2.0 });
    assert!(filter.track().is_none());
    // A lost frame has been seen, whatever comes under its stamp.
    let mut filter = tracking();
    assert!(matches!(
        filter.miss(last + FRAME_NS),
        TrackOutcome::Coasting { .. }
    ));
    let stamp_ns = last + FRAME_NS;
    let outcome = filter.update(stamp_ns, &pose(0.0), &covariance());
    assert_eq!(outcome, TrackOutcome::Duplicate { stamp_ns });
}

#[test]
fn stamps_that_go_back_far_begin_anew() {
    let mut filter = tracking();
    let outcome = filter.update(EPOCH_NS - 10_000_000_000, &pose(0.0), &covariance());
    assert!(matches!(
        outcome,
        TrackOutcome::Started(StartReason::StampsWentBack { by_s }) if by_s > 10.0
    ));
    // The extremes of the type are no special case.
    for stamp in [i64::MIN, i64::MAX, i64::MIN, 0] {
        let outcome = filter.update(stamp, &pose(0.0), &covariance());
        assert!(matches!(outcome, TrackOutcome::Started(_)), "{outcome:?}");
    }
}

#[test]
fn reset_forgets_everything() {
    let mut reset = tracking();
    reset.reset();
    assert_eq!(reset, filter());
}

#[test]
fn what_is_no_pose_is_refused() {
    let mut filter = tracking();
    let before = filter.clone();
    let stamp = EPOCH_NS + 5 * FRAME_NS;
    let mut asymmetric = covariance();
    asymmetric.0[(0, 1)] = 1e-5;
    for wrong in [
        asymmetric,
        PoseCovariance(-Matrix6::identity()),
        PoseCovariance(Matrix6::zeros()),
        PoseCovariance(Matrix6::from_element(f64::NAN)),
    ] {
        let outcome = filter.update(stamp, &pose(0.0), &wrong);
        let expected = MeasurementError::InvalidCovariance;
        assert_eq!(outcome, TrackOutcome::Invalid(expected));
    }
    let outcome = filter.update(stamp, &pose(f64::INFINITY), &covariance());
    let expected = MeasurementError::PoseNotFinite;
    assert_eq!(outcome, TrackOutcome::Invalid(expected));
    assert_eq!(filter, before);
}

#[test]
fn predictions_exist_from_the_track_to_the_gap() {
    let filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    assert_eq!(
        filter.predict(last).as_ref(),
        Ok(&filter.track().expect("a track").motion)
    );
    assert!(matches!(
        filter.predict(last - 1),
        Err(PredictError::BeforeTrack { .. })
    ));
    assert!(matches!(
        filter.predict(last + 1_000_000_001),
        Err(PredictError::BeyondGap { .. })
    ));
    let mut sigma = 0.0;
    for after_ns in [0, 100_000_000, 400_000_000, 1_000_000_000] {
        let motion = filter.predict(last + after_ns).expect("within the gap");
        let grown = motion.covariance[(2, 2)].sqrt();
        assert!(grown > sigma);
        sigma = grown;
    }
}

#[test]
fn settings_out_of_range_are_named() {
    let settings = FilterSettings {
        max_gap_s: f64::NAN,
        ..Default::default()
    };
    let error = Filter::new(settings).expect_err("NaN is in no range");
    assert_eq!(
        error.to_string(),
        "max_gap_s: expected 0.001 to 60, got NaN"
    );
    let settings = FilterSettings {
        confirm_frames: 1,
        ..Default::default()
    };
    let error = Filter::new(settings).expect_err("one frame has no velocity");
    assert_eq!(error.name, "confirm_frames");
}
