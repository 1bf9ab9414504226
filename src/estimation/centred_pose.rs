//! A pose about the markers' mean, and increments of it; used by fits and residuals.

use nalgebra::{Isometry3, Rotation3, Translation3, UnitQuaternion, Vector3};

use super::lanes::information::Vector;
use crate::geometry::cayley;

/// rad, and share of the distance. A shorter step changes the standard deviations by at most 0.15 % for the shipped
/// maps, and by about 1 % for a flat target seen face on, or one that is closer than its size.
const NEAR: f64 = 7e-4;

/// A pose as the fit parametrises it: rotation, and the camera coordinates of the markers' mean.
#[derive(Debug, Clone, Copy)]
pub(crate) struct CentredPose {
    pub(crate) rotation: Rotation3<f64>,
    pub(crate) centre_in_camera: Vector3<f64>,
}

impl CentredPose {
    /// Returns whether a step is too short to change the information, to the accuracy stated at [`NEAR`].
    #[inline(always)]
    pub(crate) fn is_near(&self, step: &Vector) -> bool {
        let turn = Vector3::new(step[0], step[1], step[2]).norm_squared();
        let motion = Vector3::new(step[3], step[4], step[5]).norm_squared();
        turn < NEAR * NEAR && motion < (NEAR * self.centre_in_camera.z).powi(2)
    }

    /// Returns `camera_from_tanker`.
    ///
    /// # Inputs
    /// * `lever`: from the tanker's origin to the markers' mean, camera axes, m.
    #[inline(always)]
    pub(crate) fn about_origin(&self, lever: &Vector3<f64>) -> Isometry3<f64> {
        Isometry3::from_parts(
            Translation3::from(self.centre_in_camera - lever),
            UnitQuaternion::from_rotation_matrix(&self.rotation),
        )
    }

    /// Returns the pose after an increment: rotation, then translation of the mean, rad and m, camera axes.
    #[inline(always)]
    pub(crate) fn moved(&self, step: &Vector) -> Self {
        Self {
            rotation: cayley(Vector3::new(step[0], step[1], step[2])) * self.rotation,
            centre_in_camera: self.centre_in_camera + Vector3::new(step[3], step[4], step[5]),
        }
    }
}
