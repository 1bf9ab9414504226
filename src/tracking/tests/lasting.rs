//! Consider states against the same filter with the causes written out as states.

use nalgebra::{DMatrix, DVector, Isometry3, Matrix6, UnitQuaternion, Vector3, Vector6};
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha8Rng;

use super::super::{Filter, FilterSettings, LastingError, MeasurementError, TrackOutcome};
use super::{EPOCH_NS, FRAME_NS, covariance, pose, tracking};
use crate::geometry::{PoseCovariance, motion_error};

const DT_S: f64 = FRAME_NS as f64 / 1e9;
const CAUSES: usize = 4;

/// No manoeuvres, no gate: then the filter is linear while nothing turns.
fn settings() -> FilterSettings {
    FilterSettings {
        manoeuvre_factor: 1.0,
        gate_probability: 0.999_999_9,
        ..FilterSettings::default()
    }
}

/// The textbook's Schmidt–Kalman filter: a state of motion and causes, whose causes have no gain.
struct Augmented {
    mean: DVector<f64>,
    covariance: DMatrix<f64>,
}

impl Augmented {
    const SIZE: usize = 12 + CAUSES;

    fn start(position: &Vector6<f64>, noise: &Matrix6<f64>, shifts: &[LastingError]) -> Self {
        let mut mean = DVector::zeros(Self::SIZE);
        mean.rows_mut(0, 6).copy_from(position);
        let mut covariance = DMatrix::identity(Self::SIZE, Self::SIZE);
        let b = Self::shifts(shifts);
        let pose = noise + &b * b.transpose();
        covariance.view_mut((0, 0), (6, 6)).copy_from(&pose);
        covariance.view_mut((0, 12), (6, CAUSES)).copy_from(&-&b);
        covariance
            .view_mut((12, 0), (CAUSES, 6))
            .copy_from(&-b.transpose());
        for axis in 0..3 {
            covariance[(6 + axis, 6 + axis)] = settings().initial_speed_sigma_mps.powi(2);
            let rate = settings().initial_rate_sigma_dps.to_radians();
            covariance[(9 + axis, 9 + axis)] = rate.powi(2);
        }
        Self { mean, covariance }
    }

    fn shifts(shifts: &[LastingError]) -> DMatrix<f64> {
        let mut b = DMatrix::zeros(6, CAUSES);
        for (m, error) in shifts.iter().enumerate() {
            b.column_mut(m).copy_from(&error.shift);
        }
        b
    }

    fn predict(&mut self, shifts: &[LastingError]) {
        let mut phi = DMatrix::<f64>::identity(Self::SIZE, Self::SIZE);
        let mut noise = DMatrix::zeros(Self::SIZE, Self::SIZE);
        for axis in 0..6 {
            phi[(axis, 6 + axis)] = DT_S;
            let q = if axis < 3 {
                settings().acceleration_density_mps2.powi(2)
            } else {
                let angular = settings().angular_acceleration_density_dps2.to_radians();
                angular.powi(2)
            };
            noise[(axis, axis)] = q * DT_S.powi(3) / 3.0;
            noise[(axis, 6 + axis)] = q * DT_S.powi(2) / 2.0;
            noise[(6 + axis, axis)] = q * DT_S.powi(2) / 2.0;
            noise[(6 + axis, 6 + axis)] = q * DT_S;
        }
        for (m, error) in shifts.iter().enumerate() {
            let kept = error.time_constant_s.map_or(1.0, |tau| (-DT_S / tau).exp());
            phi[(12 + m, 12 + m)] = kept;
            noise[(12 + m, 12 + m)] = 1.0 - kept * kept;
        }
        self.mean = &phi * &self.mean;
        self.covariance = &phi * &self.covariance * phi.transpose() + noise;
    }

