//! The formulas of the filter: prediction of a motion, and correction by a measured pose.
//!
//! The error is that of [`Motion::covariance`], with position and attitude error on the left and separate. With `Σ` in
//! blocks of six, `A` for the pose, `C` for the rates, `B` for their coupling:
//!
//! | step | formula |
//! |---|---|
//! | predict | `t + v dt`, `Exp(ω dt) R`; `Φ = diag(I, Exp(ω dt))`, `Γ = dt · diag(I, J(ω dt))` |
//! | noise | white acceleration of density `q`: `q dt³/3` in `A`, `q dt²/2` in `B`, `q dt` in `C` |
//! | innovation | `ν = (t_m − t, Log(R_m Rᵀ))`, `S = A + N`, `N` the measurement's covariance at `ν` |
//! | update | Joseph form, with `I − A S⁻¹` written as `N S⁻¹`: no difference of large numbers |

use nalgebra::{Isometry3, Matrix3, Matrix6, Translation3, UnitQuaternion, Vector3, Vector6};

use super::symmetric6::{Factor, rows};
use crate::geometry::{Motion, PoseCovariance, left_jacobian, left_jacobian_inverse, pose_error};

/// Two-sided spectral densities, squared: the increase of a variance per second.
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

pub(super) fn symmetric(m: &Matrix6<f64>) -> Matrix6<f64> {
    (m + m.transpose()) * 0.5
}

/// Returns `diag(I, r) m`: only attitudes are rotated.
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

/// Returns `diag(I, r) v`: only attitudes are rotated.
pub(super) fn turned(v: &Vector6<f64>, r: &Matrix3<f64>) -> Vector6<f64> {
    let mut turned = *v;
    turned
        .fixed_rows_mut::<3>(3)
        .copy_from(&(r * v.fixed_rows::<3>(3)));
    turned
}

/// Propagation of errors of the pose: `Φ` and `Γ`.
pub(super) struct Transition {
    dt_s: f64,
    turn: UnitQuaternion<f64>,
    phi: Matrix3<f64>,
    gamma: Matrix3<f64>,
}

impl Transition {
    pub(super) fn new(motion: &Motion, dt_s: f64) -> Self {
        let by = motion.rate_in_b * dt_s;
        let turn = UnitQuaternion::from_scaled_axis(by);
        Self {
            dt_s,
            turn,
            phi: turn.to_rotation_matrix().into_inner(),
            gamma: left_jacobian(by),
        }
    }

    /// Returns the error of the pose after the step, from errors of pose, and of velocity and rate, before it.
    pub(super) fn of_pose(&self, pose: &Vector6<f64>, rates: &Vector6<f64>) -> Vector6<f64> {
        turned(pose, &self.phi) + turned(rates, &self.gamma) * self.dt_s
    }
}

/// Returns `motion` predicted by `dt_s ≥ 0`.
pub(super) fn predict(motion: &Motion, dt_s: f64, noise: &Noise) -> Motion {
    advance(motion, &Transition::new(motion, dt_s), noise)
}

/// Returns `motion` after a transition that was made for it.
pub(super) fn advance(motion: &Motion, transition: &Transition, noise: &Noise) -> Motion {
    let Transition {
        dt_s,
        turn,
        phi,
        gamma,
    } = *transition;
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
        // The norm of products of unit quaternions drifts by rounding.
        UnitQuaternion::new_normalize((turn * motion.b_from_a.rotation).into_inner()),
    );
    after.store(&mut predicted);
    add_noise(&mut predicted, dt_s, noise);
    predicted
}

/// Adds the effect of white noise of acceleration over `time_s`.
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

/// Sums over all lasting causes: `U` their covariance with the motion, `B` their shifts of the measured pose,
/// `W = H U + B` their effect on the innovation.
pub(super) struct LastingSums {
    /// `W Wᵀ`.
    pub(super) seen: Matrix6<f64>,
    /// `W Uᵀ`, of the pose.
    pub(super) seen_pose: Matrix6<f64>,
    /// `W Uᵀ`, of velocity and rate.
    pub(super) seen_rates: Matrix6<f64>,
    /// `W Bᵀ`.
    pub(super) seen_shift: Matrix6<f64>,
}

/// A corrected motion, with the gains.
pub(super) struct Correction {
    pub(super) motion: Motion,
    /// `K` of the pose, transposed.
    pub(super) pose_gain_t: Matrix6<f64>,
    /// `K` of velocity and rate, transposed.
    pub(super) rates_gain_t: Matrix6<f64>,
    /// Converts errors of the attitude to errors about the corrected one.
    pub(super) reset: Matrix3<f64>,
}

