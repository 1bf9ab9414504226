//! `tanker_pose replay`, run as a program on whole and on damaged recordings.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

use tanker_pose::messages::{
    CameraInfo, EstimatorStatus, FeaturePointArray, Odometry, PoseWithCovarianceStamped,
};
use tanker_pose::recording::{RecordedMessage, Recording, Writer, cdr};

const FRAMES: usize = 100;

/// A folder of its own, removed at the end.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("replay_{name}_{}", std::process::id()));
        let _ = std::fs::remove_dir_all(&path);
        std::fs::create_dir_all(&path).expect("the directory for temporary files is writable");
        Self(path)
    }

    fn path(&self, name: &str) -> PathBuf {
        self.0.join(name)
    }

    /// Writes an approach of [`FRAMES`] frames, in one chunk.
    fn approach(&self) -> PathBuf {
        self.simulated("4", "25")
    }

    /// Writes an approach of 6000 frames, in several chunks.
    fn long_approach(&self) -> PathBuf {
        self.simulated("120", "50")
    }

    fn simulated(&self, duration_s: &str, rate_hz: &str) -> PathBuf {
        let path = self.path("approach.mcap");
        let options = [
            "simulate",
            "--duration-s",
            duration_s,
            "--rate-hz",
            rate_hz,
            "--bag",
        ];
        let output = tool(&options, &[&path]);
        assert!(output.status.success(), "{output:?}");
        path
    }

    /// Returns the recording rewritten: what becomes of each message, in their order.
    fn rewritten(
        &self,
        from: &Path,
        change: impl Fn(RecordedMessage) -> Vec<RecordedMessage>,
    ) -> PathBuf {
        let path = self.path("rewritten.mcap");
        let mut writer = Writer::create(&path).expect("the folder is writable");
        for message in messages(from).into_iter().flat_map(change) {
            let channel = writer.channel(&message.topic).expect("writable");
            let time_ns = message.log_time_ns;
            writer
                .write(channel, time_ns, time_ns, &message.bytes)
                .expect("writable");
        }
        writer.finish().expect("writable");
        path
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn tool(options: &[&str], paths: &[&Path]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_tanker_pose"))
        .args(options)
        .args(paths)
        .output()
        .expect("the tool starts")
}

/// What a replay printed, its exit code, and the answers.
struct Replayed {
    code: i32,
    words: String,
    output: PathBuf,
}

impl Replayed {
    fn of(scratch: &Scratch, recording: &Path, ros_arguments: &[&str]) -> Self {
        let output = scratch.path("answers.mcap");
        let _ = std::fs::remove_file(&output);
        let run = Command::new(env!("CARGO_BIN_EXE_tanker_pose"))
            .args(["replay", "-o"])
            .args([&output, recording])
            .arg("--ros-args")
            .args(ros_arguments)
            .output()
            .expect("the tool starts");
        let words = String::from_utf8_lossy(&run.stderr) + String::from_utf8_lossy(&run.stdout);
        Self {
            code: run.status.code().expect("it ends by itself"),
            words: words.into_owned(),
            output,
        }
    }

    fn statuses(&self) -> Vec<EstimatorStatus> {
        let all = messages(&self.output).into_iter();
        all.filter(|message| message.is("/status"))
            .map(|message| message.decode().expect("a status"))
            .collect()
    }

    fn count(&self, topic: &str) -> usize {
        let all = messages(&self.output).into_iter();
        all.filter(|message| message.is(topic)).count()
    }
}

fn messages(path: &Path) -> Vec<RecordedMessage> {
    Recording::open(path)
        .expect("it can be opened")
        .map(|item| item.expect("it is whole"))
        .collect()
}

#[test]
fn every_frame_is_answered_beside_the_inputs_and_twice_gives_the_same_bytes() {
    let scratch = Scratch::new("whole");
    let approach = scratch.approach();
    let found = Replayed::of(&scratch, &approach, &["-p", "publish_tf:=true"]);
    assert_eq!(found.code, 0, "{}", found.words);
    assert_eq!(found.statuses().len(), FRAMES);
    for topic in ["/feature_points", "/camera_info", "/truth", "/status"] {
        assert_eq!(found.count(topic), FRAMES, "{topic}");
    }
    assert_eq!(found.count("/pose"), found.count("/tf"));
    assert!(found.count("/pose") > FRAMES * 9 / 10, "{}", found.words);
    let answers = messages(&found.output);
    assert!(answers.is_sorted_by_key(|message| message.log_time_ns));
    let of = |topic: &'static str| answers.iter().filter(move |message| message.is(topic));
    for (message, input) in of("/status").zip(of("/feature_points")) {
        assert_eq!(message.log_time_ns, input.log_time_ns);
        let status: EstimatorStatus = message.decode().expect("a status");
        assert_eq!(
            status.solve_time,
            tanker_pose::messages::Duration::default()
        );
    }
    for message in of("/pose") {
        let _: PoseWithCovarianceStamped = message.decode().expect("a pose");
    }
    assert!(of("/odometry").count() > FRAMES / 2);
    let _: Odometry = of("/odometry")
        .next_back()
        .expect("some")
        .decode()
        .expect("odometry");
    // One report a second, and the last one.
    assert_eq!(of("/diagnostics").count(), 4);

    let bytes = std::fs::read(&found.output).expect("it was written");
    let again = Replayed::of(&scratch, &approach, &["-p", "publish_tf:=true"]);
    assert!(bytes == std::fs::read(&again.output).expect("it was written"));
}

#[test]
fn names_and_parameters_are_the_nodes() {
    let scratch = Scratch::new("names");
    let approach = scratch.approach();
    let moved = scratch.rewritten(&approach, |mut message| {
        let topic = std::sync::Arc::make_mut(&mut message.topic);
        topic.name = format!("/left{}", topic.name);
        vec![message]
    });
    let missed = Replayed::of(&scratch, &moved, &[]);
    assert_eq!(missed.code, 2, "{}", missed.words);
    assert!(
        missed
            .words
            .contains("-r /feature_points:=/left/feature_points"),
        "{}",
        missed.words
    );
    for arguments in [
        &["-r", "__ns:=/left"][..],
        &[
            "-r",
            "feature_points:=/left/feature_points",
            "-r",
            "camera_info:=left/camera_info",
        ],
    ] {
        let found = Replayed::of(&scratch, &moved, arguments);
        assert_eq!(found.code, 0, "{}", found.words);
        assert_eq!(found.words.matches(&format!("{FRAMES} frames")).count(), 1);
    }
    let refused = Replayed::of(&scratch, &approach, &["-p", "min_point:=5"]);
    assert_eq!(refused.code, 2);
    assert!(refused.words.contains("min_points"), "{}", refused.words);
    let few = Replayed::of(&scratch, &approach, &["-p", "min_points:=100"]);
    assert_eq!((few.code, few.count("/pose")), (0, 0), "{}", few.words);
    assert!(few.words.contains("TOO_FEW_POINTS 100"), "{}", few.words);
}

#[test]
fn cut_recording_is_answered_up_to_its_cut() {
    let scratch = Scratch::new("cut");
    let approach = scratch.long_approach();
    let whole = std::fs::read(&approach).expect("it was written");
    let cut = scratch.path("cut.mcap");
    std::fs::write(&cut, &whole[..whole.len() / 2]).expect("the folder is writable");
    let found = Replayed::of(&scratch, &cut, &[]);
    assert_eq!(found.code, 1, "{}", found.words);
    assert!(found.words.contains("cut off"), "{}", found.words);
    let answers = found.statuses();
    assert!((1000..6000).contains(&answers.len()), "{}", answers.len());

    // What is read gives the same answers as of the whole recording.
    let of_whole = Replayed::of(&scratch, &approach, &[]).statuses();
    assert_eq!(of_whole.len(), 6000);
    for (found, expected) in answers.iter().zip(&of_whole) {
        // NaN is not itself.
        assert_eq!(format!("{found:?}"), format!("{expected:?}"));
    }
}

#[test]
fn damaged_chunk_is_named_and_the_frames_around_it_are_answered() {
    let scratch = Scratch::new("chunk");
    let path = scratch.long_approach();
    let mut content = std::fs::read(&path).expect("it was written");
    let middle = content.len() / 2;
    content[middle] ^= 0xff;
    std::fs::write(&path, &content).expect("the folder is writable");
    let found = Replayed::of(&scratch, &path, &[]);
    assert_eq!(found.code, 1, "{}", found.words);
    assert!(found.words.contains("the chunk at byte"), "{}", found.words);
    let count = found.statuses().len();
    assert!((1000..6000).contains(&count), "{count}");
}

/// Detections in every other second get a pixel that is no number.
fn without_numbers_in_odd_seconds(mut message: RecordedMessage) -> Vec<RecordedMessage> {
    if message.is("/feature_points") {
        let mut points: FeaturePointArray = message.decode().expect("detections");
        if points.header.stamp.sec % 2 == 1 {
            points.points[0].u = f64::NAN;
            message.bytes = cdr::encode(&points).expect("a message of ROS");
        }
    }
    vec![message]
}

#[test]
fn frames_without_numbers_are_refused_and_those_around_them_are_answered() {
    let scratch = Scratch::new("nan");
    let approach = scratch.approach();
    let nan = scratch.rewritten(&approach, without_numbers_in_odd_seconds);
    let found = Replayed::of(&scratch, &nan, &[]);
    assert_eq!(found.code, 0, "{}", found.words);
    assert!(found.words.contains("NOT_FINITE 50"), "{}", found.words);
    assert!(found.words.contains("OK 50"), "{}", found.words);
}

#[test]
fn undecodable_messages_are_counted_and_the_others_are_answered() {
    let scratch = Scratch::new("undecodable");
    let approach = scratch.approach();
    let short = scratch.rewritten(&approach, |mut message| {
        if message.is("/feature_points") && message.log_time_ns.is_multiple_of(1_000_000_000) {
            message.bytes.truncate(30);
        }
        vec![message]
    });
    let found = Replayed::of(&scratch, &short, &[]);
    assert_eq!(found.code, 1, "{}", found.words);
    assert!(
        found
            .words
            .contains("4 message(s) on /feature_points cannot be decoded"),
        "{}",
        found.words
    );
    assert_eq!(found.statuses().len(), FRAMES - 4);
}

#[test]
fn two_cameras_on_one_topic_are_named_and_each_frame_has_the_last_camera_info() {
    let scratch = Scratch::new("cameras");
    let approach = scratch.approach();
    let two = scratch.rewritten(&approach, |message| {
        let mut other = message.clone();
        if message.is("/camera_info") {
            let mut info: CameraInfo = message.decode().expect("a camera info");
            info.header.frame_id = "right".to_owned();
            other.bytes = cdr::encode(&info).expect("a message of ROS");
            vec![message, other]
        } else if message.is("/feature_points") {
            let mut points: FeaturePointArray = message.decode().expect("detections");
            points.header.frame_id = "right".to_owned();
            other.bytes = cdr::encode(&points).expect("a message of ROS");
            vec![message, other]
        } else {
            vec![]
        }
    });
    let found = Replayed::of(&scratch, &two, &[]);
    assert_eq!(found.code, 0, "{}", found.words);
    assert!(found.words.contains("of 2 cameras"), "{}", found.words);
    assert!(
        found.words.contains("FRAME_MISMATCH 100"),
        "{}",
        found.words
    );
    assert_eq!(found.statuses().len(), 2 * FRAMES);
}

#[test]
fn empty_recordings_and_those_without_an_input_say_what_is_missing() {
    let scratch = Scratch::new("empty");
    let approach = scratch.approach();
    let empty = scratch.rewritten(&approach, |_| vec![]);
    let found = Replayed::of(&scratch, &empty, &[]);
    assert_eq!(found.code, 2, "{}", found.words);
    assert!(found.words.contains("has no messages"), "{}", found.words);
    assert_eq!(messages(&found.output), []);

    let blind = scratch.rewritten(&approach, |message| {
        let is_kept = !message.is("/camera_info");
        is_kept.then_some(message).into_iter().collect()
    });
    let found = Replayed::of(&scratch, &blind, &[]);
    assert_eq!(found.code, 1, "{}", found.words);
    assert!(
        found.words.contains("no message on /camera_info"),
        "{}",
        found.words
    );
    assert!(
        found.words.contains("NO_CAMERA_INFO 100"),
        "{}",
        found.words
    );

    let found = Replayed::of(&scratch, &scratch.path("gone"), &[]);
    assert_eq!(found.code, 2, "{}", found.words);
    let same = tool(&["replay"], &[&approach, Path::new("-o"), &approach]);
    assert_eq!(same.status.code(), Some(2));
    assert_eq!(
        messages(&approach).len(),
        3 * FRAMES,
        "the recording is untouched"
    );
}

#[test]
fn topics_of_another_type_or_definition_are_named_and_not_decoded() {
    let scratch = Scratch::new("types");
    let approach = scratch.approach();
    let other = scratch.rewritten(&approach, |mut message| {
        if message.is("/feature_points") {
            let topic = std::sync::Arc::make_mut(&mut message.topic);
            let definition = topic.definition.as_mut().expect("it is embedded");
            let text = String::from_utf8_lossy(&definition.text);
            definition.text = text.replace("float64 v ", "float32 v ").into_bytes();
        }
        vec![message]
    });
    let found = Replayed::of(&scratch, &other, &[]);
    assert_eq!(found.code, 2, "{}", found.words);
    assert!(found.words.contains("float32 v"), "{}", found.words);
}

#[test]
fn warnings_beyond_the_first_twenty_are_counted() {
    let scratch = Scratch::new("warnings");
    let approach = scratch.simulated("240", "1");
    // Every other frame has no number; a fault that comes back is said again after some seconds, here forty times.
    let blinking = scratch.rewritten(&approach, without_numbers_in_odd_seconds);
    let found = Replayed::of(&scratch, &blinking, &[]);
    let lines = found.words.lines();
    let printed = lines.filter(|line| line.starts_with("tanker_pose: warning: "));
    assert_eq!(printed.count(), 20, "{}", found.words);
    let rest = "20 more warnings; the statuses in ";
    assert!(found.words.contains(rest), "{}", found.words);
}
