//! The whole of a calibration: select, adjust, leave out, judge, until the detector's sigma settles.

use std::collections::{BTreeMap, BTreeSet};

use statrs::distribution::{ChiSquared, ContinuousCDF};

use super::adjust::{Adjusted, State, adjust, cost, linearise};
use super::correlation::usual_spacing_s;
use super::decide::{decide, written_covariance};
use super::dominate::separate;
use super::gauge::gauge_modes;
use super::leverage::{FrameResiduals, residuals};
use super::model::Model;
use super::noise::{DetectorNoise, detector_noise};
use super::outcome::Calibration;
use super::result::Results;
use super::select::{needed_factor, select};
use super::unknowns::Unknowns;
use super::{CalibrateError, CalibrationSettings, RecordedFrame};
use crate::camera::Camera;
use crate::estimation::{ErrorBudget, Estimator};
use crate::target::MarkerMap;

/// Frames below which nothing is calibrated.
const LEAST_FRAMES: usize = 10;
/// Rounds until the detector's sigma has settled.
const SIGMA_ROUNDS: usize = 5;
/// Relative change of the sigma, and of what noise that lasts adds, at which it has.
const SETTLED: f64 = 0.02;
/// Sigmas are not taken for smaller than this share of what was stated: without noise they would end at zero.
const LEAST_FACTOR: f64 = 0.02;
/// Rounds of leaving out detections.
const REJECT_ROUNDS: usize = 10;
/// Points of a frame below which it has no pose that checks itself.
const LEAST_POINTS: usize = 4;
/// Share of a marker's detections that may be left out as wrong.
const MOST_LEFT_OUT: f64 = 0.2;

/// Returns what a recording tells of map, camera, mount and detector.
///
/// # Inputs
/// * `estimator`: with the budget of map and camera; its exclusion and trust select the frames.
/// * `recorded`: by time.
///
/// # Errors
/// [`CalibrateError`] when nothing can be estimated. What the data do not tell is no error: it is not moved.
pub fn calibrate(
    camera: &Camera,
    map: &MarkerMap,
    estimator: &Estimator,
    recorded: &[RecordedFrame],
    settings: &CalibrationSettings,
) -> Result<Calibration, CalibrateError> {
    let exact = ErrorBudget::of_checked(&[], vec![], vec![], 0.0);
    let budget = estimator.budget().unwrap_or(&exact);
    let times = [recorded.first(), recorded.last()].map(|frame| frame.map_or(0.0, |f| f.time_s));
    let unknowns = Unknowns::new(map, budget, settings.mount.as_ref(), times)?;
    let context = Context {
        camera,
        map,
        estimator,
        recorded,
        settings,
        unknowns: &unknowns,
        jitter_px: budget.jitter_px(),
    };
    let mut factor = needed_factor(camera, estimator, recorded);
    let mut lasting = 1.0;
    let mut round = context.round(factor, lasting)?;
    for _ in 1..SIGMA_ROUNDS {
        let next = round.noise.factor_of_stated.max(LEAST_FACTOR);
        let next_lasting = round
            .noise
            .lasting_factor(usual_spacing_s(&round.residuals))
            * round.noise.corner_factor();
        let is_settled =
            (next / factor - 1.0).abs() < SETTLED && (next_lasting / lasting - 1.0).abs() < SETTLED;
        if is_settled {
            break;
        }
        (factor, lasting) = (next, next_lasting);
        round = context.round(factor, lasting)?;
    }
    context.outcome(round, lasting)
}

struct Context<'a> {
    camera: &'a Camera,
    map: &'a MarkerMap,
    estimator: &'a Estimator,
    recorded: &'a [RecordedFrame],
    settings: &'a CalibrationSettings,
    unknowns: &'a Unknowns,
    jitter_px: f64,
}

/// One adjustment with what it left out.
struct Round {
    adjusted: Adjusted,
    residuals: Vec<FrameResiduals>,
    noise: DetectorNoise,
    cost: f64,
    /// By point: detections, and how many of them were left out.
    left_out: BTreeMap<u32, (usize, usize)>,
    /// Why the first frame that is not used was refused.
    first_reason: Option<String>,
    far_attitudes: usize,
}

