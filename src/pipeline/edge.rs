//! Detections at the edge of the image: if the edge cuts a beacon, its centroid is shifted inwards.
//!
//! A disc is cut if its centre is closer to the edge than its radius, and the centroid of the visible part is always
//! closer to the edge than that radius. So a margin as wide as the largest beacon's radius excludes every cut beacon. A
//! pixel that is outside by more than the margin is not a cut beacon, because no blob has its centroid there. Such a
//! pixel was computed (simulated, undistorted, or the corner of a tag), and is processed like any other.

use std::fmt;

use nalgebra::{Matrix3, Vector3};

use crate::camera::{Camera, CameraInfo, Pixel, Ray};
use crate::estimation::Observation;
use crate::text::list;

/// Largest deviation of `R Rᵀ` from the identity: calibrations are printed with six digits.
const ROTATION_TOLERANCE: f64 = 1e-4;

/// The edges of the image that detections come from.
#[derive(Debug, Clone, PartialEq)]
pub struct ImageEdges {
    size_px: Option<(u32, u32)>,
    raw: Option<RawImage>,
}

/// The raw image from which a rectified one was made; outside its edge the rectified one is black.
#[derive(Debug, Clone, PartialEq)]
struct RawImage {
    rectified: Camera,
    camera: Camera,
    size_px: (u32, u32),
    raw_from_rectified: Matrix3<f64>,
}

/// Detections left out because the edge of the image may have cut their beacons.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct LeftOut {
    /// Their marker ids, in the order of the detections.
    pub ids: Vec<u32>,
    /// The margin, px.
    pub margin_px: f64,
}

impl fmt::Display for LeftOut {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "left out within {} px of the image's edge, which may have cut its beacon: id {}",
            self.margin_px,
            list(&self.ids)
        )
    }
}

impl ImageEdges {
    /// Returns the edges of the image that a camera's detections come from.
    ///
    /// # Inputs
    /// * `camera`: made from `info`, with the same `rectified`. The edges are those after region of interest and
    ///   binning, since a region cuts beacons as well. Without a size of the image there is no edge.
    /// * `rectified`: if so, the raw image's edge counts too, provided that `K`, `D` and `R` are known.
    #[must_use]
    pub fn new(info: &CameraInfo, camera: &Camera, rectified: bool) -> Self {
        Self {
            size_px: camera.image_size_px(),
            raw: if rectified {
                RawImage::new(info, camera)
            } else {
                None
            },
        }
    }

    /// Returns the observations that are clear of the edges, and the ids of the others.
    ///
    /// # Inputs
    /// * `margin_px`: least distance from an edge, inside or outside; 0: no margin.
    #[must_use]
    pub fn leave_out(
        &self,
        mut observations: Vec<Observation>,
        margin_px: f64,
    ) -> (Vec<Observation>, LeftOut) {
        let mut ids = Vec::new();
        observations.retain(|seen| {
            let is_clear = self.is_clear(seen.pixel, margin_px);
            if !is_clear {
                ids.push(seen.id);
            }
            is_clear
        });
        (observations, LeftOut { ids, margin_px })
    }

    /// Returns whether a pixel is clear of the edges by this margin, px.
    #[must_use]
    pub fn is_clear(&self, pixel: Pixel, margin_px: f64) -> bool {
        self.distance_px(pixel) >= margin_px
    }

    /// Returns how far a pixel is from the nearest edge, inside or outside; infinity without an edge.
    fn distance_px(&self, pixel: Pixel) -> f64 {
        let own = self
            .size_px
            .map_or(f64::INFINITY, |size| to_border(pixel, size));
        let raw = self
            .raw
            .as_ref()
            .and_then(|raw| raw.distance_px(pixel))
            .unwrap_or(f64::INFINITY);
        own.min(raw)
    }
}

impl RawImage {
    /// Returns `None` if the camera info does not state how the rectified image was made.
    fn new(info: &CameraInfo, rectified: &Camera) -> Option<Self> {
        let camera = Camera::from_info(info, false).ok()?;
        let rectified_from_raw = Matrix3::from_row_slice(&info.r);
        let deviation = rectified_from_raw * rectified_from_raw.transpose() - Matrix3::identity();
        (deviation.amax() < ROTATION_TOLERANCE).then_some(Self {
            rectified: rectified.clone(),
            size_px: camera.image_size_px()?,
            camera,
            raw_from_rectified: rectified_from_raw.transpose(),
        })
    }

    /// Returns the distance of a rectified pixel from the nearest edge of the raw image, px of that image; `None` if
    /// the pixel has no counterpart there.
    fn distance_px(&self, rectified: Pixel) -> Option<f64> {
        let ray = self.rectified.ray_from_pixel(rectified).ok()?;
        let in_raw = self.raw_from_rectified * Vector3::new(ray.x, ray.y, 1.0);
        if in_raw.z <= 0.0 {
            return None;
        }
        let ray = Ray {
            x: in_raw.x / in_raw.z,
            y: in_raw.y / in_raw.z,
        };
        let (pixel, _) = self.camera.project(ray)?;
        Some(to_border(pixel, self.size_px))
    }
}

