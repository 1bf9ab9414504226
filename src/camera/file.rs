//! The calibration file of ROS's `camera_calibration_parsers` -> a [`CameraInfo`].

use serde::Deserialize;
use serde::de::IgnoredAny;
use serde_saphyr::Spanned;

use super::CameraInfo;
use crate::yaml::{self, Place, YamlError};

/// Why a calibration file cannot be read; each message begins with the place at fault.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
#[expect(missing_docs, reason = "a variant's message names its fields")]
pub enum CameraFileError {
    /// No YAML, or not in a calibration file's shape.
    #[error(transparent)]
    Yaml(#[from] YamlError),
    /// A matrix of another size than the format has.
    #[error("{place}: {matrix} must have {need_rows} x {need_cols} entries, says {rows} x {cols}")]
    MatrixSize {
        place: Place,
        matrix: &'static str,
        rows: usize,
        cols: usize,
        need_rows: usize,
        need_cols: usize,
    },
    /// A matrix whose data are not as many as its rows and columns say.
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

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawInfo {
    image_width: u32,
    image_height: u32,
    /// Part of the format, without a place in a camera info.
    #[serde(rename = "camera_name", default)]
    _camera_name: Option<IgnoredAny>,
    camera_matrix: RawMatrix,
    distortion_model: String,
    distortion_coefficients: RawMatrix,
    rectification_matrix: RawMatrix,
    projection_matrix: RawMatrix,
}

#[derive(Deserialize)]
#[serde(deny_unknown_fields)]
struct RawMatrix {
    rows: Spanned<usize>,
    cols: Spanned<usize>,
    data: Spanned<Vec<Spanned<f64>>>,
}

impl CameraInfo {
    /// Returns the camera info that a calibration file describes: whole image, no binning.
    ///
    /// The shape is that of `config/cameras/paper.yaml`, which is what `camera_calibration` writes.
    /// Only the shape is checked; [`super::Camera::from_info`] checks what the numbers mean.
    ///
    /// # Inputs
    /// * `text`: the YAML; an unknown or missing key is an error, only `camera_name` may be left out.
    /// * `source`: what errors call the text, usually its path.
    ///
    /// # Errors
    /// [`CameraFileError`] with the line and column of the value at fault.
    ///
    /// ```
    /// use tanker_pose::camera::{Camera, CameraInfo};
    ///
    /// let info = CameraInfo::from_yaml(include_str!("../../config/cameras/paper.yaml"), "paper.yaml")?;
    /// let camera = Camera::from_info(&info, false)?;
    /// assert_eq!(camera.pinhole(), Some([571.0, 571.0, 254.0, 206.0]));
    /// # Ok::<(), Box<dyn std::error::Error>>(())
    /// ```
    pub fn from_yaml(text: &str, source: &str) -> Result<Self, CameraFileError> {
        let raw: RawInfo = yaml::read(text, source)?;
        let coefficients = &raw.distortion_coefficients;
        Ok(Self {
            width: raw.image_width,
            height: raw.image_height,
            distortion_model: raw.distortion_model,
            d: coefficients.read(
                source,
                "distortion_coefficients",
                1,
                coefficients.cols.value,
            )?,
            k: raw.camera_matrix.fixed(source, "camera_matrix", 3, 3)?,
            r: raw
                .rectification_matrix
                .fixed(source, "rectification_matrix", 3, 3)?,
            p: raw
                .projection_matrix
                .fixed(source, "projection_matrix", 3, 4)?,
            ..Self::default()
        })
    }
}

impl RawMatrix {
    /// Returns the entries, row-major, of a matrix that must have this size.
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
        let data = &self.data.value;
        // Written so that no product can overflow: rows is 1 where columns are the file's choice.
        let need = need_rows.saturating_mul(need_cols);
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
        let info = CameraInfo::from_yaml(PAPER, "paper.yaml").expect("a good file");
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
        assert_eq!(info, expected);
    }

    #[test]
    fn matrices_of_another_size_are_refused_at_their_line() {
        assert_eq!(
            refusal("camera_matrix:\n  rows: 3", "camera_matrix:\n  rows: 2"),
            "c.yaml:5:9: camera_matrix must have 3 x 3 entries, says 2 x 3"
        );
        assert_eq!(
            refusal("cols: 4", "cols: 3"),
            "c.yaml:19:9: projection_matrix must have 3 x 4 entries, says 3 x 3"
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
        assert!(
            refusal("rows: 1", "rows: 2")
                .starts_with("c.yaml:10:9: distortion_coefficients must have 1 x 5")
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
            ("image_height: 412", "image_heigth: 412", 2),
            ("camera_name: paper", "camera_name: paper\nbinning: 2", 4),
            ("  rows: 1\n", "", 11),
            ("distortion_model: plumb_bob", "distortion_model:", 8),
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
    fn no_key_but_the_name_may_be_left_out() {
        assert!(CameraInfo::from_yaml(&with("camera_name: paper\n", ""), "c.yaml").is_ok());
        assert!(refusal("distortion_model: plumb_bob\n", "").contains("distortion_model"));
        assert!(refusal("image_width: 508\n", "").contains("image_width"));
    }
}
