//! The position of each marker from a recording and all other markers: which one is not where the map says.
//!
//! One offset `d` of the suspected marker and the pose of each frame are fitted together, by Gauss–Newton with the
//! poses eliminated:
//!
//! ```text
//! A = Σ Jᵀ W J,   W = (1 + H P Hᵀ)⁻¹,   d ← d + A⁻¹ Σ Jᵀ r
//! ```
//!
//! with `r` the marker's residual at the frame's best pose, `J` its derivative by the marker, `H` by the pose, all over
//! the noise of a detection, and `P` the pose's covariance by the other markers. What lasts (survey, flex, calibration)
//! is the same in every frame and does not average out: each of it shifts all pixels of all frames, and the shift of
//! `d` that follows is added to the covariance `A⁻¹`.

use nalgebra::{
    DMatrix, Matrix2, Matrix2x3, Matrix2x6, Matrix3, Matrix6, Vector2, Vector3, Vector6,
};
use statrs::distribution::{ChiSquared, ContinuousCDF};
use tanker_pose::estimation::{
    ErrorBudget, Estimator, EstimatorSettings, Initialisation, LinearFrame, Observation,
};
use tanker_pose::target::MarkerMap;

use super::recording::Frame;

/// Standard deviation of each coordinate before any frame, m: a direction that no frame shows stays at zero.
const PRIOR_M: f64 = 3.0;
/// Probability with which some marker of a right map is named.
const FALSE_ALARM: f64 = 1e-6;
/// The least points that fix a pose and show that it fits.
const LEAST_OTHERS: usize = 4;
const MAX_STEPS: usize = 8;
/// Columns for modes; a budget has fewer.
const MAX_MODES: usize = 40;
/// m; smaller steps change nothing that is printed.
const SETTLED_M: f64 = 1e-4;

/// A marker that is elsewhere than on the map.
#[derive(Debug, Clone)]
pub struct Offset {
    pub id: u32,
    /// From the map's position to the true one, tanker frame, m.
    pub shift_m: Vector3<f64>,
    pub sigma_m: Vector3<f64>,
    /// Squared offset in its sigmas, all axes together.
    pub chi_squared: f64,
    /// Chi-squared above which it is no chance.
    pub limit: f64,
    /// Frames that fit with the marker moved, and all with it.
    pub frames: (usize, usize),
}

impl Offset {
    /// Returns whether it is no chance, and explains most frames.
    pub fn is_significant(&self) -> bool {
        self.chi_squared > self.limit && 2 * self.frames.0 >= self.frames.1
    }
}

/// Returns the offset of every marker that can be judged, the most significant first.
pub fn offsets(
    frames: &[Frame],
    map: &MarkerMap,
    estimator: &Estimator,
    sigma_px: f64,
    margin_px: f64,
) -> Vec<Offset> {
    let settings = EstimatorSettings {
        initialisation: Initialisation::Nominal,
        max_outliers: 0,
        min_points: (LEAST_OTHERS + 1).min(estimator.settings().min_points),
        ..estimator.settings().clone()
    };
    let plain = Estimator::new(settings);
    let with = |budget: Option<ErrorBudget>| {
        budget.map_or_else(|| plain.clone(), |budget| plain.clone().with_budget(budget))
    };
    let modes = estimator.budget().and_then(|budget| {
        let (flex, calibration) = (budget.flex().to_vec(), budget.calibration().to_vec());
        ErrorBudget::new(&[], flex, calibration, 0.0).ok()
    });
    let judge = Judge {
        map,
        modes: with(modes),
        all: with(estimator.budget().cloned()),
        plain: plain.clone(),
        sigma_px,
        margin_px,
    };
    let limit = ChiSquared::new(3.0).map_or(f64::INFINITY, |distribution| {
        distribution.inverse_cdf(1.0 - FALSE_ALARM / map.markers().len() as f64)
    });
    let markers = map.markers().iter();
    let mut found: Vec<Offset> = markers
        .filter_map(|marker| judge.offset(frames, marker.id, limit))
        .collect();
    found.sort_by(|a, b| b.chi_squared.total_cmp(&a.chi_squared));
    found
}

/// What offsets are judged with.
struct Judge<'a> {
    map: &'a MarkerMap,
    /// Weights by the noise alone.
    plain: Estimator,
    /// Knows the modes that last, to linearise them.
    modes: Estimator,
    /// Knows the whole budget, to say what fits.
    all: Estimator,
    sigma_px: f64,
    margin_px: f64,
}

/// Sums over the frames.
struct Sums {
    information: Matrix3<f64>,
    pull: Vector3<f64>,
    /// A column for each cause that lasts.
    lasting: DMatrix<f64>,
    frames: usize,
}

