//! `tanker_pose check`: marker map, camera and error budget together, before flight.
//!
//! Looks at the map alone (size, flatness, symmetry), along the nominal approach without noise (sigmas by cause,
//! protection levels with all beacons and with each one lost), and against a recording if there is one. Exit codes: 0
//! nothing to mend, 1 warnings or errors, 2 something cannot be read.

mod against;
mod along;
mod axes;
mod exchanged;
mod figure;
mod finding;
mod more;
mod offset;
mod recording;
mod report;
mod shape;
mod situation;
#[cfg(test)]
mod tests;
mod verdict;
mod view;

use std::cmp::Reverse;
use std::io::Write;
use std::path::{Path, PathBuf};

use tanker_pose::camera::{CameraError, CameraFileError, CameraInfo};
use tanker_pose::pipeline::{integrity_monitor, modes_of_file};
use tanker_pose::target::{MarkerMap, MarkerMapError};
use tanker_pose::text_file;

use self::against::{Against, Outcome};
use self::finding::{Finding, Severity};
use self::recording::{Recording, RecordingError, Sight};
use self::report::{Report, finding_json};
use self::situation::{Route, Situation};
use crate::options::{self, CalibrationError, EstimatorOptions, IntegrityOptions, SetupError};
use crate::plot::panel;

/// The exit code if nothing is to be mended.
const NOTHING_FOUND: u8 = 0;
/// Something is to be mended.
const FOUND: u8 = 1;
/// Something cannot be read.
const UNREADABLE: u8 = 2;

/// Assumed without `--camera`.
const PAPER_CAMERA: &str = include_str!("../../../../config/cameras/paper.yaml");

/// Check marker map, camera and error budget together before flight
///
/// Exit code 0: nothing to mend; 1: warnings or errors; 2: something cannot be read.
#[derive(Debug, clap::Args)]
#[command(allow_negative_numbers = true)]
pub struct Arguments {
    /// Marker map: paper, fin6 or a path
    #[arg(long, value_name = "MAP")]
    marker_map: String,
    /// Calibration file, as ROS writes it; without it the recording's camera, or else the paper's
    #[arg(long, value_name = "FILE")]
    camera: Option<PathBuf>,
    /// Pixels are those of the rectified image: use p instead of k and d
    #[arg(long)]
    rectified: bool,
    /// Frames of an approach, JSON Lines as `solve` reads them, to hold the map against
    #[arg(long, value_name = "FILE")]
    recording: Option<PathBuf>,
    /// Where the approach begins: how far the tanker's origin is ahead of the camera, m
    #[arg(long, value_name = "M", default_value_t = 60.0, value_parser = metres)]
    from_m: f64,
    /// Where it ends, m; with --refuelling at contact at the latest
    #[arg(long, value_name = "M", default_value_t = 5.0, value_parser = metres)]
    to_m: f64,
    /// Ranges that are looked at
    #[arg(long, value_name = "N", default_value_t = 20, value_parser = clap::value_parser!(u32).range(2..=1000))]
    steps: u32,
    /// Error that is allowed at the nearest range, m
    #[arg(long, value_name = "M", default_value_t = 0.1, value_parser = metres)]
    required_m: f64,
    /// Directory for plots (SVG); made where missing
    #[arg(long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Print JSON instead of tables
    #[arg(long)]
    json: bool,
    #[command(flatten)]
    estimator: EstimatorOptions,
    #[command(flatten)]
    integrity: IntegrityOptions,
}

fn metres(text: &str) -> Result<f64, String> {
    match text.parse::<f64>() {
        Ok(value) if value > 0.0 && value <= 1e4 => Ok(value),
        _ => Err(format!(
            "expected metres, above 0 and at most 10000, got {text}"
        )),
    }
}

