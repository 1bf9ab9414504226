//! What every decoder of `tanker_pose` must do with any bytes: not panic, and keep what its checked types promise.
//!
//! Each target is a function of bytes that panics where a promise is broken. libFuzzer drives them
//! (`fuzz_targets/`), and `tests/fuzzed_inputs.rs` does so with seeded mutants on every run of the tests.
//!
//! ```text
//! messages        CDR of every message type; those of inputs through conversion and pipeline
//! files           parameter files, marker maps, cameras, budgets, refuelling setups
//! words           ROS arguments, lines of `solve`
//! recordings      MCAP and SQLite, and both answered as the node answers
//! promises        what holds for a pose, a camera, a map
//! ```

mod files;
mod messages;
mod promises;
mod recordings;
mod scratch;
#[path = "../../src/bin/tanker_pose/solve/input.rs"]
#[allow(dead_code, missing_docs, unreachable_pub)] // the tool uses all of it
mod solve_input;
mod words;

/// A decoder and its promises.
pub struct Target {
    /// Name of the target, of libFuzzer's program and of the folder with its seeds.
    pub name: &'static str,
    /// Panics where a promise is broken.
    pub run: fn(&[u8]),
}

/// All targets.
pub const TARGETS: [Target; 10] = [
    target("cdr", messages::cdr),
    target("parameter_file", files::parameter_file),
    target("marker_map", files::marker_map),
    target("camera_file", files::camera_file),
    target("calibration_budget", files::calibration_budget),
    target("refuelling_setup", files::refuelling_setup),
    target("solve_line", words::solve_line),
    target("arguments", words::arguments),
    target("recording", recordings::recording),
    target("replay", recordings::replay),
];

const fn target(name: &'static str, run: fn(&[u8])) -> Target {
    Target { name, run }
}

/// Runs one target.
///
/// # Panics
/// Where a promise is broken, or no target has this name.
pub fn run(name: &str, bytes: &[u8]) {
    let found = TARGETS.iter().find(|target| target.name == name);
    let target = found.expect("a name of TARGETS");
    (target.run)(bytes);
}
