//! The lines that `solve` reads.
//!
//! The fuzz targets read them with this file too, so it uses libraries only.

use ros2_node::text::clip;
use serde::Deserialize;
use serde::de::IgnoredAny;
use tanker_pose::camera::{CameraInfo, RegionOfInterest};
use tanker_pose::pipeline::Detection;

#[derive(Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with id, camera and points"
)]
pub struct InputFrame {
    #[serde(default)]
    pub id: serde_json::Value,
    /// May be left out where `--camera` names a calibration.
    pub camera: Option<InputCamera>,
    pub points: Vec<InputPoint>,
}

/// A `CameraInfo`, as ROS 2 or ROS 1 prints it.
#[derive(Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with the fields of a camera info"
)]
pub struct InputCamera {
    #[serde(rename = "header", default)]
    _header: Option<IgnoredAny>,
    #[serde(default)]
    width: u32,
    #[serde(default)]
    height: u32,
    #[serde(default)]
    distortion_model: String,
    #[serde(default, alias = "D")]
    d: Vec<f64>,
    #[serde(alias = "K")]
    k: [f64; 9],
    #[serde(default, alias = "R")]
    r: [f64; 9],
    #[serde(default, alias = "P")]
    p: Vec<f64>,
    #[serde(default)]
    binning_x: u32,
    #[serde(default)]
    binning_y: u32,
    #[serde(default)]
    roi: InputRoi,
}

#[derive(Debug, Default, Deserialize)]
#[serde(
    deny_unknown_fields,
    default,
    expecting = "an object with x_offset, y_offset, height and width"
)]
pub struct InputRoi {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
    do_rectify: bool,
}

#[derive(Debug, Deserialize)]
#[serde(
    deny_unknown_fields,
    expecting = "an object with id, u, v and perhaps x, y, z and sigma"
)]
pub struct InputPoint {
    pub id: u32,
    pub x: Option<f64>,
    pub y: Option<f64>,
    pub z: Option<f64>,
    pub u: f64,
    pub v: f64,
    #[serde(default)]
    pub sigma: f64,
}

/// Returns why a line is not a frame, if its beginning shows it: the parser's message would be about its own structures.
pub fn not_an_object(line: &[u8]) -> Option<&'static str> {
    let got = match line.trim_ascii().first() {
        None => "an empty line",
        Some(b'[') => "an array",
        Some(b'"') => "a string",
        Some(_) => return None,
    };
    Some(got)
}

/// The parser's reason without its own position: each line is a document of its own to it.
///
/// It quotes a foreign word (a key, a string) whole and then says what was expected instead.
pub fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    let text = text
        .rsplit_once(" at line ")
        .map_or(text.as_str(), |(reason, _)| reason);
    let (found, expected) = match text.rfind(", expected") {
        Some(at) => text.split_at(at),
        None => (text, ""),
    };
    let quote = |c: char| c == '`' || c == '"';
    match (found.find(quote), found.rfind(quote)) {
        (Some(first), Some(last)) if first < last => {
            let (before, word) = (&found[..=first], &found[first + 1..last]);
            format!("{before}{}{}{expected}", clip(word), &found[last..])
        }
        _ => format!("{}{expected}", clip(found)),
    }
}

impl InputPoint {
    pub fn detection(&self) -> Detection {
        Detection {
            id: self.id,
            u_px: self.u,
            v_px: self.v,
            sigma_px: self.sigma,
        }
    }
}

impl InputCamera {
    pub fn info(&self) -> Result<CameraInfo, String> {
        let p = match self.p.len() {
            0 => [0.0; 12],
            _ => <[f64; 12]>::try_from(self.p.as_slice())
                .map_err(|_| format!("camera: expected 12 numbers in p, got {}", self.p.len()))?,
        };
        Ok(CameraInfo {
            height: self.height,
            width: self.width,
            distortion_model: self.distortion_model.clone(),
            d: self.d.clone(),
            k: self.k,
            r: self.r,
            p,
            binning_x: self.binning_x,
            binning_y: self.binning_y,
            roi: RegionOfInterest {
                x_offset: self.roi.x_offset,
                y_offset: self.roi.y_offset,
                height: self.roi.height,
                width: self.roi.width,
                do_rectify: self.roi.do_rectify,
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(line: &str) -> String {
        reason(&serde_json::from_str::<InputFrame>(line).expect_err("no frame"))
    }

    #[test]
    fn foreign_words_are_cut_and_what_was_expected_stays() {
        let long = "x".repeat(500_000);
        for line in [
            format!("{{\"{long}\": 1, \"points\": []}}"),
            format!("{{\"points\": \"{long}\"}}"),
            format!("{{\"points\": [{{\"{long}\": 1}}]}}"),
            format!("{{\"camera\": {{\"{long}, expected `a`\": 1}}}}"),
        ] {
            let words = words(&line);
            assert!(
                words.len() < 400,
                "{} bytes: {}",
                words.len(),
                &words[..400]
            );
            assert!(
                words.contains("xxx… (5000") || words.contains("xxx… (500000 bytes)"),
                "{words}"
            );
            assert!(words.contains(", expected"), "{words}");
        }
        assert_eq!(
            words("{\"extra\": 1}"),
            "unknown field `extra`, expected one of `id`, `camera`, `points`"
        );
        assert_eq!(words("{}"), "missing field `points`");
    }

    #[test]
    fn what_is_no_object_is_called_what_it_is() {
        for (line, got) in [
            ("", Some("an empty line")),
            ("  \r\n", Some("an empty line")),
            ("[]", Some("an array")),
            ("\"a\"", Some("a string")),
            ("{}", None),
        ] {
            assert_eq!(not_an_object(line.as_bytes()), got, "{line:?}");
        }
        assert_eq!(
            words("3"),
            "invalid type: integer `3`, expected an object with id, camera and points"
        );
        assert!(
            words("{\"camera\": 3}")
                .ends_with("expected an object with the fields of a camera info")
        );
    }
}
