//! `tanker_pose solve`: the estimator's face to other languages and to batch work.
//!
//! One JSON object a line in, one a line out, in order. A line that cannot be read or solved gives an
//! output line with its outcome and message, and the next is processed.

pub mod input;
mod levels;
mod lines;

use std::fs::File;
use std::io::{BufRead, BufReader, BufWriter, IsTerminal, Write};
use std::path::PathBuf;
use std::time::Duration;

use indicatif::ProgressBar;
use nalgebra::{Point3, Rotation3};
use tanker_pose::camera::{CalibrationBudget, Camera, CameraError, CameraInfo};
use tanker_pose::estimation::Estimator;
use tanker_pose::integrity::{IntegrityMonitor, SolvedFrame, Unavailable};
use tanker_pose::pipeline::{
    self, Detection, FrameOutcome, ImageEdges, Refusal, integrity_monitor, modes_of_file, observe,
};
use tanker_pose::target::{MAX_COORDINATE_M, MarkerMap};

use self::input::{InputFrame, InputPoint, not_an_object, reason};
use self::levels::Levels;
use self::lines::OutputFrame;
use crate::options::{self, CalibrationError, EstimatorOptions, IntegrityOptions, SetupError};

/// Longest line that is read: a frame of ten thousand points.
pub const MAX_LINE_BYTES: u64 = 1 << 20;
/// What is skipped in search of the end of a longer one.
const MAX_SKIPPED_BYTES: u64 = 1 << 28;

