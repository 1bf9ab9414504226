//! Points of a camera with any lens, one at a time: the lens model is evaluated at the prediction.

use nalgebra::{Matrix2x3, Point3, Vector2};

use super::sums::{Sums, Weight};
use super::{Linearised, Residuals, Slope};
use crate::camera::{Camera, Ray};
use crate::estimation::Observation;
use crate::estimation::centred_pose::CentredPose;

/// Points of a camera with any lens, one at a time: the lens model is evaluated at the prediction.
pub(crate) struct LensResiduals<'a> {
    pub(crate) camera: &'a Camera,
    pub(crate) observations: &'a [Observation],
    pub(crate) markers_mean: Point3<f64>,
}

impl Residuals for LensResiduals<'_> {
    type Kept = ();
    const RISE: f64 = 0.0;

    fn linearise(&self, pose: &CentredPose) -> Option<Linearised> {
        let mut sums = Sums::new(0.0);
        for seen in self.observations {
            sums.add_seen(self.camera, seen, &self.markers_mean, pose)?;
        }
        sums.finish()
    }

    fn slope(&self, pose: &CentredPose, (): &()) -> Option<Slope> {
        self.linearise(pose).map(|here| here.slope)
    }
}

impl Sums<f64> {
    fn add_seen(
        &mut self,
        camera: &Camera,
        seen: &Observation,
        markers_mean: &Point3<f64>,
        pose: &CentredPose,
    ) -> Option<()> {
        let arm = pose.rotation * (seen.marker_in_tanker - markers_mean);
        let q = arm + pose.centre_in_camera;
        if q.z <= 0.0 {
            return None;
        }
        let ray = Ray::through(&q);
        let (pixel, by_ray) = camera.project(ray)?;
        let whitening = 1.0 / seen.sigma_px;
        let by_point = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y);
        let d = by_ray * by_point * (whitening / q.z);
        let residual = Vector2::new(pixel.u - seen.pixel.u, pixel.v - seen.pixel.v);
        let whitened = residual * whitening;
        let m = d.tr_mul(&d);
        let s = d.tr_mul(&whitened);
        self.add(
            [arm.x, arm.y, arm.z],
            Weight {
                m11: m.m11,
                m12: Some(m.m12),
                m13: m.m13,
                m22: m.m22,
                m23: m.m23,
                m33: m.m33,
            },
            [s.x, s.y, s.z],
        );
        self.slope.chi_squared += whitened.norm_squared();
        self.slope.squared_residuals_px += residual.norm_squared();
        Some(())
    }
}
