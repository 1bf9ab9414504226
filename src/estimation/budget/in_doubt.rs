//! A frame's points with their error budget: fits, and predictions of a fit from one step.

use super::frame::FrameBudget;
use super::residuals::{LensBudget, PinholeBudget};
use crate::camera::Camera;
use crate::estimation::Observation;
use crate::estimation::centred_pose::CentredPose;
use crate::estimation::lanes::four::{Arithmetic, Kernel, vectorised};
use crate::estimation::lanes::points::Points;
use crate::estimation::lanes::symmetric3::{positive_inverse, times};
use crate::estimation::refine::{self, Fit, FitFailure};
use crate::estimation::residuals::Residuals;

/// A frame's points with their error budget.
pub(crate) struct InDoubt<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) observations: &'a [Observation],
    pub(crate) points: &'a Points<'a>,
    pub(crate) budget: &'a FrameBudget,
}

impl InDoubt<'_> {
    /// Returns the maximum likelihood pose that descent from `start` reaches.
    pub(crate) fn fit(&self, start: CentredPose) -> Result<Fit, FitFailure> {
        self.run(MaximumLikelihood { start })
    }

    /// Returns chi-squared and the squared residuals, px², at a pose.
    pub(crate) fn at(&self, pose: CentredPose) -> Option<(f64, f64)> {
        self.run(At { pose })
    }

    /// Returns chi-squared as predicted after one step from a pose.
    pub(crate) fn promised(&self, pose: CentredPose) -> Option<f64> {
        self.run(Promised { pose })
    }

    /// Returns chi-squared with this attitude, at the position predicted by one step.
    pub(crate) fn with_attitude(&self, pose: CentredPose) -> Option<f64> {
        self.run(WithAttitude { pose })
    }

    /// Runs a task with storage for the number of modes: less storage takes less time to clear.
    fn run<T: Task>(&self, task: T) -> T::Output {
        match self.budget.modes() {
            0..=3 => self.run_with::<T, 3>(task),
            4..=6 => self.run_with::<T, 6>(task),
            7..=18 => self.run_with::<T, 18>(task),
            _ => self.run_with::<T, { super::MAX_MODES }>(task),
        }
    }

    fn run_with<T: Task, const K: usize>(&self, task: T) -> T::Output {
        match self.camera.pinhole() {
            Some([fx, fy, ..]) => vectorised(PinholeTask::<T, K> {
                task,
                points: self.points,
                focal: [fx, fy],
                budget: self.budget,
            }),
            None => task.run(&LensBudget::<K> {
                camera: self.camera,
                observations: self.observations,
                markers_mean: self.points.mean,
                budget: self.budget,
            }),
        }
    }
}

/// An operation on residuals of any kind.
trait Task {
    type Output;
    fn run(self, residuals: &impl Residuals) -> Self::Output;
}

struct PinholeTask<'a, T, const K: usize> {
    task: T,
    points: &'a Points<'a>,
    focal: [f64; 2],
    budget: &'a FrameBudget,
}

impl<T: Task, const K: usize> Kernel for PinholeTask<'_, T, K> {
    type Output = T::Output;

    #[inline(always)]
    fn run<A: Arithmetic>(self, arithmetic: A) -> T::Output {
        self.task.run(&PinholeBudget::<A, K> {
            arithmetic,
            points: self.points,
            focal: self.focal,
            budget: self.budget,
        })
    }
}

struct MaximumLikelihood {
    start: CentredPose,
}

impl Task for MaximumLikelihood {
    type Output = Result<Fit, FitFailure>;

    #[inline(always)]
    fn run(self, residuals: &impl Residuals) -> Self::Output {
        refine::maximum_likelihood(residuals, self.start, |failure| failure)
    }
}

struct At {
    pose: CentredPose,
}

impl Task for At {
    type Output = Option<(f64, f64)>;

    #[inline(always)]
    fn run(self, residuals: &impl Residuals) -> Self::Output {
        refine::squared_residuals(residuals, &self.pose)
    }
}

struct Promised {
    pose: CentredPose,
}

impl Task for Promised {
    type Output = Option<f64>;

    #[inline(always)]
    fn run(self, residuals: &impl Residuals) -> Self::Output {
        let here = residuals.linearise(&self.pose)?;
        let gradient = &here.slope.gradient;
        let step = here.information.solver()?.solve(gradient);
        let gain: f64 = step.iter().zip(gradient).map(|(a, b)| a * b).sum();
        Some((here.slope.chi_squared - gain).max(0.0))
    }
}

struct WithAttitude {
    pose: CentredPose,
}

impl Task for WithAttitude {
    type Output = Option<f64>;

    #[inline(always)]
    fn run(self, residuals: &impl Residuals) -> Self::Output {
        let here = residuals.linearise(&self.pose)?;
        let [.., x, y, z] = here.slope.gradient;
        let position = here.information.position;
        let inverse = positive_inverse(&position, [position[0], position[3], position[5]], 0.0)?;
        let [dx, dy, dz] = times(&inverse, [x, y, z]);
        let gain = dx * x + dy * y + dz * z;
        Some((here.slope.chi_squared - gain).max(0.0))
    }
}
