//! Size of the image, and checks of the principal point against it.

use std::fmt;

use super::CameraError;
use super::info::{CameraInfo, RegionOfInterest};

/// Largest distance of the principal point from the image, in image sizes. A crop from the corner of a sensor twice as
/// wide and high still passes.
const MAX_SIZES_OUTSIDE: f64 = 1.0;
/// Usual distance of the principal point from the centre of the image, in image sizes.
const USUAL_OFFSET: f64 = 0.04;
/// From this offset on, in image sizes, another interpretation of the numbers is considered if it puts the principal
/// point at the centre.
const UNUSUAL_OFFSET: f64 = 0.08;
/// Largest ratio between the aspect ratios of two common image formats (16:9 and 5:4), with some margin for the
/// principal points.
const MAX_ASPECT_CHANGE: f64 = 1.5;

/// Returns the size of the image that detections come from; `None` if it is unknown.
pub(super) fn image_size(info: &CameraInfo) -> Result<Option<(u32, u32)>, CameraError> {
    let full = full_size(info.width, info.height)?;
    let RegionOfInterest {
        x_offset,
        y_offset,
        width,
        height,
        do_rectify: _,
    } = info.roi;
    let read_out = if (x_offset, y_offset, width, height) == (0, 0, 0, 0) {
        full
    } else {
        if width == 0 || height == 0 {
            return Err(CameraError::EmptyRegion {
                width,
                height,
                x_offset,
                y_offset,
            });
        }
        if let Some((image_width, image_height)) = full {
            let right = u64::from(x_offset) + u64::from(width);
            let bottom = u64::from(y_offset) + u64::from(height);
            if right > u64::from(image_width) || bottom > u64::from(image_height) {
                return Err(CameraError::RegionOutsideImage {
                    width,
                    height,
                    x_offset,
                    y_offset,
                    image_width,
                    image_height,
                });
            }
        }
        Some((width, height))
    };
    let Some((width, height)) = read_out else {
        return Ok(None);
    };
    let binned = (
        width / info.binning_x.max(1),
        height / info.binning_y.max(1),
    );
    if binned.0 == 0 || binned.1 == 0 {
        let (binning_x, binning_y) = (info.binning_x, info.binning_y);
        return Err(CameraError::BinningTooLarge {
            binning_x,
            binning_y,
            width,
            height,
        });
    }
    Ok(Some(binned))
}

fn full_size(width: u32, height: u32) -> Result<Option<(u32, u32)>, CameraError> {
    match (width, height) {
        (0, 0) => Ok(None),
        (0, _) | (_, 0) => Err(CameraError::ImageSize { width, height }),
        _ => Ok(Some((width, height))),
    }
}

/// Checks the principal point against the size of the full image, if that is known.
///
/// Also detects three mistakes that leave each number plausible and the pose wrong: swapped width and height,
/// intrinsics of the binned image together with a binning, and a calibration made at another resolution.
pub(super) fn check_principal_point(
    info: &CameraInfo,
    array: &'static str,
    &[_, _, cx, cy]: &[f64; 4],
) -> Result<(), CameraError> {
    let (width, height) = (f64::from(info.width), f64::from(info.height));
    if width == 0.0 || height == 0.0 {
        return Ok(());
    }
    let margin = MAX_SIZES_OUTSIDE;
    let is_far = |centre: f64, size: f64| centre < -margin * size || centre > (1.0 + margin) * size;
    if is_far(cx, width) || is_far(cy, height) {
        return Err(CameraError::PrincipalPointOutside {
            array,
            cx,
            cy,
            width: info.width,
            height: info.height,
        });
    }
    let offset = |width: f64, height: f64| -> [f64; 2] {
        [(cx / width - 0.5).abs(), (cy / height - 0.5).abs()]
    };
    let is_usual = |offsets: [f64; 2]| offsets.iter().all(|&offset| offset < USUAL_OFFSET);
    let is_unusual = offset(width, height)
        .iter()
        .all(|&offset| offset > UNUSUAL_OFFSET);
    if is_unusual && is_usual(offset(height, width)) {
        return Err(CameraError::SizeExchanged {
            cx,
            cy,
            width: info.width,
            height: info.height,
        });
    }
    let (binning_x, binning_y) = (info.binning_x.max(1), info.binning_y.max(1));
    let binned = offset(width / f64::from(binning_x), height / f64::from(binning_y));
    if binning_x > 1 && binning_y > 1 && is_unusual && is_usual(binned) {
        return Err(CameraError::BinningApplied {
            array,
            cx,
            cy,
            binning_x,
            binning_y,
        });
    }
    if is_of_another_resolution([cx / width, cy / height]) {
        return Err(CameraError::OtherResolution {
            array,
            cx,
            cy,
            width: info.width,
            height: info.height,
        });
    }
    Ok(())
}

/// Returns whether a principal point, in image sizes, would be the centre of another image: one that is larger or
/// smaller in both directions, with a similar aspect ratio.
///
/// A crop that removes both the left and the upper part of the sensor's image (or the right and the lower) looks the
/// same. It is refused too: a region of interest would make its numbers unambiguous, and without one the alternative is
/// a pose at twice the distance that looks right.
fn is_of_another_resolution([x, y]: [f64; 2]) -> bool {
    let (most, least) = (x.max(y), x.min(y));
    let is_larger = least > 0.5 + UNUSUAL_OFFSET;
    let is_smaller = most < 0.5 - UNUSUAL_OFFSET && least >= 0.0;
    (is_larger || is_smaller) && most <= MAX_ASPECT_CHANGE * least
}

/// A principal point that is far from the centre of the image but may be right; displays as a warning.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct OffCentre {
    cx: f64,
    cy: f64,
    width: u32,
    height: u32,
}

impl fmt::Display for OffCentre {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            cx,
            cy,
            width,
            height,
        } = self;
        write!(
            f,
            "the principal point ({cx}, {cy}) is far from the centre of the image of {width}x{height}: this is right if the image \
             is a part of a larger one (better declared with roi, and width and height of the full image), and wrong if \
             the calibration was made at another resolution"
        )
    }
}

impl CameraInfo {
    /// Returns a warning if the principal point is off the centre by more than 8 % of the image size.
    #[must_use]
    pub fn off_centre(&self, rectified: bool) -> Option<OffCentre> {
        let (cx, cy) = if rectified {
            (self.p[2], self.p[6])
        } else {
            (self.k[2], self.k[5])
        };
        let is_off = |centre: f64, size: u32| {
            size > 0 && (centre / f64::from(size) - 0.5).abs() > UNUSUAL_OFFSET
        };
        let (width, height) = (self.width, self.height);
        (is_off(cx, width) || is_off(cy, height)).then_some(OffCentre {
            cx,
            cy,
            width,
            height,
        })
    }
}