#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// JSON Lines to read; standard input when missing or -
    file: Option<PathBuf>,
    /// Marker map (paper, fin6 or a path) for points without x, y, z
    #[arg(long, value_name = "MAP")]
    marker_map: Option<String>,
    /// Calibration file, as ROS writes it, for lines without a camera
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Pixels are those of the rectified image: use p instead of k and d
    #[arg(long)]
    rectified: bool,
    #[command(flatten)]
    estimator: EstimatorOptions,
    /// Add protection levels to each line
    #[arg(long, help_heading = "Protection levels")]
    protection_levels: bool,
    #[command(flatten)]
    integrity: IntegrityOptions,
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
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    #[error(transparent)]
    Setup(#[from] SetupError),
    #[error("cannot read line {number}: it exceeds {limit} bytes")]
    EndlessLine { number: u64, limit: u64 },
    #[error("cannot read the input: {0}")]
    Read(std::io::Error),
    #[error("cannot write the output: {0}")]
    Write(std::io::Error),
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
    // A person at the terminal reads the lines themselves; otherwise show progress.
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

/// Returns how many bytes the next line has, 0 at the end of the input; of a line that is too long only the beginning
/// is kept.
pub fn read_line(
    input: &mut impl BufRead,
    line: &mut Vec<u8>,
    number: u64,
) -> Result<u64, SolveError> {
    line.clear();
    let mut bytes = 0;
    loop {
        let chunk = input.fill_buf().map_err(SolveError::Read)?;
        let end = chunk.iter().position(|&byte| byte == b'\n');
        let taken = end.map_or(chunk.len(), |end| end + 1);
        if bytes <= MAX_LINE_BYTES {
            line.extend_from_slice(&chunk[..taken]);
        }
        input.consume(taken);
        bytes += taken as u64;
        if end.is_some() || taken == 0 {
            return Ok(bytes);
        }
        if bytes > MAX_SKIPPED_BYTES {
            return Err(SolveError::EndlessLine {
                number,
                limit: MAX_SKIPPED_BYTES,
            });
        }
    }
}

/// A camera, and where its image ends.
type Sight = (Camera, ImageEdges);

struct Solver {
    options: EstimatorOptions,
    estimator: Estimator,
    calibration_budget: Option<CalibrationBudget>,
    map: Option<MarkerMap>,
    calibration: Option<CameraInfo>,
    rectified: bool,
    pixel_sigma_px: f64,
    edge_margin_px: f64,
    camera: Option<(CameraInfo, Result<Sight, CameraError>)>,
    previous_rotation: Option<Rotation3<f64>>,
    integrity: Option<IntegrityMonitor>,
}

impl Solver {
    fn new(arguments: &Arguments) -> Result<Self, SolveError> {
        let map = arguments
            .marker_map
            .as_deref()
            .map(options::marker_map)
            .transpose()
            .map_err(SolveError::MarkerMap)?;
        let setup = arguments.integrity.setup()?;
        let integrity = arguments.protection_levels.then(|| {
            let turned = arguments.estimator.receiver_from_camera();
            let settings = arguments.integrity.settings();
            integrity_monitor(settings, &turned, map.as_ref(), setup.as_ref())
        });
        Ok(Self {
            estimator: arguments.estimator.estimator(map.as_ref(), &[]),
            calibration_budget: arguments.estimator.calibration_budget()?,
            options: arguments.estimator.clone(),
            map,
            calibration: arguments
                .camera
                .as_deref()
                .map(options::calibration)
                .transpose()?,
            rectified: arguments.rectified,
            pixel_sigma_px: arguments.estimator.pixel_sigma_px,
            edge_margin_px: arguments.estimator.edge_margin_px,
            camera: None,
            previous_rotation: None,
            integrity,
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
            number += 1;
            let answer = match read_line(&mut input, &mut line, number)? {
                0 => return output.flush().map_err(SolveError::Write),
                bytes if bytes > MAX_LINE_BYTES => OutputFrame::malformed(
                    serde_json::Value::Null,
                    format!("line {number}: expected at most {MAX_LINE_BYTES} bytes, got {bytes}"),
                ),
                _ => self.answer(&line, number),
            };
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
        if let Some(got) = not_an_object(line) {
            let message =
                format!("line {number}: expected a JSON object with camera and points, got {got}");
            return OutputFrame::malformed(serde_json::Value::Null, message);
        }
        match serde_json::from_slice::<InputFrame>(line) {
            Ok(frame) => match self.solve(&frame) {
                Ok(outcome) => OutputFrame::new(frame.id, outcome, self.levels()),
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

    /// Returns what writes protection levels, if they are wanted.
    fn levels(&self) -> Option<Levels<'_>> {
        let monitor = self.integrity.as_ref()?;
        let budget = self.estimator.budget();
        Some(Levels { monitor, budget })
    }

    fn solve(&mut self, frame: &InputFrame) -> Result<FrameOutcome, String> {
        let info = match (&frame.camera, &self.calibration) {
            (Some(camera), _) => camera.info()?,
            (None, Some(calibration)) => calibration.clone(),
            (None, None) => return Err("expected a camera, or a file by --camera".to_owned()),
        };
        let markers = frame
            .points
            .iter()
            .map(|point| self.marker(point).map(|marker| (point.id, marker)))
            .collect::<Result<Vec<_>, String>>()?;
        let detections: Vec<Detection> = frame.points.iter().map(InputPoint::detection).collect();
        let (sigma_px, margin_px) = (self.pixel_sigma_px, self.edge_margin_px);
        let (camera, edges) = match self.latch(info) {
            Ok(sight) => sight,
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
        let (observations, left_out) = edges.leave_out(observations, margin_px);
        let camera = camera.clone();
        let mut outcome = pipeline::solve(
            &self.estimator,
            &camera,
            &observations,
            self.previous_rotation.as_ref(),
        )
        .without(left_out);
        outcome.integrity = self.integrity.as_ref().map(|monitor| {
            let solution = outcome.result.as_ref().map_err(|_| Unavailable::NoPose)?;
            monitor.judge(&SolvedFrame {
                estimator: &self.estimator,
                map: self.map.as_ref(),
                camera: &camera,
                observations: &observations,
                solution,
            })
        });
        if let Ok(solution) = &outcome.result {
            self.previous_rotation =
                Some(solution.camera_from_tanker.rotation.to_rotation_matrix());
        }
        Ok(outcome)
    }

    /// Checks a camera once and keeps it while the lines bring the same.
    fn latch(&mut self, info: CameraInfo) -> Result<&Sight, &CameraError> {
        let rectified = self.rectified;
        let known = self.camera.take().filter(|(known, _)| *known == info);
        let (_, sight) = self.camera.insert(known.unwrap_or_else(|| {
            let sight = Camera::from_info(&info, rectified).and_then(|camera| {
                if let Some(budget) = &self.calibration_budget {
                    let modes = modes_of_file(budget, &info, &camera)?;
                    self.estimator = self.options.estimator(self.map.as_ref(), &modes);
                }
                let edges = ImageEdges::new(&info, &camera, rectified);
                Ok((camera, edges))
            });
            (info, sight)
        }));
        sight.as_ref()
    }

    /// The point's position on the tanker, its own or the map's; `None` without either.
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
