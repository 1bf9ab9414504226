//! `tanker_pose solve`: the estimator's face to other languages and to batch work.
//!
//! One JSON object a line in, one a line out, in order. A line that cannot be read or solved gives an
//! output line with its outcome and message, and the next goes on.

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use indicatif::ProgressBar;
use nalgebra::{Point3, Rotation3};
use serde::{Deserialize, Serialize};
use tanker_pose::camera::{Camera, CameraError, CameraInfo, RegionOfInterest};
use tanker_pose::estimation::{Estimator, Solution};
use tanker_pose::pipeline::{self, Detection, FrameOutcome, Refusal, observe};
use tanker_pose::target::MarkerMap;

use crate::options::{self, EstimatorOptions};

/// Outcome of a line that is not a frame.
const MALFORMED: &str = "malformed";
/// m; a marker farther from the tanker's origin is a mistake in units.
const MAX_COORDINATE_M: f64 = 1e3;

#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// JSON Lines to read; standard input when missing or -
    file: Option<PathBuf>,
    /// Marker map (paper, fin6 or a path) for points that bring no x, y, z
    #[arg(long, value_name = "MAP")]
    marker_map: Option<String>,
    /// Pixels are those of the rectified image: use p instead of k and d
    #[arg(long)]
    rectified: bool,
    #[command(flatten)]
    estimator: EstimatorOptions,
}

/// Why the tool as a whole ends; a bad line is not among the reasons.
#[derive(Debug, thiserror::Error)]
pub enum SolveError {
    #[error("cannot read {}: {source}", path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot use the marker map: {0}")]
    MarkerMap(String),
    #[error("cannot read the input: {0}")]
    Read(std::io::Error),
    #[error("cannot write the output: {0}")]
    Write(std::io::Error),
}

#[derive(Debug, Deserialize)]
struct InputFrame {
    #[serde(default)]
    id: serde_json::Value,
    camera: InputCamera,
    points: Vec<InputPoint>,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct InputCamera {
    #[serde(default)]
    width: u32,
    #[serde(default)]
    height: u32,
    #[serde(default)]
    distortion_model: String,
    #[serde(default)]
    d: Vec<f64>,
    k: [f64; 9],
    #[serde(default)]
    r: [f64; 9],
    #[serde(default)]
    p: Vec<f64>,
    #[serde(default)]
    binning_x: u32,
    #[serde(default)]
    binning_y: u32,
    #[serde(default)]
    roi: InputRoi,
}

#[derive(Debug, Default, Deserialize)]
#[serde(deny_unknown_fields, default)]
struct InputRoi {
    x_offset: u32,
    y_offset: u32,
    height: u32,
    width: u32,
    do_rectify: bool,
}

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct InputPoint {
    id: u32,
    x: Option<f64>,
    y: Option<f64>,
    z: Option<f64>,
    u: f64,
    v: f64,
    #[serde(default)]
    sigma: f64,
}

#[derive(Debug, Serialize)]
struct OutputFrame {
    id: serde_json::Value,
    outcome: String,
    message: String,
    #[serde(flatten)]
    pose: Option<OutputPose>,
    used_ids: Vec<u32>,
    rejected_ids: Vec<u32>,
    #[serde(flatten)]
    numbers: Option<OutputNumbers>,
}

/// Only for trusted frames: a doubtful pose is not printed.
#[derive(Debug, Serialize)]
struct OutputPose {
    rotation: Vec<f64>,
    translation: Vec<f64>,
    covariance: Vec<f64>,
}

#[derive(Debug, Serialize)]
struct OutputNumbers {
    rms_px: f64,
    chi_squared: f64,
    degrees_of_freedom: u16,
    ambiguity: f64,
    iterations: u16,
}

/// Reads frames, writes outcomes, until the input ends.
pub fn run(arguments: &Arguments) -> Result<(), SolveError> {
    let mut solver = Solver::new(arguments)?;
    let input: Box<dyn BufRead> = match &arguments.file {
        Some(path) if path.as_os_str() != "-" => {
            Box::new(BufReader::new(File::open(path).map_err(|source| {
                SolveError::Open {
                    path: path.clone(),
                    source,
                }
            })?))
        }
        _ => Box::new(std::io::stdin().lock()),
    };
    let stdout = std::io::stdout();
    // A person at the terminal reads the lines themselves; otherwise show that work goes on.
    let progress = if stdout.is_terminal() {
        ProgressBar::hidden()
    } else {
        ProgressBar::new_spinner()
    };
    progress.enable_steady_tick(Duration::from_millis(200));
    let mut output = BufWriter::new(stdout.lock());
    let result = solver.stream(input, &mut output, &progress);
    progress.finish_and_clear();
    match result {
        // The reader has seen enough, as `head` does: not a fault.
        Err(SolveError::Write(error)) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result,
    }
}

struct Solver {
    estimator: Estimator,
    map: Option<MarkerMap>,
    rectified: bool,
    pixel_sigma_px: f64,
    camera: Option<(CameraInfo, Result<Camera, CameraError>)>,
    previous_rotation: Option<Rotation3<f64>>,
}

impl Solver {
    fn new(arguments: &Arguments) -> Result<Self, SolveError> {
        let map = arguments
            .marker_map
            .as_deref()
            .map(options::marker_map)
            .transpose();
        Ok(Self {
            estimator: Estimator::new(arguments.estimator.settings()),
            map: map.map_err(SolveError::MarkerMap)?,
            rectified: arguments.rectified,
            pixel_sigma_px: arguments.estimator.pixel_sigma_px,
            camera: None,
            previous_rotation: None,
        })
    }

