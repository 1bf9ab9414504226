use nalgebra::{Isometry3, Matrix3, Matrix6, Point3, Rotation3, SMatrix, UnitQuaternion, Vector3};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};
use statrs::distribution::{ContinuousCDF, Normal};

use super::{Envelope, EnvelopeError, EnvelopeState, RefuellingGeometry, Region};
use crate::frames::{flu_from_optical, rotation_only};
use crate::geometry::{Matrix12, Motion, PoseCovariance, Vector12};

const CONTACT: Region = Region::Cylinder {
    min_x_m: -0.2,
    max_x_m: 0.5,
    radius_m: 0.3,
};
const PRE_CONTACT: Region = Region::Box {
    min: Vector3::new(-0.5, -2.0, -2.0),
    max: Vector3::new(10.0, 2.0, 2.0),
};
/// What `Region::probability` promises for nearly singular covariances.
const ACCURACY: f64 = 1e-4;
/// And for all others.
const USUAL_ACCURACY: f64 = 2e-6;

/// A camera two metres above and behind the nose, looking up by ten degrees, probe to the right.
fn geometry() -> RefuellingGeometry {
    let tilt = Rotation3::from_euler_angles(0.0, -10.0_f64.to_radians(), 0.0);
    let mut receiver_from_camera = rotation_only(&(tilt * flu_from_optical()));
    receiver_from_camera.translation.vector = Vector3::new(-2.0, 0.0, 2.0);
    RefuellingGeometry {
        receiver_from_camera,
        mount_covariance: PoseCovariance(Matrix6::from_diagonal(&nalgebra::Vector6::new(
            4e-6, 1e-6, 2e-6, 1e-6, 3e-6, 2e-6,
        ))),
        probe_tip_in_receiver: Point3::new(1.0, -1.5, 0.5),
        receptacle_in_tanker: Point3::new(-6.0, 0.5, -1.0),
        receptacle_covariance: Matrix3::from_diagonal(&Vector3::new(1e-4, 4e-4, 9e-4)),
    }
}

fn motion(random: &mut ChaCha8Rng) -> Motion {
    let half = Matrix12::from_fn(|_, _| random.random_range(-1e-3..1e-3));
    Motion {
        b_from_a: Isometry3::new(Vector3::new(0.3, -4.0, 14.0), Vector3::new(1.2, -1.2, 1.2)),
        velocity_in_b: Vector3::new(0.1, -0.2, -0.8),
        rate_in_b: Vector3::new(0.02, -0.03, 0.01),
        covariance: half * half.transpose() + Matrix12::identity() * 1e-6,
    }
}

fn normal<const N: usize>(random: &mut ChaCha8Rng) -> nalgebra::SVector<f64, N> {
    nalgebra::SVector::from_fn(|_, _| StandardNormal.sample(random))
}

