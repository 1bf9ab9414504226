//! The two formulas of the filter: how a motion goes on, and what a measured pose teaches about it.
//!
//! The error is that of [`Motion::covariance`], so position and attitude error stand on the left and
//! apart. With `Σ` in blocks of six, `A` of the pose, `C` of the rates, `B` between:
//!
//! | step | formula |
//! |---|---|
//! | predict | `t + v dt`, `Exp(ω dt) R`; `Φ = diag(I, Exp(ω dt))`, `Γ = dt · diag(I, J(ω dt))` |
//! | noise | white acceleration of density `q`: `q dt³/3` in `A`, `q dt²/2` in `B`, `q dt` in `C` |
//! | innovation | `ν = (t_m − t, Log(R_m Rᵀ))`, `S = A + N`, `N` the measurement's covariance seen at `ν` |
//! | update | Joseph's form, with `I − A S⁻¹` written as `N S⁻¹`: no difference of large numbers |

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use super::symmetric6::{Factor, rows};
use crate::geometry::{Motion, PoseCovariance, left_jacobian, left_jacobian_inverse, pose_error};

/// Two-sided spectral densities, squared: what each second adds to a variance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Noise {
    /// m²/s³.
    pub(super) acceleration: f64,
    /// rad²/s³.
    pub(super) angular_acceleration: f64,
}

impl Noise {
    /// Returns the noise with its densities (not their squares) multiplied.
    pub(super) fn times(&self, factor: f64) -> Self {
        Self {
            acceleration: self.acceleration * factor * factor,
            angular_acceleration: self.angular_acceleration * factor * factor,
        }
    }
}

/// `Σ` in blocks.
struct Blocks {
    pose: Matrix6<f64>,
    cross: Matrix6<f64>,
    rates: Matrix6<f64>,
}

impl Blocks {
    fn of(motion: &Motion) -> Self {
        let block = |row, column| {
            motion
                .covariance
                .fixed_view::<6, 6>(row, column)
                .into_owned()
        };
        Self {
            pose: block(0, 0),
            cross: block(0, 6),
            rates: block(6, 6),
        }
    }

    fn store(&self, motion: &mut Motion) {
        let mut put = |row, column, block: &Matrix6<f64>| {
            motion
                .covariance
                .fixed_view_mut::<6, 6>(row, column)
                .copy_from(block);
        };
        put(0, 0, &symmetric(&self.pose));
        put(0, 6, &self.cross);
        put(6, 0, &self.cross.transpose());
        put(6, 6, &symmetric(&self.rates));
    }
}

impl Blocks {
    fn is_positive_definite(&self) -> bool {
        let schur =
            |factor: Factor| self.rates - self.cross.transpose() * (factor.inverse() * self.cross);
        Factor::new(&rows(&self.pose))
            .map(schur)
            .is_some_and(|rest| Factor::new(&rows(&rest)).is_some())
    }
}

fn symmetric(m: &Matrix6<f64>) -> Matrix6<f64> {
    (m + m.transpose()) * 0.5
}

/// Returns `diag(I, r) m`: only attitudes turn.
fn turn_rows(mut m: Matrix6<f64>, r: &Matrix3<f64>) -> Matrix6<f64> {
    let turned = r * m.fixed_rows::<3>(3);
    m.fixed_rows_mut::<3>(3).copy_from(&turned);
    m
}

/// Returns `m diag(I, r)ᵀ`.
fn turn_columns(mut m: Matrix6<f64>, r: &Matrix3<f64>) -> Matrix6<f64> {
    let turned = m.fixed_columns::<3>(3) * r.transpose();
    m.fixed_columns_mut::<3>(3).copy_from(&turned);
    m
}

/// Returns `motion` after `dt_s ≥ 0`.
pub(super) fn predict(motion: &Motion, dt_s: f64, noise: &Noise) -> Motion {
    let turn = motion.rate_in_b * dt_s;
    let turned = UnitQuaternion::from_scaled_axis(turn);
    let phi = turned.to_rotation_matrix().into_inner();
    let gamma = left_jacobian(turn);

    let before = Blocks::of(motion);
    let kept = turn_rows(before.cross, &phi);
    let gained = turn_rows(before.rates, &gamma) * dt_s;
    let crossed = turn_columns(kept, &gamma) * dt_s;
    let after = Blocks {
        pose: turn_columns(turn_rows(before.pose, &phi), &phi)
            + crossed
            + crossed.transpose()
            + turn_columns(gained, &gamma) * dt_s,
        cross: kept + gained,
        rates: before.rates,
    };
    let mut predicted = *motion;
    predicted.b_from_a = Isometry3::from_parts(
        Translation3::from(motion.b_from_a.translation.vector + motion.velocity_in_b * dt_s),
        // Products of unit quaternions drift from length one by rounding.
        UnitQuaternion::new_normalize((turned * motion.b_from_a.rotation).into_inner()),
    );
    after.store(&mut predicted);
    add_noise(&mut predicted, dt_s, noise);
    predicted
}