    fn stream(
        &mut self,
        mut input: impl BufRead,
        output: &mut impl Write,
        progress: &ProgressBar,
    ) -> Result<(), SolveError> {
        let mut line = Vec::new();
        let mut number = 0_u64;
        loop {
            line.clear();
            if input
                .read_until(b'\n', &mut line)
                .map_err(SolveError::Read)?
                == 0
            {
                return output.flush().map_err(SolveError::Write);
            }
            number += 1;
            let answer = self.answer(&line, number);
            serde_json::to_writer(&mut *output, &answer)
                .map_err(|error| SolveError::Write(error.into()))?;
            output.write_all(b"\n").map_err(SolveError::Write)?;
            // A caller that waits for the answer before it sends the next line must get it now.
            output.flush().map_err(SolveError::Write)?;
            progress.inc(1);
            progress.set_message(format!("{number} frames"));
        }
    }

    fn answer(&mut self, line: &[u8], number: u64) -> OutputFrame {
        match serde_json::from_slice::<InputFrame>(line) {
            Ok(frame) => match self.solve(&frame) {
                Ok(outcome) => OutputFrame::new(frame.id, outcome),
                Err(message) => {
                    OutputFrame::malformed(frame.id, format!("line {number}: {message}"))
                }
            },
            Err(error) => {
                let id = serde_json::from_slice::<serde_json::Value>(line)
                    .ok()
                    .and_then(|value| value.get("id").cloned())
                    .unwrap_or_default();
                OutputFrame::malformed(
                    id,
                    format!(
                        "line {number}, column {}: {}",
                        error.column(),
                        reason(&error)
                    ),
                )
            }
        }
    }

    fn solve(&mut self, frame: &InputFrame) -> Result<FrameOutcome, String> {
        let info = frame.camera.info()?;
        let markers = frame
            .points
            .iter()
            .map(|point| self.marker(point).map(|marker| (point.id, marker)))
            .collect::<Result<Vec<_>, String>>()?;
        let detections: Vec<Detection> = frame.points.iter().map(InputPoint::detection).collect();
        let sigma_px = self.pixel_sigma_px;
        let camera = match self.latch(info) {
            Ok(camera) => camera,
            Err(error) => {
                return Ok(FrameOutcome::refused(Refusal::InvalidCameraInfo(
                    error.clone(),
                )));
            }
        };
        let lookup = |id| {
            markers
                .iter()
                .find(|(known, _)| *known == id)
                .and_then(|(_, marker)| *marker)
        };
        let observations = match observe(camera, &detections, sigma_px, lookup) {
            Ok(observations) => observations,
            Err(refusal) => return Ok(FrameOutcome::refused(refusal)),
        };
        let camera = camera.clone();
        let outcome = pipeline::solve(
            &self.estimator,
            &camera,
            &observations,
            self.previous_rotation.as_ref(),
        );
        if let Ok(solution) = &outcome.result {
            self.previous_rotation =
                Some(solution.camera_from_tanker.rotation.to_rotation_matrix());
        }
        Ok(outcome)
    }