impl Judge<'_> {
    fn offset(&self, frames: &[Frame], id: u32, limit: f64) -> Option<Offset> {
        let mut offset_m = Vector3::zeros();
        let mut covariance = Matrix3::zeros();
        for _ in 0..MAX_STEPS {
            let sums = self.sums(frames, id, &offset_m)?;
            let noise = sums.information.try_inverse()?;
            let step_m = noise * sums.pull;
            offset_m += step_m;
            let lasting = noise * &sums.lasting;
            covariance = noise + &lasting * lasting.transpose();
            if step_m.norm() < SETTLED_M {
                break;
            }
        }
        let chi_squared = offset_m.dot(&(covariance.try_inverse()? * offset_m));
        let fits = |frame: &&Frame| {
            let seen = self.observations(frame, id, &offset_m);
            let found = seen.map(|seen| self.all.estimate(&frame.sight.camera, &seen, None));
            matches!(found, Some(Ok(solution)) if solution.is_trusted())
        };
        let has_it = |frame: &&Frame| self.observations(frame, id, &offset_m).is_some();
        Some(Offset {
            id,
            shift_m: offset_m,
            sigma_m: covariance.diagonal().map(f64::sqrt),
            chi_squared,
            limit,
            frames: (
                frames.iter().filter(fits).count(),
                frames.iter().filter(has_it).count(),
            ),
        })
    }

    /// Returns the observations of a frame with one marker moved; `None` unless it and enough others are in it.
    fn observations(
        &self,
        frame: &Frame,
        id: u32,
        offset_m: &Vector3<f64>,
    ) -> Option<Vec<Observation>> {
        let place = |id| self.map.get(id);
        let mut seen = frame
            .observations(self.sigma_px, self.margin_px, place)
            .ok()?;
        if seen.len() <= LEAST_OTHERS {
            return None;
        }
        let suspect = seen.iter_mut().find(|seen| seen.id == id)?;
        suspect.marker_in_tanker += offset_m;
        Some(seen)
    }

    /// Returns `None` where no frame has the marker and enough others.
    fn sums(&self, frames: &[Frame], id: u32, offset_m: &Vector3<f64>) -> Option<Sums> {
        let mut sums = Sums {
            information: Matrix3::identity() * PRIOR_M.powi(-2),
            pull: -offset_m * PRIOR_M.powi(-2),
            lasting: DMatrix::zeros(3, MAX_MODES + 3 * self.map.markers().len()),
            frames: 0,
        };
        for frame in frames {
            let camera = &frame.sight.camera;
            let Some(seen) = self.observations(frame, id, offset_m) else {
                continue;
            };
            let Ok(solution) = self.plain.estimate(camera, &seen, None) else {
                continue;
            };
            let Some(linear) = self.modes.linearised(camera, &seen, &solution) else {
                continue;
            };
            let rotation = solution.camera_from_tanker.rotation.to_rotation_matrix();
            if self
                .add(&linear, rotation.matrix(), id, &mut sums)
                .is_some()
            {
                sums.frames += 1;
            }
        }
        (sums.frames > 0).then_some(sums)
    }

    /// Adds a frame; `None` where the others do not determine its pose.
    fn add(
        &self,
        linear: &LinearFrame,
        camera_from_tanker: &Matrix3<f64>,
        id: u32,
        sums: &mut Sums,
    ) -> Option<()> {
        let by_pose =
            |at: usize| Matrix2x6::from_fn(|row, column| linear.by_pose[2 * at + row][column]);
        let by_marker = |at: usize| -> Matrix2x3<f64> {
            by_pose(at).fixed_view::<2, 3>(0, 0) * camera_from_tanker
        };
        let suspect = linear.ids.iter().position(|known| *known == id)?;
        let others = || (0..linear.ids.len()).filter(move |at| *at != suspect);
        let mut information = Matrix6::zeros();
        for axis in 3..6 {
            information[(axis, axis)] = linear.attitude_information;
        }
        for at in others() {
            information += by_pose(at).tr_mul(&by_pose(at));
        }
        let of_others = information.cholesky()?.inverse();
        let (h, j) = (by_pose(suspect), by_marker(suspect));
        let weight = (Matrix2::identity() + h * of_others * h.transpose()).try_inverse()?;
        let residual = Vector2::new(
            linear.residuals[2 * suspect],
            linear.residuals[2 * suspect + 1],
        );
        sums.information += j.tr_mul(&weight) * j;
        sums.pull -= j.tr_mul(&residual);

        // What one sigma of a cause does to the suspect's residual at the pose of the others.
        let through_pose = |moved: Vector6<f64>| h * (of_others * moved);
        let mut add = |column: usize, shift: Vector2<f64>| {
            let mut sum = sums.lasting.column_mut(column);
            sum += j.tr_mul(&(weight * shift));
        };
        let modes = linear.modes;
        for mode in 0..modes.min(MAX_MODES) {
            let shift = |at: usize| {
                Vector2::from_fn(|row, _| linear.by_mode[(2 * at + row) * modes + mode])
            };
            let moved: Vector6<f64> = others().map(|at| by_pose(at).tr_mul(&shift(at))).sum();
            add(mode, shift(suspect) - through_pose(moved));
        }
        let Some(budget) = self.all.budget() else {
            return Some(());
        };
        for (at, marker) in linear.ids.iter().enumerate() {
            let sigma_m = budget.survey_sigma_m(*marker);
            let markers = self.map.markers();
            let Ok(index) = markers.binary_search_by_key(marker, |known| known.id) else {
                continue;
            };
            for axis in 0..3 {
                let shift: Vector2<f64> = by_marker(at).column(axis) * sigma_m;
                let shift = if at == suspect {
                    shift
                } else {
                    -through_pose(by_pose(at).tr_mul(&shift))
                };
                add(MAX_MODES + 3 * index + axis, shift);
            }
        }
        Some(())
    }
}
