//! Why a camera info cannot be used, and why a pixel has no ray.

use crate::text::{clip, list};

/// Why a camera info cannot be used.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum CameraError {
    /// The intrinsics are all zero, which is how ROS marks an uncalibrated camera.
    #[error("the camera is not calibrated (k[0] is {fx:?})")]
    NotCalibrated { fx: f64 },
    /// Rectified pixels are configured, but the projection of the rectified image is zero.
    #[error("the camera has no projection for rectified pixels (p[0] is {fx:?})")]
    NoProjection { fx: f64 },
    /// A number that is needed is NaN or infinite.
    #[error("{array}[{index}] must be finite, got {value:?}")]
    NotFinite {
        array: &'static str,
        index: usize,
        value: f64,
    },
    /// An implausible focal length: negative, not in pixels, or off by orders of magnitude.
    #[error("{array}[{index}], a focal length, must be {min} to {max:e} px, got {value:?}")]
    FocalLength {
        array: &'static str,
        index: usize,
        value: f64,
        min: f64,
        max: f64,
    },
    /// An implausibly distant principal point.
    #[error(
        "{array}[{index}], the principal point, must be within {limit:e} px of the image, got {value:?}"
    )]
    PrincipalPoint {
        array: &'static str,
        index: usize,
        value: f64,
        limit: f64,
    },
    /// A principal point far outside an image of known size.
    #[error(
        "the principal point ({cx}, {cy}) of {array} lies more than one image size outside the image of \
         {width}x{height}: the calibration belongs to another resolution, or the image is a region of a larger one \
         (set roi, and width and height of the full image)"
    )]
    PrincipalPointOutside {
        array: &'static str,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
    },
    /// The calibration's error budget names a coefficient that this lens model does not have.
    #[error(
        "the calibration's error budget names {name}, which the lens model equidistant does not have"
    )]
    BudgetOfOtherLens { name: &'static str },
    /// Width and height are swapped.
    #[error(
        "width {width} and height {height} are exchanged, or belong to another calibration: the principal point \
         ({cx}, {cy}) is the centre of an image of {height}x{width}"
    )]
    SizeExchanged {
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
    },
    /// The intrinsics are those of the binned image; those of full resolution are needed.
    #[error(
        "the principal point ({cx}, {cy}) of {array} is the centre of the image after binning by \
         {binning_x}x{binning_y}: k and p must be those of the full resolution, or set binning to 1"
    )]
    BinningApplied {
        array: &'static str,
        cx: f64,
        cy: f64,
        binning_x: u32,
        binning_y: u32,
    },
    /// The intrinsics belong to another resolution, or to the full image where only a part is read out.
    #[error(
        "the principal point ({cx}, {cy}) of {array} is the centre of an image of {}x{}, but width and height are \
         {width}x{height}: calibrate at the resolution that is used, or scale {array} to it; if the image is a part of \
         a larger one, set roi, and width and height of the full image",
        (2.0 * cx).round(),
        (2.0 * cy).round()
    )]
    OtherResolution {
        array: &'static str,
        cx: f64,
        cy: f64,
        width: u32,
        height: u32,
    },
    /// Skew, which is not supported.
    #[error("{array}[{index}], the skew, must be 0 (up to {limit:.1e} px), got {value:?}")]
    Skew {
        array: &'static str,
        index: usize,
        value: f64,
        limit: f64,
    },
    /// An entry whose value the matrix's form prescribes.
    #[error("{array}[{index}] must be {expected}, got {value:?}")]
    FixedEntry {
        array: &'static str,
        index: usize,
        expected: f64,
        value: f64,
    },
    /// The projection belongs to the second camera of a stereo pair.
    #[error(
        "p[{index}] must be 0, got {value:?}: it holds a stereo pair's baseline, and the projection of one camera is needed"
    )]
    Baseline { index: usize, value: f64 },
    /// An unknown lens model.
    #[error(
        "distortion model `{}` with d = [{}] is unknown; known models are {known}{hint}",
        clip(model),
        list(d)
    )]
    UnknownDistortionModel {
        model: String,
        d: Vec<f64>,
        known: &'static str,
        hint: &'static str,
    },
    /// The number of coefficients does not match the lens model.
    #[error(
        "distortion model `{}` needs {need} coefficients (more only if those are 0), got {got}: d = [{}]",
        clip(model),
        list(d)
    )]
    CoefficientCount {
        model: String,
        need: &'static str,
        got: usize,
        d: Vec<f64>,
    },
    /// An implausible distortion coefficient.
    #[error("d[{index}] must be within {limit:e}, got {value:?}")]
    CoefficientTooLarge {
        index: usize,
        value: f64,
        limit: f64,
    },
    /// Only one dimension of the image is given.
    #[error(
        "image width and height must both be positive, or both 0 for unknown, got {width}x{height}"
    )]
    ImageSize { width: u32, height: u32 },
    /// An empty region of interest that is not all zero (all zero means the whole image).
    #[error("the region of interest has no pixels: {width}x{height} at ({x_offset}, {y_offset})")]
    EmptyRegion {
        width: u32,
        height: u32,
        x_offset: u32,
        y_offset: u32,
    },
    /// The region of interest extends beyond the image.
    #[error(
        "the region of interest, {width}x{height} at ({x_offset}, {y_offset}), reaches beyond the image of {image_width}x{image_height}"
    )]
    RegionOutsideImage {
        width: u32,
        height: u32,
        x_offset: u32,
        y_offset: u32,
        image_width: u32,
        image_height: u32,
    },
    /// The binning leaves no pixel.
    #[error("binning {binning_x}x{binning_y} leaves no pixel of {width}x{height}")]
    BinningTooLarge {
        binning_x: u32,
        binning_y: u32,
        width: u32,
        height: u32,
    },
}

/// Why a pixel has no ray.
#[derive(Debug, Clone, Copy, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum UndistortError {
    /// The pixel is NaN or infinite, or so large that its ray is not finite.
    #[error("pixel ({u:?}, {v:?}) must be finite and have a finite ray")]
    NotFinite { u: f64, v: f64 },
    /// The pixel is outside the valid region of the lens model.
    #[error(
        "pixel ({u:?}, {v:?}) lies outside the valid region of the lens model: its distorted radius is \
         {radius:.6} on the plane z = 1, the model reaches {max_radius:.6} in this direction"
    )]
    OutsideValidRegion {
        u: f64,
        v: f64,
        radius: f64,
        max_radius: f64,
    },
}