/// Adds what white noise of acceleration leaves after `time_s`.
pub(super) fn add_noise(motion: &mut Motion, time_s: f64, noise: &Noise) {
    let covariance = &mut motion.covariance;
    for axis in 0..6 {
        let q = if axis < 3 {
            noise.acceleration
        } else {
            noise.angular_acceleration
        };
        let crossed = q * time_s.powi(2) / 2.0;
        covariance[(axis, axis)] += q * time_s.powi(3) / 3.0;
        covariance[(axis, 6 + axis)] += crossed;
        covariance[(6 + axis, axis)] += crossed;
        covariance[(6 + axis, 6 + axis)] += q * time_s;
    }
}

/// A measured pose held against a prediction.
pub(super) struct Innovation {
    /// `ν`.
    difference: Vector6<f64>,
    /// `N`.
    noise: Matrix6<f64>,
    /// `S⁻¹`.
    inverse: Matrix6<f64>,
    /// The square root of `S⁻¹`, times `ν`: white and of unit variance when the model is right.
    pub(super) whitened: Vector6<f64>,
    /// `νᵀ S⁻¹ ν`.
    pub(super) squared: f64,
}

impl Innovation {
    /// Returns `None` when the covariances are so far apart that their sum has no factor.
    pub(super) fn new(
        predicted: &Motion,
        b_from_a: &Isometry3<f64>,
        covariance: &PoseCovariance,
    ) -> Option<Self> {
        let difference = pose_error(b_from_a, &predicted.b_from_a);
        // The measurement's own error turns with the attitude between the two: Log(Exp(n) Exp(φ)).
        let turn = left_jacobian_inverse(difference.fixed_rows::<3>(3).into_owned());
        let noise = symmetric(&turn_columns(turn_rows(covariance.0, &turn), &turn));
        let factor = Factor::new(&rows(&(predicted.pose_covariance().0 + noise)))?;
        let whitened = Vector6::from(factor.whiten(&difference.into()));
        let squared = whitened.norm_squared();
        squared.is_finite().then_some(Self {
            difference,
            noise,
            inverse: factor.inverse(),
            whitened,
            squared,
        })
    }

    /// Returns the motion corrected by the measurement; `None` when its covariance would not be positive
    /// definite.
    pub(super) fn corrected(&self, predicted: &Motion) -> Option<Motion> {
        let before = Blocks::of(predicted);
        // Transposed gains, S⁻¹ A and S⁻¹ B, and (I − A S⁻¹)ᵀ = S⁻¹ N.
        let pose_gain_t = self.inverse * before.pose;
        let rates_gain_t = self.inverse * before.cross;
        let rest_t = self.inverse * self.noise;
        let rest = rest_t.transpose();
        let mut after = Blocks {
            pose: rest * before.pose * rest_t + pose_gain_t.transpose() * self.noise * pose_gain_t,
            cross: rest * before.cross,
            rates: before.rates - before.cross.transpose() * rates_gain_t,
        };

        let pose_step = pose_gain_t.tr_mul(&self.difference);
        let rates_step = rates_gain_t.tr_mul(&self.difference);
        let turn: Vector3<f64> = pose_step.fixed_rows::<3>(3).into_owned();
        // What is left of the error now stands about the corrected attitude.
        let reset = left_jacobian(turn);
        after.pose = turn_columns(turn_rows(after.pose, &reset), &reset);
        after.cross = turn_rows(after.cross, &reset);

        let mut corrected = *predicted;
        corrected.b_from_a = Isometry3::from_parts(
            Translation3::from(
                predicted.b_from_a.translation.vector + pose_step.fixed_rows::<3>(0),
            ),
            UnitQuaternion::new_normalize(
                (UnitQuaternion::from_scaled_axis(turn) * predicted.b_from_a.rotation).into_inner(),
            ),
        );
        corrected.velocity_in_b += rates_step.fixed_rows::<3>(0);
        corrected.rate_in_b += rates_step.fixed_rows::<3>(3);
        after.store(&mut corrected);
        after.is_positive_definite().then_some(corrected)
    }
}
