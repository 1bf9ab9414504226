//! `tanker_pose calibrate-map`: marker map, mount and camera refined from a recorded approach.

mod files;
mod report;

use std::path::PathBuf;
use std::process::ExitCode;

use ros2_node::arguments::ArgumentError;
use tanker_pose::calibration::{CalibrateError, CalibrationSettings, MountPrior, calibrate};
use tanker_pose::recording::{OpenError, Recording};
use tanker_pose::replay::{Flight, FlightError, Replay, ReplayError};
use tanker_pose::target::{BodyChange, MapChange, MarkerMap, MarkerMapError};

use crate::options::{self, CalibrationError};
use crate::ros_options::RosOptions;

/// Something was refined.
const REFINED: u8 = 0;
/// The data support nothing of what may be wrong.
const NOT_TOLD: u8 = 1;
/// An error.
const FAILED: u8 = 2;

/// Refine marker map, camera mount and camera from a recorded approach, with honest sigmas; measure the detector's noise.
///
/// Topics, remaps and parameters are the node's, as in `replay`: -r from:=to, -p, --params-file after --ros-args. What is
/// believed and how well comes from the marker map (`sigma`) and from the parameters of the error budget. Writes map.yaml,
/// parameters.yaml and report.json into the output folder; camera.yaml with --intrinsics, `calibration_budget.yaml` where
/// the camera has sigmas. Exit code: 0 if something was refined, 1 if the data support nothing of it, 2 on an error.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// MCAP file, `SQLite` file of rosbag2 (.db3), or a bag's folder
    recording: PathBuf,
    /// Marker map: paper, fin6 or a path; in place of the parameter `marker_map`
    #[arg(long, value_name = "MAP")]
    map: Option<String>,
    /// Standard deviation of each coordinate of markers for which the map has none, m; they are exact otherwise
    #[arg(long, value_name = "M", value_parser = positive)]
    survey_sigma_m: Option<f64>,
    /// Calibration file of the camera, in place of the recorded camera infos
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Write a refined camera, as far as the budget has sigmas of the calibration and the data support it
    #[arg(long)]
    intrinsics: bool,
    /// Refine the mount; needs the attitudes of both aircraft in the recording, and the parameters `attitude` and
    /// `reported_attitude_sigma_deg`
    #[arg(long)]
    mount: bool,
    /// Standard deviation of the mount about each axis before the recording, degrees
    #[arg(long, value_name = "DEG", default_value_t = 1.0, value_parser = positive)]
    mount_sigma_deg: f64,
    /// Standard deviation of what changes in the reported attitudes from frame to frame, degrees; what stays the same is
    /// `reported_attitude_sigma_deg`
    #[arg(long, value_name = "DEG", default_value_t = 0.5, value_parser = positive)]
    attitude_noise_deg: f64,
    /// Folder to write into [default: the recording's name with _calibrated]
    #[arg(short, long, value_name = "FOLDER")]
    output: Option<PathBuf>,
    #[command(flatten)]
    ros: RosOptions,
}

fn positive(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(value) if value > 0.0 && f64::is_finite(value) => Ok(value),
        _ => Err(format!("expected a number above 0, got {text:?}")),
    }
}

