use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};
use proptest::prelude::{Strategy, prop, prop_assert, proptest};

use super::model::{Innovation, Noise, predict};
use super::{Filter, FilterSettings, MeasurementError, PredictError, StartReason, TrackOutcome};
use crate::geometry::{Matrix12, Motion, PoseCovariance, left_jacobian, motion_error, set};

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
fn duplicate_and_late_stamps_are_told_and_not_used() {
    let mut filter = tracking();
    let last = EPOCH_NS + 4 * FRAME_NS;
    let before = filter.clone();
    let outcome = filter.update(last, &pose(0.0), &covariance());
    assert_eq!(outcome, TrackOutcome::Duplicate { stamp_ns: last });
    let outcome = filter.update(last - FRAME_NS / 2, &pose(0.0), &covariance());
    assert!(
        matches!(outcome, TrackOutcome::Late { late_by_s } if (late_by_s - 0.016_666_666).abs() < 1e-12)
    );
    assert_eq!(filter, before);
    // A frame that the gate refused has been seen as well.
    let next = last + FRAME_NS;
    let outcome = filter.update(next, &pose(3.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Gated { .. }));
    let outcome = filter.update(next, &pose(0.0), &covariance());
    assert_eq!(outcome, TrackOutcome::Duplicate { stamp_ns: next });
    // And another image from between the two is still younger than the track.
    let outcome = filter.update(next - 1, &pose(0.0), &covariance());
    assert!(matches!(outcome, TrackOutcome::Updated { .. }));
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
fn poses_that_go_on_contradicting_the_track_end_it() {
    let mut filter = tracking();
    let mut restarted = None;
    for k in 5..60 {
        let outcome = filter.update(EPOCH_NS + k * FRAME_NS, &pose(6.0), &covariance());
        if let TrackOutcome::Started(StartReason::Gap { gap_s }) = outcome {
            restarted = Some(gap_s);
            assert!(filter.track().is_none());
        }
    }
    assert!(restarted.is_some_and(|gap_s| gap_s > 1.0 && gap_s < 1.1));
    assert!(filter.track().is_some());
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

const NOISE: Noise = Noise {
    acceleration: 0.04,
    angular_acceleration: 1e-3,
};

fn motion() -> Motion {
    Motion {
        b_from_a: pose(0.5),
        velocity_in_b: Vector3::new(0.3, -0.2, -1.0),
        rate_in_b: Vector3::new(0.4, -0.3, 0.6),
        covariance: Matrix12::from_fn(|i, j| if i == j { 0.01 } else { 1e-3 }),
    }
}

#[test]
fn many_small_steps_predict_what_one_large_step_does() {
    let mut stepped = motion();
    for _ in 0..1000 {
        stepped = predict(&stepped, 5e-4, &NOISE);
    }
    let whole = predict(&motion(), 0.5, &NOISE);
    let distance = motion_error(&whole, &stepped).norm();
    assert!(distance < 1e-11, "{distance:.1e}");
    // Only the noise of the attitude is approximated: it should turn with the rate, here by 22 degrees.
    let difference = Matrix12::from_fn(|i, j| {
        let scale = (whole.covariance[(i, i)] * whole.covariance[(j, j)]).sqrt();
        (whole.covariance[(i, j)] - stepped.covariance[(i, j)]) / scale
    });
    assert!(difference.amax() < 5e-3, "{:.1e}", difference.amax());
    let position = difference.fixed_view::<3, 3>(0, 0).amax();
    assert!(position < 1e-12, "{position:.1e}");
}

#[test]
fn the_predicted_covariance_is_that_of_predicted_errors() {
    const STEP: f64 = 1e-5;
    const DT_S: f64 = 0.7;
    const QUIET: Noise = Noise {
        acceleration: 0.0,
        angular_acceleration: 0.0,
    };
    let moved = |axis: usize, by: f64| {
        let mut m = motion();
        let step = Vector3::ith(axis % 3, by);
        match axis / 3 {
            0 => m.b_from_a.translation.vector += step,
            1 => {
                m.b_from_a.rotation = UnitQuaternion::from_scaled_axis(step) * m.b_from_a.rotation;
            }
            2 => m.velocity_in_b += step,
            _ => m.rate_in_b += step,
        }
        predict(&m, DT_S, &QUIET)
    };
    let transition = Matrix12::from_columns(&std::array::from_fn::<_, 12, _>(|axis| {
        motion_error(&moved(axis, STEP), &moved(axis, -STEP)) / (2.0 * STEP)
    }));
    let expected = transition * motion().covariance * transition.transpose();
    let found = predict(&motion(), DT_S, &QUIET).covariance;
    assert!((found - expected).amax() < 1e-8);
}

#[test]
fn an_update_is_the_textbook_one() {
    let predicted = motion();
    let noise = PoseCovariance(Matrix6::from_fn(|i, j| if i == j { 0.02 } else { 2e-3 }));
    // Without a difference in attitude nothing turns, and the plain formula holds.
    let mut measured = predicted.b_from_a;
    measured.translation.vector += Vector3::new(0.05, -0.02, 0.1);
    let innovation = Innovation::new(&predicted, &measured, &noise).expect("positive definite");
    let corrected = innovation.corrected(&predicted).expect("positive definite");

    let p = predicted.covariance;
    let s = p.fixed_view::<6, 6>(0, 0) + noise.0;
    let inverse = s.try_inverse().expect("positive definite");
    let gain = p.fixed_view::<12, 6>(0, 0) * inverse;
    let difference = Vector6::new(0.05, -0.02, 0.1, 0.0, 0.0, 0.0);
    let step = gain * difference;
    let before = Motion {
        b_from_a: Isometry3::from_parts(
            Translation3::from(predicted.b_from_a.translation.vector),
            predicted.b_from_a.rotation,
        ),
        ..predicted
    };
    assert!((motion_error(&corrected, &before) - step).norm() < 1e-12);
    assert!((innovation.squared - difference.dot(&(inverse * difference))).abs() < 1e-10);
    // The attitude moved by a correlation, and what is left of its error stands about the new one.
    let mut reset = Matrix12::identity();
    let turn = step.fixed_rows::<3>(3).into_owned();
    set(&mut reset, 3, 3, &left_jacobian(turn));
    let plain = reset * (p - gain * s * gain.transpose()) * reset.transpose();
    assert!((corrected.covariance - plain).amax() < 1e-14);
}

/// One frame: time since the last one, sigmas of position and attitude, a shift in sigmas.
fn any_frame() -> impl Strategy<Value = (i64, f64, f64, f64)> {
    let exponent = |low: f64, high: f64| (low..high).prop_map(|x| 10.0_f64.powf(x));
    (
        exponent(0.0, 10.77).prop_map(|ns| {
            #[allow(clippy::cast_possible_truncation)] // below 6e10
            let ns = ns as i64;
            ns
        }),
        exponent(-9.0, 3.0),
        exponent(-9.0, 0.5),
        -3.0..3.0,
    )
}

proptest! {
    /// Gaps of a nanosecond to a minute, sigmas of a nanometre to a kilometre, in any order.
    #[test]
    fn the_covariance_stays_positive_definite(
        frames in prop::collection::vec(any_frame(), 300),
        acceleration_exponent in -4.0..2.0,
        speed_exponent in -3.0..3.0,
    ) {
        let mut filter = Filter::new(FilterSettings {
            acceleration_density_mps2: 10.0_f64.powf(acceleration_exponent),
            angular_acceleration_density_dps2: 10.0_f64.powf(acceleration_exponent + 1.0),
            initial_speed_sigma_mps: 10.0_f64.powf(speed_exponent),
            max_gap_s: 60.0,
            confirm_frames: 2,
            ..Default::default()
        }).expect("in range");
        let mut stamp_ns = EPOCH_NS;
        for (after_ns, position_sigma_m, attitude_sigma, shift) in frames {
            stamp_ns += after_ns;
            let diagonal = Vector3::repeat(position_sigma_m.powi(2))
                .push(attitude_sigma.powi(2))
                .push(attitude_sigma.powi(2))
                .push(attitude_sigma.powi(2));
            let measured = PoseCovariance(Matrix6::from_diagonal(&diagonal));
            let outcome = filter.update(stamp_ns, &pose(shift * position_sigma_m), &measured);
            prop_assert!(
                outcome != TrackOutcome::Started(StartReason::LostPrecision),
                "lost precision"
            );
            if let Some(track) = filter.track() {
                prop_assert!(track.motion.is_valid(), "{:?}", track.motion.covariance);
                let ahead = filter.predict(track.stamp_ns + 60_000_000_000);
                prop_assert!(ahead.is_ok_and(|motion| motion.is_valid()));
            }
        }
    }
}
