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
mod tests {
    use super::*;

    const PAPER: &str = include_str!("../../config/cameras/paper.yaml");

    /// The shipped file without its comments, so that lines are counted from `image_width`, with one line replaced.
    fn with(line: &str, replacement: &str) -> String {
        let lines: Vec<&str> = PAPER
            .lines()
            .filter(|line| !line.starts_with('#'))
            .collect();
        let text = lines.join("\n") + "\n";
        assert!(text.contains(line), "{line}");
        text.replacen(line, replacement, 1)
    }

    fn refusal(line: &str, replacement: &str) -> String {
        CameraInfo::from_yaml(&with(line, replacement), "c.yaml")
            .expect_err("this file is wrong")
            .to_string()
    }

    #[test]
    fn the_papers_camera_is_read_as_it_stands() {
        let (info, warnings) = CameraInfo::from_yaml(PAPER, "paper.yaml").expect("a good file");
        let expected = CameraInfo {
            height: 412,
            width: 508,
            distortion_model: "plumb_bob".to_owned(),
            d: vec![0.0; 5],
            k: [571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0],
            r: [1.0, 0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0],
            p: [
                571.0, 0.0, 254.0, 0.0, 0.0, 571.0, 206.0, 0.0, 0.0, 0.0, 1.0, 0.0,
            ],
            ..CameraInfo::default()
        };
        assert_eq!((info, warnings), (expected, Vec::new()));
    }

    #[test]
    fn matrices_of_another_size_are_refused_at_their_line() {
        assert_eq!(
            refusal("camera_matrix:\n  rows: 3", "camera_matrix:\n  rows: 2"),
            "c.yaml:5:9: camera_matrix must have 3 x 3 entries, but is declared as 2 x 3"
        );
        assert_eq!(
            refusal("cols: 4", "cols: 3"),
            "c.yaml:19:9: projection_matrix must have 3 x 4 entries, but is declared as 3 x 3"
        );
        assert_eq!(
            refusal(
                "[571.0, 0.0, 254.0, 0.0, 571.0, 206.0, 0.0, 0.0, 1.0]",
                "[571.0, 0.0, 254.0]"
            ),
            "c.yaml:7:9: data of camera_matrix must hold 9 numbers, got 3"
        );
        assert_eq!(
            refusal("cols: 5", "cols: 4"),
            "c.yaml:12:9: data of distortion_coefficients must hold 4 numbers, got 5"
        );
        assert_eq!(
            refusal("rows: 1", "rows: 2"),
            "c.yaml:12:9: data of distortion_coefficients must hold 10 numbers, got 5"
        );
    }

    #[test]
    fn entries_that_are_not_finite_are_refused_at_their_place() {
        assert_eq!(
            refusal(
                "[571.0, 0.0, 254.0, 0.0, 571.0",
                "[571.0, 0.0, .nan, 0.0, 571.0"
            ),
            "c.yaml:7:22: data[2] of camera_matrix must be finite, got NaN"
        );
    }

    #[test]
    fn another_shape_is_refused_at_its_line() {
        let slips = [
            ("image_width: 508", "image_width: -508", 1),
            ("image_width: 508", "image_width: 508.5", 1),
            ("image_width: 508", "image_width: 508\nimage_width: 508", 2),
            ("  rows: 1\n", "", 11),
        ];
        for (line, replacement, at) in slips {
            let error = refusal(line, replacement);
            assert!(
                error.starts_with(&format!("c.yaml:{at}:")),
                "{replacement}: {error}"
            );
        }
    }

    #[test]
    fn the_name_may_be_left_out_and_the_size_may_not() {
        assert!(CameraInfo::from_yaml(&with("camera_name: paper\n", ""), "c.yaml").is_ok());
        assert!(refusal("image_width: 508\n", "").contains("image_width"));
        assert!(refusal("image_height: 412", "image_heigth: 412").contains("image_height"));
    }

    #[test]
    fn what_ros_itself_assumes_or_passes_over_is_read_with_a_warning() {
        let read = |text: &str| {
            let (info, warnings) = CameraInfo::from_yaml(text, "c.yaml").expect("ROS reads it");
            let words: Vec<String> = warnings.iter().map(ToString::to_string).collect();
            (info, words.join("; "))
        };
        let (info, warnings) = read(&with("distortion_model: plumb_bob\n", ""));
        assert_eq!(info.distortion_model, "plumb_bob");
        assert_eq!(warnings, "c.yaml: no distortion_model, plumb_bob assumed");
        let (_, warnings) = read(&with(
            "camera_name: paper",
            "camera_name: paper\nfov: 2\nage: 3",
        ));
        assert_eq!(
            warnings,
            "c.yaml: keys not in the format are ignored: \"age\", \"fov\""
        );
    }

    #[test]
    fn coefficients_may_stand_in_a_column() {
        let column = with("rows: 1\n  cols: 5", "rows: 5\n  cols: 1");
        let (info, _) = CameraInfo::from_yaml(&column, "c.yaml").expect("ROS reads it");
        assert_eq!(info.d, [0.0; 5]);
    }

    #[test]
    fn binning_and_region_are_read() {
        let region = "binning_x: 2\nbinning_y: 4\nroi:\n  x_offset: 8\n  y_offset: 4\n  height: 200\n  width: 300\n  \
                      do_rectify: true\n";
        let (info, warnings) =
            CameraInfo::from_yaml(&format!("{PAPER}{region}"), "c.yaml").expect("ROS writes it");
        assert_eq!((info.binning_x, info.binning_y), (2, 4));
        let roi = info.roi;
        assert_eq!(
            (
                roi.x_offset,
                roi.y_offset,
                roi.width,
                roi.height,
                roi.do_rectify
            ),
            (8, 4, 300, 200, true)
        );
        assert_eq!(warnings, []);
    }

    #[test]
    fn opencvs_directive_is_skipped_and_two_cameras_in_a_file_are_refused_in_a_users_words() {
        let opencv = format!("%YAML:1.0\n{PAPER}");
        assert!(CameraInfo::from_yaml(&opencv, "c.yaml").is_ok());
        assert!(CameraInfo::from_yaml(&format!("%YAML:1.0\n---\n{PAPER}"), "c.yaml").is_ok());
        let two = format!("{PAPER}---\n{PAPER}");
        let error = CameraInfo::from_yaml(&two, "c.yaml").expect_err("which camera?");
        assert!(
            error
                .to_string()
                .ends_with(": expected one document, got a second one after `---`"),
            "{error}"
        );
    }
}