    fn update(&mut self, position: &Vector6<f64>, noise: &Matrix6<f64>, shifts: &[LastingError]) {
        let mut h = DMatrix::zeros(6, Self::SIZE);
        h.view_mut((0, 0), (6, 6)).copy_from(&Matrix6::identity());
        h.view_mut((0, 12), (6, CAUSES))
            .copy_from(&Self::shifts(shifts));
        let s = &h * &self.covariance * h.transpose() + noise;
        let mut gain =
            &self.covariance * h.transpose() * s.try_inverse().expect("positive definite");
        gain.view_mut((12, 0), (CAUSES, 6)).fill(0.0);
        self.mean += &gain * (position - &h * &self.mean);
        let rest = DMatrix::identity(Self::SIZE, Self::SIZE) - &gain * h;
        self.covariance =
            &rest * &self.covariance * rest.transpose() + &gain * noise * gain.transpose();
    }
}

#[test]
fn the_track_is_that_of_a_filter_with_the_causes_as_states_without_gain() {
    let mut random = ChaCha8Rng::seed_from_u64(5);
    let mut filter = Filter::new(settings()).expect("in range");
    let mut expected: Option<Augmented> = None;
    let floor = {
        let mut floor = Matrix6::zeros();
        for axis in 0..3 {
            floor[(axis, axis)] = settings().position_floor_m.powi(2);
            floor[(3 + axis, 3 + axis)] = settings().attitude_floor_deg.to_radians().powi(2);
        }
        floor
    };
    for k in 0..120 {
        // Attitudes stay as they are, so that nothing turns and both filters are linear.
        let mut errors = |size: f64| {
            let mut shift = Vector6::zeros();
            shift
                .fixed_rows_mut::<3>(0)
                .copy_from(&Vector3::from_fn(|_, _| random.random_range(-size..size)));
            shift
        };
        let mut shifts: Vec<LastingError> = (0..CAUSES as u64)
            .map(|cause| LastingError {
                cause,
                shift: errors(0.2),
                time_constant_s: (cause % 2 == 1).then_some(0.5),
            })
            .collect();
        // Sometimes a cause does nothing in a frame: it is not listed then.
        if k % 5 == 4 {
            shifts[0].shift = Vector6::zeros();
        }
        let listed = &shifts[usize::from(k % 5 == 4)..];
        let at = errors(0.05);
        let noise = Matrix6::identity() * 1e-4;
        let measured = Isometry3::from_parts(
            at.fixed_rows::<3>(0).into_owned().into(),
            UnitQuaternion::identity(),
        );
        let outcome = filter.update_with_lasting(
            EPOCH_NS + k * FRAME_NS,
            &measured,
            &PoseCovariance(noise),
            listed,
        );
        assert!(!matches!(outcome, TrackOutcome::Invalid(_)), "{outcome:?}");
        let floored = noise + floor;
        match &mut expected {
            None => expected = Some(Augmented::start(&at, &floored, &shifts)),
            Some(expected) => {
                expected.predict(&shifts);
                expected.update(&at, &floored, &shifts);
            }
        }
    }
    let (expected, found) = (
        expected.expect("frames"),
        filter.track().expect("a track").motion,
    );
    let position = found.b_from_a.translation.vector;
    assert!((position - expected.mean.rows(0, 3)).norm() < 1e-9);
    assert!((found.velocity_in_b - expected.mean.rows(6, 3)).norm() < 1e-8);
    let difference = found.covariance - expected.covariance.view((0, 0), (12, 12));
    assert!(difference.amax() < 1e-9, "{:.1e}", difference.amax());
    // The causes set a floor: without them 120 frames would be far surer.
    let mut independent = Filter::new(settings()).expect("in range");
    for k in 0..120 {
        independent.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
    }
    let alone = independent.track().expect("a track").motion;
    assert!(found.covariance[(0, 0)] > 4.0 * alone.covariance[(0, 0)]);
}

