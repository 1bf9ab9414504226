//! The one call that turns a solution into protection levels.

use nalgebra::{Isometry3, Matrix3, Matrix3x6, Point3, RowVector6, Vector3, Vector6};
use smallvec::SmallVec;

use super::IntegritySettings;
use super::frame::{AboveLimit, FrameIntegrity, PointIntegrity, Unavailable, Unmonitored};
use super::gaussian::tail_inverse;
use super::hypotheses::{Beacon, Hypothesis, Plan, Unit, units};
use super::level::{Along, Risk};
use super::projection::Projection;
use super::separation::{Separations, Suspicion};
use crate::camera::Camera;
use crate::estimation::{Estimator, LinearFrame, Observation, Refinement, Solution};
use crate::geometry::{PoseCovariance, skew};
use crate::target::MarkerMap;

/// Points that must remain without the suspects: three fix up to four poses.
const LEAST_REMAINING: usize = 4;
/// rad, 10°; beyond it the error does not follow the covariance.
const MOST_ATTITUDE_SIGMA: f64 = 10.0 * std::f64::consts::PI / 180.0;
/// Sigmas of the attitude without a beacon: farther, a pose without it is another one.
const MOST_TURN_SIGMAS: f64 = 10.0;
/// Thickness of a target over its length below which it counts as flat.
const FLAT: f64 = 0.02;
/// Share of the risk that is kept for frames in which detections were left out: each choice of them is one more way to
/// be wrong.
const SHARE_OF_EXCLUSIONS: f64 = 0.1;

/// Of the variance that the curvature gives: below it, a covariance differs by the step that it was taken before.
const WIDENED: f64 = 1.02;

/// A point of the tanker whose position is to be protected.
#[derive(Debug, Clone, PartialEq)]
pub struct IntegrityPoint {
    /// Its name, for reports.
    pub name: String,
    /// Where it is, tanker frame, m.
    pub point_in_tanker: Point3<f64>,
    /// How it deviates from there, covariance in the tanker's axes, m².
    pub covariance: Matrix3<f64>,
    /// Largest levels allowed: ahead, lateral, vertical in the receiver, m; `None`: not stated.
    pub alert_limit_m: Option<[f64; 3]>,
}

/// How the camera sits in the receiver, whose axes the levels have.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Mount {
    /// From the camera's optical axes to x ahead, y left, z up, m.
    pub receiver_from_camera: Isometry3<f64>,
    /// Of it, receiver axes, about the camera.
    pub covariance: PoseCovariance,
}

/// Computes protection levels of solutions.
#[derive(Debug, Clone)]
pub struct IntegrityMonitor {
    settings: IntegritySettings,
    mount: Mount,
    points: Vec<IntegrityPoint>,
}

/// Everything of one frame that hypotheses are held against.
struct Frame<'a> {
    linear: &'a LinearFrame,
    suspicion: Suspicion<'a>,
    /// Three for each point.
    axes: SmallVec<[Axis; 6]>,
}

