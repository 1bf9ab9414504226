//! Reads the calibration file format of ROS's `camera_calibration_parsers` into a [`CameraInfo`].

use std::borrow::Cow;
use std::fmt;

use serde::de::{IgnoredAny, MapAccess, Visitor};
use serde::{Deserialize, Deserializer};
use serde_saphyr::Spanned;

use super::{CameraInfo, RegionOfInterest};
use crate::text::{clip, list};
use crate::yaml::{self, Place, YamlError};

/// Why a calibration file cannot be read; each message begins with the position in the file.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum CameraFileError {
    /// Not YAML, or not in the format of a calibration file.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// A matrix whose size is not the format's.
    #[error(
        "{place}: {matrix} must have {need_rows} x {need_cols} entries, but is declared as {rows} x {cols}"
    )]
    MatrixSize {
        place: Place,
        matrix: &'static str,
        rows: usize,
        cols: usize,
        need_rows: usize,
        need_cols: usize,
    },
    /// A matrix whose amount of data differs from rows times columns.
    #[error("{place}: data of {matrix} must hold {need} numbers, got {got}")]
    DataLength {
        place: Place,
        matrix: &'static str,
        got: usize,
        need: usize,
    },
    /// An entry that is NaN or infinite.
    #[error("{place}: data[{index}] of {matrix} must be finite, got {value}")]
    NotFinite {
        place: Place,
        matrix: &'static str,
        index: usize,
        value: f64,
    },
}

/// What was assumed or ignored while reading a calibration file.
#[derive(Debug, Clone, PartialEq, Eq)]
#[non_exhaustive]
pub enum CameraFileWarning {
    /// No lens model is given.
    ModelAssumed {
        /// The name of the file.
        source: String,
    },
    /// Keys that are not part of the format.
    UnknownKeys {
        /// The name of the file.
        source: String,
        /// Their names, sorted.
        keys: Vec<String>,
    },
}

impl fmt::Display for CameraFileWarning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::ModelAssumed { source } => write!(
                f,
                "{}: no distortion_model, {ASSUMED_MODEL} assumed",
                clip(source)
            ),
            Self::UnknownKeys { source, keys } => write!(
                f,
                "{}: keys not in the format are ignored: {}",
                clip(source),
                list(keys)
            ),
        }
    }
}

/// The lens model that ROS's reader assumes if a file does not name one.
const ASSUMED_MODEL: &str = "plumb_bob";

#[derive(Deserialize)]
struct RawInfo {
    image_width: u32,
    image_height: u32,
    /// Part of the format, but a camera info has no field for it.
    #[serde(rename = "camera_name", default)]
    _camera_name: Option<IgnoredAny>,
    camera_matrix: RawMatrix,
    distortion_model: Option<String>,
    distortion_coefficients: RawMatrix,
    rectification_matrix: RawMatrix,
    projection_matrix: RawMatrix,
    #[serde(default)]
    binning_x: u32,
    #[serde(default)]
    binning_y: u32,
    #[serde(default)]
    roi: RawRegion,
    #[serde(flatten)]
    unknown: UnknownKeys,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMatrix {
    rows: Spanned<usize>,
    cols: Spanned<usize>,
    data: Spanned<Vec<Spanned<f64>>>,
}

/// Names of unknown keys.
#[derive(Default)]
struct UnknownKeys(Vec<String>);

impl<'de> Deserialize<'de> for UnknownKeys {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        struct Names;
        impl<'de> Visitor<'de> for Names {
            type Value = UnknownKeys;

            fn expecting(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
                f.write_str("keys with values")
            }

            fn visit_map<A: MapAccess<'de>>(self, mut map: A) -> Result<UnknownKeys, A::Error> {
                let mut names = Vec::new();
                while let Some((name, IgnoredAny)) = map.next_entry()? {
                    names.push(name);
                }
                names.sort();
                Ok(UnknownKeys(names))
            }
        }
        deserializer.deserialize_map(Names)
    }
}

#[derive(Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct RawRegion {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
    do_rectify: bool,
}