#[test]
fn position_and_velocity_of_the_receptacle_have_the_covariance_of_samples() {
    const SAMPLES: usize = 40_000;
    // Sampling errors allowed, and what the second order leaves of a standard deviation.
    const LIMIT: f64 = 5.0;
    const SECOND_ORDER: f64 = 0.01;
    let mut random = ChaCha8Rng::seed_from_u64(1);
    let geometry = geometry();
    let found = motion(&mut random);
    let expected = geometry.receptacle(&found);
    let root = found.covariance.cholesky().expect("positive definite").l();
    let mount_root = geometry.mount_covariance.0.map(f64::sqrt);
    let swing_root = geometry.receptacle_covariance.map(f64::sqrt);
    let turn = |v: Vector3<f64>| UnitQuaternion::from_scaled_axis(v);

    let mut sampled = SMatrix::<f64, 6, 6>::zeros();
    for _ in 0..SAMPLES {
        // A truth by rigid geometry, without any of the code under test.
        let e: Vector12 = root * normal::<12>(&mut random);
        let m = mount_root * normal::<6>(&mut random);
        let receptacle =
            geometry.receptacle_in_tanker.coords + swing_root * normal::<3>(&mut random);
        let rotation = turn(e.fixed_rows::<3>(3).into_owned()) * found.b_from_a.rotation;
        let arm = rotation * receptacle;
        let in_camera = found.b_from_a.translation.vector + e.fixed_rows::<3>(0) + arm;
        // The swing is a position, not a velocity: the velocity is that of the nominal point.
        let nominal_arm = rotation * geometry.receptacle_in_tanker.coords;
        let rate = found.rate_in_b + e.fixed_rows::<3>(9);
        let velocity = found.velocity_in_b + e.fixed_rows::<3>(6) + rate.cross(&nominal_arm);
        let mount =
            turn(m.fixed_rows::<3>(3).into_owned()) * geometry.receiver_from_camera.rotation;
        let position = mount * in_camera
            + geometry.receiver_from_camera.translation.vector
            + m.fixed_rows::<3>(0)
            - geometry.probe_tip_in_receiver.coords;
        let mut error = nalgebra::Vector6::zeros();
        error
            .fixed_rows_mut::<3>(0)
            .copy_from(&(position - expected.receptacle_from_probe));
        error
            .fixed_rows_mut::<3>(3)
            .copy_from(&(mount * velocity - expected.velocity_in_receiver));
        sampled += error * error.transpose() / SAMPLES as f64;
    }
    let covariance = expected.covariance;
    for i in 0..6 {
        for j in 0..6 {
            let product = covariance[(i, i)] * covariance[(j, j)];
            let error = ((product + covariance[(i, j)].powi(2)) / SAMPLES as f64).sqrt();
            let difference = (sampled[(i, j)] - covariance[(i, j)]).abs();
            let allowed = LIMIT * error + SECOND_ORDER * product.sqrt();
            assert!(
                difference < allowed,
                "({i}, {j}): {difference:e} > {allowed:e}"
            );
        }
    }
}

#[test]
fn a_tanker_straight_ahead_is_where_the_drawings_put_it() {
    let mut geometry = geometry();
    geometry.receiver_from_camera = rotation_only(&flu_from_optical());
    geometry.receiver_from_camera.translation.vector = Vector3::new(-2.0, 0.0, 2.0);
    // Aligned airframes, the tanker's origin 20 m ahead of the camera, closing at 0.5 m/s.
    let found = Motion {
        b_from_a: Isometry3::from_parts(
            Vector3::new(0.0, 0.0, 20.0).into(),
            UnitQuaternion::from_rotation_matrix(&flu_from_optical().inverse()),
        ),
        velocity_in_b: Vector3::new(0.0, 0.0, -0.5),
        rate_in_b: Vector3::zeros(),
        covariance: Matrix12::identity() * 1e-4,
    };
    let estimate = geometry.receptacle(&found);
    // -2 + 20 - 6 - 1, 0 + 0.5 + 1.5, 2 - 1 - 0.5
    let expected = Vector3::new(11.0, 2.0, 0.5);
    assert!((estimate.receptacle_from_probe - expected).norm() < 1e-12);
    let closing = estimate.closing_speed_mps();
    assert!((closing.value - 0.5).abs() < 1e-12);
    // The rate's error on the arm of 1 m below, that of the speed, and the mount's turn of 0.
    assert!((closing.sigma - (1e-4 * (1.0 + 1.0 + 0.25_f64)).sqrt()).abs() < 1e-9);
    assert!((estimate.distance_ahead_m().value - 11.0).abs() < 1e-12);
}

#[test]
fn geometries_that_cannot_be_are_named() {
    assert_eq!(geometry().check(), Ok(()));
    let mut wrong = geometry();
    wrong.mount_covariance.0[(2, 2)] = -1e-6;
    assert_eq!(
        wrong.check().expect_err("negative").to_string(),
        "mount_covariance: expected a finite, symmetric matrix without negative variances"
    );
    let mut wrong = geometry();
    wrong.probe_tip_in_receiver.y = f64::NAN;
    assert_eq!(
        wrong.check().expect_err("NaN").what,
        "probe_tip_in_receiver"
    );
    let mut certain = geometry();
    certain.mount_covariance = PoseCovariance(Matrix6::zeros());
    certain.receptacle_covariance = Matrix3::zeros();
    assert_eq!(certain.check(), Ok(()));
}

