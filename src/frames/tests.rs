//! Each change against sampled truths: the change of the mean is rigid geometry, the covariance that of samples.

use nalgebra::{
    Isometry3, Matrix3, Matrix6, SMatrix, SVector, Translation3, UnitQuaternion, Vector3, Vector6,
};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::{
    LocalAttitude, PoseEstimate, flu_from_optical, frd_from_flu, ned_from_enu, rotation_only,
};
use crate::geometry::{Motion, PoseCovariance, Vector12, motion_error, pose_error};

const SAMPLES: usize = 20_000;
/// Standard errors; with 78 numbers a change, none in a hundred seeds goes beyond by chance.
const LIMIT: f64 = 5.0;
/// Of a standard deviation: what the second order leaves, at sigmas of a few milliradians.
const SECOND_ORDER: f64 = 0.01;

/// m and rad; of lengths up to 20 m.
const ROUNDING: f64 = 1e-13;

fn random_covariance<const N: usize>(random: &mut ChaCha8Rng) -> SMatrix<f64, N, N> {
    // Centimetres and milliradians, so that the second order vanishes below the sampling error.
    let half = SMatrix::<f64, N, N>::from_fn(|_, _| random.random_range(-1e-3..1e-3));
    half * half.transpose() + SMatrix::identity() * 1e-6
}

fn normal<const N: usize>(
    random: &mut ChaCha8Rng,
    covariance: &SMatrix<f64, N, N>,
) -> SVector<f64, N> {
    // A square root by eigenvectors would do as well; Cholesky's is at hand for any size here.
    let mut l = SMatrix::<f64, N, N>::zeros();
    for i in 0..N {
        for j in 0..=i {
            let sum: f64 = (0..j).map(|k| l[(i, k)] * l[(j, k)]).sum();
            l[(i, j)] = if i == j {
                (covariance[(i, i)] - sum).sqrt()
            } else {
                (covariance[(i, j)] - sum) / l[(j, j)]
            };
        }
    }
    l * SVector::<f64, N>::from_fn(|_, _| StandardNormal.sample(random))
}

/// Fails unless the samples' mean square is the covariance, within sampling error.
fn assert_covariance<const N: usize>(
    what: &str,
    errors: &[SVector<f64, N>],
    covariance: &SMatrix<f64, N, N>,
) {
    let n = errors.len() as f64;
    let mut sampled = SMatrix::<f64, N, N>::zeros();
    for error in errors {
        sampled += error * error.transpose() / n;
    }
    for i in 0..N {
        for j in 0..N {
            let (variance_i, variance_j) = (covariance[(i, i)], covariance[(j, j)]);
            // Variance of a product of two correlated normal numbers.
            let standard_error =
                ((variance_i * variance_j + covariance[(i, j)].powi(2)) / n).sqrt();
            let difference = (sampled[(i, j)] - covariance[(i, j)]).abs();
            let allowed = LIMIT * standard_error + SECOND_ORDER * (variance_i * variance_j).sqrt();
            assert!(
                difference < allowed,
                "{what} ({i}, {j}): {difference:.2e} > {allowed:.2e}"
            );
        }
    }
}

fn moved(motion: &Motion, error: &Vector12) -> Motion {
    Motion {
        b_from_a: Isometry3::from_parts(
            Translation3::from(motion.b_from_a.translation.vector + error.fixed_rows::<3>(0)),
            UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(3).into_owned())
                * motion.b_from_a.rotation,
        ),
        velocity_in_b: motion.velocity_in_b + error.fixed_rows::<3>(6),
        rate_in_b: motion.rate_in_b + error.fixed_rows::<3>(9),
        covariance: motion.covariance,
    }
}

fn some_motion(random: &mut ChaCha8Rng) -> Motion {
    Motion {
        b_from_a: Isometry3::new(Vector3::new(1.0, -2.0, 15.0), Vector3::new(0.3, -0.5, 0.9)),
        velocity_in_b: Vector3::new(0.4, -0.7, -1.1),
        rate_in_b: Vector3::new(0.15, 0.1, -0.2),
        covariance: random_covariance(random),
    }
}

