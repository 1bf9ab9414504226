//! The one call that turns a solution into protection levels.

use nalgebra::{RowVector6, Vector6};
use smallvec::SmallVec;

use super::IntegritySettings;
use super::alone::Alone;
use super::declared::{IntegrityPoint, Mount, PointAxes};
use super::frame::{
    AboveLimit, FrameIntegrity, PointIntegrity, SolvedFrame, Unavailable, Unmonitored,
};
use super::gaussian::tail_inverse;
use super::hypotheses::{Beacon, Hypothesis, Plan, Unit, units};
use super::level::{Along, Risk};
use super::projection::{Projection, WIDENED};
use super::search::{Axis, Frame, Search, VisibleFault};
use super::separation::{Separations, Suspicion};
use super::track::{FrameSeparations, LeftOut, Linearised};
use crate::estimation::{LinearFrame, Refinement, Solution};
use crate::geometry::PoseCovariance;

/// Points that must remain without the suspects: three fix up to four poses.
const LEAST_REMAINING: usize = 4;

/// Computes protection levels of solutions.
#[derive(Debug, Clone)]
pub struct IntegrityMonitor {
    settings: IntegritySettings,
    mount: Mount,
    points: Vec<IntegrityPoint>,
}

impl IntegrityMonitor {
    /// Returns a monitor of these points.
    #[must_use]
    pub fn new(settings: IntegritySettings, mount: Mount, points: Vec<IntegrityPoint>) -> Self {
        Self {
            settings,
            mount,
            points,
        }
    }

    /// Returns the points.
    #[must_use]
    pub fn points(&self) -> &[IntegrityPoint] {
        &self.points
    }

    /// Returns the settings.
    #[must_use]
    pub fn settings(&self) -> &IntegritySettings {
        &self.settings
    }

    /// Returns the protection levels of a solution.
    ///
    /// # Errors
    /// [`Unavailable`]: no levels can be given, or a fault is visible.
    pub fn judge(&self, solved: &SolvedFrame) -> Result<FrameIntegrity, Unavailable> {
        self.examine(solved, None)
    }

    /// Returns the protection levels of a solution, and what those of a track need of the frame: `None` where it cannot
    /// be linearised.
    pub fn judge_for_track(
        &self,
        solved: &SolvedFrame,
    ) -> (
        Result<FrameIntegrity, Unavailable>,
        Option<FrameSeparations>,
    ) {
        let mut separations = FrameSeparations::default();
        let levels = self.examine(solved, Some(&mut separations));
        let is_linearised = separations.is_of_frame();
        (levels, is_linearised.then_some(separations))
    }

    fn examine(
        &self,
        solved: &SolvedFrame,
        for_track: Option<&mut FrameSeparations>,
    ) -> Result<FrameIntegrity, Unavailable> {
        let &SolvedFrame {
            estimator,
            map,
            camera,
            observations,
            solution,
        } = solved;
        let linear = estimator
            .linearised(camera, observations, solution)
            .ok_or(match estimator.settings().refinement {
                Refinement::MaximumLikelihood => Unavailable::Singular,
                Refinement::None => Unavailable::NotMaximumLikelihood,
            })?;
        let beacon_of = |id| {
            map.and_then(|map| map.tag_of_corner(id))
                .map_or(Beacon::Marker(id), |tag| Beacon::Tag(tag.id))
        };
        let units = units(&linear.ids, beacon_of);
        let plan = self.plan(units.len(), linear.flex_modes, linear.modes);
        let left_out = left_out(solved);
        let allowed = self.settings.hmi_probability * left_out.share();
        let is_hopeless = plan.beyond >= allowed;
        let too_many = || Unavailable::Unmonitored {
            probability: plan.beyond,
            allowed,
            reason: Unmonitored::Several,
        };
        if is_hopeless && for_track.is_none() {
            // Before work that grows with the square of the points.
            return Err(too_many());
        }
        let projection = Projection::new(&linear).ok_or(Unavailable::Singular)?;
        let frame = self
            .frame(&linear, &projection, solution)
            .ok_or(Unavailable::Singular)?;
        let mut search = Search {
            frame: &frame,
            quantile: self.quantile(&plan),
            along: Vec::with_capacity(plan.count * frame.axes.len()),
            hypotheses: Vec::with_capacity(plan.count),
            modes: SmallVec::new(),
            is_monitored: Vec::with_capacity(plan.count),
            unmonitorable: 0.0,
            fault: VisibleFault::default(),
            found: Separations::new(),
        };
        self.visit(&units, &plan, &Alone(solved), &mut search);
        if let Some(separations) = for_track {
            let linearised = Linearised {
                linear: &linear,
                projection: &projection,
                suspicion: &frame.suspicion,
                solution,
                budget: estimator.budget(),
            };
            *separations = FrameSeparations::new(
                &linearised,
                &units,
                plan.has_pairs,
                &search.modes,
                &search.is_monitored,
                left_out,
            );
        }
        if is_hopeless {
            return Err(too_many());
        }
        search.fault.none()?;
        let frames = f64::from(self.settings.frames);
        let parts = [
            (plan.beyond, Unmonitored::Several),
            (search.unmonitorable, Unmonitored::TooFewPoints),
            (solution.ambiguity * frames, Unmonitored::SecondPose),
        ];
        let sigmas: SmallVec<[f64; 6]> = frame.axes.iter().map(|axis| axis.sigma_m).collect();
        self.levels(allowed, &parts, &sigmas, &search.hypotheses, &search.along)
    }