/// A measured pose compared with a prediction.
pub(super) struct Innovation {
    /// `ν`.
    difference: Vector6<f64>,
    /// `N`.
    noise: Matrix6<f64>,
    /// `S⁻¹`.
    inverse: Matrix6<f64>,
    /// The square root of `S⁻¹`, times `ν`: white and of unit variance if the model is right.
    pub(super) whitened: Vector6<f64>,
    /// `νᵀ S⁻¹ ν`.
    pub(super) squared: f64,
}

/// The difference of a measured pose from a predicted one.
pub(super) struct Difference {
    /// `ν`.
    by: Vector6<f64>,
    /// Rotates the measurement's error by the attitude between the two: `Log(Exp(n) Exp(φ))`.
    pub(super) turn: Matrix3<f64>,
}

impl Difference {
    pub(super) fn new(predicted: &Motion, b_from_a: &Isometry3<f64>) -> Self {
        let by = pose_error(b_from_a, &predicted.b_from_a);
        Self {
            by,
            turn: left_jacobian_inverse(by.fixed_rows::<3>(3).into_owned()),
        }
    }
}

impl Innovation {
    /// Returns `None` if the covariances differ so much in size that their sum cannot be factored.
    ///
    /// # Inputs
    /// * `covariance`: of the predicted pose, given the lasting causes.
    /// * `noise`: covariance of the measured pose, given the lasting causes.
    /// * `lasting`: sums over the lasting causes; `None` without any.
    pub(super) fn new(
        difference: &Difference,
        covariance: &PoseCovariance,
        noise: &PoseCovariance,
        lasting: Option<&LastingSums>,
    ) -> Option<Self> {
        let turn = &difference.turn;
        let noise = symmetric(&turn_columns(turn_rows(noise.0, turn), turn));
        let mut sum = covariance.0 + noise;
        if let Some(sums) = lasting {
            sum += symmetric(&sums.seen);
        }
        let factor = Factor::new(&rows(&sum))?;
        let whitened = Vector6::from(factor.whiten(&difference.by.into()));
        let squared = whitened.norm_squared();
        squared.is_finite().then_some(Self {
            difference: difference.by,
            noise,
            inverse: factor.inverse(),
            whitened,
            squared,
        })
    }

    /// Returns the motion corrected by the measurement; `None` if its covariance would not be positive definite.
    /// Covariances of motions are those given the lasting causes.
    pub(super) fn correct(
        &self,
        predicted: &Motion,
        lasting: Option<&LastingSums>,
    ) -> Option<Correction> {
        let before = Blocks::of(predicted);
        // Transposed gains, S⁻¹ A and S⁻¹ B, and (I − A S⁻¹)ᵀ = S⁻¹ N; with causes their terms are added.
        let mut pose_gain_t = self.inverse * before.pose;
        let mut rates_gain_t = self.inverse * before.cross;
        let mut rest_t = self.inverse * self.noise;
        if let Some(sums) = lasting {
            pose_gain_t += self.inverse * sums.seen_pose;
            rates_gain_t += self.inverse * sums.seen_rates;
            rest_t += self.inverse * sums.seen_shift;
        }
        let rest = rest_t.transpose();
        let mut after = Blocks {
            pose: rest * before.pose * rest_t + pose_gain_t.transpose() * self.noise * pose_gain_t,
            cross: rest * before.cross,
            rates: before.rates - before.cross.transpose() * rates_gain_t,
        };
        if lasting.is_some() {
            // The gain is not optimal given the causes, so terms that cancel in the two lines above do not cancel here.
            let slipped = self.noise * rates_gain_t;
            after.cross += pose_gain_t.tr_mul(&slipped) - rest * (before.pose * rates_gain_t);
            after.rates += rates_gain_t.tr_mul(&(before.pose * rates_gain_t + slipped))
                - rates_gain_t.tr_mul(&before.cross);
        }

        let pose_step = pose_gain_t.tr_mul(&self.difference);
        let rates_step = rates_gain_t.tr_mul(&self.difference);
        let turn: Vector3<f64> = pose_step.fixed_rows::<3>(3).into_owned();
        // The remaining error is now about the corrected attitude.
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
        after.is_positive_definite().then_some(Correction {
            motion: corrected,
            pose_gain_t,
            rates_gain_t,
            reset,
        })
    }
}
