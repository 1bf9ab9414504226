//! Recordings: read to the end, and answered as the node answers its topics.

use ros2_node::arguments::Arguments;
use tanker_pose::geometry::PoseCovariance;
use tanker_pose::messages;
use tanker_pose::recording::{RecordedMessage, Recording, Writer, type_name};
use tanker_pose::replay::Replay;

use super::{messages::decoded, promises, scratch};

/// Most items of a recording by its size: a message takes 31 bytes of a chunk, zstd turns 4 bytes into 2¹⁷ at most, and
/// damages are fewer than messages.
const ITEMS_PER_BYTE: usize = (1 << 17) / 4 / 31;

/// A recording is read to its end in bounded steps, however damaged.
pub fn recording(bytes: &[u8]) {
    let path = scratch::file("recording", bytes);
    let recording = match Recording::open(&path) {
        Ok(recording) => recording,
        Err(error) => {
            let words = error.to_string();
            assert!(!words.contains('\n') && words.len() < 4096, "{words:?}");
            return;
        }
    };
    let most = 64 + ITEMS_PER_BYTE * bytes.len();
    let (mut last_ns, mut is_damaged, mut is_ordered) = (0, false, true);
    for (count, item) in recording.enumerate() {
        assert!(
            count < most,
            "more than {most} items in {} bytes",
            bytes.len()
        );
        match item {
            Ok(message) => {
                is_ordered &= message.log_time_ns >= last_ns;
                last_ns = message.log_time_ns;
                known(&message);
            }
            Err(damage) => {
                is_damaged = true;
                let words = damage.to_string();
                assert!(words.len() < 4096, "{words:?}");
            }
        }
    }
    assert!(
        is_ordered || is_damaged,
        "out of order without a word about damage"
    );
}

/// Messages of known types keep what they say.
fn known(message: &RecordedMessage) {
    macro_rules! check {
        ($($name:ident)+) => {$(
            if message.topic.type_name == type_name::<messages::$name>() {
                let _ = decoded::<messages::$name>(&message.bytes);
            }
        )+};
    }
    check!(FeaturePointArray Detection2DArray AprilTagDetectionArray CameraInfo Imu VehicleAttitude Header);
}

/// The answers to a recording are a whole recording, with poses that can be used.
pub fn replay(bytes: &[u8]) {
    let path = scratch::file("inputs", bytes);
    let Ok(recording) = Recording::open(&path) else {
        return;
    };
    let node = Replay::new(&Arguments::default()).expect("the node without arguments");
    let answers = scratch::path("answers.mcap");
    let writer = Writer::create(&answers).expect("the directory for temporary files is writable");
    let summary = node.answer(recording, writer, true, |_, _| {});
    let summary = summary.expect("answers can be written");
    let outcomes: u64 = summary.outcomes.iter().map(|(_, count)| count).sum();
    assert_eq!(outcomes, summary.frames, "a frame without an answer");
    // Reading is done by a thread of its own.
    let has_failed = |words: &String| words.contains("reading thread failed");
    assert!(
        !summary.skipped.iter().any(has_failed),
        "{:?}",
        summary.skipped
    );
    let (mut statuses, mut last_ns) = (0, 0);
    for item in Recording::open(&answers).expect("answers can be read") {
        let message = item.expect("answers are whole");
        assert!(message.log_time_ns >= last_ns);
        last_ns = message.log_time_ns;
        if message.is("/pose")
            && message.topic.type_name == type_name::<messages::PoseWithCovarianceStamped>()
        {
            let pose: messages::PoseWithCovarianceStamped = message.decode().expect("our pose");
            let p = &pose.pose.pose.position;
            assert!([p.x, p.y, p.z].iter().all(|value| value.is_finite()));
            let covariance = nalgebra::Matrix6::from_row_slice(&pose.pose.covariance);
            promises::covariance(&PoseCovariance(covariance));
        }
        statuses += u64::from(message.is("/status"));
    }
    assert_eq!(statuses, summary.frames, "a frame without a status");
}
