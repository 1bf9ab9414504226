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

use super::matrix6::{symmetric, times, times_vector, turn_columns, turn_rows};
use super::symmetric6::{Factor, rows};
use crate::geometry::{Matrix12, Motion, left_jacobian, left_jacobian_inverse, pose_error};

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
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Blocks {
    pub(super) pose: Matrix6<f64>,
    pub(super) cross: Matrix6<f64>,
    pub(super) rates: Matrix6<f64>,
}

impl Blocks {
    fn of(covariance: &Matrix12) -> Self {
        let block = |row, column| covariance.fixed_view::<6, 6>(row, column).into_owned();
        Self {
            pose: block(0, 0),
            cross: block(0, 6),
            rates: block(6, 6),
        }
    }

    pub(super) fn whole(&self) -> Matrix12 {
        let mut covariance = Matrix12::zeros();
        let mut put = |row, column, block: &Matrix6<f64>| {
            covariance
                .fixed_view_mut::<6, 6>(row, column)
                .copy_from(block);
        };
        put(0, 0, &self.pose);
        put(0, 6, &self.cross);
        put(6, 0, &self.cross.transpose());
        put(6, 6, &self.rates);
        covariance
    }

    #[inline(always)]
    fn is_positive_definite(&self) -> bool {
        Factor::new(&rows(&self.pose)).is_some_and(|factor| {
            let rest = self.rates - factor.explained(&self.cross);
            Factor::new(&rows(&rest)).is_some()
        })
    }

    /// Returns it without the rounding by which it is not symmetric.
    #[inline(always)]
    fn symmetric(&self) -> Self {
        Self {
            pose: symmetric(&self.pose),
            cross: self.cross,
            rates: symmetric(&self.rates),
        }
    }
}

/// A [`Motion`] with its covariance in blocks, as the filter computes with it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct BlockMotion {
    pub(super) b_from_a: Isometry3<f64>,
    pub(super) velocity_in_b: Vector3<f64>,
    pub(super) rate_in_b: Vector3<f64>,
    pub(super) covariance: Blocks,
}

impl BlockMotion {
    pub(super) fn of(motion: &Motion) -> Self {
        Self {
            b_from_a: motion.b_from_a,
            velocity_in_b: motion.velocity_in_b,
            rate_in_b: motion.rate_in_b,
            covariance: Blocks::of(&motion.covariance),
        }
    }

    pub(super) fn motion(&self) -> Motion {
        Motion {
            b_from_a: self.b_from_a,
            velocity_in_b: self.velocity_in_b,
            rate_in_b: self.rate_in_b,
            covariance: self.covariance.whole(),
        }
    }
}

/// Returns `diag(I, r) v`: only attitudes are rotated.
#[inline(always)]
pub(super) fn turned(v: &Vector6<f64>, r: &Matrix3<f64>) -> Vector6<f64> {
    let (r, [a, b, c, x, y, z]) = (&r.data.0, v.data.0[0]);
    let row = |row: usize| r[0][row] * x + r[1][row] * y + r[2][row] * z;
    Vector6::new(a, b, c, row(0), row(1), row(2))
}

/// Propagation of errors of the pose: `Φ` and `Γ`.
pub(super) struct Transition {
    dt_s: f64,
    turn: UnitQuaternion<f64>,
    phi: Matrix3<f64>,
    gamma: Matrix3<f64>,
}

impl Transition {
    pub(super) fn new(motion: &BlockMotion, dt_s: f64) -> Self {
        let by = motion.rate_in_b * dt_s;
        let turn = UnitQuaternion::from_scaled_axis(by);
        Self {
            dt_s,
            turn,
            phi: turn.to_rotation_matrix().into_inner(),
            gamma: left_jacobian(by),
        }
    }

    /// Returns it as a matrix of errors of the whole motion.
    pub(super) fn matrix(&self) -> Matrix12 {
        let mut matrix = Matrix12::identity();
        matrix.fixed_view_mut::<3, 3>(3, 3).copy_from(&self.phi);
        for axis in 0..3 {
            matrix[(axis, 6 + axis)] = self.dt_s;
        }
        let by_rate = self.gamma * self.dt_s;
        matrix.fixed_view_mut::<3, 3>(3, 9).copy_from(&by_rate);
        matrix
    }

    /// Returns the error of the pose after the step, from errors of pose, and of velocity and rate, before it.
    #[inline(always)]
    pub(super) fn of_pose(&self, pose: &Vector6<f64>, rates: &Vector6<f64>) -> Vector6<f64> {
        turned(pose, &self.phi) + turned(rates, &self.gamma) * self.dt_s
    }
}

/// Returns `motion` predicted by `dt_s ≥ 0`.
pub(super) fn predict(motion: &Motion, dt_s: f64, noise: &Noise) -> Motion {
    let motion = BlockMotion::of(motion);
    advance(&motion, &Transition::new(&motion, dt_s), noise).motion()
}

/// Returns `motion` after a transition that was made for it.
#[inline(always)]
pub(super) fn advance(motion: &BlockMotion, transition: &Transition, noise: &Noise) -> BlockMotion {
    let Transition {
        dt_s,
        turn,
        phi,
        gamma,
    } = *transition;
    let before = &motion.covariance;
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
    let mut predicted = BlockMotion {
        b_from_a: Isometry3::from_parts(
            Translation3::from(motion.b_from_a.translation.vector + motion.velocity_in_b * dt_s),
            // The norm of products of unit quaternions drifts by rounding.
            UnitQuaternion::new_normalize((turn * motion.b_from_a.rotation).into_inner()),
        ),
        velocity_in_b: motion.velocity_in_b,
        rate_in_b: motion.rate_in_b,
        covariance: after.symmetric(),
    };
    add_noise(&mut predicted, dt_s, noise);
    predicted
}

