//! Checks of the input before any computation.

use nalgebra::Point3;
use smallvec::SmallVec;

use super::refusal::{MAX_SIGMA_PX, MIN_SIGMA_PX, Refusal};
use super::{Detection, Stamp};
use crate::camera::{Camera, Pixel};
use crate::estimation::Observation;
use crate::text::MAX_NAME_BYTES;

/// px; limit of pixels if the image size is unknown.
const MAX_PIXEL: f64 = 1e5;
/// Most detections of a frame that are checked without the heap.
pub const MOST_INLINE_DETECTIONS: usize = 64;

pub(super) fn check_stamp(stamp: Stamp) -> Result<(), Refusal> {
    let is_zero = stamp.sec == 0 && stamp.nanosec == 0;
    if is_zero || stamp.sec < 0 || stamp.nanosec >= 1_000_000_000 {
        return Err(Refusal::InvalidStamp(stamp));
    }
    Ok(())
}

/// Checked first, because a refusal echoes the header too.
pub(super) fn check_frame_id_length(got: &str) -> Result<(), Refusal> {
    if got.len() <= MAX_NAME_BYTES {
        return Ok(());
    }
    Err(Refusal::FrameIdTooLong {
        got: got.to_owned(),
    })
}

pub(super) fn check_frame_id(expected: &str, got: &str) -> Result<(), Refusal> {
    if got.is_empty() || expected != got {
        return Err(Refusal::FrameMismatch {
            expected: expected.to_owned(),
            got: got.to_owned(),
        });
    }
    Ok(())
}

/// Returns the detections as observations, in their order.
///
/// # Inputs
/// * `default_sigma_px`: for detections with sigma 0.
/// * `marker_in_tanker`: returns the position of a marker, m; `None` for an unknown id.
///
/// # Errors
/// [`Refusal`] for the first error: pixel not finite, sigma out of range, unknown id, duplicate id, pixel far outside
/// the image. One invalid detection refuses the frame, because the others of that detector are then not reliable
/// either.
pub fn observe(
    camera: &Camera,
    detections: &[Detection],
    default_sigma_px: f64,
    marker_in_tanker: impl Fn(u32) -> Option<Point3<f64>>,
) -> Result<Vec<Observation>, Refusal> {
    let observations = detections
        .iter()
        .map(|seen| {
            check_detection(camera, seen, default_sigma_px, &marker_in_tanker)
                .map_err(|fault| refusal(fault, camera, seen, detections, &marker_in_tanker))
        })
        .collect::<Result<Vec<_>, Refusal>>()?;
    check_unique(detections)?;
    Ok(observations)
}

/// What is wrong with a detection, without words.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Fault {
    NotFinite,
    Sigma,
    UnknownId,
    OutsideImage,
}

/// Returns a detection as an observation; see [`observe`].
pub(super) fn check_detection(
    camera: &Camera,
    seen: &Detection,
    default_sigma_px: f64,
    marker_in_tanker: impl Fn(u32) -> Option<Point3<f64>>,
) -> Result<Observation, Fault> {
    let Detection {
        id,
        u_px,
        v_px,
        sigma_px,
    } = *seen;
    if !(u_px.is_finite() && v_px.is_finite()) {
        return Err(Fault::NotFinite);
    }
    if sigma_px != 0.0 && !(MIN_SIGMA_PX..=MAX_SIGMA_PX).contains(&sigma_px) {
        return Err(Fault::Sigma);
    }
    let marker_in_tanker = marker_in_tanker(id).ok_or(Fault::UnknownId)?;
    if !is_in_image(camera, seen) {
        return Err(Fault::OutsideImage);
    }
    Ok(Observation {
        id,
        marker_in_tanker,
        pixel: Pixel { u: u_px, v: v_px },
        sigma_px: if sigma_px == 0.0 {
            default_sigma_px
        } else {
            sigma_px
        },
    })
}

/// Returns whether a pixel can be of this image.
///
/// A centroid may be slightly outside the image. A pixel that is outside by more than the image's width or height is
/// garbage, or belongs to a `camera_info` of another resolution.
fn is_in_image(camera: &Camera, seen: &Detection) -> bool {
    let size = camera.image_size_px();
    let within = |value: f64, length: Option<u32>| {
        let length = length.map_or(MAX_PIXEL, f64::from);
        (-length..=2.0 * length).contains(&value)
    };
    within(seen.u_px, size.map(|s| s.0)) && within(seen.v_px, size.map(|s| s.1))
}

fn refusal(
    fault: Fault,
    camera: &Camera,
    seen: &Detection,
    detections: &[Detection],
    known: impl Fn(u32) -> Option<Point3<f64>>,
) -> Refusal {
    let Detection {
        id,
        u_px,
        v_px,
        sigma_px,
    } = *seen;
    match fault {
        Fault::NotFinite => Refusal::NotFinite { id, u_px, v_px },
        Fault::Sigma => Refusal::InvalidSigma { id, sigma_px },
        Fault::UnknownId => unknown_ids(detections, known),
        Fault::OutsideImage => {
            let size = camera.image_size_px();
            let image = size.map_or("image".to_owned(), |(width, height)| {
                format!("{width} × {height} image")
            });
            Refusal::OutsideImage {
                id,
                reason: format!(
                    "expected a pixel in or near the {image}, got ({u_px:?}, {v_px:?})"
                ),
            }
        }
    }
}

/// Returns an id that is there twice: the smallest.
pub(super) fn first_duplicate(detections: &[Detection]) -> Option<u32> {
    let mut ids: SmallVec<[u32; MOST_INLINE_DETECTIONS]> =
        detections.iter().map(|seen| seen.id).collect();
    ids.sort_unstable();
    ids.windows(2)
        .find(|pair| pair[0] == pair[1])
        .map(|pair| pair[0])
}

fn check_unique(detections: &[Detection]) -> Result<(), Refusal> {
    let Some(id) = first_duplicate(detections) else {
        return Ok(());
    };
    let count = detections.iter().filter(|seen| seen.id == id).count();
    Err(Refusal::DuplicateId { id, count })
}

fn unknown_ids(detections: &[Detection], known: impl Fn(u32) -> Option<Point3<f64>>) -> Refusal {
    let mut ids: Vec<u32> = detections
        .iter()
        .map(|seen| seen.id)
        .filter(|&id| known(id).is_none())
        .collect();
    ids.sort_unstable();
    ids.dedup();
    Refusal::UnknownId { ids }
}
