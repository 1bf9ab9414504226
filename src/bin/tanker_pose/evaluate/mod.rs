//! `tanker_pose evaluate`: recordings judged, one report each and one over all, without ROS.

mod files;

use std::path::{Path, PathBuf};

use indicatif::ProgressBar;
use rayon::prelude::*;
use ros2_node::arguments::ArgumentError;
use tanker_pose::evaluation::{
    Evaluation, FailedBag, FleetReport, Report, Settings, SettingsError,
};
use tanker_pose::recording::{OpenError, Recording};

use crate::recording_codes::{IN_PART, NOTHING, WHOLE};
use crate::ros_options::RosOptions;
use files::{Job, WriteError};

/// Judge recordings: errors against a truth, honesty of the covariance, protection levels, refusals, residuals, delays.
///
/// Of each recording a page (evaluation.html), the same figures as JSON (evaluation.json) and its trajectories; of several
/// a summary too. Answers of the node must be in the recording, live or written by `replay`. Names, map and mount are the
/// node's parameters: -r from:=to, -p, --params-file after --ros-args. Exit code: 0 if all was read, 1 if something could
/// not be read or used (it is named, the rest is evaluated), 2 if nothing could be evaluated.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// MCAP files, `SQLite` files of rosbag2 (.db3), or bags' folders; with --reports: files evaluation.json
    #[arg(required = true, value_name = "BAG")]
    recordings: Vec<PathBuf>,
    /// Topic of the true pose of the tanker in the camera: `PoseStamped`, `PoseWithCovarianceStamped` or Odometry [default:
    /// truth, if there is one]
    #[arg(long, value_name = "TOPIC")]
    truth: Option<String>,
    /// Folder to write; with several recordings it gets a folder for each [default: evaluation]
    #[arg(short, long, value_name = "DIR")]
    output: Option<PathBuf>,
    /// Write the summary over reports that were written before only: BAG are files evaluation.json, or folders of reports
    #[arg(long, conflicts_with_all = ["truth", "ros_args"])]
    reports: bool,
    #[command(flatten)]
    ros: RosOptions,
}

/// Why nothing can be evaluated.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Arguments(#[from] ArgumentError),
    #[error(transparent)]
    Settings(#[from] Box<SettingsError>),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("none of the files holds a report")]
    NoReport,
}

/// Evaluates the recordings; says on standard error what could not be read.
pub fn run(arguments: &Arguments) -> u8 {
    match evaluate(arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("tanker_pose: {error}");
            NOTHING
        }
    }
}

fn evaluate(arguments: &Arguments) -> Result<u8, Error> {
    let output = arguments
        .output
        .clone()
        .unwrap_or_else(|| PathBuf::from("evaluation"));
    if arguments.reports {
        return summarise(&arguments.recordings, &output);
    }
    let ros = arguments.ros.read()?;
    let settings = Settings::new(&ros, arguments.truth.as_deref()).map_err(Box::new)?;
    for warning in &settings.warnings {
        eprintln!("tanker_pose: warning: {warning}");
    }
    let jobs = files::folders(&arguments.recordings, &output);
    let bar = ProgressBar::new(jobs.len() as u64);
    let results: Vec<Result<Report, Error>> = jobs
        .par_iter()
        .map(|job| {
            let report = one(job, &settings);
            bar.inc(1);
            report
        })
        .collect();
    bar.finish_and_clear();
    let mut codes = Vec::new();
    let (mut reports, mut failed) = (Vec::new(), Vec::new());
    for (job, result) in jobs.iter().zip(results) {
        codes.push(match result {
            Ok(report) => {
                let code = say(job, &report);
                reports.push(report);
                code
            }
            Err(error) => {
                eprintln!("tanker_pose: {}: {error}", job.recording.display());
                failed.push(FailedBag {
                    bag: job.name.clone(),
                    reason: error.to_string(),
                });
                NOTHING
            }
        });
    }
    if jobs.len() > 1 && !reports.is_empty() {
        sum_up(&reports, failed, &output)?;
    }
    Ok(overall(&codes))
}

/// Returns the exit code for several: that of all, or the one for a part.
fn overall(codes: &[u8]) -> u8 {
    match codes.first() {
        Some(first) if codes.iter().all(|code| code == first) => *first,
        Some(_) => IN_PART,
        None => NOTHING,
    }
}

/// Writes the summary over reports that were written before.
fn summarise(paths: &[PathBuf], output: &Path) -> Result<u8, Error> {
    let (mut reports, mut failed) = (Vec::new(), Vec::new());
    for path in files::reports(paths) {
        match files::read(&path) {
            Ok(report) => reports.push(report),
            Err(reason) => {
                eprintln!("tanker_pose: {}: {reason}", path.display());
                failed.push(FailedBag {
                    bag: files::name_of(&path),
                    reason,
                });
            }
        }
    }
    if reports.is_empty() {
        return Err(Error::NoReport);
    }
    let code = if failed.is_empty() { WHOLE } else { IN_PART };
    sum_up(&reports, failed, output)?;
    Ok(code)
}

/// Writes the summary over reports, and says where it is.
fn sum_up(reports: &[Report], failed: Vec<FailedBag>, output: &Path) -> Result<(), WriteError> {
    let fleet = FleetReport::of(reports, failed);
    files::write_summary(&fleet, output)?;
    let page = output.join(files::SUMMARY_PAGE);
    println!("{}: {}", page.display(), fleet.in_words());
    Ok(())
}

fn one(job: &Job, settings: &Settings) -> Result<Report, Error> {
    let opened = Recording::open(&job.recording)?;
    let evaluation = Evaluation::of(&job.name, opened, settings);
    files::write(&evaluation, &job.folder)?;
    Ok(evaluation.report)
}

fn say(job: &Job, report: &Report) -> u8 {
    let name = job.recording.display();
    for words in &report.skipped {
        eprintln!("tanker_pose: {name}: skipped: {words}");
    }
    for words in &report.notes {
        eprintln!("tanker_pose: {name}: note: {words}");
    }
    let page = job.folder.join(files::PAGE);
    println!("{name}: {}: {}", page.display(), report.in_words());
    if !report.has_answers() {
        NOTHING
    } else if report.is_whole() {
        WHOLE
    } else {
        IN_PART
    }
}