/// One axis at one point.
#[derive(Clone, Copy)]
struct Axis {
    /// Standard deviation of the estimate in use, with mount and point, m.
    sigma_m: f64,
    /// How much more than its curvature says the estimate may be off, 1 or more.
    widened: f64,
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
    /// # Inputs
    /// * `map`: tells which points are corners of one tag; without one each is a beacon of its own.
    /// * `observations`: those that the solution was estimated from, with those that it left out.
    ///
    /// # Errors
    /// [`Unavailable`]: no levels can be given, or a fault is visible.
    pub fn judge(
        &self,
        estimator: &Estimator,
        map: Option<&MarkerMap>,
        camera: &Camera,
        observations: &[Observation],
        solution: &Solution,
    ) -> Result<FrameIntegrity, Unavailable> {
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
        let plan = Plan::new(
            &self.settings,
            units.len(),
            linear.flex_modes,
            linear.modes - linear.flex_modes,
        );
        let allowed = self.allowed(estimator, observations, solution);
        if plan.beyond >= allowed {
            // Before work that grows with the square of the points.
            return Err(Unavailable::Unmonitored {
                probability: plan.beyond,
                allowed,
                reason: Unmonitored::Several,
            });
        }
        let projection = Projection::new(&linear).ok_or(Unavailable::Singular)?;
        let frame = self
            .frame(&linear, &projection, solution)
            .ok_or(Unavailable::Singular)?;
        let test = self.settings.false_alert_probability
            / (2.0
                * f64::from(self.settings.frames)
                * (plan.count * frame.axes.len()).max(1) as f64);
        let mut search = Search {
            frame: &frame,
            quantile: tail_inverse(test),
            along: Vec::with_capacity(plan.count * frame.axes.len()),
            hypotheses: Vec::with_capacity(plan.count),
            unmonitorable: 0.0,
            fault: None,
            found: Separations::new(),
        };
        let alone = Alone {
            estimator,
            camera,
            observations,
            solution,
        };
        self.visit(&units, &plan, &alone, &mut search);
        if let Some((_, fault)) = search.fault {
            return Err(fault);
        }
        let frames = f64::from(self.settings.frames);
        let parts = [
            (plan.beyond, Unmonitored::Several),
            (search.unmonitorable, Unmonitored::TooFewPoints),
            (solution.ambiguity * frames, Unmonitored::SecondPose),
        ];
        let probability: f64 = parts.iter().map(|(part, _)| part).sum();
        let risk = (allowed - probability) / (3.0 * frames);
        if risk <= 0.0 || risk.is_nan() {
            let largest = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0));
            return Err(Unavailable::Unmonitored {
                probability,
                allowed,
                reason: largest.map_or(Unmonitored::Several, |(_, reason)| *reason),
            });
        }
        let mut risk = Risk::new(risk, search.hypotheses.len());
        let points = (0..self.points.len()).map(|point| {
            let mut found = PointIntegrity {
                level_m: [0.0; 3],
                sigma_m: [0.0; 3],
                weakest: [None; 3],
            };
            for axis in 0..3 {
                let at = 3 * point + axis;
                let sigma_m = frame.axes[at].sigma_m;
                let faults = search.along.iter().skip(at).step_by(frame.axes.len());
                let (level_m, weakest) = risk.protection_level(sigma_m, &faults.copied());
                found.level_m[axis] = level_m;
                found.sigma_m[axis] = sigma_m;
                found.weakest[axis] = weakest.map(|index| search.hypotheses[index]);
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

    /// Returns the risk of a frame: most of it where nothing was left out.
    fn allowed(
        &self,
        estimator: &Estimator,
        observations: &[Observation],
        solution: &Solution,
    ) -> f64 {
        let risk = self.settings.hmi_probability;
        let (most, count) = (estimator.settings().max_outliers, observations.len() as f64);
        let choices = match most {
            0 => return risk,
            1 => count,
            _ => count + 0.5 * count * (count - 1.0),
        };
        if solution.excluded.ids().next().is_none() {
            risk * (1.0 - SHARE_OF_EXCLUSIONS)
        } else {
            risk * SHARE_OF_EXCLUSIONS / choices
        }
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
        let pose = &solution.camera_from_tanker;
        let receiver = self
            .mount
            .receiver_from_camera
            .rotation
            .to_rotation_matrix();
        for point in &self.points {
            let arm = pose.rotation * point.point_in_tanker.coords;
            let by_pose = at_point(receiver.matrix(), &arm);
            let from_mount = receiver * (arm + pose.translation.vector);
            let by_mount = at_point(&Matrix3::identity(), &from_mount);
            let turned = receiver.matrix() * pose.rotation.to_rotation_matrix().matrix();
            let of_point = turned * point.covariance * turned.transpose();
            let variance = |row: &RowVector6<f64>, of: &PoseCovariance| (row * of.0).dot(row);
            for axis in 0..3 {
                let row: RowVector6<f64> = by_pose.row(axis).into_owned();
                let direction = projection.whitened(&row.transpose())?;
                let curvature = direction.norm_squared();
                let stated = variance(&row, &solution.covariance);
                let own = if stated > WIDENED * curvature {
                    stated
                } else {
                    curvature
                };
                let mount_row: RowVector6<f64> = by_mount.row(axis).into_owned();
                let fixed_m2 = variance(&mount_row, &self.mount.covariance).max(0.0)
                    + of_point[(axis, axis)].max(0.0);
                let sigma_m = (own + fixed_m2).sqrt();
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
            let prior = if mode < linear.flex_modes {
                self.settings.flex_fault_probability
            } else {
                self.settings.calibration_fault_probability
            };
            if prior > 0.0 {
                search.mode(mode, prior);
            }
        }
    }
}

/// Returns the derivative of a point's position by a pose, in turned axes.
///
/// # Inputs
/// * `arm`: from the pose's origin to the point, m.
fn at_point(axes: &Matrix3<f64>, arm: &Vector3<f64>) -> Matrix3x6<f64> {
    let mut by_pose = Matrix3x6::zeros();
    by_pose.fixed_view_mut::<3, 3>(0, 0).copy_from(axes);
    by_pose
        .fixed_view_mut::<3, 3>(0, 3)
        .copy_from(&(axes * -skew(*arm)));
    by_pose
}

/// The points of a frame without some of them.
struct Alone<'a> {
    estimator: &'a Estimator,
    camera: &'a Camera,
    observations: &'a [Observation],
    solution: &'a Solution,
}

impl Alone<'_> {
    /// Returns the used points but those of these rows.
    fn without<'a>(&'a self, rows: &'a [usize]) -> impl Iterator<Item = &'a Observation> {
        let used = self.observations.iter();
        used.filter(|seen| !self.solution.excluded.contains(seen.id))
            .enumerate()
            .filter(|(at, _)| !rows.contains(&(2 * at)))
            .map(|(_, seen)| seen)
    }

    /// Returns whether the points without these rows have one pose, near the one in use: no second one that they
    /// allow, where a fault could have led, and an attitude that is known.
    fn fix_one_pose(&self, rows: &[usize]) -> bool {
        let others: SmallVec<[Observation; 16]> = self.without(rows).copied().collect();
        let found = self.estimator.estimate_of_all(self.camera, &others);
        found.is_ok_and(|found| {
            let turn = found
                .camera_from_tanker
                .rotation
                .angle_to(&self.solution.camera_from_tanker.rotation);
            let sigma = found.covariance.largest_attitude_sigma();
            found.ambiguity <= 0.0 && sigma < MOST_ATTITUDE_SIGMA && turn < MOST_TURN_SIGMAS * sigma
        })
    }

    /// Returns whether the points without these rows lie near one plane, so that they allow two poses.
    fn are_flat(&self, rows: &[usize]) -> bool {
        let (mut count, mut sum) = (0.0, Vector3::zeros());
        for seen in self.without(rows) {
            count += 1.0;
            sum += seen.marker_in_tanker.coords;
        }
        let mean = sum / count;
        let mut scatter = Matrix3::zeros();
        for seen in self.without(rows) {
            let arm = seen.marker_in_tanker.coords - mean;
            scatter += arm * arm.transpose();
        }
        let spread = scatter.symmetric_eigenvalues();
        let is_deep = spread.min() > FLAT * FLAT * spread.max();
        !is_deep
    }
}

/// What the hypotheses of a frame add up to.
struct Search<'a> {
    frame: &'a Frame<'a>,
    /// Of the test of a separation, in its sigmas.
    quantile: f64,
    /// All axes of the first hypothesis, then those of the next.
    along: Vec<Along>,
    hypotheses: Vec<Hypothesis>,
    /// Probability of faults that the points that are left could not show.
    unmonitorable: f64,
    /// The worst one that is visible, with its separation over the threshold.
    fault: Option<(f64, Unavailable)>,
    found: Separations,
}

