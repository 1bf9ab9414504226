//! From an adjustment to what is written: map, camera and mount, each with what is then still wrong.

use nalgebra::{DMatrix, Rotation3, Vector3};

use super::dominate::{Mode, dominate};
use super::outcome::{CameraOutcome, MapOutcome, MountOutcome, Movement, Parameter};
use super::unknowns::{BodyId, Unknowns};
use super::{CalibrateError, MountPrior};
use crate::camera::CALIBRATION_SIZE;
use crate::target::{BodyChange, Flex, MAP_ERROR, MAX_FLEX_MODES, MapChange, MarkerMap};

/// What results are made from.
pub(super) struct Results<'a> {
    pub(super) map: &'a MarkerMap,
    pub(super) unknowns: &'a Unknowns,
    pub(super) mount: Option<&'a MountPrior>,
    pub(super) parameters: &'a [Parameter],
    pub(super) values: &'a [f64],
}

impl Results<'_> {
    /// Returns the map.
    ///
    /// # Inputs
    /// * `joint`: covariance of the written positions, and what follows.
    /// * `to_claim`: that of the positions, widened by what a map cannot say of its correlation with the camera.
    pub(super) fn map_outcome(
        &self,
        joint: &DMatrix<f64>,
        to_claim: &DMatrix<f64>,
    ) -> Result<MapOutcome, CalibrateError> {
        let unknowns = self.unknowns;
        let size = 3 * unknowns.bodies.len();
        let is_kept = |flex: &&Flex| !flex.name.starts_with(MAP_ERROR);
        let kept: Vec<Flex> = self
            .map
            .budget()
            .flex
            .iter()
            .filter(is_kept)
            .cloned()
            .collect();
        let mut change = MapChange {
            flex: kept,
            ..MapChange::default()
        };
        let statement = dominate(to_claim, MAX_FLEX_MODES.saturating_sub(change.flex.len()));
        for (index, body) in unknowns.bodies.iter().enumerate() {
            let mut of_body = BodyChange {
                sigma_m: statement.variances[index].sqrt(),
                ..BodyChange::default()
            };
            for axis in 0..3 {
                let moved = self
                    .parameters
                    .iter()
                    .any(|p| p.column == 3 * index + axis && p.movement == Movement::Moved);
                if moved {
                    of_body.shift_in_tanker[axis] = self.values[3 * index + axis];
                }
            }
            match body.id {
                BodyId::Marker(id) => change.markers.insert(id, of_body),
                BodyId::Tag(id) => change.tags.insert(id, of_body),
            };
        }
        for (index, mode) in statement.modes.iter().enumerate() {
            change.flex.push(self.map_error(index, mode));
        }
        let map = self.map.changed(&change)?;
        Ok(MapOutcome {
            change,
            map,
            covariance: joint.view((0, 0), (size, size)).into_owned(),
            claimed: statement.covariance(),
            bodies: unknowns.bodies.iter().map(|body| body.id.name()).collect(),
        })
    }

    /// Returns a mode as a map states it.
    fn map_error(&self, index: usize, mode: &Mode) -> Flex {
        let bodies = self.unknowns.bodies.iter().enumerate();
        let shape = bodies.flat_map(|(index, body)| {
            let shift = mode.shape.fixed_rows::<3>(3 * index).into_owned();
            body.points.iter().map(move |point| (*point, shift))
        });
        let mut shape: Vec<_> = shape.collect();
        shape.sort_unstable_by_key(|(point, _)| *point);
        Flex {
            name: format!("{MAP_ERROR}{}", index + 1),
            sigma_m: mode.sigma_m,
            time_constant_s: None,
            shape,
        }
    }

    /// Returns the camera; `None` if nothing of it is unknown.
    pub(super) fn camera_outcome(&self, covariance: &DMatrix<f64>) -> Option<CameraOutcome> {
        let unknowns = self.unknowns;
        let count = unknowns.camera.len();
        if count == 0 {
            return None;
        }
        let of_camera = unknowns.first_of_camera..unknowns.first_of_camera + count;
        let mut written = vec![0.0; unknowns.size];
        let mut is_moved = false;
        for parameter in self.parameters {
            if of_camera.contains(&parameter.column) && parameter.movement == Movement::Moved {
                written[parameter.column] = self.values[parameter.column];
                is_moved = true;
            }
        }
        let changes = DMatrix::from_fn(CALIBRATION_SIZE, count, |row, mode| {
            unknowns.camera[mode].change[row]
        });
        Some(CameraOutcome {
            is_moved,
            change: unknowns.camera_change(&written),
            covariance: &changes * covariance * changes.transpose(),
        })
    }

    /// Returns the mount; `None` if it was not asked for.
    pub(super) fn mount_outcome(
        &self,
        covariance: &DMatrix<f64>,
        frames: usize,
    ) -> Option<MountOutcome> {
        let (at, prior) = (self.unknowns.mount?, self.mount?);
        let mut turn = Vector3::zeros();
        let mut sigma_rad = [prior.sigma_rad; 3];
        for axis in 0..3 {
            let own = self.parameters.iter().find(|p| p.column == at + axis)?;
            if own.movement == Movement::Moved {
                turn[axis] = self.values[at + axis];
                sigma_rad[axis] = covariance[(at + axis, at + axis)].sqrt();
            }
        }
        Some(MountOutcome {
            is_moved: turn.norm() > 0.0,
            frames,
            camera_from_receiver: Rotation3::new(turn) * prior.camera_from_receiver,
            sigma_rad,
        })
    }
}
