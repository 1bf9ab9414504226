//! `tanker_pose replay`: a recording answered as the node would, without ROS and without a clock.

mod timing;
mod warnings;

use std::path::{Path, PathBuf};
use std::time::Instant;

use indicatif::{ProgressBar, ProgressStyle};
use ros2_node::arguments::ArgumentError;
use tanker_pose::recording::{OpenError, Recording, WriteError, Writer};
use tanker_pose::replay::{Replay, ReplayError, Summary};

use crate::recording_codes::{IN_PART, NOTHING, WHOLE};
use crate::ros_options::RosOptions;

/// Answer a recording as the node would, without ROS: poses, status and all else into an MCAP file.
///
/// Topics, remaps and parameters are the node's: -r from:=to, -p, --params-file after --ros-args. Time is the
/// recording's, and the same recording gives the same bytes. Exit code: 0 if all was read, 1 if something could not be read
/// or used (it is named, the rest is answered), 2 if nothing could be answered.
#[derive(Debug, clap::Args)]
pub struct Arguments {
    /// MCAP file (zstd, lz4, with or without index, cut off), `SQLite` file of rosbag2 (.db3), or a bag's folder
    recording: PathBuf,
    /// MCAP file to write; one that exists is overwritten [default: the recording's name with _replayed.mcap]
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
    /// Write the answers only, not the recording's own messages
    #[arg(long)]
    answers_only: bool,
    /// Afterwards only read and decode the MCAP file, by the mcap crate, and print how the times compare
    #[arg(long)]
    timing: bool,
    #[command(flatten)]
    ros: RosOptions,
}

/// Why nothing can be answered.
#[derive(Debug, thiserror::Error)]
pub enum Error {
    #[error(transparent)]
    Arguments(#[from] ArgumentError),
    #[error(transparent)]
    Replay(#[from] Box<ReplayError>),
    #[error(transparent)]
    Open(#[from] OpenError),
    #[error(transparent)]
    Write(#[from] WriteError),
    #[error("the output {} is the recording itself", .0.display())]
    Same(PathBuf),
    #[error("--timing: {0}")]
    Timing(String),
}

/// Answers the recording; says on standard error what could not be read.
pub fn run(arguments: &Arguments) -> u8 {
    let bar = bar();
    warnings::start(&bar);
    let code = match answer(arguments, &bar) {
        Ok(summary) if summary.frames == 0 => NOTHING,
        Ok(summary) if summary.is_whole() => WHOLE,
        Ok(_) => IN_PART,
        Err(error) => {
            bar.suspend(|| eprintln!("tanker_pose: {error}"));
            NOTHING
        }
    };
    bar.finish_and_clear();
    code
}

fn answer(arguments: &Arguments, bar: &ProgressBar) -> Result<Summary, Error> {
    let replay = Replay::new(&arguments.ros.read()?).map_err(Box::new)?;
    for warning in &replay.warnings {
        bar.suspend(|| eprintln!("tanker_pose: warning: {warning}"));
    }
    let input = &arguments.recording;
    let output = match &arguments.output {
        Some(output) => output.clone(),
        None => beside(input),
    };
    let begin = Instant::now();
    let recording = Recording::open(input)?;
    if is_within(&output, input) {
        return Err(Error::Same(output));
    }
    let writer = Writer::create(&output)?;
    let copies = !arguments.answers_only;
    let progress = |size, passed| {
        bar.set_length(size);
        bar.set_position(passed);
    };
    let answered = replay.answer(recording, writer, copies, progress);
    let summary = answered.map_err(Box::new)?;
    let taken = begin.elapsed();
    bar.suspend(|| say(&summary, &output));
    if arguments.timing {
        let line = timing::compare(input, summary.frames, taken).map_err(Error::Timing)?;
        bar.suspend(|| println!("{line}"));
    }
    Ok(summary)
}

fn say(summary: &Summary, output: &Path) {
    let unprinted = warnings::unprinted();
    if unprinted > 0 {
        eprintln!(
            "tanker_pose: {unprinted} more warnings; the statuses in {} say what became of each frame",
            output.display()
        );
    }
    for words in &summary.skipped {
        eprintln!("tanker_pose: skipped: {words}");
    }
    for words in &summary.notes {
        eprintln!("tanker_pose: note: {words}");
    }
    let outcomes: Vec<String> = summary
        .outcomes
        .iter()
        .map(|(name, count)| format!("{name} {count}"))
        .collect();
    println!(
        "{} frames of {} messages answered into {}: {}",
        summary.frames,
        summary.messages,
        output.display(),
        if outcomes.is_empty() {
            "none".to_owned()
        } else {
            outcomes.join(", ")
        }
    );
}

/// Returns where the answers go unless that is said.
fn beside(input: &Path) -> PathBuf {
    let stem = input.file_stem().unwrap_or_default();
    let mut name = stem.to_os_string();
    name.push("_replayed.mcap");
    input.with_file_name(name)
}

/// Whether the output is the input, or a file of the bag that is the input.
fn is_within(output: &Path, input: &Path) -> bool {
    let (Ok(output), Ok(input)) = (output.canonicalize(), input.canonicalize()) else {
        return false;
    };
    output == input || (input.is_dir() && output.parent() == Some(&input))
}

fn bar() -> ProgressBar {
    let bar = ProgressBar::new(0);
    if let Ok(style) = ProgressStyle::with_template("{bar:30} {bytes}/{total_bytes}  {eta} left") {
        bar.set_style(style);
    }
    bar
}
