//! From a camera info to a checked camera.

use super::CameraError;
use super::distortion::{BrownConrady, Equidistant, Lens};
use super::image::{check_principal_point, image_size};
use super::info::CameraInfo;
use super::model::Camera;

/// Least focal length, px; with less, the numbers are probably not in pixels.
const MIN_FOCAL_LENGTH_PX: f64 = 1.0;
/// Largest focal length, px: a metre-long lens on one-micrometre pixels.
const MAX_FOCAL_LENGTH_PX: f64 = 1.0e6;
/// Largest distance of the principal point, px, if the image size is unknown.
const MAX_PRINCIPAL_POINT_PX: f64 = 1.0e6;
/// Largest skew, relative to the focal length, that counts as rounding: 1e-3 px at the edge of an image as wide as the
/// focal length.
const MAX_SKEW: f64 = 1.0e-6;
/// Least number of coefficients; missing ones after these are 0.
const MIN_COEFFICIENTS: usize = 4;
/// Largest distortion coefficient. Those of long lenses are large, because their rays are close to the axis.
const MAX_COEFFICIENT: f64 = 1.0e9;
/// Rounding tolerance for matrix entries with a prescribed value.
const FIXED_ENTRY_TOLERANCE: f64 = 1.0e-9;

/// Number of coefficients that an error stores.
const MAX_TOLD: usize = 16;
/// The supported models.
const KNOWN_MODELS: &str = "plumb_bob, rational_polynomial, equidistant";

/// Parts of vendors' names for fisheye models. These bend rays even if all coefficients are 0, so such a name is never
/// taken to mean "no distortion".
const FISHEYE_NAMES: [&str; 6] = ["fish", "equi", "kannala", "omni", "theta", "stereographic"];

impl Camera {
    /// Returns the checked camera that a camera info describes.
    ///
    /// # Inputs
    /// * `info`: the calibration. Its region of interest and binning are applied as `image_geometry`
    ///   does: the offset is subtracted from the principal point, then everything is divided by the
    ///   binning (0 means 1), without a shift by half a pixel. A width and height of 0 mean unknown.
    /// * `rectified`: whether pixels are those of the rectified image. If so, P is used without distortion; otherwise
    ///   K and D. Rays of rectified pixels are in the rectified camera frame: `r` is not used.
    ///
    /// # Errors
    /// [`CameraError`] with the invalid value: an uncalibrated camera, implausible numbers, skew, the baseline of a
    /// stereo pair, an unknown lens model or a wrong number of coefficients, a region or binning without pixels.
    ///
    /// # Source
    /// REP 104; `sensor_msgs/msg/CameraInfo`.
    pub fn from_info(info: &CameraInfo, rectified: bool) -> Result<Self, CameraError> {
        camera(info, rectified)
    }

    /// Returns the checked pinhole camera with these focal lengths and principal point, px.
    ///
    /// # Errors
    /// As [`Self::from_info`] with a `k` made of the four numbers.
    pub fn from_intrinsics(
        fx: f64,
        fy: f64,
        cx: f64,
        cy: f64,
        image_size: Option<(u32, u32)>,
    ) -> Result<Self, CameraError> {
        let (width, height) = image_size.unwrap_or_default();
        let k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        Self::from_info(
            &CameraInfo {
                height,
                width,
                k,
                ..CameraInfo::default()
            },
            false,
        )
    }
}

/// Returns the checked camera; see [`Camera::from_info`].
fn camera(info: &CameraInfo, rectified: bool) -> Result<Camera, CameraError> {
    // ROS marks an uncalibrated camera by k[0] alone, regardless of which matrix is used.
    if info.k[0] == 0.0 {
        return Err(CameraError::NotCalibrated { fx: info.k[0] });
    }
    let (intrinsics, lens) = if rectified {
        (projection(&info.p)?, None)
    } else {
        (
            camera_matrix(&info.k)?,
            lens(&info.distortion_model, &info.d)?,
        )
    };
    let image_size_px = image_size(info)?;
    check_principal_point(info, if rectified { "p" } else { "k" }, &intrinsics)?;
    let [fx, fy, cx, cy] = intrinsics;
    let (binning_x, binning_y) = (
        f64::from(info.binning_x.max(1)),
        f64::from(info.binning_y.max(1)),
    );
    Ok(Camera {
        fx: fx / binning_x,
        fy: fy / binning_y,
        cx: (cx - f64::from(info.roi.x_offset)) / binning_x,
        cy: (cy - f64::from(info.roi.y_offset)) / binning_y,
        image_size_px,
        lens,
    })
}

/// Returns `[fx, fy, cx, cy]` of K.
fn camera_matrix(k: &[f64; 9]) -> Result<[f64; 4], CameraError> {
    check_finite("k", k)?;
    check_skew("k", k, 1)?;
    check_fixed("k", k, &[(3, 0.0), (6, 0.0), (7, 0.0), (8, 1.0)])?;
    check_intrinsics("k", k, [0, 4, 2, 5])
}

/// Returns `[fx, fy, cx, cy]` of P.
fn projection(p: &[f64; 12]) -> Result<[f64; 4], CameraError> {
    if p[0] == 0.0 {
        return Err(CameraError::NoProjection { fx: p[0] });
    }
    check_finite("p", p)?;
    for index in [3, 7] {
        if p[index].abs() > FIXED_ENTRY_TOLERANCE {
            return Err(CameraError::Baseline {
                index,
                value: p[index],
            });
        }
    }
    check_skew("p", p, 1)?;
    check_fixed(
        "p",
        p,
        &[(4, 0.0), (8, 0.0), (9, 0.0), (10, 1.0), (11, 0.0)],
    )?;
    check_intrinsics("p", p, [0, 5, 2, 6])
}