fn pose_of(motion: &Motion) -> PoseEstimate {
    PoseEstimate {
        b_from_a: motion.b_from_a,
        covariance: motion.pose_covariance(),
    }
}

type Change<'a, T> = &'a dyn Fn(&T) -> Motion;

fn some_transform() -> Isometry3<f64> {
    Isometry3::new(Vector3::new(2.0, -1.0, 3.0), Vector3::new(-0.7, 0.2, 1.1))
}

fn some_attitude(random: &mut ChaCha8Rng) -> LocalAttitude {
    LocalAttitude {
        local_from_b: UnitQuaternion::from_scaled_axis(Vector3::new(0.2, -0.1, 1.9)),
        covariance: random_covariance(random),
        rate_in_b: Vector3::new(0.05, -0.1, 0.2),
        rate_covariance: random_covariance(random),
    }
}

#[test]
fn every_change_of_a_motion_carries_its_covariance() {
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let found = some_motion(&mut random);
    let x = some_transform();
    let changes: [(&str, Change<Motion>); 3] = [
        ("seen_from", &|m| m.seen_from(&x)),
        ("of", &|m| m.of(&x)),
        ("inverse", &|m| m.inverse()),
    ];
    for (what, change) in changes {
        let changed = change(&found);
        let errors: Vec<Vector12> = (0..SAMPLES)
            .map(|_| {
                let truth = moved(&found, &normal(&mut random, &found.covariance));
                motion_error(&change(&truth), &changed)
            })
            .collect();
        assert_covariance(what, &errors, &changed.covariance);
    }
}

#[test]
fn local_axes_carry_the_errors_of_attitude_and_rate() {
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let found = some_motion(&mut random);
    let attitude = some_attitude(&mut random);
    let changed = found.in_local_axes(&attitude);
    let errors: Vec<Vector12> = (0..SAMPLES)
        .map(|_| {
            let truth = moved(&found, &normal(&mut random, &found.covariance));
            let turn = normal(&mut random, &attitude.covariance);
            let truth_attitude = LocalAttitude {
                local_from_b: UnitQuaternion::from_scaled_axis(turn) * attitude.local_from_b,
                rate_in_b: attitude.rate_in_b + normal(&mut random, &attitude.rate_covariance),
                ..attitude
            };
            motion_error(&truth.in_local_axes(&truth_attitude), &changed)
        })
        .collect();
    assert_covariance("in_local_axes", &errors, &changed.covariance);
}

#[test]
fn a_pose_changes_as_the_pose_of_a_motion_does() {
    // The Jacobians of the pose are the first block of the motion's, which the samples have checked.
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let found = some_motion(&mut random);
    let attitude = some_attitude(&mut random);
    let x = some_transform();
    for (pose, motion) in [
        (pose_of(&found).seen_from(&x), found.seen_from(&x)),
        (pose_of(&found).of(&x), found.of(&x)),
        (pose_of(&found).inverse(), found.inverse()),
        (
            pose_of(&found).in_local_axes(&attitude),
            found.in_local_axes(&attitude),
        ),
    ] {
        let error: Vector6<f64> = pose_error(&pose.b_from_a, &motion.b_from_a);
        assert!(error.norm() < 1e-14);
        let difference = pose.covariance.0 - motion.pose_covariance().0;
        assert!(difference.amax() < 1e-15);
    }
}

#[test]
fn velocities_are_derivatives_of_the_changed_poses() {
    const STEP_S: f64 = 1e-4;
    let mut random = ChaCha8Rng::seed_from_u64(4);
    let now = some_motion(&mut random);
    let attitude = some_attitude(&mut random);
    let x = some_transform();
    let at = |dt: f64| {
        let mut error = Vector12::zeros();
        error
            .fixed_rows_mut::<3>(0)
            .copy_from(&(now.velocity_in_b * dt));
        error
            .fixed_rows_mut::<3>(3)
            .copy_from(&(now.rate_in_b * dt));
        let turned = LocalAttitude {
            // Body rates stand on the right.
            local_from_b: attitude.local_from_b
                * UnitQuaternion::from_scaled_axis(attitude.rate_in_b * dt),
            ..attitude
        };
        (moved(&now, &error), turned)
    };
    let changes: [Change<(Motion, LocalAttitude)>; 4] = [
        &|(m, _)| m.seen_from(&x),
        &|(m, _)| m.of(&x),
        &|(m, _)| m.inverse(),
        &|(m, attitude)| m.in_local_axes(attitude),
    ];
    for change in changes {
        let (ahead, back) = (change(&at(STEP_S)), change(&at(-STEP_S)));
        let difference = pose_error(&ahead.b_from_a, &back.b_from_a) / (2.0 * STEP_S);
        let changed = change(&(now, attitude));
        assert!((difference.fixed_rows::<3>(0) - changed.velocity_in_b).norm() < 1e-6);
        assert!((difference.fixed_rows::<3>(3) - changed.rate_in_b).norm() < 1e-6);
    }
}

