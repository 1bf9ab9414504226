//! Recorded frames, JSON Lines as `solve` reads them; marker positions in them are ignored for those of the map.

use std::fs::File;
use std::io::BufReader;
use std::path::{Path, PathBuf};
use std::rc::Rc;

use nalgebra::Point3;
use tanker_pose::camera::{Camera, CameraInfo};
use tanker_pose::estimation::Observation;
use tanker_pose::pipeline::{Detection, ImageEdges, observe};

use crate::solve::input::{InputFrame, InputPoint};
use crate::solve::{MAX_LINE_BYTES, SolveError, read_line};

/// Frames that are looked at, evenly taken from the recording.
const MOST_FRAMES: usize = 60;

/// Why a recording cannot be read.
#[derive(Debug, thiserror::Error)]
pub enum RecordingError {
    #[error("cannot read the recording {}: {source}", path.display())]
    Open {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot read the recording: {0}")]
    Read(#[from] SolveError),
    #[error("the recording {} has no frame: {reason}", path.display())]
    Empty { path: PathBuf, reason: String },
}

/// A camera, and where its image ends.
pub struct Sight {
    pub info: CameraInfo,
    pub camera: Camera,
    pub edges: ImageEdges,
}

/// One frame.
#[derive(Clone)]
pub struct Frame {
    pub sight: Rc<Sight>,
    pub detections: Vec<Detection>,
}

/// The frames of a recording that are looked at.
pub struct Recording {
    pub frames: Vec<Frame>,
    /// How many lines the file has.
    pub lines: usize,
    /// How many of them are no frame, and why the first is not.
    pub unusable: usize,
    pub first_reason: Option<String>,
}

impl Sight {
    pub fn new(info: CameraInfo, rectified: bool) -> Result<Self, String> {
        let camera = Camera::from_info(&info, rectified).map_err(|error| error.to_string())?;
        let edges = ImageEdges::new(&info, &camera, rectified);
        Ok(Self {
            info,
            camera,
            edges,
        })
    }
}

impl Recording {
    /// Returns the recording of a file.
    ///
    /// # Inputs
    /// * `calibration`: for lines without a camera.
    pub fn read(
        path: &Path,
        calibration: Option<&CameraInfo>,
        rectified: bool,
    ) -> Result<Self, RecordingError> {
        let file = File::open(path).map_err(|source| RecordingError::Open {
            path: path.to_owned(),
            source,
        })?;
        let mut input = BufReader::new(file);
        let (mut line, mut number) = (Vec::new(), 0_u64);
        let mut recording = Self {
            frames: Vec::new(),
            lines: 0,
            unusable: 0,
            first_reason: None,
        };
        let mut known: Option<Rc<Sight>> = None;
        loop {
            number += 1;
            let bytes = read_line(&mut input, &mut line, number)?;
            if bytes == 0 {
                break;
            }
            recording.lines += 1;
            let frame = if bytes > MAX_LINE_BYTES {
                Err(format!("it exceeds {MAX_LINE_BYTES} bytes"))
            } else {
                frame(&line, calibration, rectified, &mut known)
            };
            match frame {
                Ok(frame) => recording.frames.push(frame),
                Err(reason) => {
                    recording.unusable += 1;
                    let reason = format!("line {number}: {reason}");
                    recording.first_reason.get_or_insert(reason);
                }
            }
        }
        if recording.frames.is_empty() {
            return Err(RecordingError::Empty {
                path: path.to_owned(),
                reason: recording
                    .first_reason
                    .unwrap_or_else(|| "it is empty".to_owned()),
            });
        }
        recording.frames = spread(recording.frames);
        Ok(recording)
    }
}

/// Returns at most [`MOST_FRAMES`], the first and the last among them.
fn spread(frames: Vec<Frame>) -> Vec<Frame> {
    let count = frames.len();
    if count <= MOST_FRAMES {
        return frames;
    }
    (0..MOST_FRAMES)
        .map(|index| frames[index * (count - 1) / (MOST_FRAMES - 1)].clone())
        .collect()
}

fn frame(
    line: &[u8],
    calibration: Option<&CameraInfo>,
    rectified: bool,
    known: &mut Option<Rc<Sight>>,
) -> Result<Frame, String> {
    let frame: InputFrame =
        serde_json::from_slice(line).map_err(|error| crate::solve::input::reason(&error))?;
    let info = match (&frame.camera, calibration) {
        (Some(camera), _) => camera.info()?,
        (None, Some(calibration)) => calibration.clone(),
        (None, None) => return Err("expected a camera, or a file by --camera".to_owned()),
    };
    let sight = match known.as_ref().filter(|sight| sight.info == info) {
        Some(sight) => Rc::clone(sight),
        None => Rc::new(Sight::new(info, rectified)?),
    };
    *known = Some(Rc::clone(&sight));
    Ok(Frame {
        sight,
        detections: frame.points.iter().map(InputPoint::detection).collect(),
    })
}

impl Frame {
    /// Returns the observations with marker positions from `place`; markers without one are left out. Or why the node
    /// would refuse the frame before it estimates.
    pub fn observations(
        &self,
        sigma_px: f64,
        margin_px: f64,
        place: impl Fn(u32) -> Option<Point3<f64>>,
    ) -> Result<Vec<Observation>, String> {
        let known: Vec<Detection> = self
            .detections
            .iter()
            .filter(|seen| place(seen.id).is_some())
            .copied()
            .collect();
        let observations = observe(&self.sight.camera, &known, sigma_px, place)
            .map_err(|refusal| refusal.to_string())?;
        let (observations, _) = self.sight.edges.leave_out(observations, margin_px);
        Ok(observations)
    }
}
