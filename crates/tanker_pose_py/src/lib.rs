//! The estimator for Python: numpy arrays in, numpy arrays out, without ROS.
//!
//! ```text
//! errors, arrays            exceptions; arrays of Python as slices
//! parameters                keyword arguments, checked as the node's parameters
//! camera, markers, budget   checked inputs, from files and dicts
//! inputs                    the detections of a frame, from rows of arrays
//! record                    an outcome as the bytes of one element of a structured array
//! frame, motion             an outcome, and the track's motion, as objects
//! estimator                 one frame, or many on all cores
//! pipeline                  frame by frame, with the track
//! replay                    a recording, its answers as columns
//! ```
//!
//! Every pose comes from `tanker_pose::pipeline`, as in the node. The public names, their shapes and their frames are in
//! `python/tanker_pose_estimator`.

#![expect(clippy::doc_markdown, reason = "docstrings are read in Python")]
#![expect(
    clippy::needless_pass_by_value,
    reason = "what Python passes is extracted by value"
)]

mod arrays;
mod budget;
mod camera;
mod errors;
mod estimator;
mod frame;
mod inputs;
mod markers;
mod motion;
mod parameters;
mod pipeline;
mod record;
mod replay;

use pyo3::prelude::*;
use tanker_pose::pipeline::{OutcomeCode, TrackCode};

/// Runs the tools' command line in this process; returns the exit code.
#[pyfunction]
fn run_tool(py: Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    py.detach(|| tanker_pose_tools::run(arguments))
}

/// Names with numbers of one enum.
type Codes = Vec<(&'static str, u8)>;

/// Names and numbers of the outcomes, and of the effects on the track, as the node's status has them.
#[pyfunction]
fn codes() -> (Codes, Codes) {
    (
        OutcomeCode::ALL
            .map(|code| (code.name(), code.number()))
            .to_vec(),
        TrackCode::ALL
            .map(|code| (code.name(), code.number()))
            .to_vec(),
    )
}

#[pymodule]
fn _native(module: &Bound<'_, PyModule>) -> PyResult<()> {
    module.add(
        "RefusalError",
        module.py().get_type::<errors::RefusalError>(),
    )?;
    module.add_class::<camera::PyCamera>()?;
    module.add_class::<budget::PyBudget>()?;
    module.add_class::<markers::PyMarkerMap>()?;
    module.add_class::<estimator::PyEstimator>()?;
    module.add_class::<frame::Frame>()?;
    module.add_class::<motion::PyMotion>()?;
    module.add_class::<pipeline::PyPipeline>()?;
    module.add_function(wrap_pyfunction!(replay::replay, module)?)?;
    module.add_function(wrap_pyfunction!(run_tool, module)?)?;
    module.add_function(wrap_pyfunction!(codes, module)?)
}