    /// Returns the hypotheses about so many beacons and modes, by their number.
    pub(super) fn plan(&self, beacons: usize, flex_modes: usize, modes: usize) -> Plan {
        Plan::new(&self.settings, beacons, flex_modes, modes - flex_modes)
    }

    /// Returns the quantile of the test of one separation.
    pub(super) fn quantile(&self, plan: &Plan) -> f64 {
        let axes = 3 * self.points.len();
        tail_inverse(
            self.settings.false_alert_probability
                / (2.0 * f64::from(self.settings.frames) * (plan.count * axes).max(1) as f64),
        )
    }

    /// Returns the levels of all points.
    ///
    /// # Inputs
    /// * `allowed`: the risk of all frames.
    /// * `parts`: probabilities of what is not monitored.
    /// * `sigmas`: without a fault, of three axes for each point, m.
    /// * `along`: all axes of the first hypothesis, then those of the next.
    pub(super) fn levels(
        &self,
        allowed: f64,
        parts: &[(f64, Unmonitored)],
        sigmas: &[f64],
        hypotheses: &[Hypothesis],
        along: &[Along],
    ) -> Result<FrameIntegrity, Unavailable> {
        let probability: f64 = parts.iter().map(|(part, _)| part).sum();
        let risk = (allowed - probability) / (3.0 * f64::from(self.settings.frames));
        if risk <= 0.0 || risk.is_nan() {
            let largest = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0));
            return Err(Unavailable::Unmonitored {
                probability,
                allowed,
                reason: largest.map_or(Unmonitored::Several, |(_, reason)| *reason),
            });
        }
        let mut risk = Risk::new(risk, hypotheses.len());
        let points = (0..self.points.len()).map(|point| {
            let mut found = PointIntegrity {
                level_m: [0.0; 3],
                sigma_m: [0.0; 3],
                weakest: [None; 3],
            };
            for axis in 0..3 {
                let at = 3 * point + axis;
                let sigma_m = sigmas[at];
                let faults = along.iter().skip(at).step_by(sigmas.len());
                let (level_m, weakest) = risk.protection_level(sigma_m, &faults.copied());
                found.level_m[axis] = level_m;
                found.sigma_m[axis] = sigma_m;
                found.weakest[axis] = weakest.map(|index| hypotheses[index]);
            }
            found
        });
        let points: Vec<PointIntegrity> = points.collect();
        Ok(FrameIntegrity {
            above_limit: self.above_limit(&points),
            points,
            unmonitored_probability: probability,
        })
    }

    /// Returns the axes of a point at a pose.
    pub(super) fn axes_at(
        &self,
        point: &IntegrityPoint,
        pose: &nalgebra::Isometry3<f64>,
    ) -> PointAxes {
        PointAxes::new(point, &self.mount, pose)
    }

    /// Returns the level that exceeds its limit by the largest factor.
    fn above_limit(&self, found: &[PointIntegrity]) -> Option<AboveLimit> {
        let limits = self.points.iter().map(|point| point.alert_limit_m);
        found
            .iter()
            .zip(limits)
            .enumerate()
            .filter_map(|(point, (found, limits))| Some((point, found, limits?)))
            .flat_map(|(point, found, limits)| {
                (0..3).map(move |axis| AboveLimit {
                    point,
                    axis,
                    level_m: found.level_m[axis],
                    limit_m: limits[axis],
                    weakest: found.weakest[axis],
                })
            })
            .filter(|above| above.level_m > above.limit_m || above.level_m.is_nan())
            .max_by(|a, b| (a.level_m / a.limit_m).total_cmp(&(b.level_m / b.limit_m)))
    }

    /// Returns the frame with its directions.
    fn frame<'a>(
        &self,
        linear: &'a LinearFrame,
        projection: &'a Projection,
        solution: &Solution,
    ) -> Option<Frame<'a>> {
        let mut directions: SmallVec<[Vector6<f64>; 6]> = SmallVec::new();
        let mut axes = SmallVec::new();
        let variance = |row: &RowVector6<f64>, of: &PoseCovariance| (row * of.0).dot(row);
        for point in &self.points {
            let at = self.axes_at(point, &solution.camera_from_tanker);
            for axis in 0..3 {
                let row: RowVector6<f64> = at.by_pose.row(axis).into_owned();
                let direction = projection.whitened(&row.transpose())?;
                let curvature = direction.norm_squared();
                let stated = variance(&row, &solution.covariance);
                let own = if stated > WIDENED * curvature {
                    stated
                } else {
                    curvature
                };
                let sigma_m = (own + at.fixed_m2[axis]).sqrt();
                if !(sigma_m.is_finite() && curvature > 0.0) {
                    return None;
                }
                directions.push(direction);
                axes.push(Axis {
                    sigma_m,
                    widened: (own / curvature).sqrt(),
                });
            }
        }
        Some(Frame {
            linear,
            suspicion: Suspicion::new(projection, &directions),
            axes,
        })
    }

    /// Gives every hypothesis to the search.
    fn visit(&self, units: &[Unit], plan: &Plan, alone: &Alone, search: &mut Search) {
        let p = self.settings.fault_probability;
        let points = search.frame.linear.ids.len();
        let mut rows: SmallVec<[usize; 16]> = SmallVec::new();
        for (at, unit) in units.iter().enumerate() {
            let remaining = points - unit.rows.len() / 2;
            let is_monitored = remaining >= LEAST_REMAINING && alone.fix_one_pose(&unit.rows);
            search.rows(unit.beacon.into(), p, &unit.rows, is_monitored);
            if !plan.has_pairs {
                continue;
            }
            for other in &units[at + 1..] {
                rows.clear();
                rows.extend_from_slice(&unit.rows);
                rows.extend_from_slice(&other.rows);
                let remaining = points - rows.len() / 2;
                let is_monitored = remaining >= LEAST_REMAINING && !alone.are_flat(&rows);
                let pair = Hypothesis::Pair(unit.beacon, other.beacon);
                search.rows(pair, p * p, &rows, is_monitored);
            }
        }
        let linear = search.frame.linear;
        for mode in 0..linear.modes {
            let prior = self
                .settings
                .mode_fault_probability(mode, linear.flex_modes);
            if prior > 0.0 {
                search.mode(mode, prior);
            }
        }
    }
}

/// Returns what a solution leaves out.
fn left_out(solved: &SolvedFrame) -> LeftOut {
    let count = solved.observations.len() as f64;
    LeftOut {
        ids: solved.solution.excluded.ids().collect(),
        choices: match solved.estimator.settings().max_outliers {
            0 => None,
            1 => Some(count),
            _ => Some(count + 0.5 * count * (count - 1.0)),
        },
    }
}