/// Returns the distance of a pixel from the border of an image, px. The border is the outer side of the outermost
/// pixels, whose centres are integers.
fn to_border(pixel: Pixel, (width, height): (u32, u32)) -> f64 {
    // Distance beyond the nearer of two opposite sides; negative between them.
    let beyond = |value: f64, length: u32| (-0.5 - value).max(value - (f64::from(length) - 0.5));
    let (u, v) = (beyond(pixel.u, width), beyond(pixel.v, height));
    if u <= 0.0 && v <= 0.0 {
        -u.max(v)
    } else {
        u.max(0.0).hypot(v.max(0.0))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::camera::RegionOfInterest;
    use nalgebra::Point3;

    const MARGIN_PX: f64 = 3.0;

    fn info() -> CameraInfo {
        CameraInfo {
            width: 640,
            height: 480,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![-0.3, 0.1, 0.0, 0.0, 0.0],
            k: [500.0, 0.0, 320.0, 0.0, 500.0, 240.0, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            // Zoomed out until the whole raw image is inside: black all around.
            p: [
                300.0, 0.0, 320.0, 0.0, 0.0, 300.0, 240.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            ..CameraInfo::default()
        }
    }

    fn is_left_out(info: &CameraInfo, rectified: bool, margin_px: f64, (u, v): (f64, f64)) -> bool {
        let camera = Camera::from_info(info, rectified).expect("a good camera");
        let seen = Observation {
            id: 7,
            marker_in_tanker: Point3::origin(),
            pixel: Pixel { u, v },
            sigma_px: 1.0,
        };
        let edges = ImageEdges::new(info, &camera, rectified);
        let (kept, left_out) = edges.leave_out(vec![seen], margin_px);
        assert_eq!(kept.len() + left_out.ids.len(), 1);
        kept.is_empty()
    }

    #[test]
    fn within_the_margin_of_any_edge_is_left_out_on_both_sides_of_it() {
        for (pixel, expected) in [
            ((2.4, 100.0), true),
            ((2.6, 100.0), false),
            ((636.6, 100.0), true),
            ((636.4, 100.0), false),
            ((100.0, 2.4), true),
            ((100.0, 476.6), true),
            ((100.0, 476.4), false),
            ((-3.4, 100.0), true),
            ((-3.6, 100.0), false),
            // Off the corner by 2 px in both: 2.8 px away.
            ((-2.5, -2.5), true),
            ((-2.9, -2.9), false),
            ((320.0, 240.0), false),
        ] {
            assert_eq!(
                is_left_out(&info(), false, MARGIN_PX, pixel),
                expected,
                "{pixel:?}"
            );
            assert!(!is_left_out(&info(), false, 0.0, pixel), "{pixel:?}");
        }
    }

    #[test]
    fn edges_are_those_of_what_is_read_out() {
        let read_out = CameraInfo {
            roi: RegionOfInterest {
                x_offset: 100,
                y_offset: 60,
                width: 400,
                height: 300,
                do_rectify: false,
            },
            binning_x: 2,
            binning_y: 1,
            ..info()
        };
        assert!(is_left_out(&read_out, false, MARGIN_PX, (198.0, 100.0)));
        assert!(!is_left_out(&read_out, false, MARGIN_PX, (190.0, 100.0)));
        assert!(is_left_out(&read_out, false, MARGIN_PX, (100.0, 298.0)));
    }

    #[test]
    fn without_a_size_there_is_no_edge() {
        let unknown = CameraInfo {
            width: 0,
            height: 0,
            ..info()
        };
        assert!(!is_left_out(&unknown, false, 100.0, (0.0, 0.0)));
    }

    #[test]
    fn the_raw_images_edge_counts_inside_the_rectified_one() {
        let info = info();
        let raw = Camera::from_info(&info, false).expect("a good camera");
        let rectified = Camera::from_info(&info, true).expect("a good camera");
        for (raw_u, expected) in [(1.0, true), (4.0, false), (-3.0, true)] {
            let ray = raw
                .ray_from_pixel(Pixel { u: raw_u, v: 240.0 })
                .expect("the lens reaches the edge");
            let (seen, _) = rectified.project(ray).expect("a pinhole");
            assert!(seen.u > 50.0, "far from the rectified image's own edge");
            let found = is_left_out(&info, true, MARGIN_PX, (seen.u, seen.v));
            assert_eq!(found, expected, "{raw_u}");
            // Without R the edge of the raw image is unknown.
            let unknown = CameraInfo {
                r: [0.0; 9],
                ..info.clone()
            };
            assert!(!is_left_out(&unknown, true, MARGIN_PX, (seen.u, seen.v)));
        }
        assert!(is_left_out(&info, true, MARGIN_PX, (1.0, 240.0)), "its own");
    }
}