impl Context<'_> {
    fn round(&self, factor: f64, lasting: f64) -> Result<Round, CalibrateError> {
        let mount = self.settings.mount.as_ref();
        let selected = select(self.camera, self.estimator, self.recorded, factor, mount);
        let too_few = |used: usize| CalibrateError::TooFewFrames {
            used,
            got: self.recorded.len(),
            need: LEAST_FRAMES,
            reason: selected.first_reason.clone().unwrap_or_default(),
        };
        if selected.frames.len() < LEAST_FRAMES {
            return Err(too_few(selected.frames.len()));
        }
        let model = Model {
            camera: self.camera,
            unknowns: self.unknowns,
            jitter_px: self.jitter_px,
            lasting,
            attitude_noise_rad: mount.map_or(1.0, |mount| mount.attitude_noise_rad),
        };
        let mut left_out = selected.left_out.clone();
        let mut state = State {
            values: vec![0.0; self.unknowns.size],
            frames: selected.frames.clone(),
        };
        let limit = ChiSquared::new(2.0).map_or(f64::INFINITY, |law| {
            law.inverse_cdf(1.0 - self.settings.reject_probability)
        });
        let tag_of = |point: u32| self.map.tag_of_corner(point).map(|tag| tag.id);
        let singular = CalibrateError::Singular { of: "a frame" };
        for _ in 0..REJECT_ROUNDS {
            let adjusted = adjust(&model, state)?;
            let sums = linearise(&model, &adjusted.state).ok_or(singular.clone())?;
            let residuals = residuals(
                &model,
                &adjusted.state,
                &sums,
                &adjusted.covariance,
                &tag_of,
            )
            .ok_or(singular.clone())?;
            let noise = detector_noise(&residuals, factor).ok_or(CalibrateError::TooLittle {
                frames: residuals.len(),
            })?;
            // Too small sigmas are no reason to leave out what they call wrong.
            let allowed = limit * (noise.factor_of_stated / factor).max(1.0).powi(2);
            let (kept, count) =
                without_wrong(adjusted.state.clone(), &residuals, allowed, &mut left_out);
            if count == 0 {
                let cost = cost(&model, &adjusted.state).ok_or(singular)?;
                return Ok(Round {
                    adjusted,
                    residuals,
                    noise,
                    cost,
                    left_out,
                    first_reason: selected.first_reason,
                    far_attitudes: selected.far_attitudes,
                });
            }
            if kept.frames.len() < LEAST_FRAMES {
                return Err(too_few(kept.frames.len()));
            }
            state = kept;
        }
        Err(CalibrateError::TooManyWrong {
            rounds: REJECT_ROUNDS,
        })
    }

    fn outcome(&self, round: Round, lasting_factor: f64) -> Result<Calibration, CalibrateError> {
        let unknowns = self.unknowns;
        let (values, covariance) = (&round.adjusted.state.values, &round.adjusted.covariance);
        let frames = &round.adjusted.state.frames;
        let mount_frames = frames
            .iter()
            .filter(|frame| frame.reported.is_some())
            .count();
        let mut warnings = Vec::new();
        let suspects = self.suspects(&round.left_out, &mut warnings);
        let parameters = decide(
            unknowns,
            covariance,
            values,
            &suspects,
            mount_frames,
            self.settings,
        );
        for parameter in parameters
            .iter()
            .filter(|parameter| !parameter.is_plausible)
        {
            warnings.push(format!(
                "{} moves by {:.1} times the sigma that its movement should have: its prior is too small, or something else is wrong",
                parameter.name, parameter.sigmas
            ));
        }
        if let Some(reason) = &round.first_reason {
            warnings.push(format!(
                "{} of {} frames not used; the first: {reason}",
                self.recorded.len() - frames.len(),
                self.recorded.len()
            ));
        }
        if round.noise.factor_of_stated < LEAST_FACTOR {
            warnings.push(
                "the detections have next to no noise: of the detector the recording tells nothing"
                    .to_owned(),
            );
        }
        if round.far_attitudes > 0 {
            warnings.push(format!(
                "the reported attitudes of {} frames are farther from the image than mount and attitudes are stated to be wrong; they were left out",
                round.far_attitudes
            ));
        }
        let joint = written_covariance(unknowns, covariance, &parameters);
        let (of_bodies, of_camera) = separate(&joint, 3 * unknowns.bodies.len());
        let results = Results {
            map: self.map,
            unknowns,
            mount: self.settings.mount.as_ref(),
            parameters: &parameters,
            values,
        };
        let map = results.map_outcome(&joint, &of_bodies)?;
        let used_points = frames.iter().map(|frame| frame.points.len()).sum();
        Ok(Calibration {
            frames: self.recorded.len(),
            used_frames: frames.len(),
            used_points,
            left_out_points: round.left_out.values().map(|(_, out)| out).sum(),
            steps: round.adjusted.steps,
            cost: round.cost,
            gauge: gauge_modes(unknowns, covariance, values),
            noise: round.noise,
            lasting_factor,
            map,
            camera: results.camera_outcome(&of_camera),
            mount: results.mount_outcome(covariance, mount_frames),
            parameters,
            warnings,
        })
    }

    /// Returns the bodies of which many detections were left out as wrong.
    fn suspects(
        &self,
        left_out: &BTreeMap<u32, (usize, usize)>,
        warnings: &mut Vec<String>,
    ) -> BTreeSet<usize> {
        let mut suspects = BTreeSet::new();
        for (point, (count, out)) in left_out {
            if *out as f64 <= MOST_LEFT_OUT * *count as f64 {
                continue;
            }
            warnings.push(format!(
                "{out} of {count} detections of id {point} were left out as wrong"
            ));
            suspects.extend(self.unknowns.body_of(*point));
        }
        suspects
    }
}

/// Returns the state without detections whose residuals correct ones do not have, and how many those were.
fn without_wrong(
    mut state: State,
    residuals: &[FrameResiduals],
    allowed: f64,
    left_out: &mut BTreeMap<u32, (usize, usize)>,
) -> (State, usize) {
    let mut count = 0;
    for (frame, residuals) in state.frames.iter_mut().zip(residuals) {
        // One wrong detection makes others of its frame look wrong: the worst first.
        let worst = residuals
            .points
            .iter()
            .filter_map(|point| Some((point.id, point.chi_squared?)))
            .filter(|(_, chi_squared)| *chi_squared > allowed)
            .max_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((id, _)) = worst {
            frame.points.retain(|seen| seen.id != id);
            left_out.entry(id).or_default().1 += 1;
            count += 1;
        }
    }
    state
        .frames
        .retain(|frame| frame.points.len() >= LEAST_POINTS);
    (state, count)
}
