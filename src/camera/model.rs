//! The checked camera: conversion between pixels and rays.

use nalgebra::{Matrix2, Matrix2x3, Point2, Vector3};

use super::UndistortError;
use super::distortion::{Lens, Outside};

/// A place in the image, px; the centre of the top-left pixel is (0, 0).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Pixel {
    /// Column, px.
    pub u: f64,
    /// Row, px.
    pub v: f64,
}

/// A direction in the camera frame, by its point on the plane `z = 1`; no unit.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Ray {
    /// To the right.
    pub x: f64,
    /// Down.
    pub y: f64,
}

impl Ray {
    /// Returns the ray through a point in front of the camera, in the camera's axes.
    #[inline]
    #[must_use]
    pub fn through(point: &Vector3<f64>) -> Self {
        Self {
            x: point.x / point.z,
            y: point.y / point.z,
        }
    }
}

/// A checked camera: pinhole with or without lens distortion, for the pixels of the detections.
#[derive(Debug, Clone, PartialEq)]
pub struct Camera {
    pub(super) fx: f64,
    pub(super) fy: f64,
    pub(super) cx: f64,
    pub(super) cy: f64,
    pub(super) image_size_px: Option<(u32, u32)>,
    pub(super) lens: Option<Lens>,
}

impl Camera {
    /// Returns the ray of a pixel, to about 1e-12 on the plane `z = 1`.
    ///
    /// Pixels outside the image are accepted as long as the lens model holds there.
    ///
    /// # Errors
    /// [`UndistortError`] if the pixel is not finite or outside the lens model's valid region. The number of steps is
    /// bounded for every input.
    pub fn ray_from_pixel(&self, pixel: Pixel) -> Result<Ray, UndistortError> {
        let Pixel { u, v } = pixel;
        let distorted = Point2::new((u - self.cx) / self.fx, (v - self.cy) / self.fy);
        if !(distorted.x.is_finite() && distorted.y.is_finite()) {
            return Err(UndistortError::NotFinite { u, v });
        }
        let ideal = match &self.lens {
            None => distorted,
            Some(lens) => lens
                .undistort(distorted)
                .map_err(
                    |Outside { radius, max_radius }| UndistortError::OutsideValidRegion {
                        u,
                        v,
                        radius,
                        max_radius,
                    },
                )?,
        };
        Ok(Ray {
            x: ideal.x,
            y: ideal.y,
        })
    }

    /// Returns the pixel of a ray and the 2×2 derivative of pixel (u, v) by ray (x, y).
    ///
    /// `None` outside the lens model's valid region, which is that of [`Self::ray_from_pixel`], and for a ray or pixel
    /// that is not finite. A pixel outside the image is returned as such.
    #[inline]
    #[must_use]
    pub fn project(&self, ray: Ray) -> Option<(Pixel, Matrix2<f64>)> {
        let ideal = Point2::new(ray.x, ray.y);
        let (distorted, derivative) = match &self.lens {
            None => (ideal, Matrix2::new(self.fx, 0.0, 0.0, self.fy)),
            Some(lens) => self.distort(lens, ideal)?,
        };
        let pixel = Pixel {
            u: self.fx * distorted.x + self.cx,
            v: self.fy * distorted.y + self.cy,
        };
        (pixel.u.is_finite() && pixel.v.is_finite()).then_some((pixel, derivative))
    }

    /// Returns the pixel of a point in the camera's axes, m, and its 2×3 derivative by the point, px/m.
    ///
    /// `None` for a point that is not in front of the camera, and where [`Self::project`] is.
    #[inline]
    #[must_use]
    pub fn project_point(&self, point: &Vector3<f64>) -> Option<(Pixel, Matrix2x3<f64>)> {
        if point.z <= 0.0 {
            return None;
        }
        let ray = Ray::through(point);
        let (pixel, by_ray) = self.project(ray)?;
        let ray_by_point = Matrix2x3::new(1.0, 0.0, -ray.x, 0.0, 1.0, -ray.y);
        Some((pixel, by_ray * ray_by_point / point.z))
    }

    /// Returns the distorted point, and the derivative of the pixel by the ideal one.
    fn distort(&self, lens: &Lens, ideal: Point2<f64>) -> Option<(Point2<f64>, Matrix2<f64>)> {
        let (distorted, by_ideal) = lens.distort(ideal)?;
        Some((
            distorted,
            Matrix2::new(self.fx, 0.0, 0.0, self.fy) * by_ideal,
        ))
    }

    /// Returns whether the camera has no lens distortion.
    #[must_use]
    pub fn is_pinhole(&self) -> bool {
        self.lens.is_none()
    }

    /// Returns `[fx, fy, cx, cy]`, px, if the camera has no lens distortion.
    #[must_use]
    pub fn pinhole(&self) -> Option<[f64; 4]> {
        self.is_pinhole()
            .then_some([self.fx, self.fy, self.cx, self.cy])
    }

    /// Returns width and height of the image that detections come from, px, after region of interest and binning;
    /// `None` if the camera info left them 0.
    #[must_use]
    pub fn image_size_px(&self) -> Option<(u32, u32)> {
        self.image_size_px
    }
}
