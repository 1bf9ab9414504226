//! What the same file takes when it is only read and decoded, by the library of its format.

use std::fs::File;
use std::hint::black_box;
use std::io::BufReader;
use std::path::Path;
use std::time::{Duration, Instant};

use tanker_pose::messages::{CameraInfo, FeaturePointArray};
use tanker_pose::recording::cdr;

/// Returns in words how long an answer took, and how that compares.
///
/// # Errors
/// In words: the recording is no single MCAP file, or is damaged.
pub fn compare(path: &Path, frames: u64, taken: Duration) -> Result<String, String> {
    let begin = Instant::now();
    let messages = read(path)?;
    let read = begin.elapsed();
    let (taken_s, read_s) = (taken.as_secs_f64(), read.as_secs_f64());
    let ratio = taken_s / read_s.max(1e-9);
    let rate = frames as f64 / taken_s.max(1e-9);
    Ok(format!(
        "{taken_s:.3} s for {frames} frames, {rate:.0} frames/s; only reading and decoding {messages} messages: {read_s:.3} s; ratio \
         {ratio:.2}"
    ))
}

/// Reads a file from its start to its end, and decodes detections and camera infos.
fn read(path: &Path) -> Result<u64, String> {
    let file = File::open(path).map_err(|error| error.to_string())?;
    let reader = mcap::io::MessageReader::new(BufReader::with_capacity(1 << 20, file));
    let mut count = 0;
    for message in reader {
        let message = message.map_err(|error| error.to_string())?;
        count += 1;
        let schema = message.channel.schema.as_ref();
        match schema.map(|schema| schema.name.as_str()) {
            Some("tanker_pose/msg/FeaturePointArray") => {
                let found: Result<FeaturePointArray, _> = cdr::decode(&message.data);
                black_box(found.map_err(|error| error.to_string())?);
            }
            Some("sensor_msgs/msg/CameraInfo") => {
                let found: Result<CameraInfo, _> = cdr::decode(&message.data);
                black_box(found.map_err(|error| error.to_string())?);
            }
            _ => {}
        }
    }
    Ok(count)
}