/// Adds the effect of white noise of acceleration over `time_s`.
#[inline(always)]
pub(super) fn add_noise(motion: &mut BlockMotion, time_s: f64, noise: &Noise) {
    let Blocks { pose, cross, rates } = &mut motion.covariance;
    for axis in 0..6 {
        let q = if axis < 3 {
            noise.acceleration
        } else {
            noise.angular_acceleration
        };
        pose[(axis, axis)] += q * time_s.powi(3) / 3.0;
        cross[(axis, axis)] += q * time_s.powi(2) / 2.0;
        rates[(axis, axis)] += q * time_s;
    }
}

/// Sums over all lasting causes: `U` their covariance with the motion, `B` their shifts of the measured pose,
/// `W = H U + B` their effect on the innovation. `W Wᵀ` is the sum of the first and the last.
pub(super) struct LastingSums {
    /// `W Uᵀ`, of the pose.
    pub(super) pose: Matrix6<f64>,
    /// `W Uᵀ`, of velocity and rate.
    pub(super) rates: Matrix6<f64>,
    /// `W Bᵀ`.
    pub(super) shift: Matrix6<f64>,
}

/// A corrected motion, with the gains.
pub(super) struct Correction {
    pub(super) motion: BlockMotion,
    /// `K` of the pose.
    pub(super) pose_gain: Matrix6<f64>,
    /// `K` of velocity and rate.
    pub(super) rates_gain: Matrix6<f64>,
    /// Converts errors of the attitude to errors about the corrected one.
    pub(super) reset: Matrix3<f64>,
}

/// A measured pose compared with a prediction.
pub(super) struct Innovation {
    /// `ν`.
    pub(super) difference: Vector6<f64>,
    /// `N`.
    pub(super) noise: Matrix6<f64>,
    /// `S`.
    pub(super) covariance: Matrix6<f64>,
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
    pub(super) fn new(predicted: &BlockMotion, b_from_a: &Isometry3<f64>) -> Self {
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
        covariance: &Matrix6<f64>,
        noise: &Matrix6<f64>,
        lasting: Option<&LastingSums>,
    ) -> Option<Self> {
        let turn = &difference.turn;
        let noise = symmetric(&turn_columns(turn_rows(*noise, turn), turn));
        let mut sum = covariance + noise;
        if let Some(sums) = lasting {
            sum += symmetric(&(sums.pose + sums.shift));
        }
        let factor = Factor::new(&rows(&sum))?;
        let whitened = Vector6::from(factor.whiten(&difference.by.into()));
        let squared = whitened.norm_squared();
        squared.is_finite().then_some(Self {
            difference: difference.by,
            noise,
            covariance: sum,
            inverse: factor.inverse(),
            whitened,
            squared,
        })
    }

    /// Returns the motion corrected by the measurement; `None` if its covariance would not be positive definite.
    /// Covariances of motions are those given the lasting causes.
    #[inline(always)]
    pub(super) fn correct(
        &self,
        predicted: &BlockMotion,
        lasting: Option<&LastingSums>,
    ) -> Option<Correction> {
        let before = &predicted.covariance;
        // Transposed gains, S⁻¹ A and S⁻¹ B, and (I − A S⁻¹)ᵀ = S⁻¹ N; with causes their terms are added.
        let (mut pose, mut cross, mut rest) = (before.pose, before.cross, self.noise);
        if let Some(sums) = lasting {
            pose += sums.pose;
            cross += sums.rates;
            rest += sums.shift;
        }
        let pose_gain_t = times(&self.inverse, &pose);
        let rates_gain_t = times(&self.inverse, &cross);
        let rest_t = times(&self.inverse, &rest);
        let (pose_gain, rates_gain) = (pose_gain_t.transpose(), rates_gain_t.transpose());
        let rest = rest_t.transpose();
        let kept = times(&rest, &before.pose);
        let added = times(&pose_gain, &self.noise);
        let mut after = Blocks {
            pose: times(&kept, &rest_t) + times(&added, &pose_gain_t),
            cross: times(&rest, &before.cross),
            rates: before.rates,
        };
        let mut learned = before.cross;
        if lasting.is_some() {
            // The gain is not optimal given the causes, so these terms do not cancel.
            after.cross += times(&(added - kept), &rates_gain_t);
            learned = learned * 2.0 - times(&(before.pose + self.noise), &rates_gain_t);
        }
        after.rates -= times(&rates_gain, &learned);

        let pose_step = times_vector(&pose_gain, &self.difference);
        let rates_step = times_vector(&rates_gain, &self.difference);
        let turn: Vector3<f64> = pose_step.fixed_rows::<3>(3).into_owned();
        // The remaining error is now about the corrected attitude.
        let reset = left_jacobian(turn);
        after.pose = turn_columns(turn_rows(after.pose, &reset), &reset);
        after.cross = turn_rows(after.cross, &reset);

        let b_from_a = Isometry3::from_parts(
            Translation3::from(
                predicted.b_from_a.translation.vector + pose_step.fixed_rows::<3>(0),
            ),
            UnitQuaternion::new_normalize(
                (UnitQuaternion::from_scaled_axis(turn) * predicted.b_from_a.rotation).into_inner(),
            ),
        );
        let after = after.symmetric();
        after.is_positive_definite().then(|| Correction {
            motion: BlockMotion {
                b_from_a,
                velocity_in_b: predicted.velocity_in_b + rates_step.fixed_rows::<3>(0),
                rate_in_b: predicted.rate_in_b + rates_step.fixed_rows::<3>(3),
                covariance: after,
            },
            pose_gain,
            rates_gain,
            reset,
        })
    }
}
