//! What is estimated once for all frames, and what is known of it beforehand.
//!
//! The columns are markers and tags (three each, m), amplitudes of flex modes (in their sigmas), modes of the camera (in
//! their sigmas), rotation of the mount and the constant error of the reported attitudes (rad, three each).

use std::collections::BTreeMap;

use nalgebra::{DMatrix, Matrix3, Vector3};

use super::{CalibrateError, MountPrior};
use crate::camera::{CalibrationChange, Camera};
use crate::estimation::{CalibrationMode, ErrorBudget, FlexMode};
use crate::target::{CORNER_FACTOR, MAP_ERROR, MarkerMap};

/// Amplitudes of one flex mode in its time constant: linear in between, they keep nine tenths of the variance.
const PER_TIME_CONSTANT: f64 = 4.0;
/// Most amplitudes of all flex modes.
const MOST_AMPLITUDES: usize = 400;
/// m; markers that only a mode moves need some variance of their own for the prior to have an inverse.
const LEAST_SIGMA_M: f64 = 1e-5;

/// A marker, or a tag whose corners move together.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
pub(super) enum BodyId {
    Marker(u32),
    Tag(u32),
}

impl BodyId {
    pub(super) fn name(self) -> String {
        match self {
            Self::Marker(id) => format!("marker {id}"),
            Self::Tag(id) => format!("tag {id}"),
        }
    }
}

/// A body whose position is estimated.
#[derive(Debug, Clone)]
pub(super) struct Body {
    pub(super) id: BodyId,
    /// Its points on the map.
    pub(super) points: Vec<u32>,
    pub(super) centre_in_tanker: Vector3<f64>,
}

/// The amplitudes of a flex mode at evenly spaced times.
#[derive(Debug, Clone)]
struct FlexColumns {
    /// Displacement of each point at one sigma, m.
    shape: BTreeMap<u32, Vector3<f64>>,
    first: usize,
    count: usize,
    start_s: f64,
    spacing_s: f64,
}

/// The unknowns that all frames share.
#[derive(Debug, Clone)]
pub(super) struct Unknowns {
    pub(super) bodies: Vec<Body>,
    by_point: BTreeMap<u32, usize>,
    flex: Vec<FlexColumns>,
    pub(super) camera: Vec<CalibrationMode>,
    pub(super) first_of_camera: usize,
    /// Column of the mount; the constant error of the attitudes follows.
    pub(super) mount: Option<usize>,
    pub(super) size: usize,
    /// Before the recording.
    pub(super) prior: DMatrix<f64>,
    pub(super) prior_information: DMatrix<f64>,
}

impl Unknowns {
    /// Returns the unknowns of a map and a budget.
    ///
    /// # Inputs
    /// * `from_s`, `until_s`: times of the first and the last frame.
    pub(super) fn new(
        map: &MarkerMap,
        budget: &ErrorBudget,
        mount: Option<&MountPrior>,
        [from_s, until_s]: [f64; 2],
    ) -> Result<Self, CalibrateError> {
        let (of_map, flex): (Vec<&FlexMode>, Vec<&FlexMode>) = budget
            .flex()
            .iter()
            .partition(|mode| mode.name.starts_with(MAP_ERROR));
        let bodies = bodies(map, budget, &of_map);
        let mut by_point = BTreeMap::new();
        for (index, body) in bodies.iter().enumerate() {
            by_point.extend(body.points.iter().map(|point| (*point, index)));
        }
        let mut size = 3 * bodies.len();
        let mut columns = Vec::with_capacity(flex.len());
        for mode in &flex {
            let used = size - 3 * bodies.len();
            let of_mode = FlexColumns::new(mode, size, used, [from_s, until_s])?;
            size += of_mode.count;
            columns.push(of_mode);
        }
        let first_of_camera = size;
        size += budget.calibration().len();
        let mount_at = mount.map(|_| size);
        size += if mount.is_some() { 6 } else { 0 };
        if size == 0 {
            return Err(CalibrateError::NothingUnknown);
        }
        let mut prior = DMatrix::identity(size, size);
        let of_bodies = body_prior(&bodies, budget, &of_map);
        prior
            .view_mut((0, 0), of_bodies.shape())
            .copy_from(&of_bodies);
        for (of_mode, mode) in columns.iter().zip(&flex) {
            of_mode.correlate(mode, &mut prior);
        }
        if let (Some(at), Some(mount)) = (mount_at, mount) {
            for axis in 0..3 {
                prior[(at + axis, at + axis)] = mount.sigma_rad.powi(2);
                prior[(at + 3 + axis, at + 3 + axis)] = mount.attitude_bias_rad.powi(2).max(1e-12);
            }
        }
        let inverse = prior.clone().cholesky();
        let prior_information = inverse
            .ok_or(CalibrateError::Singular { of: "the prior" })?
            .inverse();
        Ok(Self {
            bodies,
            by_point,
            flex: columns,
            camera: budget.calibration().to_vec(),
            first_of_camera,
            mount: mount_at,
            size,
            prior,
            prior_information,
        })
    }

    /// Returns the body that a point belongs to.
    pub(super) fn body_of(&self, point: u32) -> Option<usize> {
        self.by_point.get(&point).copied()
    }