/// Why nothing can be refined.
#[derive(Debug, thiserror::Error)]
enum Error {
    #[error(transparent)]
    Arguments(#[from] ArgumentError),
    #[error(transparent)]
    Replay(#[from] Box<ReplayError>),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Flight(#[from] FlightError),
    #[error(transparent)]
    Camera(#[from] CalibrationError),
    #[error("cannot use --survey-sigma-m: {0}")]
    SurveySigma(#[from] MarkerMapError),
    #[error(transparent)]
    Calibrate(#[from] CalibrateError),
    #[error(
        "--intrinsics needs detections in the raw image: with `rectified` the parameters K and D that a camera file holds are not seen"
    )]
    Rectified,
    #[error(
        "--intrinsics needs a sigma of what the calibration may have wrong: focal_length_sigma, principal_point_sigma_px, k1_sigma, k2_sigma or calibration_budget_file"
    )]
    ExactCamera,
    #[error(transparent)]
    Files(#[from] files::FilesError),
}

/// Runs the tool; says on standard error what could not be read.
pub fn run(arguments: &Arguments) -> ExitCode {
    let code = match refine(arguments) {
        Ok(true) => REFINED,
        Ok(false) => NOT_TOLD,
        Err(error) => {
            eprintln!("tanker_pose: {error}");
            FAILED
        }
    };
    ExitCode::from(code)
}

fn refine(arguments: &Arguments) -> Result<bool, Error> {
    let given = arguments
        .camera
        .as_deref()
        .map(options::calibration)
        .transpose()?;
    let mut more = Vec::new();
    if let Some(map) = &arguments.map {
        // A string of JSON is one of YAML, whatever the name.
        let quoted = serde_json::Value::from(map.as_str());
        more = vec!["-p".to_owned(), format!("marker_map:={quoted}")];
    }
    let mut replay = Replay::new(&arguments.ros.read_with(&more)?).map_err(Box::new)?;
    for warning in &replay.warnings {
        eprintln!("tanker_pose: warning: {warning}");
    }
    if let Some(sigma_m) = arguments.survey_sigma_m {
        let map = surveyed(replay.map(), sigma_m)?;
        replay = replay.with_map(map);
    }
    let recording = Recording::open(&arguments.recording)?;
    let flight = replay.flight(recording, given)?;
    for words in &flight.skipped {
        eprintln!("tanker_pose: skipped: {words}");
    }
    if arguments.intrinsics && flight.settings.rectified {
        return Err(Error::Rectified);
    }
    let budget = flight.estimator.budget();
    if arguments.intrinsics && budget.is_none_or(|budget| budget.calibration().is_empty()) {
        return Err(Error::ExactCamera);
    }
    let settings = CalibrationSettings {
        intrinsics: arguments.intrinsics,
        mount: arguments.mount_prior(&flight),
        ..CalibrationSettings::default()
    };
    let found = calibrate(
        &flight.camera,
        &flight.map,
        &flight.estimator,
        &flight.frames,
        &settings,
    )?;
    let folder = arguments.output.clone().unwrap_or_else(|| {
        let mut name = arguments
            .recording
            .file_stem()
            .unwrap_or_default()
            .to_os_string();
        name.push("_calibrated");
        arguments.recording.with_file_name(name)
    });
    files::write(&folder, &flight, &found)?;
    report::say(&found, &folder);
    Ok(report::is_anything_moved(&found))
}

impl Arguments {
    /// Returns what is known of the mount, if it is to be refined.
    fn mount_prior(&self, flight: &Flight) -> Option<MountPrior> {
        self.mount.then(|| MountPrior {
            camera_from_receiver: flight.settings.receiver_from_camera.inverse(),
            sigma_rad: self.mount_sigma_deg.to_radians(),
            attitude_bias_rad: flight
                .settings
                .reported_attitude
                .map_or(0.0, |reported| reported.sigma_rad),
            attitude_noise_rad: self.attitude_noise_deg.to_radians(),
        })
    }
}

/// Returns the map with a sigma for the markers and tags that have none.
fn surveyed(map: &MarkerMap, sigma_m: f64) -> Result<MarkerMap, MarkerMapError> {
    let mut change = MapChange {
        flex: map.budget().flex.clone(),
        ..MapChange::default()
    };
    let has_sigma = |id: u32| map.budget().survey_sigma_m.iter().any(|(of, _)| *of == id);
    let body = BodyChange {
        sigma_m,
        ..BodyChange::default()
    };
    for marker in map.markers().iter().filter(|marker| !has_sigma(marker.id)) {
        match map.tag_of_corner(marker.id) {
            Some(tag) => change.tags.insert(tag.id, body),
            None => change.markers.insert(marker.id, body),
        };
    }
    map.changed(&change)
}