    /// Checks a camera once and keeps it while the lines bring the same.
    fn latch(&mut self, info: CameraInfo) -> Result<&Camera, &CameraError> {
        let rectified = self.rectified;
        let known = self.camera.take().filter(|(known, _)| *known == info);
        let (_, camera) = self.camera.insert(known.unwrap_or_else(|| {
            let camera = Camera::from_info(&info, rectified);
            (info, camera)
        }));
        camera.as_ref()
    }

    /// Where a point sits on the tanker: as it says itself, or as the map says; none when neither does.
    fn marker(&self, point: &InputPoint) -> Result<Option<Point3<f64>>, String> {
        match (point.x, point.y, point.z) {
            (Some(x), Some(y), Some(z)) => {
                let marker = Point3::new(x, y, z);
                if marker.iter().all(|value| value.abs() <= MAX_COORDINATE_M) {
                    Ok(Some(marker))
                } else {
                    Err(format!(
                        "point {}: expected coordinates within {MAX_COORDINATE_M} m, got ({x:?}, {y:?}, {z:?})",
                        point.id
                    ))
                }
            }
            (None, None, None) => match &self.map {
                Some(map) => Ok(map.get(point.id)),
                None => Err(format!(
                    "point {}: expected x, y, z, or a map by --marker-map",
                    point.id
                )),
            },
            _ => Err(format!(
                "point {}: expected all of x, y, z or none of them",
                point.id
            )),
        }
    }
}

/// The parser's reason without its own position: each line is a document of its own to it.
fn reason(error: &serde_json::Error) -> String {
    let text = error.to_string();
    text.rsplit_once(" at line ")
        .map_or(text.as_str(), |(reason, _)| reason)
        .to_owned()
}

impl InputPoint {
    fn detection(&self) -> Detection {
        Detection {
            id: self.id,
            u_px: self.u,
            v_px: self.v,
            sigma_px: self.sigma,
        }
    }
}

impl InputCamera {
    fn info(&self) -> Result<CameraInfo, String> {
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

impl OutputFrame {
    fn malformed(id: serde_json::Value, message: String) -> Self {
        Self {
            id,
            outcome: MALFORMED.to_owned(),
            message,
            pose: None,
            used_ids: Vec::new(),
            rejected_ids: Vec::new(),
            numbers: None,
        }
    }

    fn new(id: serde_json::Value, outcome: FrameOutcome) -> Self {
        Self {
            id,
            outcome: outcome.code().name().to_ascii_lowercase(),
            message: outcome
                .result
                .as_ref()
                .err()
                .map(ToString::to_string)
                .unwrap_or_default(),
            pose: outcome.result.as_ref().ok().map(OutputPose::new),
            numbers: outcome.solution().map(OutputNumbers::new),
            used_ids: outcome.used_ids,
            rejected_ids: outcome.rejected_ids,
        }
    }
}

impl OutputPose {
    fn new(solution: &Solution) -> Self {
        let pose = &solution.camera_from_tanker;
        let rotation = pose.rotation.to_rotation_matrix();
        Self {
            // nalgebra stores columns; the transpose's columns are the rows.
            rotation: rotation.matrix().transpose().as_slice().to_vec(),
            translation: pose.translation.vector.as_slice().to_vec(),
            covariance: solution.covariance.row_major().to_vec(),
        }
    }
}

impl OutputNumbers {
    fn new(solution: &Solution) -> Self {
        Self {
            rms_px: solution.rms_px,
            chi_squared: solution.chi_squared,
            degrees_of_freedom: solution.degrees_of_freedom,
            ambiguity: solution.ambiguity,
            iterations: solution.iterations,
        }
    }
}