#[test]
fn changes_can_be_undone() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let found = some_motion(&mut random);
    let x = some_transform();
    for back in [
        found.inverse().inverse(),
        found.seen_from(&x).seen_from(&x.inverse()),
        found.of(&x).of(&x.inverse()),
        // Seen from the other side, the observer's lever arm is the target's.
        found.seen_from(&x).inverse().of(&x).inverse(),
    ] {
        assert!(motion_error(&back, &found).norm() < 1e-13);
        assert!((back.covariance - found.covariance).amax() < 1e-16);
    }
}

#[test]
fn axes_go_where_the_conventions_say() {
    let (forward, left, up) = (Vector3::x(), Vector3::y(), Vector3::z());
    assert_eq!(flu_from_optical() * Vector3::z(), forward);
    assert_eq!(flu_from_optical() * Vector3::x(), -left);
    assert_eq!(flu_from_optical() * Vector3::y(), -up);
    assert_eq!(frd_from_flu() * left, -Vector3::y());
    assert_eq!(frd_from_flu() * up, -Vector3::z());
    // East is x of ENU and y of NED.
    assert_eq!(ned_from_enu() * Vector3::x(), Vector3::y());
    assert_eq!(ned_from_enu() * Vector3::y(), Vector3::x());
    for own_inverse in [frd_from_flu(), ned_from_enu()] {
        assert_eq!(
            own_inverse.matrix() * own_inverse.matrix(),
            Matrix3::identity()
        );
        assert!((own_inverse.matrix().determinant() - 1.0).abs() < 1e-15);
    }
}

#[test]
fn px4_and_ros_agree_on_a_tanker_ahead_of_a_receiver_that_flies_east() {
    // FLU, ENU: heading east is the identity. FRD, NED: heading east is a yaw of 90 degrees.
    let flu_from_tanker = PoseEstimate {
        b_from_a: Isometry3::new(Vector3::new(20.0, 1.0, 3.0), Vector3::zeros()),
        covariance: PoseCovariance(Matrix6::identity()),
    };
    let attitude = |local_from_b| LocalAttitude {
        local_from_b,
        covariance: Matrix3::identity() * 1e-4,
        rate_in_b: Vector3::zeros(),
        rate_covariance: Matrix3::zeros(),
    };
    let ros = flu_from_tanker.in_local_axes(&attitude(UnitQuaternion::identity()));
    let east = UnitQuaternion::from_axis_angle(&Vector3::z_axis(), std::f64::consts::FRAC_PI_2);
    let px4 = flu_from_tanker
        .seen_from(&rotation_only(&frd_from_flu()))
        .in_local_axes(&attitude(east));
    // Left of east is north.
    let expected = Vector3::new(1.0, 20.0, -3.0);
    assert!((px4.b_from_a.translation.vector - expected).norm() < ROUNDING);
    let translated = ros.seen_from(&rotation_only(&ned_from_enu()));
    assert!(pose_error(&translated.b_from_a, &px4.b_from_a).norm() < ROUNDING);
    assert!((translated.covariance.0 - px4.covariance.0).amax() < ROUNDING);
    // 20 m ahead and 3 m above, 10 mrad of attitude move it by 0.2 m and 0.03 m to the side.
    assert!((ros.covariance.0[(1, 1)] - (1.0 + 0.04 + 0.0009)).abs() < ROUNDING);
}
