//! Words of a command line, and lines of `solve`.

use ros2_node::arguments::{ArgumentError, Arguments, Command, ParameterSource};
use ros2_node::parameters::ParameterValue;
use tanker_pose::answering::start::effective_parameters;
use tanker_pose::camera::Camera;
use tanker_pose::config::{self, Configuration};
use tanker_pose::estimation::Estimator;
use tanker_pose::pipeline::{self, Detection, FrameOutcome, ImageEdges, observe};
use tanker_pose::target::MarkerMap;

use super::files::{same, scalar};
use super::messages::{default_settings, paper_camera, seen_by};
use super::promises;
use super::solve_input::{InputFrame, InputPoint, not_an_object, reason};

/// A line that `solve` reads.
pub fn solve_line(bytes: &[u8]) {
    let _ = not_an_object(bytes);
    let frame: InputFrame = match serde_json::from_slice(bytes) {
        Ok(frame) => frame,
        Err(error) => {
            let words = reason(&error);
            assert!(words.len() < 1024, "{} bytes: {words}", words.len());
            return;
        }
    };
    let info = match frame
        .camera
        .as_ref()
        .map(super::solve_input::InputCamera::info)
    {
        Some(Ok(info)) => info,
        Some(Err(_)) => return,
        None => paper_camera(),
    };
    promises::camera(&info);
    let Ok(camera) = Camera::from_info(&info, false) else {
        return;
    };
    let detections: Vec<Detection> = frame.points.iter().map(InputPoint::detection).collect();
    let map = MarkerMap::shipped("paper").expect("a shipped map");
    let place = |id| {
        let point = frame.points.iter().find(|point| point.id == id)?;
        match (point.x, point.y, point.z) {
            (Some(x), Some(y), Some(z)) => Some(nalgebra::Point3::new(x, y, z)),
            _ => map.get(id),
        }
    };
    let outcome = match observe(&camera, &detections, 0.5, place) {
        Err(refusal) => FrameOutcome::refused(refusal),
        Ok(observations) => {
            let edges = ImageEdges::new(&info, &camera, false);
            let (observations, left_out) = edges.leave_out(observations, 3.0);
            let is_near = |value: &f64| value.abs() <= tanker_pose::target::MAX_COORDINATE_M;
            // As `solve` does, before it looks at pixels.
            if !observations
                .iter()
                .all(|seen| seen.marker_in_tanker.iter().all(is_near))
            {
                return;
            }
            let estimator = Estimator::new(default_settings().estimator);
            pipeline::solve(&estimator, &camera, &observations, None).without(left_out)
        }
    };
    promises::outcome(&outcome);
}

/// The words of a command line, one a line.
pub fn arguments(bytes: &[u8]) {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return;
    };
    let words: Vec<String> = text.split('\n').map(str::to_owned).collect();
    let found = match Command::parse(&words) {
        Ok(Command::Run(found)) => found,
        Ok(Command::Help | Command::Version) => return,
        Err(error) => return told(&error),
    };
    let written = written(&found);
    let Ok(Command::Run(again)) = Command::parse(&written) else {
        unreachable!("{written:?} is not read again")
    };
    assert_eq!(found.remaps, again.remaps);
    assert_eq!(found.log_levels, again.log_levels);
    assert_eq!(found.rosout_logs, again.rosout_logs);
    assert_eq!(found.console_logs, again.console_logs);
    assert_eq!(found.parameters.len(), again.parameters.len());
    for (a, b) in found.parameters.iter().zip(&again.parameters) {
        match (a, b) {
            (ParameterSource::Assignment(a), ParameterSource::Assignment(b)) => {
                assert_eq!((&a.node, &a.name), (&b.node, &b.name));
                assert!(same(a.value.as_ref(), b.value.as_ref()), "{a:?} {b:?}");
            }
            (a, b) => assert_eq!(a, b),
        }
    }
    start(found);
}

/// An error is one of words, and not the whole command line again.
fn told(error: &ArgumentError) {
    assert!(!error.to_string().is_empty());
}

fn written(arguments: &Arguments) -> Vec<String> {
    let mut words = vec!["--ros-args".to_owned()];
    let mut pair = |name: &str, value: String| words.extend([name.to_owned(), value]);
    for rule in &arguments.remaps {
        let node = rule
            .node_name
            .as_ref()
            .map_or_else(String::new, |node| format!("{node}:"));
        pair("-r", format!("{node}{}:={}", rule.from, rule.to));
    }
    for source in &arguments.parameters {
        match source {
            ParameterSource::File(path) => pair("--params-file", path.display().to_string()),
            ParameterSource::Assignment(given) => {
                let node = given
                    .node
                    .as_ref()
                    .map_or_else(String::new, |node| format!("{node}:"));
                let value = scalar(given.value.as_ref());
                pair("-p", format!("{node}{}:={value}", given.name));
            }
        }
    }
    for (logger, level) in &arguments.log_levels {
        let logger = logger
            .as_ref()
            .map_or_else(String::new, |logger| format!("{logger}:="));
        pair(
            "--log-level",
            format!("{logger}{level}")
                .to_lowercase()
                .replace("off", "unset"),
        );
    }
    let switches = [
        (arguments.rosout_logs, "rosout"),
        (arguments.console_logs, "stdout"),
    ];
    for (_, name) in switches.iter().filter(|(on, _)| !on) {
        words.push(format!("--disable-{name}-logs"));
    }
    words
}

/// Starts a node with these arguments, without the files that they name.
fn start(mut arguments: Arguments) {
    let is_given = |source: &ParameterSource| matches!(source, ParameterSource::Assignment(_));
    arguments.parameters.retain(is_given);
    let Ok((names, start)) = effective_parameters(&arguments) else {
        return;
    };
    assert!(names.fully_qualified().starts_with('/'));
    for (name, value) in start.parameters.iter() {
        if let ParameterValue::Double(number) = value {
            assert!(number.is_finite(), "{name}: {number}");
        }
    }
    if config::check_together(&start.parameters).is_ok() {
        seen_by(
            &paper_camera(),
            Configuration::from(&start.parameters).settings,
        );
    }
}
