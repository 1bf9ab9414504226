//! A recording answered as the node would, its answers as arrays.

use std::path::PathBuf;

use numpy::ndarray::Array2;
use numpy::{PyArray1, PyArray2};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList};
use ros2_node::arguments::Arguments;
use tanker_pose::messages::{
    EstimatorStatus, Header, Odometry, PoseWithCovariance, PoseWithCovarianceStamped,
};
use tanker_pose::recording::{Recording, Writer, type_name};
use tanker_pose::replay::{Replay, Summary};

use crate::errors::value_error;

/// Columns of numbers, and of words, of one topic.
#[derive(Default)]
struct Table {
    stamps_ns: Vec<i64>,
    numbers: Vec<(&'static str, usize, Vec<f64>)>,
    whole: Vec<(&'static str, Vec<u32>)>,
    words: Vec<(&'static str, Vec<String>)>,
    ids: Vec<(&'static str, Vec<Vec<u32>>)>,
}

impl Table {
    fn stamp(&mut self, header: &Header) {
        let stamp = tanker_pose::pipeline::Stamp::from(header.stamp);
        self.stamps_ns.push(stamp.nanoseconds());
    }

    fn doubles(&mut self, name: &'static str, row: &[f64]) {
        match self.numbers.iter_mut().find(|(known, ..)| *known == name) {
            Some((_, _, column)) => column.extend_from_slice(row),
            None => self.numbers.push((name, row.len(), row.to_vec())),
        }
    }

    fn whole(&mut self, name: &'static str, value: u32) {
        push(&mut self.whole, name, value);
    }

    fn pose(&mut self, pose: &PoseWithCovariance) {
        let (at, turn) = (&pose.pose.position, &pose.pose.orientation);
        self.doubles("translation", &[at.x, at.y, at.z]);
        self.doubles("quaternion_xyzw", &[turn.x, turn.y, turn.z, turn.w]);
        self.doubles("covariance", &pose.covariance);
    }

    fn status(&mut self, status: EstimatorStatus) {
        self.stamp(&status.header);
        self.whole("outcome", status.outcome.into());
        self.whole("track", status.track.into());
        self.whole("degrees_of_freedom", status.degrees_of_freedom.into());
        self.whole("iterations", status.iterations.into());
        self.whole("certificate", status.certificate.into());
        self.doubles("rms_px", &[status.rms_residual]);
        self.doubles("chi_squared", &[status.chi_squared]);
        self.doubles("ambiguity", &[status.ambiguity]);
        push(&mut self.words, "message", status.message);
        push(&mut self.words, "dominant_cause", status.dominant_cause);
        push(&mut self.ids, "used_ids", status.used_ids);
        push(&mut self.ids, "rejected_ids", status.rejected_ids);
    }

    fn odometry(&mut self, odometry: &Odometry) {
        self.stamp(&odometry.header);
        self.pose(&odometry.pose);
        let twist = &odometry.twist.twist;
        self.doubles("linear", &[twist.linear.x, twist.linear.y, twist.linear.z]);
        self.doubles(
            "angular",
            &[twist.angular.x, twist.angular.y, twist.angular.z],
        );
        self.doubles("twist_covariance", &odometry.twist.covariance);
    }

    /// Returns a dict of columns. A matrix of 36 numbers is (rows, 6, 6).
    fn columns(self, py: Python<'_>) -> PyResult<Bound<'_, PyDict>> {
        let columns = PyDict::new(py);
        let rows = self.stamps_ns.len();
        columns.set_item("stamp_ns", PyArray1::from_vec(py, self.stamps_ns))?;
        for (name, width, numbers) in self.numbers {
            if width == 1 {
                columns.set_item(name, PyArray1::from_vec(py, numbers))?;
                continue;
            }
            let array = Array2::from_shape_vec((rows, width), numbers).map_err(value_error)?;
            let array = PyArray2::from_owned_array(py, array);
            if width == 36 {
                columns.set_item(name, array.call_method1("reshape", (rows, 6, 6))?)?;
            } else {
                columns.set_item(name, array)?;
            }
        }
        for (name, values) in self.whole {
            columns.set_item(name, PyArray1::from_vec(py, values))?;
        }
        for (name, words) in self.words {
            columns.set_item(name, PyList::new(py, words)?)?;
        }
        for (name, ids) in self.ids {
            columns.set_item(name, PyList::new(py, ids)?)?;
        }
        Ok(columns)
    }
}

fn push<T>(columns: &mut Vec<(&'static str, Vec<T>)>, name: &'static str, value: T) {
    match columns.iter_mut().find(|(known, _)| *known == name) {
        Some((_, column)) => column.push(value),
        None => columns.push((name, vec![value])),
    }
}

/// Why there are no answers.
#[derive(Debug, thiserror::Error)]
enum ReplayError {
    #[error(transparent)]
    Arguments(#[from] ros2_node::arguments::ArgumentError),
    #[error(transparent)]
    Replay(#[from] Box<tanker_pose::replay::ReplayError>),
    #[error(transparent)]
    Open(#[from] tanker_pose::recording::OpenError),
    #[error(transparent)]
    Write(#[from] tanker_pose::recording::WriteError),
    #[error("the output {} is the recording itself", .0.display())]
    Same(PathBuf),
    #[error("cannot read the answers: {0}")]
    Damage(#[from] tanker_pose::recording::Damage),
    #[error("cannot read the answers: {0}")]
    Decode(#[from] tanker_pose::recording::DecodeError),
}

/// Answers a recording into an MCAP file; returns a dict of topics, each a dict of columns, and what was read.
#[pyfunction]
#[pyo3(signature = (recording, output, ros_arguments, answers_only))]
pub fn replay(
    py: Python<'_>,
    recording: PathBuf,
    output: PathBuf,
    ros_arguments: Vec<String>,
    answers_only: bool,
) -> PyResult<(Bound<'_, PyDict>, Bound<'_, PyDict>)> {
    let work = || answer(&recording, &output, &ros_arguments, answers_only);
    let (warnings, summary, tables) = py.detach(work).map_err(value_error)?;
    let topics = PyDict::new(py);
    for (name, table) in tables {
        topics.set_item(name, table.columns(py)?)?;
    }
    let read = PyDict::new(py);
    read.set_item("frames", summary.frames)?;
    read.set_item("messages", summary.messages)?;
    let outcomes = PyDict::new(py);
    for (name, count) in summary.outcomes {
        outcomes.set_item(name, count)?;
    }
    read.set_item("outcomes", outcomes)?;
    read.set_item("skipped", summary.skipped)?;
    read.set_item("notes", [warnings, summary.notes].concat())?;
    Ok((topics, read))
}

type Answers = (Vec<String>, Summary, Vec<(String, Table)>);

fn answer(
    recording: &std::path::Path,
    output: &std::path::Path,
    ros_arguments: &[String],
    answers_only: bool,
) -> Result<Answers, ReplayError> {
    let mut all = vec!["--ros-args".to_owned()];
    all.extend_from_slice(ros_arguments);
    let node = Replay::new(&Arguments::split(&all)?.0).map_err(Box::new)?;
    let warnings = node.warnings.clone();
    let source = Recording::open(recording)?;
    if is_within(output, recording) {
        return Err(ReplayError::Same(output.to_owned()));
    }
    let writer = Writer::create(output)?;
    let answered = node.answer(source, writer, !answers_only, |_, _| {});
    let summary = answered.map_err(Box::new)?;
    Ok((warnings, summary, tables(output)?))
}

/// Whether the output is the input, or a file of the bag that is the input.
fn is_within(output: &std::path::Path, input: &std::path::Path) -> bool {
    let (Ok(output), Ok(input)) = (output.canonicalize(), input.canonicalize()) else {
        return false;
    };
    output == input || (input.is_dir() && output.parent() == Some(&input))
}

/// Reads poses, tracks and status of a file.
fn tables(path: &std::path::Path) -> Result<Vec<(String, Table)>, ReplayError> {
    let mut tables: Vec<(String, Table)> = Vec::new();
    let recording = Recording::open(path)?;
    let (pose, odometry, status) = (
        type_name::<PoseWithCovarianceStamped>(),
        type_name::<Odometry>(),
        type_name::<EstimatorStatus>(),
    );
    for topic in recording.topics() {
        if [&pose, &odometry, &status].contains(&&topic.type_name) {
            tables.push((topic.name.clone(), Table::default()));
        }
    }
    for message in recording {
        let message = message?;
        let Some((_, table)) = tables.iter_mut().find(|(name, _)| message.is(name)) else {
            continue;
        };
        if message.topic.type_name == status {
            table.status(message.decode()?);
        } else if message.topic.type_name == odometry {
            table.odometry(&message.decode()?);
        } else {
            let pose: PoseWithCovarianceStamped = message.decode()?;
            table.stamp(&pose.header);
            table.pose(&pose.pose);
        }
    }
    Ok(tables)
}
