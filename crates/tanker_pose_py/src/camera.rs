//! Checked cameras, from calibration files, dicts and plain numbers.

use std::path::PathBuf;

use pyo3::prelude::*;
use pyo3::types::PyDict;
use tanker_pose::camera::{Camera, CameraInfo, RegionOfInterest};
use tanker_pose::pipeline::ImageEdges;
use tanker_pose::text_file;

use crate::errors::value_error;

/// A checked camera.
#[pyclass(frozen, name = "Camera", module = "tanker_pose_estimator")]
pub struct PyCamera {
    pub info: CameraInfo,
    pub camera: Camera,
    pub edges: ImageEdges,
    pub rectified: bool,
}

impl PyCamera {
    fn new(info: CameraInfo, rectified: bool) -> PyResult<Self> {
        let camera = Camera::from_info(&info, rectified).map_err(value_error)?;
        let edges = ImageEdges::new(&info, &camera, rectified);
        Ok(Self {
            info,
            camera,
            edges,
            rectified,
        })
    }
}

#[pymethods]
impl PyCamera {
    /// A pinhole camera. fx, fy, cx, cy in px; the centre of the top-left pixel is (0, 0). Without width and height the
    /// size of the image is unknown, and no detection is left out at its edge.
    #[new]
    #[pyo3(signature = (fx, fy, cx, cy, *, width=0, height=0))]
    fn py_new(fx: f64, fy: f64, cx: f64, cy: f64, width: u32, height: u32) -> PyResult<Self> {
        let k = [fx, 0.0, cx, 0.0, fy, cy, 0.0, 0.0, 1.0];
        let info = CameraInfo {
            height,
            width,
            k,
            ..CameraInfo::default()
        };
        Self::new(info, false)
    }

    /// A camera from a calibration file as ROS's camera_calibration writes it. What the file leaves open and the reader
    /// assumes is a UserWarning. rectified: pixels are those of the rectified image, P instead of K and D.
    #[staticmethod]
    #[pyo3(signature = (path, *, rectified=false))]
    fn from_file(py: Python<'_>, path: PathBuf, rectified: bool) -> PyResult<Self> {
        let text = text_file::read(&path)?;
        let (info, warnings) =
            CameraInfo::from_yaml(&text, &path.display().to_string()).map_err(value_error)?;
        let category = py.get_type::<pyo3::exceptions::PyUserWarning>();
        for warning in warnings {
            let words = std::ffi::CString::new(warning.to_string())?;
            PyErr::warn(py, &category, &words, 1)?;
        }
        Self::new(info, rectified)
    }

    /// A camera from a dict with the fields of sensor_msgs/CameraInfo: k (9 numbers, row by row), and, unless they are 0
    /// or empty, width, height, distortion_model, d, r (9), p (12), binning_x, binning_y, roi (dict with x_offset,
    /// y_offset, height, width, do_rectify). Arrays of any shape with that many numbers are accepted.
    #[staticmethod]
    #[pyo3(signature = (fields, *, rectified=false))]
    fn from_dict(fields: &Bound<'_, PyDict>, rectified: bool) -> PyResult<Self> {
        Self::new(info(fields)?, rectified)
    }

    /// Width and height of the image that detections come from, px; None if unknown.
    #[getter]
    fn image_size(&self) -> Option<(u32, u32)> {
        self.camera.image_size_px()
    }

    /// Whether pixels are those of the rectified image.
    #[getter]
    fn rectified(&self) -> bool {
        self.rectified
    }

    fn __repr__(&self) -> String {
        let [fx, _, cx, _, fy, cy, ..] = self.info.k;
        let CameraInfo {
            width,
            height,
            distortion_model,
            ..
        } = &self.info;
        format!(
            "Camera(fx={fx}, fy={fy}, cx={cx}, cy={cy}, width={width}, height={height}, distortion_model={distortion_model:?}, rectified={})",
            if self.rectified { "True" } else { "False" }
        )
    }
}

fn info(fields: &Bound<'_, PyDict>) -> PyResult<CameraInfo> {
    let mut info = CameraInfo::default();
    let mut has_k = false;
    for (name, value) in fields {
        let name: String = name.extract()?;
        match name.as_str() {
            "header" => {}
            "width" => info.width = whole("width", &value)?,
            "height" => info.height = whole("height", &value)?,
            "distortion_model" => info.distortion_model = value.extract()?,
            "d" | "D" => info.d = numbers("d", &value)?,
            "k" | "K" => {
                has_k = true;
                info.k = matrix("k", &value)?;
            }
            "r" | "R" => info.r = matrix("r", &value)?,
            "p" | "P" => info.p = matrix("p", &value)?,
            "binning_x" => info.binning_x = whole("binning_x", &value)?,
            "binning_y" => info.binning_y = whole("binning_y", &value)?,
            "roi" => info.roi = region(value.cast::<PyDict>()?)?,
            _ => {
                return Err(value_error(format!(
                    "unknown field {name:?} of a camera info"
                )));
            }
        }
    }
    if !has_k {
        return Err(value_error("missing field \"k\" of a camera info"));
    }
    Ok(info)
}

fn region(fields: &Bound<'_, PyDict>) -> PyResult<RegionOfInterest> {
    let mut region = RegionOfInterest::default();
    for (name, value) in fields {
        let name: String = name.extract()?;
        match name.as_str() {
            "x_offset" => region.x_offset = whole("x_offset", &value)?,
            "y_offset" => region.y_offset = whole("y_offset", &value)?,
            "height" => region.height = whole("height", &value)?,
            "width" => region.width = whole("width", &value)?,
            "do_rectify" => region.do_rectify = value.extract()?,
            _ => {
                return Err(value_error(format!(
                    "unknown field {name:?} of a region of interest"
                )));
            }
        }
    }
    Ok(region)
}

fn whole(name: &str, value: &Bound<'_, PyAny>) -> PyResult<u32> {
    value.extract().map_err(|_| {
        value_error(format!(
            "camera: expected a whole number from 0 to {} in {name}",
            u32::MAX
        ))
    })
}

fn numbers(name: &str, value: &Bound<'_, PyAny>) -> PyResult<Vec<f64>> {
    let array = crate::arrays::doubles(value)
        .map_err(|error| value_error(format!("camera: {name}: {}", error.value(value.py()))))?;
    Ok(array.as_slice()?.to_vec())
}

fn matrix<const N: usize>(name: &str, value: &Bound<'_, PyAny>) -> PyResult<[f64; N]> {
    let found = numbers(name, value)?;
    let got = found.len();
    found
        .try_into()
        .map_err(|_| value_error(format!("camera: expected {N} numbers in {name}, got {got}")))
}
