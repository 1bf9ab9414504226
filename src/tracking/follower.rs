//! What follows the error of a motion through the filter: the same recursion, for whoever needs it.

use std::fmt::Debug;

use nalgebra::{Matrix3, Matrix6, SMatrix, Vector3, Vector6};

use super::model::{BlockMotion, Correction, Difference, Innovation, Transition};
use super::settings::Checked;
use crate::geometry::Matrix12;

/// 12×6: what an error of a measured pose does to a motion.
pub type Matrix12x6 = SMatrix<f64, 12, 6>;

/// Something that goes the way of a track's error, linear as that is. It is part of what a filter believes, so it follows
/// when late frames are put in their place, when a candidate becomes the track, and when the track begins anew.
pub trait Follower: Debug + Clone + PartialEq + Default {
    /// What a frame says to it.
    type Input: Debug + Clone + PartialEq + Default;

    /// Begins with the frame that a candidate begins with. What it has been before is of another track.
    fn begin(&mut self, input: &Self::Input);

    /// Goes on by a frame that corrects the motion: becomes what `before` is afterwards. What it has been itself has no
    /// meaning; its memory may be used again.
    fn follow(&mut self, before: &Self, step: &Step, input: &Self::Input);

    /// Becomes a copy of another, in its own memory.
    fn copy_from(&mut self, other: &Self) {
        self.clone_from(other);
    }
}

/// Nothing follows.
impl Follower for () {
    type Input = ();

    fn begin(&mut self, (): &()) {}

    fn follow(&mut self, (): &Self, _: &Step, (): &()) {}
}

/// One correction of a motion, as errors go through it: with `ε` found minus true before it and `n` that of the measured
/// pose, the error after it is `R ((1 − K H) F ε + K T n)`, in the order of [`Motion`](crate::geometry::Motion).
pub struct Step<'a> {
    pub(super) dt_s: f64,
    pub(super) transition: &'a Transition,
    pub(super) difference: &'a Difference,
    pub(super) innovation: &'a Innovation,
    pub(super) predicted: &'a BlockMotion,
    pub(super) correction: &'a Correction,
    pub(super) checked: &'a Checked,
}

impl Step<'_> {
    /// Returns the time since the last correction, s.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        self.dt_s
    }

    /// Returns `F`: from errors at the last correction to those of the prediction.
    #[must_use]
    pub fn transition(&self) -> Matrix12 {
        self.transition.matrix()
    }

    /// Returns `K`.
    #[must_use]
    pub fn gain(&self) -> Matrix12x6 {
        let mut gain = Matrix12x6::zeros();
        let correction = self.correction;
        gain.fixed_view_mut::<6, 6>(0, 0)
            .copy_from(&correction.pose_gain);
        gain.fixed_view_mut::<6, 6>(6, 0)
            .copy_from(&correction.rates_gain);
        gain
    }

    /// Returns `R K T`: what an error of the measured pose does.
    #[must_use]
    pub fn of_measured(&self) -> Matrix12x6 {
        let turn = self.difference.turn;
        let mut gain = self.reset() * self.gain();
        let turned = gain.fixed_view::<12, 3>(0, 3) * turn;
        gain.fixed_view_mut::<12, 3>(0, 3).copy_from(&turned);
        gain
    }

    /// Returns `R (1 − K H) F`: what is left of errors from before.
    #[must_use]
    pub fn kept(&self) -> Matrix12 {
        let transition = self.transition();
        let pose = transition.fixed_rows::<6>(0).into_owned();
        self.reset() * (transition - self.gain() * pose)
    }

    /// Returns `R`.
    #[must_use]
    pub fn reset(&self) -> Matrix12 {
        let mut reset = Matrix12::identity();
        reset
            .fixed_view_mut::<3, 3>(3, 3)
            .copy_from(&self.correction.reset);
        reset
    }

    /// Returns `T`, which turns errors of the measured attitude to such as are about the predicted one.
    #[must_use]
    pub fn measured_turn(&self) -> Matrix3<f64> {
        self.difference.turn
    }

    /// Returns `ν`, measured minus predicted.
    #[must_use]
    pub fn innovation(&self) -> Vector6<f64> {
        self.innovation.difference
    }

    /// Returns a covariance that is at least that of `ν`.
    #[must_use]
    pub fn innovation_covariance(&self) -> Matrix6<f64> {
        self.innovation.covariance
    }

    /// Returns the covariance of the measured pose given the lasting causes, about the predicted attitude.
    #[must_use]
    pub fn noise(&self) -> Matrix6<f64> {
        self.innovation.noise
    }

    /// Returns the covariance of the prediction given the lasting causes.
    #[must_use]
    pub fn predicted_covariance(&self) -> Matrix12 {
        self.predicted.covariance.whole()
    }

    /// Returns the covariance after the correction, given the lasting causes.
    #[must_use]
    pub fn corrected_covariance(&self) -> Matrix12 {
        self.correction.motion.covariance.whole()
    }

    /// Returns velocity and rate after the correction.
    #[must_use]
    pub fn rates(&self) -> (Vector3<f64>, Vector3<f64>) {
        let motion = &self.correction.motion;
        (motion.velocity_in_b, motion.rate_in_b)
    }

    /// Returns the variances of velocity, (m/s)², and rate, (rad/s)², on each axis with which a track begins.
    #[must_use]
    pub fn initial_rates_variance(&self) -> (f64, f64) {
        let checked = self.checked;
        (
            checked.initial_speed_variance,
            checked.initial_rate_variance,
        )
    }
}
