//! A track with its hypotheses -> its protection levels.

use nalgebra::RowVector6;
use smallvec::SmallVec;

use super::frame::Suspects;
use super::state::{Lost, TrackSeparations};
use crate::geometry::{Matrix12, Motion, Vector12};
use crate::integrity::frame::{FrameIntegrity, Unavailable, Unmonitored};
use crate::integrity::level::Along;
use crate::integrity::monitor::IntegrityMonitor;
use crate::integrity::search::VisibleFault;

/// One axis of a point, in errors of the track at its last frame.
struct Direction {
    along: Vector12,
    /// m
    sigma_m: f64,
    /// What one sigma of each lasting cause does to the track, m.
    by_cause: Vec<f64>,
}

impl IntegrityMonitor {
    /// Returns the protection levels of a track.
    ///
    /// # Inputs
    /// * `followed`: of the track, at its last frame.
    /// * `transition`: of errors from then to the time of the motion.
    /// * `motion`: the track in use, at the time that levels are wanted for.
    ///
    /// # Errors
    /// [`Unavailable`]: no levels can be given, or a fault is visible.
    pub fn judge_track(
        &self,
        followed: &TrackSeparations,
        transition: &Matrix12,
        motion: &Motion,
    ) -> Result<FrameIntegrity, Unavailable> {
        match followed.lost {
            Some(Lost::Frame) => return Err(Unavailable::TrackNotFollowed),
            Some(Lost::TooMany) => return Err(Unavailable::TooManyHypotheses),
            None => {}
        }
        let plan = self.plan(
            followed.beacons.len(),
            followed.flex_modes,
            followed.all_modes,
        );
        let directions = self
            .directions(followed, transition, motion)
            .ok_or(Unavailable::Singular)?;
        let quantile = self.quantile(&plan);
        let mut along = Vec::with_capacity(plan.count * directions.len());
        let mut hypotheses = Vec::with_capacity(plan.count);
        let mut unmonitorable = 0.0;
        let mut fault = VisibleFault::default();
        for (suspects, separated) in &followed.hypotheses {
            let prior = self.prior(*suspects, followed.flex_modes);
            if !separated.is_known() {
                unmonitorable += prior;
                continue;
            }
            let hypothesis = followed.hypothesis(*suspects);
            hypotheses.push(hypothesis);
            for (at, direction) in directions.iter().enumerate() {
                let a = &direction.along;
                let (mut of_separation, mut more) = (
                    a.dot(&(separated.new * a)).max(0.0),
                    a.dot(&(separated.more * a)),
                );
                for (by, of_track) in separated.by_cause.iter().zip(&direction.by_cause) {
                    let by = a.dot(by);
                    of_separation += by * by;
                    more += by * (by + 2.0 * of_track);
                }
                let threshold_m = quantile * of_separation.sqrt();
                let separation_m = a.dot(&separated.difference).abs();
                fault.take(hypothesis, at % 3, separation_m, threshold_m);
                along.push(Along {
                    prior,
                    threshold_m,
                    // To leave something out does not make it better.
                    sigma_m: (direction.sigma_m.powi(2) + more.max(0.0)).sqrt(),
                });
            }
        }
        fault.none()?;
        let frames = f64::from(self.settings().frames);
        let parts = [
            (plan.beyond, Unmonitored::Several),
            (unmonitorable, Unmonitored::TooFewPoints),
            (
                followed.weighing.ambiguity() * frames,
                Unmonitored::SecondPose,
            ),
        ];
        let allowed = self.settings().hmi_probability * followed.weighing.share();
        let sigmas: SmallVec<[f64; 6]> = directions.iter().map(|of| of.sigma_m).collect();
        self.levels(allowed, &parts, &sigmas, &hypotheses, &along)
    }

    fn prior(&self, suspects: Suspects, flex_modes: usize) -> f64 {
        let settings = self.settings();
        match suspects {
            Suspects::One(_) => settings.fault_probability,
            Suspects::Two(..) => settings.fault_probability.powi(2),
            Suspects::Mode(mode) => settings.mode_fault_probability(mode, flex_modes),
        }
    }

    /// Returns three directions for each point; `None` where the track is not certain enough.
    fn directions(
        &self,
        followed: &TrackSeparations,
        transition: &Matrix12,
        motion: &Motion,
    ) -> Option<SmallVec<[Direction; 6]>> {
        let covariance = motion.pose_covariance();
        let mut directions = SmallVec::new();
        for point in self.points() {
            let axes = self.axes_at(point, &motion.b_from_a);
            for axis in 0..3 {
                let row: RowVector6<f64> = axes.by_pose.row(axis).into_owned();
                let of_pose = (row * covariance.0).dot(&row);
                let sigma_m = (of_pose + axes.fixed_m2[axis]).sqrt();
                if !(sigma_m.is_finite() && of_pose > 0.0) {
                    return None;
                }
                // At the last frame: what a direction at the motion's time is of errors then.
                let pose = transition.fixed_rows::<6>(0);
                let along: Vector12 = (row * pose).transpose();
                let by_cause = followed.causes.iter().map(|cause| along.dot(&cause.by));
                directions.push(Direction {
                    by_cause: by_cause.collect(),
                    along,
                    sigma_m,
                });
            }
        }
        Some(directions)
    }
}