/// Why nothing can be checked.
#[derive(Debug, thiserror::Error)]
enum CheckError {
    #[error("cannot use the marker map: {0}")]
    MarkerMap(String),
    #[error(transparent)]
    Calibration(#[from] CalibrationError),
    #[error("cannot use the camera: {0}")]
    Camera(String),
    #[error("cannot use what the calibration may have wrong: {0}")]
    CalibrationBudget(#[from] CameraError),
    #[error(transparent)]
    Setup(#[from] SetupError),
    #[error(transparent)]
    Recording(#[from] RecordingError),
    #[error("{0}")]
    Route(String),
    #[error("cannot write {}: {source}", path.display())]
    Write {
        path: PathBuf,
        source: std::io::Error,
    },
    #[error("cannot draw {}: {reason}", path.display())]
    Draw { path: PathBuf, reason: String },
    #[error("cannot print the report: {0}")]
    Print(std::io::Error),
}

/// Checks and prints; the exit code says whether something is to be mended.
pub fn run(arguments: &Arguments) -> u8 {
    let checked = check(arguments).and_then(|(text, severity)| {
        print(&text)?;
        Ok(severity)
    });
    match checked {
        Ok(None | Some(Severity::Note)) => NOTHING_FOUND,
        Ok(Some(Severity::Warning | Severity::Error)) => FOUND,
        Err(error) => {
            eprintln!("tanker_pose: {error}");
            UNREADABLE
        }
    }
}

/// Returns the report, and the worst of its findings.
fn check(arguments: &Arguments) -> Result<(String, Option<Severity>), CheckError> {
    let map = match read_map(&arguments.marker_map)? {
        Ok(map) => map,
        Err(finding) => {
            let text = if arguments.json {
                format!(
                    "{:#}",
                    serde_json::json!({"findings": [finding_json(&finding)]})
                )
            } else {
                format!("Findings\n  {finding}")
            };
            return Ok((text, Some(finding.severity)));
        }
    };
    let calibration = arguments
        .camera
        .as_deref()
        .map(options::calibration)
        .transpose()?;
    let recording = arguments
        .recording
        .as_deref()
        .map(|path| Recording::read(path, calibration.as_ref(), arguments.rectified))
        .transpose()?;
    let (info, camera) = camera_of(arguments, calibration, recording.as_ref())?;
    let mut findings = Vec::new();
    if info.width == 0 || info.height == 0 {
        findings.push(Finding::warning(
            "image_size",
            "the camera's size of the image is not known, so nothing leaves it".to_owned(),
            "write width and height into the calibration",
        ));
    }
    let situation = situation(arguments, map, info)?;
    let checked = Checked::new(
        &situation,
        recording.as_ref(),
        arguments.required_m,
        findings,
    );
    let files = match &arguments.output {
        Some(directory) => draw(&situation, &checked, directory)?,
        None => Vec::new(),
    };
    let report = Report {
        situation: &situation,
        camera,
        shape: &checked.shape,
        stations: &checked.stations,
        verdicts: &checked.verdicts,
        one_more: checked.one_more.as_ref(),
        recording: checked.outcome.as_ref(),
        findings: &checked.findings,
        files: &files,
    };
    let text = if arguments.json {
        format!("{:#}", report.json())
    } else {
        report.text()
    };
    let worst = checked
        .findings
        .iter()
        .map(|finding| finding.severity)
        .max();
    Ok((text, worst))
}

/// All that is found in a situation.
struct Checked {
    shape: shape::Shape,
    stations: Vec<along::Station>,
    verdicts: Vec<verdict::Verdict>,
    one_more: Option<more::OneMore>,
    outcome: Option<Outcome>,
    /// The worst first.
    findings: Vec<Finding>,
}

impl Checked {
    fn new(
        situation: &Situation,
        recording: Option<&Recording>,
        required_m: f64,
        mut findings: Vec<Finding>,
    ) -> Self {
        let (shape, of_shape) = shape::lint(&situation.map);
        findings.extend(of_shape);
        let against = Against {
            map: &situation.map,
            estimator: &situation.estimator,
            sigma_px: situation.sigma_px,
            margin_px: situation.edge_margin_px,
            required_m,
        };
        let outcome = recording.map(|recording| against.check(recording));
        findings.extend(outcome.iter().flat_map(|outcome| outcome.findings.clone()));
        let stations = along::stations(situation);
        let verdicts = verdict::verdicts(situation, &stations, required_m);
        findings.extend(verdict::findings(situation, &stations, &verdicts));
        if let Some(pairs) = shape.mirrors[1].as_ref().filter(|pairs| !pairs.is_empty()) {
            findings.push(exchanged::lint(situation, pairs));
        }
        if !situation.estimator.has_causes() {
            findings.push(Finding::note(
                "no_budget",
                "no error of map or calibration is stated: sigmas and levels are those of exact ones".to_owned(),
                "state them: docs/budget.md",
            ));
        }
        findings.sort_by_key(|finding| Reverse(finding.severity));
        Self {
            one_more: more::best(situation),
            shape,
            stations,
            verdicts,
            outcome,
            findings,
        }
    }
}

/// Returns the map, or what is wrong with its coordinates so that it is none.
fn read_map(name_or_path: &str) -> Result<Result<MarkerMap, Finding>, CheckError> {
    if let Some(map) = MarkerMap::shipped(name_or_path) {
        return Ok(Ok(map));
    }
    let text = text_file::read(Path::new(name_or_path)).map_err(|error| {
        CheckError::MarkerMap(format!(
            "{name_or_path}: {error} (expected paper, fin6 or the path of a marker map)"
        ))
    })?;
    MarkerMap::from_yaml(&text, name_or_path)
        .map(Ok)
        .or_else(|error: MarkerMapError| {
            let finding = shape::of_refusal(&error);
            finding
                .map(Err)
                .ok_or_else(|| CheckError::MarkerMap(error.to_string()))
        })
}

/// Returns the camera of the options, or of the recording, or the paper's, and where it is from.
fn camera_of(
    arguments: &Arguments,
    calibration: Option<CameraInfo>,
    recording: Option<&Recording>,
) -> Result<(CameraInfo, String), CheckError> {
    if let (Some(info), Some(path)) = (calibration, &arguments.camera) {
        return Ok((info, path.display().to_string()));
    }
    if let Some(frame) = recording.and_then(|recording| recording.frames.first()) {
        let info = frame.sight.info.clone();
        return Ok((info, "that of the recording's first frame".to_owned()));
    }
    let paper = CameraInfo::from_yaml(PAPER_CAMERA, "config/cameras/paper.yaml");
    let (info, _) =
        paper.map_err(|error: CameraFileError| CheckError::Camera(error.to_string()))?;
    Ok((
        info,
        "the paper's is assumed (--camera names yours)".to_owned(),
    ))
}

fn situation(
    arguments: &Arguments,
    map: MarkerMap,
    info: CameraInfo,
) -> Result<Situation, CheckError> {
    let sight = Sight::new(info, arguments.rectified).map_err(CheckError::Camera)?;
    let modes = match arguments.estimator.calibration_budget()? {
        Some(budget) => modes_of_file(&budget, &sight.info, &sight.camera)?,
        None => Vec::new(),
    };
    let estimator = arguments.estimator.estimator(Some(&map), &modes);
    let setup = arguments.integrity.setup()?;
    let receiver_from_camera = arguments.estimator.receiver_from_camera();
    let monitor = integrity_monitor(
        arguments.integrity.settings(),
        &receiver_from_camera,
        Some(&map),
        setup.as_ref(),
    );
    let geometry = setup.map(|setup| setup.geometry(&receiver_from_camera));
    let route = Route::new(
        arguments.from_m,
        arguments.to_m,
        arguments.steps,
        geometry.as_ref(),
        &estimator.settings().nominal_camera_from_tanker,
    )
    .map_err(CheckError::Route)?;
    Ok(Situation {
        map,
        camera: sight.camera,
        edges: sight.edges,
        estimator,
        monitor,
        receiver_from_camera,
        geometry,
        sigma_px: arguments.estimator.pixel_sigma_px,
        edge_margin_px: arguments.estimator.edge_margin_px,
        route,
    })
}

/// Writes a plot for each declared point.
fn draw(
    situation: &Situation,
    checked: &Checked,
    directory: &Path,
) -> Result<Vec<PathBuf>, CheckError> {
    let write = |path: &Path, source| CheckError::Write {
        path: path.to_owned(),
        source,
    };
    std::fs::create_dir_all(directory).map_err(|source| write(directory, source))?;
    let points = situation.monitor.points().iter().enumerate();
    points
        .map(|(index, point)| {
            let is_safe = |c: char| c.is_ascii_alphanumeric() || c == '-' || c == '_';
            let name: String = point
                .name
                .chars()
                .map(|c| if is_safe(c) { c } else { '_' })
                .take(64)
                .collect();
            let path = directory.join(format!("check_{}_{name}.svg", index + 1));
            let figure = figure::figure(situation, &checked.stations, index);
            let svg = panel::svg(&figure).map_err(|error| CheckError::Draw {
                path: path.clone(),
                reason: error.to_string(),
            })?;
            std::fs::write(&path, svg).map_err(|source| write(&path, source))?;
            Ok(path)
        })
        .collect()
}

fn print(text: &str) -> Result<(), CheckError> {
    let mut stdout = std::io::stdout().lock();
    match writeln!(stdout, "{text}") {
        // The reader has seen enough, as `head` does: not a fault.
        Err(error) if error.kind() == std::io::ErrorKind::BrokenPipe => Ok(()),
        result => result.map_err(CheckError::Print),
    }
}