fn check_finite(array: &'static str, values: &[f64]) -> Result<(), CameraError> {
    match values
        .iter()
        .enumerate()
        .find(|(_, value)| !value.is_finite())
    {
        Some((index, &value)) => Err(CameraError::NotFinite {
            array,
            index,
            value,
        }),
        None => Ok(()),
    }
}

fn check_fixed(
    array: &'static str,
    values: &[f64],
    fixed: &[(usize, f64)],
) -> Result<(), CameraError> {
    for &(index, expected) in fixed {
        let value = values[index];
        if (value - expected).abs() > FIXED_ENTRY_TOLERANCE {
            return Err(CameraError::FixedEntry {
                array,
                index,
                expected,
                value,
            });
        }
    }
    Ok(())
}

fn check_skew(array: &'static str, values: &[f64], index: usize) -> Result<(), CameraError> {
    let (skew, limit) = (values[index], MAX_SKEW * values[0].abs());
    if skew.abs() > limit {
        return Err(CameraError::Skew {
            array,
            index,
            value: skew,
            limit,
        });
    }
    Ok(())
}

/// Returns the values at the indices of fx, fy, cx, cy.
fn check_intrinsics(
    array: &'static str,
    values: &[f64],
    indices: [usize; 4],
) -> Result<[f64; 4], CameraError> {
    let (min, max) = (MIN_FOCAL_LENGTH_PX, MAX_FOCAL_LENGTH_PX);
    for &index in &indices[..2] {
        let value = values[index];
        if !(min..=max).contains(&value) {
            return Err(CameraError::FocalLength {
                array,
                index,
                value,
                min,
                max,
            });
        }
    }
    for &index in &indices[2..] {
        let value = values[index];
        if value.abs() > MAX_PRINCIPAL_POINT_PX {
            return Err(CameraError::PrincipalPoint {
                array,
                index,
                value,
                limit: MAX_PRINCIPAL_POINT_PX,
            });
        }
    }
    Ok(indices.map(|index| values[index]))
}

/// Returns the lens of the raw image; `None` without distortion.
fn lens(model: &str, d: &[f64]) -> Result<Option<Lens>, CameraError> {
    check_finite("d", d)?;
    if let Some((index, &value)) = d
        .iter()
        .enumerate()
        .find(|(_, value)| value.abs() > MAX_COEFFICIENT)
    {
        return Err(CameraError::CoefficientTooLarge {
            index,
            value,
            limit: MAX_COEFFICIENT,
        });
    }
    let all_zero = d.iter().all(|&value| value == 0.0);
    match model {
        "equidistant" => {
            let k = coefficients(model, d, "4")?;
            Ok(Some(Lens::Equidistant(Equidistant::new(k))))
        }
        "plumb_bob" | "rational_polynomial" if all_zero => Ok(None),
        "plumb_bob" => {
            let [k1, k2, p1, p2, k3] = coefficients(model, d, "4 or 5")?;
            Ok(Some(brown_conrady([k1, k2, k3, 0.0, 0.0, 0.0], [p1, p2])))
        }
        // OpenCV's longer vectors continue with thin prism and tilt, which ROS's model does not have.
        "rational_polynomial" => {
            let [k1, k2, p1, p2, k3, k4, k5, k6] = coefficients(model, d, "4 to 8")?;
            Ok(Some(brown_conrady([k1, k2, k3, k4, k5, k6], [p1, p2])))
        }
        _ if all_zero && !names_a_fisheye(model) => Ok(None),
        _ => Err(CameraError::UnknownDistortionModel {
            model: model.to_owned(),
            d: d.iter().take(MAX_TOLD).copied().collect(),
            known: KNOWN_MODELS,
            hint: if names_a_fisheye(model) {
                "; ROS calls OpenCV's fisheye model (4 coefficients) `equidistant`"
            } else {
                ""
            },
        }),
    }
}

/// Returns a model's coefficients. Missing ones at the end are 0; additional ones must be 0.
///
/// Both are common: some drivers use one message for every lens and pad with zeros, and calibrations omit what they did
/// not estimate.
fn coefficients<const N: usize>(
    model: &str,
    d: &[f64],
    need: &'static str,
) -> Result<[f64; N], CameraError> {
    let rest_is_zero = d.iter().skip(N).all(|&value| value == 0.0);
    if d.len() < MIN_COEFFICIENTS || !rest_is_zero {
        return Err(CameraError::CoefficientCount {
            model: model.to_owned(),
            need,
            got: d.len(),
            d: d.iter().take(MAX_TOLD).copied().collect(),
        });
    }
    let mut filled = [0.0; N];
    for (to, &from) in filled.iter_mut().zip(d) {
        *to = from;
    }
    Ok(filled)
}

fn brown_conrady(radial: [f64; 6], tangential: [f64; 2]) -> Lens {
    Lens::BrownConrady(BrownConrady::new(radial, tangential))
}

fn names_a_fisheye(model: &str) -> bool {
    let model = model.to_lowercase();
    FISHEYE_NAMES.iter().any(|part| model.contains(part))
}