/// The definition: with a cause of one sigma in all measured poses, estimates are off by `−U`.
#[test]
fn a_column_is_what_one_sigma_of_its_cause_does_to_the_estimate_of_a_tanker_that_turns() {
    // Central differences; the step's square times the curvature is below the tolerance.
    const STEP: f64 = 1e-4;
    let shift_at = |k: i64| {
        let along = 0.02 * k as f64;
        Vector6::new(0.3, -0.2 + along, 0.5, 0.02, 0.05 - 0.1 * along, -0.03)
    };
    let flown = |sigmas: f64| {
        let mut filter = Filter::new(settings()).expect("in range");
        for k in 0..40 {
            let time_s = k as f64 * DT_S;
            let truth = Isometry3::new(
                Vector3::new(1.0 + 0.5 * time_s, -2.0, 20.0 - time_s),
                Vector3::new(0.3, -0.5, 0.9),
            );
            let turned = UnitQuaternion::from_scaled_axis(Vector3::new(0.03, -0.1, 0.06) * time_s)
                * truth.rotation;
            let shift = shift_at(k);
            let error = shift * sigmas;
            let measured = Isometry3::from_parts(
                (truth.translation.vector + error.fixed_rows::<3>(0)).into(),
                UnitQuaternion::from_scaled_axis(error.fixed_rows::<3>(3).into_owned()) * turned,
            );
            let lasting = [LastingError {
                cause: 5,
                shift,
                time_constant_s: None,
            }];
            let noise = PoseCovariance(Matrix6::from_diagonal(&Vector6::new(
                1e-4, 2e-4, 9e-4, 1e-6, 2e-6, 4e-6,
            )));
            filter.update_with_lasting(EPOCH_NS + k * FRAME_NS, &measured, &noise, &lasting);
        }
        filter
    };
    let state = |filter: &Filter| filter.track().expect("a track").motion;
    let by_cause = motion_error(&state(&flown(STEP)), &state(&flown(-STEP))) / (2.0 * STEP);
    let column = flown(0.0).lasting_column(0).expect("one cause");
    for first in [0, 3, 6, 9] {
        let block = column.fixed_rows::<3>(first);
        let difference = (by_cause + column).fixed_rows::<3>(first).norm();
        // The filter is linear in the innovation's turn, of a hundredth while the rate is being found.
        assert!(difference < 0.01 * block.norm(), "{by_cause} {column}");
    }
    assert!(column.fixed_rows::<3>(3).norm() > 0.02);
}

#[test]
fn causes_that_move_and_have_no_room_count_as_noise_too() {
    // Many small errors that last for half a second, behind as many constant ones as there is room for.
    let mut errors: Vec<LastingError> = (0..58)
        .zip((0..3).cycle())
        .map(|(cause, axis)| LastingError {
            cause,
            shift: Vector6::ith(axis, 0.05),
            time_constant_s: None,
        })
        .collect();
    errors.extend(
        (58..88)
            .zip((0..3).cycle())
            .map(|(cause, axis)| LastingError {
                cause,
                shift: Vector6::ith(axis, 0.02),
                time_constant_s: Some(0.5),
            }),
    );
    let sigma_of_speed = |errors: &[LastingError]| {
        let mut filter = Filter::new(settings()).expect("in range");
        for k in 0..300 {
            let outcome = filter.update_with_lasting(
                EPOCH_NS + k * FRAME_NS,
                &pose(0.0),
                &PoseCovariance(Matrix6::identity() * 1e-6),
                errors,
            );
            assert!(!matches!(outcome, TrackOutcome::Invalid(_)), "{outcome:?}");
        }
        filter.track().expect("a track").motion.covariance[(6, 6)].sqrt()
    };
    let (constant, all) = (sigma_of_speed(&errors[..58]), sigma_of_speed(&errors));
    assert!(all > 2.0 * constant, "{all} m/s, without them {constant}");
}