impl Search<'_> {
    fn rows(&mut self, hypothesis: Hypothesis, prior: f64, rows: &[usize], is_monitored: bool) {
        let suspicion = &self.frame.suspicion;
        let is_monitored = is_monitored && suspicion.without_rows(rows, &mut self.found).is_some();
        self.take(hypothesis, prior, is_monitored);
    }

    fn mode(&mut self, mode: usize, prior: f64) {
        let linear = self.frame.linear;
        let shifts = linear.by_mode.iter().skip(mode).step_by(linear.modes);
        let shifts: SmallVec<[f64; 32]> = shifts.copied().collect();
        let suspicion = &self.frame.suspicion;
        let is_monitored = suspicion.without_mode(&shifts, &mut self.found).is_some();
        self.take(Hypothesis::Mode(mode), prior, is_monitored);
    }

    fn take(&mut self, hypothesis: Hypothesis, prior: f64, is_monitored: bool) {
        if !is_monitored {
            self.unmonitorable += prior;
            return;
        }
        self.hypotheses.push(hypothesis);
        for (at, (axis, separation)) in self.frame.axes.iter().zip(&self.found).enumerate() {
            let threshold_m = self.quantile * separation.sigma_m;
            let by = separation.difference_m.abs();
            // Whatever is not a number is no agreement.
            if by > threshold_m || by.is_nan() || threshold_m.is_nan() {
                let ratio = by / threshold_m;
                if self.fault.is_none_or(|(worst, _)| ratio > worst) {
                    let fault = Unavailable::Fault {
                        hypothesis,
                        axis: at % 3,
                        separation_m: by,
                        threshold_m,
                    };
                    self.fault = Some((ratio, fault));
                }
            }
            let own = separation.sigma_m * axis.widened;
            self.along.push(Along {
                prior,
                threshold_m: threshold_m * axis.widened,
                sigma_m: axis.sigma_m.hypot(own),
            });
        }
    }
}