#[test]
fn probabilities_agree_with_closed_forms() {
    let law = Normal::standard();
    let sigmas = Vector3::new(0.3, 1.1, 0.02);
    let covariance = Matrix3::from_diagonal(&sigmas.component_mul(&sigmas));
    let mean = Vector3::new(0.1, -1.7, 1.99);
    // Independent axes in a box: the product of three shares.
    let Region::Box { min, max } = PRE_CONTACT else {
        unreachable!()
    };
    let expected: f64 = (0..3)
        .map(|i| law.cdf((max[i] - mean[i]) / sigmas[i]) - law.cdf((min[i] - mean[i]) / sigmas[i]))
        .product();
    let found = PRE_CONTACT.probability(&mean, &covariance);
    assert!(
        (found - expected).abs() < USUAL_ACCURACY,
        "{found} {expected}"
    );

    // A round distribution on the axis of a cylinder: Rayleigh's.
    for sigma in [1e-5, 0.01, 0.1, 0.3, 1.0, 30.0] {
        let mean = Vector3::new(0.4, 0.0, 0.0);
        let found = CONTACT.probability(&mean, &(Matrix3::identity() * sigma * sigma));
        let along = law.cdf(0.1 / sigma) - law.cdf(-0.6 / sigma);
        let across = 1.0 - (-0.5 * (0.3_f64 / sigma).powi(2)).exp();
        assert!(
            (found - along * across).abs() < USUAL_ACCURACY,
            "sigma {sigma}: {found} {}",
            along * across
        );
    }
}

#[test]
fn a_long_cylinder_has_rayleighs_share_however_x_correlates() {
    let long = Region::Cylinder {
        min_x_m: -1e3,
        max_x_m: 1e3,
        radius_m: 0.3,
    };
    for sigma in [0.02, 0.2, 2.0] {
        for own in [1e-4, 1e-2, 1.0] {
            // x follows y and z, up to `own`.
            let half = Matrix3::new(own, 3.0, -1.0, 0.0, sigma, 0.0, 0.0, 0.0, sigma);
            let found = long.probability(&Vector3::zeros(), &(half * half.transpose()));
            let expected = 1.0 - (-0.5 * (0.3_f64 / sigma).powi(2)).exp();
            assert!(
                (found - expected).abs() < ACCURACY,
                "{sigma} {own}: {found} {expected}"
            );
        }
    }
}

#[test]
fn a_slab_has_the_share_of_one_axis_however_the_others_correlate() {
    const WIDE_M: f64 = 1e3;
    let law = Normal::standard();
    let mut random = ChaCha8Rng::seed_from_u64(3);
    let mut worst = 0.0_f64;
    for trial in 0..600_u32 {
        let thinner = 0.1_f64.powi((trial % 5).cast_signed());
        let thinness = Vector3::new(1.0, thinner, thinner * thinner);
        let half = Matrix3::from_fn(|_, column| thinness[column] * random.random_range(-1.0..1.0));
        let covariance = half * half.transpose();
        let mean = Vector3::from_fn(|_, _| random.random_range(-0.5..0.5));
        for axis in 0..3 {
            let (mut min, mut max) = (Vector3::repeat(-WIDE_M), Vector3::repeat(WIDE_M));
            (min[axis], max[axis]) = (-0.1, 0.3);
            let sigma = covariance[(axis, axis)].sqrt();
            let expected =
                law.cdf((0.3 - mean[axis]) / sigma) - law.cdf((-0.1 - mean[axis]) / sigma);
            let found = Region::Box { min, max }.probability(&mean, &covariance);
            worst = worst.max((found - expected).abs());
        }
    }
    println!("largest error {worst:.1e}");
    assert!(worst < ACCURACY, "{worst:e}");
}