    /// Returns columns and displacements, m per unit, by which flex moves a point at a time.
    pub(super) fn flex_of(
        &self,
        point: u32,
        time_s: f64,
    ) -> impl Iterator<Item = (usize, Vector3<f64>)> {
        self.flex.iter().flat_map(move |mode| {
            let shift = mode.shape.get(&point).copied();
            let shares = mode.shares(time_s);
            shift
                .into_iter()
                .flat_map(move |shift| shares.map(|(column, share)| (column, shift * share)))
                .filter(|(_, shift)| *shift != Vector3::zeros())
        })
    }

    /// Returns the camera with estimated amplitudes of its modes.
    pub(super) fn camera(&self, camera: &Camera, values: &[f64]) -> Camera {
        camera.with_change(&self.camera_change(values))
    }

    /// Returns the change of the camera at these values of the unknowns.
    pub(super) fn camera_change(&self, values: &[f64]) -> CalibrationChange {
        let amplitudes = &values[self.first_of_camera..];
        let modes = self.camera.iter().zip(amplitudes);
        modes.fold(CalibrationChange::zeros(), |sum, (mode, amplitude)| {
            sum + mode.change * *amplitude
        })
    }
}

/// Returns markers and tags of which something is unknown.
fn bodies(map: &MarkerMap, budget: &ErrorBudget, of_map: &[&FlexMode]) -> Vec<Body> {
    let mut bodies: BTreeMap<BodyId, Body> = BTreeMap::new();
    for marker in map.markers() {
        let is_moved = of_map
            .iter()
            .any(|mode| mode.shape.iter().any(|(id, _)| *id == marker.id));
        if budget.survey_sigma_m(marker.id) == 0.0 && !is_moved {
            continue;
        }
        let tag = map.tag_of_corner(marker.id);
        let id = tag.map_or(BodyId::Marker(marker.id), |tag| BodyId::Tag(tag.id));
        let centre_in_tanker = tag.map_or(marker.marker_in_tanker.coords, |tag| {
            tag.tanker_from_tag.translation.vector
        });
        let body = bodies.entry(id).or_insert(Body {
            id,
            points: Vec::new(),
            centre_in_tanker,
        });
        body.points.push(marker.id);
    }
    bodies.into_values().collect()
}

/// Returns the covariance of all positions as the map states it, with the modes of an earlier calibration.
fn body_prior(bodies: &[Body], budget: &ErrorBudget, of_map: &[&FlexMode]) -> DMatrix<f64> {
    let size = 3 * bodies.len();
    let mut prior = DMatrix::zeros(size, size);
    for (index, body) in bodies.iter().enumerate() {
        let of_points = body
            .points
            .first()
            .map_or(0.0, |id| budget.survey_sigma_m(*id));
        let sigma_m = match body.id {
            BodyId::Marker(_) => of_points,
            BodyId::Tag(_) => of_points / CORNER_FACTOR,
        };
        let variance = sigma_m.max(LEAST_SIGMA_M).powi(2);
        let mut own = prior.view_mut((3 * index, 3 * index), (3, 3));
        own.copy_from(&(Matrix3::identity() * variance));
    }
    for mode in of_map {
        let mut shift = nalgebra::DVector::zeros(size);
        for (index, body) in bodies.iter().enumerate() {
            let of_body = mode.shape.iter().find(|(id, _)| body.points.contains(id));
            if let Some((_, of_body)) = of_body {
                shift.fixed_rows_mut::<3>(3 * index).copy_from(of_body);
            }
        }
        prior += &shift * shift.transpose();
    }
    prior
}

impl FlexColumns {
    fn new(
        mode: &FlexMode,
        first: usize,
        used: usize,
        [from_s, until_s]: [f64; 2],
    ) -> Result<Self, CalibrateError> {
        let length_s = (until_s - from_s).max(0.0);
        let (count, spacing_s) = match mode.time_constant_s {
            None => (1, f64::INFINITY),
            Some(time_constant_s) => {
                let spacing_s = time_constant_s / PER_TIME_CONSTANT;
                // Saturates, and is then above the limit.
                #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
                let need = ((length_s / spacing_s).ceil() as usize).saturating_add(1);
                if used.saturating_add(need) > MOST_AMPLITUDES {
                    return Err(CalibrateError::TooManyAmplitudes {
                        name: mode.name.clone(),
                        time_constant_s,
                        length_s,
                        need,
                        most: MOST_AMPLITUDES,
                    });
                }
                (need, spacing_s)
            }
        };
        Ok(Self {
            shape: mode.shape.iter().copied().collect(),
            first,
            count,
            start_s: from_s,
            spacing_s,
        })
    }

    /// Returns the two amplitudes next to a time, with their shares.
    fn shares(&self, time_s: f64) -> [(usize, f64); 2] {
        let place = if self.count > 1 {
            ((time_s - self.start_s) / self.spacing_s).clamp(0.0, (self.count - 1) as f64)
        } else {
            0.0
        };
        // Below count.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let before = (place.floor() as usize).min(self.count - 1);
        let after = (before + 1).min(self.count - 1);
        let share = place - before as f64;
        [
            (self.first + before, 1.0 - share),
            (self.first + after, share),
        ]
    }

    /// Writes the covariance of a first-order Gauss–Markov process of one sigma.
    fn correlate(&self, mode: &FlexMode, prior: &mut DMatrix<f64>) {
        let Some(time_constant_s) = mode.time_constant_s else {
            return;
        };
        for i in 0..self.count {
            for j in 0..self.count {
                let apart_s = self.spacing_s * i.abs_diff(j) as f64;
                prior[(self.first + i, self.first + j)] = (-apart_s / time_constant_s).exp();
            }
        }
    }
}
