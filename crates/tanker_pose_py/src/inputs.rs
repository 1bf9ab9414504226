//! The detections of frames, from arrays.

use numpy::{PyReadonlyArrayDyn, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use tanker_pose::pipeline::Detection;

use crate::arrays::{doubles, switches};
use crate::errors::value_error;

/// Standard deviations of pixels.
pub enum Sigmas<'py> {
    /// One for all; 0: not stated.
    One(f64),
    /// One a point.
    OfPoints(PyReadonlyArrayDyn<'py, f64>),
    /// One a point of each frame.
    OfFrames(PyReadonlyArrayDyn<'py, f64>),
}

/// The same without Python.
#[derive(Clone, Copy)]
pub enum SigmaSlices<'a> {
    One(f64),
    OfPoints(&'a [f64]),
    OfFrames(&'a [f64]),
}

impl<'py> Sigmas<'py> {
    /// Reads a number, an array (N,) or, for many frames, (F, N).
    pub fn read(
        value: Option<&Bound<'py, PyAny>>,
        points: usize,
        frames: Option<usize>,
    ) -> PyResult<Self> {
        let Some(value) = value else {
            return Ok(Self::One(0.0));
        };
        // An array of one number would pass as a number.
        if !value.is_instance_of::<PyUntypedArray>()
            && let Ok(sigma_px) = value.extract::<f64>()
        {
            return Ok(Self::One(sigma_px));
        }
        let array = doubles(value)?;
        match (array.shape(), frames) {
            (&[n], _) if n == points => Ok(Self::OfPoints(array)),
            (&[f, n], Some(frames)) if (f, n) == (frames, points) => Ok(Self::OfFrames(array)),
            (got, frames) => {
                let of_frames =
                    frames.map_or(String::new(), |frames| format!(" or ({frames}, {points})"));
                Err(value_error(format!(
                    "sigma_px: expected a number or an array of shape ({points},){of_frames}, got shape {got:?}"
                )))
            }
        }
    }

    pub fn slices(&self) -> PyResult<SigmaSlices<'_>> {
        Ok(match self {
            Self::One(sigma_px) => SigmaSlices::One(*sigma_px),
            Self::OfPoints(array) => SigmaSlices::OfPoints(array.as_slice()?),
            Self::OfFrames(array) => SigmaSlices::OfFrames(array.as_slice()?),
        })
    }
}

impl SigmaSlices<'_> {
    fn at(&self, frame: usize, point: usize, points: usize) -> f64 {
        match self {
            Self::One(sigma_px) => *sigma_px,
            Self::OfPoints(sigmas) => sigmas[point],
            Self::OfFrames(sigmas) => sigmas[frame * points + point],
        }
    }
}

/// Reads the pixels of one frame, (N, 2).
pub fn pixels_of_frame<'py>(
    value: &Bound<'py, PyAny>,
    points: usize,
) -> PyResult<PyReadonlyArrayDyn<'py, f64>> {
    let array = doubles(value)?;
    if array.shape() == [points, 2] {
        return Ok(array);
    }
    let got = array.shape();
    Err(value_error(format!(
        "pixels: expected an array of shape ({points}, 2), got shape {got:?}"
    )))
}

/// Reads the pixels of many frames, (F, N, 2).
pub fn pixels_of_frames<'py>(
    value: &Bound<'py, PyAny>,
    points: usize,
) -> PyResult<(PyReadonlyArrayDyn<'py, f64>, usize)> {
    let array = doubles(value)?;
    if let &[frames, n, 2] = array.shape()
        && n == points
    {
        return Ok((array, frames));
    }
    let got = array.shape();
    Err(value_error(format!(
        "pixels: expected an array of shape (frames, {points}, 2), got shape {got:?}"
    )))
}

/// Reads which points are seen in which frames, (F, N).
pub fn visible_points<'py>(
    value: Option<&Bound<'py, PyAny>>,
    points: usize,
    frames: usize,
) -> PyResult<Option<PyReadonlyArrayDyn<'py, bool>>> {
    let Some(value) = value else { return Ok(None) };
    let array = switches("visible", value)?;
    if array.shape() == [frames, points] {
        return Ok(Some(array));
    }
    let got = array.shape();
    Err(value_error(format!(
        "visible: expected an array of shape ({frames}, {points}), got shape {got:?}"
    )))
}

/// The numbers of many frames.
#[derive(Clone, Copy)]
pub struct Frames<'a> {
    pub ids: &'a [u32],
    pub pixels: &'a [f64],
    pub sigmas: SigmaSlices<'a>,
    pub visible: Option<&'a [bool]>,
}

impl Frames<'_> {
    /// Puts the detections of one frame into `detections`.
    pub fn detections(&self, frame: usize, detections: &mut Vec<Detection>) {
        let points = self.ids.len();
        detections.clear();
        for (point, &id) in self.ids.iter().enumerate() {
            let place = frame * points + point;
            if self.visible.is_some_and(|visible| !visible[place]) {
                continue;
            }
            detections.push(Detection {
                id,
                u_px: self.pixels[2 * place],
                v_px: self.pixels[2 * place + 1],
                sigma_px: self.sigmas.at(frame, point, points),
            });
        }
    }
}