impl CameraInfo {
    /// Returns the camera info in a calibration file, and warnings about what was assumed.
    ///
    /// The format is that of `config/cameras/paper.yaml`, which `camera_calibration` writes; since `image_common` 4.1.0
    /// ROS adds binning and region of interest. Only the format is checked here; [`super::Camera::from_info`] checks
    /// the values.
    ///
    /// # Inputs
    /// * `text`: the YAML. As in ROS's own reader, `camera_name`, binning and region are optional, a missing
    ///   `distortion_model` is taken as `plumb_bob` (with a warning), the coefficients may be a row or a column, and
    ///   unknown keys are ignored (with a warning). A first line `%YAML:1.0`, as `OpenCV` writes it, is ignored.
    /// * `source`: the name of the text in errors, usually its path.
    ///
    /// # Errors
    /// [`CameraFileError`] with line and column of the invalid value.
    ///
    /// ```
    /// use tanker_pose::camera::{Camera, CameraInfo};
    ///
    /// let text = include_str!("../../config/cameras/paper.yaml");
    /// let (info, warnings) = CameraInfo::from_yaml(text, "paper.yaml")?;
    /// let camera = Camera::from_info(&info, false)?;
    /// assert_eq!(camera.pinhole(), Some([571.0, 571.0, 254.0, 206.0]));
    /// assert!(warnings.is_empty());
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_yaml(
        text: &str,
        source: &str,
    ) -> Result<(Self, Vec<CameraFileWarning>), CameraFileError> {
        // `OpenCV` writes this line; YAML's own directive has a space instead of the colon. It is turned into a
        // comment, so that line numbers stay right.
        let text = match text.strip_prefix("%YAML:") {
            Some(rest) => Cow::Owned(format!("#YAML:{rest}")),
            None => Cow::Borrowed(text),
        };
        let raw: RawInfo = yaml::read(&text, source)?;
        let mut warnings = Vec::new();
        if raw.distortion_model.is_none() {
            warnings.push(CameraFileWarning::ModelAssumed {
                source: source.to_owned(),
            });
        }
        if !raw.unknown.0.is_empty() {
            warnings.push(CameraFileWarning::UnknownKeys {
                source: source.to_owned(),
                keys: raw.unknown.0,
            });
        }
        let coefficients = &raw.distortion_coefficients;
        let info = Self {
            width: raw.image_width,
            height: raw.image_height,
            distortion_model: raw
                .distortion_model
                .unwrap_or_else(|| ASSUMED_MODEL.to_owned()),
            d: coefficients.any_size(source, "distortion_coefficients")?,
            k: raw.camera_matrix.fixed(source, "camera_matrix", 3, 3)?,
            r: raw
                .rectification_matrix
                .fixed(source, "rectification_matrix", 3, 3)?,
            p: raw
                .projection_matrix
                .fixed(source, "projection_matrix", 3, 4)?,
            binning_x: raw.binning_x,
            binning_y: raw.binning_y,
            roi: RegionOfInterest {
                x_offset: raw.roi.x_offset,
                y_offset: raw.roi.y_offset,
                height: raw.roi.height,
                width: raw.roi.width,
                do_rectify: raw.roi.do_rectify,
            },
        };
        Ok((info, warnings))
    }
}

impl RawMatrix {
    /// Returns the entries, row-major, of a matrix of this size.
    fn read(
        &self,
        source: &str,
        matrix: &'static str,
        need_rows: usize,
        need_cols: usize,
    ) -> Result<Vec<f64>, CameraFileError> {
        let (rows, cols) = (self.rows.value, self.cols.value);
        if (rows, cols) != (need_rows, need_cols) {
            let wrong = if rows == need_rows {
                &self.cols
            } else {
                &self.rows
            };
            let place = Place::at(source, wrong.referenced);
            return Err(CameraFileError::MatrixSize {
                place,
                matrix,
                rows,
                cols,
                need_rows,
                need_cols,
            });
        }
        self.numbers(source, matrix, need_rows.saturating_mul(need_cols))
    }

    /// Returns the entries of a matrix of any size, for example a row or a column.
    fn any_size(&self, source: &str, matrix: &'static str) -> Result<Vec<f64>, CameraFileError> {
        // Saturating, since the product of the declared sizes may overflow.
        self.numbers(
            source,
            matrix,
            self.rows.value.saturating_mul(self.cols.value),
        )
    }

    fn numbers(
        &self,
        source: &str,
        matrix: &'static str,
        need: usize,
    ) -> Result<Vec<f64>, CameraFileError> {
        let data = &self.data.value;
        if data.len() != need {
            let place = Place::at(source, self.data.referenced);
            return Err(CameraFileError::DataLength {
                place,
                matrix,
                got: data.len(),
                need,
            });
        }
        if let Some((index, entry)) = data
            .iter()
            .enumerate()
            .find(|(_, entry)| !entry.value.is_finite())
        {
            let place = Place::at(source, entry.referenced);
            return Err(CameraFileError::NotFinite {
                place,
                matrix,
                index,
                value: entry.value,
            });
        }
        Ok(data.iter().map(|entry| entry.value).collect())
    }

    fn fixed<const N: usize>(
        &self,
        source: &str,
        matrix: &'static str,
        need_rows: usize,
        need_cols: usize,
    ) -> Result<[f64; N], CameraFileError> {
        let entries = self.read(source, matrix, need_rows, need_cols)?;
        entries
            .try_into()
            .map_err(|entries: Vec<f64>| CameraFileError::DataLength {
                place: Place::at(source, self.data.referenced),
                matrix,
                got: entries.len(),
                need: N,
            })
    }
}

#[cfg(test)]
mod tests;