#[test]
fn a_frame_may_have_no_noise_of_its_own() {
    let mut filter = Filter::new(FilterSettings::default()).expect("in range");
    let lasting: Vec<LastingError> = (0..6)
        .zip(0..6)
        .map(|(cause, axis)| LastingError {
            cause,
            shift: Vector6::ith(axis, 0.01),
            time_constant_s: Some(1.0),
        })
        .collect();
    for k in 0..10 {
        let stamp_ns = EPOCH_NS + k * FRAME_NS;
        let none = PoseCovariance(Matrix6::zeros());
        let outcome = filter.update_with_lasting(stamp_ns, &pose(0.0), &none, &lasting);
        assert!(!matches!(outcome, TrackOutcome::Invalid(_)), "{outcome:?}");
    }
    assert!(filter.track().is_some());
}

#[test]
fn an_error_that_is_the_same_in_every_frame_stays_in_the_covariance() {
    let shift = Vector6::new(0.3, 0.0, -0.4, 0.05, 0.0, 0.0);
    let mut filter = Filter::new(FilterSettings::default()).expect("in range");
    for k in 0..600 {
        filter.update_with_lasting(
            EPOCH_NS + k * FRAME_NS,
            &pose(0.0),
            &covariance(),
            &[LastingError {
                cause: 9,
                shift,
                time_constant_s: None,
            }],
        );
    }
    let found = filter.track().expect("a track").motion.covariance;
    for (axis, sigma) in [(0, 0.3), (2, 0.4), (3, 0.05)] {
        assert!(found[(axis, axis)].sqrt() > sigma);
        assert!(found[(axis, axis)].sqrt() < 1.05 * sigma);
    }
    assert!(found[(1, 1)].sqrt() < 0.01);
    // And it says nothing about the velocity.
    let mut alone = Filter::new(FilterSettings::default()).expect("in range");
    for k in 0..600 {
        alone.update(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance());
    }
    let alone = alone.track().expect("a track").motion.covariance;
    assert!((found[(6, 6)] / alone[(6, 6)] - 1.0).abs() < 1e-3);
}

#[test]
fn more_causes_than_are_carried_singly_are_carried_together() {
    let errors = |count: u64| -> Vec<LastingError> {
        (0..count)
            .map(|cause| LastingError {
                cause,
                shift: Vector6::from_fn(|axis, _| {
                    1e-2 * ((cause as f64 + 1.0) * (axis as f64 + 1.0)).sin()
                }),
                time_constant_s: None,
            })
            .collect()
    };
    for count in [58, 59, 64, 300] {
        let errors = errors(count);
        let mut filter = Filter::new(FilterSettings::default()).expect("in range");
        for k in 0..300 {
            filter.update_with_lasting(EPOCH_NS + k * FRAME_NS, &pose(0.0), &covariance(), &errors);
        }
        let found = filter.track().expect("a track").motion.covariance;
        for axis in 0..3 {
            let floor: f64 = errors.iter().map(|error| error.shift[axis].powi(2)).sum();
            let share = found[(axis, axis)] / floor;
            assert!((1.0..1.5).contains(&share), "{count} causes: {share}");
        }
    }
}

#[test]
fn what_is_no_lasting_error_is_refused() {
    let mut filter = tracking();
    let before = filter.clone();
    let good = LastingError {
        cause: 1,
        shift: Vector6::zeros(),
        time_constant_s: None,
    };
    for wrong in [
        LastingError {
            shift: Vector6::from_element(f64::NAN),
            ..good
        },
        LastingError {
            time_constant_s: Some(0.0),
            ..good
        },
        LastingError {
            time_constant_s: Some(f64::NAN),
            ..good
        },
    ] {
        let stamp_ns = EPOCH_NS + 5 * FRAME_NS;
        let outcome =
            filter.update_with_lasting(stamp_ns, &pose(0.0), &covariance(), &[good, wrong]);
        let expected = MeasurementError::InvalidLastingError;
        assert_eq!(outcome, TrackOutcome::Invalid(expected));
    }
    assert_eq!(filter, before);
}