#[test]
fn probabilities_agree_with_samples() {
    const SAMPLES: u32 = 100_000;
    let mut random = ChaCha8Rng::seed_from_u64(2);
    let mut inside_some = 0;
    for trial in 0..40_u32 {
        // From round to nearly flat or linear, from a hundredth of the region to three times it.
        let scale = 10.0_f64.powf(random.random_range(-2.0..0.5));
        let thinner = 0.1_f64.powi((trial % 4).cast_signed());
        let thinness = Vector3::new(1.0, thinner, thinner * thinner);
        let half =
            Matrix3::from_fn(|_, column| scale * thinness[column] * random.random_range(-1.0..1.0));
        let covariance = half * half.transpose();
        let mean = Vector3::new(
            random.random_range(-0.4..0.7),
            random.random_range(-0.3..0.3),
            random.random_range(-0.3..0.3),
        );
        for region in [CONTACT, PRE_CONTACT] {
            let inside = (0..SAMPLES)
                .filter(|_| region.contains(&(mean + half * normal::<3>(&mut random))))
                .count();
            let sampled = inside as f64 / f64::from(SAMPLES);
            let found = region.probability(&mean, &covariance);
            // Five standard errors, by the probability under test.
            let error = (found * (1.0 - found) / f64::from(SAMPLES)).sqrt();
            assert!(
                (sampled - found).abs() < 5.0 * error + 1e-4,
                "trial {trial}, {region:?}: {sampled} {found}"
            );
            inside_some += usize::from((0.01..0.99).contains(&found));
        }
    }
    assert!(inside_some > 20, "{inside_some}");
}

#[test]
fn an_assessment_names_the_state_and_its_probabilities_add_up() {
    let envelope = Envelope::new(PRE_CONTACT, CONTACT).expect("nested");
    let covariance = Matrix3::identity() * 0.01;
    for (x, state) in [
        (0.1, EnvelopeState::Contact),
        (5.0, EnvelopeState::PreContact),
        (20.0, EnvelopeState::Outside),
    ] {
        let found = envelope.assess(&Vector3::new(x, 0.0, 0.0), &covariance);
        assert_eq!(found.state, state);
        let sum = found.outside + found.pre_contact + found.contact;
        assert!((sum - 1.0).abs() < 1e-12);
        let of_state = match state {
            EnvelopeState::Contact => found.contact,
            EnvelopeState::PreContact => found.pre_contact,
            EnvelopeState::Outside => found.outside,
        };
        assert!(of_state > 0.95, "{found:?}");
    }
    // On the very edge of the window the state is a coin's toss, and says so.
    let edge = envelope.assess(&Vector3::new(0.5, 0.0, 0.0), &(Matrix3::identity() * 1e-4));
    assert_eq!(edge.state, EnvelopeState::Contact);
    assert!((edge.contact - 0.5).abs() < USUAL_ACCURACY);
    let unknown = envelope.assess(&Vector3::zeros(), &Matrix3::from_element(f64::NAN));
    assert!(unknown.contact.is_nan() && unknown.outside.is_nan());
}

#[test]
fn regions_that_enclose_nothing_or_each_other_wrongly_are_refused() {
    let flat = Region::Cylinder {
        min_x_m: 1.0,
        max_x_m: 1.0,
        radius_m: 0.3,
    };
    assert_eq!(
        Envelope::new(PRE_CONTACT, flat),
        Err(EnvelopeError::EmptyRegion(flat))
    );
    assert!(matches!(
        Envelope::new(CONTACT, PRE_CONTACT),
        Err(EnvelopeError::NotNested { .. })
    ));
    // A box whose sides fit a cylinder while its corners do not.
    let square = Region::Box {
        min: Vector3::new(0.0, -0.25, -0.25),
        max: Vector3::new(0.1, 0.25, 0.25),
    };
    assert!(matches!(
        Envelope::new(CONTACT, square),
        Err(EnvelopeError::NotNested { .. })
    ));
}
