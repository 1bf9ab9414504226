//! The formulas against differences and the textbook, and their numbers over long runs.

use nalgebra::{Isometry3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};
use proptest::prelude::{Strategy, prop, prop_assert, proptest};

use super::super::model::{BlockMotion, Difference, Innovation, Noise, predict};
use super::super::{Filter, FilterSettings, StartReason, TrackOutcome};
use super::{EPOCH_NS, pose};
use crate::geometry::{Matrix12, Motion, PoseCovariance, left_jacobian, motion_error, set};

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
    let in_blocks = BlockMotion::of(&predicted);
    let difference = Difference::new(&in_blocks, &measured);
    let innovation = Innovation::new(&difference, &in_blocks.covariance.pose, &noise.0, None)
        .expect("positive definite");
    let corrected = innovation
        .correct(&in_blocks, None)
        .expect("positive definite")
        .motion
        .motion();

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

/// One frame, each length in its unit or in sigmas.
#[derive(Debug, Clone)]
struct AnyFrame {
    after_ns: i64,
    position_sigma_m: f64,
    attitude_sigma: f64,
    /// Of position and attitude, in sigmas.
    shift: f64,
    turn: Vector3<f64>,
    /// From the tanker's origin to the point that was measured.
    lever_m: Vector3<f64>,
}

impl AnyFrame {
    fn covariance(&self) -> PoseCovariance {
        let mut point = Matrix6::zeros();
        for axis in 0..3 {
            point[(axis, axis)] = self.attitude_sigma.powi(2);
            point[(3 + axis, 3 + axis)] = self.position_sigma_m.powi(2);
        }
        PoseCovariance::from_point(&point, &self.lever_m)
    }

    fn pose(&self) -> Isometry3<f64> {
        let mut pose = pose(self.shift * self.position_sigma_m);
        let turn = self.turn * self.attitude_sigma.min(1.0);
        pose.rotation = UnitQuaternion::from_scaled_axis(turn) * pose.rotation;
        pose
    }
}

fn any_frame() -> impl Strategy<Value = AnyFrame> {
    let exponent = |low: f64, high: f64| (low..high).prop_map(|x| 10.0_f64.powf(x));
    let vector = || [-1.0..1.0, -1.0..1.0, -1.0..1.0_f64].prop_map(Vector3::from);
    #[allow(clippy::cast_possible_truncation)] // below 6e10
    let after_ns = exponent(0.0, 10.77).prop_map(|ns| ns as i64);
    (
        after_ns,
        exponent(-9.0, 3.0),
        exponent(-9.0, 0.5),
        -3.0..3.0,
        vector(),
        vector(),
        exponent(-3.0, 3.0),
    )
        .prop_map(
            |(after_ns, position_sigma_m, attitude_sigma, shift, turn, arm, length_m)| AnyFrame {
                after_ns,
                position_sigma_m,
                attitude_sigma,
                shift,
                turn,
                lever_m: arm * length_m,
            },
        )
}

/// Sends the frames through a filter; returns how often it lost precision, after which a track begins anew.
fn fly(frames: &[AnyFrame], acceleration_exponent: f64, speed_exponent: f64) -> usize {
    let mut filter = Filter::new(FilterSettings {
        acceleration_density_mps2: 10.0_f64.powf(acceleration_exponent),
        angular_acceleration_density_dps2: 10.0_f64.powf(acceleration_exponent + 1.0),
        initial_speed_sigma_mps: 10.0_f64.powf(speed_exponent),
        max_gap_s: 60.0,
        confirm_frames: 2,
        ..Default::default()
    })
    .expect("in range");
    let mut stamp_ns = EPOCH_NS;
    let mut lost = 0;
    for frame in frames {
        stamp_ns += frame.after_ns;
        let outcome = filter.update(stamp_ns, &frame.pose(), &frame.covariance());
        lost += usize::from(outcome == TrackOutcome::Started(StartReason::LostPrecision));
        if let Some(track) = filter.track() {
            assert!(track.motion.is_valid(), "{:?}", track.motion.covariance);
            let ahead = filter.predict(track.stamp_ns + 60_000_000_000);
            assert!(ahead.is_ok_and(|motion| motion.is_valid()));
        }
    }
    lost
}

proptest! {
    /// Gaps of a nanosecond to a minute, sigmas of a nanometre to a kilometre, in any order.
    #[test]
    fn the_covariance_stays_positive_definite(
        mut frames in prop::collection::vec(any_frame(), 300),
        acceleration_exponent in -4.0..2.0,
        speed_exponent in -3.0..3.0,
    ) {
        for frame in &mut frames {
            frame.lever_m = Vector3::zeros();
        }
        prop_assert!(fly(&frames, acceleration_exponent, speed_exponent) == 0, "lost precision");
    }

    /// The same of points a kilometre from the origin: a billion billion between the largest variance and the
    /// least is more than doubles tell apart. A track may then end, but never goes out without a covariance.
    #[test]
    fn the_covariance_of_far_points_is_one_or_the_track_begins_anew(
        frames in prop::collection::vec(any_frame(), 300),
        acceleration_exponent in -4.0..2.0,
        speed_exponent in -3.0..3.0,
    ) {
        fly(&frames, acceleration_exponent, speed_exponent);
    }
}
